"""Readings that are refused: the reason of one, and signals as numbers of the right shape."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wbc.base.errors import MeasurementError, shown
from wbc.base.numbers import Array, unmasked
from wbc.core.signals import Measurement

TOLD = 4
"""Number of sensors that a message names."""


class Refusal(NamedTuple):
    """Reading that was refused.

    Attributes:
        sensor: Name of the sensor, such as "encoder of left_knee".
        value: The reading; NaN for one that is no number.
        low: Least reading that is accepted in this tick.
        high: Greatest reading that is accepted in this tick.
        unit: Unit of the three.
        jump: True for a reading that is in its range, but too far from the last one.
        why: What else is wrong, such as the shape of a signal.
    """

    sensor: str
    value: float = math.nan
    low: float = -math.inf
    high: float = math.inf
    unit: str = ""
    jump: bool = False
    why: str = ""

    def __str__(self) -> str:
        if self.why:
            return f"{self.sensor} ({self.why})"
        said = f"{self.value:.5g} {self.unit}" if math.isfinite(self.value) else "no number"
        when = " so soon after the last reading" if self.jump else ""
        return f"{self.sensor} ({said}, must lie in [{self.low:.4g}, {self.high:.4g}] {self.unit}{when})"


def few(texts: Sequence[object]) -> str:
    """Return some texts as one, the first `TOLD` and the number of the others."""
    more = [f"{len(texts) - TOLD} more"] if len(texts) > TOLD else []
    return ", ".join([*map(str, texts[:TOLD]), *more])


def numbers_of(m: Measurement, name: str, shape: tuple[int, ...]) -> Array:
    """Return a signal of a measurement as numbers of a shape."""
    value = getattr(m, name)
    if type(value) is np.ndarray and value.dtype == np.float64 and value.shape == shape:
        return value
    try:
        array = np.asarray(unmasked(value))  # a reading that is masked is none
    except Exception:  # lists of lists of different lengths, objects that fail
        array = np.empty(0, dtype=object)
    if array.dtype.kind not in "iuf":
        raise MeasurementError(f"{name} must be numbers of shape {shape}, got {shown(value)}")
    if array.shape != shape:
        raise MeasurementError(f"{name} must have shape {shape}, got {array.shape}")
    return array.astype(np.float64, copy=False)
