"""`wbc terrain` and `wbc terrains`: grounds to walk on."""

from __future__ import annotations

import json

from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.sim.terrain.report import TerrainOptions, describe_terrain, list_terrains


@reports
def terrain(options: Flat[TerrainOptions], *, output: OutputOptions = Output()) -> Report:
    """Describe a ground, and draw or measure it if asked to."""
    facts = describe_terrain(options)
    return output.report(facts, "\n".join(f"{key:<14} {json.dumps(value)}" for key, value in facts.items()))


@reports
def terrains(*, output: OutputOptions = Output()) -> Report:
    """List the families of grounds with their parameters."""
    families = list_terrains()
    lines = []
    for family in families:
        lines.append(f"{family['name']:<12} {family['summary']} (amplitude {family['amplitude_m']:g} m)")
        for parameter in family["parameters"]:
            unit = f" {parameter['unit']}" if parameter["unit"] else ""
            lines.append(f"    {parameter['name']} = {parameter['default']}{unit}  {parameter['about']}")
    return output.report({"terrains": families}, "\n".join(lines))
