"""Arms in front of a robot: the posture in which it is handed a load."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.core.arguments import checked
from wbc.core.errors import Array
from wbc.core.robot import BASE_DOF, GRAVITY, Robot, joints_to

HEIGHTS = np.arange(0.0, 0.31, 0.03)
"""Heights of the hands over the CoM that are tried, m."""


@checked
def arms_forward(robot: Robot, forward: float, share: float = 0.2) -> Array:
    """Return half-sitting with both hands in front of the robot, where a load asks least of the arms.

    Args:
        robot: The robot.
        forward: Distance of the hands in front of the middle of the feet, m; as far as the arms reach.
        share: Load of all hands, as a share of the robot's mass.

    Returns:
        Configuration, shape (nq,).
    """
    weight = share * robot.mass * GRAVITY / max(len(robot.frames), 1)
    best, least = np.array(robot.half_sitting), float("inf")
    for height in float(robot.com[2]) + HEIGHTS:
        for apart in (0.0, 0.05):
            q, off = _reach(robot, forward, height, apart)
            cost = max(off - 2e-3, 0.0) * 1e3 + _strain(robot, q, weight)
            if cost < least:
                best, least = q, cost
    return best


def _strain(robot: Robot, q: Array, weight: float) -> float:
    """Return the greatest torque over its limit when each hand bears a weight, N, at rest."""
    model, data = robot.model, robot.model.createData()
    torque = pin.computeGeneralizedGravity(model, data, q)
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    joints: set[int] = set()
    for frame in robot.frames.values():
        index = robot.frame_id(frame)
        torque += weight * pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)[2]
        joints.update(joints_to(model, index))
    places = np.array([model.joints[j].idx_v - BASE_DOF for j in joints])
    return float(np.max(np.abs(torque[BASE_DOF:][places]) / robot.torque_limit[places]))


def _reach(robot: Robot, forward: float, height: float, apart: float) -> tuple[Array, float]:
    """Return a posture with the hands at a place, by damped least squares, and the greatest distance from there, m."""
    model, data = robot.model, robot.model.createData()
    q, worst = np.array(robot.half_sitting), 0.0
    for frame in robot.frames.values():
        index = robot.frame_id(frame)
        arm = joints_to(model, index, robot.frame_id(robot.torso_frame))
        columns = np.array([model.joints[j].idx_v for j in arm])
        low, high = (
            robot.position_lower[columns - BASE_DOF] + 0.05,
            robot.position_upper[columns - BASE_DOF] - 0.05,
        )
        pin.framesForwardKinematics(model, data, q)
        side = float(data.oMi[arm[0]].translation[1])
        goal = np.array([forward, side + np.copysign(apart, side), height])
        for _ in range(120):
            pin.computeJointJacobians(model, data, q)
            pin.updateFramePlacements(model, data)
            error = goal - data.oMf[index].translation
            jacobian = pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)[:3][:, columns]
            inverse = jacobian.T @ np.linalg.inv(jacobian @ jacobian.T + 1e-4 * np.eye(3))
            home = robot.half_sitting[columns + 1] - q[columns + 1]
            step = 0.5 * inverse @ error + 0.02 * (home - inverse @ (jacobian @ home))
            q[columns + 1] = np.clip(q[columns + 1] + step, low, high)
        worst = max(worst, float(np.linalg.norm(error)))
    return q, worst
