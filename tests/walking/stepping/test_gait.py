"""Gait of the stepping walk around a point mass: symmetries, what it does when, and where it goes."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math

import numpy as np
import pinocchio as pin
import pytest
from point_mass import MIRROR, SCALE, Frames, PointMass, Tick, angle, mirrored, mirrored_input, moved, scaled
from properties import by_default

import wbc
from wbc.core.robot import SIDES
from wbc.walking.contact import Event, GaitPhase
from wbc.walking.plans.footsteps import Footstep, FootstepPlan
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.planners import walk_distance
from wbc.walking.plans.reach import Reach
from wbc.walking.plans.sources import BESIDE, PlanSource
from wbc.walking.source import Reference
from wbc.walking.stepping.felt import BodyState
from wbc.walking.stepping.gait import SteppingWalk
from wbc.walking.stepping.settings import SteppingSettings

DT = 0.004
VELOCITY = (0.25, 0.05, 0.2)


@functools.cache
def pushed_aside() -> tuple[Tick, ...]:
    """A stand, a push to the left, steps, a velocity, and a stop."""
    body = PointMass()
    body.run(0.7)
    body.speed += [0.05, 0.6]
    body.run(0.1)
    body.gait.steering.command(VELOCITY)
    body.run(1.7)
    body.gait.steering.command(None)
    body.run(0.7)
    assert body.gait.steps_done >= 4
    return tuple(body.ticks)


def replay(
    inputs: list[tuple[BodyState, Frames]], heading: float, velocity: tuple[float, float, float]
) -> list[Reference]:
    """References of another gait for the inputs of `pushed_aside`, steered at the same ticks."""
    gait, references = SteppingWalk(SteppingSettings(), SCALE, heading, DT), []
    for tick, (state, frames) in enumerate(inputs):
        if tick == round(0.8 / DT):
            gait.steering.command(velocity)
        elif tick == round(2.5 / DT):
            gait.steering.command(None)
        references.append(gait.advance(state, frames))
    return references


@pytest.mark.slow
def test_a_mirrored_world_gives_mirrored_references() -> None:
    ticks = pushed_aside()
    x, y, turn = VELOCITY
    references = replay([mirrored_input(tick) for tick in ticks], 0.0, (x, -y, -turn))
    steps = 0
    for tick, reference in zip(ticks, references, strict=True):
        real = tick.reference
        step, of_real = reference.progress, real.progress
        assert step.phase is of_real.phase and step.events == of_real.events
        assert reference.progress.heading == pytest.approx(-real.progress.heading, abs=1e-9)
        assert reference.progress.contact == real.progress.contact[::-1]
        assert reference.most_force == pytest.approx(real.most_force[::-1], abs=1e-6)
        for name in ("com", "com_velocity", "com_acceleration", "zmp"):
            expected = MIRROR @ getattr(real.pendulum, name)
            np.testing.assert_allclose(getattr(reference.pendulum, name), expected, atol=1e-9)
        for foot, other in zip(reference.feet, real.feet[::-1], strict=True):
            twin = mirrored(other.placement)
            np.testing.assert_allclose(foot.placement.homogeneous, twin.homogeneous, atol=1e-9)
            np.testing.assert_allclose(foot.velocity[:3], MIRROR @ other.velocity[:3], atol=1e-8)
            np.testing.assert_allclose(foot.acceleration[:3], MIRROR @ other.acceleration[:3], atol=1e-6)
        if of_real.landing is None:
            continue
        steps += 1
        assert step.landing is not None and step.landing.side != of_real.landing.side
        assert (step.landing.x, step.landing.y, step.landing.yaw) == pytest.approx(
            (of_real.landing.x, -of_real.landing.y, -of_real.landing.yaw), abs=1e-9
        )
    assert steps > 400


@pytest.mark.parametrize("world", by_default([(2.5, 3.0, -4.0), (-0.9, -5.0, 2.0)], (2.5, 3.0, -4.0)))
def test_a_moved_and_turned_world_gives_moved_and_turned_references(
    world: tuple[float, float, float],
) -> None:
    ticks, (yaw, x, y) = pushed_aside(), world
    place = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, yaw), np.array([x, y, 0.3]))
    references = replay([moved(tick, place) for tick in ticks], yaw, VELOCITY)
    for tick, reference in list(zip(ticks, references, strict=True))[::7]:
        real = tick.reference
        assert (
            reference.progress.phase is real.progress.phase
            and reference.progress.stance == real.progress.stance
        )
        assert angle(reference.progress.heading, real.progress.heading + yaw) == pytest.approx(0.0, abs=1e-9)
        np.testing.assert_allclose(reference.pendulum.com, place.act(real.pendulum.com), atol=1e-8)
        np.testing.assert_allclose(reference.pendulum.zmp, place.act(real.pendulum.zmp), atol=1e-8)
        push = place.rotation @ real.pendulum.com_acceleration
        np.testing.assert_allclose(reference.pendulum.com_acceleration, push, atol=1e-6)
        for foot, other in zip(reference.feet, real.feet, strict=True):
            turned = (place * other.placement).homogeneous
            np.testing.assert_allclose(foot.placement.homogeneous, turned, atol=1e-8)
            np.testing.assert_allclose(foot.velocity[:3], place.rotation @ other.velocity[:3], atol=1e-6)
        landing, planned = reference.progress.landing, real.progress.landing
        if planned is not None:
            assert landing is not None
            expected = place.act(np.array([planned.x, planned.y, 0.0]))[:2]
            assert (landing.x, landing.y) == pytest.approx(tuple(expected), abs=1e-8)
            assert angle(landing.yaw, planned.yaw + yaw) == pytest.approx(0.0, abs=1e-9)


def test_a_step_takes_the_time_that_its_record_says() -> None:
    """On soles that hold across their width steps are slow: the time between two lift-offs is that of the cycle."""
    body, lift_offs = PointMass(), []
    body.run(0.7)
    body.gait.steering.command((0.1, 0.0, 0.0))

    def hold(tick: Tick) -> None:
        body.gait.steering.supported = 1.0
        if Event.LIFT_OFF in tick.reference.progress.events:
            lift_offs.append((tick.time, body.ticks[-2].reference.progress.cycle))

    body.run(3.5, hold)
    assert len(lift_offs) > 3
    for (before, _), (now, cycle) in itertools.pairwise(lift_offs[1:]):
        assert now - before == pytest.approx(cycle, rel=0.05)
        assert cycle > 1.5 * body.gait.settings.step_time


@pytest.mark.parametrize("k", by_default([0.4, 2.5], 0.4))
def test_a_larger_robot_does_the_same_in_larger_steps_and_longer_times(k: float) -> None:
    """Lengths by k, masses by k³, times by √k; the velocity by √k too."""
    root = math.sqrt(k)
    small, large = PointMass(), PointMass(scaled(k), DT * root)
    for body, size in ((small, 1.0), (large, root)):
        body.run(0.7 * size)
        body.gait.steering.command((0.25 * size, 0.05 * size, 0.2 / size))
        body.run(2.2 * size)
    assert len(small.ticks) == len(large.ticks) and small.gait.steps_done >= 2
    for one, other in zip(small.ticks, large.ticks, strict=True):
        a, b, forces = one.reference.progress, other.reference.progress, one.reference.most_force
        assert (a.phase, a.stance, a.events) == (b.phase, b.stance, b.events)
        assert b.duration == pytest.approx(root * a.duration, rel=1e-6)
        assert other.reference.most_force == pytest.approx([k**3 * force for force in forces], rel=1e-6)
        np.testing.assert_allclose(other.reference.pendulum.zmp, k * one.reference.pendulum.zmp, atol=1e-6)
        if a.landing is not None:
            assert b.landing is not None
            expected = (k * a.landing.x, k * a.landing.y)
            assert (b.landing.x, b.landing.y) == pytest.approx(expected, abs=1e-6)


def mean_speed(body: PointMass, seconds: float) -> np.ndarray:
    """Velocity over some seconds, over ground, m/s."""
    start = body.com[:2].copy()
    body.run(seconds)
    return (body.com[:2] - start) / seconds


@pytest.mark.parametrize(
    "velocity", by_default([(0.4, 0.0), (0.7, 0.0), (-0.2, 0.0), (0.0, 0.12)], (0.7, 0.0))
)
def test_a_steered_walk_has_the_velocity_that_is_asked_for(velocity: tuple[float, float]) -> None:
    body = PointMass()
    body.run(0.5)
    body.gait.steering.command((*velocity, 0.0))
    body.run(5.0)
    np.testing.assert_allclose(mean_speed(body, 4.0), velocity, atol=0.06)


def test_phases_follow_each_other_and_steps_are_counted() -> None:
    body = PointMass()
    body.run(0.6)
    assert body.gait.finished and body.gait.steps_done == 0
    body.gait.steering.command((0.2, 0.0, 0.0))
    assert [tick.reference.progress.phase for tick in body.run(0.1)][-1] is GaitPhase.DOUBLE
    body.run(4.0)
    body.gait.steering.command(None)
    body.run(4.0)
    events = [event for tick in body.ticks for event in tick.reference.progress.events]
    landed = [e for e in events if e in (Event.TOUCH_DOWN, Event.EARLY_TOUCH_DOWN, Event.LATE_TOUCH_DOWN)]
    assert events[0] is Event.STARTED and events[-1] is Event.STOPPED
    assert body.gait.steps_done == len(landed) == events.count(Event.LIFT_OFF) >= 7
    s, c = body.gait.settings, body.gait.constants
    lifts = [tick for tick in body.ticks if Event.LIFT_OFF in tick.reference.progress.events]
    supports = [tick.reference.progress for tick in lifts]
    first, *others = (tick.reference.most_force[1 - tick.reference.progress.stance] for tick in lifts)
    assert first == 0.0 and others == pytest.approx([2.0 * c.touch.share] * len(others))
    assert supports[0].stance == 1, "the right foot"
    seen = lifts[0].frames[1].actInv(np.array(lifts[0].state.com))
    assert seen[1] == pytest.approx(
        c.stand.shift * s.width / (1.0 + math.exp(SCALE.omega * s.step_time)), abs=0.01
    )
    assert body.gait.finished
    place = body.com[:2].copy()
    body.run(2.0)
    np.testing.assert_allclose(body.com[:2], place, atol=5e-3)
    assert body.ticks[-1].reference.progress.contact == (True, True)


def test_feet_never_land_inside_each_other_nor_out_of_reach() -> None:
    """Also when the mass is pushed at random."""
    body, rng = PointMass(), np.random.default_rng(4)
    settings, carrying, widths = body.gait.settings, body.gait.constants.area.carrying, []
    body.run(0.5)
    for _ in range(8):
        velocity = rng.uniform(-1.0, 1.0, 3) * [0.5, 0.2, 1.0]
        body.gait.steering.command(velocity.tolist())
        body.speed += rng.normal(size=2) * [0.15, 0.2]
        for tick in body.run(0.6):
            landing, heading = tick.reference.progress.landing, tick.reference.progress.heading
            if landing is None or tick.reference.progress.air is None:
                continue
            stance = tick.frames[tick.reference.progress.stance]
            foot = stance.act(np.array([carrying, 0.0, 0.0]))
            cos, sin = math.cos(heading), math.sin(heading)
            dx, dy = landing.x - foot[0], landing.y - foot[1]
            assert landing.side == ("left", "right")[1 - tick.reference.progress.stance]
            ahead = cos * dx + sin * dy + carrying
            aside = (cos * dy - sin * dx) * (1.0 if landing.side == "left" else -1.0)
            turning = 5e-3  # m: a heading turns on for 12 ms between two programs
            assert abs(ahead) <= settings.reach + turning
            assert settings.gap - turning <= aside <= settings.widest + turning
            widths.append(aside)
            longest = settings.longest * settings.slow_time * 1.1  # a fast walk has longer ones
            at_once = body.gait.step.decision.closes or tick.reference.progress.duration < settings.shortest
            assert at_once or settings.shortest - 1e-9 <= tick.reference.progress.duration <= longest
    assert min(widths) == pytest.approx(settings.gap, abs=turning), "no push was hard enough"


def test_a_turn_turns_landings_and_heading_and_a_swing_foot_that_stays_level() -> None:
    body = PointMass()
    body.run(0.5)
    body.gait.steering.command((0.1, 0.0, 0.5))
    steps = [tick for tick in body.run(3.0) if tick.reference.progress.phase is GaitPhase.SINGLE]
    turned = steps[-1].reference.progress.heading - steps[0].reference.progress.heading
    assert turned == pytest.approx(0.5 * (steps[-1].time - steps[0].time), rel=0.01)
    for tick in steps:
        reference, swing = tick.reference, tick.reference.progress.air
        assert (
            reference.progress.landing is not None
            and reference.progress.landing.yaw >= reference.progress.heading
        )
        if swing is not None:
            rotation = reference.feet[swing].placement.rotation
            np.testing.assert_allclose(rotation[2], [0.0, 0.0, 1.0], atol=1e-12)
            off = angle(math.atan2(rotation[1, 0], rotation[0, 0]), reference.progress.heading)
            assert -0.5 <= off < 0.5, "from where the foot has stood"


def test_a_walk_that_a_push_has_turned_goes_on_from_where_its_pelvis_faces() -> None:
    """The heading stays near that of the pelvis, and landings turn with it; small differences change nothing."""
    body = PointMass()
    body.gait.steering.command((0.2, 0.0, 0.0))
    tick = body.run(2.0)[-1]
    gait, heading = body.gait, body.gait.steering.heading
    assert abs(heading) < 1e-9
    for turned in (0.2, -0.3):
        gait.advance(tick.state._replace(heading=turned), tick.frames)
        assert gait.steering.heading == heading
    for turned in (1.5, -2.0, 3.0):
        gait.advance(tick.state._replace(heading=turned), tick.frames)
        assert 0.1 < abs(angle(turned, gait.steering.heading)) < 0.5
    body.run(1.2)  # steps of the heading that is left
    for tick in body.run(1.0):
        if tick.reference.progress.air is not None:
            foot = tick.reference.feet[tick.reference.progress.air].placement
            assert abs(angle(pin.rpy.matrixToRpy(foot.rotation)[2], gait.steering.heading)) < 0.6


def test_a_push_of_a_stand_is_answered_by_the_foot_on_its_side() -> None:
    for sign, foot in ((1.0, 0), (-1.0, 1)):
        body = PointMass()
        body.run(0.7)
        body.speed += [0.0, sign * 0.6]
        first = next(tick for tick in body.run(1.0) if tick.reference.progress.air is not None)
        assert first.reference.progress.air == foot
        body.run(2.0)
        assert body.gait.finished and abs(body.com[1]) < 0.5
    body = PointMass()  # while its weight shifts, too
    body.run(0.7)
    body.gait.steering.command((0.2, 0.0, 0.0))
    body.run(0.1)
    body.speed += [0.0, 0.6]
    assert Event.LIFT_OFF in [event for tick in body.run(0.2) for event in tick.reference.progress.events]
    body = PointMass()
    body.run(0.7)
    body.speed += [0.0, 0.1]
    assert {tick.reference.progress.phase for tick in body.run(2.0)} == {GaitPhase.STANDING}, (
        "a small push needs no step"
    )
    np.testing.assert_allclose(body.com[:2], 0.0, atol=0.01)


@pytest.mark.parametrize("speed", by_default([0.55, 0.8], 0.8))
def test_feet_that_have_stepped_out_of_a_push_close_up_before_the_robot_stands(speed: float) -> None:
    """A wide stand has no room to the side, however well the DCM lies between the feet."""
    body = PointMass()
    body.run(0.7)
    body.speed += [0.0, speed]
    ticks = body.run(4.0)
    stopped = next(tick for tick in ticks if Event.STOPPED in tick.reference.progress.events)
    left, right = (frame.translation for frame in stopped.frames)
    assert np.linalg.norm(left - right) <= body.gait.constants.stand.stop_length
    assert body.gait.finished


@pytest.mark.parametrize("goal", by_default([(1.0, 0.4, 0.5), (-0.2, 0.15, 0.0)], (1.0, 0.4, 0.5)))
def test_a_goal_is_reached_and_stood_at(goal: tuple[float, float, float]) -> None:
    body = PointMass()
    body.run(0.6)
    body.gait.steering.go_to(*goal)
    while not body.gait.finished:
        body.run(0.5)
    assert body.time < 14.0
    assert math.dist(body.com[:2], goal[:2]) < 0.15
    assert angle(body.gait.steering.heading, goal[2]) == pytest.approx(0.0, abs=0.2)


@pytest.mark.parametrize("goal", [(0.0, 0.0, 0.0), (0.05, -0.04, -0.1)])
def test_a_goal_where_the_robot_stands_takes_no_step(goal: tuple[float, float, float]) -> None:
    body = PointMass()
    body.run(0.6)
    body.gait.steering.go_to(*goal)
    assert not body.gait.finished
    body.run(1.5)
    assert body.gait.finished and body.gait.steps_done == 0


VELOCITIES = [(0.4, 0.0, 0.0), (-0.3, 0.0, 0.0), (0.0, 0.3, 0.0), (0.3, -0.2, 0.0), (0.3, 0.0, 0.4)]


@pytest.mark.parametrize("velocity", by_default(VELOCITIES, VELOCITIES[2]))
def test_a_velocity_beyond_the_ground_ends_in_a_stand_on_it(velocity: tuple[float, float, float]) -> None:
    """Near its edge, from which it sets off no more; away from there it does."""
    extent = (-0.8, 0.8, -0.7, 0.7)
    body = PointMass(extent=extent)
    body.run(0.6)
    gait, away = body.gait, (-velocity[0], -velocity[1], 0.0)
    for _ in range(2):
        gait.steering.command(velocity)
        body.run(6.0)
        corners = [
            foot.act(np.array([a * SCALE.sole[0], b * SCALE.sole[1], 0.0]))[:2]
            for tick in body.ticks[-1500::50]
            for foot in tick.frames
            for a in (-1.0, 1.0)
            for b in (-1.0, 1.0)
        ]
        for x, y in corners:
            assert extent[0] < x < extent[1] and extent[2] < y < extent[3]
        if velocity[2]:  # around in a circle
            return
        assert gait.felt.phase is GaitPhase.STANDING and not gait.steering.pending and gait.reason
        nearest = np.min(np.abs(np.array(extent).reshape(2, 2).T - body.com[:2]))
        assert nearest < 0.5
    gait.steering.command(away)
    body.run(1.5)
    assert gait.steering.pending and gait.felt.phase is not GaitPhase.STANDING


def planned(distance: float, reach: Reach | None = None) -> tuple[PointMass, FootstepPlan]:
    """A body that has begun to walk along footsteps, with legs of a reach."""
    body = PointMass(dataclasses.replace(SCALE, sole=(0.085, 0.05)))
    body.gait.reach = reach
    body.run(0.6)
    left, right = (
        Footstep(side, *frame.translation[:2].tolist())
        for side, frame in zip(SIDES, body.ticks[-1].frames, strict=True)
    )
    plan = walk_distance(FootstepPlan(left, right, (), Gait(step_length=0.12)), distance)
    body.gait.take(PlanSource(plan))
    return body, plan


def test_a_missed_footstep_is_missed_by_where_the_foot_carries() -> None:
    """Feet that come down 15 mm aside of where they are sent."""
    (body, plan), said = planned(0.4), []
    move = body._move

    def aside(reference: Reference) -> None:
        move(reference)
        if (air := reference.progress.air) is not None:
            body._feet[air].translation += [0.0, 0.015, 0.0]

    body._move = aside  # type: ignore[method-assign]
    body.run(7.0, lambda tick: said.append(body.gait.missed))
    assert body.gait.steps_done == len(plan)
    assert 1e3 * np.array(said)[-1000:] == pytest.approx(15.0, abs=3.0)


@pytest.mark.parametrize("push", by_default([0.0, 0.4], 0.4))
def test_footsteps_are_landed_on_and_left_for_a_push_alone(push: float) -> None:
    """The distance of each landing from its footstep is said until the next one."""
    body, plan = planned(0.8)
    body.run(2.0)
    body.speed += [0.0, push]
    said = set[float]()
    body.run(7.5, lambda _: said.add(body.gait.missed))
    assert body.gait.finished and body.gait.steps_done == len(plan) and body.gait.missed < 4e-3
    landed = [tick for tick in body.ticks if Event.LIFT_OFF in tick.reference.progress.events][
        1:
    ] + body.ticks[-1:]
    errors = [
        math.dist(tick.frames[SIDES.index(step.side)].translation[:2], step.position[:2])
        for step, tick in zip(plan.steps, landed, strict=True)
    ]
    assert max(errors[0], *errors[4:]) < 4e-3
    missed = max(errors[1:4])
    assert missed < 4e-3 if push == 0.0 else missed > 0.05
    assert max(said) == pytest.approx(max(errors), abs=1e-9)


PUSHES = ((0.3, 0.0), (0.5, 0.0), (-0.2, 0.0), (-0.3, 0.0), (0.0, 0.5))


@pytest.mark.parametrize("push", by_default(PUSHES, (0.5, 0.0)))
def test_a_robot_that_is_pushed_in_the_last_step_of_a_plan_stands_and_then_steps_back_to_its_end(
    push: tuple[float, float],
) -> None:
    """A footstep that is missed is no order that was dropped."""
    reach = Reach.of(wbc.load_robot("g1").robot(), SCALE.height)
    body, plan = planned(0.4, reach)
    gait = body.gait
    while gait.steps_done < len(plan) - 1:
        body.run(DT)
    body.run(0.3)
    body.speed += push
    body.run(8.0)
    assert gait.finished and gait.planner is None and gait.reason == ""
    for frame, foot in zip(body.ticks[-1].frames, plan.final, strict=True):
        assert math.dist(frame.translation[:2], foot.position[:2]) < BESIDE * reach.max_length


class Ridge:
    """Sight of a ridge across the way, 40 mm high and seen by nothing but the way of a swing."""

    version = 0

    def __init__(self, at: float) -> None:
        """Lie across x, m."""
        self.at = at

    def highest(self, side: int, start: np.ndarray, end: np.ndarray, yaw: float) -> float:
        return 0.04 if min(start[0], end[0]) < self.at < max(start[0], end[0]) else -math.inf

    def support(self, *place: object) -> None: ...
    def stand(self, *place: object) -> None: ...
    def best(self, *place: object) -> None: ...


def test_a_swing_clears_what_lies_on_the_way_to_a_landing_that_has_moved() -> None:
    """A push from behind lengthens the step in flight, over a ridge that the landing at lift-off was short of."""
    body = PointMass()
    body.gait.steering.command((0.2, 0.0, 0.0))
    body.run(1.0)
    while body.gait.step.swing is None or body.ticks[-1].reference.progress.elapsed > 0.02:
        body.run(body.dt)
    swing = body.gait.step.swing
    ridge = Ridge(swing.landing.x + 0.03)
    body.gait.ground.sight = ridge  # type: ignore[assignment]
    body.speed[0] += 0.2
    tops = []
    while body.ticks[-1].reference.progress.elapsed < 0.08:
        body.run(body.dt)
        tops.append(float(swing.at(swing.apex_time).placement.translation[2]))
    assert body.gait.step.swing is swing and swing.landing.x > ridge.at
    assert swing.over == 0.04 and tops[-1] > swing.over + 0.02


@pytest.mark.parametrize("kind", by_default(["velocity", "stop", "plan"], "velocity"))  # a plan is taken once
def test_an_order_that_is_given_in_every_tick_is_that_given_once_and_a_second_run_is_the_first(
    kind: str,
) -> None:
    def order(body: PointMass, plan: FootstepPlan) -> None:
        if kind == "plan":
            body.gait.take(PlanSource(plan))
        else:
            body.gait.steering.command((0.2, 0.03, 0.1) if kind == "velocity" else None)

    def references(body: PointMass, *, again: bool) -> list[bytes]:
        feet = [Footstep(side, *frame.translation[:2]) for side, frame in zip(SIDES, body._feet, strict=True)]
        plan = walk_distance(FootstepPlan(*feet, (), Gait(step_length=0.12)), 0.3)
        if kind == "stop":
            body.gait.steering.command((0.2, 0.0, 0.0))
        body.run(1.5)
        order(body, plan)
        told = len(body.ticks)
        often = again and kind != "plan"
        body.run(3.0 if kind == "plan" else 2.0, (lambda _: order(body, plan)) if often else None)
        found = [tick.reference for tick in body.ticks[told:]]
        assert body.gait.steps_done >= 2
        return [each.pendulum.com.tobytes() + repr((each.progress, each.cop)).encode() for each in found]

    body, again = PointMass(), PointMass()
    first = references(body, again=False)
    assert references(again, again=True) == first
    again.gait.begin(0.0)
    body = PointMass()
    body.gait = again.gait
    assert references(body, again=False) == first
