"""Family: parameters of a kind of ground, how its rough part is built, and the registry of all families.

CONTRIBUTING.md and docs/grounds.md have the smallest family of heights and of solids.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field, fields
from functools import cached_property
from typing import Annotated, Any, ClassVar, TypeVar, dataclass_transform

import numpy as np
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError, shown
from wbc.base.numbers import ROUNDING, Array
from wbc.base.registry import Registry, call_checked
from wbc.base.settings import Positive, settings
from wbc.feet.sensing.scan import PROFILE_STEP
from wbc.sim.terrain.families.site import Draws, Site, cells
from wbc.sim.terrain.ground import FLOOR_GAP, Ground, HeightField, flat_box
from wbc.sim.terrain.shapes import Box, Shape, lowered

AMPLITUDE_TOLERANCE = 1e-9
"""Largest difference between the amplitude asked for and the one built, m."""

LATERAL_CELLS = 3
"""Cells across a ground that does not vary across; odd, so that no grid line runs along y = 0."""

DEFAULT_CELL = 0.007
"""Widest cell of a height field by default, m: the radius of the sole's spheres and the grid of the public profiles of
the paper's authors (429 samples on 3 m)."""

BLEND = 0.1
"""Length over which a ground that varies both ways rises from its flat strips, m."""

PositiveShare = Annotated[float, Field(gt=0.0, le=1.0)]
"""A number above zero, up to one."""


@checked
def param(default: Any, about: str, *, at_least: str | None = None, feature: Positive | None = None) -> Any:
    """Declare a parameter of a family, or of a scene; its annotation states type, range and unit, as in all settings.

    Args:
        default: Its value by default.
        about: Meaning of the parameter, for `wbc terrain`.
        at_least: Name of another parameter that this one must not be below.
        feature: Size that a foot can feel, as a multiple of the parameter: 0.5 for a wavelength. The least of these
            sizes is the smallest feature of a ground. None for a parameter that is no size.
    """
    return field(default=default, metadata={"about": about, "at_least": at_least, "feature": feature})


@settings
class Family(ABC):
    """Parameters of a family of grounds; see `ShapeFamily` and `FieldFamily` for the two kinds."""

    name: ClassVar[str] = ""
    default_amplitude: ClassVar[float] = 0.03
    """The height of the paper's hardest training grounds is 40 mm, of its small stones 25 mm; m."""
    ramps: ClassVar[bool] = True
    """False for a family whose heights are exact and cannot begin with a ramp."""

    def __post_init__(self) -> None:
        """Check the parameters that must not be below others."""
        for f in fields(self):
            other = f.metadata.get("at_least")
            if other is not None and getattr(self, f.name) < getattr(self, other):
                raise InputError(
                    f"{self.name}: {other} ({getattr(self, other):g}) must not exceed "
                    f"{f.name} ({getattr(self, f.name):g})"
                )

    @property
    def smallest_feature(self) -> float:
        """Size of the smallest feature that a foot can feel (a stone, a joint, half a wave), m; see `param`."""
        return float(min(share * getattr(self, name) for name, share in self._features()))

    @classmethod
    def _features(cls) -> list[tuple[str, float]]:
        """Return the parameters that are sizes of features, each with the size over the parameter."""
        return [(f.name, f.metadata["feature"]) for f in fields(cls) if f.metadata.get("feature")]

    def feature_at(self, amplitude: float) -> float:
        """Return the smallest feature at this amplitude, m; in some families it grows with the amplitude."""
        return self.smallest_feature

    def rise_at(self, amplitude: float) -> float:
        """Return the height by which a foot must be lifted in one step, m: the amplitude (m), or less on climbs."""
        return amplitude

    @property
    def unidirectional(self) -> bool:
        """True if the ground does not vary across the track."""
        return False

    @property
    def largest_amplitude(self) -> float:
        """Greatest amplitude for which the family keeps its character, m."""
        return math.inf

    def track(self) -> dict[str, float]:
        """Return track dimensions (names of `Terrain` fields, m) that differ from the usual ones."""
        return {} if self.ramps else {"ramp": 0.0}

    def check_track(self, length: float, width: float) -> None:
        """Raise `InputError`, which says what is possible, if the family cannot fill a rough part of this size (m)."""
        del length, width

    def facts(self, site: Site) -> dict[str, Any]:
        """Return further facts about a ground as JSON values, with the unit in the name."""
        return {}

    @abstractmethod
    def ground(self, site: Site, strip: float, ramp: float, sole_radius: float) -> Ground:
        """Return the ground on a site.

        Args:
            site: Its rough part.
            strip: Length of the flat strips before and after it, m.
            ramp: Length of the first piece of the rough part, on which heights grow, m.
            sole_radius: Radius of the spheres under the sole, m, for height fields.
        """


class ShapeFamily(Family):
    """Base of families that consist of solids on a floor.

    The highest point of `shapes` must be exactly `site.amplitude` above `floor(site)`, and some floor must stay
    uncovered.
    """

    @abstractmethod
    def shapes(self, site: Site) -> Iterable[Shape]:
        """Return the solids of the rough part; all are inside it."""

    def floor(self, site: Site) -> float:
        """Return the level of the endless floor, m; the start strip is at 0."""
        return 0.0

    def stop(self, site: Site) -> float:
        """Return the level of the stop strip, m."""
        return 0.0

    def ground(self, site: Site, strip: float, ramp: float, sole_radius: float) -> Ground:
        """See `Family`; an `InputError` for solids that are not where and as high as they should be."""
        shapes, floor, stop = tuple(self.shapes(site)), self.floor(site), self.stop(site)
        built, whole = max((float(s.peak[2]) for s in shapes), default=floor) - floor, Ground(floor, shapes)
        if abs(built - site.amplitude) > AMPLITUDE_TOLERANCE:
            raise InputError(
                f"terrain family '{self.name}' built {built:g} m for an amplitude of {site.amplitude:g} m"
            )
        if _sticks_out(site, whole, max(floor, stop)):
            raise InputError(f"terrain family '{self.name}' placed a solid outside the rough part")
        boxes = np.array([shape.box for shape in shapes]).reshape(-1, 4)
        x, y = (boxes[:, 0] + boxes[:, 1]) / 2.0, (boxes[:, 2] + boxes[:, 3]) / 2.0
        drops = (1.0 - _share(site, ramp, x)) * whole.height(x, y)
        sunk = tuple(s if d == 0.0 else lowered(s, d) for s, d in zip(shapes, drops, strict=True))
        return Ground(floor, sunk, _strips(site, strip, stop, floor))


class FieldFamily(Family):
    """Base of families that are given by heights on a grid, which are then scaled to the amplitude."""

    @abstractmethod
    def heights(self, site: Site, x: Array, y: Array) -> Array:
        """Return heights in any scale.

        Args:
            site: The rough part.
            x: Columns of the grid, shape (1, columns), m.
            y: Rows of the grid, shape (rows, 1), m.

        Returns:
            Heights that broadcast to (rows, columns); those of one row do not vary across the track.
        """

    @cached_property
    def unidirectional(self) -> bool:
        """True if the ground does not vary across the track."""
        two, site = np.array([[0.0], [1.0]]), Site(0.0, 10.0, 10.0, 1.0, Draws(0, ""))  # of usual lengths
        return len(np.atleast_2d(self.heights(site, two.T, two))) == 1

    @property
    def grid(self) -> float:
        """Default size of a cell, m; with eight cells for each feature a sine is exact to 2 % of its height."""
        return min(DEFAULT_CELL, self.smallest_feature / 8.0)

    def cell(self, widest: float) -> float:
        """Return the size of the cells of a height field, m, at most `widest`; it divides `grid`."""
        return self.grid / max(1, math.ceil(self.grid / widest - ROUNDING))

    def level(self, site: Site, x: Array, raw: Array) -> tuple[Array, float]:
        """Shift raw heights to the start strip, which is at 0.

        A ground that varies only along the track starts at 0, and its stop strip continues its end. A ground that
        varies in both directions is shifted to a mean of 0 and blended into strips at 0.

        Args:
            site: Place of the rough part.
            x: Stations along the track, shape (n,), m.
            raw: Heights, shape (rows, n), in the scale of the family.

        Returns:
            Heights, and the level of the stop strip, both in the raw scale.
        """
        if len(raw) == 1:
            raw = raw - raw[:, :1]
            return raw, float(raw[0, -1])
        raw = raw - raw.mean()
        t = np.clip(np.minimum(x - site.x0, site.x1 - x) / BLEND, 0.0, 1.0)
        return raw * t * t * (3.0 - 2.0 * t), 0.0

    def sample(self, site: Site, step: float) -> tuple[Array, float]:
        """Sample the raw heights in cells of at most `step` (m).

        Returns:
            Heights, shape (rows, columns) or (1, columns), and the level of the stop strip; in the raw scale.
        """
        columns, rows, half = cells(site.length, step) + 1, cells(site.width, step) + 1, site.width / 2.0
        x, y = np.linspace(site.x0, site.x1, columns)[None, :], np.linspace(-half, half, rows)[:, None]
        raw = np.atleast_2d(np.asarray(self.heights(site, x, y), dtype=np.float64))
        raw = np.broadcast_to(raw, (1 if len(raw) == 1 else rows, columns))
        if not np.isfinite(raw).all():
            raise InputError(f"{self.name}: the heights are not all finite")
        raw, stop = self.level(site, x, raw)
        if raw.max() <= raw.min():
            raise InputError(f"{self.name}: all heights are equal, so no amplitude can be met")
        return raw, stop

    def ground(self, site: Site, strip: float, ramp: float, sole_radius: float) -> Ground:
        """See `Family`."""
        raw, stop = self.sample(site, self.cell(sole_radius))
        scale, half = site.amplitude / float(raw.max() - raw.min()), site.width / 2.0
        share = _share(site, ramp, np.linspace(site.x0, site.x1, raw.shape[1]))
        rows = LATERAL_CELLS + 1 if len(raw) == 1 else len(raw)
        z = np.ascontiguousarray(np.broadcast_to(raw * scale * share, (rows, raw.shape[1])))
        floor = float(z.min()) - FLOOR_GAP
        strips = _strips(site, strip, stop * scale * float(share[-1]), floor)
        return Ground(floor, (), strips, HeightField(site.x0, site.x1, -half, half, z))


def _strips(site: Site, length: float, stop: float, floor: float) -> tuple[Box, ...]:
    """Return the boxes of the flat start, at 0, and of the stop, where the floor is not at their level."""
    spans = ((site.x0 - length, site.x0, 0.0), (site.x1, site.x1 + length, stop))
    return tuple(flat_box(a, b, site.width, level, floor) for a, b, level in spans if level != floor)


def _share(site: Site, ramp: float, x: Array) -> Array:
    """Return the ratio of the heights on the ramp to those without it, at world x (m)."""
    return np.clip((x - site.x0) / ramp, 0.0, 1.0) if ramp > 0.0 else np.ones_like(x)


def _sticks_out(site: Site, ground: Ground, stop: float) -> bool:
    """Return True if a solid sticks out of floor and strips along a line just outside the rough part."""
    half, out = site.width / 2.0, 1e-5
    x = np.linspace(site.x0 - out, site.x1 + out, cells(site.length, PROFILE_STEP) + 1)
    y = np.linspace(-half - out, half + out, cells(site.width, PROFILE_STEP) + 1)
    sides = ((x, -half - out, ground.floor), (x, half + out, ground.floor))
    ends = ((site.x0 - out, y, 0.0), (site.x1 + out, y, stop))
    return any((ground.height(a, b) > level).any() for a, b, level in (*sides, *ends))


def _check(kind: object) -> None:
    if not (isinstance(kind, type) and issubclass(kind, Family) and "name" in vars(kind)):
        raise InputError(f"a ground is a class derived from Family with @family above it, got {shown(kind)}")


_FAMILIES: Registry[type[Family]] = Registry("terrain", group="wbc.terrains", check=_check)
_F = TypeVar("_F", bound=Family)


@dataclass_transform(frozen_default=True, field_specifiers=(param,))
def family(name: str) -> Callable[[type[_F]], type[_F]]:
    """Register a class as a family of grounds and make it settings (`wbc.base.settings`).

    Args:
        name: Name for `terrain(name, …)` and the command line.
    """

    def register(cls: type[_F]) -> type[_F]:
        if not (isinstance(cls, type) and issubclass(cls, Family)):
            raise InputError(f"@family must be above a class derived from Family, got {shown(cls)}")
        cls.name = name
        made = settings(cls)
        if cls.smallest_feature is Family.smallest_feature and not cls._features():
            raise InputError(
                f"terrain '{name}' must have a parameter that is the size of a feature, as in param(0.3, …, "
                "feature=1.0), or a `smallest_feature`"
            )
        _FAMILIES.add(name, made)
        return made

    return register


def terrain_families() -> dict[str, type[Family]]:
    """Return all families by name, in alphabetical order."""
    return dict(sorted(_FAMILIES.loaded().items()))


def make_family(name: str, params: Mapping[str, Any]) -> Family:
    """Return the parameters of a family by its name, some of them changed; raises as `call_checked`."""
    return call_checked(f"terrain '{name}'", _FAMILIES[name], params)
