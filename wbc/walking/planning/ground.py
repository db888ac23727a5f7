"""Height of the ground over the plan, as the landings find it.

A foot that lands e higher than expected moves the next landings up by a fraction of e, and by a smaller fraction the
rise that is expected from each step to the next: where the ground keeps rising, or the estimate drifts, feet would
otherwise always land too early.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from wbc.walking.planning.footsteps import Footstep


class GroundEstimate:
    """Estimate of the height of the ground over the plan.

    Attributes:
        height: Height of the ground over the plan, m; 0 once a plan from where the feet stand contains it.
        rise: Growth of that height from step to step, m.
    """

    def __init__(self, height_share: float, rise_share: float) -> None:
        """Expect the ground where the plan has it.

        The ratio `height_share` of the unexpected height of a landing moves the next landings, `rise_share` changes the
        rise.
        """
        self._height_share, self._rise_share = height_share, rise_share
        self._unexpected = 0.0  # height of the last landing over the expected one, m
        self.height = self.rise = 0.0

    def expect(self, planned: Footstep) -> Footstep:
        """Return the landing of a swing that begins, on the expected ground."""
        self.height += self.rise
        return replace(planned, z=planned.z + self.height)

    def land(self, unexpected: float) -> None:
        """Update the estimate with the height of a landing over the expected one, m."""
        self._unexpected = unexpected
        self.height += self._height_share * unexpected
        self.rise += self._rise_share * unexpected

    def settled(self, steps: Sequence[Footstep], *, swings: bool) -> Sequence[Footstep]:
        """Return steps planned from where the feet stand now, on the expected ground; `height` is 0 for such a plan.

        `steps` are landings at the height of the last one; a foot that `swings` is where the ground is expected.
        """
        if swings or not self._unexpected:
            return steps
        down = (1.0 - self._height_share) * self._unexpected
        return [replace(step, z=step.z - down) for step in steps]
