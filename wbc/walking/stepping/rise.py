"""Limit on the rise of the centre of mass: no foot that stands presses so hard that the robot leaves the ground.

A robot whose hips have no torque left can lift its swing foot by stretching the leg that stands, and what a push has
lifted goes on upwards. Feet cannot pull: from its speed upwards ż the centre of mass is slowed down by a share α of
gravity g at most, so that the room d up to a ceiling bounds the speed,

    ż⁺ ≤ √(2 α g d),        z̈ ≤ (ż⁺ − ż) / t,        z̈ ≥ −α g.

Below the ceiling the limit leaves everything else as it is; beyond it, a part 1 − α of the weight stays on the feet.
"""

from __future__ import annotations

import math

import numpy as np

from wbc.base.numbers import Array
from wbc.core.limits.base import Limit
from wbc.core.robot import GRAVITY, Robot

SHARE, TIME, RECOVERY = 0.5, 0.02, 0.1
"""Share α of gravity by which the rise is slowed down; time t in which the speed is brought within the bound, s; time
constant of the way back from beyond the ceiling, s."""


class RiseLimit(Limit):
    """Limit on the rise of the centre of mass.

    Attributes:
        height: Height about which the centre of mass is held, in the world, m; set in every tick.
        slack: Distance of the ceiling above it, m.
    """

    def __init__(self, slack: float) -> None:
        """Leave a slack, m."""
        self.name, self.dim = "rise of the CoM", 1
        self.slack, self.height = slack, math.inf

    def bind(self, robot: Robot) -> None:
        """Take views of the robot."""
        self._robot, self._base_rotation = robot, robot.data.oMi[1].rotation

    def write(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill the row; see `Limit.write`."""
        robot = self._robot
        lower[0] = -np.inf
        if not math.isfinite(self.height):
            rows[0], upper[0] = 0.0, np.inf
            return
        room, speed = self.height + self.slack - robot.com.item(2), robot.com_velocity.item(2)
        most = math.sqrt(2.0 * SHARE * GRAVITY * room) if room > 0.0 else room / RECOVERY
        bound = max((most - speed) / TIME, -SHARE * GRAVITY)
        # Acceleration of the CoM at zero generalised acceleration: the force on the base rows of the bias, less weight.
        drift = float(self._base_rotation[2].dot(robot.bias[:3])) / robot.mass - GRAVITY
        rows[0] = robot.com_jacobian[2]
        upper[0] = bound - drift
