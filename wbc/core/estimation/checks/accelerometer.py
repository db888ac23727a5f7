"""Check of the accelerometer against attitude, legs and ground forces, in every tick: it changes what is used."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import NamedTuple

from wbc.base.numbers import lag_gain
from wbc.base.vectors import Vector
from wbc.core.estimation.observer import Observer
from wbc.core.robot import GRAVITY
from wbc.core.signals import Measurement

logger = logging.getLogger(__name__)


class AccelerometerThresholds(NamedTuple):
    """Thresholds of the check of the accelerometer.

    Walks of `g1`, `hrp4_class` and `talos` with realistic noise, on flat floors and stones of 20 mm, come to 2.7 m/s².

    Attributes:
        contradicts: Horizontal acceleration that the accelerometer alone shows, from which on it is left out, m/s².
        agrees: The same below which it is used again, m/s².
        mean: Time constant of the accelerations that are compared, s.
        carries: Share of the load that every foot must carry in a stand.
        standing: Time for which it must have carried it, s: landing feet jerk the legs and their loads.
    """

    contradicts: float = 3.5
    agrees: float = 2.0
    mean: float = 0.015
    carries: float = 0.15
    standing: float = 0.5


THRESHOLDS = AccelerometerThresholds()


class AccelerometerCheck:
    """Check of the direction of the specific force against attitude, legs and ground forces.

    A robot that stands and whose accelerometer points elsewhere than up accelerates: so the legs move, and the ground
    pushes it. While neither is so, the accelerometer is left out, and the robot is taken to keep its speed.

    Attributes:
        left_out: True while the accelerometer is left out.
    """

    def __init__(self, dt: float) -> None:
        """Start at rest; dt is the control period, s."""
        self._dt, self._gain = dt, lag_gain(dt, THRESHOLDS.mean)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self.left_out = False
        self._shown = self._moved = 0j
        self._stands = 0.0  # time for which every foot has carried, s
        self._legs: Vector | None = None
        self._time = 0.0  # of the last measurement, s

    def check(self, measurement: Measurement, observer: Observer) -> Measurement:
        """Return a plausible measurement, without the accelerometer's direction where it contradicts all others.

        The observer has not seen the measurement yet: what it knows of attitude, legs and feet is of the last tick.
        """
        inertial, before = observer.inertial, self._legs
        self._legs = legs = inertial.correction.legs
        passed, self._time = measurement.time - self._time, measurement.time
        self._stands = self._stands + self._dt if min(observer.rest.shares) > THRESHOLDS.carries else 0.0
        if before is None or legs is None or self._stands < THRESHOLDS.standing:
            self._shown = self._moved = 0j
            self.left_out = False
            return measurement
        rotation = inertial.rotation
        x, y, _ = rotation.dot(measurement.specific_force).tolist()
        passed = passed if passed > 0.0 else self._dt  # more than a period where measurements are lost
        moved = complex(legs[0] - before[0], legs[1] - before[1]) / passed
        sooner = self._shown
        self._shown = shown = self._shown + self._gain * (complex(x, y) - self._shown)
        self._moved += self._gain * (moved - self._moved)
        least = THRESHOLDS.agrees if self.left_out else THRESHOLDS.contradicts
        # Velocities of joints may show a push a period later than the accelerometer does.
        left_out = abs(shown) > least and min(abs(shown - self._moved), abs(sooner - self._moved)) > least
        if left_out and not self.left_out:
            force = observer.net_wrench[:2] / observer.robot.mass
            left_out = abs(shown - complex(*force.tolist())) > least
            if left_out:
                logger.error(
                    "measurement at %.4f s: accelerometer contradicts attitude and legs", measurement.time
                )
        self.left_out = left_out
        return replace(measurement, specific_force=GRAVITY * rotation[2]) if left_out else measurement
