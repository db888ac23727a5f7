"""Lean of the trunk: for a short time it supplies the moment that the feet cannot give.

Where the CoP cannot go further, the distribution of wrenches has a shortfall m of the moment about the desired ZMP. The
reaction to a trunk that accelerates the other way gives this moment (the hip strategy):

    I φ̈ = −m − I (2 ζ √k φ̇ + k φ),   |φ| ≤ φ_max,

with φ the lean about the horizontal axes of the world and I the moment for a unit of acceleration. That is as if the
support were wider by up to I φ_max / (m_robot h), until the trunk comes back upright.

Source: B. Stephens, "Humanoid push recovery", Humanoids 2007; A. Hofmann, M. Popovic, H. Herr, "Exploiting angular
momentum to enhance bipedal center-of-mass control", ICRA 2009. The spring is ours.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
import pinocchio as pin
from pydantic import Field

from wbc.base.numbers import Array
from wbc.base.settings import Positive, settings
from wbc.core.robot import GRAVITY

DEAD_BAND = 0.002
"""Missing moment that causes no lean, over m g h."""

STILL_ANGLE = 1e-4
"""Lean below which a trunk without a missing moment is upright, rad."""

STILL_SPEED = 1e-3
"""Speed below which such a trunk rests, rad/s."""


@settings
class LeanSettings:
    """Settings of the lean of the trunk.

    Attributes:
        inertia: I over m h², with the mass of the robot and the height of its CoM; with a smaller value the
            trunk leans more for the same moment.
        stiffness: Stiffness k of the spring that brings the trunk back, 1/s².
        damping: Damping ratio ζ of the spring.
        limit: Greatest lean about each axis, φ_max, rad.
        braking: Deceleration before the limit, rad/s².
    """

    inertia: Positive = 0.06
    stiffness: Annotated[Positive, "1/s²"] = 25.0
    damping: Positive = 0.7
    limit: Annotated[float, Field(gt=0.0, le=1.5), "rad"] = 0.4
    braking: Annotated[Positive, "rad/s²"] = 60.0


class LeanMotion(NamedTuple):
    """A lean at one instant, in the world."""

    rotation: Array  # from the upright trunk to the leaning one, shape (3, 3)
    velocity: Array  # angular velocity, shape (3,), rad/s
    acceleration: Array  # angular acceleration, shape (3,), rad/s²


UPRIGHT = LeanMotion(np.eye(3), np.zeros(3), np.zeros(3))


class Lean:
    """Lean of one trunk.

    Attributes:
        settings: Its `LeanSettings`.
        angle: Lean about x and y, rad.
        speed: Derivative of the lean, rad/s.
    """

    def __init__(self, mass: float, height: float, settings: LeanSettings | None = None) -> None:
        """Stand upright; mass of the robot, kg, and height of the CoM over the support, m, are above zero."""
        self.settings = settings or LeanSettings()
        self._height = height
        self.set_mass(mass)
        self.angle = self.speed = (0.0, 0.0)

    def set_mass(self, mass: float) -> None:
        """Set the mass of the robot with its load, kg, above zero."""
        s = self.settings
        first_moment = mass * self._height
        self._inertia = s.inertia * first_moment * self._height
        self._dead_band = DEAD_BAND * first_moment * GRAVITY

    def update(self, missing: tuple[float, float], dt: float) -> LeanMotion:
        """Integrate over one period, s, and return the lean at its end; `UPRIGHT` itself when there is none.

        `missing` is the desired moment that the feet do not give, about the horizontal axes of the world, Nm.
        """
        if math.hypot(*missing) < self._dead_band:
            missing = (0.0, 0.0)
            if max(map(abs, self.angle)) < STILL_ANGLE and max(map(abs, self.speed)) < STILL_SPEED:
                self.angle = self.speed = missing
                return UPRIGHT
        (x, wx, ax), (y, wy, ay) = (
            self._moved(*axis, dt) for axis in zip(self.angle, self.speed, missing, strict=True)
        )
        self.angle, self.speed = (x, y), (wx, wy)
        # For leans of half a radian and less the rates of the angles are those of the rotation.
        rotation = np.array(pin.exp3(np.array((x, y, 0.0))))
        return LeanMotion(rotation, np.array((wx, wy, 0.0)), np.array((ax, ay, 0.0)))

    def _moved(self, angle: float, speed: float, missing: float, dt: float) -> tuple[float, float, float]:
        """Angle, speed and acceleration about one axis after a period; the trunk can always brake before its limit."""
        s = self.settings
        push = -missing / self._inertia
        free = speed + dt * (push - 2.0 * s.damping * math.sqrt(s.stiffness) * speed - s.stiffness * angle)
        after = angle + dt * free
        highest = math.sqrt(2.0 * s.braking * max(0.0, s.limit - after))
        lowest = -math.sqrt(2.0 * s.braking * max(0.0, s.limit + after))
        reached = min(max(free, lowest), highest)
        return angle + dt * reached, reached, (reached - speed) / dt
