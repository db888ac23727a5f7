"""Measurements of a robot at rest, made by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from wbc.core.robot import GRAVITY, Robot
from wbc.core.signals import Measurement


def at_rest(robot: Robot, time: float, **changes: Any) -> Measurement:
    """Half-sitting, half the weight on each foot, by perfect sensors; some signals may be others."""
    wrench = np.zeros((2, 6))
    wrench[:, 2] = 0.5 * robot.mass * GRAVITY
    up = robot.placement(robot.imu_frame).rotation.T @ np.array([0.0, 0.0, GRAVITY])
    still = np.zeros(robot.na)
    return replace(
        Measurement(time, robot.half_sitting[7:].copy(), still, np.zeros(3), up, wrench), **changes
    )
