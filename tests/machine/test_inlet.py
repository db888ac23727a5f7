"""Figures of the way in of measurements: the pace of a machine's own time, and how long measurements were refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import wbc
from wbc import Measurement
from wbc.core.robot import GRAVITY
from wbc.machine.inlet import Inlet, TimeRatio

ROBOT = wbc.load_robot("g1").robot()
RATES = np.random.default_rng(4).normal(size=ROBOT.na)
UP = ROBOT.placement(ROBOT.imu_frame).rotation.T @ [0.0, 0.0, GRAVITY]


def measured(time: float, way: float = 0.0, speed: float = 0.0) -> Measurement:
    """Joints that have gone a way and go at a speed, each in proportion to its rate."""
    return Measurement(
        time, ROBOT.half_sitting[7:] + way * RATES, speed * RATES, np.zeros(3), UP, np.zeros((2, 6))
    )


@pytest.mark.parametrize("ratio", [0.6, 1.0])
def test_the_pace_counts_velocities_that_change_by_their_mean(ratio: float) -> None:
    """Over a tenth of a second, by trapezoids, which are exact for a steady acceleration."""
    pace, begin = TimeRatio(), 5.0
    for tick in range(60):
        passed = 0.004 * tick
        pace.update(measured(begin + passed, ratio * 2.0 * passed**2, 4.0 * passed))
        if abs(passed - 0.1) > 1e-3:
            assert pace.ratio == (1.0 if passed < 0.1 else pytest.approx(ratio))
    gone = 2.0 * ratio * passed**2
    for tick in range(60):  # it goes on at another pace, and is looked at from where the last look ended
        time = begin + passed + 0.004 * tick
        pace.update(measured(time, gone + 0.5 * 0.004 * tick, 1.0))
    assert pace.ratio == pytest.approx(0.5)


@pytest.mark.parametrize(("length", "told"), [(0.019, False), (0.021, True)])
def test_ways_of_less_than_twenty_milliradians_tell_no_pace(length: float, told: bool) -> None:
    """In all joints together, as their velocities have it."""
    pace = TimeRatio()
    speed = length / 0.1 / float(np.linalg.norm(RATES))
    for tick in range(11):
        pace.update(measured(0.01 * tick, 0.7 * speed * 0.01 * tick, speed))
    assert pace.ratio == (pytest.approx(0.7) if told else 1.0)


@pytest.mark.parametrize(("gap", "begins"), [(0.099, False), (0.101, True), (-0.001, True)])
def test_the_pace_begins_anew_after_a_gap_of_a_tenth_of_a_second_or_a_step_back(
    gap: float, begins: bool
) -> None:
    pace = TimeRatio()
    pace.update(measured(1.0, 0.0, 1.0))
    pace.update(measured(1.05, 0.05, 1.0))
    pace.update(measured(1.05 + gap, 0.05 + 0.5 * gap, 1.0))
    if begins:
        assert pace.ratio == 1.0
    else:
        assert pace.ratio == pytest.approx((0.05 + 0.5 * gap) / (0.05 + gap))


def test_measurements_are_refused_from_the_first_bad_one_until_a_good_one() -> None:
    inlet = Inlet(ROBOT, 0.01)
    assert (inlet.since, inlet.refused, inlet.good) == (math.inf, "", None)
    assert inlet.take(measured(1.0), 20.0)
    bad = replace(measured(1.01), joint_position=np.zeros(3))
    assert inlet.take(bad, 20.01) and "joint_position" in inlet.refused and inlet.since == 20.01
    assert inlet.take(replace(bad, time=1.02), 20.02) and inlet.since == 20.01
    assert inlet.raw.time == 1.02 and inlet.good is not None and inlet.good.time == 1.0
    assert inlet.take(measured(1.03), 20.03) and (inlet.since, inlet.refused) == (math.inf, "")
    assert not inlet.take(measured(1.03), 20.04)
    assert inlet.take("nothing", 20.05) and "Measurement" in inlet.refused and inlet.since == 20.05


def test_a_stamp_that_stands_still_is_believed_for_three_measurements() -> None:
    """Then the time of arrival counts; one that goes on in between is a clock."""
    inlet = Inlet(ROBOT, 0.01)
    moving = [measured(0.0, 1e-4 * i) for i in range(9)]
    stamps = (0.0, 0.0, 0.0, 0.01, 0.01, 0.01, 0.01, 0.01)
    taken = [
        inlet.take(replace(m, time=t), 3.0 + 0.01 * i)
        for i, (m, t) in enumerate(zip(moving, stamps, strict=False))
    ]
    assert taken == [True, False, False, True, False, False, True, True]
    assert not inlet.stamped and inlet.good is not None and inlet.good.time == 3.07
    assert inlet.take(replace(moving[8], time=0.01), 3.08) and inlet.good.time == 3.08


def test_measurements_that_a_control_checks_are_not_checked_and_the_next_one_is_a_first_one() -> None:
    inlet = Inlet(ROBOT, 0.01)
    assert inlet.take(measured(1.0), 20.0)
    bad = replace(measured(1.01), joint_position=np.zeros(3))
    assert inlet.take(bad, 20.01, check=False) and inlet.raw is bad
    assert inlet.good is not None and inlet.good.time == 1.0 and not inlet.refused
    inlet.adopt(measured(1.02))
    assert inlet.good.time == 1.02
    inlet.forget()
    assert inlet.take(measured(9.0), 28.0) and not inlet.refused and inlet.good.time == 9.0
    assert inlet.take(measured(17.0), 36.0) and "time stamp" in inlet.refused and inlet.good.time == 9.0
