"""Step adjustment: place and time of a landing with which the pendulum can be caught.

Over the planned ZMP, a DCM error of e now is one of e · e^{ωT} when the foot has landed and taken over, T from now. An
error that no ZMP within the stance foot brings back asks for another place or time of the landing, such that the DCM
is as planned relative to the new foot. The program of free steps (`wbc.walking.stepping.program`) weighs all changes,
with the planned landing as the step that is asked for and one constant ZMP that stands for the planned motion.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from typing import Annotated, NamedTuple

from wbc.base.settings import Share, settings
from wbc.base.vectors import Point
from wbc.core.robot import SIDES
from wbc.tasks.stabilizer.pendulum import natural_frequency
from wbc.walking.lipm.pattern import Pattern
from wbc.walking.lipm.schedule import ZmpTarget
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.reach import Reach
from wbc.walking.stepping.program import COSTS, FREE, SHIFT, TIME, Bounds, Now, StepProgram, Wish

LONGEST, FREEZE = 0.1, 0.05
"""Greatest stretch of the time left; least time from now to touch-down, in which the step stays, s: a foot needs that
much to come down."""

SAME_TIME = 0.05
"""Relative change of e^{ωT} below which the time of touch-down counts as unchanged."""


@settings
class AdjustmentSettings:
    """Limits of step adjustment: distances of 1 m at most.

    Attributes:
        margin: Distance of the ZMP from the edge of the stance foot, m.
        backward: Greatest shift of the ZMP towards the heel, m. When a step comes early, the DCM lags behind. The CoP
            would have to move to the heel to push the DCM on, and on stones a heel seldom carries.
        threshold: Change of landing below which the step stays as planned, m.
        max_shift: Greatest distance of a landing from the plan, forward and sideways, m.
    """

    margin: Annotated[Share, "m"] = 0.01
    backward: Annotated[Share, "m"] = 0.03
    threshold: Annotated[Share, "m"] = 0.005
    max_shift: Annotated[tuple[Share, Share], "m"] = (0.15, 0.12)


class PlannedSwing(NamedTuple):
    """Swing as planned at lift-off, against which steps are adjusted: one change does not add to another."""

    pattern: Pattern
    begin: float  # of the pattern, from lift-off, s
    landing: Footstep
    stance: Footstep
    duration: float  # from lift-off to touch-down, s
    transfer: float  # from touch-down until the new foot has taken over, s

    def dcm(self, time: float) -> complex:
        """Return the planned DCM at a time from lift-off, s."""
        return self.pattern.dcm_at(time - self.begin)


class StepAdjuster:
    """Step adjustment of one robot."""

    def __init__(self, height: float, reach: Reach, target: ZmpTarget, settings: AdjustmentSettings) -> None:
        """Make the program for a height of the CoM, m."""
        self.settings = s = settings
        self._omega, self._reach, self._program = natural_frequency(height), reach, StepProgram(height)
        self._shifts = {}  # of the ZMP under each foot, least and greatest, ahead and towards the other foot, m
        for side, sole in zip(SIDES, reach.soles, strict=True):
            length, width = (max(0.5 * size - s.margin, 1e-3) for size in sole)
            low = min(0.0, max(-length - target.forward, -s.backward)), min(0.0, -width - target.inward)
            self._shifts[side] = low, (max(0.0, length - target.forward), max(0.0, width - target.inward))
        # Greatest shift of the ZMP that costs less than any change of the step that counts.
        costs = COSTS[[0, TIME]] * (s.threshold**2, (height * SAME_TIME) ** 2)
        self._idle = math.sqrt(float(costs.min()) / float(COSTS[SHIFT.start]))

    def adjust(self, swing: PlannedSwing, elapsed: float, dcm: complex) -> tuple[Footstep, float]:
        """Return landing and time to touch-down, s; as planned where a ZMP within the stance foot is enough.

        `elapsed` is the time since lift-off, s, `dcm` the measured DCM in the world, x + iy, m.
        """
        s, omega, step, stance = self.settings, self._omega, swing.landing, swing.stance
        remaining = swing.duration - elapsed
        if remaining <= FREEZE:
            return step, remaining
        here, axis, planned = complex(stance.x, stance.y), cmath.rect(1.0, stance.yaw), swing.dcm(elapsed)
        left = remaining + swing.transfer
        grow = math.exp(omega * left)
        low, high = self._shifts[stance.side]
        # The plan with the ZMP shifted by δ = e τ*/(τ* − 1), for a DCM error e, keeps the equation. If the stance foot
        # can take this shift, its cost bounds the least cost from above, and with it every change.
        shift = (dcm - planned) / axis * (grow / (grow - 1.0))
        ahead, outwards = shift.real, shift.imag if step.side == "left" else -shift.imag
        if abs(shift) <= self._idle and low[0] <= ahead <= high[0] and low[1] <= outwards <= high[1]:
            return step, remaining

        def seen(point: complex) -> complex:
            """Return how far a point is ahead and outwards of the stance foot, m."""
            point = (point - here) / axis
            return point if step.side == "left" else point.conjugate()

        now, xi = seen(planned), seen(dcm)
        place, then = seen(complex(step.x, step.y)), seen(swing.dcm(swing.duration + swing.transfer))
        zmp, (b, d) = (grow * now - then) / (grow - 1.0), _parts(then - place)
        # The steps after this one are those of which the planned offset is the orbit: they ask for nothing else.
        on, out = (grow - 1.0) * b, (grow - 1.0) * d
        wish = Wish((*_parts(place), on, -out, on, out), (b, d, b, -d, b, d), left)
        times = min(left, FREEZE + swing.transfer), left + LONGEST
        bounds = Bounds(((-FREE, -FREE), (FREE, FREE)), (low, high), (0.0, 0.0), times)
        box = self._box(_parts(place))
        solved = self._program.solve(Now(_parts(xi), _parts(zmp), omega, left, left), wish, bounds, box)
        if solved is None:
            return step, remaining
        landing, later = complex(*solved.place), math.exp(omega * (solved.left - left))
        if abs(landing - place) <= s.threshold and abs(later - 1.0) < SAME_TIME:
            return step, remaining
        landing = here + axis * (landing if step.side == "left" else landing.conjugate())
        return replace(step, x=landing.real, y=landing.imag), solved.left - swing.transfer

    def _box(self, place: Point) -> tuple[Point, Point]:
        """Return the least and the greatest landing: within reach and within `max_shift` of the planned `place`, m."""
        r, (x, y), (dx, dy) = self._reach, place, self.settings.max_shift
        # A plan at the edge of the reach, or beyond it, stays possible.
        low = min(max(-r.max_length, x - dx), x), min(max(r.min_spacing, y - dy), y)
        return low, (max(min(r.max_length, x + dx), x), max(min(r.max_spacing, y + dy), y))


def _parts(point: complex) -> Point:
    return point.real, point.imag
