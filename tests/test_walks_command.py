"""`wbc walk` and `wbc study`."""

from __future__ import annotations

import csv
import json
import re
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
        (["walk", "--push", "impuls=0.1"], "impulse"),
        (["walk", "--param", "foo=2"], "parameter of terrain 'stones'"),
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
        (["study", "plot", "stiffness", "--journal", "empty.jsonl", "-o", "a.png"], "35 rows .* 7 at most"),
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
