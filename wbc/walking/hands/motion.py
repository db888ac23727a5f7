"""Motions of hands: a force or a displacement along a quintic, and the frame that goes with the robot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.trajectories import Quintic

FOLLOW = 0.25
"""Time constant of each of two low-passes with which a hand that grips follows the feet, s."""


class Ramp:
    """A value that goes to its goal along a quintic.

    Attributes:
        value: Present value.
        goal: Value in the end.
    """

    def __init__(self, value: float = 0.0) -> None:
        """Rest at a value."""
        self.value = self.goal = value
        self._curve: Quintic[float] | None = None
        self._elapsed = 0.0

    def to(self, goal: float, duration: float) -> None:
        """Go to a goal within a time, s, from rest."""
        self._curve = Quintic((self.value, 0.0, 0.0), (goal, 0.0, 0.0), duration)
        self.goal, self._elapsed = goal, 0.0

    def advance(self, dt: float) -> None:
        """Advance by a period, s."""
        if self._curve is None:
            return
        self._elapsed += dt
        if self._elapsed >= self._curve.duration:
            self.value, self._curve = self.goal, None
        else:
            self.value = self._curve.at(self._elapsed)[0]


class Follower:
    """Value that follows its goal like a critically damped mass: two low-passes in a row.

    Attributes:
        value: Present value, a number or an array.
        velocity: Its derivative.
        acceleration: The derivative of that.
    """

    def __init__(self, time_constant: float, value: Any) -> None:
        """Rest at a value; the time constant, s, is that of each low-pass."""
        self._rate = 1.0 / time_constant
        self.value = value
        self.velocity = self.acceleration = 0.0 * value

    def follow(self, error: Any, dt: float) -> None:
        """Advance by a period, s, towards a goal: `error` is goal minus value."""
        self.acceleration = self._rate * self._rate * error - 2.0 * self._rate * self.velocity
        self.velocity = self.velocity + dt * self.acceleration
        self.value = self.value + dt * self.velocity


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
        return pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, self._yaw.value), self._point.value)

    def velocity(self, point: Array) -> Array:
        """Return the velocity of a point that goes with the frame, both in the world, shape (3,), m and m/s."""
        lever = point - self._point.value
        moved: Array = self._point.velocity + self._yaw.velocity * np.array((-lever[1], lever[0], 0.0))
        return moved


def quintic_part(time: float, duration: float, begin: float, end: float) -> tuple[float, float, float]:
    """Return a quintic from 0 to 1 with two derivatives; times are in s, `begin` and `end` over the duration."""
    span = (end - begin) * duration
    elapsed = min(max(time - begin * duration, 0.0), span)
    return Quintic((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), span).at(elapsed)
