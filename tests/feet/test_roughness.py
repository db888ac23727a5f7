"""The roughness parameters against analytic profiles, SciPy's statistics and direct sums."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples
from scipy import signal, stats

from wbc.base.errors import InputError
from wbc.feet import foot
from wbc.feet.sensing.roughness import PARAMETERS, RoughnessSettings, low_pass, roughness
from wbc.sim.terrain.spec import terrain

STEP = 0.007
PLAIN = RoughnessSettings(corner=None)


def grid(n: int) -> np.ndarray:
    return STEP * np.arange(n)


def rough(n: int = 200, seed: int = 0, count: int = 1) -> np.ndarray:
    """Random walks, shape (count, n), m: ground with all wavelengths."""
    return 1e-3 * np.random.default_rng(seed).normal(size=(count, n)).cumsum(axis=1)


# --- independent computations -----------------------------------------------------------------------------------------


@given(seed=st.integers(0, 10_000), n=st.integers(8, 120))
@examples(40)
def test_agrees_with_scipy_and_direct_sums(seed: int, n: int) -> None:
    z = rough(n, seed)[0]
    r, d = roughness(grid(n), z, PLAIN), signal.detrend(z)
    assert r["Sa"] == pytest.approx(np.mean(np.abs(d)))
    assert r["Sq"] == pytest.approx(np.std(d))
    assert r["Ssk"] == pytest.approx(stats.skew(d), abs=1e-9)
    assert r["Sku"] == pytest.approx(stats.kurtosis(d, fisher=False))
    assert (r["Sv"], r["Sp"]) == (pytest.approx(-d.min()), pytest.approx(d.max()))
    assert r["Sz"] == pytest.approx(np.ptp(d))
    assert r["P"] == pytest.approx(np.var(np.diff(z) / STEP))
    lines = np.array([abs(np.exp(-2j * math.pi * k * np.arange(n) / n) @ d / n) ** 2 for k in range(n)])
    assert r["M"] == pytest.approx(lines[1:].sum()), "Parseval"
    assert r["K"] == pytest.approx(1 - (lines[1:] ** 2).sum() / lines[1:].sum() ** 2)


# --- properties -------------------------------------------------------------------------------------------------------


@given(
    scale=st.floats(0.1, 10.0),
    lift=st.floats(-50.0, 50.0),
    slope=st.floats(-0.5, 0.5),
    place=st.floats(-200, 200),
)
@examples(40)
def test_place_lift_and_slope_do_not_matter_and_scale_does_as_it_should(
    scale: float, lift: float, slope: float, place: float
) -> None:
    x, z = grid(60), rough(60)[0]
    a = roughness(x, z)
    b = roughness(x + place, scale * z + lift + slope * x)
    order = {"Ssk": 0, "Sku": 0, "K": 0, "M": 2, "P": 2}
    for name in PARAMETERS:
        assert b[name] == pytest.approx(float(a[name]) * scale ** order.get(name, 1), rel=1e-6), name


def test_level_ground_has_no_roughness_at_all() -> None:
    for level, slope in ((0.0, 0.0), (0.1, 0.0), (-123.4, 0.0), (-5.0, 0.3)):
        r = roughness(grid(43), level + slope * np.tile(grid(43), (2, 1)))
        np.testing.assert_array_equal(r.values, 0.0)
    mixed = roughness(grid(43), np.stack([np.full(43, 7.0), rough(43)[0]]))
    np.testing.assert_array_equal(mixed.values[0], 0.0)
    np.testing.assert_allclose(mixed.values[1], roughness(grid(43), rough(43)[0]).values, rtol=1e-12)
    profile = terrain("flat").profile(0.0, 0.3)
    assert set(roughness(*profile).as_dict().values()) == {0.0}


def test_a_nanometre_about_the_trend_counts_as_level() -> None:
    x = grid(64)
    wave = np.sin(2.0 * math.pi * np.arange(64) / 16.0)
    for size, rough_ground in ((0.8e-9, False), (1.3e-9, True)):
        assert (roughness(x, 0.2 * x + size * wave, PLAIN)["Sq"] > 0.0) == rough_ground


def test_a_grid_may_be_uneven_by_a_ten_thousandth_of_its_step() -> None:
    for share, even in ((0.5e-4, True), (2e-4, False), (-2e-4, False)):
        x = grid(40)
        x[20:] += share * STEP
        if even:
            roughness(x, rough(40)[0])
        else:
            with pytest.raises(InputError):
                roughness(x, rough(40)[0])
    for bad in (-grid(40), np.zeros(40), grid(40)[:7]):
        with pytest.raises(InputError):
            roughness(bad, rough(bad.size)[0])


# --- filter -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [8, 41, 429])
@pytest.mark.parametrize("corner", [0.5, 3.6, 4.08, 40.0])
def test_the_filter_is_scipys_on_ground_that_goes_on_as_its_mirror_image(n: int, corner: float) -> None:
    z = rough(n, 2)[0]
    again = 3000 // n + 1
    b, a = signal.butter(1, corner, fs=1 / STEP)
    theirs = signal.filtfilt(b, a, np.pad(z, again * n, mode="symmetric"))
    np.testing.assert_allclose(low_pass(z, STEP, corner), theirs[again * n : (again + 1) * n], atol=1e-9)


def gain(length: float, corner: float, n: int = 4001, step: float = 0.001) -> float:
    """Part of the amplitude of a long wave that the filter leaves in the middle of a track."""
    x = step * np.arange(n)
    wave = np.cos(2.0 * math.pi * (x - x[n // 2]) / length)
    return float(low_pass(wave, step, corner)[n // 2])


def test_half_of_a_wave_as_long_as_the_soft_foot_is_left() -> None:
    """−6 dB at the corner, −3 dB at 0.64 of it, and nothing is taken of long waves."""
    corner = RoughnessSettings().corner
    assert corner is not None and corner * foot("soft").length == pytest.approx(1.0)  # type: ignore[attr-defined]
    assert gain(1.0 / corner, corner) == pytest.approx(0.5, abs=1e-6)
    assert gain(1.0 / (0.64 * corner), corner) == pytest.approx(math.sqrt(0.5), abs=5e-3)
    assert gain(100.0 / corner, corner) == pytest.approx(1.0, abs=1e-3)


def test_a_corner_beyond_the_samples_filters_nothing_and_one_of_a_continent_is_refused() -> None:
    z = rough(40)
    np.testing.assert_array_equal(low_pass(z, STEP, 0.5 / STEP), z)
    assert np.abs(low_pass(z, STEP, 0.49 / STEP) - z).max() > 0.0
    low_pass(z, STEP, 1.01e-6 / STEP)
    with pytest.raises(InputError):
        low_pass(z, STEP, 0.99e-6 / STEP)
