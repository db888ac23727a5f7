"""Plausibility of single readings, and sensors that contradict each other or have frozen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbc import Measurement
from wbc.core.estimation.consistency import ConsistencyMonitor, ConsistencySettings
from wbc.core.estimation.plausibility import Plausibility
from wbc.core.robot import GRAVITY
from wbc.robots import load

ROBOT, DT = load("hrp4_class").robot(), 0.005


def standing(time: float, **changes: np.ndarray) -> Measurement:
    """Measurement of the robot at rest in half-sitting."""
    na, wrench = ROBOT.na, np.zeros((2, 6))
    wrench[:, 2] = 0.5 * ROBOT.mass * GRAVITY
    up = np.array([0.0, 0.0, GRAVITY])
    measurement = Measurement(time, ROBOT.half_sitting[7:].copy(), np.zeros(na), np.zeros(3), up, wrench)
    return replace(measurement, **changes)


def test_an_encoder_may_have_travelled_as_far_as_its_joint_moves_while_it_was_refused() -> None:
    plausibility = Plausibility(ROBOT, DT)
    plausibility.check(standing(0.0))
    for tick in range(1, 5):
        lost = ROBOT.half_sitting[7:].copy()
        lost[3] = np.nan
        plausibility.check(standing(tick * DT, joint_position=lost))
    settings, there = plausibility.settings, ROBOT.half_sitting[7:].copy()
    there[3] += settings.position_jump + 3.0 * DT * settings.velocity_margin * ROBOT.velocity_limit[3]
    used, _ = plausibility.check(standing(5 * DT, joint_position=there))
    assert used.joint_position[3] == there[3] and plausibility.refused == 4


def test_a_moment_is_possible_as_far_as_the_greatest_force_has_an_arm_on_the_sole() -> None:
    plausibility = Plausibility(ROBOT, DT)
    plausibility.check(standing(0.0))
    greatest = plausibility.settings.force_ratio * ROBOT.mass * GRAVITY
    for tick, (share, refused) in enumerate(((0.9, 0), (1.1, 1)), start=1):
        wrench = standing(0.0).wrenches.copy()
        wrench[0, 4] = share * greatest * ROBOT.soles[0].length
        plausibility.check(standing(tick * DT, sole_wrench=wrench))
        assert plausibility.refused == refused


def test_a_force_that_stays_the_same_is_frozen_and_none_at_all_is_a_foot_in_the_air() -> None:
    settings = ConsistencySettings()
    names = Plausibility(ROBOT, DT).names
    monitor, rng = ConsistencyMonitor(ROBOT, DT, names), np.random.default_rng(0)
    for tick in range(settings.frozen_after + 20):
        values = rng.normal(size=len(names))
        values[-12:] = 0.0  # in the air but for
        values[-10] = 300.0  # a frozen force on the left sole
        monitor.update(values, standing(tick * DT), GRAVITY, 0.0, (0.0, 0.0, 0.0), 0j)
    assert [doubt for doubt in monitor.doubts if "frozen" in doubt] == ["force sensor of left_foot frozen"]
