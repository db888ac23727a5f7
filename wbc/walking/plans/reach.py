"""Reach of a robot's legs in steps, and the gait for its size."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from typing import Annotated

import numpy as np

from wbc.base.checked import checked
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import Positive, in_units, settings
from wbc.core.robot import GRAVITY, SIDES, Robot
from wbc.walking.plans.footsteps import Footstep, SoleSizes, moved
from wbc.walking.plans.gait import Gait, StepGait
from wbc.walking.plans.leg import Leg, SwingLeg, outward_turn, swing_effort

QUICKEST = 0.9
"""Least time on one foot in planned steps, 1/ω: at 0.95/ω three robots of three sizes walk, at 0.7/ω they fall."""

SPANS = 1.6
"""Greatest length of a step over the distance that a leg spans either way: both legs span it, with room."""

CLEARING = 0.01
"""Distance by which a step goes outwards, again and again, whose sole would overlap the one that stands, m."""

STEP = 0.99
"""Share of the legs' reach that a default step may take."""

BACK = 0.8
"""Share of the greatest length that a step has which would be longer: the rest is for the balance."""


@settings
class Reach:
    """Limits of a step, measured from the stance sole to the landing sole in the stance frame.

    Attributes:
        max_length: Greatest distance forward or back, m.
        min_spacing: Least lateral distance between the soles' centres, m.
        max_spacing: Greatest lateral distance between the soles' centres, m.
        max_yaw: Greatest turn outwards, rad; half of it inwards.
        max_height: Greatest difference in height, m.
        max_swing_height: Greatest swing height, m.
        min_single_support: Least time on one foot, s.
        soles: (length, width) of the left and of the right sole, m.
        leg: Leg that swings.
    """

    max_length: Annotated[Positive, "m"]
    min_spacing: Annotated[Positive, "m"]
    max_spacing: Annotated[Positive, "m"]
    max_yaw: Annotated[Positive, "rad"]
    max_height: Annotated[Positive, "m"]
    max_swing_height: Annotated[Positive, "m"]
    min_single_support: Annotated[Positive, "s"]
    soles: Annotated[SoleSizes, "m"]
    leg: SwingLeg

    @staticmethod
    @checked
    def of(robot: Robot, com_height: Annotated[Positive, "m"] | None = None) -> Reach:
        """Return the reach of a robot, by its legs, for a CoM height over the soles, m; half-sitting when None.

        A leg of length L whose hip, half way between the feet, is h over its ankle spans √((0.98 L)² − h²) either way.
        Raises `InputError` with the range for a height that the legs cannot reach.
        """
        leg = Leg(robot)
        span, spacing = leg.span(com_height), leg.spacing
        left, right = robot.soles[:2]
        yaw = outward_turn(robot)
        return Reach(
            max_length=SPANS * span,
            min_spacing=min(max(left.width, right.width) + 0.01, 0.95 * spacing),
            max_spacing=spacing + 1.2 * span,
            max_yaw=min(0.5, 0.8 * yaw) if yaw > 0.0 else 0.1,
            max_height=leg.length / 3.0,
            max_swing_height=leg.length / 2.0,
            min_single_support=QUICKEST * math.sqrt(leg.com_height / GRAVITY),
            soles=((left.length, left.width), (right.length, right.width)),
            leg=leg.swing(com_height),
        )

    def allows(self, stance: Footstep, step: Footstep) -> bool:
        """Return True if a step is within reach over the ground, seen from the foot that stands."""
        forward, spacing, _, _ = step.outwards_of(stance)
        aside = self.min_spacing - ROUNDING <= spacing <= self.max_spacing + ROUNDING
        return aside and abs(forward) <= self.max_length + ROUNDING

    def nearest(self, stance: Footstep, step: Footstep) -> Footstep:
        """Return a step within reach of the foot that stands, clear of it: the same one, or the nearest on its way."""
        forward, beside, _, out = step.outwards_of(stance)
        side, long = 1.0 if step.side == "left" else -1.0, self.max_length
        turned = -0.5 * self.max_yaw - ROUNDING <= out <= self.max_yaw + ROUNDING
        if turned and self.allows(stance, step) and not self.overlap(stance, step):
            return step
        x = forward if abs(forward) <= long + ROUNDING else math.copysign(BACK * long, forward)
        yaw = stance.yaw + side * min(max(out, -0.5 * self.max_yaw), self.max_yaw)
        beside = min(max(beside, self.min_spacing), self.max_spacing)
        while True:
            u, v, _ = moved((stance.x, stance.y, stance.yaw), x, side * beside, 0.0)
            near = replace(step, x=u, y=v, yaw=yaw)
            if beside >= self.max_spacing or not self.overlap(stance, near):
                return near
            beside = min(beside + CLEARING, self.max_spacing)

    def effort(self, gait: StepGait, begin: float, end: float, aside: float) -> float:
        """Return what a step on level ground asks of hip and knee over what they give.

        A joint that comes late for a moment costs a part of the way: of a long step or of a high swing more than a
        robot survives, of a short and low one little. So `swing_effort` counts by the greater ratio of the step to the
        longest and to the highest one. Of 77 walks of three robots in position control, with realistic noise, at 0.3
        to 0.8 s on one foot, all those below 1 arrived, and all but two of those above it fell.
        """
        share = max(abs(end) / self.max_length, gait.swing_height / self.max_swing_height)
        return share * swing_effort(self.leg, gait, round(begin, 3), round(end, 3), round(aside, 3))

    def corners(self, foot: Footstep) -> Array:
        """Return the corners of a sole in the world, seen from above, shape (4, 2), m."""
        half = 0.5 * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) * self.soles[SIDES.index(foot.side)]
        c, s = math.cos(foot.yaw), math.sin(foot.yaw)
        corners: Array = half @ np.array([[c, s], [-s, c]]) + (foot.x, foot.y)
        return corners

    def overlap(self, a: Footstep, b: Footstep) -> bool:
        """Return True if two soles overlap, by the separating axes of two rectangles."""
        p, q = self.corners(a), self.corners(b)
        for yaw in (a.yaw, a.yaw + math.pi / 2, b.yaw, b.yaw + math.pi / 2):
            axis = np.array([math.cos(yaw), math.sin(yaw)])
            s, t = p @ axis, q @ axis
            if s.max() <= t.min() or t.max() <= s.min():
                return False
        return True


def sized(gait: Gait, robot: Robot) -> Gait:
    """Return a gait whose values that are not given fit a robot's size (`Robot.length_scale`) and its legs.

    A pendulum of half the height falls in √½ of the time: times and speeds go with the root of lengths.
    """
    root = math.sqrt(robot.length_scale)
    usual = StepGait()
    own = in_units(usual, {"m": root**2, "s": root, "m/s": root})
    changes = {
        field.name: round(value, 4)
        for field in fields(gait)
        if getattr(gait, field.name) is None
        and (value := getattr(own, field.name)) != getattr(usual, field.name)
    }
    if gait.step_length is None:
        reach = STEP * Reach.of(robot).max_length
        if reach < changes.get("step_length", usual.step_length):
            changes["step_length"] = reach
    return replace(gait, **changes)
