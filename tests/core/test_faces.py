"""Faces of shapes in closed form: which corners look along a direction, and where edges of two faces cross."""

from __future__ import annotations

import itertools
import math

import coal
import numpy as np
import pinocchio as pin
import pytest

from wbc.core.limits.facing import Facing, _across, _crossings, _face_of, _of_hull


def directions(count: int = 30) -> np.ndarray:
    ways = np.random.default_rng(1).normal(size=(count, 3))
    axes = np.vstack([ways, np.eye(3), -np.eye(3), [[0.7, 0.0, 0.714], [0.699, 0.1, 0.7]]])
    return np.asarray(axes / np.linalg.norm(axes, axis=1, keepdims=True))


def test_two_vectors_across_a_direction_have_length_one_and_are_across_each_other() -> None:
    for axis in directions():
        found = np.column_stack((_across(axis), axis))
        np.testing.assert_allclose(found.T @ found, np.eye(3), atol=1e-12)


def test_a_box_looks_along_a_direction_with_the_face_whose_normal_is_nearest() -> None:
    half = np.array([0.1, 0.2, 0.3])
    face = _face_of(coal.Box(*(2.0 * half)))
    for normal in directions():
        axis = int(np.abs(normal).argmax())
        found = {tuple(np.round(corner, 9)) for corner in face(np.eye(3), normal).tolist()}
        signs = [s for s in itertools.product((-1.0, 1.0), repeat=3) if s[axis] == np.sign(normal[axis])]
        assert found == {tuple(np.round(half * s, 9)) for s in signs} and len(found) == 4


def test_a_cylinder_looks_with_an_edge_of_its_side_or_with_its_rim_that_does_not_spin() -> None:
    face = _face_of(coal.Cylinder(0.1, 0.6))
    for angle in (0.3, 2.0, -1.2):
        aside = np.array([math.cos(angle), math.sin(angle), 0.0])
        line = face(np.eye(3), aside)
        np.testing.assert_allclose(line, [0.1 * aside - (0, 0, 0.3), 0.1 * aside + (0, 0, 0.3)], atol=1e-12)
    turn = pin.exp3(np.array([0.4, -0.3, 0.2]))
    for sign in (1.0, -1.0):
        normal = np.array([0.1, -0.05, sign])
        rim = face(turn, normal / np.linalg.norm(normal))
        np.testing.assert_allclose(np.hypot(rim[:, 0], rim[:, 1]), 0.1)
        np.testing.assert_allclose(rim[:, 2], sign * 0.3)
        spun = face(turn @ pin.utils.rotate("z", 0.7), normal / np.linalg.norm(normal))
        ends = [np.round((turn @ rim.T).T, 9), np.round((turn @ pin.utils.rotate("z", 0.7) @ spun.T).T, 9)]
        np.testing.assert_allclose(*ends, atol=1e-8)


def test_a_capsule_has_the_ends_of_its_axis_and_a_ball_has_none() -> None:
    ends = _face_of(coal.Capsule(0.05, 0.4))(np.eye(3), np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(ends, [[0.0, 0.0, -0.2], [0.0, 0.0, 0.2]])
    assert len(_face_of(coal.Sphere(0.1))(np.eye(3), np.array([1.0, 0.0, 0.0]))) == 0


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_hull_looks_with_its_vertices_that_are_outermost_after_a_small_turn(axis: int) -> None:
    half = np.array([0.1, 0.2, 0.3])
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * half
    below = 0.95 * half * (axis == np.arange(3))  # within the hull
    found = {
        tuple(corner) for corner in _of_hull(np.vstack((corners, below)))(np.eye(3), np.eye(3)[axis]).tolist()
    }
    assert found == {tuple(corner) for corner in corners.tolist() if corner[axis] > 0.0}


@pytest.mark.parametrize(
    ("one", "other", "have"),
    [
        (coal.Sphere(0.1), coal.Box(1.0, 1.0, 1.0), True),
        (coal.Sphere(0.1), coal.Cylinder(0.1, 1.0), False),
        (coal.Capsule(0.1, 1.0), coal.Sphere(0.1), False),
        (coal.Capsule(0.1, 1.0), coal.Cylinder(0.1, 1.0), True),
    ],
)
def test_a_ball_at_what_has_no_flat_side_has_no_corners(
    one: coal.CollisionGeometry, other: coal.CollisionGeometry, *, have: bool
) -> None:
    for shapes in ((one, other), (other, one)):
        geometry = pin.GeometryModel()
        for name, shape in zip("ab", shapes, strict=True):
            geometry.addGeometryObject(pin.GeometryObject(name, 0, pin.SE3.Identity(), shape))
        geometry.addCollisionPair(pin.CollisionPair(0, 1))
        assert Facing(geometry, geometry.createData()).has_corners == [have]


def edges(points: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    count = len(points)
    return [(points[i], points[(i + 1) % count]) for i in range(count if count > 2 else 1)]


@pytest.mark.parametrize("counts", [(4, 4), (4, 3), (5, 6), (2, 4), (4, 2), (2, 2)])
def test_edges_of_two_faces_cross_where_their_lines_meet_within_both(counts: tuple[int, int]) -> None:
    """By the two shares that solve a + s (b − a) = c + t (d − c) across the normal; on the edge of the first face."""
    rng, total = np.random.default_rng(5), 0
    for _ in range(25):
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        across = np.linalg.svd(normal[None])[2][1:].T
        faces = []
        for count in counts:
            angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, count))
            flat = 0.1 * np.column_stack((np.cos(angles), np.sin(angles))) + rng.normal(scale=0.05, size=2)
            faces.append(flat @ across.T + normal * rng.normal(scale=0.02, size=(count, 1)))
        expected = []
        for (a, b), (c, d) in itertools.product(edges(faces[0]), edges(faces[1])):
            matrix = np.column_stack(((b - a) @ across, -(d - c) @ across))
            s, t = np.linalg.solve(matrix, (c - a) @ across)
            if 0.0 < s < 1.0 and 0.0 < t < 1.0:
                expected.append(a + s * (b - a))
        found = _crossings(faces[0], faces[1], normal)
        total += len(expected)
        assert len(found) == len(expected)
        for point in expected:
            assert min(float(np.abs(point - each).max()) for each in found) < 1e-9
    assert total > 4
