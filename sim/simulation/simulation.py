"""A simulated robot as its controller sees it: a `Measurement` out, a `Command` in, once in each control period."""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.checked import checked, fixed, result
from wbc.base.errors import InputError, MeasurementError, WbcError, shown
from wbc.base.numbers import ROUNDING, Array, finite_array, finite_scalar
from wbc.base.settings import Seed
from wbc.core.conventions import Index
from wbc.core.robot import Robot
from wbc.core.signals import Command, Measurement
from wbc.ground import PointCloud
from wbc.robots import RobotDescription
from wbc.sim.simulation.machine import Machine, SoleIndex, Step, steps_per_tick, whole_steps
from wbc.sim.simulation.sensors import NOISE_PRESETS, SensorChain, SensorNoise, SensorVector
from wbc.tasks.stabilizer.pendulum import MIN_FORCE

ANOTHER = "make another simulation"
"""Advice in place of an assignment to an attribute that a simulation is made of."""

_OVER = 1e-12
"""Remaining time at which a push is over, s."""


class DivergedError(WbcError):
    """Step of a simulation that has diverged, whose state has no meaning any more."""


@dataclass(frozen=True, slots=True)
class GroundTruth:
    """The true state of a simulation at one instant, for logs, tests and pictures, never for a controller.

    Its arrays are read-only.

    Attributes:
        time: Time, s.
        q: Configuration, shape (nq,), in Pinocchio's convention.
        v: Velocity, shape (nv,), base in the base frame.
        com: Centre of mass of everything, feet included, in the world, shape (3,), m.
        com_velocity: Its velocity in the world, shape (3,), m/s.
        joint_torque: Torque of the drives in the physics step that ended now, after the torque limit, shape (na,), Nm.
        contact_position: Points of contact with ground and things in that step, in the world, shape (n, 3), m.
        contact_force: Force on the robot at each contact, in the world, shape (n, 3), N.
        contact_sole: Index of the sole that each contact belongs to, −1 for other parts, shape (n,).
        sole_wrench: Sum of the contacts of each sole, [force; moment] in the sole frame at the sole centre,
            shape (number of soles, 6), N and Nm; without the weight of the foot, which the sensor includes.
    """

    time: float
    q: Array
    v: Array
    com: Array
    com_velocity: Array
    joint_torque: Array
    contact_position: Array
    contact_force: Array
    contact_sole: Index
    sole_wrench: Array

    def __post_init__(self) -> None:
        for name in self.__slots__[1:]:
            getattr(self, name).setflags(write=False)

    @property
    def other_force(self) -> Array:
        """Force of the surroundings on all but the soles, in the world, shape (3,), N."""
        return np.asarray(self.contact_force[self.contact_sole < 0].sum(axis=0))

    @property
    def centre_of_pressure(self) -> Array:
        """Mean of the contact points by their vertical forces, in the world, shape (3,), m; NaN for less than 1 N.

        On level ground it is the zero-tilting moment point (Sardain & Bessonnet, IEEE T-SMC-A 34(5), 2004).
        """
        load = self.contact_force[:, 2]
        if load.sum() < MIN_FORCE:
            return np.full(3, np.nan)
        return np.asarray(load @ self.contact_position / load.sum())


@dataclass
class _Push:
    body: Any  # as the engine names it
    force: Array  # in the world, N
    point: Array | None  # of attack in the body, m; None for its centre of mass
    remaining: float  # s


class Simulation(ABC):
    """A simulated robot, a loop that is measured, commanded, pushed and reset alike in every physics engine.

    Encoders, joint velocities and gyroscope are those of the present instant; accelerometer and forces are the mean
    over the control period that ended now, like the output of an anti-aliasing filter: hard contacts chatter within a
    period, and single samples of that mislead the controller.

    A derived class says how its engine puts the robot somewhere, advances it, and reads it.

    Attributes:
        description: The robot as data.
        robot: Its model, for names and sizes; its state is not kept up to date.
        control_period: Time that `step` advances, s; `steps` physics steps.
        timestep: Physics step, s.
        diverged: Reason why the simulation has diverged; None while it has not.
        noise: Sensor errors; `seed` is the seed of their draws.
        machine: Delays, and which sensors exist.
        ticks: Control periods since the start.
    """

    timestep: float = fixed(ANOTHER)
    control_period: float = fixed(ANOTHER)
    steps: int = fixed(ANOTHER)
    seed: int = result("_seed", "give another seed to its `reset`")

    _shared = False  # with other robots, all of which take a step or begin anew together

    @checked
    def __init__(
        self,
        description: RobotDescription,
        robot: Robot,
        signals: SensorVector,
        *,
        control_period: Step,
        timestep: Step,
        noise: str | SensorNoise,
        seed: Seed,
        machine: Machine,
    ) -> None:
        """Connect sensors, delays and pushes; `signals` are the true ones of all sensors, and both times are in s."""
        self.description, self.robot = description, robot
        self.control_period, self.timestep = float(control_period), float(timestep)
        self.steps = steps_per_tick(control_period, timestep)
        self.noise = NOISE_PRESETS[noise] if isinstance(noise, str) else noise
        self._seed, self.machine = seed, machine
        self.diverged: str | None = None
        self.ticks = 0
        self._signals = signals
        self._chain = SensorChain(self.noise, signals, timestep, self.steps, delay=machine.measurement_delay)
        self._age = whole_steps(machine.measurement_delay, timestep) * timestep  # of a measurement, s
        self._delay = whole_steps(machine.command_delay, timestep)
        self._late: deque[list[Any]] = deque()  # orders that wait, each with the steps until it acts
        self._pushes: list[_Push] = []  # those that act now
        self._posture = robot.half_sitting[7:]
        self._ground = 0.0  # height of the floor, m
        self._no_feet = np.full(len(robot.soles), np.nan)
        self._measurement: Measurement | None = None
        self._truth: GroundTruth | None = None

    # State

    @property
    def time(self) -> float:
        """Simulated time since the start, s."""
        return self.ticks * self.control_period

    @property
    def com_height(self) -> float:
        """Height of the true centre of mass in the world, m."""
        return float(self.truth().com[2])

    @property
    def base_pose(self) -> tuple[float, ...]:
        """True pose of the base: position x, y, z (m) and quaternion x, y, z, w."""
        return tuple(self.truth().q[:7].tolist())

    @property
    def joint_position(self) -> Array:
        """True positions of the actuated joints now, shape (na,), rad."""
        return self.truth().q[7:]

    @property
    def joint_velocity(self) -> Array:
        """True velocities of the actuated joints now, shape (na,), rad/s."""
        return self.truth().v[6:]

    @property
    def joint_torque(self) -> Array:
        """Torques of the drives in the last physics step, shape (na,), Nm."""
        return self.truth().joint_torque

    @property
    @abstractmethod
    def sole_poses(self) -> Sequence[tuple[Array, Array]]:
        """True centre, shape (3,), m, and rotation, shape (3, 3), of each sole, left first; for reading only."""

    @checked
    def sole_pose(self, side: SoleIndex) -> tuple[Array, Array]:
        """Return a copy of the true centre, shape (3,), m, and rotation, shape (3, 3), of a sole, 0 left, 1 right."""
        centre, rotation = self.sole_poses[side]
        return centre.copy(), rotation.copy()

    def truth(self) -> GroundTruth:
        """Return the true state now, for logs, tests and pictures; the same object until the next step."""
        if self._truth is None:
            self._truth = self._true_state()
        return self._truth

    @abstractmethod
    def _true_state(self) -> GroundTruth:
        """Return the true state now."""

    # Sensors

    def measure(self) -> Measurement:
        """Return the readings of the sensors now; the same object until the next step.

        Raises:
            MeasurementError: The simulation has diverged.
        """
        if self._measurement is None:
            reading = self._chain.read(self._signals.values)
            if self.diverged is not None or not math.isfinite(reading.dot(reading)):
                raise MeasurementError(
                    f"no measurement at {self.time:.4f} s: {self.diverged or 'a sensor is not finite'}"
                )
            reading.setflags(write=False)
            self._measurement = self._signals.measurement(
                reading, self.time - self._age, *self._foot_readings()
            )
        return self._measurement

    def _foot_readings(self) -> tuple[Array, Array]:
        """Return ranges (m) and stiffness (Nm/rad) of the soles, both of shape (soles,); NaN where there are none."""
        return self._no_feet.copy(), self._no_feet.copy()

    def clouds(self) -> list[PointCloud]:
        """Return the clouds of points of the ground that have come since the last call; empty without eyes."""
        return []

    # Pushes

    @checked
    def push(self, body: str, force: ArrayLike, duration: float, at: ArrayLike | None = None) -> None:
        """Start to push a body of the robot with a constant force; several pushes add up.

        Args:
            body: Link or frame of the robot; "torso" and "base" are its torso and base frames.
            force: Force in the world, shape (3,), N.
            duration: Duration, s.
            at: Point of attack in the frame of that body, shape (3,), m; the centre of mass of its link when None.
        """
        carrier, frame = self._carrier(body)
        point = None if at is None else frame.act(finite_array("point of attack (m)", at, (3,)))
        pull = finite_array("force of the push (N)", force, (3,))
        remaining = finite_scalar("duration of the push (s)", duration, above=0.0)
        self._pushes.append(_Push(carrier, pull, point, remaining))

    def _push_forces(self) -> list[tuple[Any, Array, Array | None]]:
        """Return body, force (N) and point (m) of each push in the coming physics step.

        A push that ends within the step acts with the share of its force that gives the same impulse.
        """
        forces = []
        for push in self._pushes:
            forces.append((push.body, min(1.0, push.remaining / self.timestep) * push.force, push.point))
            push.remaining -= self.timestep
        self._pushes = [push for push in self._pushes if push.remaining > _OVER]
        return forces

    @abstractmethod
    def _carrier(self, name: str) -> tuple[Any, pin.SE3]:
        """Return the body that carries a link or frame, as the engine names it, and the frame's placement in it."""

    # Reset and hold

    @checked
    def reset(
        self,
        configuration: ArrayLike | None = None,
        seed: Seed | None = None,
        *,
        velocity: ArrayLike | None = None,
    ) -> None:
        """Restart at time zero without pushes; the servos hold the configuration.

        Args:
            configuration: Start of the robot, shape (nq,), used as it is; the usual start on the ground when None.
            seed: New seed; the same as before when None.
            velocity: Velocity at the start, shape (nv,), with that of the base in the base frame; zero when None.

        Raises:
            InputError: A configuration or velocity has a wrong shape, is not finite or has no unit quaternion, or the
                robot cannot be there. The simulation stays as it is.
        """
        self._check_alone("reset")
        self._put(configuration, velocity)
        if seed is not None:
            self._seed = seed
        self._begin()

    def _check_alone(self, method: str) -> None:
        """Refuse what one of several robots in one simulation cannot do alone."""
        if self._shared:
            raise InputError(
                f"a robot of a SharedPlant cannot {method} alone: all of its robots do so together, by `{method}` of "
                "the plant"
            )

    def _put(self, configuration: ArrayLike | None, velocity: ArrayLike | None = None) -> None:
        """Check configuration and velocity of `reset`, and place the robot there."""
        v = None if velocity is None else finite_array("velocity", velocity, (self.robot.nv,))
        given = self._usual_start() if configuration is None else configuration
        q = self.robot.check_configuration("configuration", given)
        self.robot.check_range("position of joint", range(self.robot.na), q[7:], beyond=math.tau)
        q[3:7] /= np.linalg.norm(q[3:7])
        self._place(q, v)
        self._posture = q[7:].copy()

    def _usual_start(self) -> Array:
        """Return the configuration of a reset that is given none, shape (nq,)."""
        return self.on_ground(self.robot.half_sitting)

    def on_ground(self, configuration: ArrayLike) -> Array:
        """Return a configuration, shape (nq,), moved up or down until its lowest sole touches the ground."""
        q = self.robot.check_configuration("configuration", configuration)
        q[2] += self._ground - lowest_sole_point(self.robot, q)
        return q

    @abstractmethod
    def _place(self, q: Array, v: Array | None) -> None:
        """Put the robot there with a velocity, at rest when None; raise an `InputError` before anything changes."""

    def _begin(self) -> None:
        """Forget what was before: the state is set, and so are the drives."""
        self._pushes.clear()
        self._late.clear()
        self.diverged, self.ticks = None, 0
        self._measurement = self._truth = None
        self._begin_signals()
        self._chain.reset(self._signals.values, self._sensor_seed())

    @abstractmethod
    def _begin_signals(self) -> None:
        """Write the signals at the start, whose forces are taken as those of a whole period before it."""

    def _sensor_seed(self) -> int:
        """Return the seed of the sensor errors."""
        return self._seed

    def hold(self) -> Command:
        """Return a command that holds with the servos the posture of the last reset; before one, that at the begin."""
        zero = np.zeros(self.robot.na)
        return Command(zero, self._posture.copy(), zero)

    # Step

    def step(self, command: Command) -> None:
        """Advance by one control period under a command.

        In position control a command without a velocity reference counts as one with zero velocity.

        Args:
            command: References of the servos and feed-forward torque, or, in torque control, only the torque.

        Raises:
            InputError: The command has a wrong shape, is not finite, has negative gains, is made for another period, or
                cannot be followed by this robot. The simulation has not advanced.
            DivergedError: The simulation has diverged before; `diverged` says why.
        """
        self._check_alone("step")
        step_together((self,), (command,))

    def _checked(self, command: Command) -> Any:
        """Return what the drives make of a command; see `step` for what is refused."""
        if self.diverged is not None:
            raise DivergedError(f"the simulation cannot go on: {self.diverged}; reset it")
        if not isinstance(command, Command):
            raise InputError(f"a simulation takes a Command, got {shown(command)}")
        if command.period is not None and command.period != self.control_period:
            own = self.control_period
            period = finite_scalar("period of a command (s)", command.period, above=0.0)
            whole = round(period / own)
            if whole < 1 or abs(whole * own - period) > ROUNDING:
                raise InputError(
                    f"the control is made for a period of {1e3 * period:g} ms, and the simulation advances by "
                    f"{1e3 * own:g} ms: give both the same control_period"
                )
        return self._read(command)

    def _read(self, command: Command) -> Any:
        """Return an order to the drives: a command as they take it; `InputError` for one that they cannot follow."""
        if command.sole_stiffness is not None:
            raise InputError(
                "command: the soles of this simulation have no stiffness to command; those of a wbc.Plant with "
                "foot='variable' have"
            )
        return command.check(self.robot.joint_names)

    def _take(self, order: Any) -> None:
        """Take an order, which acts from now on, or after the delay of the machine."""
        self._measurement = self._truth = None
        if self._delay == 0:
            self._follow(order)
        else:
            self._late.append([self._delay, copy.deepcopy(order)])  # arrays of a controller may change

    def _follow_late(self) -> None:
        """Act on the order that is due at the coming physics step."""
        for waiting in self._late:
            waiting[0] -= 1
        if self._late and self._late[0][0] < 0:
            self._follow(self._late.popleft()[1])

    @abstractmethod
    def _follow(self, order: Any) -> None:
        """Act on an order of `_read` from the coming physics step on."""

    @abstractmethod
    def _act(self) -> None:
        """Set what acts in the coming physics step: drives, where they depend on the state, and pushes."""

    @abstractmethod
    def _integrate(self) -> None:
        """Advance by one physics step; what depends on the state need not be up to date then."""

    @abstractmethod
    def _record(self, left: int) -> None:
        """Keep the forces of the physics step that has just ended, of the period `left` are to come."""

    def _refresh(self) -> None:  # noqa: B027 - of engines that are not always up to date
        """Bring positions, velocities and sensors of them up to date with the state."""

    @abstractmethod
    def _sample(self) -> None:
        """Write the present signals, whose state is up to date."""

    def _end_period(self) -> None:  # noqa: B027 - of engines whose warnings are looked at once
        """Keep what is read once a control period, and find out whether the simulation has diverged."""


def reset_together(robots: Sequence[Simulation], configurations: Sequence[ArrayLike]) -> None:
    """Restart robots in one simulation, each in its configuration: they begin once all of them are in place."""
    for robot, configuration in zip(robots, configurations, strict=True):
        robot._put(configuration)
    for robot in robots:
        robot._begin()


def step_together(robots: Sequence[Simulation], commands: Sequence[Command]) -> None:
    """Advance robots in one simulation, of one period, by it, each under its command.

    Forces are recorded in each physics step. The rest is brought up to date at the end, and before that where sensors
    are read, which have a latency then, or pushes act.
    """
    orders = [robot._checked(command) for robot, command in zip(robots, commands, strict=True)]
    for robot, order in zip(robots, orders, strict=True):
        robot._take(order)
    first = robots[0]
    for left in range(first.steps - 1, -1, -1):
        for robot in robots:
            if robot._late:
                robot._follow_late()
            robot._act()
        first._integrate()
        ready = left == 0
        for robot in robots:
            robot._record(left)
            ready = ready or left in robot._chain.kept or bool(robot._pushes)
        if first.diverged is not None:
            break
        if ready:
            first._refresh()
            for robot in robots:
                if left in robot._chain.kept:
                    robot._sample()
                    robot._chain.push(robot._signals.values)
    for robot in robots:
        robot.ticks += 1
        robot._end_period()


def lowest_sole_point(robot: Robot, q: Array) -> float:
    """Return the height of the lowest corner of the soles of a robot in a configuration, shape (nq,), m."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return min(float(sole.corners(data.oMf[robot.frame_id(sole.frame)])[:, 2].min()) for sole in robot.soles)
