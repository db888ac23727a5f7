"""Pace of a run that is watched: a multiple of real time."""

from __future__ import annotations

import time as clock

CATCH_UP_TIME = 0.2
"""A run that is further behind the clock than this does not catch up, s."""

MAX_LEAD = 1.0
"""A run that is further ahead of the clock than this has been reset or has jumped, s."""


class Pace:
    """Holds a run back to a multiple of real time."""

    def __init__(self, speed: float | None) -> None:
        """Start counting with the next call of `wait`.

        Args:
            speed: Multiple of real time; None never waits.
        """
        self.speed = speed

    @property
    def speed(self) -> float | None:
        """Multiple of real time; None never waits."""
        return self._speed

    @speed.setter
    def speed(self, speed: float | None) -> None:
        self._speed = speed
        self.restart()

    def restart(self) -> None:
        """Count from the next call of `wait` on."""
        self._start: tuple[float, float] | None = None  # clock and simulated time

    def wait(self, simulated: float | None) -> None:
        """Wait until the clock has come as far as the run.

        Args:
            simulated: Simulated time, s; None does not wait.
        """
        if self._speed is None or simulated is None:
            return
        now = clock.perf_counter()
        if self._start is None:
            self._start = (now, simulated)
        ahead = self._start[0] + (simulated - self._start[1]) / self._speed - now
        if not -CATCH_UP_TIME <= ahead <= MAX_LEAD:
            self._start = (now, simulated)
        elif ahead > 0.0:
            clock.sleep(ahead)
