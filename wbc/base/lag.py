"""Exact discretisation of first-order lags: time constants are independent of the control period."""

from __future__ import annotations

import math


def lag_gain(dt: float, time_constant: float) -> float:
    """Return the share of the way to its input that a first-order lag goes in dt; 1 without a time constant."""
    return 1.0 if time_constant <= 0.0 else -math.expm1(-dt / time_constant)
