"""Coordinates of rotations, poses and directions, in which their targets move (`Task.move_to`)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.core.errors import ROUNDING, Array
from wbc.core.qp.move import Coordinates

DIFFERENCE = 1e-4
"""Step of the difference that gives the rate of a Jacobian of rotations, rad."""


class RotationCoordinates(Coordinates):
    """Rotations as rotation vectors from the first one, along the fixed axes, rad."""

    def __init__(self, base: Array, check: Callable[[Any], Array]) -> None:
        """Begin at a rotation, shape (3, 3); see `Coordinates`."""
        super().__init__(np.zeros(3), check)
        self._base = np.array(base)

    def of(self, target: Any, before: Array) -> Array:
        """Return the rotation vector to a rotation, shape (3,): of those that are the same turn, the nearest."""
        vector = np.asarray(pin.log3(self._check(target) @ self._base.T))
        angle = float(np.linalg.norm(vector))
        if angle < ROUNDING:
            return vector
        axis = vector / angle
        turns = round((float(axis @ before) - angle) / math.tau)
        return np.asarray(vector + math.tau * turns * axis)

    def target(self, place: Array, velocity: Array, acceleration: Array) -> tuple[Any, Array, Array]:
        """Return rotation, angular velocity and angular acceleration of a rotation vector that changes.

        With the left Jacobian J of the exponential, ω = J(r) ṙ and ω̇ = J(r) r̈ + J̇ ṙ.

        Source: Solà, Deray, Atchuthan, "A micro Lie theory for state estimation in robotics", 2018, eqs. 143, 145.
        """
        rotation = pin.exp3(place) @ self._base
        left, speed = pin.Jexp3(place).T, float(np.linalg.norm(velocity))
        rate = left @ acceleration
        if speed > 1e-12:
            step = DIFFERENCE / speed
            ahead, behind = pin.Jexp3(place + step * velocity), pin.Jexp3(place - step * velocity)
            rate += (ahead - behind).T @ velocity / (2.0 * step)
        return rotation, left @ velocity, rate


class PoseCoordinates(Coordinates):
    """Poses as a point, m, and a rotation vector, rad."""

    def __init__(self, base: pin.SE3, check: Callable[[Any], pin.SE3]) -> None:
        """Begin at a pose; see `Coordinates`."""
        super().__init__(np.concatenate([base.translation, np.zeros(3)]), check, (slice(0, 3), slice(3, 6)))
        self._rotations = RotationCoordinates(base.rotation, np.asarray)

    def of(self, target: Any, before: Array) -> Array:
        """Return point and rotation vector of a pose, shape (6,)."""
        pose: Any = self._check(target)
        return np.concatenate([pose.translation, self._rotations.of(pose.rotation, before[3:])])

    def target(self, place: Array, velocity: Array, acceleration: Array) -> tuple[Any, Array, Array]:
        """Return pose, velocity and acceleration, shape (6,), of point and rotation vector."""
        rotation, angular, rate = self._rotations.target(place[3:], velocity[3:], acceleration[3:])
        return (
            pin.SE3(rotation, place[:3]),
            np.concatenate([velocity[:3], angular]),
            np.concatenate([acceleration[:3], rate]),
        )


class DirectionCoordinates(Coordinates):
    """Directions as the least rotation vectors from the first one, rad."""

    def __init__(self, base: Array, check: Callable[[Any], Array]) -> None:
        """Begin at a direction, shape (3,); see `Coordinates`."""
        super().__init__(np.zeros(3), check)
        self._base = np.array(base)

    def of(self, target: Any, before: Array) -> Array:
        """Return the rotation vector to a direction, shape (3,)."""
        return least_turn(self._base, self._check(target))

    def target(self, place: Array, velocity: Array, acceleration: Array) -> tuple[Any, Array, Array]:
        """Return direction, and velocity and acceleration of the rotation vector across it."""
        rotation, left = pin.exp3(place), pin.Jexp3(place).T
        direction = rotation @ self._base
        rates = [left @ rate for rate in (velocity, acceleration)]
        return (direction, *(rate - direction * (direction @ rate) for rate in rates))


def least_turn(axis: Array, direction: Array) -> Array:
    """Return the least rotation vector that turns an axis to a direction, rad; these have length 1, all shape (3,)."""
    cross = np.cross(axis, direction)
    sine, cosine = float(np.linalg.norm(cross)), float(axis @ direction)
    if sine < 1e-6:
        if cosine > 0.0:
            return np.zeros(3)
        cross = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])  # half a turn, about any axis across
        return np.asarray(math.pi / np.linalg.norm(cross) * cross)
    return math.atan2(sine, cosine) / sine * cross
