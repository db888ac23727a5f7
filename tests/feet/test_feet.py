"""Feet without a simulator: designs, fit, constraint law, stiffness actuator, range sensor."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples
from scipy.spatial.transform import Rotation

from wbc.base.errors import InputError, UnknownNameError
from wbc.feet import RangeSensor, SoftFoot, StiffnessActuator, foot
from wbc.feet.sensing.range_sensor import RangeSampler
from wbc.feet.soles.contact import ContactSpheres
from wbc.feet.soles.foot import AnkleSole, bar_inertia, box_inertia
from wbc.feet.soles.soft import ROWS

OWN = replace(AnkleSole.under_ankle(0.093, 0.160, 0.076), spacing=0.175)
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
    assert fit.added_inertia.mass == 0.0


def test_the_soft_foot_of_the_iit_has_the_stiffness_and_the_mass_of_its_five_chains() -> None:
    """Two hinges in a row that share an angle equally have a half of the stiffness and of the damping of each."""
    design = foot("iit_softfoot")
    assert isinstance(design, SoftFoot)
    assert (design.stiffness, design.damping) == pytest.approx((5 * 0.8 / 2, 5 * 0.04 / 2))
    chain = 6 * 5.24 + 4.82 + 6.93 + 9.56  # g
    assert design.fit(OWN).added_inertia.mass == pytest.approx(
        1e-3 * (5 * chain + 79.6 + 72.0 + 67.6), rel=0.01
    )


@pytest.mark.parametrize("name", FITTING)
def test_ankle_sits_where_the_design_says_whatever_the_axes_of_its_link(name: str) -> None:
    own = tilted_sole(1)
    fit = foot(name).fit(own)
    np.testing.assert_allclose(fit.sole.ankle, [-0.03, own.ankle[1], own.ankle[2]], atol=1e-12)
    np.testing.assert_allclose(fit.sole.rotation_matrix, own.rotation_matrix, atol=1e-12)
    assert (fit.sole.length, fit.sole.width) == (0.27782, 0.1045)


def test_a_low_ankle_is_raised() -> None:
    assert foot("soft").fit(AnkleSole.under_ankle(0.025, 0.16, 0.076)).sole.ankle[2] == pytest.approx(0.034)


LIMITS = [
    # design, the value that fits by a hair and the one that does not, both of the robot's sole or of the foot
    ("rigid", lambda e: {"ankle_behind": 0.13891 + e}, lambda e: OWN),
    ("soft", lambda e: {"ankle_behind": -0.13891 - e}, lambda e: OWN),
    (
        "soft",
        lambda e: {},
        lambda e: AnkleSole("a", (0.0, 0.05225 + e, -0.09), (0.0, 0.0, 0.0, 1.0), 0.1, 0.1),
    ),
    (
        "rigid",
        lambda e: {},
        lambda e: AnkleSole("a", (0.0, -0.05225 - e, -0.09), (0.0, 0.0, 0.0, 1.0), 0.1, 0.1),
    ),
    ("soft", lambda e: {"width": 0.175 + e}, lambda e: OWN),
    ("soft", lambda e: {"ankle_height": 0.034 - e}, lambda e: OWN),
    ("rigid", lambda e: {"ankle_height": 0.014 - e}, lambda e: OWN),
    ("rigid", lambda e: {"length": 2.0 + e}, lambda e: OWN),
    ("rigid", lambda e: {"ankle_height": 2.0 + e}, lambda e: OWN),
    ("soft", lambda e: {"hinge_height": 0.014 + e}, lambda e: OWN),
    ("soft", lambda e: {"thickness": 0.014 - e}, lambda e: OWN),
]


@pytest.mark.parametrize(("name", "changes", "own"), LIMITS)
def test_a_foot_fits_up_to_its_limits_and_not_beyond(name: str, changes: Any, own: Any) -> None:
    """The ankle over the sole, two soles side by side, room for the arch, hinges and spheres in the phalanges."""
    fit = foot(name, **changes(-1e-6)).fit(own(-1e-6))
    assert fit.sole.ankle[1] == pytest.approx(own(-1e-6).ankle[1])
    with pytest.raises(InputError):
        foot(name, **changes(1e-6)).fit(own(1e-6))


@pytest.mark.parametrize("name", [*FITTING, "flat"])
def test_three_sensors_look_down_from_the_front_edge(name: str) -> None:
    fit = foot(name).fit(OWN)
    x, y = fit.sole.length / 2.0, fit.sole.width / 2.0
    np.testing.assert_allclose(fit.toe_sensors, [[x, -y, 0.02], [x, 0.0, 0.02], [x, y, 0.02]], atol=1e-12)


def test_masses_of_the_feet_and_their_lowest_ankles() -> None:
    """Ten phalanges of 20 g and two arches of 70 g, 340 g; the plate has as much, so compliance alone differs."""
    six = foot("soft", phalanges=6)
    for design, mass in ((foot("soft"), 0.34), (foot("rigid"), 0.34), (six, 6 * 0.02 + 0.07 + 0.07)):
        assert design.fit(OWN).added_inertia.mass == pytest.approx(mass)
    plate = box_inertia(0.34, (0.27782, 0.1045, 0.014), (0.0, 0.0, 0.0)).inertia
    np.testing.assert_allclose(foot("rigid").fit(OWN).added_inertia.inertia, plate, atol=1e-15)


@given(st.tuples(*3 * [st.floats(0.01, 1.0)]), st.floats(0.01, 10.0))
@examples(20)
def test_inertia_of_a_box_is_that_of_its_corners(size: tuple[float, float, float], mass: float) -> None:
    """Eight points at 1 / √3 of the half extents have the second moments of the box."""
    points = (
        np.array(size) / math.sqrt(12.0) * np.stack(np.meshgrid(*3 * [[-1.0, 1.0]]), axis=-1).reshape(8, 3)
    )
    second = mass * points.T @ points / 8.0
    box = box_inertia(mass, size, (0.1, 0.2, 0.3))
    np.testing.assert_allclose(box.inertia, np.trace(second) * np.eye(3) - second, atol=1e-12)
    np.testing.assert_allclose((box.mass, *box.lever), (mass, 0.1, 0.2, 0.3))


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
        x = design.contact.row_positions(design.length, ROWS * phalanges)
        np.testing.assert_allclose(np.diff(x), np.diff(x)[0], atol=1e-12)
        np.testing.assert_allclose(x, -x[::-1], atol=1e-12)
        for i, centre in enumerate(design.layout(design.fit(OWN).sole).centres):
            under = x[2 * i : 2 * i + 2]
            assert np.abs(under - centre).max() <= design.length / phalanges / 2.0 + 1e-12


@given(st.floats(0.02, 1.0), st.floats(0.02, 1.0), st.floats(0.004, 0.1), st.integers(2, 9))
@examples(30)
def test_spheres_of_a_rigid_sole_span_it_with_as_few_rows_as_its_spacing_allows(
    length: float, width: float, spacing: float, columns: int
) -> None:
    spheres = ContactSpheres(row_spacing=spacing, columns=columns)
    count = spheres.rows(length)
    x, y = spheres.row_positions(length, count), spheres.column_positions(width)
    assert count == 2 or length / (count - 1) <= spacing * (1 + 1e-12) and length / (count - 2) >= spacing
    np.testing.assert_allclose(x, length * (0.5 - np.arange(count) / (count - 1)), atol=1e-12)  # from the toe
    np.testing.assert_allclose(
        y, width * (np.arange(columns) / (columns - 1) - 0.5), atol=1e-12
    )  # from the right


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
    actuator, dt = StiffnessActuator(rate_limit=5.0, time_constant=0.05), 1e-4
    reference = actual = 1.0  # log10 of 10 Nm/rad
    for _ in range(4_000):
        reference += float(np.clip(2.0 - reference, -5.0 * dt, 5.0 * dt))
        actual += dt / 0.05 * (reference - actual)
    exact = actuator.advance(actuator.at_rest(10.0), 100.0, 0.4)
    assert exact.actual == pytest.approx(10.0**actual, rel=1e-3)
    assert exact.reference == 100.0


def test_the_actuator_takes_the_time_that_its_description_says() -> None:
    """A decade in 1 / 33 s; its whole range in 0.2 s: 0.1 s of ramp, and five time constants to an error of 1 %."""
    actuator = StiffnessActuator()
    low, high = actuator.low, actuator.high
    assert (low, high) == (1.0, 2000.0)
    decade = actuator.advance(actuator.at_rest(10.0), 1000.0, 0.030)
    assert decade.reference == pytest.approx(10.0 * 10.0**0.99)
    for start, end in ((low, high), (high, low)):
        ramp = math.log10(high / low) / 33.0
        assert ramp == pytest.approx(0.1, abs=1e-3)
        short = actuator.advance(actuator.at_rest(start), end, 0.999 * ramp)
        there = actuator.advance(actuator.at_rest(start), end, 1.001 * ramp)
        assert short.reference != end and there.reference == end
        # Behind a ramp of slope s a lag T is s T (1 − exp(−t / T)) late, in decades.
        late = math.copysign(33.0 * 0.02 * (1.0 - math.exp(-ramp / 0.02)), end - start)
        settled = actuator.advance(actuator.at_rest(start), end, ramp + 0.1)
        assert math.log10(end / settled.actual) == pytest.approx(late * math.exp(-5.0), rel=1e-6)
        assert settled.actual == pytest.approx(end, rel=0.0103)


def test_the_range_of_an_actuator_holds_at_both_ends() -> None:
    for actuator in (StiffnessActuator(low=2.0, high=50.0), StiffnessActuator.instantaneous(high=50.0)):
        for inside in (actuator.low, 7.0, 50.0):
            assert actuator.at_rest(inside).actual == inside
            assert actuator.advance(actuator.at_rest(7.0), inside, 100.0).actual == pytest.approx(inside)
        for outside in (actuator.low - 1e-6, 50.0 + 1e-6):
            with pytest.raises(InputError):
                actuator.advance(actuator.at_rest(7.0), outside, 0.1)
    for changes in (
        {"high": 1.0},
        {"low": 3.0, "high": 2.0},
        {"low": 0.0},
        {"low": 0.0, "rate_limit": math.inf},
    ):
        with pytest.raises(InputError):
            StiffnessActuator(**changes)
    at_once = StiffnessActuator.instantaneous()
    assert (at_once.low, at_once.high) == (0.0, 80.0)  # Table I of the paper
    assert at_once.advance(at_once.at_rest(0.0), 80.0, 0.0).actual == 80.0


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
    with pytest.raises(InputError, match="seed of RangeSampler"):
        RangeSampler(sensor, seed=-1)


def test_a_reading_stays_in_the_range_of_its_sensor_whatever_the_noise() -> None:
    sensor = RangeSensor(least=0.1, greatest=0.5, noise=0.05)
    for true, end in ((0.1, sensor.least), (0.5, sensor.greatest)):
        sampler = RangeSampler(sensor, seed=2)
        readings = np.array([sampler.sample(0.01 * i, true) for i in range(400)])
        assert np.isfinite(readings).all()
        assert readings.min() >= sensor.least and readings.max() <= sensor.greatest
        assert np.mean(readings == end) == pytest.approx(0.5, abs=0.1)  # half of a symmetric noise is beyond


@given(
    st.floats(0.0, 100.0),
    st.sampled_from([30.0, 100.0, 200.0]),
    st.lists(st.floats(0.0, 0.05), min_size=1, max_size=40),
)
@examples(50)
def test_range_readings_are_those_of_the_ticks_of_the_sensors_clock(
    start: float, rate: float, pauses: list[float]
) -> None:
    """The clock starts with the first call: a call reads if a multiple of 1 / rate has passed since the last."""
    sampler = RangeSampler(RangeSensor(rate=rate))
    last = -1
    for i, since in enumerate(np.cumsum([0.0, *pauses])):
        ticks = since * rate
        if abs(ticks - round(ticks)) < 1e-6 and i > 0:
            continue  # on the tick rounding decides
        fresh = math.floor(ticks) > last
        assert sampler.due(start + since) == fresh
        reading = sampler.sample(start + since, 0.1 + 0.01 * i)
        last = math.floor(ticks) if fresh else last
        assert reading == pytest.approx(0.1 + 0.01 * i if fresh else math.nan, nan_ok=True)


def test_a_sensor_of_100_hz_is_read_100_times_a_second() -> None:
    sampler = RangeSampler(RangeSensor(rate=100.0))
    assert sum(sampler.sample(0.001 * i, 0.5) > 0.0 for i in range(1000)) == 100
    every = RangeSampler(RangeSensor())
    assert all(every.sample(0.001 * i, 0.1 + 0.001 * i) == 0.1 + 0.001 * i for i in range(100))


def test_range_noise_depends_on_the_seed_and_the_number_of_the_reading_alone() -> None:
    sensor = RangeSensor(noise=0.01, dropout=0.3)
    true, lost = np.full(60, 0.5), np.full(60, 0.5)
    lost[:20] = np.inf

    def readings(seed: int, distances: np.ndarray) -> np.ndarray:
        sampler = RangeSampler(sensor, seed)
        first = [sampler.sample(0.01 * i, d) for i, d in enumerate(distances)]
        sampler.reset()
        again = [sampler.sample(0.01 * i, d) for i, d in enumerate(distances)]
        np.testing.assert_array_equal(first, again)
        return np.array(first)

    one, other = readings(1, true), readings(2, true)
    np.testing.assert_array_equal(readings(1, lost)[20:], one[20:])
    both = np.isfinite(one) & np.isfinite(other)
    assert 10 < both.sum() < 50 and (one[both] != other[both]).all()


@given(st.floats(0.001, 0.05), st.floats(0.05, 3.9))
@examples(30)
def test_a_reading_is_the_nearest_multiple_of_the_resolution(resolution: float, distance: float) -> None:
    reading = RangeSampler(RangeSensor(resolution=resolution)).sample(0.0, distance)
    assert reading / resolution == pytest.approx(round(reading / resolution), abs=1e-6)
    assert abs(reading - distance) <= resolution / 2.0 + 1e-12


def test_only_what_lies_in_the_range_of_a_sensor_is_read() -> None:
    sensor = RangeSensor(least=0.1, greatest=2.0)
    seen = {d: RangeSampler(sensor).sample(0.0, d) for d in (0.1, 0.7, 2.0)}
    assert seen == {d: d for d in seen}
    for d in (0.0999, 2.0001, math.inf, -math.inf, math.nan):
        assert math.isnan(RangeSampler(sensor).sample(0.0, d))
    with pytest.raises(InputError):
        RangeSensor(least=0.5, greatest=0.5)
