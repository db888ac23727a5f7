"""Time stamps of measurements: clocks that jump or stand still, and the pace at which measurements come."""

from __future__ import annotations

import logging
import math
import numbers
from contextlib import suppress
from typing import Any

import numpy as np

from wbc.base.errors import MeasurementError, shown

logger = logging.getLogger(__name__)

PACE_TICKS = 50
"""Number of ticks in which a control looks how often measurements come, again and again."""

PACE_RATIO = 1.2
"""Ratio of the period of measurements to that of the controller from which, either way, they do not fit together."""

STANDS = 5
"""Number of changed measurements in a row with the same stamp after which the stamp is taken for no clock."""


class Stamps:
    """Time of a robot's measurements, by stamps that are a clock, or by their number.

    Attributes:
        time: Time of the last measurement, s; NaN before the first one.
        pace: Sentence that measurements do not come at the period of the controller, or without a clock; empty while
            they do.
    """

    def __init__(self, dt: float, max_gap: int, resync: float) -> None:
        """Begin for a control period dt, s; the other two are as in `PlausibilitySettings`."""
        self._dt, self._largest, self._resync = dt, max_gap * dt, resync
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self.time, self._other_time, self._consistent = math.nan, math.nan, 0.0
        self.pace = ""
        self._ticks, self._begin, self._odd = 0, math.nan, 0
        self._stamp, self._stands = math.nan, 0  # as it came, and changed measurements in a row that had it

    def take(self, stamp: float, *, first: bool, same: bool) -> bool:
        """Take the stamp of a measurement, s, and move `time` on; True for a clock that is adopted anew.

        Any stamp is adopted that is the `first`. `same` is True for readings that are those of the last measurement.
        A `MeasurementError` refuses a stamp that has jumped.
        """
        if stamp == self._stamp and (self._stands or not same):
            self._stand_still(stamp, same=same)
            return False
        again = self._stands >= STANDS  # it moves on again, and is adopted where it is
        renewed = self._move(stamp, first=first, again=again)
        self._stamp, self._stands = stamp, 0
        return renewed

    def _stand_still(self, stamp: float, *, same: bool) -> None:
        """Count one period a measurement for a stamp that goes on standing still."""
        self._stands += not same
        if self._stands < STANDS or same:
            return
        self.time += self._dt
        if self._stands == STANDS:
            self.time += (STANDS - 1) * self._dt
            self.pace = f"time stamps stand still at {stamp:g} s: one control period a measurement is counted"
            logger.error("%s", self.pace)

    def _move(self, time: float, *, first: bool, again: bool) -> bool:
        """Adopt a stamp, refuse it, or adopt a clock that has jumped and moves on; True for the last."""
        if not math.isfinite(time):
            raise MeasurementError(f"time of a measurement must be a finite number, got {time!r}")
        if again:
            logger.warning("time stamps move on again, from %.4f s", time)
            self._adopt(time)
            self._ticks, self.pace = 0, ""
            return True
        if first or 0.0 <= time - self.time <= self._largest:
            self._adopt(time)
            self._check_pace(time)
            return False
        step = time - self._other_time  # NaN for the first stamp of another clock
        # One that stands still at another time is adopted as well, as one that is no clock.
        self._consistent = self._consistent + (step or self._dt) if 0.0 <= step <= self._largest else 0.0
        self._other_time = time
        if self._consistent >= self._resync:
            logger.warning("the clock of measurements has jumped by %+.3f s; adopted", time - self.time)
            self._adopt(time)
            self._ticks = 0
            return True
        raise MeasurementError(
            f"time stamp {time:.4f} s does not follow {self.time:.4f} s: steps must lie in [0, {self._largest:g}] s"
        )

    def _adopt(self, time: float) -> None:
        self.time, self._consistent, self._other_time = time, 0.0, math.nan

    def _check_pace(self, time: float) -> None:
        """Compare the mean step of stamps with the control period: of the first ones, and twice in a row later."""
        if self._ticks == 0:
            self._begin, self._odd = time, 1
        self._ticks += 1
        if self._ticks <= PACE_TICKS:
            return
        period, self._begin, self._ticks = (time - self._begin) / PACE_TICKS, time, 1
        if self._dt / PACE_RATIO <= period <= self._dt * PACE_RATIO:
            self._odd, self.pace = 0, ""
            return
        self._odd += 1
        if self._odd >= 2 and not self.pace:
            own = 1e3 * self._dt
            self.pace = (
                f"measurements come every {1e3 * period:.3g} ms, the controller is made for {own:.3g} ms"
            )
            logger.warning("%s", self.pace)


def stamp_of(time: Any) -> float:
    """Return the time of a measurement as a float, s; truth values and texts are none."""
    if isinstance(time, np.ndarray) and time.ndim == 0:
        time = time[()]
    if not isinstance(time, bool) and isinstance(time, numbers.Real):
        with suppress(OverflowError):  # an integer of many digits
            return float(time)
    raise MeasurementError(f"time of a measurement must be a finite number, got {shown(time)}")
