"""Convex hulls of points in the plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array


def convex_hull(points: ArrayLike, tolerance: float = 1e-12) -> Array:
    """Return the corners of the convex hull, shape (k, 2), m, counter-clockwise from the leftmost one.

    A corner that spans less than half the `tolerance`, m², with its neighbours is dropped; k < 3 for points on a line.

    Source: A. M. Andrew, "Another efficient algorithm for convex hulls in two dimensions", Information Processing
    Letters 9(5), 1979.
    """
    array = finite_array("points (m)", points)
    if array.ndim != 2 or array.shape[1] != 2:
        raise InputError(f"points must have shape (n, 2), got {array.shape}")
    ordered = sorted({(float(x), float(y)) for x, y in array})
    corners: list[tuple[float, float]] = []
    for side in (ordered, ordered[::-1]):
        chain: list[tuple[float, float]] = []
        for point in side:
            while len(chain) > 1 and _twice_area(chain[-2], chain[-1], point) <= 0.0:
                chain.pop()
            chain.append(point)
        corners += chain[:-1]
    # Flat corners go in a second pass: in the first one, an edge that is vertical but for rounding would lose its ends.
    i = 0
    while i < len(corners) > 2:
        if _twice_area(corners[i - 1], corners[i], corners[(i + 1) % len(corners)]) > tolerance:
            i += 1
        else:
            del corners[i]
            i = max(i - 1, 0)
    return np.array(corners).reshape(-1, 2)


def _twice_area(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Return twice the area of a triangle, m², positive if its corners go counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def hull_and_area(points: Array) -> tuple[Array, float]:
    """Return corners (counter-clockwise, shape (k, 2), m) and area (m²) of the hull of many points, by Qhull.

    Points, shape (n, 2), are rounded to nanometres; those on a line have their ends and no area.
    """
    from scipy.spatial import ConvexHull, QhullError  # noqa: PLC0415 - slow to import

    unique = np.unique(np.round(points, 9), axis=0)
    if len(unique) < 3:
        return unique, 0.0
    try:
        hull = ConvexHull(unique)
    except QhullError:
        along = unique @ np.linalg.svd(unique - unique.mean(axis=0))[2][0]
        return unique[[int(along.argmin()), int(along.argmax())]], 0.0
    return unique[hull.vertices], float(hull.volume)  # in the plane, "volume" is the area
