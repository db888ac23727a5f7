"""Comparison of the gyroscope with accelerometer and legs: it turns the legs about the foot that stands.

The velocity that the leg of this foot gives the inertial measurement unit contains the rate of the gyroscope times the
height over the foot, the velocity by the accelerometer does not. A foot that truly turns moves the accelerometer, too.
"""

from __future__ import annotations

import math

from wbc.base.numbers import lag_gain
from wbc.base.vectors import Vector
from wbc.core.estimation.foot import STILL
from wbc.core.estimation.legs import MEMORY, OFFSET, SMOOTHING

FOOT_SPIN = 0.5
"""Speed about the vertical above which a foot on the ground slides, so that speeds are not compared, rad/s."""

SLAP = 2.0
"""Speed about a horizontal axis above which a foot that carries slaps down from an edge, rad/s."""

SLAPPED = 0.05
"""Time for which legs and accelerometer are not compared after that, s: the foot leaves the ground in part, and its end
is a blow."""

SPEED_DIFFERENCE = 0.035
"""Greatest difference between the speeds of legs and accelerometer within 0.3 s, m/s, while the foot on the ground
seems to turn: one that turns, as on stones, moves the accelerometer, too; an error of the gyroscope does not."""

STANCE_ROTATION = 0.05
"""Speed from which on the foot on the ground seems to turn, rad/s."""

SUSPICION = 0.1
"""Time for which the difference must be too large while the robot stays calm, s."""

# Where wrenches are estimated, the loads of feet that land come late, and legs seem to jerk.
BLIND = 1.5
"""Factor of the greatest difference there."""

BLIND_SUSPICION = 0.15
"""Time for which it must be too large there, s."""

REMEMBERED = 1.0
"""Time for which a doubt of the gyroscope stays, s: the difference fades while the gyroscope stays wrong."""


class GyroscopeComparison:
    """Comparison of the velocity by the leg that stands with that by the accelerometer; x + iy in the world, m/s."""

    def __init__(self, dt: float) -> None:
        """Start with nothing known; dt is the control period, s."""
        self._dt, self._smoothing = dt, lag_gain(dt, SMOOTHING)
        self._keep, self._offset_gain = 1.0 - lag_gain(dt, MEMORY), lag_gain(dt, OFFSET)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self._drift = self._offset = self._parted = (
            0j  # difference, what of it is normal, the rest after a low-pass
        )
        self._turned: Vector = STILL  # turn of the foot since the difference has been too large, rad
        # Time for which the difference has been too large, and for which a slap and a doubt still count, s.
        self._suspected = self._slapped = self._doubted = 0.0

    def update(self, stance: Vector, unexplained: complex, *, blind: bool, steady: bool, turns: bool) -> bool:
        """Compare for one tick; return True while the gyroscope is doubted.

        Args:
            stance: Angular velocity of the foot that stands, by encoders and gyroscope, in the world, rad/s.
            unexplained: Change of the legs' velocity that the accelerometer does not show (`InertialFilter`).
            blind: True if wrenches are estimated.
            steady: True for a calm robot on its feet.
            turns: True if a foot turns as only a wrong gyroscope explains (`LegComparison`).
        """
        most, lasting = (
            (BLIND * SPEED_DIFFERENCE, BLIND_SUSPICION) if blind else (SPEED_DIFFERENCE, SUSPICION)
        )
        u, v, w = stance
        self._slapped = SLAPPED if math.hypot(u, v) > SLAP else self._slapped - self._dt
        if turns:
            self._doubted = REMEMBERED
        if not steady or abs(w) > FOOT_SPIN or self._slapped > 0.0:  # or slides, or steps out of a push
            self._suspected = 0.0
            self._drift, self._parted, unexplained = self._offset, 0j, 0j
        self._drift = drift = self._keep * self._drift + unexplained
        self._offset += self._offset_gain * (drift - self._offset)
        self._parted += self._smoothing * (drift - self._offset - self._parted)
        if abs(self._parted) > most:
            self._suspected += self._dt
            x, y, z = self._turned
            self._turned = x + self._dt * u, y + self._dt * v, z + self._dt * w
            if self._suspected >= lasting and math.hypot(*self._turned) > STANCE_ROTATION * self._suspected:
                self._doubted = REMEMBERED
        elif self._suspected:
            self._suspected, self._turned = 0.0, STILL
        if self._doubted <= 0.0:
            return False
        self._doubted -= self._dt
        return True
