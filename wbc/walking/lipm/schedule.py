"""Schedule of the supports of a plan, with the area and the reference of the ZMP on each of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np

from wbc.base.errors import InputError
from wbc.base.hull import convex_hull
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import Number, settings
from wbc.walking.plans.footsteps import Footstep, FootstepPlan, SoleSizes

EDGES = 8
"""Number of half-planes of a support area; the hull of two rectangles never has more."""


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

    def under(self, foot: Footstep) -> tuple[float, float]:
        """Return the point under a foot, x and y in the world, m."""
        forward, side = self.in_sole(foot.side)
        c, s = math.cos(foot.yaw), math.sin(foot.yaw)
        return foot.x + c * forward - s * side, foot.y + s * forward + c * side


def zmp_reference(supports: Sequence[SupportPhase], target: ZmpTarget, start: Array) -> tuple[Array, Array]:
    """Return times (s) and points (m) of a ZMP that rests under stance feet and crosses over on both, from that now."""
    times, points = [0.0], [tuple(np.asarray(start, dtype=float).tolist())]
    for i, support in enumerate(supports):
        if support.single:
            goal = target.under(support.feet[0])
        elif i + 1 < len(supports):
            goal = target.under(supports[i + 1].feet[0])
        else:
            (x, y), (u, v) = target.under(support.feet[0]), target.under(support.feet[1])
            goal = 0.5 * (x + u), 0.5 * (y + v)
        times.append(times[-1] + support.duration)
        points.append(goal)
    return np.array(times), np.array(points)


@lru_cache(maxsize=256)
def support_area(feet: tuple[Footstep, ...], sizes: SoleSizes, margin: float = 0.0) -> tuple[Array, Array]:
    """Return half-planes N z ≤ d of the area of one or two feet less a margin, m: shapes (8, 2), (8,).

    Rows that are not needed are zero with d = 1. Cached: do not write into them.
    """
    corners = []
    for foot in feet:
        length, width = sizes[0] if foot.side == "left" else sizes[1]
        if 2.0 * margin >= min(length, width):
            raise InputError(f"a margin of {margin:g} m leaves nothing of a sole of {length:g} × {width:g} m")
        c, s = math.cos(foot.yaw), math.sin(foot.yaw)
        for fx, fy in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
            x, y = fx * (0.5 * length - margin), fy * (0.5 * width - margin)
            corners.append((foot.x + c * x - s * y, foot.y + s * x + c * y))
    # 1e-9 m² drops corners on an edge, such as those of parallel feet side by side.
    hull = convex_hull(corners, tolerance=ROUNDING)
    normals, offsets = np.zeros((EDGES, 2)), np.ones(EDGES)
    for row, (a, b) in enumerate(zip(hull, np.roll(hull, -1, axis=0), strict=True)):
        edge = np.array([b[0] - a[0], b[1] - a[1]])
        normals[row] = np.array([edge[1], -edge[0]]) / np.hypot(*edge)
        offsets[row] = normals[row] @ a
    normals.setflags(write=False)
    offsets.setflags(write=False)
    return normals, offsets
