"""Step adjustment: place and time of a landing with which the pendulum can be caught.

Over the planned ZMP, a DCM error of e now is one of e · e^{ωT} when the foot has landed and taken over, T from now. An
error that no ZMP within the stance foot brings back asks for another place or time of the landing, such that the DCM
is as planned relative to the new foot. The program of free steps (`wbc.walking.stepping.program`) weighs all changes,
with the planned landing as the step that is asked for and one constant ZMP that stands for the planned motion.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated

from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, settings
from wbc.core.robot import SIDES
from wbc.tasks.stabilizer.pendulum import natural_frequency
from wbc.walking.lipm.schedule import ZmpTarget
from wbc.walking.plans.footsteps import Footstep, SoleSizes
from wbc.walking.plans.reach import Reach
from wbc.walking.stepping.law import Point
from wbc.walking.stepping.program import COSTS, FREE, SHIFT, TIME, Bounds, StepProgram, Wish

SHORTEST, LONGEST, FREEZE = 0.05, 0.1, 0.05
"""Least time from now to touch-down, greatest stretch of the time left, time before touch-down in which the step stays,
s: a foot needs that much to come down."""

SAME_TIME = 0.05
"""Relative change of e^{ωT} below which the time of touch-down counts as unchanged."""


@settings
class AdjustmentSettings:
    """Limits of step adjustment.

    Attributes:
        margin: Distance of the ZMP from the edge of the stance foot, m.
        backward: Greatest shift of the ZMP towards the heel, m. With a step that comes early the DCM lags behind; the
            heel would have to push it on, and seldom carries on stones.
        threshold: Change of landing below which the step stays as planned, m.
        max_shift: Greatest distance of a landing from the plan, forward and sideways, m.
    """

    margin: Annotated[NonNegative, "m"] = 0.01
    backward: Annotated[NonNegative, "m"] = 0.03
    threshold: Annotated[NonNegative, "m"] = 0.005
    max_shift: Annotated[tuple[NonNegative, NonNegative], "m"] = (0.15, 0.12)

    def sized(self, scale: float) -> AdjustmentSettings:
        """Return the settings with their lengths times a factor, for a small robot (`Robot.length_scale`)."""
        forward, aside = self.max_shift
        return replace(
            self,
            margin=scale * self.margin,
            backward=scale * self.backward,
            threshold=scale * self.threshold,
            max_shift=(scale * forward, scale * aside),
        )


class StepAdjuster:
    """Step adjustment of one robot."""

    def __init__(
        self, height: float, reach: Reach, sizes: SoleSizes, settings: AdjustmentSettings | None = None
    ) -> None:
        """Make the program for a height of the CoM, m, and (length, width) of the left and of the right sole, m."""
        self.settings = s = settings or AdjustmentSettings()
        self._omega, self._reach, self._program = natural_frequency(height), reach, StepProgram(height)
        self._half = [[max(0.5 * size - s.margin, 1e-3) for size in sole] for sole in sizes]
        # Greatest shift of the ZMP that costs less than any change of the step that counts.
        costs = COSTS[[0, TIME]] * (s.threshold**2, (height * SAME_TIME) ** 2)
        self._idle = math.sqrt(float(costs.min()) / float(COSTS[SHIFT.start]))

    def adjust(
        self,
        dcm: Array,
        planned: Array,
        at_landing: Array,
        step: Footstep,
        stance: Footstep,
        remaining: float,
        transfer: float,
        target: ZmpTarget,
    ) -> tuple[Footstep, float]:
        """Return landing and time to touch-down, s; as planned where a ZMP within the stance foot is enough.

        The DCM is measured, and planned, now and `at_landing`, when the new foot has taken over, in the world, m; the
        times are to touch-down (`remaining`), and from there until the new foot has taken over (`transfer`), s.
        """
        s, omega, side = self.settings, self._omega, 1.0 if step.side == "left" else -1.0
        if remaining <= FREEZE:
            return step, remaining
        cos, sin = math.cos(stance.yaw), math.sin(stance.yaw)

        def seen(x: float, y: float) -> Point:
            """Return how far a point is ahead and outwards of the stance foot, m."""
            x, y = x - stance.x, y - stance.y
            return cos * x + sin * y, side * (cos * y - sin * x)

        left = remaining + transfer
        grow = math.exp(omega * left)
        (ahead, aside), now, then = target.in_sole(stance.side), seen(*planned[:2]), seen(*at_landing[:2])
        length, width = self._half[SIDES.index(stance.side)]
        low = min(0.0, max(-length - ahead, -s.backward)), min(0.0, -width - side * aside)
        high = max(0.0, length - ahead), max(0.0, width - side * aside)
        xi, ratio = seen(*dcm[:2]), grow / (grow - 1.0)
        # The plan with the ZMP shifted by δ = e τ*/(τ* − 1), for a DCM error e, keeps the equation. If the stance foot
        # can take this shift, its cost bounds the least cost from above, and with it every change.
        x, y = (ratio * (a - b) for a, b in zip(xi, now, strict=True))
        if low[0] <= x <= high[0] and low[1] <= y <= high[1] and math.hypot(x, y) <= self._idle:
            return step, remaining
        place = seen(step.x, step.y)
        (b, d), (u, v) = (
            [q - p for p, q in zip(place, then, strict=True)],
            [(grow * p - q) / (grow - 1.0) for p, q in zip(now, then, strict=True)],
        )
        # The steps after this one are those of which the planned offset is the orbit: they ask for nothing else.
        on, out = (grow - 1.0) * b, (grow - 1.0) * d
        wish = Wish((*place, on, -out, on, out), (b, d, b, -d, b, d), left)
        times = min(left, max(SHORTEST, FREEZE) + transfer), left + LONGEST
        bounds = Bounds(((-FREE, -FREE), (FREE, FREE)), (low, high), (0.0, 0.0), times)
        solved = self._program.solve(xi, (u, v), omega, left, left, wish, bounds, self._box(place))
        if solved is None:
            return step, remaining
        x, y = solved.place
        later = math.exp(omega * (solved.left - left))
        if math.dist((x, y), place) <= s.threshold and abs(later - 1.0) < SAME_TIME:
            return step, remaining
        y *= side
        moved = replace(step, x=stance.x + cos * x - sin * y, y=stance.y + sin * x + cos * y)
        return moved, solved.left - transfer

    def _box(self, place: Point) -> tuple[Point, Point]:
        """Return the least and the greatest landing: within reach and within `max_shift` of the planned `place`, m."""
        r, (x, y), (dx, dy) = self._reach, place, self.settings.max_shift
        # A plan at the edge of the reach, or beyond it, stays possible.
        low = min(max(-r.max_length, x - dx), x), min(max(r.min_spacing, y - dy), y)
        return low, (max(min(r.max_length, x + dx), x), max(min(r.max_spacing, y + dy), y))
