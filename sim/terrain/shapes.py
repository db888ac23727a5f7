"""Solids that grounds are made of, their upper surface as a height function, and those that families place.

The height of a solid at (x, y) is where the vertical line through that point leaves it; the height of several solids is
that of the highest. The formulas are ray–quadric and ray–half-space intersections for
the ray direction +z.
"""
# ruff: noqa: D102 - overrides are documented where they are declared

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Annotated

import numpy as np
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import Number, Positive
from wbc.core.frames import yaw_rotation

_OUTSIDE = -np.inf

LONGEST_TRACK = 1000.0
"""Longest and widest track, m."""

BURIED = 0.005
"""Depth of solids below the floor, m: no gap shows at a tilted base."""


class Shape(ABC):
    """A convex solid, placed in the world frame (m)."""

    @property
    @abstractmethod
    def box(self) -> tuple[float, float, float, float]:
        """Rectangle around the footprint: x from, x to, y from, y to, m."""

    @property
    @abstractmethod
    def peak(self) -> Array:
        """A highest point of the solid, shape (3,), m."""

    @abstractmethod
    def top(self, x: Array, y: Array) -> Array:
        """Return the height of the upper surface, m; -inf beside the solid. All arrays have shape (n,)."""


class Quadric(Shape):
    """A solid whose curved part is (p - c)ᵀ A (p - c) = 1 with its position c, written as a quadratic in z."""

    position: Array  # shape (3,), m

    @property
    @abstractmethod
    def form(self) -> Array:
        """Symmetric matrix A, shape (3, 3), 1/m²."""

    def top(self, x: Array, y: Array) -> Array:
        a, dx, dy = self.form, x - self.position[0], y - self.position[1]
        half = a[0, 2] * dx + a[1, 2] * dy
        rest = a[0, 0] * dx * dx + 2.0 * a[0, 1] * dx * dy + a[1, 1] * dy * dy - 1.0
        discriminant = half * half - a[2, 2] * rest
        root = (np.sqrt(np.maximum(discriminant, 0.0)) - half) / a[2, 2]
        return np.where(discriminant >= 0.0, self.position[2] + root, _OUTSIDE)


@dataclass(frozen=True, eq=False)
class Ellipsoid(Quadric):
    """An ellipsoid; the columns of `rotation` are its axes in the world frame."""

    position: Array
    semi_axes: Array
    rotation: Array

    @cached_property
    def form(self) -> Array:
        if np.ptp(self.semi_axes) == 0.0:  # of a ball without the rounding of a power
            return np.asarray(np.eye(3) / self.semi_axes[0] ** 2)
        return np.asarray(self.rotation @ np.diag(self.semi_axes**-2) @ self.rotation.T)

    @cached_property
    def _spread(self) -> Array:
        """Covariance-like matrix A⁻¹: the support in direction u is √(uᵀ A⁻¹ u)."""
        return np.asarray(self.rotation @ np.diag(self.semi_axes**2) @ self.rotation.T)

    @property
    def box(self) -> tuple[float, float, float, float]:
        (x, y, _), r = self.position, np.sqrt(np.diag(self._spread))
        return (x - r[0], x + r[0], y - r[1], y + r[1])

    @property
    def peak(self) -> Array:
        column = self._spread[:, 2]
        return np.asarray(self.position + column / np.sqrt(column[2]))


def ball(position: Array, radius: float) -> Ellipsoid:
    """Make a ball from its centre, shape (3,), m, and its radius, m."""
    return Ellipsoid(position, np.full(3, radius), np.eye(3))


class _Rod(Quadric):
    """A capsule or a cylinder: an axis from `start` to `end` and a radius."""

    start: Array
    end: Array
    radius: float

    @property
    def position(self) -> Array:  # type: ignore[override]
        return np.asarray((self.start + self.end) / 2.0)

    @cached_property
    def half_length(self) -> float:
        return float(np.linalg.norm(self.end - self.start)) / 2.0

    @cached_property
    def axis(self) -> Array:
        """Unit vector from start to end, shape (3,)."""
        return np.asarray((self.end - self.start) / (2.0 * self.half_length))

    @cached_property
    def form(self) -> Array:
        return np.asarray((np.eye(3) - np.outer(self.axis, self.axis)) / self.radius**2)

    def _tube(self, x: Array, y: Array) -> Array:
        """Return the top of the curved wall, m; -inf beside it or past its ends."""
        z = super().top(x, y)
        from_centre = np.stack([x, y, np.where(np.isfinite(z), z, 0.0)], axis=-1) - self.position
        inside = np.abs(from_centre @ self.axis) <= self.half_length
        return np.where(inside, z, _OUTSIDE)


@dataclass(frozen=True, eq=False)
class Capsule(_Rod):
    """A round bar with half balls at its ends; its axis must not be vertical."""

    start: Array
    end: Array
    radius: float

    @cached_property
    def _ends(self) -> tuple[Ellipsoid, Ellipsoid]:
        return ball(self.start, self.radius), ball(self.end, self.radius)

    @property
    def box(self) -> tuple[float, float, float, float]:
        low, high = np.minimum(self.start, self.end), np.maximum(self.start, self.end)
        r = self.radius
        return (low[0] - r, high[0] + r, low[1] - r, high[1] + r)

    @property
    def peak(self) -> Array:
        return max((end.peak for end in self._ends), key=lambda p: float(p[2]))

    def top(self, x: Array, y: Array) -> Array:
        first, last = self._ends
        return np.maximum(self._tube(x, y), np.maximum(first.top(x, y), last.top(x, y)))


@dataclass(frozen=True, eq=False)
class Cylinder(_Rod):
    """A round bar with flat ends; its axis must not be vertical."""

    start: Array
    end: Array
    radius: float

    @property
    def _reach(self) -> Array:
        """Half extents of an end disc along the world axes, shape (3,), m."""
        return np.asarray(self.radius * np.sqrt(np.maximum(1.0 - self.axis**2, 0.0)))

    @property
    def box(self) -> tuple[float, float, float, float]:
        low, high, r = np.minimum(self.start, self.end), np.maximum(self.start, self.end), self._reach
        return (low[0] - r[0], high[0] + r[0], low[1] - r[1], high[1] + r[1])

    @property
    def peak(self) -> Array:
        end = self.start if self.start[2] > self.end[2] else self.end
        up = np.array([0.0, 0.0, 1.0]) - self.axis[2] * self.axis
        return np.asarray(end + self.radius * up / np.linalg.norm(up))

    def _disc(self, end: Array, x: Array, y: Array) -> Array:
        """Return the height where vertical lines cross the flat end, m; -inf beside it or when the end is vertical."""
        if abs(self.axis[2]) < ROUNDING:
            return np.full(x.shape, _OUTSIDE)
        dx, dy = x - end[0], y - end[1]
        dz = -(self.axis[0] * dx + self.axis[1] * dy) / self.axis[2]
        return np.where(dx * dx + dy * dy + dz * dz <= self.radius**2, end[2] + dz, _OUTSIDE)

    def top(self, x: Array, y: Array) -> Array:
        discs = np.maximum(self._disc(self.start, x, y), self._disc(self.end, x, y))
        return np.maximum(self._tube(x, y), discs)


class Polytope(Shape):
    """A convex solid bounded by planes: every row of `faces` holds a unit normal n and an offset n·p ≤ c."""

    @property
    @abstractmethod
    def corners(self) -> Array:
        """Corners, shape (k, 3), m."""

    @property
    @abstractmethod
    def faces(self) -> Array:
        """Faces, shape (f, 4): outward unit normal and offset (m)."""

    @cached_property
    def box(self) -> tuple[float, float, float, float]:
        low, high = self.corners.min(axis=0), self.corners.max(axis=0)
        return (low[0], high[0], low[1], high[1])

    @property
    def peak(self) -> Array:
        return np.asarray(self.corners[np.argmax(self.corners[:, 2])])

    def top(self, x: Array, y: Array) -> Array:
        f = self.faces[self.faces[:, 2] > 1e-12]  # the line leaves by the lowest of the upper faces' planes
        z = ((f[:, 3:] - f[:, :1] * x - f[:, 1:2] * y) / f[:, 2:3]).min(axis=0)
        slack = self.faces[:, 3:] - self.faces[:, :1] * x - self.faces[:, 1:2] * y - self.faces[:, 2:3] * z
        return np.where(slack.min(axis=0) >= -1e-12, z, _OUTSIDE)


@dataclass(frozen=True, eq=False)
class Box(Polytope):
    """A cuboid; the columns of `rotation` are its axes in the world frame."""

    position: Array
    half_size: Array
    rotation: Array

    @cached_property
    def corners(self) -> Array:
        signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], dtype=np.float64)
        return np.asarray(self.position + (signs * self.half_size) @ self.rotation.T)

    @cached_property
    def faces(self) -> Array:
        normals = np.concatenate([self.rotation.T, -self.rotation.T])
        offsets = normals @ self.position + np.tile(self.half_size, 2)
        return np.column_stack([normals, offsets])


@dataclass(frozen=True, eq=False)
class Pyramid(Polytope):
    """A square pyramid with a vertical axis, its base reaching `depth` below z = `floor` as a prism."""

    apex: Array
    floor: float
    side: float
    yaw: float
    depth: float = 0.005

    @cached_property
    def corners(self) -> Array:
        angles = self.yaw + np.pi / 4.0 + np.pi / 2.0 * np.arange(4)
        ring = self.apex[:2] + self.side / np.sqrt(2.0) * np.column_stack([np.cos(angles), np.sin(angles)])
        layers = [np.column_stack([ring, np.full(4, z)]) for z in (self.floor, self.floor - self.depth)]
        return np.concatenate([self.apex[None], *layers])

    @cached_property
    def faces(self) -> Array:
        angles = self.yaw + np.pi / 2.0 * np.arange(4)
        out = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(4)])
        height = self.apex[2] - self.floor
        slant = out * height + np.array([0.0, 0.0, self.side / 2.0])
        slant /= np.linalg.norm(slant, axis=1, keepdims=True)
        down = np.array([[0.0, 0.0, -1.0]])
        normals = np.concatenate([slant, out, down])
        base = np.append(self.apex[:2], self.floor)
        offsets = [*(slant @ self.apex), *(out @ base + self.side / 2.0), self.depth - self.floor]
        return np.column_stack([normals, offsets])


_PLACES = ("position", "start", "end", "apex")
"""Fields of solids that are points."""


def lowered(shape: Shape, drop: float) -> Shape:
    """Return a solid lower by a drop, m: a dataclass with its place in fields such as "position"."""
    down = np.array([0.0, 0.0, drop])
    moved = {f.name: getattr(shape, f.name) - down for f in fields(shape) if f.name in _PLACES}  # type: ignore[arg-type]
    if isinstance(shape, Pyramid):
        moved["floor"] = shape.floor - drop
    return replace(shape, **moved)  # type: ignore[type-var]  # its subclasses are dataclasses


def tilted_rotation(slope_x: float, slope_y: float, yaw: float = 0.0) -> Array:
    """Return the axes of a plate whose face rises by `slope_x` along world x and `slope_y` along world y, shape (3, 3).

    The first axis lies above the direction of `yaw` (rad), so that the plate's footprint keeps its heading.
    """
    normal = np.array([-slope_x, -slope_y, 1.0])
    normal /= np.linalg.norm(normal)
    heading = np.array([np.cos(yaw), np.sin(yaw), slope_x * np.cos(yaw) + slope_y * np.sin(yaw)])
    heading /= np.linalg.norm(heading)
    return np.column_stack([heading, np.cross(normal, heading), normal])


@checked
def dome(
    x: Annotated[Number, "m"],
    y: Annotated[Number, "m"],
    radius: Annotated[Positive, Field(le=LONGEST_TRACK), "m"],
    top: Annotated[Positive, Field(le=LONGEST_TRACK), "m"],
) -> Shape:
    """Make a round stone from its place, radius on the floor and height, m: a spherical cap or half an ellipsoid."""
    if top > radius:
        return stone(x, y, (radius, radius), top, 0.0)
    curve = (top**2 + radius**2) / (2.0 * top)
    return ball(np.array([x, y, top - curve]), curve)


def stone(x: float, y: float, semi_axes: tuple[float, float], top: float, yaw: float) -> Ellipsoid:
    """Make half an ellipsoid on the floor at z = 0 (semi-axes and top in m, yaw in rad)."""
    return Ellipsoid(np.array([x, y, 0.0]), np.array([*semi_axes, top]), yaw_rotation(yaw))


def bar(x: float, y: float, length: float, yaw: float, width: float, top: float) -> list[Shape]:
    """Make a round-topped bar lying on the floor at z = 0, across the track at yaw 0 (rad), its middle at x and y (m).

    Its section is a segment of a circle; where it is higher than half its width, a half circle on a rectangle. Length,
    width on the floor and height of the crown (`top`) are in m.
    """
    half = width / 2.0
    radius = (top**2 + half**2) / (2.0 * top) if top <= half else half
    reach = length / 2.0 - half
    along = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
    middle = np.array([x, y, top - radius])
    parts: list[Shape] = [Capsule(middle - reach * along, middle + reach * along, radius)]
    if top > half:
        z0, z1 = -BURIED, top - radius
        size = np.array([half, reach, (z1 - z0) / 2.0])
        parts.append(Box(np.array([x, y, (z0 + z1) / 2.0]), size, yaw_rotation(yaw)))
    return parts


def plate(
    x: float,
    y: float,
    size: tuple[float, float],
    top: float,
    *,
    slope: tuple[float, float] = (0.0, 0.0),
    yaw: float = 0.0,
    thickness: float | None = None,
) -> Box:
    """Make a tile, brick or board by the place of its middle and the height of its highest corner (`top`), m.

    `size` is along its own first and second axis, m, `slope` the rise of its face along world x and y, `yaw` the
    heading of its first axis, rad; without a `thickness` across the face, m, it reaches down into the floor z = 0.
    """
    rotation = tilted_rotation(*slope, yaw)
    up = rotation[2]
    half_x, half_y = size[0] / 2.0, size[1] / 2.0
    to_corner = abs(up[0]) * half_x + abs(up[1]) * half_y
    half_z = (top + BURIED) / (2.0 * up[2]) if thickness is None else thickness / 2.0
    centre = top - to_corner - up[2] * half_z
    # The face's middle, not the block's, stands at (x, y): a tilted block leans away below it.
    lean = rotation[:2, 2] * half_z
    return Box(np.array([x - lean[0], y - lean[1], centre]), np.array([half_x, half_y, half_z]), rotation)


def footprint_margin(size: tuple[float, float], yaw: float) -> Array:
    """Return the half extents along x and y of a rectangle turned by yaw (rad), shape (2,), m."""
    c, s = abs(math.cos(yaw)), abs(math.sin(yaw))
    return np.array([c * size[0] + s * size[1], s * size[0] + c * size[1]]) / 2.0
