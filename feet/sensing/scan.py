"""`GroundScan`: profile of the ground along the walking direction, from ranges and poses of a swinging foot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array, finite_array, finite_scalar
from wbc.base.settings import Positive, settings

PROFILE_STEP = 0.007
"""Distance of the samples of a profile, m: the public profiles of the paper's authors have 429 samples on 3 m."""

MAX_GAP = 0.028
"""Widest gap that is bridged, m: one phalanx of the paper's foot, its shortest rigid piece."""

Numbers: TypeAlias = Sequence[float] | Array
"""Three numbers."""


@settings
class ScanSettings:
    """Settings of a profile: grid, gaps and length.

    Attributes:
        step: Distance of the profile's samples, m.
        max_gap: Widest gap between hits that is bridged by a straight line, m; at a wider one the profile is cut.
        capacity: Cells of the buffer; with the step it bounds the length of a profile. A quarter of them lies behind
            the first hit.
    """

    step: Annotated[Positive, "m"] = PROFILE_STEP
    max_gap: Annotated[Positive, "m"] = MAX_GAP
    capacity: Annotated[int, Field(ge=16)] = 256

    def __post_init__(self) -> None:
        if self.max_gap < self.step:
            raise InputError(f"max_gap (m) must be at least one step, {self.step:g}, got {self.max_gap:g}")


@dataclass(frozen=True, eq=False)
class Profile:
    """Heights of the ground on a uniform grid along a line in the world."""

    x: Array  # distance along `forward` from the world origin, ascending multiples of the step, shape (n,), m
    z: Array  # world height, shape (n,), m
    lateral: Array  # distance to the left of the line through the world origin along `forward`, shape (n,), m
    seen: NDArray[np.bool_]  # True where a hit is within half a step, elsewhere z is interpolated, shape (n,)
    forward: Array  # unit vector of the walking direction in the world's x–y plane, shape (2,)
    step: float  # distance of the samples, m

    @property
    def length(self) -> float:
        """Distance from the first to the last sample, m."""
        return float(self.x[-1] - self.x[0])

    @property
    def coverage(self) -> float:
        """Share of the samples with hits."""
        return float(self.seen.mean())

    @property
    def points(self) -> Array:
        """The samples in the world, shape (n, 3), m."""
        (c, s), x, y = self.forward, self.x, self.lateral
        return np.stack([c * x - s * y, s * x + c * y, self.z], axis=-1)

    def last(self, length: float) -> Profile:
        """Return the end of the profile, nearest to the landing place, at most `length` (m) long."""
        count = (
            int(finite_scalar("length of the end of a profile (m)", length, above=0.0) / self.step + 1e-6) + 1
        )
        if count >= self.x.size:
            return self
        cut = slice(self.x.size - count, None)
        return Profile(self.x[cut], self.z[cut], self.lateral[cut], self.seen[cut], self.forward, self.step)


class GroundScan:
    """Hits on the ground, summed up in cells of one profile step; a tick costs microseconds and allocates nothing.

    A profile is the broken line through the centroids of the hits in each cell: exact on straight ground, independent
    of the order and number of the hits, and with less noise where the foot is slow.

        scan = GroundScan()
        scan.start((1.0, 0.0))
        scan.add(sensor_position, ray_direction, distance)    # every tick
        profile = scan.profile()

    Attributes:
        settings: Settings of the profile.
        hits: Hits since the start.
        lost: Readings without a hit since the start.
        outside: Hits beyond the capacity since the start; not used.
    """

    def __init__(self, settings: ScanSettings | None = None) -> None:
        """Start along the world's x axis."""
        self.settings = ScanSettings() if settings is None else settings
        # Rows: number of hits, sums of x, z and lateral. A cell's x is summed from the cell's centre to keep digits.
        self._sums = np.zeros((4, int(self.settings.capacity)))
        self.start()

    def start(self, forward: ArrayLike = (1.0, 0.0)) -> None:
        """Forget all hits and scan along a direction in the world's x–y plane, any length, shape (2,)."""
        given = finite_array("walking direction", forward, (2,))
        norm = math.hypot(*given)
        if norm < ROUNDING:
            raise InputError(f"walking direction must not be zero, got {given}")
        self._c, self._s = float(given[0]) / norm, float(given[1]) / norm
        self._sums[:] = 0.0
        self._first: int | None = None
        self.hits = self.lost = self.outside = 0

    def add(self, position: Numbers, ray: Numbers, distance: float) -> bool:
        """Add one reading, m, which is NaN or infinite without a hit; return True if it was used.

        Position of the sensor, m, and unit vector of its ray have shape (3,), in the world. A controller gives
        estimated poses, the true ones are known in a simulator alone.
        """
        if not math.isfinite(distance):
            self.lost += 1
            return False
        px, py, pz = position
        dx, dy, dz = ray
        wx, wy = px + distance * dx, py + distance * dy
        x = self._c * wx + self._s * wy
        z = pz + distance * dz
        if not math.isfinite(x + z):
            self.lost += 1
            return False
        step, sums = self.settings.step, self._sums
        cell = math.floor(x / step + 0.5)
        if self._first is None:
            self._first = cell - sums.shape[1] // 4
        i = cell - self._first
        if not 0 <= i < sums.shape[1]:
            self.outside += 1
            return False
        sums[0, i] += 1.0
        sums[1, i] += x - cell * step
        sums[2, i] += z
        sums[3, i] += self._c * wy - self._s * wx
        self.hits += 1
        return True

    def profile(self) -> Profile:
        """Return the profile of the ground so far.

        Where the distance of two neighbouring cells with hits exceeds `max_gap`, the profile is cut and the longest
        piece returned, the later one if two are equally long.
        """
        filled = np.flatnonzero(self._sums[0])
        if filled.size < 2:
            raise InputError(
                f"no profile: {self.hits} hits in {filled.size} cells ({self.lost} readings lost, {self.outside} "
                "out of reach); hits in two cells are needed"
            )
        assert self._first is not None, "there are hits"
        step, cell = self.settings.step, filled + self._first
        mean = self._sums[1:, filled] / self._sums[0, filled]
        x = cell * step + mean[0]
        cuts = np.flatnonzero(np.diff(x) > self.settings.max_gap + ROUNDING) + 1
        begins, ends = np.append(0, cuts), np.append(cuts, x.size)
        lengths = cell[ends - 1] - cell[begins]  # in cells, to compare without rounding
        best = lengths.size - 1 - int(np.argmax(lengths[::-1]))
        piece = slice(int(begins[best]), int(ends[best]))
        x, cell = x[piece], cell[piece]
        nodes = np.arange(math.ceil(x[0] / step - ROUNDING), math.floor(x[-1] / step + ROUNDING) + 1)
        if nodes.size < 2:
            raise InputError(f"no profile: the longest piece without a gap is {x[-1] - x[0]:.4f} m long")
        at = nodes * step
        return Profile(
            x=at,
            z=np.interp(at, x, mean[1, piece]),
            lateral=np.interp(at, x, mean[2, piece]),
            seen=np.isin(nodes, cell, assume_unique=True),
            forward=np.array([self._c, self._s]),
            step=step,
        )
