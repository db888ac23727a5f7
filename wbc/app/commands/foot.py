"""`wbc foot`: the feet, and tests of one foot on a rig."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from wbc.app.arguments import Fields
from wbc.app.commands.settings import settings_of
from wbc.app.commands.terrain import TRACK, ground_of
from wbc.app.output import Report, facts_text, reports
from wbc.base.errors import InputError
from wbc.base.registry import first_line
from wbc.base.settings import (
    NonNegative,
    as_changes,
    read_changes,
    settings,
    to_json,
)
from wbc.feet.soles.catalog import changed_foot, foot_changes, foot_names
from wbc.feet.soles.catalog import foot as foot_by_name
from wbc.feet.soles.foot import AnkleSole
from wbc.robots import load, names
from wbc.sim.plant.fitting import ankle_soles
from wbc.sim.rig.press import press
from wbc.sim.rig.rig import HRP4C_SOLE, FootTest, fit_facts
from wbc.sim.terrain.spec import Terrain

SHARED = Fields(FootTest, "load ankle_stiffness x y drop settle hold")
"""Options that are fields of the test."""

GROUND = Fields(Terrain, "amplitude seed", help=TRACK.help)
"""Options that are fields of the ground."""


@settings(kw_only=True)
class FootOptions:
    """Options of a foot, the ground under it and the test.

    Attributes:
        foot: Foot that is tested.
        foot_param: Its parameters, each as name=value, such as phalanges=8 or contact.radius=0.005.
        robot: Robot whose ankle gets the foot, and the only one in the list; by default its sole is 160 x 76 mm.
        stiffness: Of the sole hinges of a soft foot, Nm/rad; the foot's own if not given.
        terrain: Family of grounds that `wbc terrain` lists.
        param: Parameters of the ground, each as name=value.
    """

    foot: str = "soft"
    foot_param: tuple[str, ...] = ()
    robot: str | None = None
    stiffness: NonNegative | None = None
    terrain: str = "flat"
    param: tuple[str, ...] = ()

    def test(self, given: Mapping[str, Any], ground: Mapping[str, Any]) -> FootTest:
        """Return the test of one foot on one ground, with further fields of both."""
        changes = foot_changes(self.foot, as_changes(read_changes(self.foot_param)))
        design = changed_foot(self.foot, self.stiffness, changes)
        return FootTest(
            foot=design,
            ground=ground_of(self.terrain, self.param, {"sole_radius": design.contact.radius, **ground}),
            robot_sole=HRP4C_SOLE if self.robot is None else _sole(self.robot),
            **given,
        )


@reports
def foot(
    test: Annotated[
        Literal["press"] | None, Parameter(help="Test; the feet are listed when left out.")
    ] = None,
    /,
    *,
    options: FootOptions,
    given: Annotated[Mapping[str, Any], SHARED],
    ground: Annotated[Mapping[str, Any], GROUND],
) -> Report:
    """List the feet, or press one on a ground, on a rig.

    A press lets the foot fall on the ground and settle under a load, and looks at impact, forces, contacts, support and
    sole.
    """
    if test is None:
        return _list(options.robot)
    made = options.test(given, ground)
    data = {**made.describe(), **to_json(press(made))}
    shown = {name: value for name, value in data.items() if name != "foot_parameters"}
    return Report(data, facts_text(shown))


def _list(robot: str | None) -> Report:
    soles = {name: _sole(name) for name in (names() if robot is None else [robot])}
    listed = []
    for name in foot_names():
        design = foot_by_name(name)
        fits: dict[str, dict[str, Any]] = {}
        for each, sole in soles.items():
            try:
                fits[each] = fit_facts(design, sole)
            except InputError as error:
                fits[each] = {"error": str(error)}
        own = [
            {"name": row.name, "default": to_json(row.value), "about": row.about}
            for row in settings_of(type(design), "", design)
        ]
        listed.append({"name": name, "summary": first_line(type(design)), "fits": fits, "parameters": own})
    return Report({"feet": listed}, "\n".join(_lines(listed)))


def _sole(robot: str) -> AnkleSole:
    return ankle_soles(load(robot).robot())[0]


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
