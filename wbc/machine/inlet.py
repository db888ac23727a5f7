"""Way in of a machine's measurements, whatever its driver makes of them: time stamps, repeats, impossible readings."""

from __future__ import annotations

import logging
import math
from dataclasses import replace
from typing import Any

import numpy as np

from wbc.base.errors import MeasurementError
from wbc.core.estimation.checks.integrals import IntegralComparison
from wbc.core.estimation.checks.plausibility import Plausibility
from wbc.core.robot import Robot
from wbc.core.signals import SIGNALS, Measurement

logger = logging.getLogger(__name__)

STILL = 3
"""Number of new measurements in a row with the same time stamp after which the stamp is taken for no clock: fewer than
for `Stamps` in a control, since those before are not used here, while a control counts them at once."""


class Inlet:
    """Check of every measurement at the door of a run, unless the control that runs has a check of its own.

    A measurement whose stamp and signals are those of the last one is no new one. Stamps that stand still while the
    signals change, such as a tick that nobody counts, are no clock: the time of arrival takes their place.

    Attributes:
        stamped: False once the time of arrival counts.
        raw: The last new measurement with the time that counts, for a control that has a check of its own.
        good: The last measurement that can be used, impossible readings replaced; None before there is one.
        refused: Reason why the last one cannot be used; empty when it can.
        since: Time from which on they have been refused, s; infinite while they are not.
    """

    def __init__(self, robot: Robot, period: float) -> None:
        """Take the ranges from a robot that is controlled with a period, s."""
        self._plausible = Plausibility(robot, period)
        self._unfelt = np.zeros((len(robot.soles), 6))
        self._last: Any = None
        self._still = 0
        self.stamped, self.refused, self.since = True, "", math.inf
        self.raw: Any = None
        self.good: Measurement | None = None
        self._integrals = IntegralComparison(robot, period)

    @property
    def pace(self) -> float:
        """Ratio of the machine's own time to that of its stamps.

        A simulator on a busy computer that sends no clock runs slower than the time of arrival.
        """
        return self._integrals.pace

    def forget(self) -> None:
        """Take the next measurement as the first one, whatever time has passed."""
        self._plausible.reset()
        self._integrals.reset()

    def take(self, measurement: Any, now: float, *, check: bool = True) -> bool:
        """Take a measurement that arrived at `now`, s, and check it; True if it is a new one."""
        last, self._last = self._last, measurement
        if isinstance(measurement, Measurement) and isinstance(last, Measurement):
            if self.stamped and not _same(measurement.time, last.time):
                self._still = 0
            elif all(_same(getattr(measurement, name), getattr(last, name)) for name in SIGNALS):
                return False
            elif self.stamped:
                self._still += 1
                if self._still < STILL:
                    return False
                logger.warning("time stamps stand still at %r: the time of arrival counts", last.time)
                self.stamped = False
                self.forget()
        if not self.stamped and isinstance(measurement, Measurement):
            measurement = replace(measurement, time=now)
        self.raw = measurement
        if not check:
            return True
        try:
            before, self.good = self.good, self._checked(measurement)
            passed = 0.0 if before is None else self.good.time - before.time
            self._integrals.update(self._plausible.values, None, passed)
            self.refused, self.since = "", math.inf
        except MeasurementError as error:
            self.refused, self.since = str(error), min(self.since, now)
        return True

    def _checked(self, measurement: Any) -> Measurement:
        if isinstance(measurement, Measurement) and measurement.sole_wrench is None:
            felt = replace(measurement, sole_wrench=self._unfelt)
            return replace(self._plausible.check(felt)[0], sole_wrench=None)
        return self._plausible.check(measurement)[0]


def _same(one: Any, other: Any) -> bool:
    """Return True if two parts of measurements are equal, of whatever kind they are."""
    try:
        if type(one) is float and type(other) is float:  # in a tenth of the time
            return one == other
        return one is other or bool(np.array_equal(one, other))
    except Exception:  # parts that cannot be compared are not the same
        return False
