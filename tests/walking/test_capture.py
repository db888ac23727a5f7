"""Steps out of a push: which foot, where and how many; and none where the feet in place are enough."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.core.drive.position import PositionControl
from wbc.robots import load
from wbc.sim.balance import StandPushSpec, StandSpec, push_standing, stand
from wbc.walking import FootstepPlan, Reach, Walk, WalkingControl, natural_frequency
from wbc.walking.planning.capture import CaptureSettings, CaptureSteps
from wbc.walking.planning.footsteps import Footstep, other

ROBOT = load("hrp4_class").robot()
REACH = Reach.of(ROBOT)
SIZES = tuple((sole.length, sole.width) for sole in ROBOT.soles[:2])
START = FootstepPlan.standing(ROBOT)
OMEGA = natural_frequency(float(ROBOT.com[2]))
MIDDLE = 0.5 * (START.left.position + START.right.position)[:2]


def capture() -> CaptureSteps:
    return CaptureSteps(OMEGA, REACH, SIZES, START.spacing)


def test_a_dcm_within_the_soles_is_inside() -> None:
    steps = capture()
    assert steps.outside(MIDDLE, START) < 0.0
    edge = START.left.x + 0.5 * SIZES[0][0]
    assert steps.outside(np.array([edge + 0.03, MIDDLE[1]]), START) == pytest.approx(0.03)


@pytest.mark.parametrize("angle", np.arange(0.0, 2.0 * math.pi, math.pi / 4.0))
@pytest.mark.parametrize("distance", [0.1, 0.15, 0.25])
def test_landings_are_within_reach_and_sides_alternate(angle: float, distance: float) -> None:
    dcm = MIDDLE + distance * np.array([math.cos(angle), math.sin(angle)])
    plan = capture().footsteps(dcm, START, None, 0.02)
    stance = START.right if plan.steps[0].side == "left" else START.left
    for step in plan.steps[:-1]:
        forward, left, _, turn = step.seen_from(stance)
        assert abs(forward) <= REACH.max_length + 1e-9 and turn == 0.0
        assert REACH.min_spacing - 1e-9 <= abs(left) <= REACH.max_spacing + 1e-9
        assert step.side == other(stance.side)
        stance = step
    forward, left, _, _ = plan.steps[-1].seen_from(stance)
    assert forward == pytest.approx(0.0, abs=1e-9) and abs(left) == pytest.approx(START.spacing), (
        "feet together"
    )


def test_stronger_pushes_never_need_fewer_steps() -> None:
    counts = [
        len(capture().footsteps(MIDDLE + (x, 0.0), START, None, 0.02)) for x in np.linspace(0.08, 0.5, 15)
    ]
    assert counts == sorted(counts) and counts[0] == 2 and counts[-1] > 2


def test_mirrored_pushes_give_mirrored_feet() -> None:
    one = capture().footsteps(MIDDLE + (0.12, 0.05), START, None, 0.02).steps
    two = capture().footsteps(MIDDLE + (0.12, -0.05), START, None, 0.02).steps
    assert len(one) == len(two)
    for a, b in zip(one, two, strict=True):
        assert a.side == other(b.side) and a.x == pytest.approx(b.x)
        assert a.y - MIDDLE[1] == pytest.approx(MIDDLE[1] - b.y)


def test_a_foot_in_the_air_lands_as_planned_unless_the_dcm_leaves_the_feet() -> None:
    steps, stance = capture(), START.right
    planned = Footstep("left", 0.1, START.left.y, 0.01)
    assert steps.landing(MIDDLE + (0.05, 0.0), stance, planned, 0.2) is planned
    ahead = [steps.landing(MIDDLE + (x, 0.0), stance, planned, 0.2) for x in (0.12, 0.15, 0.18, 0.4)]
    places = [landing.x for landing in ahead]
    assert places == sorted(places) and planned.x < places[0] < places[1]
    assert places[-1] == pytest.approx(stance.x + REACH.max_length) and ahead[0].z == planned.z
    sooner = steps.landing(MIDDLE + (0.15, 0.0), stance, planned, 0.1)
    assert sooner.x < places[1], "less time in which the DCM runs away"


def test_feet_stay_apart_unless_the_dcm_runs_away_over_the_stance_foot() -> None:
    planned = Footstep("right", 0.0, START.right.y, 0.0)
    out, ahead = (
        capture().landing(MIDDLE + push, START.left, planned, 0.2) for push in ((0.0, 0.16), (0.15, 0.0))
    )
    assert START.left.y - out.y == pytest.approx(REACH.min_spacing)
    assert START.left.y - ahead.y >= START.spacing - 1e-9


@pytest.mark.parametrize("yaw", [0.0, 2.0, -3.1])
def test_a_push_is_straight_where_the_dcm_leaves_ahead_or_back(yaw: float) -> None:
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    feet = [
        Footstep(foot.side, *(turn @ (foot.x, foot.y)), 0.0, foot.yaw + yaw)
        for foot in (START.left, START.right)
    ]
    turned = FootstepPlan(*feet, (), START.gait)
    middle = turn @ MIDDLE
    ahead = [
        capture().pushed_straight(middle + turn @ way, turned)
        for way in ((0.1, 0.02), (-0.1, 0.03), (0.1, 0.1), (0.0, 0.1))
    ]
    assert ahead == pytest.approx([0.1, -0.1, 0.0, 0.0])


def test_all_straight_steps_take_as_long() -> None:
    straight = CaptureSettings().for_straight()
    assert straight.quickest == straight.gait.single_support == 0.28
    assert straight.gait.swing_height < CaptureSettings().gait.swing_height


def test_the_base_of_a_commanded_robot_is_drawn_to_the_estimated_one_and_its_joints_stay() -> None:
    robot = load("hrp4_class").robot()
    walking = WalkingControl(robot, FootstepPlan.standing(robot), 0.005)
    control = walking.control
    assert isinstance(control, PositionControl)
    estimate = control.observer.robot
    q, v = np.array(estimate.q), np.array(estimate.v)
    q[0] += 0.04
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.0, 0.1, 0.0)).coeffs()
    v[0] = 0.5
    estimate.update(q, v)
    joints = control.q[7:].copy()
    control.draw_base(0.5)
    np.testing.assert_array_equal(control.q[7:], joints)
    pitch = pin.rpy.matrixToRpy(robot.placement(robot.base_frame).rotation)[1]
    assert pitch == pytest.approx(0.05, abs=1e-3) and control.v[0] == pytest.approx(0.25)
    for _ in range(40):
        control.draw_base(0.5)
    np.testing.assert_allclose(control.q[:7], q[:7], atol=1e-6)


def test_the_height_of_the_com_weighs_more_while_a_robot_steps_ahead() -> None:
    robot = load("hrp4_class").robot()
    walking = WalkingControl(robot, FootstepPlan.standing(robot), 0.005)
    before = np.array(walking.tasks.com.weight)
    walking.tasks.hold_height(1000.0)
    np.testing.assert_array_equal(walking.tasks.com.weight, [100.0, 100.0, 1000.0])
    walking.tasks.hold_height(None)
    np.testing.assert_array_equal(walking.tasks.com.weight, before)


def test_a_pattern_of_a_push_does_not_fall_back_with_each_plan() -> None:
    """A DCM that the feet cannot hold, planned from again and again: the CoM depends on what is measured alone."""
    plan = FootstepPlan.standing(ROBOT)
    com = np.array(ROBOT.com)
    far = com + (0.4, 0.0, 0.0)
    step = replace(plan.right, x=plan.right.x + 0.2)

    def after(plans: int, measured: np.ndarray | None) -> float:
        walk = Walk(ROBOT, plan, float(ROBOT.com[2]), 0.005)
        for _ in range(plans):
            walk.steer([step], None, far, measured)
        return float(walk.update((190.0, 190.0)).pendulum.com[0])

    assert after(20, com) == pytest.approx(after(2, com), abs=1e-3)
    assert after(20, None) < after(2, None) - 0.5


def test_soles_of_a_commanded_robot_do_not_bind_while_it_steps_out_of_a_push() -> None:
    """Its QP then finds wrenches beyond the soles; on them again it has those of before."""
    robot = load("hrp4_class").robot()
    walking = WalkingControl(robot, FootstepPlan.standing(robot), 0.005)
    sole, beyond = robot.soles[0], np.array([0.0, 0.0, 100.0, 0.0, -100.0 * 0.3, 0.0])
    cone = walking.tasks.contacts[0].cone.copy()
    assert (cone @ beyond).max() > 0.0 and sole.length < 0.6
    walking.tasks.free(True)
    assert (walking.tasks.contacts[0].cone @ beyond).max() <= 0.0
    walking.tasks.free(False)
    np.testing.assert_array_equal(walking.tasks.contacts[0].cone, cone)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "impulse", "degrees"),
    [
        ("hrp4_class", 0.48, 0.0),
        ("hrp4_class", 0.52, 135.0),
        ("hrp4_class", 0.48, 180.0),
        ("talos", 0.52, 0.0),
        ("talos", 0.6, 45.0),
        ("talos", 0.56, 180.0),
    ],
)
def test_a_robot_steps_out_of_a_push_that_its_feet_in_place_do_not_take(
    robot: str, impulse: float, degrees: float
) -> None:
    spec = StandPushSpec(robot=robot, mode="position", impulse=impulse, direction=math.radians(degrees))
    assert not push_standing(spec).recovered
    assert push_standing(StandPushSpec(**(vars(spec) | {"steps": "allowed"}))).recovered


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [0.0, 180.0])
@pytest.mark.parametrize("robot", ["hrp4_class", "talos"])
def test_a_long_push_ahead_and_back_is_stepped_out_of(robot: str, degrees: float) -> None:
    """350 N for 0.15 s on an adult-size robot, with noise."""
    spec = StandPushSpec(
        robot=robot,
        mode="position",
        impulse=0.58,
        duration=0.15,
        direction=math.radians(degrees),
        noise="realistic",
        after=3.0,
        steps="allowed",
        seed=132,
    )
    assert push_standing(spec).recovered


@pytest.mark.parametrize("robot", ["hrp4_class", "talos", "g1"])
def test_a_push_before_the_first_lift_off_is_stepped_out_of(robot: str) -> None:
    plant = wbc.Plant(load(robot))
    walking = WalkingControl(model := load(robot).robot(), FootstepPlan.standing(model), plant.control_period)
    pushed = False
    while plant.time < 2.6 and walking.fallen is None:
        if plant.time >= 0.3:
            walking.velocity = (0.2, 0.0, 0.0)
        if plant.time >= 0.5 and not pushed:
            pushed = True
            assert walking.walk.phases.sets_off and not walking.driver.recovery.active
            plant.push("torso", [0.36 * model.mass / 0.1, 0.0, 0.0], 0.1)
        plant.step(walking.command(plant.measure()))
    assert pushed and walking.fallen is None and walking.steps_done >= 2


@pytest.mark.parametrize("period", [0.005, 0.02])
def test_steps_out_of_a_push_have_phases_of_two_periods_at_least(period: float) -> None:
    robot = load("hrp4_class").robot()
    recovery = WalkingControl(robot, FootstepPlan.standing(robot), period).driver.recovery
    for steps in (recovery._any_way, recovery._straight_on):
        assert steps is not None
        gait = steps.settings.gait
        assert gait.initial_double_support >= 2.0 * period and gait.on_grid(period) == (gait, ())


@pytest.mark.slow
def test_no_step_without_a_push() -> None:
    """Noisy sensors and a small push move no foot."""
    plant = wbc.Plant(load("hrp4_class"), noise="realistic", seed=1)
    robot = load("hrp4_class").robot()
    walking = WalkingControl(robot, FootstepPlan.standing(robot), plant.control_period)
    while plant.time < 30.0:
        if abs(plant.time - 10.0) < 1e-6:
            plant.push("torso", [0.1 * robot.mass / 0.1, 0.0, 0.0], 0.1)
        plant.step(walking.command(plant.measure()))
    assert walking.steps_done == 0 and walking.finished and walking.fallen is None
    result = stand(StandSpec(steps="allowed", seconds=3.0, noise="realistic"))
    assert result.upright and result.com_error_mm < 10.0
