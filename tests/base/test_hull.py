"""Convex hulls: order of the corners, flat corners, and points that span no area."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.base.hull import convex_hull, hull_and_area


def test_corners_are_points_around_all_others_counter_clockwise_from_the_leftmost_one() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        points = rng.normal(size=(int(rng.integers(4, 30)), 2))
        corners = convex_hull(points)
        assert {*map(tuple, corners)} <= {*map(tuple, points)} and corners[0, 0] == points[:, 0].min()
        edges = np.roll(corners, -1, axis=0) - corners
        apart = points[:, None] - corners
        left = edges[:, 0] * apart[..., 1] - edges[:, 1] * apart[..., 0]  # of each edge, each point
        assert left.min() > -1e-12 and ((np.abs(left) < 1e-12).sum(axis=0) == 2).all()
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
