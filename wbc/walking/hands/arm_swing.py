"""Swing of arms without targets, each with the foot of the other side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from wbc.core.robot import BASE_DOF, Robot
from wbc.tasks.motion.posture import PostureTask
from wbc.walking.pattern.swing import FootMotion

HANDS = ("left_hand", "right_hand")
"""Roles of the hands in `Robot.frames`."""

LEAST_GAIN = 0.01
"""Displacement of a hand forward per angle of a joint, m/rad, below which the joint cannot swing the arm."""


class ArmSwing:
    """Arms that swing with the opposite foot: by the joint of each arm that moves its hand forward most."""

    def __init__(
        self, robot: Robot, arms: Mapping[str, tuple[str, Sequence[int]]], posture: PostureTask
    ) -> None:
        """Find the joint of each arm that swings it; an arm without such a joint is held still.

        `arms` is role of a hand → its frame and the joints of its arm, as indices in arrays of shape (na,).
        """
        self._posture = posture
        self._rest = np.array(posture.target)
        self._joints: list[
            tuple[int, int, float]
        ] = []  # joint, side, displacement of the hand forward per radian
        for side, name in enumerate(HANDS):
            frame, joints = arms.get(name, ("", ()))
            if not joints:
                continue
            rows = pin.getFrameJacobian(
                robot.model, robot.data, robot.frame_id(frame), pin.LOCAL_WORLD_ALIGNED
            )
            forward = robot.placement(robot.base_frame).rotation[:, 0]
            gains = [float(forward @ rows[:3, BASE_DOF + joint]) for joint in joints]
            best = max(range(len(gains)), key=lambda i: abs(gains[i]))
            if abs(gains[best]) > LEAST_GAIN:
                self._joints.append((joints[best], side, gains[best]))

    def update(self, feet: Sequence[FootMotion], yaw: float, swing: float) -> None:
        """Set the targets of the posture and their velocities, from references of both soles and the heading, rad.

        `swing` is how far a hand goes forward for each metre that the other side's foot is ahead of its own.
        """
        c, s = math.cos(yaw), math.sin(yaw)
        (left, right), velocity = feet, np.zeros(self._posture.dim)
        x, y, _ = (right.placement.translation - left.placement.translation).tolist()
        ahead = c * x + s * y
        u, v = (right.velocity - left.velocity)[:2].tolist()
        speed = c * u + s * v
        target = self._rest.copy()
        for joint, side, gain in self._joints:
            turn = (1.0, -1.0)[side] * swing / gain  # rad for each metre that the foot is ahead
            target[joint] += turn * ahead
            velocity[joint] = turn * speed
        self._posture.follow(target, velocity, np.zeros(self._posture.dim))
