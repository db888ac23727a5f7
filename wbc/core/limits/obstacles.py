"""Shapes of links and of obstacles, for limits on collisions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pydantic import Field

from wbc.base.checked import checked, result
from wbc.base.errors import InputError, shown
from wbc.base.numbers import ROUNDING, Array, finite_array, read_only
from wbc.base.settings import Positive, settings
from wbc.core.frames import FixedPose, pose

FARTHEST = 1e6
"""Greatest coordinate and size of a shape, m: distances of shapes beyond are wrong, and hulls cannot be computed."""

Coordinate = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]

Length = Annotated[Positive, Field(le=FARTHEST)]

Point = tuple[Coordinate, Coordinate, Coordinate]


@settings
class CollisionSphere:
    """Sphere around a point of a frame.

    Attributes:
        radius: Radius, m.
        centre: Centre in the frame, shape (3,), m.
    """

    radius: Annotated[Length, "m"]
    centre: Annotated[Point, "m"] = (0.0, 0.0, 0.0)


@settings
class _Segment:
    """Shape about a line segment in a frame.

    Attributes:
        radius: Radius, m.
        start: One end of the segment in the frame, shape (3,), m.
        end: The other end of the segment, shape (3,), m.
    """

    radius: Annotated[Length, "m"]
    start: Annotated[Point, "m"]
    end: Annotated[Point, "m"]

    def __post_init__(self) -> None:
        if math.dist(self.start, self.end) < ROUNDING:
            raise InputError(f"a {type(self).__name__} needs two different ends, got {self.start} twice")


@settings
class CollisionCapsule(_Segment):
    """Capsule: all points within a radius of a line segment in a frame."""


@settings
class CollisionCylinder(_Segment):
    """Cylinder whose ends have the ends of a line segment in a frame as middles."""


@settings
class CollisionBox:
    """Box in a frame of a robot.

    Attributes:
        size: Full lengths of the edges along the axes of the box, m.
        centre: Centre in the frame, shape (3,), m.
        turn: Rotation vector from the axes of the frame to those of the box, shape (3,), rad.
    """

    size: Annotated[tuple[Length, Length, Length], "m"]
    centre: Annotated[Point, "m"] = (0.0, 0.0, 0.0)
    turn: Annotated[Point, "rad"] = (0.0, 0.0, 0.0)


@settings
class CollisionHull:
    """Convex hull of points in a frame, such as the vertices of a mesh.

    Attributes:
        points: At least four points in the frame that span a volume, shape (n, 3), m.
    """

    points: Annotated[tuple[Point, ...], "m"]

    def __post_init__(self) -> None:
        points = np.array(self.points).reshape(-1, 3)
        if len(points) < 4 or np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[-1] < 1e-6:
            raise InputError(
                f"a hull needs at least four points that span a volume, got {shown(self.points)}"
            )


@settings
class CollisionHalfSpace:
    """Half-space on one side of a plane in a frame, such as the ground; for obstacles.

    Attributes:
        normal: Direction out of the half-space, shape (3,), of any length.
        offset: Distance of the plane from the origin of the frame along the normal, m.
    """

    normal: Annotated[Point, "1"] = (0.0, 0.0, 1.0)
    offset: Annotated[Coordinate, "m"] = 0.0

    def __post_init__(self) -> None:
        if math.hypot(*self.normal) < ROUNDING:
            raise InputError(f"normal of a half-space must not be zero, got {self.normal}")


Shape = (
    CollisionSphere | CollisionCapsule | CollisionCylinder | CollisionBox | CollisionHull | CollisionHalfSpace
)
"""Shapes in a frame of the robot, or of an obstacle."""

RoundShape = CollisionSphere | CollisionCapsule
"""Shapes that are all points within a radius of a point or a segment."""


class Obstacle:
    """Shape in the world, which may move at any tick.

    Attributes:
        name: Name in messages and distances.
        shape: The shape in the frame of the obstacle.
    """

    __slots__ = ("__weakref__", "_name", "_placement", "_shape", "_velocity")
    name: str = result("_name", "make another obstacle")
    shape: Shape = result("_shape", "make another obstacle")

    @checked
    def __init__(
        self, name: Annotated[str, Field(min_length=1)], shape: Shape, placement: pin.SE3 | None = None
    ) -> None:
        """Describe the obstacle; without a placement its frame is the world frame."""
        self._name, self._shape = name, shape
        self._velocity = np.zeros(6)
        self.placement = pin.SE3.Identity() if placement is None else placement

    @property
    def placement(self) -> pin.SE3:
        """Placement of the obstacle in the world, read-only; assign a new one, and `velocity` if it moves."""
        return FixedPose(self._placement)

    @placement.setter
    def placement(self, value: pin.SE3) -> None:
        placed = pose(f"placement of obstacle '{self.name}'", value)
        if np.abs(placed.translation).max() > FARTHEST:
            raise InputError(
                f"placement of obstacle '{self.name}' must lie within ±{FARTHEST:g} m, got {shown(value.translation)}"
            )
        self._placement = placed

    @property
    def velocity(self) -> Array:
        """Velocity of the obstacle, [linear; angular] along the world axes, shape (6,), m/s and rad/s."""
        return read_only(self._velocity)

    @velocity.setter
    def velocity(self, value: ArrayLike) -> None:
        self._velocity = finite_array(f"velocity of obstacle '{self.name}'", value, (6,))

    @property
    def moving(self) -> bool:
        """True where the velocity is not zero."""
        return bool(self._velocity.any())

    def __repr__(self) -> str:
        return f"Obstacle('{self.name}', {self.shape!r})"


@dataclass(slots=True)
class PlacedObstacle:
    """Obstacle among the shapes of a limit: its number there, its pairs, and its placement at present."""

    obstacle: Obstacle
    index: int
    local: pin.SE3
    pairs: slice
    seen: pin.SE3 | None = None


def geometry_of(shape: Shape) -> tuple[Any, pin.SE3]:
    """Return the geometry of a shape for coal, and its placement in the frame of the shape."""
    if isinstance(shape, CollisionSphere):
        return coal.Sphere(shape.radius), pin.SE3(np.eye(3), np.array(shape.centre, dtype=float))
    if isinstance(shape, CollisionBox):
        place = pin.SE3(pin.exp3(np.array(shape.turn)), np.array(shape.centre, dtype=float))
        return coal.Box(*shape.size), place
    if isinstance(shape, CollisionHull):
        points = np.array(shape.points, dtype=float)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        mesh = coal.BVHModelOBBRSS()
        mesh.beginModel(0, len(points))
        mesh.addVertices(points - middle)
        mesh.endModel()
        mesh.buildConvexHull(True, "Qt")
        return mesh.convex, pin.SE3(np.eye(3), middle)
    if isinstance(shape, CollisionHalfSpace):
        length = math.hypot(*shape.normal)
        return coal.Halfspace(np.array(shape.normal) / length, shape.offset), pin.SE3.Identity()
    start, end = np.array(shape.start, dtype=float), np.array(shape.end, dtype=float)
    length = float(np.linalg.norm(end - start))  # along z, about its middle
    kind = coal.Capsule if isinstance(shape, CollisionCapsule) else coal.Cylinder
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), (end - start) / length)
    return kind(shape.radius, length), pin.SE3(turn.matrix(), 0.5 * (start + end))
