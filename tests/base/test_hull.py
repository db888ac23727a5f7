"""Convex hulls: against another library, and of points that span no area."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from wbc.base.hull import convex_hull, hull_and_area


def test_hull_is_that_of_another_library() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        points = rng.normal(size=(int(rng.integers(4, 30)), 2))
        ours, theirs = convex_hull(points), points[ConvexHull(points).vertices]
        start = int(np.argmin(np.linalg.norm(theirs - ours[0], axis=1)))
        np.testing.assert_allclose(ours, np.roll(theirs, -start, axis=0), atol=1e-12)
    assert len(convex_hull([[0, 0], [1, 0], [0.5, 0.0], [1, 1], [0, 1]])) == 4
    rounded = [
        [1e-17, 0.5],
        [2e-17, 0],
        [2e-17, 1],
        [1, 0],
        [1, 1],
    ]  # an edge that is vertical but for rounding
    np.testing.assert_allclose(
        sorted(convex_hull(rounded).round(9).tolist()), [[0, 0], [0, 1], [1, 0], [1, 1]]
    )


def test_hull_and_area() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]])
    corners, area = hull_and_area(square)
    assert area == pytest.approx(1.0) and len(corners) == 4
    line = np.array([[0.0, 0.0], [1.0, 1.0], [0.4, 0.4]])
    ends, nothing = hull_and_area(line)
    assert nothing == 0.0
    np.testing.assert_allclose(sorted(ends.tolist()), [[0.0, 0.0], [1.0, 1.0]])
    assert hull_and_area(np.zeros((0, 2)))[1] == hull_and_area(np.array([[1.0, 2.0]]))[1] == 0.0


def test_flat_corners_in_a_row_all_go() -> None:
    bulge = [(0.2, -1e-7), (0.4, -1.5e-7), (0.6, -1.5e-7), (0.8, -1e-7)]
    square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    np.testing.assert_array_equal(convex_hull(square + bulge, tolerance=1e-5), square)
