"""Limit on collisions: a velocity damper on the distances between links, and of links to obstacles of the world."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbc.base.checked import checked, fixed, result
from wbc.base.errors import InputError, shown
from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, Positive
from wbc.base.vectors import add_cross
from wbc.core.limits.base import BACK, OPTIONS, Barrier, demands
from wbc.core.limits.facing import CORNERS, Facing
from wbc.core.limits.obstacles import ENDLESS, CollisionHeights, Columns, Obstacle, Shape, geometry_of
from wbc.core.limits.pairs import check_separable, pairs_that_touch, srdf_pairs
from wbc.core.limits.separation import Separation, cross, following, round_radius
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

SLOW = 1e-3
"""Speed up to which the curvature of the way counts for nothing, m/s."""

SUDDEN = 100.0
"""Acceleration up to which a distance may shrink in a tick before its row must be there, m/s²."""


AT_REST = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


Numbers = tuple[float, int, float, float, float, float, float, float, float, float, float, float, float]
DISTANCE, PAIR, ROOM, GROWTH, LINE, NORMAL, POINT = 0, 1, 2, 3, slice(4, 10), slice(4, 7), slice(10, 13)
"""Numbers of a pair of shapes, or of a corner of a pair, in the world, and their places.

Its distance, m, and the number of the pair; the distance beyond the margin, of a corner beyond that of a pair that has
come too close, m; the speed of the distance, or what a moving obstacle adds to it, m/s; the normal from the first shape
to the second and its moment about the origin, the line; and the nearest point of the first shape, m.
"""


class Near(NamedTuple):
    """Pairs that are near and, behind them, corners of pairs: all that have rows in a tick.

    Attributes:
        rows: Row of each, shape (n,).
        pairs: Pair of each, shape (n,).
        numbers: Its numbers, shape (n, 13); see `Numbers`.
    """

    rows: NDArray[np.intp]
    pairs: NDArray[np.intp]
    numbers: Array


NOTHING = Near(np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp), np.zeros((0, 13)))


@dataclass(slots=True)
class _Place:
    """Place of an obstacle among the shapes, the placement that it has there, and its pairs."""

    obstacle: Obstacle
    index: int
    local: pin.SE3
    seen: pin.SE3 | None = None
    pairs: slice = field(default_factory=lambda: slice(0))

    def twist(self) -> Array:
        """Return the velocity of the obstacle at the origin of the world, [linear; angular], shape (6,)."""
        *linear, a, b, c = self.obstacle._velocity.tolist()
        return np.array(
            [*add_cross(linear, self.obstacle._placement.translation.tolist(), (a, b, c)), a, b, c]
        )

    def follow(self, geometry: pin.GeometryModel) -> None:
        """Take a new placement of the obstacle over."""
        if self.obstacle._placement is not self.seen:
            self.seen = self.obstacle._placement
            geometry.geometryObjects[self.index].placement = self.seen * self.local


class CollisionLimit(Barrier):
    """Limit that keeps pairs of links at a distance, and links away from obstacles, which may move.

        CollisionLimit("all", shapes=description.collision_hulls(), obstacles=[Obstacle("table", CollisionBox(…))])

    Each pair of shapes has a row for its nearest points, and there are rows for corners of faces that look at each
    other; see `wbc.core.limits.facing`. The rows of pairs that are far apart are empty. In a controller the rows of
    pairs that are slow for their distance are empty too. A pair is measured when its shapes have moved so far since
    they were last measured that its row may be needed. In a controller the rows ignore how the rotation of the common
    normal accelerates the distance. The next tick corrects this.

    Attributes:
        pairs: Pairs of links or frames, or "all", as given; like all attributes read-only.
        obstacles: Shapes of the world; their placements and velocities may be assigned.
        against: Links that keep away from the obstacles, as given.
        shapes: Link or frame → its shapes.
        margin, influence: Smallest distance, and the one beyond which a pair is ignored, m.
        time_constant: Time constant of the approach, s.
        recovery: Smallest acceleration that separates links closer than the margin, m/s².
    """

    reads = "kinematics"
    step_unit = "m"
    pairs: tuple[tuple[str, str], ...] | Literal["all"] = fixed(OPTIONS)
    obstacles: tuple[Obstacle, ...] = fixed(OPTIONS)
    against: tuple[str, ...] | None = result("_against", OPTIONS)
    shapes: Mapping[str, tuple[Shape, ...]] = result("_shapes", OPTIONS)
    margin: float = result("_margin", OPTIONS)
    influence: float = result("_influence", OPTIONS)
    time_constant: float = result("_time", OPTIONS)
    recovery: float = result("_back", OPTIONS)

    @checked
    def __init__(
        self,
        pairs: Literal["all"] | Iterable[tuple[str, str]] = (),
        *,
        obstacles: Iterable[Obstacle] = (),
        against: Iterable[str] | None = None,
        shapes: Mapping[str, Shape | Sequence[Shape]] | None = None,
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
            margin: Smallest distance, m.
            influence: Distance beyond which a pair is ignored, m.
            time_constant: Time constant of the approach, s.
            recovery: Smallest acceleration that separates links closer than the margin, m/s². It also slows links that
                come within `influence` too fast.
            name: Name of the limit.
        """
        self.name, self.dim = name, 0
        self.pairs = "all" if pairs == "all" else tuple(pairs)
        self._all, self._given = (True, ()) if self.pairs == "all" else (False, self.pairs)
        if len({frozenset(pair) for pair in self._given if pair[0] != pair[1]}) != len(self._given):
            raise InputError(f"limit '{name}' has a link with itself, or a pair twice: {list(self._given)}")
        self.obstacles = tuple(obstacles)
        named = [obstacle.name for obstacle in self.obstacles]
        if len(set(named)) != len(named):
            raise InputError(f"limit '{name}' has two obstacles of one name: {named}")
        if not (self._given or self._all or named):
            raise InputError(f"limit '{name}' needs at least one pair of links, or an obstacle")
        self._shapes = {
            frame: tuple(given) if isinstance(given, Sequence) else (given,)
            for frame, given in (shapes or {}).items()
        }
        for frame, given in self._shapes.items():
            if not given or any(isinstance(each, ENDLESS) for each in given):
                raise InputError(
                    f"shapes of '{frame}' must be one or more that have an end, such as spheres, got {shown(given)}"
                )
        if influence <= margin:
            raise InputError(f"influence of limit '{name}' must exceed its margin, {influence} ≤ {margin} m")
        self._against = None if against is None else tuple(against)
        self._margin, self._influence = margin, influence
        self._time, self._back = time_constant, recovery

    @checked
    def bind(self, robot: Robot) -> None:
        """Build the shapes, and find the pairs where all are asked for."""
        self._robot = robot  # first, so that it refuses copies of the limit
        given = [frame for pair in self._given for frame in pair]
        for frame in (*self._shapes, *(self._against or ()), *given):
            robot.frame_id(frame)
        near = self._links_near_obstacles(robot)
        self._geometry = geometry = pin.GeometryModel()
        objects = self._add_shapes(robot, (*given, *(self._shapes if self._all else ()), *near))
        grounds = self._add_obstacles()
        pairs = self._pairs_of(robot, objects, near)
        for _, i, k in pairs:
            geometry.addCollisionPair(pin.CollisionPair(i, k))
        self._names, self._n_pairs = [names for names, _, _ in pairs], len(pairs)
        self._geometry_data = geometry.createData()
        for request in self._geometry_data.distanceRequests:
            request.gjk_initial_guess = coal.GJKInitialGuess.CachedGuess
        for item in geometry.geometryObjects:
            item.geometry.computeLocalAABB()
        self._grounds = [grounds.get(k) for _, _, k in pairs]
        self._changing = np.array([ground is not None for ground in self._grounds])  # measured at every tick
        self._facing = Facing(geometry, self._geometry_data, self._grounds)
        corners = self._facing.has_corners
        self._separation = Separation(geometry, self._geometry_data, np.array(corners))
        self._spread = self._separation.spread.tolist()
        self.dim = self._n_pairs + min(CORNERS * sum(corners), MOST_CORNERS)
        super().bind(robot)
        self._follow_bodies(robot, np.array([(i, k) for _, i, k in pairs]))
        self._corner_rows = np.arange(self._n_pairs, self.dim)
        self._near, self._growth = NOTHING, np.zeros(self.dim)  # of the last tick; growths by rows
        self._start()

    def _add_obstacles(self) -> dict[int, Columns]:
        """Add the obstacles to the geometry; return the columns of height maps, by the number of their shape."""
        grounds: dict[int, Columns] = {}
        self._places: list[_Place] = []
        for obstacle in self.obstacles:
            body, local = geometry_of(obstacle.shape)
            item = pin.GeometryObject(f"obstacle {obstacle.name}", 0, 0, obstacle.placement * local, body)
            place = _Place(obstacle, self._geometry.addGeometryObject(item), local)
            if isinstance(obstacle.shape, CollisionHeights):
                grounds[place.index] = Columns(obstacle.shape, body, place.index)
            self._places.append(place)
        return grounds

    def _pairs_of(
        self, robot: Robot, objects: dict[str, list[int]], near: list[str]
    ) -> list[tuple[tuple[str, str], int, int]]:
        """Return all pairs of shapes: their names and numbers; those with obstacles are of the links that are near."""

        def between(names: tuple[str, str]) -> list[tuple[tuple[str, str], int, int]]:
            return [(names, i, k) for i in objects[names[0]] for k in objects[names[1]]]

        pairs = [pair for names in self._given for pair in between(names)]
        check_separable(robot, self._geometry, pairs, self._margin, self.name)
        if self._all:
            known = set(map(frozenset, self._given))
            touching = pairs_that_touch(robot, self._geometry, objects, self._margin)
            pairs += [pair for names in touching if frozenset(names) not in known for pair in between(names)]
        for place in self._places:
            first = len(pairs)
            pairs += [((link, place.obstacle.name), i, place.index) for link in near for i in objects[link]]
            place.pairs = slice(first, len(pairs))
        if not pairs:
            raise InputError(f"limit '{self.name}' has no pair that can touch: give the pairs")
        return pairs

    def _follow_bodies(self, robot: Robot, pairs: Array) -> None:
        """Prepare what the rows need of the bodies of each pair, which has numbers of shapes, shape (pairs, 2)."""
        items = self._geometry.geometryObjects
        # Joints of each pair, and radii from the nearest points to the axes along the normal, m.
        self._ends = np.array([item.parentJoint for item in items], dtype=np.intp)[pairs.T]
        self._round = np.array([round_radius(item.geometry) for item in items])[pairs.T] * [[-1.0], [1.0]]
        # Of each pair: 1 for each column of `data.J` that moves the second body alone, −1 for the first body alone.
        carried, self._leaders = _columns(robot)
        self._moves = carried[self._ends[1]] - carried[self._ends[0]]
        self._motions = np.zeros_like(self._moves.T)
        data = robot.data  # velocities, accelerations and placements of all bodies
        self._bodies = (
            following([each.linear for each in data.v], 6),
            following([each.linear for each in data.a], 6),
            following([each.rotation for each in data.oMi], 12),
        )

    def _start(self) -> None:
        """Measure all pairs once; refuse an obstacle inside a link."""
        robot, n = self._robot, self._n_pairs
        pin.updateGeometryPlacements(robot.model, robot.data, self._geometry, self._geometry_data)
        distances = np.array([self._distance_of(row) for row in range(n)])
        self._separation.distances()
        self._separation.measured(np.arange(n), distances)
        for place in self._places:
            for (link, what), distance in zip(self._names[place.pairs], distances[place.pairs], strict=True):
                if distance <= 0.0:
                    raise InputError(
                        f"obstacle '{what}' of limit '{self.name}' is {-distance:.3f} m inside '{link}': move it, "
                        "or give the links that keep away in `against`"
                    )

    def _links_near_obstacles(self, robot: Robot) -> list[str]:
        """Return the links that keep away from the obstacles."""
        if not self.obstacles or self._against is not None:
            return list(self._against or ()) if self.obstacles else []
        model, root = robot.model, 1 if robot.floating else 0
        stands = {model.frames[robot.frame_id(sole.frame)].parentJoint for sole in robot.soles}
        joints = {f: model.frames[robot.frame_id(f)].parentJoint for f in self._shapes}
        return [f for f, joint in joints.items() if joint not in stands and (robot.soles or joint > root)]

    def _add_shapes(self, robot: Robot, frames: Iterable[str]) -> dict[str, list[int]]:
        """Add the shapes of frames to the geometry; return their numbers, by frame."""
        objects: dict[str, list[int]] = {}
        for frame in dict.fromkeys(frames):
            if frame not in self._shapes:
                raise InputError(
                    f"limit '{self.name}' has no shape for '{frame}': give it in `shapes`, where "
                    "`RobotDescription.collision_hulls()` has those of all links (it has it for: "
                    f"{', '.join(sorted(self._shapes)) or 'none'})"
                )
            index = robot.frame_id(frame)
            parent = robot.model.frames[index]
            objects[frame] = []
            for number, (body, local) in enumerate(map(geometry_of, self._shapes[frame])):
                place = parent.placement * local
                item = pin.GeometryObject(f"{frame} {number}", parent.parentJoint, index, place, body)
                objects[frame].append(self._geometry.addGeometryObject(item))
        return objects

    @property
    def distances(self) -> dict[tuple[str, str], float]:
        """Distance at the last tick of each pair of links, or of a link and an obstacle, m; negative in collision."""
        smallest: dict[tuple[str, str], float] = {}
        for row, pair in enumerate(self._names):
            smallest[pair] = min(smallest.get(pair, np.inf), self._distance_of(row))
        return smallest

    def _distance_of(self, row: int, within: float | None = None) -> float:
        """Return the distance of a pair of shapes, m; infinite where there is no ground within a distance, m."""
        ground = self._grounds[row]
        if ground is None:
            return float(pin.computeDistance(self._geometry, self._geometry_data, row).min_distance)
        result = ground.nearest(self._geometry, self._geometry_data, row, within or self._influence)
        return np.inf if result is None else float(result.min_distance)

    def measure(self, rows: Array, below: Array, above: Array) -> None:
        """Fill rows and rooms of all pairs within the influence; see `Barrier.measure`."""
        room = np.zeros((2, self.dim))
        self._measure(rows, room, None, False)
        above[:], below[:] = room

    def write_step(self, rows: Array, lower: Array, upper: Array) -> None:
        """Fill how far each pair may approach, or must separate; see `Limit.write_step`."""
        super().write_step(rows, lower, upper)
        if demands(lower, upper):
            self._settle(BACK, rows, lower, upper)

    def violation(self, row: int, size: float) -> str:
        """Return by how much the margin of a pair is violated, and which pair it is."""
        near = self._near
        one, other = self._names[row if row < self._n_pairs else near.pairs[near.rows == row][0]]
        return f"{size:.3g} m ('{one}' and '{other}')"

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
                twists[:, place.pairs] = place.twist()[:, None]
        return twists

    def _speeds(self, rows: Array) -> Array:
        return self._growth

    def drift(self) -> Array:
        """Return the accelerations of the distances; see `Barrier.drift`."""
        return self._drift(self._near)

    def _drift(self, near: Near, chosen: Any = slice(None)) -> Array:
        """Return the accelerations of the distances of some that are near, shape (dim,); zero in other rows.

        Points on the axis of round shapes move as the shape does; on its surface, spinning would count.
        """
        drift, (rows, pairs, numbers) = np.zeros(self.dim), (each[chosen] for each in near)
        if n := rows.size:
            ends = self._ends.take(pairs, axis=1).ravel()  # first bodies, then second ones
            away = self._round.take(pairs, axis=1)
            away[1] += numbers[:, DISTANCE]
            twice = np.concatenate((numbers, numbers)).T
            velocities, accelerations, placements = (each.take(ends, axis=0) for each in self._bodies)
            motion, places = np.concatenate((velocities, accelerations), axis=1), placements.reshape(-1, 4, 3)
            # Along the world's axes, bodies last.
            motion = (motion.reshape(-1, 4, 3) @ places[:, :3]).transpose(1, 2, 0)
            arm = away.ravel() * twice[NORMAL] + twice[POINT] - places[:, 3].T
            of_points = motion[::2] + cross(motion[1::2], arm[None])  # velocities, accelerations
            accelerations = of_points[1] + cross(motion[1], of_points[0])
            along = np.add.reduce(twice[NORMAL] * accelerations, axis=0)
            drift[rows] = along[n:] - along[:n]
        return drift

    def _measure(self, rows: Array, room: Array, dt: float | None, of_velocity: bool) -> Array | None:
        """Fill the rows of pairs that are near, and of the corners of their faces.

        In a controller those are left out whose bodies move at speeds at which nothing but an acceleration above
        `SUDDEN` makes them too fast for their distance.
        """
        rows.fill(0.0)
        room.fill(np.inf)
        self._growth.fill(0.0)
        self._near, moves = near, _ = self._find(dt, of_velocity)
        bent = False
        if near.rows.size:
            moving = self._put(near, rows, room)
            bent = of_velocity and self._bend(near, moving, dt or 0.0)
        return self._growth if bent or moves else None

    def _find(self, dt: float | None, of_velocity: bool) -> tuple[Near, bool]:
        """Return the pairs that are near, and the corners of their faces; True with them if speeds count.

        They are near for velocities or accelerations of a period, s, or for a step, without a period.
        """
        bounds, influence, margin = self._bounds(), self._influence, self._margin
        twists: Array | None = None  # see `_twists`; of velocities, those of the obstacles alone
        counts: Array | None = None  # distance of each pair up to which it counts, m
        # Time after which a distance counts at its present speed, distance up to which it counts then, and distance
        # beyond the margin that a turn may take from corners, for each metre between them.
        ahead, free, turning = 0.0, math.inf, math.inf
        within, reach = influence, min(influence, margin + NEAR)  # of pairs and of corners
        if of_velocity and dt is not None:
            within, twists, turning = reach, self._beside(), dt * TURNING
        elif dt is not None:
            ahead, free, turning = self._time, margin + self._time * dt * SUDDEN, self._time * dt * TURNED
            reach, twists = influence, self._twists()
            counts = np.minimum(self._time * self._separation.speeds(twists) + free, influence)
        asked = (bounds <= (within if counts is None else counts)).nonzero()[0]
        if not asked.size:
            return NOTHING, False
        distances = np.array([self._distance_of(row, within) for row in asked.tolist()])
        self._separation.measured(asked, distances)
        pairs: list[Numbers] = []
        corners: list[Numbers] = []
        results, facing = self._geometry_data.distanceResults, self._facing
        moving = itertools.repeat(AT_REST) if twists is None else twists.take(asked, axis=1).T.tolist()
        limits = itertools.repeat(within) if counts is None else counts.take(asked).tolist()
        for pair, distance, most, (vx, vy, vz, wx, wy, wz) in zip(
            asked.tolist(), distances.tolist(), limits, moving, strict=False
        ):
            if distance > most:
                continue
            result = results[pair]
            normal, point = result.normal, result.getNearestPoint1()
            (nx, ny, nz), (x, y, z) = normal.tolist(), point.tolist()
            mx, my, mz = y * nz - z * ny, z * nx - x * nz, x * ny - y * nx
            growth = nx * vx + ny * vy + nz * vz + mx * wx + my * wy + mz * wz
            left = distance - margin
            if distance + ahead * growth < free:
                pairs.append((distance, pair, left, growth, nx, ny, nz, mx, my, mz, x, y, z))
            if not facing.has_corners[pair] or distance < -DEEP:
                continue
            turn = self._spread[pair] * math.sqrt(wx * wx + wy * wy + wz * wz) if ahead else 0.0
            late = margin + turning * self._spread[pair]
            # A corner further away is slow for its distance.
            beyond = min(late + ahead * (turn - growth), reach)
            if distance >= beyond:
                continue
            least = min(left, 0.0)  # what has come too close may not come closer
            touches = left < TOUCHING
            for gap, nx, ny, nz, mx, my, mz, x, y, z in facing.corners(
                pair, distance, normal, point, beyond, touches
            ):
                growth = nx * vx + ny * vy + nz * vz + mx * wx + my * wy + mz * wz
                if gap + ahead * growth < late:
                    space = gap - margin - least
                    corners.append((gap, pair, space, growth, nx, ny, nz, mx, my, mz, x, y, z))
        most_corners, moves = len(self._corner_rows), twists is not None
        if len(corners) > most_corners:
            corners = sorted(corners)[:most_corners]
        if not (pairs or corners):
            return NOTHING, moves
        numbers = np.array(pairs + corners)
        owners, n = numbers[:, PAIR].astype(np.intp), len(pairs)
        return Near(np.concatenate((owners[:n], self._corner_rows[: len(corners)])), owners, numbers), moves

    def _put(self, near: Near, rows: Array, room: Array) -> Array:
        """Fill the rows of pairs and corners, and return them.

        With J the Jacobians of the joints at the origin of the world, a pair with the normal n from a point p₁ of the
        first body to a point p₂ of the second has the row [n, p₂ × n]·J over the joints that carry the second, less
        [n, p₁ × n]·J over those that carry the first. Since p₂ − p₁ is along n, p₂ × n is p₁ × n.
        """
        filled, pairs, numbers = near
        room[1, filled], self._growth[filled] = numbers[:, ROOM], numbers[:, GROWTH]
        moving = numbers[:, LINE].dot(self._robot.joint_jacobians)
        moving *= self._moves.take(pairs, axis=0)
        rows[filled] = moving = moving if self._leaders is None else moving.dot(self._leaders)
        return np.asarray(moving)

    def _bend(self, near: Near, moving: Array, dt: float) -> bool:
        """Add what the curvature of the way takes from distances in a period at the speed of the last step, if any.

        `moving` are the rows of those that are near. Inverse kinematics leave no velocities of bodies in the data of
        the robot: they are computed here.
        """
        robot, numbers = self._robot, near.numbers
        closing = moving.dot(robot.v) + numbers[:, GROWTH] < -0.5 / self._time * numbers[:, ROOM] - SLOW
        chosen = closing.nonzero()[0]
        if chosen.size:
            pin.forwardKinematics(robot.model, robot.data, robot.q, robot.v, np.zeros(robot.nv))
            self._growth += 0.5 * dt * np.minimum(self._drift(near, chosen), 0.0)
        return bool(chosen.size)

    def __repr__(self) -> str:
        return f"{type(self).__name__}('{self.name}', rows={self.dim})"


def _columns(robot: Robot) -> tuple[Array, Array | None]:
    """Return which columns of `data.J` move which body, and which velocity coordinate moves which column.

    Coupled joints have columns of their own there. Both arrays hold ones and zeros: of the body behind each joint,
    shape (joints, columns), and of each column, shape (columns, nv); None if each column is that of a coordinate.
    """
    model, columns = robot.model, robot.joint_jacobians.shape[1]
    carrying, leaders = np.zeros((model.njoints, columns)), np.zeros((columns, robot.nv))
    for number in range(1, model.njoints):  # parents come first
        joint = model.joints[number]
        own = np.arange(joint.nvExtended)
        carrying[number] = carrying[model.parents[number]]
        carrying[number, joint.idx_vExtended + own] = 1.0
        leaders[joint.idx_vExtended + own, joint.idx_v + own] = 1.0
    return carrying, None if columns == robot.nv else leaders
