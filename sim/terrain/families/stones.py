"""Grounds covered with round stones: stones, small stones, cobble stones."""
# ruff: noqa: D102 - overrides are documented where they are declared

from __future__ import annotations

import math
from collections.abc import Iterator

from wbc.core.errors import InputError
from wbc.sim.terrain.families.base import ShapeFamily, family, param
from wbc.sim.terrain.families.site import Site
from wbc.sim.terrain.families.solids import dome, stone
from wbc.sim.terrain.shapes import Shape


def _rubble(
    site: Site, density: float, smallest: float, largest: float, slimmest: float, lowest: float
) -> Iterator[Shape]:
    """Lay half ellipsoids of random size and heading on a jittered lattice."""
    pitch = math.sqrt(2.0 / (math.sqrt(3.0) * density))
    points = site.hexagons(pitch, 0.3, largest / 2.0)
    n = len(points)
    tops = site.tops(n, lowest)
    longer, aspect = (
        site.draws.uniform(smallest / 2.0, largest / 2.0, n),
        site.draws.uniform(slimmest, 1.0, n),
    )
    yaws = site.draws.uniform(0.0, math.pi, n)
    for (x, y), top, a, share, yaw in zip(points, tops, longer, aspect, yaws, strict=True):
        yield stone(float(x), float(y), (float(a), float(a * share)), float(top), float(yaw))


@family("stones")
class Stones(ShapeFamily):
    """Dense rubble of half ellipsoids, 60 to 150 mm long."""

    density: float = param(90.0, "1/m2", "Stones on a square metre", open_low=True)
    smallest: float = param(0.06, "m", "Shortest stone", open_low=True)
    largest: float = param(0.15, "m", "Longest stone", open_low=True)
    slimmest: float = param(0.6, "1", "Least ratio of width to length", high=1.0, open_low=True)
    lowest: float = param(0.5, "1", "Lowest stone, as a share of the amplitude", high=1.0, open_low=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        _sized(self.name, self.smallest, self.largest)

    @property
    def smallest_feature(self) -> float:
        return self.smallest * self.slimmest

    def shapes(self, site: Site) -> Iterator[Shape]:
        yield from _rubble(site, self.density, self.smallest, self.largest, self.slimmest, self.lowest)


@family("small_stones")
class SmallStones(ShapeFamily):
    """Gravel of half ellipsoids, 20 to 50 mm long and at most half as high as the longest is long."""

    density: float = param(400.0, "1/m2", "Stones on a square metre", open_low=True)
    smallest: float = param(0.02, "m", "Shortest stone", open_low=True)
    largest: float = param(0.05, "m", "Longest stone", open_low=True)
    slimmest: float = param(0.6, "1", "Least ratio of width to length", high=1.0, open_low=True)
    lowest: float = param(0.4, "1", "Lowest stone, as a share of the amplitude", high=1.0, open_low=True)

    default_amplitude = 0.02

    def __post_init__(self) -> None:
        super().__post_init__()
        _sized(self.name, self.smallest, self.largest)

    @property
    def smallest_feature(self) -> float:
        return self.smallest * self.slimmest

    @property
    def largest_amplitude(self) -> float:
        return self.largest / 2.0

    def shapes(self, site: Site) -> Iterator[Shape]:
        yield from _rubble(site, self.density, self.smallest, self.largest, self.slimmest, self.lowest)


@family("cobble_stones")
class CobbleStones(ShapeFamily):
    """Round domes on an uneven hexagonal lattice, touching their neighbours."""

    pitch: float = param(0.18, "m", "Distance between neighbours", open_low=True)
    overlap: float = param(
        0.1, "1", "How far a dome reaches beyond half the pitch, as a share of it", high=1.0
    )
    jitter: float = param(0.08, "1", "Greatest displacement, as a share of the pitch", high=0.5)
    lowest: float = param(0.6, "1", "Lowest dome, as a share of the amplitude", high=1.0, open_low=True)

    @property
    def smallest_feature(self) -> float:
        return self.pitch / 4.0

    def shapes(self, site: Site) -> Iterator[Shape]:
        radius = self.pitch / 2.0 * (1.0 + self.overlap)
        points = site.hexagons(self.pitch, self.jitter, radius)
        for (x, y), top in zip(points, site.tops(len(points), self.lowest), strict=True):
            yield dome(float(x), float(y), radius, float(top))


def _sized(name: str, smallest: float, largest: float) -> None:
    if smallest > largest:
        raise InputError(f"{name}: smallest ({smallest:g} m) must not exceed largest ({largest:g} m)")
