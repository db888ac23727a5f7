"""The parts of a walk as one control, against analytic answers: a robot whose sensors are made by hand."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc.core.robot import GRAVITY, Robot
from wbc.core.signals import Measurement
from wbc.robots import load
from wbc.tasks import CoMTask
from wbc.walking.control import WalkingControl, WalkingControlSettings
from wbc.walking.falls import FallReason, FallSettings
from wbc.walking.planning.footsteps import FootstepPlan
from wbc.walking.stabilizer.gains import StabilizerGains

DESCRIPTION = load("hrp4_class")
DT = 0.005


def standing(settings: WalkingControlSettings) -> tuple[Robot, WalkingControl]:
    robot = DESCRIPTION.robot()
    return robot, WalkingControl(DESCRIPTION.robot(), FootstepPlan.standing(robot), DT, settings)


def sensors(
    robot: Robot, tick: int, q: np.ndarray, cop: tuple[float, float] = (0.0, 0.0), left: float = 0.5
) -> Measurement:
    """An upright robot at rest; a share of its weight on the left foot, both feet at a CoP (m, in the sole)."""
    wrench = np.zeros((2, 6))
    for foot, share in enumerate((left, 1.0 - left)):
        force = share * robot.mass * GRAVITY
        wrench[foot, 2:5] = force, cop[1] * force, -cop[0] * force
    up = robot.placement(robot.imu_frame).rotation.T @ np.array([0.0, 0.0, GRAVITY])
    return Measurement(tick * DT, q[7:].copy(), np.zeros(robot.na), np.zeros(3), up, wrench)


@pytest.mark.parametrize(("depth", "reason"), [(0.03, None), (0.07, FallReason.HEIGHT)])
def test_a_robot_that_sinks_below_its_target_has_fallen(depth: float, reason: FallReason | None) -> None:
    """Its knees give way while it stands; 50 mm are allowed."""
    robot, walking = standing(WalkingControlSettings(falls=FallSettings(drop=0.05)))
    stand, bend, q = float(robot.com[2]), 0.0, np.array(robot.half_sitting)
    legs = [
        (f"{side}_{joint}", sign)
        for side in ("left", "right")
        for joint, sign in (("hip_pitch", -1.0), ("knee_pitch", 2.0), ("ankle_pitch", -1.0))
    ]
    for tick in range(200):
        if stand - robot.com[2] < depth:
            bend += 0.003
        q = robot.configuration(
            {j: robot.half_sitting[7 + robot.joint_index(j)] + sign * bend for j, sign in legs}
        )
        robot.update(q, np.zeros(robot.nv))
        walking.command(sensors(robot, tick, q))
    assert stand - robot.com[2] == pytest.approx(depth, abs=5e-3)
    assert walking.fallen is reason


def test_feed_forward_is_the_inverse_dynamics_of_the_motion_under_the_desired_wrenches() -> None:
    """Of a commanded robot that moves, while pushed feet make the stabilizer want other wrenches than the QP."""
    settings = WalkingControlSettings()
    robot, walking = standing(settings)
    control, rng = walking.control, np.random.default_rng(4)
    for tick in range(10):
        control.v[:] = 0.1 * rng.normal(size=robot.nv)
        q, v = control.q.copy(), control.v.copy()
        command = walking.command(sensors(robot, tick, robot.half_sitting, (0.02, -0.01), left=0.6))
        solution, output = control.solution, walking.output
        assert solution is not None and solution.ok and output is not None
        model, data = robot.model, robot.model.createData()
        generalised = pin.rnea(model, data, q, v, solution.accelerations)
        own = generalised.copy()
        for sole, wrench in zip(robot.soles, output.feet.wrenches, strict=True):
            jacobian = pin.computeFrameJacobian(model, data, q, robot.frame_id(sole.frame), pin.LOCAL)
            generalised -= jacobian.T @ wrench
            own -= jacobian.T @ solution.wrenches[sole.name]
        assert (np.abs(generalised[6:]) < robot.torque_limit).all()
        np.testing.assert_allclose(command.joint_torque, generalised[6:], atol=1e-6)
        assert np.abs(generalised[6:] - own[6:]).max() > 1.0  # not those of the QP


def test_the_shifted_target_of_the_com_moves_as_its_feed_forwards_say() -> None:
    """The ZMP is off, and the CoM admittance shifts the target over a pendulum that rests."""
    robot, walking = standing(WalkingControlSettings(gains=StabilizerGains(com_admittance=1.0)))
    task = next(task for task in walking.controller.tasks if isinstance(task, CoMTask))
    places, speeds, accelerations = [], [], []
    for tick in range(60):
        cop = (0.02 * np.sin(0.1 * tick), 0.01)
        walking.command(sensors(robot, tick, robot.half_sitting, cop))
        places.append(task.target[:2].copy())
        speeds.append(task.feedforward_velocity[:2].copy())
        accelerations.append(task.feedforward_acceleration[:2].copy())
    moved = np.diff(places, axis=0) / DT
    assert np.abs(moved).max(axis=0).min() > 1e-3
    np.testing.assert_allclose(speeds[1:], moved, atol=1e-9)
    np.testing.assert_allclose(accelerations[1:], np.diff(speeds, axis=0) / DT, atol=1e-7)
