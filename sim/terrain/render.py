"""Draw a terrain into a MuJoCo model."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal

import mujoco
import numpy as np

from wbc.core.arguments import checked
from wbc.core.errors import Array, InputError
from wbc.core.settings import NonNegative, Positive, Share, settings, to_json
from wbc.sim.terrain.heightmap import HeightMap
from wbc.sim.terrain.shapes import Box, Capsule, Cylinder, Ellipsoid, Pyramid, Shape, Sphere
from wbc.sim.terrain.spec import Terrain

TERRAIN_GROUP = 2
"""Geom group of every terrain geom: MuJoCo's URDF importer uses 0 and 1, and viewers show 0 to 2."""

FIELD_BASE = 0.1
"""Thickness of a height field below its lowest point, m: nothing falls through at a hard landing."""

SLAB = 0.1
"""Length of track whose solids share a static body, m.

MuJoCo pairs the world body with every moving body and walks the whole tree of its geoms; bodies of their own are
sorted out by their bounding boxes first, if they are not too many. Two soft feet (`terrain_cost`), µs a step with all
solids in one body / in slabs of 0.1 m / each in a body of its own: slats 35 / 23 / 23, large floor tiles 43 / 25 / 25,
cobbles 67 / 41 / 41, stones 77 / 53 / 58, floor tiles 61 / 40 / 77, small stones 101 / 70 / 159. Slabs of 0.05 m gain
nothing more.
"""

_STRIP_COLOUR = (0.55, 0.60, 0.62, 1.0)
_LOW_COLOUR = np.array([0.40, 0.36, 0.33])
_HIGH_COLOUR = np.array([0.80, 0.75, 0.66])

_T = mujoco.mjtGeom


@settings
class GroundContact:
    """Contact parameters of the ground, in MuJoCo's terms.

    The values of a sole with a higher `priority`, such as the soft soles, take precedence (friction as well). The
    defaults are the paper's sole contact: t = 0.1 ms, zeta = 1, d = 0.99 (eq. 1).

    Args:
        friction: Sliding coefficient.
        torsion: Torsional friction, m; MuJoCo's default.
        rolling: Rolling friction, m; MuJoCo's default.
        solref: Time constant (s) and damping ratio. With `refsafe` on, MuJoCo raises the time constant to the
            step (integrator `discrete`) or to two steps (the others).
        solimp: Impedance: least, greatest, width (m), midpoint, power.
        condim: Contact dimension: 1, 3, 4 or 6.
        priority: Compared between the two geoms of a contact.
        contype: Bit mask.
        conaffinity: Bit mask.
    """

    friction: NonNegative = 0.7
    torsion: Annotated[NonNegative, "m"] = 0.005
    rolling: Annotated[NonNegative, "m"] = 0.0001
    solref: tuple[Positive, Positive] = (1e-4, 1.0)
    solimp: tuple[Share, Share, float, float, float] = (0.99, 0.99, 0.001, 0.5, 2.0)
    condim: Literal[1, 3, 4, 6] = 3
    priority: int = 0
    contype: int = 1
    conaffinity: int = 1

    def geom_fields(self) -> dict[str, Any]:
        """Return the values by their names in a MuJoCo geom."""
        values: dict[str, Any] = to_json(self)
        return values | {"friction": [values.pop(name) for name in ("friction", "torsion", "rolling")]}


@dataclass(frozen=True)
class AddedTerrain:
    """A terrain in a model.

    Attributes:
        terrain: The terrain as drawn; its `height` is that of vertical rays.
        geoms: Names of the geoms.
        height_field: Name of the height field asset, if there is one.
        group: Geom group of all geoms.
        ray_groups: Mask for `mj_ray` that lets rays meet the terrain alone, shape (6,), uint8.
    """

    terrain: Terrain
    geoms: tuple[str, ...]
    height_field: str | None
    group: int
    ray_groups: Array = field(repr=False, compare=False)

    @property
    def nodes(self) -> int:
        """Nodes of the height field."""
        field = self.terrain.surface.field
        return 0 if field is None else int(field.z.size)


@checked
def add_to_spec(
    spec: mujoco.MjSpec,
    terrain: Terrain,
    *,
    sole_radius: float | None = None,
    contact: GroundContact | None = None,
    group: int = TERRAIN_GROUP,
    prefix: str = "terrain",
) -> AddedTerrain:
    """Draw a terrain into the world body of a model.

    Everything is checked before anything is added.

    Args:
        spec: The model; changed in place.
        terrain: The terrain.
        sole_radius: Radius of the spheres under the soles, m; that of the terrain when None.
        contact: Contact parameters; the defaults of `GroundContact` when None.
        group: Geom group of all terrain geoms.
        prefix: Beginning of all names.

    Returns:
        The terrain as drawn, and the names of its geoms.

    Raises:
        InputError: The terrain's resolution is too coarse for the soles (the message names the one needed), or the
            group or a name is not usable.
    """
    if not 0 <= group < mujoco.mjNGROUP:
        raise InputError(f"geom group must lie in 0..{mujoco.mjNGROUP - 1}, got {group}")
    if spec.geom(f"{prefix}_floor") is not None:
        raise InputError(f"the model has a terrain called '{prefix}' already")
    if sole_radius is not None:
        terrain = replace(terrain, sole_radius=sole_radius)
    ground = terrain.surface
    # Without density the ground adds nothing to the mass of the model.
    common = (contact or GroundContact()).geom_fields() | {"group": group, "density": 0.0}
    names = [f"{prefix}_floor"]
    spec.worldbody.add_geom(
        name=names[0],
        type=_T.mjGEOM_PLANE,
        size=[0, 0, 0.05],
        pos=[0, 0, ground.floor],
        rgba=_STRIP_COLOUR,
        **common,
    )
    slabs: dict[int, Any] = {}
    for i, shape in enumerate(ground.solids):
        name = f"{prefix}_{i}"
        colour = _STRIP_COLOUR if i >= len(ground.shapes) else _colour(shape, ground.floor, terrain.amplitude)
        middle = (shape.box[0] + shape.box[1]) / 2.0
        key = math.floor(middle / SLAB)
        if key not in slabs:
            slabs[key] = spec.worldbody.add_body(name=f"{prefix}_body_{len(slabs)}", pos=[middle, 0, 0])
        body = slabs[key]
        body.add_geom(name=name, rgba=colour, **_geom(spec, name, shape, body.pos), **common)
        names.append(name)
    asset = None
    if ground.field is not None:
        asset = f"{prefix}_field"
        names.append(asset)
        spec.worldbody.add_geom(
            name=asset, rgba=(*_HIGH_COLOUR, 1.0), **_height_field(spec, asset, ground.field), **common
        )
    mask = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
    mask[group] = 1
    return AddedTerrain(terrain, tuple(names), asset, group, mask)


def _colour(shape: Shape, floor: float, amplitude: float) -> tuple[float, ...]:
    """Shade a solid by the height of its peak."""
    share = float(np.clip((shape.peak[2] - floor) / amplitude, 0.0, 1.0))
    return (*(_LOW_COLOUR + share**2 * (_HIGH_COLOUR - _LOW_COLOUR)).tolist(), 1.0)


def _quaternion(rotation: Array) -> Array:
    """Return the MuJoCo quaternion (wxyz) of a rotation matrix, shape (4,)."""
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation).ravel())
    return quaternion


def _geom(spec: mujoco.MjSpec, name: str, shape: Shape, origin: Array) -> dict[str, Any]:
    """Return the geom fields of a solid in a body at `origin` (m); a pyramid adds its mesh to the model."""
    match shape:
        case Sphere():
            return {"type": _T.mjGEOM_SPHERE, "size": [shape.radius, 0, 0], "pos": shape.position - origin}
        case Ellipsoid():
            place = {"pos": shape.position - origin, "quat": _quaternion(shape.rotation)}
            return {"type": _T.mjGEOM_ELLIPSOID, "size": shape.semi_axes, **place}
        case Box():
            place = {"pos": shape.position - origin, "quat": _quaternion(shape.rotation)}
            return {"type": _T.mjGEOM_BOX, "size": shape.half_size, **place}
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


def _height_field(spec: mujoco.MjSpec, name: str, field: HeightMap) -> dict[str, Any]:
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
