"""`RangeSensor` and `RangeSampler`: readings of the range sensor under the toe, from the true distance."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING
from wbc.base.settings import NonNegative, Positive, Seed, Share, settings


@settings
class RangeSensor:
    """Errors and limits of a range sensor, which without arguments is perfect and read at every tick.

    Attributes:
        least: Shortest distance in range, m.
        greatest: Longest distance in range, m.
        noise: Standard deviation of a reading, m.
        relative_noise: Part of the standard deviation that grows with the distance, m/m.
        resolution: Quantum of a reading, m; 0 for none.
        dropout: Probability that a reading is lost.
        rate: Readings per second, Hz; 0 for a reading at every call.

    Source: the authors' public simulation has 200 Hz and a perfect sensor. Their later hardware had ranges of 0.1 m to
        4 m (VL6180, VL53L1X).
    """

    least: Annotated[NonNegative, "m"] = 0.0
    greatest: Annotated[Positive, "m"] = 4.0
    noise: Annotated[NonNegative, "m"] = 0.0
    relative_noise: NonNegative = 0.0
    resolution: Annotated[NonNegative, "m"] = 0.0
    dropout: Share = 0.0
    rate: Annotated[NonNegative, "Hz"] = 0.0

    def __post_init__(self) -> None:
        if self.greatest <= self.least:
            raise InputError(f"greatest (m) must exceed least, {self.least:g}, got {self.greatest:g}")


class RangeSampler:
    """Readings of one range sensor over time."""

    @checked
    def __init__(self, sensor: RangeSensor, seed: Seed = 0) -> None:
        self.sensor = sensor
        self._seed = seed
        self.reset()

    def reset(self) -> None:
        """Forget all readings and restart the noise."""
        self._random = np.random.default_rng(self._seed)
        self._due = -math.inf

    def due(self, time: float) -> bool:
        """Return True if `sample` takes a new reading at this time (s) and needs the true distance."""
        return time >= self._due - ROUNDING

    def sample(self, time: float, distance: float) -> float:
        """Return the reading at a time, s, that does not decrease, m; NaN if it is lost, out of range, or not due.

        The true distance along the ray, m, is infinite or NaN where the ray hits nothing.
        """
        if not self.due(time):
            return math.nan
        s = self.sensor
        if s.rate > 0.0:
            first = math.isinf(self._due)
            missed = 0.0 if first else math.floor((time - self._due) * s.rate + ROUNDING)
            self._due = (time if first else self._due + missed / s.rate) + 1.0 / s.rate
        # Both draws are made for every reading, so that its noise does not depend on the readings before it.
        normal, uniform = self._random.standard_normal(), self._random.random()
        if not (math.isfinite(distance) and s.least <= distance <= s.greatest and uniform >= s.dropout):
            return math.nan
        value = distance + normal * math.hypot(s.noise, s.relative_noise * distance)
        if s.resolution > 0.0:
            value = round(value / s.resolution) * s.resolution
        return min(max(value, s.least), s.greatest)
