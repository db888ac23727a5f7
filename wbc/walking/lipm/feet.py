"""Feet of planned steps: where they stand, the swing of the one in the air, and their drift on the ground.

A landing moves with the ground that is seen, against the drift of the feet, and where it catches the pendulum. With it
the plan changes (`PlanPhases`), and the motion of the pendulum (`PlannedCourse`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.frames import heading, yaw_rotation
from wbc.core.robot import SIDES
from wbc.walking.ground import LAST_LOOK, NOTICED, GroundEstimate
from wbc.walking.lipm.adjustment import FREEZE, PlannedSwing, StepAdjuster
from wbc.walking.lipm.phases import PlanPhases
from wbc.walking.lipm.preview import PlannedCourse
from wbc.walking.plans.footsteps import Footstep, FootstepPlan, mean_heading
from wbc.walking.plans.reach import Reach
from wbc.walking.plans.swing import FootMotion, SwingFoot

SOFT = 0.5
"""Speed at touch-down over that at the landing height, on level ground."""

EVEN = (0.005, 0.02)
"""Height between the feet in the last steps up to which the ground counts as level, and from which on as uneven, m, at
any size: with its share of them, a robot of 0.25 m fell on stairs of 12 and 18 mm that it climbs so."""


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
        self._motion: pin.SE3 | None = None

    def turn(self, angle: float) -> None:
        """Take in an angle by which soles have turned on the ground, rad."""
        self._turned += angle

    def planner_feet(self, feet: Sequence[Footstep]) -> Sequence[Footstep]:
        """Return feet in the world that the planner was taken in."""
        return feet if self._motion is None else [foot.moved(self._motion.inverse()) for foot in feet]

    def present_plan(self, plan: FootstepPlan) -> FootstepPlan:
        """Return a planner's answer in the world as it is now."""
        return plan if self._motion is None else plan.moved(self._motion)

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
        self._motion = move if self._motion is None else move * self._motion
        return move


class PlannedFeet:
    """Feet of one walk.

    Attributes:
        places: Placements of the left and the right sole as planned.
        swing: Swing of this step; None on both feet.
        drift: Drift of the feet on the ground, by which the remaining footsteps move.
    """

    def __init__(
        self, phases: PlanPhases, course: PlannedCourse, ground: GroundEstimate, reach: Reach, dt: float
    ) -> None:
        """Stand on the feet of a plan, with the control period, s."""
        self._phases, self._course, self._ground, self._reach, self._dt = phases, course, ground, reach, dt
        self.places = [foot.placement for foot in phases.plan.feet(0)]
        self._yaws = [heading(place.rotation) for place in self.places]
        self.swing: SwingFoot | None = None
        self.drift = FeetDrift()
        self._planned: PlannedSwing | None = None  # this swing, or the last one

    @property
    def heading(self) -> float:
        """Heading half way between those of the feet, rad."""
        return mean_heading(*self._yaws)

    def motions(self) -> tuple[FootMotion, FootMotion]:
        """Move the foot in the air on; return the motions of the left and the right sole."""
        motions = [FootMotion.at_rest(place) for place in self.places]
        if self.swing is not None:
            side, elapsed = 1 - self._phases.stance, self._phases.elapsed
            self._yaws[side], motions[side] = self.swing.heading(elapsed), self.swing.at(elapsed)
            self.places[side] = motions[side].placement
        return motions[0], motions[1]

    def lift(self, soles: Sequence[pin.SE3], measured: Sequence[pin.SE3] | None) -> None:
        """Start a swing from the placements of the soles, as they are and as `measured` by the encoders if they are."""
        phases, ground, last = self._phases, self._ground, self._planned
        phases.lift()
        stance = phases.stance
        landed = last is not None and last.landing.side == SIDES[stance]
        move = self.drift.lift(stance, soles, measured if landed else None)
        if move is not None:
            phases.set_landing(phases.landing.moved(move))
        step, shape = phases.landing, phases.gait.swing
        ground.lift(stance, soles[stance])
        landing = ground.expect(step, self._near(step))
        phases.set_landing(landing, carry=False)
        # Where what is seen is not there, the ground is where it was felt.
        shape = shape._replace(
            touch=1.0 - (1.0 - SOFT) * ground.level(*EVEN), search_depth=shape.search_depth + ground.raised
        )
        start = soles[1 - stance]
        self.swing = SwingFoot(start, landing, phases.duration, shape, ground.way(start, landing))
        self.replan()

    def _near(self, step: Footstep) -> Callable[[float, float], bool] | None:
        """Return which places near a step may be chosen; None if it stays, as the last two do: the goal is met."""
        plan, index = self._phases.plan, self._phases.step
        if step.fixed or index >= len(plan) - 2:
            return None
        stance, reach = plan.stance(index), self._reach
        return lambda x, y: reach.allows(stance, replace(step, x=x, y=y))

    def replan(self) -> None:
        """Plan the pendulum anew, and keep the swing, if a foot swings, as planned: adjustments are made against it."""
        self._course.plan()
        phases, plan = self._phases, self._phases.plan
        if self.swing is not None:
            landing, stance = phases.landing, plan.stance(phases.step)
            pattern, begin = self._course.pattern, phases.elapsed
            self._planned = PlannedSwing(pattern, begin, landing, stance, phases.duration, phases.transfer)

    def look(self) -> None:
        """Move the landing to the height that is seen under it, while the foot can follow."""
        phases, ground, swing = self._phases, self._ground, self.swing
        if swing is None or phases.remaining < LAST_LOOK or phases.overdue:
            return
        now = phases.landing
        seen = ground.choose(now)
        if abs(seen.z - now.z) < NOTICED:
            return
        ground.height += seen.z - now.z
        phases.set_landing(seen, carry=False)
        self._retarget(swing, seen, swing.duration)

    def adjust(self, dcm: Array, adjuster: StepAdjuster) -> None:
        """Catch the pendulum, whose DCM is measured, m, by landing and time."""
        phases, swing, planned = self._phases, self.swing, self._planned
        if swing is None or planned is None or phases.overdue or phases.remaining <= FREEZE:
            return
        landing, time = adjuster.adjust(planned, phases.elapsed, complex(*dcm[:2].tolist()))
        now, threshold = phases.landing, adjuster.settings.threshold
        time = max(self._dt, round(time / self._dt) * self._dt)
        moved = math.hypot(landing.x - now.x, landing.y - now.y)
        if moved < 0.5 * threshold and abs(time - phases.remaining) < 2.5 * self._dt:
            return
        if self._ground.sight is not None:
            landing = self._ground.choose(replace(landing, z=now.z))
        phases.set_landing(landing, left=time)
        self._retarget(swing, landing, phases.duration)

    def _retarget(self, swing: SwingFoot, landing: Footstep, duration: float) -> None:
        """Send the swing foot to a landing of the plan that has changed, at a time from lift-off, s."""
        swing.retarget(self._phases.elapsed, landing, duration)
        self._course.plan()

    def land(self, soles: Sequence[pin.SE3], credit: float) -> None:
        """End a swing: the foot stands at its placement, and the plan goes on from there; see `PlanPhases.land`."""
        phases = self._phases
        planned, side = phases.landing, 1 - phases.stance
        # A copy: the placement may be the model's own, which moves on with the foot.
        self.places[side] = place = pin.SE3(soles[side])
        self._yaws[side] = heading(place.rotation)
        landed = Footstep.of(planned.side, place)
        self._ground.land(landed.z - planned.z, landed.z - float(soles[1 - side].translation[2]))
        phases.land(landed, credit)
        self.swing = None
