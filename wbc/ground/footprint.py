"""Footprint of a sole at a place: height of its first contact, plane of its rest, and the ground on its way.

The sole is a grid of nodes. It touches first at the highest of them; the height is taken as the mean over small errors
of the place, because neither map nor landing is exact: a tip under the middle of the sole counts in full, an edge under
its rim by half. Under a load a rigid sole comes to rest on the plane that carries it and is lowest at the load.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, Share, settings
from wbc.ground.height_map import Places

NODE = (0.02, 0.012)
"""Distance between nodes along and across the sole, m."""

MOVES, FAR = (2, 2), (5, 2)
"""Number of nodes by which a place may be moved along and across: 40 and 24 mm; at a high edge 100 mm along."""

HIGH, HANGING = 0.08, 0.2
"""Height over which an edge is high, m: no sole rests over it; share of a sole that may hang over one."""

SLOPES = np.array([-0.36, -0.26, -0.18, -0.11, -0.05, 0.0, 0.05, 0.11, 0.18, 0.26, 0.36])
"""Slopes of resting planes along and across the sole."""

LOADS = np.array([[0.0, 0.03, -0.03, 0.0, 0.0], [0.0, 0.0, 0.0, 0.02, -0.02]])
"""Places of the loads under which a sole should rest quietly: at its centre and about it, along and across, m."""

LOOSE = 0.003
"""Height over that of the first contact up to which a single height counts for the resting plane, m."""

ACROSS = 1.5
"""Weight of a tilt across the sole over that of one along it: the sole is narrow."""

NOTHING = -1e3
"""Height of unknown ground for a resting plane, m: it carries nothing."""

Cost = Callable[[Places], Array]
"""Moves of a landing u + iv in the axes of its sole, m → their costs, m; infinite for one that is not allowed."""

Heights = Callable[[Places], tuple[Array, Array]]
"""Places x + iy, m → heights, NaN where unknown, and their standard deviations, m."""


@settings
class FootprintSettings:
    """Settings of the choice of a landing on known ground.

    Attributes:
        least_known: Least share of known ground under a sole; with less the ground is unknown.
        trust: Number of standard deviations by which each height is lowered, so that noise does not raise the
            highest point.
        tilt_cost: Cost of the mean tilt of the planes on which the sole may rest, m/rad.
        distance: Cost of moving a landing, m/m.
        move: Cost of any move of a landing, however small, m.
        edge: Cost of a place whose neighbours, one node away, touch the ground at another height, m/m.
        tilt: Greatest tilt of a landing, rad; 0 keeps the sole level.
        choice: True to choose another place nearby where the sole rests better.
        way: True for a swing that clears the highest ground on its way.
    """

    least_known: Share = 0.35
    trust: NonNegative = 1.5
    tilt_cost: Annotated[NonNegative, "m/rad"] = 0.1
    distance: Annotated[NonNegative, "m/m"] = 0.15
    move: Annotated[NonNegative, "m"] = 0.002
    edge: Annotated[NonNegative, "m/m"] = 0.2
    tilt: Annotated[NonNegative, "rad"] = 0.0
    choice: bool = True
    way: bool = True


class Support(NamedTuple):
    """Ground under a sole.

    Attributes:
        x: x of the sole centre in the world, m.
        y: y of the sole centre in the world, m.
        z: Height of the centre of a level sole at the first contact, m.
        slope: Slopes of the resting plane along and across the sole, within the greatest tilt.
    """

    x: float
    y: float
    z: float
    slope: tuple[float, float]


class _Lattice:
    """Nodes about a sole, and those that it covers when it is moved by some of them.

    Attributes:
        nodes: Place of each node, row by row from the heel, as u + iv in the axes of the sole, m.
        soles: Nodes under the sole at each of its places, shape (places, nodes of the sole).
        moves: Displacement of each place with all places about it, as u + iv, m.
        inner: These places, as rows of `soles`.
        around: The nine places within a node of each of them, itself in the middle, as rows of `soles`.
    """

    def __init__(self, size: tuple[int, int], step: tuple[float, float], moves: tuple[int, int]) -> None:
        (nu, nv), (du, dv), (n, m) = size, step, (moves[0] + 1, moves[1] + 1)
        u = du * (np.arange(nu + 2 * n) - 0.5 * (nu - 1) - n)
        v = dv * (np.arange(nv + 2 * m) - 0.5 * (nv - 1) - m)
        self.nodes = (u[:, None] + 1j * v).ravel()
        number = np.arange(self.nodes.size).reshape(u.size, v.size)
        self.soles = sliding_window_view(number, size).reshape(-1, nu * nv)
        places = np.arange(len(self.soles)).reshape(2 * n + 1, 2 * m + 1)
        self.inner = places[1:-1, 1:-1].ravel()
        self.around = sliding_window_view(places, (3, 3)).reshape(-1, 9)
        self.moves = (du * np.arange(1 - n, n)[:, None] + 1j * dv * np.arange(1 - m, m)).ravel()


class Footprint:
    """Questions about the ground under one sole."""

    def __init__(self, length: float, width: float, settings: FootprintSettings | None = None) -> None:
        """Lay nodes over a sole of a length and a width, m."""
        self.settings = settings or FootprintSettings()
        size = nu, nv = max(round(length / NODE[0]), 2) + 1, max(round(width / NODE[1]), 2) + 1
        step = length / (nu - 1), width / (nv - 1)
        self._near, *self._wide = (_Lattice(size, step, moves) for moves in ((0, 0), MOVES, FAR))
        self._sole = self._near.nodes[self._near.soles[4]]
        self._inside = np.arange(nu * nv).reshape(size)[1:-1, 1:-1].ravel()
        # Resting planes are found over blocks of two by two nodes, whose highest counts: a quarter of the work.
        rows, columns = (np.minimum(np.arange(0, n, 2)[:, None] + (0, 1), n - 1) for n in size)
        self._blocks = (rows[:, None, :, None] * nv + columns[None, :, None, :]).reshape(-1, 4)
        middle = self._sole[self._blocks].mean(axis=1)
        self._slopes = np.stack([a.ravel() for a in np.meshgrid(SLOPES, SLOPES)], axis=1)
        self._planes = (self._slopes @ (middle.real, middle.imag)).astype(np.float32)
        self._under_loads = (self._slopes @ LOADS).T.astype(np.float32)

    def support(self, ground: Heights, x: float, y: float, yaw: float) -> Support | None:
        """Return the ground under a sole at a place, m and rad, in the world; None where too little is known."""
        low = self._low(ground, self._near.nodes, x, y, yaw)
        top, _ = _first_contacts(low, self._near)
        return self._support(low[self._near.soles[4]], float(top[0]), x, y)

    def best(
        self,
        ground: Heights,
        x: float,
        y: float,
        yaw: float,
        allowed: Callable[[float, float], bool],
        cost: Cost | None = None,
    ) -> Support | None:
        """Return the ground at the best place near a place: where the sole rests quietly, not far away.

        If high edges leave none nearby that holds the sole, one further along is taken that does.
        """
        s, turn = self.settings, complex(math.cos(yaw), math.sin(yaw))
        if not s.choice:
            return self.support(ground, x, y, yaw)

        def choose(lattice: _Lattice, strict: bool) -> tuple[Support | None, bool]:
            """Return the cheapest place of a lattice, of those that hold the sole if `strict`, and if it does."""
            low, moves = self._low(ground, lattice.nodes, x, y, yaw), lattice.moves
            soles, (top, spread) = low[lattice.soles[lattice.inner]], _first_contacts(low, lattice)
            hanging = (soles < top[:, None] - HIGH).mean(axis=1)  # or in the shadow of the edge
            holds = ((hanging <= HANGING) & (spread <= HIGH)) | (low[low > NOTHING] >= low.max() - HIGH).all()
            usable = ((soles > NOTHING).mean(axis=1) >= s.least_known) & (holds | (not strict))
            moving = s.distance * np.abs(moves) + s.move * (moves != 0.0)
            if cost is not None:
                moving += cost(moves)
            costs = s.tilt_cost * self._mean_tilt(soles, top) + s.edge * spread + moving
            for k in np.argsort(np.where(usable, costs, np.inf), kind="stable").tolist():
                place = complex(complex(x, y) + turn * moves[k])
                if usable[k] and (moves[k] == 0.0 or allowed(place.real, place.imag)):
                    return self._support(soles[k], float(top[k]), place.real, place.imag), bool(holds[k])
            return None, False

        near, held = choose(self._wide[0], strict=False)
        return near if near is None or held else choose(self._wide[1], strict=True)[0] or near

    def highest(self, ground: Heights, places: Places, yaw: float) -> float:
        """Return the highest ground under a sole at any of some places x + iy, m; −inf where nothing is known."""
        if not self.settings.way:
            return -math.inf
        nodes = (places[:, None] + self._sole * complex(math.cos(yaw), math.sin(yaw))).ravel()
        z, std = ground(nodes)
        return float(np.fmax.reduce(z - self.settings.trust * std, initial=-math.inf))

    def over(self, ground: Heights, place: Array, rotation: Array) -> tuple[float, float, float]:
        """Return how high the ground is over a sole that stands: where it carries, at most, and inside the rim, m.

        The sole has a place, shape (3,), m, and a rotation to the world, shape (3, 3). Ground beside an edge may lie in
        the rim by an error of the place; inside, half of the nodes are below the last value. All are NaN where too
        little is known.
        """
        nodes = rotation[:, :2] @ (self._sole.real, self._sole.imag) + place[:, None]
        z, std = ground(nodes[0] + 1j * nodes[1])
        over = z - self.settings.trust * std - nodes[2]
        inside = over[self._inside]
        if np.isnan(over).mean() > 1.0 - self.settings.least_known or np.isnan(inside).all():
            return math.nan, math.nan, math.nan
        return float(np.nanquantile(over, 0.95)), float(np.nanmax(over)), float(np.nanmedian(inside))

    def _low(self, ground: Heights, nodes: Places, x: float, y: float, yaw: float) -> Array:
        """Return lower bounds of the heights at nodes about a place; `NOTHING` where unknown."""
        z, std = ground(complex(x, y) + nodes * complex(math.cos(yaw), math.sin(yaw)))
        low = z - self.settings.trust * std
        low[np.isnan(low)] = NOTHING
        return low

    def _support(self, low: Array, top: float, x: float, y: float) -> Support | None:
        if (low > NOTHING).mean() < self.settings.least_known:
            return None
        most, a, b = self.settings.tilt, 0.0, 0.0
        if most > 0.0:
            resting = self._resting(low[None], np.array([top]))[0]
            a, b = self._slopes[int(np.argmin(resting))].tolist()
        return Support(x, y, top, (min(max(a, -most), most), min(max(b, -most), most)))

    def _resting(self, low: Array, top: Array) -> Array:
        """Return the height of the centre of each plane that carries the sole, over its first contact, m.

        Heights under the nodes have shape (places, nodes), those of the first contacts (places,), the result
        (places, planes).
        """
        highest = low[:, self._blocks].max(axis=2)
        z = np.minimum(highest - top[:, None], LOOSE).astype(np.float32)
        return np.asarray((z[:, None] - self._planes).max(axis=2))

    def _mean_tilt(self, low: Array, top: Array) -> Array:
        """Return the mean tilt of the planes on which a sole rests under the loads, shape (places,), rad."""
        lowest = self._resting(low, top)
        rest = np.argmin(lowest[:, None] + self._under_loads, axis=2)  # (places, loads)
        return np.asarray(np.hypot(*(self._slopes[rest] * (1.0, ACROSS)).transpose(2, 0, 1)).mean(axis=1))


def _first_contacts(low: Array, lattice: _Lattice) -> tuple[Array, Array]:
    """Return the height of first contact at each inner place, m: the mean over the nine about it, and their range."""
    tops = low[lattice.soles].max(axis=1)
    nine = tops[lattice.around]
    nine = np.where(nine > NOTHING, nine, nine[:, 4:5])
    return np.asarray(nine.mean(axis=1)), np.asarray(np.ptp(nine, axis=1))
