"""Solids of families, by their place on the floor, their width and the height of their top."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.numbers import Array
from wbc.base.settings import Number, Positive
from wbc.core.frames import yaw_rotation
from wbc.sim.terrain.families.site import LONGEST_TRACK
from wbc.sim.terrain.shapes import Box, Capsule, Ellipsoid, Shape, ball, tilted_rotation

BURIED = 0.005
"""Depth of solids below the floor, m: no gap shows at a tilted base."""


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
