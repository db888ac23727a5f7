"""Limit of the centre of mass to a polygon on the ground, such as the hull of the soles.

The speed towards each edge is bounded by distance / time constant at the end of each period (the velocity damper of
Faverjon & Tournassoud, ICRA 1987). With the default time constant, that of the linear inverted pendulum, √(height / g),
the divergent component of motion, c + ċ / ω, stays inside, which a CoP in the same polygon can always ensure.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from wbc.base.checked import checked, result
from wbc.base.errors import InputError
from wbc.base.hull import convex_hull
from wbc.base.numbers import Array, read_only
from wbc.base.settings import NonNegative, Positive
from wbc.core.limits.base import OPTIONS, Barrier
from wbc.core.robot import Robot

EDGES = 8
"""Rows of a limit, one for each edge that the hull of two soles may have; more for a given polygon that has more."""


class CoMPolygonLimit(Barrier):
    """Limit that keeps the ground projection of the centre of mass inside a convex polygon.

    The velocities that all edges together allow are never empty, so that the rows cannot contradict each other.

    The arguments are attributes, too. All but `polygon` are read-only, and those that are None have their values once a
    controller has the limit.
    """

    reads = "kinematics"
    step_unit = "m"
    time_constant: float = result("_time", OPTIONS)
    recovery: float = result("_back", OPTIONS)
    margin: float = result("_margin", OPTIONS)

    @checked
    def __init__(
        self,
        polygon: ArrayLike | None = None,
        *,
        margin: Annotated[NonNegative, "m"] = 0.01,
        time_constant: Annotated[Positive, "s"] | None = None,
        recovery: Annotated[NonNegative, "m/s²"] | None = None,
        name: str = "CoM polygon",
    ) -> None:
        """Describe the limit.

        Args:
            polygon: Points in world x and y, shape (n, 2), m; the polygon is their convex hull. When None, it is the
                hull of all soles at the time when the limit is added.
            margin: Distance that the CoM keeps from the edges, m.
            time_constant: Time constant of the approach to an edge, s; √(height of the CoM / g) when None. If it is
                shorter, the CoM may become so fast that no contact force can stop it in time.
            recovery: Smallest acceleration that brings a CoM back from outside an edge, m/s². When None, it is margin /
                (2 · time constant²): the acceleration by a CoP that is half the margin further out than the CoM.
            name: Name of the limit.
        """
        self.name, self.dim = name, EDGES if polygon is None else max(EDGES, len(convex_hull(polygon)))
        self._margin, self._given_recovery = margin, recovery
        self._given_time = time_constant
        self._normals, self._offsets = np.zeros((self.dim, 2)), np.full(self.dim, np.inf)
        self._polygon: Array | None = None
        self._of_soles = polygon is None
        if polygon is not None:
            self.polygon = polygon

    @property
    def polygon(self) -> Array:
        """Corners in world x and y, counter-clockwise, shape (n, 2), m, read-only; assign points, whose hull it is."""
        if self._polygon is None:
            raise InputError(f"limit '{self.name}' has no polygon before it is added to a controller")
        return read_only(self._polygon)

    @polygon.setter
    def polygon(self, points: ArrayLike) -> None:
        corners = convex_hull(points)
        if not 3 <= len(corners) <= self.dim:
            raise InputError(
                f"polygon of limit '{self.name}' must span an area with 3 to {self.dim} corners, got {len(corners)} "
                f"from {np.asarray(points).tolist()}"
            )
        edges = np.roll(corners, -1, axis=0) - corners
        normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
        offsets = np.einsum("ij,ij->i", normals, corners) - self._margin
        if (normals @ corners.mean(axis=0) >= offsets).any() and not _inner_radius(normals, offsets) > 0.0:
            raise InputError(
                f"polygon of limit '{self.name}' leaves nothing inside its margin of {self._margin} m: "
                f"{corners.tolist()}"
            )
        self._of_soles = False
        self._polygon, self._normals[:], self._offsets[:] = corners, 0.0, np.inf  # of rows without an edge
        self._normals[: len(corners)], self._offsets[: len(corners)] = normals, offsets

    @checked
    def use_soles(self, soles: Iterable[str] | None = None) -> None:
        """Take the hull of some soles, where they are now, as the polygon; call it when contacts have changed.

        Args:
            soles: Names or frames of soles; all when None.

        Raises:
            InputError: No sole is given; as an `UnknownNameError`, the robot has no such sole.
        """
        robot = self.robot
        chosen = robot.soles if soles is None else [robot.sole(name) for name in soles]
        if not chosen:
            raise InputError(f"limit '{self.name}' needs at least one sole")
        self.polygon = np.concatenate([sole.corners(robot.placement(sole.frame)) for sole in chosen])[:, :2]

    @property
    def distance(self) -> float:
        """Distance of the CoM to the polygon less its margin, at the last update of the robot, m; negative outside."""
        return float((self._offsets - self._normals @ self.robot.com[:2]).min())

    @checked
    def bind(self, robot: Robot) -> None:
        """Take the hull of the soles when no polygon was given."""
        if not robot.floating:
            raise InputError(
                f"limit '{self.name}' is of a robot that stands, '{robot.name}' is bolted to the world"
            )
        super().bind(robot)
        self._com, self._jacobian = robot.com[:2], robot.com_jacobian[:2]  # views
        time_constant, recovery = self._given_time, self._given_recovery
        if time_constant is None:
            heights = [robot.com[2] - robot.placement(sole.frame).translation[2] for sole in robot.soles]
            if not heights or max(heights) <= 0.0:
                raise InputError(
                    f"limit '{self.name}' needs a time constant: the CoM of {robot!r} is above no sole"
                )
            time_constant = math.sqrt(max(heights) / -robot.model.gravity.linear[2])
        self._time = time_constant
        self._back = 0.5 * self._margin / time_constant**2 if recovery is None else recovery
        if self._of_soles:
            self.use_soles()
            self._of_soles = True  # wherever it is added next

    def measure(self, rows: Array, below: Array, above: Array) -> None:
        """Fill one row for each edge; see `Barrier.measure`."""
        below.fill(np.inf)
        rows[:] = self._normals.dot(self._jacobian)
        np.subtract(self._offsets, self._normals.dot(self._com), out=above)

    def drift(self) -> Array:
        """Return the accelerations towards the edges; see `Barrier.drift`."""
        return np.asarray(self._normals.dot(self._robot.com_drift()[:2]))

    def __repr__(self) -> str:
        return f"{type(self).__name__}('{self.name}', edges={np.isfinite(self._offsets).sum()})"


def _inner_radius(normals: Array, offsets: Array) -> float:
    """Return the radius of the largest circle between half-planes, m; negative if they leave no point."""
    from scipy.optimize import linprog  # noqa: PLC0415 - slow to import, and hardly ever needed

    rows = np.column_stack([normals, np.ones(len(normals))])  # centre and radius
    bounds = [(None, None)] * 3
    found = linprog([0.0, 0.0, -1.0], A_ub=rows, b_ub=offsets, bounds=bounds)
    return float(found.x[2]) if found.success else -np.inf
