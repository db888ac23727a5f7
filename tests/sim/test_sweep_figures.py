"""Figures of sweeps and of the tables of studies, on outcomes that are made up."""

from __future__ import annotations

import importlib
from concurrent.futures import CancelledError, Executor, Future
from pathlib import Path
from typing import Any

import pytest
from sweep_trials import MadeUpTrial

from wbc.sim.studies.journal import Entry, Journal
from wbc.sim.studies.outcomes import Outcome
from wbc.sim.studies.provenance import provenance
from wbc.sim.studies.study import Cell, Study
from wbc.sim.studies.study_table import cause_of, layout_of, part_of, study_table
from wbc.sim.studies.sweep import SweepError, SweepSummary, sweep

module = importlib.import_module("wbc.sim.studies.sweep")
"""The module, whose name in the package is that of the function."""


def test_causes_of_falls_are_four() -> None:
    for fall, cause in (
        (None, None),
        ("left", None),
        ({}, None),
        ({"cause": "forward"}, "forward"),
        ({"cause": "backward"}, "backward"),
        ({"cause": "left"}, "sideways"),
        ({"cause": "right"}, "sideways"),
        ({"cause": "up"}, None),
        ({"cause": "left", "reason": "height"}, "dropped"),
        ({"cause": "left", "reason": "tilt"}, "sideways"),
    ):
        assert cause_of({"fall": fall}) == cause
    assert cause_of({}) is None


def made_table(results: dict[str, list[dict[str, Any] | str]]) -> Any:
    count = max(map(len, results.values()))
    study = Study(
        name="made",
        base={"plan": {"distance": 0.1}},
        cells=(Cell("flat", {}),),
        arms={name: {"foot": foot} for name, foot in zip(results, ("rigid", "soft"), strict=False)},
        seeds=tuple(range(1, count + 1)),
    )
    entries = {}
    for trial in study.trials():
        given = results[trial.arm][trial.seed - 1 :][:1]
        if given:
            status, result = (given[0], None) if isinstance(given[0], str) else ("done", given[0])
            entry = Entry(trial.spec.to_json(), status, result, None, None, provenance())
            entries[entry.key] = entry
    return study_table(study, entries, metric="steps_done")


def test_loads_falls_and_losses_stand_in_their_units() -> None:
    """Landing peaks over the weight, ZMP errors in mm, contact areas in cm²; falls per 1,000 steps by cause."""

    def walk(steps: int, factor: float, outcome: str = "completed", **fall: str) -> dict[str, Any]:
        return {
            "steps_done": steps,
            "outcome": outcome,
            "fall": fall or None,
            "impact": 1.5 * factor,
            "zmp_error": {"mean": 0.012 * factor},
            "contact_area": {"mean": 0.0035 * factor},
            "cost_of_transport": 0.4 * factor,
            "vibration": 2e6 * factor,
            "slip": 0.01 * factor,
        }

    first = [
        walk(22, 1.0),
        walk(22, 2.0, "strayed"),
        walk(6, 3.0, "fell", cause="left"),
        walk(0, 2.0, "unfinished"),
    ]
    table = made_table(
        {"one": [*first, "diverged", "timeout", "timeout", "crashed"], "other": [walk(50, 1.0)] * 8}
    )
    one = table.by_name["flat", "one"]
    assert one.statuses == {"done": 4, "diverged": 1, "timeout": 2, "crashed": 1}
    assert one.outcomes == {"completed": 1, "strayed": 1, "fell": 1, "unfinished": 1}
    assert one.falls == {"sideways": 1} and one.steps == 50
    assert one.beside == pytest.approx(
        {
            "impact": 3.0,
            "zmp_error.mean": 0.024,
            "contact_area.mean": 0.007,
            "cost_of_transport": 0.8,
            "vibration": 4e6,
            "slip": 0.02,
        }
    )
    assert one.estimate.mean == pytest.approx(12.5)
    lines = table.ends().splitlines()
    heads = [part.strip() for part in lines[2].strip("|").split("|")]
    assert heads == ["", "completed", "forward", "sideways", "backward", "dropped"] + [
        "landing peak (x weight)",
        "ZMP error (mm)",
        "contact area (cm²)",
        "cost of transport",
        "vibration (10⁶ rad/s²)",
        "slip (mm)",
    ]
    parts = dict(zip(heads, (part.strip() for part in lines[4].strip("|").split("|")), strict=True))
    assert parts[""] == "one" and parts["completed"].startswith("1 of 4")
    assert parts["sideways"].startswith("20 [") and parts["forward"] == "≤ 59.9"  # ln(20) / 0.05
    assert [parts[h] for h in heads[6:]] == ["3", "24", "70", "0.8", "4", "20"]
    assert lines[-1] == (
        "1 of 'one' strayed; 1 of 'one' unfinished; 1 of 'one' diverged; 2 of 'one' timeout; 1 of 'one' crashed"
    )
    shown = table.to_json()
    assert shown["confidence"] == 0.95 and shown["reference"] == "one"
    assert [(cell["row"], cell["arm"]) for cell in shown["cells"]] == [("flat", "one"), ("flat", "other")]
    assert shown["cells"][0]["mean"] == pytest.approx(12.5) and shown["cells"][0]["n"] == 4


def test_layouts_are_the_ground_and_the_seed() -> None:
    """Not the gait, and not the order in which parameters of a ground are written."""
    one = {"terrain": "stones", "amplitude": 0.02, "terrain_params": {"a": 1, "b": 2}, "seed": 3, "gait": 1}
    other = {**one, "gait": 2, "terrain_params": {"b": 2, "a": 1}}
    assert layout_of(one) == layout_of(other)
    for name, value in (
        ("terrain", "flat"),
        ("amplitude", 0.03),
        ("terrain_params", {"a": 2, "b": 2}),
        ("seed", 4),
    ):
        assert layout_of({**one, name: value}) != layout_of(one)
    assert part_of({"a": {"b": {"c": 4}}}, "a.b.c") == 4


class Direct(Executor):
    """Runs nothing: gives what it is told for each trial's number, in the order of the trials, and counts."""

    def __init__(self, gives: dict[int, Any] | None = None) -> None:
        self.gives, self.open, self.most, self.sent = gives or {}, 0, 0, []
        self.waiting: list[tuple[int, Future[Outcome]]] = []

    def submit(self, fn: Any, /, spec: Any, *rest: Any, **named: Any) -> Future[Outcome]:
        future: Future[Outcome] = Future()
        self.sent.append((spec.number, *rest))
        self.waiting.append((spec.number, future))
        self.most = max(self.most, len(self.waiting))
        return future

    def end(self) -> None:
        for number, future in self.waiting:
            given = self.gives.get(number, Outcome("done", {"square": number**2}))
            future.set_running_or_notify_cancel()
            if isinstance(given, BaseException):
                future.set_exception(given)
            else:
                future.set_result(given)
        self.waiting.clear()


@pytest.fixture
def direct(monkeypatch: pytest.MonkeyPatch) -> Direct:
    """An executor whose trials end when the sweep waits for them."""
    executor, wait = Direct(), module.wait

    def ended(*args: Any, **named: Any) -> Any:
        executor.end()
        return wait(*args, **named)

    monkeypatch.setattr(module, "wait", ended)
    return executor


def test_an_executor_holds_a_thousand_trials_and_each_has_its_time_out(
    direct: Direct, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert module.IN_FLIGHT == 1000
    monkeypatch.setattr(module, "IN_FLIGHT", 3)
    with Journal(tmp_path / "journal.jsonl") as journal:
        summary = sweep([MadeUpTrial(i) for i in range(8)], journal, executor=direct, timeout=12.0)
        assert (summary.run, summary.counts) == (8, {"done": 8})
        assert direct.most == 3 and [sent[0] for sent in direct.sent] == list(range(8))
        assert {sent[1] for sent in direct.sent} == {12.0}
        sweep([MadeUpTrial(9)], journal, executor=direct)
        assert direct.sent[-1][1] == 600.0  # by default


def test_trials_that_an_executor_has_lost_are_counted(direct: Direct, tmp_path: Path) -> None:
    """Those that have ended meanwhile are written down; nothing new is begun."""
    direct.gives = {1: CancelledError(), 2: CancelledError()}
    with Journal(tmp_path / "journal.jsonl") as journal:
        module_most, module.IN_FLIGHT = module.IN_FLIGHT, 4
        try:
            with pytest.raises(SweepError, match="; 2 trials are written down, 2 were lost and 3 not begun"):
                sweep([MadeUpTrial(i) for i in range(7)], journal, executor=direct)
        finally:
            module.IN_FLIGHT = module_most
        direct.gives = {4: KeyError("worker")}
        with pytest.raises(SweepError, match="could not run a trial .KeyError: 'worker'."):
            sweep([MadeUpTrial(4)], journal, executor=direct)
        assert len(journal.entries) == 2


def test_the_rate_of_a_sweep_is_that_of_its_own_trials() -> None:
    assert SweepSummary(10, found=5, run=4, seconds=8.0).per_hour == 1800.0
    assert SweepSummary(10, found=5, run=0, seconds=8.0).per_hour is None
    assert SweepSummary(10, run=4).per_hour is None
    summary = SweepSummary(3, run=1, seconds=3600.0)
    summary.counts["done"] += 2
    assert summary.to_json() == {
        "total": 3,
        "found": 0,
        "run": 1,
        "counts": {"done": 2},
        "seconds": 3600.0,
        "per_hour": 1.0,
    }
