"""`wbc study`: many trials, written down in a journal, and the tables that they make."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass
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
from wbc.app.files import check_target
from wbc.app.output import Flat, Output, OutputOptions, Report, progress_console, reports
from wbc.core.errors import InputError, choose
from wbc.sim.studies.catalog import STUDIES, study_by_name
from wbc.sim.studies.journal import SYNCS, Entry, Journal, check_journal_path, read_journal
from wbc.sim.studies.labels import Label, check_windows, labels, stiffness_table
from wbc.sim.studies.stiffness import dataset as make_dataset
from wbc.sim.studies.stiffness import half_heights
from wbc.sim.studies.study import Study, found_entries
from wbc.sim.studies.sweep import TIMEOUT, SweepSummary, cluster_executor, sweep
from wbc.sim.studies.swings import swing_report, swing_text
from wbc.sim.studies.tables import StudyTable, study_rows, study_table

StudyName = Annotated[
    str, Parameter(help="Study: the name of one that `wbc study list` shows, or a file with one as JSON.")
]


JournalPath = Annotated[Path, Parameter(help="File that `wbc study run` has written.")]


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
class DatasetOptions:
    """How much is tried, and where the table goes.

    Attributes:
        output: Table to write (.csv).
        seeds: Grounds of each kind and amplitude.
        amplitudes: Amplitudes of each of the twelve kinds of ground.
        evaluations: Stiffnesses that are tried on each ground.
        distance: Length of a walk, m.
        height: Amplitudes over those of the paper; higher grounds tell more where every walk is survived.
        windows: Profiles that are cut out of each ground, as long as a foot's scan.
        separate: Find the best stiffness of each ground from its own walks alone, as in the paper; otherwise what all
            grounds have in common fills in what these leave open.
        any_code: Take walks of other versions of the code, too.
    """

    output: Path
    seeds: int = 2
    amplitudes: int = 5
    evaluations: int = 16
    distance: float = 3.0
    height: float = 1.0
    windows: int = 6
    separate: bool = False
    any_code: bool = False

    def __post_init__(self) -> None:
        check_windows(self.windows)

    def study(self) -> Study:
        """The walks."""
        return make_dataset(self.seeds, self.amplitudes, self.evaluations, self.distance, self.height)

    def command(self) -> str:
        """The command that makes the same table."""
        names = ("seeds", "amplitudes", "evaluations", "distance", "height", "windows")
        words = "wbc study dataset " + " ".join(f"--{name} {getattr(self, name):g}" for name in names)
        return words + (" --separate" if self.separate else "")


@dataclass(frozen=True, kw_only=True)
class BestOptions:
    """From which walks.

    Attributes:
        journal: File that `wbc study run` has written.
        separate: Find the best stiffness of each cell from its own walks alone; otherwise what the others have in
            common fills in what these leave open.
        any_code: Take walks of other versions of the code, too.
    """

    journal: Path
    separate: bool = False
    any_code: bool = False


@dataclass(frozen=True, kw_only=True)
class TableOptions:
    """Which table.

    Attributes:
        journal: File that `wbc study run` has written.
        metric: Part of the results, such as steps_done, zmp_error.mean or peak_torque_ratio; the study's own when
            not given.
        completed: Only walks that were completed.
        by: Part of the specs, such as terrain or gait.swing_height; cells that agree in it become one row. May be given
            several times.
    """

    journal: Path
    metric: str | None = None
    completed: bool = False
    by: tuple[str, ...] = ()

    def table(self, study: str, part: PartOptions) -> StudyTable:
        """The table."""
        return study_table(
            part.part(study),
            entries_of(self.journal),
            metric=self.metric,
            completed_only=self.completed,
            by=self.by,
            any_code=part.any_code,
        )


@reports
def list_studies(*, output: OutputOptions = Output()) -> Report:
    """List the studies that come with the library."""
    facts = [study_facts(name) for name in STUDIES]
    lines = [f"{fact['name']:<22} {fact['trials'] or '':>5} trials  {fact['about']}" for fact in facts]
    return output.report({"studies": facts}, "\n".join(lines))


def study_facts(name: str) -> dict[str, Any]:
    """What there is to say of a study; of one that rests on another that has not been run, what is missing."""
    try:
        study = study_by_name(name)
    except InputError as error:
        return {"name": name, "about": f"not yet: {error}", "trials": None}
    return {"name": name, "about": study.about, "trials": sum(1 for _ in study.trials())}


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
    summary = run_trials(chosen, options, any_code=part.any_code)
    data = {"study": chosen.name, "journal": str(options.journal), **summary.to_json()}
    return output.report(data, summary_text(chosen, options, summary))


@reports
def dataset(
    *,
    options: Flat[RunOptions],
    size: Flat[DatasetOptions],
    output: OutputOptions = Output(),
) -> Report:
    """Find the best stiffness for ground and amplitude, and write the table that a stiffness model learns from.

    The walks that the journal does not have are run first; the size says how many there are, from minutes to the
    paper's 6,000 walks (50 evaluations, 2 seeds). `wbc stiffness train` makes a model of the table.
    """
    study = size.study()
    target = check_target("a stiffness table", size.output, (".csv",))
    summary = run_trials(study, options, any_code=size.any_code)
    entries = read_journal(options.journal)
    found = labels(study, entries, pooled=not size.separate, any_code=size.any_code)
    made = {"command": size.command(), **origin(study, entries, any_code=size.any_code)}
    table = stiffness_table(study, found, windows=size.windows, made=made)
    table.save(target)
    data = {
        "table": str(target),
        "rows": len(table),
        "labels": {cell: asdict(label) for cell, label in found.items()},
        **summary.to_json(),
    }
    lines = [
        summary_text(study, options, summary),
        labels_text(found),
        f"{len(table)} rows written to {target}",
    ]
    return output.report(data, "\n".join(lines))


@reports
def best(
    study: StudyName,
    /,
    *,
    options: Flat[BestOptions],
    output: OutputOptions = Output(),
) -> Report:
    """Find the best stiffness of each cell of a study whose arms are stiffnesses, from what its journal has."""
    chosen, entries = read_study(study), entries_of(options.journal)
    found = labels(chosen, entries, pooled=not options.separate, any_code=options.any_code)
    if not found:
        raise InputError(
            f"{options.journal} has no cell of '{chosen.name}' with walks of enough stiffnesses; run the study"
        )
    data = {
        "study": chosen.name,
        "separate": options.separate,
        **origin(chosen, entries, any_code=options.any_code),
        "labels": {cell: asdict(label) for cell, label in found.items()},
    }
    return output.report(data, labels_text(found))


@reports
def heights(
    study: StudyName = "halfway",
    /,
    *,
    journal: JournalPath,
    part: Flat[PartOptions] = PartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Find the height of each ground at which half of the walks are completed, from what a journal has."""
    chosen, entries = part.part(study), entries_of(journal)
    found = half_heights(chosen, entries, any_code=part.any_code)
    if not found:
        raise InputError(f"{journal} has no walks of '{chosen.name}'; run the study")
    data = {"study": chosen.name, **origin(chosen, entries, any_code=part.any_code), "heights_m": found}
    return output.report(data, "\n".join(f"{name:<20} {1e3 * h:5.1f} mm" for name, h in found.items()))


def labels_text(found: Mapping[str, Label]) -> str:
    """Best stiffness of each ground and amplitude, for people."""
    lines = [f"{'best stiffness, Nm/rad':<32} best   nearly best     80 % sure        J   gained by it"]
    for cell, label in found.items():
        near = f"{label.nearly_low:.3g} … {label.nearly_high:.3g}"
        sure = f"{label.best_low:.3g} … {label.best_high:.3g}"
        lines.append(
            f"  {cell:<30} {label.stiffness:4.3g}  {near:^14} {sure:^14} {label.J:8.3g} {label.gain:8.2g}"
        )
    return "\n".join(lines)


def run_trials(study: Study, options: RunOptions, *, any_code: bool = False) -> SweepSummary:
    """Run what a study's journal does not have, with a progress bar."""
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
    """What was run, for people."""
    counts = ", ".join(f"{n} {status}" for status, n in sorted(summary.counts.items()))
    rate = "" if summary.per_hour is None else f" ({summary.per_hour:.0f} an hour)"
    return (
        f"{study.name}: {summary.total} trials, {summary.found} were in {options.journal}, {summary.run} run in "
        f"{summary.seconds:.0f} s{rate}\n  {counts}"
    )


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
    made = options.table(study, part)
    return output.report(made.to_json(), made.markdown())


@reports
def plot(
    study: StudyName,
    /,
    *,
    out: Annotated[Path, Parameter(alias="-o", help="Figure to write (.png, .svg or .pdf).")],
    options: Flat[TableOptions],
    part: Flat[PartOptions] = PartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Draw what a study found: each arm's mean and its difference to the reference, with intervals."""
    from wbc.app.plot.output import check_output, save  # noqa: PLC0415 - slow to import
    from wbc.app.plot.study import study_figure  # noqa: PLC0415

    target = check_output(out)
    made = options.table(study, part)
    save({made.study.name: study_figure(made)}, target)
    return output.report({"figure": str(target), **made.to_json()}, str(target))


@reports
def export(
    study: StudyName,
    /,
    *,
    journal: JournalPath,
    out: Annotated[Path, Parameter(alias="-o", help="Table to write (.csv), a row for each trial.")],
    part: Flat[PartOptions] = PartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Write all results of a study to a table, for a spreadsheet or a data frame."""
    target = check_target("a table", out, (".csv",))
    columns, rows = study_rows(part.part(study), entries_of(journal), any_code=part.any_code)
    with target.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(rows)
    data = {"table": str(target), "rows": len(rows), "columns": columns}
    return output.report(data, f"{len(rows)} rows with {len(columns)} columns written to {target}")


@reports
def swings(
    study: StudyName,
    /,
    *,
    journal: JournalPath,
    part: Flat[PartOptions] = PartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Tell what soles of variable stiffness did: how often they were ready, how well the ground was seen, how soon."""
    chosen = part.part(study)
    found = swing_report(chosen, entries_of(journal), any_code=part.any_code)
    if not found:
        raise InputError(f"{journal} has no walk of '{chosen.name}' on soles of variable stiffness")
    return output.report(
        {"study": chosen.name, "rows": {row: summary.to_json() for row, summary in found.items()}},
        swing_text(found),
    )


def origin(study: Study, entries: Mapping[str, Entry], *, any_code: bool) -> dict[str, Any]:
    """What was walked, by which code: counts of trials by status, and the versions that made them."""
    found = found_entries(study, entries, any_code=any_code)
    used = {trial: entry for trial, entry in found if entry is not None}
    versions = {json.dumps(entry.version, sort_keys=True) for entry in used.values()}
    return {
        "trials": dict(Counter(entry.status for entry in used.values())),
        "versions": [json.loads(version) for version in sorted(versions)],
        "seeds": sorted({trial.seed for trial in used}),
    }


def entries_of(journal: Path) -> dict[str, Entry]:
    """What a journal has.

    Raises:
        InputError: There is none.
    """
    if not journal.exists():
        raise InputError(f"there is no journal {journal}; `wbc study run` writes it")
    return read_journal(journal)


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
