"""First-order filters with exact steps: their time constants mean the same at any control period."""

from __future__ import annotations

import numpy as np

from wbc.base.lag import LagGain
from wbc.base.numbers import Array, non_negative


class LowPass:
    """First-order low-pass, y' = (u − y) / T.

    Attributes:
        time_constant: T, s; 0 passes everything.
        value: Output.
    """

    def __init__(self, time_constant: float, shape: int | tuple[int, ...]) -> None:
        """Start at zero."""
        self.time_constant = non_negative("time constant of a low-pass (s)", time_constant)
        self.value: Array = np.zeros(shape)
        self._fresh = True
        self._gain = LagGain()

    def reset(self) -> None:
        """Start over: the next output is the next input."""
        self._fresh = True

    def update(self, u: Array, dt: float) -> Array:
        """Return the output for one more input, which the next call overwrites."""
        if self._fresh:
            self.value[:] = u
            self._fresh = False
        else:
            self.value += self._gain(dt, self.time_constant) * (u - self.value)
        return self.value


class Average:
    """Exponential moving average of an error in the plane, x + i y, from zero; each component within a bound.

    Attributes:
        value: Average.
    """

    def __init__(self, time_constant: float, bound: float) -> None:
        """Start at zero, with a memory of `time_constant` seconds; each component stays within ± `bound`."""
        self._time_constant, self._bound = time_constant, bound
        self.value = 0j
        self._gain = LagGain()

    def reset(self) -> None:
        """Set the value to zero."""
        self.value = 0j

    def update(self, error: complex, dt: float) -> complex:
        """Return the average with one more error."""
        self._gain(dt, self._time_constant)
        value, bound = self.value + self._gain.number * (error - self.value), self._bound
        self.value = complex(min(max(value.real, -bound), bound), min(max(value.imag, -bound), bound))
        return self.value


class HighPass:
    """First-order high-pass of a point in the plane, x + i y: the input without its low-pass.

    The pendulum gives the derivative of the DCM error as ė = ω (e − e_zmp), at all frequencies but with an offset when
    CoM or force sensors are off; a high-pass takes the offset away.
    """

    def __init__(self, time_constant: float) -> None:
        """Start at zero, with the time constant of the low-pass, s."""
        self._time_constant = non_negative("time constant of a high-pass (s)", time_constant)
        self._low: complex | None = None
        self._gain = LagGain()

    def reset(self) -> None:
        """Start over: the next output is zero."""
        self._low = None

    def update(self, u: complex, dt: float) -> complex:
        """Return the output for one more input."""
        if self._low is None:
            self._low = u
        else:
            self._gain(dt, self._time_constant)
            self._low += self._gain.number * (u - self._low)
        return u - self._low
