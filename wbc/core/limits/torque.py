"""Limits of joint torques."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from wbc.base.checked import checked, result
from wbc.base.numbers import Array
from wbc.base.settings import PositiveNumbers, Ratio
from wbc.core.limits.base import OPTIONS, Limit, for_joints
from wbc.core.robot import Robot


class TorqueLimits(Limit):
    """Bounds of the joint torques and of their rates.

    Attributes:
        least, most: Bounds of the torques, shape (na,), Nm; read-only, known once a controller has the limits.
        rate: Greatest rates of the torques, shape (na,), Nm/s, read-only; None for none.
    """

    least: Array = result("_least", OPTIONS)
    most: Array = result("_most", OPTIONS)
    rate: Array | None = result("_most_rate", OPTIONS)

    @checked
    def __init__(self, *, ratio: Ratio = 1.0, rate: Annotated[PositiveNumbers, "Nm/s"] | None = None) -> None:
        """Choose the bounds.

        Args:
            ratio: Share of the model's torque limits that may be used, in (0, 1].
            rate: Largest rate of a torque, Nm/s, scalar or shape (na,); unlimited when None.
        """
        self.name, self.dim = "torque limits", 0
        self._ratio = ratio
        self._rate = rate

    @checked
    def bind(self, robot: Robot) -> None:
        """Take the limits from the model."""
        self.dim = robot.na
        self._least, self._most = self._ratio * robot.torque_lower, self._ratio * robot.torque_upper
        self._most_rate: Array | None = None
        if self._rate is not None:
            self._most_rate = for_joints("rate of torque limits", self._rate, robot)

    def write(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill the torque interval of every joint, Nm; the rows are the torque rows of the QP, and stay as they are."""
        self.interval(dt, None, lower, upper)

    def interval(self, dt: float, previous: Array | None, lower: Array, upper: Array) -> None:
        """Fill the torque interval of every joint, Nm.

        Args:
            dt: Control period, s.
            previous: Torques of the last tick, shape (na,), Nm; None before the first tick.
            lower: To fill, shape (na,).
            upper: To fill, shape (na,).
        """
        upper[:] = self._most
        lower[:] = self._least
        if self._most_rate is not None and previous is not None:
            before = np.clip(previous, lower, upper)
            np.minimum(upper, before + self._most_rate * dt, out=upper)
            np.maximum(lower, before - self._most_rate * dt, out=lower)
