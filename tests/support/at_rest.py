"""Measurements and estimates of a robot at rest, made by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from wbc.core.estimation.foot import FeetAtRest
from wbc.core.estimation.inertial import Correction
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


def observed(robot: Robot, /, *, slides: Sequence[bool] = (False, False), **parts: Any) -> Any:
    """Return the estimate of a robot that stands upright, with some parts replaced."""
    inertial = SimpleNamespace(rotation=robot.placement(robot.imu_frame).rotation, correction=Correction())
    still: dict[str, Any] = {"inertial": inertial, "load_shares": [0.5, 0.5]}
    still["foot_velocities"] = still["foot_rotations"] = [(0.0, 0.0, 0.0)] * 2
    still["rest"] = FeetAtRest([0.4, 0.6], [False, False], list(slides))
    return SimpleNamespace(**(still | parts))
