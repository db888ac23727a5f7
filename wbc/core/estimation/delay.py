"""Delays of measurements and commands: the state when a command takes effect, the torques when one was measured.

A measurement is `measurement_delay` old when it arrives, and a command takes effect `command_delay` after it was sent.
The commands that act in between are known, and so, by the model, are the accelerations that they cause: the state is
carried ahead with them, from the estimate anew in every tick (O. J. M. Smith's predictor, ISA Journal 6(2), 1959).
"""

from __future__ import annotations

from collections import deque

import numpy as np
import pinocchio as pin

from wbc.base.numbers import ROUNDING, Array
from wbc.core.signals import Command, Measurement


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


class SentCommands:
    """The last commands, for the torque that acted when a measurement was made."""

    def __init__(
        self, gains: tuple[Array, Array] | None, limits: tuple[Array, Array], dt: float, delay: float
    ) -> None:
        """Start without any command, with the least and the greatest torques, each of shape (na,), Nm.

        Gains are kp and kd for commands that bring none, each of shape (na,), zero when None; the delay is the sum of
        those of measurement and command, s.
        """
        whole = int(delay / dt + ROUNDING)
        self._part = max(delay / dt - whole, 0.0)  # of a period, in which an older command still acted
        self._commands: deque[Command] = deque(maxlen=whole + 2)
        none = np.zeros_like(limits[0])
        self._own = (none, none) if gains is None else gains
        self._limits = limits

    def reset(self) -> None:
        """Forget the commands."""
        self._commands.clear()

    def sent(self, command: Command) -> None:
        """Take over the command that is sent now."""
        self._commands.append(command.copy())

    def torque(self, measurement: Measurement) -> Array | None:
        """Return the mean torque in the period before a measurement, shape (na,), Nm; None before there is one."""
        commands = self._commands
        if not commands:
            return None
        if len(commands) < (commands.maxlen or 0):
            return self._applied(commands[0], measurement)
        torque = (1.0 - self._part) * self._applied(commands[1], measurement)
        if self._part > 0.0:
            torque += self._part * self._applied(commands[0], measurement)
        return torque

    def _applied(self, command: Command, measurement: Measurement) -> Array:
        torque = command.drive_torque(measurement.joint_position, measurement.joint_velocity, self._own)
        return np.asarray(np.clip(torque, *self._limits))
