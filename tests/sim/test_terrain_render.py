"""Grounds in MuJoCo: rays and contacts meet the surface that the height query describes."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from wbc.core.errors import Array, InputError
from wbc.sim.terrain.families.base import terrain_families
from wbc.sim.terrain.render import AddedTerrain, GroundContact, add_to_spec
from wbc.sim.terrain.spec import Terrain, terrain

NAMES = [n for n in terrain_families() if n != "image"]


def _image() -> Terrain:
    grey = np.random.default_rng(5).uniform(0, 1, (60, 200))
    return terrain("image", 0.03, source=grey, metres_per_pixel=0.01)


GROUNDS = [replace(terrain(n, seed=1), rendering=r) for n in NAMES for r in ("auto", "height_field")]
GROUNDS += [_image(), terrain("iso8608", 0.04, 1, isotropic=True), terrain("slats", 0.12, 2, tilt=0.1)]
GROUNDS += [terrain("cylinder_obstacles", 0.08, 1), terrain("roof_tiles", 0.08, 1, rising=False)]


def _compile(t: Terrain, **options: object) -> tuple[mujoco.MjModel, mujoco.MjData, AddedTerrain]:
    spec = mujoco.MjSpec()
    added = add_to_spec(spec, t, **options)  # type: ignore[arg-type]
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data, added


def _cast(model: mujoco.MjModel, data: mujoco.MjData, added: AddedTerrain, x: Array, y: Array) -> Array:
    """Height found by vertical rays; infinite where a ray is lost."""
    z = np.full(x.shape, np.inf)
    geom, down = np.zeros(1, dtype=np.int32), np.array([0.0, 0.0, -1.0])
    for i in range(x.size):
        distance = mujoco.mj_ray(
            model, data, np.array([x[i], y[i], 0.5]), down, added.ray_groups, 1, -1, geom
        )
        if distance >= 0.0:
            z[i] = 0.5 - distance
    return z


@pytest.mark.parametrize("t", GROUNDS, ids=lambda t: f"{t.name}-{t.rendering}-{1e3 * t.amplitude:.0f}")
def test_3000_random_rays_find_the_height(t: Terrain) -> None:
    rng = np.random.default_rng(0)
    x0, x1, y0, y1 = t.extent
    x, y = rng.uniform(x0 - 0.1, x1 + 0.1, 3000), rng.uniform(y0 - 0.1, y1 + 0.1, 3000)
    model, data, added = _compile(t)
    found = _cast(model, data, added, x, y)
    assert np.isfinite(found).all()
    # 0.1 mm is asked for; single precision of height fields and meshes is all that is lost.
    assert np.abs(found - added.terrain.height(x, y)).max() < 1e-7


@pytest.mark.parametrize("name", ["random", "iso8608", "metal_sheets", "stones"])
def test_rays_a_micrometre_beside_grid_lines_are_not_lost(name: str) -> None:
    t = terrain(name, seed=2, rendering="height_field")
    model, data, added = _compile(t)
    field = t.surface.field
    assert field is not None
    rng = np.random.default_rng(1)
    columns = np.linspace(field.x0, field.x1, field.z.shape[1])
    x = columns[rng.integers(0, columns.size - 1, 3000)] + 1e-6
    y = np.where(rng.uniform(size=3000) < 0.5, 0.07, rng.uniform(-0.3, 0.3, 3000)) + 1e-6
    assert np.abs(_cast(model, data, added, x, y) - t.height(x, y)).max() < 1e-6


@pytest.mark.parametrize(
    "t", GROUNDS[::2] + GROUNDS[1::6], ids=lambda t: f"{t.name}-{t.rendering}-{1e3 * t.amplitude:.0f}"
)
def test_contacts_lie_on_the_surface(t: Terrain) -> None:
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


def test_all_geoms_share_group_and_contact_parameters() -> None:
    contact = GroundContact(friction=0.5, solref=(0.002, 1.0), priority=0)
    for t in (terrain("sticks"), terrain("pyramidal_stones"), terrain("random")):
        model, _, added = _compile(t, contact=contact, group=4)
        assert model.ngeom == len(added.geoms) and (model.geom_group == 4).all()
        np.testing.assert_allclose(model.geom_friction[:, 0], 0.5)
        np.testing.assert_allclose(model.geom_solref, [[0.002, 1.0]] * model.ngeom)
        np.testing.assert_allclose(model.geom_solimp[:, :2], 0.99)
        assert model.body_mass.sum() == 0.0


def test_unidirectional_grounds_take_few_cells_across() -> None:
    for name in ("random", "iso8608", "metal_sheets"):
        model, _, _ = _compile(terrain(name))
        assert 2 <= model.hfield_nrow[0] - 1 <= 5


def test_rendering_can_be_chosen_when_drawing() -> None:
    t = terrain("stone_bricks", seed=1)
    _, _, solid = _compile(t)
    _, _, field = _compile(replace(t, rendering="height_field", resolution=0.003))
    assert (solid.height_field, field.height_field) == (None, "terrain_field")
    assert solid.nodes == 0 and field.nodes == 1001 * 335


def test_nothing_is_added_before_all_is_checked() -> None:
    field = terrain("stones", rendering="height_field", resolution=0.006)
    for options in ({"group": 6}, {"sole_radius": 0.005}):
        spec = mujoco.MjSpec()
        with pytest.raises(InputError):
            add_to_spec(spec, field, **options)  # type: ignore[arg-type]
        assert not spec.worldbody.geoms and not spec.hfields
    spec = mujoco.MjSpec()
    add_to_spec(spec, terrain("stones"))
    with pytest.raises(InputError, match="already"):
        add_to_spec(spec, terrain("stones"))
