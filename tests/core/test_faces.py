"""Faces of shapes in closed form: which corners look along a direction, and where edges of two faces cross."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

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


def facing(shapes: Sequence[coal.CollisionGeometry], places: Sequence[pin.SE3]) -> Facing:
    """Return the corners of one pair of shapes at their places in the world."""
    geometry, model = pin.GeometryModel(), pin.Model()
    for name, shape, place in zip("ab", shapes, places, strict=True):
        geometry.addGeometryObject(pin.GeometryObject(name, 0, place, shape))
    geometry.addCollisionPair(pin.CollisionPair(0, 1))
    data = geometry.createData()
    pin.updateGeometryPlacements(model, model.createData(), geometry, data, pin.neutral(model))
    return Facing(geometry, data)


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
        assert facing(shapes, [pin.SE3.Identity()] * 2).has_corners == [have]


FAR = (0.0,) * 7 + (9.0, 9.0, 9.0)
"""Nearest points that no corner is one of."""


@pytest.mark.parametrize("seed", range(8))
def test_corners_of_two_capsules_are_the_ends_of_their_axes(seed: int) -> None:
    """As coal measures a ball at each end of one capsule against the other capsule."""
    rng = np.random.default_rng(seed)
    shapes = [coal.Capsule(*rng.uniform(0.05, 0.2, 2)) for _ in range(2)]
    turns = [pin.Quaternion(rng.normal(size=4)).normalized().matrix() for _ in range(2)]
    places = [pin.SE3(turns[i], rng.uniform(-0.5, 0.5, 3) + [0.0, 0.0, 2.0 * i]) for i in range(2)]
    found = facing(shapes, places).corners(0, FAR, 10.0, touching=False)
    expected = []
    for item, end in itertools.product((0, 1), (-1.0, 1.0)):
        capsule, other, result = shapes[item], 1 - item, coal.DistanceResult()
        at = places[item].act(np.array([0.0, 0.0, end * capsule.halfLength]))
        gap = coal.distance(
            *(coal.Sphere(capsule.radius), coal.Transform3s(np.eye(3), at)),
            *(shapes[other], coal.Transform3s(places[other].rotation, places[other].translation)),
            *(coal.DistanceRequest(True, True), result),
        )
        points = (result.getNearestPoint1(), result.getNearestPoint2())[:: 1 - 2 * item]
        normal = (points[1] - points[0]) / gap
        expected.append([gap, *normal, *np.cross(points[0], normal), *points[0]])
    np.testing.assert_allclose(found, sorted(expected), atol=1e-6)
    within = 0.5 * (found[1][0] + found[2][0])
    assert facing(shapes, places).corners(0, FAR, within, touching=False) == found[:2]


def test_a_capsule_over_a_box_has_its_two_ends_at_their_heights() -> None:
    lying = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.5 * math.pi - 0.1, 0.0), np.array([0.0, 0.0, 1.0]))
    shapes = coal.Capsule(0.1, 0.4), coal.Box(2.0, 2.0, 1.0)
    nearest = (0.5 - 0.1 - 0.2 * math.sin(0.1), 0.0, 0.0, -1.0, *FAR[4:])
    found = facing(shapes, (lying, pin.SE3.Identity())).corners(0, nearest, 1.0, touching=False)
    ends = [(0.4 - 0.2 * side * math.sin(0.1), -1.0, -0.2 * side * math.cos(0.1)) for side in (1.0, -1.0)]
    np.testing.assert_allclose([(gap, nz, x) for gap, _, _, nz, *_, x, _, _ in found], ends, atol=1e-6)


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
