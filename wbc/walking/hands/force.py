"""Force with which a hand presses: the one asked for, as far as the arm gives it."""

from __future__ import annotations

import math

from wbc.base.numbers import ROUNDING
from wbc.core.trajectories import Ramp

BOUNDED = 1.0
"""Lack of force from which on an arm counts as too weak, N."""

LOSS, LOSS_TIME = 0.3, 0.02
"""Ratio of measured to planned force below which a contact is lost after a time, and that time, s."""


class PressForce:
    """Force of one hand that presses, along its direction.

    Attributes:
        ramp: The force that is asked for, N.
    """

    def __init__(self, start: float = 0.0) -> None:
        """Begin with a force, N."""
        self.ramp = Ramp(start)
        self._most = math.inf  # force that the arm has, N
        self._lacked = 0.0  # time for which the measured force has been too small, s

    @property
    def planned(self) -> float:
        """The force that is asked for, limited to what the arm gives, N."""
        return min(self.ramp.value, self._most)

    def planned_after(self, time: float) -> float:
        """Return the planned force after a time, s, N."""
        return min(self.ramp.after(time), self._most)

    def fade(self, duration: float) -> None:
        """Reduce the force to zero within a time, s."""
        self.ramp = Ramp(self.planned)
        self.ramp.to(0.0, duration)

    def advance(self, given: float, asked: float, dt: float) -> bool:
        """Move on by a period dt, s, after the QP has given a force for the one that it was asked for, N.

        The answer is True if the arm is too weak.
        """
        weak = given < asked - BOUNDED
        self._most = given if weak else math.inf
        self.ramp.advance(dt)
        return weak

    def is_lost(self, pressed: float, touch: float, dt: float) -> bool:
        """Return True once a measured force has been too small for `LOSS_TIME`; no more than two touches are lost."""
        short = pressed < LOSS * self.planned and self.planned > 2.0 * touch
        self._lacked = self._lacked + dt if short else 0.0
        return self._lacked > LOSS_TIME + ROUNDING
