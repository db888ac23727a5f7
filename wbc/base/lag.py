"""Exact discretisation of first-order lags: time constants are independent of the control period."""

from __future__ import annotations

import math

import numpy as np

from wbc.base.numbers import Array, scalar


def lag_gain(dt: float, time_constant: float) -> float:
    """Return the share of the way to its input that a first-order lag goes in dt; 1 without a time constant."""
    return 1.0 if time_constant <= 0.0 else -math.expm1(-dt / time_constant)


class LagGain:
    """`lag_gain` for arrays, computed again only when its arguments change."""

    def __init__(self) -> None:
        self._of = (math.nan, math.nan)
        self._gain: Array = np.zeros(())
        self.number = 0.0

    def __call__(self, dt: float, time_constant: float) -> Array:
        """Return the gain, a read-only array without axes."""
        if self._of != (dt, time_constant):
            self._of = (dt, time_constant)
            self.number = lag_gain(dt, time_constant)
            self._gain = scalar(self.number)
        return self._gain
