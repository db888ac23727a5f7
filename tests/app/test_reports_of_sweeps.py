"""Reports of studies: trials without a result, first failures, keys of a journal, trials that are the same."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from wbc.app.cli import BAD_INPUT, RAN, main
from wbc.app.commands import study as run_command
from wbc.sim.studies.journal import Entry
from wbc.sim.studies.provenance import provenance
from wbc.sim.studies.study import Study

Said = pytest.CaptureFixture[str]


# ---- studies --------------------------------------------------------------------------------------------------------

PLAIN = {"name": "s", "cells": {"a": {}}, "arms": {"b": {}}, "seeds": list(range(8)), "metric": "steps_done"}


def test_trials_without_a_result_are_named_with_their_commands(tmp_path: Path) -> None:
    study = Study.from_json(PLAIN)
    trials = list(study.trials())
    entries = [
        Entry(trial.plain, status, {"steps_done": 1} if status == "done" else None, None, None, provenance())
        for trial, status in zip(trials, ("done", "crashed", "timeout"), strict=False)
    ]
    found = run_command.reruns(study, {entry.key: entry for entry in entries}, tmp_path / "a b.jsonl")
    assert [(each["status"], each["seed"]) for each in found] == [("crashed", 1), ("timeout", 2)]
    assert found[0]["command"].endswith(f"--key {entries[1].key[: run_command.KEY_LENGTH]}")
    assert "'" in found[0]["command"], "a name with a space is one word"


@pytest.mark.parametrize("failures", [0, 1, 5, 7])
def test_the_text_of_a_sweep_names_the_first_failures(
    failures: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    (tmp_path / "s.json").write_text(json.dumps(PLAIN))
    failed = [
        {"command": f"run {i}", "status": "crashed", "cell": "a", "arm": "b", "seed": i}
        for i in range(failures)
    ]
    counts = {"done": 8 - failures} | ({"crashed": failures} if failures else {})
    summary = SimpleNamespace(
        counts=counts,
        per_hour=36.4,
        total=8,
        found=1,
        run=7,
        seconds=12.4,
        to_json=lambda: {"counts": counts},
    )
    monkeypatch.setattr(run_command, "run_trials", lambda *_, **__: summary)
    monkeypatch.setattr(run_command, "read_journal", lambda *_, **__: {})
    monkeypatch.setattr(run_command, "reruns", lambda *_: failed)
    words = ["study", "run", str(tmp_path / "s.json"), "--journal", str(tmp_path / "j.jsonl")]
    assert main(words) == RAN
    lines = capsys.readouterr().out.splitlines()
    assert "8 trials, 1 were in" in lines[0] and lines[0].endswith("7 run in 12 s (36 an hour)")
    assert [line.split()[1] for line in lines if "# crashed" in line] == [
        str(i) for i in range(min(failures, 5))
    ]
    assert sum("--json" in line for line in lines) == (failures > 5) and (
        failures < 7 or "and 2 more" in lines[-1]
    )
    assert main([*words, "--json"]) == RAN
    assert json.loads(capsys.readouterr().out)["without_result"] == failed


def test_a_key_of_a_journal_is_given_as_far_as_it_is_the_only_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    trials = list(Study.from_json(PLAIN | {"seeds": list(range(30))}).trials())
    entries = [Entry(trial.spec.to_json(), "done", {}, None, None, {}) for trial in trials]
    journal = tmp_path / "j.jsonl"
    journal.write_bytes(b"".join(entry.line() for entry in entries))
    outcome = SimpleNamespace(status="done", result={}, error=None, clock=None)
    monkeypatch.setattr(run_command, "run_trial", lambda *_: outcome)
    first = [entry.key[0] for entry in entries]
    common = next(letter for letter in first if first.count(letter) > 1)
    words = ["study", "run", "--journal", str(journal), "--key"]
    assert main([*words, common]) == BAD_INPUT
    assert f"{first.count(common)} keys of the journal begin with '{common}'" in capsys.readouterr().err
    entry = entries[first.index(common)]
    assert main([*words, entry.key]) == RAN
    assert f"{entry.key}: done, the same as in the journal (done)" in capsys.readouterr().out
    assert main([*words, "none"]) == BAD_INPUT
    assert "key 'none' of the journal" in capsys.readouterr().err


def test_a_trial_is_the_same_when_status_and_result_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    trial = next(iter(Study.from_json(PLAIN).trials()))
    entry = Entry(trial.spec.to_json(), "done", {"steps_done": 1}, None, None, {})
    journal = tmp_path / "j.jsonl"
    journal.write_bytes(entry.line())
    words = ["study", "run", "--journal", str(journal), "--key", entry.key[:6]]
    for status, result, same in (
        ("done", {"steps_done": 1}, True),
        ("done", {"steps_done": 2}, False),
        ("crashed", {"steps_done": 1}, False),
        ("crashed", None, False),
    ):
        outcome = SimpleNamespace(
            status=status, result=result, error="one\ntwo" if result is None else None, clock=None
        )
        monkeypatch.setattr(run_command, "run_trial", lambda *_, outcome=outcome: outcome)
        assert main(words) == RAN
        said = capsys.readouterr().out
        assert ("not the same" not in said) is same
        assert ("steps_done" in said) is (result is not None) and ("two" in said) is (result is None)
        assert main([*words, "--json"]) == RAN
        assert json.loads(capsys.readouterr().out)["same"] is same
