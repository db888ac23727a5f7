"""Command lines that cannot be used: one line on standard error that names what is wrong, exit code 2, nothing else."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from mjcf_biped import biped

from wbc.app.cli import BAD_INPUT, main
from wbc.app.log.header import FORMAT
from wbc.app.log.signals import Signals
from wbc.app.log.writer import LogWriter
from wbc.sim import WalkSpec
from wbc.sim.studies import Entry, Study
from wbc.sim.studies.provenance import provenance

STUDY = Path(__file__).resolve().parents[2] / "examples/studies/flat_floor.json"

REFUSED = {
    "stnd": "stand",
    "stand --seconds long": "--seconds",
    "stand --mode velocity": "torque",
    "stand --control-period 0.0015": "control period",
    "stand --port 7000": "--view",
    "stand --port 7000 --view mujoco": "workbench",
    "stand --view window": "mujoco",
    "stand --view": "Choose from: meshcat, workbench, rerun, mujoco",
    "stand --workbench": "--workbench",
    "walk --drive --view meshcat": "workbench",
    "view run.arrow --speed 2": "film",
    "plot": "log",
    "plot empty.jsonl com/estimated": "empty.jsonl",
    "walk --spec nothing.json": "nothing.json",
    "walk --spec friza": "frizza",
    "walk --policy model --foot rigid": "model",
    "walk --set swing_heigth=0.06": "swing_height",
    "walk --seconds 5": "--drive",
    "walk --param foo=2": "foo",
    "study run STUDY --journal .": "folder",
    "study run --journal j": "study",
    "study table STUDY --journal j --separate": "separate",
    "study table STUDY --journal empty.jsonl -o a.png": ".csv",
    "study show STUDY --arm hard": "soft",
    "study show one.jsonl": "--journal one.jsonl",
    "walk --spec one.jsonl": "--journal one.jsonl",
    "study run nowhere.json --journal j": "nowhere.json",
    "foot press --foot rigid --stiffness 5": "stiffness",
    "foot press --robot g1 --foot-param width=0.3": "wide",
    "terrain stone": "stones",
    "terrain iso8608 --param high=fast": "high",
    "terrain iso8608 --param high=3 --param high=4": "high",
    "terrain --plot a.doc": "a.doc",
    "terrain --amplitude 0.1": "family",
    "robots check nowhere.xml": "nowhere.xml",
    "robots check biped.xml --lock waist": "waist",
    "robots check biped.xml --left lft_foot": "left_foot",
    "robots check biped.xml -o biped.xml": "biped.xml",
    "robots add biped.xml": "check",
}
"""Command line → what its message names."""

FILES = {
    "walk.toml": ("swing = 0.1", "swing"),
    "changes.toml": ("[changes]\ndcm_q = 1", "dcm_p"),
    "colon.toml": ("step_length: 0.1", "TOML"),
    "equals.json": ("step_length = 0.1", "JSON"),
    "list.json": ("[1]", "object"),
    "deep.json": ("[" * 100_000, "JSON"),
    "twice.json": ('{"seed": 1, "seed": 2}', "seed"),
    "drive.toml": ("plan.drive = [[1, 0.1, 0, 0]]", "stand"),
}
"""Files that hold no walk → content, and what the message names."""


def check_refused(words: list[str], named: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == BAD_INPUT
    said = capsys.readouterr()
    lines = [line for line in said.err.splitlines() if line.startswith("wbc: ")]
    assert len(lines) == 1 and named in lines[0] and not said.out and "Traceback" not in said.err


@pytest.mark.parametrize("line", REFUSED)
def test_a_command_line_is_refused_and_writes_nothing(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("empty.jsonl").touch()
    Path("biped.xml").write_text(biped())
    Path("one.jsonl").write_text('{"clock":null}\n')
    words = [word.replace("STUDY", str(STUDY)) for word in line.split()]
    check_refused(words, REFUSED[line], capsys)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["biped.xml", "empty.jsonl", "one.jsonl"]


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_holds_no_walk_is_refused(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, named = FILES[name]
    (tmp_path / name).write_text(text)
    check_refused(["walk", "--spec", str(tmp_path / name)], named, capsys)


RESULTS: tuple[tuple[dict[str, Any], list[str], str], ...] = (
    ({"steps_done": 10**400, "outcome": "fell"}, [], "'steps_done' of the results must be numbers"),
    ({"steps_done": 3, "outcome": "fell", "impact": "hard"}, [], "'impact' of the results must be numbers"),
    (
        {"steps_done": 3, "outcome": "fell"},
        ["--metric", "outcome"],
        "'outcome' of the results must be numbers",
    ),
    ({"steps_done": 3}, ["--completed"], "no part 'outcome' of a result"),
)
"""Results of a trial in a journal, options of its table, and what its message names beside the file."""


@pytest.mark.parametrize(("result", "options", "named"), RESULTS)
def test_a_value_of_a_journal_that_is_no_number_is_refused(
    result: dict[str, Any], options: list[str], named: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plain = {"name": "s", "cells": {"a": {}}, "arms": {"b": {}}, "seeds": [1], "metric": "steps_done"}
    (tmp_path / "study.json").write_text(json.dumps(plain))
    (trial,) = Study.from_json(plain).trials()
    entry = Entry(trial.spec.to_json(), "done", result, {}, None, {})
    (tmp_path / "results.jsonl").write_bytes(entry.line())
    words = ["study", "table", str(tmp_path / "study.json"), "--any-code", *options]
    check_refused([*words, "--journal", str(tmp_path / "results.jsonl")], f"results.jsonl: {named}", capsys)


CODE = """
import wbc
from wbc.sim.studies.outcomes import Outcome, TrialKind
open("RAN", "w").close()

class Spec:
    def __init__(self, data):
        self.kind, self.data = data["kind"], data

    def to_json(self):
        return dict(self.data)

KIND = TrialKind(Spec, lambda spec, check: Outcome("done", {"steps_done": 1}))
Loop = wbc.Plant
"""

READ = {
    "study show .": 0,
    "study show kind.json": BAD_INPUT,
    "study show loop.json": BAD_INPUT,
    "study show loop.json --arm a --seeds 1": BAD_INPUT,
    "study table plain.json --journal kind.jsonl": 0,
    "study table plain.json --journal loop.jsonl --any-code": 0,
    "study table kind.json --journal kind.jsonl": BAD_INPUT,
    "study plot plain.json --journal loop.jsonl": BAD_INPUT,  # of which it has nothing to draw
    "study run --journal kind.jsonl --key KEY": BAD_INPUT,
    "walk --spec walk.toml": BAD_INPUT,
    "walk --repeat log.arrow": BAD_INPUT,
}
"""Command line that reads data which name code → its exit code."""


@pytest.fixture
def code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return the key of a trial whose kind is code in `own.py`, with files that name it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("wbc.base.registry._allowed", set())
    Path("own.py").write_text(CODE)
    cells: dict[str, Any] = {"name": "s", "cells": {"c": {}}, "arms": {"a": {}}, "seeds": [1]}
    studies = {"plain": {}, "kind": {"kind": "own.py:KIND"}, "loop": {"base": {"loop": "own.py:Loop"}}}
    for name, parts in studies.items():
        Path(f"{name}.json").write_text(json.dumps(cells | parts))
    Path("walk.toml").write_text('loop = "own.py:Loop"')
    own = Entry({"kind": "own.py:KIND", "seed": 1}, "done", {"steps_done": 1}, None, None, provenance())
    of_loop = replace(own, spec={"kind": "walk", "loop": "own.py:Loop", "seed": 1})
    Path("kind.jsonl").write_bytes(own.line())
    Path("loop.jsonl").write_bytes(of_loop.line())
    recorded = WalkSpec().to_json() | {"loop": "own.py:Loop"}
    signals, writer = Signals(), LogWriter("log.arrow")
    signals.one("time", "s", "", lambda tick: 0.0, "double")
    writer.begin(signals, {"format": FORMAT, "spec": recorded})
    writer.row[0] = 0.0
    writer.commit([])
    writer.close()
    return own.key


@pytest.mark.parametrize("line", READ)
def test_reading_runs_no_code_that_data_name(line: str, code: str) -> None:
    assert main([word.replace("KEY", code) for word in line.split()]) == READ[line]
    assert not Path("RAN").exists()


@pytest.mark.parametrize(
    "line",
    [
        "study show kind.json --code own.py",
        pytest.param("study run kind.json --journal new.jsonl", marks=pytest.mark.slow),
    ],
)
@pytest.mark.usefixtures("code")
def test_code_that_is_named_or_run_as_a_study_is_run(line: str) -> None:
    assert main(line.split()) == 0
    assert Path("RAN").exists()
