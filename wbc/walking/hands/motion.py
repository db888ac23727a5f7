"""Frame that goes with the robot, in which hands keep what they hold."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.frames import pose_of
from wbc.core.trajectories import Follower

FOLLOW = 0.25
"""Time constant of each of two low-passes with which a hand that grips follows the feet, s."""


class MovingFrame:
    """Frame in the middle of both planned feet, on the ground, smoothed: what a hand holds moves with it."""

    def __init__(self, feet: Sequence[Array], yaw: float) -> None:
        """Begin between planned places of both feet, each of shape (3,), m, with a heading, rad."""
        self._point, self._yaw = Follower(FOLLOW, 0.5 * (feet[0] + feet[1])), Follower(FOLLOW, yaw)

    def update(self, feet: Sequence[Array], yaw: float, dt: float) -> None:
        """Follow the planned places of both feet, each of shape (3,), m, and the heading, rad."""
        self._point.follow(0.5 * (feet[0] + feet[1]) - self._point.value, dt)
        self._yaw.follow(math.remainder(yaw - self._yaw.value, math.tau), dt)

    @property
    def placement(self) -> pin.SE3:
        """Placement in the world."""
        return pose_of(pin.rpy.rpyToMatrix(0.0, 0.0, self._yaw.value), self._point.value)

    def velocity(self, point: Array) -> Array:
        """Return the velocity of a point that goes with the frame, both in the world, shape (3,), m and m/s."""
        lever = point - self._point.value
        moved: Array = self._point.velocity + self._yaw.velocity * np.array((-lever[1], lever[0], 0.0))
        return moved
