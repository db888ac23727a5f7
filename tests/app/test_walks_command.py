"""`wbc walk` and `wbc study`."""

from __future__ import annotations

import csv
import json
import math
import re
import tomllib
from pathlib import Path

import pytest

from wbc.app.cli import BAD_INPUT, RAN, main


def test_a_walk_from_the_command_line_is_the_same_from_its_own_output(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["walk", "--distance", "0.05", "--noise", "none", "--set", "dcm_p=4", "--json"]) == RAN
    first = capsys.readouterr().out
    (tmp_path / "walk.json").write_text(first)
    data = json.loads(first)
    assert data["spec"]["changes"] == {"gains.dcm_p": [4.0, 4.0]} and data["steps_planned"] == 2
    assert main(["walk", "--spec", str(tmp_path / "walk.json"), "--json"]) == RAN
    again = json.loads(capsys.readouterr().out)
    clock = ("wall_s", "real_time_factor", "tick_us", "physics_share", "decision_us")
    assert {k: v for k, v in data.items() if k not in clock} == {
        k: v for k, v in again.items() if k not in clock
    }


CONFIG = """
foot = "soft"
distance = 0.05
noise = "none"
swing-height = 0.07
single_support = 0.7

[set]
dcm_p = 4
walk.phases.lift_off = 0.2

[push]
impulse = 0.05
direction = 90
step = 2
"""


def test_gait_and_gains_from_a_file_and_what_is_given_comes_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "gait.toml"
    file.write_text(CONFIG)
    assert (
        main(["walk", "--config", str(file), "--set", "gains.dcm-p=5", "--single-support", "0.8", "--json"])
        == RAN
    )
    spec = json.loads(capsys.readouterr().out)["spec"]
    assert spec["changes"] == {"gains.dcm_p": [5.0, 5.0], "walk.phases.lift_off": 0.2}
    assert spec["gait"]["swing_height"] == 0.07 and spec["gait"]["single_support"] == 0.8
    assert spec["foot"] == "soft" and spec["noise"] == "none" and spec["plan"]["distance"] == 0.05
    (push,) = spec["pushes"]
    assert push["step"] == 2 and push["direction"] == pytest.approx(math.pi / 2)
    (tmp_path / "gait.json").write_text(json.dumps(tomllib.loads(CONFIG)))
    assert main(["walk", "--config", str(tmp_path / "gait.json"), "--json"]) == RAN
    other = json.loads(capsys.readouterr().out)["spec"]
    assert other["changes"]["gains.dcm_p"] == [4.0, 4.0] and other["gait"]["single_support"] == 0.7
    assert other["pushes"] == spec["pushes"]
    file.write_text("set = ['dcm_p=4', 'dcm_d=0.1']\npush = ['impulse=0.1,step=1', 'impulse=0.05,step=2']")
    words = ["walk", "--config", str(file), "--distance", "0.05", "--set", "dcm_p=5", "--json"]
    assert main(words) == RAN
    third = json.loads(capsys.readouterr().out)["spec"]
    assert third["changes"]["gains.dcm_p"] == [5.0, 5.0] and third["changes"]["gains.dcm_d"] == [0.1, 0.1]
    assert [push["step"] for push in third["pushes"]] == [1, 2]


def test_a_preset_is_the_papers_walk_and_what_is_given_comes_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["walk", "--preset", "frizza", "--terrain", "flat", "--distance", "0.05", "--json"]
    assert main(words) == RAN
    spec = json.loads(capsys.readouterr().out)["spec"]
    assert (spec["foot"], spec["gains"], spec["policy"]) == ("paper", "legacy", "model")
    assert (spec["changes"]["gains.dcm_p"], spec["changes"]["gains.dcm_d"]) == ([3.4, 3.4], [2.1, 2.1])
    assert spec["changes"]["stiffness.decide_at"] == 0.75
    assert spec["gait"]["apex"] == 0.5 and spec["gait"]["step_length"] == 0.145
    file = tmp_path / "mine.toml"
    file.write_text("apex = 0.4\nfoot = 'soft'\n[set]\ndcm_d = 1.0\n")
    assert main([*words, "--config", str(file), "--set", "dcm_p=5", "--foot", "flat"]) == RAN
    spec = json.loads(capsys.readouterr().out)["spec"]
    assert (spec["foot"], spec["gait"]["apex"]) == ("flat", 0.4)
    assert (spec["changes"]["gains.dcm_p"], spec["changes"]["gains.dcm_d"]) == ([5.0, 5.0], [1.0, 1.0])
    assert main(["walk", "--preset", "friza"]) == BAD_INPUT
    assert "did you mean 'frizza'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.toml", "swing = 0.1", "swing"),
        ("a.toml", "seed = 1.5", "--seed must be a whole number, got 1.5"),
        ("a.toml", "seed = 'x'", "seed"),
        ("a.toml", "[gait]\nstep_length = 0.1", r"\[gait\] .* choices: .*set"),
        ("a.toml", "[set]\ndcm_q = 1", "dcm_p"),
        ("a.toml", "step_length: 0.1", "not TOML"),
        ("a.json", "step_length = 0.1", "not JSON"),
        ("a.json", "[1]", "must hold options"),
        ("a.json", '{"seed": 1, "seed": 2}', "'seed' is given twice"),
        ("a.conf", "seed = 1", "must end in .toml or .json"),
        ("a.toml", "config = 'b.toml'", "cannot name another"),
        ("a.toml", "spec = 'walk.json'", "leave --config out"),
        ("a.toml", "set = 4", "must be a table"),
        ("a.json", "", "not JSON"),
    ],
)
def test_bad_files_of_options_are_refused(
    name: str, text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_text(text)
    assert main(["walk", "--config", str(tmp_path / name)]) == BAD_INPUT
    assert re.search(message, capsys.readouterr().err)


def test_a_fall_is_a_result(capsys: pytest.CaptureFixture[str]) -> None:
    push = "impulse=1.2,direction=90,step=1,phase=0.3"
    assert main(["walk", "--distance", "0.05", "--push", push]) == RAN
    assert "FELL" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["walk", "--step-length", "0.5"], "within reach"),
        (["walk", "--set", "dcm_q=1"], "dcm_p"),
        (["walk", "--spec", "nothing.json"], "cannot be read"),
        (["walk", "--spec", "nothing.json", "--foot", "soft"], "leave --foot out"),
        (["walk", "--spec", "nothing.json", "--foot", "variable"], "leave --foot out"),
        (["walk", "--spec", "nothing.json", "--swing-height", "0.06"], "leave --swing-height out"),
        (["walk", "--config", "nothing.toml"], "cannot be read"),
        (["walk", "--seed", "1.5"], "--seed must be a whole number, got 1.5"),
        (["walk", "--velocity", "0.1", "0", "0", "--steps", "2.5"], "--steps must be a whole number"),
        (["walk", "--seed", "one"], "one"),
        (["walk", "--push", "impuls=0.1"], "impulse"),
        (["walk", "--param", "foo=2"], "no parameter of the terrain 'stones' 'foo'"),
        (["study", "run", "flat_floor", "--journal", "."], "folder"),
        (["study", "run", "flat_flor", "--journal", "j"], "flat_floor"),
        (["study", "table", "flat_floor", "--journal", "nothing.jsonl"], "no journal"),
        (
            ["study", "table", "flat_floor", "--journal", "empty.jsonl", "--by", "gait.hight"],
            "gait.swing_height",
        ),
        (["study", "show", "flat_floor", "--arm", "hard"], "soft"),
        (["study", "plot", "flat_floor", "--journal", "empty.jsonl", "-o", "a.txt"], r"\.png"),
        (["study", "plot", "flat_floor", "--journal", "empty.jsonl", "-o", "a.png"], "nothing to draw"),
        (["study", "plot", "arches", "--journal", "empty.jsonl", "-o", "a.png"], "18 rows .* 7 at most"),
        (["study", "export", "flat_floor", "--journal", "empty.jsonl", "-o", "a.xls"], r"\.csv"),
        (["study", "swings", "flat_floor", "--journal", "empty.jsonl"], "no walk .* variable stiffness"),
    ],
)
def test_the_command_refuses(
    words: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("empty.jsonl").touch()
    assert main(words) == BAD_INPUT
    captured = capsys.readouterr()
    assert re.search(message, captured.err) and captured.err.count("\n") == 1 and not captured.out


def test_a_study_that_names_a_cell_twice_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of two values of one name JSON's reader keeps the last: a cell, and its walks, would be missing in silence."""
    path = tmp_path / "study.json"
    cells = '{"a": {"terrain": "flat"}, "a": {"terrain": "stones"}}'
    path.write_text(f'{{"name": "s", "cells": {cells}, "arms": {{"b": {{}}}}, "seeds": [1]}}')
    assert main(["study", "show", str(path)]) == BAD_INPUT
    assert "'a' is given twice" in capsys.readouterr().err


def test_a_study_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study, journal = tmp_path / "study.json", tmp_path / "journal.jsonl"
    data = {
        "name": "small",
        "base": {"plan": {"distance": 0.05}},
        "cells": {"level": {"terrain": "flat"}},
        "arms": {"flat": {"foot": "flat"}, "variable": {"foot": "variable", "policy": "fixed"}},
        "seeds": [1, 2],
    }
    study.write_text(json.dumps(data))
    assert main(["study", "run", str(study), "--journal", str(journal), "--seeds", "1", "--json"]) == RAN
    assert json.loads(capsys.readouterr().out)["counts"] == {"done": 2}
    assert main(["study", "table", str(study), "--journal", str(journal)]) == RAN
    assert "| level | 2 (1) | 2 (1) |" in capsys.readouterr().out
    figure = tmp_path / "steps.png"
    assert main(["study", "plot", str(study), "--journal", str(journal), "-o", str(figure)]) == RAN
    assert figure.stat().st_size > 5000 and capsys.readouterr().out == f"{figure}\n"
    table = tmp_path / "walks.csv"
    assert main(["study", "export", str(study), "--journal", str(journal), "-o", str(table)]) == RAN
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["arm"] for row in rows] == ["flat", "variable"] * 2
    assert [row["status"] for row in rows] == ["done", "done", "missing", "missing"]
    assert (
        rows[0]["steps_done"] == "2" and float(rows[0]["zmp_error.mean"]) > 0.0 and not rows[2]["steps_done"]
    )
    capsys.readouterr()
    assert main(["study", "swings", str(study), "--journal", str(journal), "--json"]) == RAN
    swings = json.loads(capsys.readouterr().out)["rows"]["level"]
    assert (swings["walks"], swings["swings"], swings["reached"]) == (1, 2, 1.0)
    assert main(["study", "show", "flat_floor", "--cell", "talos"]) == RAN
    assert set(json.loads(capsys.readouterr().out)["cells"]) == {"talos"}
