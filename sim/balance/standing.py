"""A robot that stands: the balance controller against the plant, as a pure function of a frozen set of options."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import numpy as np

from wbc.core.control import PositionControl, TorqueControl
from wbc.core.errors import Array, choose, positive
from wbc.feet.soles.catalog import foot as foot_by_name
from wbc.robots import load
from wbc.sim.balance.controller import BalanceGains, balance_controller
from wbc.sim.balance.falls import FallDetector
from wbc.sim.plant.plant import Plant
from wbc.sim.plant.sensors import noise_preset
from wbc.sim.plant.settings import steps_per_tick
from wbc.sim.plant.shod import shod
from wbc.sim.plant.truth import GroundTruth

Mode = Literal["position", "torque"]
Feedback = Literal["open", "closed"]
Control = PositionControl | TorqueControl

MODES: tuple[Mode, ...] = ("position", "torque")
"""What the drives can be given."""

CONTROL_PERIOD: dict[Mode, float] = {"position": 0.005, "torque": 0.002}
"""Control period when none is given, s: servos hold the robot between ticks, torques do not."""


@dataclass(frozen=True, kw_only=True)
class StandSpec:
    """Which robot stands, and how.

    Attributes:
        robot: Robot, one of those that `wbc robots` lists.
        mode: What the drives are given: references of position and velocity, or torques.
        seconds: Simulated time, s.
        foot: Foot under both ankles; flat is the robot's own sole.
        noise: Errors of the sensors, none or realistic.
        seed: Fixes every random draw.
        feedback: In position control, whether the controller sees the robot as commanded (open) or as estimated
            (closed).
        control_period: Time between two commands, s; 5 ms in position control and 2 ms in torque control when not
            given.
        timestep: Physics step, s.
        gains: Weights and gains of the controller.
    """

    robot: str = "hrp4_class"
    mode: Mode = "position"
    seconds: float = 10.0
    foot: str = "flat"
    noise: str = "none"
    seed: int = 0
    feedback: Feedback = "closed"
    control_period: float | None = None
    timestep: float = 0.001
    gains: BalanceGains = field(default_factory=BalanceGains)

    def __post_init__(self) -> None:
        load(self.robot)
        choose("mode", self.mode, MODES)
        choose("feedback", self.feedback, ("open", "closed"))
        positive("seconds (s)", self.seconds)
        foot_by_name(self.foot)
        noise_preset(self.noise)
        steps_per_tick(self.period, self.timestep)

    @property
    def period(self) -> float:
        """Control period, s."""
        return CONTROL_PERIOD[self.mode] if self.control_period is None else self.control_period


@dataclass(frozen=True)
class StandResult:
    """How a robot stood.

    Everything but the times of the clock (`real_time_factor`, `tick_us`) is the same whenever the options are.

    Attributes:
        robot: Name of the robot.
        mode: "position" or "torque".
        upright: True if it never fell.
        com_error_mm: Greatest horizontal distance of the true centre of mass from its target in the second half.
        zmp_noise_mm: Standard deviation of the true zero-tilting moment point in the second half, both axes together.
        real_time_factor: Simulated time over wall time of the whole loop.
        tick_us: Wall time from measurement to command, median and 99th percentile.
        seconds: Simulated time, s; shorter than asked for if it fell.
        failures: Ticks without a solution or with an unusable measurement.
        noise: Errors of the sensors.
        foot: Foot under both ankles.
        seed: Seed.
        control_period: s.
    """

    robot: str
    mode: Mode
    upright: bool
    com_error_mm: float
    zmp_noise_mm: float
    real_time_factor: float
    tick_us: dict[str, float]
    seconds: float
    failures: int
    noise: str
    foot: str
    seed: int
    control_period: float

    def to_json(self) -> dict[str, Any]:
        """The result as plain values."""
        return asdict(self)


class Stand:
    """A standing robot that can be stepped: plant, controller and what connects them.

    Attributes:
        options: What was asked for.
        plant: The plant.
        control: The controller and its observer.
        tick_times: Wall time of every tick so far, from measurement to command, s.
        fallen: True once the robot has fallen or the simulation has diverged.
    """

    def __init__(self, options: StandSpec) -> None:
        """Build the robot, the plant and the controller.

        Raises:
            InputError: A foot that does not fit the robot.
        """
        self.options = options
        foot = foot_by_name(options.foot)
        description = shod(load(options.robot), foot)
        self.plant = Plant(
            description,
            foot=foot,
            noise=options.noise,
            seed=options.seed,
            timestep=options.timestep,
            control_period=options.period,
        )
        controller = balance_controller(description.robot(), options.period, options.gains)
        self.control: Control = (
            TorqueControl(controller)
            if options.mode == "torque"
            else PositionControl(controller, feedback=options.feedback)
        )
        self.tick_times: list[float] = []
        self._falls = FallDetector(self.plant.robot)
        self.fallen = False

    def run(self, seconds: float) -> Iterator[GroundTruth]:
        """Go on for a while, and give the true state after every control period; ends early if the robot falls.

        Args:
            seconds: Simulated time at which to end, s.
        """
        plant, control = self.plant, self.control
        while plant.time < seconds - 0.5 * plant.control_period and not self.fallen:
            measurement = plant.measure()
            start = time.perf_counter()
            command = control.command(measurement)
            self.tick_times.append(time.perf_counter() - start)
            plant.step(command)
            truth = plant.truth()
            self.fallen = plant.diverged is not None or self._falls.fallen(truth.q)
            yield truth

    def result(self, after_tick: Callable[[], None] | None = None) -> StandResult:
        """Stand for the time of the options and sum up.

        Args:
            after_tick: Called after every control period, for a viewer.
        """
        options = self.options
        target = np.array(self.plant.truth().com)
        com: list[Array] = []
        zmp: list[Array] = []
        start = time.perf_counter()
        for truth in self.run(options.seconds):
            com.append(truth.com)
            zmp.append(centre_of_pressure(truth))
            if after_tick is not None:
                after_tick()
        elapsed = time.perf_counter() - start
        half = len(com) // 2
        error = np.linalg.norm((np.array(com) - target)[half:, :2], axis=1)
        ticks = 1e6 * np.array(self.tick_times)
        return StandResult(
            robot=options.robot,
            mode=options.mode,
            upright=not self.fallen,
            com_error_mm=_rounded(1e3 * error.max()),
            zmp_noise_mm=_rounded(1e3 * np.sqrt(np.nanvar(np.array(zmp)[half:], axis=0).sum())),
            real_time_factor=_rounded(self.plant.time / elapsed),
            tick_us={"median": _rounded(np.median(ticks)), "p99": _rounded(np.percentile(ticks, 99))},
            seconds=self.plant.time,
            failures=self.control.failures,
            noise=options.noise,
            foot=options.foot,
            seed=options.seed,
            control_period=options.period,
        )


def stand(options: StandSpec) -> StandResult:
    """Let a robot stand.

    Args:
        options: Which robot, and how.

    Returns:
        How it went.

    Raises:
        InputError: A foot that does not fit the robot.
    """
    return Stand(options).result()


def centre_of_pressure(truth: GroundTruth) -> Array:
    """Centre of pressure of all contacts; on level ground it is the zero-tilting moment point.

    Args:
        truth: The true state.

    Returns:
        Horizontal position in the world, shape (2,), m; NaN in flight.

    Source: Sardain & Bessonnet, IEEE T-SMC-A 34(5), 2004: on a level ground the two points are one.
    """
    normal = truth.contact_force[:, 2]
    total = normal.sum()
    if total < 1.0:
        return np.full(2, np.nan)
    point: Array = normal @ truth.contact_position[:, :2] / total
    return point


def _rounded(value: float) -> float:
    """Four significant digits: what is printed is not more exact than that."""
    return float(f"{value:.4g}")
