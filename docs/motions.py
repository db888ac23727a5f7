"""Table of tracked motions, for docs/motion.md: clips made by rule, made feasible, tracked with noise.

python docs/motions.py --robots hrp4_class talos g1 > table.md
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

import wbc
from wbc.motion import make_feasible, make_motion
from wbc.sim.balance import TrackResult, TrackSpec, track_motion

CLIPS = {"arms": 3, "dance": 3, "waist": 3, "squat": 3, "one_leg": 4, "steps": 4}
"""Motion → number of clips, seeds from 0 on: 20 in all."""


def tracked(robot: str, name: str, count: int, mode: str) -> tuple[list[TrackResult], list[float]]:
    """Return results and stretches of the clips of one motion."""
    model = wbc.load_robot(robot).robot()
    results, stretched = [], []
    for seed in range(count):
        feasible = make_feasible(model, make_motion(model, name, seed))
        spec = TrackSpec(robot=robot, seed=seed, mode=None if mode == "auto" else mode)  # type: ignore[arg-type]
        results.append(track_motion(feasible.clip, spec))
        stretched.append(feasible.stretched)
    return results, stretched


def row(robot: str, name: str, results: Sequence[TrackResult], stretched: Sequence[float]) -> str:
    """Return one line of the table."""

    def most(field: str) -> float:
        return float(max(getattr(result, field) for result in results))

    done = sum(result.completed for result in results)
    cells = [
        f"`{robot}`",
        name,
        f"{done}/{len(results)}",
        f"{np.mean([result.joint_rms_deg for result in results]):.2f}",
        f"{most('worst_joint_rms_deg'):.2f}",
        f"{most('foot_slide_mm'):.1f}",
        f"{np.mean([result.com_rms_mm for result in results]):.1f}",
        f"{int(most('failures'))}",
        f"{max(stretched):.2f}",
    ]
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", nargs="+", default=["hrp4_class", "talos", "g1"])
    parser.add_argument("--mode", default="auto", choices=["auto", "position", "torque", "hybrid"])
    parser.add_argument("--motions", nargs="+", default=list(CLIPS), choices=list(CLIPS))
    options = parser.parse_args()
    print(
        "| Robot | Motion | To its end | Joints, rms, ° | Worst joint, rms, ° | Feet slid, mm | CoM, rms, mm | "
        "Failed ticks, most | Time stretched, most |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for robot in options.robots:
        for name in options.motions:
            print(row(robot, name, *tracked(robot, name, CLIPS[name], options.mode)), flush=True)


if __name__ == "__main__":
    main()
