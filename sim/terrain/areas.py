"""Areas of a ground whose surface has other properties than the rest: wet patches, plates, foam, walkways."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.base.errors import InputError, choose
from wbc.base.numbers import Array

PROPERTIES = {
    "friction": (0.0, 2.0, ""),
    "stiffness": (1.0, 1e12, " N/m³"),
    "damping": (0.0, 1e12, " Ns/m³"),
    "speed": (-5.0, 5.0, " m/s"),
}
"""Properties of an area: least and largest value, and unit. The speed is that of a walkway, along x."""

Sides = tuple[float, float, float, float]
"""Least and largest x, least and largest y, m."""


@dataclass(frozen=True)
class Area:
    """Rectangle of a ground in the world frame, with one property of its surface.

    Attributes:
        sides: Least and largest x, least and largest y, m; infinite where the area goes as far as the ground.
        name: Name of the property, one of `PROPERTIES`.
        value: Its value: coefficient of friction of a sole, stiffness (N/m³), damping (Ns/m³) or speed along x (m/s).
    """

    sides: Sides
    name: str
    value: float

    def covers(self, places: Array) -> NDArray[np.bool_]:
        """Return True for places, shape (n, 2 or 3), m, that are on the area."""
        (x0, x1, y0, y1), x, y = self.sides, places[:, 0], places[:, 1]
        return (x >= x0) & (x < x1) & (y >= y0) & (y < y1)

    def within(self, ends: Sides) -> Sides:
        """Return the sides, those without a place at the ends of a ground."""
        x0, x1, y0, y1 = (s if math.isfinite(s) else e for s, e in zip(self.sides, ends, strict=True))
        return x0, x1, y0, y1

    def __str__(self) -> str:
        return f"{self.name} {self.value:g}{PROPERTIES[self.name][2]}"


def read_areas(values: Sequence[float | str | None], ends: Sides | None, gives: bool) -> tuple[Area, ...]:
    """Return areas that are given by six values each: least and largest x, least and largest y, property, value.

    Args:
        values: The values of one area behind those of the other; None for a side at the end of the ground.
        ends: Least and largest x, least and largest y of the ground, m; None for one without an end.
        gives: True if the ground gives outside of the areas, too.
    """
    if len(values) % 6:
        raise InputError(
            "areas must have six values each: from x, to x, from y, to y (m; none for the end of the ground), a "
            f"property ({', '.join(PROPERTIES)}) and its value; got {len(values)} values"
        )
    areas = tuple(_area(values[i : i + 6], ends) for i in range(0, len(values), 6))
    for one, other in itertools.combinations(areas, 2):
        (a0, a1, b0, b1), (c0, c1, d0, d1) = one.sides, other.sides
        apart = a1 <= c0 or c1 <= a0 or b1 <= d0 or d1 <= b0
        if one.name == other.name and one.value != other.value and not apart:
            raise InputError(
                f"the area of {one} at {_place(one.sides)} and that of {other} at {_place(other.sides)} overlap: cut "
                "one of them off"
            )
    soft = [area for area in areas if area.name == "stiffness"]
    for area in areas:
        if area.name == "damping" and not gives and not any(_inside(area.sides, each.sides) for each in soft):
            raise InputError(
                f"an area of {area} must be where the ground gives: set floor_stiffness, or an area of stiffness "
                f"around {_place(area.sides)}"
            )
    return areas


def at_places(areas: Sequence[Area], name: str, places: Array, elsewhere: ArrayLike) -> Array:
    """Return a property of the ground at places, shape (n, 2 or 3), m, which has a value elsewhere, as shape (n,)."""
    found = np.array(np.broadcast_to(elsewhere, len(places)), dtype=np.float64)
    for area in areas:
        if area.name == name:
            found[area.covers(places)] = area.value
    return found


def _area(values: Sequence[float | str | None], ends: Sides | None) -> Area:
    """Return the area of six values; see `read_areas`."""
    *given, name, value = values
    low, high, unit = PROPERTIES[choose("property of an area", str(name), PROPERTIES)]
    numbers = [side for side in (*given, value) if side is not None]
    if value is None or not all(isinstance(each, (int, float)) and math.isfinite(each) for each in numbers):
        raise InputError(
            f"an area of {name} must have finite numbers, none alone for a side; got {tuple(values)}"
        )
    if not low <= float(value) <= high:
        raise InputError(f"{name} of an area must be from {low:g} to {high:g}{unit}, got {value:g}")
    far = (-math.inf, math.inf, -math.inf, math.inf)
    x0, x1, y0, y1 = (end if side is None else float(side) for side, end in zip(given, far, strict=True))
    area = Area((x0, x1, y0, y1), str(name), float(value))
    if x0 >= x1 or y0 >= y1:
        raise InputError(
            f"an area must go from x to a greater x and from y to a greater y, got {_place(area.sides)}"
        )
    if ends is not None and not _inside(area.within(ends), ends):
        raise InputError(
            f"an area of {area} must be on the ground, which goes from {_place(ends)}, got {_place(area.sides)}: "
            "give none for the end of the ground, or another length, width or strip"
        )
    return area


def _inside(inner: Sides, outer: Sides) -> bool:
    """Return True if the sides of an area are inside of those of another."""
    (a0, a1, b0, b1), (c0, c1, d0, d1) = inner, outer
    return c0 <= a0 and a1 <= c1 and d0 <= b0 and b1 <= d1


def _place(sides: Sides) -> str:
    """Return the sides of an area as text."""
    x0, x1, y0, y1 = sides
    return f"x {x0:g} to {x1:g} m, y {y0:g} to {y1:g} m"
