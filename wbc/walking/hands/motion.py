"""Motions of hands: a force or a displacement along a quintic, and the frame that goes with the robot."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array
from wbc.tasks.trajectories import Quintic


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


class MovingFrame:
    """Middle of both feet as planned, on the ground, smoothed: what a hand holds goes with it.

    Attributes:
        placement: In the world.
        velocity: Of its origin, shape (3,), m/s.
        turning: Speed about the vertical, rad/s.
    """

    def __init__(self, time_constant: float) -> None:
        """Begin at the first update; the time constant, s, is that of both filters in a row."""
        self._rate = 1.0 / time_constant
        self._yaw = self.turning = 0.0
        self._began = False
        self.placement, self.velocity = pin.SE3.Identity(), np.zeros(3)

    def update(self, feet: Sequence[Array], yaw: float, dt: float) -> None:
        """Follow the planned places of both feet, each of shape (3,), m, and the heading, rad."""
        middle = 0.5 * (feet[0] + feet[1])
        if not self._began:
            self._began, self._yaw, self._point = True, yaw, middle
        rate = self._rate
        # Critically damped.
        self.velocity = self.velocity + dt * (
            rate * rate * (middle - self._point) - 2.0 * rate * self.velocity
        )
        self._point = self._point + dt * self.velocity
        error = math.remainder(yaw - self._yaw, 2.0 * math.pi)
        self.turning += dt * (rate * rate * error - 2.0 * rate * self.turning)
        self._yaw += dt * self.turning
        self.placement = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, self._yaw), self._point)


def quintic_part(time: float, duration: float, begin: float, end: float) -> tuple[float, float, float]:
    """Return a quintic from 0 to 1 with two derivatives; times are in s, `begin` and `end` over the duration."""
    span = (end - begin) * duration
    elapsed = min(max(time - begin * duration, 0.0), span)
    return Quintic((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), span).at(elapsed)
