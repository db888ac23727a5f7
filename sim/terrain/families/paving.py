"""Grounds laid with boxes or barrel tiles: bricks, floor tiles small and large, roof tiles."""
# ruff: noqa: D102 - overrides are documented where they are declared

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated

import numpy as np
from pydantic import Field

from wbc.base.numbers import Array
from wbc.base.settings import Positive, Share
from wbc.sim.terrain.families.base import PositiveShare, ShapeFamily, family, param
from wbc.sim.terrain.families.site import Site, centred
from wbc.sim.terrain.shapes import BURIED, Cylinder, Shape, plate

SHORTEST_CUT = 0.25
"""Ratio of its length below which a brick that the edge of the track cuts is left out."""


def _laid(
    site: Site, size: tuple[float, float], joint: float, bond: float, lowest: float, tilt: float
) -> Iterator[Shape]:
    """Lay plates in rows along x, every other row shifted by `bond` plate lengths, with joints between them.

    Heights belong to the highest corner; `tilt` is the rise over a plate over the amplitude, less where a high
    plate would lean over its joint.
    """
    pitch = (size[0] + joint, size[1] + joint)
    site.require(*pitch)
    places = []
    for j, y in enumerate(centred(-(site.width - pitch[1]) / 2.0, (site.width - pitch[1]) / 2.0, pitch[1])):
        shift = bond * pitch[0] * (j % 2)
        x = site.x0 + pitch[0] / 2.0 - shift
        while x - size[0] / 2.0 < site.x1 - joint:
            a = max(x - size[0] / 2.0, site.x0 + joint / 2.0)
            b = min(x + size[0] / 2.0, site.x1 - joint / 2.0)
            if b - a > SHORTEST_CUT * size[0]:
                places.append(((a + b) / 2.0, float(y), b - a))
            x += pitch[0]
    n = len(places)
    tops = site.tops(n, lowest)
    rises = site.draws.uniform(-tilt / 2.0, tilt / 2.0, 2 * n).reshape(n, 2) * site.amplitude
    for (x, y, length), top, rise in zip(places, tops, rises, strict=True):
        steepest = joint / 2.0 / (float(top) + BURIED)
        slope = [float(s) for s in np.clip(rise / size, -steepest, steepest)]
        yield plate(x, y, (length, size[1]), float(top), slope=(slope[0], slope[1]))


@family("stone_bricks")
class StoneBricks(ShapeFamily):
    """Bricks in running bond, each at its own height and slightly tilted."""

    length: Annotated[Positive, "m"] = param(0.2, "Brick along the track", feature=1.0)
    breadth: Annotated[Positive, "m"] = param(0.1, "Brick across the track", feature=1.0)
    joint: Annotated[Positive, "m"] = param(0.01, "Joint between bricks", feature=1.0)
    lowest: Share = param(0.4, "Lowest brick, as a share of the amplitude")
    tilt: Share = param(0.2, "Greatest rise over a brick, as a share of the amplitude")

    def shapes(self, site: Site) -> Iterator[Shape]:
        return _laid(site, (self.length, self.breadth), self.joint, 0.5, self.lowest, self.tilt)


@family("floor_tiles")
class FloorTiles(ShapeFamily):
    """Small square tiles with wide joints, each at its own height and slightly tilted."""

    side: Annotated[Positive, "m"] = param(0.051, "Side of a tile", feature=1.0)
    joint: Annotated[Positive, "m"] = param(0.017, "Joint between tiles", feature=1.0)
    lowest: Share = param(0.2, "Lowest tile, as a share of the amplitude")
    tilt: Share = param(0.2, "Greatest rise over a tile, as a share of the amplitude")

    default_amplitude = 0.02

    def shapes(self, site: Site) -> Iterator[Shape]:
        return _laid(site, (self.side, self.side), self.joint, 0.0, self.lowest, self.tilt)


@family("large_floor_tiles")
class LargeFloorTiles(FloorTiles):
    """Tiles about as long as a foot, each at its own height and tilted, with narrow joints."""

    side: Annotated[Positive, "m"] = param(0.3, "Side of a tile", feature=1.0)
    joint: Annotated[Positive, "m"] = param(0.01, "Joint between tiles", feature=1.0)
    lowest: Share = param(0.3, "Lowest tile, as a share of the amplitude")
    tilt: Share = param(0.5, "Greatest rise over a tile, as a share of the amplitude")

    default_amplitude = 0.03


@family("roof_tiles")
class RoofTiles(ShapeFamily):
    """Barrel tiles: a saw-tooth along the track on round ridges side by side, each tile at its own height."""

    period_min: Annotated[Positive, "m"] = param(0.2, "Shortest tile along the track", feature=0.25)
    period_max: Annotated[Positive, "m"] = param(0.25, "Longest tile along the track", at_least="period_min")
    breadth: Annotated[Positive, "m"] = param(0.2, "Distance between ridges", feature=0.25)
    heel: Annotated[float, Field(ge=0.0, le=0.9)] = param(
        0.2, "Height of a tile's low end, as a share of its high end"
    )
    lowest: PositiveShare = param(0.6, "Lowest tile, as a share of the amplitude")
    rising: bool = param(True, "The tiles rise along +x and drop; otherwise they step up and fall")

    @property
    def largest_amplitude(self) -> float:
        # Higher tiles would be steeper than 1 in 2 and overhang their own foot.
        return 0.4 * min(self.breadth, self.period_min)

    def shapes(self, site: Site) -> Iterator[Shape]:
        site.require(1.2 * self.period_max, self.breadth)
        half = (site.width - self.breadth) / 2.0
        lanes = centred(-half, half, self.breadth)
        count = math.ceil(site.length / self.period_min) + 1
        # The foot of a high end reaches a little beyond its edge, under the next tile.
        first, last = site.x0 + self.period_min / 10.0, site.x1 - self.period_min / 10.0
        edges = first + np.cumsum(site.draws.uniform(self.period_min, self.period_max, count))
        edges = np.concatenate([[first], edges[edges <= last]])
        tops = site.tops((edges.size - 1) * lanes.size, self.lowest).reshape(-1, lanes.size)
        for i in range(edges.size - 1):
            for y, top in zip(lanes, tops[i], strict=True):
                ends = (float(edges[i]), float(edges[i + 1]))
                yield self._tile(ends if self.rising else ends[::-1], float(y), float(top))

    def _tile(self, ends: tuple[float, float], y: float, top: float) -> Cylinder:
        """Make a barrel whose crown line climbs from the low end to `top` just before the high end (m)."""
        low, span = self.heel * top, ends[1] - ends[0]
        # The flat high end leans out by the tile's slope s. Its crown stands back by (top - low) s, so that it passes
        # the edge at the height of a low end and leaves no slit; s = (top - low) / (span - (top - low) s).
        back = (abs(span) - math.sqrt(span**2 - 4.0 * (top - low) ** 2)) / 2.0
        crown_low = np.array([ends[0], y, low])
        crown_high = np.array([ends[1] - math.copysign(back, span), y, top])
        along: Array = crown_high - crown_low
        along = along / np.linalg.norm(along)
        up = np.array([0.0, 0.0, 1.0]) - along[2] * along
        # The high end, measured in its own plane, spans the whole breadth on the floor.
        half, depth = self.breadth / 2.0, top / float(np.linalg.norm(up))
        radius = (depth**2 + half**2) / (2.0 * depth)
        down = -radius * up / np.linalg.norm(up)
        return Cylinder(crown_low + down, crown_high + down, radius)
