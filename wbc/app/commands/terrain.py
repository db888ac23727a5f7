"""`wbc terrain`, `wbc terrains` and `wbc scenes`: grounds to walk on, and what may stand on them."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

from wbc.app.files import check_picture
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.core.changes import read_changes
from wbc.core.settings import settings, unit_and_choices
from wbc.feet.stiffness.roughness import PARAMETERS, UNITS
from wbc.sim.scenes import scene_kinds
from wbc.sim.terrain import Rendering, Terrain, check_clearance, terrain_families
from wbc.sim.terrain import terrain as make_terrain
from wbc.sim.terrain.families.base import make_family
from wbc.sim.terrain.plot import example_terrain, plot_families, plot_terrain
from wbc.sim.terrain.spec import SOLE_SPHERE_RADIUS
from wbc.walking.planning.gait import Gait


@settings
class TerrainOptions:
    """Options of `wbc terrain`.

    Attributes:
        name: Family, one of those `wbc terrains` lists.
        amplitude: Highest minus lowest point of the rough part, m; the family's own when not given.
        seed: Fixes every random draw.
        param: Parameters of the family, each as name=value.
        length: Length of the rough part, m; 3 m when not given.
        width: Extent across, m; 1 m when not given.
        start: x at which the rough part begins, m; 0.3 m when not given.
        strip: Length of the flat strips, m; 1 m when not given.
        rendering: Solids, height field, or auto: solids wherever the family is made of them.
        resolution: Greatest cell of a height field, m; fine enough for family and sole when not given.
        sole_radius: Radius of the spheres under the sole, m.
        clearance: Height of the swing foot, m; a warning says if that is too low.
        plot: Picture of the map and a profile to write.
        cost: Also measure memory and steps per second.
    """

    name: str
    amplitude: float | None = None
    seed: int = 0
    param: tuple[str, ...] = ()
    length: float | None = None
    width: float | None = None
    start: float | None = None
    strip: float | None = None
    rendering: Rendering = "auto"
    resolution: float | None = None
    sole_radius: float = SOLE_SPHERE_RADIUS
    clearance: float = Gait.swing_height
    plot: Path | None = None
    cost: bool = False

    def terrain(self) -> Terrain:
        """Make the terrain.

        Raises:
            UnknownNameError: No such family or parameter.
            InputError: A value is out of range or cannot be read.
        """
        names = ("length", "width", "start", "strip", "rendering", "resolution", "sole_radius")
        track: dict[str, Any] = {name: getattr(self, name) for name in names}
        family = make_family(self.name, read_changes(self.param))
        return make_terrain(family, self.amplitude, self.seed, **track)


@settings
class TerrainListOptions:
    """Options of `wbc terrains`.

    Attributes:
        plot: Sheet of thumbnails to write.
        cost: Also measure memory and steps per second of each; takes about half a minute.
    """

    plot: Path | None = None
    cost: bool = False


@reports
def terrain(options: Flat[TerrainOptions], *, output: OutputOptions = Output()) -> Report:
    """Describe a ground, and draw or measure it if asked to."""
    facts = describe_terrain(options)
    return output.report(facts, "\n".join(f"{key:<20} {_text(value)}" for key, value in facts.items()))


@reports
def terrains(
    options: Flat[TerrainListOptions] = TerrainListOptions(), *, output: OutputOptions = Output()
) -> Report:
    """List the families of grounds with their parameters; draw all of them, or measure what they cost."""
    families = list_terrains(options)
    facts: dict[str, Any] = {"terrains": families}
    if options.plot is not None:
        facts["plot"] = str(options.plot)
    return output.report(facts, "\n".join(_cost_table(families) if options.cost else _listing(families)))


@reports
def scenes(*, output: OutputOptions = Output()) -> Report:
    """List the scenes that `wbc walk --scene` and `Plant(scene=…)` take, with their parameters."""
    kinds = [
        {"name": name, "summary": kind.summary(), "parameters": _parameters(kind)}
        for name, kind in scene_kinds().items()
    ]
    lines = [line for kind in kinds for line in (f"{kind['name']:<8} {kind['summary']}", *_rows(kind))]
    return output.report({"scenes": kinds}, "\n".join(lines))


def describe_terrain(options: TerrainOptions) -> dict[str, Any]:
    """Return the facts about a terrain; draw it and measure its cost if asked to. Everything is checked first.

    Returns:
        `Terrain.describe()`, the roughness parameters along y = 0 (`Terrain.roughness`), `clears` (true if the
        swing foot passes over the ground), and as asked for `plot` and `cost`.

    Raises:
        UnknownNameError: No such family or parameter.
        InputError: A value is out of range, or the picture cannot be written.

    Warns:
        ClearanceWarning: The ground is higher than the clearance.
    """
    ground = options.terrain()
    target = check_picture(options.plot, options.param)
    clears = check_clearance(ground, options.clearance)
    facts = ground.describe() | {"roughness": _named_roughness(ground), "clears": clears}
    if target is not None:
        plot_terrain(ground, target)
        facts["plot"] = str(target)
    if options.cost:
        from wbc.app.bench.terrain import terrain_cost  # noqa: PLC0415 - slow to import, rarely asked for

        facts["cost"] = terrain_cost(ground)
    return facts


def list_terrains(options: TerrainListOptions) -> list[dict[str, Any]]:
    """Return the facts about all families; draw them and measure their cost if asked to.

    Returns:
        For each: name, summary, usual amplitude (m), parameters, and as asked for `cost`.

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
    if options.cost:
        from wbc.app.bench.terrain import terrain_cost  # noqa: PLC0415 - slow to import, rarely asked for

        for facts in families:
            facts["cost"] = terrain_cost(example_terrain(facts["name"]))
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


def _cost_table(families: list[dict[str, Any]]) -> list[str]:
    lines = [
        f"{'terrain':<20}{'amplitude mm':>13}{'geoms':>7}{'nodes':>9}{'kB':>7}{'contacts':>10}{'steps/s':>9}"
    ]
    for family in families:
        cost = family["cost"]
        lines.append(
            f"{family['name']:<20}{1e3 * family['amplitude_m']:>13.0f}{cost['geoms']:>7}{cost['nodes']:>9}"
            f"{cost['model_bytes'] / 1e3:>7.0f}{cost['contacts']:>10.0f}{cost['steps_per_s']:>9.0f}"
        )
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
