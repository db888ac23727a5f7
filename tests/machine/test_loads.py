"""Loads of the soles and lean of a machine that something holds: closed forms of their lags."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc import Measurement
from wbc.core.robot import GRAVITY
from wbc.machine.loads import SoleLoads
from wbc.machine.start import Landing

G1 = wbc.load_robot("g1")
ROBOT = G1.robot()
WEIGHT = ROBOT.mass * GRAVITY
PERIOD = 0.005
BASE_FROM_IMU = ROBOT.placement(ROBOT.base_frame).rotation.T @ ROBOT.placement(ROBOT.imu_frame).rotation


def loads_of(period: float = PERIOD) -> SoleLoads:
    return SoleLoads(G1, period, (np.array(G1.kp), np.array(G1.kd)))


def measured(
    time: float, normal: tuple[float, float] | None = (0.0, 0.0), roll: float = 0.0, pitch: float = 0.0
) -> Measurement:
    """A base at rest with a lean; normal forces in N."""
    up = BASE_FROM_IMU.T @ pin.rpy.rpyToMatrix(roll, pitch, 0.0).T @ [0.0, 0.0, GRAVITY]
    wrench = np.zeros((2, 6))
    if normal is not None:
        wrench[:, 2] = normal
    rest = ROBOT.half_sitting[7:].copy()
    return Measurement(time, rest, np.zeros(ROBOT.na), np.zeros(3), up, None if normal is None else wrench)


def lean(loads: SoleLoads) -> tuple[float, float]:
    turn = pin.Quaternion(loads.posture(measured(0.0))[3:7]).matrix()
    return tuple(pin.rpy.matrixToRpy(turn)[:2])


def test_forces_are_taken_as_they_are_at_first_and_then_with_their_lags() -> None:
    """0.15 s for what is fed forward, 0.02 s for the share of the weight by which a touch is told."""
    loads = loads_of()
    first = measured(0.0, (100.0, -20.0))
    assert loads.wrenches(first) is first.sole_wrench  # as the sensors told them
    assert loads.normal.tolist() == [100.0, 0.0] and loads.share == pytest.approx(100.0 / WEIGHT)
    for i in range(1, 7):
        loads.wrenches(measured(i * PERIOD, (200.0, 50.0)))
    slow, quick = np.exp(-0.03 / 0.15), np.exp(-0.03 / 0.02)
    assert loads.normal == pytest.approx([200.0 - 100.0 * slow, 50.0 - 50.0 * slow])
    assert loads.share == pytest.approx((250.0 - 150.0 * quick) / WEIGHT)
    before = loads.normal.copy()
    loads.wrenches(measured(6 * PERIOD, (900.0, 900.0)))  # a second time in the same tick
    assert np.array_equal(loads.normal, before)


@pytest.mark.parametrize(
    ("period", "passed", "kept"),
    [(0.005, 0.019, "lag"), (0.005, 0.021, "as before"), (0.02, 0.049, "lag"), (0.02, 0.051, "as before")]
    + [(0.005, 0.199, "as before"), (0.005, 0.201, "anew"), (0.005, -0.01, "anew")],
)
def test_a_gap_begins_anew_from_what_was_or_from_nothing(period: float, passed: float, kept: str) -> None:
    """From 20 ms, or two and a half periods, on nothing is followed; from 0.2 s on all is as at first."""
    loads = loads_of(period)
    loads.wrenches(measured(1.0, (100.0, 100.0), roll=0.1))
    loads.wrenches(measured(1.0 + passed, (200.0, 0.0), roll=0.3))
    lag = np.exp(-passed / 0.15)
    wanted = {"lag": [200.0 - 100.0 * lag, 100.0 * lag], "as before": [100.0, 100.0], "anew": [200.0, 0.0]}
    assert loads.normal == pytest.approx(wanted[kept])
    if kept == "anew":
        assert lean(loads) == pytest.approx((0.3, 0.0), abs=1e-9)
    if kept == "as before" and passed < 0.1:
        assert lean(loads) == pytest.approx((0.3, 0.0), abs=1e-9)  # a first one has no mean beside it


def test_the_lean_is_that_of_the_first_measurement_and_then_a_mean() -> None:
    """Of all since, until that takes three seconds; the shortest mean is one of 0.1 s."""
    loads = loads_of()
    loads.wrenches(measured(0.0, roll=0.2))
    assert lean(loads) == pytest.approx((0.2, 0.0), abs=1e-9)
    left = 0.2
    for i in range(1, 400):
        loads.wrenches(measured(i * PERIOD))
        left *= np.exp(-PERIOD / max(0.1, i * PERIOD))
    assert lean(loads)[0] == pytest.approx(left, rel=1e-6)
    adopted = loads_of()
    q = ROBOT.half_sitting.copy()
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.1, -0.3, 0.0)).coeffs()
    adopted.adopt(5.0, q, np.zeros(ROBOT.nv), np.array([30.0, -5.0]))
    assert adopted.normal.tolist() == [30.0, 0.0] and adopted.share == pytest.approx(30.0 / WEIGHT)
    assert lean(adopted) == pytest.approx((0.1, -0.3), abs=1e-9)
    for i in range(1, 101):
        adopted.wrenches(measured(5.0 + i * PERIOD, (30.0, 0.0), roll=0.1, pitch=0.0))
    assert lean(adopted)[1] == pytest.approx(-0.3 * np.exp(-0.5 / 3.0), rel=2e-2)  # a swing is three seconds


def test_a_base_that_turns_is_followed_by_its_gyroscope() -> None:
    """In free fall, and below half of gravity, by nothing else."""
    loads = loads_of()
    loads.wrenches(measured(0.0))
    turning, time = measured(0.0), 0.0
    for size in (0.0, 0.49):
        start = lean(loads)[1]
        for _ in range(20):
            time += PERIOD
            force = size * turning.specific_force
            rate = BASE_FROM_IMU.T @ [0.0, 0.5, 0.0]
            loads.wrenches(replace(turning, time=time, specific_force=force, angular_velocity=rate))
        assert lean(loads) == pytest.approx((0.0, start + 0.05), abs=1e-9)
    q = loads.posture(replace(turning, joint_position=turning.joint_position + 0.01))
    assert q[7:] == pytest.approx(ROBOT.half_sitting[7:] + 0.01)
    assert np.array_equal(q[:3], ROBOT.half_sitting[:3])


def test_without_force_sensors_and_torques_nothing_is_known() -> None:
    """With the torques of limbs that hang, all of the weight is what holds the robot, with its lag of 0.05 s."""
    loads = loads_of()
    assert not loads.wrenches(measured(0.0, None)).any() and loads.share == 0.0 and not loads.outside.any()
    q = ROBOT.half_sitting.copy()
    hanging = pin.computeGeneralizedGravity(ROBOT.model, ROBOT.model.createData(), q)
    loads = loads_of()
    for i in range(41):
        wrench = loads.wrenches(replace(measured(i * PERIOD, None), joint_torque=hanging[6:]))
    assert np.abs(wrench).max() < 2.0 and loads.share < 0.01
    share = 1.0 - np.exp(-40 * PERIOD / 0.05)
    assert loads.outside[:6] == pytest.approx(share * hanging[:6], abs=0.01 * WEIGHT)
    assert loads.outside[2] == pytest.approx(share * WEIGHT, rel=5e-3)


def test_a_base_that_is_accelerated_moves_and_forgets() -> None:
    """Its velocity by the accelerometer decays with 0.3 s; impacts, above 1.7 of gravity, count for nothing."""
    for extra, counts in ((0.3, True), (0.69, True), (0.71, False), (-0.69, True)):
        loads = loads_of()
        loads.wrenches(measured(0.0))
        still = measured(0.0)
        for i in range(1, 11):
            loads.wrenches(
                replace(still, time=i * PERIOD, specific_force=(1.0 + extra) * still.specific_force)
            )
        wanted, decay = 0.0, np.exp(-PERIOD / 0.3)
        for _ in range(10):
            wanted = (wanted + counts * PERIOD * extra * GRAVITY) * decay
        assert loads._speed == pytest.approx([0.0, 0.0, wanted], abs=1e-9)


@pytest.mark.parametrize("period", [0.002, 0.005, 0.05])
def test_legs_of_a_robot_that_hangs_turn_by_their_speed_in_the_time_of_a_tick(period: float) -> None:
    """0.3 rad/s, for 20 ms a tick at most; the lean that they follow is a mean over half a second."""
    loads = loads_of(period)
    landing = Landing(ROBOT, loads)
    rest = ROBOT.half_sitting[7:]
    before, lean_of = rest, 0.0
    for tick in range(5):
        now = measured(tick * period, pitch=0.3)
        loads.wrenches(now)
        joints = landing.reference(now)
        passed = min(period, 0.02) if tick else 0.02  # nothing is known of the time before the first
        lean_of += passed / 0.5 * (0.3 - lean_of)
        assert pin.rpy.matrixToRpy(landing._attitude) == pytest.approx([0.0, lean_of, 0.0], abs=1e-9)
        assert np.abs(joints - before).max() == pytest.approx(0.3 * passed, abs=1e-9 + 0.02 * passed)
        before = joints
    loads.wrenches(measured(5 * period, (0.5 * WEIGHT, 0.5 * WEIGHT)))
    assert loads.share > 0.05
    held = landing.reference(measured(5 * period, pitch=0.3))
    assert np.array_equal(held, before)
