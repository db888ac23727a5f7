"""Phases of planned steps on scripted foot loads."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from pendulum import BY_TIME

from wbc.core.robot import GRAVITY, SIDES
from wbc.robots import load
from wbc.walking.contact import Event, GaitPhase
from wbc.walking.lipm.adjustment import AdjustmentSettings, PlannedSwing
from wbc.walking.lipm.settings import PhaseSettings, WalkSettings
from wbc.walking.lipm.walk import LipmWalk
from wbc.walking.plans.footsteps import Footstep, FootstepPlan, moved
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.planners import walk_distance, walk_path
from wbc.walking.plans.sources import PlanSource

ROBOT = load("hrp4_class").robot()
START = FootstepPlan(Footstep("left", 0.0, 0.0875), Footstep("right", 0.0, -0.0875), (), Gait())
WEIGHT = ROBOT.mass * GRAVITY
HEIGHT = 0.76
DT = 0.005
Loads = Callable[[LipmWalk], tuple[float, float]]


def ideal(w: LipmWalk) -> tuple[float, float]:
    """A robot that is where the plan says: the weight moves over linearly, and the ground is where it should be."""
    if w.phases.phase is GaitPhase.SINGLE:
        landed = 0.1 if w.phases.elapsed >= w.phases.duration - DT else 0.0
        return (landed, 1 - landed) if w.progress.air == 0 else (1 - landed, landed)
    if w.phases.phase is GaitPhase.STANDING or w.phases.step >= len(w.phases.plan):
        return 0.5, 0.5
    staying = 0.5 + 0.5 * min(1.0, w.phases.elapsed / w.phases.duration)
    return (1 - staying, staying) if w.phases.landing.side == "left" else (staying, 1 - staying)


def run(w: LipmWalk, loads: Loads, seconds: float) -> list[tuple[float, Event]]:
    happened = []
    for k in range(round(seconds / w.dt)):
        share = loads(w)
        happened += [(k * w.dt, e) for e in w.advance([WEIGHT * s for s in share]).progress.events]
    return happened


def walking(distance: float = 0.3, settings: PhaseSettings | None = None, dt: float = DT) -> LipmWalk:
    s = WalkSettings(adjustment=None, phases=settings or PhaseSettings())
    w = LipmWalk(ROBOT, walk_distance(START, distance), HEIGHT, dt, s)
    assert w.advance([0.5 * WEIGHT, 0.5 * WEIGHT]).progress.events == (Event.STARTED,)
    return w


def until(w: LipmWalk, loads: Loads, event: Event, limit: float = 10.0) -> float:
    for k in range(round(limit / DT)):
        if event in w.advance([WEIGHT * s for s in loads(w)]).progress.events:
            return k * DT
    raise AssertionError(f"{event} did not happen")


@pytest.mark.parametrize("dt", [0.005, 0.002])
def test_an_ideal_walk_keeps_the_plans_time(dt: float) -> None:
    w = walking(dt=dt)
    gait, n = w.phases.gait, len(w.phases.plan)
    assert n == 4
    total = gait.initial_double_support + gait.final_double_support + n * 0.8 + (n - 1) * 0.3
    events = run(w, ideal, total + 0.5)
    kinds = [e for _, e in events]
    assert kinds == [Event.LIFT_OFF, Event.TOUCH_DOWN] * n + [Event.STOPPED]
    assert events[-1][0] == pytest.approx(total, abs=0.05 * n)
    assert w.finished and w.steps_done == n and w.progress.air is None


def test_contacts_and_schedule_follow_the_phase() -> None:
    w = walking()
    assert w.progress.air is None
    total = sum(s.duration for s in w.phases.supports())
    until(w, ideal, Event.LIFT_OFF)
    assert w.progress.air == 0
    now = w.phases.supports()
    assert now[0].single and now[0].feet == (START.right,) and now[0].duration == pytest.approx(0.8)
    run(w, ideal, 0.3)
    assert w.phases.supports()[0].duration == pytest.approx(0.5)
    assert sum(s.duration for s in w.phases.supports()) == pytest.approx(total - 0.8 - 0.3, abs=0.02)
    until(w, ideal, Event.TOUCH_DOWN)
    now = w.phases.supports()
    assert not now[0].single and now[0].feet == (START.right, w.phases.plan.steps[0])


def test_lift_off_waits_for_the_load_and_is_forced_in_the_end() -> None:
    w = walking()

    def slow(w: LipmWalk) -> tuple[float, float]:
        return (0.4, 0.6) if w.phases.phase is GaitPhase.DOUBLE and w.phases.elapsed < 0.9 else ideal(w)

    assert until(w, slow, Event.LIFT_OFF) == pytest.approx(0.9, abs=0.02)
    w = walking()
    assert until(w, lambda w: (0.4, 0.6), Event.FORCED_LIFT_OFF) == pytest.approx(0.8 + 0.3, abs=0.015)
    w = walking()
    run(w, lambda w: (0.4, 0.6), 1.0)
    assert (
        w.phases.phase is GaitPhase.DOUBLE and w.phases.overdue and w.phases.remaining == pytest.approx(0.05)
    )
    assert w.phases.supports()[0].duration == pytest.approx(0.05)


def test_lift_off_needs_the_other_foot_to_carry() -> None:
    w = walking()
    run(w, lambda w: (0.1, 0.3), 1.0)  # light on both feet: half in the air
    assert w.phases.phase is GaitPhase.DOUBLE


def test_early_ground_ends_the_swing_but_a_stumble_does_not() -> None:
    w = walking()
    until(w, ideal, Event.LIFT_OFF)
    run(w, lambda w: (0.3, 0.7), 0.45)
    assert w.phases.phase is GaitPhase.SINGLE  # 56 % of the swing
    assert until(w, lambda w: (0.3, 0.7), Event.EARLY_TOUCH_DOWN) == pytest.approx(0.03, abs=0.011)
    assert w.phases.phase is GaitPhase.DOUBLE and w.progress.air is None and w.phases.step == 1
    assert w.phases.duration == pytest.approx(0.3 + 0.32, abs=0.011)  # the rhythm is kept


def test_a_spike_is_no_touch_down() -> None:
    w = walking()
    until(w, ideal, Event.LIFT_OFF)
    spikes = iter([(0.0, 1.0), (0.3, 0.7)] * 70)
    run(w, lambda w: next(spikes), 0.7)
    assert w.phases.phase is GaitPhase.SINGLE


def test_late_ground_is_waited_for() -> None:
    w = walking()
    until(w, ideal, Event.LIFT_OFF)
    late = until(w, lambda w: (0.1, 0.9) if w.phases.elapsed > 0.82 else (0.0, 1.0), Event.LATE_TOUCH_DOWN)
    assert late == pytest.approx(0.83, abs=0.015) and w.phases.phase is GaitPhase.DOUBLE and w.steps_done == 1


def test_by_time_alone() -> None:
    w = walking(settings=BY_TIME)
    kinds = [e for _, e in run(w, lambda w: (0.5, 0.5), 6.0)]
    assert kinds == [Event.LIFT_OFF, Event.TOUCH_DOWN] * 4 + [Event.STOPPED]


def test_stopping_in_a_swing_puts_it_down_and_closes_up() -> None:
    w = walking(3.0)
    until(w, ideal, Event.TOUCH_DOWN)
    until(w, ideal, Event.LIFT_OFF)
    landing = w.phases.landing
    w.take(None)  # as it is steered: to a stand
    run(w, ideal, DT)
    w.take(None)
    run(w, ideal, DT)
    assert len(w.phases.plan) == 2 and w.phases.plan.steps[0] == landing
    kinds = [e for _, e in run(w, ideal, 5.0)]
    assert kinds[-1] is Event.STOPPED and w.finished and w.steps_done == 3
    left, right = w.phases.plan.final
    assert left.x == pytest.approx(right.x) and left.y - right.y == pytest.approx(0.175)


def test_stopping_on_both_feet() -> None:
    w = walking(3.0)
    run(w, ideal, 0.3)
    w.take(None)
    run(w, ideal, DT)
    assert len(w.phases.plan) == 0
    assert Event.STOPPED in [e for _, e in run(w, ideal, 1.5)] and w.steps_done == 0
    w = walking(3.0)
    until(w, ideal, Event.TOUCH_DOWN)
    w.take(None)
    run(w, ideal, DT)
    assert len(w.phases.plan) == 1 and w.phases.plan.final[0].x == pytest.approx(w.phases.plan.final[1].x)
    assert [e for _, e in run(w, ideal, 5.0)][-1] is Event.STOPPED
    w.take(None)
    assert w.finished


def test_a_foot_without_ground_is_taken_to_stand_at_the_tick_that_the_settings_name() -> None:
    """0.8 s of the swing and 0.5 s of search: 260 ticks; the weight stays on the foot that stands meanwhile."""
    w = walking()
    until(w, ideal, Event.LIFT_OFF)
    width, ticks = 0.5 * ROBOT.soles[0].width, 0
    while True:
        reference, ticks = w.advance([0.0, WEIGHT]), ticks + 1
        if Event.NO_TOUCH_DOWN in reference.progress.events:
            break
        if w.phases.overdue:
            assert abs(reference.pendulum.zmp[1] - START.right.y) < width
            assert w.phases.remaining == pytest.approx(0.05) and ticks >= 160
    assert ticks == round(1.3 / DT)
    assert w.phases.duration == pytest.approx(w.phases.gait.double_support)


@pytest.mark.parametrize("ready", [0.24, 0.26])
def test_lift_off_is_free_up_to_a_quarter_of_the_weight_on_the_foot_that_leaves(ready: float) -> None:
    w = walking()
    happened = [event for _, event in run(w, lambda w: (ready, 0.9 - ready), 0.82)]
    assert (Event.LIFT_OFF in happened) == (ready < 0.25)


def test_the_velocity_of_a_walk_is_that_of_its_next_two_steps() -> None:
    """In the heading of the foot that stands: two steps of 0.1 m, 0.02 m aside and 0.1 rad, in their time."""
    w = LipmWalk(ROBOT, walk_path(START, [(0.1, 0.02, 0.1)] * 4), HEIGHT, DT, WalkSettings(adjustment=None))
    place = (0.0, 0.0, 0.0)
    for _ in range(2):
        place = moved(place, 0.1, 0.02, 0.1)
    right = moved(place, 0.0, -0.0875, 0.0)
    two = 2.0 * w.phases.gait.cycle
    assert w.granted == pytest.approx((right[0] / two, (right[1] + 0.0875) / two, 0.2 / two))


def test_soles_that_turn_on_the_ground_turn_the_landings_back_about_the_foot_that_stands() -> None:
    """From 0.02 rad on, by 0.04 rad a step at most."""
    for turned, back in ((0.015, 0.0), (0.03, 0.03), (-0.1, -0.04)):
        w = walking()
        w.advance([0.5 * WEIGHT] * 2, turned=turned)
        before = w.phases.plan.steps[1]
        until(w, ideal, Event.LIFT_OFF)
        step, c, s = w.phases.plan.steps[1], np.cos(back), np.sin(back)
        x, y = before.x, before.y + 0.0875  # from the right foot
        assert step.yaw == pytest.approx(-back)
        assert (step.x, step.y) == pytest.approx((c * x + s * y, -s * x + c * y - 0.0875))


@pytest.mark.parametrize(
    ("between", "part"), [(0.0, 0.5), (0.005, 0.5), (0.0125, 0.75), (-0.0125, 0.75), (0.02, 1.0), (0.06, 1.0)]
)
def test_a_foot_meets_level_ground_half_as_quickly_as_uneven_ground(between: float, part: float) -> None:
    """`between` is the height between the feet after the last landing, m."""
    w = walking()
    w.ground.land(0.0, between)
    until(w, ideal, Event.LIFT_OFF)
    swing, speed = w.feet.swing, w.phases.gait.landing_speed
    assert swing is not None
    (_, _, z), (_, _, down) = swing.motion(w.phases.duration)
    assert z == pytest.approx(swing.landing.z, abs=1e-9) and down == pytest.approx(-part * speed)
    height = w.phases.gait.landing_height
    (_, _, z), (_, _, down) = swing.motion(w.phases.duration - height / (0.5 * (1.0 + part) * speed))
    assert z == pytest.approx(swing.landing.z + height, abs=1e-9) and down == pytest.approx(-speed)


def test_a_tick_calls_no_more_functions_the_longer_the_plan_is() -> None:
    """Nor where pushes move landings, feet slide, and the ground is higher than planned."""

    def most_calls(steps: int) -> int:
        w = LipmWalk(ROBOT, START, HEIGHT, DT)
        w.take(PlanSource(walk_path(START, [(0.1, 0.0, 0.0)] * steps)))  # which checks it, before the tick
        places, calls, counts = [START.left.placement, START.right.placement], 0, []

        def count(_frame: object, event: str, _argument: object) -> None:
            nonlocal calls
            calls += event in ("call", "c_call")

        dcm = np.array((*w.course.pattern.at(0.0).com[:2], 0.0))
        while w.steps_done < 2:
            higher, slid = (pin.SE3(np.eye(3), np.array(by)) for by in ((0.0, 0.0, 0.004), (0.003, 0.0, 0.0)))
            soles, measured = [higher * place for place in places], [slid * places[0], places[1]]
            if w.feet.swing is not None:
                dcm += (0.04, 0.0, 0.0)
            calls, loads = 0, [WEIGHT * share for share in ideal(w)]
            sys.setprofile(count)
            try:
                reference = w.advance(loads, soles, dcm, measured=measured)
            finally:
                sys.setprofile(None)
            counts.append(calls)
            places = [foot.placement for foot in reference.feet]
            pendulum = reference.pendulum
            dcm = pendulum.com + pendulum.com_velocity / pendulum.omega
        return max(counts)

    most_calls(100)  # which fills caches
    assert most_calls(300) <= 1.02 * most_calls(100)


def test_a_plan_that_cannot_be_walked_to_its_end_is_refused_before_it_begins() -> None:
    plan = walk_path(START, [(0.1, 0.0, 0.0)] * 200)
    far = replace(plan.steps[150], x=plan.steps[150].x + 1.0)
    w = LipmWalk(ROBOT, START, HEIGHT, DT)
    w.take(PlanSource(plan.with_step(150, far, carry=False)))
    w.advance(ideal(w))
    assert f"step 151 of {len(plan)} ({far.side}) goes forward" in w.reason and w.phases.rests


@pytest.mark.parametrize("last_leaves", [False, True])
def test_feet_that_slide_on_the_ground_land_on_the_footsteps_of_the_plan(*, last_leaves: bool) -> None:
    """Each foot slides by d after its landing, by the encoders; a foot that swings is where the foot that stands is.

    Then the robot sets off again: the last slide counts if the foot that has slid stays.
    """
    slide, w, steps = np.array([-0.006, 0.002, 0.0]), walking(), walk_distance(START, 0.3).steps
    places, off = [START.left.placement, START.right.placement], [np.zeros(3), np.zeros(3)]

    def step_on() -> None:
        measured = [pin.SE3(at.rotation, at.translation + by) for at, by in zip(places, off, strict=True)]
        feet = w.advance([WEIGHT * share for share in ideal(w)], places, measured=measured).feet
        places[:] = (foot.placement for foot in feet)

    for count, step in enumerate(steps):
        while w.steps_done == count:
            step_on()
            if (air := w.progress.air) is not None:
                off[air] = off[1 - air]
        side = SIDES.index(step.side)
        landed = places[side].translation + off[1 - side]
        np.testing.assert_allclose(landed[:2], (step.x, step.y), atol=1e-6)
        off[side] = off[1 - side] + slide
    while not w.finished:
        step_on()
    feet = Footstep.of("left", places[0]), Footstep.of("right", places[1])
    again = feet[side if last_leaves else 1 - side]
    again = replace(again, x=again.x + 0.05)
    w.take(PlanSource(FootstepPlan(feet[0], feet[1], (again,), Gait())))
    while w.progress.air is None:
        step_on()
    moved_by = np.zeros(3) if last_leaves else -slide
    np.testing.assert_allclose(w.phases.landing.position, again.position + moved_by, atol=1e-9)


def test_the_reference_of_the_com_goes_over_to_a_new_pattern_as_quickly_as_the_dcm_falls() -> None:
    """An offset x decays as (1 + ωt) e^{−ωt} x, its velocity and acceleration with it; the ZMP is the pattern's."""
    w = walking()
    run(w, ideal, 0.1)
    falls = w.course.pattern.omega * DT * np.arange(1, 81)
    for start, speed in ((0.01 - 0.02j, 0j), (0j, 0.1 + 0.05j)):
        w.course._off.value, w.course._off.velocity = start, speed
        offs = []
        for _ in range(80):
            pendulum, own = w.course.pendulum(), w.course.pattern.at(w.course.since)
            off = complex(*(pendulum.com_velocity - own.com_velocity)[:2])
            assert off == pytest.approx(w.course._off.velocity, abs=1e-9)
            np.testing.assert_array_equal(pendulum.zmp, own.zmp)
            w.course.since += w.dt
            w.course._off.follow(-w.course._off.value, w.dt)
            offs.append(complex(*(w.course.pendulum().com - w.course.pattern.at(w.course.since).com)[:2]))
        expected = (start * (1.0 + falls) + speed * falls / w.course.pattern.omega) * np.exp(-falls)
        np.testing.assert_allclose(offs, expected, atol=5e-4)


def in_swing() -> LipmWalk:
    """Return a walk half a second after its first lift-off."""
    w = walking(1.0)
    until(w, ideal, Event.LIFT_OFF)
    run(w, ideal, 0.3)
    assert w.feet.swing is not None
    return w


class Adjuster:
    """Step adjustment that answers as it is told: a shift of the landing, m, and of the time, ticks."""

    settings = AdjustmentSettings(threshold=0.005)

    def __init__(self, shift: float, ticks: float) -> None:
        """Take the answer."""
        self.shift, self.ticks = shift, ticks

    def adjust(self, swing: PlannedSwing, elapsed: float, dcm: complex) -> tuple[Footstep, float]:
        """Answer."""
        return (
            replace(
                swing.landing, x=swing.landing.x + 0.6 * self.shift, y=swing.landing.y + 0.8 * self.shift
            ),
            swing.duration - elapsed + self.ticks * DT,
        )


@pytest.mark.parametrize(
    ("shift", "ticks", "moves"),
    [(0.002, 2.0, False), (0.003, 0.0, True), (0.0, 3.0, True), (0.0, -3.4, True), (-0.003, 1.0, True)],
)
def test_a_step_is_adjusted_from_half_a_threshold_or_three_ticks_on(
    shift: float, ticks: float, moves: bool
) -> None:
    w = in_swing()
    before, last = w.phases.plan, w.phases.duration
    w.feet.adjust(np.zeros(3), Adjuster(shift, ticks))  # type: ignore[arg-type]
    way = w.phases.plan.steps[0].position - before.steps[0].position
    np.testing.assert_allclose(way, np.array([0.6, 0.8, 0.0]) * shift * moves, atol=1e-12)
    assert w.phases.duration - last == pytest.approx(round(ticks) * DT * moves)
    assert w.feet.swing is not None and w.feet.swing.landing == w.phases.plan.steps[0]
    np.testing.assert_allclose(w.phases.plan.steps[1].position - before.steps[1].position, way, atol=1e-12)
    assert w.phases.plan.steps[0].y - before.steps[0].y == pytest.approx(0.8 * shift * moves)


@pytest.mark.parametrize("moment", ["early", "late"])
@pytest.mark.parametrize("change", [0.002, 0.01, -0.01])
def test_a_landing_goes_to_the_height_that_is_seen_while_the_foot_can_follow(
    change: float, moment: str
) -> None:
    """From 3 mm on, and until 0.12 s before it."""
    w = in_swing()
    run(w, lambda w: (0.0, 1.0), 0.0 if moment == "early" else w.phases.remaining - 0.1)
    before, height = w.phases.plan.steps[0], w.ground.height
    w.ground.choose = lambda landing: replace(landing, z=before.z + change)  # type: ignore[method-assign]
    w.feet.look()
    follows = moment == "early" and abs(change) > 0.003
    assert w.phases.plan.steps[0].z - before.z == pytest.approx(change if follows else 0.0)
    assert w.ground.height - height == pytest.approx(change if follows else 0.0)
    assert w.phases.plan.steps[1].z == pytest.approx(0.0), "the others stay in the world"


def test_a_landing_is_kept_as_it_was_found_and_the_ground_learns_from_it() -> None:
    """20 mm higher than expected and 35 mm above the other foot; half of it is expected next, a tenth as its rise."""
    w = in_swing()
    planned = w.phases.plan.steps[0]
    here = Footstep("left", planned.x + 0.01, planned.y - 0.02, planned.z + 0.02, 0.1, 0.2, 0.3).placement
    w.feet.land([here, START.right.moved(pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.015]))).placement], 0.0)
    step = w.phases.plan.steps[0]
    assert (step.x - planned.x, step.y - planned.y, step.z - planned.z) == pytest.approx((0.01, -0.02, 0.02))
    assert (step.yaw, step.pitch, step.roll) == pytest.approx((0.1, 0.0, 0.0))
    assert (w.ground.height, w.ground.rise, w.ground.uneven) == pytest.approx((0.01, 0.002, 0.035))
    assert w.phases.plan.steps[1].x == pytest.approx(walk_distance(START, 1.0).steps[1].x)


def test_all_but_the_last_two_free_steps_may_be_put_on_better_ground_within_reach() -> None:
    w = walking(1.0)
    count = len(w.phases.plan)
    for w.phases.step, free in ((0, True), (count - 3, True), (count - 2, False), (count - 1, False)):
        assert (w.feet._near(w.phases.landing) is not None) == free
        assert w.feet._near(replace(w.phases.landing, fixed=True)) is None
    w.phases.step = 0
    near, step = w.feet._near(w.phases.plan.steps[0]), w.phases.plan.steps[0]
    assert near is not None
    assert near(step.x, step.y) and not near(w.reach.max_length + 0.01, step.y)
    assert not near(step.x, w.reach.max_spacing - 0.0875 + 0.01)


def test_a_walk_comes_to_rest_in_the_last_tenth_of_a_second_of_its_last_step() -> None:
    w = walking(0.1)
    assert len(w.phases.plan) == 2
    for w.phases.step, w.phases.elapsed, rests in ((1, 0.71, True), (1, 0.69, False), (0, 0.71, False)):
        w.phases.duration = 0.8
        assert w.phases.comes_to_rest == rests


def test_a_robot_that_is_to_go_on_before_it_stands_shifts_its_weight_first() -> None:
    w = walking(0.1)
    until(w, ideal, Event.TOUCH_DOWN)
    until(w, ideal, Event.TOUCH_DOWN)
    run(w, ideal, 0.2)
    assert w.phases.phase is GaitPhase.DOUBLE and w.phases.step == len(w.phases.plan)
    w.take(PlanSource(walk_distance(w.phases.plan.end, 0.3)))
    w.plan_steps()
    assert w.phases.phase is GaitPhase.DOUBLE and w.phases.step < len(w.phases.plan)
    assert w.phases.duration - w.phases.elapsed == pytest.approx(w.phases.gait.initial_double_support)
