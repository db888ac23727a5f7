"""Grounds in MuJoCo: rays and contacts meet the surface that the height query describes."""

from typing import Any

import mujoco
import numpy as np
import pytest
from matplotlib.figure import Figure
from properties import by_default
from scipy.spatial.transform import Rotation

from wbc.base.numbers import Array
from wbc.feet.sensing.roughness import PARAMETERS, UNITS
from wbc.sim.terrain import plot
from wbc.sim.terrain.families.base import terrain_families
from wbc.sim.terrain.plot import _draw_map, _number, example_terrain, plot_families, plot_terrain
from wbc.sim.terrain.render import TERRAIN_GROUP, _geom, add_to_spec
from wbc.sim.terrain.shapes import Box, Capsule, Cylinder, Ellipsoid, Pyramid, Shape, ball, lowered
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


def _solids(seed: int) -> list[Shape]:
    """One solid of each kind, turned at random, around (0.1, -0.2, 0.05) m."""
    rng = np.random.default_rng(seed)
    turn, place = Rotation.random(rng=rng).as_matrix(), np.array([0.1, -0.2, 0.05])
    a, b, c = rng.uniform(0.02, 0.2, 3)
    half = turn @ [0.0, b, 0.0]
    return [
        ball(place, a),
        Ellipsoid(place, np.array([a, b, c]), turn),
        Capsule(place - half, place + half, c),
        Cylinder(place - half, place + half, c),
        Box(place, np.array([a, b, c]), turn),
        Pyramid(place + [0.0, 0.0, c], 0.05, 2.0 * a, float(rng.uniform(0.0, 3.0)), depth=0.03),
    ]


@pytest.mark.parametrize("seed", range(2))
def test_a_solid_is_as_high_and_as_wide_as_mujoco_has_it(seed: int) -> None:
    """Top by vertical rays; footprint and peak are those of the densest grid of tops; lowered it is all that lower."""
    for shape in _solids(seed):
        x0, x1, y0, y1 = shape.box
        x, y = np.meshgrid(np.linspace(x0 - 0.01, x1 + 0.01, 201), np.linspace(y0 - 0.01, y1 + 0.01, 201))
        x, y = x.ravel(), y.ravel()
        z, peak = shape.top(x, y), shape.peak
        hit, cell = np.isfinite(z), 1.5 * max(x1 - x0 + 0.02, y1 - y0 + 0.02) / 200
        edges = np.array([x[hit].min(), x[hit].max(), y[hit].min(), y[hit].max()])
        inwards = np.array([1.0, -1.0, 1.0, -1.0]) * (edges - shape.box)
        assert (inwards > -1e-9).all() and (inwards < 8.0 * cell).all(), type(shape)
        assert z[hit].max() <= peak[2] + 1e-9
        near = np.hypot(x - peak[0], y - peak[1]) < 2.0 * cell
        assert z[near].max() > peak[2] - 6.0 * cell, type(shape)
        assert x0 - 1e-9 <= peak[0] <= x1 + 1e-9 and y0 - 1e-9 <= peak[1] <= y1 + 1e-9
        down = lowered(shape, 0.37)
        np.testing.assert_allclose(down.top(x, y)[hit], z[hit] - 0.37, atol=1e-9)
        np.testing.assert_allclose(down.peak, peak - [0.0, 0.0, 0.37])
        spec = mujoco.MjSpec()
        spec.worldbody.add_geom(**_geom(spec, "solid", shape, np.zeros(3)))
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        some = np.random.default_rng(seed).choice(x.size, 200, replace=False)
        geom = np.zeros(1, dtype=np.int32)
        for i in some:
            far = mujoco.mj_ray(
                model, data, np.array([x[i], y[i], 2.0]), np.array([0.0, 0.0, -1.0]), None, 1, -1, geom
            )
            if far >= 0.0 or z[i] > -np.inf:
                assert 2.0 - far == pytest.approx(float(z[i]), abs=1e-6), type(shape)


@pytest.mark.parametrize("name", ["random", "iso8608"])
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
    x, y = rng.uniform(t.start, t.stop, 80), rng.uniform(-t.width / 2 + 0.01, t.width / 2 - 0.01, 80)
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


def test_a_map_shows_the_height_at_the_middle_of_each_of_its_pixels() -> None:
    ground = terrain("steps", 0.06, riser=0.03, direction="up", length=1.0)
    box = (-0.2, 1.4, -0.4, 0.4)
    figure = Figure()
    image = _draw_map(figure.subplots(), ground, box)
    shown = np.asarray(image.get_array())
    rows, columns = shown.shape
    assert (columns, rows) == (400, 200)  # of 4 mm
    x0, x1, y0, y1 = image.get_extent()
    assert (x0, x1, y0, y1) == box and image.origin == "lower"
    x, y = x0 + (np.arange(columns) + 0.5) * 0.004, y0 + (np.arange(rows) + 0.5) * 0.004
    np.testing.assert_allclose(shown, 1e3 * ground.height(x[None, :], y[:, None]), atol=1e-9)
    assert image.get_clim()[0] < shown.min() - 0.5 * np.ptp(shown)
    assert (_number("Sa", "m", 0.0123), _number("M", "m2", 2e-6)) == ("Sa 12.3 mm", "M 2 mm²")


def test_pictures_of_grounds_have_their_profiles_extents_and_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Heights in mm along y = 0 from strip to strip; of each family the first two metres, four side by side."""
    drawn: list[Any] = []
    monkeypatch.setattr(plot, "save_figure", lambda figure, path, dpi: drawn.append(figure))
    ground = terrain("steps", 0.06, seed=3, direction="up")
    plot_terrain(ground, "one.svg")
    top, below, _ = drawn[0].axes
    assert tuple(top.get_images()[0].get_extent()) == ground.extent
    x, z = (np.asarray(values) for values in below.get_lines()[0].get_data())
    assert (x[0], x[-1]) == pytest.approx(ground.extent[:2]) and np.diff(x) == pytest.approx(0.001)
    np.testing.assert_allclose(z, 1e3 * ground.height(x, 0.0), atol=1e-9)
    title = below.get_title()
    for name, unit, value in zip(PARAMETERS, UNITS, ground.roughness().values, strict=True):
        assert _number(name, unit, value) in title
    names = list(terrain_families())
    assert [example_terrain(name).name for name in names] == names
    monkeypatch.setattr(plot, "terrain_families", lambda: dict.fromkeys(names[:5]))
    assert plot_families("all.svg") == 5
    for ax, name in zip(drawn[1].axes, names[:5], strict=False):
        shown = example_terrain(name)
        extent = (shown.start - 0.1, shown.start + 2.0, *shown.extent[2:])
        assert shown.name in ax.get_title() and ax.get_images()[0].get_extent() == pytest.approx(extent)


def test_areas_are_drawn_on_their_highest_point_and_touch_nothing() -> None:
    """A millimetre thick, in the colour of their property, as wide as the ground where no side is given."""
    for name, top in (("flat", 0.0), ("stones", 0.03)):
        areas = (0.5, 1.25, None, None, "friction", 0.2, 2.0, None, -0.2, 0.1, "stiffness", 1e7)
        ground = terrain(name, areas=areas)
        spec = mujoco.MjSpec()
        add_to_spec(spec, ground)
        model, bare = spec.compile(), mujoco.MjSpec()
        add_to_spec(bare, terrain(name))
        x0, x1, right, left = ground.extent
        assert left - right == pytest.approx(1.0)
        sides = ((0.5, 1.25, right, left), (2.0, x1, -0.2, 0.1))
        for k, (a, b, c, d) in enumerate(sides):
            geom = model.geom(f"terrain_area_{k}")
            assert geom.size == pytest.approx([0.5 * (b - a), 0.5 * (d - c), 0.0005])
            assert geom.pos[:2] == pytest.approx([0.5 * (a + b), 0.5 * (c + d)])
            assert 0.6 * top <= geom.pos[2] <= top
            assert geom.contype == geom.conaffinity == 0 and geom.group == 1
        ice, foam = (model.geom(f"terrain_area_{k}").rgba for k in range(2))
        assert TERRAIN_GROUP != 1 and ice[2] > ice[0] and foam[0] > foam[2]
        assert model.body_mass.sum() == 0.0 and model.ngeom == bare.compile().ngeom + 2


def test_a_field_is_drawn_between_its_lowest_and_highest_height() -> None:
    spec = mujoco.MjSpec()
    field = add_to_spec(spec, _image()).surface.field
    assert field is not None
    model, low, high = spec.compile(), float(field.z.min()), float(field.z.max())
    geom = model.geom("terrain_field")
    wide = [(field.x1 - field.x0) / 2.0, (field.y1 - field.y0) / 2.0]
    assert model.hfield_size[0] == pytest.approx([*wide, high - low, model.hfield_size[0, 3]])
    assert geom.pos == pytest.approx([(field.x0 + field.x1) / 2.0, (field.y0 + field.y1) / 2.0, low])
    assert [int(model.hfield_nrow[0]), int(model.hfield_ncol[0])] == list(field.z.shape)
    np.testing.assert_allclose(
        model.hfield_data.reshape(field.z.shape), (field.z - low) / (high - low), atol=1e-6
    )
    assert model.body_mass.sum() == 0.0
