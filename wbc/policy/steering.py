"""Steering of a policy: the velocity that it is asked for, what the robot lacks of it, and the clock of the gait."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from wbc.core.frames import heading
from wbc.core.robot import Robot
from wbc.policy.description import PolicyDescription
from wbc.walking.plans.sources import Velocity, VelocityLimits, checked_velocity

MOST_LACK = 0.5
"""Greatest velocity that is asked for as well, m/s."""

STILL = 0.01
"""Velocity below which a policy is asked for a stand, m/s and rad/s: its clock rests."""

SETTLES = 2.0
"""Time in which a policy that is asked for a stand comes to one, s."""

STANDING = (math.pi, math.pi)
"""Phases of the feet of a robot that stands, rad."""


class PolicySteering:
    """Velocity that a policy is asked for, within the range that it is made for.

    Attributes:
        command: Velocity that the policy is asked for, with what the robot lacks of it: ahead and aside, m/s, and turn,
            rad/s, shape (3,).
        phase: Phases of the left and the right foot by the clock of the gait, from −π to π, shape (2,), rad. They are
            half a period apart, and rest in a stand; without a clock they do not go on.
        limits: Largest velocities that the policy is made for, aside and in turns to either side.
    """

    def __init__(self, description: PolicyDescription, regain: float) -> None:
        """Ask for a stand; `regain` is the share of what lacks that is asked for as well after 1 s, 1/s."""
        fastest = np.array(description.fastest)
        slowest = -fastest if description.slowest is None else np.array(description.slowest)
        (back, *right), (forward, *left) = np.abs(slowest).tolist(), fastest.tolist()
        self.limits = VelocityLimits(forward, back, *map(min, right, left))
        clock = description.phase
        self._step = 0.0 if clock is None else 2.0 * math.pi * description.period / clock
        self._range, self._gain = (slowest, fastest), description.period * regain
        self.command, self._asked, self._lack = np.zeros(3), np.zeros(3), np.zeros(2)
        self.phase = np.array(STANDING)
        self.velocity = None
        self.begin()

    def begin(self) -> None:
        """Begin anew with a robot that stands, and with the velocity that is asked for."""
        self._rested = 0.0  # time for which a stand has been asked for, s
        self._lack[:] = 0.0  # velocity that is asked for as well, m/s
        self.command[:] = self._asked
        self._stood, self.phase[:] = True, STANDING

    @property
    def velocity(self) -> Velocity | None:
        """Velocity that is asked for, without what lacks of it; None for a stand."""
        return self._velocity

    @velocity.setter
    def velocity(self, value: Sequence[float] | None) -> None:
        velocity = checked_velocity(value)
        self._velocity = None if value is None else velocity
        asked = np.clip(velocity, *self._range)
        self._stands = not (np.abs(asked) >= STILL).any()
        turned = np.sign(asked[:2]) != np.sign(self._asked[:2])
        self._lack[turned | self._stands] = 0.0  # it was that of another direction
        self._asked = asked
        self.command[:] = asked

    @property
    def done(self) -> bool:
        """True when a stand has been asked for during the last 2 s."""
        return self._rested >= SETTLES

    def wait(self, dt: float) -> None:
        """Let time pass, s."""
        self._rested = self._rested + dt if self._stands else 0.0

    def tick(self, robot: Robot) -> None:
        """Ask for what the robot lacks, too, and let the clock go on, in a period of the policy.

        Nothing is asked for as well in a stand, and what lacks turns no velocity around.
        """
        if self._gain and not self._stands:
            towards, ahead = heading(robot.placement(robot.base_frame).rotation), self._asked[:2]
            cos, sin = math.cos(towards), math.sin(towards)
            x, y, _ = robot.com_velocity.tolist()
            self._lack += self._gain * (ahead - (cos * x + sin * y, cos * y - sin * x))
            np.clip(self._lack, -MOST_LACK, MOST_LACK, out=self._lack)
            self.command[:2] = ahead + self._lack
            self.command[:2][self.command[:2] * ahead < 0.0] = 0.0
            np.clip(self.command, *self._range, out=self.command)
        if self._stands:
            self.phase[:] = STANDING
        elif self._stood:
            self.phase[:] = 0.0, math.pi
        else:
            self.phase[:] = np.mod(self.phase + self._step + math.pi, 2.0 * math.pi) - math.pi
        self._stood = self._stands
