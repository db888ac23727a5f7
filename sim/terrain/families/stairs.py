"""Grounds without chance: flat floor, stairs, ramps."""
# ruff: noqa: D102 - overrides are documented where they are declared

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING
from wbc.base.settings import Positive
from wbc.sim.terrain.families.base import ShapeFamily, family, param
from wbc.sim.terrain.families.site import Site
from wbc.sim.terrain.ground import STRIP_DEPTH, flat_box
from wbc.sim.terrain.shapes import Box, Shape, tilted_rotation

Direction = Literal["up", "down", "up_down"]


@family("flat")
class Flat(ShapeFamily):
    """A flat floor."""

    default_amplitude = largest_amplitude = 0.0
    smallest_feature = math.inf
    unidirectional = True

    def shapes(self, site: Site) -> Iterator[Shape]:
        return iter(())


class _Climb(ShapeFamily):
    """Stairs or a ramp: a direction, and the levels that follow from it."""

    direction: Direction
    ramps, unidirectional = False, True

    def floor(self, site: Site) -> float:
        return -site.amplitude if self.direction == "down" else 0.0

    def stop(self, site: Site) -> float:
        return {"up": site.amplitude, "down": -site.amplitude, "up_down": 0.0}[self.direction]

    def _block(self, site: Site, x0: float, x1: float, level: float) -> Box:
        """Make a box as wide as the track from x0 to x1 with its top at `level` (m)."""
        return flat_box(x0, x1, site.width, level, self.floor(site))


@family("steps")
class Stairs(_Climb):
    """Stairs; the amplitude is the whole climb, divided into equal risers."""

    riser: Annotated[Positive, "m"] = param(0.03, "Greatest height of one step")
    tread: Annotated[Positive, "m"] = param(0.3, "Depth of one step", feature=1.0)
    landing: Annotated[Positive, "m"] = param(0.6, "Length of the top between climb and descent")
    direction: Direction = param("up_down", "Where the stairs lead")

    default_amplitude = 0.09

    def risers(self, amplitude: float) -> int:
        """Return the number of steps of one flight."""
        return max(1, math.ceil(amplitude / self.riser - ROUNDING))

    def rise_at(self, amplitude: float) -> float:
        return amplitude / self.risers(amplitude)

    def facts(self, site: Site) -> dict[str, Any]:
        n = self.risers(site.amplitude)
        return {"risers": n, "riser_m": site.amplitude / n}

    def shapes(self, site: Site) -> Iterator[Shape]:
        n = self.risers(site.amplitude)
        flight = (n - 1) * self.tread
        needed = 2.0 * flight + self.landing if self.direction == "up_down" else flight
        if needed > site.length + ROUNDING:
            raise InputError(
                f"stairs of {n} risers and {self.tread:g} m treads need a rough part of {needed:g} m, "
                f"got {site.length:g} m"
            )
        lead = (site.length - needed) / 2.0
        levels = [site.amplitude * i / n for i in range(n + 1)]
        x = site.x0 + lead
        blocks = [(self.tread, level) for level in levels[1:-1]]  # length and height of each
        if self.direction == "down":
            yield self._block(site, site.x0, x, 0.0)
            blocks = [(length, -level) for length, level in blocks]
        elif self.direction == "up_down":
            blocks = [*blocks, (self.landing, site.amplitude), *reversed(blocks)]
        for length, level in blocks:
            yield self._block(site, x, x + length, level)
            x += length
        if self.direction == "up":
            yield self._block(site, x, site.x1, site.amplitude)


@family("slope")
class Slope(_Climb):
    """A ramp up, or one up and one down with a level part between; the amplitude is its rise."""

    landing: Annotated[Positive, "m"] = param(0.6, "Length of the top between climb and descent", feature=1.0)
    direction: Direction = param("up_down", "Where the ramp leads")

    default_amplitude = 0.1

    def rise_at(self, amplitude: float) -> float:
        return 0.0  # a foot that goes along with the ramp meets nothing

    def _run(self, length: float) -> float:
        return (length - self.landing) / 2.0 if self.direction == "up_down" else length

    def check_track(self, length: float, width: float) -> None:
        if self._run(length) <= 0.0:
            raise InputError(
                f"slope: a landing of {self.landing:g} m leaves no ramp on a track of {length:g} m"
            )

    def facts(self, site: Site) -> dict[str, Any]:
        return {"angle_rad": math.atan2(site.amplitude, self._run(site.length))}

    def _ramp(self, site: Site, x0: float, z0: float, x1: float, z1: float) -> Box:
        """Make a tilted box whose upper face runs from (x0, z0) to (x1, z1), m."""
        rotation = tilted_rotation((z1 - z0) / (x1 - x0), 0.0)
        half = np.array([math.hypot(x1 - x0, z1 - z0) / 2.0, site.width / 2.0, STRIP_DEPTH])
        face = np.array([(x0 + x1) / 2.0, 0.0, (z0 + z1) / 2.0])
        return Box(face - rotation[:, 2] * half[2], half, rotation)

    def shapes(self, site: Site) -> Iterator[Shape]:
        h, run = site.amplitude, self._run(site.length)
        if self.direction == "up":
            yield self._ramp(site, site.x0, 0.0, site.x1, h)
        elif self.direction == "down":
            yield self._ramp(site, site.x0, 0.0, site.x1, -h)
        else:
            top = site.x0 + run
            yield self._ramp(site, site.x0, 0.0, top, h)
            yield self._block(site, top, site.x1 - run, h)
            yield self._ramp(site, site.x1 - run, h, site.x1, 0.0)
