"""`wbc robots`: a table of the robots, or the description of one."""

from __future__ import annotations

from typing import Annotated, Any

from cyclopts import Parameter

from wbc.app.output import Output, OutputOptions, Report, reports
from wbc.robots import load, names

COLUMNS = {"mass_kg": "mass kg", "height_m": "height m", "com_height_m": "CoM m", "dof": "joints"}
"""Columns of the table: key of `RobotDescription.summary` → heading."""


@reports
def robots(
    name: Annotated[
        str | None, Parameter(help="Robot to describe in full; all in a table when left out.")
    ] = None,
    /,
    *,
    output: OutputOptions = Output(),
) -> Report:
    """List the robots, or describe one: limits, posture, servo gains, soles and what was derived."""
    if name is not None:
        description = load(name)
        return output.report(description.summary(), description.report())
    facts = [load(each).summary() for each in names()]
    return output.report({"robots": [_brief(each) for each in facts]}, _table(facts))


def _brief(facts: dict[str, Any]) -> dict[str, Any]:
    sole = next(iter(facts["soles"].values()))
    keys = ("name", *COLUMNS, "nv", "licence", "source")
    return {key: facts[key] for key in keys} | {"sole_m": sole["size_m"]}


def _table(facts: list[dict[str, Any]]) -> str:
    lines = [
        f"{'robot':<14}" + "".join(f"{heading:>10}" for heading in COLUMNS.values()) + f"{'sole mm':>12}"
    ]
    for each in facts:
        values = "".join(f"{_number(each[key]):>10}" for key in COLUMNS)
        length, width = next(iter(each["soles"].values()))["size_m"]
        lines.append(f"{each['name']:<14}{values}{f'{1e3 * length:.0f} x {1e3 * width:.0f}':>12}")
    return "\n".join(lines)


def _number(value: Any) -> str:
    return "?" if value is None else f"{value:.4g}"
