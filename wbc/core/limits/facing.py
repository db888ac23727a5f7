"""Points in which two shapes face each other, and their distances.

Between flat faces the nearest points of two shapes jump from corner to corner. A limit on these alone leaves all other
corners free. What can come nearest when a shape turns a little are corners: those of the face of either shape that
looks at the other shape, and the crossings of the edges of both faces, seen along the common normal. Each of these is
a point of one shape, and its distance to the whole other shape is at least that of the shapes. The distance of a point
to a convex shape is a convex function of the place of the point: its linearisation is never too large.

Between curved shapes that turn freely, nearest points go to and fro. The last ones are kept, as points of their shapes.

Source of the idea: E. Coumans, "Contact generation between 3D convex meshes", GDC 2010 (contact manifolds of engines).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.limits.heights import Columns

KEPT = 2
"""Earlier nearest points of each shape that count as corners."""

CORNERS = 8 + 2 * KEPT
"""Corners of a pair that count besides its nearest points: those with the least distances."""

RIM = np.exp(0.25j * np.pi * np.arange(8))
"""Directions of points on the rim of a cylinder that stands on its end."""

AROUND = np.stack((RIM.real, RIM.imag))
CONE = 0.1 * AROUND
"""Turns up to which vertices of a hull count, rad: those that are outermost after one of them."""

STANDS = math.sqrt(0.5)
"""Component of the axis of a cylinder along the normal from which on it stands on its end."""

SAME, MOVED = 1e-6, 1e-4
"""Distance up to which points are one, and from which on a nearest point is another one, m."""

Corner = tuple[float, float, float, float, float, float, float, float, float, float]
"""Distance of a corner, normal from the first shape to the second, its moment, and the point of the first shape."""

Face = Callable[[Array, Array, Array, float], Array]
"""Corners in the world of the face of a shape that looks along a unit vector, of its rotation and its origin.

Those may be left out that are less far along the unit vector than the last argument, m.
"""


class Facing:
    """Corners of pairs of shapes of a geometry, at the placements in its data."""

    def __init__(
        self, geometry: pin.GeometryModel, data: pin.GeometryData, grounds: Sequence[Columns | None]
    ) -> None:
        """Find out of each shape how its faces are found.

        Args:
            geometry: Shapes and pairs.
            data: Their placements.
            grounds: Columns that are in the place of the second shape of a pair, for each pair.
        """
        self._grounds = grounds
        #: Earlier nearest points of both shapes of each pair, in the frames of the shapes.
        self._kept: list[tuple[list[Array], list[Array]]] = [([], []) for _ in grounds]
        self._shapes = [item.geometry for item in geometry.geometryObjects]
        self._faces = [_face_of(shape) for shape in self._shapes]
        self._radii = [float(s.radius) if isinstance(s, coal.Capsule) else 0.0 for s in self._shapes]
        self._spins = [isinstance(shape, coal.Cylinder) for shape in self._shapes]
        self._pairs = [(pair.first, pair.second) for pair in geometry.collisionPairs]
        self._data = data
        self._point, self._at = coal.Sphere(0.0), coal.Transform3s()
        self._request, self._result = coal.DistanceRequest(True, True), coal.DistanceResult()
        #: Whether a pair has corners: a ball has none, and its nearest point is all that counts.
        self.has_corners = [
            not any(isinstance(self._shapes[i], coal.Sphere) for i in pair) for pair in self._pairs
        ]

    def corners(
        self, pair: int, distance: float, normal: Array, nearest: Array, within: float, touching: bool
    ) -> list[Corner]:
        """Return the corners of a pair that are within a distance, m, but for its nearest point; nearest ones first.

        Args:
            pair: Number of the pair.
            distance: Distance of the shapes, m.
            normal: Common normal from the first shape to the second, shape (3,).
            nearest: Nearest point of the first shape, shape (3,), m.
            within: Distance up to which corners count, m.
            touching: Whether the pair is so near that earlier nearest points count.
        """
        first, second = self._pairs[pair]
        places, ground = self._data.oMg, self._grounds[pair]
        one, other = places[first], places[second]
        # The other shape lies behind the plane through its nearest point: what is far from this plane is far from it.
        height, slack = float(normal.dot(nearest)), within - distance
        inside = height - self._radii[first] - slack
        points = self._faces[first](one.rotation, one.translation, normal, inside)
        if ground is None:
            outside = height + distance + self._radii[second] + slack
            others = self._faces[second](other.rotation, other.translation, -normal, -outside)
            if len(points) > 1 and len(others) > 1 and len(points) + len(others) > 4:
                crossings = _crossings(points, others, normal)
                if crossings:
                    points = np.concatenate((points, crossings))
            if touching:
                earlier = self._earlier(pair, normal, nearest, distance)
                if earlier[0]:
                    points = np.concatenate((points, earlier[0]))
                if earlier[1]:
                    others = np.concatenate((others, earlier[1]))
            found = list[Corner]()
            near = points[points.dot(normal) >= inside]
            if len(near):
                found = self._found(near, first, 1.0, self._nearest(near, second), within)
            near = others[others.dot(normal) <= outside]
            if len(near):
                found += self._found(near, second, -1.0, self._nearest(near, first), within)
        else:
            gaps, towards = ground.below(points, within + self._radii[first])
            found = self._found(points, first, 1.0, zip(gaps.tolist(), towards, strict=True), within)
        if not found:
            return found
        x, y, z = nearest.tolist()
        found = [
            corner
            for corner in found
            if max(abs(corner[7] - x), abs(corner[8] - y), abs(corner[9] - z)) > SAME
        ]
        found.sort()
        return found[:CORNERS]

    def _earlier(
        self, pair: int, normal: Array, nearest: Array, distance: float
    ) -> tuple[list[Array], list[Array]]:
        """Return the last nearest points of both shapes where they are no longer nearest, and keep the present ones."""
        found: tuple[list[Array], list[Array]] = ([], [])
        for side, item, kept in zip((0, 1), self._pairs[pair], self._kept[pair], strict=True):
            place, radius = self._data.oMg[item], self._radii[item]
            now = nearest + (distance + radius if side else -radius) * normal
            x, y, z = now.tolist()
            for local in kept:
                point = place.act(local)
                a, b, c = point.tolist()
                if abs(a - x) > MOVED or abs(b - y) > MOVED or abs(c - z) > MOVED:
                    found[side].append(point)
            if len(found[side]) == len(kept):
                kept.append(place.actInv(now))
                del kept[:-KEPT]
        return found

    def _nearest(self, points: Array, target: int) -> Iterator[tuple[float, Array]]:
        """Yield the distance of each point to a shape, and the normal from the point to the shape."""
        shape, place, result = self._shapes[target], self._data.oMg[target], self._result
        there = coal.Transform3s(place.rotation, place.translation)
        for point in points:
            self._at.setTranslation(point)
            result.clear()
            distance = coal.distance(self._point, self._at, shape, there, self._request, result)
            yield distance, result.normal

    def _found(
        self,
        points: Array,
        item: int,
        side: float,
        nearest: Iterable[tuple[float, Array]],
        within: float,
    ) -> list[Corner]:
        """Return the corners among points of one shape, the first one on side 1, within a distance of the other."""
        found, radius, place = list[Corner](), self._radii[item], self._data.oMg[item]
        axis = place.rotation[:, 2].tolist() if self._spins[item] else None
        for point, (distance, normal) in zip(points, nearest, strict=True):
            gap = distance - radius
            if gap > within:
                continue
            (x, y, z), (nx, ny, nz) = point.tolist(), normal.tolist()
            if side < 0.0:
                nx, ny, nz = -nx, -ny, -nz
            mx, my, mz = y * nz - z * ny, z * nx - x * nz, x * ny - y * nx
            if axis is not None:  # a cylinder that spins about its axis stays where it is
                (ax, ay, az), (cx, cy, cz) = axis, place.translation.tolist()
                spin = ax * (mx - cy * nz + cz * ny) + ay * (my - cz * nx + cx * nz)
                spin += az * (mz - cx * ny + cy * nx)
                mx, my, mz = mx - spin * ax, my - spin * ay, mz - spin * az
            away = radius if side > 0.0 else -radius - gap
            x, y, z = x + away * nx, y + away * ny, z + away * nz
            found.append((gap, nx, ny, nz, mx, my, mz, x, y, z))
        return found


def _face_of(shape: coal.CollisionGeometry) -> Face:
    """Return what finds the corners of the faces of a shape; of one without an end there are none."""
    if isinstance(shape, coal.Capsule):
        ends = float(shape.halfLength) * np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
        return lambda rotation, origin, normal, least: origin + ends.dot(rotation.T)
    if isinstance(shape, coal.Cylinder):
        return _of_cylinder(float(shape.radius), float(shape.halfLength))
    if isinstance(shape, coal.Box):
        return _of_box(np.array(shape.halfSide).ravel())
    if isinstance(shape, coal.ConvexBase):
        return _of_hull(np.array(shape.points()))
    return lambda rotation, origin, normal, least: np.zeros((0, 3))


def _of_box(half: Array) -> Face:
    around = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    faces = np.zeros((3, 2, 4, 3))  # by axis and side
    for axis in range(3):
        for side, sign in enumerate((1.0, -1.0)):
            faces[axis, side] = np.insert(around, axis, sign, axis=1) * half

    def face(rotation: Array, origin: Array, normal: Array, least: float) -> Array:
        along = normal.dot(rotation)
        axis = np.abs(along).argmax()
        return np.asarray(origin + faces[axis, int(along[axis] < 0.0)].dot(rotation.T))

    return face


def _of_cylinder(radius: float, half: float) -> Face:
    ends = half * np.array([[-1.0], [1.0]])

    def face(rotation: Array, origin: Array, normal: Array, least: float) -> Array:
        axis = rotation[:, 2]
        along = float(axis.dot(normal))
        if abs(along) < STANDS:
            aside = normal - along * axis
            return np.asarray(origin + ends * axis + aside * (radius / math.sqrt(1.0 - along * along)))
        # The points of the rim do not spin with the cylinder.
        around = _across(axis).dot(AROUND).T
        return np.asarray(origin + math.copysign(half, along) * axis + radius * around)

    return face


def _of_hull(vertices: Array) -> Face:
    def face(rotation: Array, origin: Array, normal: Array, least: float) -> Array:
        along = normal.dot(rotation)
        corners = vertices[vertices.dot(along) >= least - normal.dot(origin)]
        if len(corners) > 1:
            tilted = _across(along).dot(CONE)
            tilted += along[:, None]
            outermost = corners.dot(tilted).argmax(axis=0).tolist()
            corners = corners[list(dict.fromkeys(outermost))]
        return np.asarray(origin + corners.dot(rotation.T))

    return face


def _across(axis: Array) -> Array:
    """Return two unit vectors across a unit vector, and across each other, as columns, shape (3, 2)."""
    a, b, c = axis.tolist()
    if abs(a) < 0.7:
        length = math.sqrt(b * b + c * c)
        return np.array(((0.0, -length), (c / length, a * b / length), (-b / length, a * c / length)))
    length = math.sqrt(a * a + c * c)
    return np.array(((-c / length, a * b / length), (0.0, -length), (a / length, b * c / length)))


def _crossings(one: Array, other: Array, normal: Array) -> list[Array]:
    """Return the points of the edges of one face at which edges of another face cross them, seen along the normal."""
    across = _across(normal)
    here, there = one.dot(across).tolist(), other.dot(across).tolist()
    corners = list(one)
    if len(here) > 2:
        here, corners = [*here, here[0]], [*corners, corners[0]]
    if len(there) > 2:
        there.append(there[0])
    found = []
    for (cx, cy), (dx, dy) in pairwise(there):
        vx, vy = dx - cx, dy - cy
        sides = [vx * (y - cy) - vy * (x - cx) for x, y in here]
        for i, (s, t) in enumerate(pairwise(sides)):
            if s * t < 0.0:
                (ax, ay), (bx, by) = here[i], here[i + 1]
                ux, uy = bx - ax, by - ay
                if (ux * (cy - ay) - uy * (cx - ax)) * (ux * (dy - ay) - uy * (dx - ax)) < 0.0:
                    found.append(corners[i] + (s / (s - t)) * (corners[i + 1] - corners[i]))
    return found
