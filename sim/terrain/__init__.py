"""Grounds to walk on: named families of rough terrain with one height query for simulation, tests and pictures.

    >>> ground = terrain("stones", amplitude=0.03, seed=1)
    >>> float(ground.height(0.0, 0.0))
    0.0

A new kind of ground goes into `families/`; `add_to_spec` draws a terrain into a MuJoCo model.
"""

from wbc.sim.terrain.clearance import ClearanceWarning, check_clearance
from wbc.sim.terrain.families import fields, image, obstacles, patchwork, paving, stairs, stones  # noqa: F401 - registers the families
from wbc.sim.terrain.families.base import Family, FieldFamily, ShapeFamily, family, param, terrain_families
from wbc.sim.terrain.families.site import Site
from wbc.sim.terrain.families.solids import bar, dome, plate, stone
from wbc.sim.terrain.ground import Ground
from wbc.sim.terrain.heightmap import HeightMap
from wbc.sim.terrain.render import AddedTerrain, GroundContact, add_to_spec
from wbc.sim.terrain.spec import Rendering, Terrain, terrain

__all__ = [
    # Grounds by name
    "terrain",
    "terrain_families",
    "Terrain",
    "Rendering",
    # Clearance of the swing foot
    "check_clearance",
    "ClearanceWarning",
    # In a MuJoCo model
    "add_to_spec",
    "AddedTerrain",
    "GroundContact",
    # A family of your own
    "family",
    "param",
    "Family",
    "FieldFamily",
    "ShapeFamily",
    "Site",
    "bar",
    "dome",
    "plate",
    "stone",
    # The surface
    "Ground",
    "HeightMap",
]
