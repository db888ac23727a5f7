"""Delays of measurements and commands: the state when a command takes effect.

A measurement is `measurement_delay` old when it arrives, and a command takes effect `command_delay` after it was sent.
The commands that act in between are known, and so, by the model, are the accelerations that they cause: the state is
carried ahead with them, from the estimate anew in every tick (O. J. M. Smith's predictor, ISA Journal 6(2), 1959).
"""

from __future__ import annotations

from collections import deque

import numpy as np
import pinocchio as pin

from wbc.base.numbers import ROUNDING, Array


class DelayPredictor:
    """Carries a state ahead by the sum of both delays, with the accelerations commanded meanwhile."""

    def __init__(self, model: pin.Model, delay: float) -> None:
        """Start at rest; the delay is the sum of those of measurement and command, s."""
        self._model, self._delay = model, delay
        self._sent: deque[tuple[Array, float]] = deque()
        self._covered = 0.0
        self._step, self._v = np.zeros(model.nv), np.zeros(model.nv)

    def reset(self) -> None:
        """Forget the accelerations: the robot is at rest."""
        self._sent.clear()
        self._covered = 0.0

    def commanded(self, acceleration: Array, dt: float) -> None:
        """Take over the acceleration, shape (nv,), of the command that is sent now and valid for dt, s."""
        self._sent.append((acceleration, dt))
        self._covered += dt
        while self._covered - self._sent[0][1] >= self._delay - ROUNDING:
            self._covered -= self._sent.popleft()[1]

    def ahead(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return configuration and velocity, shapes (nq,) and (nv,), after the delay from those at the measurement."""
        step, velocity = self._step, self._v
        np.multiply(v, self._delay, out=step)
        velocity[:] = v
        left = min(self._covered, self._delay)  # of the delay, from when each command begins to act
        surplus = self._covered - left
        for acceleration, dt in self._sent:
            acts = dt - surplus
            surplus = 0.0
            velocity += acts * acceleration
            step += acts * (left - 0.5 * acts) * acceleration
            left -= acts
        return pin.integrate(self._model, q, step), velocity
