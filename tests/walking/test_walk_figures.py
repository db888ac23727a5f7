"""Figures of a walk in closed form: costs and gains of its tasks, its height over stairs, limits of arms and body."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from point_mass import SCALE
from task_factory import make_robot

from wbc import load_robot
from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY, Robot
from wbc.core.trajectories import Quintic
from wbc.robots import RobotDescription
from wbc.tasks.balance import BodyGains
from wbc.tasks.stabilizer.distribution import DistributionSettings
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking import FootstepPlan, WalkingControl, WalkingControlSettings
from wbc.walking.body import lowest_com
from wbc.walking.contact import Event, GaitPhase, touch_down
from wbc.walking.hands.arm import Route
from wbc.walking.lipm.schedule import HeightProfile, ZmpTarget, schedule
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.leg import Leg, vertical_joint
from wbc.walking.plans.planners import climb_stairs
from wbc.walking.plans.swing import FootMotion
from wbc.walking.source import Progress, StandSource
from wbc.walking.stepping.gait import SteppingWalk
from wbc.walking.stepping.settings import SteppingConstants, SteppingSettings
from wbc.walking.table import TaskGains, free_table, planned_table

DT = 0.005
START = FootstepPlan(Footstep("left", 0.0, 0.0875), Footstep("right", 0.0, -0.0875), (), Gait())


# ---- costs and gains ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("by_load", [False, True])
@pytest.mark.parametrize("torque", [False, True])
def test_the_table_of_planned_steps_has_the_gains_of_its_settings(torque: bool, by_load: bool) -> None:
    """In torque control a swing foot may turn, feet come back softly and have the friction of the ground."""
    robot = make_robot("g1")
    gains = TaskGains(
        com_weight=90.0, com_stiffness=80.0, orientation_weight=7.0, orientation_stiffness=60.0,
        posture_weight=0.3, posture_stiffness=15.0, swing_weight=500.0, swing_stiffness=300.0,
        contact_stiffness=700.0, wrench_weight=2e-3,
    )  # fmt: skip
    distribution = DistributionSettings(friction=0.55, by_load=by_load)
    table = planned_table(robot, gains, distribution, torque=torque)
    for contact in table.contacts:
        assert contact.friction == (0.55 if torque else 2.0)
        assert contact.min_force == 0.0
        np.testing.assert_allclose(contact.stiffness, 100.0 if torque else 700.0)
    np.testing.assert_allclose(table.swing["weight"], [500.0] * 3 + [1.0 if torque else 500.0] * 3)
    assert table.swing["stiffness"] == 300.0
    for trunk in table.trunk:
        assert (trunk["weight"], trunk["stiffness"]) == (7.0, 60.0)
    np.testing.assert_allclose(table.com.weight, 90.0)
    np.testing.assert_allclose(table.com.stiffness, [0.0, 0.0, 80.0] if torque else 80.0)
    expected = np.full(robot.na, 0.3)
    if by_load:
        expected[robot.leg_joints] = 0.003
    np.testing.assert_allclose(table.posture.weight, expected)
    np.testing.assert_allclose(table.posture.stiffness, 15.0)
    assert table.stabilized is not None and table.stabilized.torque is torque and table.feet is None
    assert table.rise is None and table.reaching == 1.0
    assert isinstance(gains, BodyGains)


def test_the_table_of_free_steps_is_in_units_of_the_robot() -> None:
    """Costs of rotations in h², stiffness in ω², damping in ω, of forces in 1/m², of moments in 1/(m h)²."""
    robot = make_robot("g1")
    table = free_table(robot, SteppingWalk(SteppingSettings(), SCALE, 0.0, DT))
    law, h, omega = SteppingConstants().in_si(SCALE), SCALE.height, math.sqrt(GRAVITY / SCALE.height)
    feet = table.feet
    assert feet is not None and table.rise is not None and table.twist is not None
    np.testing.assert_allclose(feet.stand[0][:2], law.stand.stand_gain * omega**2)
    np.testing.assert_allclose(feet.stand[1][:2], (1.0 + law.stand.stand_gain) * omega)
    np.testing.assert_allclose(feet.shift[0][:2], law.stand.shift_gains[0])
    np.testing.assert_allclose(feet.shift[1][:2], law.stand.shift_gains[1])
    for gains in (feet.shift, feet.stand, (table.com.stiffness, table.com.damping)):
        assert (gains[0][2], gains[1][2]) == pytest.approx((3.67 * omega**2, 3.46 * omega))
    np.testing.assert_allclose(table.swing["weight"], [20.0, 20.0, 120.0, *[5.6 * h**2] * 3])
    np.testing.assert_allclose(
        table.swing["stiffness"], [*[law.swing.swing_gains[0]] * 3, *[24.5 * omega**2] * 3]
    )
    np.testing.assert_allclose(table.swing["damping"], [*[law.swing.swing_gains[1]] * 3, *[8.9 * omega] * 3])
    (pelvis, torso), damping = table.trunk, 5.45 * omega
    np.testing.assert_allclose(pelvis["weight"], np.array([8.3, 8.3, 0.83]) * h**2)
    np.testing.assert_allclose(torso["weight"], np.array([1.2, 1.2, 0.003]) * h**2)
    for trunk in table.trunk:
        assert (trunk["stiffness"], trunk["damping"]) == pytest.approx((7.35 * omega**2, damping))
    np.testing.assert_allclose(feet.swing(0.0), 1.0)
    np.testing.assert_allclose(feet.swing(1.0), [10.0, 10.0, 3.0, 1.0, 1.0, 1.0])
    np.testing.assert_allclose(feet.swing(-1.0), 0.03)
    np.testing.assert_allclose(feet.single, [*[1000.0] * 3, *[8.3 * h**2] * 3])
    np.testing.assert_allclose(feet.firm, [*[1000.0] * 3, *[2780.0 * h**2] * 3])
    assert table.reaching == 0.03
    for contact in table.contacts:
        wrench = [*[1.1e-3 / SCALE.mass**2] * 3, *[2.0 / (SCALE.mass * h) ** 2] * 3]
        np.testing.assert_allclose(contact.wrench_weight, wrench)
        np.testing.assert_allclose(contact.damping, 5.0 * omega)
    legs = np.zeros(robot.na, bool)
    legs[robot.leg_joints] = True
    posture = table.posture
    np.testing.assert_allclose(posture.weight, np.where(legs, 2.8e-3, 1.39) * h**2)
    np.testing.assert_allclose(posture.stiffness, np.where(legs, 0.0, 4.9) * omega**2)
    np.testing.assert_allclose(posture.damping, np.where(legs, 0.5, 3.96) * omega)
    assert (table.twist["weight"], table.twist["stiffness"]) == pytest.approx((450.0 * h**2, 2.0 * omega**2))
    assert table.rise.slack == pytest.approx(0.03 * h)


# ---- height ---------------------------------------------------------------------------------------------------------


def level_at(rise: float, time: float, start: float = 0.0) -> tuple[float, float, float]:
    """Height of a walk that steps up or down once, both feet, with times from the landing of the first one, s."""
    steps = (Footstep("left", 0.3, 0.0875, rise), Footstep("right", 0.3, -0.0875, rise))
    supports = schedule(replace(START, steps=steps))
    landing = supports[0].duration + supports[1].duration
    rest = Pendulum.at_rest(np.array([0.0, 0.0, 0.76 + start]))
    return HeightProfile(supports, 0.76, rest).at(landing + time)


def test_a_low_stair_is_risen_from_the_landing_to_the_middle_of_the_next_support() -> None:
    """0.3 s on both feet and half of 0.8 s on one; a quintic from rest to rest, at 0.16 m/s in the mean at most."""
    for rise in (0.03, 0.059):
        curve = Quintic((0.0, 0.0, 0.0), (rise, 0.0, 0.0), 0.7)
        for time in (0.0, 0.1, 0.35, 0.6, 0.7, 1.0):
            expected = curve.at(min(time, 0.7))
            np.testing.assert_allclose(level_at(rise, time), expected, atol=1e-12)


def test_a_high_stair_is_risen_by_20_mm_before_the_lower_foot_leaves() -> None:
    """And then to its height by the middle of the support, unless that is faster than 0.16 m/s in the mean."""
    first = Quintic((0.0, 0.0, 0.0), (0.02, 0.0, 0.0), 0.3)
    for rise in (0.061, 0.1):
        duration = max(0.4, (rise - 0.02) / 0.16)
        rest = Quintic((0.02, 0.0, 0.0), (rise, 0.0, 0.0), duration)
        for time in (0.1, 0.2, 0.3):
            np.testing.assert_allclose(level_at(rise, time), first.at(time), atol=1e-12)
        for time in (0.35, 0.5, 0.65, 0.3 + duration):
            np.testing.assert_allclose(level_at(rise, time), rest.at(time - 0.3), atol=1e-12)


def test_a_low_stair_down_is_sunk_from_the_middle_of_a_support_until_both_feet_have_settled() -> None:
    for drop in (0.03, 0.119):
        curve = Quintic((0.0, 0.0, 0.0), (-drop, 0.0, 0.0), 0.4 + 0.3)
        for time in (-0.5, -0.4, -0.2, 0.0, 0.2, 0.3, 0.6):
            expected = curve.at(min(max(time + 0.4, 0.0), 0.7))
            np.testing.assert_allclose(level_at(-drop, time), expected, atol=1e-12)


def test_a_deep_stair_down_is_sunk_all_but_20_mm_when_the_foot_lands() -> None:
    drop = 0.15
    curve = Quintic((0.0, 0.0, 0.0), (0.02 - drop, 0.0, 0.0), 0.8)
    for time in (-0.8, -0.5, -0.1, 0.0):
        np.testing.assert_allclose(level_at(-drop, time), curve.at(time + 0.8), atol=1e-12)
    np.testing.assert_allclose(level_at(-drop, 0.3), (-drop, 0.0, 0.0), atol=1e-12)


def test_a_height_goes_on_from_where_the_com_is_to_the_ground_of_the_supports() -> None:
    curve = Quintic((0.01, 0.0, 0.0), (0.0, 0.0, 0.0), 0.8)
    supports = schedule(replace(START, steps=(Footstep("left", 0.1, 0.0875),)))
    profile = HeightProfile(supports, 0.76, Pendulum.at_rest(np.array([0.0, 0.0, 0.77])))
    for time in (-1.0, 0.0, 0.2, 0.5, 0.8, 2.0):
        np.testing.assert_allclose(profile.at(time), curve.at(min(max(time, 0.0), 0.8)), atol=1e-12)


def test_a_schedule_has_the_times_of_its_gait_and_the_feet_that_stand() -> None:
    gait = Gait(single_support=0.7, double_support=0.25, initial_double_support=0.6, final_double_support=0.9)
    plan = climb_stairs(
        replace(START, gait=gait), rise=0.05, tread=0.3, count=1, first_edge=0.15, together=True
    )
    supports = schedule(plan)
    assert [s.duration for s in supports] == pytest.approx([0.6, 0.7, 0.25, 0.7, 0.9])
    assert all(s.total == s.duration for s in supports)
    first, second = plan.steps
    assert [s.feet for s in supports] == [
        (START.left, START.right), (START.right,), (START.right, first), (first,), (first, second),
    ]  # fmt: skip
    (stand,) = schedule(replace(START, gait=gait))
    assert stand.duration == stand.total == pytest.approx(1.5)


@pytest.mark.parametrize("yaw", [0.0, 2.2])
def test_the_zmp_of_a_foot_is_ahead_and_inwards_in_its_heading(yaw: float) -> None:
    target, c, s = ZmpTarget(forward=0.02, inward=0.01), math.cos(yaw), math.sin(yaw)
    for side, left in (("left", -0.01), ("right", 0.01)):
        point = target.under(Footstep(side, 1.0, -2.0, 0.0, yaw))
        expected = (1.0 + 0.02 * c - left * s, -2.0 + 0.02 * s + left * c)
        assert (point.real, point.imag) == pytest.approx(expected)


# ---- phases ---------------------------------------------------------------------------------------------------------


def test_a_touch_down_is_early_in_time_or_late_by_its_bounds() -> None:
    for late, event in (
        (-0.031, Event.EARLY_TOUCH_DOWN),
        (-0.029, Event.TOUCH_DOWN),
        (0.0, Event.TOUCH_DOWN),
        (0.049, Event.TOUCH_DOWN),
        (0.051, Event.LATE_TOUCH_DOWN),
    ):
        assert touch_down(late, 0.03, 0.05) is event


def test_the_record_of_a_step_has_its_landing_and_a_foot_that_has_landed_is_no_longer_in_the_air() -> None:
    robot, landing = load_robot("hrp4_class").robot(), Footstep("right", 0.3, -0.1)
    rest = StandSource(robot).update(None).progress  # type: ignore[arg-type]
    assert rest._replace(heading=0.0) == Progress()
    for swing, side in ((1, "right"), (0, "left"), (None, None)):
        step = Progress(GaitPhase.SINGLE, 1, swing, upcoming=(landing,))
        assert step.swing_side == side and step.landing is (None if swing is None else landing)
        assert step.air == swing and step._replace(landed=True).air is None
    assert Progress().landing is None


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_a_stand_has_its_com_over_the_ground_between_its_soles(yaw: float) -> None:
    robot = load_robot("hrp4_class").robot()
    q = np.array(robot.half_sitting)
    q[:3] += (1.0, 2.0, 0.4)
    q[3:7] = 0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    robot.update(q, np.zeros(robot.nv))
    source = StandSource(robot)
    reference = source.update(None)  # type: ignore[arg-type]
    np.testing.assert_allclose(reference.pendulum.com, robot.com)
    ground = 0.5 * sum(robot.placement(sole.frame).translation[2] for sole in robot.soles)
    np.testing.assert_allclose(reference.pendulum.zmp, [*robot.com[:2], ground])
    height = float(robot.com[2]) - ground
    assert reference.pendulum.omega == pytest.approx(math.sqrt(GRAVITY / height))
    assert reference.progress.heading == pytest.approx(yaw)
    for motion, sole in zip(reference.feet, robot.soles, strict=True):
        np.testing.assert_allclose(motion.placement.homogeneous, robot.placement(sole.frame).homogeneous)
        assert not motion.velocity.any()
    source.com[:] += 0.01
    np.testing.assert_allclose(source.pendulum().com, robot.com + 0.01)


# ---- arms -----------------------------------------------------------------------------------------------------------


def standing(name: str = "hrp4_class") -> WalkingControl:
    robot = load_robot(name).robot()
    return WalkingControl(robot, FootstepPlan.standing(robot), DT)


def update(walking: WalkingControl, ticks: int) -> None:
    robot = walking.controller.robot
    left, right = (FootMotion.at_rest(robot.placement(sole.frame)) for sole in robot.soles)
    for _ in range(ticks):
        walking.arms.update((left, right), 0.0)


def test_the_length_of_an_arm_is_that_of_its_links_from_the_shoulder_to_the_hand() -> None:
    walking = standing()
    robot = walking.controller.robot
    for arm in walking.arms.all.values():
        chain = [joint for joint in robot.joints_between(arm.frame, robot.torso_frame)]
        places = [robot.data.oMi[int(robot.joint_numbers[joint])].translation for joint in sorted(chain)]
        places.append(arm.place.translation)
        way = sum(float(np.linalg.norm(b - a)) for a, b in zip(places, places[1:], strict=False))
        assert arm.length == pytest.approx(way)
        np.testing.assert_allclose(arm.shoulder, places[0])


@pytest.mark.parametrize(
    ("way", "turn", "there"),
    [(0.0099, 0.0, True), (0.0101, 0.0, False), (0.0, 0.0499, True), (0.0, 0.0501, False)],
)
def test_a_hand_is_at_its_target_within_10_mm_and_50_mrad_once_its_reference_is(
    way: float, turn: float, *, there: bool
) -> None:
    walking = standing()
    arm = walking.arms["left_hand"]
    start = pin.SE3(arm.place)
    goal = pin.SE3(start.rotation @ pin.exp3(np.array([0.0, turn, 0.0])), start.translation + (0.0, way, 0.0))
    arm.reach(goal)
    assert arm.moving and not arm.reached
    update(walking, 200)
    assert not arm.moving and arm.reached == there
    np.testing.assert_allclose(arm.error[:3], (0.0, way, 0.0), atol=1e-9)
    assert np.linalg.norm(arm.error[3:]) == pytest.approx(turn, abs=1e-9)
    assert arm.behind == pytest.approx(way, abs=1e-3)
    if turn and not there:  # of a point the rotation means nothing
        arm.reach(goal.translation)
        update(walking, 200)
        assert arm.reached and not arm.error[3:].any()


def test_a_hand_that_moves_has_not_reached_its_target() -> None:
    walking = standing()
    arm, robot = walking.arms["left_hand"], walking.controller.robot
    arm.reach(arm.place.translation)
    update(walking, 3)
    for speed, there in ((0.049, True), (0.051, False)):
        v = np.zeros(robot.nv)
        v[:3] = robot.placement(robot.base_frame).rotation.T @ (0.6 * speed, 0.0, 0.8 * speed)
        robot.update(robot.q, v)
        assert arm.speed == pytest.approx(speed) and arm.reached == there


def test_the_weight_of_a_hand_rises_and_falls_within_three_tenths_of_a_second() -> None:
    walking = standing()
    arm = walking.arms["right_hand"]
    assert not arm.active and np.isnan(arm.error).all()
    arm.reach(pin.SE3(arm.place))
    for tick in range(1, 61):
        update(walking, 1)
        share = min(tick * DT / 0.3, 1.0)
        curve = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        np.testing.assert_allclose(arm.task.scale, curve, atol=1e-9)
    arm.release()
    assert arm.target is None and arm.active and arm.speed == 0.0
    update(walking, 30)
    np.testing.assert_allclose(arm.task.scale, 0.5, atol=1e-9)
    update(walking, 31)
    assert not arm.active and not arm.moving
    arm.reach(arm.place.translation)
    update(walking, 61)
    np.testing.assert_allclose(arm.task.scale, [1.0, 1.0, 1.0, 0.0, 0.0, 0.0], atol=1e-9)


def test_the_error_of_a_hand_is_seen_in_the_frame_of_its_target() -> None:
    walking = standing()
    arm = walking.arms["left_hand"]
    box = pin.SE3(pin.utils.rotate("z", 0.7), np.array([0.5, 0.2, 0.3]))
    walking.arms.place("box", box)
    here = box.actInv(arm.place)
    np.testing.assert_allclose(arm.seen("box").homogeneous, here.homogeneous, atol=1e-12)
    arm.reach(here.translation + (0.01, -0.02, 0.03), "box")
    np.testing.assert_allclose(arm.error, [0.01, -0.02, 0.03, 0.0, 0.0, 0.0], atol=1e-12)
    with pytest.raises(InputError):
        arm.reach([0.0, 0.0, 0.0], "crate")
    for name in ("world", "pelvis", "feet"):
        with pytest.raises(InputError, match="name of an object"):
            walking.arms.place(name, box)


def test_a_reference_turns_and_goes_no_faster_than_it_may_and_stops_where_it_is() -> None:
    """At 1.5 rad/s and 6 rad/s², and at the speed that is given, or that of the settings."""
    for speed in (None, 0.1):
        walking = standing()
        arm, settings = walking.arms["left_hand"], walking.arms.settings
        start = pin.SE3(arm.place)
        goal = pin.SE3(
            pin.exp3(np.array([0.0, 1.0, 0.0])) @ start.rotation, start.translation + (0.0, 0.3, 0.0)
        )
        arm.send(Route([goal], "world", 1.0, speed=speed))
        most, rates, pushes, before = speed or settings.speed, [], [], np.zeros(6)
        for _ in range(120):
            arm._there = pin.SE3(arm.place)  # a hand that follows at once
            update(walking, 1)
            rates.append(arm._way.velocity.copy())
            pushes.append((arm._way.velocity - before) / DT)
            before = arm._way.velocity.copy()
        linear, angular = np.linalg.norm(np.array(rates).reshape(-1, 2, 3), axis=2).T
        assert linear.max() == pytest.approx(most, rel=1e-6) and angular.max() <= 1.5 + 1e-9
        sizes = np.linalg.norm(np.array(pushes).reshape(-1, 2, 3), axis=2)
        assert sizes[:, 0].max() <= settings.acceleration * (1.0 + 1e-9)
        assert sizes[:, 1].max() == pytest.approx(6.0, rel=1e-6)
        here = pin.SE3(arm._way.place)
        arm.stop("world")
        assert arm.target is not None and not arm._way.velocity.any()
        np.testing.assert_allclose(arm.target.homogeneous, here.homogeneous, atol=1e-12)
        assert not arm.moving
        arm.stop("pelvis")
        expected = arm.seen("pelvis").homogeneous
        np.testing.assert_allclose(arm.target.homogeneous, expected, atol=1e-12)


def test_a_hand_that_turned_as_it_liked_is_turned_from_where_it_is() -> None:
    walking = standing()
    arm, robot = walking.arms["left_hand"], walking.controller.robot
    arm.reach(arm.place.translation + (0.1, 0.0, 0.0))
    update(walking, 20)
    here, moving = arm._way.place.translation.copy(), arm._way.velocity.copy()
    q = np.array(robot.q)
    q[7 + arm.joints[-1]] += 0.4
    robot.update(q, np.zeros(robot.nv))
    turned = arm.place.rotation.copy()
    arm.reach(pin.SE3(np.eye(3), np.array(here)))
    np.testing.assert_allclose(arm._way.place.rotation, turned, atol=1e-12)
    np.testing.assert_allclose(arm._way.place.translation, here, atol=1e-12)
    np.testing.assert_allclose(arm._way.velocity, [*moving[:3], 0.0, 0.0, 0.0], atol=1e-12)


def test_a_task_spares_all_joints_but_those_of_its_arm_and_the_posture_yields_to_hands() -> None:
    walking = standing()
    arms, robot = walking.arms, walking.controller.robot
    one, other = arms["left_hand"], arms["right_hand"]
    one.reach(one.place.translation)
    update(walking, 1)
    columns = np.array(one.joints) + 6
    assert sorted(one.task.spared) == sorted(set(range(robot.nv)) - set(columns.tolist()))
    assert sorted(walking.tasks.com.spared) == sorted(columns)
    scale = np.ones(robot.na)
    scale[one.joints] = walking.tasks.table.reaching
    np.testing.assert_allclose(walking.tasks.posture.scale, scale)
    other.reach(other.place.translation)
    update(walking, 1)
    assert sorted(walking.tasks.com.spared) == sorted([*columns, *(np.array(other.joints) + 6)])
    one.release()
    other.release()
    update(walking, 64)
    assert not walking.tasks.com.spared.size
    np.testing.assert_allclose(walking.tasks.posture.scale, 1.0)


# ---- body -----------------------------------------------------------------------------------------------------------


def test_set_points_of_the_body_are_taken_up_to_what_the_robot_reaches() -> None:
    """Lean by 0.35 rad in all, turn of the waist less 0.05 rad, and the height between bent and straight legs."""
    walking = standing()
    body, robot = walking.body, walking.controller.robot
    found = vertical_joint(robot, robot.torso_frame, robot.half_sitting)
    assert found is not None and abs(found[1]) > 0.9
    joint = found[0]
    most = min(-robot.position_lower[joint], robot.position_upper[joint]) - 0.05
    for sign in (1.0, -1.0):
        body.turn = sign * (most - 1e-4)
        assert body.turn == pytest.approx(sign * (most - 1e-4))
        with pytest.raises(InputError, match="turn of the trunk"):
            body.turn = sign * (most + 1e-4)
        body.lean = (sign * 0.6 * 0.349, -sign * 0.8 * 0.349)
        with pytest.raises(InputError, match="at most 0.35 rad"):
            body.lean = (sign * 0.6 * 0.351, -sign * 0.8 * 0.351)
    leg = Leg(robot)
    straight = 0.979 * leg.length - (leg.hip_height - leg.com_height)
    body.com_height = straight - 1e-4
    assert body.com_height == pytest.approx(straight - 1e-4)
    with pytest.raises(InputError):
        body.com_height = straight + 1e-4
    lowest = lowest_com(robot)
    body.com_height = lowest + 1e-4
    with pytest.raises(InputError, match="as far as its legs bend"):
        body.com_height = lowest - 1e-4
    assert body.com_height == pytest.approx(lowest + 1e-4)


def test_a_lowered_body_refuses_steps_that_lift_their_feet_higher_than_its_legs_have_room() -> None:
    walking = standing()
    body, lowest = walking.body, lowest_com(walking.controller.robot)
    own = body.com_height
    walking.source.lift_room = 0.5
    body.check_steps()  # nothing is lowered
    body.com_height = lowest + 0.03
    walking.source.lift_room = 0.0299
    body.check_steps()
    walking.source.lift_room = 0.0307
    with pytest.raises(InputError, match="lift a foot by 31 mm in a walk"):
        body.check_steps()
    body.com_height = own
    walking.source.lift_room = 0.5
    body.check_steps()


@pytest.mark.parametrize("part", ["height", "turn"])
def test_a_set_point_is_reached_within_a_thousandth(part: str) -> None:
    walking = standing()
    body = walking.body
    off, rest = (0.02, Pendulum.at_rest(np.array([0.0, 0.0, 0.8]))), 0.0
    if part == "height":
        body.com_height -= off[0]
    else:
        body.turn = off[0]
    reached = []
    for _ in range(400):
        body.update(0.0)
        now = 0.8 - body.raised(off[1]).com[2] if part == "height" else body.twist.angle
        left = off[0] - float(now)
        if abs(abs(left) - 1e-3) > 1e-9:
            assert body.reached == (abs(left) < 1e-3)
        reached.append(body.reached)
        rest = left
    assert reached[-1] and not reached[0] and abs(rest) < 1e-9


def test_a_neck_looks_with_the_axis_that_points_ahead_in_a_stand_and_a_tenth_of_the_cost_of_the_trunk() -> (
    None
):
    """Cost 1, stiffness 30, an error of 0.3 rad at most; the more firmly the less its posture gives way."""
    walking = standing()
    body, robot = walking.body, walking.controller.robot
    point = np.array(robot.com) + (3.0, 0.0, 0.5)
    body.look_at(point)
    gaze = body._gaze
    assert gaze is not None and gaze in walking.controller.tasks and not gaze.idle
    np.testing.assert_allclose(gaze.weight, 1.0)
    np.testing.assert_allclose(gaze.stiffness, 30.0)
    np.testing.assert_allclose(gaze.error_bound, 0.3)
    np.testing.assert_allclose(gaze.scale, 1.0 / walking.tasks.table.reaching)
    frame = robot.placement(gaze.frame)
    np.testing.assert_allclose(frame.rotation @ gaze._axis, (1.0, 0.0, 0.0), atol=1e-6)
    head = max(robot.model.getJointId(name) for name in robot.joint_names if "neck" in name or "head" in name)
    assert robot.model.frames[robot.frame_id(gaze.frame)].parentJoint == head
    body.look_at(None)
    assert gaze.idle and not body.looking


def test_a_trunk_without_a_waist_turns_on_its_hips_by_three_tenths() -> None:
    robot = biped()
    walking = WalkingControl(robot, FootstepPlan.standing(robot), DT)
    body = walking.body
    body.turn = 0.3
    with pytest.raises(InputError):
        body.turn = 0.301
    for _ in range(600):
        body.update(0.0)
    assert body.hip_turn == pytest.approx(0.3) and not body.twist.by_waist
    waisted = standing().body
    waisted.turn = 0.3
    for _ in range(600):
        waisted.update(0.0)
    assert waisted.hip_turn == 0.0 and waisted.twist.by_waist and waisted.twist.angle == pytest.approx(0.3)


def biped() -> Robot:
    return RobotDescription.from_mjcf(Path(__file__).parents[2] / "examples" / "biped.xml").robot()


def test_a_robot_that_may_take_free_steps_turns_its_torso_by_six_tenths() -> None:
    robot = load_robot("g1").robot()
    settings: Any = WalkingControlSettings(mode="torque")
    body = WalkingControl(robot, None, 0.002, settings).body
    body.turn = -0.6
    with pytest.raises(InputError):
        body.turn = 0.601
