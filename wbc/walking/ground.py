"""Estimate of the ground that feet land on: heights of the landings so far, and of the map that is seen.

    landing = ground.expect(planned)          at lift-off: height of a landing that is planned
    landing = ground.choose(landing)          whenever a landing has moved, or more is seen
    over = ground.way(start, landing)         highest ground on the way there
    ground.land(unexpected)                   what the landing has found

Nothing but `sight` sees; without it, and where it knows nothing, the landings alone count.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import pinocchio as pin

from wbc.core.robot import SIDES
from wbc.ground import KnownGround
from wbc.ground.footprint import Cost
from wbc.walking.plans.footsteps import Footstep

MEMORY = 0.9
"""Ratio of the unevenness that is remembered from step to step: grounds seldom end within a few steps."""

LAST_LOOK = 0.12
"""Time before touch-down from which on the height of a landing stays, s: the foot could no longer follow."""

NOTICED = 0.003
"""Change of the height of a landing from which on its swing is changed, m: less is noise of sensors, at any size."""

HIGHEST = 0.06
"""Greatest height by which the way raises the apex over the higher end, m: more is a wall, or an error."""


class GroundEstimate:
    """Estimate of the height of the ground over a plan, as landings find it and `sight` sees it.

    A foot that lands e higher than expected moves the next landings up by a share of e, and by a smaller share the rise
    that is expected from each step to the next: where the ground keeps rising, or the estimate drifts, feet would
    otherwise always land too early.

    Attributes:
        height: Height of the ground over that at which landings are planned, m; 0 once a plan from where the feet stand
            contains it. Free steps plan their landings at 0 in the world.
        rise: Growth of that height from step to step, m.
        uneven: Greatest height between the feet in the last steps, m.
        raised: Height by which `sight` put the last landing above where the landings so far would have it, m.
        sight: What is seen; None for a blind robot.
    """

    def __init__(self, height_share: float, rise_share: float, most: float = math.inf) -> None:
        """Expect the ground where the plan has it.

        The ratio `height_share` of the unexpected height of a landing moves the next landings, `rise_share` changes the
        rise. Ground that is seen more than `most` above or below the foot that stands, m, is out of the legs' reach and
        counts as unknown.
        """
        self._height_share, self._rise_share, self._most = height_share, rise_share, most
        self.sight: KnownGround | None = None
        self.forget()

    def forget(self) -> None:
        """Expect the ground where the next plan has it; `sight` stays."""
        self._stands = 0.0  # height of the foot that stands, m
        self._unexpected = 0.0  # height of the last landing over the expected one, m
        self._looked = -1  # version of what was seen
        self.height = self.rise = self.uneven = self.raised = 0.0

    def expect(self, planned: Footstep, allowed: Callable[[float, float], bool] | None = None) -> Footstep:
        """Return the landing of a swing that begins, on the ground that is expected or seen.

        The best place near it is chosen, of those that are `allowed` (x, y, m), unless it is None.
        """
        self.height += self.rise
        expected = replace(planned, z=planned.z + self.height)
        seen = self.choose(expected, allowed)
        self.raised = max(seen.z - expected.z, 0.0)
        if seen is not expected:
            self.height, self.rise = seen.z - planned.z, 0.0
        return seen

    def choose(
        self,
        landing: Footstep,
        allowed: Callable[[float, float], bool] | None = None,
        cost: Cost | None = None,
    ) -> Footstep:
        """Return the best place for a landing near it, of those that are `allowed` (x, y); its own place if None.

        `cost` of moving it adds to that of the distance. The landing is the same where nothing is known of the place,
        and where the legs do not reach it.
        """
        if self.sight is None:
            return landing
        self._looked = self.sight.version
        at = SIDES.index(landing.side), landing.x, landing.y, landing.yaw
        place = self.sight.support(*at) if allowed is None else self.sight.best(*at, allowed, cost)
        if place is None or abs(place.z - self._stands) > self._most:
            return landing
        along, across = place.slope
        return replace(
            landing, x=place.x, y=place.y, z=place.z, pitch=-math.atan(along), roll=math.atan(across)
        )

    def level(self, full: float, none: float) -> float:
        """Return the share from 1 to 0 by which the ground counts as level, up to `full` and from `none` uneven, m."""
        return min(max((none - self.uneven) / (none - full), 0.0), 1.0)

    @property
    def news(self) -> bool:
        """True if more is seen than when a landing was looked at last."""
        return self.sight is not None and self.sight.version != self._looked

    def way(self, start: pin.SE3, landing: Footstep) -> float:
        """Return the highest ground seen between a foot and its landing, m; −∞ where nothing is known."""
        if self.sight is None:
            return -math.inf
        side, from_ = SIDES.index(landing.side), start.translation
        over = float(self.sight.highest(side, from_[:2], landing.position[:2], landing.yaw))
        return min(over, max(float(from_[2]), landing.z) + HIGHEST)

    def lift(self, stance: int, placement: pin.SE3) -> None:
        """Begin a swing: what is seen is compared with the foot that stands, 0 left and 1 right."""
        self._stands = float(placement.translation[2])
        if self.sight is not None:
            self.sight.stand(stance, placement)

    def land(self, unexpected: float, between: float = 0.0) -> None:
        """Take in a landing: its height over the expected one, and the height between the feet, m."""
        self._unexpected = unexpected
        self.height += self._height_share * unexpected
        self.rise += self._rise_share * unexpected
        self.uneven = max(abs(between), MEMORY * self.uneven)

    def settled(self, steps: Sequence[Footstep], *, swings: bool) -> Sequence[Footstep]:
        """Return steps planned from where the feet stand now, on the expected ground; `height` is 0 for such a plan.

        `steps` are landings at the height of the last one; a foot that `swings` is where the ground is expected.
        """
        if swings or not self._unexpected:
            return steps
        down = (1.0 - self._height_share) * self._unexpected
        return [replace(step, z=step.z - down) for step in steps]
