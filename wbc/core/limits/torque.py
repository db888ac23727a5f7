"""Limits of joint torques."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from wbc.base.checked import checked
from wbc.base.numbers import Array
from wbc.base.settings import PositiveNumbers, Ratio
from wbc.core.limits.base import Limit, for_joints
from wbc.core.robot import Robot


class TorqueLimits(Limit):
    """Bounds of the joint torques and of their rates.

    Attributes:
        previous: Torques of the last tick, shape (na,), Nm; None before the first tick.
    """

    @checked
    def __init__(self, *, ratio: Ratio = 1.0, rate: Annotated[PositiveNumbers, "Nm/s"] | None = None) -> None:
        """Choose the bounds.

        Args:
            ratio: Share of the model's torque limits that may be used, in (0, 1].
            rate: Largest rate of a torque, Nm/s, scalar or shape (na,); unlimited when None.
        """
        self.name, self.dim = "torque limits", 0
        self.previous: Array | None = None
        self._ratio = ratio
        self._rate = rate

    def bind(self, robot: Robot) -> None:
        """Take the limits from the model."""
        self.dim = robot.na
        self.least, self.most = self._ratio * robot.torque_lower, self._ratio * robot.torque_upper
        self.rate: Array | None = None
        if self._rate is not None:
            self.rate = for_joints("rate of torque limits", self._rate, robot)

    def write(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill the torque interval of every joint, Nm; the rows are the torque rows of the QP, and stay as they are."""
        upper[:] = self.most
        lower[:] = self.least
        if self.rate is not None and self.previous is not None:
            before = np.clip(self.previous, lower, upper)
            np.minimum(upper, before + self.rate * dt, out=upper)
            np.maximum(lower, before - self.rate * dt, out=lower)
