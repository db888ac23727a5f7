"""Convex hulls: order of the corners, flat corners, and points that span no area."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.base.errors import InputError
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
    rng = np.random.default_rng(4)
    for middle, way in rng.normal(size=(20, 2, 2)):  # lines anywhere, one across the way to it
        for direction in (way, np.array([-middle[1], middle[0]])):
            points = middle + np.outer([0.3, -1.0, -0.3, 1.0, 0.0], direction)
            ends, nothing = hull_and_area(points)
            assert nothing == 0.0
            np.testing.assert_allclose(
                sorted(ends.tolist()), sorted(points[[1, 3]].tolist()), rtol=0.0, atol=1e-12
            )
    assert hull_and_area(np.zeros((0, 2)))[1] == hull_and_area(np.array([[1.0, 2.0]]))[1] == 0.0


def test_flat_corners_in_a_row_all_go() -> None:
    bulge = [(0.2, -1e-13), (0.4, -1.5e-13), (0.6, -1.5e-13), (0.8, -1e-13)]
    square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    np.testing.assert_array_equal(convex_hull(square + bulge), square)


def test_the_area_is_that_of_the_triangles_of_the_corners() -> None:
    """Green's theorem; and that of a regular polygon, n / 2 · sin(2π / n), on which every corner stays."""
    rng = np.random.default_rng(5)
    for n in (3, 4, 7, 40):
        angles = 2.0 * np.pi * (np.arange(n) + rng.random()) / n
        around = np.stack((np.cos(angles), np.sin(angles)), axis=1)
        corners, area = hull_and_area(rng.permutation([*around, *(0.3 * around)]))
        assert len(corners) == len(convex_hull(around)) == n
        x, y = corners.T
        assert area == pytest.approx(0.5 * n * np.sin(2.0 * np.pi / n), rel=1e-12)
        assert area == pytest.approx(0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum(), rel=1e-12)


@pytest.mark.parametrize("bad", [[1.0, 2.0], [[1.0, 2.0, 3.0]], [[[1.0, 2.0]]], [[1.0, np.nan]]])
def test_points_have_two_coordinates(bad: object) -> None:
    with pytest.raises(InputError):
        convex_hull(bad)  # type: ignore[arg-type]
