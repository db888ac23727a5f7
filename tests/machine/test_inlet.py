"""Way in of measurements: which are new, and how long they were refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

import wbc
from wbc import Measurement
from wbc.core.robot import GRAVITY
from wbc.machine.inlet import Inlet

ROBOT = wbc.load_robot("g1").robot()
UP = ROBOT.placement(ROBOT.imu_frame).rotation.T @ [0.0, 0.0, GRAVITY]


def measured(time: float, way: float = 0.0) -> Measurement:
    """A robot at rest whose joints have gone a way."""
    still = np.zeros(ROBOT.na)
    return Measurement(time, ROBOT.half_sitting[7:] + way, still, np.zeros(3), UP, np.zeros((2, 6)))


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
    inlet.forget()
    assert inlet.take(measured(9.0), 28.0) and not inlet.refused and inlet.good.time == 9.0
    assert inlet.take(measured(17.0), 36.0) and "time stamp" in inlet.refused and inlet.good.time == 9.0


def test_what_joints_did_while_a_control_checked_itself_does_not_count_in_the_pace() -> None:
    inlet = Inlet(ROBOT, 0.01)
    hand = np.array(["elbow" in name for name in ROBOT.joint_names]) * 0.5  # rad/s
    for i in range(700):  # up in the first two seconds, down again after the fourth
        time, up = 0.01 * i, min(0.01 * i, 2.0) - min(max(0.01 * i - 4.0, 0.0), 2.0)
        still = measured(time)
        velocity = hand * (float(time < 2.0) - float(4.0 <= time < 6.0))
        seen = replace(still, joint_position=still.joint_position + up * hand, joint_velocity=velocity)
        if i == 400:
            inlet.forget()
        assert inlet.take(seen, time, check=i >= 400 or i < 5) and not inlet.refused
        inlet.good = seen  # the control's own
        assert abs(inlet.pace - 1.0) < 0.1
