"""Sensing: a measurement in, the estimated robot out, the same for every law that drives the robot.

Plausibility, accelerometer, observer, wrenches of feet without sensors, monitor and falls work in this order in a tick.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Literal

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbc.base.numbers import Array
from wbc.base.settings import settings
from wbc.core.estimation.checks.accelerometer import AccelerometerCheck
from wbc.core.estimation.checks.consistency import ConsistencyMonitor
from wbc.core.estimation.checks.plausibility import Plausibility, PlausibilitySettings
from wbc.core.estimation.falls import FallDetector
from wbc.core.estimation.observer import Observer
from wbc.core.estimation.wrenches import WrenchEstimator
from wbc.core.robot import Robot
from wbc.core.signals import Command, Measurement


@settings
class SafetySettings:
    """Ranges of measurements and commands, and the reaction to a fall.

    Attributes:
        plausibility: Ranges that measurements must keep.
        on_fall: Reaction to a fall, after which nothing recovers: "damp" sends damping alone until `reset`, "go on"
            solves on, for a controller that stands up or falls in a way of its own.
    """

    plausibility: PlausibilitySettings = field(default_factory=PlausibilitySettings)
    on_fall: Literal["damp", "go on"] = "damp"


class Sensing:
    """Estimate of one robot in a run: checks of its sensors, observer, monitor, falls and clock.

    Attributes:
        observer: Observer that estimates the state from measurements.
        on_fall: Reaction to a fall; see `SafetySettings`.
        plausibility: Check of measurements.
        accelerometer: Check of the direction of the specific force.
        monitor: Monitor of sensors that contradict each other, after `watch`, until a fall; None in a simulation as a
            rule.
        wrenches: Estimator of the wrenches of feet without force sensors; None while they are measured.
        falls: Detector of a fall, by the estimate.
        measurement: Last measurement that was used, with what was refused replaced by predictions; None before one.
        time: Time since the control was made, s; one control period in each tick.
    """

    def __init__(self, robot: Robot, observer: Observer, dt: float, safety: SafetySettings) -> None:
        """Take the ranges from a robot of the observer's model, whose state is not read; dt is the period, s."""
        self._robot, self.observer, self._dt, self.on_fall = robot, observer, dt, safety.on_fall
        self.plausibility = Plausibility(robot, dt, safety.plausibility)
        self.accelerometer = AccelerometerCheck(dt)
        self.monitor: ConsistencyMonitor | None = None
        self.wrenches: WrenchEstimator | None = None
        self.falls = FallDetector(observer.robot, dt)
        self.measurement: Measurement | None = None
        self.time = 0.0
        # Acceleration that the command of the last tick asks for, shape (nv,), and none.
        self._asked: Array | None = None
        self._none = np.zeros(robot.nv)

    def reset(self) -> None:
        """Forget all measurements and a fall; the observer has a reset of its own."""
        self.plausibility.reset()
        self.accelerometer.reset()
        if self.monitor is not None:
            self.monitor.reset()
        self.falls.reset()
        self.wrenches = self.measurement = self._asked = None

    def tick(self) -> float:
        """Begin a tick of the control, and return its time, s."""
        self.time += self._dt
        return self.time

    @property
    def damped(self) -> bool:
        """True once a fall has ended in damping, until `reset`."""
        return self.falls.reason is not None and self.on_fall == "damp"

    @property
    def stale(self) -> bool:
        """True if nothing was measured, or the observer has gone on by the measurements of another control."""
        return self.measurement is None or self.measurement.time != self.observer.time

    def watch(self) -> ConsistencyMonitor:
        """Compare the sensors with each other from the next tick on; return the monitor."""
        if self.monitor is None:
            self.monitor = ConsistencyMonitor(self._robot, self._dt, self.plausibility.names)
        return self.monitor

    def update(
        self,
        measurement: Measurement,
        soles: Sequence[pin.SE3 | None] | None,
        forgiven: NDArray[np.bool_] | None,
        *,
        follows: bool,
    ) -> Measurement:
        """Update the estimate from what is plausible of a measurement, and return that.

        See `Observer.update` for soles, and `Plausibility.check` for joints that are forgiven, and for its errors. The
        accelerations of the last command are those of the estimated robot if it `follows`.
        """
        blind = type(measurement) is Measurement and measurement.sole_wrench is None
        if blind:
            measurement = self._estimator().fill(measurement)
        measurement, renewed = self.plausibility.check(measurement, forgiven=forgiven)
        if measurement.sole_wrench is None:  # a sensor that is refused for too long
            blind, measurement = True, self._estimator().fill(measurement)
        observer = self.observer
        if renewed:
            observer.resume(measurement.time - self._dt)
        measurement = self.accelerometer.check(measurement, observer)
        observer.update(measurement, soles, plausible=True)
        if blind:
            measurement = self._estimator().observe(
                measurement, *observer.measured_state, observer.rest.lifts
            )
        # What feet and IMU of a robot that lies read says nothing of them.
        if self.monitor is not None and self.falls.reason is None:
            asked = self._asked if follows else None
            self.monitor.update(self.plausibility.values, measurement, observer, asked)
        self.measurement = measurement
        return measurement

    def _estimator(self) -> WrenchEstimator:
        """Return the estimator of wrenches, which is made when it is needed first."""
        if self.wrenches is None:
            self.wrenches = WrenchEstimator(self._robot, self._dt, delay=self.observer.settings.delay)
        return self.wrenches

    def sent(self, command: Command, acceleration: Array | None) -> None:
        """Take the command that is sent now, and the acceleration that it asks for, shape (nv,); None for unknown."""
        self._asked = acceleration
        if self.wrenches is not None:
            self.wrenches.sent(command)
        self.observer.commanded(self._none if acceleration is None else acceleration, self._dt)
