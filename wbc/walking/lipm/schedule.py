"""Schedule of the supports of a plan, with the reference of the ZMP on each of them; points are x + iy, m."""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from wbc.base.settings import Number, settings
from wbc.walking.plans.footsteps import Footstep, FootstepPlan


@dataclass(frozen=True)
class SupportPhase:
    """Time in which the same feet stand on the ground."""

    duration: float  # time left, s
    feet: tuple[Footstep, ...]  # the foot that stands, or the foot that leaves next and the foot that stays
    step: int  # index of the step that swings, or that swings next; the number of steps at the end
    total: float  # whole length, s

    @property
    def single(self) -> bool:
        """True on one foot."""
        return len(self.feet) == 1


def schedule(plan: FootstepPlan) -> tuple[SupportPhase, ...]:
    """Return the supports of a whole plan, from standing to standing."""
    gait, count = plan.gait.full, len(plan)
    if count == 0:
        total = gait.initial_double_support + gait.final_double_support
        return (SupportPhase(total, (plan.left, plan.right), 0, total),)
    supports = []
    for k in range(count):
        time = gait.initial_double_support if k == 0 else gait.double_support
        supports.append(SupportPhase(time, (plan.lift_off(k), plan.stance(k)), k, time))
        supports.append(SupportPhase(gait.single_support, (plan.stance(k),), k, gait.single_support))
    final = gait.final_double_support
    supports.append(SupportPhase(final, (plan.stance(count - 1), plan.steps[-1]), count, final))
    return tuple(supports)


@settings
class ZmpTarget:
    """Reference of the ZMP under a stance foot.

    Attributes:
        forward: From the sole centre, m.
        inward: From the sole centre towards the other foot, m.
    """

    forward: Annotated[Number, "m"] = 0.0
    inward: Annotated[Number, "m"] = 0.0

    def in_sole(self, side: str) -> tuple[float, float]:
        """Return the point in the frame of a left or right sole, x and y, m."""
        return self.forward, -self.inward if side == "left" else self.inward

    def under(self, foot: Footstep) -> complex:
        """Return the point under a foot in the world."""
        return complex(foot.x, foot.y) + cmath.rect(1.0, foot.yaw) * complex(*self.in_sole(foot.side))


def zmp_reference(supports: Sequence[SupportPhase], target: ZmpTarget) -> list[complex]:
    """Return the points at the ends of supports of a ZMP that rests under stance feet and crosses over on both."""
    points = []
    for i, support in enumerate(supports):
        stance = support if support.single or i + 1 == len(supports) else supports[i + 1]
        under = [target.under(foot) for foot in stance.feet]
        points.append(sum(under) / len(under))
    return points
