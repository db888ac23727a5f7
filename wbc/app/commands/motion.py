"""`wbc motion`: clips made, checked, made feasible and tracked."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter

from wbc import robots
from wbc.app.live import LiveView, with_changes
from wbc.app.output import Report, reports
from wbc.base.errors import InputError
from wbc.base.files import check_target
from wbc.base.settings import NonNegative, Positive, settings
from wbc.core.robot import Robot
from wbc.motion import (
    MotionClip,
    check_motion,
    make_feasible,
    read_motion,
    read_skeleton,
    retarget,
    write_motion,
)
from wbc.motion.feasible import FeasibleMotion
from wbc.motion.files import Axis, shows_person
from wbc.motion.measures import MotionMeasures
from wbc.sim.balance.tracking import TrackSpec, TrackTrial

CLIPS = (".npz", ".csv")
"""Endings of the clips that are written."""


@settings(kw_only=True)
class ClipOptions:
    """Options of the clip.

    Attributes:
        rate: Frames per second, Hz, of a file that does not say it.
        joint: Joint of the next column, of a file that does not name them; once for each. Of a person's clip a joint
            that the usual names do not find, such as left_knee=LKnee.
        up: Axis that points up in a person's clip: y of a .bvh file and z of an .npz file if it is not given.
        begin: Time in a person's clip at which the motion begins, s.
        end: Time at which it ends, s; the end of the clip if it is not given.
        out: Clip that filter writes, .npz or .csv.
    """

    rate: Annotated[Positive, "Hz"] | None = None
    joint: tuple[str, ...] = ()
    up: Axis | None = None
    begin: Annotated[NonNegative, "s"] = 0.0
    end: Annotated[Positive, "s"] | None = None
    out: Annotated[Path | None, Parameter(alias="-o")] = None

    def read(self, file: Path, name: str) -> tuple[Robot, MotionClip]:
        """Return a robot, by its name, and the clip for it."""
        robot = robots.load(name).robot()
        if shows_person(file):
            person = read_skeleton(file, rate=self.rate, up=self.up).part(self.begin, self.end)
            return robot, retarget(person, robot, joints=dict(self._joint_of_person())).clip
        for option in ("up", "begin", "end"):
            if getattr(self, option):
                raise InputError(f"--{option} is an option of a person's clip, .bvh or .npz with positions")
        clip = read_motion(file, rate=self.rate, joints=self.joint or None)
        clip.configurations(robot)  # refuses a clip of another robot
        return robot, clip

    def _joint_of_person(self) -> Iterator[tuple[str, str]]:
        for joint in self.joint:
            part, found, name = joint.partition("=")
            if not found:
                raise InputError(f"--joint of a person's clip must be such as left_knee=LKnee, got '{joint}'")
            yield part, name

    def target(self, file: Path) -> Path:
        """Return the file of the clip to write."""
        if self.out is None:
            raise InputError("give the clip to write, .npz or .csv: --out or -o")
        return check_target("a motion", self.out, CLIPS, [file])


@reports
def motion(
    do: Annotated[Literal["check", "filter", "track"], Parameter(help="What is done with it.")],
    clip: Annotated[Path, Parameter(help="Clip of the robot, .npz or .csv, or of a person, .bvh or .npz.")],
    /,
    *,
    spec: TrackSpec,
    options: ClipOptions,
    live: LiveView,
) -> Report:
    """Check, filter or track a clip of joint positions, or of a person.

    `check` measures joint limits, speeds, torques, foot slide and the ZMP. `filter` makes the clip feasible, and
    reports the changes. `track` simulates a robot that follows the clip while it balances; a clip that is not feasible
    is filtered first. The clip of a person is retargeted to the robot first.
    """
    if do == "filter":
        return _filter(clip, spec.robot, options)
    if options.out is not None:
        raise InputError(f"--out is no option of 'motion {do}'")
    if do == "check":
        return _check(clip, spec.robot, options)
    return _track(clip, spec, options, live)


def _check(file: Path, name: str, options: ClipOptions) -> Report:
    robot, clip = options.read(file, name)
    measures = check_motion(robot, clip)
    verdict = (
        "feasible"
        if measures.feasible
        else "not feasible as it is: `wbc motion filter` changes what must change"
    )
    lines = [
        f"{clip.name} on {name}: {clip.duration:.2f} s at {clip.rate:g} Hz, {verdict}",
        *_table(measures),
    ]
    return Report({"motion": clip.name, "robot": name} | measures.to_json(), "\n".join(lines))


def _filter(file: Path, name: str, options: ClipOptions) -> Report:
    target = options.target(file)
    robot, given = options.read(file, name)
    result = make_feasible(robot, given)
    write_motion(result.clip, target)
    data = {
        "motion": given.name,
        "robot": name,
        "file": str(target),
        "before": result.before.to_json(),
        "after": result.after.to_json(),
        "changed_most_deg": {name: float(np.degrees(value)) for name, value in result.changes.items()},
        "steps_shortened_mm": 1e3 * result.shortened,
        "stretched": result.stretched,
        "unfinished": list(result.unfinished),
    }
    return Report(data, "\n".join(_changes(given, result)) + f"\nwritten to {target}")


def _track(file: Path, spec: TrackSpec, options: ClipOptions, live: LiveView) -> Report:
    robot, given = options.read(file, spec.robot)
    clip, lines = given, []
    data: dict[str, Any] = {"motion": given.name}
    if not (given.standing is not None and check_motion(robot, given).feasible):
        feasible = make_feasible(robot, given)
        clip, lines = feasible.clip, _changes(given, feasible)
        data |= {"feasible": feasible.after.feasible, "stretched": feasible.stretched}
        data |= {"unfinished": list(feasible.unfinished)}
    result, trial, hooks = live.run(
        lambda: TrackTrial(clip, spec, visuals=live.view is not None),
        lambda trial, hooks: trial.run(hooks),
        lambda ended: "tracked to its end" if ended.completed else f"fell after {ended.seconds:.2f} s",
    )
    state = "tracked to its end" if result.completed else f"FELL after {result.seconds:.2f} s: {result.fall}"
    lines += [
        f"{result.motion} on {result.robot}, {result.mode} control, {spec.foot} feet, noise {spec.noise}, "
        f"{result.clip_seconds:.2f} s: {state}",
        f"  joints within {degrees(result.joint_rms):.2g}° rms of the clip, {result.worst_joint} "
        f"{degrees(result.worst_joint_rms):.2g}°, at most {degrees(result.joint_error_max):.2g}°",
        f"  centre of mass {1e3 * result.com_rms:.2g} mm rms; loaded feet slid by {1e3 * result.foot_slide:.2g} mm "
        f"at most; {result.landings} landings",
        f"  {result.clock}; {result.failures} failed",
    ]
    return Report(*with_changes(hooks, trial, data | result.to_json(), "\n".join(lines)))


ROWS = (
    ("joints over their limits", lambda m: float(len(m.joint_excess)), ""),
    ("joints over the speed allowed", lambda m: float(len(m.joint_speed)), ""),
    ("joints over the torque allowed", lambda m: float(len(m.joint_torque)), ""),
    ("path of soles that stand", lambda m: 1e3 * m.slide_speed, "mm/s"),
    ("depth of soles below the ground", lambda m: 1e3 * m.sole_depth, "mm"),
    ("ZMP outside the support, most", lambda m: 1e3 * m.zmp_outside, "mm"),
    ("friction that soles need, most", lambda m: m.friction, ""),
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
    unfinished = [f"  not finished: {', '.join(result.unfinished)}"] if result.unfinished else []
    return [
        f"{given.name}: {verdict}; {result.stretched:.2f} x its time, steps shortened by up to "
        f"{1e3 * result.shortened:.0f} mm",
        f"  {'':<34}{'before':>10}{'after':>10}",
        *_table(result.before, result.after),
        f"  changed most, degrees: {changed}",
        *unfinished,
    ]
