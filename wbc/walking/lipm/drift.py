"""Drift of the feet: what soles have moved and turned on the ground, which the estimated world follows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.core.frames import yaw_rotation
from wbc.walking.plans.footsteps import Footstep, FootstepPlan

TURNED, MOST_TURN = 0.02, 0.04
"""Angle by which soles have turned on the ground from which on the landings to come are turned back, and greatest angle
of that in a step, rad."""


class FeetDrift:
    """Motion of the remaining footsteps against the drift of the feet, since a planner was taken."""

    def __init__(self) -> None:
        self._turned = 0.0  # angle by which soles have turned since landings were turned back last, rad
        self.begin()

    def begin(self) -> None:
        """Begin with another planner, in the world as it is now."""
        self._motion = pin.SE3.Identity()
        self._moves = False

    def turn(self, angle: float) -> None:
        """Take in an angle by which soles have turned on the ground, rad."""
        self._turned += angle

    def planner_feet(self, feet: Sequence[Footstep]) -> Sequence[Footstep]:
        """Return feet in the world that the planner was taken in."""
        return [foot.moved(self._motion.inverse()) for foot in feet] if self._moves else feet

    def present_plan(self, plan: FootstepPlan) -> FootstepPlan:
        """Return a planner's answer in the world as it is now."""
        return plan.moved(self._motion) if self._moves else plan

    def lift(
        self, stance: int, places: Sequence[pin.SE3], measured: Sequence[pin.SE3] | None
    ) -> pin.SE3 | None:
        """Return the motion of the landings to come against the drift, at a lift-off; None without any.

        A foot that has just landed has moved by the difference of its places beside the other one, as commanded and as
        `measured` by the encoders. What soles have turned is turned back about the foot that stands, 0 left, 1 right.
        """
        turn, back, here = 0.0, np.zeros(3), places[stance].translation
        if measured is not None:
            before, now = (
                soles[1 - stance].translation - soles[stance].translation for soles in (places, measured)
            )
            back[:2] = now[:2] - before[:2]
        if abs(self._turned) >= TURNED:
            turn = max(-MOST_TURN, min(MOST_TURN, -self._turned))
            self._turned += turn
        rotation = yaw_rotation(turn)
        move = pin.SE3(rotation, here - rotation.dot(here) + back)
        if move.isIdentity(0.0):
            return None
        self._motion, self._moves = move * self._motion, True
        return move
