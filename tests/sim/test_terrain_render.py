"""Grounds in MuJoCo: rays and contacts meet the surface that the height query describes."""

import mujoco
import numpy as np
import pytest
from properties import by_default

from wbc.base.numbers import Array
from wbc.sim.terrain.families.base import terrain_families
from wbc.sim.terrain.render import TERRAIN_GROUP, add_to_spec
from wbc.sim.terrain.spec import Terrain, terrain

NAMES = [n for n in terrain_families() if n != "image"]


def _image() -> Terrain:
    grey = np.random.default_rng(5).uniform(0, 1, (60, 200))
    return terrain("image", 0.03, source=grey, metres_per_pixel=0.01)


GROUNDS = [terrain(n, seed=1) for n in NAMES]
GROUNDS += [_image(), terrain("iso8608", 0.04, 1, isotropic=True), terrain("slats", 0.12, 2, tilt=0.1)]
GROUNDS += [terrain("cylinder_obstacles", 0.08, 1), terrain("roof_tiles", 0.08, 1, rising=False)]


KINDS_OF_SURFACE = [
    "random-30",  # the same across
    "iso8608-40",  # in all directions
    "image-30",
    "slats-120",  # tilted boxes
    "cylinder_obstacles-80",  # capsules
    "stones-30",  # ellipsoids
    "pyramidal_stones-30",
    "cobble_stones-30",  # spheres
    "roof_tiles-80",  # cylinders
]
"""Grounds of which each is made of something else: by default these alone are touched and hit by rays."""


def _name(t: Terrain) -> str:
    return f"{t.name}-{1e3 * t.amplitude:.0f}"


BY_NAME = {_name(t): t for t in GROUNDS}
grounds = pytest.mark.parametrize("name", by_default(BY_NAME, *KINDS_OF_SURFACE))


def _cast(t: Terrain, x: Array, y: Array) -> Array:
    """Height found by vertical rays; infinite where a ray is lost."""
    spec = mujoco.MjSpec()
    assert add_to_spec(spec, t) == t
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert (model.geom_group == TERRAIN_GROUP).all() and model.body_mass.sum() == 0.0
    z = np.full(x.shape, np.inf)
    geom, down = np.zeros(1, dtype=np.int32), np.array([0.0, 0.0, -1.0])
    groups = (np.arange(6) == TERRAIN_GROUP).astype(np.uint8)
    for i in range(x.size):
        distance = mujoco.mj_ray(model, data, np.array([x[i], y[i], 0.5]), down, groups, 1, -1, geom)
        if distance >= 0.0:
            z[i] = 0.5 - distance
    return z


@grounds
def test_random_rays_find_the_height(name: str) -> None:
    t = BY_NAME[name]
    rng = np.random.default_rng(0)
    x0, x1, y0, y1 = t.extent
    x, y = rng.uniform(x0 - 0.1, x1 + 0.1, 1500), rng.uniform(y0 - 0.1, y1 + 0.1, 1500)
    # 0.1 mm is asked for; single precision of height fields and meshes is all that is lost.
    assert np.abs(_cast(t, x, y) - t.height(x, y)).max() < 1e-7


@pytest.mark.parametrize("name", ["random", "iso8608", "metal_sheets"])
def test_rays_a_micrometre_beside_grid_lines_are_not_lost(name: str) -> None:
    t = terrain(name, seed=2)
    field = t.surface.field
    assert field is not None
    assert (field.z.shape[0] < 6) is t.parameters.unidirectional, "the same across takes few cells"
    rng = np.random.default_rng(1)
    columns = np.linspace(field.x0, field.x1, field.z.shape[1])
    x = columns[rng.integers(0, columns.size - 1, 3000)] + 1e-6
    y = np.where(rng.uniform(size=3000) < 0.5, 0.07, rng.uniform(-0.3, 0.3, 3000)) + 1e-6
    assert np.abs(_cast(t, x, y) - t.height(x, y)).max() < 1e-6


@grounds
def test_contacts_lie_on_the_surface(name: str) -> None:
    t = BY_NAME[name]
    radius, depth = 0.002, 1e-4
    rng = np.random.default_rng(3)
    x, y = rng.uniform(t.start, t.stop, 150), rng.uniform(-t.width / 2 + 0.01, t.width / 2 - 0.01, 150)
    spec = mujoco.MjSpec()
    add_to_spec(spec, t)
    ball = spec.worldbody.add_body(name="ball")
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0, 0], mass=0.01)
    model = spec.compile()
    data = mujoco.MjData(model)
    n = t.normal(x, y)
    centres = np.stack([x, y, t.height(x, y)], axis=-1) + n * (radius - depth)
    good = 0
    for centre, normal in zip(centres, n, strict=True):
        data.qpos[:3] = centre
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        met = [abs(c.dist + depth) < 1e-5 and abs(abs(c.frame[:3] @ normal) - 1) < 1e-3 for c in data.contact]
        good += any(met)
    # The rest touch a second face, in a corner, or slip beside an edge.
    assert good >= 0.95 * x.size
