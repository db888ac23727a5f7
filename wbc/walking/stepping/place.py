"""Place of a landing near that of the law, and what it costs the balance to move it there.

The law lands at u = p + (ξ − p) e^{ωt} − b after the time t. A landing that is moved by d uses two freedoms:

    time      the step lasts s/ω longer: u moves by s g along the growth of ξ, g = (ξ − p) e^{ωt}; b is left as it is
    offset    the rest r = d − s g is missing in the offset that is left, b − r

The next step grows an offset by E = e^{ωT}: aside it is only shorter or longer for it, by ln(b_y / (b_y − r_y)) / ω, so
that b_y − r_y is kept within shares of b_y; ahead its own landing moves by (E − 1) r_x the other way. The move costs
a s² + c |r|² with the s for which that is least, s = c d·g / (a + c |g|²).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc.core.errors import Array
from wbc.ground.height_map import Places
from wbc.walking.stepping.law import Orbit, Point, SteppingConstants


class LandingShift(NamedTuple):
    """Move of a landing from the place of the law.

    Attributes:
        by: Move ahead and outwards, away from the stance foot, m.
        later: Time s by which the step is longer, 1/ω.
        ahead: Offset r_x that is missing ahead, m.
        outwards: Offset r_y by which the landing is further outwards, m.
    """

    by: complex = 0j
    later: float = 0.0
    ahead: float = 0.0
    outwards: float = 0.0


class Moves:
    """Moves of one landing ahead and outwards, as complex numbers, m; called with moves, it returns their costs."""

    def __init__(
        self, growth: Point, times: Point, orbit: Orbit, now: complex, constants: SteppingConstants
    ) -> None:
        """Weigh moves of a landing that goes to the move `now`, m.

        `growth` is g ahead and outwards, m; `times` are the least and the greatest s that the time of the step allows.
        """
        self._growth, self._orbit, self._now, self._c = complex(*growth), orbit, now, constants
        most = constants.most_later
        self._least, self._most = min(max(times[0], -most), 0.0), max(min(times[1], most), 0.0)

    def __call__(self, by: Places) -> Array:
        """Return the cost of each move, m; infinite beyond what the balance allows."""
        c, (later, left) = self._c, self._split(by)
        aside = left.imag / self._orbit.inwards
        far = (np.abs(left.real) > c.most_ahead) | (aside < -c.most_inwards) | (aside > c.most_outwards)
        cost = c.time_cost * later**2 + c.offset_cost * np.abs(left) ** 2
        cost += c.change * np.abs(by - self._now) + c.move * (by != 0.0)
        return np.where(far & (by != 0.0), np.inf, cost)

    def at(self, by: complex) -> LandingShift:
        """Return how a landing is moved."""
        later, left = self._split(np.array(by))
        return LandingShift(by, float(later), float(left.real), float(left.imag))

    def _split(self, by: Places) -> tuple[Array, Places]:
        """Return the times s and the offsets r of moves."""
        c, g = self._c, self._growth
        later = c.offset_cost * (by * g.conjugate()).real / (c.time_cost + c.offset_cost * abs(g) ** 2)
        later = np.clip(later, self._least, self._most)
        return later, by - later * g
