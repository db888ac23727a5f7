"""A robot in another physics engine: sensors, drives, pushes and truth over the little that every engine has.

A derived class says how its engine puts the robot somewhere, reads its state, advances, and finds contacts;
`examples/other_engine.py` does it for DART.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.checked import checked, fixed, result
from wbc.base.errors import InputError, MeasurementError, shown
from wbc.base.numbers import Array, finite_array, positive
from wbc.base.settings import Seed
from wbc.core.robot import GRAVITY, checked_configuration
from wbc.core.signals import Command, Measurement
from wbc.ground import PointCloud
from wbc.robots import RobotDescription
from wbc.robots.registry import as_description
from wbc.sim.loop.floor import lowest_sole_point
from wbc.sim.plant.drives import delays
from wbc.sim.plant.places import body_frame
from wbc.sim.plant.robot import ANOTHER, DivergedError, check_period
from wbc.sim.plant.sensors import NO_NOISE, NOISE_PRESETS, SensorChain, SensorNoise
from wbc.sim.plant.settings import Machine, SoleIndex, Step, steps_per_tick
from wbc.sim.plant.truth import GroundTruth

FASTEST = 1e4
"""Speed of a joint, rad/s, or of the base, m/s, from which on a simulation has diverged."""

SAME_PLACE = 1e-4
"""Error with which an engine keeps what it was put into, m, rad, and their speeds: single precision suffices."""

TOUCHING = 1e-3
"""Height of the soles up to which a robot that is put somewhere stands there, m."""

_OVER = 1e-12
"""Remaining time at which a push is over, s."""


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

    position: Any
    force: Any
    sole: Any


@dataclass
class _Push:
    link: str
    force: Array
    point: Array
    remaining: float


class EngineLoop(ABC):
    """Base of loops for other physics engines; a derived class builds the robot in `__init__` and calls `reset`.

    Its only ground is the floor at z = 0. Encoders, joint velocities and gyroscope are read at the end of the control
    period. Wrenches and accelerometer are means over the last control period, because hard contacts chatter within a
    period, and a single reading of the accelerometer would differ from the mean acceleration. Sensor errors and delays
    are those of a `wbc.Plant`. In each physics step the drives apply kp (q_ref − q) + kd (q̇_ref − q̇) + τ, within the
    torque limits.

    Attributes:
        description: The robot as data; `robot` is its model.
        control_period: Time that `step` advances, s; `steps` physics steps of `timestep`.
        soles: Moving link that carries each sole, left first, and the sole frame in it.
        diverged: Reason why the simulation has diverged; None while it has not.
        joint_torque: Torques of the drives in the last physics step, shape (na,), Nm.
        noise: Sensor errors; `seed` is the seed of their draws.
        machine: Delays, and which sensors exist.
        ticks: Control periods since the start.
    """

    control_period: float = fixed(ANOTHER)
    timestep: float = fixed(ANOTHER)
    steps: int = fixed(ANOTHER)
    seed: int = result("_seed", "give another seed to its `reset`")

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
        self.description = description = as_description(description)
        description.needs_feet("a loop with sensors of a humanoid")
        if description.couplings or description.closures:
            raise InputError(
                f"an EngineLoop has no coupled joints and no closed chains, and robot '{description.name}' has: "
                f"{', '.join((*description.couplings, *(each.name for each in description.closures)))}"
            )
        self.control_period, self.timestep = float(control_period), float(timestep)
        self.steps = steps_per_tick(control_period, timestep)
        self.robot = robot = description.robot()
        self.noise = NOISE_PRESETS[noise] if isinstance(noise, str) else noise
        self._seed, self.machine = seed, machine
        self.soles = tuple(description.attachment(sole.frame) for sole in robot.soles)
        self.diverged: str | None = None
        self.joint_torque = np.zeros(robot.na)
        self.ticks = 0
        self._model, self._data = robot.model, robot.model.createData()
        self._imu = robot.frame_id(robot.imu_frame)
        self._sole_frames = [robot.frame_id(sole.frame) for sole in robot.soles]
        self._kp, self._kd = np.array(description.kp), np.array(description.kd)
        self._least, self._most = np.array(robot.torque_lower), np.array(robot.torque_upper)
        self._age, self._late = delays(machine, self.timestep)
        self._chain = SensorChain(
            self.noise,
            robot.na,
            len(robot.soles),
            self.timestep,
            self.steps,
            delay=machine.measurement_delay,
            torques=machine.torque_sensors,
        )
        self._values = np.zeros(self._chain.size)
        self._motion: deque[tuple[Array, Array]] = deque(maxlen=self.steps + 1)  # of the IMU
        self._wrenches: deque[Array] = deque(maxlen=self.steps)
        self._pushes: list[_Push] = []

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
    def time(self) -> float:
        """Simulated time since the start, s."""
        return self.ticks * self.control_period

    @property
    def command(self) -> Command:
        """Present command."""
        return self._command

    @property
    def com_height(self) -> float:
        """Height of the true centre of mass, m."""
        return float(pin.centerOfMass(self._model, self._data, self._q)[2])

    @property
    def base_pose(self) -> tuple[float, ...]:
        """True pose of the base: position x, y, z (m) and quaternion x, y, z, w."""
        return tuple(self._q[:7].tolist())

    @property
    def joint_position(self) -> Array:
        """True positions of the actuated joints now, shape (na,), rad."""
        return self._q[7:]

    @property
    def joint_velocity(self) -> Array:
        """True velocities of the actuated joints now, shape (na,), rad/s."""
        return self._v[6:]

    @checked
    def sole_pose(self, side: SoleIndex) -> tuple[Array, Array]:
        """Return the true centre, shape (3,), m, and the rotation, shape (3, 3), of a sole, 0 left, 1 right."""
        place = self._data.oMf[self._sole_frames[side]]
        return place.translation.copy(), place.rotation.copy()

    def on_ground(self, configuration: ArrayLike) -> Array:
        """Return a configuration, shape (nq,), moved up or down until its lowest sole touches the floor."""
        q = checked_configuration("configuration", configuration, self.robot.nq)
        q[2] -= lowest_sole_point(self.robot, q)
        return q

    @checked
    def reset(self, configuration: ArrayLike | None = None, seed: Seed | None = None) -> None:
        """Restart at time zero and at rest, servos holding the configuration, without pushes.

        Args:
            configuration: Start of the robot, shape (nq,); half-sitting on the floor when None.
            seed: New seed; the same as before when None.
        """
        if configuration is None:
            q = self.on_ground(self.robot.half_sitting)
        else:
            q = checked_configuration("configuration", configuration, self.robot.nq)
            self.robot.check_range("position of joint", range(self.robot.na), q[7:], beyond=math.tau)
        if seed is not None:
            self._seed = seed
        q[3:7] /= np.linalg.norm(q[3:7])
        self._start = q
        self._pushes.clear()
        if self._late is not None:
            self._late.clear()
        self.diverged, self.ticks = None, 0
        self._command = self.hold()
        self.joint_torque = np.zeros(self.robot.na)
        self.place(q.copy())
        self._check_state(q)
        self._motion.clear()
        self._look()
        wrench = np.zeros((len(self.soles), 6))
        if lowest_sole_point(self.robot, q) < TOUCHING:
            wrench[:, 2] = self.robot.mass * GRAVITY / len(self.soles)
        self._wrenches.clear()
        self._wrenches.append(wrench)
        self._touched = EngineContacts(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.intp))
        self._sample()
        self._chain.reset(self._values, self.seed)
        self._measurement: Measurement | None = None
        self._truth: GroundTruth | None = None

    def _check_state(self, q: Array) -> None:
        """Refuse an engine whose `state` is not what it was put into by `place`, at rest."""
        there, v = self.state()
        name, robot = type(self).__name__, self.robot
        if np.shape(there) != q.shape or np.shape(v) != (robot.nv,):
            raise InputError(
                f"{name}.state must return arrays of shapes ({robot.nq},) and ({robot.nv},), got {np.shape(there)} and "
                f"{np.shape(v)}"
            )
        off = np.array(there) - q
        if there[3:7] @ q[3:7] < 0.0:  # the same rotation
            off[3:7] = there[3:7] + q[3:7]
        worst, moving = int(np.argmax(np.abs(off))), float(np.abs(v).max())
        if not (abs(off[worst]) < SAME_PLACE and moving < SAME_PLACE):
            parts = (*("x", "y", "z"), *(f"quaternion {i}" for i in "xyzw"), *robot.joint_names)
            raise InputError(
                f"{name}.state must return the configuration that place was given, at rest: {parts[worst]} is "
                f"{there[worst]:.6g} instead of {q[worst]:.6g}, and the largest velocity is {moving:.3g}; the place "
                "of the base is the origin of its link, not its centre of mass, and joints are in the robot's order"
            )

    def hold(self) -> Command:
        """Return a command that holds the posture of the last reset with the servos."""
        zero = np.zeros(self.robot.na)
        return Command(zero, np.array(self._start[7:]), zero)

    def push(self, body: str, force: ArrayLike, duration: float, at: ArrayLike | None = None) -> None:
        """Start to push a body of the robot with a constant force; several pushes add up.

        Args:
            body: Link or frame of the robot; "torso" and "base" are its torso and base frames.
            force: Force in the world, shape (3,), N.
            duration: s.
            at: Point of attack in the frame of that body, shape (3,), m; the centre of mass of its moving link when
                None.
        """
        frame = body_frame(body, self.robot)
        link, place = self.description.attachment(frame)
        joint = self._model.frames[self.robot.frame_id(frame)].parentJoint
        point = self._model.inertias[joint].lever
        if at is not None:
            point = place.act(finite_array("point of attack (m)", at, (3,)))
        self._pushes.append(
            _Push(
                link,
                finite_array("force of the push (N)", force, (3,)),
                np.array(point),
                positive("duration of the push (s)", duration),
            )
        )

    def measure(self) -> Measurement:
        """Return the readings of the sensors now; the same object until the next step.

        Raises:
            MeasurementError: The simulation has diverged.
        """
        if self._measurement is None:
            if self.diverged is not None:
                raise MeasurementError(f"no measurement at {self.time:.4f} s: {self.diverged}")
            reading, na, soles = self._chain.read(self._values), self.robot.na, len(self.soles)
            reading.setflags(write=False)
            end = 2 * na + 6 + 6 * soles
            wrenches = reading[2 * na + 6 : end].reshape(-1, 6)
            self._measurement = Measurement(
                self.time - self._age,
                reading[:na],
                reading[na : 2 * na],
                reading[2 * na : 2 * na + 3],
                reading[2 * na + 3 : 2 * na + 6],
                wrenches if self.machine.force_sensors else None,
                joint_torque=reading[end:] if self.machine.torque_sensors else None,
            )
        return self._measurement

    def clouds(self) -> list[PointCloud]:
        """Return no clouds of the ground, since this loop has no eyes."""
        return []

    def truth(self) -> GroundTruth:
        """Return the true state now, for logs, tests and pictures; the same object until the next step."""
        if self._truth is None:
            com = pin.centerOfMass(self._model, self._data, self._q, self._v)
            self._truth = GroundTruth(
                time=self.time,
                q=self._q.copy(),
                v=self._v.copy(),
                com=com.copy(),
                com_velocity=self._data.vcom[0].copy(),
                joint_torque=self.joint_torque.copy(),
                contact_position=np.asarray(self._touched.position),
                contact_force=np.asarray(self._touched.force),
                contact_sole=np.asarray(self._touched.sole),
                sole_wrench=self._wrenches[-1].copy(),
            )
        return self._truth

    def step(self, command: Command) -> None:
        """Advance by one control period under a command.

        Args:
            command: References of the servos and feed-forward torque, or, in torque control, only the torque.

        Raises:
            InputError: The command has a wrong shape, is not finite, or has negative gains. The simulation has not
                advanced.
            DivergedError: The simulation has diverged before; `diverged` says why.
        """
        if self.diverged is not None:
            raise DivergedError(f"the simulation cannot go on: {self.diverged}; reset it")
        if not isinstance(command, Command):
            raise InputError(f"a loop takes a Command, got {shown(command)}")
        command = command.check(self.robot.joint_names)
        check_period(command, self.control_period)
        self._measurement = self._truth = None
        if self._late is None:
            self._command = command
        else:
            self._late.push(command)
        for left in reversed(range(self.steps)):
            if self._late is not None and (due := self._late.advance()) is not None:
                self._command = due
            self.joint_torque = self._drive(self._command)
            self.advance(self.joint_torque, self._forces())
            if not self._look():
                break
            position, force, sole = self.contacts()
            self._touched = EngineContacts(
                np.asarray(position, dtype=float).reshape(-1, 3),
                np.asarray(force, dtype=float).reshape(-1, 3),
                np.asarray(sole, dtype=np.intp),
            )
            if len({len(each) for each in self._touched}) > 1:
                raise InputError(
                    f"{type(self).__name__}.contacts must return a point, a force and a sole for each contact, got "
                    + ", ".join(str(len(each)) for each in self._touched)
                )
            self._wrenches.append(self._sole_wrenches(self._touched))
            if self._chain.newest <= left <= self._chain.oldest:
                self._sample()
                self._chain.push(self._values)
        self.ticks += 1

    def _drive(self, command: Command) -> Array:
        """Return the torques of all drives, shape (na,), Nm, at the present state."""
        torque = command.joint_torque
        if command.joint_position is not None:
            kp = self._kp if command.kp is None else command.kp
            kd = self._kd if command.kd is None else command.kd
            rate = 0.0 if command.joint_velocity is None else command.joint_velocity
            torque = torque + kp * (command.joint_position - self._q[7:]) + kd * (rate - self._v[6:])
        elif command.kd is not None:  # damped torques
            torque = torque - command.kd * self._v[6:]
        return np.clip(torque, self._least, self._most)

    def _forces(self) -> list[EnginePush]:
        """Return the pushes of the coming physics step; one that ends within it acts with a share of its force."""
        forces = []
        for push in self._pushes:
            share = min(1.0, push.remaining / self.timestep)
            forces.append(EnginePush(push.link, share * push.force, push.point))
            push.remaining -= self.timestep
        self._pushes = [push for push in self._pushes if push.remaining > _OVER]
        return forces

    def _look(self) -> bool:
        """Read the state of the engine; False if the simulation has diverged."""
        self._q, self._v = self.state()
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
        na, values = self.robot.na, self._values
        (before, slow), (after, fast) = self._motion[0], self._motion[-1]
        time = (len(self._motion) - 1) * self.timestep
        specific = (fast - slow) / time if time > 0.0 else np.zeros(3)
        specific[2] += GRAVITY
        values[:na], values[na : 2 * na] = self._q[7:], self._v[6:]
        values[2 * na : 2 * na + 3] = self._imu_motion.angular
        values[2 * na + 3 : 2 * na + 6] = 0.5 * (before + after).T @ specific
        end = 2 * na + 6 + 6 * len(self.soles)
        values[2 * na + 6 : end] = np.mean(self._wrenches, axis=0).ravel()
        if self.machine.torque_sensors:
            values[end:] = self.joint_torque

    def _sole_wrenches(self, contacts: EngineContacts) -> Array:
        """Return the wrench on each sole, [force; moment] in its frame at its centre, shape (soles, 6)."""
        position, force, sole = (np.asarray(each) for each in contacts)
        wrenches = np.zeros((len(self.soles), 6))
        for i, frame in enumerate(self._sole_frames):
            mine = sole == i
            if mine.any():
                place = self._data.oMf[frame]
                there, pull = (
                    (position[mine] - place.translation) @ place.rotation,
                    force[mine] @ place.rotation,
                )
                wrenches[i, :3], wrenches[i, 3:] = pull.sum(axis=0), np.cross(there, pull).sum(axis=0)
        return wrenches
