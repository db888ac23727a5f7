"""Site: the rough part of a terrain, and layouts inside it that families share."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import Seed


class Draws:
    """One stream of uniform numbers, fixed by a seed and a key; another key is an independent stream.

    NumPy promises stable streams for its bit generators alone (NEP 19: `Generator` methods may change between
    releases), so the raw 64-bit words of PCG64 are turned into doubles here.
    """

    @checked
    def __init__(self, seed: Seed, key: str) -> None:
        """Start the stream of a seed, 0 or above, and a key, which tells a ground from all others of the seed."""
        words = np.frombuffer(hashlib.sha256(key.encode()).digest(), dtype="<u4")
        self._bits = np.random.PCG64(np.random.SeedSequence([seed, *words.tolist()]))

    def uniform(self, low: float, high: float, count: int) -> Array:
        """Draw `count` numbers from [low, high), shape (count,)."""
        words = self._bits.random_raw(count)
        unit = (np.asarray(words, dtype=np.uint64) >> np.uint64(11)) * 2.0**-53
        return np.asarray(low + (high - low) * unit, dtype=np.float64)


@dataclass(frozen=True)
class Site:
    """Place, size and random numbers of the rough part of a terrain."""

    x0: float  # start of the rough part, m
    x1: float  # end of the rough part, m
    width: float  # extent across, centred on y = 0, m
    amplitude: float  # highest minus lowest point, m
    draws: Draws  # source of uniform random numbers

    @property
    def length(self) -> float:
        """Length of the rough part, m."""
        return self.x1 - self.x0

    @property
    def area(self) -> float:
        """Area of the rough part, m²."""
        return self.length * self.width

    def tops(self, count: int, lowest: float) -> Array:
        """Draw `count` heights between `lowest` and 1 times the amplitude, m; the greatest is exactly the amplitude."""
        share = self.draws.uniform(lowest, 1.0, count)
        if count:
            share[np.argmax(share)] = 1.0
        return np.asarray(share * self.amplitude)

    def scatter(self, count: int, margin: float) -> Iterator[tuple[float, float]]:
        """Draw points anywhere in the rough part, `margin` (m) away from its edges."""
        self.require(2.0 * margin, 2.0 * margin)
        x = self.draws.uniform(self.x0 + margin, self.x1 - margin, count)
        y = self.draws.uniform(margin - self.width / 2.0, self.width / 2.0 - margin, count)
        return zip(x.tolist(), y.tolist(), strict=True)

    def hexagons(self, pitch: float, jitter: float, margin: float) -> Array:
        """Return points of a hexagonal lattice, shape (n, 2), m, some pitches (m) of jitter off along x and y.

        The jitter is drawn, 0 to 0.5 at most; the margin (m) is kept from the edges.
        """
        keep = margin + jitter * pitch
        self.require(2.0 * keep, 2.0 * keep + pitch / 2.0)
        xs = centred(self.x0 + keep, self.x1 - keep, pitch * math.sqrt(3.0) / 2.0)
        ys = centred(keep - self.width / 2.0, self.width / 2.0 - keep - pitch / 2.0, pitch)
        points = np.array([(x, y + (i % 2) * pitch / 2.0) for i, x in enumerate(xs) for y in ys])
        moves = self.draws.uniform(-jitter * pitch, jitter * pitch, points.size)
        return np.asarray(points + moves.reshape(-1, 2))

    def require(self, length: float, width: float) -> None:
        """Raise `InputError`, which says what is needed, if the rough part is not at least this long and wide (m)."""
        if self.length < length or self.width < width:
            raise InputError(
                f"the rough part is {self.length:g} m x {self.width:g} m (length x width); with these parameters "
                f"it must be at least {length:.3g} m x {width:.3g} m"
            )


def centred(low: float, high: float, pitch: float) -> Array:
    """Place as many points `pitch` apart as fit between low and high, centred, shape (n,)."""
    count = max(1, math.floor((high - low) / pitch + ROUNDING) + 1)
    return np.asarray((low + high) / 2.0 + pitch * (np.arange(count) - (count - 1) / 2.0))


def cells(extent: float, step: float) -> int:
    """Count the cells no wider than `step` that divide `extent` evenly."""
    return max(1, math.ceil(extent / step - ROUNDING))
