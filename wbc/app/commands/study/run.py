"""`wbc study run`: the trials of a study, or one of them once more."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from textwrap import shorten
from typing import Annotated, Any

from cyclopts import Parameter
from rich.markup import escape
from rich.progress import Progress, TextColumn

from wbc.app.commands.study.show import PartOptions, StudyFile, entries_of
from wbc.app.output import Report, facts_text, progress_console, reports
from wbc.base.errors import InputError, one_line, unknown_name
from wbc.base.files import check_target, write_text
from wbc.base.registry import allow_code, code_of
from wbc.base.settings import Count, Positive, settings
from wbc.sim.studies.journal import Entry, Journal, canonical, check_journal_path, read_journal
from wbc.sim.studies.outcomes import run_trial, trial_from_json
from wbc.sim.studies.provenance import differences
from wbc.sim.studies.study import Study, left_out, study_entries
from wbc.sim.studies.sweep import TIMEOUT, SweepSummary, cluster_executor, sweep

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
        out: File to write the spec of that trial to before it runs (.json), for `wbc walk --spec`.
    """

    journal: Path
    workers: Count = 1
    cluster: str | None = None
    timeout: Annotated[Positive, "s"] = TIMEOUT
    retry: bool = False
    key: str | None = None
    out: Annotated[Path | None, Parameter(alias="-o")] = None

    def __post_init__(self) -> None:
        check_journal_path(self.journal)


@reports
def run(study: StudyFile | None = None, /, *, options: RunOptions, part: PartOptions) -> Report:
    """Run the trials of a study that its journal does not have; it can be stopped, and continues from there.

    With --key, run one trial of the journal again, in this process, and compare: for trials that diverged, crashed or
    took too long, whose commands are printed.
    """
    if options.key is not None:
        return _rerun(options, options.key)
    if study is None or options.out is not None:
        raise InputError("give a study to run, or the --key of a trial of the journal (and -o for its spec)")
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
    """Run one trial of a journal again, and report whether it ends as there."""
    target = None
    if options.out is not None:
        target = check_target("a spec", options.out, (".json",), [options.journal])
    entries = entries_of(options.journal)
    found = [entry for name, entry in entries.items() if key and name.startswith(key)]
    if not found:
        unknown_name("key of the journal", key, entries)
    if len(found) > 1:
        raise InputError(f"{len(found)} keys of the journal begin with '{key}'; give more of it")
    entry = found[0]
    spec = trial_from_json(entry.spec)
    if target is not None:
        write_text(target, json.dumps(entry.spec, indent=2) + "\n")
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
            TextColumn("{task.completed} of {task.total}  {task.fields[rate]}"),
        )
        bar = stack.enter_context(Progress(*columns, console=progress_console()))
        task = bar.add_task(escape(one_line(study.name)), total=len(specs), rate="")

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
            progress=progress,
        )
