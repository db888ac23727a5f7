"""Base of limits: rows over the accelerations with bounds that never contradict each other."""

from __future__ import annotations

import weakref
from abc import ABC, abstractmethod
from typing import Any

from wbc.core.errors import Array
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
