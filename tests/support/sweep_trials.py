"""Trials for tests of sweeps: quick, and able to do whatever a trial can do wrong. Imported by worker processes."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from wbc.sim.studies.journal import Journal
from wbc.sim.studies.outcomes import Outcome, TimeoutCheck, TrialKind, register_trial
from wbc.sim.studies.sweep import sweep


@dataclass(frozen=True)
class MadeUpTrial:
    """Does as it is told, and leaves a mark each time it is run.

    Attributes:
        number: Tells it from others.
        does: "work", "diverge", "raise", "wait" (for its time-out), "hang" (deaf to it), "die", "numpy" (a result of
            NumPy's numbers), "object" (a result that no journal can hold), "finished" (no status) or "nothing".
        seconds: Duration, s.
        marks: File with a line for each run; none when empty.
    """

    kind: ClassVar[str] = "test"

    number: int
    does: str = "work"
    seconds: float = 0.0
    marks: str = ""

    def to_json(self) -> dict[str, Any]:
        return {"kind": self.kind, **asdict(self)}

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> MadeUpTrial:
        return MadeUpTrial(**{key: value for key, value in data.items() if key != "kind"})


def run_test_trial(spec: MadeUpTrial, check: TimeoutCheck) -> Outcome:
    if spec.marks:
        with Path(spec.marks).open("a") as file:
            file.write(f"{spec.number} {os.getpid()}\n")
    if spec.does == "die":
        os._exit(3)
    if spec.does == "raise":
        raise ArithmeticError(f"trial {spec.number} has had enough")
    end = time.monotonic() + (3600.0 if spec.does in ("wait", "hang") else spec.seconds)
    while time.monotonic() < end:
        time.sleep(0.01)
        if spec.does != "hang":
            check()
    if spec.does == "numpy":
        values = {"best": np.arange(3)[-1], "even": np.True_, "all": np.arange(2), "none": np.float32("nan")}
        return Outcome("done", values, {"wall_s": np.float32(1.0)})
    if spec.does == "object":
        return Outcome("done", {"object": object()})
    if spec.does == "finished":
        return Outcome("finished")  # type: ignore[arg-type]
    if spec.does == "nothing":
        return None  # type: ignore[return-value]
    status = "diverged" if spec.does == "diverge" else "done"
    return Outcome(
        status, {"square": spec.number**2, "threads": os.environ.get("OMP_NUM_THREADS")}, {"wall_s": 1.0}
    )


register_trial("test", TrialKind(MadeUpTrial.from_json, run_test_trial))


def main() -> None:
    """Run a sweep in a program of its own: journal, file of marks, number of trials."""
    journal, marks, count = sys.argv[1:4]
    trials = [MadeUpTrial(number, seconds=0.15, marks=marks) for number in range(int(count))]
    with Journal(journal) as book:
        sweep(trials, book, workers=1)
