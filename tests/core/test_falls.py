"""A fall is what nothing recovers from: it ends in damping, and a robot that is caught is never damped."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from faults import silence

import wbc
from wbc import Measurement
from wbc.core.drive.failures import FailurePolicy
from wbc.core.drive.sensing import SafetySettings
from wbc.core.estimation.falls import LASTING, SLOPE, FallDetector, FallReason
from wbc.core.robot import GRAVITY
from wbc.sim import Plant
from wbc.sim.trial.falls import TrueFallDetector
from wbc.walking import WalkingControl, WalkingControlSettings

KINDS: dict[str, Any] = {
    "position": wbc.PositionControl,
    "torque": wbc.TorqueControl,
    "hybrid": wbc.HybridControl,
}


def toppled(robot: wbc.Robot, slope: float, way: float) -> np.ndarray:
    """Half-sitting turned about a point between the soles until the CoM is so far beside the nearer one."""
    low, high = 0.0, 0.5 * math.pi
    for _ in range(12):
        angle = 0.5 * (low + high)
        turn = pin.exp3(angle * np.array([-math.sin(way), math.cos(way), 0.0]))
        q = np.array(robot.half_sitting)
        q[:3] = turn @ q[:3]
        q[3:7] = pin.Quaternion(turn @ pin.Quaternion(q[3:7]).matrix()).coeffs()
        robot.update(q, np.zeros(robot.nv))
        soles = [robot.placement(sole.frame).translation for sole in robot.soles]
        ways = [robot.com - sole for sole in soles]
        if min(math.hypot(x, y) / max(z, 1e-9) for x, y, z in ways) < slope:
            low = angle
        else:
            high = angle
    return q


@pytest.mark.parametrize("name", ["g1", "hrp4_class"])
def test_a_centre_of_mass_farther_beside_the_feet_than_above_them_is_a_fall_if_it_lasts(name: str) -> None:
    robot, dt = wbc.load_robot(name).robot(), 0.002
    detector = FallDetector(robot, dt)
    lasting = LASTING * math.sqrt(float(robot.com[2]) / 9.81)
    v = np.zeros(robot.nv)
    for way in (0.0, 1.6, 4.0):
        for slope, falls in ((0.97 * SLOPE, False), (1.03 * SLOPE, True)):
            detector.reset()
            robot.update(toppled(robot, slope, float(way)), v)
            ticks = next((n for n in range(1, 200) if detector.update()), None)
            assert (ticks is not None) is falls
            assert ticks is None or ticks * dt == pytest.approx(lasting, rel=0.15)
            assert detector.reason is (FallReason.DOWN if falls else None)
    for change in ({"q": np.nan}, {"v": np.nan}, {"v": 200.0}):
        detector.reset()
        robot.update(robot.half_sitting, v)
        for part, value in change.items():
            getattr(robot, part)[3] = value
        assert detector.update() is FallReason.DIVERGED


def test_squats_bows_stairs_and_hops_are_no_falls() -> None:
    robot = wbc.load_robot("g1").robot()
    detector, v = FallDetector(robot, 0.002), np.zeros(robot.nv)
    legs = {"hip_pitch": -1.6, "knee": 2.6, "ankle_pitch": -0.87}
    squat = {f"{side}_{part}_joint": x for side in ("left", "right") for part, x in legs.items()}
    sits = dict(zip(robot.joint_names, robot.half_sitting[7:].tolist(), strict=True))
    bow = {name: sits[name] - 0.9 for name in sits if "hip_pitch" in name}
    stair = {"left_hip_pitch_joint": -1.5, "left_knee_joint": 1.5}
    for joints, pitch in ((squat, 0.0), (bow, 0.9), (stair, 0.0)):
        q = robot.configuration(joints)
        q[3:7] = [0.0, math.sin(0.5 * pitch), 0.0, math.cos(0.5 * pitch)]
        for lift in (0.0, 1.0):
            q[2] += lift
            robot.update(q, v)
            assert not any(detector.update() for _ in range(200))


def thrown(
    mode: str, on_fall: str, seconds: float
) -> tuple[Any, list[tuple[float, wbc.Command, Measurement, bool]]]:
    """Push a standing robot over; return its control; time, command, measurement and fall of every tick."""
    description = wbc.load_robot("g1")
    plant = Plant(description, control_period=0.004, timestep=0.002, visuals=False)
    safety = SafetySettings(on_fall=on_fall)  # type: ignore[arg-type]
    control = KINDS[mode](wbc.balance_controller(description.robot(), 0.004), safety=safety)
    plant.push("torso_link", (150.0, 0.0, 0.0), 0.2)
    ticks = []
    while plant.time < seconds:
        measurement = plant.measure()
        command = control.command(measurement)
        ticks.append((plant.time, command, measurement, control.sensing.falls.reason is not None))
        plant.step(command)
    assert TrueFallDetector(plant.robot).fallen(plant.truth().q)
    return control, ticks


@pytest.mark.parametrize("mode", ["position", "torque", pytest.param("hybrid", marks=pytest.mark.slow)])
@silence()
def test_a_control_of_a_robot_that_has_fallen_damps_until_it_is_reset(mode: str) -> None:
    control, ticks = thrown(mode, "damp", 1.3)
    assert control.fallen is FallReason.DOWN and control.damped
    assert control.status().startswith(f"fallen: {FallReason.DOWN.value}; damped")
    _, command, measurement, _ = ticks[-1]
    velocity = measurement.joint_velocity
    assert command.kp is None or not command.kp.any()
    damping = 0.0 if command.kd is None else command.kd
    torque = command.joint_torque - damping * velocity
    limit = control.controller.robot.torque_limit
    share = FailurePolicy().joint_damping if mode != "hybrid" else 0.0
    assert (torque * velocity <= 1e-9).all() and (np.abs(torque) <= 1.5 * limit).all()
    assert (np.abs(torque) >= np.minimum(0.99 * share * limit * np.abs(velocity), 0.99 * limit)).all()
    upper = control.controller.robot.position_upper
    hanging = np.full((2, 6), -0.5 * control.controller.robot.mass * GRAVITY) * [0, 0, 1, 0, 0, 0]
    for tick in range(1, 40):  # encoders that stay beyond their range are believed in the end
        beyond = {
            "joint_position": upper + 0.01,
            "joint_velocity": np.zeros(len(upper)),
            "sole_wrench": hanging,
        }
        command = control.command(replace(measurement, time=measurement.time + 0.004 * tick, **beyond))
        assert command.joint_position is None or (command.joint_position <= upper).all()
    control.reset()
    assert control.fallen is None and not control.damped


@silence()
def test_who_wants_else_goes_on() -> None:
    control, ticks = thrown("torque", "go on", 1.0)
    assert control.sensing.falls.reason is FallReason.DOWN and not control.damped
    first = next(i for i, (_, _, _, down) in enumerate(ticks) if down)
    damping = FailurePolicy().joint_damping * control.controller.robot.torque_limit
    _, command, measurement, _ = ticks[first]
    assert (
        np.abs(command.joint_torque + damping * measurement.joint_velocity).max() > 1.0
    )  # not damping alone


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("name", ["g1", "hrp4_class"])
@silence()
def test_pushes_that_are_stepped_out_damp_nobody_and_all_falls_do(name: str) -> None:
    """Of impulses around those that fell the robot, in random directions.

    A robot has truly fallen below a third of its height. At a half it may crouch with its feet below it, for half a
    second before it is lost, and a squat is no fall.
    """
    description, rng = wbc.load_robot(name), np.random.default_rng(5)
    plant, outcomes = Plant(description, noise="realistic", control_period=0.002, visuals=False), []
    torso = plant.robot.torso_frame
    for seed in range(12):
        plant.reset(seed=seed)
        settings = WalkingControlSettings(mode="torque")
        walking = WalkingControl(description.robot(), None, plant.control_period, settings)
        angle, impulse = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(0.4, 2.0) * plant.robot.mass
        low = said = math.inf
        while plant.time < 4.0 and plant.time < said + 0.5:
            if abs(plant.time - 0.5) < 1e-6:
                force = 10.0 * impulse * np.array([math.cos(angle), math.sin(angle), 0.0])
                plant.push(torso, tuple(force.tolist()), 0.1)
            plant.step(walking.command(plant.measure()))
            if plant.truth().com[2] < plant.robot.com[2] / 3.0:
                low = min(low, plant.time)
            if walking.fallen is not None:
                said = min(said, plant.time)
        outcomes.append(low < math.inf)
        assert (said < math.inf) == (low < math.inf) and (low == math.inf or said < low + 0.2)
    assert {True, False} == set(outcomes)
