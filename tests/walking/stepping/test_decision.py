"""Decision of a step in closed form: steps on their orbit, along footsteps, in the time that legs need, and bounds."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from point_mass import SCALE
from properties import examples

from wbc.core.robot import GRAVITY, SIDES
from wbc.walking.ground import GroundEstimate
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.stepping.decision import (
    STAIR_TIME,
    StepDecision,
    StepState,
)
from wbc.walking.stepping.law import Divergent, Orbit, StanceAxes
from wbc.walking.stepping.path import steps_of_plan, steps_of_velocity
from wbc.walking.stepping.program import Bounds, Now, Step
from wbc.walking.stepping.settings import GaitValues, SteppingConstants, SteppingSettings

DT = 0.004
CONSTANTS, SETTINGS = SteppingConstants().in_si(SCALE), SteppingSettings().in_si(SCALE)
OMEGA = math.sqrt(GRAVITY / SCALE.height)
POINT = (0.0, 0.0, 0.0)
AT_REST = Now((0.0, 0.0), (0.0, 0.0), OMEGA, 0.3, 0.3)

lengths, angles = st.floats(-0.6, 0.6), st.floats(-math.pi, math.pi)


def decision() -> StepDecision:
    return StepDecision(GaitValues(SETTINGS, CONSTANTS, SCALE, DT), GroundEstimate(0.5, 0.0, 0.2))


@examples(25)
@given(
    st.sampled_from([1.0, -1.0]),
    angles,
    st.tuples(lengths, lengths),
    st.tuples(st.floats(-0.2, 0.35), st.floats(-0.1, 0.1)),
    st.floats(0.05, 0.9),
)
def test_a_step_on_its_orbit_stays_as_it_is_asked_for_at_any_time_of_it_and_in_any_direction(
    side: float, yaw: float, pivot: tuple[float, float], velocity: tuple[float, float], share: float
) -> None:
    """ξ moves away from the foot by e^{ωt}: where it is on the orbit, place and time are the nominal ones."""
    made, time, width = decision(), SETTINGS.step_time, SETTINGS.width
    orbit = Orbit.of(velocity, side, width, time, time, OMEGA)
    cos, sin = math.cos(yaw), math.sin(yaw)
    fall = math.exp(-OMEGA * time * (1.0 - share))
    length, beside = velocity[0] * time, width + side * velocity[1] * time
    end = length + orbit.ahead, beside - orbit.inwards
    ahead, left = fall * end[0], side * fall * end[1]
    swing = (pivot[0], pivot[1], 0.0, 0.0)
    contact = (*pivot, 0.0)
    dcm = Divergent(pivot[0] + cos * ahead - sin * left, pivot[1] + sin * ahead + cos * left, OMEGA)
    axes = StanceAxes(side, (cos, sin), contact)
    stance = StepState(axes, contact, contact, dcm, orbit, time, 2.0 * time, share * time, swing, 0.06)
    assert stance.axes.offset(*stance.axes.point(0.3, -0.2)) == pytest.approx((0.3, -0.2))
    assert stance.axes.offset(dcm.x, dcm.y) == pytest.approx((fall * end[0], fall * end[1]))
    wish = steps_of_velocity(velocity, width, stance)
    assert wish.places == pytest.approx(
        (length, beside, length, width - side * velocity[1] * time, length, beside)
    )
    made._time_for_legs = lambda *_: None  # type: ignore[method-assign]
    made.decide(stance, wish, None)
    assert made.end == pytest.approx(time, abs=1e-5) and made.urgency == 0.0
    expected = stance.axes.point(length - CONSTANTS.area.carrying, beside)
    assert made.place == pytest.approx(expected, abs=1e-5)
    made.press()
    assert made.cop == pytest.approx((0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("count", [1, 2, 3, 5, 6])
def test_footsteps_are_walked_by_a_pendulum_that_rests_in_the_middle_of_the_last_two(count: int) -> None:
    """From step to step ξ − p grows by E about the foot that stands; it is known backwards from its rest."""
    side, time = 1.0, SETTINGS.step_time
    growth, carrying = math.exp(OMEGA * time), CONSTANTS.area.carrying
    steps = [
        Footstep(SIDES[k % 2], 0.1 + 0.15 * k, (0.12 if k % 2 == 0 else -0.1) + 0.01 * k, yaw=0.05 * k)
        for k in range(count)
    ]
    pivot = (carrying, -0.11, 0.0)
    axes = StanceAxes(side, (1.0, 0.0), pivot)
    wish = steps_of_plan(steps, carrying, SETTINGS.width, axes, OMEGA, time)
    feet = [np.array(pivot[:2])] + [
        np.array([s.x + carrying * math.cos(s.yaw), s.y + carrying * math.sin(s.yaw)]) for s in steps
    ]
    ends, mirror = [0.5 * (feet[-1] + feet[-2])], np.array([[1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
    for foot in feet[-2:0:-1]:
        ends.insert(0, foot + (ends[0] - foot) / growth)
    offsets = np.reshape(wish.offsets, (3, 2)) * mirror
    ways = np.reshape(wish.places, (3, 2)) * mirror
    for k in range(min(count, 3)):
        np.testing.assert_allclose(ways[k], feet[k + 1] - feet[k], atol=1e-12)
        np.testing.assert_allclose(offsets[k], ends[k] - feet[k + 1], atol=1e-12)
    for k in range(1, 3):  # whatever leads on from there obeys the law as well
        np.testing.assert_allclose(growth * offsets[k - 1], ways[k] + offsets[k], atol=1e-9)
        assert ways[k, 0] == pytest.approx(0.0) or k < count
        assert abs(ways[k, 1]) == pytest.approx(SETTINGS.width) or k < count
        assert ways[k, 1] * ways[k - 1, 1] < 0.0


@examples(20)
@given(st.tuples(*[st.floats(-0.05, 0.05)] * 2), st.tuples(*[st.floats(-0.05, 0.05)] * 2))
def test_the_centre_of_pressure_moves_at_no_more_than_its_speed(
    now: tuple[float, float], wanted: tuple[float, float]
) -> None:
    made, most = decision(), CONSTANTS.area.cop_speed * DT
    made.cop, made._wanted = now, wanted
    made.press()
    for before, goal, after in zip(now, wanted, made.cop, strict=True):
        assert after == pytest.approx(
            goal if abs(goal - before) <= most else before + math.copysign(most, goal - before)
        )


def stance_at(
    swing: tuple[float, float, float, float],
    dcm: tuple[float, float] = (0.0, 0.0),
    elapsed: float = 0.1,
    speed: float = 0.0,
    longest: float = 0.5,
) -> StepState:
    """State on a right foot that carries at the origin, in the heading of x, of a walk at a speed, m/s."""
    orbit = Orbit.of((speed, 0.0), 1.0, SETTINGS.width, SETTINGS.step_time, SETTINGS.step_time, OMEGA)
    axes, xi = StanceAxes(1.0, (1.0, 0.0), POINT), Divergent(*dcm, OMEGA)
    return StepState(axes, POINT, POINT, xi, orbit, SETTINGS.step_time, longest, elapsed, swing, 0.06)


def walking_at(dcm: tuple[float, float], elapsed: float) -> StepState:
    """The same in a walk ahead."""
    return stance_at((0.2, 0.2, 0.0, 0.0), dcm, elapsed, 0.2, 2.0 * SETTINGS.step_time)


def test_a_foot_reaches_in_a_time_what_a_quintic_of_its_greatest_acceleration_passes() -> None:
    """t² a √3/10 about where it is; the places stay within those of steps."""
    made, time = decision(), 0.05
    way = math.sqrt(3.0) / 10.0 * CONSTANTS.swing.swing_push * time**2
    low, high = made._way(stance_at((0.05, 0.3, 0.0, 0.0))).reached(time, made._places)
    here = np.array([0.05 + CONSTANTS.area.carrying, 0.3])
    np.testing.assert_allclose((low, high), (here - way, here + way), atol=1e-12)
    low, high = made._way(stance_at((-0.9, 0.1, 0.0, 0.0))).reached(time, made._places)
    assert low == (-SETTINGS.reach, SETTINGS.gap) and high[0] == -SETTINGS.reach
    low, high = made._way(stance_at((0.9, 1.9, 0.0, 0.0))).reached(time, made._places)
    assert high == (SETTINGS.reach, SETTINGS.widest) == low


@pytest.mark.parametrize("speed", [0.0, 0.8, -0.8])
def test_a_step_is_put_off_until_the_foot_can_pass_its_way(speed: float) -> None:
    """A place that stays: v t/2 + a t² √3/10 is the way of a quintic that comes to rest after t."""
    made, a = decision(), CONSTANTS.swing.swing_push * math.sqrt(3.0) / 10.0
    far = 0.35
    stance = stance_at((-CONSTANTS.area.carrying, 0.1, 0.0, speed))._replace(longest=0.52)
    step = Step((0.0, 0.1 + far), (0.0, 0.0), 0.02)
    bounds = Bounds(((-1.0, 0.0), (1.0, 1.0)), ((0.0, 0.0), (0.0, 0.0)), (0.0, 0.0), (0.0, 1.0))
    wish = steps_of_velocity((0.0, 0.0), SETTINGS.width, stance)
    fixed = wish._replace(offsets=(0.0, -(0.1 + far), *wish.offsets[2:]))
    later = made._time_for_legs(stance, step, AT_REST, fixed, bounds)
    times = 0.02 + 0.4 * np.arange(1, 9) / 8
    missed = np.maximum(far - (0.5 * speed + a * times) * times, 0.0)
    expected = times[int(np.argmax(missed < 0.02))]
    assert later == pytest.approx(expected)


@pytest.mark.parametrize("share", [-0.5, 0.0, 0.3, 1.0, 2.0])
def test_urgency_grows_in_a_line_with_the_distance_of_a_landing_from_the_one_asked_for(share: float) -> None:
    made, (near, far) = decision(), CONSTANTS.swing.urgent
    off = near + share * (far - near)
    made._program.solve = lambda *_: Step((0.0, SETTINGS.width + off), (0.0, 0.0), 0.3)  # type: ignore[method-assign]
    made._time_for_legs = lambda *_: None  # type: ignore[method-assign]
    stance = stance_at((0.0, 0.22, 0.0, 0.0))
    made.decide(stance, steps_of_velocity((0.0, 0.0), SETTINGS.width, stance), None)
    assert made.urgency == pytest.approx(min(max(share, 0.0), 1.0))
    assert made.end == pytest.approx(0.1 + 0.3)
    assert made.place == pytest.approx((-CONSTANTS.area.carrying, SETTINGS.width + off))


def test_times_of_a_step_are_bounded_by_the_settings_and_by_where_the_dcm_runs_ahead() -> None:
    made, s, stretch = decision(), SETTINGS, CONSTANTS.time.stretch
    stance = stance_at((0.0, 0.22, 0.0, 0.0))
    held = made._bounds(stance._replace(longest=0.6), (0.0, 0.05))
    assert held.times == pytest.approx((s.shortest - 0.1, 0.5)) and held.places == (
        (-s.reach, s.gap),
        (s.reach, s.widest),
    )
    assert held.next_area == pytest.approx([CONSTANTS.area.next_area * half for half in SCALE.sole])
    # ξ at 60 mm reaches the stretch after ln(stretch / 60 mm) / ω.
    ahead = 0.3 * stretch
    assert made._bounds(stance._replace(longest=9.0), (ahead, 0.05)).times[1] == pytest.approx(
        max(math.log(1.0 / 0.3) / OMEGA, s.shortest - 0.1)
    )
    walks = stance._replace(longest=9.0, orbit=Orbit.of((0.4, 0.0), 1.0, s.width, 0.4, 0.4, OMEGA))
    reach = abs(walks.orbit.forward) + stretch
    assert made._bounds(walks, (-0.1 * reach, 0.05)).times[1] == pytest.approx(math.log(10.0) / OMEGA)
    made.area.ahead, made.area.aside = [-0.01, 0.02], [-0.03, 0.04]
    for side, low, high in ((1.0, -0.03, 0.04), (-1.0, -0.04, 0.03)):
        turned = stance._replace(axes=stance.axes._replace(side=side))
        area = made._bounds(turned, (0.0, 0.05)).area
        assert area == ((-0.01, low), (0.02, high))


@pytest.mark.parametrize("yaw", [0.0, 2.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_program_counts_what_the_measured_pressure_is_off_the_commanded_one_up_to_a_bound(
    yaw: float, side: float
) -> None:
    """Both are parts along the heading and to the side of the foot that swings; ξ is bounded from there."""
    made, most, found = decision(), CONSTANTS.area.cop_error, []
    cos, sin = math.cos(yaw), math.sin(yaw)

    def world(ahead: float, outwards: float) -> tuple[float, float, float]:
        left = side * outwards
        return 0.4 + cos * ahead - sin * left, -0.3 + sin * ahead + cos * left, 0.0

    made._bounds = lambda _, runs, *__, **___: found.append(runs) or bounds  # type: ignore[method-assign, func-returns-value]
    made._program.solve = lambda now, *_: found.append((*now.dcm, *now.contact))  # type: ignore[method-assign, assignment]
    bounds = Bounds(((-1.0, 0.0), (1.0, 1.0)), ((0.0, 0.0), (0.0, 0.0)), (0.0, 0.0), (0.0, 1.0))
    for off, counted in (
        ((0.01, -0.02), (0.01, -0.02)),
        ((1.0, 1.0), (most, most)),
        ((-1.0, -1.0), (-most, -most)),
    ):
        x, y, _ = world(0.05, 0.1)
        stance = stance_at((0.0, 0.22, 0.0, 0.0), (x, y))._replace(
            axes=StanceAxes(side, (cos, sin), world(0.0, 0.0)),
            cop_command=world(0.02, 0.01),
            contact=world(0.02 + off[0], 0.01 + off[1]),
        )
        found.clear()
        made.decide(stance, steps_of_velocity((0.0, 0.0), SETTINGS.width, stance), None)
        assert found[0] == pytest.approx((0.05 - counted[0], 0.1 - counted[1]))
        assert found[1] == pytest.approx((0.05, 0.1, *counted))
        assert made.place == pytest.approx(world(-CONSTANTS.area.carrying, SETTINGS.width)[:2]), (
            "the program fails"
        )
        made.begin()


def test_a_place_out_of_reach_is_missed_by_what_lies_beyond_it_at_any_time() -> None:
    """A foot that comes to the edge of its reach is put off no further."""
    made = decision()
    stance = stance_at((-CONSTANTS.area.carrying, 0.1, 0.0, 0.0))._replace(longest=0.52)
    step = Step((0.0, 0.6), (0.0, 0.0), 0.02)
    bounds = Bounds(((-1.0, 0.0), (1.0, 0.35)), ((0.0, 0.0), (0.0, 0.0)), (0.0, 0.0), (0.0, 1.0))
    wish = steps_of_velocity((0.0, 0.0), SETTINGS.width, stance)
    fixed = wish._replace(offsets=(0.0, -0.6, *wish.offsets[2:]))
    a = CONSTANTS.swing.swing_push * math.sqrt(3.0) / 10.0
    times = 0.02 + 0.4 * np.arange(1, 9) / 8
    missed = np.maximum(0.25 - a * times**2, 0.0)
    assert made._time_for_legs(stance, step, AT_REST, fixed, bounds) == pytest.approx(
        times[int(np.argmax(missed <= 0.0))]
    )


class Seen(GroundEstimate):
    """Ground that keeps what a place on it is asked with, and puts the foot 20 mm ahead."""

    def choose(self, landing: Footstep, allowed: object, cost: object = None) -> Footstep:
        """Keep the questions."""
        self.asked = landing, allowed, cost
        return dataclasses.replace(landing, x=landing.x + 0.02)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_place_on_seen_ground_costs_what_the_program_says_within_the_bounds_of_steps(side: float) -> None:
    """δᵀ K δ / 2 of the program, over its own cost in h²; the sole's centre is behind its carrying point."""
    ground = Seen(0.5, 0.0, 0.2)
    made = StepDecision(GaitValues(SETTINGS, CONSTANTS, SCALE, DT), ground)
    stance = stance_at((0.0, side * 0.22, 0.0, 0.0), (0.02, side * 0.1), 0.2)
    stance = stance._replace(axes=stance.axes._replace(side=side))
    wish = steps_of_velocity((0.1, 0.0), SETTINGS.width, stance)
    made.decide(stance, wish, None)
    free = made.place
    area = made._bounds(stance, (0.0, 0.0)).area
    stiffness = made._program.stiffness(area)
    chosen = made._choose(stance, area, free, 0.3)
    assert chosen == pytest.approx((free[0] + 0.02, free[1]))
    landing, allowed, cost = ground.asked
    assert (landing.x, landing.y, landing.side) == (*free, "left" if side > 0.0 else "right")
    for u, v in ((0.01, 0.0), (0.0, 0.02), (0.03, -0.01)):
        delta = np.array([u, side * v])
        expected = 0.5 * delta @ stiffness @ delta * CONSTANTS.swing.balance_cost / SCALE.height**2
        assert cost(np.array([u + 1j * v]))[0] == pytest.approx(expected)
    x, s = -CONSTANTS.area.carrying, SETTINGS
    for ahead, outwards, within in (
        (0.99 * s.reach, 0.3, True),
        (1.01 * s.reach, 0.3, False),
        (-1.01 * s.reach, 0.3, False),
        (0.0, 1.01 * s.gap, True),
        (0.0, 0.99 * s.gap, False),
        (0.0, 0.99 * s.widest, True),
        (0.0, 1.01 * s.widest, False),
    ):
        assert allowed(x + ahead, side * outwards) == within
    assert made._choose(stance, area, (free[0] + 0.5 * CONSTANTS.swing.again, free[1]), 0.3) == chosen, (
        "it has hardly moved"
    )
    again = made._choose(stance, area, (free[0] + 1.5 * CONSTANTS.swing.again, free[1]), 0.3)
    assert again == pytest.approx((free[0] + 1.5 * CONSTANTS.swing.again + 0.02, free[1]))
    early = stance._replace(elapsed=0.9 * CONSTANTS.swing.choice * 0.4 / CONSTANTS.swing.touch)
    moved = (free[0] + 9.0, free[1])
    assert made._choose(early, area, moved, 0.4 - early.elapsed) == again, "it is too early"
    assert made._choose(stance, area, moved, 0.11) == again, "it is too late"


def test_a_foot_is_put_down_at_once_where_that_leaves_the_shorter_step() -> None:
    """Of ξ beyond the outer edge: the step after next is to where ξ is after the shortest time, from either place.

    All ways are between carrying points: what is ahead of them and what is behind them are mirror images.
    """
    closing, found = SETTINGS.shortest - 0.05, set()
    for ahead in (-0.12, -0.08, 0.0, 0.08, 0.12):
        for beyond in (0.03, 0.06, 0.12):
            for foot in ((-0.1, 0.15), (0.0, 0.25), (0.1, 0.4)):
                made = decision()
                stance = stance_at((foot[0] - CONSTANTS.area.carrying, foot[1], 0.0, 0.0), elapsed=0.05)
                made._put_down = made._puts_down(stance, (ahead, -beyond))
                near, far = (place[0] for place in made._way(stance).reached(closing, made._places))
                there = (min(max(ahead * math.exp(OMEGA * closing), near), far), SETTINGS.gap)
                ways = []
                for place, time in ((foot, min(closing, 0.06)), (there, closing)):
                    dcm = math.exp(OMEGA * time) * np.array([ahead, -beyond])
                    after = np.array(place) + math.exp(OMEGA * SETTINGS.shortest) * (dcm - place)
                    ways.append(float(np.linalg.norm(after)))
                if abs(ways[0] - ways[1]) > 1e-9:
                    assert made.closes == (ways[0] < ways[1]), (ahead, beyond, foot)
                    mirrored = stance_at(
                        (-foot[0] - CONSTANTS.area.carrying, foot[1], 0.0, 0.0), elapsed=0.05
                    )
                    assert (decision()._puts_down(mirrored, (-ahead, -beyond)) is not None) == made.closes
                    found.add(made.closes)
                if made.closes:
                    reached = made._way(stance).reached(0.06, made._places)
                    assert made._put_down == (pytest.approx(0.11), reached)
    assert found == {True, False}


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("off", "share"), [(0.0, 0.0), (0.9, 0.0), (1.25, 0.4), (1.5, 1.0 / 1.5), (3.0, 1.0)]
)
def test_a_landing_that_is_promised_moves_by_what_the_next_sole_cannot_catch(
    axis: int, sign: float, off: float, share: float
) -> None:
    """An offset within the area that counts is left to it; twice as far, all of it is made good by the landing."""
    made, time = decision(), SETTINGS.step_time
    made.area.evenness = 1.0
    wish = steps_of_velocity((0.2, 0.0), SETTINGS.width, walking_at((0.0, 0.0), time))
    caught = made.area.caught(CONSTANTS.area.caught)[axis]
    left = off * (caught[1] if sign > 0.0 else caught[0])
    end = [wish.places[0] + wish.offsets[0], wish.places[1] + wish.offsets[1]]
    end[axis] += left
    remaining = 0.02  # too little to change the time, or the centre of pressure, which is a point
    shrunk = math.exp(-OMEGA * remaining)
    stance = walking_at((shrunk * end[0], shrunk * end[1]), time - remaining)
    made._bounds = lambda *_, **__: Bounds(  # type: ignore[method-assign]
        ((-2.0, -2.0), (2.0, 2.0)), ((0.0, 0.0), (0.0, 0.0)), (0.0, 0.0), (remaining, remaining)
    )
    made._time_for_legs = lambda *_: None  # type: ignore[method-assign]
    made.decide(stance, wish._replace(promised=True), None)
    assert made.displaced == pytest.approx(share * abs(left), abs=4.5e-3)
    made.decide(stance, wish, None)
    assert made.displaced == pytest.approx(abs(left), abs=4.5e-3), "steps of a velocity go with the weight"


@pytest.mark.parametrize("share", [0.0, 0.3, 0.7])
def test_footsteps_closer_together_than_steps_of_a_velocity_may_be_are_met_in_their_time(
    share: float,
) -> None:
    made, time, width = decision(), SETTINGS.step_time, 0.8 * SETTINGS.gap
    wish = steps_of_velocity((0.2, 0.0), width, walking_at((0.0, 0.0), time))
    inwards = width / (1.0 + math.exp(OMEGA * time))
    wish = wish._replace(offsets=tuple(-inwards if k % 2 else b for k, b in enumerate(wish.offsets)))
    fallen = math.exp(-OMEGA * time * (1.0 - share))
    end = wish.places[0] + wish.offsets[0], wish.places[1] + wish.offsets[1]
    stance = walking_at((fallen * end[0], fallen * end[1]), share * time)
    stance = stance._replace(swing=(-wish.places[0], width, 0.0, 0.0))
    made.decide(stance._replace(longest=1.2 * time), wish._replace(promised=True), None)
    assert made.end == pytest.approx(time, abs=1e-5)
    assert made.displaced == pytest.approx(0.0, abs=1e-6)
    made.decide(stance._replace(longest=1.2 * time), wish, None)
    assert made.displaced > 0.1 * SETTINGS.gap, "those of a velocity stay apart"


def test_a_step_that_legs_need_longer_for_lands_where_the_pendulum_is_then() -> None:
    """With the centre of pressure at its edge: the more so the later the step ends."""
    made, time = decision(), SETTINGS.step_time
    made.area.ahead, made.area.aside = [-0.05, 0.05], [-0.02, 0.02]
    stance = walking_at((0.12, 0.04), 0.0)._replace(swing=(-0.4, 0.22, 0.0, 0.0))
    wish = steps_of_velocity((0.2, 0.0), SETTINGS.width, stance)
    made._time_for_legs = lambda *_: 0.45  # type: ignore[method-assign]
    made.decide(stance, wish, None)
    assert made.end == pytest.approx(0.45) and 1.05 * time < 0.45
    shift = np.array(made._program.x[6:8])
    assert math.hypot(*shift) > 0.02
    there = shift + math.exp(OMEGA * made.end) * (np.array([stance.dcm.x, stance.dcm.y]) - shift)
    np.testing.assert_allclose(made._program.x[:2] + made._program.x[11:13], there, atol=1e-6)


@pytest.mark.parametrize("off", [(0.3, 0.0), (-0.3, 0.0), (0.4, -0.1)])
def test_a_landing_on_a_stair_stays_between_its_edges_wherever_the_dcm_is(off: tuple[float, float]) -> None:
    """Slow steps, over which an error grows by more than 300 until the last offset of the program."""
    made, time = decision(), SETTINGS.slow_time
    stance = walking_at((0.0, 0.0), 0.2 * time)._replace(nominal=time)
    wish = steps_of_velocity((0.2, 0.0), SETTINGS.width, stance)
    grown = math.exp(-OMEGA * 0.8 * time)
    end = wish.places[0] + wish.offsets[0] + off[0], wish.places[1] + wish.offsets[1] + off[1]
    stance = stance._replace(dcm=Divergent(grown * end[0], grown * end[1], OMEGA))
    made.decide(stance._replace(climbs=True, longest=1.2 * time), wish._replace(promised=True), None)
    ahead, _ = stance.axes.offset(*made.place)
    assert ahead + CONSTANTS.area.carrying == pytest.approx(wish.places[0], abs=3.5e-3) and not made.closes
    assert made.end >= STAIR_TIME * time - 1e-9, "legs lift a foot no sooner"
