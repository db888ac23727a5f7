"""Estimates of ground, load and legs of a walk in closed form, and what a leg is wherever the world begins."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from steered_walk import steered_steps

from wbc.base.errors import InputError
from wbc.core.estimation.outside import OutsideSettings, OutsideWrench
from wbc.core.frames import heading
from wbc.core.robot import GRAVITY, Robot
from wbc.robots import load
from wbc.walking.ground import GroundEstimate
from wbc.walking.load import LAG, REST_LAG, SETTLING, HeldLoad
from wbc.walking.plans.footsteps import Footstep, FootstepPlan
from wbc.walking.plans.gait import Gait, StepGait
from wbc.walking.plans.leg import Leg
from wbc.walking.plans.planners import (
    MOST_STEPS,
    climb_stairs,
    turn_in_place,
    walk_distance,
    walk_path,
    walk_velocity,
)
from wbc.walking.plans.reach import Reach
from wbc.walking.plans.sources import AT_REST, Standing
from wbc.walking.plans.swing import SwingFoot

START = FootstepPlan(Footstep("left", 0.0, 0.0875), Footstep("right", 0.0, -0.0875), (), Gait())


# ---- ground ---------------------------------------------------------------------------------------------------------


def test_the_ground_is_level_up_to_one_height_and_uneven_from_another_one_on() -> None:
    ground = GroundEstimate(0.5, 0.25)
    for uneven, share in ((0.0, 1.0), (0.01, 1.0), (0.02, 0.75), (0.04, 0.25), (0.05, 0.0), (0.2, 0.0)):
        ground.uneven = uneven
        assert ground.level(0.01, 0.05) == pytest.approx(share)


# ---- load -----------------------------------------------------------------------------------------------------------


def held(robot: Robot) -> tuple[HeldLoad, OutsideWrench]:
    outside = OutsideWrench(robot, OutsideSettings(tare=0.0))
    return HeldLoad(robot, outside), outside


def test_a_load_that_comes_is_followed_quickly_and_one_that_stays_slowly() -> None:
    """The first sign of it at rest with T = 0.5 s, from then on with 0.1 s: m (1 − e^{−t/T})."""
    robot, dt, mass = load("hrp4_class").robot(), 0.005, 4.0
    held_load, outside = held(robot)
    own = robot.mass
    assert not held_load.changing
    left, expected = mass, []
    for tick in range(60):
        outside.wrench = np.array([0.0, 0.0, -(mass - held_load.applied) * GRAVITY, 0.0, 0.0, 0.0])
        held_load.update(dt)
        left *= math.exp(-dt / (REST_LAG if tick == 0 else LAG))
        expected.append(mass - left)
        assert held_load.mass == pytest.approx(expected[-1], rel=1e-6)
        assert held_load.changing
    for _ in range(round(1.5 * SETTLING / dt) + 200):
        outside.wrench = np.array([0.0, 0.0, -(mass - held_load.applied) * GRAVITY, 0.0, 0.0, 0.0])
        held_load.update(dt)
    assert not held_load.changing and held_load.mass == pytest.approx(mass, rel=1e-3)
    before = held_load.mass
    small = 0.9 * 0.01 * own
    outside.wrench = np.array([0.0, 0.0, -(mass + small - held_load.applied) * GRAVITY, 0.0, 0.0, 0.0])
    held_load.update(dt)
    assert not held_load.changing, "an error of the sensors is no change"
    assert held_load.mass - before == pytest.approx(
        (mass + small - before) * (1.0 - math.exp(-dt / REST_LAG))
    )


# ---- legs -----------------------------------------------------------------------------------------------------------


def test_a_leg_is_the_same_wherever_its_half_sitting_stands() -> None:
    """Heights are those over the sole, not those of the world."""
    robot, moved = (load("hrp4_class").robot() for _ in range(2))
    vars(moved)["half_sitting"] = np.array(robot.half_sitting) + np.eye(robot.nq)[:3].T @ (1.0, -2.0, 0.4)
    leg, other = Leg(robot), Leg(moved)
    for figure in (
        "length",
        "shank",
        "knee",
        "shortest",
        "ankle_height",
        "hip_height",
        "com_height",
        "spacing",
    ):
        assert getattr(other, figure) == pytest.approx(getattr(leg, figure), abs=1e-9), figure
    low = leg.com_height - 0.03
    assert other.hips(low) == pytest.approx(leg.hips(low)) and other.span(low) == pytest.approx(leg.span(low))
    assert other.carried_height() == pytest.approx(leg.carried_height())
    assert other.bent_height(0.9) == pytest.approx(leg.bent_height(0.9))
    assert other.swing(None) == pytest.approx(leg.swing(None))


# ---- plans ----------------------------------------------------------------------------------------------------------


def test_a_plan_has_as_many_steps_as_it_may_and_no_more() -> None:
    """Of a turn two for each pair of feet; of stairs two each, and two of the approach."""
    half = MOST_STEPS // 2
    step = START.gait.full.step_length
    assert len(turn_in_place(START, 0.001 * half, per_step=0.001)) == MOST_STEPS
    with pytest.raises(InputError, match=f"takes {MOST_STEPS + 2} steps"):
        turn_in_place(START, 0.001 * (half + 1), per_step=0.001)
    assert len(walk_distance(START, step * MOST_STEPS)) == MOST_STEPS + 1
    with pytest.raises(InputError, match=f"takes {MOST_STEPS + 1} steps"):
        walk_distance(START, -step * (MOST_STEPS + 0.5))
    with pytest.raises(InputError, match=f"takes {2 * MOST_STEPS} steps"):
        walk_path(START, [(0.0, 0.0, 0.0)] * (2 * MOST_STEPS))
    with pytest.raises(InputError, match=f"takes {MOST_STEPS + 1} steps"):
        walk_velocity(START, (0.1, 0.0, 0.0), MOST_STEPS + 1)
    with pytest.raises(InputError, match=f"takes {MOST_STEPS + 2} steps"):
        climb_stairs(START, rise=0.1, tread=0.3, count=half, first_edge=0.4)
    assert climb_stairs(START, rise=1e-5, tread=0.3, count=half - 1, first_edge=0.15)


def test_feet_stand_half_a_tread_before_the_first_edge() -> None:
    plan = climb_stairs(START, rise=0.1, tread=0.3, count=1, first_edge=0.15)
    assert [step.x for step in plan.steps] == pytest.approx([0.3, 0.3]), "there is nothing to approach"
    with pytest.raises(InputError, match=r"half a tread, 0\.15 m, before the edge, got 0\.14 m"):
        climb_stairs(START, rise=0.1, tread=0.3, count=1, first_edge=0.14)


def test_a_robot_sets_off_with_the_foot_on_the_side_of_the_motion_else_of_the_turn() -> None:
    reach = Reach.of(load("hrp4_class").robot())
    for velocity, side in (
        ((0.1, 0.0, 0.0), "left"),
        ((0.1, 0.05, -0.1), "left"),
        ((0.1, -0.05, 0.1), "right"),
        ((0.0, 0.0, 0.1), "left"),
        ((0.0, 0.0, -0.1), "right"),
    ):
        assert walk_velocity(START, velocity, 3).steps[0].side == side
        for first in (None, "right"):
            planner = steered_steps(reach)
            planner.steering.command(velocity)
            plan = planner.footsteps(Standing(START, first, 0, False, 0.0))
            assert plan.steps[0].side == (first or side) and planner.granted != AT_REST


# ---- swings ---------------------------------------------------------------------------------------------------------


def test_a_foot_rolls_into_its_landing_over_its_share_of_the_swing() -> None:
    start = Footstep("left", 0.0, 0.0875)
    landing = replace(start, x=0.2, roll=0.1, pitch=-0.1)
    shape = StepGait(takeoff_time=0.0, landing_time=0.0).swing._replace(level=0.5, edge=0.0)
    foot = SwingFoot(start.placement, landing, 0.8, shape)
    times = np.linspace(0.0, 0.8, 801)
    rolls = np.array([pin.rpy.matrixToRpy(foot.at(float(t)).placement.rotation)[0] for t in times])
    assert times[int(np.argmax(rolls > 0.1 - 1e-7))] == pytest.approx(0.4, abs=0.01)
    np.testing.assert_allclose(foot.at(0.4).placement.rotation, foot.at(0.8).placement.rotation, atol=1e-6)


def test_a_foot_leaves_the_ground_with_the_speed_of_its_shape_and_its_heading_turns_the_short_way() -> None:
    start = Footstep("left", 0.0, 0.0875, 0.0, 3.0)
    shape = StepGait().swing._replace(lift_speed=0.3)
    foot = SwingFoot(start.placement, replace(start, x=0.2, yaw=-3.0), 0.8, shape)
    assert foot.motion(0.0)[1] == pytest.approx((0.0, 0.0, 0.3))
    yaws = [heading(foot.at(time).placement.rotation) for time in (0.0, 0.4, 0.8)]
    assert (yaws[0], yaws[2]) == pytest.approx((3.0, -3.0)) and abs(yaws[1]) > 3.0


def test_a_foot_in_the_air_goes_on_over_the_ground_that_it_is_given() -> None:
    """Its apex is over the higher one of that ground and of its landing, with no more lift than legs have."""
    start = Footstep("left", 0.0, 0.0875)
    for ground in (0.0, 0.06):
        foot = SwingFoot(start.placement, replace(start, x=0.2), 0.8, StepGait().swing)
        place = pin.SE3(np.eye(3), np.array([0.05, 0.09, 0.02]))
        foot.join(0.1, place, (0.2, 0.0, 0.0), ground, 3.0)
        assert foot.motion(0.1) == (pytest.approx((0.05, 0.09, 0.02)), pytest.approx((0.2, 0.0, 0.0)))
        top = max(foot.motion(float(t))[0][2] for t in np.linspace(0.1, 0.8, 701))
        assert top == pytest.approx(ground + StepGait().swing_height, abs=1e-4)
