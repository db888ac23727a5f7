"""`wbc feet`: the feet, their parameters and their fit under the ankles of robots."""

from __future__ import annotations

import inspect
from typing import Any

from wbc.app.arguments import attribute_docs
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.core.changes import setting_names
from wbc.core.errors import InputError
from wbc.core.settings import settings, to_json
from wbc.feet import Foot, foot, foot_names
from wbc.robots import load, names
from wbc.sim.plant.model import sole_geometries
from wbc.sim.rig.spec import fit_facts


@settings(kw_only=True)
class FeetOptions:
    """Options of `wbc feet`.

    Attributes:
        robot: Only this robot; all that `wbc robots` lists when not given.
    """

    robot: str | None = None


@reports
def feet(options: Flat[FeetOptions] = FeetOptions(), *, output: OutputOptions = Output()) -> Report:
    """List the feet: how they fit every robot, what mass and height they add, and their parameters."""
    robots = list(names()) if options.robot is None else [options.robot]
    soles = {name: sole_geometries(load(name).robot())[0] for name in robots}
    listed = []
    for name in foot_names():
        design = foot(name)
        fits: dict[str, dict[str, Any]] = {}
        for robot, sole in soles.items():
            try:
                fits[robot] = fit_facts(design.fit(sole))
            except InputError as error:
                fits[robot] = {"error": str(error)}
        listed.append(
            {"name": name, "summary": _summary(type(design)), "fits": fits, "parameters": parameters(design)}
        )
    return output.report({"feet": listed}, "\n".join(_lines(listed)))


def parameters(design: Foot) -> list[dict[str, Any]]:
    """Return the parameters of a foot: name, default and meaning, with its unit."""
    listed = []
    for path in setting_names(design):
        owner: Any = design
        *groups, name = path.split(".")
        for group in groups:
            owner = getattr(owner, group)
        default, about = to_json(getattr(owner, name)), attribute_docs(type(owner)).get(name, "")
        listed.append({"name": path, "default": default, "about": about})
    return listed


def _summary(kind: type) -> str:
    return (inspect.getdoc(kind) or "").splitlines()[0]


def _lines(listed: list[dict[str, Any]]) -> list[str]:
    lines = []
    shared: dict[str, str] = {}
    for entry in listed:
        lines.append(f"{entry['name']}: {entry['summary']}")
        for robot, fit in entry["fits"].items():
            if "error" in fit:
                lines.append(f"    {robot:<12} {fit['error']}")
                continue
            (length, width), (behind, _, height) = fit["footprint_m"], fit["ankle_in_sole_m"]
            lines.append(
                f"    {robot:<12} {1e3 * length:.0f} x {1e3 * width:.0f} mm, ankle {-1e3 * behind:.0f} mm behind its "
                f"centre and {1e3 * height:.0f} mm up; {fit['added_mass_kg']:.2f} kg more, "
                f"{1e3 * fit['height_change_m']:.0f} mm higher"
            )
        for each in entry["parameters"]:
            line = f"    {each['name']} = {each['default']}  {each['about']}"
            if each["name"].startswith("contact."):
                shared[each["name"]] = line
            else:
                lines.append(line)
    return [*lines, "How all of them touch the ground:", *shared.values()]
