"""Fall test on the true state: height and tilt of the pelvis, whatever the controller's estimate says."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
import pinocchio as pin

from wbc.core.checked import checked
from wbc.core.errors import Array
from wbc.core.estimation.falls import FallReason
from wbc.core.robot import Robot
from wbc.core.settings import Number, Positive, settings

LOWEST_SHARE = 0.7
"""Pelvis height over that at half-sitting below which a standing robot has fallen. Squats do not go that low."""

LARGEST_TILT = math.radians(60.0)
"""Tilt of the pelvis, against half-sitting, from which no balance controller recovers, rad."""


@settings
class FallSettings:
    """Limits of the true fall test of a walk or of a tracked clip; a small robot's drop is in proportion.

    Attributes:
        drop: Greatest distance of the pelvis below its height at the start, m.
        tilt: Greatest angle of the pelvis to its orientation at half-sitting, rad; acos(0.8).
    """

    drop: Annotated[Positive, "m"] = 0.18
    tilt: Annotated[Positive, "rad"] = 0.6435


@settings
class PelvisLimits:
    """Limits of the pelvis beyond which a robot has fallen.

    Attributes:
        height: Lowest height over the ground, m.
        tilt: Largest angle to its orientation at half-sitting, rad; a turn about the vertical is none.
    """

    height: Annotated[Number, "m"]
    tilt: Annotated[Positive, "rad"] = LARGEST_TILT


class TrueFallDetector:
    """Fall test on the true configuration.

    Attributes:
        limits: Limits of the pelvis.
    """

    @checked
    def __init__(self, robot: Robot, limits: PelvisLimits | None = None) -> None:
        """Take half-sitting as upright; limits of a robot that stands or squats, whose feet may slide, when None."""
        self.limits = limits or PelvisLimits(LOWEST_SHARE * float(robot.half_sitting[2]))
        rotation = np.asarray(pin.Quaternion(robot.half_sitting[3:7]).toRotationMatrix())
        self._up: tuple[float, float, float] = tuple(rotation[2].tolist())
        self._upright = math.cos(self.limits.tilt)

    def reason(
        self,
        q: Array | Sequence[float],
        ground: float = 0.0,
        up: Array | Sequence[float] | None = None,
    ) -> FallReason | None:
        """Return why a robot has fallen, None if it has not; a configuration with NaN counts as tilted.

        Args:
            q: True configuration, shape (nq,), or its first seven values: position and orientation of the base.
            ground: Height of the ground, m.
            up: Axis of the base, in its own frame, that is vertical when the robot is upright, for a robot that is
                to bend; that of half-sitting when None.
        """
        x, y, z, w = (float(value) for value in q[3:7])
        a, b, c = self._up if up is None else up
        vertical = a * 2.0 * (x * z - w * y) + b * 2.0 * (y * z + w * x) + c * (1.0 - 2.0 * (x * x + y * y))
        if not vertical >= self._upright * (x * x + y * y + z * z + w * w):
            return FallReason.TILT
        return None if q[2] - ground >= self.limits.height else FallReason.HEIGHT

    def fallen(self, q: Array | Sequence[float]) -> bool:
        """Return True if a robot on the floor has fallen, by its true configuration, shape (nq,)."""
        return self.reason(q, 0.0) is not None
