"""`wbc terrain`: grounds to walk on, and the scenes that may stand on them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from wbc.app.arguments import Fields
from wbc.app.files import PICTURES
from wbc.app.output import Report, facts_text, reports
from wbc.base.errors import InputError
from wbc.base.files import check_target
from wbc.base.registry import first_line
from wbc.base.settings import read_changes, settings, unit_and_choices
from wbc.feet.sensing.roughness import PARAMETERS, UNITS
from wbc.sim.scenes.base import scene_kinds
from wbc.sim.terrain.families.base import Family, make_family, terrain_families
from wbc.sim.terrain.plot import plot_families, plot_terrain
from wbc.sim.terrain.spec import TRACK as TRACK_FIELDS
from wbc.sim.terrain.spec import Terrain
from wbc.sim.terrain.spec import terrain as make_terrain
from wbc.walking.plans.gait import StepGait

TRACK = Fields(
    Terrain,
    "amplitude seed length width start strip ramp sole_radius",
    help={"amplitude": "Highest minus lowest point of the rough part, m; the family's own if not given."},
)
"""Options of the ground."""


@settings(kw_only=True)
class TerrainOptions:
    """Further options of `wbc terrain`.

    Attributes:
        param: Parameters of the family, each as name=value.
        plot: Picture to write: map and profile, or thumbnails of all families.
    """

    param: tuple[str, ...] = ()
    plot: Path | None = None

    def target(self) -> Path | None:
        """Return the path of the picture after a check; None without one."""
        return None if self.plot is None else check_target("a picture", self.plot, PICTURES, self.param)


@reports
def terrain(
    name: Annotated[str | None, Parameter(help="Family; all of them, and the scenes, when left out.")] = None,
    /,
    *,
    given: Annotated[Mapping[str, Any], TRACK],
    options: TerrainOptions,
) -> Report:
    """Describe or draw a ground, or list the families of grounds and the scenes with their parameters."""
    if name is not None:
        facts = describe_terrain(name, options, given)
        return Report(facts, facts_text(facts))
    of_one = [*given, *(["param"] if options.param else [])]
    if of_one:
        raise InputError(f"--{of_one[0].replace('_', '-')} belongs to one ground; name its family")
    target = options.target()
    facts = list_terrains()
    if target is not None:
        plot_families(target)
        facts["plot"] = str(target)
    lines = []
    for each in facts["terrains"]:
        lines += [f"{each['name']:<18} {each['summary']} (amplitude {each['amplitude_m']:g} m)", *_rows(each)]
    lines.append("Scenes:")
    for each in facts["scenes"]:
        lines += [f"{each['name']:<8} {each['summary']}", *_rows(each)]
    return Report(facts, "\n".join(lines))


def describe_terrain(name: str, options: TerrainOptions, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return `Terrain.describe()`, roughness along y = 0 and whether the swing foot clears it; draw it if asked to."""
    ground = ground_of(name, options.param, given)
    target = options.target()
    names = [f"{name}_{unit}" if unit else name for name, unit in zip(PARAMETERS, UNITS, strict=True)]
    facts = ground.describe() | {
        "roughness": dict(zip(names, ground.roughness().values.tolist(), strict=True)),
        "clears": ground.clears(StepGait.swing_height),
    }
    if target is not None:
        plot_terrain(ground, target)
        facts["plot"] = str(target)
    return facts


def ground_of(name: str, param: Iterable[str], given: Mapping[str, Any]) -> Terrain:
    """Return a ground of a family, with parameters as name=value: the family's own, else those of every ground."""
    values = read_changes(param)
    own = {each.name for each in fields(terrain_families().get(name, Family))}
    every = {each: values.pop(each) for each in (*values,) if each in TRACK_FIELDS and each not in own}
    return make_terrain(make_family(name, values), **{**every, **given})


def list_terrains() -> dict[str, Any]:
    """Return name, summary, parameters and, of grounds, usual amplitude (m) of all families and scenes."""
    grounds = [
        {**_described(name, family), "amplitude_m": family.default_amplitude}
        for name, family in terrain_families().items()
    ]
    return {"terrains": grounds, "scenes": [_described(*scene) for scene in scene_kinds().items()]}


def _described(name: str, kind: Any) -> dict[str, Any]:
    """Return name, summary and parameters of a family of grounds or a scene."""
    found = []
    for field in fields(kind):
        unit, choices = unit_and_choices(kind, field.name)
        row = {"name": field.name, "default": field.default, "unit": unit or "1"}
        found.append(row | {"about": field.metadata["about"], "choices": choices})
    return {"name": name, "summary": first_line(kind), "parameters": found}


def _rows(family: dict[str, Any]) -> list[str]:
    lines = []
    for parameter in family["parameters"]:
        unit = "" if parameter["unit"] == "1" else f" {parameter['unit']}"
        choices = f" ({', '.join(parameter['choices'])})" if parameter["choices"] else ""
        lines.append(f"    {parameter['name']} = {parameter['default']}{unit}  {parameter['about']}{choices}")
    return lines
