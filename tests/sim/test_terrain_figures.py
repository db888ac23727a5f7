"""Figures of grounds: facts of their families, the room that they need, sizes of what lies on them, wrong input."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture

from wbc.base.errors import InputError
from wbc.base.settings import settings
from wbc.sim.terrain.families.base import Family, ShapeFamily
from wbc.sim.terrain.families.fields import ISO_LIMITS
from wbc.sim.terrain.families.patchwork import stretches
from wbc.sim.terrain.families.site import Draws, Site
from wbc.sim.terrain.shapes import Cylinder, Shape, dome
from wbc.sim.terrain.spec import terrain


def test_the_cut_off_of_random_ground_is_told_as_a_frequency_and_as_a_wavelength() -> None:
    """A share of the Nyquist frequency of the samples, half a wave from one to the next: 0.1 of 1/20 mm is 5 /m."""
    facts = terrain("random", cutoff=0.1, spacing=0.01, length=2.0).describe()
    assert facts["cutoff_cycles_per_m"] == pytest.approx(5.0)
    assert facts["cutoff_wavelength_m"] == pytest.approx(0.2)
    uneven = terrain("random", cutoff=0.1, spacing=0.03, length=1.0).describe()  # 34 samples fit into 1 m
    assert uneven["cutoff_wavelength_m"] == pytest.approx(2.0 / 34.0 / 0.1)


def test_the_class_of_a_road_is_that_of_iso_8608() -> None:
    """Classes A to G end at 32e-6 m³ and four times that of the one before; H has none above."""
    np.testing.assert_allclose(ISO_LIMITS, [32e-6 * 4**k for k in range(7)])
    road = terrain("iso8608").parameters

    def facts(amplitude: float) -> dict[str, Any]:
        return road.facts(Site(0.3, 3.3, 1.0, amplitude, Draws(2, "key")))

    least = facts(1.0)["gd_n0_m3"]  # it grows with the square of the amplitude
    for k, limit in enumerate(ISO_LIMITS):
        for share, name in ((0.999, "ABCDEFGH"[k]), (1.001, "ABCDEFGH"[k + 1])):
            found = facts(math.sqrt(share * limit / least))
            assert found["gd_n0_m3"] == pytest.approx(share * limit) and found["iso_class"] == name
    assert "iso_class" not in terrain("iso8608", isotropic=True).describe()


def test_waves_of_a_road_lie_between_its_frequencies() -> None:
    """Of two waves each stands for half of the band, in its middle: 1.5 /m and 2.5 /m between 1 and 3 /m."""
    road = terrain("iso8608", 0.02, 1, low=1.0, high=3.0, waves=2, length=10.0, ramp=0.0)
    x, z = road.profile(step=0.01)
    columns = np.column_stack(
        [f(math.tau * n * x) for n in (1.5, 2.5) for f in (np.cos, np.sin)] + [np.ones(x.size)]
    )
    found, residual, *_ = np.linalg.lstsq(columns, z, rcond=None)
    assert residual[0] < 1e-6 * z.size * z.var()
    sizes = np.hypot(found[:4:2], found[1:4:2])
    assert sizes[0] / sizes[1] == pytest.approx(2.5 / 1.5, rel=5e-3)  # Gd falls with the square
    gd = road.describe()["gd_n0_m3"]  # at 0.1 /m; a wave carries the variance Gd dn, half of its size squared
    assert sizes[0] == pytest.approx(math.sqrt(2.0 * gd * (1.5 / 0.1) ** -2 * 1.0), rel=5e-3)
    with pytest.raises(InputError):
        terrain("iso8608", low=3.0, high=3.0)
    terrain("iso8608", low=0.1, high=1.0, length=1.001, ramp=0.5)
    with pytest.raises(InputError):  # no whole wave
        terrain("iso8608", low=0.1, high=1.0, length=0.999, ramp=0.5)


def test_heights_of_both_directions_blend_into_the_strips_over_a_tenth_of_a_metre() -> None:
    """About their mean, by 3t² − 2t³ at either end; heights along the track alone begin at zero and end as they are."""
    site = Site(1.0, 2.0, 1.0, 0.03, Draws(0, "key"))
    x = np.linspace(1.0, 2.0, 101)[None, :]
    raw = np.random.default_rng(2).normal(5.0, 1.0, (4, 101))
    both: Any = terrain("iso8608", isotropic=True).parameters
    found, stop = both.level(site, x, raw)
    t = np.clip(np.minimum(x - 1.0, 2.0 - x) / 0.1, 0.0, 1.0)
    np.testing.assert_allclose(found, (raw - raw.mean()) * (3.0 * t**2 - 2.0 * t**3), atol=1e-12)
    assert stop == 0.0
    along: Any = terrain("iso8608").parameters
    found, stop = along.level(site, x, raw[:1])
    np.testing.assert_allclose(found, raw[:1] - raw[0, 0])
    assert stop == pytest.approx(raw[0, -1] - raw[0, 0])


def made(name: str, length: float, width: float, amplitude: float = 0.02, **params: Any) -> list[Shape]:
    """Return the solids of a family in a rough part from x = 1 m on."""
    parameters: Family = terrain(name, **params).parameters
    assert isinstance(parameters, ShapeFamily)
    return list(parameters.shapes(Site(1.0, 1.0 + length, width, amplitude, Draws(3, "key"))))


ROOM: list[tuple[str, dict[str, Any], float, float]] = [
    ("stone_bricks", {"length": 0.3, "breadth": 0.15, "joint": 0.02}, 0.32, 0.17),
    ("floor_tiles", {"side": 0.2, "joint": 0.03}, 0.23, 0.23),
    ("roof_tiles", {"period_max": 0.3, "breadth": 0.4}, 1.2 * 0.3, 0.4),
    ("cylinder_obstacles", {"width_max": 0.08, "yaw": 0.0}, 0.08, 0.0),
    ("pyramidal_stones", {"base": 0.1}, math.sqrt(2.0) * 0.1, math.sqrt(2.0) * 0.1),
    ("sticks", {"longest": 0.4}, 0.4, 0.4),
    ("slats", {"width_max": 0.05, "gap_max": 0.2}, 0.05 + 2.0 * 0.2, 0.0),
    ("ellipsoids", {"pitch": 0.2, "half_length": 0.1}, 2.0 * 0.11, 2.0 * 0.11 + 0.1),
    ("cobble_stones", {"pitch": 0.2, "overlap": 0.2, "jitter": 0.1}, 2.0 * 0.14, 2.0 * 0.14 + 0.1),
    (
        "stones",
        {"density": 50.0, "largest": 0.16},
        0.16 + 0.6 * math.sqrt(2.0 / math.sqrt(3.0) / 50.0),
        0.16 + 1.1 * math.sqrt(2.0 / math.sqrt(3.0) / 50.0),
    ),
]
"""Family, parameters, and the least length and width of a rough part that they need, m."""


@pytest.mark.parametrize(("name", "params", "length", "width"), ROOM)
def test_a_family_needs_room_for_one_of_its_parts(
    name: str, params: dict[str, Any], length: float, width: float
) -> None:
    spare = 1e-6
    own = {"length": params.pop("length")} if "length" in params else {}  # of a brick, not of the track
    parameters: Any = type(terrain(name).parameters)(**params, **own)

    def fits(along: float, across: float) -> bool:
        try:
            solids = list(parameters.shapes(Site(0.0, along, across, 0.02, Draws(3, "key"))))
        except InputError:
            return False
        return solids is not None

    aside = width or 0.5
    assert fits(length + spare, aside + spare)
    assert not fits(length - spare, aside + spare)
    assert fits(2.0 * length, aside + spare)
    if width:
        assert not fits(2.0 * length, width - spare)


def test_bars_across_the_track_keep_their_ends_on_it() -> None:
    """A bar that is turned by its greatest angle reaches half the width times its sine ahead, with half its own."""
    parameters: Any = terrain("cylinder_obstacles", width_min=0.08, width_max=0.08, yaw=0.5).parameters
    need = 2.0 * (0.04 + 0.5 * math.sin(0.5))
    for length, fits in ((need + 1e-6, True), (need - 1e-6, False)):
        site = Site(0.0, length, 1.0, 0.02, Draws(1, "key"))
        if fits:
            assert list(parameters.shapes(site))
        else:
            with pytest.raises(InputError):
                list(parameters.shapes(site))


def middles(solids: list[Shape]) -> np.ndarray:
    """Return the middles of solids along the track, m."""
    return np.array([0.5 * (solid.box[0] + solid.box[1]) for solid in solids])


def test_bars_are_as_far_apart_as_is_asked_for() -> None:
    """The first one half a distance behind the margin; on a short track one lies in the middle."""
    bars = made(
        "cylinder_obstacles", 6.0, 1.0, width_min=0.05, width_max=0.05, spacing_min=0.4, spacing_max=0.4, yaw=0.0
    )  # fmt: skip
    places = np.unique(np.round(middles(bars), 9))
    np.testing.assert_allclose(places, 1.0 + 0.025 + 0.2 + 0.4 * np.arange(len(places)))
    assert places[-1] <= 7.0 - 0.025 < places[-1] + 0.4
    one = made("cylinder_obstacles", 0.5, 1.0, spacing_min=2.0, spacing_max=2.0, yaw=0.0)
    (place,) = np.unique(np.round(middles(one), 9))
    assert place == pytest.approx(1.25)


def test_boards_have_their_gaps_lengths_and_widths() -> None:
    """Straight boards of one length: a gap, a board, a gap and so on, half of them as wide as the track."""
    straight = {"shortest": 0.2, "longest": 0.2, "gap_min": 0.15, "gap_max": 0.15, "yaw": 0.0, "narrow": 0.3}
    boards = made("boards", 12.0, 1.5, **straight)
    places = middles(boards)
    np.testing.assert_allclose(places, 1.0 + 0.15 + 0.1 + 0.35 * np.arange(len(places)))
    assert places[-1] + 0.1 <= 13.0 < places[-1] + 0.1 + 0.35
    across = np.array([[board.box[2], board.box[3]] for board in boards])
    widths = np.diff(across, axis=1)[:, 0]
    assert set(np.round(widths, 9)) == {0.3, 1.5} and 0.2 < np.mean(widths > 1.0) < 0.8
    aside = np.abs(across.mean(axis=1))
    assert aside[widths > 1.0].max() < 1e-9 and 0.2 < aside.max() <= 1.5 * 0.3
    assert np.abs(across).max() <= 0.75 + 1e-9
    # A track that holds none: one narrow board in its middle, if there is room for twice its sizes.
    one = made("boards", 0.41, 0.61, **(straight | {"gap_min": 0.4, "gap_max": 0.4}))
    assert middles(one) == pytest.approx([1.205]) and one[0].box[3] - one[0].box[2] == pytest.approx(0.3)
    for length, width in ((0.39, 0.61), (0.41, 0.59)):
        with pytest.raises(InputError):
            made("boards", length, width, **(straight | {"gap_min": 0.4, "gap_max": 0.4}))


def test_turned_boards_stay_on_the_track_and_behind_each_other() -> None:
    for seed in range(4):
        parameters: Any = terrain("boards", yaw=1.0).parameters
        boards = list(parameters.shapes(Site(0.0, 6.0, 1.0, 0.02, Draws(seed, "key"))))
        for board in boards:
            assert board.box[2] >= -0.5 - 1e-9 and board.box[3] <= 0.5 + 1e-9 and board.box[1] <= 6.0 + 1e-9
        for one, other in zip(boards, boards[1:], strict=False):
            assert 0.1 - 1e-9 <= other.box[0] - one.box[1] <= 0.4 + 1e-9


def test_slats_have_their_gaps_and_widths_and_sag_into_their_pit() -> None:
    """The first gap begins at the edge, the last is left of the end; slats lie below the edge by a share of the pit."""
    even = {"width_min": 0.03, "width_max": 0.03, "gap_min": 0.1, "gap_max": 0.1, "tilt": 0.0, "sag": 0.4}
    slats = made("slats", 4.0, 0.8, 0.05, **even)
    np.testing.assert_allclose(middles(slats), 1.0 + 0.13 * np.arange(1, len(slats) + 1) - 0.015)
    last = slats[-1].box[1]
    assert last + 0.1 <= 5.0 + 1e-9 < last + 0.1 + 0.13
    tops = np.array([slat.peak[2] for slat in slats])
    assert tops.max() == pytest.approx(0.0) and -0.4 * 0.05 <= tops.min() < -0.3 * 0.05
    for slat in slats:
        assert slat.box[1] - slat.box[0] == pytest.approx(0.03)
        assert slat.box[3] - slat.box[2] == pytest.approx(0.8)
    parameters: Any = terrain("slats").parameters
    assert parameters.floor(Site(0.0, 1.0, 1.0, 0.07, Draws(0, "key"))) == -0.07


def test_plates_are_laid_in_rows_with_their_joints_and_their_bond() -> None:
    """Bricks of 0.2 m by 0.1 m with joints of 20 mm: every other row is shifted by half a brick, cut at the ends."""
    bricks = made("stone_bricks", 2.2, 0.72, **{"breadth": 0.1, "joint": 0.02, "tilt": 0.0})
    rows: dict[float, list[tuple[float, float]]] = {}
    for brick in bricks:
        rows.setdefault(round(0.5 * (brick.box[2] + brick.box[3]), 9), []).append(
            (brick.box[0], brick.box[1])
        )
        assert brick.box[3] - brick.box[2] == pytest.approx(0.1)
    assert sorted(rows) == pytest.approx([-0.3, -0.18, -0.06, 0.06, 0.18, 0.3])
    for j, y in enumerate(sorted(rows)):
        ends = np.array(rows[y])
        np.testing.assert_allclose(ends[1:, 0] - ends[:-1, 1], 0.02, atol=1e-9)
        assert ends[0, 0] == pytest.approx(1.01) and ends[-1, 1] == pytest.approx(3.19)
        lengths = ends[:, 1] - ends[:, 0]
        np.testing.assert_allclose(lengths[1:-1], 0.2)
        np.testing.assert_allclose(lengths[[0, -1]], 0.2 if j % 2 == 0 else 0.09)


def test_plates_that_are_high_and_tilted_do_not_lean_over_their_joints() -> None:
    """Each has half of a joint on either side, so that neighbours never meet; low ones tilt as far as is asked for."""
    for joint in (0.004, 0.02):
        tiles = made("floor_tiles", 2.0, 1.0, 0.06, side=0.05, joint=joint, tilt=1.0)
        sizes = np.array([[tile.box[1] - tile.box[0], tile.box[3] - tile.box[2]] for tile in tiles])
        assert sizes[:, 1].min() >= 0.05 - 1e-3 and sizes.max() <= 0.05 + joint
        leans = sizes.max() - 0.05
        assert leans > 0.3 * joint
    low = made("floor_tiles", 2.0, 1.0, 0.004, side=0.05, joint=0.02, tilt=1.0)
    slopes = np.array([abs(tile.rotation[:2, 2] / tile.rotation[2, 2]) for tile in low])  # type: ignore[attr-defined]
    assert 0.9 * 0.5 * 0.004 / 0.05 < slopes.max() <= 0.5 * 0.004 / 0.05 + 1e-9


@pytest.mark.parametrize("rising", [True, False])
def test_a_barrel_tile_climbs_from_its_heel_to_its_top(rising: bool) -> None:
    """Over a tile the crown goes from a share of its height to all of it, and its section is as wide as its breadth."""
    (tile,) = made("roof_tiles", 0.5, 0.4, 0.04, period_min=0.3, period_max=0.3, breadth=0.4, rising=rising)
    assert isinstance(tile, Cylinder)
    x = np.linspace(1.04, 1.32, 8)  # the tile lies from 1.03 m on, a tenth of its length behind the edge
    heights = tile.top(x, 0.0 * x)
    slope = np.diff(heights) / np.diff(x)
    np.testing.assert_allclose(slope, slope[0], rtol=1e-6)
    assert (slope[0] > 0.0) == rising
    low, high = (1.03, 1.33) if rising else (1.33, 1.03)
    line = np.polynomial.Polynomial.fit(x, heights, 1)
    assert line(low) == pytest.approx(0.2 * 0.04, abs=1e-6)
    back = (0.3 - math.sqrt(0.3**2 - 4.0 * (0.8 * 0.04) ** 2)) / 2.0
    assert line(high - math.copysign(back, high - low)) == pytest.approx(0.04, abs=1e-6)
    assert tile.box[3] - tile.box[2] == pytest.approx(2.0 * tile.radius)
    assert terrain("roof_tiles", breadth=0.15).parameters.largest_amplitude == pytest.approx(0.4 * 0.15)
    assert terrain("roof_tiles", breadth=0.3).parameters.largest_amplitude == pytest.approx(0.4 * 0.2)


def test_counts_of_scattered_solids_are_their_density_times_the_area() -> None:
    for name, density in (("pyramidal_stones", 6.0), ("sticks", 9.0)):
        for length, width in ((2.0, 1.0), (3.0, 1.5)):
            assert len(made(name, length, width, density=density)) == round(density * length * width)
        assert len(made(name, 0.8, 0.8, density=0.01)) == 1
    # A hexagonal lattice has 2 / (√3 p²) points on a square metre.
    stones = made("stones", 6.0, 6.0, density=70.0)
    assert len(stones) == pytest.approx(70.0 * 36.0, rel=0.1)


def test_sizes_of_stones_sticks_and_domes_are_within_their_bounds() -> None:
    for stone in made("stones", 3.0, 1.0, smallest=0.08, largest=0.1, slimmest=0.9):
        for low, high in ((0, 1), (2, 3)):
            extent = stone.box[high] - stone.box[low]
            assert 0.08 * 0.9 - 1e-9 <= extent <= 0.1 + 1e-9
    for stick in made("sticks", 3.0, 1.5, 0.04, shortest=0.3, longest=0.4, lowest=0.5):
        radius = stick.radius
        assert 0.01 - 1e-9 <= radius <= 0.02 + 1e-9
        assert 0.3 - 1e-9 <= np.linalg.norm(stick.end - stick.start) + 2.0 * radius <= 0.4 + 1e-9
        assert stick.start[2] == stick.end[2] == radius
    domes = made("cobble_stones", 3.0, 1.0, 0.05, pitch=0.2, overlap=0.2)
    for round_ in domes:
        lift = round_.peak[2]
        ball = (0.12**2 + lift**2) / (2.0 * lift)  # through the edge of a circle of 0.12 m
        assert np.ptp(round_.box[:2]) == pytest.approx(2.0 * ball)
    assert terrain("small_stones", largest=0.06).parameters.largest_amplitude == pytest.approx(0.03)


def test_features_that_grow_with_the_amplitude_are_those_of_the_ground() -> None:
    """Half of the amplitude of sticks whose thinnest is half as high as the highest; the usual one on level ground."""
    sticks = terrain("sticks").parameters
    usual = type(sticks).default_amplitude
    for amplitude, feature in ((0.02, 0.01), (0.05, 0.025), (0.0, 0.5 * usual)):
        assert sticks.feature_at(amplitude) == pytest.approx(feature)
    mixed = terrain("patchwork", families="sticks:0.5 boards")
    assert mixed.parameters.feature_at(0.02) == pytest.approx(0.005)
    assert terrain("stones").parameters.feature_at(0.5) == pytest.approx(0.036)


def test_stretches_of_a_patchwork_are_as_many_as_fit_and_the_last_takes_the_rest() -> None:
    for length, count, last in ((3.0, 5, 0.6), (3.5, 5, 1.1), (3.6, 6, 0.6), (0.5, 1, 0.5)):
        ground = terrain("patchwork", length=length, ramp=0.0)
        found = stretches(ground)
        assert len(found) == count and found[-1][2] == pytest.approx(0.3 + length)
        assert found[-1][2] - found[-1][1] == pytest.approx(last)
        assert ground.describe()["stretches"] == [name for name, *_ in found]
    low = terrain("patchwork", 0.05, 5, families="boards:0.5 stones:1", stretch=0.6)
    assert low.parameters.feature_at(0.05) == pytest.approx(0.036)
    # Of any order one stretch has the whole amplitude, and the families' bounds count by their shares.
    for seed in range(6):
        short = terrain("patchwork", 0.02, seed, families="boards:0.5 stones:1", length=0.7, ramp=0.0)
        assert [name for name, *_ in stretches(short)] == ["stones"]
    most = terrain("patchwork", families="roof_tiles:0.5 boards").parameters.largest_amplitude
    assert most == pytest.approx(0.4 * 0.2 / 0.5)


def test_an_image_has_its_extent_and_its_grey_from_left_to_right() -> None:
    """Three rows of four pixels of 0.5 m: 1.5 m along, 1 m across, the first row at the left edge, black lowest."""
    grey = np.array([[0.0, 1.0, 2.0, 3.0], [1.0, 1.0, 1.0, 1.0], [4.0, 4.0, 4.0, 8.0]])
    ground = terrain("image", 0.08, source=grey, metres_per_pixel=0.5, start=1.0)
    assert (ground.length, ground.width, ground.ramp) == (1.5, 1.0, 0.0)
    for row, y in ((0, 0.5), (1, 0.0), (2, -0.5)):
        for column, x in enumerate((1.0, 1.5, 2.0, 2.5)):
            edge = 1e-9 * np.sign([1.75 - x, -y])
            assert ground.height(x + edge[0], y + edge[1]) == pytest.approx(
                0.01 * grey[row, column], abs=1e-6
            )
    assert ground.describe()["smallest_feature_m"] == 1.5
    for size in ({"length": 1.6}, {"width": 1.1}):
        with pytest.raises(InputError):
            terrain("image", 0.08, source=grey, metres_per_pixel=0.5, **size)
    inner = terrain("image", 0.08, source=grey, metres_per_pixel=0.5, length=1.0, width=0.5)
    assert inner.height(inner.start + 0.5, 0.0) == pytest.approx(
        inner.height(inner.start + 1e-9, 0.0), abs=1e-6
    )


@pytest.mark.parametrize(("slope_x", "slope_y"), [(0.2, 0.0), (0.0, 0.0)])
def test_normals_lean_against_the_slope(slope_x: float, slope_y: float) -> None:
    if slope_x:
        ground = terrain("slope", 0.2 * 3.0, direction="up", length=3.0)
        expected = np.array([-0.2, 0.0, 1.0]) / math.hypot(0.2, 1.0)
    else:
        ground, expected = terrain("flat"), np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(ground.normal(np.array([1.0, 2.0]), 0.1), [expected] * 2, atol=1e-6)
    pyramid = terrain("pyramidal_stones", 0.02, 1, density=1.0, ramp=0.0)
    solid: Any = pyramid.surface.shapes[0]
    x, y = solid.peak[:2]
    away = 0.1 * solid.side * np.array([math.cos(solid.yaw), math.sin(solid.yaw)])
    normals = pyramid.normal(x + np.array([away[0], -away[0]]), y + np.array([away[1], -away[1]]))
    # Both sides look away from the top, as the heights of 2 h over the base say.
    lean = 2.0 * (solid.apex[2] - solid.floor) / solid.side
    for normal, way in zip(normals, (1.0, -1.0), strict=True):
        flat = way * away / np.linalg.norm(away) * lean
        np.testing.assert_allclose(normal, np.array([*flat, 1.0]) / math.hypot(lean, 1.0), atol=1e-5)


def test_ground_higher_than_the_foot_is_lifted_warns() -> None:
    high = terrain("stones", 0.05)
    with pytest.warns(UserWarning, match="clearance"):
        assert not high.clears(0.04)
    assert high.clears(0.05)
    # Of a climb only one riser has to be stepped over, and nothing of a ramp.
    assert terrain("steps", 0.09, riser=0.03).clears(0.03)
    assert terrain("slope", 0.3).clears(0.01)
    with pytest.warns(UserWarning, match="by 45 mm"):
        assert not terrain("steps", 0.09, riser=0.05).clears(0.04)
    with pytest.raises(InputError, match="clearance"):
        high.clears(-0.1)


def _picture(path: Path, mode: str, array: np.ndarray) -> Path:
    picture = Picture.fromarray(array)
    (picture if mode == "I;16" else picture.convert(mode)).save(path)
    return path


def test_an_array_becomes_the_ground() -> None:
    rng = np.random.default_rng(0)
    grey = rng.uniform(0, 255, (41, 101))
    t = terrain("image", 0.03, source=grey, metres_per_pixel=0.006)
    assert (t.length, t.width) == pytest.approx((0.6, 0.24))
    x, y = t.start + 0.006 * np.arange(101), 0.12 - 0.006 * np.arange(41)
    # Pixel centres, off the edges, where the strips begin.
    want = 0.03 * (grey - grey.min()) / np.ptp(grey)
    np.testing.assert_allclose(t.height(x[1:-1], y[1:-1, None]), want[1:-1, 1:-1], atol=1e-9)
    assert t == terrain("image", 0.03, source=grey.copy(), metres_per_pixel=0.006)
    assert t != terrain("image", 0.03, source=grey[::-1].copy(), metres_per_pixel=0.006)


@settings
class Single(ShapeFamily):
    """One dome, as high as a share of the amplitude."""

    name = "single"
    x: float = 1.0
    y: float = 0.0
    share: float = 1.0
    stop_level: float = 0.0

    @property
    def smallest_feature(self) -> float:
        return 0.1

    def stop(self, site: Site) -> float:
        return self.stop_level

    def shapes(self, site: Site) -> Iterator[Shape]:
        yield dome(self.x, self.y, 0.1, self.share * site.amplitude)


@pytest.mark.parametrize(("x", "y"), [(0.4, 0.0), (3.2, 0.0), (1.0, 0.4), (1.0, -0.4)])
def test_solids_of_a_family_stay_inside_the_rough_part(x: float, y: float) -> None:
    """A dome of 0.1 m radius touches an edge from inside, and is refused a millimetre further."""
    inwards = np.sign([1.8 - x if y == 0.0 else 0.0, -y])
    for by, fits in ((1e-4, True), (-1e-3, False)):
        place = np.array([x, y]) + by * inwards
        ground = terrain(Single(*place.tolist()), 0.05)
        if fits:
            assert ground.height(*place) == pytest.approx(0.05, abs=0.05)
        else:
            with pytest.raises(InputError):
                ground.height(0.0, 0.0)


def test_a_family_must_be_as_high_as_its_amplitude() -> None:
    assert terrain(Single(), 0.05).height(1.0, 0.0) == pytest.approx(0.05)
    for share in (1.0 + 1e-6, 1.0 - 1e-6):
        with pytest.raises(InputError):
            terrain(Single(share=share), 0.05).height(0.0, 0.0)
    high = terrain(Single(stop_level=0.02), 0.05)
    assert high.height(high.stop + 0.1, 0.0) == pytest.approx(0.02)
    assert high.height(high.stop - 0.01, 0.0) == high.height(high.start - 0.1, 0.0) == 0.0


def test_a_profile_has_a_sample_at_each_step_up_to_its_end() -> None:
    ground = terrain("slope", 0.1, direction="up")
    for x0, x1, step, count in ((0.0, 1.0, 0.1, 11), (0.0, 0.99, 0.1, 10), (-0.2, 0.1, 0.15, 3)):
        x, z = ground.profile(x0, x1, 0.2, step)
        np.testing.assert_allclose(x, x0 + step * np.arange(count), atol=1e-12)
        np.testing.assert_array_equal(z, ground.height(x, 0.2))
    x, _ = ground.profile()
    assert x[0] == ground.start and ground.stop - x[-1] < 0.007
    for bad in ({"x0": 1.0, "x1": 1.0}, {"x0": 0.0, "x1": 1.0, "step": 0.99e-7}, {"step": 0.0}):
        with pytest.raises(InputError):
            ground.profile(**bad)
    slope = np.arctan(0.1 / 3.0)
    np.testing.assert_allclose(ground.normal(1.0, 0.1), [-np.sin(slope), 0.0, np.cos(slope)], atol=1e-6)


def test_an_image_is_used_up_to_its_edges_along_and_across() -> None:
    grey = np.random.default_rng(0).uniform(0, 1, (21, 51))
    whole = terrain("image", 0.03, source=grey, metres_per_pixel=0.02)
    assert (whole.length, whole.width, whole.ramp) == pytest.approx((1.0, 0.4, 0.0))
    part = terrain("image", 0.03, source=grey, metres_per_pixel=0.02, length=0.5, width=0.4)
    assert part.height(0.55, 0.1) > 0.0
    for beyond in ({"length": 1.001}, {"width": 0.401}):
        with pytest.raises(InputError):
            terrain("image", 0.03, source=grey, metres_per_pixel=0.02, **beyond)


def test_coarse_images_are_drawn_in_finer_cells_but_stay_the_same() -> None:
    grey = np.random.default_rng(1).uniform(0, 1, (9, 31))
    coarse = terrain("image", 0.03, source=grey, metres_per_pixel=0.05)
    assert coarse.surface.field is not None and max(coarse.surface.field.step) <= 0.007
    x, y = coarse.start + 0.05 * np.arange(31), 0.2 - 0.05 * np.arange(9)
    want = 0.03 * (grey - grey.min()) / np.ptp(grey)
    np.testing.assert_allclose(coarse.height(x[1:-1], y[1:-1, None]), want[1:-1, 1:-1], atol=1e-9)


def test_images_are_read_from_files(tmp_path: Path) -> None:
    eight = np.random.default_rng(2).integers(0, 256, (20, 60)).astype(np.uint8)
    sixteen = eight.astype(np.uint16) * 257
    same = [
        _picture(tmp_path / "grey.png", "L", eight),
        _picture(tmp_path / "deep.png", "I;16", sixteen),
        _picture(tmp_path / "equal.png", "RGB", eight),
        tmp_path / "map.npy",
        tmp_path / "map.csv",
    ]
    np.save(same[3], eight)
    np.savetxt(same[4], eight, delimiter=",")
    first, *others = (terrain("image", 0.03, source=p, metres_per_pixel=0.01) for p in same)
    x, y = np.meshgrid(np.linspace(first.start, first.stop, 301), np.linspace(-0.4, 0.4, 81))
    for other in others:
        np.testing.assert_allclose(other.height(x, y), first.height(x, y), atol=1e-12)


@pytest.mark.parametrize("name", ["stones", "random"])
def test_nowhere_has_no_height_and_does_not_change_that_of_other_places(name: str) -> None:
    ground = terrain(name, amplitude=0.03)
    x, y = np.linspace(0.4, 2.8, 50), np.zeros(50)
    heights = ground.height(x, y)
    assert np.ptp(heights) > 0.01
    with_nan = ground.height(np.append(x, [np.nan, 1.0]), np.append(y, [0.0, np.nan]))
    np.testing.assert_array_equal(with_nan, np.append(heights, [np.nan, np.nan]))
    assert np.isnan(ground.normal(1.0, np.nan)).all()
