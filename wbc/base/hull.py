"""Convex hulls of points in the plane, by Qhull."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array

FLAT = 1e-12
"""Twice the area, m², of the triangle of a corner and its neighbours up to which the corner is none."""


def convex_hull(points: ArrayLike) -> Array:
    """Return the corners of the convex hull, shape (k, 2), m, counter-clockwise from the leftmost one.

    Flat corners are dropped; k < 3 for points on a line.
    """
    array = finite_array("points (m)", points)
    if array.ndim != 2 or array.shape[1] != 2:
        raise InputError(f"points must have shape (n, 2), got {array.shape}")
    hull = hull_and_area(array)[0]
    first = np.lexsort((hull[:, 1], hull[:, 0]))[0] if len(hull) else 0
    corners = np.roll(hull, -int(first), axis=0).tolist()
    i = 0
    while i < len(corners) > 2:
        if _twice_area(corners[i - 1], corners[i], corners[(i + 1) % len(corners)]) > FLAT:
            i += 1
        else:
            del corners[i]
            i = max(i - 1, 0)
    return np.array(corners).reshape(-1, 2)


def _twice_area(a: list[float], b: list[float], c: list[float]) -> float:
    """Return twice the area of a triangle, m², positive if its corners go counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def hull_and_area(points: Array) -> tuple[Array, float]:
    """Return corners (counter-clockwise, shape (k, 2), m) and area (m²) of the hull of many points.

    Points, shape (n, 2), that are the same to a nanometre count as one; those on a line have their ends and no area.
    """
    from scipy.spatial import ConvexHull, QhullError  # noqa: PLC0415 - slow to import

    points = points[np.unique(np.round(points, 9), axis=0, return_index=True)[1]]
    if len(points) < 3:
        return points, 0.0
    try:
        hull = ConvexHull(points)
    except QhullError:
        along = points @ np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][0]
        return points[[int(along.argmin()), int(along.argmax())]], 0.0
    return points[hull.vertices], float(hull.volume)  # in the plane, "volume" is the area
