"""A robot in a MuJoCo simulation: how it is measured and pushed, and its truth, whoever has built the model."""

from __future__ import annotations

import logging
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from wbc.base.checked import checked, fixed, result
from wbc.base.errors import InputError, MeasurementError, WbcError
from wbc.base.numbers import ROUNDING, Array, positive
from wbc.core.conventions import configuration_from_mujoco, velocity_from_mujoco
from wbc.core.robot import Robot
from wbc.core.signals import Command, Measurement
from wbc.ground import PointCloud
from wbc.robots import RobotDescription
from wbc.sim.plant.drives import delays
from wbc.sim.plant.hands import Grips, HandSensor
from wbc.sim.plant.places import RobotPlaces
from wbc.sim.plant.pushes import Push, Pushes
from wbc.sim.plant.sensors import NOISE_PRESETS, SensorChain, SensorNoise
from wbc.sim.plant.settings import Machine, SoleIndex, steps_per_tick
from wbc.sim.plant.signals import Imu, TrueSignals
from wbc.sim.plant.truth import Contacts, GroundTruth

_log = logging.getLogger(__name__)

if mujoco.get_mju_user_warning() is None:  # else MuJoCo writes a file into the working directory
    mujoco.set_mju_user_warning(lambda message: _log.info("MuJoCo: %s", message))

ANOTHER = "make another loop"
"""Advice in place of an assignment to an attribute that a loop is made of."""

WARNINGS = tuple(range(int(mujoco.mjtWarning.mjNWARNING)))
"""All kinds of warnings of MuJoCo."""


class DivergedError(WbcError):
    """Step of a simulation that has diverged, whose state has no meaning any more."""


class SimulatedRobot(ABC):
    """A robot in a MuJoCo model, common to plants (`wbc.Plant`) and models of one's own (`wbc.sim.MujocoLoop`).

    Encoders, joint velocities and gyroscope are those of the present instant; accelerometer and forces are the mean
    over the control period that ended now, like the output of an anti-aliasing filter: hard contacts chatter within a
    period, and single samples of that mislead the controller.

    Attributes:
        description: The robot as data; `robot` is its model, for names and sizes, whose state is not kept up to date.
        model: MuJoCo's model; in its `data` positions and velocities are up to date after `step`.
        places: Places of joints, base, feet and IMU in the model.
        timestep: Physics step, s.
        control_period: Time that `step` advances, s; `steps` physics steps.
        diverged: Reason why the simulation has diverged; None while it has not.
    """

    diverged: str | None
    timestep: float = fixed(ANOTHER)
    control_period: float = fixed(ANOTHER)
    steps: int = fixed(ANOTHER)
    seed: int = result("_seed", "give another seed to its `reset`")
    _truth: GroundTruth | None
    _measurement: Measurement | None

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
        hands: Sequence[HandSensor] = (),
    ) -> None:
        """Connect the sensors; see `wbc.sim.plant.signals.TrueSignals`."""
        self.description, self.robot, self.places = description, robot, places
        self.model = places.model
        self.data = mujoco.MjData(self.model)
        self.timestep, self.control_period = float(self.model.opt.timestep), float(control_period)
        self.steps = steps_per_tick(control_period, self.timestep)
        self.noise = NOISE_PRESETS[noise] if isinstance(noise, str) else noise
        self._seed = seed
        self.machine = machine
        self._contacts, self._pushes = Contacts(places), Pushes()
        self._grips = Grips(self.model, robot, places.prefix)
        self._signals = TrueSignals(
            places,
            imu,
            self._contacts,
            self._drive_torque,
            self.steps,
            machine,
            soles=soles,
            hands=hands,
        )
        self._chain = SensorChain(
            self.noise,
            robot.na,
            len(places.feet),
            self.timestep,
            self.steps,
            delay=machine.measurement_delay,
            torques=machine.torque_sensors,
            hands=len(hands),
        )
        self._age, self._late = delays(machine, self.timestep)
        self._no_feet = np.full(len(places.feet), np.nan)

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return float(self.data.time)

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
        return np.asarray(self.data.qvel[self.places.joint_dof])

    @checked
    def sole_pose(self, side: SoleIndex) -> tuple[Array, Array]:
        """Return the true centre, shape (3,), m, and the rotation, shape (3, 3), of a sole, 0 left, 1 right."""
        places, body = self.places, self.places.feet[side]
        rotation, sole = self.data.xmat[body].reshape(3, 3), places.soles[side]
        return self.data.xpos[body] + rotation @ sole.translation, rotation @ sole.rotation

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

    def clouds(self) -> list[PointCloud]:
        """Return the clouds of the ground that have come since the last call; empty for a robot without eyes."""
        return []

    @checked
    def push(self, body: str, force: ArrayLike, duration: float, at: ArrayLike | None = None) -> None:
        """Start to push a body of the robot with a constant force; several pushes add up.

        Args:
            body: Link or frame of the robot; "torso" and "base" are its torso and base frames.
            force: Force in the world, shape (3,), N.
            duration: s.
            at: Point of attack in the frame of that body, shape (3,), m; the centre of mass of its link when None.
        """
        index, place = self.places.carrier(body)
        self._pushes.add(Push.at(index, place, force, duration, at))

    def grip(self, hand: str, handle: str) -> None:
        """Close a hand around a handle of the scene: it keeps its distance to the handle, and turns freely about it.

        Args:
            hand: Role of the hand, such as "left_hand".
            handle: Name of the handle's site in the scene, such as "left handle".
        """
        self._grips.close(self.data, hand, handle)

    def let_go(self, hand: str) -> None:
        """Open a hand, by its role."""
        self._grips.open(self.data, hand)

    def hold(self) -> Command:
        """Return a command that holds with the servos the posture of the last reset; before one, that at the begin."""
        zero = np.zeros(self.robot.na)
        return Command(zero, self._posture.copy(), zero)

    def truth(self) -> GroundTruth:
        """Return the true state now; the same object until the next step.

        It is for logs, tests and pictures, never for a controller.
        """
        if self._truth is None:
            data, places = self.data, self.places
            q = configuration_from_mujoco(data.qpos[places.base_qpos :], places.joint_qpos - places.base_qpos)
            v = velocity_from_mujoco(q, data.qvel[places.base_dof :], places.joint_dof - places.base_dof)
            mujoco.mj_subtreeVel(self.model, data)
            position, force, sole = self._contacts.of_robot()
            self._truth = GroundTruth(
                time=self.time,
                q=q,
                v=v,
                com=data.subtree_com[places.root].copy(),
                com_velocity=data.subtree_linvel[places.root].copy(),
                joint_torque=self._drive_torque(data),
                contact_position=position,
                contact_force=force,
                contact_sole=sole,
                sole_wrench=self._contacts.wrenches(),
            )
        return self._truth

    def _take(self, command: Command) -> None:
        """Take a checked command, which acts from now on, or after the delay of the machine."""
        self._measurement = self._truth = None
        if self._late is None:
            self._follow(command)
        else:
            self._late.push(command)

    @abstractmethod
    def _follow(self, command: Command) -> None:
        """Act on a checked command from the coming physics step on."""

    def _act(self) -> None:  # noqa: B027 - of drives that depend on the state
        """Write the controls of the coming physics step."""

    @abstractmethod
    def _integrate(self) -> None:
        """Advance by one physics step; what depends on the state need not be up to date then."""

    @abstractmethod
    def _refresh(self) -> None:
        """Bring positions, velocities and sensors of them up to date with the state."""

    def _drive_torque(self, data: mujoco.MjData) -> Array:
        """Return the torques of the drives in the last physics step, a new array of shape (na,), Nm."""
        torque: Array = data.qfrc_actuator.take(self.places.joint_dof)
        return torque

    def _foot_readings(self) -> tuple[Array, Array]:
        """Return ranges (m) and stiffness (Nm/rad) of the soles, both of shape (soles,); NaN where there are none."""
        return self._no_feet.copy(), self._no_feet.copy()

    def _begin(self, seed: int) -> None:
        """Forget what was before: the state is set, and so are the drives; the seed is that of the sensor errors."""
        self._pushes.clear(self.data)
        mujoco.mj_forward(self.model, self.data)
        if self._late is not None:
            self._late.clear()
        self._measurement = self._truth = None
        self.diverged = None
        self._posture = self.joint_position
        self._signals.begin(self.data)
        self._chain.reset(self._signals.values, seed)

    def _find_divergence(self, kinds: Sequence[int] = WARNINGS) -> None:
        """Set `diverged` after a step: some of MuJoCo's warnings, or what is not finite."""
        data = self.data
        warned, q, v = data.warning.number.tolist(), data.qpos, data.qvel
        finite = math.isfinite(q.dot(q) + v.dot(v))
        if finite and not any(warned):
            return
        names = [mujoco.mjtWarning(kind).name for kind in kinds if warned[kind]]
        if names or not finite:
            why = ", ".join(names) or "NaN in the state"
            self.diverged = f"simulation diverged before {self.time:.4f} s ({why})"


def check_period(command: Command, own: float) -> None:
    """Check that a command is made for the control period of a simulation, s, or for a whole number of them."""
    period = command.period
    if period is None or period == own:
        return
    period = positive("period of a command (s)", period)
    if round(period / own) < 1 or abs(round(period / own) * own - period) > ROUNDING:
        raise InputError(
            f"the control is made for a period of {1e3 * period:g} ms, and the simulation advances by "
            f"{1e3 * own:g} ms: give both the same control_period"
        )


def advance(robots: Sequence[SimulatedRobot]) -> None:
    """Advance robots in one simulation by a control period under the commands that they have taken.

    Forces are recorded in each physics step. The rest is brought up to date at the end, and before that where sensors
    are read, which have a latency then, or pushes act.
    """
    first = robots[0]
    data = first.data
    for step in range(first.steps):
        left = first.steps - 1 - step
        ready = left == 0
        for robot in robots:
            if robot._late is not None and (due := robot._late.advance()) is not None:
                robot._follow(due)
            robot._act()
            if robot._pushes:
                robot._pushes.apply(data, first.timestep)
        first._integrate()
        for robot in robots:
            signals, chain = robot._signals, robot._chain
            if left == 0 or signals.of_contacts:
                robot._contacts.capture(data)
            signals.record(data, signals.window[step])
            ready = ready or chain.newest <= left <= chain.oldest or bool(robot._pushes)
        if ready:
            first._refresh()
            for robot in robots:
                if robot._chain.newest <= left <= robot._chain.oldest:
                    robot._signals.sample(data)
                    robot._chain.push(robot._signals.values)
