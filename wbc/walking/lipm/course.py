"""Planned motion of the pendulum while steps change: a pattern, and the way over to it from the one before."""

from __future__ import annotations

import math

import numpy as np

from wbc.base.numbers import ROUNDING, Array
from wbc.core.trajectories import Follower
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.lipm.pattern import Pattern
from wbc.walking.lipm.phases import PlanPhases
from wbc.walking.lipm.preview import PreviewController

FELT = 30.0
"""Time from which on the steps of a plan change the DCM now by less than rounding, 1/ω."""


class PlannedCourse:
    """Planned motion of the pendulum of one walk.

    Attributes:
        preview: Preview control, which plans the next pattern; set another one, of the same height, at any time.
        pattern: Pattern of the steps as they are.
        since: Time since it was planned, s.
    """

    def __init__(self, phases: PlanPhases, preview: PreviewController, start: Pendulum) -> None:
        """Stand at rest."""
        self._phases, self.preview = phases, preview
        self._off = Follower(1.0 / preview.omega, 0j)  # of the reference of the CoM from the pattern, m
        self.pattern: Pattern = preview.plan(phases.supports(), start)
        self.since = 0.0

    def advance(self, dt: float) -> None:
        """Go on by a tick, s."""
        self.since += dt
        self._off.follow(-self._off.value, dt)

    def plan(self) -> None:
        """Plan the pattern anew from the pendulum as planned; what is measured is left to the stabilizer."""
        steps = math.ceil(FELT / (self.preview.omega * self._phases.gait.cycle))
        before = self.pattern.at(self.since)
        self.pattern, self.since = self.preview.plan(self._phases.supports(steps), before), 0.0
        now = self.pattern.at(0.0)
        self._off.value += _plane(before.com - now.com)
        self._off.velocity += _plane(before.com_velocity - now.com_velocity)

    def pendulum(self) -> Pendulum:
        """Return the reference of the pendulum: the CoM goes over to a pattern that begins elsewhere.

        A pattern begins elsewhere where no ZMP within the supports takes the DCM to the steps that are new, as after a
        push. The reference of the CoM and its velocity go on, and come to the pattern as quickly as the DCM falls. The
        ZMP is that of the pattern.
        """
        pendulum, off = self.pattern.at(self.since), self._off
        if abs(off.value) + abs(off.velocity) / self.preview.omega < ROUNDING:
            return pendulum
        com, velocity, acceleration, zmp, zmp_velocity, omega = pendulum
        way, speed, push = off.value, off.velocity, off.acceleration
        # One array and its parts: making an array costs more than a slice.
        added = np.array((way.real, way.imag, 0.0, speed.real, speed.imag, 0.0, push.real, push.imag, 0.0))
        moved = com + added[:3], velocity + added[3:6], acceleration + added[6:]
        return Pendulum(*moved, zmp, zmp_velocity, omega)


def _plane(vector: Array) -> complex:
    """Return the part of a vector over the ground, x + iy."""
    return complex(*vector[:2].tolist())
