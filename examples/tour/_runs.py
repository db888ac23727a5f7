"""Runs of a program: trials of a sweep, each a line of a journal, so that an interrupted program goes on."""

from __future__ import annotations

import hashlib
import importlib
import inspect
import json
import logging
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wbc.sim.studies import (
    Entry,
    Journal,
    Outcome,
    SweepSummary,
    TrialKind,
    read_journal,
    register_trial,
    sweep,
)
from wbc.sim.studies.journal import trial_key

LONGEST = 3600.0
"""Wall time after which a run is given up, s."""

SHOWN = 200
"""Number of characters of a value from which on it is in the journal alone."""

Row = dict[str, Any]
"""Arguments and result of a run."""

_programs: dict[str, tuple[str, str]] = {}  # kind of runs → hash of its files, and module that registers it


@dataclass(frozen=True)
class Run:
    """Spec of a run: its kind, and the arguments of the function that makes it."""

    kind: str
    arguments: Mapping[str, Any]

    def to_json(self) -> Row:
        """Return the spec as plain values, with the hash of the program, so that a journal keeps its versions apart."""
        return {"kind": self.kind, "program": _programs[self.kind][0], **self.arguments}

    def __reduce__(self) -> tuple[Any, ...]:
        return _received, (_programs[self.kind][1], self.kind, self.arguments)


def _received(module: str, kind: str, arguments: Mapping[str, Any]) -> Run:
    """Return a run in a process of a sweep, which has the main program and imports the module of another kind."""
    if module != "__main__":
        importlib.import_module(module)
    return Run(kind, arguments)


def register_runs(
    kind: str, function: Callable[..., Row], files: Iterable[Path] = (), metric: str = TrialKind.metric
) -> None:
    """Make the runs of a function of plain values a kind of trial; its program is its own file and further ones.

    The metric is the part of the results that tables of studies are about.
    """
    contents = [file.read_bytes() for file in (Path(inspect.getfile(function)), *sorted(files))]
    _programs[kind] = hashlib.sha256(b"".join(contents)).hexdigest()[:12], function.__module__

    def read(data: Mapping[str, Any]) -> Run:
        return Run(kind, {name: value for name, value in data.items() if name not in ("kind", "program")})

    def run(spec: Run, _: Callable[[], None]) -> Outcome:
        logging.getLogger("wbc").setLevel(logging.CRITICAL)  # robots that fall are in the results
        return Outcome("done", function(**spec.arguments))

    register_trial(kind, TrialKind(read, run, metric=metric))


def rows(path: Path, kind: str) -> list[Row]:
    """Return the runs of a kind that a journal has, whatever code made them."""
    return [_row(entry) for entry in read_journal(path, any_code=True).values() if _is_done(entry, kind)]


def show(row: Row) -> None:
    """Print a run on one line."""
    texts = {name: json.dumps(value) for name, value in row.items()}
    print(", ".join(f"{name} {text}" for name, text in texts.items() if len(text) < SHOWN), flush=True)


def make_runs(
    path: Path,
    kind: str,
    wanted: Iterable[Row],
    *,
    any_code: bool = False,
    workers: int = 1,
    tell: Callable[[Row], object] = show,
) -> list[Row]:
    """Make the runs that a journal does not have, and return those of all that are wanted which have a result.

    Args:
        path: The journal.
        kind: Kind of the runs.
        wanted: Arguments of each run.
        any_code: Take runs of other versions of the code for those of this one.
        workers: Number of runs at a time.
        tell: Function that is called with each run, as soon as it has ended; one without a result has an "error".
    """
    specs = [Run(kind, arguments) for arguments in wanted]
    keys, told = [trial_key(spec.to_json()) for spec in specs], dict[str, Entry]()
    with Journal(path, any_code=any_code) as journal:

        def follow(_: SweepSummary) -> None:
            for key in keys:
                entry = journal.entries.get(key)
                if entry is not None and told.get(key) is not entry:
                    told[key] = entry
                    tell(_row(entry))

        sweep(specs, journal, workers=workers, timeout=LONGEST, retry=True, progress=follow)
    return [_row(told[key]) for key in keys if _is_done(told[key], kind)]


def _is_done(entry: Entry, kind: str) -> bool:
    return entry.result is not None and entry.spec["kind"] == kind


def _row(entry: Entry) -> Row:
    spec = {name: value for name, value in entry.spec.items() if name not in ("kind", "program")}
    return spec | dict({"error": f"{entry.status}: {entry.error}"} if entry.result is None else entry.result)
