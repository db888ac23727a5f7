"""Moves of targets: a trajectory in coordinates of a target, which are the target itself unless it is a rotation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from wbc.core.errors import ROUNDING, Array
from wbc.core.trajectories import Trajectory

USUAL_SPEED = {"m": 0.2, "rad": 1.0}
"""Unit → greatest speed of a target that is given neither a duration nor a speed, per second."""


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

    def now(self) -> tuple[Any, Array, Array]:
        """Return target, velocity and acceleration at this time."""
        return self.coordinates.target(*self._trajectory.at(self._elapsed))

    def advance(self, dt: float) -> bool:
        """Go on by a period, s; False if the target had arrived before."""
        arrived = self._elapsed >= self._trajectory.duration - ROUNDING
        self._elapsed += dt
        return not arrived
