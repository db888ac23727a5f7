"""Inputs of what is known of the ground: clouds of points, and maps of the user's own."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError, shown
from wbc.base.numbers import Array, unmasked
from wbc.base.settings import Angle, Number, Positive

WORLD = "world"
"""Frame of clouds and maps that are in the frame of the robot's estimate."""

SEEN = 8192
"""Greatest number of points that are taken of one cloud, so that a large one costs a tick no more than 2 ms. The map of
the ground has as many cells on 3.3 m²."""

LEAST_STD, MOST_STD = 1e-6, 1e3
"""Bounds within which the standard deviation of a point is taken, m: squares beyond them lose all digits."""

GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


def check_frame(what: str, name: object) -> None:
    """Raise an `InputError` for what is no name of a frame; `what` is said in the message."""
    if not isinstance(name, str) or not name or not name.isprintable():
        raise InputError(f"{what} must be the name of a frame of the robot, or '{WORLD}', got {shown(name)}")


def _numbers(what: str, value: ArrayLike) -> Array:
    """Return a copy of numbers, which may be NaN, as a float64 array of any shape; else an `InputError`."""
    try:
        array = np.asarray(unmasked(value))
        if array.dtype.kind not in "iuf" and array.size:
            raise TypeError
        return np.array(array, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{what} must be numbers, got {shown(value)}") from error


def spread(count: int, most: int, turn: int) -> NDArray[np.int64] | slice:
    """Return numbers below a count, `most` of them at most, spread evenly over all; others for each `turn`."""
    if count <= most:
        return slice(None)
    part, within = _parts(most)
    place = within + turn * most * GOLDEN % 1.0
    np.subtract(place, 1.0, out=place, where=place >= 1.0)
    place += part
    place *= count / most
    return place.astype(np.int64)


@functools.lru_cache(maxsize=16)
def _parts(most: int) -> tuple[Array, Array]:
    """Return the numbers of equal parts, and a place within each, between 0 and 1, by the golden ratio.

    A regular step may meet one column of an image alone.
    """
    part = np.arange(most, dtype=np.float64)
    return part, part * GOLDEN % 1.0


def _points(value: ArrayLike, turn: int) -> tuple[Array, int, NDArray[np.int64] | slice]:
    """Return the points that are taken of a cloud, as float64, their number in the whole cloud, and which they are.

    An array with the fields x, y and z is read by them.
    """
    fields = getattr(getattr(value, "dtype", None), "names", None)
    if fields is not None:
        if missing := [axis for axis in "xyz" if axis not in fields]:
            raise InputError(
                f"points of a cloud must have the fields x, y and z, of {', '.join(fields)}: "
                f"{', '.join(missing)} missing"
            )
        flat = np.asanyarray(value).ravel()
        chosen = spread(flat.size, SEEN, turn)
        part = flat[chosen]
        columns = [_numbers(f"field {axis} of a cloud", part[axis]) for axis in "xyz"]
        if any(column.ndim != 1 for column in columns):
            raise InputError("fields x, y and z of a cloud must be one number for each point")
        return np.stack(columns, axis=1), flat.size, chosen
    array = value if isinstance(value, np.ndarray) else _numbers("points of a cloud", value)
    if array.ndim != 2 or array.shape[1] != 3:
        more = "; leave out the columns after x, y and z" if array.ndim == 2 and array.shape[1] > 3 else ""
        raise InputError(f"points of a cloud must have shape (n, 3), got {array.shape}{more}")
    chosen = spread(len(array), SEEN, turn)
    return _numbers("points of a cloud", array[chosen]), len(array), chosen


@checked
@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points of the ground seen at one instant, by a depth camera, a lidar or range sensors.

    Attributes:
        points: Points in `frame`, shape (n, 3), m. Rows with NaN or infinity (lost returns) are left out. An array with
            named fields, as in ROS, is read by its fields x, y and z. At most 8192 points are used: of a larger cloud
            this number is taken, spread evenly over all points, and other ones at another `time`.
        time: Time at which the points were seen, by the clock of `Measurement.time`, s.
        frame: Frame of the robot's model in which the points are given, usually that of the sensor; "world" for the
            world frame of the robot's state estimate.
        std: Standard deviation of the points along their rays, m, a number or an array of shape (n,).
    """

    points: Array
    time: Annotated[Number, "s"]
    frame: str
    std: ArrayLike = 0.005

    def __post_init__(self) -> None:
        check_frame("frame of a cloud", self.frame)
        points, count, chosen = _points(self.points, hash(self.time) % 1009)
        std = self.std if isinstance(self.std, np.ndarray) else _numbers("std of a cloud (m)", self.std)
        if std.shape not in ((), (1,), (count,)):
            raise InputError(
                f"std of a cloud (m) must be a number or have shape ({count},), got shape {std.shape}"
            )
        each = std.shape == (count,)
        std = _numbers("std of a cloud (m)", std[chosen] if each else std)
        finite = np.isfinite(points)
        if not finite.all():
            good = np.flatnonzero(finite[:, 0] & finite[:, 1] & finite[:, 2])
            points = points.take(good, axis=0)
            std = std.take(good) if each else std
        if not (std > 0.0).all():
            raise InputError("std of a cloud (m) must be above zero for every point")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "std", np.broadcast_to(np.clip(std, LEAST_STD, MOST_STD), len(points)))


@checked
@dataclass(frozen=True, eq=False)
class ElevationMap:
    """Map of the user's own: heights of the ground on a grid.

    Attributes:
        heights: Height at the centre of each cell, shape (nx, ny), m; NaN where unknown. Infinite values become NaN.
        cell: Size of a cell, m.
        pose: Place (m) and heading (rad) in the world of the corner of cell (0, 0), where x and y of the map begin.
        time: Instant at which the map was right, on the clock of `Measurement.time`, s.
        frame: "world", the frame of the robot's estimate: maps in other frames are not used.
        max_age: Time after which the map is no longer used, s.
        unknown: True if no height is known.
    """

    heights: Array
    cell: Annotated[Positive, "m"]
    pose: tuple[Number, Number, Angle] = (0.0, 0.0, 0.0)
    time: Annotated[Number, "s"] = 0.0
    frame: str = WORLD
    max_age: Annotated[float, Field(gt=0.0, allow_inf_nan=True), "s"] = np.inf
    unknown: bool = field(init=False)
    _turn: complex = field(init=False, repr=False)

    def __post_init__(self) -> None:
        heights = _numbers("heights of a map (m)", self.heights)
        if heights.ndim != 2 or not heights.size:
            raise InputError(f"heights of a map must have shape (nx, ny), got {heights.shape}")
        check_frame("frame of a map", self.frame)
        _, _, yaw = self.pose
        object.__setattr__(self, "heights", np.where(np.isfinite(heights), heights, np.nan))
        object.__setattr__(self, "unknown", not np.isfinite(heights).any())
        object.__setattr__(self, "_turn", np.exp(-1j * yaw) / self.cell)

    def heights_at(self, places: NDArray[np.complex128]) -> Array:
        """Return the heights at places x + iy, m, complex of any shape; NaN outside and where unknown."""
        grid = (places - complex(self.pose[0], self.pose[1])) * self._turn
        i, j = np.floor(grid.real), np.floor(grid.imag)
        nx, ny = self.heights.shape
        inside = (i >= 0) & (i < nx) & (j >= 0) & (j < ny)
        i, j = np.where(inside, i, 0).astype(np.int64), np.where(inside, j, 0).astype(np.int64)
        return np.where(inside, self.heights[i, j], np.nan)
