"""Force sensor at the wrist of a hand: its tare, and readings that stay out."""

from __future__ import annotations

import logging

import numpy as np

from wbc.base.numbers import Array

logger = logging.getLogger(__name__)

SILENCE = 0.05
"""Time without a reading up to which the last one holds, s."""


class WristSensor:
    """Sensor of the wrench on one hand, without its tare.

    Attributes:
        tare: Reading without a contact, [force; moment] in the frame of the hand, shape (6,), N and Nm: the mean on the
            last way to a point; zero before the first.
        wrench: Last reading less the tare, shape (6,), N and Nm; zero while the sensor is silent.
    """

    def __init__(self, name: str, dt: float) -> None:
        """Begin without a reading of the hand of a name, in ticks of dt, s."""
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
