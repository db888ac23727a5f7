"""Grounds covered with round stones: stones, small stones, cobble stones."""
# ruff: noqa: D102 - overrides are documented where they are declared

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from wbc.base.settings import Positive, Share
from wbc.sim.terrain.families.base import PositiveShare, ShapeFamily, family, param
from wbc.sim.terrain.families.site import Site
from wbc.sim.terrain.shapes import Shape, dome, stone


@family("stones")
class Stones(ShapeFamily):
    """Dense rubble of half ellipsoids, 60 to 150 mm long."""

    density: Annotated[Positive, "1/m2"] = param(90.0, "Stones on a square metre")
    smallest: Annotated[Positive, "m"] = param(0.06, "Shortest stone")
    largest: Annotated[Positive, "m"] = param(0.15, "Longest stone", at_least="smallest")
    slimmest: PositiveShare = param(0.6, "Least ratio of width to length")
    lowest: PositiveShare = param(0.5, "Lowest stone, as a share of the amplitude")

    @property
    def smallest_feature(self) -> float:
        return self.smallest * self.slimmest

    def shapes(self, site: Site) -> Iterator[Shape]:
        pitch = math.sqrt(2.0 / (math.sqrt(3.0) * self.density))
        points = site.hexagons(pitch, 0.3, self.largest / 2.0)
        n = len(points)
        tops = site.tops(n, self.lowest)
        longer = site.draws.uniform(self.smallest / 2.0, self.largest / 2.0, n)
        aspect = site.draws.uniform(self.slimmest, 1.0, n)
        yaws = site.draws.uniform(0.0, math.pi, n)
        for (x, y), top, a, share, yaw in zip(points, tops, longer, aspect, yaws, strict=True):
            yield stone(float(x), float(y), (float(a), float(a * share)), float(top), float(yaw))


@family("small_stones")
class SmallStones(Stones):
    """Gravel of half ellipsoids, 20 to 50 mm long and at most half as high as the longest is long."""

    density: Annotated[Positive, "1/m2"] = param(400.0, "Stones on a square metre")
    smallest: Annotated[Positive, "m"] = param(0.02, "Shortest stone")
    largest: Annotated[Positive, "m"] = param(0.05, "Longest stone", at_least="smallest")
    lowest: PositiveShare = param(0.4, "Lowest stone, as a share of the amplitude")

    default_amplitude = 0.02

    @property
    def largest_amplitude(self) -> float:
        return self.largest / 2.0


@family("cobble_stones")
class CobbleStones(ShapeFamily):
    """Round domes on an uneven hexagonal lattice, touching their neighbours."""

    pitch: Annotated[Positive, "m"] = param(0.18, "Distance between neighbours", feature=0.25)
    overlap: Share = param(0.1, "Overlap of a dome with its neighbour, over half the pitch")
    jitter: Annotated[float, Field(ge=0.0, le=0.5)] = param(
        0.08, "Greatest displacement, as a share of the pitch"
    )
    lowest: PositiveShare = param(0.6, "Lowest dome, as a share of the amplitude")

    def shapes(self, site: Site) -> Iterator[Shape]:
        radius = self.pitch / 2.0 * (1.0 + self.overlap)
        points = site.hexagons(self.pitch, self.jitter, radius)
        for (x, y), top in zip(points, site.tops(len(points), self.lowest), strict=True):
            yield dome(float(x), float(y), radius, float(top))
