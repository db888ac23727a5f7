"""Steps out of a push: which foot, where, and how many, so that the pendulum comes to rest over the feet.

Over a ZMP at rest in z the DCM runs away from it,

    ξ(T) = z + (ξ − z) e^{ωT},

so that the stance foot holds the DCM back best from its point next to it. For either foot the DCM at the landing is
predicted, the landing is put under it as far as the leg reaches, and where that is not far enough the other foot steps
on from there. The side that needs fewer steps wins, of two equal ones the shorter step.

Source: T. Koolen et al., "Capturability-based analysis and control of legged locomotion", IJRR 31(9), 2012.
"""

from __future__ import annotations

import math
from dataclasses import field, replace
from typing import Annotated

import numpy as np
from pydantic import Field

from wbc.core.arguments import checked
from wbc.core.errors import Array
from wbc.core.settings import NonNegative, Positive, Share, settings
from wbc.walking.planning.footsteps import SIDES, Footstep, FootstepPlan, other
from wbc.walking.planning.gait import Gait
from wbc.walking.planning.reach import Reach
from wbc.walking.planning.schedule import SoleSizes, support_area


def _quick() -> Gait:
    return Gait(
        single_support=0.28,
        double_support=0.06,
        initial_double_support=0.02,
        final_double_support=0.6,
        swing_height=0.04,
        takeoff_time=0.03,
        landing_time=0.05,
        landing_speed=0.2,
        landing_height=0.0,
        search_time=0.1,
    )


def _straight() -> Gait:
    return replace(_quick(), swing_height=0.03, apex=0.5)


@settings
class CaptureSettings:
    """Settings of steps out of a push.

    Attributes:
        trigger: Distance of the DCM beyond the edge of the soles from which a standing robot steps, m.
        debounce: Time beyond that distance before it steps, s.
        inside: Distance of the DCM inside the edge of the soles at which a foot that has landed is enough, m.
        margin: Distance of the ZMP from the edge of a stance foot in predictions, m.
        beyond: Distance by which a landing is put beyond the predicted DCM, m.
        aside: Distance by which a landing is put outward of the predicted DCM, m: as in a walk, where the DCM stays
            between the feet.
        reach: Share of the legs' reach that steps may use.
        steps: Greatest number of steps predicted.
        again: Time between predictions while both feet stand, s.
        quickest: Time of a step of no length, s.
        step_speed: Length of a step over the time that it takes beyond that, m/s; at most `gait.single_support`.
        least_change: Change of landing below which a foot in the air goes on as planned, m.
        aim_until: Time before touch-down until which a landing is moved, s.
        sink: Depth under its landing at which a foot arrives unless it meets the ground before, m: a robot that tips
            over the edge of its stance foot holds the other one up.
        wait: Longest time that a loaded foot delays its lift-off, s.
        gait: Timings and swing.
        straight: Distance to the side per distance ahead or back up to which a DCM counts as pushed straight; the three
            below are for such pushes, in position control.
        straight_gait: Timings and swing; all steps take as long.
        base_time: Time constant with which the base of the commanded robot is drawn to the estimated one, s.
        height_weight: Cost of the height of the CoM per (m/s²)² for pushes to the front.
    """

    trigger: Annotated[float, "m"] = -0.01
    debounce: Annotated[NonNegative, "s"] = 0.01
    inside: Annotated[float, "m"] = 0.02
    margin: Annotated[NonNegative, "m"] = 0.015
    beyond: Annotated[NonNegative, "m"] = 0.02
    aside: Annotated[NonNegative, "m"] = 0.035
    reach: Share = 1.0
    steps: Annotated[int, Field(ge=1, le=6)] = 3
    again: Annotated[Positive, "s"] = 0.02
    quickest: Annotated[NonNegative, "s"] = 0.15
    step_speed: Annotated[Positive, "m/s"] = 3.0
    least_change: Annotated[NonNegative, "m"] = 0.005
    aim_until: Annotated[NonNegative, "s"] = 0.06
    sink: Annotated[NonNegative, "m"] = 0.015
    wait: Annotated[NonNegative, "s"] = 0.0
    gait: Gait = field(default_factory=_quick)
    straight: NonNegative = 0.4
    straight_gait: Gait = field(default_factory=_straight)
    base_time: Annotated[Positive, "s"] = 0.08
    height_weight: Positive = 1000.0

    def for_straight(self) -> CaptureSettings:
        """Return the settings with the gait for pushes straight ahead or back."""
        gait = self.straight_gait
        return replace(self, gait=gait, quickest=gait.single_support)


class CaptureSteps:
    """Planner of steps out of a push, for one robot.

    Attributes:
        settings: Settings.
    """

    @checked
    def __init__(
        self,
        omega: float,
        reach: Reach,
        sizes: SoleSizes,
        spacing: float,
        settings: CaptureSettings | None = None,
    ) -> None:
        """Keep the robot's figures.

        Args:
            omega: Natural frequency, 1/s.
            reach: Reach of the legs.
            sizes: (length, width) of the left and of the right sole, m.
            spacing: Lateral distance between the soles' centres of a robot that stands, m.
            settings: Settings; the defaults when None.
        """
        self.settings = settings or CaptureSettings()
        self._omega, self._reach, self._sizes, self._spacing = omega, reach, sizes, spacing

    def pushed_straight(self, dcm: Array, start: FootstepPlan) -> float:
        """Return the distance of a DCM ahead of the middle of both feet, m; 0 if it has left to the side.

        Args:
            dcm: DCM in the world, shape (2,) or (3,), m.
            start: Feet on the ground.
        """
        yaw = start.left.yaw + 0.5 * math.remainder(start.right.yaw - start.left.yaw, 2.0 * math.pi)
        x = float(dcm[0]) - 0.5 * (start.left.x + start.right.x)
        y = float(dcm[1]) - 0.5 * (start.left.y + start.right.y)
        ahead, aside = math.cos(yaw) * x + math.sin(yaw) * y, math.cos(yaw) * y - math.sin(yaw) * x
        return ahead if abs(aside) <= self.settings.straight * abs(ahead) else 0.0

    def outside(self, dcm: Array, start: FootstepPlan) -> float:
        """Return the distance of a DCM (shape (2,) or (3,), m) beyond the hull of both soles, m; negative inside."""
        return _beyond(dcm, (start.left, start.right), self._sizes)

    def footsteps(self, dcm: Array, start: FootstepPlan, first: str | None, wait: float) -> FootstepPlan:
        """Return the feet with the steps that catch a DCM, and the one that closes up.

        Args:
            dcm: DCM now, in the world, shape (2,) or (3,), m.
            start: Feet on the ground.
            first: Side that steps next; None for either.
            wait: Time until it lifts off, s.
        """
        best: tuple[tuple[float, ...], tuple[Footstep, ...]] | None = None
        for side in SIDES if first is None else (first,):
            steps, missing = self._from(np.asarray(dcm, dtype=float)[:2], start, side, wait)
            stance = start.right if side == "left" else start.left
            cost = (len(steps), missing, math.hypot(steps[0].x - stance.x, steps[0].y - stance.y))
            if best is None or cost < best[0]:
                best = cost, steps
        assert best is not None
        steps = best[1]
        return replace(start, steps=(*steps, self._closing(start, steps)), gait=self.settings.gait)

    def landing(self, dcm: Array, stance: Footstep, planned: Footstep, remaining: float) -> Footstep:
        """Return the landing of a foot in the air that catches a DCM: the planned one where that is near enough.

        Args:
            dcm: DCM now, in the world, shape (2,) or (3,), m.
            stance: Foot on the ground.
            planned: Landing as planned.
            remaining: Time to touch-down, s.
        """
        s = self.settings
        now = np.asarray(dcm, dtype=float)[:2]
        rest = _nearest(now, (stance,), self._sizes, s.margin)
        then = rest + (now - rest) * math.exp(self._omega * remaining)
        if _beyond(then, (stance, planned), self._sizes) < -s.inside:
            return planned
        landing = self._landing(then, stance, planned.side)
        return replace(landing, z=planned.z)

    def _from(
        self, dcm: Array, start: FootstepPlan, side: str, wait: float
    ) -> tuple[tuple[Footstep, ...], float]:
        """Steps that begin with a side, and the distance by which the last one misses the DCM."""
        s, omega = self.settings, self._omega
        feet = {"left": start.left, "right": start.right}
        steps: list[Footstep] = []
        missing = math.inf
        grow = math.exp(omega * s.gait.single_support)
        while len(steps) < s.steps:
            stance = feet[other(side)]
            # On both feet the ZMP goes from the point next to the DCM to the stance foot.
            hold = _nearest(dcm, tuple(feet.values()), self._sizes, s.margin)
            rest = _nearest(dcm, (stance,), self._sizes, s.margin)
            shift = 0.5 * (hold + rest)
            dcm = shift + (dcm - shift) * math.exp(omega * wait)
            rest = _nearest(dcm, (stance,), self._sizes, s.margin)
            dcm = rest + (dcm - rest) * grow
            landing = self._landing(dcm, stance, side)
            steps.append(landing)
            feet[side] = landing
            missing = _beyond(dcm, (stance, landing), self._sizes) + s.margin
            if missing <= 0.0:
                break
            side, wait = other(side), s.gait.double_support
        return tuple(steps), max(missing, 0.0)

    def _landing(self, dcm: Array, stance: Footstep, side: str) -> Footstep:
        """Landing under a DCM, as far as the leg reaches from the stance foot."""
        s, r = self.settings, self._reach
        c, sn = math.cos(stance.yaw), math.sin(stance.yaw)
        dx, dy = float(dcm[0]) - stance.x, float(dcm[1]) - stance.y
        forward, outward = c * dx + sn * dy, c * dy - sn * dx
        sign = 1.0 if side == "left" else -1.0
        forward += math.copysign(min(s.beyond, abs(forward)), forward)
        outward *= sign
        width = self._sizes[SIDES.index(stance.side)][1]
        # Feet stay apart unless the DCM runs away over the outer edge of the stance foot: then the other one closes up.
        least = r.min_spacing if outward < s.margin - 0.5 * width else self._spacing
        outward += s.aside
        longest = s.reach * r.max_length
        forward = max(-longest, min(longest, forward))
        outward = max(least, min(s.reach * r.max_spacing, outward)) * sign
        return Footstep(
            side,
            stance.x + c * forward - sn * outward,
            stance.y + sn * forward + c * outward,
            stance.z,
            stance.yaw,
        )

    @staticmethod
    def _closing(start: FootstepPlan, steps: tuple[Footstep, ...]) -> Footstep:
        """Landing of the other foot beside the last one."""
        last = steps[-1]
        offset = start.spacing if last.side == "right" else -start.spacing
        c, s = math.cos(last.yaw), math.sin(last.yaw)
        return replace(last, side=other(last.side), x=last.x - s * offset, y=last.y + c * offset)


def _beyond(point: Array, feet: tuple[Footstep, ...], sizes: SoleSizes) -> float:
    """Distance of a point beyond the hull of soles, m; negative inside."""
    normals, offsets = support_area(feet, sizes)
    needed = normals.any(axis=1)
    return float((normals[needed] @ np.asarray(point, dtype=float)[:2] - offsets[needed]).max())


def _nearest(point: Array, feet: tuple[Footstep, ...], sizes: SoleSizes, margin: float) -> Array:
    """Point of the hull of soles, less a margin, next to a point, shape (2,), m."""
    normals, offsets = support_area(feet, sizes, margin)
    place = np.array(point, dtype=float)
    for _ in range(8):  # onto the edge that is crossed furthest, again and again
        over = normals @ place - offsets
        worst = int(over.argmax())
        if over[worst] <= 1e-9:
            break
        place -= over[worst] * normals[worst]
    return place
