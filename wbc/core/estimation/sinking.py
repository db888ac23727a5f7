"""Compliance of what the feet stand on, felt while the load goes from foot to foot.

While two feet carry, the legs tell the height of one over the other. A foot that takes over load sinks into ground that
gives, and a soft sole is pressed flat: the difference of the heights changes by −c times the difference of the loads.
The compliance c is the slope of the one over the other, by least squares over one change of the load. The heights are
those of points of the soles: on a tilted sole the centre of pressure comes up or down with its way over the sole, and
no ground gives. The mean over the last changes is steady where it is greater than their scatter. A weight that shifts
slowly before the first step tells as much as some landings, and tells it while it shifts. Where a floor changes under
way a mean over the last two or three changes counts, for the depth of the feet alone: times the rate of a load that
chatters on hard ground it would be a velocity that no foot has.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from wbc.core.robot import GRAVITY

SHIFT = 0.5
"""Least change of the difference of the loads that tells a compliance, over the weight."""

FIRST = 0.3
"""The same for the first change, whose slope counts while it still goes on."""

CHANGING = 0.5
"""Least weight of the last change of the load in the mean of a floor that changes."""

UNCHANGED = 0.2
"""The same in the mean of a steady floor."""

CLEAR = 2.0
"""Least mean over the scatter from which on a compliance is steady."""

SURE = 0.4
"""Time of the changes of the load from which on a compliance is steady, s."""

LEAST = 0.003
"""Least depth under the whole weight that counts, m: errors of encoders and tilt look the same, and tipping feet."""

DEEPEST = 0.05
"""Greatest depth under the whole weight that counts, m: a foot that steps off an edge is lower, too."""


class Sinking:
    """Compliance of ground and soles under a robot with two feet.

    Attributes:
        compliance: Depth of a foot over its load, m/N; 0 until it is known.
        steady: The same where it is steady, else 0: by it, a foot sinks at the rate of its load.
    """

    def __init__(self, weight: float) -> None:
        """Begin on ground that is taken for rigid; the robot has a weight, N."""
        self._weight, self._most = weight, DEEPEST / weight
        self.reset()

    def reset(self) -> None:
        """Forget the ground."""
        self.compliance = self.steady = 0.0
        self._start: tuple[float, float] | None = None  # of a change of the load that goes on
        self._lasted = self._products = self._squares = self._most_change = 0.0  # of this change
        self._count, self._total_time = 0, 0.0  # of changes
        self._recent_mean = self._steady_mean = self._mean_square = 0.0  # of their slopes

    @property
    def speed(self) -> float:
        """Greatest speed, m/s, of a foot that takes the whole weight at once: √(g d), where it sinks by d at rest."""
        return math.sqrt(GRAVITY * self.steady * self._weight)

    def update(self, loads: Sequence[float], heights: Sequence[float], dt: float, *, carry: bool) -> None:
        """Take in a tick of dt, s: forces, N, and heights, m, of the two feet, and True while both of them carry."""
        if not carry:
            self._finish()
            return
        force, height = loads[0] - loads[1], heights[0] - heights[1]
        if self._start is None:
            self._start, self._lasted = (force, height), 0.0
            self._products = self._squares = self._most_change = 0.0
        force, height = force - self._start[0], height - self._start[1]
        self._lasted += dt
        self._products -= force * height
        self._squares += force * force
        self._most_change = max(self._most_change, abs(force))
        if self._count == 0 and self._most_change >= FIRST * self._weight:
            found = min(self._products / self._squares, self._most)
            self.compliance = found if found > LEAST / self._weight else 0.0

    def _finish(self) -> None:
        """End a change of the load; its slope counts if the load has changed enough."""
        if self._start is None:
            return
        self._start = None
        if self._most_change < SHIFT * self._weight:
            return
        found = min(max(self._products / self._squares, -self._most), self._most)
        self._count, self._total_time = self._count + 1, self._total_time + self._lasted
        share, least = max(1.0 / self._count, UNCHANGED), LEAST / self._weight
        self._recent_mean += max(share, CHANGING) * (found - self._recent_mean)
        self._steady_mean += share * (found - self._steady_mean)
        self._mean_square += share * (found * found - self._mean_square)
        scatter = math.sqrt(max(self._mean_square - self._steady_mean**2, 0.0))
        sure = self._total_time >= SURE and self._steady_mean > max(CLEAR * scatter, least)
        self.steady = self._steady_mean if sure else 0.0
        self.compliance = self.steady or (self._recent_mean if self._recent_mean > least else 0.0)
