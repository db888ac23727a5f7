"""Grounds: amplitude, seeds, strips and what each family promises."""

import math
import pickle
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import by_default, examples

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.sim.terrain.families.base import Family, FieldFamily, terrain_families
from wbc.sim.terrain.families.fields import low_pass
from wbc.sim.terrain.families.patchwork import stretches
from wbc.sim.terrain.families.site import Draws, Site, cells, centred
from wbc.sim.terrain.shapes import bar, dome, footprint_margin, plate, stone
from wbc.sim.terrain.spec import Terrain, terrain

NAMES = [n for n in terrain_families() if n not in ("flat", "image")]


def _inside(t: Terrain, count: int, seed: int = 0) -> tuple[Array, Array]:
    """Draw random points of the rough part."""
    rng = np.random.default_rng(seed)
    half = t.width / 2
    return rng.uniform(t.start, t.stop, count), rng.uniform(-half, half, count)


def _peaks(t: Terrain) -> Array:
    """Points just inside the footprint, below the highest points of all solids; or the nodes of the map."""
    field = t.surface.field
    if field is not None:
        xs = np.linspace(field.x0, field.x1, field.z.shape[1])
        ys = np.linspace(field.y0, field.y1, field.z.shape[0])
        return np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    peaks = np.array([s.peak[:2] for s in t.surface.shapes])
    middles = np.array([[(s.box[0] + s.box[1]) / 2, (s.box[2] + s.box[3]) / 2] for s in t.surface.shapes])
    return peaks + 1e-9 * (middles - peaks)


ALIKE = ("ellipsoids", "floor_tiles", "large_floor_tiles", "small_stones", "stone_bricks")
"""Families of solids of which another family is made, too."""


@pytest.mark.parametrize("name", by_default(NAMES, *(name for name in NAMES if name not in ALIKE)))
@examples(2)
@given(seed=st.integers(0, 2**40), share=st.floats(0.05, 1.0))
def test_amplitude_is_highest_minus_lowest_point(name: str, seed: int, share: float) -> None:
    t = terrain(name, amplitude=share * terrain(name).amplitude, seed=seed, ramp=0.0)
    x, y = _inside(t, 1000)
    # The stop strip of a climb meets the rough part's end; the very edge belongs to the rough part.
    x = np.append(np.append(x, _peaks(t)[:, 0]), t.stop - 1e-12)
    y = np.append(np.append(y, _peaks(t)[:, 1]), 0.0)
    z = t.height(x, y)
    assert z.max() - z.min() == pytest.approx(t.amplitude, abs=1e-7)
    floor = t.surface.floor if t.surface.field is None else float(t.surface.field.z.min())
    assert z.max() <= floor + t.amplitude + 1e-12
    assert z.min() >= floor - 1e-12


def _layouts(ground: Terrain, seeds: int) -> Array:
    """Heights of the layouts of some seeds at the same places, about their mean, shape (seeds, places)."""
    x = np.linspace(ground.start + 0.05, ground.stop - 0.05, 60)[None, :]
    y = np.array([-0.3, -0.1, 0.12, 0.33])[:, None]
    heights = np.array([replace(ground, seed=s).height(x, y).ravel() for s in range(seeds)])
    centred: Array = heights - heights.mean(axis=0)
    return centred / np.linalg.norm(centred)


RANDOM_CUTOFFS = [{"cutoff": 0.02}, {"cutoff": 0.0102}]


@pytest.mark.parametrize("name", ["patchwork", "random"])
def test_layouts_of_one_seed_are_independent_between_amplitudes_parameters_and_seeds(name: str) -> None:
    """Over many seeds, as two single random walks may look alike by chance."""
    usual = terrain(name)
    many = 100 if usual.parameters.unidirectional else 10
    others = [replace(usual, amplitude=0.999 * usual.amplitude)]
    others += [terrain("random", **cutoff) for cutoff in RANDOM_CUTOFFS] if name == "random" else []
    layouts = _layouts(usual, many)
    for other in others:
        assert abs((layouts * _layouts(other, many)).sum()) < 0.2
    assert abs((layouts * np.roll(layouts, 1, axis=0)).sum()) < 0.2


@pytest.mark.parametrize("name", [*NAMES, "flat"])
def test_starts_and_stops_on_flat_strips(name: str) -> None:
    t = terrain(name, seed=2, **({"isotropic": True} if name == "iso8608" else {}))
    y = np.linspace(-t.width / 2, t.width / 2, 9)[:, None]
    before = t.height(np.linspace(t.start - t.strip, t.start - 1e-9, 50), y)
    after = t.height(np.linspace(t.stop + 1e-9, t.stop + t.strip, 50), y)
    np.testing.assert_allclose(before, 0.0, atol=1e-12)
    np.testing.assert_allclose(after, after[0, 0], atol=1e-12)
    np.testing.assert_allclose(t.normal(t.start - 0.1, 0.0), [0, 0, 1])
    assert t.start > 0.2  # the robot's toes, 0.17 m ahead of its ankles, are on the strip at x = 0


def moments(t: Terrain) -> list[float]:
    """Return mean and deviation of the heights on a grid, and means weighted along and across the track, mm."""
    x0, x1, y0, y1 = t.extent
    x, y = (np.arange(400) + 0.3183) / 400, (np.arange(100) + 0.3183) / 100  # off the edges
    z = 1e3 * t.height(x0 + (x1 - x0) * x[None, :], y0 + (y1 - y0) * y[:, None])
    return [float(value) for value in (z.mean(), z.std(), (z * x).mean(), (z.T * y).mean())]


MOMENTS = {
    "boards": (3.291, 8.938, 1.949, 1.546),
    "cobble_stones": (5.406, 7.905, 2.701, 2.680),
    "cylinder_obstacles": (0.728, 3.701, 0.375, 0.363),
    "ellipsoids": (4.356, 7.812, 2.167, 2.176),
    "flat": (0.000, 0.000, 0.000, 0.000),
    "floor_tiles": (3.565, 5.749, 1.777, 1.757),
    "iso8608": (-11.172, 7.348, -6.496, -5.566),
    "large_floor_tiles": (8.165, 9.452, 4.179, 3.999),
    "metal_sheets": (-9.913, 8.295, -6.543, -4.939),
    "patchwork": (4.510, 10.440, 2.261, 2.199),
    "pyramidal_stones": (0.041, 0.655, 0.016, 0.025),
    "random": (6.952, 6.670, 5.034, 3.463),
    "roof_tiles": (4.567, 6.615, 2.300, 2.254),
    "slats": (-24.663, 23.734, -12.313, -12.259),
    "slope": (36.000, 38.781, 18.000, 17.935),
    "small_stones": (1.629, 3.971, 0.818, 0.812),
    "steps": (21.600, 32.333, 10.790, 10.761),
    "sticks": (1.287, 5.234, 0.609, 0.692),
    "stone_bricks": (9.802, 10.361, 4.901, 4.884),
    "stones": (4.209, 7.629, 2.127, 2.082),
}
"""Moments of every family with a sharp edge and seed 1: studies of different machines walk on the same grounds."""


@pytest.mark.parametrize("name", [*NAMES, "flat"])
def test_the_ground_is_the_same_on_every_machine(name: str) -> None:
    """Within 2 µm: a point of 40,000 at an edge of 40 mm may fall on either side."""
    sharp = terrain(name, seed=1, ramp=0.0)
    np.testing.assert_allclose(moments(sharp), MOMENTS[name], rtol=0.0, atol=2e-3)


@pytest.mark.parametrize("name", ["pyramidal_stones", "random", "slats", "stones"])
def test_heights_grow_along_the_ramp_and_are_those_of_the_family_behind_it(name: str) -> None:
    y = np.linspace(-0.4, 0.4, 41)[:, None]
    at_once, at_last = 0.0, 0.0
    for seed in range(2):
        ramped, sharp = terrain(name, seed=seed), terrain(name, seed=seed, ramp=0.0)
        near = np.linspace(ramped.start, ramped.start + 0.1, 40)
        behind = np.linspace(ramped.start + 1.0, ramped.stop, 400)
        np.testing.assert_array_equal(ramped.height(behind, y), sharp.height(behind, y))
        floor = sharp.surface.floor if sharp.surface.field is None else -np.inf  # a pit stays as deep
        at_once += np.abs(np.where(sharp.height(near, y) == floor, 0.0, sharp.height(near, y))).mean()
        at_last += np.abs(np.where(ramped.height(near, y) == floor, 0.0, ramped.height(near, y))).mean()
    assert at_last <= 0.5 * at_once


def test_heights_of_a_field_grow_in_proportion_over_the_length_of_the_ramp() -> None:
    length = 0.4
    ramped, sharp = terrain("random", seed=1, ramp=length), terrain("random", seed=1, ramp=0.0)
    field = ramped.surface.field
    x = np.linspace(field.x0, field.x1, field.z.shape[1])
    share = np.clip((x - ramped.start) / length, 0.0, 1.0)
    np.testing.assert_allclose(field.z, sharp.surface.field.z * share, atol=1e-12)


def test_equal_terrains_are_one_key_and_survive_a_pickle() -> None:
    a, b = terrain("stones", 0.03, 5, density=70.0), terrain("stones", 0.03, 5, density=70.0)
    assert a == b and hash(a) == hash(b) and len({a, b, terrain("stones", 0.03, 6)}) == 2
    a.height(1.0, 0.0)
    sent = pickle.dumps(a)
    assert len(sent) < 1000
    back = pickle.loads(sent)
    assert back == a and back.height(1.0, 0.1) == a.height(1.0, 0.1)


@pytest.mark.parametrize("cutoff", [1e-3, 0.5])
def test_low_pass_has_half_power_at_its_cutoff(cutoff: float) -> None:
    impulse = np.zeros(1 << 15)
    impulse[0] = 1.0
    gain = np.abs(np.fft.rfft(low_pass(impulse, cutoff)))
    share = np.linspace(0.0, 1.0, gain.size)
    assert gain[0] == pytest.approx(1.0, abs=1e-9)
    assert np.interp(cutoff, share, gain) == pytest.approx(math.sqrt(0.5), abs=1e-3)
    assert gain[-1] < 1e-3


def test_iso_ground_has_the_spectrum_it_reports() -> None:
    low, high, ratios, spectra = 0.5, 8.0, [], []
    for seed in range(40):
        t = terrain("iso8608", 0.03, seed, low=low, high=high, length=10.0)
        gd = t.parameters.facts(t.site())["gd_n0_m3"]
        _, z = t.profile(step=0.01)
        ratios.append(
            z.var() / (gd * 0.01 * (1 / low - 1 / high))
        )  # variance: integral of Gd(n0) (n0/n)^2 dn
        spectra.append(np.abs(np.fft.rfft((z - z.mean()) * np.hanning(z.size))) ** 2)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.1)
    power, n = np.mean(spectra, axis=0), np.fft.rfftfreq(z.size, 0.01)
    band = (n > 0.8) & (n < 7.0)
    assert np.polyfit(np.log(n[band]), np.log(power[band]), 1)[0] == pytest.approx(-2.0, abs=0.2)
    assert power[n > 10.0].max() < 1e-3 * power[band].max()


@pytest.mark.parametrize("direction", ["up", "down", "up_down"])
@given(
    amplitude=st.floats(0.02, 0.3),
    riser=st.floats(0.02, 0.2),
    tread=st.floats(0.1, 0.3),
    landing=st.floats(0.3, 1.0),
    start=st.floats(-2.0, 2.0),
)
@examples(10)
def test_stairs_climb_in_the_middle_of_their_track(
    direction: str, amplitude: float, riser: float, tread: float, landing: float, start: float
) -> None:
    """The fewest risers that are no higher than asked for; of the treads between them each is one riser higher."""
    n = math.ceil(amplitude / riser - 1e-9)
    run = (n - 1) * tread
    needed = 2.0 * run + landing if direction == "up_down" else run
    values = {"riser": riser, "tread": tread, "landing": landing, "start": start}
    t = terrain("steps", amplitude, direction=direction, length=math.ceil(needed) + 1.0, **values)
    x = np.linspace(t.start - 0.2, t.stop + 0.2, 400) + 1e-7
    along = x - (t.start + 0.5 * (t.length - needed))
    up = np.clip(np.floor(along / tread) + 1.0, 0.0, n) * amplitude / n
    if direction == "up_down":
        down = np.clip(np.floor((needed - along) / tread) + 1.0, 0.0, n) * amplitude / n
        up = np.minimum(up, down)
    np.testing.assert_allclose(t.height(x, 0.3), -up if direction == "down" else up, atol=1e-9)
    rise = {"up": amplitude, "down": -amplitude, "up_down": 0.0}[direction]
    assert t.height(t.stop + 0.5, 0.0) == pytest.approx(rise, abs=1e-12)
    assert t.parameters.rise_at(amplitude) == pytest.approx(amplitude / n)
    assert t.parameters.facts(t.site()) == {"risers": n, "riser_m": pytest.approx(amplitude / n)}
    with pytest.raises(InputError):
        replace(t, length=needed - 1e-6).height(0.0, 0.0)


@pytest.mark.parametrize("direction", ["up", "down", "up_down"])
def test_a_slope_rises_evenly_over_its_run(direction: str) -> None:
    for amplitude, length, landing in ((0.2, 3.0, 0.6), (0.05, 1.4, 1.0)):
        t = terrain("slope", amplitude, direction=direction, length=length, landing=landing)
        run = 0.5 * (length - landing) if direction == "up_down" else length
        x = np.linspace(t.start - 0.3, t.stop + 0.3, 300) + 1e-7
        up = np.clip((x - t.start) / run, 0.0, 1.0)
        if direction == "up_down":
            up = np.minimum(up, np.clip((t.stop - x) / run, 0.0, 1.0))
        np.testing.assert_allclose(
            t.height(x, -0.2), (-1.0 if direction == "down" else 1.0) * amplitude * up, atol=1e-6
        )
        assert t.describe()["angle_rad"] == pytest.approx(math.atan(amplitude / run))
    with pytest.raises(InputError):
        terrain("slope", 0.1, length=0.6, landing=0.6)


def test_a_patchwork_is_what_its_stretches_say() -> None:
    """Each stretch is as high as its family is to be, and its solids are those of the family."""
    ground = terrain("patchwork", 0.04, 3, families="boards:0.5 stones roof_tiles", length=3.0, ramp=0.0)
    found = stretches(ground)
    assert [round(end - begin, 9) for _, begin, end in found] == [0.6] * 5
    assert all(a != b for (a, *_), (b, *_) in pairwise(found))
    y = np.linspace(-0.49, 0.49, 99)[:, None]
    for name, begin, end in found:
        peak = max(float(s.peak[2]) for s in ground.surface.shapes if begin <= s.peak[0] <= end)
        assert peak == pytest.approx(0.02 if name == "boards" else 0.04, abs=1e-9)
        kinds = {type(s).__name__ for s in ground.surface.shapes if begin <= s.peak[0] <= end}
        assert len(kinds) == 1
        assert ground.height(np.linspace(begin, end, 200), y).max() <= peak + 1e-9
    orders = {tuple(name for name, *_ in stretches(replace(ground, seed=s))) for s in range(10)}
    assert len(orders) > 5
    assert stretches(terrain("stones", seed=1)) == [("stones", 0.3, 3.3)]


# --- solids and places ------------------------------------------------------------------------------------------------

metres = st.floats(0.02, 0.3)
turns = st.floats(-3.0, 3.0)


def _over(shapes: list, x: Array, y: Array) -> Array:
    """Height of some solids over a floor at 0, at places, m."""
    tops: Array = np.max([np.broadcast_to(shape.top(x, y), x.shape) for shape in shapes], axis=0)
    return np.maximum(tops, 0.0)


@given(metres, metres, metres, turns)
@examples(30)
def test_round_stones_have_the_place_width_and_height_that_is_asked_for(
    a: float, b: float, top: float, yaw: float
) -> None:
    """A dome has the section of a circle through its edges and its top, or of an ellipse where it is higher."""
    r = np.linspace(0.0, a * 0.999, 30)
    if top <= a:
        ball = (a * a + top * top) / (2.0 * top)
        section = np.sqrt(ball**2 - r**2) - (ball - top)
    else:
        section = top * np.sqrt(1.0 - (r / a) ** 2)
    for angle in (0.3, 2.0):
        x, y = 0.4 + r * math.cos(angle), -0.2 + r * math.sin(angle)
        np.testing.assert_allclose(_over([dome(0.4, -0.2, a, top)], x, y), section, atol=1e-7)
    c, s = math.cos(yaw), math.sin(yaw)
    for share, angle in ((0.5, 0.4), (0.9, 2.5), (1.01, 1.0)):
        u, v = share * a * math.cos(angle), share * b * math.sin(angle)
        x, y = np.array([0.1 + c * u - s * v]), np.array([0.2 + s * u + c * v])
        height = top * math.sqrt(max(0.0, 1.0 - share**2))
        np.testing.assert_allclose(_over([stone(0.1, 0.2, (a, b), top, yaw)], x, y), height, atol=1e-9)


@given(metres, metres, st.floats(0.5, 1.5), turns)
@examples(30)
def test_a_bar_has_the_section_of_a_circle_over_its_whole_width(
    width: float, top: float, length: float, yaw: float
) -> None:
    """Up to half its width it is a segment of a circle, above a half circle on a rectangle; its ends are round."""
    shapes, half = bar(0.3, -0.1, length, yaw, width, top), width / 2.0
    across = np.linspace(-1.2, 1.2, 41) * half
    radius = (half * half + top * top) / (2.0 * top) if top <= half else half
    circle = np.sqrt(np.maximum(radius**2 - across**2, 0.0)) + top - radius
    section = np.where(np.abs(across) < half, np.maximum(circle, 0.0), 0.0)
    c, s = math.cos(yaw), math.sin(yaw)
    for along in (0.0, 0.9, -0.9):
        v = along * (length / 2.0 - half)
        x, y = 0.3 + c * across - s * v, -0.1 + s * across + c * v
        np.testing.assert_allclose(_over(shapes, x, y), section, atol=1e-6)
    # The segment of a flat bar is rounded at its ends, too, and by no more than its section.
    ends = np.array([-1.0, 1.0]) * (length / 2.0 - half + radius + 1e-6)
    np.testing.assert_allclose(_over(shapes, 0.3 - s * ends, -0.1 + c * ends), 0.0, atol=1e-9)


@given(metres, metres, metres, st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), turns)
@examples(30)
def test_a_plate_has_its_highest_corner_at_its_top_and_its_face_in_its_slope(
    a: float, b: float, top: float, slope_x: float, slope_y: float, yaw: float
) -> None:
    for thickness in (None, 0.02):
        made = plate(0.3, -0.1, (a, b), top, slope=(slope_x, slope_y), yaw=yaw, thickness=thickness)
        assert made.corners[:, 2].max() == pytest.approx(top)
        middle = float(made.top(np.array([0.3]), np.array([-0.1]))[0])
        dx, dy = 0.2 * min(a, b) * np.array([1.0, 0.0, -1.0]), 0.2 * min(a, b) * np.array([0.0, 1.0, -0.5])
        heights = made.top(0.3 + dx, -0.1 + dy)
        np.testing.assert_allclose(heights, middle + slope_x * dx + slope_y * dy, atol=1e-9)
        np.testing.assert_allclose(2.0 * made.half_size[:2], (a, b))
        if thickness is not None:
            assert 2.0 * made.half_size[2] == thickness
        else:
            lowest = np.sort(made.corners[:, 2])[:4]
            assert lowest.max() <= 1e-9 or slope_x or slope_y
            assert made.corners[:, 2].min() < 0.0


@given(metres, metres, turns)
@examples(20)
def test_the_margin_of_a_turned_footprint_is_that_of_its_corners(a: float, b: float, yaw: float) -> None:
    c, s = math.cos(yaw), math.sin(yaw)
    corners = np.array([[x * c - y * s, x * s + y * c] for x in (-a, a) for y in (-b, b)]) / 2.0
    np.testing.assert_allclose(footprint_margin((a, b), yaw), corners.max(axis=0))


@given(st.floats(0.0, 3.0), st.floats(0.01, 0.4))
@examples(30)
def test_places_are_as_many_as_fit_centred_and_cells_divide_evenly(extent: float, pitch: float) -> None:
    places = centred(-1.0, -1.0 + extent, pitch)
    assert places.mean() == pytest.approx(-1.0 + extent / 2.0, abs=1e-9)
    np.testing.assert_allclose(np.diff(places), pitch)
    assert np.ptp(places) <= extent + 1e-6 and np.ptp(places) + pitch > extent
    count = cells(extent + 0.01, pitch)
    assert (extent + 0.01) / count <= pitch * (1 + 1e-6)
    assert count == 1 or (extent + 0.01) / (count - 1) > pitch


@given(st.integers(0, 1000), st.floats(0.0, 0.1), st.floats(0.1, 0.3), st.floats(0.0, 0.4))
@examples(20)
def test_layouts_stay_in_the_rough_part_by_their_margin(
    seed: int, margin: float, pitch: float, jitter: float
) -> None:
    site = Site(1.0, 3.5, 1.2, 0.04, Draws(seed, "key"))
    assert (site.length, site.area) == pytest.approx((2.5, 3.0))
    x, y = np.array(list(site.scatter(500, margin))).T
    for values, low, high in ((x, 1.0, 3.5), (y, -0.6, 0.6)):
        assert low + margin <= values.min() < low + margin + 0.05 * (high - low)
        assert high - margin - 0.05 * (high - low) < values.max() <= high - margin
        assert values.mean() == pytest.approx((low + high) / 2.0, abs=0.1 * (high - low))
    points = site.hexagons(pitch, jitter, margin)
    assert points[:, 0].min() >= 1.0 + margin and points[:, 0].max() <= 3.5 - margin
    assert np.abs(points[:, 1]).max() <= 0.6 - margin
    lattice = Site(1.0, 3.5, 1.2, 0.04, Draws(seed, "key")).hexagons(pitch, 0.0, margin)
    apart = np.linalg.norm(lattice[:, None] - lattice, axis=-1)
    nearest = np.sort(apart, axis=1)[:, 1]
    np.testing.assert_allclose(nearest[nearest < 1.5 * pitch], pitch)  # a row of one has farther neighbours
    tops = site.tops(400, 0.3)
    assert tops.max() == 0.04 and 0.012 <= tops.min() < 0.014
    assert tops.mean() == pytest.approx(0.65 * 0.04, rel=0.06)
    draws = Draws(seed, "key").uniform(-2.0, 3.0, 2000)
    assert draws.mean() == pytest.approx(0.5, abs=0.15) and draws.min() >= -2.0 and draws.max() < 3.0
    assert not np.array_equal(draws, Draws(seed, "other").uniform(-2.0, 3.0, 2000))
    assert not np.array_equal(draws, Draws(seed + 1, "key").uniform(-2.0, 3.0, 2000))


def test_a_layout_needs_room_for_its_margin_and_half_a_pitch() -> None:
    """Two margins with the jitter, and across half a pitch for the rows that are shifted; else nothing fits."""
    pitch, jitter, margin = 0.2, 0.1, 0.05
    keep = margin + jitter * pitch

    def hexagons(length: float, width: float) -> int:
        return len(Site(0.0, length, width, 0.03, Draws(0, "key")).hexagons(pitch, jitter, margin))

    def scattered(length: float, width: float) -> int:
        return len(list(Site(0.0, length, width, 0.03, Draws(0, "key")).scatter(4, 0.15)))

    across = 2.0 * keep + 0.5 * pitch
    for layout, length, width, count in ((hexagons, 2.0 * keep, across, 1), (scattered, 0.3, 0.3, 4)):
        assert layout(length, width) == count
        for beside in ((length - 1e-6, 1.0), (1.0, width - 1e-6)):
            with pytest.raises(InputError):
                layout(*beside)


SIZES: list[tuple[str, dict[str, Any], dict[str, Any]]] = [
    # 50,000 solids; 10 million nodes in cells of 1 mm; 50 million quarters of cobbles
    ("stones", {"density": 50_000.0, "length": 2.0, "width": 0.5}, {"density": 50_001.0}),
    ("stones", {"density": 50_000.0, "length": 2.0, "width": 0.5}, {"length": 2.001}),
    ("iso8608", {"isotropic": True, "length": 10.0, "sole_radius": 1e-3}, {"length": 10.1}),
    ("iso8608", {"isotropic": True, "length": 10.0, "sole_radius": 1e-3}, {"width": 1.01}),
    ("random", {"length": 998.0, "sole_radius": 1e-4, "spacing": 1e-4}, {"sole_radius": 0.9e-4}),
    ("cobble_stones", {"length": 1.0, "width": 0.5, "pitch": 4e-4}, {"pitch": 3.99e-4}),
]


@pytest.mark.parametrize(("name", "largest", "beyond"), SIZES)
def test_a_ground_has_as_many_parts_as_are_built_and_no_more(
    name: str, largest: dict[str, Any], beyond: dict[str, Any]
) -> None:
    terrain(name, **largest)
    with pytest.raises(InputError):
        terrain(name, **(largest | beyond))


def test_a_ground_lies_where_its_page_says() -> None:
    """3 m long and 1 m wide, 0.3 m ahead of the robot, with strips of 1 m and a ramp of 0.5 m (docs/grounds.md)."""
    t = terrain("stones")
    assert (t.start, t.length, t.width, t.strip, t.ramp) == (0.3, 3.0, 1.0, 1.0, 0.5)
    assert t.stop == pytest.approx(3.3) and t.extent == pytest.approx((-0.7, 4.3, -0.5, 0.5))
    assert terrain("slope").ramp == 0.0


FEATURES = {
    "boards": 0.05,  # the shortest board
    "cobble_stones": 0.18 / 4.0,  # a quarter of the pitch
    "cylinder_obstacles": 0.03,  # the narrowest bar
    "ellipsoids": 2.0 * 0.032,  # the smaller axis
    "floor_tiles": 0.017,  # a joint
    "iso8608": 0.5 / 5.0,  # half of the shortest wave
    "large_floor_tiles": 0.01,  # a joint
    "metal_sheets": 0.076 / 2.0,  # half of a wave
    "patchwork": 0.03,  # that of its bars
    "pyramidal_stones": 0.047,  # the base
    "random": 3.0 * 0.007,  # three samples
    "roof_tiles": 0.2 / 4.0,  # a quarter of the shorter side
    "slats": 0.02,  # the narrowest slat
    "slope": 0.6,  # the landing
    "small_stones": 0.02 * 0.6,  # the shortest stone at its slimmest
    "steps": 0.3,  # a tread
    "sticks": 0.03 * 0.5,  # the thinnest stick
    "stone_bricks": 0.01,  # a joint
    "stones": 0.06 * 0.6,
}
"""Smallest feature of each family that a foot can feel, m, of its own parameters."""


@pytest.mark.parametrize("name", NAMES)
def test_the_smallest_feature_is_that_of_the_familys_parameters(name: str) -> None:
    t = terrain(name)
    assert t.parameters.feature_at(t.amplitude) == pytest.approx(FEATURES[name], rel=1e-12)
    if isinstance(t.parameters, FieldFamily):  # eight cells for each, and none longer than 7 mm
        grid = t.parameters.grid
        assert grid == pytest.approx(min(0.007, FEATURES[name] / (3.0 if name == "random" else 8.0)))
        for widest in (0.005, 0.0007):
            cell = t.parameters.cell(widest)
            assert cell <= widest * (1 + 1e-9) and grid / cell == pytest.approx(round(grid / cell))
            assert cell > 0.5 * min(widest, grid)


@pytest.mark.parametrize("name", ["stones", "random", "boards"])
def test_a_ground_says_what_it_is_made_of(name: str) -> None:
    t = terrain(name, seed=4, length=2.0, ramp=0.4, strip=0.7)
    facts, field = t.describe(), t.surface.field
    lengths = {"amplitude": t.amplitude, "start": 0.3, "length": 2.0, "width": 1.0, "strip": 0.7, "ramp": 0.4}
    assert {key: facts[f"{key}_m"] for key in lengths} == lengths
    assert sum(facts["geoms"].values()) == len(t.surface.solids)
    assert t.extent == pytest.approx((-0.4, 3.0, -0.5, 0.5))
    if field is None:
        assert facts["nodes"] is None and facts["cell_m"] is None and facts["height_field_bytes"] == 0
        assert set(facts["geoms"]) == {"ellipsoid" if name == "stones" else "box"}
    else:
        rows, columns = facts["nodes"]
        assert facts["cell_m"] == pytest.approx([2.0 / (columns - 1), 1.0 / (rows - 1)])
        assert facts["height_field_bytes"] == 4 * rows * columns  # single precision
    assert all(type(value) in (float, int, bool, str) for value in facts["parameters"].values())


@pytest.mark.parametrize("name", sorted(n for n in NAMES if n != "patchwork"))
def test_no_ground_is_higher_than_its_family_allows(name: str) -> None:
    kind: Family = terrain(name).parameters
    most = kind.largest_amplitude
    if math.isfinite(most):
        assert terrain(name, most).amplitude == most
        with pytest.raises(InputError):
            terrain(name, 1.001 * most)
    assert terrain(name, 1e-6).amplitude == 1e-6
    with pytest.raises(InputError):
        terrain(name, 0.9e-6)
    assert terrain(name, 0.0).height(1.0, 0.1) == 0.0
