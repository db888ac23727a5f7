"""Ranges and poses become a profile on a uniform grid, whatever the order, noise, gaps and drop-outs of the hits."""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from properties import examples

from wbc.base.errors import InputError
from wbc.feet import foot
from wbc.feet.sensing.scan import PROFILE_STEP, GroundScan, Profile, ScanSettings
from wbc.feet.soles.foot import AnkleSole
from wbc.feet.soles.soft import toe_sensor

DOWN = (0.0, 0.0, -1.0)


def swing(n: int = 120, length: float = 0.29, height: float = 0.06) -> tuple[np.ndarray, np.ndarray]:
    """Toe of a swinging foot: places, shape (n, 3), and pitch, shape (n,)."""
    u = np.linspace(0.0, 1.0, n)
    s = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    p = np.stack(
        [0.4 + length * s, 0.07 + 0.003 * np.sin(math.pi * u), 0.01 + height * np.sin(math.pi * u) ** 2], 1
    )
    return p, 0.2 * np.sin(2.0 * math.pi * u)


def rays(pitch: np.ndarray) -> np.ndarray:
    """Rays of a sensor that looks down its sole, under a foot with this pitch."""
    return np.stack([-np.sin(pitch), np.zeros_like(pitch), -np.cos(pitch)], axis=1)


def scan_plane(a: float, b: float, forward: tuple[float, float] = (1.0, 0.0), **options: float) -> GroundScan:
    """Scan the plane z = a + b x (x along `forward`), with exact ranges."""
    scan = GroundScan(ScanSettings(**options))  # type: ignore[arg-type]
    scan.start(forward)
    places, pitch = swing()
    c, s = np.array(forward) / math.hypot(*forward)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    for p, d in zip(places, rays(pitch), strict=True):
        scan.add(turn @ p, turn @ d, (a + b * p[0] - p[2]) / (d[2] - b * d[0]))
    return scan


def profile_of(x: Sequence[float] | np.ndarray, z: Sequence[float] | np.ndarray, **options: float) -> Profile:
    """Profile of ground that is seen from above at some places, with heights, NaN where the reading is lost."""
    scan = GroundScan(ScanSettings(**options))  # type: ignore[arg-type]
    for place, height in zip(x, z, strict=True):
        scan.add((place, 0.0, 1.0), DOWN, 1.0 - height)
    return scan.profile()


@given(
    a=st.floats(-0.1, 0.1),
    b=st.floats(-0.3, 0.3),
    yaw=st.floats(-3.1, 3.1),
    step=st.sampled_from([0.006, 0.007, 0.012]),
)
@example(a=-0.09375, b=-0.296875, yaw=0.0, step=0.006)  # low and falling: hits spread over 0.369 m
@examples(40)
def test_a_plane_is_reconstructed_exactly(a: float, b: float, yaw: float, step: float) -> None:
    """Centroids of cells lie on a straight line, so averaging and interpolating must not bend it."""
    profile = scan_plane(a, b, (2.0 * math.cos(yaw), 2.0 * math.sin(yaw)), step=step).profile()
    np.testing.assert_allclose(profile.z, a + b * profile.x, atol=1e-12)
    np.testing.assert_allclose(np.diff(profile.x), step, atol=1e-12)
    np.testing.assert_allclose(profile.x / step, np.round(profile.x / step), atol=1e-9)
    np.testing.assert_allclose(profile.points[:, 2], profile.z)
    np.testing.assert_allclose(profile.points[:, :2] @ profile.forward, profile.x, atol=1e-12)
    assert (
        step == 0.006 or profile.coverage > 0.95
    )  # the finest cells are passed over in the middle of a swing
    places, pitch = swing()
    d = rays(pitch)
    hits = places[:, 0] + (a + b * places[:, 0] - places[:, 2]) / (d[:, 2] - b * d[:, 0]) * d[:, 0]
    # The ends are the first and the last multiple of the step between the centroids of the outermost cells.
    assert hits.min() - 1e-9 <= profile.x[0] < hits.min() + 1.5 * step
    assert hits.max() - 1.5 * step < profile.x[-1] <= hits.max() + 1e-9
    assert np.all((profile.lateral > 0.069) & (profile.lateral < 0.074))


def add_all(scan: GroundScan, places: np.ndarray, rays: np.ndarray, distances: np.ndarray) -> int:
    """Add readings one by one; return the number of those that were used."""
    return sum(scan.add(p, r, d) for p, r, d in zip(places, rays, distances, strict=True))


def test_readings_count_the_same_in_any_order() -> None:
    rng = np.random.default_rng(3)
    places, pitch = swing()
    ranges = places[:, 2] + rng.normal(0.0, 0.003, places.shape[0])
    ranges[rng.random(ranges.size) < 0.1] = np.nan
    ranges[5] = math.inf
    d = rays(pitch)
    one, shuffled = GroundScan(), GroundScan()
    assert add_all(one, places, d, ranges) == one.hits
    assert one.lost == int((~np.isfinite(ranges)).sum()) > 5
    order = rng.permutation(ranges.size)
    add_all(shuffled, places[order], d[order], ranges[order])
    np.testing.assert_allclose(shuffled.profile().z, one.profile().z, atol=1e-12)
    np.testing.assert_array_equal(shuffled.profile().seen, one.profile().seen)


@given(
    yaw=st.floats(-math.pi, math.pi),
    a=st.floats(-1.0, 1.0),
    lean=st.floats(-0.4, 0.4),
    curve=st.floats(-0.3, 0.3),
    seed=st.integers(0, 100),
)
@examples(40)
def test_points_of_a_profile_are_the_hits_at_its_samples(
    yaw: float, a: float, lean: float, curve: float, seed: int
) -> None:
    """One hit at each sample, seen from anywhere: the profile goes through all of them, in the world."""
    c, s = math.cos(yaw), math.sin(yaw)
    along = PROFILE_STEP * np.arange(-10, 30)
    aside, heights = a + lean * along, 0.1 * np.sin(20.0 * along) + curve
    hits = np.stack([c * along - s * aside, s * along + c * aside, heights], axis=1)
    scan = GroundScan()
    scan.start((3.0 * c, 3.0 * s))
    rng = np.random.default_rng(seed)
    distances = rng.uniform(0.05, 0.5, along.size)
    towards = rng.normal(size=(along.size, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    assert add_all(scan, hits - distances[:, None] * towards, towards, distances) == along.size
    profile = scan.profile()
    np.testing.assert_allclose(profile.points, hits, atol=1e-9)
    np.testing.assert_allclose(profile.lateral, aside, atol=1e-9)
    assert profile.coverage == 1.0
    assert profile.length == pytest.approx(39 * PROFILE_STEP)
    assert profile.last(5.0) is profile
    end = profile.last(5.0 * PROFILE_STEP)
    np.testing.assert_allclose(end.points, hits[-6:], atol=1e-9)
    assert end.coverage == 1.0


@pytest.mark.parametrize("capacity", [16, 40])
@pytest.mark.parametrize("first", [-100, 0, 7])
def test_a_quarter_of_the_buffer_lies_behind_the_first_hit(capacity: int, first: int) -> None:
    scan = GroundScan(ScanSettings(capacity=capacity))
    scan.add((first * PROFILE_STEP, 0.0, 0.1), DOWN, 0.1)
    behind, ahead = first - capacity // 4, first + capacity - capacity // 4 - 1
    for cell, inside in ((behind, True), (behind - 1, False), (ahead, True), (ahead + 1, False)):
        assert scan.add((cell * PROFILE_STEP, 0.0, 0.1), DOWN, 0.1) == inside
    assert (scan.hits, scan.outside, scan.lost) == (3, 2, 0)
    assert not scan.add((0.0, 0.0, math.nan), DOWN, 0.1) and not scan.add((0.0, 0.0, 0.1), DOWN, math.inf)
    assert (scan.hits, scan.outside, scan.lost) == (3, 2, 2)
    scan.start((0.0, 1e-3))
    assert (scan.hits, scan.outside, scan.lost) == (0, 0, 0)


def test_a_hit_belongs_to_the_nearest_sample() -> None:
    for share, cell in ((0.49, 0), (0.51, 1), (-0.49, 0), (-0.51, -1)):
        scan = GroundScan()
        for x in (-3.0, -2.0, share, 3.0, 4.0):
            scan.add((x * PROFILE_STEP, 0.0, 0.1), DOWN, 0.1)
        seen = dict(zip(range(-3, 5), scan.profile().seen.tolist(), strict=True))
        assert [n for n, hit in seen.items() if hit] == sorted({-3, -2, cell, 3, 4})


def test_the_widest_gap_is_at_least_a_step() -> None:
    assert ScanSettings(step=0.01, max_gap=0.01).max_gap == 0.01
    with pytest.raises(InputError):
        ScanSettings(step=0.01, max_gap=0.0099)
    for hits in ([0.0], [0.0, 1.0]):
        with pytest.raises(InputError):
            profile_of(hits, hits)  # one cell, and two too far apart


def test_noise_is_averaged_where_the_foot_is_slow() -> None:
    scan = GroundScan()
    rng = np.random.default_rng(0)
    x = np.repeat(PROFILE_STEP * np.arange(40), 100)
    add_all(
        scan,
        np.stack([x, 0 * x, 0 * x + 0.1], 1),
        np.tile(DOWN, (x.size, 1)),
        0.1 + rng.normal(0, 0.01, x.size),
    )
    assert scan.profile().z.std() == pytest.approx(0.01 / 10.0, rel=0.3)


def test_gaps_are_bridged_up_to_a_width_and_cut_beyond() -> None:
    x = np.arange(0.0, 0.4, 0.001)
    bridged = profile_of(x, np.where((x > 0.1) & (x < 0.12), np.nan, 0.5 * x))
    np.testing.assert_allclose(bridged.z, 0.5 * bridged.x, atol=1e-12)
    assert 0.9 < bridged.coverage < 1.0
    assert bridged.length > 0.38
    hole = np.where((x > 0.1) & (x < 0.2), np.nan, 0.5 * x)
    cut = profile_of(x, hole)
    assert 0.19 < cut.x[0] <= cut.x[-1] < 0.401, "the longer piece stays"
    equal = PROFILE_STEP * np.r_[0:20, 40:60, 80:90]
    assert profile_of(equal, equal).x[0] == pytest.approx(40 * PROFILE_STEP), (
        "of equal pieces the later one stays"
    )
    for gap, samples in ((4 * PROFILE_STEP, 43), (4.1 * PROFILE_STEP, 19)):
        places = np.r_[PROFILE_STEP * np.arange(20), 19 * PROFILE_STEP + gap + PROFILE_STEP * np.arange(20)]
        assert profile_of(places, places).x.size == samples, "28 mm are bridged, 28.7 mm are not"
    whole = profile_of(x, hole, max_gap=0.5)
    assert whole.length > 0.38
    np.testing.assert_allclose(whole.z, 0.5 * whole.x, atol=1e-12)


@pytest.mark.parametrize("phalanges", [10, 7])
def test_the_toe_sensor_is_where_the_model_has_it(phalanges: int) -> None:
    spec = mujoco.MjSpec()
    ankle = spec.worldbody.add_body(name="ankle", pos=[0.0, 0.0, 1.0])
    ankle.add_freejoint()
    ankle.mass, ankle.inertia = 1.0, [0.01] * 3
    design = foot("variable", phalanges=phalanges)
    built = design.build(spec, ankle, "left", AnkleSole.under_ankle(0.093, 0.16, 0.076))  # type: ignore[arg-type]
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    body, site = data.body(built.body), data.site(built.range_site)
    inside = body.xmat.reshape(3, 3).T @ (site.xpos - body.xpos)
    np.testing.assert_allclose(inside, toe_sensor(design), atol=2e-6)  # type: ignore[arg-type]
    np.testing.assert_allclose(site.xmat.reshape(3, 3)[:, 2], DOWN, atol=1e-9)
