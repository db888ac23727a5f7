"""Table of tracked motions, for docs/motion.md: clips made by rule, made feasible, tracked with noise.

python benchmarks/trials/motions.py --modes position torque --journal motions.jsonl > table.md

Each trial is a line of the journal; trials that are in it are not run again.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import wbc
from wbc.motion import make_feasible, retarget
from wbc.sim.balance.tracking import TrackSpec, track_motion

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests" / "support"))

from made_motions import make_motion  # noqa: E402 - a module of that folder
from made_person import make_person  # noqa: E402

CLIPS = {"arms": 3, "dance": 3, "waist": 3, "squat": 3, "one_leg": 4, "steps": 4, "person": 1}
"""Motion → number of clips, seeds from 0 on: 20 of robots, and one of a person."""

ROBOTS = ("hrp4_class", "talos", "g1")

DEGREES = 180.0 / np.pi
"""Degrees in a radian."""

COLUMNS = (
    "Robot",
    "Motion",
    "To its end",
    "Joints, rms, °",
    "Worst joint, rms, °",
    "Feet slid, mm",
    "CoM, rms, mm",
    "Failed ticks, most",
    "Time stretched, most",
)

Row = dict[str, Any]
"""One trial: motion, robot, mode, seed, stretched, and the fields of its `TrackResult`."""


def track(
    robots: Sequence[str], motions: Sequence[str], modes: Sequence[str], known: Sequence[Row]
) -> Iterator[Row]:
    """Track the clips that are not known and yield a row for each.

    Args:
        robots: Robots.
        motions: Motions, of `CLIPS`.
        modes: Commands of the drives.
        known: Rows of trials that are not run again.
    """
    done = {(row["robot"], row["clip"], row["seed"], row["mode"]) for row in known}
    for motion in motions:
        for robot in robots:
            for seed in range(CLIPS[motion]):
                missing = [mode for mode in modes if (robot, motion, seed, mode) not in done]
                if not missing:
                    continue
                model = wbc.load_robot(robot).robot()
                person = motion == "person"
                made = (
                    retarget(make_person(seed=seed), model).clip
                    if person
                    else make_motion(model, motion, seed)
                )
                feasible = make_feasible(model, made)
                for mode in missing:
                    result = track_motion(feasible.clip, TrackSpec(robot=robot, seed=seed, mode=mode))  # type: ignore[arg-type]
                    yield result.to_json() | {"clip": motion, "seed": seed, "stretched": feasible.stretched}


def line(robot: str, motion: str, rows: Sequence[Row]) -> str:
    """Return one line of the table; errors are those of clips tracked to their end."""
    ended = [row for row in rows if row["completed"]]

    def of(combine: Any, name: str, form: str, scale: float) -> str:
        return form.format(scale * combine([row[name] for row in ended])) if ended else ""

    cells = [
        f"`{robot}`",
        motion,
        f"{len(ended)}/{len(rows)}",
        of(np.mean, "joint_rms", "{:.2f}", DEGREES),
        of(max, "worst_joint_rms", "{:.2f}", DEGREES),
        of(max, "foot_slide", "{:.1f}", 1e3),
        of(np.mean, "com_rms", "{:.1f}", 1e3),
        str(max(row["failures"] for row in rows)),
        f"{max(row['stretched'] for row in rows):.2f}",
    ]
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Track what is not in the journal and print the table of each mode."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS), choices=list(ROBOTS))
    parser.add_argument("--modes", nargs="+", default=["position"], choices=["position", "torque", "hybrid"])
    parser.add_argument("--motions", nargs="+", default=list(CLIPS), choices=list(CLIPS))
    parser.add_argument(
        "--journal", type=Path, help="JSON lines, one for each trial; made if it is not there"
    )
    options = parser.parse_args()
    rows: list[Row] = []
    if options.journal is not None and options.journal.exists():
        rows = [json.loads(text) for text in options.journal.read_text().splitlines()]
    for row in track(options.robots, options.motions, options.modes, list(rows)):
        rows.append(row)
        if options.journal is not None:
            with options.journal.open("a") as journal:
                journal.write(json.dumps(row) + "\n")
    for mode in options.modes:
        print(f"\n{mode} control\n\n| " + " | ".join(COLUMNS) + " |\n" + "|---" * len(COLUMNS) + "|")
        for robot in options.robots:
            for motion in options.motions:
                mine = [
                    row for row in rows if (row["robot"], row["clip"], row["mode"]) == (robot, motion, mode)
                ]
                if mine:
                    print(line(robot, motion, mine))


if __name__ == "__main__":
    main()
