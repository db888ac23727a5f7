"""Moves of targets: a trajectory in coordinates of a target, the target itself unless it has a rotation."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array
from wbc.core.frames import pose_of
from wbc.core.trajectories import Trajectory

USUAL_SPEED = {"m": 0.2, "rad": 1.0}
"""Unit → greatest speed of a target that is given neither a duration nor a speed, per second."""

SAME = 1e-6
"""Angle up to which a rotation or direction is the first one again, or half a turn from it, rad."""

SAMPLES = 16
"""Samples by which the turn between two targets is measured."""

DIFFERENCE = 1e-4
"""Step of the difference that gives the rate of a Jacobian of rotations, rad."""


class Coordinates:
    """Coordinates of targets, in which a trajectory moves; of points and joints, these are the targets themselves.

    Attributes:
        start: Coordinates at the start, shape (n,).
        parts: Coordinates that are one vector, with a speed of their own.
    """

    def __init__(
        self, start: Array, check: Callable[[Any], Array], parts: Sequence[slice] = (slice(None),)
    ) -> None:
        """Begin at the present target, shape (n,); `check` returns a target after a check, shape (n,)."""
        self.start, self._check, self.parts = np.array(start), check, parts

    def of(self, target: Any, before: Array) -> Array:
        """Return the coordinates of a target, shape (n,), checked; `before` are those of the one before it."""
        return self._check(target)

    def target(self, place: Array, velocity: Array, acceleration: Array) -> tuple[Any, Array, Array]:
        """Return target, velocity and acceleration of coordinates and their first and second derivative."""
        return place, velocity, acceleration


class RotationCoordinates(Coordinates):
    """Rotations as rotation vectors from the first one, along the fixed axes, rad."""

    def __init__(self, base: Array, check: Callable[[Any], Array]) -> None:
        """Begin at a rotation, shape (3, 3); see `Coordinates`."""
        super().__init__(np.zeros(3), check)
        self._base = np.array(base)

    def of(self, target: Any, before: Array) -> Array:
        """Return the rotation vector to a rotation, shape (3,): of those that are the same turn, the nearest.

        A way there of more than half a turn is an `InputError`: unless all axes are parallel, it is not the least one.
        """
        vector = _nearest_turn(self._turn_to(self._check(target), before), before)
        way = [pin.exp3(place) for place in np.linspace(before, vector, SAMPLES)]
        turn = sum(float(np.linalg.norm(pin.log3(b @ a.T))) for a, b in itertools.pairwise(way))
        if turn > math.pi + SAME * SAMPLES:
            raise InputError(
                f"a move turns by half a turn at most from one target to the next, got {math.degrees(turn):.0f}°: "
                "end the move at a target before, and begin another one there"
            )
        return vector

    def _turn_to(self, target: Array, before: Array) -> Array:
        return np.asarray(pin.log3(target @ self._base.T))

    def target(self, place: Array, velocity: Array, acceleration: Array) -> tuple[Any, Array, Array]:
        """Return rotation, angular velocity and angular acceleration of a rotation vector that changes."""
        rotation = pin.exp3(place) @ self._base
        return rotation, *_turning_rates(place, velocity, acceleration)


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
            pose_of(rotation, place[:3]),
            np.concatenate([velocity[:3], angular]),
            np.concatenate([acceleration[:3], rate]),
        )


class DirectionCoordinates(RotationCoordinates):
    """Directions as the least rotation vectors from the first one, rad."""

    def _turn_to(self, target: Array, before: Array) -> Array:
        return least_turn(self._base, target, before)

    def target(self, place: Array, velocity: Array, acceleration: Array) -> tuple[Any, Array, Array]:
        """Return the direction d, d × ḋ and its derivative: the angular velocity ω across d, and how it changes.

        With ḋ = ω × d, the part of ω across d is ω − d (d · ω), and its derivative ω̇ − d (d · ω̇) − ḋ (d · ω).
        """
        direction, spin, rate = super().target(place, velocity, acceleration)
        along = float(direction @ spin)
        across = rate - direction * (direction @ rate) - np.cross(spin, direction) * along
        return direction, spin - direction * along, across


def coordinates(start: Any, check: Callable[[Any], Any]) -> Coordinates:
    """Return coordinates of poses, rotations or vectors, by what the first target is."""
    if isinstance(start, pin.SE3):
        return PoseCoordinates(start, check)
    return RotationCoordinates(start, check) if start.ndim == 2 else Coordinates(start, check)


class Move:
    """A target on its way through others to rest at the last."""

    def __init__(
        self,
        coordinates: Coordinates,
        targets: Sequence[Any],
        rates: tuple[Array | None, Array | None],
        **limits: Any,
    ) -> None:
        """Plan from the present target, and its velocity and acceleration, on; limits are those of a `Trajectory`."""
        points = [coordinates.start]
        for target in targets:
            points.append(coordinates.of(target, points[-1]))
        self.coordinates = coordinates
        self._trajectory = Trajectory(
            points, parts=coordinates.parts, velocity=rates[0], acceleration_at_start=rates[1], **limits
        )
        self._elapsed = 0.0
        self._order = [_copied(each) for each in (*targets, *limits.values())]

    def is_of(self, targets: Sequence[Any], limits: Mapping[str, Any]) -> bool:
        """Return True for the targets and the limits with which the move was made."""
        order = [*targets, *limits.values()]
        return len(order) == len(self._order) and all(map(_same, self._order, order))

    def now(self) -> tuple[Any, Array, Array]:
        """Return target, velocity and acceleration at this time."""
        return self.coordinates.target(*self._trajectory.at(self._elapsed))

    @property
    def arrived(self) -> bool:
        """True once the target is at rest at the last one."""
        return self._elapsed >= self._trajectory.duration - ROUNDING

    def advance(self, dt: float) -> bool:
        """Go on by a period, s; False if the target had arrived before."""
        arrived = self.arrived
        self._elapsed += dt
        return not arrived


def _copied(value: Any) -> Any:
    """Return a copy of a target or a limit: a pose, positions by joint, numbers or None."""
    if isinstance(value, pin.SE3):
        return pin.SE3(value)
    return dict(value) if isinstance(value, Mapping) else np.array(value)


def _same(copied: Any, value: Any) -> bool:
    """Return True if a value is that of which a copy was made."""
    if isinstance(copied, np.ndarray):
        return np.array_equal(copied, value)
    return isinstance(value, type(copied)) and bool(copied == value)


def _turning_rates(place: Array, velocity: Array, acceleration: Array) -> tuple[Array, Array]:
    """Return angular velocity and acceleration of a rotation vector r that changes, shape (3,), along fixed axes.

    With the left Jacobian J of the exponential, ω = J(r) ṙ and ω̇ = J(r) r̈ + J̇ ṙ.

    Source: Solà, Deray, Atchuthan, "A micro Lie theory for state estimation in robotics", 2018, eqs. 143, 145.
    """
    left, speed = pin.Jexp3(place).T, float(np.linalg.norm(velocity))
    rate = left @ acceleration
    if speed > 1e-12:
        step = DIFFERENCE / speed
        ahead, behind = pin.Jexp3(place + step * velocity), pin.Jexp3(place - step * velocity)
        rate += (ahead - behind).T @ velocity / (2.0 * step)
    return left @ velocity, rate


def _nearest_turn(vector: Array, before: Array) -> Array:
    """Return the rotation vector that is the same turn as a vector, and nearest to another one, rad, shape (3,)."""
    angle, turned = float(np.linalg.norm(vector)), float(np.linalg.norm(before))
    if angle < SAME:  # whole turns are about any axis
        return vector if turned < SAME else math.tau * round(turned / math.tau) / turned * before
    axis = vector / angle
    turns = round((float(axis @ before) - angle) / math.tau)
    return np.asarray(vector + math.tau * turns * axis)


def least_turn(axis: Array, direction: Array, before: Array | None = None) -> Array:
    """Return the least rotation vector that turns an axis to a direction, rad; these have length 1, all shape (3,).

    Half a turn is about the axis of the rotation vector `before`, which is across, or about any one across.
    """
    cross = np.cross(axis, direction)
    sine, cosine = float(np.linalg.norm(cross)), float(axis @ direction)
    if sine < SAME:
        if cosine > 0.0:
            return np.asarray(cross)  # the sine is the angle
        cross = (
            before
            if before is not None and before.any()
            else np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
        )
        return np.asarray(math.pi / np.linalg.norm(cross) * cross)
    return math.atan2(sine, cosine) / sine * cross
