"""A robot in somebody else's MuJoCo model: driven, measured and told apart from everything else in it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from foreign import KINDS, foreign_model
from properties import by_default

import wbc
from wbc import Command
from wbc.base.errors import InputError, MeasurementError, ModelError, UnknownNameError
from wbc.core.robot import GRAVITY
from wbc.robots import RobotDescription
from wbc.sim import MujocoLoop, PhysicsSettings, Plant
from wbc.sim.foreign.notes import friction_under
from wbc.sim.simulation.simulation import lowest_sole_point

DESCRIPTION = wbc.load_robot("hrp4_class")
MASS = DESCRIPTION.robot().mass
PREFIX = "mine/"
EXAMPLES = Path(__file__).parents[2] / "examples"


def stand(loop: MujocoLoop, seconds: float, mode: str) -> float:
    """Stand and return how far the true centre of mass has moved, mm."""
    controller = wbc.balance_controller(DESCRIPTION.robot(), loop.control_period)
    control: wbc.PositionControl | wbc.TorqueControl = (
        wbc.PositionControl(controller, feedback="closed")
        if mode == "position"
        else wbc.TorqueControl(controller)
    )
    start = loop.truth().com
    while loop.time < seconds:
        loop.step(control.command(loop.measure()))
    assert control.failures == 0 and control.status() == "ok"
    return 1e3 * float(abs(loop.truth().com - start).max())


@pytest.mark.parametrize("kind", ["plant", "loop"])
def test_contact_forces_in_the_data_are_those_of_the_truth_or_none(kind: str) -> None:
    """A robot comes down on its toes and back: contacts come and go between ticks, and `mj_contactForce` reads them.

    Those of the truth are of the last step: they agree with the wrenches of the soles.
    """
    if kind == "plant":
        plant: Plant | MujocoLoop = Plant("hrp4_class", control_period=0.002, visuals=False)
    else:
        plant = MujocoLoop(DESCRIPTION, foreign_model(DESCRIPTION, "motor"), prefix=PREFIX)
    control = wbc.TorqueControl(wbc.balance_controller(DESCRIPTION.robot(), plant.control_period))
    com, force, numbers, known = control.controller.task("com"), np.zeros(6), set(), 0
    com.move_to(com.target + [0.05, 0.06, 0.0], duration=0.25)
    model, data = plant.model, plant.data
    while plant.time < 0.25:
        plant.step(control.command(plant.measure()))
        truth, total = plant.truth(), 0.0
        feet = truth.contact_force[truth.contact_sole >= 0, 2].sum()
        assert feet == pytest.approx(truth.sole_wrench[:, 2].sum(), abs=20.0)
        for i in range(data.ncon):
            if not plant.places.of_robot[model.geom_bodyid[data.contact.geom[i]]].any():
                continue
            mujoco.mj_contactForce(model, data, i, force)
            total += (data.contact.frame[i].reshape(3, 3).T @ force[:3])[2]
        numbers.add(data.ncon)
        known += np.isfinite(total)
        if np.isfinite(total):
            assert total == pytest.approx(truth.contact_force[:, 2].sum(), abs=1e-6)
    assert len(numbers) > 1 and known == (0 if kind == "plant" else 125)


@pytest.mark.parametrize(
    ("dimensions", "cone"),
    [(1, "PYRAMIDAL"), (3, "ELLIPTIC"), (4, "PYRAMIDAL"), (6, "PYRAMIDAL"), (6, "ELLIPTIC")],
)
def test_wrenches_of_soles_are_those_of_mujocos_contacts(dimensions: int, cone: str) -> None:
    """Forces and moments of all contacts of a sole, as `mj_contactForce` has them, about the sole in its own axes."""
    model = foreign_model(DESCRIPTION, "motor")
    model.opt.cone = getattr(mujoco.mjtCone, f"mjCONE_{cone}")
    model.geom_condim[:] = dimensions
    loop = MujocoLoop(DESCRIPTION, model, prefix=PREFIX)
    loop.push("torso", [80.0, 60.0, 0.0], 1.0)
    for _ in range(5):
        loop.step(loop.hold())
    data, robot, truth = loop.data, loop.robot.clone(), loop.truth()
    robot.update(truth.q, truth.v)
    expected, local = np.zeros((2, 6)), np.zeros(6)
    carriers = [
        loop.places.feet.index(body) if body in loop.places.feet else -1 for body in model.geom_bodyid
    ]
    for i in range(data.ncon):
        contact = data.contact[i]
        first, second = (carriers[geom] for geom in contact.geom)
        mujoco.mj_contactForce(model, data, i, local)
        axes = contact.frame.reshape(3, 3)
        for side, sign in ((first, -1.0), (second, 1.0)):
            if side >= 0:
                force, moment = sign * axes.T @ local[:3], sign * axes.T @ local[3:]
                expected[side] += np.hstack([force, moment + np.cross(contact.pos, force)])
    for side, sole in enumerate(robot.soles):
        centre, rotation = loop.sole_pose(side)
        np.testing.assert_allclose(centre, robot.placement(sole.frame).translation, atol=1e-6)
        force, about = expected[side, :3], expected[side, 3:]
        inside = np.hstack([rotation.T @ force, rotation.T @ (about - np.cross(centre, force))])
        np.testing.assert_allclose(truth.sole_wrench[side], inside, atol=2e-2)
    assert truth.sole_wrench[:, 2].min() > 50.0 and (dimensions == 1 or np.abs(expected[:, :2]).max() > 3.0)
    points = truth.contact_force.sum(axis=0)
    np.testing.assert_allclose(points, expected[:, :3].sum(axis=0), atol=1e-6)


EACH_KIND = list(zip(KINDS, ("position", "torque") * (len(KINDS) // 2), strict=True))
"""Kinds of actuators, of which each is driven by one kind of control, and each kind of control drives half of them."""


@pytest.mark.parametrize(
    ("kind", "mode"),
    [
        pytest.param(kind, mode, marks=() if (kind, mode) in EACH_KIND else pytest.mark.slow)
        for kind in KINDS
        for mode in ("position", "torque")
    ],
)
def test_a_robot_stands_on_actuators_of_any_kind(kind: str, mode: str) -> None:
    loop = MujocoLoop(DESCRIPTION, foreign_model(DESCRIPTION, kind), prefix=PREFIX)
    assert stand(loop, 0.1, mode) < 1.0
    weight = loop.measure().sole_wrench[:, 2].sum()
    assert weight == pytest.approx(9.80665 * loop.robot.mass, rel=0.02)
    ball = loop.data.qpos[:3]
    assert np.allclose(ball, [1.0, 1.0, 0.1], atol=2e-3) and loop.data.ctrl[0] == 0.0  # that of the door


def test_joints_that_are_not_described_and_that_nothing_holds_are_named_at_the_start(
    caplog: pytest.LogCaptureFixture,
) -> None:
    whole = wbc.load_robot("g1")
    names = [n for n in whole.joint_names if "waist_roll" in n or "wrist_yaw" in n]
    left, right = whole.soles
    lock = dict.fromkeys(names, 0.0)
    locked = wbc.RobotDescription.from_urdf(
        whole.urdf, left_sole=left, right_sole=right, lock=lock, name="g1_26"
    )
    model = Plant(whole, visuals=False).model
    model.actuator_biastype[:], model.actuator_biasprm[:] = 0, 0.0  # motors
    note = next(note for note in MujocoLoop(locked, model).notes if "not in the description" in note)
    assert all(name in note for name in names) and note in caplog.text
    assert note.startswith(f"{len(names)} joints")
    model.jnt_stiffness[model.joint(names[0]).id] = 100.0
    note = next(note for note in MujocoLoop(locked, model).notes if "not in the description" in note)
    assert names[0] not in note
    assert not any("not in the description" in note for note in MujocoLoop(whole, model).notes)


@pytest.mark.parametrize("integrator", by_default(["euler", "implicit", "rk4"], "euler", "rk4"))
def test_every_integrator_and_a_gear(integrator: str) -> None:
    model = foreign_model(DESCRIPTION, "motor", integrator=integrator, gear=-20.0)
    assert stand(MujocoLoop(DESCRIPTION, model, prefix=PREFIX), 0.06, "position") < 1.0


@pytest.mark.parametrize(
    "integrator",
    by_default(["euler", "implicit", "implicitfast", "discrete"], "implicitfast", "discrete"),
)
def test_a_torque_acts_in_full_on_a_joint_with_a_servo(integrator: str) -> None:
    speeds = []
    for bias in (mujoco.mjtBias.mjBIAS_AFFINE, mujoco.mjtBias.mjBIAS_NONE):
        model = Plant(DESCRIPTION, physics=PhysicsSettings(gravity=0.0), visuals=False).model
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
        model.actuator_biastype[:] = int(bias)
        loop = MujocoLoop(DESCRIPTION, model, control_period=0.005)
        up = loop.robot.half_sitting.copy()
        up[2] += 1.0
        loop.reset(up)
        elbow = list(DESCRIPTION.joint_names).index("left_elbow_pitch")
        torque = np.zeros(loop.robot.na)
        torque[elbow] = 2.0
        for _ in range(6):
            loop.step(Command(torque))
        assert loop.measure().joint_torque[elbow] == pytest.approx(2.0, abs=1e-6)
        speeds.append(loop.data.qvel[loop.places.joint_dof[elbow]])
    assert speeds[0] == pytest.approx(speeds[1], rel=0.02)


def test_measurements_are_those_of_the_plant() -> None:
    """The plant of this library, wrapped as somebody else's, is measured as it measures itself."""
    plant = Plant(DESCRIPTION, foot="flat", control_period=0.001, visuals=False)
    push = [60.0, 30.0, 0.0]
    control = wbc.TorqueControl(wbc.balance_controller(DESCRIPTION.robot(), 0.001))
    plant.push("torso", push, 0.3)
    while plant.time < 0.2:
        plant.step(control.command(plant.measure()))
    command = control.command(plant.measure())
    data = mujoco.MjData(plant.model)
    mujoco.mj_copyData(data, plant.model, plant.data)
    loop = MujocoLoop(DESCRIPTION, plant.model, data, control_period=0.001)
    loop.step(command)
    data.xfrc_applied[:] = 0.0
    plant.step(command)
    own, other = plant.measure(), loop.measure()
    np.testing.assert_allclose(other.joint_position, own.joint_position, atol=1e-6)
    np.testing.assert_allclose(other.joint_velocity, own.joint_velocity, atol=1e-3)
    np.testing.assert_allclose(other.angular_velocity, own.angular_velocity, atol=1e-3)
    np.testing.assert_allclose(other.specific_force, own.specific_force, atol=0.05)
    np.testing.assert_allclose(loop.truth().com, plant.truth().com, atol=1e-6)
    np.testing.assert_allclose(other.sole_wrench, plant.truth().sole_wrench, atol=0.5)
    assert other.joint_torque is not None
    np.testing.assert_allclose(other.joint_torque, plant.joint_torque, atol=0.2)


def test_imu_readings_are_in_the_frame_of_the_description() -> None:
    """The same with sensors on a turned site and computed without any."""
    readings = []
    for imu in (True, False):
        loop = MujocoLoop(DESCRIPTION, foreign_model(DESCRIPTION, "motor", imu=imu), prefix=PREFIX)
        assert (len(loop.notes) == 0) is imu
        base = loop.places.base_dof
        loop.data.qvel[base + 3 : base + 6] = [0.5, -0.4, 0.3]
        for _ in range(5):
            loop.step(loop.hold())
        readings.append(loop.measure())
    np.testing.assert_allclose(readings[0].angular_velocity, readings[1].angular_velocity, atol=1e-9)
    # Computed of the velocities at the end of a step, measured of those at its begin.
    np.testing.assert_allclose(readings[0].specific_force, readings[1].specific_force, atol=2e-3)
    assert np.abs(readings[0].angular_velocity).max() > 0.01


def test_gains_of_a_command_replace_those_of_the_file() -> None:
    na = DESCRIPTION.robot().na
    for kind in ("motor", "position"):
        loop = MujocoLoop(DESCRIPTION, foreign_model(DESCRIPTION, kind), prefix=PREFIX)
        q = loop.measure().joint_position
        off = q + 0.01
        loop.step(Command(np.zeros(na), off, np.zeros(na), kp=np.full(na, 50.0), kd=np.zeros(na)))
        torque = loop.measure().joint_torque
        assert torque is not None
        np.testing.assert_allclose(torque, 0.5, atol=0.15)  # the joints have begun to move


def test_other_parts_than_the_feet_touch() -> None:
    """The pelvis of a robot that lies on its back hits the ground, which is not measured at the soles."""
    loop = MujocoLoop(DESCRIPTION, foreign_model(DESCRIPTION, "motor"), prefix=PREFIX)
    loop.step(loop.hold())
    assert set(loop.truth().contact_sole.tolist()) == {0, 1} and not loop.truth().other_force.any()
    q = np.array(loop.robot.half_sitting)
    q[2], q[3:7] = 0.099, [0.0, -np.sqrt(0.5), 0.0, np.sqrt(0.5)]
    loop.reset(q)
    loop.step(loop.hold())
    assert not loop.measure().sole_wrench.any()
    truth = loop.truth()
    assert set(truth.contact_sole.tolist()) == {-1} and truth.contact_force[0, 2] > 100.0
    np.testing.assert_allclose(truth.other_force, truth.contact_force.sum(axis=0))


def test_a_model_of_another_robot_is_refused() -> None:
    model = foreign_model(DESCRIPTION, "motor")
    bad: tuple[tuple[dict[str, object], str], ...] = (
        ({"prefix": ""}, "joint"),
        ({"joints": {"left_nee": "x"}}, "left_nee"),
        ({"gyroscope": "gyro"}, "sensor"),
        ({"gyroscope": PREFIX + "acc"}, "gyroscope"),
        ({"control_period": 0.0015}, "multiple"),
        ({"data": Plant(DESCRIPTION, visuals=False).data}, "data"),
    )
    for options, named in bad:
        with pytest.raises((InputError, UnknownNameError), match=named):
            MujocoLoop(DESCRIPTION, model, **({"prefix": PREFIX} | options))  # type: ignore[arg-type]
    model.actuator_gaintype[5] = mujoco.mjtGain.mjGAIN_AFFINE
    with pytest.raises(ModelError, match="gain"):
        MujocoLoop(DESCRIPTION, model, prefix=PREFIX)


def test_a_simulation_that_has_diverged_gives_no_measurement_and_a_reset_leaves_nothing_of_it() -> None:
    """MuJoCo puts everything back to where the file has it, unless it is told not to."""
    model = foreign_model(DESCRIPTION, "motor")
    loop = MujocoLoop(DESCRIPTION, model, prefix=PREFIX)
    loop.step(loop.hold())
    loop.data.qvel[loop.places.joint_dof[0]] = 1e12
    loop.step(loop.hold())
    assert np.isfinite(loop.data.qpos).all()
    with pytest.raises(MeasurementError, match="simulation diverged before"):
        loop.measure()
    assert loop.diverged is not None and "mjWARN_BADQ" in loop.diverged
    loop.data.qpos[:], loop.data.qvel[:] = model.qpos0, 0.0
    loop.reset(seed=9)
    assert loop.seed == 9
    for _ in range(20):
        loop.step(loop.hold())
    assert loop.measure().time == loop.time and np.isfinite(loop.measure().joint_position).all()


BIPED = (Path(__file__).parents[2] / "examples" / "biped.xml").read_text(encoding="utf-8")
FLOOR = '<geom name="deck" type="plane" size="0 0 1"/></worldbody>'
DOOR = '<body pos="3 0 1"><joint name="hinge"/><geom type="box" size=".3 .02 .5"/></body></worldbody>'
SERVO = 'kp="900" kv="9"'


@cache
def biped() -> RobotDescription:
    return RobotDescription.from_mjcf(BIPED)


def loop_of(xml: str) -> MujocoLoop:
    """Return the loop of the biped in a model of a changed file."""
    return MujocoLoop(biped(), mujoco.MjModel.from_xml_string(xml))


def stranger(xml: str, floor: str = FLOOR) -> tuple[MujocoLoop, float]:
    """Return the loop of the biped in a changed file after standing for 0.08 s, and how far its CoM moved, m."""
    xml = xml.replace("</worldbody>", floor, 1)
    loop = MujocoLoop(wbc.RobotDescription.from_mjcf(xml), mujoco.MjModel.from_xml_string(xml))
    control = wbc.TorqueControl(wbc.balance_controller(loop.description.robot(), loop.control_period))
    start = loop.truth().com
    while loop.time < 0.08:
        loop.step(control.command(loop.measure()))
    assert control.failures == 0
    return loop, float(np.abs(loop.truth().com - start).max())


@pytest.mark.parametrize("kinds", by_default(["door", "robot", "both"], "both"))
def test_controls_are_found_where_actuators_have_several(kinds: str) -> None:
    """A pid of a door in front of the motors, pids as the robot's servos; controls of the door are left alone."""
    xml = BIPED.replace("</worldbody>", DOOR).replace(
        "<actuator>", f'<actuator><pid joint="hinge" {SERVO}/>' if kinds != "robot" else "<actuator>"
    )
    if kinds != "door":
        xml = re.sub(r'<motor joint="(\w+)"/>', rf'<pid joint="\1" {SERVO} gear="1"/>', xml)
    loop, moved = stranger(xml)
    assert moved < 2e-3
    assert set(loop.actuators.kinds) == {"motor" if kinds == "door" else "position"}
    assert kinds == "robot" or not loop.data.ctrl[:2].any()


@pytest.mark.parametrize("more", ['ki="1"', 'slewmax="1"', 'kp="0"'])
def test_a_pid_that_does_more_is_refused_by_name(more: str) -> None:
    gains = more if "kp" in more else f'kp="900" {more}'
    own = f'<pid name="odd" joint="left_knee" kv="2" {gains}/></actuator>'
    with pytest.raises(ModelError, match="'odd' of joint 'left_knee'"):
        stranger(BIPED.replace("</actuator>", own))


@pytest.mark.parametrize(("off", "kind"), [(3, "motor"), (2, "position"), (4, "motor + position")])
def test_actuators_of_a_group_that_is_off_do_not_drive(off: int, kind: str) -> None:
    names = re.findall(r'<motor joint="(\w+)"/>', BIPED)
    servos = "".join(f'<position joint="{name}" gear="1" {SERVO} group="3"/>' for name in names)
    xml = BIPED.replace("</actuator>", f"{servos}</actuator>").replace('gear="10"/>', 'gear="10" group="2"/>')
    option = f'<option actuatorgroupdisable="{off}"/><default>'
    loop, moved = stranger(xml.replace("<default>", option, 1))
    assert set(loop.actuators.kinds) == {kind} and moved < 2e-3
    assert any("disabled" in note for note in loop.notes) == (off != 4)


def test_the_lowest_point_of_the_soles_is_that_of_their_corners() -> None:
    robot = DESCRIPTION.robot()
    q = robot.half_sitting.copy()
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(-0.2, 0.4, -2.0)).coeffs()
    robot.update(q, np.zeros(robot.nv))
    corners = []
    for sole in robot.soles:
        place = robot.placement(sole.frame)
        for x in (-0.5, 0.5):
            corners += [place.act(np.array([x * sole.length, y * sole.width, 0.0])) for y in (-0.5, 0.5)]
    assert lowest_sole_point(robot, q) == pytest.approx(min(corner[2] for corner in corners), abs=1e-12)


def test_a_floor_more_slippery_than_contacts_count_on_is_noted() -> None:
    model = foreign_model(DESCRIPTION, "motor")
    for friction, noted in ((0.69, True), (0.71, False)):
        model.geom_friction[:, 0] = friction
        loop = MujocoLoop(DESCRIPTION, model, prefix=PREFIX)
        assert any("friction" in note for note in loop.notes) == noted
    foot = int(np.flatnonzero(model.geom_bodyid == loop.places.feet[0])[0])
    model.geom_friction[:, 0], model.geom_friction[foot, 0], model.geom_priority[foot] = 0.9, 0.3, 1
    found = friction_under(loop.places, loop.robot, mujoco.MjData(model), 0.0)
    assert found == pytest.approx(0.3)
    model.geom_condim[:] = 1
    assert friction_under(loop.places, loop.robot, mujoco.MjData(model), 0.0) == 0.0
    assert friction_under(loop.places, loop.robot, mujoco.MjData(model), 0.05) is None


JOINT_NOTES = {
    "dof_armature": "rotor inertia",
    "dof_damping": "damping",
    "dof_frictionloss": "dry friction",
    "jnt_stiffness": "springs",
}
"""Values of MuJoCo's joints, and what notes call them; the rotor inertia alone is not zero here."""


@pytest.mark.parametrize(
    ("scale", "offset", "noted"),
    [(1.009, 0.0, 0), (0.991, 0.0, 0), (1.011, 0.0, 1), (0.989, 0.0, 1), (1.0, 1e-3, 4)],
)
def test_what_joints_have_otherwise_than_described_is_noted_from_a_hundredth_on(
    scale: float, offset: float, noted: int
) -> None:
    model = foreign_model(DESCRIPTION, "motor")
    joint = int(model.joint(f"{PREFIX}left_knee_pitch").id)
    for name in JOINT_NOTES:
        values, place = getattr(model, name), joint if name == "jnt_stiffness" else model.jnt_dofadr[joint]
        values[place] = scale * values[place] + offset
    model.body_subtreemass[model.body_rootid[model.jnt_bodyid[joint]]] += (scale - 1.0) * MASS
    notes = MujocoLoop(DESCRIPTION, model, prefix=PREFIX).notes
    assert [any(word in note for note in notes) for word in JOINT_NOTES.values()].count(True) == noted
    assert any("kg in the model" in note for note in notes) == (noted == 1)


@pytest.mark.parametrize("count", [3, 4])
def test_joints_without_an_actuator_are_counted_and_the_first_three_are_named(count: int) -> None:
    bare = re.findall(r'<motor joint="(\w+)"/>', BIPED)[:count]
    xml = BIPED.replace("</worldbody>", FLOOR)
    for name in bare:
        xml = xml.replace(f'<motor joint="{name}"/>', "")
    (note,) = (note for note in loop_of(xml).notes if "without an actuator" in note)
    assert (
        note.startswith(f"{count} joints")
        and [name in note for name in bare] == ([True] * 3 + [False])[:count]
    )
    assert ("…" in note) == (count > 3)


def test_an_actuator_without_a_name_is_told_by_its_joint() -> None:
    xml = BIPED.replace('<motor joint="left_knee"', '<motor delay="0.006" nsample="8" joint="left_knee"')
    (note,) = (note for note in loop_of(xml).notes if "delay" in note)
    assert "left_knee" in note


def test_sensors_that_a_flag_switches_off_are_computed() -> None:
    off = BIPED.replace("<default>", '<option><flag sensor="disable"/></option><default>', 1)
    loop, moved = stranger(off)
    assert moved < 2e-3 and loop.measure().specific_force[2] > 9.0
    gyroscope = next(str(loop.model.sensor(i).name) for i in range(loop.model.nsensor))
    with pytest.raises(InputError, match="disables all sensors"):
        MujocoLoop(loop.description, loop.model, gyroscope=gyroscope)


BOX = '<geom type="box" size="1 1 0.05" pos="0 0 {z}"/></worldbody>'
FLOORS = {  # floor, its height, m, and what is noted
    "level": (FLOOR, 0.0, ""),
    "higher": (FLOOR.replace("/>", ' pos="0 0 0.08"/>'), 0.08, ""),
    "lower": (FLOOR.replace("/>", ' pos="0 0 -0.25"/>'), -0.25, ""),
    "above the robot": (BOX.format(z=4.95), 5.0, ""),
    "under a roof": (BOX.format(z=-0.05) + BOX.format(z=3.0).replace("</worldbody>", ""), 0.0, ""),
    "under a painting": ('<geom type="box" size="1 1 0.1" contype="0" conaffinity="0"/>' + FLOOR, 0.0, ""),
    "ball between the feet": (
        '<body pos="0 0 .05"><freejoint/><geom type="sphere" size=".05"/></body>' + FLOOR,
        0.0,
        "",
    ),
    "step under a foot": ('<geom type="box" size="1 1 0.02" pos="0 1 0"/>' + FLOOR, 0.02, ""),
    "none": ("</worldbody>", 0.0, "no ground under the soles"),
    "ice": (FLOOR.replace("<geom ", '<geom friction="0.05" priority="1" '), 0.0, "ground is 0.05"),
    "without friction": (FLOOR.replace("<geom ", '<geom condim="1" priority="1" '), 0.0, "ground is 0,"),
}


@pytest.mark.parametrize("what", FLOORS)
def test_a_robot_is_put_on_the_floor_that_there_is(what: str) -> None:
    floor, height, said = FLOORS[what]
    if "</worldbody>" in floor[:-12]:
        floor = floor.replace("</worldbody>", "") + "</worldbody>"
    xml = BIPED.replace("</worldbody>", floor, 1)
    loop = loop_of(xml)
    half_sitting = loop.robot.half_sitting
    assert loop.truth().q[2] == pytest.approx(half_sitting[2] + height, abs=1e-6)
    assert any(said in note for note in loop.notes) if said else not loop.notes
    loop.reset(half_sitting)  # where one says, it is put
    assert loop.truth().q[2] == pytest.approx(half_sitting[2])


def test_a_robot_that_begins_inside_a_thing_is_noted() -> None:
    xml = BIPED.replace("</worldbody>", '<geom type="box" size="0.005 0.2 0.3" pos="0.08 0 0"/>' + FLOOR)
    assert any("inside" in note for note in loop_of(xml).notes)


LEAF = """<body name="{side}_pad"><inertial pos="0.03 0 -0.06" mass="1" diaginertia="0.001 0.001 0.001"/>
<joint name="{side}_leaf" type="slide" axis="0 0 1" stiffness="40000" damping="800" armature="0" frictionloss="0"/>"""
SHANK = (
    '<joint name="{side}_shank" axis="0 1 0" stiffness="2000" damping="20" armature="0.02" frictionloss="0"/>'
)
SPRINGS = {"leaf": 0.003, "shank": -0.01}
"""Spring → position at which the description locks it: a pad below the foot, m, and a bending shank, rad."""


def sprung(springs: Sequence[str]) -> str:
    """Return examples/biped.xml with springs in both legs that nothing drives."""
    xml = (EXAMPLES / "biped.xml").read_text(encoding="utf-8")
    for side in ("left", "right"):
        if "shank" in springs:
            at = xml.index(f'<joint name="{side}_ankle_pitch"')
            xml = xml[:at] + SHANK.format(side=side) + xml[at:]
        if "leaf" in springs:
            at = xml.index("<geom", xml.index(f'<joint name="{side}_ankle_roll"'))
            end = xml.index("</body>", at)
            xml = xml[:at] + LEAF.format(side=side) + xml[at:end] + "</body>" + xml[end:]
    return xml


@pytest.mark.parametrize("springs", by_default([("shank",), ("leaf",), ("shank", "leaf")], ("shank", "leaf")))
def test_joints_that_the_description_locks_move_in_the_model(springs: tuple[str, ...]) -> None:
    """The robot stands on its springs; joints, soles and their wrenches are those of the model."""
    xml = sprung(springs)
    lock = {f"{side}_{name}": SPRINGS[name] for side in ("left", "right") for name in springs}
    feet = ("left_pad", "right_pad") if "leaf" in springs else ("left_foot", "right_foot")
    description = RobotDescription.from_mjcf(xml, lock=lock, left_sole=feet[0], right_sole=feet[1])
    assert description.locked == lock and not set(lock) & set(description.joint_names)
    spec = mujoco.MjSpec.from_string(xml)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 1])
    spec.option.timestep = 0.001
    model = spec.compile()
    loop = MujocoLoop(description, model)
    places = {name: int(model.joint(name).qposadr[0]) for name in lock}
    for name, at in lock.items():
        assert loop.data.qpos[places[name]] == at
    robot = description.robot()
    control = wbc.HybridControl(wbc.balance_controller(robot, loop.control_period))
    start = loop.truth().com
    while loop.time < 0.15:
        loop.step(control.command(loop.measure()))
    assert control.failures == 0 and np.abs(loop.truth().com - start).max() < 0.01
    moved = [abs(float(loop.data.qpos[places[name]]) - at) for name, at in lock.items()]
    assert min(moved) > 1e-4
    for side, foot in enumerate(
        ("left_pad", "right_pad") if "leaf" in springs else ("left_foot", "right_foot")
    ):
        assert loop.places.feet[side] == model.body(foot).id
        assert abs(loop.sole_pose(side)[0][2]) < 3e-3
    weight = loop.truth().sole_wrench[:, 2].sum()
    assert abs(weight / (robot.mass * GRAVITY) - 1.0) < 0.2
    loop.reset()
    assert all(loop.data.qpos[places[name]] == at for name, at in lock.items())
    assert not loop.data.qvel.any()
