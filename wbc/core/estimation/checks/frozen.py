"""Readings of sensors that stay the same to the bit, while noise would change a good one in every tick.

They are doubted; a whole measurement that comes again and again is refused by `Plausibility`.
"""

from __future__ import annotations

import numpy as np

from wbc.base.numbers import Array, scalar
from wbc.core.robot import Robot

FROZEN_AFTER = 20
"""Ticks for which a reading must stay the same to the bit to count as frozen."""

BUSY = 0.8
"""Share of the ticks before in which it must have changed: one that is rounded comes to rest by and by."""

BUSY_GAIN = 0.02
"""Gain of that share in a tick."""

NAMED = 6
"""Number of frozen sensors that are named."""

_ONE = scalar(1.0)


class FrozenReadings:
    """Search for frozen readings, tick by tick."""

    def __init__(self, robot: Robot, channels: tuple[str, ...]) -> None:
        """Prepare for a robot, and the names of the numbers that `update` gets."""
        self._robot, self._channels, self._na = robot, channels, robot.na
        self._wrenches = len(channels) - 6 * len(robot.soles)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        n = len(self._channels)
        self._last: Array | None = None
        self._run, self._busy, self._frozen = np.zeros(n), np.zeros(n), np.zeros(n, dtype=bool)
        self._ticks = 0

    def update(self, values: Array) -> list[str]:
        """Return the frozen sensors, such as "encoder of left_knee frozen"; `values` are all numbers of a tick."""
        last, self._last = self._last, values
        if last is None:
            return []
        run, busy, frozen = self._run, self._busy, self._frozen
        changed = values != last
        run += _ONE
        run[changed] = 0.0
        self._ticks += 1
        busy += max(BUSY_GAIN, 1.0 / self._ticks) * (changed - busy)
        stands = run == FROZEN_AFTER
        if np.count_nonzero(stands):  # in a third of the time of `any`
            frozen |= stands & (busy > BUSY * (1.0 - BUSY_GAIN) ** FROZEN_AFTER)
        if not np.count_nonzero(frozen):
            return []
        frozen &= ~changed
        na, doubted = self._na, frozen.copy()
        doubted[self._wrenches :] &= values[self._wrenches :] != 0.0  # no force is that of a foot in the air
        # A joint that sticks has no speed, and its encoder stays.
        sticks = (values[na : 2 * na] == 0.0) & (run[:na] >= 1.0)
        doubted[: 2 * na] &= ~np.concatenate((sticks, sticks))
        # One that is faster than it can be is cut off by the check of plausibility.
        doubted[na : 2 * na] &= np.abs(values[na : 2 * na]) < self._robot.velocity_limit
        names = list(dict.fromkeys(self._channels[i] for i in doubted.nonzero()[0]))
        more = [f"{len(names) - NAMED} more sensors frozen"] if len(names) > NAMED else []
        return [f"{name} frozen" for name in names[:NAMED]] + more
