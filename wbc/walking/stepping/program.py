"""Place, time and centre of pressure of a step by one quadratic program.

In the heading's axes, ahead and outwards (towards the foot that swings, and so mirrored from step to step), about the
carrying point of the stance foot, with the DCM ξ, the contact point z and the time t that is left:

    s0 + b0 = z + (ξ − z − d') τ + d0 (1 − τ') + d' τ'      τ = e^{ωt},  τ' and d' those of the last solution
    s1 + b1 = d1 + E (b0 − d1)                    E = e^{ωT}
    s2 + b2 = E b1
    min  |s − s*|² + c_τ (τ/τ* − 1)² + c_b |b − b*|² + c_d |d|²

That of s0 is s0 + b0 = z + (ξ − z) τ + d0 (1 − τ), linear about the last solution: where d' is past ξ, the centre of
pressure brings ξ back, and the more so the longer the step is. The equations of s1 and s2 are those ahead; outwards
their b0 and b1 on the right have the opposite sign, as outwards is the other side in the next step.

17 unknowns: three steps s from foot to foot, shifts d of the centre of pressure in this step and in the next, the time
as τ/τ*, and the offsets b of ξ from the feet that land. s* are the steps that are asked for, b* and τ* those of their
orbit. s, d and τ are bounded: by the reach of the legs, by the supported area of the sole
(`wbc.walking.stepping.felt`), and by the times that a swing needs.

With d = 0 and free places steps alone balance, so that the offset of an orbit is left; with places held and d within a
sole it is a walk along footsteps. Source of time and place in one program: Khadiv et al., IEEE T-RO 36(3), 2020.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import daqp
import numpy as np

from wbc.base.numbers import Array
from wbc.base.vectors import Point

PLACES, SHIFT, NEXT_SHIFT, TIME, OFFSETS = slice(0, 6), slice(6, 8), slice(8, 10), 10, slice(11, 17)
"""The unknowns, ahead and outwards in turn."""

COUNT, LAST_OFFSET = 17, slice(15, 17)
"""Number of the unknowns; those of the last offset."""

LANDING, NEXT, LAST = slice(0, 2), slice(2, 4), slice(4, 6)
"""The three steps: their places among the unknowns, and their equations among the rows."""

SOLVED = np.array((0, 1, 6, 7, 11, 12, TIME))
"""Those that decide this step: its landing, the shift of its centre of pressure, its offset and its time."""

COSTS = np.repeat((1.0, 0.02, 0.5, 0.082, 20.0, 100.0), (6, 2, 2, 1, 4, 2))
"""Costs of the unknowns, that of the time τ/τ* in h²: an offset that is not left grows by E in the next step, a centre
of pressure costs nearly nothing."""

AREA_COST = 1e-3
"""Cost of a shift of the centre of pressure over the whole area in the stiffness of a landing, of that of the time."""

SMALLEST = 1e-6
"""Least extent of an area in the stiffness of a landing, m."""

FREE, FAR = 100.0, 1e4
"""Bound of what is not bounded, m; that of the last offset over a landing that is held, of which an error has grown by
E² until then."""


class Now(NamedTuple):
    """The pendulum about the foot that stands, and the time that is left of the step."""

    dcm: Point  # ξ from the carrying point of the stance foot, ahead and outwards, m
    contact: Point  # contact point z, with its shift taken off, m
    omega: float  # natural frequency ω, 1/s
    left: float  # time that is left of a step of the time T, s: τ*
    last: float  # time that is left by the last solution, s: τ'
    shift: Point = (0.0, 0.0)  # shift of the centre of pressure by the last solution, m: d'

    @property
    def run(self) -> Point:
        """Offset of ξ from the contact point, which grows by e^{ωt}, m."""
        return self.dcm[0] - self.contact[0], self.dcm[1] - self.contact[1]

    def landing(self, time: float, wish: Wish) -> Point:
        """Return the place, ahead and outwards, m, from which ξ has the offset of a wish after a time, s."""
        grown, ((x, y), (u, v)) = math.exp(self.omega * time), (self.dcm, self.contact)
        return u + grown * (x - u) - wish.offsets[0], v + grown * (y - v) - wish.offsets[1]


class Wish(NamedTuple):
    """Steps that are asked for, ahead and outwards in turn."""

    places: tuple[float, ...]  # of three steps, from foot to foot, m
    offsets: tuple[float, ...]  # of ξ from the feet that land, m
    time: float  # of one step, s
    promised: bool = False  # true for footsteps: a landing moves only by what the next sole cannot catch


class Bounds(NamedTuple):
    """Limits of one step."""

    places: tuple[Point, Point]  # least and greatest place ahead and outwards, m
    area: tuple[Point, Point]  # least and greatest shift of the centre of pressure, ahead and outwards, m
    next_area: Point  # greatest shift of that of the next step, either way, m
    times: tuple[float, float]  # least and greatest time that is left, s

    def after(self, time: float) -> Bounds:
        """Return the same limits of a step for which a time, s, is left at least."""
        least, most = self.times
        return self._replace(times=(max(least, time), max(most, time)))

    def ending(self, time: float | None = None, places: tuple[Point, Point] | None = None) -> Bounds:
        """Return the same limits of a step that ends at a time, s, at its least one by default; at other places."""
        time = self.times[0] if time is None else max(time, 0.0)
        return self._replace(times=(time, time), places=places or self.places)

    def containing(self, places: Sequence[float]) -> Bounds:
        """Return limits that three steps are within, ahead and outwards in turn, m: footsteps may be close together."""
        (x, y), (u, v) = self.places
        ahead, outwards = places[::2], places[1::2]
        return self._replace(
            places=((min(x, *ahead), min(y, *outwards)), (max(u, *ahead), max(v, *outwards)))
        )


class Step(NamedTuple):
    """Solution, ahead and outwards."""

    place: Point  # landing s0, m
    shift: Point  # shift d of the centre of pressure in this step, m
    left: float  # time that is left, s
    offset: Point = (0.0, 0.0)  # offset b0 of ξ from the foot that lands, m


class StepProgram:
    """The program of one walk, its arrays made once.

    Attributes:
        x: The unknowns of the last solution, shape (17,).
    """

    def __init__(self, height: float) -> None:
        """Write what does not change, for a height h of the CoM, m."""
        self._costs = COSTS.copy()
        self._costs[TIME] *= height**2
        self._hessian, self._gradient, self.x = np.diag(self._costs), np.zeros(COUNT), np.zeros(COUNT)
        self._asked = np.zeros(COUNT)  # unknowns that are asked for
        self._asked[TIME] = 1.0
        self._rows = np.zeros((6, COUNT))
        self._sense = np.repeat(np.array((0, 5), np.int32), (COUNT, 6))  # 5: an equality
        self._rows[:, PLACES] = self._rows[:, OFFSETS] = np.eye(6)
        self._lower, self._upper = np.full(COUNT + 6, -FREE), np.full(COUNT + 6, FREE)
        self._lower[COUNT:] = self._upper[COUNT:] = 0.0

    def solve(
        self, now: Now, wish: Wish, bounds: Bounds, landing: tuple[Point, Point] | None = None
    ) -> Step | None:
        """Return the step; None if the solver fails.

        Args:
            now: State of the pendulum, and time that is left.
            wish: Steps that are asked for.
            bounds: Limits of this step, and of the next ones' places.
            landing: Least and greatest place of this step, m, in place of that of the bounds.
        """
        rows, low, high, (dcm, z, omega, left, last, shift) = self._rows, self._lower, self._upper, now
        growth, tau, before = math.exp(omega * wish.time), math.exp(omega * left), math.exp(omega * last)
        asked = self._asked
        asked[PLACES], asked[OFFSETS] = wish.places, wish.offsets
        np.multiply(self._costs, -asked, out=self._gradient)
        for i, mirror in enumerate((1.0, -1.0)):
            first, second, third = LANDING.start + i, NEXT.start + i, LAST.start + i
            rows[first, SHIFT.start + i] = before - 1.0
            rows[first, TIME] = -(dcm[i] - z[i] - shift[i]) * tau
            rows[second, NEXT_SHIFT.start + i] = growth - 1.0
            rows[second, OFFSETS.start + first] = rows[third, OFFSETS.start + second] = -growth * mirror
            low[COUNT + first] = high[COUNT + first] = z[i] + shift[i] * before
        (low[LANDING], high[LANDING]), (low[SHIFT], high[SHIFT]) = bounds.places, bounds.area
        low[NEXT] = low[LAST] = low[LANDING]
        high[NEXT] = high[LAST] = high[LANDING]
        far = FREE
        if landing is not None:
            (low[LANDING], high[LANDING]), far = landing, FAR
        low[LAST_OFFSET], high[LAST_OFFSET] = -far, far
        high[NEXT_SHIFT] = bounds.next_area
        np.negative(high[NEXT_SHIFT], out=low[NEXT_SHIFT])
        low[TIME], high[TIME] = (math.exp(omega * time) / tau for time in bounds.times)
        x, _, flag, _ = daqp.solve(self._hessian, self._gradient, rows, high, low, self._sense)
        if flag < 1:
            return None
        self.x = x
        s_ahead, s_out, d_ahead, d_out, b_ahead, b_out, grown = x[SOLVED].tolist()
        time = math.log(max(grown * tau, 1.0)) / omega
        return Step((s_ahead, s_out), (d_ahead, d_out), time, (b_ahead, b_out))

    def stiffness(self, area: tuple[Point, Point]) -> Array:
        """Return K, shape (2, 2), 1/m²: a landing that is held δ away from that of the last solution costs δᵀ K δ / 2.

        Of the bounds the least and the greatest shift of the centre of pressure, m, alone count: a shift costs the more
        the smaller the area is.
        """
        costs = self._costs.copy()
        size = np.maximum(np.subtract(area[1], area[0]), SMALLEST)
        costs[SHIFT] += AREA_COST * self._costs[TIME] / size**2
        rows = self._rows[:, 2:]
        compliance: Array = (rows / costs[2:]) @ rows.T
        stiffness: Array = np.linalg.inv(compliance)[:2, :2] + costs[0] * np.eye(2)
        return stiffness
