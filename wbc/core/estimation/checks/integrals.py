"""Integrals of what is measured and commanded: joints against their velocities, the base against its accelerations."""

from __future__ import annotations

import math

import numpy as np

from wbc.base.numbers import Array
from wbc.core.robot import Robot

TICKS = 10
"""Number of ticks over which velocities and accelerations are integrated before the integrals are compared."""

MISSED = 10
"""Number of periods between two measurements from which on what joints have done meanwhile is not known."""

DRIFT = 0.1
"""Distance by which an encoder may leave the integral of its joint's velocity, rad.

In walks with realistic noise, over stones and with pushes, it is 0.011 rad at most.
"""

DRIFT_MEMORY = 2.0
"""Time constant with which this distance is forgotten, s."""

DRIFTING = 0.1
"""Time for which it must last, s."""

UNMET_SPEED = 1.0
"""Velocity by which the base may stay behind the integral of its commanded accelerations, m/s.

Walks with realistic noise over stones of 20 mm come to 0.3 m/s; a push adds its impulse over the mass for a while.
"""

UNMET_RATE = 4.0
"""The same of its angular velocity about the horizontal axes, rad/s, where those walks come to 0.8 rad/s.

About the vertical they come to 4 rad/s, because feet slip on stones: that turn does not count.
"""

UNMET_MEMORY = 0.3
"""Time constant with which both are forgotten, s."""

UNMET = 0.2
"""Time for which they must last, s."""

REAL_TIME = 0.8
"""Ratio of the encoders' speeds to the joint velocities below which a machine's own time runs slower than the stamps.

From its inverse on it runs faster.
"""

AGREEMENT = 0.95
"""Cosine between the two from which on all joints agree on another time."""

MOVED = 0.02
"""Least length of a motion of all joints that tells this time, rad."""


class IntegralComparison:
    """Comparison of integrals over some ticks at a time.

    Attributes:
        drifts: Joints whose encoder is not the integral of their velocity, such as "velocity of left_knee contradicts
            its encoder", or that the machine runs at another time; empty when all agrees.
        behind: Time for which the base has been slower than its commanded accelerations make it, s.
    """

    def __init__(self, robot: Robot, dt: float) -> None:
        """Prepare for a robot and a control period, s."""
        self._names, self._na, self._dt = robot.joint_names, robot.na, dt
        self._drift_limit = DRIFT * robot.per_rad
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self.drifts: list[str] = []
        self.behind = 0.0
        self._first = True
        # Of some ticks: their number and time, encoders at their begin, and the integral of the velocities.
        self._ticks, self._elapsed = TICKS, 0.0
        self._begin, self._travelled = np.zeros((2, self._na))
        # What is forgotten slowly: motions of joints by encoders and by velocities, and what the base lacks.
        self._moved, self._expected, self._drifting = np.zeros((3, self._na))
        self._unmet, self._gained, self._asked = np.zeros(6), np.zeros(6), False

    def update(self, values: Array, base: tuple[Array, Array] | None, passed: float) -> None:
        """Integrate one tick more; `drifts` and `behind` are then up to date.

        Args:
            values: Positions and velocities of the joints, and further numbers of a tick.
            base: Accelerations that were commanded of the base, and its velocity, each of shape (6,); None if nothing
                was commanded.
            passed: Time since the last tick, s; the first tick is not compared.
        """
        if self._first:
            self._first = False
            return
        position, velocity = values[: self._na], values[self._na : 2 * self._na]
        asked, self._asked = self._asked, base is not None
        if base is None or not asked:
            self._unmet.fill(0.0)
            self.behind = 0.0
        if base is not None and not asked:
            self._gained[:] = base[1]
        if self._ticks < TICKS and 0.0 < passed < MISSED * self._dt:
            self._elapsed += passed
            self._ticks += 1
            self._travelled += passed * velocity
            if base is not None:
                self._unmet += passed * base[0]
            if self._ticks < TICKS:
                return
            self._compare_joints(position)
            if base is not None:
                self._compare_base(base[1])
        # Begin anew; what joints have done in a gap is not known.
        self._ticks, self._elapsed, self._begin = 0, 0.0, position.copy()
        self._travelled.fill(0.0)
        if base is not None:
            self._gained[:] = base[1]

    def _compare_joints(self, position: Array) -> None:
        """Compare the integrals of joint velocities over some ticks with the encoders."""
        time, moved, expected = self._elapsed, self._moved, self._expected
        keep = 1.0 - min(time / DRIFT_MEMORY, 1.0)
        moved += position - self._begin
        expected += self._travelled
        moved *= keep
        expected *= keep
        far = np.abs(moved - expected) > self._drift_limit
        self._drifting = np.where(far, self._drifting + time, 0.0)
        named = (self._drifting >= DRIFTING).nonzero()[0]
        self.drifts = [f"velocity of {self._names[i]} contradicts its encoder" for i in named[:4]]
        if named.size and not REAL_TIME <= (pace := self.pace) <= 1.0 / REAL_TIME:
            self.drifts = [f"the machine runs at {pace:.1f} of real time"]

    @property
    def pace(self) -> float:
        """Ratio of the joints' motions by encoders to those by velocities, in which all agree; 1 if they do not."""
        moved, expected = self._moved, self._expected
        cross, square, own = float(moved @ expected), float(expected @ expected), float(moved @ moved)
        told = square > MOVED**2 and cross >= AGREEMENT * math.sqrt(square * own)
        return cross / square if told else 1.0

    def _compare_base(self, velocity: Array) -> None:
        """Compare the integral of the commanded accelerations with the velocity of the base."""
        time, unmet = self._elapsed, self._unmet
        unmet -= velocity - self._gained
        unmet *= 1.0 - min(time / UNMET_MEMORY, 1.0)
        linear, angular = unmet[:3], unmet[3:5]  # not about the vertical, about which feet slip
        behind = linear.dot(linear) > UNMET_SPEED**2 or angular.dot(angular) > UNMET_RATE**2
        self.behind = self.behind + time if behind else 0.0
