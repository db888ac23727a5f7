"""`wbc terrain` and `wbc terrains`: grounds to walk on."""

from __future__ import annotations

import json
from typing import Any

from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.sim.terrain.report import TerrainListOptions, TerrainOptions, describe_terrain, list_terrains


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


def _listing(families: list[dict[str, Any]]) -> list[str]:
    lines = []
    for family in families:
        lines.append(f"{family['name']:<18} {family['summary']} (amplitude {family['amplitude_m']:g} m)")
        for parameter in family["parameters"]:
            unit = "" if parameter["unit"] == "1" else f" {parameter['unit']}"
            lines.append(f"    {parameter['name']} = {parameter['default']}{unit}  {parameter['about']}")
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
    """A value for people: numbers to four digits."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, dict):
        return "  ".join(f"{key} {_text(each)}" for key, each in value.items()) or "-"
    if isinstance(value, list):
        return " x ".join(_text(each) for each in value)
    return value if isinstance(value, str) else json.dumps(value)
