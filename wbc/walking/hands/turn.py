"""Turn by the gyroscope alone: where the robot looks, though its feet have slipped.

The estimate of the attitude (`wbc.core.estimation.inertial`) takes the heading from the feet, which hold it without
drift while they do not slip. A robot that turns something heavy slips by degrees in each step. Over a minute the
integrated gyroscope is better, once its bias has been averaged at rest.
"""

from __future__ import annotations

from wbc.base.numbers import Array

LEAST = 0.5
"""Time at rest from which a mean counts as the bias of the gyroscope, s."""


class GyroTurn:
    """Turn about the vertical since the start.

    Attributes:
        angle: Turn since the start, rad.
        bias: Bias of the gyroscope about the vertical, rad/s; zero before the robot has been at rest for 0.5 s.
    """

    def __init__(self) -> None:
        """Start at zero."""
        self.angle = self.bias = 0.0
        self._sum, self._rest = 0.0, 0.0

    def update(self, gyro: Array, vertical: Array, rests: bool, dt: float) -> None:
        """Advance by one period, s, with the gyroscope, rad/s, and the vertical in its frame, each of shape (3,).

        `rests` is True while the robot does not turn: its mean then is the bias.
        """
        rate = float(gyro.dot(vertical))
        if not rests:
            self._sum = self._rest = 0.0
            self.angle += (rate - self.bias) * dt
            return
        self._sum, self._rest = self._sum + rate * dt, self._rest + dt
        if self._rest >= LEAST:
            self.bias = self._sum / self._rest
