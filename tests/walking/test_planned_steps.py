"""Planned steps in closed form: steering to a goal, where a robot counts as there, and what plans and checks say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from steered_walk import steered_steps

from wbc.base.errors import InputError
from wbc.robots import load
from wbc.walking.plans.footsteps import Footstep, FootstepPlan, check_start
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.planners import climb_stairs, turn_in_place, walk_distance, walk_path, walk_velocity
from wbc.walking.plans.reach import Reach
from wbc.walking.plans.sources import (
    AHEAD,
    AT_REST,
    DriveSettings,
    FootstepSource,
    PlanSource,
    Standing,
    checked_velocity,
    close_up,
    next_steps,
)
from wbc.walking.steering import Steering
from wbc.walking.stepping.program import Bounds, Now, StepProgram, Wish

ROBOT = load("hrp4_class").robot()
REACH, SPACING = Reach.of(ROBOT), 0.175
GAIT = Gait()


def feet_at(x: float, y: float = 0.0, yaw: float = 0.0, z: float = 0.0) -> FootstepPlan:
    """Both feet about a place, beside each other."""
    left, right = (
        Footstep(side, x - sign * math.sin(yaw), y + sign * math.cos(yaw), z, yaw)
        for side, sign in (("left", 0.5 * SPACING), ("right", -0.5 * SPACING))
    )
    return FootstepPlan(left, right, (), GAIT)


def at_rest(start: FootstepPlan, begun: int = 0, time: float = 0.0) -> Standing:
    return Standing(start, None, begun, False, time)


# ---- a goal ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("first", [None, "left", "right"])
@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_a_goal_is_walked_to_in_two_steps_from_the_middle_of_the_feet_or_beside_the_one_that_stands(
    first: str | None, yaw: float
) -> None:
    """A velocity of the way over two cycles; feet that stride have their middle half a spacing beside the stance."""
    c, s = math.cos(yaw), math.sin(yaw)
    start = feet_at(1.0, -2.0, yaw)
    if first is not None:  # the foot that swings next is far behind and does not count
        foot = start.foot(first)
        start = replace(start, **{first: replace(foot, x=foot.x - 0.3 * c, y=foot.y - 0.3 * s)})
    start = replace(start, gait=replace(GAIT, feet_spacing=SPACING))
    planner = steered_steps(REACH, granted=(0.01, 0.0, 0.0), pace=0.01)
    planner.steering.go_to(1.0 + 0.2 * c - 0.06 * s, -2.0 + 0.2 * s + 0.06 * c, yaw + 0.1)
    two = 2.0 * Gait.for_speed(planner.granted, start.gait).cycle
    wanted = planner._towards_goal(Standing(start, first, 3, False, 0.0))
    assert wanted == pytest.approx((0.2 / two, 0.06 / two, 0.1 / two))


def test_a_robot_walks_to_a_near_goal_no_faster_than_its_settings_say() -> None:
    planner = steered_steps(REACH, DriveSettings(fastest=(0.05, 0.2, 0.5)))
    planner.steering.go_to(0.5, 0.0, 0.0)
    assert planner._towards_goal(at_rest(feet_at(0.0)))[0] == pytest.approx(0.05)
    planner.steering.go_to(-0.5, 0.0, 0.0)
    assert planner._towards_goal(at_rest(feet_at(0.0)))[0] == pytest.approx(-0.05)
    planner.steering.go_to(0.59, 0.0, 3.0)
    assert planner._towards_goal(at_rest(feet_at(0.0)))[2] > 0.1, (
        "within 0.6 m it turns to the goal's heading"
    )
    planner.steering.go_to(0.61, 0.0, 3.0)
    assert planner._towards_goal(at_rest(feet_at(0.0)))[2] == pytest.approx(0.0), "beyond, to the goal"


@pytest.mark.parametrize(
    ("off", "turn", "there"),
    [(0.019, 0.0, True), (0.021, 0.0, False), (0.0, 0.049, True), (0.0, -0.049, True), (0.0, 0.051, False)],
)
def test_a_goal_is_reached_within_20_mm_and_50_mrad(off: float, turn: float, *, there: bool) -> None:
    planner = steered_steps(REACH)
    planner.steering.go_to(1.0 + 0.6 * off, 0.8 * off, turn)
    assert len(planner.footsteps(at_rest(feet_at(1.0))).steps) == (0 if there else 5)
    assert (planner.steering.goal is None) == there


@pytest.mark.parametrize(
    ("x", "turn", "steps"), [(0.029, 0.0, 0), (0.031, 0.0, 1), (0.0, 0.099, 0), (0.0, 0.101, 1)]
)
def test_a_robot_that_was_there_with_feet_that_stride_stands_by_what_closed_feet_may_be_off(
    x: float, turn: float, steps: int
) -> None:
    """10 mm and 50 mrad more, once it has stopped there."""
    planner = steered_steps(REACH)
    planner.steering.go_to(1.0, 0.0, 0.0)
    planner.footsteps(Standing(feet_at(1.0), "left", 4, False, 0.0))
    assert planner.steering.goal is not None, "it has to close up first"
    plan = planner.footsteps(at_rest(feet_at(1.0 + x, 0.0, turn), 5))
    assert bool(plan.steps) == bool(steps) and (planner.steering.goal is None) == (not steps)


def test_feet_that_miss_their_places_count_as_there_after_two_landings_within_what_they_miss() -> None:
    """20 mm and the distance of the landing that is further from its plan, of the last one of each foot.

    The ground takes the feet back each time, so that the robot is as far from its goal as before.
    """
    for away, landings in ((0.068, 3), (0.072, None)):
        planner, begun, found = steered_steps(REACH), 7, None
        start = replace(feet_at(1.0), gait=replace(GAIT, feet_spacing=SPACING))
        planner.steering.go_to(1.0 + away, 0.0, 0.0)
        planner.footsteps(Standing(start, "left", begun, False, 0.0))
        for side, (x, y) in (("left", (0.03, -0.04)), ("right", (0.0, 0.02))) * 2:
            foot, swings = start.foot(side), "right" if side == "left" else "left"
            planner._way.aim, begun = (begun, foot), begun + 1
            planner._way.goal = planner.steering.goal = (1.0 + away + x, y, 0.0)
            landed = replace(start, **{side: replace(foot, x=foot.x + x, y=foot.y + y)})
            wanted = planner._towards_goal(Standing(landed, swings, begun, False, 0.1 * begun))
            assert planner._way.missed["left"] == pytest.approx(0.05)
            assert planner._way.missed["right"] == pytest.approx(0.02 if begun > 8 else 0.0)
            if wanted == AT_REST and found is None:
                found = begun - 7
        assert found == landings, "the first one shows what is missed; the next two count"


def test_a_new_goal_forgets_what_was_missed_on_the_way_to_the_last_one() -> None:
    planner = steered_steps(REACH)
    planner.steering.go_to(1.5, 0.0, 0.0)
    planner.footsteps(Standing(feet_at(1.0), "left", 0, False, 0.0))
    planner._way.missed["left"], planner._way.tries, planner._way.beside = 0.3, 5, True
    planner.steering.go_to(1.6, 0.0, 0.0)
    planner._towards_goal(Standing(feet_at(1.0), "right", 1, False, 0.1))
    assert planner._way.missed == {"left": 0.0, "right": 0.0} and planner._way.tries == 0


def test_a_step_in_the_air_is_not_looked_at_before_it_lands() -> None:
    planner = steered_steps(REACH)
    planner.steering.go_to(1.5, 0.0, 0.0)
    plan = planner.footsteps(Standing(feet_at(1.0), "left", 3, False, 0.0))
    aim = plan.steps[0]
    moved = replace(feet_at(1.0), left=replace(aim, x=aim.x + 0.01, y=aim.y - 0.02))
    planner._towards_goal(Standing(moved, "right", 4, True, 0.2))
    assert planner._way.missed["left"] == 0.0
    planner._towards_goal(Standing(moved, "right", 4, False, 0.3))
    assert planner._way.missed["left"] == pytest.approx(math.hypot(0.01, 0.02))


@pytest.mark.parametrize("aside", [0.0, 0.6])
def test_a_step_above_a_tenth_of_a_metre_is_halved_before_a_stand(aside: float) -> None:
    """By the way of both parts together, at the speed of the gait that it has."""
    for way in (0.099, 0.101):
        cycle = Gait.at_speed(0.1).cycle
        granted = (math.sqrt(1.0 - aside**2) * way / cycle, aside * way / cycle, 0.0)
        planner = steered_steps(REACH, granted=granted, pace=0.1)
        plan = planner.footsteps(Standing(feet_at(1.0), "left", 0, False, 0.0))
        assert (planner.granted == AT_REST) == (way < 0.1)
        assert bool(plan.steps) == (way > 0.1)


def test_the_step_in_the_air_is_the_first_of_the_two_in_which_a_robot_stops() -> None:
    cycle = Gait.at_speed(0.3).cycle
    for swings, halved in ((True, False), (False, True)):
        planner = steered_steps(REACH, granted=(0.3, 0.0, 0.0), pace=0.3)
        plan = planner.footsteps(Standing(feet_at(1.0), "right", 5, swings, 0.0))
        assert [step.x for step in plan.steps] == pytest.approx([1.0 + 0.15 * cycle] * 2 if halved else [])


def test_a_goal_beside_the_ground_is_refused_and_one_on_its_edge_is_taken() -> None:
    steering = Steering(DriveSettings().limits, 0.6, (-1.0, 2.0, -3.0, 4.0))
    for x, y in ((-1.0, 4.0), (2.0, -3.0), (0.0, 0.0)):
        steering.command((0.1, 0.0, 0.0))
        steering.go_to(x, y, 0.1)
        assert steering.goal == (x, y, 0.1) and steering.target is None and steering.pending
    for x, y in ((-1.001, 0.0), (2.001, 0.0), (0.0, -3.001), (0.0, 4.001)):
        with pytest.raises(InputError, match="goal"):
            steering.go_to(x, y, 0.0)
    assert steering.goal == (0.0, 0.0, 0.1)
    steering.command((0.0, 0.0, 0.0))
    assert not steering.pending, "a velocity of zero is a stand"
    steering.command((0.0, 0.0, -0.1))
    assert steering.target == (0.0, 0.0, -0.1) and steering.pending


def test_the_limits_of_a_driven_robot_are_those_of_its_settings() -> None:
    limits = DriveSettings(fastest=(0.4, 0.3, 0.7), fastest_back=0.2).limits
    assert (limits.forward, limits.back, limits.aside, limits.turn) == (0.4, 0.2, 0.3, 0.7)
    for given in ((10.0, -10.0, 10.0), (-10.0, 10.0, -10.0)):
        assert checked_velocity(given) == given
        for part in range(3):
            with pytest.raises(InputError):
                checked_velocity([1.001 * v if i == part else v for i, v in enumerate(given)])


# ---- plans ----------------------------------------------------------------------------------------------------------


def test_a_step_turns_a_foot_by_less_than_half_a_turn() -> None:
    """The foot on the side of a turn takes two steps' worth of it."""
    most = 0.5 * math.pi / GAIT.full.cycle
    for sign in (1.0, -1.0):
        plan = walk_velocity(feet_at(0.0), (0.0, 0.0, sign * 0.999 * most), 1)
        assert plan.steps[0].yaw == pytest.approx(sign * 0.999 * math.pi)
        with pytest.raises(InputError, match=rf"by {sign * math.pi * 1.001:.2f} rad.* is {most:.2f} rad/s"):
            walk_velocity(feet_at(0.0), (0.0, 0.0, sign * 1.001 * most), 1)
        walk_path(feet_at(0.0), [(0.0, 0.0, sign * math.pi)])
        with pytest.raises(InputError, match="half a turn"):
            walk_path(feet_at(0.0), [(0.0, 0.0, sign * 3.15)])


def test_steps_stand_half_a_spacing_beside_a_middle_at_the_height_between_both_feet() -> None:
    start = replace(feet_at(1.0, 2.0, 0.5), left=replace(feet_at(1.0, 2.0, 0.5).left, z=0.04))
    plan = walk_path(start, [(0.1, 0.02, 0.2), (0.1, -0.01, 0.1)], first="right")
    place, side = (1.0, 2.0, 0.5), -1.0
    moves = [(0.1, 0.02, 0.2), (0.1, -0.01, 0.1), (0.0, 0.0, 0.0)]
    assert len(plan) == 3
    for step, (dx, dy, turn) in zip(plan.steps, moves, strict=True):
        c, s = math.cos(place[2]), math.sin(place[2])
        place = (place[0] + c * dx - s * dy, place[1] + s * dx + c * dy, place[2] + turn)
        half = 0.5 * side * start.spacing
        expected = (
            place[0] - half * math.sin(place[2]),
            place[1] + half * math.cos(place[2]),
            0.02,
            place[2],
        )
        assert (step.x, step.y, step.z, step.yaw) == pytest.approx(expected)
        side = -side


@pytest.mark.parametrize(("angle", "per_step", "pairs"), [(0.5, 0.25, 2), (0.51, 0.25, 3), (-0.2, 0.25, 1)])
def test_a_turn_on_the_spot_takes_pairs_of_steps_of_which_the_outer_one_turns(
    angle: float, per_step: float, pairs: int
) -> None:
    for ahead in (0.0, 0.4):
        plan = turn_in_place(feet_at(0.0), angle, per_step=per_step, ahead=ahead)
        assert len(plan) == 2 * pairs
        assert plan.steps[0].side == ("left" if (angle > 0.0) == (ahead == 0.0) else "right")
        for k, (a, b) in enumerate(zip(plan.steps[::2], plan.steps[1::2], strict=True)):
            assert a.yaw == pytest.approx(b.yaw) == pytest.approx((k + 1) * angle / pairs)


def test_the_count_of_steps_of_a_distance_is_the_least_of_their_greatest_length() -> None:
    most = GAIT.full.step_length
    for share, count in ((0.4, 1), (1.0, 1), (1.0001, 2), (-3.0, 3), (-3.2, 4)):
        plan = walk_distance(feet_at(0.0), share * most)
        assert len(plan) == count + 1
        assert plan.steps[0].x == pytest.approx(share * most / count)
    walk_distance(feet_at(0.0), -1.01e-6)
    with pytest.raises(InputError, match="must not be zero"):
        walk_distance(feet_at(0.0), 0.99e-6)


@pytest.mark.parametrize("yaw", [0.0, 2.5])
def test_later_steps_keep_their_places_beside_a_changed_landing_or_in_the_world(yaw: float) -> None:
    plan = walk_distance(feet_at(1.0, -1.0, yaw), 0.5)
    old = plan.steps[1]
    new = replace(old, x=old.x + 0.03, y=old.y - 0.02, z=0.01, yaw=old.yaw + 0.3)
    carried = plan.with_step(1, new)
    assert carried.steps[0] == plan.steps[0] and carried.steps[1] == new
    for before, after in zip(plan.steps[2:], carried.steps[2:], strict=True):
        assert after.seen_from(new) == pytest.approx(before.seen_from(old))
    assert plan.with_step(1, new, carry=False).steps[2:] == plan.steps[2:]
    for index in (-1, len(plan)):
        with pytest.raises((InputError, ValueError)):
            plan.with_step(index, new)
    with pytest.raises(InputError, match="step 0 is of"):
        plan.with_step(0, new)


@pytest.mark.parametrize(
    ("name", "fits", "beyond"),
    [("x", 0.019, 0.021), ("y", -0.019, -0.021), ("z", 0.049, -0.051), ("yaw", -0.049, 0.051)],
)
@pytest.mark.parametrize("side", ["left", "right"])
def test_a_plan_begins_where_the_robot_stands(name: str, fits: float, beyond: float, side: str) -> None:
    plan = FootstepPlan.standing(ROBOT)
    foot = plan.foot(side)
    check_start(ROBOT, replace(plan, **{side: replace(foot, **{name: getattr(foot, name) + fits})}))
    with pytest.raises(InputError, match=f"its {side} foot"):
        check_start(ROBOT, replace(plan, **{side: replace(foot, **{name: getattr(foot, name) + beyond})}))
    off = replace(foot, x=foot.x + 0.6 * 0.021, y=foot.y + 0.8 * 0.021)
    with pytest.raises(InputError, match="within 0.02 m"):
        check_start(ROBOT, replace(plan, **{side: off}))


@pytest.mark.parametrize("yaw", [0.0, -2.0])
def test_a_foot_closes_up_to_beside_the_other_one_at_its_height_and_heading(yaw: float) -> None:
    start = feet_at(0.5, 0.2, yaw, 0.1)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        stance = start.foot("right" if side == "left" else "left")
        astray = replace(
            start, **{side: Footstep(side, 3.0, 1.0, 0.0, 0.4)}, gait=replace(GAIT, feet_spacing=0.2)
        )
        (step,) = close_up(astray, side).steps
        assert step.seen_from(stance) == pytest.approx((0.0, sign * 0.2, 0.0, 0.0), abs=1e-12)


def test_a_foot_that_steps_out_of_turn_steps_beside_the_other_one_and_the_plan_goes_on_from_there() -> None:
    plan = walk_distance(feet_at(0.0), 0.4)  # left first
    for moved in (0.0, 0.05):  # a foot that stands there already steps in its place
        source, right = PlanSource(plan), feet_at(0.0).right
        source.footsteps(Standing(feet_at(0.0), "left", 2, False, 0.0))
        start = replace(feet_at(0.0), right=replace(right, x=moved), gait=replace(GAIT, feet_spacing=SPACING))
        later = source.footsteps(Standing(start, "right", 2, False, 0.5))
        assert later.steps[0].side == "right" and later.steps[1:] == plan.steps
        assert later.steps[0].x == pytest.approx(0.0) and later.steps[0].y == pytest.approx(right.y)
        assert source.plan.steps == later.steps
        assert source.footsteps(Standing(start, "left", 3, False, 0.9)).steps == plan.steps
        assert source.to_check == 2, "the others have been checked"


class Fixed(FootstepSource):
    """Planner that answers with one plan."""

    def __init__(self, plan: FootstepPlan, to_check: int | None) -> None:
        self.plan, self.to_check = plan, to_check

    def footsteps(self, now: Standing) -> FootstepPlan:
        return self.plan


def test_as_many_steps_of_a_planner_are_checked_as_it_asks_for() -> None:
    plan = walk_distance(feet_at(0.0), 0.6)
    far = plan.with_step(2, replace(plan.steps[2], x=9.0), carry=False)
    now = Standing(feet_at(0.0), "left", 0, False, 0.0, REACH)
    for to_check, good in ((0, True), (1, True), (2, True), (3, False), (None, False)):
        if good:
            assert next_steps(Fixed(far, to_check), now) is far
        else:
            with pytest.raises(InputError, match="step 3"):
                next_steps(Fixed(far, to_check), now)
    assert next_steps(Fixed(far, None), now._replace(reach=None)) is far, "of unknown legs nothing is checked"
    with pytest.raises(InputError, match="left foot steps next|right foot steps next"):
        next_steps(Fixed(plan, 0), now._replace(first="right"))
    edge = (-1.0, plan.steps[0].x + 0.01, -1.0, 1.0)
    with pytest.raises(InputError, match="leaves the ground"):
        next_steps(Fixed(plan, 0), now, edge)
    together = now._replace(start=replace(now.start, left=replace(now.start.left, y=-0.05)))  # soles overlap
    assert next_steps(Fixed(plan, 0), together, (-1.0, 2.0, -1.0, 1.0)) is plan, "the ground alone is checked"
    assert next_steps(Fixed(feet_at(3.0), None), now).steps == ()
    # Steps begin where the feet are, not where the planner has them.
    shifted = Standing(feet_at(-0.5), "left", 0, False, 0.0, REACH)
    with pytest.raises(InputError, match="step 1"):
        next_steps(Fixed(plan, None), shifted)


@pytest.mark.parametrize("to_check", [None, 1, 0])
def test_a_sole_that_leaves_the_ground_is_refused_whether_the_reach_of_the_legs_is_known_or_not(
    to_check: int | None,
) -> None:
    """Of unknown legs the centres of the soles are on the ground: 120 mm further than whole soles."""
    plan = walk_distance(feet_at(0.0), 0.145)
    x, length = plan.steps[0].x, REACH.soles[0][0]
    for reach, room in ((REACH, 0.5 * length), (None, 0.0)):
        now = Standing(feet_at(0.0), "left", 0, False, 0.0, reach)
        for high, good in ((x + room + 1e-6, True), (x + room - 1e-6, False)):
            ground = (-1.0, high, -1.0, 1.0)
            if good:
                assert next_steps(Fixed(plan, to_check), now, ground) is plan
                continue
            with pytest.raises(InputError, match="step 1 leaves the ground"):
                next_steps(Fixed(plan, to_check), now, ground)
    far, long = (-1.0, 0.4, -1.0, 1.0), PlanSource(walk_distance(feet_at(0.0), 1.0))
    long.begin(None, far)
    with pytest.raises(InputError, match="leaves the ground"):
        long.footsteps(Standing(feet_at(0.0), "left", 0, False, 0.0))


@pytest.mark.parametrize("rise", [0.1, -0.1])
def test_stairs_begin_at_the_height_between_both_feet(rise: float) -> None:
    start = feet_at(1.0, 2.0, 0.5, 0.3)
    start = replace(start, left=replace(start.left, z=0.34))
    plan = climb_stairs(start, rise=rise, tread=0.3, count=2, first_edge=0.4)
    assert [step.z for step in plan.steps[-4:]] == pytest.approx([0.32 + rise] * 2 + [0.32 + 2.0 * rise] * 2)
    assert plan.steps[0].z == pytest.approx(0.32)
    for k, step in enumerate(plan.steps[-4::2]):
        place = step.middle(start.spacing)
        way = math.hypot(place[0] - 1.0, place[1] - 2.0)
        assert way == pytest.approx(0.4 + (k + 0.5) * 0.3)


def test_times_of_a_gait_are_whole_periods_and_what_was_rounded_is_told() -> None:
    """To the nearest one, and the time on one foot up where take-off and landing need it."""
    gait, notes = Gait(single_support=0.803, double_support=0.301, swing_height=0.05).on_grid(0.005)
    assert (gait.single_support, gait.double_support) == pytest.approx((0.805, 0.3))
    assert notes == (
        "single_support of 0.803 s rounded to 0.805 s, a multiple of the control period",
        "double_support of 0.301 s rounded to 0.3 s, a multiple of the control period",
    )
    same = Gait(single_support=0.8, double_support=0.3)
    assert same.on_grid(0.005) == (same, ())
    short = Gait(single_support=0.301, takeoff_time=0.05, landing_time=0.1)
    assert short.on_grid(0.02)[0].single_support == pytest.approx(0.3), "half of it is take-off and landing"
    long = Gait(single_support=0.305, takeoff_time=0.05, landing_time=0.102)
    assert long.on_grid(0.02)[0].single_support == pytest.approx(0.32)
    swing = Gait(single_support=0.251, takeoff_time=0.05, landing_time=0.07)
    assert swing.full.swing.shortest == pytest.approx(0.22)
    assert Gait(double_support=0.0126).on_grid(0.005)[0].double_support == pytest.approx(0.015)
    with pytest.raises(InputError, match="must span two control periods of 0.005 s"):
        Gait(double_support=0.007).on_grid(0.005)
    assert Gait(double_support=0.0076).on_grid(0.005)[0].double_support == pytest.approx(0.01)


@pytest.mark.parametrize(("take_off", "fits"), [(0.05, True), (0.0502, False)])
def test_take_off_and_landing_are_half_of_the_time_on_one_foot_at_most(
    take_off: float, *, fits: bool
) -> None:
    if fits:
        assert Gait(single_support=0.3, takeoff_time=take_off, landing_time=0.1).full.cycle == pytest.approx(
            0.6
        )
        Gait(single_support=0.2, takeoff_time=0.05, landing_time=0.05)
        return
    with pytest.raises(InputError, match="half of the single support, 0.15 s, got 0.1502 s"):
        Gait(single_support=0.3, takeoff_time=take_off, landing_time=0.1)
    with pytest.raises(InputError, match="at least 0.12 s for take-off, swing and landing, got 0.119 s"):
        Gait(single_support=0.119, takeoff_time=0.01, landing_time=0.01)


def test_a_footstep_is_seen_from_another_one_in_its_heading() -> None:
    for yaw in (0.0, 3.0, -2.2):
        stance = Footstep("right", 1.0, -2.0, 0.1, yaw)
        c, s = math.cos(yaw), math.sin(yaw)
        step = Footstep("left", 1.0 + 0.3 * c - 0.2 * s, -2.0 + 0.3 * s + 0.2 * c, 0.15, yaw + 0.4 - math.tau)
        assert step.seen_from(stance) == pytest.approx((0.3, 0.2, 0.05, 0.4))
        world = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 1.1), np.array([0.3, 0.2, 0.5]))
        assert step.moved(world).seen_from(stance.moved(world)) == pytest.approx((0.3, 0.2, 0.05, 0.4))
    tilted = Footstep("left", 0.1, 0.2, 0.3, 0.4, 0.05, -0.06, fixed=True)
    again = Footstep.of("left", tilted.placement)
    assert (again.pitch, again.roll, again.yaw) == pytest.approx((0.05, -0.06, 0.4))
    assert tilted.moved(pin.SE3.Identity()).fixed


def test_a_program_without_a_solution_has_none() -> None:
    """ξ 10 km away: no step within reach leaves an offset that is bounded."""
    wish = Wish((0.1, 0.2, 0.1, 0.2, 0.1, 0.2), (0.0,) * 6, 0.4)
    bounds = Bounds(((-0.4, 0.1), (0.4, 0.6)), ((0.0, 0.0), (0.0, 0.0)), (0.0, 0.0), (0.1, 0.5))
    program = StepProgram(0.6)
    assert program.solve(Now((0.02, 0.05), (0.0, 0.0), 4.0, 0.4, 0.4), wish, bounds) is not None
    for ahead, outwards in ((1e4, 0.0), (0.0, -1e4)):
        assert program.solve(Now((ahead, outwards), (0.0, 0.0), 4.0, 0.4, 0.4), wish, bounds) is None


def test_a_walk_plans_with_a_bounded_number_of_steps_whatever_a_planner_answers() -> None:
    """What is checked and planned in a tick is bounded by it; what it leaves out is asked for again."""
    plan = walk_distance(feet_at(0.0), 30.0)
    now = Standing(feet_at(0.0), "left", 0, False, 0.0, REACH)
    far = plan.with_step(AHEAD, replace(plan.steps[AHEAD], x=90.0), carry=False)
    assert next_steps(Fixed(far, None), now).steps == plan.steps[:AHEAD]
