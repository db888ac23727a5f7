"""Limit on collisions: a velocity damper on the distances between links, and of links to obstacles of the world."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbc.base.checked import checked
from wbc.base.errors import InputError, shown
from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, Positive
from wbc.core.limits.base import ATTAINABLE, Limit
from wbc.core.limits.facing import CORNERS, Facing
from wbc.core.limits.heights import Columns
from wbc.core.limits.pairs import check_separable, pairs_that_touch, srdf_pairs, urdf_primitives
from wbc.core.limits.separation import YZX, ZXY, Separation
from wbc.core.limits.shapes import ENDLESS, SHAPES, CollisionHeights, Obstacle, Shape, geometry_of
from wbc.core.robot import Robot

__all__ = ["CollisionLimit", "srdf_pairs"]

NEAR = 0.1
"""Distance beyond the margin from which on pairs count among velocities, m: in a period a link comes less far."""

TURNING, TURNED = 10.0, 50.0
"""Angular velocity and acceleration up to which shapes turn against each other, rad/s and rad/s².

In inverse kinematics corners have rows that such a velocity may bring to the margin in a period. In a controller those
have rows that such an acceleration may make too fast for their distance until the next tick, which is still early
enough. Rows of nearest points hold all other motion.
"""

MOST_CORNERS = 64
"""Rows for corners of faces that a limit has at most."""

TOUCHING = 2e-3
"""Distance beyond the margin up to which earlier nearest points of a pair count as corners, m."""

DEEP = 1e-3
"""Depth of a collision from which on its corners have no rows, m: the nearest points lead out of it."""

SUDDEN = 100.0
"""Acceleration up to which a distance may shrink in a tick before its row must be there, m/s²."""


Kept = tuple[float, float, float, float, float, float, float, float, float, float, float, float]
"""Distance of a pair, room, growth, normal, its moment and the nearest point of the first shape."""

AT_REST = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

_NO_ROWS = np.zeros(0, dtype=np.intp)


def _body(robot: Robot, joint: int) -> Array:
    """Return origin, angular velocity and acceleration of the body behind a joint, in the world; zeros of the world."""
    values = np.zeros(12)
    if joint > 0:
        model, data, world = robot.model, robot.data, pin.LOCAL_WORLD_ALIGNED
        values[:3] = data.oMi[joint].translation
        values[3:6] = pin.getVelocity(model, data, joint, world).angular
        values[6:] = pin.getClassicalAcceleration(model, data, joint, world).vector
    return values


@dataclass(slots=True)
class _Near:
    """Pairs that are near.

    Attributes:
        rows: Their rows, those of the nearest points of pairs first.
        pairs: The pair of each row.
        distances: Their distances, m.
        room: Distances beyond the margin, m; those of corners beyond the distance of their pair if that is less.
        growth: Speeds at which the distances grow, m/s.
        levers: [n, p₁ × n] of the normals n from the first shape to the second one, shape (n, 6).
        points: Nearest points p₁ of the first shape in the world, shape (n, 3), m.
    """

    rows: NDArray[np.intp]
    pairs: NDArray[np.intp]
    distances: Array
    room: Array
    growth: Array
    levers: Array
    points: Array


@dataclass(slots=True)
class _Place:
    """Place of an obstacle among the shapes, the placement that it has there, and its rows."""

    obstacle: Obstacle
    index: int
    local: pin.SE3
    seen: pin.SE3 | None = None
    rows: slice = field(default_factory=lambda: slice(0))

    def twist(self) -> Array:
        """Return the velocity of the obstacle at the origin of the world, [linear; angular], shape (6,)."""
        x, y, z = self.obstacle._placement.translation.tolist()
        vx, vy, vz, wx, wy, wz = self.obstacle._velocity.tolist()
        return np.array([vx + y * wz - z * wy, vy + z * wx - x * wz, vz + x * wy - y * wx, wx, wy, wz])

    def follow(self, geometry: pin.GeometryModel) -> None:
        """Take a new placement of the obstacle over."""
        if self.obstacle._placement is not self.seen:
            self.seen = self.obstacle._placement
            geometry.geometryObjects[self.index].placement = self.seen * self.local


class CollisionLimit(Limit):
    """Limit that keeps pairs of links at a distance, and links away from obstacles, which may move.

        CollisionLimit("all", shapes=description.collision_hulls(), obstacles=[Obstacle("table", CollisionBox(…))])

    Each pair of shapes has a row for its nearest points: its distance may shrink at (distance − margin) / time constant
    at most. Rows behind those of all pairs are for corners of faces that look at each other; see
    `wbc.core.limits.facing`. The rows of pairs that are far apart are empty. In a controller the rows of pairs that are
    slow for their distance are empty too: the distance could shrink with 100 m/s² until the next tick, and would still
    be allowed to. A pair is measured when its shapes have moved so far since they were last measured that its row may
    be needed. The rows ignore how the rotation of the common normal accelerates the distance. The next tick corrects
    this.

    A row demands at most the acceleration (distance − margin) / time constant² + recovery of the distance, m/s². This
    is enough if two links are not faster than allowed when they come within `influence` of each other.
    """

    reads = "kinematics"
    step_unit = "m"

    @checked
    def __init__(
        self,
        pairs: Literal["all"] | Iterable[tuple[str, str]] = (),
        *,
        obstacles: Iterable[Obstacle] = (),
        against: Iterable[str] | None = None,
        shapes: Mapping[str, Shape | Sequence[Shape]] | None = None,
        urdf: str | Path | None = None,
        margin: Annotated[NonNegative, "m"] = 0.02,
        influence: Annotated[Positive, "m"] = 0.3,
        time_constant: Annotated[Positive, "s"] = 0.1,
        recovery: Annotated[NonNegative, "m/s²"] = 10.0,
        name: str = "collisions",
    ) -> None:
        """Describe the limit.

        Args:
            pairs: Pairs of links or frames; "all" for all links of `shapes` except neighbours, pairs that touch in
                half-sitting, and pairs that never come within the margin in 1,000 random postures.
            obstacles: Shapes of the world; their placements are attributes.
            against: Links that keep away from the obstacles. When None: all links of `shapes` except the feet; for a
                robot without feet, all except the link at its root.
            shapes: Link or frame → its shapes, in its own coordinates. `RobotDescription.collision_shapes` returns
                spheres and capsules for all links; `collision_hulls` returns shapes that fit more closely, whose
                distances take longer to compute.
            urdf: URDF, a path or the XML itself, whose primitive collision geometry (boxes, spheres, cylinders,
                capsules) is the shape of links that are not in `shapes`; meshes are left out.
            margin: Smallest distance, m.
            influence: Distance beyond which a pair is ignored, m.
            time_constant: Time constant of the approach, s.
            recovery: Smallest acceleration that separates links closer than the margin, m/s². It also slows links that
                come within `influence` too fast.
            name: Name of the limit.
        """
        self.name, self.dim = name, 0
        self._all = isinstance(pairs, str)
        links = [] if isinstance(pairs, str) else list(pairs)
        if isinstance(pairs, str) and pairs != "all":
            raise InputError(
                f"pairs of limit '{name}' must be \"all\" or pairs of names of links, got {shown(pairs)}"
            )
        if not all(isinstance(pair, (tuple, list)) and list(map(type, pair)) == [str, str] for pair in links):
            raise InputError(f"pairs of limit '{name}' must be pairs of names of links, got {shown(links)}")
        self._given = [(first, second) for first, second in links]
        self.obstacles = tuple(obstacles)
        for obstacle in self.obstacles:
            if not isinstance(obstacle, Obstacle):
                raise InputError(
                    f"obstacles of limit '{name}' must be of class Obstacle, got {shown(obstacle)}"
                )
        named = [obstacle.name for obstacle in self.obstacles]
        if len(set(named)) != len(named):
            raise InputError(f"limit '{name}' has two obstacles of one name: {named}")
        if not (self._given or self._all or self.obstacles):
            raise InputError(f"limit '{name}' needs at least one pair of links, or an obstacle")
        if len({frozenset(pair) for pair in links if pair[0] != pair[1]}) != len(links):
            raise InputError(f"limit '{name}' has a link with itself, or a pair twice: {self._given}")
        self._shapes = {
            frame: [shape] if isinstance(shape, SHAPES) else list(shape)
            for frame, shape in (shapes or {}).items()
        }
        for frame, given in self._shapes.items():
            if not given or not all(
                isinstance(shape, SHAPES) and not isinstance(shape, ENDLESS) for shape in given
            ):
                raise InputError(
                    f"shapes of '{frame}' must be shapes such as spheres and capsules, at least one; got {shown(given)}"
                )
        self._against = None if against is None else list(against)
        self._urdf = urdf
        self._margin, self._influence, self._recovery = margin, influence, recovery
        if self._influence <= self._margin:
            raise InputError(f"influence of limit '{name}' must exceed its margin, {influence} ≤ {margin} m")
        self._time = time_constant

    @checked
    def bind(self, robot: Robot) -> None:
        """Build the shapes, and find the pairs where all are asked for."""
        self._robot = robot
        for frame in (
            *self._shapes,
            *(self._against or ()),
            *(frame for pair in self._given for frame in pair),
        ):
            robot.frame_id(frame)
        self._geometry = geometry = pin.GeometryModel()
        objects: dict[str, list[int]] = {}
        radii: list[float] = []
        primitives: dict[str, list[pin.GeometryObject]] | None = None
        near = self._links_near_obstacles(robot)
        wanted = [frame for pair in self._given for frame in pair]
        for frame in dict.fromkeys((*wanted, *(self._shapes if self._all else ()), *near)):
            made = [_geometry_object(robot, frame, shape) for shape in self._shapes.get(frame, ())]
            if not made and self._urdf is not None:
                primitives = urdf_primitives(robot, self._urdf) if primitives is None else primitives
                made = primitives.get(frame, [])
            if not made:
                known = ", ".join(sorted({*self._shapes, *(primitives or {})})) or "none"
                raise InputError(
                    f"limit '{self.name}' has no shape for '{frame}': give it in `shapes`, where "
                    "`RobotDescription.collision_shapes()` has those of meshes, or a URDF in which it has primitive "
                    f"collision geometry (it has it for: {known})"
                )
            objects[frame] = []
            for number, item in enumerate(made):
                item.name = f"{frame} {number}"
                objects[frame].append(geometry.addGeometryObject(item))
                radii.append(float(getattr(item.geometry, "radius", 0.0)) if _is_round(item) else 0.0)
        self._places: list[_Place] = []
        grounds: dict[int, Columns] = {}  # of a shape
        for obstacle in self.obstacles:
            body, local = geometry_of(obstacle.shape)
            item = pin.GeometryObject(f"obstacle {obstacle.name}", 0, 0, obstacle.placement * local, body)
            place = _Place(obstacle, geometry.addGeometryObject(item), local)
            if isinstance(obstacle.shape, CollisionHeights):
                grounds[place.index] = Columns(obstacle.shape, body, place.index)
            self._places.append(place)
            radii.append(float(getattr(body, "radius", 0.0)) if _is_round(item) else 0.0)

        self._radii, self._objects = radii, objects
        self._rows: list[tuple[int, int, float, float]] = []
        self._moving: list[Obstacle | None] = []  # the obstacle of each row
        self._names: list[tuple[str, str]] = []
        for first, second in self._given:
            joints = [robot.model.frames[robot.frame_id(frame)].parentJoint for frame in (first, second)]
            if joints[0] == joints[1]:
                raise InputError(
                    f"'{first}' and '{second}' of limit '{self.name}' are parts of one rigid body"
                )
            self._add_pair(first, second)
        pairs = [(row[:2], names) for row, names in zip(self._rows, self._names, strict=True)]
        check_separable(robot, geometry, pairs, self._margin, self.name)
        if self._all:
            for pair in pairs_that_touch(robot, geometry, objects, self._margin):
                if pair not in self._given and pair[::-1] not in self._given:
                    self._add_pair(*pair)
        for place in self._places:
            first_row = len(self._rows)
            for link in near:
                for i in objects[link]:
                    self._add_row(link, place.obstacle.name, i, place.index, place.obstacle)
            place.rows = slice(first_row, len(self._rows))
        self._n_pairs = len(self._rows)
        if self._n_pairs == 0:
            raise InputError(f"limit '{self.name}' has no pair that can touch: give the pairs")
        self._geometry_data = geometry.createData()
        for request in self._geometry_data.distanceRequests:
            request.gjk_initial_guess = coal.GJKInitialGuess.CachedGuess
        for item in geometry.geometryObjects:
            item.geometry.computeLocalAABB()
        self._grounds = [grounds.get(pair.second) for pair in geometry.collisionPairs]
        self._changing = np.array([ground is not None for ground in self._grounds])  # measured at every tick
        self._facing = Facing(geometry, self._geometry_data, self._grounds)
        corners = self._facing.has_corners
        self._separation = Separation(geometry, self._geometry_data, np.array(corners))
        self._spread = self._separation.spread.tolist()
        self.dim = self._n_pairs + min(CORNERS * sum(corners), MOST_CORNERS)
        self._owners = np.arange(self.dim)  # the pair of each row
        self._leaders = _leaders(robot)
        # Of each pair: 1 for each column of `data.J` that moves the second body alone, −1 for the first body alone.
        carried = {joint: _carrying(robot, joint) for row in self._rows for joint in row[:2]}
        self._ends = np.array([row[:2] for row in self._rows], dtype=np.intp)  # joints of each pair
        self._round = np.array([row[2:] for row in self._rows])  # radii of round shapes, m
        self._moves = np.array([carried[row[1]] - carried[row[0]] for row in self._rows])
        self._motions = np.zeros_like(self._moves.T)
        self._filled = _NO_ROWS  # those that are not zero
        self._written: Array | None = None  # the array that they are in
        pin.updateGeometryPlacements(robot.model, robot.data, geometry, self._geometry_data)
        distances = np.array([self._distance_of(row) for row in range(self._n_pairs)])
        self._separation.distances()
        self._separation.measured(np.arange(self._n_pairs), distances)
        self._check_obstacles(distances)

    def _links_near_obstacles(self, robot: Robot) -> list[str]:
        """Return the links that keep away from the obstacles."""
        if not self.obstacles or self._against is not None:
            return list(self._against or ()) if self.obstacles else []
        model = robot.model
        stands = {model.frames[robot.frame_id(sole.frame)].parentJoint for sole in robot.soles}
        joints = {f: model.frames[robot.frame_id(f)].parentJoint for f in self._shapes}
        root = 1 if robot.floating else 0
        return [f for f, joint in joints.items() if joint not in stands and (robot.soles or joint > root)]

    def _add_pair(self, first: str, second: str) -> None:
        for i in self._objects[first]:
            for k in self._objects[second]:
                self._add_row(first, second, i, k, None)

    def _add_row(self, first: str, second: str, i: int, k: int, obstacle: Obstacle | None) -> None:
        items = self._geometry.geometryObjects
        self._geometry.addCollisionPair(pin.CollisionPair(i, k))
        self._rows.append((items[i].parentJoint, items[k].parentJoint, self._radii[i], self._radii[k]))
        self._names.append((first, second))
        self._moving.append(obstacle)

    def _check_obstacles(self, distances: Array) -> None:
        """Refuse an obstacle that is inside the robot."""
        for row, obstacle in enumerate(self._moving):
            if obstacle is not None and distances[row] <= 0.0:
                raise InputError(
                    f"obstacle '{obstacle.name}' of limit '{self.name}' is {-distances[row]:.3f} m inside "
                    f"'{self._names[row][0]}': move it, or give the links that keep away in `against`"
                )

    @property
    def distances(self) -> dict[tuple[str, str], float]:
        """Distance at the last tick of each pair of links, or of a link and an obstacle, m; negative in collision."""
        smallest: dict[tuple[str, str], float] = {}
        for row, pair in enumerate(self._names):
            smallest[pair] = min(smallest.get(pair, np.inf), self._distance_of(row))
        return smallest

    def _distance_of(self, row: int) -> float:
        """Return the distance of a pair of shapes, m; infinite where there is no ground within the influence."""
        ground = self._grounds[row]
        if ground is None:
            return float(pin.computeDistance(self._geometry, self._geometry_data, row).min_distance)
        result = ground.nearest(self._geometry, self._geometry_data, row, self._influence)
        return np.inf if result is None else float(result.min_distance)

    def write(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill the rows of pairs and corners; see `Limit.write`."""
        self._clear(rows, lower, upper)
        bounds, twists = self._bounds(), self._twists()
        needed = self._separation.speeds(twists)
        needed += dt * SUDDEN
        needed *= self._time
        needed += self._margin
        np.minimum(needed, self._influence, out=needed)
        near = self._measure(
            (bounds <= needed).nonzero()[0],
            self._influence,
            self._influence,
            self._time * dt * TURNED,
            twists,
            dt,
        )
        if near is not None:
            room, moving = near.room, self._jacobians(near)
            demand = -(room / self._time + near.growth) / dt
            demand = np.minimum(demand, np.maximum(room, 0.0) / self._time**2 + self._recovery)
            demand -= self._drift(near)
            # Where the joints hardly change the distance, no demand is one that they cannot meet.
            demand = np.minimum(demand, ATTAINABLE * np.abs(moving).sum(axis=1))
            self._put(rows, lower, near, moving, demand)

    def write_step(self, rows: Array, lower: Array, upper: Array) -> None:
        """Fill how far each pair may approach, or must separate; see `Limit.write_step`."""
        self._clear(rows, lower, upper)
        near = self._measure(
            (self._bounds() <= self._influence).nonzero()[0], self._influence, self._margin + NEAR, np.inf
        )
        if near is not None:
            moving, demand = self._jacobians(near), -near.room
            self._put(rows, lower, near, moving, np.minimum(demand, np.abs(moving).sum(axis=1)))

    def write_velocity(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill the smallest rate of each distance; see `Limit.write_velocity`."""
        self._clear(rows, lower, upper)
        influence = min(self._influence, self._margin + NEAR)
        asked = (self._bounds() <= influence).nonzero()[0]
        near = self._measure(asked, influence, influence, TURNING * dt, self._beside())
        if near is not None:
            moving = self._jacobians(near)
            demand = -near.room / max(self._time, dt) - near.growth
            self._put(rows, lower, near, moving, np.minimum(demand, np.abs(moving).sum(axis=1)))

    def violation(self, row: int, size: float) -> str:
        """Return by how much the margin of a pair is violated, and which pair it is."""
        one, other = self._names[self._owners[row]]
        return f"{size:.3g} m ('{one}' and '{other}')"

    def _clear(self, rows: Array, lower: Array, upper: Array) -> None:
        """Empty the rows that are filled, all of them in an array that was not seen before, and the bounds."""
        lower.fill(-np.inf)
        upper.fill(np.inf)
        if rows is not self._written:
            self._written = rows
            rows.fill(0.0)
        elif self._filled.size:
            rows[self._filled] = 0.0
        self._filled = _NO_ROWS

    def _put(self, rows: Array, lower: Array, near: _Near, moving: Array, demand: Array) -> None:
        """Fill the rows of some pairs, and their bounds."""
        self._filled = near.rows
        rows[near.rows], lower[near.rows] = moving, demand

    def _bounds(self) -> Array:
        """Place all shapes, and return lower bounds on their distances, m; without an end where the ground changes."""
        for place in self._places:
            place.follow(self._geometry)
        pin.updateGeometryPlacements(self._robot.model, self._robot.data, self._geometry, self._geometry_data)
        bounds = self._separation.distances()
        if self._changing.any():
            bounds[self._changing] = -np.inf
        return bounds

    def _twists(self) -> Array:
        """Return velocities of the second bodies against the first at the world's origin, shape (6, pairs)."""
        v = self._robot.v if self._leaders is None else self._leaders.dot(self._robot.v)
        np.multiply(self._moves.T, v[:, None], out=self._motions)
        twists, beside = self._robot.joint_jacobians.dot(self._motions), self._beside()
        return np.asarray(twists if beside is None else twists + beside)

    def _beside(self) -> Array | None:
        """Return the velocities of obstacles at the origin of the world, shape (6, pairs); None where none moves."""
        twists = None
        for place in self._places:
            if place.obstacle.moving:
                twists = np.zeros((6, self._n_pairs)) if twists is None else twists
                twists[:, place.rows] = place.twist()[:, None]
        return twists

    def _jacobians(self, near: _Near) -> Array:
        """Return the derivatives of the distances of pairs by the configuration, shape (number of pairs, nv).

        With J the Jacobians of the joints at the origin of the world, a pair with the normal n from a point p₁ of the
        first body to a point p₂ of the second has the row [n, p₂ × n]·J over the joints that carry the second, less
        [n, p₁ × n]·J over those that carry the first. Since p₂ − p₁ is along n, p₂ × n is p₁ × n.
        """
        moving = near.levers.dot(self._robot.joint_jacobians)
        moving *= self._moves[near.pairs]
        return np.asarray(moving if self._leaders is None else moving.dot(self._leaders))

    def _drift(self, near: _Near) -> Array:
        """Return the acceleration of the distances at no acceleration of the joints, m/s².

        Points on the axis of round shapes move as the shape does; on its surface, spinning would count.
        """
        normals, (inner, outer) = near.levers[:, :3], self._round[near.pairs].T[..., None]
        first = near.points - inner * normals
        second = near.points + (near.distances[:, None] + outer) * normals
        joints, of_end = np.unique(self._ends[near.pairs].T.ravel(), return_inverse=True)
        bodies = np.array([_body(self._robot, joint) for joint in joints.tolist()])[of_end]
        normal, spin = np.concatenate((normals, normals)), bodies[:, 3:6]
        arm = np.concatenate((first, second)) - bodies[:, :3]
        lever = arm[:, YZX] * normal[:, ZXY] - arm[:, ZXY] * normal[:, YZX]
        along = (normal * bodies[:, 6:9]).sum(axis=1) + (lever * bodies[:, 9:]).sum(axis=1)
        along += (spin * arm).sum(axis=1) * (spin * normal).sum(axis=1)
        along -= (spin * spin).sum(axis=1) * (normal * arm).sum(axis=1)
        return np.asarray(along[len(near.rows) :] - along[: len(near.rows)])

    def _measure(
        self,
        asked: NDArray[np.intp],
        within: float,
        corners: float,
        turning: float,
        twists: Array | None = None,
        dt: float | None = None,
    ) -> _Near | None:
        """Measure some pairs; return those that are within a distance, m, if any, and the corners of their faces.

        With a control period dt, s, those are left out whose bodies move with twists at which nothing but an
        acceleration above `SUDDEN` makes them too fast for their distance.

        Args:
            asked: The pairs.
            within: Distance up to which pairs count, m.
            corners: Distance up to which corners count, m.
            turning: Distance beyond the margin that a turn may take from corners in a period, for each metre between
                them.
            twists: Velocities of the second bodies against the first ones, see `_twists`; None if they are zero.
            dt: Control period, s; None if the twists are those of obstacles alone.
        """
        if not asked.size:
            return None
        geometry, data, facing = self._geometry, self._geometry_data, self._facing
        time, free = (0.0, np.inf) if dt is None else (self._time, self._margin + self._time * dt * SUDDEN)
        distances, near, kept = list[float](), list[int](), list[Kept]()
        faces = list[tuple[Kept, int]]()
        moving = itertools.repeat(AT_REST) if twists is None else twists.T[asked].tolist()
        for row, (vx, vy, vz, wx, wy, wz) in zip(asked.tolist(), moving, strict=False):
            ground = self._grounds[row]
            if ground is None:
                result = pin.computeDistance(geometry, data, row)
            elif (result := ground.nearest(geometry, data, row, within)) is None:
                distances.append(np.inf)
                continue
            distance = result.min_distance
            distances.append(distance)
            if distance > within:
                continue
            normal, point = result.normal, result.getNearestPoint1()
            (nx, ny, nz), (x, y, z) = normal.tolist(), point.tolist()
            mx, my, mz = y * nz - z * ny, z * nx - x * nz, x * ny - y * nx
            growth = nx * vx + ny * vy + nz * vz + mx * wx + my * wy + mz * wz
            room = distance - self._margin
            if distance + time * growth < free:
                near.append(row)
                kept.append((distance, room, growth, nx, ny, nz, mx, my, mz, x, y, z))
            if not facing.has_corners[row] or distance < -DEEP:
                continue
            turn = self._spread[row] * math.sqrt(wx * wx + wy * wy + wz * wz) if time else 0.0
            late = self._margin + turning * self._spread[row]
            reach = min(late + time * (turn - growth), corners)  # a corner beyond it is slow for its distance
            if distance < reach:
                least = min(room, 0.0)  # what has come too close may not come closer
                for gap, nx, ny, nz, mx, my, mz, x, y, z in facing.corners(
                    row, distance, normal, point, reach, room < TOUCHING
                ):
                    growth = nx * vx + ny * vy + nz * vz + mx * wx + my * wy + mz * wz
                    if gap + time * growth < late:
                        room = gap - self._margin - least
                        faces.append(((gap, room, growth, nx, ny, nz, mx, my, mz, x, y, z), row))
        self._separation.measured(asked, np.array(distances))
        if len(faces) > self.dim - self._n_pairs:
            faces = sorted(faces)[: self.dim - self._n_pairs]
        if not near and not faces:
            return None
        values = np.array(kept + [corner for corner, _ in faces])
        pairs = np.array(near + [row for _, row in faces])
        rows = np.concatenate((pairs[: len(near)], self._n_pairs + np.arange(len(faces))))
        self._owners[rows] = pairs
        return _Near(rows, pairs, values[:, 0], values[:, 1], values[:, 2], values[:, 3:9], values[:, 9:])

    def __repr__(self) -> str:
        return f"{type(self).__name__}('{self.name}', rows={self.dim})"


def _carrying(robot: Robot, joint: int) -> Array:
    """Return 1 for each column of `data.J` that moves the body behind a joint, else 0, shape (number of columns,).

    Coupled joints have a column of their own there.
    """
    model, carrying = robot.model, np.zeros(robot.joint_jacobians.shape[1])
    for each in model.supports[joint]:
        first = model.joints[each].idx_vExtended
        carrying[first : first + model.joints[each].nvExtended] = 1.0
    return carrying


def _leaders(robot: Robot) -> Array | None:
    """Return which velocity coordinate moves each column of `data.J`, shape (columns, nv); None if each has its own."""
    columns = robot.joint_jacobians.shape[1]
    if columns == robot.nv:
        return None
    leaders = np.zeros((columns, robot.nv))
    for joint in list(robot.model.joints)[1:]:
        for k in range(joint.nvExtended):
            leaders[joint.idx_vExtended + k, joint.idx_v + k] = 1.0
    return leaders


def _is_round(item: pin.GeometryObject) -> bool:
    return isinstance(item.geometry, coal.Sphere | coal.Capsule)


def _geometry_object(robot: Robot, frame: str, shape: Shape) -> pin.GeometryObject:
    index = robot.frame_id(frame)
    parent = robot.model.frames[index]
    body, local = geometry_of(shape)
    return pin.GeometryObject(frame, parent.parentJoint, index, parent.placement * local, body)
