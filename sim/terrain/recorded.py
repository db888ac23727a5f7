"""Ground of one's own as plain values, so that a log can be shown where its family is not known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from wbc.base.errors import InputError, choose
from wbc.base.numbers import finite_array
from wbc.base.settings import settings
from wbc.sim.terrain.families.base import Family
from wbc.sim.terrain.ground import Ground, HeightField
from wbc.sim.terrain.shapes import Box, Capsule, Cylinder, Ellipsoid, Pyramid, Shape, Sphere

SHAPES = {kind.__name__: kind for kind in (Box, Capsule, Cylinder, Ellipsoid, Pyramid, Sphere)}
"""Solids that are drawn, by name."""

DIGITS = 6
"""Digits of a height behind the point: a ground that is shown has them to 1 µm."""


@settings
class Recorded(Family):
    """Ground as it was drawn, in place of the family that has made it.

    Attributes:
        family: Name of that family.
        ground: The surface.
    """

    family: str
    ground: Ground

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "name", self.family)

    @property
    def smallest_feature(self) -> float:
        """See `Family`; it is not known."""
        return math.inf

    @staticmethod
    def of(family: str, plain: Mapping[str, Any]) -> Recorded:
        """Return the ground that `plain_ground` has made plain; any error is one of the values."""
        shapes, strips = ([_shape(each) for each in plain[name]] for name in ("shapes", "strips"))
        boxes = tuple(strip for strip in strips if isinstance(strip, Box))
        field, heights = plain["field"], None
        if field is not None:
            z = np.asarray(field["z"], dtype=np.float64)
            if z.ndim != 2 or min(z.shape) < 2:  # noqa: PLR2004 - rows and columns
                raise InputError(
                    f"heights of a recorded ground must be rows and columns, got shape {z.shape}"
                )
            x0, x1, y0, y1 = finite_array("ends of a recorded ground", field["ends"], (4,)).tolist()
            heights = HeightField(x0, x1, y0, y1, finite_array("heights of a recorded ground", z, z.shape))
        return Recorded(family, Ground(float(plain["floor"]), tuple(shapes), boxes, heights))


def plain_ground(ground: Ground) -> dict[str, Any]:
    """Return a surface as plain values."""
    field = ground.field
    return {
        "floor": ground.floor,
        "shapes": [_plain(shape) for shape in ground.shapes],
        "strips": [_plain(strip) for strip in ground.strips],
        "field": None
        if field is None
        else {"ends": [field.x0, field.x1, field.y0, field.y1], "z": np.round(field.z, DIGITS).tolist()},
    }


def _plain(shape: Any) -> dict[str, Any]:
    values = {each.name: np.asarray(getattr(shape, each.name)).tolist() for each in fields(shape)}
    return {"kind": type(shape).__name__, **values}


def _shape(plain: Mapping[str, Any]) -> Shape:
    kind: Any = SHAPES[choose("solid of a recorded ground", plain["kind"], SHAPES)]
    values = {}
    for each in fields(kind):
        size = (3, 3) if each.name == "rotation" else () if each.type == "float" else (3,)
        value = finite_array(f"{each.name} of a recorded {plain['kind']}", plain[each.name], size)
        values[each.name] = value if size else float(value)
    return kind(**values)  # type: ignore[no-any-return]
