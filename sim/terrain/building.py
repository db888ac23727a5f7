"""Building of a ground: the solids or the height field of a family on its site, with the ramp and the flat strips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.feet.sensing.scan import PROFILE_STEP
from wbc.sim.terrain.families.base import Family, FieldFamily, ShapeFamily
from wbc.sim.terrain.families.site import Site, cells
from wbc.sim.terrain.ground import FLOOR_GAP, Ground, strip
from wbc.sim.terrain.shapes import Box, Shape, lowered

AMPLITUDE_TOLERANCE = 1e-9
"""Largest difference between the amplitude asked for and the one built, m."""


def build(family: Family, site: Site, margin: float, ramp: float, sole_radius: float) -> Ground:
    """Return the ground of a family; an `InputError` for solids that are not where and as high as they should be.

    Args:
        family: The family.
        site: Its rough part.
        margin: Length of the flat strips before and after it, m.
        ramp: Length of the first piece of the rough part, on which heights grow, m.
        sole_radius: Radius of the spheres under the sole, m, for height fields.
    """
    if site.amplitude == 0.0:
        return Ground(0.0)
    if isinstance(family, FieldFamily):
        field, start, stop = family.build(site, family.cell(sole_radius))
        if ramp > 0.0:
            share = _share(site, ramp, np.linspace(field.x0, field.x1, field.z.shape[1]))
            field, stop = replace(field, z=field.z * share), stop * float(share[-1])
        floor = float(field.z.min()) - FLOOR_GAP
        return Ground(floor, (), _strips(site, margin, start, stop, floor), field)
    assert isinstance(family, ShapeFamily)
    shapes, floor, stop = tuple(family.shapes(site)), family.floor(site), family.stop(site)
    built, whole = max((float(s.peak[2]) for s in shapes), default=floor) - floor, Ground(floor, shapes)
    if abs(built - site.amplitude) > AMPLITUDE_TOLERANCE:
        raise InputError(
            f"terrain family '{family.name}' built {built:g} m for an amplitude of {site.amplitude:g} m"
        )
    if _sticks_out(site, whole, max(floor, stop)):
        raise InputError(f"terrain family '{family.name}' placed a solid outside the rough part")
    return Ground(floor, _sunk(site, ramp, whole), _strips(site, margin, 0.0, stop, floor))


def _strips(site: Site, margin: float, start: float, stop: float, floor: float) -> tuple[Box, ...]:
    """Return the boxes of the flat start and stop, where the floor is not at their level."""
    spans = ((site.x0 - margin, site.x0, start), (site.x1, site.x1 + margin, stop))
    return tuple(strip(a, b, site.width, level, floor) for a, b, level in spans if level != floor)


def _share(site: Site, ramp: float, x: Array) -> Array:
    """Return the ratio of the heights on the ramp to those without it, at world x (m)."""
    return np.clip((x - site.x0) / ramp, 0.0, 1.0) if ramp > 0.0 else np.ones_like(x)


def _sunk(site: Site, ramp: float, ground: Ground) -> tuple[Shape, ...]:
    """Return the solids of a ground, those of the ramp sunk by the ratio at their middle."""
    boxes = np.array([shape.box for shape in ground.shapes]).reshape(-1, 4)
    x, y = (boxes[:, 0] + boxes[:, 1]) / 2.0, (boxes[:, 2] + boxes[:, 3]) / 2.0
    drops = (1.0 - _share(site, ramp, x)) * ground.height(x, y)
    return tuple(s if d == 0.0 else lowered(s, d) for s, d in zip(ground.shapes, drops, strict=True))


def _sticks_out(site: Site, ground: Ground, stop: float) -> bool:
    """Return True if a solid sticks out of floor and strips along a line just outside the rough part."""
    half, out = site.width / 2.0, 1e-5
    x = np.linspace(site.x0 - out, site.x1 + out, cells(site.length, PROFILE_STEP) + 1)
    y = np.linspace(-half - out, half + out, cells(site.width, PROFILE_STEP) + 1)
    sides = ((x, -half - out, ground.floor), (x, half + out, ground.floor))
    ends = ((site.x0 - out, y, 0.0), (site.x1 + out, y, stop))
    return any((ground.height(a, b) > level).any() for a, b, level in (*sides, *ends))
