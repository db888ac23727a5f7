"""When a robot counts as fallen."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array
from wbc.core.robot import Robot

LOWEST_BASE = 0.7
"""Base height below which a robot has fallen, as part of its height at half-sitting. Squats do not go that low."""

LARGEST_TILT = math.radians(60.0)
"""Tilt of the base, against half-sitting, from which no balance controller comes back."""


class FallDetector:
    """Tells from the true state whether a robot has fallen; feet may slide, tilt or leave the ground."""

    def __init__(self, robot: Robot, ground: float = 0.0) -> None:
        """Take the robot's half-sitting as what upright means.

        Args:
            robot: The robot.
            ground: Height of the ground, m.
        """
        self._ground = ground
        self._height = LOWEST_BASE * float(robot.half_sitting[2])
        self._up = _rotation(robot.half_sitting).T[:, 2]

    def fallen(self, q: Array) -> bool:
        """Whether a robot in that configuration has fallen; also when it is not finite.

        Args:
            q: True configuration, shape (nq,).
        """
        high = q[2] - self._ground > self._height
        return not (high and (_rotation(q) @ self._up)[2] > math.cos(LARGEST_TILT))


def _rotation(q: Array) -> Array:
    return np.asarray(pin.Quaternion(q[3:7]).toRotationMatrix())
