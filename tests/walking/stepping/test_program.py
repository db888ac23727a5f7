"""Program of a step, and the area that holds, against the pendulum in closed form and against another solver."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
import qpsolvers
from hypothesis import example, given
from hypothesis import strategies as st
from pendulum import com_after
from properties import examples

from wbc.core.robot import GRAVITY
from wbc.walking.stepping.felt import HeldArea
from wbc.walking.stepping.law import Orbit
from wbc.walking.stepping.program import COSTS, SHIFT, Bounds, Now, Step, StepProgram, Wish
from wbc.walking.stepping.program import TIME as TIME_COST
from wbc.walking.stepping.settings import RobotSize, SteppingConstants

HEIGHT, TIME, WIDTH = 0.6, 0.36, 0.22
OMEGA = math.sqrt(GRAVITY / HEIGHT)
POINT, SOLE = ((0.0, 0.0), (0.0, 0.0)), ((-0.06, -0.03), (0.06, 0.03))
LEGS = (-0.4, 0.1), (0.4, 0.6)
SIZE = RobotSize(HEIGHT, leg=0.62, mass=33.0, sole=(0.1, 0.05), ankle=0.035, stride=0.5, swing=65.0)

offsets = st.floats(-0.05, 0.05)
velocities = st.tuples(st.floats(-0.4, 0.6), st.floats(-0.15, 0.15))


def wish_of(velocity: tuple[float, float], side: float) -> Wish:
    """Steps of a velocity, forward and left, m/s; the left foot swings if the side is 1."""
    orbit = Orbit.of(velocity, side, WIDTH, TIME, TIME, OMEGA)
    length, drift, b = velocity[0] * TIME, side * velocity[1] * TIME, orbit.ahead
    places = length, WIDTH + drift, length, WIDTH - drift, length, WIDTH + drift
    return Wish(places, (b, -orbit.inwards, b, -orbit.closing, b, -orbit.inwards), TIME)


def start_of(wish: Wish) -> np.ndarray:
    """DCM from the foot that stands at the begin of a step of an orbit, ahead and outwards, m."""
    ahead, outwards, _, _, _, _ = np.array(wish.places) + wish.offsets
    return np.array([ahead, outwards]) / math.exp(OMEGA * TIME)


def solve(
    dcm: np.ndarray,
    wish: Wish,
    area: tuple[tuple[float, float], tuple[float, float]] = POINT,
    last: float = TIME,
) -> Step:
    """Solve a program at the begin of a step."""
    bounds = Bounds(LEGS, area, (0.0, 0.0), (0.12, 0.5))
    now = Now((float(dcm[0]), float(dcm[1])), (0.0, 0.0), OMEGA, TIME, last)
    step = StepProgram(HEIGHT).solve(now, wish, bounds)
    assert step is not None
    return step


class Landing(NamedTuple):
    """End of a step: foot and DCM in the world, side of the foot (1 left), time of the step."""

    foot: np.ndarray
    dcm: np.ndarray
    side: float
    time: float


def walk(
    steps: int,
    velocity: tuple[float, float],
    error: tuple[float, float],
    area: tuple[tuple[float, float], tuple[float, float]] = POINT,
) -> list[Landing]:
    """Steps of a pendulum that does what one program at the begin of each step says, first with the left foot."""
    landings, foot, side = [], np.zeros(2), 1.0
    dcm = start_of(wish_of(velocity, side)) + error
    com = dcm - np.array([0.01, 0.002])  # with the velocity that makes up the rest of the DCM
    speed = (dcm - com) * OMEGA
    for _ in range(steps):
        mirror, last = np.array([1.0, side]), TIME
        for _ in range(8):  # until the time by which the shift counts is that of the solution
            step = solve((dcm - foot) * mirror, wish_of(velocity, side), area, last)
            last = step.left
        com, speed = com_after(com, speed, foot + mirror * step.shift, OMEGA, step.left)
        foot, dcm = foot + mirror * step.place, com + speed / OMEGA
        landings.append(Landing(foot, dcm, side, step.left))
        side = -side
    return landings


@examples(50)
@given(velocities, st.sampled_from([1.0, -1.0]))
def test_steps_on_their_orbit_are_as_asked_for(velocity: tuple[float, float], side: float) -> None:
    wish = wish_of(velocity, side)
    step = solve(start_of(wish), wish, SOLE)
    assert step.place == pytest.approx(wish.places[:2], abs=1e-6)
    assert step.shift == pytest.approx((0.0, 0.0), abs=1e-6)
    assert step.left == pytest.approx(TIME, abs=1e-6)


@examples(30)
@given(velocities, offsets, st.floats(-0.02, 0.04), st.sampled_from([POINT, SOLE]))
def test_an_error_of_the_dcm_dies_out_and_feet_do_not_cross(
    velocity: tuple[float, float], ahead: float, aside: float, area: tuple
) -> None:
    landings = walk(12, velocity, (ahead, aside), area)
    for before, after in zip(landings, landings[1:], strict=False):
        assert after.side * (after.foot[1] - before.foot[1]) >= LEGS[0][1] - 1e-6
    for before, after in zip(landings[-3:], landings[-2:], strict=False):
        orbit = Orbit.of(velocity, after.side, WIDTH, TIME, TIME, OMEGA)
        x, y = after.dcm - after.foot
        assert (x, -after.side * y) == pytest.approx((orbit.ahead, orbit.inwards), abs=2e-3)
        assert after.time == pytest.approx(TIME, abs=5e-3)
        assert after.foot[0] - before.foot[0] == pytest.approx(velocity[0] * TIME, abs=4e-3)


def test_a_sole_that_holds_keeps_places_that_a_point_must_leave() -> None:
    wish = wish_of((0.3, 0.0), 1.0)
    dcm = start_of(wish) + (0.01, 0.01)
    kept, left = (solve(dcm, wish, area).place for area in (SOLE, POINT))
    assert kept == pytest.approx(wish.places[:2], abs=5e-3)
    assert math.dist(left, wish.places[:2]) > 3.0 * math.dist(kept, wish.places[:2])


@examples(30)
@given(offsets, offsets, st.floats(0.1, 0.4))
def test_the_shift_lands_the_pendulum_where_the_program_says(ahead: float, aside: float, left: float) -> None:
    """s0 + b0 is where the closed form takes ξ, once the time of the shift is that of the solution."""
    wish, program, last = wish_of((0.2, 0.0), 1.0), StepProgram(HEIGHT), left
    dcm = start_of(wish) + (ahead, aside)
    for _ in range(30):
        now = Now(tuple(dcm), (0.004, -0.003), OMEGA, left, last)
        step = program.solve(now, wish, Bounds(LEGS, SOLE, (0.0, 0.0), (0.05, 0.5)))
        assert step is not None
        last = step.left
    contact = np.array(step.shift) + (0.004, -0.003)
    there = contact + (dcm - contact) * math.exp(OMEGA * step.left)
    np.testing.assert_allclose(program.x[:2] + program.x[11:13], there, atol=1e-4)


@examples(30)
@given(offsets, offsets, st.floats(0.0, 0.25), velocities)
@example(0.02, -0.07, 0.0, (0.2, 0.0))
@example(0.05, -0.06, 0.05, (0.0, 0.0))
def test_solutions_that_follow_each_other_find_the_best_of_all_times(
    ahead: float, aside: float, elapsed: float, velocity: tuple[float, float]
) -> None:
    """Also where the centre of pressure goes past ξ, so that a longer step brings it back.

    For one time alone the equations are linear, so that one solution is exact.
    """
    wish, left, times = wish_of(velocity, 1.0), TIME - elapsed, (max(0.1 - elapsed, 0.0), 0.45 - elapsed)
    dcm = tuple(start_of(wish) * math.exp(OMEGA * elapsed) + (ahead, aside))
    contact, bounds = (0.004, -0.003), Bounds(LEGS, SOLE, (0.02, 0.01), times)
    if dcm[1] < SOLE[0][1] + contact[1]:
        return  # nothing brings it back
    program, now = StepProgram(HEIGHT), Now(dcm, contact, OMEGA, left, left)
    for _ in range(15):
        step = program.solve(now, wish, bounds)
        assert step is not None
        now = now._replace(last=step.left, shift=step.shift)
    best, costs = StepProgram(HEIGHT), []
    for time in np.linspace(*times, 60):
        one = bounds._replace(times=(time, time))
        if best.solve(Now(dcm, contact, OMEGA, left, time), wish, one) is not None:
            costs.append(_cost(best))
    assert _cost(program) <= min(costs) + 1e-5


@examples(30)
@given(offsets, offsets, velocities)
def test_another_solver_finds_the_same_step(
    ahead: float, aside: float, velocity: tuple[float, float]
) -> None:
    wish, program = wish_of(velocity, 1.0), StepProgram(HEIGHT)
    dcm = start_of(wish) + (ahead, aside)
    bounds = Bounds(LEGS, SOLE, (0.02, 0.01), (0.12, 0.5))
    assert program.solve(Now(tuple(dcm), (0.0, 0.0), OMEGA, TIME, TIME), wish, bounds)
    rows, low, high = program._rows, program._lower, program._upper
    x = qpsolvers.solve_qp(
        program._hessian, program._gradient, A=rows, b=low[17:], lb=low[:17], ub=high[:17], solver="proxqp",
        eps_abs=1e-9,
    )  # fmt: skip
    np.testing.assert_allclose(program.x, x, atol=1e-5)


@examples(20)
@given(st.tuples(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02)))
def test_a_landing_that_is_held_costs_what_its_stiffness_says(move: tuple[float, float]) -> None:
    """Without bounds that hold."""
    wish, program, wide = wish_of((0.2, 0.0), 1.0), StepProgram(HEIGHT), ((-9.0, -9.0), (9.0, 9.0))
    free = Bounds(LEGS, wide, (9.0, 9.0), (0.01, 2.0))
    now = Now(tuple(start_of(wish) + (0.01, 0.005)), (0.0, 0.0), OMEGA, TIME, TIME)
    step = program.solve(now, wish, free)
    assert step is not None
    stiffness, least = program.stiffness(wide), _cost(program)
    held = ((step.place[0] + move[0], step.place[1] + move[1]),) * 2
    assert program.solve(now, wish, free, held)
    delta = np.array(move)
    assert _cost(program) - least == pytest.approx(0.5 * delta @ stiffness @ delta, rel=1e-2, abs=1e-7)


def _cost(program: StepProgram) -> float:
    x = program.x
    return float(0.5 * x @ program._hessian @ x + program._gradient @ x)


def test_on_level_ground_the_area_of_a_narrow_sole_counts_in_full_and_grows_sooner() -> None:
    """On rough ground it is as small as a narrow sole makes it, and the width that sets the time of steps always is."""
    c, dt, weight = SteppingConstants().in_si(SIZE), 0.002, 300.0
    sole, found = (0.085, 0.03), {}
    for level in (0.0, 1.0):
        area = HeldArea(sole, c.area, dt)
        for ticks in (10, 1000):
            for _ in range(ticks):
                area.update((0.0, 0.0), (0.0, 0.0, weight, 0.0, 0.0, 0.0), level)
            found[level, ticks] = area.ahead[1] - area.ahead[0], area.width
    assert found[1.0, 1000][0] == pytest.approx(2.0 * (sole[0] - c.area.margin))
    assert found[0.0, 1000][0] < 0.5 * found[1.0, 1000][0]
    assert found[1.0, 10][0] > 3.0 * found[0.0, 10][0]
    assert found[1.0, 1000][1] == found[0.0, 1000][1]


@pytest.mark.parametrize("size", [0.0, 0.02, 0.2])
def test_a_landing_is_the_stiffer_the_smaller_the_area_of_the_pressure_is(size: float) -> None:
    """By the conditions of optimality, with a shift over the whole area at a thousandth of the cost of the time."""
    program, wish = StepProgram(HEIGHT), wish_of((0.2, 0.05), 1.0)
    area = ((-0.5 * size, -0.5 * size), (0.5 * size, 0.5 * size))
    now = Now(tuple(start_of(wish)), (0.0, 0.0), OMEGA, TIME, TIME)
    bounds = Bounds(LEGS, area, (0.0, 0.0), (0.12, 0.5))
    assert program.solve(now, wish, bounds) is not None
    costs = COSTS.copy()
    costs[TIME_COST] *= HEIGHT**2
    costs[SHIFT] += 1e-3 * costs[TIME_COST] / max(size, 1e-6) ** 2
    rows, held = program._rows, np.eye(17)[:2]
    matrix = np.block(
        [[np.diag(costs), np.vstack((rows, held)).T], [np.vstack((rows, held)), np.zeros((8, 8))]]
    )
    found = np.linalg.solve(matrix, np.vstack((np.zeros((23, 2)), np.eye(2))))[:17]
    np.testing.assert_allclose(program.stiffness(area), found.T @ np.diag(costs) @ found, rtol=1e-4)


def test_an_area_ends_where_the_foot_turns_and_counts_by_the_width_of_the_sole() -> None:
    """Moments over force are where it presses; a foot whose heights change at a rate turns over an edge."""
    c = SteppingConstants().in_si(SIZE)
    least, full = c.area.trusted
    for half, trust in ((least, 0.0), (0.5 * (least + full), 0.5), (full, 1.0), (2.0 * full, 1.0)):
        area = HeldArea((0.1, half), c.area, 0.004)
        assert area.widest == pytest.approx(trust * max(half - c.area.margin, 0.0))
    force, roomy = SIZE.weight, (0.2, 0.15)
    for rate, turns in ((5.0, True), (0.5, False)):  # a rate is low-passed
        area = HeldArea(roomy, c.area, 0.004)
        for _ in range(200):
            area.update((0.0, 0.0), (0.0, 0.0, force, 0.0, 0.0, 0.0), 0.0)
        full = area.aside[1]
        area.update((0.0, -rate * c.area.turning / area._spin_gain), (0.0, 0.0, force, 0.0, 0.0, 0.0), 0.0)
        assert (area.aside[1] < full) is turns
    for axis, sign in ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)):
        area, rates = HeldArea(roomy, c.area, 0.004), [0.0, 0.0]
        for _ in range(3000):
            area.update((0.0, 0.0), (0.0, 0.0, force, 0.0, 0.0, 0.0), 0.0)
        most = (roomy[0] - c.area.margin - c.area.carrying, roomy[1] - c.area.margin)
        assert area.ahead[1] == pytest.approx(most[0]) and area.aside[1] == pytest.approx(most[1])
        assert area.ahead[0] == pytest.approx(c.area.margin - roomy[0] - c.area.carrying)
        edges = [list(area.ahead), list(area.aside)]
        cop = sign * 0.04 + (c.area.carrying if axis == 0 else 0.0)  # 40 mm from the carrying point
        at = [0.0, 0.0]
        at[axis] = cop
        rates[axis] = -sign * 1.5 * c.area.turning  # the end where it presses goes down
        for _ in range(60):
            area.update((rates[0], rates[1]), (0.0, 0.0, force, at[1] * force, -at[0] * force, 0.0), 0.0)
        found = [area.ahead, area.aside]
        end = 1 if sign > 0.0 else 0
        assert found[axis][end] == pytest.approx(sign * (0.04 - c.area.inside), abs=1e-9)
        assert found[axis][1 - end] == edges[axis][1 - end] and found[1 - axis] == edges[1 - axis]
        light = (0.0, 0.0, 0.9 * c.area.carries, 0.0, 0.0, 0.0)
        area.update((rates[0], rates[1]), light, 0.0)
        assert found == [area.ahead, area.aside], "a foot that hardly carries says nothing"
