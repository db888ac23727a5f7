"""Legs: what they reach, and what a step asks of them in its time, by trigonometry and by other solvers."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples
from scipy.optimize import linprog

from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY
from wbc.robots import RobotDescription, load
from wbc.walking.plans.check import check_plan
from wbc.walking.plans.footsteps import Footstep, FootstepPlan
from wbc.walking.plans.gait import Gait, StepGait, pace
from wbc.walking.plans.leg import Leg, SwingLeg, swing_effort
from wbc.walking.plans.planners import walk_distance
from wbc.walking.plans.reach import Reach
from wbc.walking.plans.sources import PlanSource, Standing
from wbc.walking.plans.swing import SwingFoot

START = FootstepPlan(Footstep("left", 0.0, 0.0875), Footstep("right", 0.0, -0.0875), (), Gait())
ROBOT = load("hrp4_class").robot()
LEG = SwingLeg(0.36, 0.34, 0.62, 8.0, 9.0, 30.0)


def effort_of(leg: SwingLeg, gait: StepGait, way: float = 0.4, aside: float = 0.1) -> float:
    return swing_effort(leg, gait, -0.5 * way, 0.5 * way, aside)


def test_the_effort_of_a_hip_is_the_acceleration_of_quintics_over_the_way_and_the_height() -> None:
    """10/√3 d/t² with the time in which the foot travels, or rises; over 0.69 of what the hip gives."""
    strong = LEG._replace(hip_speed=1e6, knee_speed=1e6)
    gait = StepGait(single_support=0.8, takeoff_time=0.05, landing_time=0.1, swing_height=0.06, apex=0.4)
    travel = 10.0 / math.sqrt(3.0) * math.hypot(0.4, 0.1) / 0.65**2
    assert effort_of(strong, gait) == pytest.approx(travel / (0.69 * 30.0))
    high = replace(gait, swing_height=0.2)
    assert effort_of(strong, high, 0.1, 0.0) == pytest.approx(
        10.0 / math.sqrt(3.0) * 0.2 / 0.32**2 / (0.69 * 30.0)
    )


@pytest.mark.parametrize("joint", ["hip", "knee"])
def test_the_effort_of_a_joint_is_its_greatest_speed_over_what_it_has(joint: str) -> None:
    """By the angles of two bars at the foot's places below a hip that goes half as far as the foot."""
    slow = LEG._replace(push=1e6, **{f"{other}_speed": 1e6 for other in ("hip", "knee") if other != joint})
    gait = StepGait(single_support=0.8, double_support=0.2)
    foot = SwingFoot(Footstep("left", -0.2, 0.0).placement, Footstep("left", 0.2, 0.0), 0.8, gait.swing)
    angles = []
    for k in range(31):
        x, _, z = foot.motion(0.8 * k / 30)[0]
        hip = 0.5 * 0.8 / 1.0 * (-0.2 + 0.4 * k / 30)
        ahead, below = x - hip, 0.62 - z
        far = math.hypot(ahead, below)
        knee = math.pi - math.acos((0.36**2 + 0.34**2 - far**2) / (2.0 * 0.36 * 0.34))
        lead = math.asin(0.34 * math.sin(knee) / far)
        angles.append(knee if joint == "knee" else math.atan2(ahead, below) + lead)
    speed = np.abs(np.diff(angles)).max() / (0.8 / 30)
    share = {"hip": 0.8 * 8.0, "knee": 1.03 * 9.0}[joint]
    assert effort_of(slow, gait, aside=0.0) == pytest.approx(speed / share, rel=1e-6)


@pytest.mark.parametrize("name", ["hrp4_class", "g1"])
def test_a_leg_spans_what_its_length_leaves_over_the_height_of_its_hip(name: str) -> None:
    """By Pythagoras; greatest lengths and widths of steps go with it, a third and a half of the leg up."""
    robot = load(name).robot()
    leg, reach = Leg(robot), Reach.of(robot)
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, robot.half_sitting)
    com = pin.centerOfMass(model, data, robot.half_sitting)
    joints = robot.joints_between(robot.soles[0].frame, robot.base_frame)
    places = [data.oMi[robot.joint_numbers[joint]].translation for joint in joints]
    hip, knee, ankle = (
        next(p for p, j in zip(places, joints, strict=True) if part in robot.joint_names[j])
        for part in ("hip_pitch", "knee", "ankle")
    )
    shank, height = (
        np.linalg.norm(knee - ankle),
        float(data.oMf[robot.frame_id(robot.soles[0].frame)].translation[2]),
    )
    assert leg.shank == pytest.approx(shank, rel=0.02)
    thigh = leg.length - leg.shank
    bent = np.array([thigh, 0.0]) + leg.shank * np.array(
        [math.cos(math.radians(120)), math.sin(math.radians(120))]
    )
    assert leg.shortest == pytest.approx(np.linalg.norm(bent))
    assert leg.com_height == pytest.approx(com[2] - height) and leg.ankle_height > 0.0
    for low in (None, leg.com_height - 0.04):
        hips = leg.hip_height - (0.0 if low is None else 0.04)
        assert leg.hips(low) == pytest.approx(hips)
        assert math.hypot(leg.span(low), hips) == pytest.approx(0.98 * leg.length)
        here = Reach.of(robot, low)
        assert here.max_length == pytest.approx(1.6 * leg.span(low))
        assert here.max_spacing == pytest.approx(leg.spacing + 1.2 * leg.span(low))
        assert here.leg.hip_height == pytest.approx(hips)
    assert (reach.max_height, reach.max_swing_height) == pytest.approx((leg.length / 3.0, leg.length / 2.0))
    assert reach.min_single_support == pytest.approx(0.9 * math.sqrt(leg.com_height / GRAVITY))
    assert reach.leg.thigh + reach.leg.shank == pytest.approx(leg.length)
    inertia = pin.crba(model, model.createData(), robot.half_sitting)
    at = robot.joint_index(next(robot.joint_names[j] for j in joints if "hip_pitch" in robot.joint_names[j]))
    alone = float(robot.torque_limit[at]) / float(inertia[6 + at, 6 + at])
    assert leg.hip_acceleration() == pytest.approx(alone)
    assert reach.leg.push == pytest.approx(leg.length * alone)
    straight = leg.hip_height > 0.95 * leg.length
    lower = leg.hip_height - max(0.9 * leg.length, leg.shortest)
    assert leg.bent_height(0.9) == pytest.approx(leg.com_height - (max(lower, 0.0) if straight else 0.0))
    assert leg.bent_height(1.0) == pytest.approx(leg.com_height)


@examples(30)
@given(*[st.floats(-0.3, 0.3)] * 2, *[st.floats(-math.pi, math.pi)] * 2)
def test_soles_overlap_where_a_point_is_in_both(x: float, y: float, here: float, there: float) -> None:
    """By a linear program for a point within the edges of both."""
    reach = Reach.of(ROBOT)
    a, b = Footstep("left", 1.0, -2.0, yaw=here), Footstep("right", 1.0 + x, -2.0 + y, yaw=there)
    rows, bounds, corners = [], [], []
    for foot, (length, width) in zip((a, b), reach.soles, strict=True):
        c, s = math.cos(foot.yaw), math.sin(foot.yaw)
        for axis, half in (((c, s), 0.5 * length), ((-s, c), 0.5 * width)):
            middle = float(np.dot(axis, (foot.x, foot.y)))
            rows += [axis, tuple(-part for part in axis)]
            bounds += [half + middle, half - middle]
        corners.append([
            (foot.x + u * c - v * s, foot.y + u * s + v * c)
            for u in (0.5 * length, -0.5 * length)
            for v in (0.5 * width, -0.5 * width)
        ])  # fmt: skip
    matrix = np.column_stack((np.array(rows), np.ones(8)))
    found = linprog((0, 0, -1), matrix, bounds, bounds=[(None, None)] * 3)
    if abs(found.x[2]) > 1e-6:
        assert reach.overlap(a, b) == reach.overlap(b, a) == (found.x[2] > 0.0)
    for foot, expected in zip((a, b), corners, strict=True):
        np.testing.assert_allclose(sorted(reach.corners(foot).tolist()), sorted(expected), atol=1e-9)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_a_step_out_of_reach_goes_as_far_as_it_can_on_its_way(side: str, yaw: float) -> None:
    reach, sign = Reach.of(ROBOT), 1.0 if side == "left" else -1.0
    stance = Footstep("right" if side == "left" else "left", 1.0, -2.0, 0.1, yaw)

    def at(ahead: float, aside: float, turn: float) -> Footstep:
        c, s = math.cos(yaw), math.sin(yaw)
        left = sign * aside
        return Footstep(side, 1.0 + c * ahead - s * left, -2.0 + s * ahead + c * left, 0.1, yaw + sign * turn)

    r = reach
    for (ahead, aside, turn), (x, y, out) in (
        ((0.9 * r.max_length, 0.2, 0.0), (0.9 * r.max_length, 0.2, 0.0)),
        ((1.1 * r.max_length, 0.2, 0.0), (0.8 * r.max_length, 0.2, 0.0)),
        ((-1.1 * r.max_length, 0.2, 0.0), (-0.8 * r.max_length, 0.2, 0.0)),
        ((0.1, 2.0, 0.0), (0.1, r.max_spacing, 0.0)),
        ((0.4 * r.max_length, -0.5, 0.0), (0.4 * r.max_length, r.min_spacing, 0.0)),
        ((0.1, 0.2, 2.0 * r.max_yaw), (0.1, 0.2, r.max_yaw)),
        ((0.1, 0.25, -2.0 * r.max_yaw), (0.1, 0.25, -0.5 * r.max_yaw)),
    ):
        near, expected = reach.nearest(stance, at(ahead, aside, turn)), at(x, y, out)
        assert (near.x, near.y) == pytest.approx((expected.x, expected.y))
        assert math.remainder(near.yaw - expected.yaw, math.tau) == pytest.approx(0.0, abs=1e-9)
        within = (ahead, aside) == (x, y)
        assert reach.allows(stance, at(ahead, aside, 0.0)) == within
        assert reach.allows(stance, near)
    for turn in (r.max_yaw, -0.5 * r.max_yaw):
        step = at(0.1, 0.25, turn)
        assert reach.nearest(stance, step) is step, "at the limit it stays"
    beside = reach.nearest(stance, at(0.0, 0.0, r.max_yaw))
    assert not reach.overlap(stance, beside), "it goes outwards until the soles are clear of each other"
    assert reach.overlap(stance, at(0.0, abs(beside.seen_from(stance)[1]) - 0.011, r.max_yaw))


def test_a_step_counts_by_its_share_of_the_greatest_length_or_height() -> None:
    reach, gait = Reach.of(ROBOT), StepGait(swing_height=0.03)
    for end, share in (
        (0.5 * reach.max_length, 0.5),
        (-0.25 * reach.max_length, 0.25),
        (0.0, 0.03 / reach.max_swing_height),
    ):
        expected = share * swing_effort(reach.leg, gait, -0.1, round(end, 3), 0.05)
        assert reach.effort(gait, -0.1, end, 0.05) == pytest.approx(expected)


@pytest.mark.parametrize("found", [0.02, -0.015])
def test_a_plan_goes_on_at_the_height_at_which_its_last_landing_has_found_the_ground(found: float) -> None:
    plan = walk_distance(START, 0.6)
    source, first = PlanSource(plan), plan.steps[0]
    source.footsteps(Standing(START, "left", 5, False, 0.0))
    landed = replace(START, **{first.side: replace(first, z=first.z + found)})
    later = source.footsteps(Standing(landed, plan.steps[1].side, 6, False, 1.0))
    assert [step.z for step in later.steps] == pytest.approx([found] * (len(plan) - 1))
    assert [step.x for step in later.steps] == pytest.approx([step.x for step in plan.steps[1:]])


@pytest.mark.parametrize(("share", "more"), [(0.2, False), (0.3, True)])
def test_a_foot_that_ends_too_far_beside_its_place_takes_a_further_step(share: float, more: bool) -> None:
    """From a quarter of the longest step on, the foot that is further away first, six times at most."""
    plan, reach = walk_distance(START, 0.3), Reach.of(ROBOT)
    source, (left, right) = PlanSource(plan), plan.final
    source.footsteps(Standing(START, "left", 0, False, 0.0, reach))
    off = replace(left, x=left.x + 0.6 * share * reach.max_length, y=left.y + 0.8 * share * reach.max_length)
    feet = FootstepPlan(off, right, (), plan.gait)
    for done in (len(plan), len(plan) + 5, len(plan) + 6):
        steps = source.footsteps(Standing(feet, None, done, False, 9.0, reach)).steps
        assert [step.side for step in steps] == (["left"] if more and done < len(plan) + 6 else [])
        for step in steps:
            assert (step.x, step.y) == pytest.approx((left.x, left.y))


def test_what_is_at_the_limit_is_within_reach_and_a_millimetre_beyond_is_not() -> None:
    reach = Reach.of(ROBOT)
    gait = StepGait(single_support=max(2.0, reach.min_single_support), swing_height=0.03)

    def plan(
        ahead: float = 0.0, aside: float = 0.2, up: float = 0.0, turn: float = 0.0, **tilt: float
    ) -> FootstepPlan:
        step = Footstep("left", ahead, aside - 0.0875, up, turn, **tilt)
        return replace(START, steps=(step,), gait=gait)

    def fits(each: FootstepPlan) -> bool:
        try:
            check_plan(each, reach, effort=False)
        except InputError:
            return False
        return True

    for name, low, high in (
        ("ahead", -reach.max_length, reach.max_length),
        ("up", -reach.max_height, reach.max_height),
        ("pitch", -0.5, 0.5),
        ("roll", -0.5, 0.5),
        ("turn", -0.5 * reach.max_yaw, reach.max_yaw),
    ):
        assert fits(plan(**{name: low})) and fits(plan(**{name: high}))
        assert not fits(plan(**{name: low - 1e-3})) and not fits(plan(**{name: high + 1e-3}))
    assert fits(plan(aside=reach.max_spacing)) and not fits(plan(aside=reach.max_spacing + 1e-3))
    assert fits(plan(aside=reach.min_spacing)) and not fits(plan(aside=reach.min_spacing - 1e-3))
    for name, value, beyond in (
        ("swing_height", reach.max_swing_height, 1e-3),
        ("single_support", reach.min_single_support, -1e-3),
    ):
        for off, fit in ((0.0, True), (beyond, False)):
            changed = {"takeoff_time": 0.02, "landing_time": 0.02, name: value + off}
            assert fits(replace(plan(), gait=replace(gait, **changed))) == fit


@pytest.mark.parametrize(("axis", "end"), [(0, 0), (0, 1), (1, 2), (1, 3)])
def test_a_plan_leaves_the_ground_where_a_corner_of_a_sole_does(axis: int, end: int) -> None:
    reach, plan = Reach.of(ROBOT), walk_distance(START, 0.5)
    corners = np.concatenate([reach.corners(foot) for foot in (plan.left, plan.right, *plan.steps)])
    edges = [corners[:, 0].min(), corners[:, 0].max(), corners[:, 1].min(), corners[:, 1].max()]
    check_plan(plan, reach, tuple(edges))
    edges[end] += -1e-3 if end % 2 else 1e-3
    with pytest.raises(InputError, match="leaves the ground"):
        check_plan(plan, reach, tuple(edges))


@pytest.mark.parametrize("height", [0.0, 0.5])
def test_a_plan_climbs_by_the_height_from_foot_to_foot_and_not_by_that_of_its_ground(height: float) -> None:
    level = walk_distance(START, 0.4).on(lambda x, y: height)
    assert not level.climbs
    assert not replace(level, steps=tuple(replace(s, z=height + 0.019) for s in level.steps)).climbs
    assert replace(level, steps=tuple(replace(s, z=height + 0.021) for s in level.steps)).climbs
    assert replace(level, steps=tuple(replace(s, z=height - 0.021) for s in level.steps)).climbs


def test_a_gait_lies_between_the_rows_of_its_table_on_its_grid() -> None:
    """By the forward, twice the sideways or 0.6 m of the turning speed; times in 10 ms."""
    assert pace((0.1, -0.04, 0.1)) == pytest.approx(0.1)
    assert pace((-0.05, -0.04, 0.1)) == pytest.approx(0.08)
    assert pace((0.05, 0.02, -0.2)) == pytest.approx(0.12)
    for speed, share in ((0.19, 4.0 / 15.0), (0.24, 0.6)):
        gait = Gait.at_speed(speed)
        for name, row in (
            ("single_support", (0.8, 0.57)),
            ("double_support", (0.3, 0.15)),
            ("landing_time", (0.1, 0.08)),
        ):
            assert getattr(gait, name) == pytest.approx(row[0] + share * (row[1] - row[0]), abs=0.0051)
            assert getattr(gait, name) / 0.01 == pytest.approx(round(getattr(gait, name) / 0.01))
        for name, row in (
            ("swing_height", (0.06, 0.05)),
            ("landing_speed", (0.1, 0.12)),
            ("apex", (0.4, 0.42)),
        ):
            assert getattr(gait, name) == pytest.approx(row[0] + share * (row[1] - row[0]), abs=0.00051)


@pytest.mark.parametrize(("left", "right", "most"), [(0.3, 0.5, 0.24), (0.5, 0.2, 0.16), (1.0, 1.0, 0.5)])
def test_feet_turn_outwards_by_four_fifths_of_what_both_hips_do(
    left: float, right: float, most: float
) -> None:
    limits = {"left_hip_yaw": (-0.9, left), "right_hip_yaw": (-right, 0.9)}
    urdf = (Path(__file__).parents[2] / "examples" / "biped.urdf").read_text(encoding="utf-8")
    feet = {"left_sole": "left_foot", "right_sole": "right_foot"}
    robot = RobotDescription.from_urdf(urdf, position_limits=limits, **feet).robot()
    assert Reach.of(robot).max_yaw == pytest.approx(most)


@pytest.mark.parametrize("index", [0, 2])
def test_a_plan_that_cannot_be_walked_is_refused_with_the_number_of_its_step(index: int) -> None:
    reach, plan = Reach.of(ROBOT), walk_distance(START, 0.4)
    step = plan.steps[index]

    def changed(**values: float) -> FootstepPlan:
        return plan.with_step(index, replace(step, **values), carry=False)

    number = f"step {index + 1} of {len(plan)}"
    with pytest.raises(InputError, match=number):
        check_plan(changed(z=2.0), reach)
    close = replace(reach, min_spacing=0.01)
    with pytest.raises(InputError, match=f"overlap at {number}"):
        check_plan(changed(y=-0.03 if step.side == "left" else 0.03), close)
    weak = replace(reach, leg=reach.leg._replace(hip_speed=1e-3))
    with pytest.raises(InputError, match="step 1 of"):
        check_plan(plan, weak)
    edge = max(s.x for s in plan.steps[:index]) if index else 0.0
    with pytest.raises(InputError, match=f"step {index + 1} leaves"):
        check_plan(plan, reach, (-9.0, edge + 0.09, -9.0, 9.0))
