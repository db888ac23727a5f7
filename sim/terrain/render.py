"""Draw a terrain into a MuJoCo model."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.robots.mechanism import placed
from wbc.sim.terrain.areas import Area
from wbc.sim.terrain.ground import HeightField
from wbc.sim.terrain.shapes import Box, Capsule, Cylinder, Ellipsoid, Pyramid, Shape
from wbc.sim.terrain.spec import Terrain

TERRAIN_GROUP = 2
"""Geom group of every terrain geom: MuJoCo's URDF importer uses 0 and 1, and viewers show 0 to 2."""

FIELD_BASE = 0.1
"""Thickness of a height field below its lowest point, m: nothing falls through at a hard landing."""

SLAB = 0.1
"""Length of track whose solids share a static body, m.

MuJoCo pairs the world body with every moving body and walks the whole tree of its geoms; bodies of their own are
sorted out by their bounding boxes first, if they are not too many. Two soft feet, µs a step with all
solids in one body / in slabs of 0.1 m / each in a body of its own: slats 35 / 23 / 23, large floor tiles 43 / 25 / 25,
cobbles 67 / 41 / 41, stones 77 / 53 / 58, floor tiles 61 / 40 / 77, small stones 101 / 70 / 159. Slabs of 0.05 m gain
nothing more.
"""

_STRIP_COLOUR = (0.55, 0.60, 0.62, 1.0)
_LOW_COLOUR = np.array([0.40, 0.36, 0.33])
_HIGH_COLOUR = np.array([0.80, 0.75, 0.66])

AREA_COLOURS = {
    "friction": (0.45, 0.70, 0.90),
    "stiffness": (0.85, 0.65, 0.35),
    "damping": (0.70, 0.50, 0.60),
    "speed": (0.45, 0.75, 0.45),
}
"""Colours of areas by their property."""

AREA_SAMPLES = 101
"""Points along each side of an area among which its highest is sought."""

_T = mujoco.mjtGeom


CONTACT: dict[str, Any] = {
    "friction": [0.7, 0.005, 0.0001],  # sliding, torsional (m) and rolling (m), the last two MuJoCo's
    "solref": (1e-4, 1.0),  # MuJoCo raises the time constant to a step (integrator `discrete`)
    "solimp": (0.99, 0.99, 0.001, 0.5, 2.0),
    "condim": 3,
    "priority": 0,
    "contype": 1,
    "conaffinity": 1,
}
"""Contact parameters of the ground in MuJoCo's terms: the paper's sole contact, t = 0.1 ms, zeta = 1, d = 0.99 (eq. 1).
Those of a sole with a higher priority, such as the soft soles, take precedence (friction as well)."""

FLOOR = "terrain_floor"
"""Name of the geom of the floor; solids are "terrain_0", …, a height field is "terrain_field"."""


def add_to_spec(spec: mujoco.MjSpec, terrain: Terrain, *, sole_radius: float | None = None) -> Terrain:
    """Draw a terrain into the world body of a model.

    Args:
        spec: The model; changed in place once everything is checked.
        terrain: The terrain.
        sole_radius: Radius of the spheres under the soles, m; that of the terrain when None.

    Returns:
        The terrain as drawn: its `height` is that of vertical rays.
    """
    if spec.geom(FLOOR) is not None:
        raise InputError("the model has a terrain already")
    if sole_radius is not None:
        terrain = replace(terrain, sole_radius=sole_radius)
    ground = terrain.surface
    # Without density the ground adds nothing to the mass of the model.
    common = CONTACT | {"group": TERRAIN_GROUP, "density": 0.0}
    spec.worldbody.add_geom(
        name=FLOOR,
        type=_T.mjGEOM_PLANE,
        size=[0, 0, 0.05],
        pos=[0, 0, ground.floor],
        rgba=_STRIP_COLOUR,
        **common,
    )
    for k, area in enumerate(terrain.surface_areas):
        _add_area(spec, f"terrain_area_{k}", area, terrain)
    slabs: dict[int, Any] = {}
    for i, shape in enumerate(ground.solids):
        name = f"terrain_{i}"
        colour = _STRIP_COLOUR if i >= len(ground.shapes) else _colour(shape, ground.floor, terrain.amplitude)
        middle = (shape.box[0] + shape.box[1]) / 2.0
        key = math.floor(middle / SLAB)
        if key not in slabs:
            slabs[key] = spec.worldbody.add_body(name=f"terrain_body_{len(slabs)}", pos=[middle, 0, 0])
        body = slabs[key]
        body.add_geom(name=name, rgba=colour, **_geom(spec, name, shape, body.pos), **common)
    if ground.field is not None:
        name = "terrain_field"
        spec.worldbody.add_geom(
            name=name, rgba=(*_HIGH_COLOUR, 1.0), **_height_field(spec, name, ground.field), **common
        )
    return terrain


def _add_area(spec: mujoco.MjSpec, name: str, area: Area, terrain: Terrain) -> None:
    """Draw an area as a thin sheet on its highest point, which touches nothing and no sensor sees."""
    x0, x1, y0, y1 = area.within(terrain.extent)
    if x0 >= x1 or y0 >= y1:  # beyond the part of an endless ground that is drawn
        return
    x, y = np.linspace(x0, x1, AREA_SAMPLES), np.linspace(y0, y1, AREA_SAMPLES)
    spec.worldbody.add_geom(
        name=name,
        type=_T.mjGEOM_BOX,
        size=[0.5 * (x1 - x0), 0.5 * (y1 - y0), 0.0005],
        pos=[0.5 * (x0 + x1), 0.5 * (y0 + y1), float(terrain.height(x[None, :], y[:, None]).max())],
        rgba=(*AREA_COLOURS[area.name], 0.6),
        contype=0,
        conaffinity=0,
        density=0.0,
        group=1,  # not seen by sensors
    )


def _colour(shape: Shape, floor: float, amplitude: float) -> tuple[float, ...]:
    """Shade a solid by the height of its peak."""
    share = float(np.clip((shape.peak[2] - floor) / amplitude, 0.0, 1.0))
    return (*(_LOW_COLOUR + share**2 * (_HIGH_COLOUR - _LOW_COLOUR)).tolist(), 1.0)


def _geom(spec: mujoco.MjSpec, name: str, shape: Shape, origin: Array) -> dict[str, Any]:
    """Return the geom fields of a solid in a body at `origin` (m); a pyramid adds its mesh to the model."""
    match shape:
        case Ellipsoid() if np.ptp(shape.semi_axes) == 0.0:
            size = [shape.semi_axes[0], 0, 0]
            return {"type": _T.mjGEOM_SPHERE, "size": size, "pos": shape.position - origin}
        case Ellipsoid() | Box():
            place = placed(pin.SE3(shape.rotation, shape.position - origin))
            if isinstance(shape, Box):
                return {"type": _T.mjGEOM_BOX, "size": shape.half_size, **place}
            return {"type": _T.mjGEOM_ELLIPSOID, "size": shape.semi_axes, **place}
        case Capsule() | Cylinder():
            kind = _T.mjGEOM_CAPSULE if isinstance(shape, Capsule) else _T.mjGEOM_CYLINDER
            return {
                "type": kind,
                "size": [shape.radius, 0, 0],
                "fromto": [*(shape.start - origin), *(shape.end - origin)],
            }
        case Pyramid():
            # Corners about the apex's foot: single precision of the mesh then costs nothing.
            foot = np.array([shape.apex[0], shape.apex[1], shape.floor])
            spec.add_mesh(name=name, uservert=(shape.corners - foot).ravel().astype(np.float32))
            return {"type": _T.mjGEOM_MESH, "meshname": name, "pos": foot - origin}
        case _:
            raise InputError(f"no MuJoCo geom for a solid of type {type(shape).__name__}")


def _height_field(spec: mujoco.MjSpec, name: str, field: HeightField) -> dict[str, Any]:
    """Add a height field asset and return its geom's fields."""
    low, high = float(field.z.min()), float(field.z.max())
    rows, columns = field.z.shape
    # The compiler scales the data to 0..1; a level field has no range and needs any positive one.
    spec.add_hfield(
        name=name,
        nrow=rows,
        ncol=columns,
        size=[(field.x1 - field.x0) / 2.0, (field.y1 - field.y0) / 2.0, (high - low) or 1e-3, FIELD_BASE],
        userdata=(field.z - low).astype(np.float32).ravel(),
    )
    position = [(field.x0 + field.x1) / 2.0, (field.y0 + field.y1) / 2.0, low]
    return {"type": _T.mjGEOM_HFIELD, "hfieldname": name, "pos": position}
