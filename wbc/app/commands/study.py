"""`wbc study`: many trials, written down in a journal, and the tables that they make."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from wbc.app.commands.walk import read_json
from wbc.app.output import Flat, Output, OutputOptions, Report, progress_console, reports
from wbc.core.errors import InputError, choose
from wbc.sim.journal import SYNCS, Journal, check_journal_path, read_journal
from wbc.sim.studies import STUDIES, Study, study_by_name, study_table
from wbc.sim.sweep import TIMEOUT, SweepSummary, cluster_executor, sweep

StudyName = Annotated[
    str, Parameter(help="Study: the name of one that `wbc study list` shows, or a file with one as JSON.")
]


@dataclass(frozen=True, kw_only=True)
class PartOptions:
    """Which part of a study.

    Attributes:
        cell: Only these cells, by name or beginning of a name.
        arm: Only these arms.
        seeds: Only the first so many seeds.
        any_code: Take results of other versions of the code, too.
    """

    cell: tuple[str, ...] = ()
    arm: tuple[str, ...] = ()
    seeds: int | None = None
    any_code: bool = False

    def part(self, study: str) -> Study:
        """That part of a study."""
        return read_study(study).narrowed(self.cell, self.arm, self.seeds)


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """How the trials of a study are run.

    Attributes:
        journal: File that every trial is written to as soon as it has ended; what is in it is not run again.
        workers: Number of processes on this machine.
        cluster: Run through Dask instead: address of a scheduler, or "local" for a cluster of --workers processes.
        timeout: Wall time that a trial may take, s.
        retry: Run those again that crashed or took too long.
        sync: When a line must be on the disk itself: always, second or never.
    """

    journal: Path
    workers: int = 1
    cluster: str | None = None
    timeout: float = TIMEOUT
    retry: bool = False
    sync: str = "second"

    def __post_init__(self) -> None:
        choose("sync policy", self.sync, SYNCS)
        check_journal_path(self.journal)
        if self.workers < 1:
            raise InputError(f"workers must be at least 1, got {self.workers}")


@dataclass(frozen=True, kw_only=True)
class TableOptions:
    """Which table.

    Attributes:
        journal: File that `wbc study run` has written.
        metric: Part of the results, such as steps_done, zmp_error.mean or peak_torque_ratio; the study's own when
            not given.
        completed: Only walks that were completed.
    """

    journal: Path
    metric: str | None = None
    completed: bool = False


@reports
def list_studies(*, output: OutputOptions = Output()) -> Report:
    """List the studies that come with the library."""
    studies = [study_by_name(name) for name in STUDIES]
    facts = [{"name": s.name, "about": s.about, "trials": sum(1 for _ in s.trials())} for s in studies]
    lines = [f"{fact['name']:<22} {fact['trials']:>5} trials  {fact['about']}" for fact in facts]
    return output.report({"studies": facts}, "\n".join(lines))


@reports
def show(
    study: StudyName, /, *, part: Flat[PartOptions] = PartOptions(), output: OutputOptions = Output()
) -> Report:
    """Print a study as JSON, to be changed and run."""
    data = part.part(study).to_json()
    return output.report(data, json.dumps(data, indent=2))


@reports
def run(
    study: StudyName,
    /,
    *,
    options: Flat[RunOptions],
    part: Flat[PartOptions] = PartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Run the trials of a study that its journal does not have. Stopped at any time, it goes on from there."""
    chosen = part.part(study)
    specs = [trial.spec for trial in chosen.trials()]
    with ExitStack() as stack:
        journal = stack.enter_context(Journal(options.journal, sync=options.sync))
        executor = None
        if options.cluster is not None:
            executor = stack.enter_context(cluster_executor(options.cluster, workers=options.workers))
        bar = stack.enter_context(_progress())
        task = bar.add_task(chosen.name, total=len(specs), rate="")

        def progress(summary: SweepSummary) -> None:
            per_hour = summary.per_hour
            rate = "" if per_hour is None else f"{per_hour:.0f} an hour"
            done = summary.found + summary.run
            bar.update(task, total=summary.total, completed=done, rate=rate)

        summary = sweep(
            specs,
            journal,
            executor=executor,
            workers=options.workers,
            timeout=options.timeout,
            retry=options.retry,
            any_code=part.any_code,
            progress=progress,
        )
    counts = ", ".join(f"{n} {status}" for status, n in sorted(summary.counts.items()))
    text = (
        f"{chosen.name}: {summary.total} trials, {summary.found} were in {options.journal}, {summary.run} run in "
        f"{summary.seconds:.0f} s"
        + ("" if summary.per_hour is None else f" ({summary.per_hour:.0f} an hour)")
    )
    data = {"study": chosen.name, "journal": str(options.journal), **summary.to_json()}
    return output.report(data, f"{text}\n  {counts}")


@reports
def table(
    study: StudyName,
    /,
    *,
    options: Flat[TableOptions],
    part: Flat[PartOptions] = PartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Make the table of a study: means with intervals, paired differences, how walks ended. As Markdown or JSON."""
    if not options.journal.exists():
        raise InputError(f"there is no journal {options.journal}; `wbc study run` writes it")
    made = study_table(
        part.part(study),
        read_journal(options.journal),
        metric=options.metric,
        completed_only=options.completed,
        any_code=part.any_code,
    )
    return output.report(made.to_json(), made.markdown())


def read_study(name: str) -> Study:
    """A study by name, or out of a file.

    Raises:
        UnknownNameError: Neither a study nor a file.
        InputError: The file is no study.
    """
    path = Path(name)
    if name in STUDIES or not (path.suffix == ".json" or path.exists()):
        return study_by_name(name)
    data: Any = read_json(path)
    if not isinstance(data, dict):
        raise InputError(f"{path} is no study: it must hold a JSON object")
    try:
        return Study.from_json(data)
    except TypeError as error:
        raise InputError(f"{path} is no study: {error}") from error


def _progress() -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[rate]}"),
        console=progress_console(),
    )
