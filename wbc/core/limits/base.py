"""Base of limits: rows over the accelerations with bounds that never contradict each other."""

from __future__ import annotations

import weakref
from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.robot import Reads, Robot

OPTIONS = "it follows from the robot and from the options with which the limit was made: make another limit"
"""Advice in place of an assignment to a bound."""


class Limit(ABC):
    """Base of limits on the generalised acceleration: lower ≤ rows · acceleration ≤ upper.

    Attributes:
        name: Name in status tables and messages.
        dim: Number of rows, fixed once the limit is bound.
        reads: State of the robot that the rows need in inverse kinematics; see `Task`.
        step_unit: Unit of the bounds of `write_step`, for messages.
    """

    reads: ClassVar[Reads] = "all"
    step_unit: ClassVar[str] = ""

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

    def write_step(self, rows: Array, lower: Array, upper: Array) -> None:
        """Fill rows and bounds of a step of the configuration, lower ≤ rows · step ≤ upper, for inverse kinematics.

        The arguments are those of `write`. A step is a velocity times a time, shape (nv,). A limit that does not
        override this method cannot be used in inverse kinematics.
        """
        raise InputError(f"limit '{self.name}' bounds no step of the configuration")

    def violation(self, row: int, size: float) -> str:
        """Return by how much a row of `write_step` is violated, for messages."""
        return f"{size:.3g} {self.step_unit}".rstrip()

    def write_velocity(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill rows and bounds of the velocity for inverse kinematics with a period dt, s; by default, from a step."""
        self.write_step(rows, lower, upper)
        lower /= dt
        upper /= dt


def for_joints(what: str, value: ArrayLike, robot: Robot) -> Array:
    """Return one number for each actuated joint, shape (na,), of one for all or one for each."""
    numbers = np.array(value, dtype=float)
    if numbers.shape not in ((), (robot.na,)):
        raise InputError(f"{what} must be one number or have shape ({robot.na},), got shape {numbers.shape}")
    return np.array(np.broadcast_to(numbers, (robot.na,)))
