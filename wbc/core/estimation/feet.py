"""Comparison of the forces that two feet report with the way in which these feet move.

A foot that carries the robot rests on the ground: the velocity that its leg gives the inertial measurement unit (IMU)
changes as the accelerometer says. A foot in the air moves as its swing asks. So legs and accelerometer alone tell which
foot carries, and a foot that rests beside the foot which carries stands on the ground, too. Pushes change nothing of
this, since legs and IMU belong to one body.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from wbc.base.lag import lag_gain
from wbc.base.vectors import Vector, part_way
from wbc.core.robot import GRAVITY

MEMORY, SMOOTHING, LASTING = 0.3, 0.03, 0.1
"""Time over which velocities of a leg and of the accelerometer are compared, low-pass of speeds, and time for which a
contradiction must last, s."""

MOVES, MORE = 0.15, 3.0
"""Velocity of a leg that the accelerometer does not show, from which on its foot moves, m/s, if it is so many times
that of the other leg."""

ALONE, SILENT = 0.6, 0.05
"""Shares of the weight that the foot which seems to carry the robot reports at least, and the other one at most."""

RESTS = 0.1
"""Speed of the feet against each other up to which both stand, m/s."""

MISSING, NEARLY = 0.35, 0.15
"""Share of the weight that force sensors do not report, of a robot that may be lighter by 30 % than its description;
and greatest difference of the vertical specific force from gravity, over gravity, at which the ground must carry it."""

STILL = (0.0, 0.0, 0.0)


class FootComparison:
    """Comparison of force sensors with legs and accelerometer, of a robot with two feet.

    Attributes:
        swapped: True while the foot in the air reports the weight, and the one on the ground none.
        together: True while the feet do not move against each other.
        silent: Index of a foot that stands on the ground, carries a part of the weight, and reports no force; else
            None.
    """

    def __init__(self, dt: float) -> None:
        """Start with nothing known; dt is the control period, s."""
        self._dt, self._keep, self._gain = dt, 1.0 - lag_gain(dt, MEMORY), lag_gain(dt, SMOOTHING)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self.swapped, self.together = False, True
        self.silent: int | None = None
        self._last: Sequence[Vector] | None = None
        # Of each leg: the velocity that the accelerometer does not show, and its low-pass, in the world, m/s.
        self._parted: list[Vector] = [STILL, STILL]
        self._smooth: list[Vector] = [STILL, STILL]
        self._between: Vector = STILL
        self._since = [0.0, 0.0]
        self._alone: int | None = None  # foot that carries the robot by its sensor

    def move(self, feet: Sequence[Vector], force: Vector) -> None:
        """Compare the legs with the accelerometer in one tick.

        Args:
            feet: Velocities of the two feet against the IMU, in the world, m/s.
            force: Specific force at the IMU, in the world, m/s².
        """
        last, self._last = self._last, feet
        if last is None:
            return
        dt, keep, gain = self._dt, self._keep, self._gain
        fx, fy, fz = dt * force[0], dt * force[1], dt * (force[2] - GRAVITY)
        for i in (0, 1):
            (x, y, z), (u, v, w), (a, b, c) = feet[i], last[i], self._parted[i]
            self._parted[i] = a, b, c = keep * a + u - x - fx, keep * b + v - y - fy, keep * c + w - z - fz
            self._smooth[i] = part_way(self._smooth[i], (a, b, c), gain)
        (x, y, z), (u, v, w) = feet
        self._between = a, b, c = part_way(self._between, (x - u, y - v, z - w), gain)
        self.together = a * a + b * b + c * c < RESTS**2

    def compare(self, shares: Sequence[float], gravity: float) -> None:
        """Compare the force sensors with the motion of the feet in one tick.

        Args:
            shares: Parts of the weight that the force sensors report, after a low-pass.
            gravity: Vertical specific force over gravity, after a low-pass.
        """
        carrying = 0 if shares[0] > shares[1] else 1
        few = shares[1 - carrying] < SILENT
        alone = carrying if few and shares[carrying] > ALONE else None
        if alone != self._alone and alone is not None:  # its swing is over
            self._parted, self._smooth = [STILL, STILL], [STILL, STILL]
        self._alone = alone
        sizes = [math.hypot(*parted) for parted in self._smooth]
        moves = alone is not None and sizes[carrying] > max(MOVES, MORE * sizes[1 - carrying])
        nearly = abs(gravity - 1.0) < NEARLY
        missing = few and self.together and nearly and shares[0] + shares[1] < 1.0 - MISSING
        for i, wrong in enumerate((moves, missing)):
            self._since[i] = self._since[i] + self._dt if wrong else 0.0
        self.swapped = self._since[0] >= LASTING
        self.silent = 1 - carrying if self._since[1] >= LASTING else None
