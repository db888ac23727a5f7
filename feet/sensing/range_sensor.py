"""The range sensor under the toe: what it would read, given the true distance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wbc.core.errors import InputError, finite_scalar, non_negative, positive


@dataclass(frozen=True)
class RangeSensor:
    """Errors and limits of a range sensor; the defaults are those of a perfect one read at every tick.

    Attributes:
        least: Shortest distance that it sees, m.
        greatest: Longest distance that it sees, m.
        noise: Standard deviation of a reading, m.
        relative_noise: Part of the standard deviation that grows with the distance, per metre of distance.
        resolution: Quantum of a reading, m; 0 for none.
        dropout: Probability that a reading is lost.
        rate: Readings per second; 0 reads whenever it is asked.

    Source: 200 Hz and a perfect sensor in the authors' public simulation; their later hardware used ranges of
    0.1 m to 4 m (VL6180, VL53L1X).
    """

    least: float = 0.0
    greatest: float = 4.0
    noise: float = 0.0
    relative_noise: float = 0.0
    resolution: float = 0.0
    dropout: float = 0.0
    rate: float = 0.0

    def __post_init__(self) -> None:
        non_negative("shortest range (m)", self.least)
        positive("longest range (m)", self.greatest)
        if self.greatest <= self.least:
            raise InputError(f"longest range {self.greatest:g} m must exceed the shortest, {self.least:g} m")
        non_negative("range noise (m)", self.noise)
        non_negative("relative range noise", self.relative_noise)
        non_negative("range resolution (m)", self.resolution)
        finite_scalar("dropout probability", self.dropout, low=0.0, high=1.0)
        non_negative("range rate (Hz)", self.rate)


class RangeSampler:
    """Readings of one range sensor over time.

    Attributes:
        sensor: Its limits and errors.
        reading: Last reading, m; NaN when it saw nothing.
        fresh: True if the last call took a new reading instead of holding the one before.
    """

    def __init__(self, sensor: RangeSensor, seed: int = 0) -> None:
        """Start without a reading.

        Args:
            sensor: Limits and errors.
            seed: Seed of its noise and drop-outs.
        """
        self.sensor = sensor
        self._seed = seed
        self.reset()

    def reset(self) -> None:
        """Forget all readings and start the noise again."""
        self._random = np.random.default_rng(self._seed)
        self._due = -math.inf
        self.reading = math.nan
        self.fresh = False

    def due(self, time: float) -> bool:
        """True if `sample` would take a new reading at this time (s), so that the ray is worth casting."""
        return time >= self._due - 1e-9

    def sample(self, time: float, distance: float) -> float:
        """Read the sensor.

        Args:
            time: Now, s; must not decrease between calls.
            distance: True distance along the ray, m; infinite or NaN when the ray hits nothing.

        Returns:
            The reading, m; NaN if it was lost or out of range. Between two readings the last one is held.
        """
        self.fresh = self.due(time)
        if not self.fresh:
            return self.reading
        s = self.sensor
        if s.rate > 0.0:
            first = math.isinf(self._due)
            missed = 0.0 if first else math.floor((time - self._due) * s.rate + 1e-9)
            self._due = (time if first else self._due + missed / s.rate) + 1.0 / s.rate
        # Both draws are made every time, so that the noise of one reading does not depend on the one before.
        normal, uniform = self._random.standard_normal(), self._random.random()
        self.reading = math.nan
        if math.isfinite(distance) and s.least <= distance <= s.greatest and uniform >= s.dropout:
            value = distance + normal * math.hypot(s.noise, s.relative_noise * distance)
            if s.resolution > 0.0:
                value = round(value / s.resolution) * s.resolution
            self.reading = min(max(value, s.least), s.greatest)
        return self.reading
