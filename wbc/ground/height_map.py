"""Heights of the ground on square cells about the robot, fused from frames of points.

Every cell holds one height with its variance, as a Kalman filter of one state. The grid rolls: a cell is found by its
place modulo the size, and belongs to the place that was written last. Before a frame is fused, the whole map is shifted
to it by the median difference of the cells that both know: on soft soles the estimated height climbs by up to 15 mm a
step, and a map that keeps its old heights trips the feet.

After P. Fankhauser, M. Bloesch, M. Hutter, "Probabilistic terrain mapping for mobile robots with uncertain
localization", IEEE RA-L 3(4), 2018.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError, shown
from wbc.base.numbers import Array
from wbc.base.settings import Count, NonNegative, Number, Numbers, Positive, Share, settings

Places = NDArray[np.complex128]
"""Places x + iy in the world, m."""

Index = NDArray[np.int64]

BITS = 7
"""Binary digits of the number of cells along each side: 128, 2.56 m with cells of 20 mm."""

SIDE = 1 << BITS
MASK = SIDE - 1
STRIDE = 20
"""Binary digits of the number of cells across, in the code of a cell."""

FAR = float(1 << (STRIDE - 1))
"""Number of cells by which the grid begins before the origin, so that all indices are positive: 10 km."""

HELD = 0.45
"""Half of the share of its side that the grid holds at once about a middle."""

REFRESH = 0.5
"""Time after which the age of all cells is looked at again, s."""

NOBODY = -1
"""Code of a cell that nobody has written."""


@settings
class HeightMapSettings:
    """Settings of a height map.

    Attributes:
        cell: Size of a cell, m. The map has 128 × 128 cells: they reach further than a step, and a sole covers several.
        gate: Difference in height beyond three standard deviations from which a cell holds another surface, m.
        wander: Growth of the uncertainty of a height that is not seen again, m/√s.
        known: Standard deviation from which on a height counts as unknown, m.
        shared: Number of cells that map and frame must share for the map to be shifted to the frame.
        follow: Share of the shift to a frame that is made.
    """

    cell: Annotated[float, Field(ge=0.01, le=0.05), "m"] = 0.02
    gate: Annotated[NonNegative, "m"] = 0.006
    wander: Annotated[NonNegative, "m/√s"] = 0.002
    known: Annotated[Positive, "m"] = 0.015
    shared: Count = 100
    follow: Share = 1.0


class HeightMap:
    """Heights of the ground on a grid around the robot.

    Attributes:
        settings: Its `HeightMapSettings`.
        origin: Position (m) and heading (rad) of the grid in the world. They are those of the robot at the start, so
            that a walk in a rotated world has the same map.
    """

    @checked
    def __init__(
        self,
        settings: HeightMapSettings | None = None,
        origin: tuple[Number, Number, Number] = (0.0, 0.0, 0.0),
    ) -> None:
        """Start with all heights unknown; the settings are the defaults when None."""
        self.settings = s = settings or HeightMapSettings()
        self.origin = origin
        x, y, yaw = origin
        self._place, self._turn = complex(x, y), complex(math.cos(yaw), -math.sin(yaw)) / s.cell
        self._z, self._seen = np.zeros(SIDE * SIDE), np.zeros(SIDE * SIDE)
        self._var = np.full(SIDE * SIDE, np.inf)
        self._code = np.full(SIDE * SIDE, NOBODY, np.int64)
        self._heights, self._std = np.full(SIDE * SIDE, np.nan), np.full(SIDE * SIDE, np.inf)  # what is known
        self._refreshed = -math.inf  # time at which all cells were, s
        self._time = -math.inf  # of the newest frame, s

    @checked
    def add(
        self,
        points: Annotated[ArrayLike, Numbers(), "m"],
        std: Annotated[ArrayLike, Numbers(low=0.0), "m"],
        time: Annotated[Number, "s"],
    ) -> float | None:
        """Fuse the points of one frame.

        A frame may come late, after newer ones. The ground may have changed since, so its heights count as less exact
        by the time in between. It is shifted to the map, and replaces nothing that has been seen since.

        Args:
            points: Points in the world, shape (n, 3), m.
            std: Standard deviations of their heights, shape (n,), m.
            time: Time at which they were seen, s.

        Returns:
            Height by which the map is shifted to agree with the frame, m; None if they overlap too little, or the frame
            is late.

        Raises:
            InputError: A number is not finite, or the shapes do not fit.
        """
        points, std = np.asarray(points), np.asarray(std)
        if not points.size:
            return None
        if points.ndim != 2 or points.shape[1] != 3 or std.shape != points.shape[:1]:
            raise InputError(
                f"points and std of a height map must have shapes (n, 3) and (n,), got {points.shape} and {std.shape}"
            )
        s = self.settings
        slot, code, z, r = self._frame(points, std)
        late = time < self._time
        if late:  # slots that now belong to other places stay
            owner = self._code[slot]
            mine = (owner == code) | (owner == NOBODY) | (self._seen[slot] <= time)
            slot, code, z, r = slot[mine], code[mine], z[mine], r[mine]
        self._time = now = max(time, self._time)
        foreign = self._code[slot] != code
        age = np.where(foreign, 0.0, time - self._seen[slot])
        since = np.minimum(age, 0.0)  # negative for what has been seen since a late frame
        r -= s.wander**2 * since
        var = self._var[slot] + s.wander**2 * (age - since)
        var[foreign] = np.inf
        shift = self._difference(slot, z, var)
        if late:
            z, shift = z - (shift or 0.0), None
        elif shift is not None:
            self._z += shift
        self._fuse(slot, z, r, var, since < 0.0)
        self._code[slot], self._seen[slot] = code, time - since
        self._refresh(now, slot, shift is not None)
        return shift

    def _fuse(self, slot: Index, z: Array, r: Array, var: Array, newer: NDArray[np.bool_]) -> None:
        """Fuse heights of variance r into cells of variance `var`; those that are known newer are not replaced."""
        old = self._z[slot]
        step = z - old
        # A higher surface replaces what is there at once; a lower one only when it has been seen again and again.
        gate = 3.0 * np.sqrt(var + r) + self.settings.gate
        fresh = ~np.isfinite(var) | (step > gate)
        below = ~fresh & (step < -gate)
        var[fresh] = 0.0
        gain = np.where(fresh, 1.0, np.where(below, 0.0, var / (var + r)))
        variance = np.where(fresh, r, np.where(below, 1.5 * var + 1e-5, (1.0 - gain) * var))
        kept = newer & (fresh | below)
        gain[kept], variance[kept] = 0.0, self._var[slot[kept]]
        self._z[slot] = old + gain * step
        self._var[slot] = variance

    @checked
    def shift(self, height: Annotated[Number, "m"]) -> None:
        """Move all heights up by a height, m."""
        self._z += height
        self._heights += height

    @checked
    def rewind(self, time: Annotated[Number, "s"]) -> None:
        """Set the time at which all heights were seen to a time, s, when the clock starts again."""
        np.minimum(self._seen, time, out=self._seen)
        self._refreshed, self._time = -math.inf, time

    def at(self, places: Places) -> tuple[Array, Array]:
        """Return heights (NaN where unknown) and standard deviations, m, at places x + iy, complex, shape (n,), m.

        An `InputError` for places that are something else.
        """
        places = np.asarray(places)
        if places.dtype != np.complex128 or places.ndim != 1 or not np.isfinite(places).all():
            raise InputError(
                f"places on a height map must be finite complex numbers x + iy, m, of shape (n,), got {shown(places)}"
            )
        slot, code = self._cells(places)
        mine = self._code[slot] == code
        return np.where(mine, self._heights[slot], np.nan), self._std[slot]

    def known(self) -> tuple[Array, Array]:
        """Return the centres of all known cells in the world, shape (n, 3), m, and their standard deviations."""
        slot = np.flatnonzero(~np.isnan(self._heights))
        code = self._code[slot]
        i, j = (code >> STRIDE) - FAR + 0.5, (code & ((1 << STRIDE) - 1)) - FAR + 0.5
        place = (i + 1j * j) / self._turn + self._place
        return np.stack([place.real, place.imag, self._heights[slot]], axis=1), self._std[slot]

    def holds(self, places: Places, middle: complex) -> NDArray[np.bool_]:
        """Return True for each place x + iy, m, that is inside the grid around a middle, m.

        The square is that of the grid, with its heading. No two places in it are stored in the same slot of the grid.
        """
        grid = (places - middle) * self._turn
        return (np.abs(grid.real) < HELD * SIDE) & (np.abs(grid.imag) < HELD * SIDE)

    def _cells(self, places: Places) -> tuple[Index, Index]:
        """Return the slots of the cells of places, and their codes, which no two places share."""
        grid = ((places - self._place) * self._turn).view(np.float64) + FAR
        index = grid.astype(np.int64)
        code = (index[0::2] << STRIDE) + index[1::2]
        return ((code >> (STRIDE - BITS)) & (MASK << BITS)) | (code & MASK), code

    def _frame(self, points: Array, std: Array) -> tuple[Index, Index, Array, Array]:
        """Return cells, codes, heights and variances of a frame, one for each cell that it sees."""
        slot, code = self._cells(points[:, 0] + 1j * points[:, 1])
        order = np.argsort(slot.astype(np.int16), kind="stable")
        slot, code, z, variance = slot[order], code[order], points[order, 2], std[order] ** 2
        first = np.flatnonzero(np.concatenate(([True], slot[1:] != slot[:-1])))
        count = np.diff(np.append(first, slot.size))
        mean = np.add.reduceat(z, first) / count
        r = np.add.reduceat(variance, first) / count
        spread = np.maximum.reduceat(z, first) - np.minimum.reduceat(z, first)
        # Two surfaces in one cell, at an edge: the mean of the upper part.
        upper = z >= np.repeat(mean, count)
        tops = np.maximum(np.add.reduceat(upper.astype(np.float64), first), 1.0)
        top = np.add.reduceat(np.where(upper, z, 0.0), first) / tops
        two = spread > 4.0 * np.sqrt(r) + self.settings.gate
        return slot[first], code[first], np.where(two, top, mean), r / np.where(two, tops, count)

    def _difference(self, slot: Index, z: Array, var: Array) -> float | None:
        """Return the median difference of a frame to what is known well, m, times `follow`; None of too few cells."""
        shared = np.flatnonzero(var < (1.4 * self.settings.known) ** 2)
        if shared.size < self.settings.shared:
            return None
        return self.settings.follow * float(np.median(z[shared] - self._z[slot[shared]]))

    def _refresh(self, time: float, slot: Index, moved: bool) -> None:
        """Compute what is known now: of all cells when they have moved or grown old, else of those just seen."""
        if moved or time >= self._refreshed + REFRESH:
            self._refreshed = time
            np.sqrt(self._var + self.settings.wander**2 * (time - self._seen), out=self._std)
            np.copyto(self._heights, self._z)
            self._heights[self._std >= self.settings.known] = np.nan
        else:
            self._std[slot] = std = np.sqrt(self._var[slot])
            self._heights[slot] = np.where(std < self.settings.known, self._z[slot], np.nan)
