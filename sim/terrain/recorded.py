"""Ground of one's own as plain values, so that a log can be shown where its family is not known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from wbc.base.errors import InputError, choose
from wbc.base.numbers import finite_array
from wbc.base.settings import settings, to_json
from wbc.sim.terrain.families.base import Family
from wbc.sim.terrain.ground import Ground, HeightField
from wbc.sim.terrain.shapes import Box, Capsule, Cylinder, Ellipsoid, Pyramid, Sphere

SHAPES = {kind.__name__: kind for kind in (Box, Capsule, Cylinder, Ellipsoid, Pyramid, Sphere)}
"""Solids that are drawn, by name."""

SIZES = {"rotation": (3, 3), "z": None}
"""Shapes of arrays that are no points; None for any shape."""

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
        kinds = [choose("solid of a recorded ground", each["kind"], SHAPES) for each in plain["shapes"]]
        shapes = tuple(_made(SHAPES[kind], each) for kind, each in zip(kinds, plain["shapes"], strict=True))
        strips = tuple(_made(Box, each) for each in plain["strips"])
        field = None if plain["field"] is None else _made(HeightField, plain["field"])
        if field is not None and (field.z.ndim != 2 or min(field.z.shape) < 2):
            raise InputError(f"z of a recorded HeightField must have rows and columns, got {field.z.shape}")
        return Recorded(family, Ground(float(plain["floor"]), shapes, strips, field))


def plain_ground(ground: Ground) -> dict[str, Any]:
    """Return a surface as plain values."""
    field = ground.field
    return {
        "floor": ground.floor,
        "shapes": [{"kind": type(shape).__name__, **to_json(shape)} for shape in ground.shapes],
        "strips": to_json(ground.strips),
        "field": None if field is None else to_json(replace(field, z=np.round(field.z, DIGITS))),
    }


def _made(kind: Any, plain: Mapping[str, Any]) -> Any:
    """Return a solid or a field of heights of plain values, which are numbers, points or arrays."""
    sizes = {each.name: () if each.type == "float" else SIZES.get(each.name, (3,)) for each in fields(kind)}
    values = {
        name: finite_array(f"{name} of a recorded {kind.__name__}", plain[name], size)
        for name, size in sizes.items()
    }
    return kind(**{name: value if value.ndim else float(value) for name, value in values.items()})
