"""Shapes of links and of obstacles in one geometry, and the pairs of them that a limit on collisions keeps apart."""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.files import parse_xml, read_text
from wbc.base.numbers import Array
from wbc.base.vectors import add_cross
from wbc.core.limits.obstacles import Obstacle, PlacedObstacle, Shape, geometry_of
from wbc.core.robot import Robot

POSTURES = 1000
"""Random postures in which pairs are looked for that can touch."""

SAMPLES = 200
"""Postures in which a pair is looked at that is closer than its margin in half-sitting."""


def srdf_pairs(srdf: str | Path, links: Iterable[str]) -> list[tuple[str, str]]:
    """Return the pairs of some links for `CollisionLimit`, but for the `disable_collisions` of an SRDF.

    The SRDF is a path or the XML itself; the links are such as those of `RobotDescription.collision_shapes`.
    """
    text = str(srdf)
    try:
        root = parse_xml(text if text.lstrip().startswith("<") else read_text(Path(text), "SRDF"))
    except (ET.ParseError, InputError) as error:
        raise InputError(f"cannot read the SRDF of a collision limit: {error}") from error
    left_out = {frozenset((each.get("link1"), each.get("link2"))) for each in root.iter("disable_collisions")}
    return [pair for pair in itertools.combinations(links, 2) if frozenset(pair) not in left_out]


def _postures(robot: Robot, count: int, joints: Collection[int] | None = None) -> Iterator[Array]:
    """Yield half-sitting, and then random positions of some joints, by default of all; of one array."""
    random, first = np.random.default_rng(0), robot.base_nq
    moved: Any = slice(None)
    if joints is not None:
        moved = [place for j in joints if j > 0 and (place := robot.model.joints[j].idx_q - first) >= 0]
    q = np.array(robot.half_sitting)
    yield q
    for _ in range(count):
        q[first:][moved] = random_joints(robot, random)[moved]
        yield q


def random_joints(robot: Robot, random: np.random.Generator, room: float = 0.0) -> Array:
    """Return random positions of the joints, shape (na,), rad or m; a joint without a limit turns by π at most.

    `room` is the share of its range that a joint keeps away from either end.
    """
    low, high = (
        np.nan_to_num(x, neginf=-np.pi, posinf=np.pi) for x in (robot.position_lower, robot.position_upper)
    )
    return np.asarray(low + random.uniform(room, 1.0 - room, robot.na) * (high - low))


class CollisionScene:
    """Shapes of a robot's links and of obstacles, and pairs of them.

    Attributes:
        geometry: All shapes, and the pairs.
        names: Names of both links of each pair, or of a link and an obstacle.
    """

    def __init__(
        self,
        robot: Robot,
        limit: str,
        shapes: Mapping[str, tuple[Shape, ...]],
        obstacles: Sequence[Obstacle],
        against: Sequence[str] | None,
        pairs: Sequence[tuple[str, str]] | Literal["all"],
        margin: float,
    ) -> None:
        """Add the shapes, and their pairs.

        Args:
            robot: The robot.
            limit: Name of the limit, for messages.
            shapes: Link or frame → its shapes.
            obstacles: Obstacles of the world.
            against: Links that keep away from the obstacles; see `CollisionLimit`.
            pairs: Pairs of links; "all" are those that can touch.
            margin: Distance that the pairs of links keep, m.
        """
        self._robot, self._limit, self._shapes = robot, limit, shapes
        given = () if pairs == "all" else pairs
        named = [frame for pair in given for frame in pair]
        for frame in (*shapes, *(against or ()), *named):
            robot.frame_id(frame)
        near = self._links_near_obstacles(against) if obstacles else []
        self.geometry = pin.GeometryModel()
        objects = self._add_shapes((*named, *(shapes if pairs == "all" else ()), *near))

        def between(names: tuple[str, str]) -> list[tuple[tuple[str, str], int, int]]:
            return [(names, i, k) for i in objects[names[0]] for k in objects[names[1]]]

        found = [pair for names in given for pair in between(names)]
        self._check_separable(found, margin)
        if pairs == "all":
            found += [pair for names in self._touching(objects, margin) for pair in between(names)]
        self._obstacles: list[PlacedObstacle] = []
        for obstacle in obstacles:
            body, local = geometry_of(obstacle.shape)
            item = pin.GeometryObject(f"obstacle {obstacle.name}", 0, 0, obstacle.placement * local, body)
            index, first = self.geometry.addGeometryObject(item), len(found)
            found += [((link, obstacle.name), i, index) for link in near for i in objects[link]]
            self._obstacles.append(PlacedObstacle(obstacle, index, local, slice(first, len(found))))
        if not found:
            raise InputError(f"limit '{limit}' has no pair that can touch: give the pairs")
        self.names = [names for names, _, _ in found]
        for _, i, k in found:
            self.geometry.addCollisionPair(pin.CollisionPair(i, k))
        for item in self.geometry.geometryObjects:
            item.geometry.computeLocalAABB()

    def _links_near_obstacles(self, against: Sequence[str] | None) -> list[str]:
        """Return the links that keep away from the obstacles."""
        if against is not None:
            return list(against)
        robot, model = self._robot, self._robot.model
        root = 1 if robot.floating else 0
        stands = {model.frames[robot.frame_id(sole.frame)].parentJoint for sole in robot.soles}
        joints = {f: model.frames[robot.frame_id(f)].parentJoint for f in self._shapes}
        return [f for f, joint in joints.items() if joint not in stands and (robot.soles or joint > root)]

    def _add_shapes(self, frames: Iterable[str]) -> dict[str, list[int]]:
        """Add the shapes of frames to the geometry; return their numbers, by frame."""
        robot, objects = self._robot, dict[str, list[int]]()
        for frame in dict.fromkeys(frames):
            if frame not in self._shapes:
                raise InputError(
                    f"limit '{self._limit}' has no shape for '{frame}': give it in `shapes`, where "
                    "`RobotDescription.collision_hulls()` has those of all links (it has it for: "
                    f"{', '.join(sorted(self._shapes)) or 'none'})"
                )
            index = robot.frame_id(frame)
            parent = robot.model.frames[index]
            objects[frame] = []
            for number, (body, local) in enumerate(map(geometry_of, self._shapes[frame])):
                place = parent.placement * local
                item = pin.GeometryObject(f"{frame} {number}", parent.parentJoint, index, place, body)
                objects[frame].append(self.geometry.addGeometryObject(item))
        return objects

    def _with_pairs(self, pairs: Sequence[tuple[tuple[str, str], int, int]]) -> pin.GeometryModel:
        """Return a copy of the shapes so far with pairs."""
        trial = self.geometry.copy()
        for _, first, second in pairs:
            trial.addCollisionPair(pin.CollisionPair(first, second))
        return trial

    def _touching(self, objects: Mapping[str, list[int]], margin: float) -> list[tuple[str, str]]:
        """Return pairs of links that can come within a margin, m, and do not in half-sitting, but for neighbours.

        `objects` are the numbers of the shapes of each link.
        """
        model = self._robot.model
        joints = {link: model.frames[self._robot.frame_id(link)].parentJoint for link in objects}
        apart = [
            (first, second)
            for first, second in itertools.combinations(objects, 2)
            if (a := joints[first]) != (b := joints[second])
            and model.parents[a] != b
            and model.parents[b] != a
        ]
        pairs = [(names, i, k) for names in apart for i in objects[names[0]] for k in objects[names[1]]]
        trial = self._with_pairs(pairs)
        state, data = model.createData(), trial.createData()
        for request in data.collisionRequests:
            request.security_margin = margin
        left = list(
            zip(range(len(pairs)), (names for names, _, _ in pairs), data.collisionResults, strict=True)
        )
        found = list[set[tuple[str, str]]]()
        for q in _postures(self._robot, POSTURES):
            pin.computeCollisions(model, state, trial, data, q, False)
            found.append(hits := {names for _, names, result in left if result.isCollision()})
            for row, names, _ in left if hits else ():
                if names in hits:  # once is enough
                    data.deactivateCollisionPair(row)
            left = [each for each in left if each[1] not in hits]
        later = set[tuple[str, str]]().union(*found[1:])
        return [names for names in apart if names in later]

    def _check_separable(self, pairs: Sequence[tuple[tuple[str, str], int, int]], margin: float) -> None:
        """Refuse a pair of one body, in collision in half-sitting, or closer than a margin, m, wherever its joints are.

        Of each pair there are the names of both links, and the numbers of their shapes.
        """
        trial, model, limit = self._with_pairs(pairs), self._robot.model, self._limit
        state, data = model.createData(), trial.createData()
        for row, ((one, other), first, second) in enumerate(pairs):
            a, b = (trial.geometryObjects[number].parentJoint for number in (first, second))
            if a == b:
                raise InputError(f"'{one}' and '{other}' of limit '{limit}' are parts of one rigid body")
            between = {*model.supports[a]} ^ {*model.supports[b]}
            distances = []
            for q in _postures(self._robot, SAMPLES, between):
                pin.updateGeometryPlacements(model, state, trial, data, q)
                distances.append(pin.computeDistance(trial, data, row).min_distance)
                if distances[0] <= 0.0:
                    raise InputError(
                        f"'{one}' and '{other}' of limit '{limit}' are {-distances[0]:.3f} m inside each other in "
                        "half-sitting; leave the pair out or give smaller shapes"
                    )
                if distances[-1] > margin:
                    break
            else:
                raise InputError(
                    f"no joint brings '{one}' and '{other}' of limit '{limit}' further apart than "
                    f"{max(distances):.4f} m, its margin is {margin:g} m; leave the pair out, or lower the margin"
                )

    def refuse_inside(self, distances: Sequence[float]) -> None:
        """Refuse an obstacle inside a link, by the distances of all pairs, m."""
        for each in self._obstacles:
            for (link, what), distance in zip(self.names[each.pairs], distances[each.pairs], strict=True):
                if distance <= 0.0:
                    raise InputError(
                        f"obstacle '{what}' of limit '{self._limit}' is {-distance:.3f} m inside '{link}': move it, "
                        "or give the links that keep away in `against`"
                    )

    def place(self, data: pin.GeometryData) -> None:
        """Place all shapes in some data, and the obstacles that have moved among them."""
        for each in self._obstacles:
            if each.obstacle._placement is not each.seen:
                each.seen = each.obstacle._placement
                self.geometry.geometryObjects[each.index].placement = each.seen * each.local
        pin.updateGeometryPlacements(self._robot.model, self._robot.data, self.geometry, data)

    def distance(self, row: int, data: pin.GeometryData) -> float:
        """Return the distance of a pair of shapes, m."""
        return float(pin.computeDistance(self.geometry, data, row).min_distance)

    def twists(self) -> Array | None:
        """Return the velocities of obstacles at the origin of the world, shape (6, pairs); None where none moves."""
        twists = None
        for each in self._obstacles:
            if each.obstacle.moving:
                twists = np.zeros((6, len(self.names))) if twists is None else twists
                *linear, a, b, c = each.obstacle._velocity.tolist()
                at = each.obstacle._placement.translation.tolist()
                twists[:, each.pairs] = np.array([*add_cross(linear, at, (a, b, c)), a, b, c])[:, None]
        return twists
