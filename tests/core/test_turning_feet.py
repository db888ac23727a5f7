"""Feet that roll, spin and turn under a robot that is estimated: what its heading and the gyroscope's bias are then."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from measured_biped import UP, biped, errors, measurements, noisy

from wbc.core.estimation.checks.consistency import ConsistencyMonitor
from wbc.core.estimation.checks.plausibility import Plausibility
from wbc.core.estimation.observer import Observer, ObserverSettings
from wbc.core.robot import GRAVITY
from wbc.core.signals import Measurement


@cache
def rolling(radius: float, axis: int = 0) -> tuple[list[Measurement], np.ndarray, np.ndarray]:
    """On one foot rolling: a cylinder (radius, m) or, for 0, a flat sole on its edge 50 mm out.

    Sideways, outwards, about the x axis of the sole (axis 0); or forwards, over the toes, about its y axis (axis 1).
    """
    turn = np.array([[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])[axis]
    side = np.cross(turn, UP)  # where it rolls to
    robot = biped()
    dt, times = 0.005, 0.005 * np.arange(402)
    qs, cop = np.zeros((len(times), robot.nq)), np.zeros((len(times), 2))
    for k, t in enumerate(times):
        angle = 0.06 * (1 - np.cos(np.pi * t))
        sole = pin.SE3(pin.exp3(angle * turn), np.zeros(3))
        if radius > 0.0:  # contact under the axis of the cylinder, which travels radius · angle
            sole.translation = radius * (angle * side + UP - sole.rotation @ UP)
            cop[k] = radius * np.sin(angle) * side[:2]
        else:
            edge = 0.05 * side
            sole.translation = edge - sole.rotation @ edge
            cop[k] = edge[:2]
        q = np.array(robot.half_sitting)
        q[7 + robot.joint_index("left_ankle_roll")] = 0.05 * np.sin(2 * t)
        q[7 + robot.joint_index("left_knee")] += 0.05 * np.sin(3 * t)
        robot.update(q, np.zeros(robot.nv))
        base = sole * robot.placement("left_sole").inverse() * pin.XYZQUATToSE3(q[:7])
        q[:7] = pin.SE3ToXYZQUAT(base)
        qs[k] = q
    sensors, vs = measurements(robot, qs, dt, {"left": cop, "right": 0 * cop}, np.ones(len(times)))
    return sensors, qs[1:-1], vs


@pytest.mark.parametrize(("radius", "axis"), [(0.0, 1), (0.3, 0)], ids=["forwards", "sideways"])
def test_a_rolling_foot_is_followed_when_anchored_at_its_centre_of_pressure(radius: float, axis: int) -> None:
    sensors, qs, vs = rolling(radius, axis)
    observer = Observer(biped(), ObserverSettings(cop_time_constant=0.0))
    observer.reset(qs[0])
    place, speed = errors(observer, sensors, qs, vs)[:, [0, 2]].max(axis=0)
    assert place < 2e-4 and speed < 5e-4  # 2 mm and 4 mm/s and more for a sole taken for flat


def spinning(seconds: float) -> tuple[list[Measurement], np.ndarray, np.ndarray]:
    """On one foot that spins by 0.4 rad within a second under a body that keeps its heading, and rests then."""
    robot = biped()
    dt, times = 0.005, 0.005 * np.arange(round(seconds / 0.005) + 2)
    qs = np.zeros((len(times), robot.nq))
    for k, t in enumerate(times):
        q = np.array(robot.half_sitting)
        q[7 + robot.joint_index("left_hip_yaw")] = 0.2 * (1 - np.cos(np.pi * min(t, 1.0)))
        robot.update(q, np.zeros(robot.nv))
        q[:3] -= robot.placement("left_sole").translation
        qs[k] = q
    rest = np.zeros((len(times), 2))
    sensors, vs = measurements(robot, qs, dt, {"left": rest, "right": rest}, np.ones(len(times)))
    return sensors, qs[1:-1], vs


@pytest.mark.slow
def test_a_foot_that_spins_does_not_turn_the_estimate_and_holds_it_when_it_rests() -> None:
    sensors, qs, _ = spinning(11.0)
    bias = np.array([0.0, 0.0, 0.004])  # rad/s, 0.04 rad over the whole time
    sensors = [replace(s, angular_velocity=s.angular_velocity + bias) for s in noisy(sensors, 1)]
    yaws = {}
    for spin in (ObserverSettings().spin, 100.0):
        observer = Observer(biped(), ObserverSettings(spin=spin))
        observer.reset(qs[0])
        yaws[spin] = [pin.rpy.matrixToRpy(observer.update(s).placement("base").rotation)[2] for s in sensors]
    robust, trusting = yaws.values()
    assert np.abs(robust).max() < 0.01, "the foot has turned by 0.4 rad, the body has not"
    assert abs(robust[-1] - robust[len(robust) // 2]) < 2e-3, "a foot at rest holds the yaw against the bias"
    assert abs(trusting[-1]) > 0.2, "without the rule the turn of the foot is taken for one of the body"


def turn_on_a_plate(observer: Observer, rates: Sequence[float], dt: float, bias: float) -> Iterator[float]:
    """Turn robot and feet as one, as on a plate, rad/s, under a gyroscope with a bias; yield the turn that it tells."""
    observer.reset()  # other tests leave the biped elsewhere
    robot = observer.robot
    wrench, joints = np.zeros((2, 6)), np.array(robot.half_sitting[7:])
    wrench[:, 2] = 0.5 * robot.mass * GRAVITY
    up = np.array(robot.placement("imu").rotation[2])
    for k, rate in enumerate(rates):
        measurement = Measurement(
            k * dt, joints, np.zeros(robot.na), (rate + bias) * up, GRAVITY * up, wrench
        )
        observer.update(measurement, plausible=True)
        yield observer.inertial.correction.turned


def test_feet_that_turn_slowly_turn_the_world_and_the_gyroscope_tells_by_how_much() -> None:
    """They turn at a third of the speed of a spin."""
    observer, dt, rate, total = Observer(biped()), 0.005, 0.03, 0.0
    rates = [rate if 2000 <= k < 3000 else 0.0 for k in range(3200)]
    for k, turned in enumerate(turn_on_a_plate(observer, rates, dt, 0.004)):
        if k < 2000:
            observer.inertial.learn_bias()
        else:
            total += turned
    assert observer.robot.placement("base").rotation[1, 0] == pytest.approx(0.0, abs=0.02)  # with its feet
    assert total == pytest.approx(rate * 1000 * dt, rel=0.05)


def test_feet_that_turn_for_a_moment_in_a_stand_hardly_move_the_bias() -> None:
    """They turn by 0.08 rad in 1 s, as a sole that settles on a stone, and count a fifth of a mean at most."""
    observer, dt, total = Observer(biped()), 0.005, 0.0
    rates = [0.08 if 1600 <= k < 1800 else 0.0 for k in range(3800)]
    for k, turned in enumerate(turn_on_a_plate(observer, rates, dt, 0.0)):
        if k < 1800:
            observer.inertial.learn_bias()
        else:
            total += turned
    assert total == pytest.approx(0.0, abs=0.2 * 0.08 * 2000 * dt / 8.0)


def test_a_stand_after_feet_have_turned_leaves_the_bias_of_the_gyroscope() -> None:
    """In a stand of 1 s the bias of the filter is still wrong by more than 0.01 rad/s."""
    observer, dt, total, bias = Observer(biped()), 0.005, 0.0, 0.004
    rates = [0.05 if 1600 <= k < 2400 else 0.0 for k in range(4600)]
    for k, turned in enumerate(turn_on_a_plate(observer, rates, dt, bias)):
        if k < 1600 or 2400 <= k < 2600:
            observer.inertial.learn_bias()
        elif k >= 2600:
            total += turned
        if k == 2599:
            assert abs(observer.inertial.gyro_bias[2] - bias) > 0.01
    assert total == pytest.approx(0.0, abs=0.1 * 0.05 * 800 * dt)


@pytest.mark.parametrize(("radius", "axis"), [(0.0, 1), (0.3, 0)], ids=["forwards", "sideways"])
def test_a_gyroscope_that_is_wrong_is_told_from_a_foot_that_turns(radius: float, axis: int) -> None:
    """Both turn the foot, by encoders and gyroscope; but only the foot moves the accelerometer."""
    sensors, qs, _ = rolling(radius, axis)
    sensors = noisy(sensors, 0)
    dt, start = 0.005, 1.4
    off = 0.1 * np.eye(3)[axis]

    def doubts(wrong: Callable[[np.ndarray], np.ndarray]) -> list[tuple[float, str]]:
        robot = biped().clone()
        observer = Observer(robot, ObserverSettings(cop_time_constant=0.0))
        observer.reset(qs[0])
        plausibility = Plausibility(robot, dt)
        monitor = ConsistencyMonitor(robot, dt, plausibility.names)
        found = []
        for true in sensors:
            rate = true.angular_velocity
            sensor = replace(true, angular_velocity=wrong(rate) if true.time > start else rate)
            observer.update(plausibility.check(sensor)[0])
            monitor.update(plausibility.values, sensor, observer)
            found += [(sensor.time - start, doubt) for doubt in monitor.doubts]
        return found

    assert not doubts(lambda rate: rate)
    for wrong in (lambda rate: rate + off, lambda rate: rate - off):
        found = doubts(wrong)
        assert found and 0.0 < found[0][0] < 0.2 and "gyroscope" in found[0][1]
