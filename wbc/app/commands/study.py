"""`wbc study`: the studies, their runs, and tables and figures of their journals."""

from __future__ import annotations

import json
import logging
import shlex
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from textwrap import shorten
from typing import Annotated, Any

from cyclopts import Parameter
from rich.markup import escape
from rich.progress import Progress, TextColumn

from wbc.app.files import PICTURES, read_object
from wbc.app.output import Report, facts_text, progress_console, reports
from wbc.base.errors import InputError, one_line, printable, unknown_name
from wbc.base.files import check_target, replacing
from wbc.base.registry import allow_code, code_of
from wbc.base.settings import Count, Positive, settings, to_json
from wbc.sim.studies.journal import Entry, Journal, canonical, check_journal_path, read_journal
from wbc.sim.studies.outcomes import run_trial, trial_from_json
from wbc.sim.studies.provenance import differences
from wbc.sim.studies.study import Study, left_out, study_entries
from wbc.sim.studies.study_table import StudyTable, study_frame, study_table
from wbc.sim.studies.sweep import TIMEOUT, SweepSummary, cluster_executor, sweep

logger = logging.getLogger(__name__)

StudyFile = Annotated[Path, Parameter(help="File with a study as JSON, such as those of examples/studies.")]


def entries_of(journal: Path, *, any_code: bool = False) -> Mapping[str, Entry]:
    """Return the entries of a journal; `InputError` if there is none."""
    if not journal.exists():
        raise InputError(f"there is no journal {journal}; `wbc study run` writes it")
    return read_journal(journal, any_code=any_code)


@settings(kw_only=True)
class ShownPartOptions:
    """Part of a study.

    Attributes:
        cell: Only these cells, by name or beginning of a name.
        arm: Only these arms.
        seeds: Only the first so many seeds.
        code: Python file that the study or its journal names and that may be run; may be given several times. Beside
            these, only the file of the study's own kind is run.
    """

    cell: tuple[str, ...] = ()
    arm: tuple[str, ...] = ()
    seeds: int | None = None
    code: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        allow_code(self.code)

    def part(self, study: Path) -> Study:
        """Return this part of a study in a file."""
        return read_study(study).narrowed(self.cell, self.arm, self.seeds)


@settings(kw_only=True)
class PartOptions(ShownPartOptions):
    """Part of a study, with results.

    Attributes:
        any_code: Take results of other versions of the code, too.
    """

    any_code: bool = False


@settings(kw_only=True)
class ResultOptions:
    """Part of the results in a journal, and the file that they are written to.

    Attributes:
        journal: File that `wbc study run` has written.
        metric: Part of the results, such as steps_done, zmp_error.mean or peak_torque_ratio; that of the study if not
            given.
        completed: Only walks that were completed.
        by: Part of the specs, such as terrain or gait.swing_height; cells that agree in it become one row. May be given
            several times.
        out: File to write. Of a table: a row for each trial, with units in the heads of the columns (.csv). Of a
            figure: .png, .pdf, .svg or .jpg, the name of the journal with .png when not given.
    """

    journal: Path
    metric: str | None = None
    completed: bool = False
    by: tuple[str, ...] = ()
    out: Annotated[Path | None, Parameter(alias="-o")] = None

    def table(self, study: Study, entries: Mapping[str, Entry]) -> StudyTable:
        """Return the table of a study; what the entries of the journal cannot give is refused by its name."""
        try:
            return study_table(study, entries, metric=self.metric, completed_only=self.completed, by=self.by)
        except InputError as error:
            raise InputError(f"{self.journal}: {error}") from error


@reports
def show(
    study: Annotated[
        Path, Parameter(help="File with a study as JSON, or a folder whose studies are listed.")
    ],
    /,
    *,
    part: ShownPartOptions,
) -> Report:
    """Print a study, or a part of it, as JSON, or list the studies of a folder."""
    if study.is_dir():
        studies = [read_study(path) for path in sorted(study.glob("*.json"))]
        facts = [{"name": each.name, "about": each.about, "trials": each.size} for each in studies]
        lines = [
            f"{one_line(each.name):<22} {each.size:>5} trials  {one_line(each.about)}" for each in studies
        ]
        return Report({"studies": facts}, "\n".join(lines))
    chosen = part.part(study)
    for _ in chosen.trials():
        pass  # what cannot be run is refused, as `run` refuses it
    data = chosen.to_json()
    return Report(data, json.dumps(data, indent=2))


@reports
def table(study: StudyFile, /, *, options: ResultOptions, part: PartOptions) -> Report:
    """Make a table of a study from its journal, or a spreadsheet."""
    target = options.out
    if target is not None:
        target = check_target("a table", target, (".csv",), [options.journal, study])
    chosen, entries, unused = _results(study, options, part)
    if target is not None:
        frame = study_frame(chosen, entries)
        with replacing(target) as new:
            heads = [_cell(chosen.titled(name)) for name in frame.columns]
            frame.map(_cell).to_csv(new, index=False, header=heads)
        facts = {"table": str(target), "rows": len(frame), "columns": list(frame.columns), **unused}
        return Report(facts, f"{len(frame)} rows with {len(frame.columns)} columns written to {target}")
    made = options.table(chosen, entries)
    return Report(made.to_json() | unused, made.markdown())


@reports
def plot(study: StudyFile, /, *, options: ResultOptions, part: PartOptions) -> Report:
    """Draw a study from its journal: means of every arm in every cell, with their intervals."""
    from wbc.app.plot.figures import save  # noqa: PLC0415 - slow to import
    from wbc.app.plot.study import draw_study  # noqa: PLC0415

    target = check_target(
        "a picture",
        options.out or f"{options.journal.name.partition('.')[0]}.png",
        PICTURES,
        [options.journal, study],
    )
    chosen, entries, unused = _results(study, options, part)
    save({chosen.name: draw_study(options.table(chosen, entries))}, target)
    return Report({"picture": str(target), **unused}, str(target))


def _cell(value: Any) -> Any:
    """Return a value as a spreadsheet shows it: a text that would be a formula gets an apostrophe before it."""
    if not isinstance(value, str):
        return value
    return f"'{printable(value)}" if value.lstrip().startswith(("=", "+", "-", "@")) else printable(value)


def _results(
    study: Path, options: ResultOptions, part: PartOptions
) -> tuple[Study, Mapping[str, Entry], dict[str, Any]]:
    """Return a part of a study, the entries of its journal, and what of them is left out, which is also told."""
    chosen, entries = part.part(study), entries_of(options.journal, any_code=part.any_code)
    rest = left_out(chosen, entries)
    if (warning := rest.text()) is not None:
        logger.warning("%s", warning)
    return chosen, entries, {"left_out": to_json(rest)}


def read_study(path: Path) -> Study:
    """Return the study in a file; `InputError` for one without."""
    return Study.from_json(read_object("study", path))


KEY_LENGTH = 12
"""Digits of a key that are printed: two of 10,000 trials agree in them with a probability of 2e-7."""

PRINTED = 5
"""Number of commands that are printed in a text; JSON has all."""


def reruns(study: Study, entries: Mapping[str, Entry], journal: Path) -> list[dict[str, Any]]:
    """Return the trials of a study that have ended without a result, each with the command that runs it again."""
    return [
        {
            "cell": trial.cell,
            "arm": trial.arm,
            "seed": trial.seed,
            "status": entry.status,
            "error": entry.error,
            "command": shlex.join(
                ["wbc", "study", "run", "--journal", str(journal), "--key", entry.key[:KEY_LENGTH]]
                + [word for file in code_of(entry.spec) for word in ("--code", file)]
            ),
        }
        for trial, entry in study_entries(study, entries)
        if entry is not None and entry.status != "done"
    ]


@settings(kw_only=True)
class RunOptions:
    """Options of a sweep over the trials of a study, or of one trial of a journal once more.

    Attributes:
        journal: File that every trial is written to as soon as it has ended; what is in it is not run again.
        workers: Number of processes on this machine.
        cluster: Run through Dask instead: address of a scheduler.
        timeout: Wall time that a trial may take, s.
        retry: Run trials again that crashed or timed out.
        key: Key of a trial of the journal, or the beginning of it, that is run again instead; the journal is only read.
    """

    journal: Path
    workers: Count = 1
    cluster: str | None = None
    timeout: Annotated[Positive, "s"] = TIMEOUT
    retry: bool = False
    key: str | None = None

    def __post_init__(self) -> None:
        check_journal_path(self.journal)


@reports
def run(study: StudyFile | None = None, /, *, options: RunOptions, part: PartOptions) -> Report:
    """Run the trials of a study that its journal does not have; it can be stopped, and continues from there.

    With --key, run one trial of the journal again, in this process, and compare: for trials that diverged, crashed or
    took too long, whose commands are printed. With --json its spec is printed, too, for `wbc walk --spec`.
    """
    if options.key is not None:
        return _rerun(options, options.key)
    if study is None:
        raise InputError("give a study to run, or the --key of a trial of the journal")
    chosen = part.part(study)
    allow_code(chosen.to_json())
    try:
        summary = run_trials(chosen, options, any_code=part.any_code)
    except KeyboardInterrupt:
        found = list(study_entries(chosen, read_journal(options.journal, any_code=True)))
        kept = sum(entry is not None for _, entry in found)
        raise KeyboardInterrupt(
            f"{kept} of {len(found)} trials are kept in {options.journal}: the same command goes on from there"
        ) from None
    failed = []
    if set(summary.counts) - {"done"}:
        failed = reruns(chosen, read_journal(options.journal, any_code=True), options.journal)
    data = {
        "study": chosen.name,
        "journal": str(options.journal),
        **summary.to_json(),
        "without_result": failed,
    }
    counts = ", ".join(f"{n} {status}" for status, n in sorted(summary.counts.items()))
    rate = "" if summary.per_hour is None else f" ({summary.per_hour:.0f} an hour)"
    lines = [
        f"{chosen.name}: {summary.total} trials, {summary.found} were in {options.journal}, {summary.run} run in "
        f"{summary.seconds:.0f} s{rate}",
        counts,
    ]
    for one in failed[:PRINTED]:
        lines.append(f"{one['command']}  # {one['status']}: {one['cell']}, {one['arm']}, seed {one['seed']}")
    if len(failed) > PRINTED:
        lines.append(f"and {len(failed) - PRINTED} more, which --json names")
    return Report(data, "\n  ".join(lines))


def _rerun(options: RunOptions, key: str) -> Report:
    entries = entries_of(options.journal)
    found = [entry for name, entry in entries.items() if key and name.startswith(key)]
    if not found:
        unknown_name("key of the journal", key, entries)
    if len(found) > 1:
        raise InputError(f"{len(found)} keys of the journal begin with '{key}'; give more of it")
    entry = found[0]
    spec = trial_from_json(entry.spec)
    outcome = run_trial(spec, options.timeout)
    same = outcome.status == entry.status and canonical(outcome.result) == canonical(entry.result)
    other = differences(entry.version)
    facts = {
        "key": entry.key,
        "journal": {"status": entry.status, "error": entry.error, "differences": other},
        "status": outcome.status,
        "error": outcome.error,
        "result": outcome.result,
        "clock": outcome.clock,
        "same": same,
        "spec": entry.spec,
    }
    lines = [
        f"{spec.kind} {entry.key}: {outcome.status}, {'the same' if same else 'not the same'} as in the journal "
        f"({entry.status})"
    ]
    if other:
        lines.append(f"  the journal's is of another version of the code: {', '.join(other)}")
    lines += [f"  {line}" for line in (outcome.error or "").splitlines()]
    return Report(facts, "\n".join([*lines, facts_text(outcome.result or {})]))


def run_trials(study: Study, options: RunOptions, *, any_code: bool = False) -> SweepSummary:
    """Run the trials that a study's journal does not have, with a progress bar."""
    specs = [trial.spec for trial in study.trials()]
    with ExitStack() as stack:
        journal = stack.enter_context(Journal(options.journal, any_code=any_code))
        older = left_out(study, journal.entries)
        if older.other_code:
            why = shorten("; ".join(older.differences), 200, placeholder=" …")
            raise InputError(
                f"{options.journal} has {older.other_code} trials of '{study.name}' by another version of the code "
                f"({why}): --any-code takes them, or begin another journal"
            )
        executor = None
        if options.cluster is not None:
            executor = stack.enter_context(cluster_executor(options.cluster))
        columns = (
            *Progress.get_default_columns(),
            TextColumn("{task.completed} of {task.total}"),
        )
        bar = stack.enter_context(Progress(*columns, console=progress_console()))
        task = bar.add_task(escape(one_line(study.name)), total=len(specs))
        return sweep(
            specs,
            journal,
            executor=executor,
            workers=options.workers,
            timeout=options.timeout,
            retry=options.retry,
            progress=lambda summary: bar.update(task, completed=summary.found + summary.run),
        )
