"""Settings of the stepping walk: units of the robot, and steps that cannot be walked."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples
from task_factory import ROBOTS, make_robot

from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY
from wbc.walking.plans.leg import Leg
from wbc.walking.plans.reach import SPANS
from wbc.walking.stepping.gait import SteppingWalk
from wbc.walking.stepping.settings import (
    LONGEST,
    GaitValues,
    RobotSize,
    SteppingConstants,
    SteppingSettings,
    SwingConstants,
)

SCALE = RobotSize(0.6, leg=0.62, mass=33.0, sole=(0.105, 0.03), ankle=0.03, stride=0.5, swing=65.0)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"shortest": 1.6, "step_time": 1.5}, "shortest"),
        ({"step_time": 1.5, "slow_time": 1.2}, "slow_time"),
        ({"longest": 0.9}, "longest"),
        ({"swing_height": 0.5, "shortest": 0.9}, "swing_height"),
        ({"swing_height": 0.02, "shortest": 0.1}, "0.455/ω"),
        ({"swing_height": 0.1, "shortest": 0.45}, "0.455/ω"),
        ({"widest": 0.3, "width": 0.367}, "width"),
        ({"gap": 0.9, "widest": 0.9}, "gap"),
    ],
)
def test_steps_that_cannot_be_walked_are_refused_by_name(changes: dict[str, float], named: str) -> None:
    with pytest.raises(InputError, match=named):
        GaitValues.of(SteppingSettings(**changes), SteppingConstants(), SCALE, 0.002)


@examples(8)
@given(piece=st.floats(0.05, 0.8), touch=st.floats(0.6, 1.0), of_plans=st.floats(0.6, 1.0))
def test_steps_have_the_time_that_their_swings_need_with_any_constants(
    piece: float, touch: float, of_plans: float
) -> None:
    """From lift-off to touch-down, at the earliest share of a step at which a foot touches down."""
    constants = SteppingConstants(swing=SwingConstants(piece=piece, touch=touch, touch_of_plans=of_plans))
    times = {"step_time": 3.0, "slow_time": 3.0, "swing_height": 0.02}
    with pytest.raises(InputError, match="shortest"):
        quicker = SteppingSettings(**times, shortest=0.99 * constants.swing.quickest)
        SteppingWalk(quicker, SCALE, 0.0, 0.002, constants=constants)
    quickest = SteppingSettings(**times, shortest=constants.swing.quickest)
    walk = SteppingWalk(quickest, SCALE, 0.0, 0.002, constants=constants)
    assert min(touch, of_plans) * walk.settings.shortest >= walk.step._shape.shortest - 1e-12


@pytest.mark.parametrize("name", ROBOTS)
def test_the_size_of_a_robot_is_measured_and_its_state_stays(name: str) -> None:
    robot = make_robot(name)
    q, com = robot.q.copy(), np.array(robot.com)
    scale = RobotSize.of(robot, 0.162)
    np.testing.assert_array_equal(robot.q, q)
    np.testing.assert_array_equal(robot.com, com)
    assert scale.mass == pytest.approx(robot.mass)
    assert scale.weight == pytest.approx(robot.mass * GRAVITY)
    assert scale.sole == pytest.approx((0.5 * robot.soles[0].length, 0.5 * robot.soles[0].width))
    assert 0.5 < scale.leg / scale.height < 1.5
    assert scale.omega == pytest.approx(np.sqrt(GRAVITY / scale.height))
    lower = RobotSize.of(robot, 0.262)
    assert scale.height - lower.height == pytest.approx(0.1 * scale.leg)
    low = 0.9 * scale.height
    assert RobotSize.of(robot, 0.162, low).height == low


@pytest.mark.parametrize("count", [1, 3])
def test_a_robot_without_two_soles_needs_two_feet(count: int) -> None:
    robot = make_robot("g1")
    robot.soles = (robot.soles * 2)[:count]
    with pytest.raises(InputError, match="two feet"):
        RobotSize.of(robot, 0.162)


@pytest.mark.parametrize("name", ["g1", "hrp4_class"])
def test_a_robot_is_measured_with_all_joints_of_its_legs_at_zero(name: str) -> None:
    robot = make_robot(name)
    q, left, model = robot.half_sitting.copy(), robot.soles[0].frame, robot.model
    for sole in robot.soles:
        q[[7 + joint for joint in robot.joints_between(sole.frame, robot.base_frame)]] = 0.0
    other = robot.clone()
    other.update(q, np.zeros(robot.nv))
    com = float(other.com[2] - other.placement(left).translation[2])
    chain = [robot.joint_numbers[j] for j in robot.joints_between(left, robot.base_frame)]
    points = [other.data.oMi[joint].translation for joint in chain]
    size = RobotSize.of(robot, 0.05)
    leg = np.ptp([point[2] for point in points])
    assert model.nq == q.size and size.leg == pytest.approx(leg)
    assert size.height == pytest.approx(max(com - 0.05 * leg, Leg(robot).carried_height()))
    assert size.ankle == pytest.approx(other.placement(left).actInv(points[-1])[0])
    assert size.swing == pytest.approx(leg * Leg(robot).hip_acceleration())
    assert size.stride == pytest.approx(LONGEST * SPANS * Leg(robot).span(size.height))


def test_settings_in_units_of_the_robot_are_lengths_times_and_forces_of_it() -> None:
    """h, ω, g, m g and the half sole, from a robot of 0.6 m and 33 kg."""
    si, c, omega = SteppingSettings().in_si(SCALE), SteppingConstants().in_si(SCALE), np.sqrt(GRAVITY / 0.6)
    own, raw = SteppingSettings(), SteppingConstants()
    assert si.step_time == pytest.approx(own.step_time / omega)
    assert si.cruise == pytest.approx(own.cruise * 0.6 * omega)
    assert si.acceleration == pytest.approx(own.acceleration * GRAVITY)
    assert si.gap == pytest.approx(0.06 + own.gap * 0.6)
    assert si.width == pytest.approx(max(own.width * 0.6, 1.25 * si.gap))
    assert c.area.standing_box == pytest.approx(
        (raw.area.standing_box[0] * 0.21, raw.area.standing_box[1] * 0.06)
    )
    assert c.area.carrying == pytest.approx(raw.area.carrying * 0.03)
    assert c.touch.share == pytest.approx(raw.touch.share * 33.0 * GRAVITY)
    assert c.swing.swing_gains == pytest.approx(
        (raw.swing.swing_gains[0] * omega**2, raw.swing.swing_gains[1] * omega)
    )
