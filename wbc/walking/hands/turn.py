"""Slip of the feet by the gyroscope: where the robot looks, though its feet have slipped.

The estimate of the attitude (`wbc.core.estimation.inertial`) takes the heading from the feet, which hold it without
drift while they do not slip. A robot that turns something heavy slips by degrees in each step. Over a minute the
integrated gyroscope is better, once its bias has been averaged at rest.
"""

from __future__ import annotations

from wbc.base.numbers import Array

LEAST = 0.5
"""Time at rest from which a mean counts as the bias of the gyroscope, s."""


class GyroSlip:
    """Turn of a link by the gyroscope on it, less that by the estimate, since the start.

    Attributes:
        angle: Turn of the feet about the vertical that the estimate lacks, rad.
        bias: Bias of the gyroscope about the vertical, rad/s; zero before the robot has been at rest for 0.5 s.
    """

    def __init__(self) -> None:
        """Start at zero."""
        self.angle = self.bias = 0.0
        self._sum, self._rest = 0.0, 0.0

    def update(self, gyro: Array, vertical: Array, turned: float, rests: bool, dt: float) -> None:
        """Advance by one period, s, with the gyroscope, rad/s, and the vertical in its frame, each of shape (3,).

        The estimate has `turned` the link about the vertical in this period, rad. `rests` is True while the feet do not
        turn: the mean of the difference then is the bias.
        """
        off = float(gyro.dot(vertical)) * dt - turned
        if not rests:
            self._sum = self._rest = 0.0
            self.angle += off - self.bias * dt
            return
        self._sum, self._rest = self._sum + off, self._rest + dt
        if self._rest >= LEAST:
            self.bias = self._sum / self._rest
