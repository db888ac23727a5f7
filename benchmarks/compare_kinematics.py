"""Time one step of inverse kinematics of this library, Pink, mink and PlaCo on the same scenes, in one run.

Pink and mink run in this environment (`pip install pin-pink mink`), PlaCo, which needs an older Pinocchio, in one of
its own, as in `compare_tick.py`. The programs take turns, several times over, so that a noisy moment hits none of them
alone.

Usage: python benchmarks/compare_kinematics.py [--json] [--repeats N] [--cache FOLDER]
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from compare_tick import HERE, MissingError, environment, finish, processor, read_record, talos
from kinematics_scene import KinematicScene

import wbc

LIBRARIES = ("wbc", "Pink", "mink", "PlaCo")
RUN_LIMIT = 300.0


def scenes() -> Iterator[KinematicScene]:
    """Yield the Panda and Talos, their joints inside their ranges."""
    description = wbc.load_robot("panda")
    robot = description.robot()
    yield KinematicScene(
        robot="panda",
        urdf=description.urdf_without_geometry(),
        posture=inside(
            robot, dict(zip(robot.joint_names, robot.half_sitting[robot.base_nq :].tolist(), strict=True))
        ),
        hand="panda_hand",
    )
    task, robot = talos(), wbc.load_robot("talos").robot()
    yield KinematicScene(
        robot="talos",
        urdf=task.urdf,
        posture=inside(robot, task.posture),
        hand="gripper_right_base_link",
        soles=task.soles,
        base_height=task.base_height,
    )


def inside(robot: wbc.Robot, posture: dict[str, float]) -> dict[str, float]:
    """Return a posture with every joint a tenth of its range, or 0.1 rad, inside."""
    kept = {}
    for joint, value in posture.items():
        i = robot.joint_index(joint)
        low, high = robot.position_lower[i], robot.position_upper[i]
        room = min(0.1, 0.1 * (high - low))
        kept[joint] = float(min(max(value, low + room), high - room))
    return kept


def main() -> int:
    """Run the comparison; 0 if every library ran, 1 if one is missing."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of the table")
    parser.add_argument("--repeats", type=int, default=5, help="turns of each library (default 5)")
    parser.add_argument("--cache", type=Path, default=Path.home() / ".cache" / "wbc-benchmarks")
    options = parser.parse_args()
    pythons = dict.fromkeys(LIBRARIES, sys.executable)
    result: dict[str, dict[str, dict[str, float | str]]] = {}
    missing: dict[str, str] = {}
    try:
        pythons["PlaCo"] = str(environment(options.cache.resolve(), "PlaCo", sys.executable))
    except MissingError as error:
        missing["PlaCo"] = str(error)
    with tempfile.TemporaryDirectory() as folder:
        for scene in scenes():
            file = Path(folder) / f"{scene.robot}.json"
            scene.save(file)
            runs: dict[str, list[dict[str, float | str]]] = {name: [] for name in LIBRARIES}
            for _ in range(options.repeats):
                for name in LIBRARIES:
                    if name not in missing:
                        command = [pythons[name], str(HERE / "kinematics_tick.py"), name, str(file)]
                        try:
                            runs[name].append(read_record(finish(command, RUN_LIMIT)))
                        except MissingError as error:
                            missing[name] = str(error)
            result[scene.robot] = {
                name: {
                    "version": each[0]["version"],
                    "median_us": statistics.median(float(run["median_us"]) for run in each),
                    "least_us": min(float(run["least_us"]) for run in each),
                    "p99_us": statistics.median(float(run["p99_us"]) for run in each),
                    "error_mm": each[0]["error_mm"],
                }
                for name, each in runs.items()
                if each and name not in missing
            }
    report(result, missing, options.json)
    return 1 if missing else 0


def report(
    result: dict[str, dict[str, dict[str, float | str]]], missing: dict[str, str], as_json: bool
) -> None:
    """Print medians, and those of the others over ours."""
    if as_json:
        print(json.dumps({"machine": processor(), "scenes": result, "missing": missing}))
        return
    print(processor())
    for robot, libraries in result.items():
        ours = float(libraries["wbc"]["median_us"])
        for name, row in libraries.items():
            median = float(row["median_us"])
            print(
                f"{robot:6s} {name:6s} {median:7.1f} µs  least {row['least_us']:7.1f}  99 % {row['p99_us']:7.1f}  "
                f"/ wbc {median / ours:5.2f}  off {row['error_mm']} mm  ({row['version']})"
            )
    for name, reason in missing.items():
        print(f"{name} not run: {reason}")


if __name__ == "__main__":
    sys.exit(main())
