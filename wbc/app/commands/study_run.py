"""`wbc study run`: the trials of a study, run and written to a journal."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from wbc.app.commands.study import PartOptions, StudyName
from wbc.app.commands.study_rerun import rerun_text, reruns
from wbc.app.output import Flat, Output, OutputOptions, Report, progress_console, reports
from wbc.core.settings import Count, Positive, settings
from wbc.sim.studies.journal import Journal, Sync, check_journal_path, read_journal
from wbc.sim.studies.study import Study
from wbc.sim.studies.sweep import TIMEOUT, SweepSummary, cluster_executor, sweep


@settings(kw_only=True)
class RunOptions:
    """Options of a sweep over the trials of a study.

    Attributes:
        journal: File that every trial is written to as soon as it has ended; what is in it is not run again.
        workers: Number of processes on this machine.
        cluster: Run through Dask instead: address of a scheduler, or "local" for a cluster of --workers processes.
        timeout: Wall time that a trial may take, s.
        retry: Run trials again that crashed or timed out.
        sync: When a line is forced to the disk.
    """

    journal: Path
    workers: Count = 1
    cluster: str | None = None
    timeout: Annotated[Positive, "s"] = TIMEOUT
    retry: bool = False
    sync: Sync = "second"

    def __post_init__(self) -> None:
        check_journal_path(self.journal)


@reports
def run(
    study: StudyName,
    /,
    *,
    options: Flat[RunOptions],
    part: Flat[PartOptions] = PartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Run the trials of a study that its journal does not have. It can be stopped, and continues from there."""
    chosen = part.part(study)
    summary = run_trials(chosen, options, any_code=part.any_code)
    failed = []
    if set(summary.counts) - {"done"}:
        failed = reruns(chosen, read_journal(options.journal), options.journal)
    data = {
        "study": chosen.name,
        "journal": str(options.journal),
        **summary.to_json(),
        "without_result": failed,
    }
    return output.report(data, summary_text(chosen, options, summary) + rerun_text(failed))


def run_trials(study: Study, options: RunOptions, *, any_code: bool = False) -> SweepSummary:
    """Run the trials that a study's journal does not have, with a progress bar."""
    specs = [trial.spec for trial in study.trials()]
    with ExitStack() as stack:
        journal = stack.enter_context(Journal(options.journal, sync=options.sync))
        executor = None
        if options.cluster is not None:
            executor = stack.enter_context(cluster_executor(options.cluster, workers=options.workers))
        bar = stack.enter_context(_progress())
        task = bar.add_task(study.name, total=len(specs), rate="")

        def progress(summary: SweepSummary) -> None:
            per_hour = summary.per_hour
            rate = "" if per_hour is None else f"{per_hour:.0f} an hour"
            done = summary.found + summary.run
            bar.update(task, total=summary.total, completed=done, rate=rate)

        return sweep(
            specs,
            journal,
            executor=executor,
            workers=options.workers,
            timeout=options.timeout,
            retry=options.retry,
            any_code=any_code,
            progress=progress,
        )


def summary_text(study: Study, options: RunOptions, summary: SweepSummary) -> str:
    """Return the text of a summary."""
    counts = ", ".join(f"{n} {status}" for status, n in sorted(summary.counts.items()))
    rate = "" if summary.per_hour is None else f" ({summary.per_hour:.0f} an hour)"
    return (
        f"{study.name}: {summary.total} trials, {summary.found} were in {options.journal}, {summary.run} run in "
        f"{summary.seconds:.0f} s{rate}\n  {counts}"
    )


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
