"""Base of limits: rows over the accelerations with bounds that never contradict each other."""

from __future__ import annotations

import weakref
from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wbc.core.errors import Array, InputError
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


def for_joints(what: str, value: ArrayLike, robot: Robot) -> Array:
    """Return one number for each actuated joint, shape (na,), of one for all or one for each."""
    numbers = np.array(value, dtype=float)
    if numbers.shape not in ((), (robot.na,)):
        raise InputError(f"{what} must be one number or have shape ({robot.na},), got shape {numbers.shape}")
    return np.array(np.broadcast_to(numbers, (robot.na,)))
