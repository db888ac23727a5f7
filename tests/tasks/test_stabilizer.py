"""The stabilizer's law: the oracle list of the original stabilizer, its algebra, its symmetries, bad input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples

from wbc.base.numbers import Array
from wbc.core.robot import GRAVITY
from wbc.tasks.stabilizer.admittance import FootAdmittance, FootCorrection
from wbc.tasks.stabilizer.distribution import DistributionSettings, WrenchDistribution
from wbc.tasks.stabilizer.feedback import (
    DcmFeedback,
    PendulumErrors,
    wrench_through,
)
from wbc.tasks.stabilizer.gains import StabilizerGains
from wbc.tasks.stabilizer.pendulum import MIN_FORCE, Pendulum, cop, level_zmp, natural_frequency, zmp_offset
from wbc.tasks.stabilizer.stabilizer import Stabilizer

MASS = 62.4  # JVRC-1
HEIGHT = 0.85
SIZES = ((0.22, 0.10), (0.22, 0.10))
SOLES = [pin.SE3(np.eye(3), np.array([0.0, y, 0.0])) for y in (0.105, -0.105)]
REST = Pendulum.at_rest(np.array([0.0, 0.0, HEIGHT]))
DT = 0.005
MC_RTC = StabilizerGains.mc_rtc()


def stabilizer(gains: StabilizerGains = MC_RTC) -> Stabilizer:
    return Stabilizer(MASS, WrenchDistribution(SIZES, DistributionSettings.mc_rtc()), gains)


def feet(left: float, right: float) -> np.ndarray:
    """Wrenches of pure normal forces."""
    wrenches = np.zeros((2, 6))
    wrenches[:, 2] = left, right
    return wrenches


STANDING = feet(MASS * GRAVITY / 2, MASS * GRAVITY / 2)


def tick(s: Stabilizer, target: Pendulum = REST, com=None, velocity=None, wrenches=STANDING, **options):
    com = target.com if com is None else np.asarray(com, dtype=float)
    velocity = target.com_velocity if velocity is None else np.asarray(velocity, dtype=float)
    arguments = {"soles": SOLES, "contact": (True, True), "yaw": 0.0, "dt": DT} | options
    return s.update(target, com, velocity, wrenches, **arguments)


def moving(rng: np.random.Generator) -> Pendulum:
    """A random instant of a pattern."""
    omega = natural_frequency(HEIGHT)
    point, offset = np.array([*rng.uniform(-0.05, 0.05, 2), 0.0]), rng.uniform(-0.05, 0.05, 2)
    com = np.array([*(point[:2] + offset), HEIGHT])
    velocity = np.array([*rng.uniform(-0.3, 0.3, 2), 0.0])
    rate = np.array([*rng.uniform(-0.3, 0.3, 2), 0.0])
    return Pendulum(com, velocity, np.array([*(omega**2 * offset), 0.0]), point, rate, omega)


# The oracle list, in its order; the first is in test_pendulum.py, the fourth in test_distribution.py, the tenth in
# test_bias.py; the sixth is that feet settle at heights by their loads


def test_oracle_2_no_error_asks_for_the_pattern_itself() -> None:
    rng = np.random.default_rng(0)
    for _ in range(10):
        target = moving(rng)
        wrench = wrench_through(target.com, target.com_acceleration, MASS)
        np.testing.assert_allclose(level_zmp(wrench, target.zmp), target.zmp, atol=1e-9)
        result = tick(stabilizer(replace(MC_RTC, dcm_p=5.0, dcm_i=10.0)), target)
        np.testing.assert_allclose(result.com_acceleration, target.com_acceleration, atol=1e-12)
        np.testing.assert_allclose(result.net_wrench, wrench, atol=1e-9)
        np.testing.assert_allclose(result.net_wrench[:3], MASS * (target.com_acceleration + [0, 0, GRAVITY]))
        np.testing.assert_allclose(result.zmp, target.zmp, atol=1e-9)


def test_oracle_3_a_com_error_of_10_mm_shifts_the_zmp_by_24_7_mm() -> None:
    result = tick(stabilizer(replace(MC_RTC, dcm_p=5.0)), com=[-0.01, 0.0, HEIGHT])
    np.testing.assert_allclose(result.errors.dcm, [0.01, 0.0])
    np.testing.assert_allclose(
        result.zmp[:2], [-0.0247, 0.0], atol=5e-5
    )  # under and beyond the displaced CoM
    np.testing.assert_allclose(level_zmp(result.net_wrench, np.zeros(3)), result.zmp, atol=1e-9)


def test_a_force_from_outside_shifts_the_load_of_the_feet_and_not_their_pressure() -> None:
    push, place = np.array([0.0, 30.0, 0.0]), np.array([0.3, 0.4, 1.1])
    result = tick(stabilizer(), outside=np.concatenate([push, np.cross(place, push)]))
    normal = result.feet.wrenches[:, 2]
    # Moments about x of the push and of the normal forces at 105 mm from the middle.
    assert 0.105 * (normal[0] - normal[1]) == pytest.approx(30.0 * 1.1, rel=1e-2)
    assert max(np.abs(cop(wrench)[1]) for wrench in result.feet.wrenches) < 1e-3


def random_run(world: pin.SE3, mirror: bool = False) -> list:
    """A stabilizer with everything on, over random but smooth errors, in a world moved or mirrored."""
    gains = StabilizerGains(dcm_p=(4.0, 5.0), dcm_i=(3.0, 2.0), dcm_d=(0.5, 0.3), zmp_d=0.02)
    s = Stabilizer(MASS, WrenchDistribution(SIZES), gains)
    flip = np.diag([1.0, -1.0, 1.0]) if mirror else np.eye(3)
    yaw = np.arctan2(world.rotation[1, 0], world.rotation[0, 0])
    out = []
    for k in range(round(0.8 / DT)):
        t = (k + 1) * DT
        y = 0.08 * np.sin(3 * t)
        com = np.array([0.01 * np.sin(5 * t), y, HEIGHT])
        omega = natural_frequency(HEIGHT)
        velocity = np.array([0.05 * np.cos(5 * t), 0.24 * np.cos(3 * t), 0.0])
        acceleration = np.array([-0.25 * np.sin(5 * t), -0.72 * np.sin(3 * t), 0.0])
        point = com - acceleration / omega**2 - [0, 0, HEIGHT]
        error = np.array([0.01 * np.cos(4 * t), 0.008 * np.sin(7 * t), 0.0])
        wrenches = np.array([
            [5 * np.sin(t), 10 * np.cos(t), 300 + 200 * np.sin(3 * t), 8 * np.sin(9 * t), 5 * np.cos(8 * t), 1.0],
            [-5 * np.sin(t), 8 * np.cos(2 * t), 300 - 200 * np.sin(3 * t), 4 * np.cos(9 * t), 6 * np.sin(8 * t), -1.0],
        ])  # fmt: skip
        soles = list(SOLES)
        contact = (True, True) if t < 0.6 else (True, False)

        def place(x: np.ndarray) -> np.ndarray:
            return world.act(flip @ x)

        def turn(x: np.ndarray) -> np.ndarray:
            return world.rotation @ (flip @ x)

        if mirror:
            wrenches = wrenches[::-1] * [1, -1, 1, -1, 1, -1]
            soles = [pin.SE3(X.rotation, flip @ X.translation) for X in SOLES[::-1]]
            contact = contact[::-1]
        target = Pendulum(
            place(com),
            turn(velocity),
            turn(acceleration),
            place(point),
            turn(np.array([0.1, 0.2, 0.0])),
            omega,
        )
        result = s.update(
            target, place(com - error), turn(velocity + 3 * error), wrenches,
            [world * X for X in soles], contact, float(yaw), DT, bias=turn(np.array([0.002, 0.001, 0.0]))[:2],
        )  # fmt: skip
        out.append(result)
    return out


@pytest.mark.parametrize("yaw", [0.0, 2.2])
def test_oracle_5_100_m_away_and_turned_it_is_the_same(yaw: float) -> None:
    world = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, yaw), np.array([100.0, -100.0, 2.0]))
    for a, b in zip(random_run(pin.SE3.Identity()), random_run(world), strict=True):
        np.testing.assert_allclose(a.feet.wrenches, b.feet.wrenches, atol=0.02)
        np.testing.assert_allclose(world.rotation @ a.com_acceleration, b.com_acceleration, atol=1e-9)
        for p, q in zip(a.corrections, b.corrections, strict=True):
            np.testing.assert_allclose([p.roll, p.pitch, p.height], [q.roll, q.pitch, q.height], atol=1e-6)


def test_oracle_7_a_cop_error_turns_the_ankle() -> None:
    gains = replace(MC_RTC, cop_admittance=0.01)
    # A CoP 2 cm ahead of where it should be: toes up, away from the ground. The rate is bounded.
    for x, y, roll, pitch in ((0.0, -6.0, 0.0, -0.06), (6.0, 0.0, 0.06, 0.0), (100.0, 0.0, 0.3, 0.0)):
        ankle, felt = FootAdmittance(gains), feet(300.0, 0.0)
        felt[0, 3:5] = x, y
        ankle.update(felt, feet(300.0, 0.0), (True, False), DT)
        assert ankle.correction(0)[3:5] == pytest.approx((roll, pitch))


def test_oracle_8_the_air_disables_and_landing_starts_afresh() -> None:
    s = stabilizer(replace(MC_RTC, dcm_i=10.0, dcm_d=0.5))
    away = [0.01, 0.02, HEIGHT]
    for _ in range(200):
        before = tick(s, com=away, wrenches=STANDING + 1.0)
    assert not before.in_air and np.abs(before.errors.average).max() > 1e-4
    before = tick(s, com=away)
    for _ in range(20):
        flying = tick(s, com=away, wrenches=feet(14.0, 14.9))
    assert flying.in_air
    np.testing.assert_allclose(flying.com_acceleration, 0.0)
    np.testing.assert_array_equal(flying.errors.rate, 0.0)
    for still, last in zip(flying.corrections, before.corrections, strict=True):
        assert last.roll and last.pitch and last.height
        assert (still.roll, still.pitch, still.height) == (last.roll, last.pitch, last.height)
        assert still.roll_rate == still.pitch_rate == still.height_rate == 0.0
    landed = tick(s, com=away, wrenches=feet(200.0, 5.0))
    assert not landed.in_air
    share = 1 - np.exp(-DT / s.gains.integrator_time)
    np.testing.assert_allclose(landed.errors.average, share * landed.errors.dcm, rtol=1e-9)
    np.testing.assert_allclose(landed.errors.rate, 0.0, atol=1e-12)
    assert np.abs(tick(s, com=away).com_acceleration).max() > 0.01


# Algebra


errors_of = st.floats(-0.03, 0.03)


@examples(30)
@given(
    errors_of, errors_of, errors_of, st.floats(0, 8), st.floats(0, 20), st.floats(0, 2), st.integers(0, 100)
)
def test_with_unit_com_gain_it_is_pure_dcm_feedback_on_the_zmp(
    e_com: float, e_velocity: float, other: float, kp: float, ki: float, kd: float, seed: int
) -> None:
    gains = StabilizerGains(dcm_p=kp, dcm_i=ki, dcm_d=kd)
    target = moving(np.random.default_rng(seed))
    omega = target.omega
    com_error, velocity_error = np.array([e_com, other, 0.0]), np.array([3 * e_velocity, other, 0.0])
    dcm = com_error[:2] + velocity_error[:2] / omega
    average, rate = np.array([other, e_com]), np.array([e_velocity, other])
    errors = PendulumErrors(com_error, velocity_error, dcm, average, rate, np.zeros(2))
    acceleration = DcmFeedback(gains).acceleration(target, errors, 0.7)
    point = met(target.com - com_error, acceleration)
    expected = target.zmp[:2] - (1 + kp / omega) * dcm - ki / omega * average - kd / omega * rate
    np.testing.assert_allclose(point[:2], expected, atol=1e-9)


def test_the_zmp_velocity_term() -> None:
    target = REST._replace(zmp_velocity=np.array([0.1, -0.2, 0.0]))
    zero = np.zeros(3)
    errors = PendulumErrors(np.array([0, 0, 0.02]), np.array([0, 0, -0.1]), *[zero[:2]] * 4)
    gains = StabilizerGains(zmp_d=0.05, com_v=0.0)
    expected = [-(REST.omega**2) * 0.05 * 0.1, REST.omega**2 * 0.05 * 0.2, 0.0]
    np.testing.assert_allclose(DcmFeedback(gains).acceleration(target, errors, 0.3), expected, atol=1e-12)


def met(com: Array, acceleration: Array) -> Array:
    """Return the point of the ground at z = 0 through which the force on a CoM goes."""
    return level_zmp(wrench_through(com, acceleration, MASS), np.zeros(3))


def settled(kp: float, ki: float, bias: float) -> float:
    """Return the final place of a pendulum's real CoM in closed loop, forward, m, when a bias is on its measurement."""
    feedback = DcmFeedback(StabilizerGains(dcm_p=kp, dcm_i=ki, max_average_dcm_error=1.0))
    omega, com, velocity, point = REST.omega, np.array([0.02, 0.0, HEIGHT]), np.zeros(3), np.zeros(3)
    for _ in range(round(40.0 / DT)):
        measured = com + [bias, 0.0, 0.0]
        errors = feedback.errors(REST, measured, velocity, point, DT)
        point = met(measured, feedback.acceleration(REST, errors, 0.0))
        c, s = np.cosh(omega * DT), np.sinh(omega * DT)
        away = com[:2] - point[:2]
        com[:2], velocity[:2] = (
            point[:2] + c * away + s * velocity[:2] / omega,
            omega * s * away + c * velocity[:2],
        )
    return float(com[0])


@pytest.mark.parametrize(("kp", "ki", "expected"), [(5.0, 0.0, -16.8), (3.0, 20.0, -11.5)])
def test_the_average_leaves_a_biased_com_where_theory_says(kp: float, ki: float, expected: float) -> None:
    assert 1e3 * settled(kp, ki, bias=0.01) == pytest.approx(expected, abs=0.1)


def test_the_ground_is_never_asked_to_pull() -> None:
    target = REST._replace(com_acceleration=np.array([0.0, 0.0, -2.0 * GRAVITY]))
    s = stabilizer(MC_RTC)
    out = tick(s, target=target, com=[0.01, 0.0, HEIGHT])
    assert out.net_wrench[2] == pytest.approx(0.5 * s.mass * GRAVITY)
    assert out.zmp[0] > 0.01  # beyond the CoM, so that it is pushed back


def test_the_ankle_is_a_lag_whose_rate_is_admittance_times_stiffness() -> None:
    gains = StabilizerGains(cop_admittance=0.01, max_angular_velocity=10.0)
    feet_admittance = FootAdmittance(gains)
    target, torque, times = feet(300.0, 0.0), 0.0, []
    target[0, 3] = 10.0
    for k in range(400):  # the ground gives back −K times the rotation
        torque = -1500.0 * feet_admittance.correction(0).roll
        measured = feet(300.0, 0.0)
        measured[0, 3] = torque
        feet_admittance.update(measured, target, (True, False), 1e-3)
        if torque < 10.0 * (1 - np.exp(-1)):
            times.append(k * 1e-3)
    assert max(times) == pytest.approx(1 / 15.0, rel=0.05)


# Symmetry, period, memory


def test_it_mirrors() -> None:
    mirrored = random_run(pin.SE3.Identity(), mirror=True)
    for a, b in zip(random_run(pin.SE3.Identity()), mirrored, strict=True):
        np.testing.assert_allclose(a.feet.wrenches * [1, -1, 1, -1, 1, -1], b.feet.wrenches[::-1], atol=0.02)
        for p, q in zip(a.corrections, b.corrections[::-1], strict=True):
            np.testing.assert_allclose([p.roll, p.pitch, p.height], [-q.roll, q.pitch, q.height], atol=1e-6)


def off_by(dcm: float, feedback: DcmFeedback, dt: float, zmp: float = 0.0) -> PendulumErrors:
    """Return the errors of a pendulum at rest whose DCM and ZMP are measured off by so much along x and y."""
    return feedback.errors(REST, REST.com - [dcm, dcm, 0.0], np.zeros(3), REST.zmp - zmp, dt)


def test_the_average_is_exact_at_any_period_and_bounded() -> None:
    for dt in (0.1, 0.01):
        feedback = DcmFeedback(replace(MC_RTC, integrator_time=0.3, max_average_dcm_error=0.02))
        for _ in range(round(0.3 / dt)):
            errors = off_by(0.01, feedback, dt)
        np.testing.assert_allclose(errors.average, 0.01 * (1.0 - np.exp(-1.0)))
        for _ in range(round(3.0 / dt)):
            errors = off_by(1.0, feedback, dt)
        np.testing.assert_allclose(errors.average, 0.02)


def test_feet_on_torque_drives_have_no_corrections_and_the_same_wrenches() -> None:
    firm = Stabilizer(MASS, WrenchDistribution(SIZES, DistributionSettings.mc_rtc()), MC_RTC, yields=False)
    soft, away = stabilizer(), [0.01, 0.02, HEIGHT]
    for _ in range(20):
        one, other = (tick(s, com=away, wrenches=STANDING + 1.0) for s in (firm, soft))
    assert one.corrections == (FootCorrection(), FootCorrection())
    assert other.corrections[0] != FootCorrection()
    np.testing.assert_array_equal(one.feet.wrenches, other.feet.wrenches)


def test_the_derivative_drops_offsets_and_keeps_motion() -> None:
    """ė = ω (e − e_zmp), less what lasts."""
    feedback, omega = DcmFeedback(replace(MC_RTC, derivator_time=1.0)), REST.omega
    for k in range(4000):
        rate = off_by(0.0, feedback, DT, zmp=-(0.3 + np.cos(20 * k * DT)) / omega).rate
    assert rate[0] == pytest.approx(np.cos(20 * 3999 * DT), abs=0.06)
    for _ in range(4000):
        rate = off_by(0.02, feedback, DT).rate
    assert rate[1] == pytest.approx(0.0, abs=1e-6)


def test_a_known_bias_changes_nothing_but_the_measurement() -> None:
    """The force goes through the true CoM: with the bias taken out, all outputs are those of the truth."""
    gains = replace(MC_RTC, dcm_p=5.0)
    com, velocity = np.array([0.012, -0.02, HEIGHT]), np.array([0.05, 0.04, 0.0])
    bias = np.array([0.006, -0.004])
    truth = tick(stabilizer(gains), com=com, velocity=velocity)
    # The DCM is off by the bias, and so is the CoM.
    mended = tick(stabilizer(gains), com=com + [*bias, 0.0], velocity=velocity, bias=bias)
    for name in ("com_acceleration", "net_wrench", "zmp"):
        np.testing.assert_allclose(getattr(mended, name), getattr(truth, name), atol=1e-9)
    np.testing.assert_allclose(mended.feet.wrenches, truth.feet.wrenches, atol=1e-3)


def test_the_rate_of_the_dcm_error_is_its_derivative() -> None:
    """Over a ZMP that moves, but for the constant that the high-pass takes off."""
    feedback = DcmFeedback(StabilizerGains(derivator_time=1e6))
    omega, dt = REST.omega, 1e-4
    com, velocity = np.array([0.02, -0.01, HEIGHT]), np.array([-0.05, 0.03, 0.0])
    dcm, rate = [], []
    for k in range(1000):
        point = 0.03 * np.array([np.sin(30 * k * dt), np.cos(20 * k * dt)])
        errors = feedback.errors(REST, com, velocity, point, dt)
        dcm.append(errors.dcm)
        rate.append(errors.rate)
        velocity[:2] += dt * omega**2 * (com[:2] - point)
        com[:2] += dt * velocity[:2]
    slope = np.diff(dcm, axis=0) / dt
    np.testing.assert_allclose(np.array(rate)[1:-1] - rate[1], slope[1:] - slope[1], atol=5e-3)
    assert np.ptp(slope, axis=0).min() > 0.1


def test_the_force_through_the_com_meets_the_ground_at_the_zmp_whatever_its_vertical_part() -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        com, acceleration = rng.normal(size=3) + [0.0, 0.0, 2.0], rng.uniform(-4.0, 4.0, 3)
        reach = (com[2] - 0.3) / (acceleration[2] + GRAVITY)
        expected = [*(com - reach * acceleration)[:2], 0.3]
        found = level_zmp(wrench_through(com, acceleration, MASS), np.array([0.0, 0.0, 0.3]))
        np.testing.assert_allclose(found, expected, atol=1e-9)


# Corrections


@pytest.mark.parametrize("wrench_time", [0.0, 0.05])
def test_feet_turn_by_the_error_of_the_filtered_wrenches_to_the_desired_ones(wrench_time: float) -> None:
    s = stabilizer(replace(MC_RTC, cop_admittance=0.01, wrench_time=wrench_time, dcm_p=5.0))
    filtered = None
    for k in range(10):
        wrenches = STANDING + np.array([[0, 0, 20.0, 3.0, -2.0, 0], [0, 0, -20.0, -1.0, 4.0, 0]]) * np.sin(k)
        out = tick(s, com=[0.01, 0.005, HEIGHT], wrenches=wrenches)
        share = 1.0 if filtered is None or not wrench_time else 1.0 - np.exp(-DT / wrench_time)
        filtered = wrenches if filtered is None else filtered + share * (wrenches - filtered)
        assert np.abs(out.feet.wrenches[:, 3:5]).max() > 1.0
        for felt, wanted, correction in zip(filtered, out.feet.wrenches, out.corrections, strict=True):
            expected = 0.01 * (felt - wanted)[3:5]
            np.testing.assert_allclose((correction.roll_rate, correction.pitch_rate), expected, atol=1e-9)


@pytest.mark.parametrize("mass", [10.0, 39.0, 90.0])
def test_gains_are_those_that_are_assigned_however_often_and_act_by_the_mass(mass: float) -> None:
    s = Stabilizer(20.0, WrenchDistribution(SIZES), StabilizerGains())
    for k in range(3):
        s.gains = replace(s.gains, dcm_p=5.0)
        s.mass = 15.0 + k
    s.mass = mass
    given = StabilizerGains(dcm_p=5.0)
    assert s.gains == given and s.feet.gains == given.for_mass(mass)
    least = given.min_force * min(1.0, mass / 30.0)  # N
    for load, flies in ((0.99 * least, True), (1.01 * least, False)):
        assert tick(s, wrenches=np.array([[0.0, 0.0, load, 0.0, 0.0, 0.0], np.zeros(6)])).in_air is flies


def test_the_usual_admittance_of_the_ankles_is_that_of_40_kg_over_the_mass() -> None:
    for mass in (5.0, 39.0, 62.4, 90.0):
        expected = 0.05 * min(1.0, 40.0 / mass)  # rad/(Nm s)
        assert StabilizerGains().for_mass(mass).cop_admittance == pytest.approx((expected,) * 2)
        assert StabilizerGains(cop_admittance=(0.02, 0.01)).for_mass(mass).cop_admittance == (0.02, 0.01)


@pytest.mark.parametrize("mass", [20.0, 1.5])
def test_the_feet_of_a_light_robot_yield_to_wrenches_in_proportion_as_those_of_one_of_30_kg(
    mass: float,
) -> None:
    """Soles, CoM and times are the same, and so are the rotations and heights of the feet."""
    both = {
        each: Stabilizer(each, WrenchDistribution(SIZES, DistributionSettings(min_force=0.0)))
        for each in (30.0, mass)
    }
    rng = np.random.default_rng(3)
    for _ in range(50):
        error, off = rng.uniform(-0.01, 0.01, 3), rng.normal(size=(2, 6)) * [0.0, 0.0, 30.0, 3.0, 3.0, 0.0]
        heavy, light = (
            tick(s, com=REST.com + error, wrenches=each / 30.0 * (feet(15.0 * GRAVITY, 15.0 * GRAVITY) + off))
            for each, s in both.items()
        )
        np.testing.assert_allclose(light.feet.wrenches, mass / 30.0 * heavy.feet.wrenches, atol=1e-3)
        np.testing.assert_allclose(light.corrections, heavy.corrections, atol=1e-5)
    assert np.abs(heavy.corrections).max() > 1e-3


def test_foot_heights_settle_and_leak() -> None:
    gains = StabilizerGains(force_difference=1e-4, support_height_leak=3.0)
    f = FootAdmittance(gains.for_mass(39.0))
    for _ in range(100):
        f.update(feet(350.0, 250.0), feet(300.0, 300.0), (True, True), DT)
    left, right = f.correction(0), f.correction(1)
    assert left.height == pytest.approx(0.0025, rel=1e-3) and right.height == pytest.approx(-left.height)
    for _ in range(200):
        f.update(feet(600.0, 0.0), feet(600.0, 0.0), (True, False), DT)
    assert f.correction(0).height == pytest.approx(left.height * np.exp(-3.0), rel=1e-3)
    assert f.correction(1).height == right.height and f.correction(1).height_rate == 0.0
    f.reset(1)
    assert f.correction(1) == FootCorrection() and f.correction(0) != FootCorrection()


def test_a_correction_moves_a_foot_in_its_own_axes() -> None:
    yawed = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, np.pi / 2), np.array([1.0, 2.0, 0.0]))
    correction = FootCorrection(roll=0.1, height=0.02, roll_rate=0.5, height_rate=-0.3)
    placement, velocity = correction.apply(yawed)
    np.testing.assert_allclose(placement.translation, [1.0, 2.0, 0.02])
    np.testing.assert_allclose(pin.log3(placement.rotation @ yawed.rotation.T), [0.0, 0.1, 0.0], atol=1e-12)
    in_world = pin.SE3(placement.rotation, np.zeros(3)).act(pin.Motion(velocity)).vector
    np.testing.assert_allclose(in_world, [0, 0, -0.3, 0, 0.5, 0], atol=1e-12)
    placement, velocity = FootCorrection(pitch=0.1, pitch_rate=0.5).apply(pin.SE3.Identity())
    np.testing.assert_allclose(pin.log3(placement.rotation), [0.0, 0.1, 0.0], atol=1e-12)
    np.testing.assert_allclose(velocity, [0, 0, 0, 0, 0.5, 0], atol=1e-12)


# Gains


def test_a_wrench_turns_nothing_level_about_its_zmp_and_moves_that_of_the_feet() -> None:
    rng = np.random.default_rng(8)
    for force, moment, point in rng.uniform(-1.0, 1.0, (6, 3, 3)):
        wrench = np.concatenate([100.0 * force + (0.0, 0.0, 300.0), 40.0 * moment])
        there = level_zmp(wrench, point)
        assert there[2] == point[2]
        np.testing.assert_allclose((wrench[3:] - np.cross(there, wrench[:3]))[:2], 0.0, atol=1e-12)
        about = wrench[3:] - np.cross(point, wrench[:3])
        np.testing.assert_allclose(zmp_offset(wrench, point, 500.0), (about[1] / 500.0, -about[0] / 500.0))


def test_a_robot_that_something_carries_or_that_falls_pushes_on_the_ground_with_the_least_force() -> None:
    """Hands that bear more than the weight, and a CoM that falls faster than gravity, leave the ground no load."""
    carried = np.array([0.0, 0.0, 1.01 * MASS * GRAVITY, 0.0, 0.0, 0.0])
    falls = REST._replace(com_acceleration=np.array([0.0, 0.0, -9.9]))
    for target, options in ((REST, {"outside": carried}), (falls, {"wrenches": feet(0.0, 0.0)})):
        output = tick(stabilizer(), target, **options)
        assert output.net_wrench[2] == pytest.approx(MIN_FORCE)
        assert np.isfinite(output.feet.wrenches).all() and (output.feet.wrenches[:, 2] >= 0.0).all()
