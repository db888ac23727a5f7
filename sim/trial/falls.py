"""Fall test on the true state: height of the CoM and tilt of the base, whatever the controller's estimate says.

The height is that of the CoM: the origin of the base lies in the pelvis of one robot and on the ground of another.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
import pinocchio as pin

from wbc.base.checked import checked
from wbc.base.numbers import Array, finite_array
from wbc.base.settings import Number, Positive, settings
from wbc.core.estimation.falls import FallReason
from wbc.core.robot import Robot

LOWEST_SHARE = 0.7
"""Height of the CoM over that at half-sitting below which a standing robot has fallen. Squats do not go that low."""

LARGEST_TILT = math.radians(60.0)
"""Tilt of the base, against half-sitting, from which no balance controller recovers, rad."""


@settings
class FallSettings:
    """Limits of the true fall test of a walk or of a tracked clip; a small robot's drop is in proportion.

    Attributes:
        drop: Greatest distance of the CoM below its height at the start, m.
        tilt: Greatest angle of the base to its orientation at half-sitting, rad; acos(0.8).
    """

    drop: Annotated[Positive, "m"] = 0.18
    tilt: Annotated[Positive, "rad"] = 0.6435


class TrueFallDetector:
    """Fall test by the true state of a simulation.

    Attributes:
        height: Lowest height of the CoM over the ground, m; that of a robot that stands or squats when None.
        tilt: Largest angle of the base to its orientation at half-sitting, rad; a turn about the vertical is none.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        height: Annotated[Number, "m"] | None = None,
        tilt: Annotated[Positive, "rad"] = LARGEST_TILT,
    ) -> None:
        """Take half-sitting as upright."""
        self._model, self._data = robot.model, robot.model.createData()
        self.height = LOWEST_SHARE * self._com_height(robot.half_sitting) if height is None else height
        self.tilt = tilt
        rotation = np.asarray(pin.Quaternion(robot.half_sitting[3:7]).toRotationMatrix())
        self._up: tuple[float, float, float] = tuple(rotation[2].tolist())
        self._upright = math.cos(tilt)

    def reason(
        self, base: Array | Sequence[float], height: float, up: Array | Sequence[float] | None = None
    ) -> FallReason | None:
        """Return why a robot has fallen, or None if it has not fallen; a state with NaN counts as tilted.

        Args:
            base: True orientation of the base, quaternion xyzw, shape (4,).
            height: True height of the CoM over the ground, m.
            up: Axis in the base frame that is vertical when the robot is upright, for a robot that should bend. When
                None, it is the one that is vertical in half-sitting.
        """
        x, y, z, w = map(float, base)
        a, b, c = self._up if up is None else up
        vertical = a * 2.0 * (x * z - w * y) + b * 2.0 * (y * z + w * x) + c * (1.0 - 2.0 * (x * x + y * y))
        if not vertical >= self._upright * (x * x + y * y + z * z + w * w):
            return FallReason.TILT
        return None if height >= self.height else FallReason.HEIGHT

    def fallen(self, q: Array) -> bool:
        """Return True if a robot on the floor has fallen, by its true configuration, shape (nq,)."""
        q = finite_array("configuration", q, (self._model.nq,), unbounded=True)
        return self.reason(q[3:7], self._com_height(q)) is not None

    def _com_height(self, q: Array) -> float:
        return float(pin.centerOfMass(self._model, self._data, q)[2])
