"""Residual of a momentum, the force that is not known, and normal forces from which a foot is on the ground."""

from __future__ import annotations

import numpy as np

from wbc.base.numbers import Array, lag_gain

TOUCH_DOWN = 0.08
"""Normal force from which a foot in the air has met the ground, over the weight."""

LIFT_OFF = 0.04
"""Normal force below which a foot on the ground has left it, over the weight."""


class MomentumResidual:
    """Observer of the unknown force on a momentum of some size.

    A momentum h changes by ḣ = f + w, with a known force f and an unknown one w. A first-order observer has w without
    a measured acceleration, ṙ = K (ḣ − f − r), since only the change of h from tick to tick is needed.

    Source: A. De Luca, A. Albu-Schäffer, S. Haddadin, G. Hirzinger, IROS 2006.

    Attributes:
        value: The residual r, which estimates the unknown force, shape (size,), N and Nm; the same array always.
        started: True once there is a momentum to compare the next one with.
    """

    def __init__(self, size: int, bandwidth: float) -> None:
        """Start at zero, with the gain K, 1/s."""
        self.value = np.zeros(size)
        self._time_constant = 1.0 / bandwidth
        self._momentum: Array = np.zeros(size)
        self.started = False

    def reset(self) -> None:
        """Forget the momentum, and return to zero."""
        self.value[:], self.started = 0.0, False

    def follow(self, momentum: Array, value: Array | None = None) -> None:
        """Take over a momentum, shape (size,), without learning from its change, and a residual if one is given."""
        self._momentum, self.started = momentum, True
        if value is not None:
            self.value[:] = value

    def update(self, momentum: Array, known: Array, dt: float) -> Array:
        """Return the residual for one more momentum, dt, s, after that which it follows, under a known force."""
        unknown = (momentum - self._momentum) / dt
        unknown -= known
        self._momentum = momentum
        unknown -= self.value
        unknown *= lag_gain(dt, self._time_constant)
        self.value += unknown
        return self.value
