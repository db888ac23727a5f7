"""Runs of a benchmark: trials of a sweep, each a line of a journal, so that an interrupted program goes on.

The programs of `examples/tour` and `examples/hands` can be imported after this module.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import logging
import sys
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

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
sys.path[:0] = [str(EXAMPLES / folder) for folder in ("tour", "hands")]

LONGEST = 3600.0
"""Wall time after which a run is given up, s."""

SHOWN = 200
"""Number of characters of a value from which on it is in the journal alone."""

Row = dict[str, Any]
"""Arguments and result of a run."""

_programs: dict[str, str] = {}  # kind of runs → hash of its files


@dataclass(frozen=True)
class Run:
    """Spec of a run: its kind, and the arguments of the function that makes it."""

    kind: str
    arguments: Mapping[str, Any]

    def to_json(self) -> Row:
        """Return the spec as plain values, with the hash of the program, so that a journal keeps its versions apart."""
        return {"kind": self.kind, "program": _programs[self.kind], **self.arguments}


def register_runs(kind: str, function: Callable[..., Row], files: Iterable[Path] = ()) -> None:
    """Make the runs of a function of plain values a kind of trial; its program is its own file and further ones."""
    contents = [file.read_bytes() for file in (Path(inspect.getfile(function)), *sorted(files))]
    _programs[kind] = hashlib.sha256(b"".join(contents)).hexdigest()[:12]

    def read(data: Mapping[str, Any]) -> Run:
        return Run(kind, {name: value for name, value in data.items() if name not in ("kind", "program")})

    def run(spec: Run, _: Callable[[], None]) -> Outcome:
        logging.getLogger("wbc").setLevel(logging.CRITICAL)  # robots that fall are in the results
        return Outcome("done", function(**spec.arguments))

    register_trial(kind, TrialKind(read, run))


def rows(path: Path, kind: str) -> list[Row]:
    """Return the runs of a kind that a journal has, whatever code made them."""
    return [_row(entry) for entry in read_journal(path, any_code=True).values() if _is_done(entry, kind)]


def make_runs(path: Path, kind: str, wanted: Iterable[Row], *, any_code: bool = False) -> list[Row]:
    """Make the runs that a journal does not have, print each, and return all that are wanted and have a result.

    Args:
        path: The journal.
        kind: Kind of the runs.
        wanted: Arguments of each run.
        any_code: Take runs of other versions of the code for those of this one.
    """
    specs = [Run(kind, arguments) for arguments in wanted]
    with Journal(path, any_code=any_code) as journal:
        told = dict(journal.entries)

        def tell(_: SweepSummary) -> None:
            for key, entry in journal.entries.items():
                if told.get(key) is not entry:
                    told[key] = entry
                    texts = {name: json.dumps(value) for name, value in _row(entry).items()}
                    print(
                        ", ".join(f"{name} {text}" for name, text in texts.items() if len(text) < SHOWN),
                        flush=True,
                    )

        sweep(specs, journal, timeout=LONGEST, retry=True, progress=tell)
        found = [journal.entry(spec) for spec in specs]
    return [_row(entry) for entry in found if entry is not None and _is_done(entry, kind)]


def _is_done(entry: Entry, kind: str) -> bool:
    return entry.result is not None and entry.spec["kind"] == kind


def _row(entry: Entry) -> Row:
    spec = {name: value for name, value in entry.spec.items() if name not in ("kind", "program")}
    return spec | dict({"error": f"{entry.status}: {entry.error}"} if entry.result is None else entry.result)
