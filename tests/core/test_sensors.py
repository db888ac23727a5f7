"""Plausibility of single readings, and sensors that contradict each other or have frozen."""

from __future__ import annotations

import numpy as np
import pytest
from at_rest import at_rest

from wbc.core.estimation.consistency import FROZEN_AFTER, ConsistencyMonitor
from wbc.core.estimation.plausibility import Plausibility
from wbc.core.robot import GRAVITY
from wbc.robots import load

ROBOT, DT = load("hrp4_class").robot(), 0.005
STILL = (0.0, 0.0, 0.0)


def test_an_encoder_may_have_travelled_as_far_as_its_joint_moves_while_it_was_refused() -> None:
    plausibility = Plausibility(ROBOT, DT)
    plausibility.check(at_rest(ROBOT, 0.0))
    for tick in range(1, 5):
        lost = ROBOT.half_sitting[7:].copy()
        lost[3] = np.nan
        plausibility.check(at_rest(ROBOT, tick * DT, joint_position=lost))
    settings, there = plausibility.settings, ROBOT.half_sitting[7:].copy()
    there[3] += settings.position_jump + 3.0 * DT * settings.velocity_margin * ROBOT.velocity_limit[3]
    used, _ = plausibility.check(at_rest(ROBOT, 5 * DT, joint_position=there))
    assert used.joint_position[3] == there[3] and plausibility.refused == 4


def test_a_moment_is_possible_as_far_as_the_greatest_force_has_an_arm_on_the_sole() -> None:
    plausibility = Plausibility(ROBOT, DT)
    plausibility.check(at_rest(ROBOT, 0.0))
    greatest = plausibility.settings.force_ratio * ROBOT.mass * GRAVITY
    for tick, (share, refused) in enumerate(((0.9, 0), (1.1, 1)), start=1):
        wrench = at_rest(ROBOT, 0.0).wrenches.copy()
        wrench[0, 4] = share * greatest * ROBOT.soles[0].length
        plausibility.check(at_rest(ROBOT, tick * DT, sole_wrench=wrench))
        assert plausibility.refused == refused


def test_torques_that_stay_impossible_are_refused_each_time_and_logged_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    plausibility = Plausibility(ROBOT, DT)
    for tick, torque in enumerate((0.0, 1e6, 1e6, 1e6, 0.0, 0.0)):
        measurement = at_rest(ROBOT, tick * DT, joint_torque=np.full(ROBOT.na, torque))
        used, _ = plausibility.check(measurement)
        assert (used.joint_torque is None) == (torque > 0.0)
    assert plausibility.refused == 3
    assert caplog.messages == ["measurement at 0.0050 s: joint torques refused"]


@pytest.mark.parametrize("lifts", [False, True])
def test_feet_that_turn_alike_are_doubted_where_the_robot_stands(lifts: bool) -> None:
    """A walk over boards turns about the edges under both soles."""
    names = Plausibility(ROBOT, DT).names
    monitor, rng = ConsistencyMonitor(ROBOT, DT, names), np.random.default_rng(0)
    told = []
    for tick in range(400):
        wrench = np.zeros((2, 6))
        left = 0.0 if lifts and tick % 60 > 30 else 0.5
        wrench[:, 2] = np.array((left, 1.0 - left)) * ROBOT.mass * GRAVITY
        measurement = at_rest(ROBOT, tick * DT, sole_wrench=wrench)
        monitor.update(rng.normal(size=len(names)), measurement, GRAVITY, 1.0, STILL, 0j)
        told.append("encoders and gyroscope disagree" in monitor.doubts)
    assert any(told) == (not lifts)


def test_a_force_that_stays_the_same_is_frozen_and_none_at_all_is_a_foot_in_the_air() -> None:
    names = Plausibility(ROBOT, DT).names
    monitor, rng = ConsistencyMonitor(ROBOT, DT, names), np.random.default_rng(0)
    for tick in range(FROZEN_AFTER + 20):
        values = rng.normal(size=len(names))
        values[-12:] = 0.0  # in the air but for
        values[-10] = 300.0  # a frozen force on the left sole
        monitor.update(values, at_rest(ROBOT, tick * DT), GRAVITY, 0.0, STILL, 0j)
    assert [doubt for doubt in monitor.doubts if "frozen" in doubt] == ["force sensor of left_foot frozen"]
