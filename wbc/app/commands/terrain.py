"""`wbc terrain`: grounds to walk on, and the scenes that may stand on them."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from wbc.app.files import check_picture
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.core.changes import read_changes
from wbc.core.errors import InputError
from wbc.core.settings import settings, unit_and_choices
from wbc.feet.stiffness.roughness import PARAMETERS, UNITS
from wbc.sim.scenes import scene_kinds
from wbc.sim.terrain import Rendering, Terrain, check_clearance, terrain_families
from wbc.sim.terrain import terrain as make_terrain
from wbc.sim.terrain.families.base import make_family
from wbc.sim.terrain.plot import plot_families, plot_terrain
from wbc.sim.terrain.spec import SOLE_SPHERE_RADIUS
from wbc.walking.planning.gait import Gait


@settings(kw_only=True)
class TerrainOptions:
    """Options of `wbc terrain`.

    Attributes:
        amplitude: Highest minus lowest point of the rough part, m; the family's own when not given.
        seed: Fixes every random draw.
        param: Parameters of the family, each as name=value.
        length: Length of the rough part, m; 3 m when not given.
        width: Extent across, m; 1 m when not given.
        start: x at which the rough part begins, m; 0.3 m when not given.
        strip: Length of the flat strips, m; 1 m when not given.
        ramp: Length on which heights grow from 0 to their own, m; 0 for a sharp edge, 0.5 m when not given.
        rendering: Solids, height field, or auto: solids wherever the family is made of them.
        resolution: Greatest cell of a height field, m; fine enough for family and sole when not given.
        sole_radius: Radius of the spheres under the sole, m.
        clearance: Height of the swing foot, m; a warning says if that is too low.
        plot: Picture to write: map and profile, or thumbnails of all families.
    """

    amplitude: float | None = None
    seed: int = 0
    param: tuple[str, ...] = ()
    length: float | None = None
    width: float | None = None
    start: float | None = None
    strip: float | None = None
    ramp: float | None = None
    rendering: Rendering = "auto"
    resolution: float | None = None
    sole_radius: float = SOLE_SPHERE_RADIUS
    clearance: float = Gait.swing_height
    plot: Path | None = None

    def terrain(self, name: str) -> Terrain:
        """Return a ground of a family.

        Raises:
            UnknownNameError: No such family or parameter.
            InputError: A value is out of range or cannot be read.
        """
        names = ("length", "width", "start", "strip", "ramp", "rendering", "resolution", "sole_radius")
        track: dict[str, Any] = {name: getattr(self, name) for name in names}
        family = make_family(name, read_changes(self.param))
        return make_terrain(family, self.amplitude, self.seed, **track)


@reports
def terrain(
    name: Annotated[str | None, Parameter(help="Family; all of them, and the scenes, when left out.")] = None,
    /,
    *,
    options: Flat[TerrainOptions] = TerrainOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Describe or draw a ground, or list the families of grounds and the scenes with their parameters."""
    if name is not None:
        facts = describe_terrain(name, options)
        return output.report(facts, "\n".join(f"{key:<20} {_text(value)}" for key, value in facts.items()))
    for each in fields(options):
        if each.name != "plot" and getattr(options, each.name) != each.default:
            raise InputError(f"--{each.name.replace('_', '-')} belongs to one ground; name its family")
    families = list_terrains(options)
    scenes = [
        {"name": name, "summary": kind.summary(), "parameters": _parameters(kind)}
        for name, kind in scene_kinds().items()
    ]
    facts = {"terrains": families, "scenes": scenes}
    if options.plot is not None:
        facts["plot"] = str(options.plot)
    lines = _listing(families)
    lines += [
        "Scenes:",
        *(line for scene in scenes for line in (f"{scene['name']:<8} {scene['summary']}", *_rows(scene))),
    ]
    return output.report(facts, "\n".join(lines))


def describe_terrain(name: str, options: TerrainOptions) -> dict[str, Any]:
    """Return the facts about a ground; draw it if asked to. Everything is checked first.

    Returns:
        `Terrain.describe()`, the roughness parameters along y = 0 (`Terrain.roughness`), `clears` (true if the
        swing foot passes over the ground), and `plot` where one is drawn.

    Raises:
        UnknownNameError: No such family or parameter.
        InputError: A value is out of range, or the picture cannot be written.

    Warns:
        ClearanceWarning: The ground is higher than the clearance.
    """
    ground = options.terrain(name)
    target = check_picture(options.plot, options.param)
    clears = check_clearance(ground, options.clearance)
    facts = ground.describe() | {"roughness": _named_roughness(ground), "clears": clears}
    if target is not None:
        plot_terrain(ground, target)
        facts["plot"] = str(target)
    return facts


def list_terrains(options: TerrainOptions) -> list[dict[str, Any]]:
    """Return the facts about all families; draw them if asked to.

    Returns:
        For each: name, summary, usual amplitude (m), parameters.

    Raises:
        InputError: The picture cannot be written.
    """
    target = check_picture(options.plot)
    families: list[dict[str, Any]] = []
    for name, family in terrain_families().items():
        families.append(
            {
                "name": name,
                "summary": family.summary(),
                "amplitude_m": family.default_amplitude,
                "parameters": _parameters(family),
            }
        )
    if target is not None:
        plot_families(target)
    return families


def _parameters(kind: type) -> list[dict[str, Any]]:
    """Return the parameters of a family of grounds or a scene: name, default, unit, meaning, choices."""
    found = []
    for field in fields(kind):
        unit, choices = unit_and_choices(kind, field.name)
        found.append(
            {
                "name": field.name,
                "default": field.default,
                "unit": unit or "1",
                "about": field.metadata["about"],
                "choices": choices,
            }
        )
    return found


def _named_roughness(ground: Terrain) -> dict[str, float]:
    """Return the roughness parameters along y = 0 by name, with their units in the names."""
    names = [f"{name}_{unit}" if unit else name for name, unit in zip(PARAMETERS, UNITS, strict=True)]
    return dict(zip(names, ground.roughness().values.tolist(), strict=True))


def _listing(families: list[dict[str, Any]]) -> list[str]:
    lines = []
    for family in families:
        lines.append(f"{family['name']:<18} {family['summary']} (amplitude {family['amplitude_m']:g} m)")
        lines += _rows(family)
    return lines


def _rows(family: dict[str, Any]) -> list[str]:
    lines = []
    for parameter in family["parameters"]:
        unit = "" if parameter["unit"] == "1" else f" {parameter['unit']}"
        choices = f" ({', '.join(parameter['choices'])})" if parameter["choices"] else ""
        lines.append(f"    {parameter['name']} = {parameter['default']}{unit}  {parameter['about']}{choices}")
    return lines


def _text(value: Any) -> str:
    """Return a value as text for people: numbers to four digits."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, dict):
        return "  ".join(f"{key} {_text(each)}" for key, each in value.items()) or "-"
    if isinstance(value, list):
        return " x ".join(_text(each) for each in value)
    return value if isinstance(value, str) else json.dumps(value)
