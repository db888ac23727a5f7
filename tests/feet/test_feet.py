"""Feet without a simulator: designs, fit, constraint law, stiffness actuator, range sensor."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples
from scipy.spatial.transform import Rotation

from wbc.base.errors import InputError, UnknownNameError
from wbc.feet import RangeSensor, SoftFoot, StiffnessActuator, foot
from wbc.feet.sensing.range_sensor import RangeSampler
from wbc.feet.soles.sole import AnkleSole, bar_inertia

OWN = AnkleSole.under_ankle(0.093, 0.160, 0.076, spacing=0.175)
FITTING = ("rigid", "soft", "long_arch", "variable")


def tilted_sole(seed: int) -> AnkleSole:
    """A sole whose ankle link has arbitrary axes, with the ankle 90 mm above, 20 mm behind, 5 mm left of it."""
    rotation = Rotation.random(rng=np.random.default_rng(seed))
    translation = -rotation.apply([-0.02, 0.005, 0.09])
    return AnkleSole("link", tuple(translation), tuple(rotation.as_quat()), 0.2, 0.1)


# --- names and bad input ---------------------------------------------------------------------------------------------


def test_unknown_names_list_what_there_is() -> None:
    with pytest.raises(UnknownNameError, match="soft"):
        foot("sotf")
    with pytest.raises(UnknownNameError, match="stiffness"):
        foot("soft", stifness=5.0)


# --- fit -------------------------------------------------------------------------------------------------------------


def test_the_flat_foot_is_the_robots_own_sole() -> None:
    fit = foot("flat").fit(OWN)
    assert fit.sole == OWN
    assert fit.mass == fit.height_change == fit.added_inertia.mass == 0.0


@pytest.mark.parametrize("name", FITTING)
def test_ankle_sits_where_the_design_says_whatever_the_axes_of_its_link(name: str) -> None:
    own = tilted_sole(1)
    fit = foot(name).fit(own)
    np.testing.assert_allclose(fit.sole.ankle, [-0.03, own.ankle[1], own.ankle[2]], atol=1e-12)
    np.testing.assert_allclose(fit.sole.rotation_matrix, own.rotation_matrix, atol=1e-12)
    assert (fit.sole.length, fit.sole.width) == (0.27782, 0.1045)
    assert fit.height_change == pytest.approx(0.0, abs=1e-12)


def test_a_low_ankle_is_raised_and_the_difference_said() -> None:
    low = AnkleSole.under_ankle(0.025, 0.16, 0.076)
    fit = foot("soft").fit(low)
    assert fit.sole.ankle[2] == pytest.approx(0.034)
    assert fit.height_change == pytest.approx(0.009)


def test_inertia_of_a_bar_is_that_of_its_points() -> None:
    start, end = np.array([0.02, 0.0, 0.09]), np.array([0.11, 0.0, 0.01])
    bar = bar_inertia(0.07, start, end, width=0.03, thickness=0.01)
    along = (end - start) / np.linalg.norm(end - start)
    across = np.array([along[2], 0.0, -along[0]])
    cells = (np.arange(20) + 0.5) / 20.0 - 0.5
    cells /= np.sqrt(1.0 - 1.0 / 20.0**2)  # so that the variance of the midpoints is that of the whole bar
    grid = np.stack(np.meshgrid(cells, cells, cells), axis=-1).reshape(-1, 3)
    length = float(np.linalg.norm(end - start))
    relative = grid @ np.array([length * along, [0.0, 0.03, 0.0], 0.01 * across])
    second = 0.07 * relative.T @ relative / len(relative)
    np.testing.assert_allclose(bar.lever, (start + end) / 2.0, atol=1e-12)
    np.testing.assert_allclose(bar.inertia, np.trace(second) * np.eye(3) - second, atol=1e-12)


def test_contact_rows_cover_the_sole_evenly_and_lie_under_their_phalanx() -> None:
    for phalanges in (2, 3, 10, 13):
        design = SoftFoot(phalanges=phalanges, loop_phalanx=1)
        x = design.contact_rows()
        np.testing.assert_allclose(np.diff(x), np.diff(x)[0], atol=1e-12)
        np.testing.assert_allclose(x, -x[::-1], atol=1e-12)
        for i, centre in enumerate(design.layout(design.fit(OWN).sole).centres):
            under = x[2 * i : 2 * i + 2]
            assert np.abs(under - centre).max() <= design.length / phalanges / 2.0 + 1e-12


# --- stiffness actuator ----------------------------------------------------------------------------------------------

actuators = st.builds(
    StiffnessActuator,
    rate_limit=st.one_of(st.just(math.inf), st.floats(0.5, 500.0)),
    time_constant=st.one_of(st.just(0.0), st.floats(1e-3, 1.0)),
)
stiffness = st.floats(1.0, 2000.0)


@given(actuators, stiffness, stiffness, st.lists(st.floats(0.0, 0.3), min_size=1, max_size=6))
@examples(50)
def test_actuator_does_not_depend_on_how_time_is_cut(
    actuator: StiffnessActuator, start: float, command: float, pieces: list[float]
) -> None:
    whole = actuator.advance(actuator.at_rest(start), command, sum(pieces))
    state = actuator.at_rest(start)
    for piece in pieces:
        state = actuator.advance(state, command, piece)
    assert state.actual == pytest.approx(whole.actual, rel=1e-9)
    assert state.reference == pytest.approx(whole.reference, rel=1e-9)


def test_actuator_solves_its_differential_equation_in_the_logarithm() -> None:
    actuator, dt = StiffnessActuator(rate_limit=5.0, time_constant=0.05), 1e-5
    reference = actual = 1.0  # log10 of 10 Nm/rad
    for _ in range(40_000):
        reference += float(np.clip(2.0 - reference, -5.0 * dt, 5.0 * dt))
        actual += dt / 0.05 * (reference - actual)
    exact = actuator.advance(actuator.at_rest(10.0), 100.0, 0.4)
    assert exact.actual == pytest.approx(10.0**actual, rel=1e-3)
    assert exact.reference == 100.0


def test_the_damping_ratio_follows_the_stiffness() -> None:
    fixed, ratio = foot("soft", stiffness=20.0), foot("soft", stiffness=20.0, damping_ratio=0.5)
    assert isinstance(fixed, SoftFoot) and isinstance(ratio, SoftFoot)
    assert fixed.damping_at(1.0) == fixed.damping_at(2000.0) == 2.0
    assert ratio.damping_at(80.0) == pytest.approx(2.0 * ratio.damping_at(20.0))
    inertia = 20.0 * (ratio.length / ratio.phalanges) ** 2  # a hinge that swings the load of 20 kg
    assert ratio.damping_at(20.0) == pytest.approx(math.sqrt(20.0 * inertia))


# --- range sensor ----------------------------------------------------------------------------------------------------


def test_range_noise_dropouts_and_resolution_have_the_asked_size() -> None:
    sensor = RangeSensor(noise=0.003, relative_noise=0.02, dropout=0.1)
    sampler = RangeSampler(sensor, seed=1)
    readings = np.array([sampler.sample(0.01 * i, 0.2) for i in range(5_000)])
    seen = readings[np.isfinite(readings)]
    assert seen.size / readings.size == pytest.approx(0.9, abs=0.02)
    assert seen.mean() == pytest.approx(0.2, abs=4e-4)
    assert seen.std() == pytest.approx(math.hypot(0.003, 0.004), rel=0.05)
    coarse = RangeSampler(RangeSensor(resolution=0.01))
    assert coarse.sample(0.0, 0.1234) == pytest.approx(0.12)
    with pytest.raises(InputError, match="integer"):
        RangeSampler(sensor, seed=-1)


def test_a_reading_stays_in_the_range_of_its_sensor_whatever_the_noise() -> None:
    sensor = RangeSensor(least=0.1, greatest=0.5, noise=0.05)
    for true, end in ((0.1, sensor.least), (0.5, sensor.greatest)):
        sampler = RangeSampler(sensor, seed=2)
        readings = np.array([sampler.sample(0.01 * i, true) for i in range(400)])
        assert np.isfinite(readings).all()
        assert readings.min() >= sensor.least and readings.max() <= sensor.greatest
        assert np.mean(readings == end) == pytest.approx(0.5, abs=0.1)  # half of a symmetric noise is beyond


def test_range_readings_are_held_between_samples() -> None:
    sampler = RangeSampler(RangeSensor(rate=100.0))
    fresh = 0
    for i in range(1000):
        sampler.sample(0.001 * i, float(i % 3) + 0.5)
        fresh += sampler.fresh
    assert fresh == 100
