"""Places of a described robot in any MuJoCo model: joints, base, feet and IMU, found by names and compared."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio as pin

from wbc.core.conventions import Index, configuration_to_mujoco
from wbc.core.errors import Array, InputError, ModelError, choose, unknown_name
from wbc.core.robot import Robot
from wbc.robots import RobotDescription

SAME_PLACE = 2e-3
"""Largest distance between a joint of the model and of the description that is no contradiction, m."""

SAME_AXIS = 1e-2
"""Largest distance between the axes of such joints, unit vectors."""


OTHER_COM = 5e-3
"""Distance between the centres of mass of a link in the model and in the description from which it is noted, m."""

HEAVY = 0.01
"""Least share of the robot's mass of a link whose centre of mass is compared."""


@dataclass(frozen=True, eq=False)
class RobotPlaces:
    """Places of a robot in a MuJoCo model.

    Attributes:
        joints: MuJoCo's joints, in the order of the robot's.
        joint_qpos: Their places in `qpos`, shape (na,).
        joint_dof: Their places in `qvel`, shape (na,).
        root: Body of the floating base.
        base_qpos: First place of the base in `qpos`.
        base_dof: First place of the base in `qvel`.
        feet: Body that carries each sole.
        soles: Sole frame in that body.
        imu_body: Body that carries the IMU.
        imu: IMU frame in that body.
    """

    joints: list[int]
    joint_qpos: Index
    joint_dof: Index
    root: int
    base_qpos: int
    base_dof: int
    feet: list[int]
    soles: list[pin.SE3]
    imu_body: int
    imu: pin.SE3

    def carrier(self, model: mujoco.MjModel, robot: Robot, frame: str) -> tuple[int, pin.SE3]:
        """Return the body that carries a frame of the robot, and the placement of the frame in it."""
        data = self._at_half_sitting(model, robot)
        return _carrier(model, data, robot, self.joints, self.root, frame)

    def _at_half_sitting(self, model: mujoco.MjModel, robot: Robot) -> mujoco.MjData:
        """Return data with the robot in half-sitting, and update the robot so."""
        data = mujoco.MjData(model)
        self.set_configuration(robot.half_sitting, data.qpos)
        mujoco.mj_kinematics(model, data)
        robot.update(robot.half_sitting, np.zeros(robot.nv))
        return data

    def displaced_mass(self, model: mujoco.MjModel, robot: Robot) -> tuple[str, float] | None:
        """Return the link whose centre of mass is farthest off the description's at half-sitting, and how far, m.

        A joint that counts from another zero has its link there; the link is named by its joint. None if no heavy link
        is off. A link has the bodies of the model that hang on it by no joint of the description.
        """
        data = self._at_half_sitting(model, robot)
        owner = {self.root: 1} | {int(model.jnt_bodyid[joint]): i + 2 for i, joint in enumerate(self.joints)}
        mass, moment = np.zeros(robot.model.njoints), np.zeros((robot.model.njoints, 3))
        for body in range(model.nbody):
            if model.body_rootid[body] != self.root:
                continue
            above = body
            while above not in owner:
                above = int(model.body_parentid[above])
            mass[owner[above]] += model.body_mass[body]
            moment[owner[above]] += model.body_mass[body] * data.xipos[body]
        worst = ("", OTHER_COM)
        for link in range(1, robot.model.njoints):
            inertia = robot.model.inertias[link]
            if min(mass[link], inertia.mass) >= HEAVY * robot.mass:
                there = robot.data.oMi[link].act(inertia.lever)
                distance = float(np.linalg.norm(moment[link] / mass[link] - there))
                if distance > worst[1]:
                    worst = ("base" if link == 1 else robot.joint_names[link - 2], distance)
        return worst if worst[0] else None

    def set_configuration(self, q: Array, qpos: Array) -> None:
        """Write a configuration, shape (nq,), into MuJoCo's `qpos`; the rest of it is kept."""
        configuration_to_mujoco(q, self.joint_qpos - self.base_qpos, out=qpos[self.base_qpos :])


def find_places(
    model: mujoco.MjModel, description: RobotDescription, names: Mapping[str, str], prefix: str
) -> RobotPlaces:
    """Return the places of a robot in a model; `names` is joint of the robot → joint of the model where they differ.

    Raises `UnknownNameError` for a joint that the model has not, `ModelError` without a free joint above them, or for a
    joint elsewhere or about another axis than in the description.
    """
    for name in names:
        choose("joint", name, description.joint_names)
    have = {model.joint(i).name: i for i in range(model.njnt)}
    joints = []
    for name in description.joint_names:
        wanted = names.get(name, prefix + name)
        if wanted not in have:
            unknown_name("joint of the MuJoCo model", wanted, [n for n in have if n])
        joints.append(have[wanted])
    root = int(model.body_rootid[model.jnt_bodyid[joints[0]]])
    apart = [j for j in joints if model.body_rootid[model.jnt_bodyid[j]] != root]
    if apart:
        raise ModelError(
            f"joints '{model.joint(joints[0]).name}' and '{model.joint(apart[0]).name}' are in different trees "
            "of the MuJoCo model"
        )
    free = [
        j
        for j in range(model.njnt)
        if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE and model.body_rootid[model.jnt_bodyid[j]] == root
    ]
    if not free:
        raise ModelError(f"body '{model.body(root).name}' of the robot must have a free joint")
    robot = description.robot()
    base_qpos, base_dof = int(model.jnt_qposadr[free[0]]), int(model.jnt_dofadr[free[0]])
    joint_qpos = model.jnt_qposadr[joints].astype(np.intp)
    data = mujoco.MjData(model)
    configuration_to_mujoco(robot.half_sitting, joint_qpos - base_qpos, out=data.qpos[base_qpos:])
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    _compare(model, data, robot, joints)

    feet = [_carrier(model, data, robot, joints, root, sole.frame) for sole in robot.soles]
    imu_body, imu = _carrier(model, data, robot, joints, root, robot.imu_frame)
    return RobotPlaces(
        joints=joints,
        joint_qpos=joint_qpos,
        joint_dof=model.jnt_dofadr[joints].astype(np.intp),
        root=root,
        base_qpos=base_qpos,
        base_dof=base_dof,
        feet=[body for body, _ in feet],
        soles=[place for _, place in feet],
        imu_body=imu_body,
        imu=imu,
    )


def _carrier(
    model: mujoco.MjModel, data: mujoco.MjData, robot: Robot, joints: list[int], root: int, frame: str
) -> tuple[int, pin.SE3]:
    """Return the body that carries a frame, and the frame in it; simulation and robot are both at half-sitting."""
    parent = robot.model.frames[robot.frame_id(frame)].parentJoint
    body = root if parent < 2 else int(model.jnt_bodyid[joints[parent - 2]])
    place = pin.SE3(data.xmat[body].reshape(3, 3), data.xpos[body])
    return body, place.actInv(robot.placement(frame))


def _compare(model: mujoco.MjModel, data: mujoco.MjData, robot: Robot, joints: list[int]) -> None:
    """Raise ModelError for a joint of the model that is elsewhere than the description's, at half-sitting."""
    pin.computeJointJacobians(robot.model, robot.data, robot.half_sitting)
    for i, (name, joint) in enumerate(zip(robot.joint_names, joints, strict=True)):
        column = pin.getJointJacobian(robot.model, robot.data, i + 2, pin.LOCAL_WORLD_ALIGNED)[:, i + 6]
        slide = bool(model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE)
        axis, found = column[:3] if slide else column[3:], data.xaxis[joint]
        if np.linalg.norm(found + axis) < SAME_AXIS:
            raise ModelError(f"joint '{name}' turns the other way in the MuJoCo model: its axis is reversed")
        if np.linalg.norm(found - axis) > SAME_AXIS:
            angle = math.degrees(math.acos(float(np.clip(found @ axis, -1.0, 1.0))))
            raise ModelError(f"axis of joint '{name}' is {angle:.1f}° off in the MuJoCo model")
        distance = float(np.linalg.norm(data.xanchor[joint] - robot.data.oMi[i + 2].translation))
        if distance > SAME_PLACE and not slide:
            raise ModelError(
                f"joint '{name}' is {1e3 * distance:.1f} mm off in the MuJoCo model, at half-sitting: the description "
                "is of another robot"
            )


@dataclass(frozen=True, eq=False)
class ImuSensors:
    """Gyroscope and accelerometer of a model, and what turns their readings into the IMU frame.

    Attributes:
        gyroscope: First place in `sensordata`, rotation from the sensor's site to the IMU frame; None to compute.
        accelerometer: Likewise.
    """

    gyroscope: tuple[int, Array] | None
    accelerometer: tuple[int, Array] | None


def find_imu(
    model: mujoco.MjModel, places: RobotPlaces, gyroscope: str | None, accelerometer: str | None
) -> ImuSensors:
    """Return the sensors of the IMU: those named, else those that are fixed to the same body as the IMU.

    Raises `UnknownNameError` for no such sensor, `InputError` for one of another kind or on another body.
    """
    kinds = mujoco.mjtSensor
    return ImuSensors(
        _sensor(model, places, "gyroscope", int(kinds.mjSENS_GYRO), gyroscope),
        _sensor(model, places, "accelerometer", int(kinds.mjSENS_ACCELEROMETER), accelerometer),
    )


def _sensor(
    model: mujoco.MjModel, places: RobotPlaces, what: str, kind: int, name: str | None
) -> tuple[int, Array] | None:
    sensors = {model.sensor(i).name: i for i in range(model.nsensor)}
    if name is not None:
        if name not in sensors:
            unknown_name("sensor of the MuJoCo model", name, [n for n in sensors if n])
        if model.sensor_type[sensors[name]] != kind:
            found = mujoco.mjtSensor(int(model.sensor_type[sensors[name]])).name
            raise InputError(f"sensor '{name}' must be {what}, it is {found}")
    candidates = [sensors[name]] if name is not None else np.flatnonzero(model.sensor_type == kind).tolist()
    best: tuple[float, int, Array] | None = None
    for sensor in candidates:
        site = int(model.sensor_objid[sensor])
        if model.body_weldid[model.site_bodyid[site]] != model.body_weldid[places.imu_body]:
            if name is not None:
                raise InputError(
                    f"{what} '{name}' is fixed to body '{model.body(model.site_bodyid[site]).name}', the IMU of the "
                    f"description to '{model.body(places.imu_body).name}'; give the description the right `imu`"
                )
            continue
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        body = pin.SE3(data.xmat[places.imu_body].reshape(3, 3), data.xpos[places.imu_body])
        imu = body * places.imu
        distance = float(np.linalg.norm(data.site_xpos[site] - imu.translation))
        turn = imu.rotation.T @ data.site_xmat[site].reshape(3, 3)
        if best is None or distance < best[0]:
            best = (distance, int(model.sensor_adr[sensor]), np.array(turn))
    return None if best is None else best[1:]
