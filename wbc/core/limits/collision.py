"""Limit on collisions: a velocity damper on the distances between links, and of links to obstacles of the world."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Literal, NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbc.base.checked import checked, fixed, result
from wbc.base.errors import InputError, shown
from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, Positive
from wbc.core.limits.base import BACK, OPTIONS, Barrier, Order, cut_demands
from wbc.core.limits.facing import CORNERS, Corner, Facing
from wbc.core.limits.obstacles import CollisionHalfSpace, Obstacle, Shape
from wbc.core.limits.pairs import CollisionScene
from wbc.core.limits.separation import Separation, cross, following, round_radius
from wbc.core.robot import Robot

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

Twist = Sequence[float]
"""Velocity of the second shape of a pair against the first at the world's origin, [linear; angular], m/s and rad/s."""


class Window(NamedTuple):
    """Distances up to which pairs and corners have rows.

    Attributes:
        within: Distance up to which a pair is looked at, m.
        corners: Distance up to which its corners are looked at, m.
        ahead: Time for which a distance is extrapolated at its present speed, s; 0 where speeds do not count.
        least: Distance below which an extrapolated pair has a row, m.
        turning: Distance beyond the margin below which an extrapolated corner has a row, for each metre of its pair, 1.
    """

    within: float
    corners: float
    ahead: float
    least: float
    turning: float


Numbers = tuple[float, float, float, float, float, float, float, float, float, float, float, float]
"""Numbers of the nearest points of two shapes, or of a corner: those of a `Corner`, its room and its growth."""


class Near(NamedTuple):
    """Pairs that are near and, behind them, corners of pairs: all that have rows in a tick.

    Attributes:
        rows: Row of each, shape (n,).
        pairs: Pair of each, shape (n,).
        distance: Distances, shape (n,), m.
        line: Normals from the first shapes to the second ones, and their moments about the origin of the world,
            shape (n, 6), 1 and m.
        point: Points of the first shapes in the world, shape (n, 3), m.
        room: Distances beyond the margin, shape (n,), m; of a corner beyond that of a pair that has come too close.
        growth: Speeds of the distances, or what a moving obstacle adds to them, shape (n,), m/s.
    """

    rows: NDArray[np.intp]
    pairs: NDArray[np.intp]
    distance: Array
    line: Array
    point: Array
    room: Array
    growth: Array

    @classmethod
    def of(cls, rows: Sequence[int], pairs: Sequence[int], numbers: Sequence[Numbers]) -> Near:
        """Return them of their rows, pairs and numbers."""
        n = np.array(numbers).reshape(-1, 12)
        places = np.array(rows, dtype=np.intp), np.array(pairs, dtype=np.intp)
        return cls(*places, n[:, 0], n[:, 1:7], n[:, 7:10], n[:, 10], n[:, 11])


NOTHING = Near.of((), (), ())


class CollisionLimit(Barrier):
    """Limit that keeps pairs of links at a distance, and links away from obstacles, which may move.

        CollisionLimit("all", shapes=description.collision_hulls(), obstacles=[Obstacle("table", CollisionBox(…))])

    Each pair of shapes has a row for its nearest points, and there are rows for corners of faces that look at each
    other; see `wbc.core.limits.facing`. The rows of pairs that are far apart are empty. In a controller the rows of
    pairs that are slow for their distance are empty too. A pair is measured when its shapes have moved so far since
    they were last measured that its row may be needed. In a controller the rows ignore how the rotation of the common
    normal accelerates the distance. The next tick corrects this.

    The arguments are attributes, too, all read-only.

    Attributes:
        obstacles: Shapes of the world; their placements and velocities may be assigned.
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
        links = () if self.pairs == "all" else self.pairs
        if len({frozenset(pair) for pair in links if pair[0] != pair[1]}) != len(links):
            raise InputError(f"limit '{name}' has a link with itself, or a pair twice: {list(links)}")
        self.obstacles = tuple(obstacles)
        named = [obstacle.name for obstacle in self.obstacles]
        if len(set(named)) != len(named):
            raise InputError(f"limit '{name}' has two obstacles of one name: {named}")
        if not (self.pairs or named):
            raise InputError(f"limit '{name}' needs at least one pair of links, or an obstacle")
        self._shapes = {
            frame: tuple(given) if isinstance(given, Sequence) else (given,)
            for frame, given in (shapes or {}).items()
        }
        for frame, given in self._shapes.items():
            if not given or any(isinstance(each, CollisionHalfSpace) for each in given):
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
        self._scene = scene = CollisionScene(
            robot, self.name, self._shapes, self.obstacles, self._against, self.pairs, self._margin
        )
        self._n_pairs = len(scene.names)
        self._probe = (
            scene.geometry.createData()
        )  # of who reads distances: a tick begins where the last one ended
        self.reset()
        scene.refuse_inside(self._measured(self._probe))
        self.dim = self._n_pairs + min(CORNERS * sum(self._facing.has_corners), MOST_CORNERS)
        super().bind(robot)
        self._follow_bodies(robot)
        self._growth = np.zeros(self.dim)  # of the last tick, by rows

    def _follow_bodies(self, robot: Robot) -> None:
        """Prepare what the rows need of the bodies of each pair."""
        items = self._scene.geometry.geometryObjects
        pairs = np.array([(pair.first, pair.second) for pair in self._scene.geometry.collisionPairs])
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

    def reset(self) -> None:
        """Forget the nearest points so far, and measure all pairs; see `Limit.reset`."""
        geometry = self._scene.geometry
        self._data = data = geometry.createData()
        for request in data.distanceRequests:
            request.gjk_initial_guess = coal.GJKInitialGuess.CachedGuess
        self._facing = Facing(geometry, data)
        self._separation = Separation(geometry, data, np.array(self._facing.has_corners))
        self._spread = self._separation.spread.tolist()
        distances = np.array(self._measured(data))
        self._separation.distances()
        self._separation.measured(np.arange(self._n_pairs), distances)
        self._near = NOTHING

    @property
    def distances(self) -> dict[tuple[str, str], float]:
        """Distance of each pair of links, or of a link and an obstacle, at present, m; negative in collision."""
        _ = self.robot  # it is refused before the limit has one
        smallest: dict[tuple[str, str], float] = {}
        for pair, distance in zip(self._scene.names, self._measured(self._probe), strict=True):
            smallest[pair] = min(smallest.get(pair, np.inf), distance)
        return smallest

    def _measured(self, data: pin.GeometryData) -> list[float]:
        """Place all shapes in some data, and return the distances of all pairs there, m."""
        scene = self._scene
        scene.place(data)
        return [scene.distance(row, data) for row in range(self._n_pairs)]

    def measure(self, rows: Array, below: Array, above: Array) -> None:
        """Fill rows and rooms of all pairs within the influence; see `Barrier.measure`."""
        room = np.zeros((2, self.dim))
        self._measure(rows, room, "step", 0.0)
        above[:], below[:] = room

    def write_step(self, rows: Array, lower: Array, upper: Array) -> None:
        """Fill how far each pair may approach, or must separate; see `Limit.write_step`."""
        super().write_step(rows, lower, upper)
        cut_demands(BACK, rows, lower, upper)

    def violation(self, row: int, size: float) -> str:
        """Return by how much the margin of a pair is violated, and which pair it is."""
        near = self._near
        one, other = self._scene.names[row if row < self._n_pairs else near.pairs[near.rows == row][0]]
        return f"{size:.3g} m ('{one}' and '{other}')"

    def _twists(self) -> Array:
        """Return velocities of the second bodies against the first at the world's origin, shape (6, pairs)."""
        v = self._robot.v if self._leaders is None else self._leaders.dot(self._robot.v)
        np.multiply(self._moves.T, v[:, None], out=self._motions)
        twists, beside = self._robot.joint_jacobians.dot(self._motions), self._scene.twists()
        return np.asarray(twists if beside is None else twists + beside)

    def drift(self) -> Array:
        """Return the accelerations of the distances; see `Barrier.drift`."""
        return self._drift(self._near)

    def _drift(self, near: Near) -> Array:
        """Return the accelerations of the distances of those that are near, shape (dim,); zero in other rows.

        Points on the axis of round shapes move as the shape does; on its surface, spinning would count.
        """
        drift = np.zeros(self.dim)
        if n := near.rows.size:
            ends = self._ends.take(near.pairs, axis=1).ravel()  # first bodies, then second ones
            away = self._round.take(near.pairs, axis=1)
            away[1] += near.distance
            normal, point = near.line.T[:3, None], near.point.T[:, None]  # of both bodies
            velocities, accelerations, placements = (each.take(ends, axis=0) for each in self._bodies)
            motion, places = np.concatenate((velocities, accelerations), axis=1), placements.reshape(-1, 4, 3)
            # Along the world's axes, bodies last.
            motion = (motion.reshape(-1, 4, 3) @ places[:, :3]).transpose(1, 2, 0)
            arm = (away * normal + point).reshape(3, -1) - places[:, 3].T
            of_points = motion[::2] + cross(motion[1::2], arm[None])  # velocities, accelerations
            accelerations = of_points[1] + cross(motion[1], of_points[0])
            along = np.add.reduce(normal * accelerations.reshape(3, 2, n), axis=0)
            drift[near.rows] = along[1] - along[0]
        return drift

    def _measure(self, rows: Array, room: Array, order: Order, dt: float) -> Array | None:
        """Fill the rows of pairs that are near, and of the corners of their faces; see `Barrier._measure`."""
        rows.fill(0.0)
        room.fill(np.inf)
        self._growth.fill(0.0)
        self._scene.place(self._data)
        twists = None  # steps have no speeds, and velocities those of obstacles alone
        if order != "step":
            twists = self._twists() if order == "acceleration" else self._scene.twists()
        self._near = near = self._find(self._window(order, dt), twists)
        bent = False
        if near.rows.size:
            moving = self._put(near, rows, room)
            bent = order == "velocity" and self._bend(near, moving, dt)
        return None if twists is None and not bent else self._growth

    def _window(self, order: Order, dt: float) -> Window:
        """Return which pairs and corners have rows.

        In a controller those are left out whose bodies move at speeds at which nothing but an acceleration above
        `SUDDEN` makes them too fast for their distance.
        """
        influence, margin, time = self._influence, self._margin, self._time
        if order == "acceleration":
            return Window(influence, influence, time, margin + time * dt * SUDDEN, time * dt * TURNED)
        close = min(influence, margin + NEAR)
        if order == "velocity":
            return Window(close, close, 0.0, math.inf, dt * TURNING)
        return Window(influence, close, 0.0, math.inf, math.inf)

    def _find(self, window: Window, twists: Array | None) -> Near:
        """Return the pairs that are near, and the corners of their faces; shapes without twists are at rest."""
        asked, limits = self._asked(window, twists)
        if not asked.size:
            return NOTHING
        data, distance_of = self._data, self._scene.distance
        distances = [distance_of(row, data) for row in asked.tolist()]
        self._separation.measured(asked, np.array(distances))
        results, has_corners, margin = data.distanceResults, self._facing.has_corners, self._margin
        moving = itertools.repeat(AT_REST) if twists is None else twists.take(asked, axis=1).T.tolist()
        found, corners = list[Numbers](), list[Numbers]()
        pairs, owners = list[int](), list[int]()  # of each found, and of each corner
        for pair, distance, most, twist in zip(asked.tolist(), distances, limits, moving, strict=False):
            if distance > most:
                continue
            result = results[pair]
            (nx, ny, nz), (x, y, z) = result.normal.tolist(), result.getNearestPoint1().tolist()
            mx, my, mz = y * nz - z * ny, z * nx - x * nz, x * ny - y * nx
            vx, vy, vz, wx, wy, wz = twist
            growth = nx * vx + ny * vy + nz * vz + mx * wx + my * wy + mz * wz
            nearest = distance, nx, ny, nz, mx, my, mz, x, y, z
            if distance + window.ahead * growth < window.least:
                pairs.append(pair)
                found.append((*nearest, distance - margin, growth))
            if has_corners[pair]:
                corners += self._corners(pair, nearest, growth, twist, window)
                owners += [pair] * (len(corners) - len(owners))
        if len(corners) > self.dim - self._n_pairs:  # the nearest ones have rows
            by = [(corner[0], owner, corner[-1]) for corner, owner in zip(corners, owners, strict=True)]
            order = sorted(range(len(by)), key=by.__getitem__)[: self.dim - self._n_pairs]
            corners, owners = [corners[i] for i in order], [owners[i] for i in order]
        if not (found or corners):
            return NOTHING
        rows = [*pairs, *range(self._n_pairs, self._n_pairs + len(corners))]
        return Near.of(rows, pairs + owners, found + corners)

    def _asked(self, window: Window, twists: Array | None) -> tuple[NDArray[np.intp], Iterable[float]]:
        """Return the pairs to measure, by bounds on their distances, and the distance up to which each counts, m."""
        bounds, counts = self._separation.distances(), window.within
        if twists is None or not window.ahead:
            return (bounds <= counts).nonzero()[0], itertools.repeat(counts)
        each = self._separation.speeds(twists)
        each *= window.ahead
        each += window.least
        np.minimum(each, counts, out=each)
        asked = (bounds <= each).nonzero()[0]
        return asked, each.take(asked).tolist()

    def _corners(
        self, pair: int, nearest: Corner, growth: float, twist: Twist, window: Window
    ) -> list[Numbers]:
        """Return the corners of a pair that have rows; `growth` is the speed of its distance, m/s."""
        distance, margin, spread, ahead = nearest[0], self._margin, self._spread[pair], window.ahead
        vx, vy, vz, wx, wy, wz = twist
        turn = spread * math.sqrt(wx * wx + wy * wy + wz * wz)
        late = margin + window.turning * spread
        # A corner that is further away is slow for its distance.
        within = min(late + ahead * (turn - growth), window.corners)
        if not -DEEP <= distance < within:
            return []
        least, touches = min(distance - margin, 0.0), distance - margin < TOUCHING
        found = list[Numbers]()
        for gap, nx, ny, nz, mx, my, mz, x, y, z in self._facing.corners(pair, nearest, within, touches):
            growth = nx * vx + ny * vy + nz * vz + mx * wx + my * wy + mz * wz
            if gap + ahead * growth < late:
                found.append((gap, nx, ny, nz, mx, my, mz, x, y, z, gap - margin - least, growth))
        return found

    def _put(self, near: Near, rows: Array, room: Array) -> Array:
        """Fill the rows of pairs and corners, and return them.

        With J the Jacobians of the joints at the origin of the world, a pair with the normal n from a point p₁ of the
        first body to a point p₂ of the second has the row [n, p₂ × n]·J over the joints that carry the second, less
        [n, p₁ × n]·J over those that carry the first. Since p₂ − p₁ is along n, p₂ × n is p₁ × n.
        """
        filled = near.rows
        room[1, filled], self._growth[filled] = near.room, near.growth
        moving = near.line.dot(self._robot.joint_jacobians)
        moving *= self._moves.take(near.pairs, axis=0)
        rows[filled] = moving = moving if self._leaders is None else moving.dot(self._leaders)
        return np.asarray(moving)

    def _bend(self, near: Near, moving: Array, dt: float) -> bool:
        """Add what the curvature of the way takes from distances in a period at the speed of the last step, if any.

        `moving` are the rows of those that are near. Inverse kinematics leave no velocities of bodies in the data of
        the robot: they are computed here.
        """
        robot = self._robot
        closing = moving.dot(robot.v) + near.growth < -0.5 / self._time * near.room - SLOW
        chosen = closing.nonzero()[0]
        if chosen.size:
            pin.forwardKinematics(robot.model, robot.data, robot.q, robot.v, np.zeros(robot.nv))
            self._growth += 0.5 * dt * np.minimum(self._drift(Near(*(each[chosen] for each in near))), 0.0)
        return bool(chosen.size)


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
