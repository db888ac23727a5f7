"""First-order filters with exact steps: their time constants mean the same at any control period."""

from __future__ import annotations

import math

import numpy as np

from wbc.core.errors import Array, non_negative
from wbc.core.lag import LagGain


def clamp(value: Array, bound: float) -> None:
    """Cut each component off at ±bound, in place."""
    if max(map(abs, value.tolist())) > bound:  # hardly ever, and quicker to see than to clip
        np.clip(value, -bound, bound, out=value)


class LowPass:
    """First-order low-pass, y' = (u − y) / T.

    Attributes:
        time_constant: T, s; 0 passes everything.
        value: Output.
    """

    def __init__(self, time_constant: float, shape: int | tuple[int, ...]) -> None:
        """Start at zero.

        Raises:
            InputError: A time constant that is negative or not finite.
        """
        self.time_constant = non_negative("time constant of a low-pass (s)", time_constant)
        self.value: Array = np.zeros(shape)
        self._fresh = True
        self._gain = LagGain()

    def reset(self) -> None:
        """Start over: the next input is taken as it is."""
        self._fresh = True

    def update(self, u: Array, dt: float) -> Array:
        """Take in one input and return the output, which the next call overwrites."""
        if self._fresh:
            self.value[:] = u
            self._fresh = False
        else:
            self.value += self._gain(dt, self.time_constant) * (u - self.value)
        return self.value


class Average:
    """Exponential moving average of an error, from zero, each component within a bound.

    Attributes:
        value: Average.
    """

    def __init__(self, time_constant: float, bound: float, size: int) -> None:
        """Start at zero.

        Args:
            time_constant: Memory, s.
            bound: Greatest magnitude of a component.
            size: Number of components.
        """
        self._time_constant, self._bound = time_constant, bound
        self.value: Array = np.zeros(size)
        self._gain = LagGain()

    def reset(self) -> None:
        """Forget everything."""
        self.value[:] = 0.0

    def update(self, error: Array, dt: float) -> Array:
        """Take in one error and return the average, which the next call overwrites."""
        self.value += self._gain(dt, self._time_constant) * (error - self.value)
        clamp(self.value, self._bound)
        return self.value


class LeakyIntegral:
    """Integral that forgets, I' = u − leak · I, each component within a bound.

    Attributes:
        value: Integral.
    """

    def __init__(self, leak: float, bound: float, size: int) -> None:
        """Start at zero.

        Args:
            leak: Rate of forgetting, 1/s; 0 forgets nothing.
            bound: Greatest magnitude of a component.
            size: Number of components.
        """
        self._leak, self._bound = leak, bound
        self.value: Array = np.zeros(size)

    def reset(self) -> None:
        """Forget everything."""
        self.value[:] = 0.0

    def update(self, rate: Array | float, dt: float) -> Array:
        """Take in one rate and return the integral, which the next call overwrites."""
        if self._leak > 0.0:
            kept = math.exp(-self._leak * dt)
            self.value *= kept
            self.value += (1.0 - kept) / self._leak * np.asarray(rate)
        else:
            self.value += dt * np.asarray(rate)
        clamp(self.value, self._bound)
        return self.value


class Derivator:
    """Derivative of the DCM error from the pendulum's model, without its constant part.

    The model says ė = ω (e − e_zmp), at all frequencies but with an offset when CoM or force sensors are off; a
    low-pass of it is taken away. Where the derivative is measured as well, its own low-pass is put there instead
    (a complementary filter: model above, measurement below).

    Attributes:
        value: Derivative.
    """

    def __init__(self, time_constant: float, size: int) -> None:
        """Start at zero.

        Args:
            time_constant: Split between measurement and model, s.
            size: Number of components.
        """
        self._slow_model = LowPass(time_constant, size)
        self._slow_measured = LowPass(time_constant, size)
        self.value: Array = np.zeros(size)

    def reset(self) -> None:
        """Start over from zero."""
        self._slow_model.reset()
        self._slow_measured.reset()
        self.value[:] = 0.0

    def update(self, model: Array, measured: Array | None, dt: float) -> Array:
        """Take in both derivatives and return the result, which the next call overwrites."""
        np.subtract(model, self._slow_model.update(model, dt), out=self.value)
        if measured is not None:
            self.value += self._slow_measured.update(measured, dt)
        return self.value
