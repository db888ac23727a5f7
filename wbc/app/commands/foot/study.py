"""`wbc foot curves` and `wbc foot stability`: one foot over stiffnesses and grounds."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from rich.progress import Progress, track

from wbc.app.files import check_picture
from wbc.app.output import Flat, Output, OutputOptions, Report, progress_console, reports
from wbc.app.rig_options import Several, StudyOptions
from wbc.core.settings import settings, to_json
from wbc.feet import SoftFoot
from wbc.feet.soles.rigid import RigidFoot
from wbc.sim import rig as bench
from wbc.sim.rig import LOADS, Deflection, FootTest, StiffnessRow
from wbc.sim.rig.study import rising_loads, with_stiffness


@settings(kw_only=True)
class CurvesOptions:
    """Options of `wbc foot curves`.

    Attributes:
        loads: Loads of the force–deflection curves over a bar as high as the grounds, N.
        plot: Picture to write.
    """

    loads: Annotated[tuple[float, ...], Several] = LOADS
    plot: Path | None = None


@settings(kw_only=True)
class StabilityOptions:
    """Options of `wbc foot stability`.

    Attributes:
        timesteps: Physics steps, s.
    """

    timesteps: Annotated[tuple[float, ...], Several] = (0.001, 0.002)


@reports
def curves(
    study: Flat[StudyOptions] = StudyOptions(),
    *,
    options: Flat[CurvesOptions] = CurvesOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Contact area, support area and ankle height over stiffness, and force–deflection curves; about a minute.

    A rigid foot of the same footprint is tried beside the soft one.
    """
    test, grounds = study.test(), study.grounds()
    target = check_picture(options.plot)
    tests = _versions(test, study.stiffness)
    first, *further = rising_loads(options.loads)
    bars = [replace(bench.over_bar(each, study.amplitude), load=first) for each in tests]
    rows: list[StiffnessRow] = []
    deflections: list[Deflection] = []
    with Progress(console=progress_console()) as bar:
        task = bar.add_task("pressing", total=len(grounds) * len(tests) + len(bars))
        for each in tests:
            for ground in grounds:
                stiffness = each.foot.stiffness if isinstance(each.foot, SoftFoot) else 0.0
                rows += bench.stiffness_curves(each, stiffnesses=(stiffness,), grounds=(ground,))
                bar.advance(task)
        for each in bars:
            deflections.append(bench.force_deflection(each, loads=further))
            bar.advance(task)
    data: dict[str, Any] = {
        "test": test.describe(),
        "means": to_json(bench.stiffness_means(rows)),
        "rows": to_json(rows),
        "deflections": to_json(deflections),
        "diverged": len(tests) * len(grounds) - len(rows) + sum(curve.diverged for curve in deflections),
    }
    if target is not None:
        bench.plot_curves(rows, deflections, target)
        data["plot"] = str(target)
    text = (
        f"{bench.stiffness_table(rows)}\n\nAnkle deflection (mm) over a bar of {1e3 * study.amplitude:g} mm under the "
        f"middle of the arch:\n\n{bench.deflection_table(deflections)}"
    )
    if data["diverged"]:
        text += f"\n\n{data['diverged']} runs DIVERGED"
    return output.report(data, text)


@reports
def stability(
    study: Flat[StudyOptions] = StudyOptions(),
    *,
    options: Flat[StabilityOptions] = StabilityOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Press a soft foot for every stiffness, ground and physics step: does it diverge, is it quiet; takes minutes."""
    test, grounds = study.test(), study.grounds()
    total = len(study.stiffness) * len(grounds) * len(options.timesteps)
    cells = bench.stability(test, stiffnesses=study.stiffness, grounds=grounds, timesteps=options.timesteps)
    rows = list(track(cells, "pressing", total, console=progress_console()))
    data = {
        "test": test.describe(),
        "cells": len(rows),
        "diverged": sum(row.diverged for row in rows),
        "rows": to_json(rows),
    }
    return output.report(data, bench.stability_table(rows))


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
