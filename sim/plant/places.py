"""Places of a described robot in a MuJoCo model: joints, base, feet and IMU, found by names and compared."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, ModelError, choose, unknown_name
from wbc.base.numbers import ROUNDING, Array
from wbc.core.conventions import Index, configuration_to_mujoco
from wbc.core.robot import Robot
from wbc.robots.mechanism import placement_of
from wbc.robots.readers.actuators_mjcf import switched_off

SAME_PLACE = 2e-3
"""Largest distance between a joint of the model and of the description that is no contradiction, m."""

SAME_AXIS = 1e-2
"""Largest distance between the axes of such joints, unit vectors."""


class RobotPlaces:
    """Places of a robot in a MuJoCo model that puts `prefix` before all of its names.

    Attributes:
        robot: The robot.
        joints: MuJoCo's joints, in the order of the robot's.
        joint_qpos: Their places in `qpos`, shape (na,); `joint_dof` in `qvel`.
        root: Body of the floating base, whose first places are `base_qpos` and `base_dof`.
        of_robot: True for bodies of the robot and its feet, shape (nbody,).
        feet: Body that carries each sole; all that hangs on it is the foot.
        soles: Sole frame in that body; `imu` is the IMU frame in `imu_body`.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        robot: Robot,
        names: Mapping[str, str] | None = None,
        prefix: str = "",
        feet: Sequence[str] = (),
        locked: Mapping[str, float] | None = None,
    ) -> None:
        """Find a robot in half-sitting; `names` is joint of the robot → joint of the model where they differ.

        `feet` are bodies whose frames are the sole frames; those that carry the description's soles when empty.
        `locked` are joints that the robot does not have and the model may have, such as springs → their positions in
        configurations of the robot.
        """
        names, locked = names or {}, locked or {}
        for name in names:
            choose("joint", name, (*robot.joint_names, *locked))
        self.model, self.prefix, self.robot = model, prefix, robot
        have = {model.joint(i).name: i for i in range(model.njnt)}
        every: dict[str, int] = {}
        for name in (*robot.joint_names, *robot.couplings):
            wanted = names.get(name, prefix + name)
            if wanted not in have:
                unknown_name("joint of the MuJoCo model", wanted, [n for n in have if n])
            every[name] = have[wanted]
        joints = [every[name] for name in robot.joint_names]
        roots = model.body_rootid[model.jnt_bodyid]
        self.joints, self.root = joints, int(roots[joints[0]])
        if apart := [j for j in joints if roots[j] != self.root]:
            raise ModelError(
                f"joints '{model.joint(joints[0]).name}' and '{model.joint(apart[0]).name}' are in different trees "
                "of the MuJoCo model"
            )
        free = np.flatnonzero((model.jnt_type == mujoco.mjtJoint.mjJNT_FREE) & (roots == self.root))
        if not free.size:
            raise ModelError(f"body '{model.body(self.root).name}' of the robot must have a free joint")
        self.of_robot = model.body_rootid == self.root
        self.base_qpos, self.base_dof = int(model.jnt_qposadr[free[0]]), int(model.jnt_dofadr[free[0]])
        self.joint_qpos: Index = model.jnt_qposadr[joints].astype(np.intp)
        self.joint_dof: Index = model.jnt_dofadr[joints].astype(np.intp)
        self._coupled = [  # joints: follower, leader; ratio, offset
            (every[name], every[coupling.leader], coupling.ratio, coupling.offset)
            for name, coupling in robot.couplings.items()
        ]
        held = {
            have[there]: at
            for name, at in locked.items()
            if (there := names.get(name, prefix + name)) in have
        }
        self._locked = {int(model.jnt_qposadr[joint]): at for joint, at in held.items()}
        self._locked_dof: Index = model.jnt_dofadr[np.array(list(held), dtype=np.intp)].astype(np.intp)
        self._locked_bodies = {int(model.jnt_bodyid[joint]) for joint in held}
        rest = self._at_half_sitting()
        _compare(model, rest, robot, joints)
        self._rest = rest.xpos.copy(), rest.xmat.reshape(-1, 3, 3).copy()
        numbered = [every[str(name)] for name in list(robot.model.names)[2:]]
        bodies = [self.root, *(int(model.jnt_bodyid[joint]) for joint in numbered)]
        self._links = []  # body of each joint of the robot, and the joint's frame in it
        for body, there in zip(bodies, list(robot.data.oMi)[1:], strict=True):
            place = self._pose(body).actInv(there)
            exact = place.isApprox(pin.SE3.Identity(), ROUNDING)
            self._links.append((body, pin.SE3.Identity() if exact else place))
        carried = [self._carrier(sole.frame) for sole in robot.soles]
        if feet:
            carried = [(int(model.body(name).id), pin.SE3.Identity()) for name in feet]
        self.feet, self.soles = [body for body, _ in carried], [place for _, place in carried]
        self.imu_body, self.imu = self._carrier(robot.imu_frame)

    def carrier(self, name: str) -> tuple[int, pin.SE3]:
        """Return the body that carries a link or frame (see `body_frame`), and the frame's placement in it."""
        name = body_frame(name, self.robot)
        body, place = self._carrier(name)
        own = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, self.prefix + name)
        if own >= 0 and self._pose(own).isApprox(self._pose(body) * place, 1e-6):
            return int(own), pin.SE3.Identity()
        return body, place

    def _carrier(self, name: str) -> tuple[int, pin.SE3]:
        frames = self.robot.model.frames
        frame = frames[self.robot.frame_id(name)]
        body, place = self._links[max(frame.parentJoint, 1) - 1]
        place = place * frame.placement
        while frame.name != "universe" and self._locked_bodies:
            own = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, self.prefix + frame.name)
            if own >= 0:
                return self._behind_locked_joint(own, body, place)
            frame = frames[frame.parentFrame]
        return body, place

    def _behind_locked_joint(self, own: int, body: int, place: pin.SE3) -> tuple[int, pin.SE3]:
        """Return the carrier of a frame: behind the last locked joint between its own body and that of its joint."""
        above = own
        while above not in (0, body):
            if above in self._locked_bodies:
                return above, self._pose(above).actInv(self._pose(body) * place)
            above = int(self.model.body_parentid[above])
        return body, place

    def _pose(self, body: int) -> pin.SE3:
        """Return where a body is at half-sitting."""
        places, rotations = self._rest
        return pin.SE3(rotations[body], places[body])

    def _at_half_sitting(self) -> mujoco.MjData:
        """Return data with the robot in half-sitting, and update the robot so."""
        data, robot = mujoco.MjData(self.model), self.robot
        self.set_configuration(robot.half_sitting, data.qpos)
        mujoco.mj_kinematics(self.model, data)
        robot.update(robot.half_sitting, np.zeros(robot.nv))
        return data

    def off_centre(self) -> float:
        """Return how far the robot's centre of mass is off the description's at half-sitting, m."""
        data = self._at_half_sitting()
        mujoco.mj_comPos(self.model, data)
        return float(np.linalg.norm(data.subtree_com[self.root] - self.robot.com))

    def set_configuration(self, q: Array, qpos: Array) -> None:
        """Write a configuration, shape (nq,), into MuJoCo's `qpos`; the rest of it is kept."""
        configuration_to_mujoco(q, self.joint_qpos - self.base_qpos, out=qpos[self.base_qpos :])
        places = self.model.jnt_qposadr
        for follower, leader, ratio, offset in self._coupled:
            qpos[places[follower]] = ratio * qpos[places[leader]] + offset
        for joint, position in self._locked.items():
            qpos[joint] = position

    def set_at_rest(self, qvel: Array) -> None:
        """Write zero velocities of base and joints, locked ones included, into MuJoCo's `qvel`."""
        qvel[self.base_dof : self.base_dof + 6] = 0.0
        qvel[self.joint_dof] = 0.0
        qvel[self._locked_dof] = 0.0
        self.couple_velocities(qvel)

    def reflected(self, values: Array, power: int) -> Array:
        """Return what the robot's joints feel of values by MuJoCo's velocities, shape (nv,), coupled ones included.

        Those of a coupled joint count by its ratio to a power: 2 for inertia and damping, 1 for friction.
        """
        own, dofs = np.array(values), self.model.jnt_dofadr
        for follower, leader, ratio, _ in self._coupled:
            own[dofs[leader]] += abs(ratio) ** power * own[dofs[follower]]
        return np.asarray(own[self.joint_dof])

    def ties(self) -> list[int]:
        """Return the equalities of the model by which coupled joints move with their leaders."""
        model, found = self.model, []
        pairs = [{follower, leader} for follower, leader, *_ in self._coupled]
        for i in range(model.neq):
            ends = {int(model.eq_obj1id[i]), int(model.eq_obj2id[i])}
            if int(model.eq_type[i]) == mujoco.mjtEq.mjEQ_JOINT and ends in pairs and model.eq_active0[i]:
                found.append(i)
        names = {self.prefix + closure.name for closure in self.robot.closures}
        return found + [i for i in range(model.neq) if (model.equality(i).name or f"equality_{i}") in names]

    def couple_velocities(self, qvel: Array) -> None:
        """Write the velocities of coupled joints into MuJoCo's `qvel`, after those of their leaders."""
        dofs = self.model.jnt_dofadr
        for follower, leader, ratio, _ in self._coupled:
            qvel[dofs[follower]] = ratio * qvel[dofs[leader]]

    def sensor(self, what: str, kind: mujoco.mjtSensor, name: str | None) -> tuple[int, Array | None] | None:
        """Return a sensor of the IMU: the one named, else the nearest that is fixed to the same body; None if none is.

        Returned are its first place in `sensordata`, and the rotation from its site to the IMU frame, None for none.
        """
        model = self.model
        if switched_off(model, mujoco.mjtDisableBit.mjDSBL_SENSOR):
            if name is not None:
                raise InputError(f"{what} '{name}' reads zero: the model's option flag disables all sensors")
            return None
        sensors = {model.sensor(i).name: i for i in range(model.nsensor)}
        candidates = np.flatnonzero(model.sensor_type == int(kind)).tolist()
        if name is not None:
            if name not in sensors:
                unknown_name("sensor of the MuJoCo model", name, [n for n in sensors if n])
            if model.sensor_type[sensors[name]] != int(kind):
                found = mujoco.mjtSensor(int(model.sensor_type[sensors[name]])).name
                raise InputError(f"sensor '{name}' must be {what}, it is {found}")
            candidates = [sensors[name]]
        imu = self._pose(self.imu_body) * self.imu
        best: tuple[float, int, Array | None] | None = None
        for sensor in candidates:
            site = int(model.sensor_objid[sensor])
            body = int(model.site_bodyid[site])
            if model.body_weldid[body] != model.body_weldid[self.imu_body]:
                if name is not None:
                    raise InputError(
                        f"{what} '{name}' is fixed to body '{model.body(body).name}', the IMU of the description to "
                        f"'{model.body(self.imu_body).name}'; give the description the right `imu`"
                    )
                continue
            at = placement_of(model.site_pos[site], model.site_quat[site])
            place = imu.actInv(self._pose(body) * at)
            distance = float(np.linalg.norm(place.translation))
            if best is None or distance < best[0]:
                level = np.allclose(place.rotation, np.eye(3), atol=ROUNDING)
                turn = None if level else place.rotation.copy()
                best = (distance, int(model.sensor_adr[sensor]), turn)
        return None if best is None else best[1:]


def hanging(model: mujoco.MjModel, bodies: Sequence[int]) -> Index:
    """Return which of some bodies each body of a model is or hangs on, by its place among them, −1 for none."""
    on = np.full(model.nbody, -1, dtype=np.intp)
    on[list(bodies)] = np.arange(len(bodies))
    for body in range(1, model.nbody):  # a parent's number is below its children's
        if on[body] < 0:
            on[body] = on[model.body_parentid[body]]
    return on


def body_frame(name: str, robot: Robot) -> str:
    """Return the link or frame of a robot by its name; "torso" and "base" stand for its torso and base frames."""
    if robot.model.existFrame(name) and name != "universe":
        return name
    alias = {"torso": robot.torso_frame, "base": robot.base_frame}
    if name not in alias:
        unknown_name("body", name, [*alias, *(f.name for f in robot.model.frames if f.name != "universe")])
    return alias[name]


def _compare(model: mujoco.MjModel, data: mujoco.MjData, robot: Robot, joints: list[int]) -> None:
    """Raise ModelError for a joint of the model that is elsewhere than the description's, at half-sitting."""
    pin.computeJointJacobians(robot.model, robot.data, robot.half_sitting)
    for i, (name, joint) in enumerate(zip(robot.joint_names, joints, strict=True)):
        number = robot.joint_numbers[i]
        column = pin.getJointJacobian(robot.model, robot.data, number, pin.LOCAL_WORLD_ALIGNED)[:, i + 6]
        slide = bool(model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE)
        axis, found = column[:3] if slide else column[3:], data.xaxis[joint]
        if np.linalg.norm(found + axis) < SAME_AXIS:
            raise ModelError(f"joint '{name}' turns the other way in the MuJoCo model: its axis is reversed")
        if np.linalg.norm(found - axis) > SAME_AXIS:
            angle = math.degrees(math.acos(float(np.clip(found @ axis, -1.0, 1.0))))
            raise ModelError(f"axis of joint '{name}' is {angle:.1f}° off in the MuJoCo model")
        distance = float(np.linalg.norm(data.xanchor[joint] - robot.data.oMi[number].translation))
        if distance > SAME_PLACE and not slide:
            raise ModelError(
                f"joint '{name}' is {1e3 * distance:.1f} mm off in the MuJoCo model, at half-sitting: the description "
                "is of another robot"
            )
