"""First-order filters with exact steps: their time constants mean the same at any control period."""

from __future__ import annotations

from collections.abc import Sequence

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
    """Exponential moving average of an error, from zero, each component within a bound; in plain numbers.

    Attributes:
        value: Average.
    """

    def __init__(self, time_constant: float, bound: float, size: int) -> None:
        """Start at zero, with a memory of `time_constant` seconds; each of `size` components stays within ± `bound`."""
        self._time_constant, self._bound = time_constant, bound
        self.value = [0.0] * size
        self._gain = LagGain()

    def reset(self) -> None:
        """Set the value to zero."""
        self.value = [0.0] * len(self.value)

    def update(self, error: Sequence[float], dt: float) -> list[float]:
        """Return the average with one more error."""
        self._gain(dt, self._time_constant)
        gain, bound = self._gain.number, self._bound
        self.value = [
            min(max(old + gain * (new - old), -bound), bound)
            for old, new in zip(self.value, error, strict=True)
        ]
        return self.value


class HighPass:
    """First-order high-pass in plain numbers: the input without its low-pass.

    The pendulum gives the derivative of the DCM error as ė = ω (e − e_zmp), at all frequencies but with an offset when
    CoM or force sensors are off; a high-pass takes the offset away.
    """

    def __init__(self, time_constant: float) -> None:
        """Start at zero, with the time constant of the low-pass, s."""
        self._time_constant = non_negative("time constant of a high-pass (s)", time_constant)
        self._low: list[float] | None = None
        self._gain = LagGain()

    def reset(self) -> None:
        """Start over: the next output is zero."""
        self._low = None

    def update(self, u: Sequence[float], dt: float) -> list[float]:
        """Return the output for one more input."""
        if self._low is None:
            self._low = list(u)
        else:
            self._gain(dt, self._time_constant)
            gain = self._gain.number
            self._low = [old + gain * (new - old) for old, new in zip(self._low, u, strict=True)]
        return [new - low for low, new in zip(self._low, u, strict=True)]
