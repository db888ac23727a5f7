"""Records of benchmarks: samples of every repeat, with the machine, the versions and the commit they belong to."""

from __future__ import annotations

import datetime
import os
import platform
import subprocess
from collections import defaultdict
from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

import wbc._version as version
from wbc.app.bench.profile import profile_walk
from wbc.app.bench.solver import BenchSolverOptions, bench_solver
from wbc.app.bench.tick import BenchTickOptions, bench_tick
from wbc.app.bench.walk import BenchWalkOptions
from wbc.app.files import read_object
from wbc.core.errors import InputError, shown
from wbc.core.settings import Count, Positive, from_json, settings
from wbc.sim.walks import WalkTrial, walk

Benchmark = Literal["tick", "solver", "walk"]

KIND = "wbc benchmark record"
"""First entry of every record, by which it is known."""

LIBRARIES = ("pin", "mujoco", "proxsuite", "daqp", "numpy", "scipy")
"""Libraries whose versions a record names."""

SHORTEST, LONGEST = 1e-6, 1e12
"""Shortest and longest time that a sample may be, µs."""

Samples = dict[str, tuple[Annotated[Positive, "µs"], ...]]
"""Figure → its value in every repeat, µs."""


@settings(kw_only=True)
class BenchRecordOptions:
    """Benchmarks of a record.

    Attributes:
        benchmark: Those that are run: tick, solver, walk.
        repeats: Times that each is run, all of them in turns; fewer than eight tell little.
        robot: Robot of the tick.
        ticks: Ticks of a repeat.
        problems: Random problems of a repeat of the solver.
        distance: Length of the walks, m.
    """

    benchmark: tuple[Benchmark, ...] = ("tick", "solver", "walk")
    repeats: Annotated[int, Field(ge=2, le=1000)] = 10
    robot: str = BenchTickOptions.robot
    ticks: Count = 2000
    problems: Count = 1000
    distance: Annotated[Positive, "m"] = 0.5

    def __post_init__(self) -> None:
        if not self.benchmark:
            raise InputError("at least one benchmark is needed")
        BenchTickOptions(robot=self.robot)


@settings(kw_only=True)
class Machine:
    """The machine of a record.

    Attributes:
        processor: Model of the processor.
        cores: Cores that the process may use.
        system: Operating system.
    """

    processor: str
    cores: int
    system: str


@settings(kw_only=True)
class RecordedBenchmark:
    """One benchmark of a record.

    Attributes:
        options: What was run; only equal ones are compared.
        samples_us: Figure → its value in every repeat, µs.
    """

    options: dict[str, str | int | float]
    samples_us: Samples


@settings(kw_only=True)
class BenchRecord:
    """A record.

    Attributes:
        kind: `KIND`.
        made: Time, UTC.
        commit: Commit of the sources, with "+" when they differ from it; None outside version control.
        versions: Version of wbc, Python and the libraries.
        machine: The machine.
        benchmarks: Name → options and samples.
    """

    kind: Literal["wbc benchmark record"]
    made: str
    commit: str | None
    versions: dict[str, str]
    machine: Machine
    benchmarks: dict[str, RecordedBenchmark]


def bench_record(
    options: BenchRecordOptions, *, progress: Callable[[int], None] | None = None
) -> BenchRecord:
    """Run the benchmarks, in turns, so that a slow minute of the machine falls on all of them.

    Args:
        options: The benchmarks.
        progress: Called with the number of repeats done.
    """
    samples: dict[str, dict[str, list[float]]] = {name: defaultdict(list) for name in options.benchmark}
    for repeat in range(options.repeats):
        for name in samples:
            for figure, value in _FIGURES[name](options):
                samples[name][figure].append(value)
        if progress is not None:
            progress(repeat + 1)
    return BenchRecord(
        kind="wbc benchmark record",
        made=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        commit=_commit(),
        versions={"wbc": version.__version__, "python": platform.python_version()}
        | {name: _version(name) for name in LIBRARIES},
        machine=Machine(processor=_processor(), cores=_cores(), system=platform.platform()),
        benchmarks={
            name: RecordedBenchmark(
                options={field: getattr(options, field) for field in _OPTIONS[name]},
                samples_us={figure: tuple(values) for figure, values in figures.items()},
            )
            for name, figures in samples.items()
        },
    )


def read_record(path: Path) -> BenchRecord:
    """Return the record in a file.

    Raises:
        InputError: No such file, or one that is no record; what is wrong with it is named.
    """
    data = read_object("benchmark record", path)
    if data.get("kind") != KIND:
        raise InputError(f"{path} is no benchmark record: its 'kind' is {data.get('kind')!r}, not '{KIND}'")
    try:
        _check_samples(data)
        return from_json(BenchRecord, data)
    except InputError as error:
        raise InputError(f"{path} is no benchmark record: {error}") from error


def _check_samples(data: dict[str, Any]) -> None:
    """Check the samples of all figures, as far as there are any."""
    benchmarks = data.get("benchmarks")
    for name, benchmark in benchmarks.items() if isinstance(benchmarks, dict) else ():
        samples = benchmark.get("samples_us") if isinstance(benchmark, dict) else None
        if not isinstance(samples, dict):
            raise InputError(f"{name} has no object 'samples_us'")
        for figure, values in samples.items():
            if not isinstance(values, list) or len(values) < 2 or not all(map(_is_time, values)):
                raise InputError(
                    f"'{figure}' of {name} must hold at least two times from {SHORTEST:g} to {LONGEST:g} us, "
                    f"got {shown(values)}"
                )


def _is_time(value: object) -> bool:
    return isinstance(value, (int, float)) and SHORTEST <= value <= LONGEST


def _tick(options: BenchRecordOptions) -> Iterator[tuple[str, float]]:
    facts = bench_tick(BenchTickOptions(robot=options.robot, ticks=options.ticks))
    yield "median", facts["median_us"]
    yield "99 %", facts["p99_us"]
    yield from facts["parts"].items()


def _solver(options: BenchRecordOptions) -> Iterator[tuple[str, float]]:
    facts = bench_solver(BenchSolverOptions(ticks=options.problems, repeat=1))
    for what in ("solve_us", "tick_cpu_us"):
        for share in ("50%", "90%", "99%"):
            yield f"{what.removesuffix('_us').replace('_cpu', '')} {share}", facts[what][share]


def _walk(options: BenchRecordOptions) -> Iterator[tuple[str, float]]:
    for name, spec in BenchWalkOptions(distance=options.distance).cases().items():
        clock = walk(spec).clock
        assert clock is not None, "a walk that has just been run has been timed"
        yield f"{name}: all", 1e6 * spec.period / clock.real_time_factor
        for row in profile_walk(WalkTrial(spec))[1]:
            yield f"{name}: {row.what}", row.us


_FIGURES: dict[str, Callable[[BenchRecordOptions], Iterator[tuple[str, float]]]] = {
    "tick": _tick,
    "solver": _solver,
    "walk": _walk,
}

_OPTIONS: dict[str, tuple[str, ...]] = {
    "tick": ("robot", "ticks"),
    "solver": ("problems",),
    "walk": ("distance",),
}
"""Benchmark → the options that it depends on."""


def _processor() -> str:
    """Return the model of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(models, platform.processor() or platform.machine())


def _cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "none"


def _commit() -> str | None:
    """Return the commit of the sources; None when they are not under version control."""
    source = Path(str(version.__file__))

    def git(*words: str) -> str:
        command = ["git", "-C", str(source.parent), *words]
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
        return str(done.stdout).strip()

    try:
        git(
            "ls-files", "--error-unmatch", "__init__.py"
        )  # not a folder of packages inside another repository
        return git("rev-parse", "HEAD") + ("+" if git("status", "--porcelain", "--", ".") else "")
    except (OSError, subprocess.SubprocessError):
        return None
