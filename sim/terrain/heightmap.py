"""Height map: a grid of heights, interpolated exactly as MuJoCo draws a height field."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.core.errors import Array


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Heights on a regular grid, linear over two triangles per cell.

    MuJoCo splits every cell along the diagonal from its (x low, y low) corner to its (x high, y high) corner, in
    rays and in contacts alike, so the query below and the drawn surface agree to single precision.

    Args:
        x0: First column, m.
        x1: Last column, m.
        y0: First row, m.
        y1: Last row, m.
        z: Heights, shape (rows, columns), m; rows run along +y, columns along +x.
    """

    x0: float
    x1: float
    y0: float
    y1: float
    z: Array

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
