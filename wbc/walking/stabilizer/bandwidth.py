"""How fast the CoP follows: the bandwidth from which the stabilizer's gain and the lead of the ZMP are chosen.

With ż = λ (z_d − z) the measured ZMP z lags behind the desired one by 1/λ. λ is found by least squares over a
sliding memory; `wbc.walking.stabilizer.gains.dcm_gain` turns it into the greatest damped gain, and 1/λ is the lead
`zmp_d` that takes the lag out of the pattern.
"""

from __future__ import annotations

import math

import numpy as np

from wbc.core.errors import Array, InputError, finite_array, positive
from wbc.core.lag import lag_gain


class CopBandwidth:
    """Recursive estimate with exponential forgetting.

    Both sides of the lag are passed through one low-pass, so that no derivative is taken, and fitted by a line
    with an intercept, so that an offset between the two signals does not count.
    """

    def __init__(self, memory: float = 10.0, window: float = 0.1) -> None:
        """Start without knowledge.

        Args:
            memory: Time after which what was seen is forgotten, s.
            window: Time constant of the filter that stands for the derivative, s; of the order of the lag.

        Raises:
            InputError: A time that is not above zero.
        """
        self._memory = positive("memory of the bandwidth estimate (s)", memory)
        self._window = positive("window of the bandwidth estimate (s)", window)
        self._slow_desired: Array | None = None
        self._slow_measured: Array = np.zeros(2)
        self._sums: Array = np.zeros((5, 2))  # 1, gap, rate, gap², gap · rate

    @property
    def value(self) -> float | None:
        """λ, 1/s; None before there has been any motion to tell it from."""
        weight, gap, rate, square, product = self._sums
        if weight[0] <= 0.0:
            return None
        spread = float((square - gap * gap / weight).sum())
        if spread <= 1e-9 * weight[0]:  # 30 µm
            return None
        return max(0.0, float((product - gap * rate / weight).sum()) / spread)

    def update(self, desired: Array, measured: Array, dt: float) -> float | None:
        """Take in one sample.

        Args:
            desired: Desired ZMP, shape (2,) or longer, m.
            measured: Measured ZMP, of the same shape, m.
            dt: Period, s.

        Returns:
            λ, 1/s, or None.
        """
        desired, measured = np.asarray(desired, dtype=float)[:2], np.asarray(measured, dtype=float)[:2]
        if not (np.isfinite(desired).all() and np.isfinite(measured).all()):
            return self.value
        if self._slow_desired is None:
            self._slow_desired, self._slow_measured = desired.copy(), measured.copy()
            return None
        gain = lag_gain(dt, self._window)
        # d/dt filtered by 1/(w s + 1) is (z − slow z)/w: the same filter on both sides of ż = λ (z_d − z).
        rate = (measured - self._slow_measured) / self._window
        gap = self._slow_desired - self._slow_measured
        self._slow_desired += gain * (desired - self._slow_desired)
        self._slow_measured += gain * (measured - self._slow_measured)
        self._sums *= math.exp(-dt / self._memory)
        self._sums += dt * np.array([np.ones(2), gap, rate, gap * gap, gap * rate])
        return self.value


def cop_bandwidth(desired: Array, measured: Array, dt: float) -> float:
    """Bandwidth of the CoP over a whole record.

    Args:
        desired: Desired ZMP, shape (n, 2), m.
        measured: Measured ZMP, shape (n, 2), m.
        dt: Period, s.

    Returns:
        λ, 1/s.

    Raises:
        InputError: Records of different length, or without motion.
    """
    desired, measured = finite_array("desired ZMP (m)", desired), finite_array("measured ZMP (m)", measured)
    if desired.shape != measured.shape or desired.ndim != 2:
        raise InputError(f"ZMP records must have one shape (n, 2), got {desired.shape} and {measured.shape}")
    estimate = CopBandwidth(memory=1e6)
    for a, b in zip(desired, measured, strict=True):
        estimate.update(a, b, dt)
    if estimate.value is None:
        raise InputError("no bandwidth can be told from a ZMP that never moves")
    return estimate.value
