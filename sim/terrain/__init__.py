"""Grounds to walk on: named families of rough terrain with one height query for simulation, tests and pictures.

    >>> ground = terrain("stones", amplitude=0.03, seed=1)
    >>> float(ground.height(0.0, 0.0))
    0.0

`wbc.sim.terrain.render.add_to_spec` draws a terrain into a MuJoCo model; nothing else here needs MuJoCo.
"""

from wbc.sim.terrain.checks import ClearanceWarning, check_clearance
from wbc.sim.terrain.families import fields, image, obstacles, paving, stairs, stones  # noqa: F401 - registers the families
from wbc.sim.terrain.families.base import Family, FieldFamily, ShapeFamily, family, param, terrain_families
from wbc.sim.terrain.families.site import Site
from wbc.sim.terrain.ground import Ground
from wbc.sim.terrain.heightmap import HeightMap
from wbc.sim.terrain.spec import Rendering, Terrain, terrain

__all__ = [
    "ClearanceWarning",
    "Family",
    "FieldFamily",
    "Ground",
    "HeightMap",
    "Rendering",
    "ShapeFamily",
    "Site",
    "Terrain",
    "check_clearance",
    "terrain_families",
    "family",
    "param",
    "terrain",
]
