"""A described robot is found in a MuJoCo model by its names, and what contradicts it is told with its size."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

import wbc
from wbc.base.errors import InputError, ModelError
from wbc.sim.plant.places import RobotPlaces, body_frame

BIPED = (Path(__file__).parents[2] / "examples" / "biped.xml").read_text(encoding="utf-8")
DESCRIPTION = wbc.RobotDescription.from_mjcf(BIPED)
GYRO, FORCE = mujoco.mjtSensor.mjSENS_GYRO, mujoco.mjtSensor.mjSENS_ACCELEROMETER


def made(change: Callable[[mujoco.MjSpec], None] = lambda spec: None) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_string(BIPED)
    change(spec)
    return spec.compile()


def places_of(change: Callable[[mujoco.MjSpec], None] = lambda spec: None) -> RobotPlaces:
    return RobotPlaces(made(change), DESCRIPTION.robot())


@pytest.mark.parametrize("offset", [0.0019, 0.0021, 0.0337])
def test_a_joint_that_is_elsewhere_is_told_from_two_millimetres_on(offset: float) -> None:
    def move(spec: mujoco.MjSpec) -> None:
        joint = spec.joint("left_hip_roll")
        joint.pos = joint.pos + [0.0, 0.6 * offset, 0.8 * offset]

    if offset < 0.002:
        places_of(move)
    else:
        with pytest.raises(ModelError, match=rf"^joint 'left_hip_roll' is {1e3 * offset:.1f} mm off in the"):
            places_of(move)


@pytest.mark.parametrize("angle", [0.009, 0.011, 0.3, np.pi - 0.3, np.pi - 0.011, np.pi - 0.009])
def test_an_axis_that_is_off_is_told_in_degrees_and_one_that_is_reversed_as_such(angle: float) -> None:
    def turn(spec: mujoco.MjSpec) -> None:
        joint = spec.joint("left_knee")
        axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
        beside = np.cross(axis, [1.0, 0.0, 0.0])
        joint.axis = np.cos(angle) * axis + np.sin(angle) * beside / np.linalg.norm(beside)

    if angle < 0.01:
        places_of(turn)
        return
    told = (
        "'left_knee' turns the other way"
        if np.pi - angle < 0.01
        else f"axis of joint 'left_knee' is {np.degrees(angle):.1f}° off"
    )
    with pytest.raises(ModelError, match=told):
        places_of(turn)


def test_what_a_plain_model_has_and_lacks() -> None:
    """Joints in the robot's order, a base in front of them, and errors by name."""
    places, robot = places_of(), DESCRIPTION.robot()
    model = places.model
    assert [model.joint(i).name for i in places.joints] == list(robot.joint_names)
    assert places.joint_qpos.tolist() == [model.joint(n).qposadr[0] for n in robot.joint_names]
    assert places.joint_dof.tolist() == [model.joint(n).dofadr[0] for n in robot.joint_names]
    assert [model.body(i).name for i in np.flatnonzero(places.of_robot)] == [
        model.body(i).name for i in range(1, model.nbody)
    ]
    with pytest.raises(InputError, match="left_knie"):
        RobotPlaces(model, robot, {"left_knie": "left_knee"})
    with pytest.raises(InputError, match="joint 'knee' of the MuJoCo model"):
        RobotPlaces(model, robot, {"left_knee": "knee"})

    def fixed(spec: mujoco.MjSpec) -> None:
        for key in list(spec.keys):
            spec.delete(key)
        spec.delete(next(j for j in spec.joints if j.type == mujoco.mjtJoint.mjJNT_FREE))

    with pytest.raises(ModelError, match="of the robot must have a free joint"):
        places_of(fixed)
    data = mujoco.MjData(model)
    data.qvel[:] = 1.0
    places.set_at_rest(data.qvel)
    assert not data.qvel.any()
    q = robot.half_sitting.copy()
    q[:3] = 1.0, 2.0, 3.0
    q[3:7] = 0.1, 0.2, 0.3, np.sqrt(1.0 - 0.14)
    places.set_configuration(q, data.qpos)
    assert data.qpos[:7] == pytest.approx([*q[:3], q[6], *q[3:6]])
    assert data.qpos[places.joint_qpos] == pytest.approx(q[7:])


def test_names_of_bodies_stand_for_frames() -> None:
    robot = DESCRIPTION.robot()
    assert body_frame("torso", robot) in {robot.torso_frame, "torso"}
    assert body_frame("base", robot) in {robot.base_frame, "base"}
    assert body_frame(robot.soles[0].frame, robot) == robot.soles[0].frame
    with pytest.raises(InputError, match="universo"):
        body_frame("universo", robot)


def with_sensors(*at: tuple[str, str, float]) -> Callable[[mujoco.MjSpec], None]:
    """Gyroscopes on sites of bodies, so far from their frames along x, m."""

    def add(spec: mujoco.MjSpec) -> None:
        for name, body, away in at:
            site = f"site_{name}"
            spec.body(body).add_site(name=site, pos=[away, 0.0, 0.0])
            spec.add_sensor(name=name, type=GYRO, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site)

    return add


def test_the_nearest_sensor_of_the_imus_body_is_taken_or_the_one_that_is_named() -> None:
    plain = places_of()
    own, other = plain.model.body(plain.imu_body).name, plain.model.body(plain.feet[0]).name
    places = places_of(with_sensors(("far", own, 0.5), ("foot", other, 0.0)))
    model, address = places.model, lambda name: int(model.sensor(name).adr[0])
    found = places.sensor("a gyroscope", GYRO, None)
    assert found is not None
    numbers = [i for i in range(model.nsensor) if model.sensor_type[i] == GYRO]
    assert found[0] == int(model.sensor_adr[numbers[0]]) and len(numbers) == 3
    named = places.sensor("a gyroscope", GYRO, "far")
    assert named is not None and named[0] == address("far")
    with pytest.raises(InputError, match=f"'foot' is fixed to body '{other}'.*to '{own}'"):
        places.sensor("a gyroscope", GYRO, "foot")
    with pytest.raises(InputError, match="sensor 'far' must be an accelerometer, it is mjSENS_GYRO"):
        places.sensor("an accelerometer", FORCE, "far")
    with pytest.raises(InputError, match="sensor 'fare' of the MuJoCo model"):
        places.sensor("a gyroscope", GYRO, "fare")
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
    assert places.sensor("a gyroscope", GYRO, None) is None
    with pytest.raises(InputError, match="reads zero"):
        places.sensor("a gyroscope", GYRO, "far")


def test_a_sensor_that_is_turned_has_its_rotation_to_the_imu_frame() -> None:
    def add(spec: mujoco.MjSpec) -> None:
        half = 0.5 * 0.4
        body = spec.body(made().body(places_of().imu_body).name)
        body.add_site(name="turned", quat=[np.cos(half), 0.0, 0.0, np.sin(half)])
        spec.add_sensor(name="turned", type=GYRO, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="turned")

    places = places_of(add)
    found = places.sensor("a gyroscope", GYRO, "turned")
    assert found is not None and found[1] is not None
    turn = np.array([[np.cos(0.4), -np.sin(0.4), 0.0], [np.sin(0.4), np.cos(0.4), 0.0], [0.0, 0.0, 1.0]])
    assert found[1] == pytest.approx(places.imu.rotation.T @ turn, abs=1e-9)
