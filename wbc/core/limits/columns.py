"""Ground of a height map among the shapes of a limit on collisions."""

from __future__ import annotations

import math
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbc.base.numbers import Array
from wbc.core.limits.obstacles import DEPTH, CollisionHeights

WIDE = 1.0
"""Half of the side of a column in which a shape has sunk, m: it leaves the ground upward, not through the next cell."""


class Columns:
    """Columns of a height map among the shapes of a limit, one after the other in the place of one box.

    A lower bound on the distance of a shape to each column is that of points inside it, less how far the shape reaches
    beyond them. The columns are measured in the order of this bound, until it exceeds the least distance: the result
    is that of all columns.

    Attributes:
        index: Number of the box among the shapes.
    """

    def __init__(self, shape: CollisionHeights, box: Any, index: int) -> None:
        """Put the columns of a map into the place of a box."""
        self.index, self._heights, self._box = index, shape.heights, box
        self._narrow = np.array(box.halfSide)
        #: Points inside each shape, and its reach beyond them.
        self._known: dict[int, tuple[Array, float]] = {}

    def nearest(
        self, geometry: pin.GeometryModel, data: pin.GeometryData, row: int, influence: float
    ) -> Any | None:
        """Return coal's result for the pair of a row and its nearest column; None without one within `influence`, m."""
        item = geometry.collisionPairs[row].first
        if item not in self._known:
            self._known[item] = _points_inside(geometry.geometryObjects[item].geometry, self._cell)
        (inside, reach), place = self._known[item], data.oMg[item]
        points = inside.dot(place.rotation.T) + place.translation
        across, above, turn, at, heights = self._offsets(points, influence + reach)
        bounds = np.hypot(np.abs(across), np.maximum(above, 0.0)).min(axis=0) - reach
        best, least = -1, influence
        for number in np.argsort(bounds).tolist():
            if bounds[number] >= least:
                break
            result = self._measure(geometry, data, row, at[number], float(heights[number]), turn)
            if result.min_distance < least:
                best, least = number, result.min_distance
        if best < 0:
            return None
        if least < 0.0:
            self._box.halfSide = np.array([WIDE, WIDE, self._narrow[2]])
        result = self._measure(geometry, data, row, at[best], float(heights[best]), turn)
        self._box.halfSide = self._narrow
        return result

    def below(self, points: Array, within: float) -> tuple[Array, Array]:
        """Return the distances of points to the columns, shape (n,), m, and unit vectors to the nearest ones, (n, 3).

        Distances of points inside the ground are negative; those beyond `within`, m, are infinite.
        """
        across, above, turn, at, _ = self._offsets(points, within)
        distances, towards = np.full(len(points), np.inf), np.zeros((len(points), 3))
        if at.size:
            far = np.hypot(np.abs(across), np.maximum(above, 0.0))
            far = np.where(far > 0.0, far, above)  # inside a column it is the depth below its top
            nearest = (np.arange(len(points)), far.argmin(axis=1))
            distances, aside = far[nearest], across[nearest] * turn
            towards = np.stack((aside.real, aside.imag, -np.maximum(above[nearest], 0.0)), axis=1)
            outside = distances > 0.0
            towards[outside] /= distances[outside, None]
            towards[~outside] = [0.0, 0.0, -1.0]
        return distances, towards

    def _offsets(
        self, points: Array, away: float
    ) -> tuple[NDArray[np.complex128], Array, complex, NDArray[np.complex128], Array]:
        """Return where columns are that are near points.

        Returns:
            Ways from points to columns along the axes of the grid, and heights of the points above the columns, shape
            (points, columns), m; the heading of the grid; places of the columns in the world and their heights, m.
        """
        ox, oy, yaw = self._heights.origin
        cell, turn = self._cell, complex(math.cos(yaw), math.sin(yaw))
        grid = ((points[:, 0] - ox) + 1j * (points[:, 1] - oy)) * turn.conjugate()
        first = np.floor([(grid.real.min() - away) / cell, (grid.imag.min() - away) / cell])
        last = np.ceil([(grid.real.max() + away) / cell, (grid.imag.max() + away) / cell])
        x, y = ((np.arange(a, b) + 0.5) * cell for a, b in zip(first, last, strict=True))
        centres = (x[:, None] + 1j * y[None, :]).ravel()
        at = centres * turn + complex(ox, oy)
        heights = self._heights.at(at)[0]
        kept = np.flatnonzero(heights >= float(points[:, 2].min()) - away)  # NaN is no height
        apart, heights = centres[kept] - grid[:, None], heights[kept]
        ahead, aside = (
            np.sign(x) * np.maximum(np.abs(x) - 0.5 * cell, 0.0) for x in (apart.real, apart.imag)
        )
        return ahead + 1j * aside, points[:, 2, None] - heights, turn, at[kept], heights

    @property
    def _cell(self) -> float:
        return float(self._heights.settings.cell)

    def _measure(
        self,
        geometry: pin.GeometryModel,
        data: pin.GeometryData,
        row: int,
        at: complex,
        height: float,
        turn: complex,
    ) -> Any:
        rotation = np.array([[turn.real, -turn.imag, 0.0], [turn.imag, turn.real, 0.0], [0.0, 0.0, 1.0]])
        data.oMg[self.index] = pin.SE3(rotation, np.array([at.real, at.imag, height - 0.5 * DEPTH]))
        return pin.computeDistance(geometry, data, row)


def _points_inside(shape: Any, spacing: float) -> tuple[Array, float]:
    """Return points inside a shape, shape (n, 3), m, and how far it reaches beyond the nearest of them, m."""
    if isinstance(shape, coal.Sphere):
        return np.zeros((1, 3)), float(shape.radius)
    if isinstance(shape, coal.Capsule):
        half = float(shape.halfLength)
        count = max(2, math.ceil(2.0 * half / spacing) + 1)
        points = np.zeros((count, 3))
        points[:, 2] = np.linspace(-half, half, count)
        return points, float(shape.radius) + half / (count - 1)
    return np.array([shape.aabb_center]), float(shape.aabb_radius)
