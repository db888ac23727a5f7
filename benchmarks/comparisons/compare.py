"""Time this library and others on the same task, in one run on one machine.

    python benchmarks/comparisons/compare.py tick                       # a control tick, beside PlaCo and TSID
    python benchmarks/comparisons/compare.py kinematics --repeats 2     # a step, beside Pink, mink and PlaCo

Each of the others has a virtual environment with the versions of its requirements, made once in a cache folder. The
programs then take turns, several times over, so that a noisy moment hits none of them alone. The exit code is 1 if a
library is missing; the reason is printed.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

from balance import BalanceTask, Scene
from kinematics import KinematicScene

import wbc
from wbc.app.commands.bench import TASK

HERE = Path(__file__).resolve().parent
TALOS = "cmeel.prefix/share/example-robot-data/robots/talos_data"
OURS = "wbc"

REQUIREMENTS = {
    "PlaCo": "requirements-placo.txt",
    "TSID": "requirements-tsid.txt",
    "Pink": "requirements-pink-mink.txt",
    "mink": "requirements-pink-mink.txt",
}
"""Library → requirements of its environment."""

LIBRARIES = {"tick": (OURS, "PlaCo", "TSID"), "kinematics": (OURS, "Pink", "mink", "PlaCo")}
"""Subject of a comparison → libraries that take turns."""

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

INSTALL_LIMIT, RUN_LIMIT = 900.0, 300.0
"""Time that making an environment may take, and one run of one library, s."""

Record = dict[str, Any]


class MissingError(Exception):
    """A library that could not be run; the message says why."""


def balance_task(ticks: int) -> BalanceTask:
    """Return the task for Talos, from the files of the installed example-robot-data.

    Raises:
        MissingError: example-robot-data is not installed in this environment.
    """
    try:
        folder = Path(str(distribution("example-robot-data").locate_file(TALOS)))
    except PackageNotFoundError as error:
        raise MissingError("example-robot-data is not installed in this environment") from error
    states = ET.parse(folder / "srdf" / "talos.srdf").getroot().iter("group_state")
    half_sitting = next(state for state in states if state.get("name") == "half_sitting")
    angles = {str(joint.get("name")): str(joint.get("value")).split() for joint in half_sitting.iter("joint")}
    base = angles.pop("root_joint")
    links = wbc.load_robot("talos").urdf_without_geometry()
    joints = [
        joint
        for joint in ET.fromstring(links).findall("joint")
        if joint.get("type") in ("revolute", "prismatic")
    ]
    posture = {str(joint.get("name")): middle(joint) for joint in joints}
    posture |= {name: float(value[0]) for name, value in angles.items() if name in posture}
    soles = "left_sole_link", "right_sole_link"
    height = float(base[2])
    return BalanceTask(
        robot="talos", urdf=links, posture=posture, soles=soles, base_height=height, numbers=TASK, ticks=ticks
    )


def middle(joint: ET.Element) -> float:
    """Return the middle of a joint's range: where the grippers are kept, which half-sitting leaves out."""
    limit = joint.find("limit")
    if limit is None:
        return 0.0
    return (float(limit.get("lower", 0)) + float(limit.get("upper", 0))) / 2


def scenes_of(what: str, ticks: int) -> Iterator[Scene]:
    """Yield the scenes of a comparison: of kinematics a Panda, and Talos whose joints are inside their ranges."""
    task = balance_task(ticks)
    if what == "tick":
        yield task
        return
    description = wbc.load_robot("panda")
    panda, talos = description.robot(), wbc.load_robot("talos").robot()
    posture = dict(zip(panda.joint_names, panda.half_sitting[panda.base_nq :].tolist(), strict=True))
    links = description.urdf_without_geometry()
    yield KinematicScene(robot="panda", urdf=links, posture=inside(panda, posture), hand="panda_hand")
    yield KinematicScene(
        robot="talos",
        urdf=task.urdf,
        posture=inside(talos, task.posture),
        soles=task.soles,
        base_height=task.base_height,
        hand="gripper_right_base_link",
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


def environment(cache: Path, name: str, python: str) -> str:
    """Return the Python of a library's environment, making the environment if its requirements have changed.

    Args:
        cache: Folder of the environments.
        name: Library.
        python: Interpreter to make it with.

    Raises:
        MissingError: It could not be made.
    """
    requirements = HERE / REQUIREMENTS[name]
    folder = cache / requirements.stem.removeprefix("requirements-")
    interpreter = folder / "bin" / "python"
    stamp = folder / "made-from.txt"
    wanted = f"{python}\n{requirements.read_text(encoding='utf-8')}"
    if stamp.exists() and stamp.read_text(encoding="utf-8") == wanted:
        return str(interpreter)
    print(f"making the environment of {name} in {folder}", file=sys.stderr)
    shutil.rmtree(folder, ignore_errors=True)
    for command in (
        [python, "-m", "venv", str(folder)],
        [str(interpreter), "-m", "pip", "install", "--quiet", "--only-binary=:all:", "-r", str(requirements)],
    ):
        finish(command, INSTALL_LIMIT)
    stamp.write_text(wanted, encoding="utf-8")
    return str(interpreter)


def finish(command: list[str], limit: float) -> str:
    """Run a command to its end, on one thread, and return what it printed.

    Raises:
        MissingError: It failed or took too long.
    """
    variables = os.environ | ONE_THREAD
    if (
        command[0] != sys.executable
    ):  # a PYTHONPATH of this environment would put the wrong Pinocchio into the others
        variables.pop("PYTHONPATH", None)
    try:
        done = subprocess.run(
            command, env=variables, capture_output=True, text=True, timeout=limit, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise MissingError(f"no end within {limit:.0f} s: {' '.join(command)}") from error
    except OSError as error:
        raise MissingError(f"{command[0]}: {error}") from error
    if done.returncode != 0:
        words = (done.stderr or done.stdout).strip().splitlines() or ["nothing printed"]
        raise MissingError(f"exit code {done.returncode}: {words[-1]}")
    return done.stdout


def read_record(printed: str) -> Record:
    """Return the JSON object that a program printed.

    Raises:
        MissingError: There is none, or it lacks the times.
    """
    try:
        record = dict(json.loads(printed))
        if not (record["median_us"] > 0 and record["p99_us"] > 0):
            raise ValueError("times must be above zero")
    except (ValueError, KeyError, TypeError) as error:
        raise MissingError(f"no timings in what it printed ({error!r}): {printed[:80]!r}") from error
    return record


def command_of(what: str, library: str, python: str, scene: Path, ticks: int) -> list[str]:
    """Return the command that runs a scene, of that number of ticks, with a library."""
    if what == "kinematics":
        return [python, str(HERE / "kinematics.py"), library, str(scene)]
    if library == OURS:
        own = ("bench", "tick", "--robot", "talos", "--ticks", str(ticks), "--json")
        return [python, "-m", "wbc.app.cli", *own]
    return [python, str(HERE / f"balance_{library.lower()}.py"), str(scene)]


def take_turns(commands: dict[str, list[str]], repeats: int, missing: dict[str, str]) -> dict[str, Record]:
    """Run every program in turn, and return a row for each; one that fails is not run again, but `missing`."""
    records: dict[str, list[Record]] = {name: [] for name in commands}
    for turn in range(repeats):
        for name, command in commands.items():
            if name in missing:
                continue
            load = os.getloadavg()[0]
            try:
                records[name].append(read_record(finish(command, RUN_LIMIT)) | {"load": round(load, 2)})
            except MissingError as error:
                missing[name] = str(error)
                continue
            print(f"turn {turn + 1}, {name}: {records[name][-1]['median_us']} µs", file=sys.stderr)
    return {name: over_turns(runs) for name, runs in records.items() if name not in missing}


def over_turns(runs: list[Record]) -> Record:
    """Return one row from the runs of one library: medians of times, sums of counts, worst of the rest."""
    row: Record = {"version": runs[0].get("version", ""), "nv": runs[0].get("nv")}
    for key, over in (("median_us", statistics.median), ("p99_us", statistics.median), ("least_us", min)):
        row[key] = over(run[key] for run in runs if key in run) if key in runs[0] else None
    row["medians_us"] = [run["median_us"] for run in runs]
    for key in ("failures", "preempted"):
        row[key] = sum(run.get(key, 0) for run in runs)
    for key in ("com_error_mm", "error_mm", "torque_use", "load"):
        row[key] = max((run[key] for run in runs if key in run), default=None)
    return row


def processor() -> str:
    """Return the name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def table(result: Record) -> str:
    """Return the result for people."""
    head = (
        f"{'robot':6s} {'library':7s} {'median':>9s} {'p99':>9s} {'spread of medians':>19s} {'over wbc':>9s}"
    )
    lines = [result["machine"], f"{head}  unsolved, off, version"]
    for robot, libraries in result["scenes"].items():
        for name, row in libraries.items():
            spread = f"{min(row['medians_us']):.1f}-{max(row['medians_us']):.1f} µs"
            times = f"{row['median_us']:6.1f} µs {row['p99_us']:6.1f} µs {spread:>19s} {row['over_ours'] or 0.0:9.2f}"
            off = row["com_error_mm"] if row["error_mm"] is None else row["error_mm"]
            lines.append(f"{robot:6s} {name:7s} {times}  {row['failures']}, {off} mm, {row['version']}")
    return "\n".join([*lines, *(f"{name} not run: {reason}" for name, reason in result["missing"].items())])


def main() -> int:
    """Run a comparison; 0 if every library ran, 1 if one is missing."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "wbc-benchmarks"
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=LIBRARIES, help="what is timed")
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of the table")
    parser.add_argument("--repeats", type=int, default=5, help="turns of each library, default %(default)s")
    parser.add_argument(
        "--ticks",
        type=int,
        default=BalanceTask.ticks,
        help="control ticks that are measured, default %(default)s",
    )
    parser.add_argument(
        "--cache", type=Path, default=cache, help="folder of environments, default %(default)s"
    )
    parser.add_argument("--python", default=sys.executable, help="interpreter of the environments, 3.11")
    options = parser.parse_args()
    if options.repeats < 1 or options.ticks < 1:
        parser.error("--repeats and --ticks must be at least 1")
    pythons, missing = {OURS: sys.executable}, dict[str, str]()
    for name in LIBRARIES[options.what][1:]:
        try:
            pythons[name] = environment(options.cache.resolve(), name, options.python)
        except MissingError as error:
            missing[name] = f"no environment: {error}"
    found: dict[str, dict[str, Record]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for scene in scenes_of(options.what, options.ticks):
            file = Path(folder) / f"{scene.robot}.json"
            scene.save(file)
            commands = {
                name: command_of(options.what, name, python, file, options.ticks)
                for name, python in pythons.items()
            }
            found[scene.robot] = rows = take_turns(commands, options.repeats, missing)
            ours = rows[OURS]["median_us"] if OURS in rows else None
            for row in rows.values():
                row["over_ours"] = round(row["median_us"] / ours, 3) if ours else None
    machine = f"{processor()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    result = {"machine": machine, "scenes": found, "missing": missing}
    print(json.dumps(result) if options.json else table(result))
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
