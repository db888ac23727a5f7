"""Orbits of free steps, their times, the ceiling of the CoM, and gains by the size of the robot, in closed form."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from point_mass import SCALE, scaled
from properties import examples
from task_factory import make_robot

from wbc.core.robot import GRAVITY
from wbc.walking.stepping.course import RiseLimit
from wbc.walking.stepping.gait import SteppingWalk
from wbc.walking.stepping.law import Orbit, Pace, takes_over, viability
from wbc.walking.stepping.settings import SteppingConstants, SteppingSettings
from wbc.walking.table import free_table

DT = 0.004
CONSTANTS, SETTINGS = SteppingConstants().in_si(SCALE), SteppingSettings().in_si(SCALE)
OMEGA = math.sqrt(GRAVITY / SCALE.height)


@examples(25)
@given(st.tuples(st.floats(-0.5, 0.5), st.floats(-0.1, 0.1)), st.floats(0.25, 0.6), st.floats(0.25, 0.6))
def test_an_orbit_repeats_itself_over_two_steps(
    velocity: tuple[float, float], time: float, pace: float
) -> None:
    """E b = s + b, of the offsets ahead and across, with the time that steps take in the one ahead."""
    for side in (1.0, -1.0):
        orbit = Orbit.of(velocity, side, 0.3, time, pace, OMEGA)
        grown = math.exp(OMEGA * pace)
        assert grown * orbit.ahead == pytest.approx(velocity[0] * pace + orbit.ahead, abs=1e-12)
        assert orbit.forward == pytest.approx(grown * orbit.ahead)
        grown, drift = math.exp(OMEGA * time), side * velocity[1] * time
        if abs(drift) / (grown - 1.0) < 0.79 * 0.3 / (1.0 + grown):
            assert grown * orbit.inwards == pytest.approx(0.3 - drift - orbit.closing)
            assert grown * orbit.closing == pytest.approx(0.3 + drift - orbit.inwards)


def test_viability_and_taking_over_are_ratios_of_offsets() -> None:
    orbit, stretch = Orbit(0.04, 0.08, 0.08, 0.1), 0.06
    assert viability(0.001, 0.16, orbit, stretch) == pytest.approx(0.5)
    assert viability(0.001, 0.0, orbit, stretch) == pytest.approx(0.07 / 1e-3)
    assert viability(-0.14, 0.01, orbit, stretch) == pytest.approx(0.5)
    grown = math.exp(0.2) - 1.0
    # Aside alone, 0.1 inwards of the new foot, ξ moves by `grown` of its way from the old one: less is needed then.
    for inwards, here in ((0.15, 0.1), (0.15, -0.1), (0.1, 0.1)):
        now, later = 0.08 / inwards, 0.08 / (inwards - grown * here)
        expected = now >= min(later, 1.0 / 1.5)
        assert takes_over((0.0, inwards), (0.0, here), orbit, stretch, 0.2, 1.5) == expected
    for ahead, on in ((0.1, 0.3), (0.1, -0.3), (0.2, 0.1)):
        now, later = 0.07 / ahead, 0.07 / abs(ahead + grown * on)
        expected = now >= min(later, 1.0 / 1.2)
        assert takes_over((ahead, 0.01), (on, 0.0), orbit, stretch, 0.2, 1.2) == expected


@pytest.mark.parametrize("effort", [0.3, 0.6])
def test_a_fast_step_takes_the_time_in_which_hips_swing_a_leg_over_two_steps(effort: float) -> None:
    """Of a quintic over 2 v T in the share t of T: 10/√3 · 2 v T / (t T)² is what the hips give."""
    settings = dataclasses.replace(SETTINGS, effort=effort)
    pace = Pace.of(CONSTANTS, settings, SCALE)
    for speed in (2.5, -4.0):
        time = pace.time(speed, 0.3)
        asked = 10.0 / math.sqrt(3.0) * 2.0 * abs(speed) * time / (CONSTANTS.swing.late_touch * time) ** 2
        assert asked == pytest.approx(effort * SCALE.swing) or time > abs(speed) / pace.swing
    assert pace.time(4.0, 1e-3) == pytest.approx(4.0 / pace.swing)
    assert pace.time(0.0, 0.35) == 0.35
    assert pace.time(CONSTANTS.time.brisk * 0.5, 0.35) == pytest.approx(0.35 * (1.0 + 0.5**4) ** 0.125)


@pytest.mark.parametrize("room", [0.02, 0.005, -0.01])
def test_the_com_slows_down_under_its_ceiling_with_half_of_gravity_and_comes_back_from_above(
    room: float,
) -> None:
    """With v² = 2 (g/2) d the speed ends at the ceiling; beyond it the way back has a time constant of 0.1 s."""
    robot, limit = make_robot("g1"), RiseLimit(0.03)
    robot.update(robot.q, np.zeros(robot.nv))
    limit.bind(robot)
    limit.height = float(robot.com[2]) + room - 0.03
    rows, lower, upper = np.zeros((1, robot.nv)), np.zeros(1), np.zeros(1)
    limit.write(DT, rows, lower, upper)
    speed = math.sqrt(GRAVITY * room) if room > 0.0 else room / 0.1
    # At rest the CoM has no acceleration of its own, so that the bound is that of z̈: the speed in 20 ms.
    assert upper[0] == pytest.approx(max(speed / 0.02, -0.5 * GRAVITY), rel=1e-6)
    np.testing.assert_allclose(rows[0], robot.com_jacobian[2], atol=1e-12)
    assert lower[0] == -np.inf
    limit.height = math.inf
    limit.write(DT, rows, lower, upper)
    assert upper[0] == np.inf and not rows.any()


def test_gains_and_costs_of_free_steps_go_with_the_size_of_the_robot() -> None:
    """Stiffness in 1/s² by 1/k, damping in 1/s by √(1/k), costs of rotations by k², of forces by the inverse mass²."""
    robot, k = make_robot("g1"), 2.0
    tables = [
        free_table(robot, SteppingWalk(SteppingSettings(), size, 0.0, DT)) for size in (SCALE, scaled(k))
    ]
    one, two = tables
    for name in ("stiffness", "damping"):
        power = -1.0 if name == "stiffness" else -0.5
        pairs = [(one.com, two.com), (one.posture, two.posture)]
        found = [(getattr(a, name), getattr(b, name)) for a, b in pairs]
        found += [(one.swing[name], two.swing[name])]
        found += [(a[name], b[name]) for a, b in zip(one.trunk, two.trunk, strict=True)]
        if name == "stiffness":
            found += [(one.twist[name], two.twist[name])]
        found += [
            (getattr(one.feet, part)[name == "damping"], getattr(two.feet, part)[name == "damping"])
            for part in ("shift", "stand")
        ]
        for a, b in found:
            np.testing.assert_allclose(b, k**power * np.asarray(a), rtol=1e-9)
    turning = np.array([1.0, 1.0, 1.0, k**2, k**2, k**2])
    np.testing.assert_allclose(two.swing["weight"], turning * one.swing["weight"])
    for part in ("single", "firm"):
        np.testing.assert_allclose(getattr(two.feet, part), turning * getattr(one.feet, part))
    for a, b in zip((*one.trunk, one.twist), (*two.trunk, two.twist), strict=True):
        np.testing.assert_allclose(b["weight"], k**2 * np.asarray(a["weight"]))
    np.testing.assert_allclose(two.posture.weight, k**2 * one.posture.weight)
    np.testing.assert_allclose(two.com.weight, one.com.weight)
    for a, b in zip(one.contacts, two.contacts, strict=True):
        np.testing.assert_allclose(b.wrench_weight, a.wrench_weight / k**6 / turning)
        np.testing.assert_allclose(b.damping, a.damping / math.sqrt(k))
    assert two.rise.slack == pytest.approx(k * one.rise.slack)
