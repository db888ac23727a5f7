"""`wbc motion`: clips made, checked and made feasible."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from wbc import robots
from wbc.app.files import check_picture, check_target
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.core.files import save_figure
from wbc.core.robot import Robot
from wbc.core.settings import Positive, Seed, settings
from wbc.motion import (
    FeasibleMotion,
    MotionClip,
    MotionMeasures,
    check_motion,
    make_feasible,
    make_motion,
    read_motion,
    write_motion,
)

CLIPS = (".npz", ".csv")


@settings
class ClipOptions:
    """The clip.

    Attributes:
        file: Clip to read, .npz or .csv.
        robot: Robot whose joints it moves.
        rate: Frames per second, Hz, of a file that does not say it.
        joint: Joint of the next column, of a file that does not name them; once for each.
        format: Format of the file: wbc, csv, unitree, beyondmimic or gmr; auto knows it by its contents.
    """

    file: Path
    robot: str = "g1"
    rate: Annotated[Positive, "Hz"] | None = None
    joint: tuple[str, ...] = ()
    format: str = "auto"

    def read(self) -> tuple[Robot, MotionClip]:
        """Return robot and clip."""
        robot = robots.load(self.robot).robot()
        clip = read_motion(self.file, rate=self.rate, joints=self.joint or None, kind=self.format)
        clip.configurations(robot)  # refuses a clip of another robot
        return robot, clip


@settings
class MakeOptions:
    """Options of `wbc motion make`.

    Attributes:
        name: Motion: arms, dance, waist, squat, one_leg or steps.
        out: Clip to write, .npz or .csv.
        robot: Robot that moves.
        seed: Fixes every random draw.
    """

    name: str
    out: Annotated[Path, Parameter(alias="-o")]
    robot: str = "g1"
    seed: Seed = 0


@settings(kw_only=True)
class FilterOptions:
    """Options of `wbc motion filter`.

    Attributes:
        out: Clip to write, .npz or .csv.
        plot: Picture to write of what was changed.
    """

    out: Annotated[Path, Parameter(alias="-o")]
    plot: Path | None = None


@reports
def make(options: Flat[MakeOptions], *, output: OutputOptions = Output()) -> Report:
    """Make a motion by rule: a clip to begin with."""
    target = check_target("a motion", options.out, CLIPS)
    clip = make_motion(robots.load(options.robot).robot(), options.name, options.seed)
    write_motion(clip, target)
    data = {"motion": clip.name, "robot": options.robot, "duration_s": clip.duration, "file": str(target)}
    return output.report(data, f"{clip.name} of {options.robot}: {clip.duration:g} s, written to {target}")


@reports
def check(options: Flat[ClipOptions], *, output: OutputOptions = Output()) -> Report:
    """Measure a clip as it is: limits, speeds, feet on the ground, ZMP in the supports."""
    robot, clip = options.read()
    measures = check_motion(robot, clip)
    verdict = (
        "feasible"
        if measures.feasible
        else "not feasible as it is: `wbc motion filter` changes what must change"
    )
    lines = [
        f"{clip.name} on {options.robot}: {clip.duration:.2f} s at {clip.rate:g} Hz, {verdict}",
        *_table(measures),
    ]
    return output.report({"motion": clip.name, "robot": options.robot} | measures.to_json(), "\n".join(lines))


@reports
def make_clip_feasible(
    clip: Flat[ClipOptions], *, options: Flat[FilterOptions], output: OutputOptions = Output()
) -> Report:
    """Make a clip feasible: limits, speeds, feet that stand still, ZMP in the supports; report what was changed."""
    target = check_target("a motion", options.out, CLIPS, [clip.file])
    picture = check_picture(options.plot, [clip.file, target])
    robot, given = clip.read()
    result = make_feasible(robot, given)
    write_motion(result.clip, target)
    if picture is not None:
        from wbc.app.plot.motion import draw_changes  # noqa: PLC0415 - slow to import

        save_figure(draw_changes(robot, given, result), picture, dpi=110.0)
    data = {
        "motion": given.name,
        "robot": clip.robot,
        "file": str(target),
        "before": result.before.to_json(),
        "after": result.after.to_json(),
        "changed_rms_deg": {name: float(np.degrees(value)) for name, value in result.changes.items()},
        "changed_most_deg": {name: float(np.degrees(value)) for name, value in result.largest.items()},
        "com_shift_mm": 1e3 * result.com_shift,
        "stretched": result.stretched,
    }
    return output.report(data, "\n".join(_changes(given, result)) + f"\nwritten to {target}")


ROWS = (
    ("joints over their limits", lambda m: float(len(m.joint_excess)), ""),
    ("joints over the speed allowed", lambda m: float(len(m.joint_speed)), ""),
    ("path of soles that stand", lambda m: m.foot_slide, "mm/s"),
    ("depth of soles below the ground", lambda m: m.penetration, "mm"),
    ("ZMP outside the support", lambda m: m.zmp_outside, "mm s"),
    ("ZMP outside, most", lambda m: m.zmp_worst, "mm"),
    ("time on one foot", lambda m: 100.0 * m.single_support, "%"),
    ("frames that are not feasible", lambda m: 100.0 * float(m.infeasible_frames.mean()), "%"),
)
"""Measures that are shown: label, value, unit."""


def _table(*columns: MotionMeasures) -> list[str]:
    return [
        f"  {label:<34}" + "".join(f"{value(measures):>10.4g}" for measures in columns) + f" {unit}"
        for label, value, unit in ROWS
    ]


def _changes(given: MotionClip, result: FeasibleMotion) -> list[str]:
    verdict = "feasible" if result.after.feasible else "still not feasible everywhere"
    most = sorted(result.changes, key=lambda name: -result.changes[name])[:6]
    changed = ", ".join(f"{name} {np.degrees(result.changes[name]):.1f}" for name in most)
    return [
        f"{given.name}: {verdict}; {result.stretched:.2f} x its time, centre of mass shifted by up to "
        f"{1e3 * result.com_shift:.0f} mm",
        f"  {'':<34}{'before':>10}{'after':>10}",
        *_table(result.before, result.after),
        f"  changed most, degrees rms: {changed}",
    ]
