"""Terrain: a family with its parameters, an amplitude, a seed and a track; the ground follows from these."""

from __future__ import annotations

import json
import math
import warnings
from collections import Counter
from dataclasses import fields, replace
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array, finite_scalar
from wbc.base.registry import first_line
from wbc.base.settings import NonNegative, Number, Positive, Seed, settings
from wbc.feet.sensing.roughness import LEAST_SAMPLES, Roughness, RoughnessSettings, roughness
from wbc.feet.sensing.scan import PROFILE_STEP
from wbc.sim.terrain.areas import Area, read_areas
from wbc.sim.terrain.families.base import Family, FieldFamily, make_family
from wbc.sim.terrain.families.site import Draws, Site
from wbc.sim.terrain.ground import Ground
from wbc.sim.terrain.shapes import LONGEST_TRACK

RAMP = 0.5
"""Default length over which heights grow from 0, m: about three steps. A strip that begins with an edge as high as the
ground fells soft soles there, whatever comes after."""

SOLE_SPHERE_RADIUS = 0.007
"""Radius of the soft sole's contact spheres, m (half the height of its 14 mm phalanges)."""

MAX_NODES = 10_000_000
"""Largest height field, nodes: 40 MB in single precision."""

MAX_SOLIDS = 50_000_000
"""Largest number of features of a ground of solids: each is a geometry of the simulation."""

MOST_PLACED = 50_000
"""Largest number of solids that a density asks for."""

DAMPING_TIME = 0.01
"""Damping of a floor that gives over its stiffness by default, s."""

LARGEST_AMPLITUDE = 100.0
"""Largest amplitude, m."""

LEAST_AMPLITUDE = 1e-6
"""Least amplitude of a ground that is not flat, m: solids cannot be thinner than rounding."""


@settings
class Terrain:
    """A ground for one walk, in the world frame: x along the track, z up, the robot starting at x = 0.

    Equal terrains are identical grounds on every machine; a terrain is hashable and small when pickled.

    Attributes:
        parameters: The family and its parameters.
        amplitude: Highest minus lowest point of the rough part, m.
        seed: Fixes every random draw. Another family, amplitude or parameter has an independent layout with the same
            seed, so that studies may use the same seeds everywhere.
        length: Length of the rough part, m.
        width: Extent of rough part and strips across, centred on y = 0, m.
        start: World x of the start of the rough part, m.
        strip: Length of the flat strip before and after the rough part, m.
        ramp: Length of the first piece of the rough part, on which heights grow from 0 to their own, m; solids sink
            by the ratio at their middle. 0 for a sharp edge. The amplitude is that without the ramp.
        sole_radius: Radius of the spheres under the sole, m; a height field must be as fine.
        floor_stiffness: Stiffness of the ground per area, N/m³, the modulus of subgrade reaction; None for a rigid one.
        floor_damping: Damping of the ground per area, Ns/m³; a hundredth of a second times its stiffness when None.
        areas: Rectangles whose surface has another property than the rest. Six values describe one, and those of the
            next follow: from x, to x, from y, to y (m; None for the end of the ground), the name of the property, its
            value. Names are friction (of a sole, from 0 to 2), stiffness (N/m³; its damping is a hundredth of a second
            times the stiffness), damping (Ns/m³) and speed (m/s, along x, of a moving walkway).
    """

    parameters: Family
    amplitude: Annotated[NonNegative, Field(le=LARGEST_AMPLITUDE), "m"]
    seed: Seed = 0
    length: Annotated[Positive, Field(le=LONGEST_TRACK), "m"] = 3.0
    width: Annotated[Positive, Field(le=LONGEST_TRACK), "m"] = 1.0
    start: Annotated[float, Field(ge=-LONGEST_TRACK, le=LONGEST_TRACK), "m"] = 0.3
    strip: Annotated[Positive, Field(le=LONGEST_TRACK), "m"] = 1.0
    ramp: Annotated[NonNegative, Field(le=LONGEST_TRACK), "m"] = RAMP
    sole_radius: Annotated[Positive, "m"] = SOLE_SPHERE_RADIUS
    floor_stiffness: Annotated[Positive, "N/m³"] | None = None
    floor_damping: Annotated[NonNegative, "Ns/m³"] | None = None
    areas: tuple[Number | str | None, ...] = ()

    def __post_init__(self) -> None:
        """Check the amplitude and the track against the family."""
        if self.amplitude > self.parameters.largest_amplitude + 1e-12:
            raise InputError(
                f"amplitude of {self.name} must be at most {self.parameters.largest_amplitude:g} m "
                f"with these parameters, got {self.amplitude:g}"
            )
        if 0.0 < self.amplitude < LEAST_AMPLITUDE:
            raise InputError(
                f"amplitude of {self.name} must be 0 or at least {LEAST_AMPLITUDE:g} m, got {self.amplitude:g}"
            )
        if self.floor_damping is not None and self.floor_stiffness is None:
            raise InputError("floor_damping is that of a floor that gives: it needs floor_stiffness, too")
        self.parameters.check_track(self.length, self.width)
        if self.ramp > 0.0 and not self.parameters.ramps:
            raise InputError(f"terrain '{self.name}' has no ramp, its heights are exact; got {self.ramp:g} m")
        self._check_size()
        _ = self.surface_areas  # they are read, and so checked

    def __getstate__(self) -> dict[str, Any]:
        """Pickle the fields alone: the surface is built again."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    def default_ramp(self) -> float:
        """Length of the ramp of its family by default, m."""
        return self.parameters.track().get("ramp", RAMP)

    @property
    def name(self) -> str:
        """Name of the family."""
        return self.parameters.name

    @property
    def gives(self) -> bool:
        """True if the ground gives somewhere."""
        areas = {area.name for area in self.surface_areas}
        return self.floor_stiffness is not None or "stiffness" in areas

    @cached_property
    def surface_areas(self) -> tuple[Area, ...]:
        """Areas with other properties of the surface; a ground that is level all over has no end for them."""
        ends = None if self.amplitude == 0.0 else self.extent
        return read_areas(self.areas, ends, self.floor_stiffness is not None)

    @property
    def own_damping(self) -> float:
        """Damping of a ground that gives, Ns/m³."""
        given, stiffness = self.floor_damping, self.floor_stiffness or 0.0
        return DAMPING_TIME * stiffness if given is None else given

    @property
    def stop(self) -> float:
        """World x of the end of the rough part, m."""
        return self.start + self.length

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Rectangle of rough part and strips: x from, x to, y from, y to, m."""
        half = self.width / 2.0
        return (self.start - self.strip, self.stop + self.strip, -half, half)

    def site(self) -> Site:
        """Return the rough part, with the beginning of its random numbers.

        They depend on all that has a layout of its own: family, amplitude in whole nm, parameters.
        """
        values = {f.name: _as_text(getattr(self.parameters, f.name)) for f in fields(self.parameters)}
        key = json.dumps([self.name, round(1e9 * self.amplitude), values], sort_keys=True)
        return Site(self.start, self.stop, self.width, self.amplitude, Draws(self.seed, key))

    def _check_size(self) -> None:
        """Check that the ground has a number of features that can be built."""
        family = self.parameters
        feature, what, most = family.feature_at(self.amplitude), "features", MAX_SOLIDS
        if isinstance(family, FieldFamily):
            feature, what, most = family.cell(self.sole_radius), "nodes", MAX_NODES
        rows = 1.0 if family.unidirectional else max(1.0, self.width / feature)
        count = max(1.0, self.length / feature) * rows
        if (density := getattr(family, "density", None)) is not None:
            count, what, most = density * self.length * self.width, "solids", MOST_PLACED
        if count > most:
            raise InputError(
                f"terrain '{self.name}' of {self.length:g} m x {self.width:g} m has about {count:.3g} {what}; at "
                f"most {most:.3g} are built: shorten the track or coarsen the family"
            )

    @cached_property
    def surface(self) -> Ground:
        """The ground as it is drawn; built at the first query."""
        if self.amplitude == 0.0:
            return Ground(0.0)
        return self.parameters.ground(self.site(), self.strip, self.ramp, self.sole_radius)

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the height of the ground as it is drawn, m, at world x and y (m), in their broadcast shape."""
        return self.surface.height(x, y)

    def normal(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the outward unit normal, world frame, at world x and y (m), in their broadcast shape plus (3,).

        From heights a micrometre away, so that an edge has that of neither side; NaN where x or y is.
        """
        x, y = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        h = 1e-6
        fall_x = (self.height(x - h, y) - self.height(x + h, y)) / (2.0 * h)
        fall_y = (self.height(x, y - h) - self.height(x, y + h)) / (2.0 * h)
        out = np.stack([fall_x, fall_y, np.ones_like(fall_x)], axis=-1)
        return np.asarray(out / np.linalg.norm(out, axis=-1, keepdims=True))

    def profile(
        self, x0: float | None = None, x1: float | None = None, y: float = 0.0, step: float = PROFILE_STEP
    ) -> tuple[Array, Array]:
        """Sample the ground along a straight line parallel to x.

        Args:
            x0: First point, m; the start of the rough part when None.
            x1: Last point, m; the end of the rough part when None.
            y: Lateral place of the line, m.
            step: Distance between samples, m; the last one stays at or before x1.

        Returns:
            x and z of the samples, each of shape (n,), m.
        """
        a = finite_scalar("profile x0 (m)", self.start if x0 is None else x0)
        b = finite_scalar("profile x1 (m)", self.stop if x1 is None else x1, above=a)
        spacing = finite_scalar("profile step (m)", step, above=0.0)
        if b - a > MAX_NODES * spacing:
            raise InputError(
                f"profile step (m) must be at least {(b - a) / MAX_NODES:.3g}, for {MAX_NODES:.3g} samples between "
                f"{a:g} and {b:g} m, got {spacing:g}"
            )
        x = np.asarray(a + spacing * np.arange(math.floor((b - a) / spacing + ROUNDING) + 1))
        return x, self.height(x, finite_scalar("profile y (m)", y))

    def clears(self, clearance: float) -> bool:
        """Return True if a foot whose sole is lifted by a clearance, m, passes over the ground; warn where it does not.

        The obstacle of one step is the amplitude, or one riser. A negative clearance is an `InputError`.
        """
        height = finite_scalar("foot clearance (m)", clearance, low=0.0)
        rise = self.parameters.rise_at(self.amplitude)
        if rise > height:
            warnings.warn(
                f"terrain '{self.name}' rises by {1e3 * rise:.3g} mm, more than the foot clearance of "
                f"{1e3 * height:.3g} mm: the swing foot will hit it; lift the foot higher or lower the amplitude",
                stacklevel=2,
            )
        return rise <= height

    def roughness(self) -> Roughness:
        """Return the roughness of the rough part along y = 0, without any filter."""
        step = min(PROFILE_STEP, self.length / LEAST_SAMPLES)
        return roughness(*self.profile(step=step), RoughnessSettings(corner=None))

    def describe(self) -> dict[str, Any]:
        """Return all facts about the terrain as JSON values; names carry the units."""
        ground, feature = self.surface, self.parameters.feature_at(self.amplitude)
        map_ = ground.field
        return {
            "terrain": self.name,
            "summary": first_line(type(self.parameters)),
            "amplitude_m": self.amplitude,
            "seed": self.seed,
            "parameters": {
                f.name: _as_text(getattr(self.parameters, f.name)) for f in fields(self.parameters)
            },
            **{f"{name}_m": getattr(self, name) for name in ("start", "length", "width", "strip", "ramp")},
            "floor_stiffness_n_per_m3": self.floor_stiffness,
            "floor_damping_ns_per_m3": None if self.floor_stiffness is None else self.own_damping,
            "unidirectional": self.parameters.unidirectional,
            "rise_m": self.parameters.rise_at(self.amplitude),
            "geoms": dict(Counter(type(s).__name__.lower() for s in ground.solids)),
            "nodes": None if map_ is None else list(map_.z.shape),
            "cell_m": None if map_ is None else list(map_.step),
            "height_field_bytes": 0 if map_ is None else 4 * map_.z.size,
            "smallest_feature_m": feature if math.isfinite(feature) else None,
            "areas": list(self.areas),
            **({} if self.amplitude == 0.0 else self.parameters.facts(self.site())),
        }


def _as_text(value: Any) -> Any:
    """Return numbers, text and truth values as they are, the rest, such as a map of heights, as short text."""
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)


TRACK = tuple(f.name for f in fields(Terrain) if f.name not in ("parameters", "amplitude", "seed"))
"""Fields of a terrain that have a default, which a family may change."""


@checked
def terrain(
    name: str | Family, amplitude: Annotated[NonNegative, "m"] | None = None, seed: Seed = 0, **values: Any
) -> Terrain:
    """Return a terrain by the name of its family.

    Args:
        name: One of `terrain_families()`, or an instance of a family with its parameters.
        amplitude: Highest minus lowest point of the rough part, m; the default of the family when None.
        seed: Fixes every random draw.
        **values: Fields of `Terrain` (length, width, start, strip, ramp, sole_radius in m; floor_stiffness in N/m³,
            floor_damping in Ns/m³; areas) and parameters of the family; by default those of the family.
    """
    given = {field: values.pop(field) for field in TRACK if field in values}
    parameters = make_family(name, values) if isinstance(name, str) else replace(name, **values)
    height = parameters.default_amplitude if amplitude is None else amplitude
    return Terrain(parameters=parameters, amplitude=height, seed=seed, **parameters.track() | given)
