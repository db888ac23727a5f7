"""Feet of retargeted motions, and the speed of retargeting.

    python benchmarks/costs/retargeting.py

A person made by rule (15 s, 30 Hz, feet that slide, float and tremble) is retargeted to three robots. The measure
is that of holosoma's evaluation: the share of frames with a sole more than 10 mm in the ground, and the share of the
frames of a foot in contact in which it moves over the ground by more than 0.01 m/s. The first row has the ankles of
the person in the same frames; their depth below the height at which they stand.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

import wbc
from wbc.base.numbers import Array
from wbc.motion import retarget
from wbc.motion.kinematics import BodyMotion

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests" / "support"))
from made_person import ANKLE, make_person  # noqa: E402 - beside the tests

DEEP, FAST = 0.010, 0.01
"""Depth, m, and speed, m/s, from which on a sole counts."""


def row(name: str, places: Array, lowest: Array, stands: Array, rate: float, speed: str) -> str:
    """Return a row for feet at places, shape (T, 2, 3), whose lowest points are (T, 2), m, and which stand, (T, 2)."""
    speeds = np.linalg.norm(np.diff(places[..., :2], axis=0), axis=-1) * rate
    held = speeds[np.logical_and(stands[1:], stands[:-1])]
    deep, depth = (lowest.min(axis=1) < -DEEP).mean(), max(0.0, -float(lowest.min()))
    cells = f"{100 * deep:.1f} % | {1e3 * depth:.3f} | {100 * (held > FAST).mean():.1f} % | {1e3 * held.max():.3f}"
    return f"| {name} | {cells} | {speed} |"


def main() -> None:
    """Print a table."""
    print("| | deeper than 10 mm | deepest, mm | faster than 0.01 m/s | fastest, mm/s | frames/s |")
    print("|---|---:|---:|---:|---:|---:|")
    person = make_person()
    limbs = person.limbs()
    ankles = np.stack([limbs["left_ankle"], limbs["right_ankle"]], axis=1)
    for name in ("g1", "hrp4_class", "talos"):
        robot = wbc.load_robot(name).robot()
        begin = time.process_time()
        clip = retarget(person, robot).clip
        busy = time.process_time() - begin
        assert clip.standing is not None and len(clip) == len(ankles)
        if name == "g1":
            print(row("the person", ankles, ankles[..., 2] - ANKLE, clip.standing, person.rate, ""))
        motion = BodyMotion.of(robot, clip.configurations(robot), clip.rate)
        lowest = motion.corners[..., 2].min(axis=2)
        print(row(f"`{name}`", motion.centres, lowest, clip.standing, clip.rate, f"{len(clip) / busy:.0f}"))


if __name__ == "__main__":
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    main()
