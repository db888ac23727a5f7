"""Simulated standing: the balance controller against the plant, as a function of a frozen spec."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal, get_args

import numpy as np

from wbc.core.arguments import checked
from wbc.core.control import Mode
from wbc.core.drive.hybrid import HybridControl
from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import TorqueControl
from wbc.core.errors import Array, InputError
from wbc.core.settings import Positive, settings
from wbc.core.signals import Command, Measurement
from wbc.sim.balance.setup import BalanceSpec
from wbc.sim.plant.falls import TrueFallDetector
from wbc.sim.plant.truth import GroundTruth
from wbc.tasks.balance import BalanceGains, balance_controller
from wbc.walking.stepping.control import OBSERVER, SteppingControl, SteppingControlSettings

Feedback = Literal["open", "closed"]

MODES: tuple[Mode, ...] = get_args(Mode)
"""Control modes of the drives."""

LEAST_TICKS = 2
"""Shortest stand, control periods: the result is about its second half."""


@settings(kw_only=True)
class StandSpec(BalanceSpec):
    """One simulated stand: the fields of `BalanceSpec`, and these.

    Attributes:
        seconds: Simulated time, s.
        feedback: In position control, whether the controller sees the robot as commanded (open) or as estimated
            (closed).
        gains: Weights and gains of the controller.
        steps: Whether the robot may step: none keeps its feet in place with the balance controller, allowed stands with
            the stepping walk, which steps out of a push; in torque (the default then) or hybrid control.
    """

    seconds: Annotated[Positive, "s"] = 10.0
    feedback: Feedback = "closed"
    gains: BalanceGains = field(default_factory=BalanceGains)
    steps: Literal["none", "allowed"] = "none"

    def __post_init__(self) -> None:
        if self.steps == "allowed":
            if self.mode == "position":
                raise InputError(
                    "a robot that may step stands in torque or hybrid control, got mode 'position' with steps 'allowed'"
                )
            object.__setattr__(self, "mode", self.mode or "torque")
        super().__post_init__()
        if self.seconds < LEAST_TICKS * self.period:
            raise InputError(
                f"seconds (s) must be at least {LEAST_TICKS} control periods of {self.period:g} s, got {self.seconds:g}"
            )


@dataclass(frozen=True)
class StandResult:
    """Result of a stand; all but the wall-clock timings (`real_time_factor`, `tick_us`) follows from the spec.

    Attributes:
        robot: Name of the robot.
        mode: "position", "torque" or "hybrid".
        upright: True if it never fell.
        com_error_mm: Greatest horizontal distance of the true centre of mass from its target in the second half.
        zmp_noise_mm: Standard deviation of the true zero-tilting moment point in the second half, both axes together.
        real_time_factor: Simulated time over wall time of the whole loop.
        tick_us: Wall time from measurement to command, median and 99th percentile.
        seconds: Simulated time, s; shorter than the spec's if it fell.
        steps_taken: Steps that the robot took; 0 where its feet stay in place.
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
    steps_taken: int
    failures: int
    noise: str
    foot: str
    seed: int
    control_period: float


class StandTrial:
    """One stand about to begin: plant and controller, connected.

    Attributes:
        spec: The stand.
        plant: The plant.
        control: The controller and its observer.
        tick_times: Wall time of each tick so far, from measurement to command, s.
        fallen: True once the robot has fallen.
    """

    def __init__(self, spec: StandSpec) -> None:
        """Build robot, plant and controller.

        Raises:
            InputError: A foot that does not fit the robot.
        """
        self.spec = spec
        robot, self.plant, observer = spec.build(OBSERVER if spec.steps == "allowed" else None)
        self.control: PositionControl | TorqueControl
        self._command: Callable[[Measurement], Command]
        self._walking: SteppingControl | None = None
        if spec.steps == "allowed":
            settings = SteppingControlSettings(mode=spec.chosen)
            self._walking = walking = SteppingControl(robot, spec.period, settings, observer=observer)
            self.control, self._command = walking.control, walking.command
        else:
            controller = balance_controller(robot, spec.period, spec.gains)
            if spec.mode == "position":
                self.control = PositionControl(controller, observer, feedback=spec.feedback)
            else:
                self.control = (TorqueControl if spec.mode == "torque" else HybridControl)(
                    controller, observer
                )
            self._command = self.control.command
        self.tick_times: list[float] = []
        self._falls = TrueFallDetector(self.plant.robot)
        self.fallen = False

    def advance(self, until: float) -> Iterator[GroundTruth]:
        """Simulate until a time, or until the robot falls.

        Args:
            until: Simulated time, s.

        Yields:
            The true state after each control period.

        Raises:
            DivergedError: The simulation has diverged: no fall, and no result.
        """
        plant = self.plant
        while plant.time < until - 0.5 * plant.control_period and not self.fallen:
            measurement = plant.measure()
            start = time.perf_counter()
            command = self._command(measurement)
            self.tick_times.append(time.perf_counter() - start)
            plant.step(command)
            plant.raise_if_diverged()
            truth = plant.truth()
            self.fallen = self._falls.fallen(truth.q)
            yield truth

    def run(self, after_tick: Callable[[], None] | None = None) -> StandResult:
        """Stand for the time of the spec and return the result.

        Args:
            after_tick: Called after each control period, for a viewer.
        """
        spec = self.spec
        target = np.array(self.plant.truth().com)
        com: list[Array] = []
        zmp: list[Array] = []
        start = time.perf_counter()
        for truth in self.advance(spec.seconds):
            com.append(truth.com)
            zmp.append(centre_of_pressure(truth))
            if after_tick is not None:
                after_tick()
        elapsed = time.perf_counter() - start
        half = len(com) // 2
        error = np.linalg.norm((np.array(com) - target)[half:, :2], axis=1)
        ticks = 1e6 * np.array(self.tick_times)
        return StandResult(
            robot=spec.robot,
            mode=spec.chosen,
            upright=not self.fallen,
            com_error_mm=_rounded(1e3 * error.max()),
            zmp_noise_mm=_rounded(1e3 * np.sqrt(np.nanvar(np.array(zmp)[half:], axis=0).sum())),
            real_time_factor=_rounded(self.plant.time / elapsed),
            tick_us={"median": _rounded(np.median(ticks)), "p99": _rounded(np.percentile(ticks, 99))},
            seconds=self.plant.time,
            steps_taken=0 if self._walking is None else self._walking.steps_done,
            failures=self.control.failures,
            noise=spec.noise,
            foot=spec.foot,
            seed=spec.seed,
            control_period=spec.period,
        )


@checked
def stand(spec: StandSpec | None = None, **values: Any) -> StandResult:
    """Simulate a standing robot.

        result = stand(robot="talos", mode="torque", noise="realistic")

    Args:
        spec: The stand; the default one when None.
        **values: Fields of `StandSpec` that differ from it.

    Raises:
        UnknownNameError: A field that the spec does not have; the nearest names are given.
        InputError: A value out of range, or a foot that does not fit the robot.
    """
    return StandTrial(replace(spec or StandSpec(), **values)).run()


def centre_of_pressure(truth: GroundTruth) -> Array:
    """Return the centre of pressure of all contacts; on level ground it is the zero-tilting moment point.

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
    """Return a number with the four significant digits that are meaningful."""
    return float(f"{value:.4g}")
