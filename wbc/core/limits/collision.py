"""Limit on self-collision: a velocity damper on the distance between the shapes of pairs of links."""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import coal
import numpy as np
import pinocchio as pin

from wbc.core.checked import checked
from wbc.core.errors import ROUNDING, Array, InputError, shown
from wbc.core.limits.base import Limit
from wbc.core.robot import Robot
from wbc.core.settings import NonNegative, Positive, settings

Point = tuple[float, float, float]

SAMPLES = 200
"""Postures in which a pair is looked at that is closer than its margin in half-sitting."""

ATTAINABLE = 100.0
"""Acceleration of a joint up to which a limit asks for it, rad/s² or m/s²; the braking of `JointLimits` at most."""


@settings
class CollisionSphere:
    """A sphere around a point of a frame.

    Attributes:
        radius: m.
        centre: In the frame, m.
    """

    radius: Annotated[Positive, "m"]
    centre: Annotated[Point, "m"] = (0.0, 0.0, 0.0)


@settings
class CollisionCapsule:
    """A capsule: all points within a radius of a line segment in a frame.

    Attributes:
        radius: m.
        start: One end of the segment in the frame, m.
        end: Its other end, m.
    """

    radius: Annotated[Positive, "m"]
    start: Annotated[Point, "m"]
    end: Annotated[Point, "m"]

    def __post_init__(self) -> None:
        if math.dist(self.start, self.end) < ROUNDING:
            raise InputError(
                f"a capsule needs two different ends, got {self.start} twice; use a CollisionSphere"
            )


Shape = CollisionSphere | CollisionCapsule


def srdf_pairs(srdf: str | Path, links: Iterable[str]) -> list[tuple[str, str]]:
    """Return the pairs of some links for `SelfCollisionLimit`, but for the `disable_collisions` of an SRDF.

    The SRDF is a path or the XML itself; the links are such as those of `RobotDescription.collision_shapes`.
    """
    root = _xml(srdf, "SRDF")
    left_out = {frozenset((each.get("link1"), each.get("link2"))) for each in root.iter("disable_collisions")}
    return [pair for pair in itertools.combinations(links, 2) if frozenset(pair) not in left_out]


def _xml(source: str | Path, what: str) -> ET.Element:
    text = str(source)
    try:
        return ET.fromstring(text) if text.lstrip().startswith("<") else ET.parse(text).getroot()
    except (ET.ParseError, OSError) as error:
        raise InputError(f"cannot read the {what} of a collision limit: {error}") from error


def _body(robot: Robot, joint: int) -> tuple[Array, list[float], Array, Array]:
    """Return origin, angular velocity, Jacobian and acceleration of the body behind a joint, in the world."""
    model, data, world = robot.model, robot.data, pin.LOCAL_WORLD_ALIGNED
    return (
        data.oMi[joint].translation,
        pin.getVelocity(model, data, joint, world).angular.tolist(),
        pin.getJointJacobian(model, data, joint, world),
        pin.getClassicalAcceleration(model, data, joint, world).vector,
    )


class SelfCollisionLimit(Limit):
    """Keep pairs of links at a distance.

    Each pair of shapes has one row: the distance may shrink at (distance − margin) / time constant at most. Rows of
    pairs that are far apart are empty. Of the acceleration of the distance, the turning of the common normal is left
    out; the next tick sees what it has changed.

    The demanded acceleration of the distance is at most (distance − margin) / time constant² + recovery, m/s²: enough
    for links that come within `influence` at no more than the speed allowed there.
    """

    @checked
    def __init__(
        self,
        pairs: Iterable[tuple[str, str]],
        *,
        shapes: Mapping[str, Shape | Sequence[Shape]] | None = None,
        urdf: str | Path | None = None,
        margin: Annotated[NonNegative, "m"] = 0.02,
        influence: Annotated[Positive, "m"] = 0.3,
        time_constant: Annotated[Positive, "s"] = 0.1,
        recovery: Annotated[NonNegative, "m/s²"] = 10.0,
        name: str = "self-collision",
    ) -> None:
        """Describe the limit.

        Args:
            pairs: Pairs of links or frames.
            shapes: Link or frame → its shapes, in its own coordinates; `RobotDescription.collision_shapes` has those of
                all links.
            urdf: URDF, a path or the XML itself, whose primitive collision geometry (boxes, spheres, cylinders,
                capsules) is the shape of links that are not in `shapes`; meshes are left out.
            margin: Smallest distance, m.
            influence: Distance beyond which a pair is ignored, m.
            time_constant: Time constant of the approach, s.
            recovery: Smallest acceleration that separates links closer than the margin, m/s². It also stops links that
                come within `influence` too fast.
            name: Name of the limit.
        """
        self.name, self.dim = name, 0
        links = list(pairs)
        if not all(isinstance(pair, (tuple, list)) and list(map(type, pair)) == [str, str] for pair in links):
            raise InputError(f"pairs of limit '{name}' must be pairs of names of links, got {shown(links)}")
        self._pairs = [(first, second) for first, second in links]
        if not self._pairs:
            raise InputError(f"limit '{name}' needs at least one pair of links")
        if len({frozenset(pair) for pair in links if pair[0] != pair[1]}) != len(links):
            raise InputError(f"limit '{name}' has a link with itself, or a pair twice: {self._pairs}")
        self._shapes = {
            frame: [shape] if isinstance(shape, CollisionSphere | CollisionCapsule) else list(shape)
            for frame, shape in (shapes or {}).items()
        }
        for frame, given in self._shapes.items():
            if not given or not all(isinstance(shape, CollisionSphere | CollisionCapsule) for shape in given):
                raise InputError(
                    f"shapes of '{frame}' must be spheres and capsules, at least one; got {given}"
                )
        self._urdf = urdf
        self._margin, self._influence, self._recovery = margin, influence, recovery
        if self._influence <= self._margin:
            raise InputError(f"influence of limit '{name}' must exceed its margin, {influence} ≤ {margin} m")
        self._time = time_constant

    def bind(self, robot: Robot) -> None:
        """Build the shapes."""
        self._robot = robot
        for frame in (*self._shapes, *(frame for pair in self._pairs for frame in pair)):
            robot.frame_id(frame)
        geometry = pin.GeometryModel()
        objects: dict[str, list[int]] = {}
        radii: list[float] = []
        primitives = None
        for frame in dict.fromkeys(frame for pair in self._pairs for frame in pair):
            if frame in self._shapes:
                made = [_geometry_object(robot, frame, shape) for shape in self._shapes[frame]]
            elif self._urdf is not None:
                primitives = _urdf_primitives(robot, self._urdf) if primitives is None else primitives
                made = primitives.get(frame, [])
            else:
                made = []
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

        self._rows: list[tuple[int, int, float, float]] = []
        self._names: list[tuple[str, str]] = []
        for first, second in self._pairs:
            joints = [robot.model.frames[robot.frame_id(frame)].parentJoint for frame in (first, second)]
            if joints[0] == joints[1]:
                raise InputError(
                    f"'{first}' and '{second}' of limit '{self.name}' are parts of one rigid body"
                )
            for i in objects[first]:
                for k in objects[second]:
                    geometry.addCollisionPair(pin.CollisionPair(i, k))
                    self._rows.append((joints[0], joints[1], radii[i], radii[k]))
                    self._names.append((first, second))
        self.dim = len(self._rows)
        self._geometry, self._geometry_data = geometry, geometry.createData()
        self._distance = np.full(self.dim, np.inf)
        self._check_separable()
        self._measure()

    @property
    def distances(self) -> dict[tuple[str, str], float]:
        """Pair → smallest distance of its shapes at the last tick, m; negative in collision."""
        smallest: dict[tuple[str, str], float] = {}
        for pair, distance in zip(self._names, self._distance, strict=True):
            smallest[pair] = min(smallest.get(pair, np.inf), float(distance))
        return smallest

    def write(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill one row for each pair of shapes; see `Limit.write`."""
        self._measure()
        v = self._robot.v
        results, bodies = self._geometry_data.distanceResults, dict[int, Any]()
        rows[:] = 0.0
        lower[:] = -np.inf
        upper[:] = np.inf
        for row in (self._distance <= self._influence).nonzero()[0].tolist():
            first, second, radius_1, radius_2 = self._rows[row]
            result = results[row]
            normal = result.normal
            # Points on the axis of round shapes move as the shape does; on its surface, spinning would count.
            sides = (
                (first, result.getNearestPoint1() - radius_1 * normal, -normal),
                (second, result.getNearestPoint2() + radius_2 * normal, normal),
            )
            drift = sum(self._add_side(rows[row], bodies, *side) for side in sides)
            room = float(self._distance[row]) - self._margin
            demand = -(room / self._time + float(np.dot(rows[row], v))) / dt
            demand = min(demand, max(room, 0.0) / self._time**2 + self._recovery) - drift
            # Where the joints hardly change the distance, no demand is one that they cannot meet.
            lower[row] = min(demand, ATTAINABLE * float(np.abs(rows[row]).sum()))

    def _add_side(
        self, row: Array, bodies: dict[int, Any], joint: int, point: Array, direction: Array
    ) -> float:
        """Add a point's motion along a direction to a row; return its acceleration at zero joint accelerations."""
        if joint not in bodies:
            bodies[joint] = _body(self._robot, joint)
        origin, (wx, wy, wz), jacobian, acceleration = bodies[joint]
        nx, ny, nz = direction.tolist()
        rx, ry, rz = (point - origin).tolist()
        lever = np.array([nx, ny, nz, ry * nz - rz * ny, rz * nx - rx * nz, rx * ny - ry * nx])
        row += np.dot(lever, jacobian)
        along, square = wx * rx + wy * ry + wz * rz, wx * wx + wy * wy + wz * wz
        centripetal = along * (nx * wx + ny * wy + nz * wz) - square * (nx * rx + ny * ry + nz * rz)
        return float(np.dot(lever, acceleration) + centripetal)

    def _measure(self) -> None:
        robot, geometry, data = self._robot, self._geometry, self._geometry_data
        pin.updateGeometryPlacements(robot.model, robot.data, geometry, data)
        for row in range(self.dim):
            self._distance[row] = pin.computeDistance(geometry, data, row).min_distance

    def _check_separable(self) -> None:
        """Refuse a pair that is in collision in half-sitting, or closer than the margin wherever its joints are."""
        robot, model = self._robot, self._robot.model
        state, data = model.createData(), self._geometry.createData()
        random = np.random.default_rng(0)
        low, high = (
            np.nan_to_num(x, neginf=-np.pi, posinf=np.pi)
            for x in (robot.position_lower, robot.position_upper)
        )
        for row, (first, second, *_) in enumerate(self._rows):
            one, other = self._names[row]
            between = sorted({*model.supports[first]} ^ {*model.supports[second]})
            joints = [model.joints[joint].idx_q - 7 for joint in between if joint > 1]
            q, furthest = np.array(robot.half_sitting), -np.inf
            for _ in range(SAMPLES):
                pin.updateGeometryPlacements(model, state, self._geometry, data, q)
                distance = pin.computeDistance(self._geometry, data, row).min_distance
                if furthest == -np.inf and distance <= 0.0:
                    raise InputError(
                        f"'{one}' and '{other}' of limit '{self.name}' are {-distance:.3f} m inside each other in "
                        "half-sitting; leave the pair out or give smaller shapes"
                    )
                furthest = max(furthest, distance)
                if furthest > self._margin:
                    break
                q[7:][joints] = random.uniform(low, high)[joints]
            else:
                raise InputError(
                    f"no joint brings '{one}' and '{other}' of limit '{self.name}' further apart than "
                    f"{furthest:.4f} m, its margin is {self._margin:g} m; leave the pair out, or lower the margin"
                )

    def __repr__(self) -> str:
        return f"{type(self).__name__}('{self.name}', pairs={len(self._pairs)}, rows={self.dim})"


def _is_round(item: pin.GeometryObject) -> bool:
    return isinstance(item.geometry, coal.Sphere | coal.Capsule)


def _geometry_object(robot: Robot, frame: str, shape: Shape) -> pin.GeometryObject:
    index = robot.frame_id(frame)
    parent = robot.model.frames[index]
    if isinstance(shape, CollisionSphere):
        body, local = coal.Sphere(shape.radius), pin.SE3(np.eye(3), np.array(shape.centre, dtype=float))
    else:
        start, end = np.array(shape.start, dtype=float), np.array(shape.end, dtype=float)
        length = float(np.linalg.norm(end - start))
        body = coal.Capsule(shape.radius, length)  # along z, about its middle
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), (end - start) / length)
        local = pin.SE3(turn.matrix(), 0.5 * (start + end))
    return pin.GeometryObject(frame, parent.parentJoint, index, parent.placement * local, body)


def _urdf_primitives(robot: Robot, urdf: str | Path) -> dict[str, list[pin.GeometryObject]]:
    """Collision geometry of a URDF that is made of primitives, by link; that of another robot is an `InputError`."""
    root = _xml(urdf, "URDF")
    for link in root.iter("link"):
        for item in (*link.findall("visual"), *link.findall("collision")):
            if item.tag == "visual" or item.find("geometry/mesh") is not None:
                link.remove(item)
    try:
        geometry = pin.buildGeomFromUrdfString(
            robot.model, ET.tostring(root, encoding="unicode"), pin.COLLISION
        )
    except (ValueError, RuntimeError) as error:
        raise InputError(f"the URDF of a collision limit does not fit {robot!r}: {error}") from error
    found: dict[str, list[pin.GeometryObject]] = {}
    for item in geometry.geometryObjects:
        found.setdefault(str(robot.model.frames[item.parentFrame].name), []).append(pin.GeometryObject(item))
    return found
