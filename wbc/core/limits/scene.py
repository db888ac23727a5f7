"""Scene of a limit on collisions: shapes of links, obstacles among them, and the pairs that are kept apart."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.limits.columns import Columns
from wbc.core.limits.obstacles import CollisionHeights, Obstacle, PlacedObstacle, Shape, geometry_of
from wbc.core.limits.pairs import check_separable, pairs_that_touch
from wbc.core.robot import Robot


class Scene:
    """Shapes of a robot's links and of obstacles, and pairs of them.

    Attributes:
        geometry: All shapes, and the pairs.
        names: Names of both links of each pair, or of a link and an obstacle.
        grounds: Columns of the second shape of each pair, where that is a height map.
    """

    def __init__(
        self,
        robot: Robot,
        limit: str,
        shapes: Mapping[str, tuple[Shape, ...]],
        obstacles: Sequence[Obstacle],
        against: Sequence[str] | None,
    ) -> None:
        """Take links with their shapes, obstacles, and the links that keep away from these; `limit` is for messages."""
        for frame in (*shapes, *(against or ())):
            robot.frame_id(frame)
        self._robot, self._limit, self._shapes = robot, limit, shapes
        self._near = self._links_near_obstacles(against) if obstacles else []
        self.geometry = pin.GeometryModel()
        self.names: list[tuple[str, str]] = []
        self.grounds: list[Columns | None] = []
        self._obstacles: list[PlacedObstacle] = []
        self._given = obstacles

    def pair(self, pairs: Sequence[tuple[str, str]] | Literal["all"], margin: float) -> None:
        """Add the shapes, and pairs of links that keep a margin, m; "all" are those that can touch."""
        given = () if pairs == "all" else pairs
        named = [frame for pair in given for frame in pair]
        for frame in named:
            self._robot.frame_id(frame)
        objects = self._add_shapes((*named, *(self._shapes if pairs == "all" else ()), *self._near))
        grounds = self._add_obstacles()

        def between(names: tuple[str, str]) -> list[tuple[tuple[str, str], int, int]]:
            return [(names, i, k) for i in objects[names[0]] for k in objects[names[1]]]

        found = [pair for names in given for pair in between(names)]
        check_separable(self._robot, self.geometry, found, margin, self._limit)
        if pairs == "all":
            touching = pairs_that_touch(self._robot, self.geometry, objects, margin)
            found += [pair for names in touching for pair in between(names)]
        for each in self._obstacles:
            first, name = len(found), each.obstacle.name
            found += [((link, name), i, each.index) for link in self._near for i in objects[link]]
            each.pairs = slice(first, len(found))
        if not found:
            raise InputError(f"limit '{self._limit}' has no pair that can touch: give the pairs")
        for names, i, k in found:
            self.geometry.addCollisionPair(pin.CollisionPair(i, k))
            self.names.append(names)
            self.grounds.append(grounds.get(k))
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

    def _add_obstacles(self) -> dict[int, Columns]:
        """Add the obstacles to the geometry; return the columns of height maps, by the number of their shape."""
        grounds: dict[int, Columns] = {}
        for obstacle in self._given:
            body, local = geometry_of(obstacle.shape)
            item = pin.GeometryObject(f"obstacle {obstacle.name}", 0, 0, obstacle.placement * local, body)
            index = self.geometry.addGeometryObject(item)
            self._obstacles.append(PlacedObstacle(obstacle, index, local))
            if isinstance(obstacle.shape, CollisionHeights):
                grounds[index] = Columns(obstacle.shape, body, index)
        return grounds

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
            each.follow(self.geometry)
        pin.updateGeometryPlacements(self._robot.model, self._robot.data, self.geometry, data)

    def distance(self, row: int, data: pin.GeometryData, within: float) -> float:
        """Return the distance of a pair of shapes, m; infinite where there is no ground within a distance, m."""
        ground = self.grounds[row]
        if ground is None:
            return float(pin.computeDistance(self.geometry, data, row).min_distance)
        result = ground.nearest(self.geometry, data, row, within)
        return np.inf if result is None else float(result.min_distance)

    def twists(self) -> Array | None:
        """Return the velocities of obstacles at the origin of the world, shape (6, pairs); None where none moves."""
        twists = None
        for each in self._obstacles:
            if each.obstacle.moving:
                twists = np.zeros((6, len(self.names))) if twists is None else twists
                twists[:, each.pairs] = each.twist()[:, None]
        return twists
