"""Patchwork: stretches of different families one behind the other, a ground on which no single stiffness is best."""
# ruff: noqa: D102 - overrides are documented where they are declared

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, finite_scalar
from wbc.base.settings import Positive
from wbc.sim.terrain.families.base import ShapeFamily, family, make_family, param
from wbc.sim.terrain.families.site import Site
from wbc.sim.terrain.shapes import Shape

if TYPE_CHECKING:
    from wbc.sim.terrain.spec import Terrain


@family("patchwork")
class Patchwork(ShapeFamily):
    """Stretches of different families one behind the other, in a random order without repeats side by side."""

    families: str = param(
        "boards cylinder_obstacles roof_tiles stones",
        "Families, each with its height as a share of the amplitude where it is not 1, such as 'boards:0.9 stones'",
    )
    stretch: Annotated[Positive, "m"] = param(0.6, "Length of a stretch, about four steps")

    default_amplitude = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self._parts:
            raise InputError("patchwork needs at least one family")
        if max(self._parts.values()) != 1.0:
            raise InputError(f"patchwork: the highest family must have the height 1, got '{self.families}'")

    @cached_property
    def _parts(self) -> dict[str, float]:
        """Family → height as a share of the amplitude."""
        parts: dict[str, float] = {}
        for text in self.families.replace(",", " ").split():
            name, _, share = text.partition(":")
            if name in parts:
                raise InputError(f"patchwork has the family '{name}' twice")
            height: Any = share or 1.0
            with suppress(ValueError):  # what is no number is refused in the next line
                height = float(height)
            parts[name] = finite_scalar(f"height of {name} in a patchwork", height, above=0.0, high=1.0)
            self._family(name)
        return parts

    @staticmethod
    def _family(name: str) -> ShapeFamily:
        made = make_family(name, {})
        if name == Patchwork.name or not isinstance(made, ShapeFamily) or math.isinf(made.smallest_feature):
            raise InputError(f"a patchwork is of families of solids on the floor, which '{name}' is not")
        return made

    @property
    def smallest_feature(self) -> float:
        return min(self._family(name).smallest_feature for name in self._parts)

    def feature_at(self, amplitude: float) -> float:
        return min(self._family(name).feature_at(share * amplitude) for name, share in self._parts.items())

    @property
    def largest_amplitude(self) -> float:
        return min(self._family(name).largest_amplitude / share for name, share in self._parts.items())

    def facts(self, site: Site) -> dict[str, Any]:
        return {"stretches": [name for name, _, _ in self.stretches(site)]}

    def stretches(self, site: Site) -> list[tuple[str, float, float]]:
        """Return family, begin and end (m) of each stretch; the last one may be longer than the others."""
        count = max(1, math.floor(site.length / self.stretch + ROUNDING))
        edges = [*(site.x0 + self.stretch * np.arange(count)), site.x1]
        names = list(self._parts)
        draws = site.draws.uniform(0.0, 1.0, count)
        order: list[int] = []
        for draw in draws.tolist():
            # Any but the one before; all stretches have the same chance.
            others = [i for i in range(len(names)) if not order or i != order[-1] or len(names) == 1]
            order.append(others[int(draw * len(others))])
        if max(self._parts[names[i]] for i in order) < 1.0:  # the amplitude is met on one stretch at least
            order[0] = max(range(len(names)), key=lambda i: self._parts[names[i]])
        return [(names[i], float(edges[n]), float(edges[n + 1])) for n, i in enumerate(order)]

    def shapes(self, site: Site) -> Iterator[Shape]:
        for name, begin, end in self.stretches(site):
            part = replace(site, x0=begin, x1=end, amplitude=self._parts[name] * site.amplitude)
            made = self._family(name)
            if made.floor(part) != 0.0:
                raise InputError(f"a patchwork is of families of solids on the floor; '{name}' has a pit")
            yield from made.shapes(part)


def stretches(ground: Terrain) -> list[tuple[str, float, float]]:
    """Return family, begin and end (world x, m) of each stretch of a ground; any ground but a patchwork is one."""
    if isinstance(ground.parameters, Patchwork):
        return ground.parameters.stretches(ground.site())
    return [(ground.name, ground.start, ground.stop)]
