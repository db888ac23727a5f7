"""Shapes of links and of obstacles, for limits on collisions, and the ground of a height map among them."""

from __future__ import annotations

import math
from typing import Annotated, Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray
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


class CollisionHeights:
    """Ground of a height map: below each known cell a column with its height; for obstacles.

    The map may change at any tick. Cells of unknown height collide with nothing.

    Attributes:
        heights: The map, such as a `wbc.ground.HeightMap`.
    """

    def __init__(self, heights: Any) -> None:
        """Take a map."""
        if not all(hasattr(heights, name) for name in ("at", "origin", "settings")):
            raise InputError(f"heights must be a map such as a wbc.ground.HeightMap, got {shown(heights)}")
        self.heights = heights

    def __repr__(self) -> str:
        return f"CollisionHeights({type(self.heights).__name__})"


Shape = (
    CollisionSphere
    | CollisionCapsule
    | CollisionCylinder
    | CollisionBox
    | CollisionHull
    | CollisionHalfSpace
    | CollisionHeights
)
"""Shapes in a frame of the robot, or of an obstacle."""

RoundShape = CollisionSphere | CollisionCapsule
"""Shapes that are all points within a radius of a point or a segment."""

ENDLESS = (CollisionHalfSpace, CollisionHeights)
"""Shapes of obstacles alone."""

DEPTH = 1.0
"""Length of the column below a cell of a height map, m."""


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
        if isinstance(self.shape, CollisionHeights) and not value.isApprox(pin.SE3.Identity(), 0.0):
            raise InputError(
                f"obstacle '{self.name}' is a height map, which lies in the world: it has no placement"
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


def geometry_of(shape: Shape) -> tuple[Any, pin.SE3]:
    """Return the geometry of a shape for coal, and its placement in the frame of the shape."""
    if isinstance(shape, CollisionSphere):
        return coal.Sphere(shape.radius), pin.SE3(np.eye(3), np.array(shape.centre, dtype=float))
    if isinstance(shape, CollisionBox):
        place = pin.SE3(pin.exp3(np.array(shape.turn)), np.array(shape.centre, dtype=float))
        return coal.Box(*shape.size), place
    if isinstance(shape, CollisionHeights):
        cell = float(shape.heights.settings.cell)
        return coal.Box(cell, cell, DEPTH), pin.SE3.Identity()
    if isinstance(shape, CollisionHull):
        points = np.array(shape.points, dtype=float)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        return coal_hull(points - middle), pin.SE3(np.eye(3), middle)
    if isinstance(shape, CollisionHalfSpace):
        length = math.hypot(*shape.normal)
        return coal.Halfspace(np.array(shape.normal) / length, shape.offset), pin.SE3.Identity()
    start, end = np.array(shape.start, dtype=float), np.array(shape.end, dtype=float)
    length = float(np.linalg.norm(end - start))  # along z, about its middle
    kind = coal.Capsule if isinstance(shape, CollisionCapsule) else coal.Cylinder
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), (end - start) / length)
    return kind(shape.radius, length), pin.SE3(turn.matrix(), 0.5 * (start + end))


def coal_hull(points: Array) -> Any:
    """Return the convex hull of points, shape (n, 3), m, for coal."""
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(0, len(points))
    mesh.addVertices(points)
    mesh.endModel()
    mesh.buildConvexHull(True, "Qt")
    return mesh.convex


WIDE = 1.0
"""Half of the side of a column in which a shape has sunk, m: it leaves the ground upward, not through the next cell."""


class Columns:
    """Columns of a height map among the shapes of a limit, one after the other in the place of one box.

    A lower bound on the distance of a shape to each column is that of points inside it, less how far the shape reaches
    beyond them. The columns are measured in the order of this bound, until it exceeds the least distance: the result
    is that of all columns.

    Attributes:
        index: Number of the box among the shapes.
    """

    def __init__(self, shape: CollisionHeights, box: Any, index: int) -> None:
        """Put the columns of a map into the place of a box."""
        self.index, self._heights, self._box = index, shape.heights, box
        self._narrow = np.array(box.halfSide)
        #: Points inside each shape, and its reach beyond them.
        self._known: dict[int, tuple[Array, float]] = {}

    def nearest(
        self, geometry: pin.GeometryModel, data: pin.GeometryData, row: int, influence: float
    ) -> Any | None:
        """Return coal's result for the pair of a row and its nearest column; None without one within `influence`, m."""
        item = geometry.collisionPairs[row].first
        if item not in self._known:
            self._known[item] = _points_inside(geometry.geometryObjects[item].geometry, self._cell)
        (inside, reach), place = self._known[item], data.oMg[item]
        points = inside.dot(place.rotation.T) + place.translation
        across, above, turn, at, heights = self._offsets(points, influence + reach)
        bounds = np.hypot(np.abs(across), np.maximum(above, 0.0)).min(axis=0) - reach
        best, least = -1, influence
        for number in np.argsort(bounds).tolist():
            if bounds[number] >= least:
                break
            result = self._measure(geometry, data, row, at[number], float(heights[number]), turn)
            if result.min_distance < least:
                best, least = number, result.min_distance
        if best < 0:
            return None
        if least < 0.0:
            self._box.halfSide = np.array([WIDE, WIDE, self._narrow[2]])
        result = self._measure(geometry, data, row, at[best], float(heights[best]), turn)
        self._box.halfSide = self._narrow
        return result

    def below(self, points: Array, within: float) -> tuple[Array, Array]:
        """Return the distances of points to the columns, shape (n,), m, and unit vectors to the nearest ones, (n, 3).

        Distances of points inside the ground are negative; those beyond `within`, m, are infinite.
        """
        across, above, turn, at, _ = self._offsets(points, within)
        distances, towards = np.full(len(points), np.inf), np.zeros((len(points), 3))
        if at.size:
            far = np.hypot(np.abs(across), np.maximum(above, 0.0))
            far = np.where(far > 0.0, far, above)  # inside a column it is the depth below its top
            nearest = (np.arange(len(points)), far.argmin(axis=1))
            distances, aside = far[nearest], across[nearest] * turn
            towards = np.stack((aside.real, aside.imag, -np.maximum(above[nearest], 0.0)), axis=1)
            outside = distances > 0.0
            towards[outside] /= distances[outside, None]
            towards[~outside] = [0.0, 0.0, -1.0]
        return distances, towards

    def _offsets(
        self, points: Array, away: float
    ) -> tuple[NDArray[np.complex128], Array, complex, NDArray[np.complex128], Array]:
        """Return where columns are that are near points.

        Returns:
            Ways from points to columns along the axes of the grid, and heights of the points above the columns, shape
            (points, columns), m; the heading of the grid; places of the columns in the world and their heights, m.
        """
        ox, oy, yaw = self._heights.origin
        cell, turn = self._cell, complex(math.cos(yaw), math.sin(yaw))
        grid = ((points[:, 0] - ox) + 1j * (points[:, 1] - oy)) * turn.conjugate()
        first = np.floor([(grid.real.min() - away) / cell, (grid.imag.min() - away) / cell])
        last = np.ceil([(grid.real.max() + away) / cell, (grid.imag.max() + away) / cell])
        x, y = ((np.arange(a, b) + 0.5) * cell for a, b in zip(first, last, strict=True))
        centres = (x[:, None] + 1j * y[None, :]).ravel()
        at = centres * turn + complex(ox, oy)
        heights = self._heights.at(at)[0]
        kept = np.flatnonzero(heights >= float(points[:, 2].min()) - away)  # NaN is no height
        apart, heights = centres[kept] - grid[:, None], heights[kept]
        ahead, aside = (
            np.sign(x) * np.maximum(np.abs(x) - 0.5 * cell, 0.0) for x in (apart.real, apart.imag)
        )
        return ahead + 1j * aside, points[:, 2, None] - heights, turn, at[kept], heights

    @property
    def _cell(self) -> float:
        return float(self._heights.settings.cell)

    def _measure(
        self,
        geometry: pin.GeometryModel,
        data: pin.GeometryData,
        row: int,
        at: complex,
        height: float,
        turn: complex,
    ) -> Any:
        rotation = np.array([[turn.real, -turn.imag, 0.0], [turn.imag, turn.real, 0.0], [0.0, 0.0, 1.0]])
        data.oMg[self.index] = pin.SE3(rotation, np.array([at.real, at.imag, height - 0.5 * DEPTH]))
        return pin.computeDistance(geometry, data, row)


def _points_inside(shape: Any, spacing: float) -> tuple[Array, float]:
    """Return points inside a shape, shape (n, 3), m, and how far it reaches beyond the nearest of them, m."""
    if isinstance(shape, coal.Sphere):
        return np.zeros((1, 3)), float(shape.radius)
    if isinstance(shape, coal.Capsule):
        half = float(shape.halfLength)
        count = max(2, math.ceil(2.0 * half / spacing) + 1)
        points = np.zeros((count, 3))
        points[:, 2] = np.linspace(-half, half, count)
        return points, float(shape.radius) + half / (count - 1)
    return np.array([shape.aabb_center]), float(shape.aabb_radius)
