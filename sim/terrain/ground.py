"""Ground: a floor, solids on it and perhaps a height field, with one height query for all."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from wbc.base.numbers import Array
from wbc.sim.terrain.shapes import Box, Shape

FLOOR_GAP = 0.01
"""Depth of the endless floor below the lowest point of a height field, m: no contact is made twice."""

STRIP_DEPTH = 0.05
"""Depth of the flat strips' boxes below the floor, m."""


@dataclass(frozen=True, eq=False)
class HeightField:
    """Heights on a regular grid, linear over two triangles per cell.

    MuJoCo splits every cell along the diagonal from its (x low, y low) corner to its (x high, y high) corner, in
    rays and in contacts alike, so the query below and the drawn surface agree to single precision.
    """

    x0: float  # first column, m
    x1: float  # last column, m
    y0: float  # first row, m
    y1: float  # last row, m
    z: Array  # heights, shape (rows, columns), m; rows run along +y, columns along +x

    @property
    def step(self) -> tuple[float, float]:
        """Cell size along x and y, m."""
        rows, columns = self.z.shape
        return (self.x1 - self.x0) / (columns - 1), (self.y1 - self.y0) / (rows - 1)

    def top(self, x: Array, y: Array) -> Array:
        """Return the height of the surface, shape (n,), m; -inf outside the grid."""
        z, (rows, columns), (step_x, step_y) = self.z, self.z.shape, self.step
        u, v = (x - self.x0) / step_x, (y - self.y0) / step_y
        c = np.clip(np.floor(u).astype(np.intp), 0, columns - 2)
        r = np.clip(np.floor(v).astype(np.intp), 0, rows - 2)
        u, v = u - c, v - r
        z00, z01, z10, z11 = z[r, c], z[r, c + 1], z[r + 1, c], z[r + 1, c + 1]
        right = u >= v  # the triangle below
        along_x = np.where(right, z01 - z00, z11 - z10)
        along_y = np.where(right, z11 - z01, z10 - z00)
        inside = (x >= self.x0) & (x <= self.x1) & (y >= self.y0) & (y <= self.y1)
        return np.where(inside, z00 + u * along_x + v * along_y, -np.inf)


@dataclass(frozen=True, eq=False)
class Ground:
    """A surface z(x, y): the highest of an endless floor, solids and a height field."""

    floor: float  # level of the endless plane, m
    shapes: tuple[Shape, ...] = ()  # solids of the rough part
    strips: tuple[Box, ...] = ()  # flat start and stop, as boxes; empty where the floor itself is their level
    field: HeightField | None = None  # height map of the rough part, if it is drawn as one

    @cached_property
    def solids(self) -> tuple[Shape, ...]:
        """All solids, those of the rough part first."""
        return self.shapes + self.strips

    @cached_property
    def _boxes(self) -> Array:
        """Footprint rectangles of the solids, shape (n, 4), m."""
        return np.array([s.box for s in self.solids]).reshape(-1, 4)

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the height of the ground, m, at world x and y (m), in their broadcast shape; NaN where x or y is."""
        bx, by = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        known = ~(np.isnan(bx) | np.isnan(by))
        # Points sorted by x: each solid then looks at one slice of them, and most solids at none.
        order = np.argsort(bx[known], kind="stable")
        xs, ys = bx[known][order], by[known][order]
        z: Array = np.full(xs.shape, self.floor)
        if self.field is not None:
            z = np.maximum(z, self.field.top(xs, ys))
        if xs.size and self.solids:
            first = np.searchsorted(xs, self._boxes[:, 0], side="left")
            last = np.searchsorted(xs, self._boxes[:, 1], side="right")
            near = (last > first) & (self._boxes[:, 2] <= ys.max()) & (self._boxes[:, 3] >= ys.min())
            for i in np.flatnonzero(near):
                across = ys[first[i] : last[i]]
                inside = (across >= self._boxes[i, 2]) & (across <= self._boxes[i, 3])
                ids = first[i] + np.flatnonzero(inside)
                z[ids] = np.maximum(z[ids], self.solids[i].top(xs[ids], ys[ids]))
        heights, unsorted = np.full(bx.shape, np.nan), np.empty_like(z)
        unsorted[order] = z
        heights[known] = unsorted
        return heights


def flat_box(x0: float, x1: float, width: float, level: float, floor: float) -> Box:
    """Make a flat box from x0 to x1 with its top at `level`, reaching below the floor, m."""
    bottom = min(floor, level) - STRIP_DEPTH
    position = np.array([(x0 + x1) / 2.0, 0.0, (level + bottom) / 2.0])
    return Box(position, np.array([(x1 - x0) / 2.0, width / 2.0, (level - bottom) / 2.0]), np.eye(3))
