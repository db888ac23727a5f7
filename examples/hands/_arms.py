"""Arms in front of a robot: the posture in which it is handed a load."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wbc

HEIGHTS = np.arange(0.0, 0.31, 0.03)
"""Heights of the hands over the CoM that are tried, m."""

BASE, GRAVITY = 6, 9.80665
"""Velocity coordinates of the base; gravity, m/s²."""


def arms_forward(robot: wbc.Robot, forward: float, share: float = 0.2) -> np.ndarray:
    """Return half-sitting with both hands in front of the robot, where a load asks least of the arms.

    Args:
        robot: The robot.
        forward: Distance of the hands in front of the middle of the feet, m; as far as the arms reach.
        share: Load of all hands, as a share of the robot's mass.
    """
    weight = share * robot.mass * GRAVITY / len(robot.frames)
    best, least = np.array(robot.half_sitting), np.inf
    for height in float(robot.com[2]) + HEIGHTS:
        for apart in (0.0, 0.05):
            q, off = reach(robot, forward, height, apart)
            cost = max(off - 2e-3, 0.0) * 1e3 + strain(robot, q, weight)
            if cost < least:
                best, least = q, cost
    return best


def strain(robot: wbc.Robot, q: np.ndarray, weight: float) -> float:
    """Return the greatest torque over its limit when each hand bears a weight, N, at rest."""
    model, data = robot.model, robot.model.createData()
    torque = pin.computeGeneralizedGravity(model, data, q)
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    joints: set[int] = set()
    for frame in robot.frames.values():
        index = robot.frame_id(frame)
        torque += weight * pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)[2]
        joints.update(robot.joints_between(frame, robot.base_frame))
    chain = sorted(joints)
    return float(np.max(np.abs(torque[BASE:][chain]) / robot.torque_limit[chain]))


def reach(robot: wbc.Robot, forward: float, height: float, apart: float) -> tuple[np.ndarray, float]:
    """Return a posture with the hands at a place, by damped least squares, and the greatest distance from there, m."""
    model, data = robot.model, robot.model.createData()
    q, worst = np.array(robot.half_sitting), 0.0
    for frame in robot.frames.values():
        index = robot.frame_id(frame)
        arm = np.array(robot.joints_between(frame, robot.torso_frame))
        low, high = robot.position_lower[arm] + 0.05, robot.position_upper[arm] - 0.05
        pin.framesForwardKinematics(model, data, q)
        side = float(data.oMi[int(arm[0]) + 2].translation[1])
        goal = np.array([forward, side + np.copysign(apart, side), height])
        for _ in range(120):
            pin.computeJointJacobians(model, data, q)
            pin.updateFramePlacements(model, data)
            error = goal - data.oMf[index].translation
            jacobian = pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)[:3][:, arm + BASE]
            inverse = jacobian.T @ np.linalg.inv(jacobian @ jacobian.T + 1e-4 * np.eye(3))
            home = robot.half_sitting[arm + 7] - q[arm + 7]
            step = 0.5 * inverse @ error + 0.02 * (home - inverse @ (jacobian @ home))
            q[arm + 7] = np.clip(q[arm + 7] + step, low, high)
        worst = max(worst, float(np.linalg.norm(error)))
    return q, worst
