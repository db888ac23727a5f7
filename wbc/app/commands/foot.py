"""`wbc foot`: the feet, and tests of one foot on a rig."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from cyclopts import Parameter
from rich.progress import Progress, track

from wbc.app.arguments import NONE_GIVEN, Fields, attribute_docs
from wbc.app.files import check_picture
from wbc.app.output import Flat, Output, OutputOptions, Report, progress_console, reports
from wbc.core.changes import changed, read_changes, setting_names
from wbc.core.errors import InputError
from wbc.core.settings import Count, settings, to_json
from wbc.feet import Foot, SoftFoot, foot_names
from wbc.feet.soles.catalog import foot as foot_by_name
from wbc.feet.soles.rigid import RigidFoot
from wbc.feet.soles.sole import SoleGeometry
from wbc.robots import load, names
from wbc.sim import rig
from wbc.sim.plant.model import sole_geometries
from wbc.sim.plant.settings import PhysicsSettings
from wbc.sim.rig import (
    HRP4C_SOLE,
    LOADS,
    STIFFNESSES,
    Deflection,
    FootTest,
    PitchResult,
    PressResult,
    SlideResult,
    StiffnessRow,
)
from wbc.sim.rig.spec import fit_facts
from wbc.sim.rig.study import rising_loads, with_stiffness
from wbc.sim.terrain import Rendering, Terrain
from wbc.sim.terrain import terrain as make_terrain
from wbc.sim.terrain.families.base import make_family

Result = TypeVar("Result", PressResult, SlideResult, PitchResult)

Several = Parameter(consume_multiple=True)
"""An option that takes all the values that follow it."""

Test = Literal["press", "drop", "slide", "pitch", "curves", "stability"]

OWN = {
    "press": ("drop", "plot"),
    "drop": ("height", "plot"),
    "slide": ("shear_share", "ramp"),
    "pitch": ("angle", "rate", "plot"),
    "curves": ("seeds", "loads", "plot"),
    "stability": ("seeds", "timesteps"),
}
"""Test → options that belong to it; the others are those of every test, or of every single one."""

SINGLE = ("param", "rendering", "resolution", "x", "y", "yaw", "timestep", "seed")
"""Options of a test on one ground."""


SHARED = Fields(
    FootTest,
    {
        "load": "load",
        "ankle-stiffness": "ankle_stiffness",
        "x": "x",
        "y": "y",
        "drop": "drop",
        "settle": "settle",
        "hold": "hold",
    },
)
"""Options that are fields of the test."""


@settings(kw_only=True)
class FootOptions:
    """Options of a foot, the ground under it and the test.

    Attributes:
        foot: Foot that is tested.
        foot_param: Its parameters, each as name=value, such as phalanges=8 or contact.radius=0.005.
        robot: Robot whose ankle the foot is fitted to, and only one in the list; 93 mm over 160 x 76 mm if not given.
        stiffness: Of the sole hinges of a soft foot, Nm/rad; several for curves and stability.
        terrain: Family of grounds that `wbc terrain` lists; several for curves and stability (random stones).
        amplitude: Highest minus lowest point of the ground, m; 30 mm for curves and stability.
        param: Parameters of the ground, each as name=value.
        seed: Fixes every random draw of the ground.
        seeds: Grounds of each family, for curves and stability.
        rendering: Solids (geoms), height_field, or auto: solids wherever the family is made of them.
        resolution: Greatest cell of a height field, m; fine enough for ground and sole if not given.
        yaw: Heading of the foot, degrees.
        timestep: Physics step, s.
        timesteps: Physics steps of the stability table, s.
        height: Height over the ground from which a drop lets the foot fall, m.
        shear_share: Shear over weight while a slide measures creep.
        ramp: Growth of shear over weight per second afterwards, 1/s.
        angle: Largest pitch that the ankle is asked for, degrees.
        rate: Speed of the pitch, degrees/s.
        loads: Loads of the force–deflection curves over a bar as high as the grounds, N.
        plot: Picture to write.
    """

    foot: str = "soft"
    foot_param: tuple[str, ...] = ()
    robot: str | None = None
    stiffness: Annotated[tuple[float, ...], Several] = ()
    terrain: Annotated[tuple[str, ...], Several] = ()
    amplitude: float | None = None
    param: tuple[str, ...] = ()
    seed: int = 0
    seeds: Count = 5
    rendering: Rendering = "auto"
    resolution: float | None = None
    yaw: float = math.degrees(FootTest.yaw)
    timestep: float = PhysicsSettings.timestep
    timesteps: Annotated[tuple[float, ...], Several] = (0.001, 0.002)
    height: float = 0.05
    shear_share: float = 0.3
    ramp: float = 1.0
    angle: float = 5.0
    rate: float = 10.0
    loads: Annotated[tuple[float, ...], Several] = LOADS
    plot: Path | None = None

    def check(self, test: Test, shared: Mapping[str, Any]) -> None:
        """Refuse options that a test does not have.

        Args:
            test: The test.
            shared: Fields of `FootTest` that are given.

        Raises:
            InputError: Such an option.
        """
        taken = {*OWN[test], *(SINGLE if test not in ("curves", "stability") else ())}
        given = {each.name for each in fields(self) if getattr(self, each.name) != each.default} | set(shared)
        for name in sorted(given & {*SINGLE, *(each for own in OWN.values() for each in own)} - taken):
            raise InputError(f"--{name.replace('_', '-')} is no option of 'foot {test}'")
        if test not in ("curves", "stability") and max(len(self.terrain), len(self.stiffness)) > 1:
            raise InputError(
                f"'foot {test}' takes one ground and one stiffness; curves and stability take several"
            )

    def test(self, given: Mapping[str, Any]) -> FootTest:
        """Return the test of one foot on one ground.

        Args:
            given: Further fields of the test.

        Raises:
            UnknownNameError: No such foot, robot, ground or parameter.
            InputError: A value out of range, a stiffness for a foot that has none, or a foot that does not fit.
        """
        design = self._foot(*self.stiffness)
        ground = make_terrain(
            make_family(self.terrain[0] if self.terrain else "flat", read_changes(self.param)),
            self.amplitude,
            self.seed,
            rendering=self.rendering,
            resolution=self.resolution,
            sole_radius=design.contact.radius,
        )
        return replace(
            self._shared(design, given),
            ground=ground,
            yaw=math.radians(self.yaw),
            physics=PhysicsSettings(timestep=self.timestep),
        )

    def study(
        self, given: Mapping[str, Any]
    ) -> tuple[FootTest, tuple[Terrain, ...], tuple[float, ...], float]:
        """Return what the runs of a study share, its grounds, its stiffnesses (Nm/rad) and their amplitude (m).

        Args:
            given: Further fields of the tests.

        Raises:
            UnknownNameError: No such foot, robot, ground or parameter.
            InputError: A value out of range, or a foot that does not fit.
        """
        amplitude = 0.03 if self.amplitude is None else self.amplitude
        grounds = tuple(
            make_terrain(name, 0.0 if name == "flat" else amplitude, seed)
            for seed in range(self.seeds)
            for name in self.terrain or ("random", "stones")
        )
        return self._shared(self._foot(), given), grounds, self.stiffness or STIFFNESSES, amplitude

    def _shared(self, design: Foot, given: Mapping[str, Any]) -> FootTest:
        sole = HRP4C_SOLE if self.robot is None else _sole(self.robot)
        return FootTest(foot=design, robot_sole=sole, **given)

    def _foot(self, *stiffness: float) -> Foot:
        design = foot_by_name(self.foot)
        values = read_changes(self.foot_param)
        for value in stiffness:
            if not isinstance(design, SoftFoot):
                raise InputError(
                    f"a {self.foot} foot has no stiffness; leave --stiffness out, or take a soft foot"
                )
            if "stiffness" in values:
                raise InputError("the stiffness is given twice, as --stiffness and as --foot-param")
            values["stiffness"] = value
        return changed(design, values)


@reports
def foot(
    test: Annotated[Test | None, Parameter(help="Test; the feet are listed when left out.")] = None,
    /,
    *,
    options: Flat[FootOptions] = FootOptions(),
    given: Annotated[Mapping[str, Any], SHARED] = NONE_GIVEN,
    output: OutputOptions = Output(),
) -> Report:
    """List the feet, or test one on a rig: press, drop, slide, pitch; curves and stability over many grounds.

    A press lets the foot settle under a load and looks at forces, contacts, support and sole; a drop shows what the
    sole takes of a hard landing; a slide how it creeps under shear and when it slips; a pitch how the centre of
    pressure follows the ankle. Curves (about a minute) are contact area, support and ankle height over the stiffness, a
    rigid foot of the same size beside; stability (minutes) asks for every physics step: does it diverge, is it quiet.
    """
    if test is None:
        return _list(options.robot, output)
    options.check(test, given)
    if test == "curves":
        return _curves(given, options, output)
    if test == "stability":
        return _stability(given, options, output)
    target = check_picture(options.plot, options.param)
    made = options.test(given)
    if test == "press":
        return _report(output, made, rig.press(made), _press_lines, rig.plot_press, target)
    if test == "drop":
        return _report(
            output, made, rig.drop(made, height=options.height), _press_lines, rig.plot_press, target
        )
    if test == "slide":
        slid = rig.slide(made, shear_share=options.shear_share, ramp=options.ramp)
        return _report(output, made, slid, _slide_lines)
    angle, rate = math.radians(options.angle), math.radians(options.rate)
    return _report(
        output, made, rig.pitch(made, amplitude=angle, rate=rate), _pitch_lines, rig.plot_pitch, target
    )


def _list(robot: str | None, output: Output) -> Report:
    """Report how the feet fit every robot, what mass and height they add, and their parameters."""
    soles = {name: _sole(name) for name in (names() if robot is None else [robot])}
    listed = []
    for name in foot_names():
        design = foot_by_name(name)
        fits: dict[str, dict[str, Any]] = {}
        for each, sole in soles.items():
            try:
                fits[each] = fit_facts(design.fit(sole))
            except InputError as error:
                fits[each] = {"error": str(error)}
        about = (inspect.getdoc(type(design)) or "").splitlines()[0]
        listed.append({"name": name, "summary": about, "fits": fits, "parameters": parameters(design)})
    return output.report({"feet": listed}, "\n".join(_lines(listed)))


def _sole(robot: str) -> SoleGeometry:
    return sole_geometries(load(robot).robot())[0]


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


def _curves(given: Mapping[str, Any], options: FootOptions, output: Output) -> Report:
    """Report curves over the stiffness, a rigid foot of the same footprint beside the soft one."""
    test, grounds, stiffnesses, amplitude = options.study(given)
    target = check_picture(options.plot)
    tests = _versions(test, stiffnesses)
    first, *further = rising_loads(options.loads)
    bars = [replace(rig.over_bar(each, amplitude), load=first) for each in tests]
    rows: list[StiffnessRow] = []
    deflections: list[Deflection] = []
    with Progress(console=progress_console()) as bar:
        task = bar.add_task("pressing", total=len(grounds) * len(tests) + len(bars))
        for each in tests:
            for ground in grounds:
                stiffness = each.foot.stiffness if isinstance(each.foot, SoftFoot) else 0.0
                rows += rig.stiffness_curves(each, stiffnesses=(stiffness,), grounds=(ground,))
                bar.advance(task)
        for each in bars:
            deflections.append(rig.force_deflection(each, loads=further))
            bar.advance(task)
    data: dict[str, Any] = {
        "test": test.describe(),
        "means": to_json(rig.stiffness_means(rows)),
        "rows": to_json(rows),
        "deflections": to_json(deflections),
        "diverged": len(tests) * len(grounds) - len(rows) + sum(curve.diverged for curve in deflections),
    }
    if target is not None:
        rig.plot_curves(rows, deflections, target)
        data["plot"] = str(target)
    text = (
        f"{rig.stiffness_table(rows)}\n\nAnkle deflection (mm) over a bar of {1e3 * amplitude:g} mm under the "
        f"middle of the arch:\n\n{rig.deflection_table(deflections)}"
    )
    if data["diverged"]:
        text += f"\n\n{data['diverged']} runs DIVERGED"
    return output.report(data, text)


def _stability(given: Mapping[str, Any], options: FootOptions, output: Output) -> Report:
    """Report the stability of a soft foot for every stiffness, ground and physics step."""
    test, grounds, stiffnesses, _ = options.study(given)
    total = len(stiffnesses) * len(grounds) * len(options.timesteps)
    cells = rig.stability(test, stiffnesses=stiffnesses, grounds=grounds, timesteps=options.timesteps)
    rows = list(track(cells, "pressing", total, console=progress_console()))
    data = {
        "test": test.describe(),
        "cells": len(rows),
        "diverged": sum(row.diverged for row in rows),
        "rows": to_json(rows),
    }
    return output.report(data, rig.stability_table(rows))


def _versions(test: FootTest, stiffnesses: Iterable[float]) -> list[FootTest]:
    """Return the foot at every stiffness and a rigid one of its size; a rigid foot alone."""
    if not isinstance(test.foot, SoftFoot):
        return [test]
    soft = test.foot
    rigid = RigidFoot(
        contact=soft.contact,
        length=soft.length,
        width=soft.width,
        thickness=soft.thickness,
        ankle_behind=soft.ankle_behind,
        ankle_height=soft.ankle_height,
        mass=soft.mass,
    )
    designs = [*(with_stiffness(soft, stiffness) for stiffness in stiffnesses), rigid]
    return [replace(test, foot=design) for design in designs]


def _report(
    output: Output,
    test: FootTest,
    result: Result,
    lines: Callable[[Result], list[str]],
    plot: Callable[[FootTest, Result, Path], None] | None = None,
    target: Path | None = None,
) -> Report:
    """Draw a result if asked to, and report test and result."""
    data = {**test.describe(), **to_json(result)}
    if plot is not None and target is not None and not result.diverged:
        plot(test, result, target)
        data["plot"] = str(target)
    return output.report(data, "\n".join([_headline(test), *lines(result)]))


def _headline(test: FootTest) -> str:
    """Return foot, ground and load as text for people."""
    description, ground = test.describe(), test.ground
    on = (
        f"{ground.name}, {1e3 * ground.amplitude:.0f} mm, seed {ground.seed}"
        if ground.amplitude
        else "flat ground"
    )
    length, width = (1e3 * size for size in description["footprint_m"])
    stiffness = f" of {test.foot.stiffness:g} Nm/rad" if hasattr(test.foot, "stiffness") else ""
    return (
        f"{description['foot']} foot{stiffness} on {on}, {test.load:g} N on the ankle\n"
        f"  foot      {length:.0f} x {width:.0f} mm, {description['added_mass_kg']:.2f} kg more and "
        f"{1e3 * description['height_change_m']:.0f} mm higher than the ankle's own sole"
    )


def _press_lines(result: PressResult) -> list[str]:
    if result.hold is None or result.impact is None:
        return [_DIVERGED]
    hold, impact, support = result.hold, result.impact, result.support
    lines = [
        f"  landing   {impact.speed:.2f} m/s, peak {impact.peak_force:.0f} N, {100 * impact.absorbed:.1f} % of "
        f"{impact.drop_energy:.2f} J absorbed, {impact.sole_energy:.2f} J of it in the sole and "
        f"{impact.arch_energy:.2f} J in the arch",
        f"  force     {hold.force_mean:.1f} N, {100 * hold.balance_error:+.3f} % off the weight, "
        f"± {hold.force_std:.2g} N",
        f"  contacts  {hold.contacts} points around {1e4 * hold.contact_area:.1f} cm², "
        f"centre of pressure ({1e3 * hold.centre_of_pressure[0]:.1f}, {1e3 * hold.centre_of_pressure[1]:.1f}) mm",
    ]
    if support is not None:
        lines.append(
            f"  support   {1e4 * support.area:.1f} cm², {1e3 * support.backward:.0f} to {1e3 * support.forward:.0f} mm "
            f"along, {1e3 * support.right:.0f} to {1e3 * support.left:.0f} mm across"
        )
    lines.append(
        f"  ankle     {1e3 * hold.ankle_height:.1f} mm high, tilted by {math.degrees(hold.ankle_tilt[0]):.2f}° roll, "
        f"{math.degrees(hold.ankle_tilt[1]):.2f}° pitch"
    )
    if hold.sole_angles:
        degrees = " ".join(f"{math.degrees(angle):.1f}" for angle in hold.sole_angles)
        lines.append(f"  sole      {degrees} degrees from toe to heel, loop gap {1e3 * hold.loop_gap:.3f} mm")
    lines.append(
        f"  depth     {1e3 * hold.penetration:.3f} mm penetration, {1e3 * hold.penetration_peak:.3f} mm at landing"
    )
    return lines


def _slide_lines(result: SlideResult) -> list[str]:
    if result.diverged:
        return [_DIVERGED]
    slips = "does not slide" if math.isnan(result.slip_share) else f"slides at {result.slip_share:.2f} of it"
    return [
        f"  creep     {1e6 * result.creep:.1f} µm/s under a shear of {result.shear_share:g} of the weight",
        f"  friction  {slips}",
    ]


def _pitch_lines(result: PitchResult) -> list[str]:
    if result.diverged:
        return [_DIVERGED]
    lines = []
    for name, pick in (("toe down", max), ("toe up", min)):
        i = result.pitch.index(pick(result.pitch))
        lines.append(
            f"  {name:<9} {math.degrees(result.pitch[i]):+.1f}°: centre of pressure at "
            f"{1e3 * result.centre_of_pressure[i]:.0f} mm, moment {result.moment[i]:.1f} Nm, ankle "
            f"{1e3 * result.ankle_height[i]:.1f} mm high"
        )
    return lines


_DIVERGED = "  the simulation DIVERGED"
