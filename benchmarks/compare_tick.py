"""Time one control tick of this library, PlaCo and TSID on one balance task, in one run on one machine.

PlaCo and TSID need older Pinocchios, so each gets a virtual environment, made once in a cache folder. The three
programs then take turns, several times over, so that a noisy moment hits none of them alone.

Usage: python benchmarks/compare_tick.py [--json] [--repeats N] [--ticks N] [--cache FOLDER]
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
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

from balance_task import BalanceTask

from wbc.robots import load

HERE = Path(__file__).resolve().parent
TALOS = "cmeel.prefix/share/example-robot-data/robots/talos_data"
OURS = "wbc"
OTHERS = {
    "PlaCo": ("requirements-placo.txt", "placo_tick.py"),
    "TSID": ("requirements-tsid.txt", "tsid_tick.py"),
}
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
INSTALL_LIMIT = 900.0
"""Seconds that making an environment may take."""
RUN_LIMIT = 300.0
"""Seconds that one run of one library may take."""

Record = dict[str, Any]


class MissingError(Exception):
    """A library that could not be run; the message says why."""


def talos() -> BalanceTask:
    """The task for Talos, from the files of the installed example-robot-data.

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
    links = load("talos").urdf_without_geometry()
    posture = {
        str(joint.get("name")): middle(joint)
        for joint in ET.fromstring(links).findall("joint")
        if moves(joint)
    }
    posture |= {name: float(value[0]) for name, value in angles.items() if name in posture}
    return BalanceTask(
        urdf=links,
        robot="talos",
        posture=posture,
        base_height=float(base[2]),
        soles=("left_sole_link", "right_sole_link"),
    )


def moves(joint: ET.Element) -> bool:
    """Return True for a joint with a degree of freedom."""
    return joint.get("type") in ("revolute", "prismatic")


def middle(joint: ET.Element) -> float:
    """Middle of a joint's range: where the grippers are kept, which half-sitting leaves out."""
    limit = joint.find("limit")
    if limit is None:
        return 0.0
    return (float(limit.get("lower", 0)) + float(limit.get("upper", 0))) / 2


def environment(cache: Path, name: str, python: str) -> Path:
    """Return the Python of a library's environment, making the environment if its requirements have changed.

    Args:
        cache: Folder of the environments.
        name: Library.
        python: Interpreter to make it with.

    Raises:
        MissingError: It could not be made.
    """
    requirements = HERE / OTHERS[name][0]
    folder = cache / name.lower()
    interpreter = folder / "bin" / "python"
    stamp = folder / "made-from.txt"
    wanted = f"{python}\n{requirements.read_text(encoding='utf-8')}"
    if stamp.exists() and stamp.read_text(encoding="utf-8") == wanted:
        return interpreter
    print(f"making the environment of {name} in {folder}", file=sys.stderr)
    shutil.rmtree(folder, ignore_errors=True)
    for command in (
        [python, "-m", "venv", str(folder)],
        [str(interpreter), "-m", "pip", "install", "--quiet", "--only-binary=:all:", "-r", str(requirements)],
    ):
        finish(command, INSTALL_LIMIT)
    stamp.write_text(wanted, encoding="utf-8")
    return interpreter


def finish(command: list[str], limit: float) -> str:
    """Run a command to its end, on one thread, and return what it printed.

    Raises:
        MissingError: It failed or took too long.
    """
    # A PYTHONPATH of this environment would put the wrong Pinocchio into the others.
    variables = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"} | ONE_THREAD
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
    """The JSON object that a program printed.

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


def take_turns(
    commands: dict[str, list[str]], repeats: int
) -> tuple[dict[str, list[Record]], dict[str, str]]:
    """Run every program in turn, `repeats` times; one that fails is not run again.

    Returns:
        The records of each program that ran every time, and for the others why not.
    """
    records: dict[str, list[Record]] = {name: [] for name in commands}
    missing: dict[str, str] = {}
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
            print(f"turn {turn + 1}, {name}: {records[name][-1]['median_us']} us", file=sys.stderr)
    return {name: runs for name, runs in records.items() if name not in missing}, missing


def summary(records: dict[str, list[Record]], missing: dict[str, str]) -> Record:
    """The medians over the turns, and our time over each of the others'.

    Returns:
        `ratio`, our median over the fastest of the others, is None while any library is missing.
    """
    libraries = {name: over_turns(runs) for name, runs in records.items()}
    ratios: dict[str, float] = {}
    if OURS in libraries:
        ours = libraries[OURS]["median_us"]
        ratios = {n: round(ours / row["median_us"], 3) for n, row in libraries.items() if n != OURS}
    return {
        "machine": f"{processor()}, {os.cpu_count()} cores, Python {platform.python_version()}",
        "libraries": libraries,
        "ratios": ratios,
        "ratio": max(ratios.values()) if set(ratios) == set(OTHERS) else None,
        "missing": missing,
    }


def over_turns(runs: list[Record]) -> Record:
    """One row from the runs of one library: medians of times, sums of counts, worst of the rest."""
    row: Record = {
        "version": runs[0].get("version", ""),
        "nv": runs[0].get("nv"),
        "median_us": statistics.median(run["median_us"] for run in runs),
        "p99_us": statistics.median(run["p99_us"] for run in runs),
        "medians_us": [run["median_us"] for run in runs],
    }
    for key in ("failures", "preempted"):
        row[key] = sum(run.get(key, 0) for run in runs)
    for key in ("com_error_mm", "torque_use", "load"):
        row[key] = max((run[key] for run in runs if key in run), default=None)
    return row


def processor() -> str:
    """Name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def table(result: Record) -> str:
    """The result for people."""
    head = f"{'library':8s} {'median':>9s} {'p99':>9s} {'spread of medians':>19s} {'unsolved':>9s}  version"
    lines = [result["machine"], head]
    for name, row in result["libraries"].items():
        spread = f"{min(row['medians_us']):.1f}-{max(row['medians_us']):.1f} us"
        times = f"{row['median_us']:6.1f} us {row['p99_us']:6.1f} us {spread:>19s}"
        lines.append(f"{name:8s} {times} {row['failures']:9d}  {row['version']}")
    lines += [f"{name:8s} not run: {reason}" for name, reason in result["missing"].items()]
    lines += [f"{OURS} / {name}: {ratio:.3f}" for name, ratio in result["ratios"].items()]
    return "\n".join(lines)


def main() -> int:
    """Run the comparison; 0 if every library ran, 1 if one is missing."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "wbc-benchmarks"
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of the table")
    parser.add_argument("--repeats", type=int, default=5, help="turns of each library (default 5)")
    parser.add_argument(
        "--ticks", type=int, default=BalanceTask.ticks, help="measured ticks of PlaCo and TSID"
    )
    parser.add_argument(
        "--cache", type=Path, default=cache, help=f"folder of their environments (default {cache})"
    )
    parser.add_argument("--python", default=sys.executable, help="interpreter of their environments, 3.11")
    options = parser.parse_args()
    if options.repeats < 1 or options.ticks < 1:
        parser.error("--repeats and --ticks must be at least 1")

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "task.json"
        replace(talos(), ticks=options.ticks).save(file)
        ours = [sys.executable, "-m", "wbc.app.cli", "bench", "tick", "--robot", "talos", "--json"]
        commands = {OURS: ours}
        missing: dict[str, str] = {}
        for name, (_, script) in OTHERS.items():
            try:
                python = environment(options.cache.resolve(), name, options.python)
            except MissingError as error:
                missing[name] = f"no environment: {error}"
                continue
            commands[name] = [str(python), str(HERE / script), str(file)]
        records, failed = take_turns(commands, options.repeats)
    result = summary(records, missing | failed)
    print(json.dumps(result) if options.json else table(result))
    return 1 if result["missing"] else 0


if __name__ == "__main__":
    sys.exit(main())
