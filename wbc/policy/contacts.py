"""Contacts of the feet as the measured loads say them: phase, steps, and how long each foot has been where it is."""

from __future__ import annotations

from collections.abc import Sequence

from wbc.core.robot import GRAVITY, Robot
from wbc.walking.contact import GaitPhase
from wbc.walking.source import Progress

CARRIES = 0.06
"""Share of the robot's weight from which on a foot carries; feet in the air feel the inertia of their soles.

It has no hysteresis: a load that goes to and fro about it makes no step, since that takes `STEP` in the air."""

STEP = 0.1
"""Least time in the air of a foot that makes a step, s: an impact may throw a foot off the ground for a moment."""

RESTS = 1.0
"""Time for which both feet of a robot that stands have carried, s."""


class FootContacts:
    """Contacts of the feet of a robot whose gait nobody plans.

    Attributes:
        air: Time for which each foot has carried nothing, s; 0 for one that carries.
        landed: Time for which each foot has carried, s; 0 for one in the air.
        steps_done: Landings so far, of feet that were in the air for 0.1 s at least.
    """

    def __init__(self, robot: Robot, dt: float) -> None:
        """Begin with feet that have stood for long, with a period dt, s; an `InputError` without two feet."""
        robot.needs_feet("a record of contacts")
        self._dt, self._least = dt, CARRIES * robot.mass * GRAVITY
        self.reset()

    def reset(self) -> None:
        """Begin again with feet that have stood for long."""
        self.air, self.landed = [0.0, 0.0], [RESTS, RESTS]
        self.steps_done, self._stance = 0, 1

    def update(self, loads: Sequence[float]) -> None:
        """Take the normal forces on the feet in this tick, N."""
        for i, load in enumerate(loads):
            if load < self._least:
                self.air[i], self.landed[i] = self.air[i] + self._dt, 0.0
            else:
                self.steps_done += self.air[i] >= STEP
                self.air[i], self.landed[i] = 0.0, self.landed[i] + self._dt
        if self.swing is not None:
            self._stance = 1 - self.swing

    @property
    def swing(self) -> int | None:
        """The foot in the air, 0 left and 1 right, the one that has left the ground first; None while both carry."""
        if not any(self.air):
            return None
        return int(self.air[1] > self.air[0])

    @property
    def progress(self) -> Progress:
        """Phase and steps; nothing is planned, so that a phase has no duration."""
        swing = self.swing
        if swing is not None:
            phase, elapsed = GaitPhase.SINGLE, self.air[swing]
        else:
            elapsed = min(self.landed)
            phase = GaitPhase.STANDING if elapsed >= RESTS else GaitPhase.DOUBLE
        return Progress(phase, self._stance, swing, steps_done=self.steps_done, elapsed=elapsed, cycle=0.0)
