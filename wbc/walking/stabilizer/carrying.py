"""The part of a sole that really carries: on a stone the CoP cannot go where the rectangle would let it.

Each edge of the rectangle starts where the sole ends. While the foot tips over an edge — it turns outwards while
it is loaded, and the CoP is what it tips about — the edge is drawn in to the CoP; afterwards it moves back out
slowly, so that ground that has been lost is tried again. The distribution of wrenches takes the rectangle as its
bound (`wbc.walking.stabilizer.distribution`).
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from wbc.core.errors import Array, InputError, non_negative, positive
from wbc.walking.stabilizer.distribution import Rectangle
from wbc.walking.stabilizer.filters import LowPass


@dataclass(frozen=True)
class CarryingSettings:
    """When an edge is taken for lost, and how it comes back.

    Attributes:
        min_load: Normal force below which nothing is learnt, N.
        tip_rate: Angular speed over an edge from which the foot tips, rad/s.
        margin: How far beyond the CoP that it tips about the edge is believed, m.
        smallest: Least half extent of the rectangle, m.
        recovery: Speed at which an edge comes back, m/s.
        filter_time: Low-pass of CoP and angular velocity, s.
        settling: Time under load before anything is learnt, s: a foot that has just met the ground turns until it lies
            on it, which looks like tipping the other way.
    """

    min_load: float = 50.0
    tip_rate: float = 0.15
    margin: float = 0.005
    smallest: float = 0.01
    recovery: float = 0.05
    filter_time: float = 0.02
    settling: float = 0.2

    def __post_init__(self) -> None:
        for field in fields(self):
            check = positive if field.name in ("tip_rate", "smallest") else non_negative
            check(f"{field.name} of the carrying area", getattr(self, field.name))


class CarryingArea:
    """Carrying rectangle of one sole.

    Attributes:
        settings: Settings.
    """

    def __init__(self, size: tuple[float, float], settings: CarryingSettings | None = None) -> None:
        """Believe in the whole sole.

        Args:
            size: Length and width of the sole, m.
            settings: Settings; the defaults when None.

        Raises:
            InputError: A sole smaller than the smallest rectangle.
        """
        self.settings = settings or CarryingSettings()
        self._half = 0.5 * np.array(size, dtype=float)
        if (self._half < self.settings.smallest).any():
            raise InputError(
                f"a sole of {size[0]:g} × {size[1]:g} m is smaller than the smallest carrying area, half "
                f"{self.settings.smallest:g} m"
            )
        self._low, self._high = -self._half, self._half.copy()
        self._signal = LowPass(self.settings.filter_time, 4)
        self._loaded = 0.0  # for how long, s

    @property
    def rectangle(self) -> Rectangle:
        """Least and greatest x, least and greatest y in the sole frame, m."""
        return float(self._low[0]), float(self._high[0]), float(self._low[1]), float(self._high[1])

    def reset(self) -> None:
        """Believe in the whole sole again: it has left the ground."""
        self._low, self._high = -self._half, self._half.copy()
        self._signal.reset()
        self._loaded = 0.0

    def update(self, wrench: Array, angular_velocity: Array, dt: float) -> Rectangle:
        """Take in one measurement.

        Args:
            wrench: What the ground does to the sole, [force; moment] in the sole frame, shape (6,), N and Nm.
            angular_velocity: Of the sole against the world, in the sole frame, shape (3,), rad/s.
            dt: Period, s.

        Returns:
            The carrying rectangle.
        """
        s = self.settings
        step = s.recovery * dt
        self._low = np.maximum(self._low - step, -self._half)
        self._high = np.minimum(self._high + step, self._half)
        force = float(wrench[2])
        if force < max(s.min_load, 1e-6):
            self._signal.reset()
            return self.rectangle
        self._loaded += dt
        signal = self._signal.update(
            np.array([-wrench[4] / force, wrench[3] / force, angular_velocity[1], -angular_velocity[0]]), dt
        )
        if self._loaded < s.settling:
            return self.rectangle
        # Positive tipping: over the toe about +y, over the left edge about −x.
        point, tipping = np.clip(signal[:2], -self._half, self._half), signal[2:]
        over_high, over_low = tipping > s.tip_rate, tipping < -s.tip_rate
        self._high = np.where(over_high, np.minimum(self._high, point + s.margin), self._high)
        self._low = np.where(over_low, np.maximum(self._low, point - s.margin), self._low)
        # What is left is never smaller than the smallest rectangle, and stays inside the sole.
        thin = self._high - self._low < 2.0 * s.smallest
        middle = np.clip(0.5 * (self._high + self._low), s.smallest - self._half, self._half - s.smallest)
        self._low = np.where(thin, middle - s.smallest, self._low)
        self._high = np.where(thin, middle + s.smallest, self._high)
        return self.rectangle
