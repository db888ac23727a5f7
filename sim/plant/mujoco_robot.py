"""A robot in a MuJoCo model, whoever has built the model: how it is measured and pushed, and its truth."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, choose
from wbc.base.numbers import Array
from wbc.core.conventions import configuration_from_mujoco, velocity_from_mujoco, velocity_to_mujoco
from wbc.core.robot import Robot
from wbc.core.signals import Command
from wbc.robots import RobotDescription
from wbc.sim.plant.contacts import Contacts
from wbc.sim.plant.grips import REACH, handles_of
from wbc.sim.plant.places import RobotPlaces
from wbc.sim.plant.signals import Imu, MujocoSignals
from wbc.sim.simulation.machine import Machine, steps_per_tick
from wbc.sim.simulation.sensors import SensorNoise
from wbc.sim.simulation.simulation import GroundTruth, Simulation

_log = logging.getLogger(__name__)

if mujoco.get_mju_user_warning() is None:  # else MuJoCo writes a file into the working directory
    mujoco.set_mju_user_warning(lambda message: _log.info("MuJoCo: %s", message))

WARNINGS = tuple(range(int(mujoco.mjtWarning.mjNWARNING)))
"""All kinds of warnings of MuJoCo."""

BAD_STATE = tuple(int(getattr(mujoco.mjtWarning, f"mjWARN_BAD{what}")) for what in ("QPOS", "QVEL", "QACC"))
"""Warnings of a state that is not finite or huge: MuJoCo resets it then, unless the model forbids it."""


class MujocoRobot(Simulation):
    """A robot in a MuJoCo model, common to plants (`wbc.Plant`) and models of one's own (`wbc.sim.MujocoLoop`).

    Attributes:
        model: MuJoCo's model.
        data: MuJoCo's state; its positions and velocities are up to date after `step`.
        places: Places of joints, base, feet and IMU in the model.
    """

    _signals: MujocoSignals

    def __init__(
        self,
        description: RobotDescription,
        robot: Robot,
        places: RobotPlaces,
        *,
        control_period: float,
        noise: str | SensorNoise,
        seed: int,
        machine: Machine,
        imu: Imu,
        soles: Sequence[str] = (),
        hands: Sequence[str] = (),
    ) -> None:
        """Connect the sensors; see `wbc.sim.plant.signals.MujocoSignals`."""
        self.places, self.model = places, places.model
        self.data = mujoco.MjData(self.model)
        timestep = float(self.model.opt.timestep)
        steps = steps_per_tick(control_period, timestep)
        self._contacts = Contacts(self.model, places.of_robot, places.feet, places.soles)
        super().__init__(
            description,
            robot,
            MujocoSignals(places, imu, self._contacts, steps, machine, soles=soles, hands=hands),
            control_period=control_period,
            timestep=timestep,
            noise=noise,
            seed=seed,
            machine=machine,
        )
        self._handles = handles_of(self.model)
        self._pushed: dict[int, Array] = {}  # body → the pushes' part of the forces in the data, shape (6,)

    @property
    def com_height(self) -> float:
        """Height of the true centre of mass in the world, m: a part of `truth` that costs nothing."""
        return float(self.data.subtree_com[self.places.root, 2])

    @property
    def base_pose(self) -> tuple[float, ...]:
        """True place of the base, x, y, z (m), and its quaternion x, y, z, w: a part of `truth` that costs nothing."""
        start = self.places.base_qpos
        x, y, z, qw, qx, qy, qz = self.data.qpos[start : start + 7].tolist()
        return x, y, z, qx, qy, qz, qw

    @property
    def joint_position(self) -> Array:
        """True positions of the actuated joints now, shape (na,), rad."""
        return np.asarray(self.data.qpos[self.places.joint_qpos])

    @property
    def joint_velocity(self) -> Array:
        """True velocities of the actuated joints now, shape (na,), rad/s."""
        velocity: Array = self.data.qvel.take(self.places.joint_dof)
        return velocity

    @property
    def joint_torque(self) -> Array:
        """Torques of the drives in the last physics step, a new array of shape (na,), Nm."""
        torque: Array = self.data.qfrc_actuator.take(self.places.joint_dof)
        return torque

    @property
    def sole_poses(self) -> Sequence[tuple[Array, Array]]:
        """See `Simulation`."""
        data, poses = self.data, list[tuple[Array, Array]]()
        for body, sole in zip(self.places.feet, self.places.soles, strict=True):
            rotation = data.xmat[body].reshape(3, 3)
            poses.append((data.xpos[body] + rotation @ sole.translation, rotation @ sole.rotation))
        return poses

    def grip(self, hand: str, handle: str) -> None:
        """Close a hand around a handle of the scene: it keeps its distance to the handle, and turns freely about it.

        Args:
            hand: Role of the hand, such as "left_hand".
            handle: Name of the handle's site in the scene, such as "left handle".
        """
        model, data, grip = self.model, self.data, self._grip(hand, handle)
        if data.eq_active[grip]:
            return
        point: Array = data.site_xpos[self._handles[handle]]
        far = float(np.linalg.norm(point - data.site(f"{self.places.prefix}{hand} site").xpos))
        if far > REACH:
            raise InputError(
                f"{hand} must be within {REACH:g} m of {handle} to grip it, it is {far:.3f} m away"
            )
        for body, place in ((model.eq_obj1id[grip], 0), (model.eq_obj2id[grip], 3)):
            rotation = data.xmat[body].reshape(3, 3)
            model.eq_data[grip, place : place + 3] = (point - data.xpos[body]) @ rotation
        data.eq_active[grip] = 1

    def let_go(self, hand: str) -> None:
        """Open a hand, by its role."""
        for handle in self._handles or ("",):
            self.data.eq_active[self._grip(hand, handle)] = 0

    def _grip(self, hand: str, handle: str) -> int:
        """Return the equality by which a hand holds a handle."""
        if not self._handles:
            raise InputError("a plant without a scene has nothing to grip; give scene=")
        names = choose("hand", hand, self.robot.frames), choose("handle", handle, self._handles)
        return int(self.model.equality(f"{self.places.prefix}{' on '.join(names)}").id)

    def _carrier(self, name: str) -> tuple[int, pin.SE3]:
        return self.places.carrier(name)

    def _true_state(self) -> GroundTruth:
        data, places = self.data, self.places
        q = configuration_from_mujoco(data.qpos[places.base_qpos :], places.joint_qpos - places.base_qpos)
        v = velocity_from_mujoco(q, data.qvel[places.base_dof :], places.joint_dof - places.base_dof)
        mujoco.mj_subtreeVel(self.model, data)
        position, force, sole = self._contacts.of_robot()
        return GroundTruth(
            time=self.time,
            q=q,
            v=v,
            com=data.subtree_com[places.root].copy(),
            com_velocity=data.subtree_linvel[places.root].copy(),
            joint_torque=self.joint_torque,
            contact_position=position,
            contact_force=force,
            contact_sole=sole,
            sole_wrench=self._contacts.wrenches(),
        )

    def _checked(self, command: Command) -> Any:
        if self.model.opt.timestep != self.timestep:
            raise InputError(
                f"the physics step of this simulation is {self.timestep:g} s, and that of its model has become "
                f"{self.model.opt.timestep:g} s: make another simulation"
            )
        return super()._checked(command)

    def _set_state(self, q: Array, v: Array | None) -> None:
        """Write configuration and velocity of the robot, at rest when None, into the data."""
        places, data = self.places, self.data
        self._release_pushes()
        places.set_configuration(q, data.qpos)
        places.set_at_rest(data.qvel)
        if v is not None:
            velocity_to_mujoco(q, v, places.joint_dof - places.base_dof, out=data.qvel[places.base_dof :])
            places.couple_velocities(data.qvel)

    def _begin(self) -> None:
        self._release_pushes()
        mujoco.mj_forward(self.model, self.data)
        super()._begin()

    def _begin_signals(self) -> None:
        self._signals.begin(self.data)
        self._sample()

    def _act(self) -> None:
        if self._pushes or self._pushed:
            self._release_pushes()
            for body, force, point in self._push_forces():
                wrench = self._pushed.setdefault(body, np.zeros(6))
                wrench[:3] += force
                if point is not None:
                    data, rotation = self.data, self.data.xmat[body].reshape(3, 3)
                    arm = data.xpos[body] + rotation @ point - data.xipos[body]
                    wrench[3:] += np.cross(arm, force)
            for body, wrench in self._pushed.items():
                self.data.xfrc_applied[body] += wrench

    def _release_pushes(self) -> None:
        """Remove the pushes of the last step from the data; forces that others set stay."""
        for body, wrench in self._pushed.items():
            self.data.xfrc_applied[body] -= wrench
        self._pushed.clear()

    def _record(self, left: int) -> None:
        signals = self._signals
        if left == 0 or signals.of_contacts:
            self._contacts.capture(self.data)
        signals.record(self.data, signals.rows[-1 - left])

    def _sample(self) -> None:
        self._signals.sample(self.data)
        if self.machine.torque_sensors:
            self._signals.joint_torque[:] = self.joint_torque

    def _find_divergence(self, kinds: Sequence[int] = WARNINGS) -> None:
        """Set `diverged` after a step; see `divergence`."""
        if why := divergence(self.data, kinds):
            self.diverged = f"simulation diverged before {self.time:.4f} s ({why})"


def divergence(data: mujoco.MjData, kinds: Sequence[int]) -> str:
    """Return why a simulation has diverged: some of MuJoCo's warnings, or what is not finite; empty if it has not."""
    warned, q, v = data.warning.number.tolist(), data.qpos, data.qvel
    finite = math.isfinite(q.dot(q) + v.dot(v))
    if finite and not any(warned):
        return ""
    names = ", ".join(mujoco.mjtWarning(kind).name for kind in kinds if warned[kind])
    return names if finite or names else "NaN in the state"
