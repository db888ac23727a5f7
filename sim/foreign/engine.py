"""A robot in another physics engine: sensors, drives, pushes and truth over the little that every engine has.

A derived class says how its engine puts the robot somewhere, reads its state, advances, and finds contacts;
`examples/other_engine.py` does it for DART.
"""

from __future__ import annotations

from abc import abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.base.settings import Seed
from wbc.core.conventions import Index
from wbc.core.robot import GRAVITY
from wbc.core.signals import Command
from wbc.robots import RobotDescription
from wbc.robots.registry import as_description
from wbc.sim.plant.places import body_frame
from wbc.sim.simulation.machine import Machine, Step
from wbc.sim.simulation.sensors import NO_NOISE, SensorNoise, SensorVector
from wbc.sim.simulation.simulation import GroundTruth, Simulation, lowest_sole_point

FASTEST = 1e4
"""Speed of a joint, rad/s, or of the base, m/s, from which on a simulation has diverged: 95,000 revolutions a minute
are far beyond any drive."""

STATE_ERROR = 1e-4
"""Error with which an engine keeps what it was put into, m, rad, and their speeds: single precision suffices."""

TOUCHING = 1e-3
"""Height of the soles up to which a robot that is put somewhere stands there, m."""


class EnginePush(NamedTuple):
    """Force on a link during the next physics step.

    Attributes:
        link: Moving link of the robot.
        force: Force in the world, shape (3,), N.
        point: Point of attack in the frame of the link, shape (3,), m.
    """

    link: str
    force: Array
    point: Array


class EngineContacts(NamedTuple):
    """Contacts of the robot in the physics step that has just ended.

    Attributes:
        position: Positions of the contacts in the world, shape (n, 3), m.
        force: Force on the robot at each contact, in the world, shape (n, 3), N.
        sole: Sole of each contact, shape (n,): 0 left, 1 right, −1 for other parts of the robot.
    """

    position: ArrayLike
    force: ArrayLike
    sole: ArrayLike


class EngineLoop(Simulation):
    """Base of simulations in other physics engines; a derived class builds the robot in `__init__` and calls `reset`.

    Its only ground is the floor at z = 0. In each physics step the drives apply kp (q_ref − q) + kd (q̇_ref − q̇) + τ,
    within the torque limits. The accelerometer is the mean acceleration, which agrees with the change of the velocity.

    Attributes:
        soles: Moving link that carries each sole, left first, and the sole frame in it.
    """

    @checked
    def __init__(
        self,
        description: RobotDescription | str,
        *,
        control_period: Step = 0.002,
        timestep: Step = 0.001,
        noise: str | SensorNoise = NO_NOISE,
        seed: Seed = 0,
        machine: Machine | None = None,
    ) -> None:
        """Prepare all parts except the engine.

        Args:
            description: The robot, or the name of one. It must not have coupled joints or closed chains: lock these
                joints, or leave them out.
            control_period: Time between two commands, s; a whole multiple of the physics step.
            timestep: Physics step, s.
            noise: Sensor errors, or the name of a preset: "none", "realistic".
            seed: Seed of every random draw.
            machine: Delays, and which sensors exist; when None, torques are measured.
        """
        machine = machine or Machine(torque_sensors=True)
        machine.check_loop("another engine")
        description = as_description(description)
        description.needs_feet("a loop with sensors of a humanoid")
        if description.couplings or description.closures:
            raise InputError(
                f"an EngineLoop has no coupled joints and no closed chains, and robot '{description.name}' has: "
                f"{', '.join((*description.couplings, *(each.name for each in description.closures)))}"
            )
        robot = description.robot()
        super().__init__(
            description,
            robot,
            SensorVector(robot.na, len(robot.soles), machine),
            control_period=control_period,
            timestep=timestep,
            noise=noise,
            seed=seed,
            machine=machine,
        )
        self.soles = tuple(description.attachment(sole.frame) for sole in robot.soles)
        self._model, self._data = robot.model, robot.model.createData()
        self._imu = robot.frame_id(robot.imu_frame)
        self._sole_frames = [robot.frame_id(sole.frame) for sole in robot.soles]
        self._kp, self._kd = np.array(description.kp), np.array(description.kd)
        self._least, self._most = np.array(robot.torque_lower), np.array(robot.torque_upper)
        self._torque = np.zeros(robot.na)
        self._motion: deque[tuple[Array, Array]] = deque(maxlen=self.steps + 1)  # of the IMU
        self._wrenches: deque[Array] = deque(maxlen=self.steps)

    @abstractmethod
    def place(self, q: Array) -> None:
        """Put the robot into a configuration, shape (nq,), in Pinocchio's convention, at rest."""

    @abstractmethod
    def state(self) -> tuple[Array, Array]:
        """Return configuration, shape (nq,), and velocity, shape (nv,), in Pinocchio's convention.

        The quaternion of the base is x, y, z, w; its velocity, [linear; angular], is that of the origin of its link, in
        the axes of this link.
        """

    @abstractmethod
    def advance(self, torque: Array, pushes: Sequence[EnginePush]) -> None:
        """Advance by one physics step under joint torques, shape (na,), Nm, and forces.

        An engine with servos of its own may use `command` instead.
        """

    @abstractmethod
    def contacts(self) -> EngineContacts:
        """Return the contacts of the physics step that has just ended."""

    @property
    def sole_poses(self) -> Sequence[tuple[Array, Array]]:
        """See `Simulation`."""
        places = [self._data.oMf[frame] for frame in self._sole_frames]
        return [(place.translation.copy(), place.rotation.copy()) for place in places]

    @property
    def command(self) -> Command:
        """Command that the drives follow now: the last one, less the delay of the machine."""
        return self._command

    def _true_state(self) -> GroundTruth:
        com = pin.centerOfMass(self._model, self._data, self._q, self._v)
        position, force, sole = self._touched
        return GroundTruth(
            time=self.time,
            q=self._q.copy(),
            v=self._v.copy(),
            com=com.copy(),
            com_velocity=self._data.vcom[0].copy(),
            joint_torque=self._torque.copy(),
            contact_position=position,
            contact_force=force,
            contact_sole=sole,
            sole_wrench=self._wrenches[-1].copy(),
        )

    def _carrier(self, name: str) -> tuple[str, pin.SE3]:
        return self.description.attachment(body_frame(name, self.robot))

    def _place(self, q: Array, v: Array | None) -> None:
        if v is not None and v.any():
            raise InputError(f"{type(self).__name__} starts at rest, and has no velocity at the start")
        self.place(q.copy())
        self._check_state(q)

    def _check_state(self, q: Array) -> None:
        """Refuse an engine whose `state` is not what it was put into by `place`, at rest."""
        there, v = (np.asarray(part, dtype=float) for part in self.state())
        name, robot = type(self).__name__, self.robot
        if np.shape(there) != q.shape or np.shape(v) != (robot.nv,):
            raise InputError(
                f"{name}.state must return arrays of shapes ({robot.nq},) and ({robot.nv},), got {np.shape(there)} and "
                f"{np.shape(v)}"
            )
        off = there - q
        if there[3:7] @ q[3:7] < 0.0:  # the same rotation
            off[3:7] = there[3:7] + q[3:7]
        worst, moving = int(np.argmax(np.abs(off))), float(np.abs(v).max())
        if not (abs(off[worst]) < STATE_ERROR and moving < STATE_ERROR):
            parts = (*("x", "y", "z"), *(f"quaternion {i}" for i in "xyzw"), *robot.joint_names)
            raise InputError(
                f"{name}.state must return the configuration that place was given, at rest: {parts[worst]} is "
                f"{there[worst]:.6g} instead of {q[worst]:.6g}, and the largest velocity is {moving:.3g}; the place "
                "of the base is the origin of its link, not its centre of mass, and joints are in the robot's order"
            )

    def _begin_signals(self) -> None:
        robot = self.robot
        self._command, self._torque = self.hold(), np.zeros(robot.na)
        self._motion.clear()
        self._look()
        wrench = np.zeros((len(self.soles), 6))
        if lowest_sole_point(robot, self._q) < TOUCHING:
            wrench[:, 2] = robot.mass * GRAVITY / len(self.soles)
        self._wrenches.clear()
        self._wrenches.append(wrench)
        self._touched = np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.intp)
        self._sample()

    def _follow(self, order: Command) -> None:
        self._command = order

    def _act(self) -> None:
        self._torque = self._drive(self._command)
        self._forces = [
            EnginePush(link, force, self._centre(link) if point is None else point)
            for link, force, point in self._push_forces()
        ]

    def _centre(self, link: str) -> Array:
        """Return the centre of mass of a moving link, in its frame, shape (3,), m."""
        joint = self._model.frames[self.robot.frame_id(link)].parentJoint
        return np.array(self._model.inertias[joint].lever)

    def _drive(self, command: Command) -> Array:
        """Return the torques of all drives, shape (na,), Nm, at the present state."""
        torque = command.drive_torque(self._q[7:], self._v[6:], (self._kp, self._kd))
        return np.clip(torque, self._least, self._most)

    def _integrate(self) -> None:
        self.advance(self._torque.copy(), self._forces)

    def _record(self, left: int) -> None:
        if not self._look():
            return
        position, force, sole = self.contacts()
        given = np.array(position, dtype=float), np.array(force, dtype=float), np.array(sole, dtype=np.intp)
        count = given[2].size
        shapes = (count, 3), (count, 3), (count,)
        if any(part.shape != shape for part, shape in zip(given, shapes, strict=True) if count or part.size):
            raise InputError(
                f"{type(self).__name__}.contacts must return a point, a force and a sole for each contact, of shapes "
                f"(n, 3), (n, 3) and (n,), got {', '.join(str(each.shape) for each in given)}"
            )
        self._touched = touched = given[0].reshape(shapes[0]), given[1].reshape(shapes[1]), given[2].ravel()
        if touched[2].size and not -1 <= touched[2].min() <= touched[2].max() < len(self.soles):
            raise InputError(
                f"{type(self).__name__}.contacts must return 0 for the left sole, 1 for the right one and -1 for other "
                f"parts of the robot, got {np.unique(touched[2]).tolist()}"
            )
        self._wrenches.append(self._sole_wrenches(*touched))

    def _look(self) -> bool:
        """Read the state of the engine; False if the simulation has diverged."""
        self._q, self._v = (np.array(part, dtype=float) for part in self.state())
        if not (np.isfinite(self._q).all() and np.abs(self._v).max() < FASTEST):
            self.diverged = f"simulation diverged in the period after {self.time:.4f} s"
            return False
        model, data = self._model, self._data
        pin.forwardKinematics(model, data, self._q, self._v)
        for frame in (self._imu, *self._sole_frames):
            pin.updateFramePlacement(model, data, frame)
        self._imu_motion = pin.getFrameVelocity(model, data, self._imu, pin.LOCAL)
        rotation = data.oMf[self._imu].rotation.copy()
        self._motion.append((rotation, rotation @ self._imu_motion.linear))
        return True

    def _sample(self) -> None:
        """Write the present signals: the mean of the specific force is the change of the velocity in a period."""
        signals = self._signals
        (before, slow), (after, fast) = self._motion[0], self._motion[-1]
        time = (len(self._motion) - 1) * self.timestep
        specific = (fast - slow) / time if time > 0.0 else np.zeros(3)
        specific[2] += GRAVITY
        signals.joint_position[:], signals.joint_velocity[:] = self._q[7:], self._v[6:]
        signals.angular_velocity[:] = self._imu_motion.angular
        signals.specific_force[:] = 0.5 * (before + after).T @ specific
        signals.sole_wrench[:] = np.mean(self._wrenches, axis=0)
        if self.machine.torque_sensors:
            signals.joint_torque[:] = self._torque

    def _sole_wrenches(self, position: Array, force: Array, sole: Index) -> Array:
        """Return the wrench on each sole, [force; moment] in its frame at its centre, shape (soles, 6)."""
        wrenches = np.zeros((len(self.soles), 6))
        for i, frame in enumerate(self._sole_frames):
            mine = sole == i
            if mine.any():
                place = self._data.oMf[frame]
                there = (position[mine] - place.translation) @ place.rotation
                pull = force[mine] @ place.rotation
                wrenches[i, :3], wrenches[i, 3:] = pull.sum(axis=0), np.cross(there, pull).sum(axis=0)
        return wrenches
