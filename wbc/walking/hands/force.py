"""Force on a hand: the sensor at its wrist, and the force with which it presses, with its help for the balance."""

from __future__ import annotations

import logging
import math

import numpy as np

from wbc.base.numbers import ROUNDING, Array
from wbc.core.trajectories import Ramp

logger = logging.getLogger(__name__)

SILENCE = 0.05
"""Time without a reading up to which the last one holds, s."""

HELP_TIME = 0.02
"""Time constant with which hands take over a moment that the feet cannot give, s."""

HELP_LEAK = 0.05
"""Ratio l of their help by which hands reduce it in each `HELP_TIME`, so that it ends once the feet give all moment."""

BOUNDED = 1.0
"""Lack of force from which on an arm counts as too weak, N."""

LOSS, LOSS_TIME = 0.3, 0.02
"""Ratio of measured to planned force below which a contact is lost after a time, and that time, s."""


class WristSensor:
    """Sensor of the wrench on one hand, without its tare.

    Attributes:
        tare: Reading without a contact, [force; moment] in the frame of the hand, shape (6,), N and Nm: the mean on the
            last way to a point; zero before the first.
        wrench: Last reading less the tare, shape (6,), N and Nm; zero while the sensor is silent.
    """

    def __init__(self, name: str, dt: float) -> None:
        """Take the name of the hand, and the period of its ticks, s."""
        self._name, self._dt = name, dt
        self._reading, self.tare, self.wrench = np.zeros(6), np.zeros(6), np.zeros(6)
        self._learnt = 0.0  # time of the readings of which the tare is the mean, s
        self.listen()

    @property
    def silent(self) -> bool:
        """True once no reading has come for `SILENCE`."""
        return self._missing > SILENCE

    def listen(self) -> None:
        """Count the time without a reading anew."""
        self._missing = 0.0  # time since the last reading, s

    def forget(self) -> None:
        """Begin a new tare at zero."""
        self.tare, self._learnt = np.zeros(6), 0.0

    def take(self, reading: Array | None) -> None:
        """Take a reading, shape (6,), N and Nm; None or NaN is none."""
        if reading is not None and np.isfinite(reading).all():
            self._reading[:], self._missing = reading, 0.0
        else:
            told, self._missing = self.silent, self._missing + self._dt
            if self.silent:
                self._reading[:] = self.tare
                if not told:
                    logger.error("%s: no reading of its force sensor for %.3f s", self._name, self._missing)
        self.wrench = self._reading - self.tare

    def learn(self, most: float) -> None:
        """Count the wrench as part of the tare, if it has just been read and its force is no touch, below `most`, N."""
        if self._missing > 0.0:
            return
        self._learnt += self._dt
        share = self._dt / self._learnt  # 1 for the first reading, whose offset may be more than a touch
        if share == 1.0 or float(np.linalg.norm(self.wrench[:3])) < most:
            self.tare += share * self.wrench


class PressForce:
    """Force of one hand that presses, along its direction.

    Attributes:
        ramp: The force that is asked for, N.
        extra: Force for the balance on top of it, N.
    """

    def __init__(self, start: float = 0.0) -> None:
        """Begin with a force, N."""
        self.ramp, self.extra = Ramp(start), 0.0
        self._most = math.inf  # force that the arm has, N
        self._lacked = 0.0  # time for which the measured force has been too small, s

    @property
    def planned(self) -> float:
        """The force that is asked for, limited to what the arm gives, N."""
        return min(self.ramp.value, self._most)

    def planned_after(self, time: float) -> float:
        """Return the planned force after a time, s, N."""
        return min(self.ramp.after(time), self._most)

    @property
    def total(self) -> float:
        """Planned force plus the one for the balance, N."""
        return self.planned + self.extra

    def help(self, lack: float, dt: float) -> None:
        """Change the force e for the balance for a period dt, s, while the feet lack a force of the hand, N.

        The lack is what remains beside the help that is given: ė = (lack − l e) / T, with T = `HELP_TIME` and the leak
        l = `HELP_LEAK`. A lack that stays would lead to e = lack / l.
        """
        self.extra += dt / HELP_TIME * (lack - HELP_LEAK * self.extra)

    def fade(self, duration: float) -> None:
        """Reduce the force to zero within a time, s."""
        self.ramp = Ramp(self.planned)
        self.ramp.to(0.0, duration)

    def advance(self, given: float, asked: float, dt: float, *, ends: bool) -> bool:
        """Move on by a period dt, s, after the QP has given a force for the one that it was asked for, N.

        The force for the balance `ends` with the one that is asked for. The answer is True if the arm is too weak.
        """
        weak = given < asked - BOUNDED
        self._most = given if weak else math.inf
        before = self.ramp.value
        self.ramp.advance(dt)
        if ends:
            self.extra *= self.ramp.value / max(before, ROUNDING)
        return weak

    def is_lost(self, pressed: float, touch: float, dt: float) -> bool:
        """Return True once a measured force has been too small for `LOSS_TIME`; no more than two touches are lost."""
        least = min(self.planned, self.total)
        short = pressed < LOSS * least and least > 2.0 * touch
        self._lacked = self._lacked + dt if short else 0.0
        return self._lacked > LOSS_TIME + ROUNDING

    def asked(self, touch: float) -> float:
        """Return the force to ask the QP for, N: with help that keeps the contact, and that the arm can give."""
        least = min(0.0, touch - self.planned)
        self.extra = min(max(self.extra, least), self._most - self.planned)
        return self.ramp.value + self.extra
