"""Supported area of a sole, as far as it is known: where the centre of pressure may go.

It is a point at first, and grows in all directions while the foot does not turn. Where the foot turns over an edge it
ends at the measured centre of pressure. On rough ground it is reduced on narrow soles, down to a point: it wins less
there than a wrong estimate costs. On ground that has been level in the last steps it is not, and grows sooner.
"""

from __future__ import annotations

from wbc.base.numbers import lag_gain
from wbc.base.vectors import Point, Vector
from wbc.walking.stepping.settings import AreaConstants


class HeldArea:
    """Area of the foot that stands, about its carrying point.

    Attributes:
        ahead: Edges behind and ahead, m.
        aside: Edges to the right and to the left, m.
        evenness: Share from 0 to 1 by which the ground counts as level.
    """

    evenness = 0.0

    def __init__(self, sole: tuple[float, float], constants: AreaConstants, dt: float) -> None:
        """Hold a point of a sole of half a length and half a width, m."""
        self._constants, self._dt = constants, dt
        self._spin_gain = lag_gain(dt, constants.spin_lag)
        self._centre = constants.carrying, 0.0
        least, full = constants.trusted
        trust = min(max((sole[1] - least) / (full - least), 0.0), 1.0)
        self._trust = trust
        half = [max(half - constants.margin, 0.0) for half in sole]
        self._most = [max(h - at, 0.0) for h, at in zip(half, self._centre, strict=True)]
        self._least = [min(-h - at, 0.0) for h, at in zip(half, self._centre, strict=True)]
        self.forget()

    def forget(self) -> None:
        """Begin with a point: nothing is known of the ground under the foot."""
        self.ahead, self.aside = [0.0, 0.0], [0.0, 0.0]
        self._spin = [0.0, 0.0]  # rates at which the ends of the sole's axes rise, low-passed, rad/s

    @property
    def width(self) -> float:
        """Half of the extent across the sole, m, as far as rough ground would have it."""
        return min(0.5 * (self.aside[1] - self.aside[0]), self.widest)

    @property
    def widest(self) -> float:
        """The greatest `width`, m."""
        return self._trust * self._most[1]

    def caught(self, share: float) -> tuple[Point, Point]:
        """Return the least and greatest offset of ξ, ahead and aside, that a share of the next sole holds, m.

        On level ground it is expected to be supported as far as the margin, on rough ground as far as it counts there.
        """
        trust = share * max(self._trust, self.evenness)
        (behind, right), (ahead, left) = self._least, self._most
        return (trust * behind, trust * ahead), (trust * right, trust * left)

    def update(self, tilting: Point, wrench: Vector, evenness: float) -> None:
        """Take in a tick: the rates at which the far and the left end of the sole rise, rad/s, and the wrench on it.

        The ground counts as level by a share from 0 to 1.
        """
        self.evenness = evenness
        constants, dt, gain = self._constants, self._dt, self._spin_gain
        self._spin = [spin + gain * (rate - spin) for spin, rate in zip(self._spin, tilting, strict=True)]
        _, _, force, roll, pitch, _ = wrench
        if force < constants.carries:
            return
        grown = constants.area_growth * (1.0 + constants.level_growth * evenness) * dt
        trust = max(self._trust, self.evenness)
        for i, (edges, moment) in enumerate(((self.ahead, -pitch), (self.aside, roll))):
            cop, spin = moment / force - self._centre[i], self._spin[i]
            if abs(spin) < constants.still:
                edges[0] = max(edges[0] - grown, trust * self._least[i])
                edges[1] = min(edges[1] + grown, trust * self._most[i])
            elif spin < -constants.turning:  # the far end goes down: it turns over the far edge
                edges[1] = max(0.0, min(edges[1], cop - constants.inside))
            elif spin > constants.turning:
                edges[0] = min(0.0, max(edges[0], cop + constants.inside))
