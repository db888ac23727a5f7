"""Clips of a robot that stands still, but for the changes that are given."""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc.core.robot import Robot
from wbc.motion import MotionClip


def still(robot: Robot, count: int = 81, **changes: Any) -> MotionClip:
    """Return frames of half-sitting at 100 Hz with both soles on the ground: joint, or x, y, z, → its changes."""
    q = np.tile(robot.half_sitting, (count, 1))
    for name, change in changes.items():
        q[:, "xyz".index(name) if name in "xyz" else 7 + robot.joint_index(name)] += change
    return MotionClip.of(robot, q, 100.0, standing=np.ones((count, 2), dtype=bool))
