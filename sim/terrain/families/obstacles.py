"""Grounds with obstacles lying on a floor: bars, pyramids, ellipsoids, sticks, boards; and slats over a pit."""
# ruff: noqa: D102 - overrides are documented where they are declared

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated

import numpy as np
from pydantic import Field

from wbc.base.settings import NonNegative, Positive
from wbc.sim.terrain.families.base import PositiveShare, ShapeFamily, family, param
from wbc.sim.terrain.families.site import Site
from wbc.sim.terrain.shapes import Capsule, Pyramid, Shape, bar, footprint_margin, plate, stone


def _stations(site: Site, low: float, high: float, margin: float) -> list[float]:
    """Draw x positions with distances between low and high (m) from the start of the rough part to its end."""
    site.require(2.0 * margin, 0.0)
    most = math.ceil(site.length / low) + 1
    steps = site.draws.uniform(low, high, most)
    x = site.x0 + margin + np.cumsum(steps) - steps[0] * 0.5
    return [float(v) for v in x if v <= site.x1 - margin] or [(site.x0 + site.x1) / 2.0]


@family("cylinder_obstacles")
class CylinderObstacles(ShapeFamily):
    """Round-topped bars across the track, nearly straight, at uneven distances."""

    width_min: Annotated[Positive, "m"] = param(0.03, "Narrowest bar", feature=1.0)
    width_max: Annotated[Positive, "m"] = param(0.06, "Widest bar", at_least="width_min")
    spacing_min: Annotated[Positive, "m"] = param(0.4, "Shortest distance between bars")
    spacing_max: Annotated[Positive, "m"] = param(
        1.2, "Longest distance between bars", at_least="spacing_min"
    )
    lowest: PositiveShare = param(0.5, "Lowest bar, as a share of the amplitude")
    yaw: Annotated[float, Field(ge=0.0, le=1.0), "rad"] = param(
        0.1, "Greatest turn from the transverse direction"
    )

    def shapes(self, site: Site) -> Iterator[Shape]:
        margin = self.width_max / 2.0 + site.width / 2.0 * math.sin(self.yaw)
        xs = _stations(site, self.spacing_min, self.spacing_max, margin)
        n = len(xs)
        tops = site.tops(n, self.lowest)
        widths = site.draws.uniform(self.width_min, self.width_max, n)
        yaws = site.draws.uniform(-self.yaw, self.yaw, n)
        for x, top, width, yaw in zip(xs, tops, widths, yaws, strict=True):
            yield from bar(x, 0.0, site.width, float(yaw), float(width), float(top))


@family("pyramidal_stones")
class PyramidalStones(ShapeFamily):
    """Square pyramids scattered at random."""

    density: Annotated[Positive, "1/m2"] = param(4.8, "Pyramids on a square metre")
    base: Annotated[Positive, "m"] = param(0.047, "Side of the base", feature=1.0)
    lowest: PositiveShare = param(0.5, "Lowest pyramid, as a share of the amplitude")

    def shapes(self, site: Site) -> Iterator[Shape]:
        n = max(1, round(self.density * site.area))
        places = site.scatter(n, self.base / math.sqrt(2.0))
        tops, yaws = site.tops(n, self.lowest), site.draws.uniform(0.0, math.pi / 2.0, n)
        for (x, y), top, yaw in zip(places, tops, yaws, strict=True):
            yield Pyramid(np.array([x, y, top]), 0.0, self.base, float(yaw))


@family("ellipsoids")
class Ellipsoids(ShapeFamily):
    """Half ellipsoids in staggered rows, each turned at random."""

    pitch: Annotated[Positive, "m"] = param(0.126, "Distance between neighbours")
    half_length: Annotated[Positive, "m"] = param(0.072, "Longer semi-axis", feature=2.0)
    half_width: Annotated[Positive, "m"] = param(0.032, "Shorter semi-axis", feature=2.0)
    lowest: PositiveShare = param(0.6, "Lowest one, as a share of the amplitude")

    def shapes(self, site: Site) -> Iterator[Shape]:
        axes = (self.half_length, self.half_width)
        points = site.hexagons(self.pitch, 0.05, max(axes))
        n = len(points)
        tops, yaws = site.tops(n, self.lowest), site.draws.uniform(0.0, math.pi, n)
        for (x, y), top, yaw in zip(points, tops, yaws, strict=True):
            yield stone(float(x), float(y), axes, float(top), float(yaw))


@family("sticks")
class Sticks(ShapeFamily):
    """Round sticks scattered on the floor at any angle."""

    density: Annotated[Positive, "1/m2"] = param(15.6, "Sticks on a square metre")
    shortest: Annotated[Positive, "m"] = param(0.16, "Shortest stick")
    longest: Annotated[Positive, "m"] = param(0.5, "Longest stick", at_least="shortest")
    lowest: PositiveShare = param(0.5, "Thinnest stick, as a share of the amplitude")

    @property
    def smallest_feature(self) -> float:
        return self.feature_at(self.default_amplitude)

    def feature_at(self, amplitude: float) -> float:
        return (amplitude or self.default_amplitude) * self.lowest

    @property
    def largest_amplitude(self) -> float:
        return self.shortest

    def shapes(self, site: Site) -> Iterator[Shape]:
        n = max(1, round(self.density * site.area))
        places = list(site.scatter(n, self.longest / 2.0))
        tops, yaws = site.tops(n, self.lowest), site.draws.uniform(0.0, math.pi, n)
        lengths = site.draws.uniform(self.shortest, self.longest, n)
        for (x, y), top, yaw, length in zip(places, tops, yaws, lengths, strict=True):
            radius = float(top) / 2.0
            reach = (float(length) / 2.0 - radius) * np.array([math.cos(yaw), math.sin(yaw), 0.0])
            middle = np.array([x, y, radius])
            yield Capsule(middle - reach, middle + reach, radius)


@family("boards")
class Boards(ShapeFamily):
    """Single boards on the floor, short along the track, narrow or as wide as the track, turned at random."""

    shortest: Annotated[Positive, "m"] = param(0.05, "Shortest board along the track", feature=1.0)
    longest: Annotated[Positive, "m"] = param(0.25, "Longest board along the track", at_least="shortest")
    narrow: Annotated[Positive, "m"] = param(
        0.2, "Extent across of the narrow half of the boards", feature=1.0
    )
    gap_min: Annotated[NonNegative, "m"] = param(0.1, "Shortest distance between boards")
    gap_max: Annotated[NonNegative, "m"] = param(0.4, "Longest distance between boards", at_least="gap_min")
    lowest: PositiveShare = param(0.5, "Thinnest board, as a share of the amplitude")
    yaw: Annotated[float, Field(ge=0.0, le=1.0), "rad"] = param(
        0.4, "Greatest turn of a narrow board; wide ones turn a quarter of it"
    )

    def shapes(self, site: Site) -> Iterator[Shape]:
        draw = site.draws.uniform
        n = math.ceil(site.length / (self.shortest + self.gap_min)) + 1
        lengths, gaps = draw(self.shortest, self.longest, n), draw(self.gap_min, self.gap_max, n)
        wide, turns, across = draw(0.0, 1.0, n) < 0.5, draw(-self.yaw, self.yaw, n), draw(-1.0, 1.0, n)
        boards, edge = [], site.x0
        for i in range(n):
            yaw = float(turns[i]) * (0.25 if wide[i] else 1.0)
            # A turned board as wide as the track is cut so that its corners stay on the track.
            reach = site.width / math.cos(yaw) - lengths[i] * abs(math.tan(yaw)) if wide[i] else self.narrow
            size = (float(lengths[i]), min(float(reach), site.width))
            half = footprint_margin(size, yaw)
            x = edge + float(gaps[i]) + half[0]
            if x + half[0] > site.x1:
                break
            room = max(0.0, min(site.width / 2.0 - half[1], 1.5 * self.narrow))
            boards.append((x, 0.0 if wide[i] else room * float(across[i]), size, yaw))
            edge = x + half[0]
        if not boards:  # a short track whose first gap takes most of it
            site.require(2.0 * self.longest, 2.0 * self.narrow)
            boards.append(((site.x0 + site.x1) / 2.0, 0.0, (float(lengths[0]), self.narrow), 0.0))
        for (x, y, size, yaw), top in zip(boards, site.tops(len(boards), self.lowest), strict=True):
            yield plate(x, y, size, float(top), yaw=yaw)


@family("slats")
class Slats(ShapeFamily):
    """Slats across a pit that is as deep as the amplitude, some lower than others and slightly tilted."""

    width_min: Annotated[Positive, "m"] = param(0.02, "Narrowest slat along the track", feature=1.0)
    width_max: Annotated[Positive, "m"] = param(0.035, "Widest slat along the track", at_least="width_min")
    gap_min: Annotated[Positive, "m"] = param(0.06, "Narrowest gap", feature=1.0)
    gap_max: Annotated[Positive, "m"] = param(0.11, "Widest gap", at_least="gap_min")
    sag: Annotated[float, Field(ge=0.0, le=0.9)] = param(
        0.3, "Depth of the lowest slat below the edge, over the depth of the pit"
    )
    tilt: Annotated[float, Field(ge=0.0, le=0.3), "rad"] = param(
        0.02, "Greatest slope of a slat along and across the track"
    )
    thickness: Annotated[Positive, "m"] = param(0.02, "Thickness of a slat")

    default_amplitude = 0.05

    def floor(self, site: Site) -> float:
        return -site.amplitude

    def shapes(self, site: Site) -> Iterator[Shape]:
        draw = site.draws.uniform
        n = math.ceil(site.length / (self.width_min + self.gap_min)) + 1
        widths, gaps = draw(self.width_min, self.width_max, n), draw(self.gap_min, self.gap_max, n)
        slopes = draw(-self.tilt, self.tilt, 2 * n).reshape(n, 2)
        ends = site.x0 + np.cumsum(widths + gaps)
        count = int(np.count_nonzero(ends + self.gap_min <= site.x1))
        site.require(self.width_max + 2.0 * self.gap_max, 0.0)
        tops = site.tops(count, 1.0 - self.sag) - site.amplitude
        for i in range(count):
            size = (float(widths[i]), site.width * math.cos(self.tilt) - 2.0 * self.thickness * self.tilt)
            slope = (float(slopes[i, 0]), float(slopes[i, 1]))
            middle = float(ends[i] - widths[i] / 2.0)
            yield plate(middle, 0.0, size, float(tops[i]), slope=slope, thickness=self.thickness)
