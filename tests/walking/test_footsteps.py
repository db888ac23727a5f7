"""Footstep plans: what they reach, that they mirror and move with the world, and what is refused."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples

from wbc.base.errors import InputError
from wbc.robots import load
from wbc.sim import Plant
from wbc.walking import WalkingControl
from wbc.walking.plans.check import check_plan
from wbc.walking.plans.footsteps import Footstep, FootstepPlan, mean_heading
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.leg import Leg, SwingLeg, swing_effort
from wbc.walking.plans.planners import climb_stairs, turn_in_place, walk_distance, walk_velocity
from wbc.walking.plans.reach import Reach
from wbc.walking.plans.sources import close_up

START = FootstepPlan(Footstep("left", 0.0, 0.0875), Footstep("right", 0.0, -0.0875), (), Gait())
ROBOT = load("hrp4_class").robot()


def mirror(plan: FootstepPlan) -> FootstepPlan:
    def flip(step: Footstep) -> Footstep:
        side = "right" if step.side == "left" else "left"
        return Footstep(side, step.x, -step.y, step.z, -step.yaw, step.pitch, -step.roll)

    return replace(
        plan, left=flip(plan.right), right=flip(plan.left), steps=tuple(flip(s) for s in plan.steps)
    )


def same(a: FootstepPlan, b: FootstepPlan) -> None:
    assert [s.side for s in a.steps] == [s.side for s in b.steps]
    for p, q in zip((a.left, a.right, *a.steps), (b.left, b.right, *b.steps), strict=True):
        np.testing.assert_allclose(p.placement.homogeneous, q.placement.homogeneous, atol=1e-9)


def test_a_footstep_keeps_its_numbers_and_no_array_of_the_caller() -> None:
    x = np.array(0.2)
    step = Footstep("left", x, np.float32(0.5), 1)  # type: ignore[arg-type]
    x += 1.0
    assert (step.x, step.y, step.z) == (0.2, 0.5, 1.0) and step in {step}


def test_three_metres_are_22_steps_and_end_side_by_side() -> None:
    plan = walk_distance(START, 3.0)
    assert len(plan) == 22
    left, right = plan.final
    np.testing.assert_allclose([left.x, right.x], 3.0)
    np.testing.assert_allclose([left.y, right.y], [0.0875, -0.0875])
    reaches = [step.seen_from(plan.stance(i))[0] for i, step in enumerate(plan.steps)]
    np.testing.assert_allclose(reaches[:-1], 3.0 / 21)
    assert reaches[-1] == pytest.approx(0.0, abs=1e-12)
    check_plan(plan, Reach.of(ROBOT))


@examples(30)
@given(st.floats(-0.15, 0.15), st.floats(-0.05, 0.05), st.floats(-0.2, 0.2), st.integers(1, 8))
def test_plans_mirror_and_follow_the_world(vx: float, vy: float, turn: float, steps: int) -> None:
    first = "left"
    plan = walk_velocity(START, (vx, vy, turn), steps, first=first)
    same(mirror(plan), walk_velocity(mirror(START), (vx, -vy, -turn), steps, first="right"))
    world = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 2.3), np.array([100.0, -50.0, 0.4]))
    same(plan.moved(world), walk_velocity(START.moved(world), (vx, vy, turn), steps, first=first))


def test_a_velocity_is_reached() -> None:
    gait = START.gait.full
    duration = gait.single_support + gait.double_support
    plan = walk_velocity(START, (0.12, 0.03, 0.0), 10)
    middle = 0.5 * (plan.final[0].position + plan.final[1].position)
    np.testing.assert_allclose(middle[:2], [0.12 * 10 * duration, 0.03 * 10 * duration])
    turning = walk_velocity(START, (0.0, 0.0, 0.1), 10)
    assert turning.final[0].yaw == pytest.approx(0.1 * 10 * duration)
    for each in (
        plan,
        turning,
        walk_velocity(START, (0.05, 0.04, -0.15), 6),
        walk_velocity(START, (0, -0.1, 0), 6),
    ):
        check_plan(each, Reach.of(ROBOT))


@pytest.mark.parametrize("angle", [math.pi / 2, -math.pi, 0.1])
def test_turning_in_place_turns_and_stays(angle: float) -> None:
    plan = turn_in_place(START, angle)
    check_plan(plan, Reach.of(ROBOT))
    left, right = plan.final
    np.testing.assert_allclose(0.5 * (left.position + right.position), 0.0, atol=1e-9)
    assert math.remainder(left.yaw - angle, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert math.remainder(right.yaw - angle, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("angle", [0.5, -0.2, 0.02])
@pytest.mark.parametrize("looks", [0.0, 3.0, -3.1])
def test_a_turn_about_a_point_ahead_keeps_its_distance_and_faces_it(angle: float, looks: float) -> None:
    start = START.moved(pin.SE3(pin.utils.rotate("z", looks), np.zeros(3)))
    plan = turn_in_place(start, angle, per_step=0.08, ahead=1.0)
    check_plan(plan, Reach.of(ROBOT))
    for foot in plan.final:
        assert math.remainder(foot.yaw - looks - angle, math.tau) == pytest.approx(0.0, abs=1e-9)
    feet, points = {"left": start.left, "right": start.right}, []
    for step in (start.left, *plan.steps):  # after every step: hands may hold something there
        feet[step.side] = step
        yaw = looks + 0.5 * sum(math.remainder(foot.yaw - looks, math.tau) for foot in feet.values())
        middle = 0.5 * (feet["left"].position + feet["right"].position)
        points.append(middle + [math.cos(yaw), math.sin(yaw), 0.0])
    assert points == pytest.approx(np.tile(points[0], (len(points), 1)), abs=0.02)


def quick(name: str, time: float, share: float, height: float) -> FootstepPlan:
    """Return a plan with a time on one foot, s, and shares of the greatest length and height of steps."""
    robot = load(name).robot()
    reach = Reach.of(robot)
    gait = Gait(
        single_support=time,
        double_support=0.1,
        step_length=share * reach.max_length,
        swing_height=height * reach.max_swing_height,
        takeoff_time=0.03,
        landing_time=0.05,
    )
    plan = walk_distance(FootstepPlan.standing(robot, gait), 5.0 * share * reach.max_length)
    check_plan(plan, reach)
    return plan


@pytest.mark.parametrize("name", ["hrp4_class", "talos"])
@pytest.mark.parametrize(
    ("time", "share", "height", "good"),
    [
        *((0.8, 0.95, 0.15, True), (0.3, 0.45, 0.15, True), (0.8, 0.4, 0.5, True)),
        *((0.3, 0.95, 0.15, False), (0.3, 0.4, 0.7, False), (0.36, 0.95, 0.15, False)),
    ],
)
def test_the_size_of_a_step_is_checked_in_its_time(
    name: str, time: float, share: float, height: float, *, good: bool
) -> None:
    """A long step takes its time, a quick one is short and low: each limit alone is kept by all of these."""
    if good:
        assert len(quick(name, time, share, height)) >= 5
        return
    with pytest.raises(InputError, match="single_support, shorter steps or a lower swing_height"):
        quick(name, time, share, height)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "time", "share", "height"),
    [
        ("hrp4_class", 0.5, 0.7, 0.15),
        ("talos", 0.5, 0.85, 0.15),
        ("g1", 0.3, 0.95, 0.2),
        ("talos", 0.8, 0.3, 0.85),
    ],
)
def test_plans_near_the_limits_are_walked(name: str, time: float, share: float, height: float) -> None:
    plan, plant = (
        quick(name, time, share, height),
        Plant(load(name), noise="realistic", seed=5, visuals=False),
    )
    walking = WalkingControl(plant.description.robot(), plan, plant.control_period)
    while not walking.done and plant.time < 15.0:
        plant.step(walking.command(plant.measure()))
    assert walking.finished and walking.steps_done >= len(plan)


@pytest.mark.parametrize("name", ["hrp4_class", "talos", "g1"])
def test_the_gaits_of_speeds_are_within_what_legs_give(name: str) -> None:
    start = FootstepPlan.standing(load(name).robot())
    leg = Reach.of(load(name).robot()).leg
    efforts = []
    for speed in (0.15, 0.2, 0.25, 0.3):
        gait = Gait.for_speed((speed, 0.0, 0.0), start.gait)
        step = speed * gait.cycle
        efforts.append(swing_effort(leg, gait, -step, step, 0.0))
        assert efforts[-1] < swing_effort(leg, gait, -step, step, step) + 1e-9
    assert efforts == sorted(efforts) and efforts[-1] < 1.0


def test_the_joints_of_a_leg_bring_its_ankle_to_its_place() -> None:
    leg = SwingLeg(0.42, 0.24, 0.6, 1.0, 1.0, 1.0)
    for at in ((0.0, 0.0), (0.0, 0.18), (0.5, 0.6)):  # out of its reach
        assert 0.0 < leg.joints(*at)[1] < math.pi
    for ahead, below in itertools.product((-0.3, 0.0, 0.2), (0.3, 0.55)):
        hip, knee = leg.joints(ahead, below)
        assert knee > 0.0
        angles, bars = np.array((hip, hip - knee)), np.array((leg.thigh, leg.shank))
        assert bars @ np.sin(angles) == pytest.approx(ahead)
        assert bars @ np.cos(angles) == pytest.approx(below)


@examples(60)
@given(st.floats(0.0, 0.3), st.floats(0.0, 0.3), st.floats(0.0005, 0.02))
def test_the_shortest_swing_is_accepted_and_stays_so_on_every_grid(
    takeoff: float, landing: float, period: float
) -> None:
    """Half of the time on one foot may be take-off and landing: 0.05 + 0.1 is no more than half of 0.3."""
    single = max(2.0 * (takeoff + landing), takeoff + landing + 0.1)
    gait = Gait(single_support=single, takeoff_time=takeoff, landing_time=landing)
    on_grid, _ = gait.on_grid(period)
    assert on_grid.single_support is not None
    ticks = on_grid.single_support / period
    assert ticks == pytest.approx(round(ticks)) and -1e-9 <= on_grid.single_support - single <= period
    assert Gait(single_support=0.3, takeoff_time=0.05, landing_time=0.1).full.cycle == pytest.approx(0.6)


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize("rise", [0.1, -0.1])
def test_stairs(rise: float, together: bool) -> None:
    plan = climb_stairs(START, rise=rise, tread=0.3, count=4, first_edge=0.4, together=together)
    reach = Reach.of(ROBOT, 0.76)
    check_plan(plan, reach)
    left, right = plan.final
    levels = np.repeat((1, 2, 3, 4), (2, 2, 2, 2) if together else (1, 1, 1, 2))
    assert [step.z for step in plan.steps] == pytest.approx([0.0] * 3 + [*(rise * levels)])
    assert left.z == right.z == pytest.approx(4 * rise)
    assert left.x == right.x == pytest.approx(0.4 + 3.5 * 0.3)
    edges = 0.4 + 0.3 * np.arange(4)
    for step in plan.steps:  # whole soles on the treads
        assert np.abs(edges - step.x).min() > 0.08
        assert step.z == pytest.approx(rise * (edges < step.x).sum())


def test_stance_and_the_foot_that_leaves() -> None:
    plan = walk_distance(START, 0.5, first="right")
    assert plan.stance(0) == START.left and plan.feet(0)[1] == START.right
    assert plan.stance(1) == plan.steps[0] and plan.feet(1)[0] == START.left
    assert plan.stance(3) == plan.steps[2] and plan.feet(3)[0] == plan.steps[1]


@pytest.mark.parametrize(("name", "bound"), [("x", 0.01), ("z", 0.01), ("yaw", 0.05)])
def test_a_foot_closes_up_unless_it_stands_beside_the_other_already(name: str, bound: float) -> None:
    for off, steps in ((0.9 * bound, 0), (1.1 * bound, 1)):
        left = replace(START.left, **{name: getattr(START.left, name) + off})
        assert len(close_up(replace(START, left=left), "left")) == steps


def test_a_ground_that_is_known_lifts_the_steps() -> None:
    plan = walk_distance(START, 1.0).on(lambda x, y: 0.1 * x + 0.2 * y)
    for step in plan.steps:
        assert step.z == pytest.approx(0.1 * step.x + 0.2 * step.y)


def test_a_footstep_can_be_read_off_a_robot_that_has_fallen() -> None:
    world = pin.SE3(pin.rpy.rpyToMatrix(-1.4, 0.9, 2.0), np.array([1.0, 2.0, 0.1]))
    step = Footstep.of("left", world)
    np.testing.assert_allclose(step.placement.homogeneous, world.homogeneous, atol=1e-12)


@pytest.mark.parametrize("name", ["hrp4_class", "talos", "g1"])
def test_bent_knees_reach_further_and_a_height_out_of_reach_is_refused(name: str) -> None:
    robot = load(name).robot()
    height = Leg(robot).com_height
    assert Reach.of(robot, height - 0.03).max_length > Reach.of(robot).max_length
    for wrong in (0.2, height + 0.3):
        with pytest.raises(InputError, match="CoM height"):
            Reach.of(robot, wrong)


def test_plans_are_joined_into_an_l() -> None:
    """1 m ahead, a quarter turn, 1 m ahead: by plans that are added, and by planners that go on from a plan."""
    start = FootstepPlan.standing(ROBOT).moved(
        pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 0.7), np.array([3.0, -2.0, 0.1]))
    )
    added = walk_distance(start, 1.0) + turn_in_place(start, 0.5 * math.pi) + walk_distance(start, 1.0)
    onward = walk_distance(turn_in_place(walk_distance(start, 1.0), 0.5 * math.pi), 1.0)
    middle = 0.5 * (start.left.position + start.right.position)
    c, s = math.cos(0.7), math.sin(0.7)
    for plan in (added, onward):
        left, right = plan.final
        end = middle + [c - s, s + c, 0.0]
        np.testing.assert_allclose(0.5 * (left.position + right.position), end, atol=1e-9)
        assert mean_heading(left.yaw, right.yaw) == pytest.approx(0.7 + 0.5 * math.pi)
        check_plan(plan, Reach.of(ROBOT))
        assert plan.left == start.left and plan.right == start.right and plan.end.steps == ()
    assert added + start == added
    same(start + added, added)
    other_gait = replace(start, gait=replace(start.gait, swing_height=0.05))
    with pytest.raises(InputError, match="gait"):
        _ = added + walk_distance(other_gait, 0.5)


@pytest.mark.parametrize("first", ["left", "right"])
def test_a_foot_that_stepped_last_is_waited_for(first: str) -> None:
    """Sides alternate in a joined plan: the other foot steps in its place between."""
    start = FootstepPlan.standing(ROBOT)
    plan = walk_distance(start, 0.2)
    joined = plan + walk_distance(start, 0.2, first=first)
    again = plan.steps[-1].side == first
    assert len(joined) == 2 * len(plan) + again
    if again:
        stays = joined.steps[len(plan)]
        assert stays == dict(left=plan.final[0], right=plan.final[1])[stays.side]
    assert walk_distance(plan, 0.2).steps[: len(plan)] == plan.steps
    assert len(walk_distance(plan, 0.2)) == 2 * len(plan)
