"""Pace of a run that is watched: a multiple of real time, or a pause."""

from __future__ import annotations

import time as clock

CATCH_UP_TIME = 0.2
"""A run that is further behind the clock than this does not catch up, s."""

MAX_STEP = 1.0
"""A run whose simulated time has gone on by more than this, or back, has been reset or has jumped, s."""

SLICE = 0.1
"""Longest time until a new speed counts, s."""


class Pace:
    """Holds a run back to a multiple of real time; any thread may set pause and speed.

    Attributes:
        paused: The run waits.
    """

    def __init__(self, speed: float | None) -> None:
        """Start counting with the next call of `wait`; the speed is a multiple of real time, None never waits."""
        self.paused = False
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
        self._last = 0.0  # simulated time of the last call, s

    def wait(self, simulated: float | None) -> None:
        """Wait until the clock has come as far as the run, s; None does not wait. A new speed ends the wait."""
        if self._speed is None or simulated is None:
            return
        if self._start is None or not 0.0 <= simulated - self._last <= MAX_STEP:
            self._start = (clock.perf_counter(), simulated)
        self._last = simulated
        while (start := self._start) is not None and (speed := self._speed) is not None:
            now = clock.perf_counter()
            ahead = start[0] + (simulated - start[1]) / speed - now
            if ahead < -CATCH_UP_TIME:
                self._start = (now, simulated)
            if ahead <= 0.0:
                return
            clock.sleep(min(ahead, SLICE))
