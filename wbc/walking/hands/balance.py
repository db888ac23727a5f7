"""Shift of the centre of mass with which feet keep their ZMP while hands press."""

from __future__ import annotations

import numpy as np

from wbc.core.errors import Array
from wbc.tasks.stabilizer.pendulum import Pendulum

SHIFT_TIME = 0.15
"""Time constant with which the CoM follows the planned forces, s, twice: its acceleration is bounded."""


class ComShift:
    """Shift of the CoM that follows its goal like a critically damped mass.

    Attributes:
        value: Shift, shape (2,), m.
    """

    def __init__(self) -> None:
        """Begin without a shift."""
        self.reset()

    def reset(self) -> None:
        """Forget the shift at once."""
        self.value, self._speed, self._acceleration = np.zeros(2), np.zeros(2), np.zeros(2)

    @property
    def still(self) -> bool:
        """True once the shift has decayed to zero."""
        return float(np.abs(self.value).max() + np.abs(self._speed).max()) < 1e-5

    def follow(self, goal: Array, dt: float) -> None:
        """Advance by one tick towards the planned shift, shape (2,), m."""
        rate = 1.0 / SHIFT_TIME
        self._acceleration = rate * rate * (goal - self.value) - 2.0 * rate * self._speed
        self._speed = self._speed + dt * self._acceleration
        self.value = self.value + dt * self._speed

    def applied(self, pendulum: Pendulum) -> Pendulum:
        """Return a reference of the pendulum without hands, moved by the shift."""
        com, velocity, acceleration = (
            pendulum.com.copy(),
            pendulum.com_velocity.copy(),
            pendulum.com_acceleration.copy(),
        )
        zmp = pendulum.zmp.copy()
        com[:2] += self.value
        velocity[:2] += self._speed
        acceleration[:2] += self._acceleration
        zmp[:2] += self.value - self._acceleration / pendulum.omega**2
        return pendulum._replace(com=com, com_velocity=velocity, com_acceleration=acceleration, zmp=zmp)
