"""Feet of free steps: what those on the ground cost and bear, and what the one in the air costs.

The tasks of the walk (`wbc.walking.tasks`) write these values where they change.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc.base.numbers import Array
from wbc.base.vectors import Point
from wbc.walking.contact import GaitPhase
from wbc.walking.source import Reference
from wbc.walking.stepping.settings import ConstantsInSI, RobotSize

# In units of the robot; costs are per (m/s²)², those of rotations per (h rad/s²)² with the height h of the CoM.
COM_HEIGHT = 3.67, 3.46
"""Stiffness, ω², and damping, ω, of the CoM's height."""

ONE_FOOT, BOTH_FEET = np.array([0.0, 0.0, 1.0]), np.ones(3)
"""Ratios by which the weight of the CoM acts: its height alone, and its place as well."""

URGENT = 10.0, 3.0
"""Ratios of the costs of the swing foot's place and of its height while its landing is far from the one that was asked
for: a trunk that turns meanwhile comes upright again, and a foot that comes late or short does not catch the robot."""

PUSHED = 0.03
"""Ratio of all costs of a swing foot that was pushed: the hip that stops a leg turns the trunk, and the leg has
time to fly."""

HELD, HELD_TURN, STANDING_TURN = 1000.0, 8.3, 2780.0
"""Cost of the place of a foot that stands, of its rotation on ground of unknown shape and in a stand."""

YIELDING = 0.1
"""Ratio of these costs for a foot that is unloaded, or waits to take over."""

UNLOADED = 1e-3
"""Least bound of the force of a foot in contact, over the greatest force of a foot."""

SHARED = 0.2
"""Least force of a foot that carries beside another one, over that of both together."""


class PhaseGains(NamedTuple):
    """Gains of the centre of mass in a phase, and size of the boxes of the centre of pressure."""

    scale: Array  # ratios by which the weight of the CoM acts, shape (3,)
    stiffness: Array  # of the CoM, shape (3,), 1/s²
    damping: Array  # of the CoM, shape (3,), 1/s
    box: Point  # length and width of the box on each sole, m


class FootLoad(NamedTuple):
    """Cost and forces of a foot on the ground."""

    cost: Array  # of its motion, shape (6,)
    least: float  # normal force, N
    most: float  # normal force, N


class SteppingFeet:
    """Feet of one walk in free steps.

    Attributes:
        single: Costs of the motion of a foot that stands while the other one swings, shape (6,).
        firm: Those of feet that both stand.
        shift: Stiffness, 1/s², and damping, 1/s, of the CoM while the weight shifts and in steps, shape (3,) each.
        stand: Those in a stand.
    """

    def __init__(self, scale: RobotSize, law: ConstantsInSI) -> None:
        """Multiply the costs out for a robot."""
        self._law, turn, omega = law, scale.height**2, scale.omega  # from (h rad/s²)² to (rad/s²)²
        self.single, self.firm = halves(HELD, HELD_TURN * turn), halves(HELD, STANDING_TURN * turn)
        self._yielding = YIELDING * self.single
        height = COM_HEIGHT[0] * omega**2, COM_HEIGHT[1] * omega
        self.shift, gain = _com_gains(law.stand.shift_gains, height), law.stand.stand_gain
        self.stand = _com_gains((gain * omega**2, (1.0 + gain) * omega), height)
        self._gains = {
            GaitPhase.STANDING: PhaseGains(BOTH_FEET, *self.stand, law.area.standing_box),
            GaitPhase.DOUBLE: PhaseGains(BOTH_FEET, *self.shift, law.area.standing_box),
            GaitPhase.SINGLE: PhaseGains(ONE_FOOT, *self.shift, law.area.box),
        }
        self._urgent = np.array([URGENT[0], URGENT[0], URGENT[1], 1.0, 1.0, 1.0]) - 1.0

    def gains(self, phase: GaitPhase) -> PhaseGains:
        """Return the gains of a phase."""
        return self._gains[phase]

    def swing(self, urgency: float) -> Array:
        """Return the ratios of the costs of a foot in the air, shape (6,): see `Reference.urgency`."""
        return np.full(6, PUSHED) if urgency < 0.0 else 1.0 + urgency * self._urgent

    def load(self, side: int, reference: Reference) -> FootLoad:
        """Return cost and forces of a foot on the ground, 0 left and 1 right."""
        law, progress = self._law, reference.progress
        single, most = progress.phase is GaitPhase.SINGLE, reference.most_force[side]
        most = max(most, UNLOADED * law.touch.most_force)
        if single and side != progress.stance:  # it unloads, or waits to take over
            return FootLoad(self._yielding, 0.0, most)
        least = SHARED * law.touch.least_force if all(progress.contact) else law.touch.carried
        return FootLoad(self.single if single else self.firm, least, most)

    def centre(self, side: int, reference: Reference) -> Point:
        """Return the centre of the box of the centre of pressure on a sole, m."""
        progress, carrying = reference.progress, self._law.area.carrying
        if progress.phase is GaitPhase.STANDING:
            return 0.0, 0.0
        if progress.phase is GaitPhase.SINGLE and side == progress.stance:
            ahead, aside = reference.cop
            return carrying + ahead, aside
        return carrying, 0.0


def _com_gains(place: Point, height: Point) -> tuple[Array, Array]:
    """Return stiffness and damping of the CoM, shape (3,) each, of those of its place and of its height."""
    return np.array([place[0], place[0], height[0]]), np.array([place[1], place[1], height[1]])


def halves(linear: float, angular: float) -> Array:
    """Return a value for three linear and one for three angular rows, shape (6,)."""
    return np.array([linear] * 3 + [angular] * 3)
