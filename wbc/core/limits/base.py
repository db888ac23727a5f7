"""Base of limits: rows over the accelerations with bounds that never contradict each other."""

from __future__ import annotations

import weakref
from abc import ABC, abstractmethod
from typing import Any

from wbc.core.errors import Array, positive
from wbc.core.robot import Robot


class Limit(ABC):
    """Base of limits: lower ≤ rows · acceleration ≤ upper.

    Attributes:
        name: Name in status tables and messages.
        dim: Number of rows, fixed once the limit is bound.
    """

    name: str
    dim: int
    _owner: weakref.ref[Any] | None = None

    @abstractmethod
    def bind(self, robot: Robot) -> None:
        """Resolve names against the robot."""

    @abstractmethod
    def write(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill the rows.

        Args:
            dt: Control period, s.
            rows: To fill, shape (dim, nv); the same array at every tick, zero at first.
            lower: To fill, shape (dim,); −inf where there is no bound.
            upper: To fill, shape (dim,); inf where there is no bound.
        """


def damped_bound(distance: Array, velocity: Array, dt: float, time_constant: float) -> Array:
    """Return the greatest acceleration towards a bound with which the speed is distance / time constant at most.

    The distance to the bound is negative beyond it, from where the bound leads back; the velocity is towards it; both,
    and the acceleration, have shape (n,). Control period and time constant are in s.

    Source: velocity damper of Faverjon & Tournassoud, ICRA 1987, held at the end of the period.
    """
    return (distance / time_constant - velocity) / dt


def limit_time_constant(value: float) -> float:
    """Return the time constant of a damped limit, s, after a check that it is positive."""
    return positive("time constant of a limit (s)", value)
