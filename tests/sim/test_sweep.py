"""Sweeps: every trial once, whatever happens to it, to its process or to the sweep; and what tables say of them."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import alive
from properties import by_default
from scipy import stats
from sweep_trials import MadeUpTrial

from wbc.app.plot.study import draw_study
from wbc.base.errors import InputError, UnknownNameError
from wbc.sim.studies.journal import Entry, Journal, read_journal
from wbc.sim.studies.outcomes import run_trial
from wbc.sim.studies.provenance import provenance
from wbc.sim.studies.study import Cell, Study, merged
from wbc.sim.studies.study_table import study_frame, study_table
from wbc.sim.studies.sweep import SweepSummary, cluster_executor, sweep
from wbc.sim.walks.plan import WalkPlan
from wbc.sim.walks.spec import WalkSpec


def marks_of(path: Path) -> Counter[int]:
    """Return seed → number of runs of each trial."""
    return (
        Counter(int(line.split()[0]) for line in path.read_text().splitlines())
        if path.exists()
        else Counter()
    )


def by_number(path: Path) -> dict[int, Entry]:
    return {entry.spec["number"]: entry for entry in read_journal(path).values()}


def test_a_cell_is_chosen_by_its_name_and_a_beginning_stands_for_several() -> None:
    cells = tuple(Cell(name, {}) for name in ("talos", "talos, 0.20 m", "g1, 0.10 m", "g1, 0.20 m"))
    study = Study(name="s", cells=cells, arms={"a": {}}, seeds=(1,))
    for given, chosen in (("talos", [0]), ("tal", [0, 1]), ("g1", [2, 3]), ("g1, 0.2", [3])):
        assert list(study.narrowed([given]).cells) == [replace(cells[i], arms=("a",)) for i in chosen]
    with pytest.raises(UnknownNameError, match=r"g1, 0\.10 m"):
        study.narrowed(["g1, 0.11 m"])


def test_runs_each_trial_once_and_finds_it_afterwards(tmp_path: Path) -> None:
    marks, path = tmp_path / "marks", tmp_path / "journal.jsonl"
    trials = [MadeUpTrial(number % 5, marks=str(marks)) for number in range(10)]
    seen: list[SweepSummary] = []
    with ThreadPoolExecutor(2) as pool, Journal(path) as journal:
        first = sweep(trials[:3], journal, executor=pool)
        second = sweep(trials, journal, executor=pool, progress=lambda s: seen.append(replace(s)))
    assert (first.total, first.found, first.run) == (3, 0, 3)
    assert (second.total, second.found, second.run, second.counts) == (5, 3, 2, {"done": 5})
    assert [(s.found, s.run) for s in seen] == [(3, 0), (3, 1), (3, 2)]
    assert marks_of(marks) == dict.fromkeys(range(5), 1)
    assert {number: entry.result["square"] for number, entry in by_number(path).items() if entry.result} == {
        number: number**2 for number in range(5)
    }


def test_whatever_goes_wrong_is_written_down(tmp_path: Path) -> None:
    marks, path = tmp_path / "marks", tmp_path / "journal.jsonl"
    kinds = ["work", "diverge", "raise", "wait"]
    trials = [MadeUpTrial(number, does=does, marks=str(marks)) for number, does in enumerate(kinds)]
    with ThreadPoolExecutor(4) as pool, Journal(path) as journal:
        sweep(trials, journal, executor=pool, timeout=0.1)
        assert sweep(trials, journal, executor=pool, timeout=0.1).run == 0
        again = sweep(trials, journal, executor=pool, timeout=0.1, retry=True)
    assert again.run == 2 and marks_of(marks) == {0: 1, 1: 1, 2: 2, 3: 2}
    entries = by_number(path)
    assert [entries[number].status for number in range(4)] == ["done", "diverged", "crashed", "timeout"]
    assert "ArithmeticError: trial 2 has had enough" in str(entries[2].error)
    assert "0.1 s" in str(entries[3].error)
    assert entries[2].result is None and entries[3].result is None


def test_a_result_of_numpy_is_written_and_one_that_cannot_be_is_a_crash(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    does = ("numpy", "object", "finished", "nothing", "work")
    with ThreadPoolExecutor(1) as pool, Journal(path) as journal:
        sweep([MadeUpTrial(k, does=each) for k, each in enumerate(does)], journal, executor=pool)
        entries = by_number(path)
        assert {entry.spec["number"]: entry for entry in journal.entries.values()} == entries
    assert [entries[k].status for k in range(len(does))] == ["done", "crashed", "crashed", "crashed", "done"]
    assert entries[0].result == {"best": 2, "even": True, "all": [0, 1], "none": None}
    assert "object" in str(entries[1].error) and "finished" in str(entries[2].error)


def test_studies_take_the_numbers_of_numpy_as_specs_do() -> None:
    cells = {
        f"{k}": {"terrain": "stones", "amplitude": np.float64(0.01), "start": np.zeros(3)} for k in range(2)
    }
    seeds = {"first": np.int64(7), "count": np.int64(2)}
    data = {
        "name": "s",
        "base": {"plan": {"distance": np.float32(0.5)}},
        "cells": cells,
        "arms": {"flat": {}},
    }
    study = Study.from_json({**data, "seeds": seeds})
    assert [trial.seed for trial in study.trials()] == [7, 7, 8, 8]
    own = Study(
        name="s",
        base=data["base"],
        cells=tuple(Cell(k, v) for k, v in cells.items()),
        arms={"flat": {}},
        seeds=(7, 8),
    )
    written = json.loads(json.dumps(own.to_json()))
    assert [t.plain for t in Study.from_json(written).trials()] == [t.plain for t in study.trials()]


def test_a_daemonic_process_is_told_to_give_an_executor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(multiprocessing.current_process(), "daemon", True)
    with Journal(tmp_path / "j.jsonl") as journal:
        with pytest.raises(InputError, match="executor"):
            sweep([MadeUpTrial(1)], journal, workers=2)
        with ThreadPoolExecutor(1) as pool:
            assert sweep([MadeUpTrial(1)], journal, executor=pool).counts == {"done": 1}


def test_results_of_other_code_count_only_if_wanted(tmp_path: Path) -> None:
    marks, path = tmp_path / "marks", tmp_path / "journal.jsonl"
    trial = MadeUpTrial(1, marks=str(marks))
    version = {**provenance(), "files": "another"}
    with ThreadPoolExecutor(1) as pool, Journal(path) as journal:
        journal.add(Entry(trial.to_json(), "done", {"square": 1}, None, None, version))
        assert sweep([trial], journal, executor=pool).run == 1
    other = tmp_path / "other.jsonl"
    other.write_bytes(path.read_bytes().splitlines(keepends=True)[0])
    with ThreadPoolExecutor(1) as pool, Journal(other, any_code=True) as journal:
        assert sweep([trial], journal, executor=pool).run == 0
    (own,) = read_journal(path, any_code=True).values()
    assert own.version == provenance() and marks_of(marks) == {1: 1}


@pytest.mark.slow
def test_own_processes_survive_a_trial_that_kills_one(tmp_path: Path) -> None:
    marks, path = tmp_path / "marks", tmp_path / "journal.jsonl"
    kinds = ["work", "die"]
    trials = [MadeUpTrial(number, does=does, marks=str(marks)) for number, does in enumerate(kinds)]
    before = dict(os.environ)
    with Journal(path) as journal:
        sweep(trials, journal, workers=1)
    entries = by_number(path)
    assert [entries[number].status for number in range(2)] == ["done", "crashed"]
    assert "died" in str(entries[1].error)
    assert marks_of(marks) == {0: 1, 1: 2}, "only a trial whose process has died is run again, alone"
    result = entries[0].result
    assert result is not None and result["threads"] == "1"
    assert os.environ.get("OMP_NUM_THREADS") == before.get("OMP_NUM_THREADS")


@pytest.mark.slow
def test_killed_in_the_middle_a_sweep_loses_what_was_in_flight_and_goes_on(tmp_path: Path) -> None:
    marks, path, count = tmp_path / "marks", tmp_path / "journal.jsonl", 8
    support = str(Path(__file__).parents[1] / "support")
    code = f"import sys; sys.path.insert(0, {support!r}); import sweep_trials; sweep_trials.main()"
    process = subprocess.Popen([sys.executable, "-c", code, str(path), str(marks), str(count)])
    try:
        give_up = time.monotonic() + 300.0
        while len(read_journal(path)) < 2 and time.monotonic() < give_up and process.poll() is None:
            time.sleep(0.02)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    done, run = by_number(path), marks_of(marks)
    assert 2 <= len(done) < count
    assert sum(run.values()) - len(done) <= 1, "more was lost than was in flight"
    pids = {int(line.split()[1]) for line in marks.read_text().splitlines()}
    give_up = time.monotonic() + 60.0
    while any(map(alive, pids)) and time.monotonic() < give_up:
        time.sleep(0.05)
    assert not any(map(alive, pids)), "processes outlive their sweep"
    trials = [MadeUpTrial(number, seconds=0.15, marks=str(marks)) for number in range(count)]
    with ThreadPoolExecutor(2) as pool, Journal(path, any_code=True) as journal:  # whoever edits may do so
        summary = sweep(trials, journal, executor=pool)
    assert summary.found == len(done) and summary.run == count - len(done)
    again = marks_of(marks)
    assert all(again[number] == 1 for number in done), "a trial that was written down was run again"
    assert set(by_number(path)) == set(range(count))


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_an_executor_of_a_cluster_will_do(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="needs the extra 'cluster'")
    path = tmp_path / "journal.jsonl"
    trials = [WalkSpec(plan=WalkPlan(distance=0.05), noise="none", seed=seed) for seed in range(2)]
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        cluster_executor(cluster.scheduler_address) as pool,
        Journal(path) as journal,
    ):
        summary = sweep(trials, journal, executor=pool)
    assert summary.counts == {"done": 2}
    here = run_trial(trials[1])
    there = next(entry for entry in read_journal(path).values() if entry.spec["seed"] == 1)
    assert there.result == json.loads(json.dumps(here.result))


# Studies and tables


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few resamples: all signs of eight pairs, and intervals that no test here looks at."""
    monkeypatch.setattr("wbc.sim.studies.intervals.RESAMPLES", 300)


def small_study(**values: Any) -> Study:
    parts: dict[str, Any] = {
        "name": "small",
        "base": {"plan": {"distance": 0.1}},
        "cells": (Cell("flat", {"terrain": "flat"}), Cell("legacy", {"gains": "no_bias"}, ("flat", "soft"))),
        "arms": {"flat": {}, "soft": {"foot": "soft", "stiffness": 5.0}, "rigid": {"foot": "rigid"}},
        "seeds": (1, 2, 3, 4),
    }
    return Study(**(parts | values))


def journal_of(study: Study, outcome: dict[str, list[Any]]) -> dict[str, Entry]:
    """For each arm what became of the seeds, steps or a status, in all cells but 'legacy', which has no walks."""
    entries = {}
    for trial in study.trials():
        value = outcome.get(trial.arm, [])[trial.seed - 1 :][:1] if trial.cell != "legacy" else []
        if not value:
            continue
        status, result = "done", None
        if isinstance(value[0], str):
            status = value[0]
        else:
            done = value[0] == 22
            fall = None if done else {"cause": "left"}
            result = {
                "outcome": "completed" if done else "fell",
                "fall_reason": None if done else "tilt",
                "fall": fall,
                "steps_done": value[0],
                "zmp_error": {"mean": 0.01 * trial.seed if done else None},
            }
        entry = Entry(trial.spec.to_json(), status, result, None, None, provenance())
        entries[entry.key] = entry
    return entries


def test_a_table_of_walks_that_fell_before_their_first_step() -> None:
    """There is no time at risk, so the number of falls has no rate; all the rest of the table stands."""
    study = small_study(cells=(Cell("flat", {}),))
    entries = journal_of(study, {"flat": [22, 22, 22, 22], "soft": [0, 0, 0, 0], "rigid": [0, 22, 0, 0]})
    table = study_table(study, entries)
    soft = table.by_name["flat", "soft"]
    assert soft.steps == 0 and soft.falls == {"sideways": 4} and soft.estimate.mean == 0.0
    (line,) = [line for line in table.markdown().splitlines() if line.startswith("| soft |")]
    assert "| 4 in 0 steps |" in line


@pytest.mark.parametrize(
    ("part", "values"),
    [
        ("seed", (10_000_001, 10_000_002)),
        ("amplitude", (0.0123456, 0.01234561)),
        ("gait.swing_height", (0.05, 0.06)),
    ],
)
def test_rows_are_as_many_as_there_are_values(part: str, values: tuple[float, float]) -> None:
    if part == "seed":
        study = small_study(cells=(Cell("flat", {}),), seeds=values)
    else:
        group, _, name = part.rpartition(".")
        parts = [{group: {name: v}} if group else {"terrain": "stones", name: v} for v in values]
        study = small_study(cells=tuple(Cell(str(k), each) for k, each in enumerate(parts)))
    assert len(set(study_table(study, {}, by=[part]).rows)) == 3, "and the one of all together"


def test_parts_of_a_result_may_have_any_name() -> None:
    study = small_study(cells=(Cell("flat", {}),), arms={"flat": {}}, seeds=(1, 2, 3))
    entries = {}
    for trial in study.trials():
        result = dict.fromkeys(("row", "pair", "value", "cause", "layouts", "families"), trial.seed)
        entry = Entry(trial.spec.to_json(), "done", result, None, None, provenance())
        entries[entry.key] = entry
    for name in ("row", "pair", "value", "cause", "layouts", "families"):
        assert study_table(study, entries, metric=name).by_name["flat", "flat"].estimate.mean == 2.0
    with pytest.raises(UnknownNameError) as raised:
        study_table(study, entries, metric="steps_done")
    assert "pair" in str(raised.value)
    fewer = {key: replace(entry, result={"best": 1.0}) for key, entry in entries.items()}
    with pytest.raises(UnknownNameError) as raised:
        study_table(study, fewer, metric="steps_done")
    assert "best" in str(raised.value) and "pair" not in str(raised.value)


def test_a_table_pairs_what_was_tried_on_the_same_seeds() -> None:
    study = small_study(reference="flat")
    entries = journal_of(
        study, {"flat": [22, 5, 22, "diverged"], "soft": [22, 22, "timeout", 10], "rigid": [3]}
    )
    table = study_table(study, entries)
    cells = table.by_name
    flat, soft, rigid = (cells["flat", arm] for arm in ("flat", "soft", "rigid"))
    assert flat.estimate.n == 3 and flat.estimate.mean == pytest.approx(49 / 3)
    assert flat.difference is None and flat.statuses == {"done": 3, "diverged": 1}
    assert soft.estimate.mean == pytest.approx(18.0)
    assert (
        soft.difference is not None and soft.difference.n == 2 and soft.difference.mean == pytest.approx(8.5)
    )
    assert soft.statuses == {"done": 3, "timeout": 1} and soft.outcomes == {"completed": 2, "fell": 1}
    assert soft.falls == {"sideways": 1} and soft.steps == 54 and soft.clusters == "layouts"
    assert rigid.difference is not None and rigid.difference.mean == pytest.approx(-19.0)
    assert rigid.statuses == {"done": 1, "missing": 3}
    assert ("legacy", "rigid") not in cells and cells["legacy", "flat"].statuses == {"missing": 4}
    json.dumps(table.to_json(), allow_nan=False)


def test_figures_of_a_table_are_those_of_its_walks() -> None:
    """Eight pairs that all differ one way: p = 2 / 2⁸, twice that for two arms; eight falls in 80 steps."""
    study = small_study(cells=(Cell("flat", {}),), seeds=tuple(range(1, 9)))
    table = study_table(study, journal_of(study, {"flat": [22] * 8, "soft": [10] * 8, "rigid": [22] * 8}))
    flat, soft, rigid = (table.by_name["flat", arm] for arm in ("flat", "soft", "rigid"))
    assert (soft.p, rigid.p, flat.p) == (2 / 2**8, 1.0, None)
    assert (soft.p_corrected, rigid.p_corrected) == (pytest.approx(4 / 2**8), 1.0)
    assert soft.steps == 80 and flat.steps == 176 and soft.falls == {"sideways": 8} and flat.falls == {}
    assert soft.completed == (0.0, pytest.approx(1.0 - 0.05 ** (1 / 8)))
    assert flat.completed == (pytest.approx(0.05 ** (1 / 8)), 1.0)
    assert soft.beside == {} and flat.beside == {"zmp_error.mean": pytest.approx(0.045)}
    text = table.markdown()
    assert "| -12 [-12, -12] (8) * |" in text and "| 0 [0, 0] (8) |" in text
    low, high = (stats.chi2.ppf(q, n) / 2.0 / 0.08 for q, n in ((0.025, 16), (0.975, 18)))
    assert f"| 100 [{low:.3g}, {high:.3g}] |" in text and "| 45 |" in text  # per 1,000 steps, mm


@pytest.mark.parametrize("count", by_default([7, 8], 8))
def test_of_eight_families_the_families_are_drawn(count: int) -> None:
    families = ("boards", "ellipsoids", "flat", "floor_tiles", "random", "slats", "sticks", "stones")[:count]
    study = small_study(cells=tuple(Cell(name, {"terrain": name}) for name in families), seeds=(1, 2))
    table = study_table(study, journal_of(study, {"flat": [22, 5], "soft": [22, 22]}))
    last = table.by_name["all", "soft"]
    assert last.clusters == ("families" if count == 8 else "layouts")
    assert last.estimate.layouts == (8 if count == 8 else 2 * count) and last.estimate.n == 2 * count


def test_a_table_of_another_part_of_the_results() -> None:
    study = small_study()
    entries = journal_of(study, {"flat": [22, 22, 5, 22]})
    table = study_table(study, entries, metric="zmp_error.mean", completed_only=True)
    assert table.cells[0].estimate.n == 3 and table.cells[0].estimate.mean == pytest.approx(0.07 / 3)
    assert study_table(study, entries, by=np.zeros(0)) == study_table(study, entries)  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match="zmp_error.mean"):
        study_table(study, entries, metric="zmp_error.men")
    assert "zmp_error.mean (m), completed walks alone: mean" in table.markdown()
    titled = {
        "fall.time": "fall.time (s)",
        "contact_area.std": "contact_area.std (m²)",
        "steps_done": "steps_done",
    }
    assert {part: study.titled(part) for part in titled} == titled
    figure = draw_study(table)
    (axes,) = figure.axes
    assert axes.get_xlabel().startswith("zmp_error.mean (m)") and len(axes.get_yticks()) == len(table.rows)
    with pytest.raises(InputError, match="no 'steps_done'"):
        draw_study(study_table(study, {}))
    frame = study_frame(study, entries)
    assert (
        list(frame.columns[:5]) == ["cell", "arm", "seed", "status", "outcome"] and len(frame) == study.size
    )
    assert frame.iloc[2, :4].tolist() == ["flat", "rigid", 1, "missing"]
    assert frame.iloc[5, :5].tolist() == ["flat", "flat", 2, "done", "completed"]
    own = frame[(frame["cell"] == "flat") & (frame["arm"] == "flat")]["zmp_error.mean"]
    np.testing.assert_array_equal(own, [0.01, 0.02, np.nan, 0.04])
    other = {key: replace(entry, version={"code": "other"}) for key, entry in entries.items()}
    other = {entry.key: entry for entry in other.values()}
    assert study_table(study, other).cells[0].estimate.n == 0


def test_a_table_puts_cells_together() -> None:
    heights = {"low": 0.01, "high": 0.02}
    cells = [Cell(name, {"terrain": "stones", "amplitude": height}) for name, height in heights.items()]
    study = small_study(cells=tuple(cells))
    walks = {"flat": [22, 5, 22, "diverged"], "soft": [22, 22, 10, 10], "rigid": [3, 3, 3, 3]}
    table = study_table(study, journal_of(study, walks), by=["terrain"])
    assert table.rows == ("stones",)
    flat, soft = table.by_name["stones", "flat"], table.by_name["stones", "soft"]
    assert flat.statuses == {"done": 6, "diverged": 2} and flat.estimate.n == 6
    # The ground on which one diverged counts for none, in the means as in the pairs.
    assert soft.estimate.n == 6 and soft.estimate.mean == pytest.approx((22 + 22 + 10) / 3)
    assert soft.difference is not None and soft.difference.mean == pytest.approx((0 + 17 - 12) / 3)

    apart = study_table(study, journal_of(study, walks), by=["amplitude", "plan.distance"])
    assert apart.rows == ("amplitude 0.01, distance 0.1", "amplitude 0.02, distance 0.1", "all")
    assert apart.by_name["all", "soft"].estimate == soft.estimate
    assert study_table(study, journal_of(study, walks)).rows == ("low", "high", "all")
    with pytest.raises(UnknownNameError, match="swing_hight"):
        study_table(study, {}, by=["gait.swing_hight"])


def test_studies_are_data() -> None:
    study = small_study(reference="soft", metric="distance")
    assert Study.from_json(json.loads(json.dumps(study.to_json()))) == study
    seeds = small_study(seeds=(100, 101, 102))
    assert Study.from_json(seeds.to_json() | {"seeds": {"first": 100, "count": 3}}) == seeds
    assert [(t.cell, t.arm, t.seed) for t in study.trials()][:6] == [
        ("flat", "flat", 1),
        ("flat", "soft", 1),
        ("flat", "rigid", 1),
        ("legacy", "flat", 1),
        ("legacy", "soft", 1),
        ("flat", "flat", 2),
    ]
    part = study.narrowed(["leg"], ["flat", "rigid"], 2)
    assert [(t.cell, t.arm, t.seed) for t in part.trials()] == [("legacy", "flat", 1), ("legacy", "flat", 2)]
    assert merged({"a": {"b": 1, "c": 2}}, {"a": {"c": 3}}) == {"a": {"b": 1, "c": 3}}


OF_A_FILE = """
from __future__ import annotations
from dataclasses import asdict, dataclass
from wbc.sim.studies.outcomes import Outcome, TrialKind

@dataclass(frozen=True)
class Square:
    number: int
    seed: int = 0
    kind: str = "square"

    def to_json(self):
        return {**asdict(self)}

def run(spec, check):
    return Outcome("done", {"square": spec.number ** 2})

SQUARE = TrialKind(lambda data: Square(**data), run, metric="square")
FORGETFUL = TrialKind(lambda data: Square(data["number"]), run)
"""


def study_of(kind: str) -> Study:
    return Study(
        name="s",
        kind=kind,
        cells=(Cell("c", {"number": 3}),),
        arms={"a": {}, "b": {"number": 4}},
        seeds=(1, 2),
    )


@pytest.mark.slow
def test_a_kind_of_trial_in_a_file_is_run_in_processes_that_have_not_imported_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor the program, where that is no file."""
    monkeypatch.setattr(sys.modules["__main__"], "__file__", "<stdin>", raising=False)
    file, path = tmp_path / "own.py", tmp_path / "journal.jsonl"
    file.write_text(OF_A_FILE)
    study = Study.from_json(study_of(f"{file}:SQUARE").to_json())
    with Journal(path) as journal:
        sweep([trial.spec for trial in study.trials()], journal, workers=1)
    table = study_table(study, read_journal(path)).markdown()
    assert "| c | 9 (2) | 16 (2) |" in table
    with Journal(path) as journal:
        assert sweep([trial.spec for trial in study.trials()], journal).run == 0
        file.write_text(OF_A_FILE.replace("** 2", "** 3"))
        summary = sweep([t.spec for t in study.trials()], journal, executor=ThreadPoolExecutor(1))
        assert (summary.found, summary.run) == (0, 4)
        assert {entry.result["square"] for entry in journal.entries.values() if entry.result} == {
            9,
            16,
            27,
            64,
        }


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("CUBE", r"no trial kind 'CUBE' of .*own\.py"),
        ("run", "must be a wbc.sim.studies.TrialKind"),
        ("FORGETFUL", "must keep the kind"),
        ("SQUARE#0123", "has changed"),
    ],
)
def test_a_kind_of_trial_in_a_file_that_is_none_is_refused(name: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OF_A_FILE)
    with pytest.raises(InputError, match=message):
        list(study_of(f"{tmp_path / 'own.py'}:{name}").trials())
