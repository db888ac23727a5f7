"""Schedule of the supports of a plan, with the reference of the ZMP on each of them, and the height of the pendulum.

The height is level on level ground, smooth over slopes and stairs. Going up, the pendulum rises from the landing until
the middle of the next single support, when the upper leg carries; up a high stair it rises but a little before the
lower foot leaves, whose leg would be stretched. Going down, it sinks from the middle of the single support until both
feet have settled, so that the swing foot reaches the lower stair; down a deep one it has sunk but a little less when
the foot lands. Points on the ground are x + iy, m.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from wbc.base.numbers import ROUNDING
from wbc.base.settings import Number, settings
from wbc.core.robot import SIDES
from wbc.core.trajectories import QuinticPath
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.plans.footsteps import Footstep, FootstepPlan

# For robots of all sizes: bipeds of 0.25 and 0.37 m climb the same stairs with these as with their share of them, and
# the error of their DCM is smaller with these.
SHORTEST = 0.1
"""Least duration of a change of height, s."""

HIGH = 0.06
"""Rise from which on a stair is high, m."""

STRETCH = 0.02
"""Rise up a high stair until the lower foot leaves, m."""

DEEP = 0.12
"""Drop from which on the pendulum sinks sooner, m: half of it would leave too much to the leg that reaches down."""

CLIMB = 0.16
"""Greatest mean speed of a rise, m/s."""


@dataclass(frozen=True)
class SupportPhase:
    """Time in which the same feet stand on the ground."""

    duration: float  # time left, s
    feet: tuple[Footstep, ...]  # the foot that stands, or the foot that leaves next and the foot that stays
    total: float  # whole length, s

    @property
    def single(self) -> bool:
        """True on one foot."""
        return len(self.feet) == 1


def schedule(plan: FootstepPlan, first: int = 0, most: int | None = None) -> tuple[SupportPhase, ...]:
    """Return the supports of a plan from a step on: of all or of `most` steps, and that on both feet after them."""
    gait, feet = plan.gait.full, list(plan.feet(first))
    if not plan.steps:
        total = gait.initial_double_support + gait.final_double_support
        return (SupportPhase(total, (plan.left, plan.right), total),)
    supports = []
    for k, step in enumerate(plan.steps[first:], start=first):
        swing, time = SIDES.index(step.side), gait.initial_double_support if k == 0 else gait.double_support
        supports.append(SupportPhase(time, (feet[swing], feet[1 - swing]), time))
        if k - first == most:
            return tuple(supports)
        supports.append(SupportPhase(gait.single_support, (feet[1 - swing],), gait.single_support))
        feet[swing] = step
    landed, final = SIDES.index(plan.steps[-1].side), gait.final_double_support
    supports.append(SupportPhase(final, (feet[1 - landed], feet[landed]), final))
    return tuple(supports)


@settings
class ZmpTarget:
    """Reference of the ZMP under a stance foot.

    Attributes:
        forward: Distance of the target ahead of the sole centre, m.
        inward: Distance of the target from the sole centre towards the other foot, m.
    """

    forward: Annotated[Number, "m"] = 0.0
    inward: Annotated[Number, "m"] = 0.0

    def under(self, foot: Footstep) -> complex:
        """Return the point under a foot in the world."""
        left = -self.inward if foot.side == "left" else self.inward
        return complex(foot.x, foot.y) + cmath.rect(1.0, foot.yaw) * complex(self.forward, left)


def zmp_reference(supports: Sequence[SupportPhase], target: ZmpTarget) -> list[complex]:
    """Return the points at the ends of supports of a ZMP that rests under stance feet and crosses over on both."""
    points = []
    for i, support in enumerate(supports):
        stance = support if support.single or i + 1 == len(supports) else supports[i + 1]
        under = [target.under(foot) for foot in stance.feet]
        points.append(sum(under) / len(under))
    return points


class HeightProfile:
    """Height of the support over time, with continuous acceleration; `height` is that of the CoM over it, m."""

    def __init__(self, supports: Sequence[SupportPhase], height: float, start: Pendulum) -> None:
        """Lay the profile through a schedule from now on: a CoM at a height over it, m, goes on without a jump."""
        self.height, events = height, _events(supports)
        state = float(start.com[2]) - height, float(start.com_velocity[2]), float(start.com_acceleration[2])
        self._path = QuinticPath(state)
        goal = math.nan
        for time, level, deadline in events:
            if abs(level - goal) < ROUNDING:
                continue
            rise = level - self._path.at(time)[0]
            duration = max(SHORTEST, deadline - time, rise / CLIMB)
            self._path.follow(time, (time + duration, (level, 0.0, 0.0)))
            goal = level

    def at(self, time: float) -> tuple[float, float, float]:
        """Return height (m), velocity (m/s) and acceleration (m/s²) at a time from now (s)."""
        return self._path.at(max(0.0, time))


def _events(supports: Sequence[SupportPhase]) -> list[tuple[float, float, float]]:
    """Changes of height in order, each as (time of its start, new level, time of its end); the first at time zero."""
    events = []
    time = 0.0
    for i, support in enumerate(supports):
        following = supports[i + 1] if i + 1 < len(supports) else None
        end = time + support.duration
        if support.single:
            level, lower = support.feet[0].z, _level(supports, min(i + 1, len(supports) - 1))
            middle = max(time, end - 0.5 * support.total)
            if following is not None and lower < level - DEEP:
                events.append((time, lower + STRETCH, end))
            else:
                events.append((time, level, middle))
                if following is not None and lower < level - ROUNDING:
                    events.append((middle, lower, end + following.duration))
        else:
            level, low = _level(supports, i), support.feet[0].z
            if following is not None and level > low + HIGH:
                events.append((time, low + STRETCH, end))
            else:
                extra = 0.5 * following.total if following is not None and level > low + ROUNDING else 0.0
                events.append((time, level, end + extra))
        time = end
    return events


def _level(supports: Sequence[SupportPhase], i: int) -> float:
    """Level at the end of a double support."""
    if i + 1 < len(supports):
        return supports[i + 1].feet[0].z
    left, right = supports[i].feet
    return 0.5 * (left.z + right.z)
