"""Bounds of what is doubted, and the steps of the inertial estimate, in closed form."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from at_rest import at_rest, observed

from wbc.base.errors import MeasurementError
from wbc.core.estimation.checks.consistency import ConsistencyMonitor
from wbc.core.estimation.checks.integrals import IntegralComparison
from wbc.core.estimation.checks.legs import LegComparison
from wbc.core.estimation.checks.plausibility import Plausibility
from wbc.core.estimation.inertial import InertialFilter, InertialSettings
from wbc.core.estimation.observer import Observer
from wbc.core.robot import GRAVITY
from wbc.core.signals import SIGNALS
from wbc.robots import load

ROBOT, DT = load("hrp4_class").robot(), 0.005
NAMES = Plausibility(ROBOT, DT).names
STILL = (0.0, 0.0, 0.0)


def doubted(after: Any, ticks: int = 200, **seen: Any) -> list[tuple[float, str]]:
    """Times since a change and what is doubted then, after 0.5 s of rest; `after` changes a measurement."""
    monitor, rng, found = ConsistencyMonitor(ROBOT, DT, NAMES), np.random.default_rng(0), []
    for tick in range(-100, ticks):
        measurement = at_rest(ROBOT, (tick + 100) * DT)
        if tick >= 0:
            measurement = after(measurement)
        values = 1e-3 * rng.normal(size=len(NAMES))
        monitor.update(values, measurement, observed(ROBOT, **(seen if tick >= 0 else {})))
        found += [(tick * DT, doubt) for doubt in monitor.doubts]
    return found


@pytest.mark.parametrize(("lasts", "told"), [(0.015, False), (0.1, True)])
def test_a_foot_that_slips_is_named_until_a_while_after(lasts: float, *, told: bool) -> None:
    """After 0.02 s, and until 0.3 s after the slip."""
    monitor, found = ConsistencyMonitor(ROBOT, DT, NAMES), []
    rng = np.random.default_rng(0)
    for tick in range(100):
        slips = 0 <= tick * DT < lasts
        monitor.update(
            1e-3 * rng.normal(size=len(NAMES)),
            at_rest(ROBOT, tick * DT),
            observed(ROBOT, slides=[False, slips]),
        )
        found += [tick * DT for doubt in monitor.doubts if doubt == f"{ROBOT.soles[1].name} slips"]
    assert bool(found) == told
    if told:
        assert found[0] == pytest.approx(0.02 - DT) and found[-1] == pytest.approx(
            lasts + 0.3 - 2 * DT, abs=DT
        )


@pytest.mark.parametrize(("share", "told"), [(1.97, False), (2.03, True)])
def test_soles_that_carry_more_than_twice_the_weight_are_doubted(share: float, *, told: bool) -> None:
    """After a low-pass of 50 ms and a tenth of a second."""
    found = doubted(lambda m: replace(m, sole_wrench=share * m.wrenches), 400)
    assert {doubt for _, doubt in found} == ({"force sensors too high for the weight"} if told else set())
    if told:
        begun = -0.05 * math.log((2.03 - 2.0) / 1.03)
        assert found[0][0] == pytest.approx(begun + 0.1, abs=0.02)


@pytest.mark.parametrize(("share", "told"), [(0.62, False), (0.58, True)])
def test_an_accelerometer_that_shows_less_than_six_tenths_of_gravity_is_doubted(
    share: float, *, told: bool
) -> None:
    found = doubted(lambda m: replace(m, specific_force=share * m.specific_force), 400)
    assert {doubt for _, doubt in found} == ({"accelerometer without gravity"} if told else set())


@pytest.mark.parametrize(("share", "told"), [(0.63, False), (0.57, True)])
def test_soles_that_carry_less_than_six_tenths_of_the_weight_are_doubted_unless_the_robot_falls(
    share: float, *, told: bool
) -> None:
    found = {doubt for _, doubt in doubted(lambda m: replace(m, sole_wrench=share * m.wrenches), 400)}
    assert found == ({"force sensor of left_foot or right_foot too low for the weight"} if told else set())
    falls = doubted(
        lambda m: replace(m, sole_wrench=0.3 * m.wrenches, specific_force=0.3 * m.specific_force), 400
    )
    assert not falls
    one = np.array([[0.0], [1.0]])
    if told:  # of one sole that carries nothing
        found = {doubt for _, doubt in doubted(lambda m: replace(m, sole_wrench=0.9 * one * m.wrenches), 400)}
        assert "force sensor of left_foot too low for the weight" in found


@pytest.mark.parametrize(("rate", "told"), [(0.48, False), (0.52, True)])
def test_feet_that_turn_alike_by_half_a_radian_a_second_contradict_the_gyroscope(
    rate: float, *, told: bool
) -> None:
    found = {
        doubt for _, doubt in doubted(lambda m: m, 200, foot_rotations=2 * [(0.6 * rate, 0.8 * rate, 0.0)])
    }
    assert found == ({"encoders and gyroscope disagree"} if told else set())


def test_wrenches_that_were_measured_and_are_estimated_now_are_named() -> None:
    found = doubted(lambda m: replace(m, wrench_source="model"), 3)
    assert {doubt for _, doubt in found} == {"force sensors silent, wrenches estimated"}
    monitor = ConsistencyMonitor(ROBOT, DT, NAMES)
    for tick in range(40):
        measurement = replace(at_rest(ROBOT, tick * DT), wrench_source="model")
        monitor.update(
            1e-3 * np.random.default_rng(tick).normal(size=len(NAMES)), measurement, observed(ROBOT)
        )
    assert monitor.doubts == (), "a robot that never had sensors"


@pytest.mark.parametrize("count", [3, 6, 9])
def test_readings_that_stay_the_same_for_twenty_ticks_are_frozen_and_six_are_named(count: int) -> None:
    monitor, rng, na = ConsistencyMonitor(ROBOT, DT, NAMES), np.random.default_rng(1), ROBOT.na
    held = np.zeros(len(NAMES))
    for tick in range(125):
        values = 1e-3 * rng.normal(size=len(NAMES))
        if tick == 99:
            held = values.copy()
        if tick >= 100:
            values[na : na + count] = held[na : na + count]
        monitor.update(values, at_rest(ROBOT, tick * DT), observed(ROBOT))
        if tick < 119:
            assert monitor.doubts == ()
        if tick == 119:
            named = [f"velocity of {name} frozen" for name in ROBOT.joint_names[: min(count, 6)]]
            more = [f"{count - 6} more sensors frozen"] if count > 6 else []
            assert list(monitor.doubts) == named + more


def test_a_machines_own_time_is_the_slope_of_its_motions_if_all_joints_agree() -> None:
    """By least squares, with a cosine of 0.95 and a way of 20 mrad in all joints at least; a gap does not count."""
    rng = np.random.default_rng(0)
    expected = rng.normal(size=ROBOT.na)

    def pace(moved: np.ndarray, expected: np.ndarray, then: float = 0.0) -> float:
        comparison = IntegralComparison(ROBOT, DT)
        for tick in range(12):
            comparison.update(np.concatenate((0.1 * tick * moved, expected / (10.0 * DT))), None, DT)
        for tick in range(12):  # after a gap, in which joints have gone elsewhere
            comparison.update(np.concatenate((moved + then, 0.0 * moved)), None, 0.0 if tick else 2.0)
        return comparison.pace

    for ratio in (0.5, 0.8, 1.4):
        assert pace(ratio * expected, expected, 5.0) == pytest.approx(ratio)
    across = rng.normal(size=ROBOT.na)
    across -= (across @ expected) / (expected @ expected) * expected
    across *= np.linalg.norm(expected) / np.linalg.norm(across)
    for cosine, agrees in ((0.96, True), (0.94, False)):
        moved = 0.7 * expected + 0.7 * math.tan(math.acos(cosine)) * across
        assert pace(moved, expected) == pytest.approx(0.7 if agrees else 1.0)
    for length, told in ((0.019, False), (0.021, True)):
        short = length / 0.975 / np.linalg.norm(expected) * expected  # of which a part is forgotten
        assert pace(0.7 * short, short) == pytest.approx(0.7 if told else 1.0)


# ---- feet -----------------------------------------------------------------------------------------------------------


def compared(
    shares: tuple[float, float], speeds: Any, gravity: float = 1.0, ticks: int = 100
) -> tuple[LegComparison, int | None]:
    """Comparison after some ticks, and the first tick at whose end something was wrong."""
    feet, first = LegComparison(DT, HEIGHT), None
    for tick in range(ticks):
        feet.move(speeds(tick * DT), [STILL] * 2, (0.0, 0.0), (0.0, 0.0, GRAVITY))
        feet.compare(shares, gravity)
        if first is None and (feet.swapped or feet.silent is not None):
            first = tick
    return feet, first


@pytest.mark.parametrize("flip", [False, True])
def test_a_foot_that_rests_and_reports_nothing_is_silent_after_a_tenth_of_a_second(flip: bool) -> None:
    """Less than 0.05 of the weight on it, and 0.65 in all, while the ground carries the robot."""

    def rests(_: float) -> list[tuple[float, float, float]]:
        return [STILL] * 2

    def of(a: float, b: float) -> tuple[float, float]:
        return (b, a) if flip else (a, b)

    feet, first = compared(of(0.6, 0.04), rests)
    assert feet.silent == (0 if flip else 1) and first == 19
    for shares, gravity in (
        (of(0.6, 0.051), 1.0),
        (of(0.62, 0.04), 1.0),
        (of(0.6, 0.04), 1.16),
        (of(0.6, 0.04), 0.84),
    ):
        assert compared(shares, rests, gravity)[0].silent is None
    for gravity in (1.14, 0.86):
        assert compared(of(0.6, 0.04), rests, gravity)[0].silent is not None


@pytest.mark.parametrize(("speed", "together"), [(0.099, True), (0.101, False)])
def test_feet_are_together_below_a_tenth_of_a_metre_per_second(speed: float, *, together: bool) -> None:
    way = np.array([0.48, -0.6, 0.64]) * speed
    feet, _ = compared((0.5, 0.5), lambda _: [tuple(0.7 * way), tuple(-0.3 * way)], ticks=400)
    assert feet.together == together


@pytest.mark.parametrize("flip", [False, True])
def test_a_foot_that_moves_as_the_accelerometer_does_not_show_cannot_carry_the_robot(flip: bool) -> None:
    """From 0.15 m/s on, and three times the velocity of the other leg."""

    def swings(rate: float, other: float = 0.0) -> Any:
        def at(time: float) -> list[tuple[float, float, float]]:
            both = [(0.6 * rate * time, -0.8 * rate * time, 0.0), (0.0, other * time, 0.0)]
            return both[::-1] if flip else both

        return at

    shares = (0.05 - 1e-3, 0.9) if flip else (0.9, 0.05 - 1e-3)
    feet, first = compared(shares, swings(2.0), ticks=80)
    assert feet.swapped and first is not None
    # It moves by a T (1 − e^{−t/T}) with T = 0.3 s, a low-pass of 0.03 s later, and for a tenth of a second.
    passed = -0.3 * math.log(1.0 - 0.15 / 0.6) + 0.03 + 0.1
    assert first * DT == pytest.approx(passed, abs=0.025)
    assert not compared(shares, swings(0.48), ticks=400)[0].swapped, "at most 0.144 m/s"
    assert compared(shares, swings(0.53), ticks=400)[0].swapped, "at most 0.159 m/s"
    assert not compared(shares, swings(2.0, 0.7), ticks=60)[0].swapped, "less than three times as fast"
    assert compared(shares, swings(2.0, 0.63), ticks=80)[0].swapped
    less = (0.049, 0.59) if flip else (0.59, 0.049)
    assert not compared(less, swings(2.0), gravity=2.0, ticks=80)[0].swapped, "it does not carry alone"


# ---- the gyroscope --------------------------------------------------------------------------------------------------

TURN_DT, HEIGHT = 1e-3, 0.7


def turning(
    legs: Any, carries: float = 0.6, ticks: int = 200, shown: Any = None
) -> tuple[LegComparison, int | None]:
    """Comparison of a foot that has stood for 0.1 s and seems to turn about y by 0.2 rad/s from then on.

    `legs` is the velocity of the IMU by the leg along x at a time from then on, m/s, and `shown` the acceleration that
    the accelerometer shows, m/s². Returned is the first tick in which the gyroscope is found wrong as well.
    """
    comparison, first = LegComparison(TURN_DT, HEIGHT), None
    up = (0.0, 0.0, GRAVITY)
    for _ in range(100):
        comparison.move([STILL] * 2, [STILL] * 2, (carries, 1.0 - carries), up)
    for tick in range(1, ticks + 1):
        time = tick * TURN_DT
        feet, rate = [(-legs(time), 0.0, 0.0), STILL], [(0.0, 0.2, 0.0), STILL]
        force = up if shown is None else (shown(time), 0.0, GRAVITY)
        comparison.move(feet, rate, (carries, 1.0 - carries), force)
        if comparison.turns and first is None:
            first = tick
    return comparison, first


def false_velocity(time: float) -> float:
    """Velocity that a leg shows of a gyroscope wrong by ω: h ω − g ∫ θ dt, with θ = ω T (1 − e^{−t/T})."""
    memory = 0.3
    tilt = 0.2 * memory * (time - memory * (1.0 - math.exp(-time / memory)))
    return HEIGHT * 0.2 - GRAVITY * tilt


def test_a_turn_that_the_accelerometer_does_not_show_is_one_of_a_wrong_gyroscope_after_a_while() -> None:
    """From 0.03 m/s and 0.05 rad/s on after a low-pass of 0.03 s, for 0.06 s, on a foot that carries four tenths."""
    _, first = turning(false_velocity)
    assert first is not None
    begun = max(-0.03 * math.log(1.0 - 0.05 / 0.2), -0.03 * math.log(1.0 - 0.03 / (HEIGHT * 0.2)))
    assert first * TURN_DT == pytest.approx(begun + 0.06, abs=0.006)
    assert turning(false_velocity, carries=0.41)[1] is not None
    assert (
        turning(false_velocity, carries=0.39)[1] is None or turning(false_velocity, carries=0.39)[1] == first
    )
    assert turning(lambda _: 0.0)[1] is None, "the foot turns, and the leg shows nothing of it"
    assert turning(lambda time: 0.4 * false_velocity(time))[1] is not None, "0.6 of it lack"
    assert turning(lambda time: 0.3 * false_velocity(time))[1] is None, "0.7 of it lack"
    assert turning(lambda time: 1.6 * false_velocity(time))[1] is not None
    assert turning(lambda time: 1.9 * false_velocity(time), ticks=110)[1] is None
    pushed = 2.0  # m/s² that leg and accelerometer both show
    same = turning(lambda time: false_velocity(time) + pushed * time, shown=lambda _: pushed)[1]
    assert same == first, "a push moves legs and IMU alike"


# ---- the inertial estimate ------------------------------------------------------------------------------------------

SETTINGS = InertialSettings(
    velocity_time_constant=0.1, tilt_time_constant=3.0, yaw_time_constant=2.0, bias_time_constant=5.0,
    flight_time_constant=0.7,
)  # fmt: skip


def filtered() -> InertialFilter:
    inertial = InertialFilter(SETTINGS)
    inertial.reset(pin.utils.rotate("z", 0.4) @ pin.utils.rotate("y", 0.1), np.array([0.1, 0.2, 0.3]))
    return inertial


def test_a_prediction_is_the_mean_of_two_samples_over_the_period() -> None:
    inertial = filtered()
    inertial.gyro_bias = np.array([0.01, -0.02, 0.03])
    rotation, velocity = inertial.rotation.copy(), inertial.velocity.copy()
    first, second = (
        (np.array([0.1, 0.2, -0.3]), np.array([0.3, -0.2, 0.5])),
        (np.ones(3), np.array([1.0, 2.0, 9.0])),
    )
    inertial.predict(first[0], second[0], 0.0)
    np.testing.assert_array_equal(inertial.rotation, rotation)
    inertial.predict(first[1], second[1], DT)
    rate = 0.5 * (first[0] + first[1]) - inertial.gyro_bias
    middle = rotation @ pin.exp3(0.5 * DT * rate)
    np.testing.assert_allclose(inertial.rotation, rotation @ pin.exp3(DT * rate), atol=1e-12)
    push = middle @ (0.5 * (second[0] + second[1])) - [0.0, 0.0, GRAVITY]
    np.testing.assert_allclose(inertial.velocity, velocity + DT * push, atol=1e-12)


def test_legs_correct_velocity_tilt_heading_and_bias_by_their_time_constants() -> None:
    """The share 1 − e^{−dt/τ} of an innovation; it turns by that share of (−y, x)/(g τ_t) and of the yaw error."""
    inertial = filtered()
    rotation, velocity = inertial.rotation.copy(), inertial.velocity.copy()
    legs, yaw_error = np.array([0.15, 0.1, 0.33]), 0.02
    inertial.correct(legs, yaw_error, DT)
    share, yaw = 1.0 - math.exp(-DT / 0.1), 1.0 - math.exp(-DT / 2.0)
    off = legs - velocity
    np.testing.assert_allclose(inertial.velocity, velocity + share * off, atol=1e-12)
    turn = np.array([-share * off[1] / (GRAVITY * 3.0), share * off[0] / (GRAVITY * 3.0), yaw * yaw_error])
    np.testing.assert_allclose(inertial.rotation, pin.exp3(turn) @ rotation, atol=1e-12)
    np.testing.assert_allclose(inertial.gyro_bias, -(rotation.T @ turn) / 5.0, atol=1e-12)
    assert inertial.correction.legs == pytest.approx(tuple(legs)) and inertial.correction.unexplained == 0j
    assert inertial.correction.turned == pytest.approx(-yaw_error), (
        "the feet have turned against the gyroscope"
    )
    left = (1.0 - share) * complex(off[0], off[1])
    before, bias, up = inertial.velocity.copy(), inertial.gyro_bias.copy(), inertial.rotation[2].copy()
    inertial.correct(legs + [0.01, 0.02, 0.0], 0.03, DT)
    found = complex(*(legs + [0.01, 0.02, 0.0] - before)[:2])
    assert inertial.correction.unexplained == pytest.approx(found - left)
    assert inertial.correction.turned == pytest.approx(
        DT * float(up @ bias) - (0.03 - (1.0 - yaw) * yaw_error)
    )


def test_in_flight_the_velocity_decays_and_nothing_is_known_of_legs() -> None:
    inertial = filtered()
    inertial.correct(np.array([0.15, 0.1, 0.33]), 0.02, DT)
    velocity, rotation = inertial.velocity.copy(), inertial.rotation.copy()
    inertial.correct(None, 0.5, 0.1)
    np.testing.assert_allclose(inertial.velocity, math.exp(-0.1 / 0.7) * velocity)
    np.testing.assert_array_equal(inertial.rotation, rotation)
    assert inertial.correction.legs is None and inertial.correction.unexplained == 0j
    assert inertial.correction.turned == pytest.approx((1.0 - (1.0 - math.exp(-DT / 2.0))) * 0.02)
    inertial.correct(None, 0.5, 0.1)
    assert inertial.correction.turned == 0.0


@pytest.mark.parametrize("signal", SIGNALS)
def test_an_observer_refuses_signals_of_another_shape_and_numbers_that_are_none(signal: str) -> None:
    observer, rest = Observer(ROBOT), at_rest(ROBOT, 1.0)
    observer.update(rest)
    good = getattr(rest, signal)
    wrong = good.copy()
    wrong.flat[0] = np.nan
    kinds = [np.array(good, dtype=kind) for kind in (object, complex, bool, str)]
    masked = np.ma.array(good, mask=True)
    for value in (wrong, np.concatenate((good, good)), good[:-1], *kinds, masked, good.tolist(), "x", None):
        with pytest.raises(MeasurementError, match=f"{signal} must be finite, of shape|no sole_wrench"):
            observer.update(replace(rest, time=1.1, **{signal: value}))
    observer.update(replace(rest, time=1.1))
    for time in (1.0999, math.nan, math.inf, "x", None, 1j, True):
        with pytest.raises(MeasurementError, match="must be finite and rise|must be a finite number"):
            observer.update(replace(rest, time=time))  # type: ignore[arg-type]
    observer.update(replace(rest, time=1.1))
