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
from wbc.core.limits.separation import following, round_radius

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

SLID = 1e-2
"""Change of the placement of two shapes against each other until their corners are looked for again, rad.

Of the distance of their origins it is a share: of this distance, or of the smaller diameter if that is less.
"""

Corner = tuple[float, float, float, float, float, float, float, float, float, float]
"""Numbers of a corner, or of nearest points, in the world.

Distance, m; normal from the first shape to the second; its moment about the origin, m; point of the first shape, m.
"""

_Faces = tuple[pin.SE3, float, Array, Array]
"""Placement of the second shape of a pair against the first one for which corners were found, its change, and these.

Corners of the first shape with the crossings, and those of the second shape, are in the frames of the shapes, (n, 3).
"""

_NO_POINTS = np.zeros((0, 3))

Face = Callable[[Array, Array], Array]
"""Corners of the face of a shape that looks along a unit vector, of its rotation and the unit vector; in its frame."""


class Facing:
    """Corners of pairs of shapes of a geometry, at the placements in its data.

    Attributes:
        has_corners: Whether each pair has corners.
    """

    def __init__(self, geometry: pin.GeometryModel, data: pin.GeometryData) -> None:
        """Find out of each shape of a geometry, with its placements in the data, how its faces are found."""
        self._data = data
        self._places = following([place.rotation for place in data.oMg], 12)  # by column, and origins
        #: Earlier nearest points of both shapes of each pair, in the frames of the shapes.
        self._kept: list[tuple[list[Array], list[Array]]] = [([], []) for _ in geometry.collisionPairs]
        self._found: list[_Faces | None] = [None for _ in geometry.collisionPairs]
        self._shapes = shapes = [item.geometry for item in geometry.geometryObjects]
        self._faces = [_face_of(shape) for shape in shapes]
        self._radii = [round_radius(shape) for shape in shapes]
        self._spins = [isinstance(shape, coal.Cylinder) for shape in shapes]
        self._pairs = [(pair.first, pair.second) for pair in geometry.collisionPairs]
        flat = [isinstance(shape, coal.Box | coal.ConvexBase) for shape in shapes]
        balls = [isinstance(shape, coal.Sphere) for shape in shapes]
        # Of a ball at what has no flat side the nearest point is all that counts.
        self.has_corners = [not (balls[i] or balls[k]) or flat[i] or flat[k] for i, k in self._pairs]
        halves = [float(shape.halfLength) if isinstance(shape, coal.Capsule) else 0.0 for shape in shapes]
        self._halves, self._capsules = halves, [halves[i] > 0.0 and halves[k] > 0.0 for i, k in self._pairs]
        self._diameters = [2.0 * min(shapes[i].aabb_radius, shapes[k].aabb_radius) for i, k in self._pairs]
        self._point, self._at = coal.Sphere(0.0), coal.Transform3s()
        self._ask = [coal.ComputeDistance(self._point, shape) for shape in shapes]  # they keep no shape alive
        self._request, self._result = coal.DistanceRequest(True, True), coal.DistanceResult()

    def corners(self, pair: int, nearest: Corner, within: float, touching: bool) -> list[Corner]:
        """Return the corners of a pair that are within a distance, m, but for its nearest point; nearest ones first.

        Args:
            pair: Number of the pair.
            nearest: Its nearest points.
            within: Distance up to which corners count, m.
            touching: Whether the pair is so near that earlier nearest points count.
        """
        sides = (self._pairs[pair], 1.0), (self._pairs[pair][::-1], -1.0)
        if self._capsules[pair]:
            one, other = (self._places[item].tolist() for item in self._pairs[pair])
            found = [*self._ends(sides[0][0], (one, other), 1.0, within)]
            found += self._ends(sides[1][0], (other, one), -1.0, within)
        else:
            found = self._of_faces(pair, nearest, within)
        if touching:
            for points, ((item, target), side) in zip(self._earlier(pair, nearest), sides, strict=True):
                found += self._corners(
                    [point.tolist() for point in points], item, side, self._nearest(points, target), within
                )
        _, _, _, _, _, _, _, x, y, z = nearest
        far = [c for c in found if max(abs(c[7] - x), abs(c[8] - y), abs(c[9] - z)) > SAME]
        return sorted(far)[:CORNERS]

    def _ends(
        self, items: tuple[int, int], places: Sequence[list[float]], side: float, within: float
    ) -> Iterator[Corner]:
        """Yield the corners of a capsule that looks at another one, the ends of its axis; see `_corners`."""
        (item, target), (one, other) = items, places
        (ux, uy, uz, px, py, pz), (vx, vy, vz, x, y, z) = one[6:], other[6:]
        half, most, radius = self._halves[item], self._halves[target], self._radii[item]
        for end in (-half, half):
            ex, ey, ez = px + end * ux, py + end * uy, pz + end * uz
            nx, ny, nz = x - ex, y - ey, z - ez
            along = min(max(-(nx * vx + ny * vy + nz * vz), -most), most)
            nx, ny, nz = nx + along * vx, ny + along * vy, nz + along * vz
            length = math.sqrt(nx * nx + ny * ny + nz * nz)
            gap = length - self._radii[target] - radius
            if gap <= within and length > SAME:
                away, length = (radius, length) if side > 0.0 else (-radius - gap, -length)
                nx, ny, nz = nx / length, ny / length, nz / length
                mx, my, mz = ey * nz - ez * ny, ez * nx - ex * nz, ex * ny - ey * nx
                yield gap, nx, ny, nz, mx, my, mz, ex + away * nx, ey + away * ny, ez + away * nz

    def _of_faces(self, pair: int, nearest: Corner, within: float) -> list[Corner]:
        """Return the corners of the faces of a pair; see `corners`."""
        (first, second), distance, normal = self._pairs[pair], nearest[0], np.array(nearest[1:4])
        one, other = self._data.oMg[first], self._data.oMg[second]
        faces, place = self._found[pair], one.actInv(other)
        if faces is None or not place.isApprox(faces[0], faces[1]):
            faces = self._found[pair] = self._find(pair, place, normal)
        _, _, points, others = faces
        # The other shape lies behind the plane through its nearest point: what is far from this plane is far from it.
        height, slack = float(normal.dot(nearest[7:])), within - distance
        points = points.dot(one.rotation.T) + one.translation
        points = points[points.dot(normal) >= height - self._radii[first] - slack]
        found = self._corners(points.tolist(), first, 1.0, self._nearest(points, second), within)
        if len(others):
            others = others.dot(other.rotation.T) + other.translation
            others = others[others.dot(normal) <= height + distance + self._radii[second] + slack]
            found += self._corners(others.tolist(), second, -1.0, self._nearest(others, first), within)
        return found

    def _find(self, pair: int, place: pin.SE3, normal: Array) -> _Faces:
        """Find the corners of the faces of a pair, of the placement of its second shape against the first one."""
        first, second = self._pairs[pair]
        one, other = self._data.oMg[first].rotation, self._data.oMg[second].rotation
        along = normal.dot(one)
        points, others = self._faces[first](one, along), self._faces[second](other, -normal.dot(other))
        if len(points) > 1 and len(others) > 1 and len(points) + len(others) > 4:
            crossings = _crossings(points, others.dot(place.rotation.T) + place.translation, along)
            points = np.concatenate((points, crossings)) if crossings else points
        apart = float(np.linalg.norm(place.translation))
        return place, SLID * min(1.0, self._diameters[pair] / max(apart, SAME)), points, others

    def _earlier(self, pair: int, nearest: Corner) -> tuple[list[Array], list[Array]]:
        """Return the last nearest points of both shapes where they are no longer nearest, and keep the present ones."""
        found: tuple[list[Array], list[Array]] = ([], [])
        distance, nx, ny, nz, _, _, _, px, py, pz = nearest
        for side, item, kept in zip((0, 1), self._pairs[pair], self._kept[pair], strict=True):
            place, radius = self._data.oMg[item], self._radii[item]
            away = distance + radius if side else -radius
            x, y, z = px + away * nx, py + away * ny, pz + away * nz
            for local in kept:
                point = place.act(local)
                a, b, c = point.tolist()
                if abs(a - x) > MOVED or abs(b - y) > MOVED or abs(c - z) > MOVED:
                    found[side].append(point)
            if len(found[side]) == len(kept):
                kept.append(place.actInv(np.array((x, y, z))))
                del kept[:-KEPT]
        return found

    def _nearest(self, points: Iterable[Array], target: int) -> Iterator[tuple[float, list[float]]]:
        """Yield the distance of each point to a shape, and the unit vector from the point to the shape."""
        at, request, result, ask = self._at, self._request, self._result, self._ask[target]
        place = self._data.oMg[target]
        there = coal.Transform3s(place.rotation, place.translation)
        for point in points:
            at.setTranslation(point)
            result.clear()
            yield ask(at, there, request, result), result.normal.tolist()

    def _corners(
        self,
        points: Sequence[Sequence[float]],
        item: int,
        side: float,
        nearest: Iterable[tuple[float, list[float]]],
        within: float,
    ) -> list[Corner]:
        """Return the corners among points of one shape, the first one on side 1, within a distance of the other."""
        found, radius, place = list[Corner](), self._radii[item], self._data.oMg[item]
        axis = place.rotation[:, 2].tolist() if self._spins[item] else None
        for (x, y, z), (distance, normal) in zip(points, nearest, strict=True):
            gap = distance - radius
            if gap > within:
                continue
            nx, ny, nz = normal if side > 0.0 else [-each for each in normal]
            mx, my, mz = y * nz - z * ny, z * nx - x * nz, x * ny - y * nx
            if axis is not None:  # a cylinder that spins about its axis stays where it is
                (ax, ay, az), (cx, cy, cz) = axis, place.translation.tolist()
                spin = ax * (mx - cy * nz + cz * ny) + ay * (my - cz * nx + cx * nz)
                spin += az * (mz - cx * ny + cy * nx)
                mx, my, mz = mx - spin * ax, my - spin * ay, mz - spin * az
            away = radius if side > 0.0 else -radius - gap
            found.append((gap, nx, ny, nz, mx, my, mz, x + away * nx, y + away * ny, z + away * nz))
        return found


def _face_of(shape: coal.CollisionGeometry) -> Face:
    """Return what finds the corners of the faces of a shape; of one without an end there are none."""
    if isinstance(shape, coal.Capsule):
        ends = float(shape.halfLength) * np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
        return lambda rotation, normal: ends
    if isinstance(shape, coal.Cylinder):
        return _of_cylinder(float(shape.radius), float(shape.halfLength))
    if isinstance(shape, coal.Box):
        return _of_box(np.array(shape.halfSide).ravel())
    if isinstance(shape, coal.ConvexBase):
        return _of_hull(np.array(shape.points()))
    return lambda rotation, normal: _NO_POINTS


def _of_box(half: Array) -> Face:
    around = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])

    def face(rotation: Array, normal: Array) -> Array:
        axis = int(np.abs(normal).argmax())
        return np.insert(around, axis, math.copysign(1.0, normal[axis]), axis=1) * half

    return face


def _of_cylinder(radius: float, half: float) -> Face:
    def face(rotation: Array, normal: Array) -> Array:
        x, y, z = normal.tolist()
        if abs(z) < STANDS:
            aside = radius / math.hypot(x, y)
            return np.array([[aside * x, aside * y, -half], [aside * x, aside * y, half]])
        # The points of the rim do not spin with the cylinder.
        points = radius * rotation.T.dot(_across(rotation[:, 2]).dot(AROUND)).T
        points[:, 2] += math.copysign(half, z)
        return np.asarray(points)

    return face


def _of_hull(vertices: Array) -> Face:
    def face(rotation: Array, normal: Array) -> Array:
        tilted = _across(normal).dot(CONE)
        tilted += normal[:, None]
        outermost = vertices.dot(tilted).argmax(axis=0).tolist()
        return np.asarray(vertices[list(dict.fromkeys(outermost))])

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
