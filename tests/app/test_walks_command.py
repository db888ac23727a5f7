"""`wbc walk` and `wbc study`."""

from __future__ import annotations

import csv
import json
import math
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from wbc.app.cli import BAD_INPUT, RAN, main
from wbc.app.commands import walk as walk_command
from wbc.core.errors import InputError
from wbc.sim import WalkSpec


def test_a_walk_from_the_command_line_is_the_same_from_its_own_output(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    level = ("--terrain", "flat", "--foot", "flat", "--noise", "none", "--set", "single_support=0.5")
    assert main(["walk", "--distance", "0.05", *level, "--set", "dcm_p=4", "--json"]) == RAN
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


PART = """
foot = "soft"
noise = "none"
plan = { distance = 0.05 }
gait = { swing_height = 0.07, single_support = 0.7 }
changes = { dcm_p = 4, "walk.phases.lift_off" = 0.2 }
pushes = [{ impulse = 0.05, direction = 1.5, step = 2 }]
"""


@pytest.fixture
def spec_of(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Any]:
    """Return the spec that words of the command line make, as JSON; nothing walks."""
    made: list[Any] = []

    def stop(spec: WalkSpec) -> None:
        made.append(json.loads(json.dumps(spec.to_json())))
        raise InputError("it would walk now")

    def spec_of(*words: str) -> Any:
        monkeypatch.setattr(walk_command, "WalkTrial", stop)
        assert main(["walk", *words]) == BAD_INPUT
        assert capsys.readouterr().err.endswith("wbc: it would walk now\n")
        return made.pop()

    return spec_of


def test_a_part_of_a_walk_from_a_file_and_what_is_given_comes_first(
    tmp_path: Path, spec_of: Callable[..., Any]
) -> None:
    file = tmp_path / "part.toml"
    file.write_text(PART)
    given = ("--set", "gains.dcm-p=5", "--set", "single_support=0.8", "--set", "noise-seed=3")
    spec = spec_of("--spec", str(file), *given)
    assert spec["changes"] == {"gains.dcm_p": [5.0, 5.0], "walk.phases.lift_off": 0.2}
    assert spec["gait"]["swing_height"] == 0.07 and spec["gait"]["single_support"] == 0.8
    assert spec["foot"] == "soft" and spec["noise_seed"] == 3 and spec["plan"]["distance"] == 0.05
    assert spec["terrain"] == "stones" and spec["amplitude"] == 0.02
    (push,) = spec["pushes"]
    assert push["step"] == 2 and push["direction"] == 1.5
    (tmp_path / "part.json").write_text(json.dumps(tomllib.loads(PART)))
    push_words = ("--push", "impulse=0.05,direction=90,step=1", "--push", "impulse=0.01,step=2")
    other = spec_of("--spec", str(tmp_path / "part.json"), *push_words, "--velocity", "0.1", "0", "0")
    assert other["changes"]["gains.dcm_p"] == [4.0, 4.0] and other["gait"]["single_support"] == 0.7
    assert [push["step"] for push in other["pushes"]] == [1, 2]
    assert other["pushes"][0]["direction"] == pytest.approx(math.pi / 2)
    assert other["plan"] == {"velocity": [0.1, 0.0, 0.0], "steps": 22}


def test_a_policy_alone_brings_the_sole_that_it_sets(spec_of: Callable[..., Any]) -> None:
    given = ((), ("--policy", "model"), ("--gait", "stepping"), ("--gait", "stepping", "--foot", "soft"))
    assert [spec_of(*words)["foot"] for words in given] == ["long_arch", "variable", "rigid", "soft"]
    assert main(["walk", "--policy", "model", "--foot", "rigid"]) == BAD_INPUT


def test_the_preset_is_the_papers_walk_and_what_is_given_comes_first(
    capsys: pytest.CaptureFixture[str], spec_of: Callable[..., Any]
) -> None:
    words = ["--spec", "frizza", "--terrain", "flat", "--distance", "0.05"]
    spec = spec_of(*words)
    assert (spec["foot"], spec["gains"], spec["policy"]) == ("paper", "frizza", "model")
    assert spec["changes"]["stiffness.decide_at"] == 0.75
    assert spec["gait"]["apex"] == 0.5 and spec["gait"]["step_length"] == 0.145
    spec = spec_of(*words, "--set", "dcm_p=5", "--set", "apex=0.4", "--foot", "flat")
    assert (spec["foot"], spec["gait"]["apex"]) == ("flat", 0.4)
    assert spec["changes"]["gains.dcm_p"] == [5.0, 5.0] and "gains.dcm_d" not in spec["changes"]
    assert main(["walk", "--spec", "friza"]) == BAD_INPUT
    assert "did you mean 'frizza'" in capsys.readouterr().err


def test_another_value_drops_what_belonged_to_the_one_of_the_file(
    tmp_path: Path, spec_of: Callable[..., Any]
) -> None:
    file = tmp_path / "walk.json"
    random = ("--terrain", "random", "--param", "cutoff=0.1", "--amplitude", "0.01", "--distance", "0.05")
    whole = spec_of(*random, "--policy", "fixed", "--policy-param", "stiffness=5")
    file.write_text(json.dumps(whole))
    assert spec_of("--spec", str(file)) == whole
    other = spec_of("--spec", str(file), "--terrain", "flat", "--foot", "flat")
    assert "policy" not in other and set(other["terrain_params"]) == {"ramp"} and other["amplitude"] == 0.0


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.toml", "swing = 0.1", "swing"),
        ("a.toml", "[changes]\ndcm_q = 1", "dcm_p"),
        ("a.toml", "step_length: 0.1", "not TOML"),
        ("a.json", "step_length = 0.1", "not JSON"),
        ("a.json", "[1]", "must hold a JSON object"),
        ("a.json", '{"seed": 1, "seed": 2}', "'seed' is given twice"),
        ("a.json", '{"spec": [1]}', "must be an object"),
        ("a.toml", "plan.drive = [[1, 0.1, 0, 0]]", "ends with a stand"),
    ],
)
def test_files_that_hold_no_walk_are_refused(
    name: str, text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_text(text)
    assert main(["walk", "--spec", str(tmp_path / name)]) == BAD_INPUT
    assert re.search(message, capsys.readouterr().err)


def test_a_fall_is_a_result(capsys: pytest.CaptureFixture[str]) -> None:
    push = "impulse=1.2,direction=90,step=1,phase=0.3"
    assert main(["walk", "--distance", "0.05", "--push", push]) == RAN
    assert "FELL" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["walk", "--spec", "nothing.json"], "cannot be read"),
        (["walk", "--set", "swing_heigth=0.06"], "swing_height"),
        (["walk", "--seconds", "5"], "give --drive"),
        (["walk", "--seed", "1.5"], "--seed must be a whole number, got 1.5"),
        (["walk", "--velocity", "0.1", "0", "0", "--steps", "2.5"], "--steps must be a whole number"),
        (["walk", "--push", "impuls=0.1"], "impulse"),
        (["walk", "--param", "foo=2"], "no parameter of the terrain 'stones' 'foo'"),
        (["study", "run", "flat_floor", "--journal", "."], "folder"),
        (["study", "run", "--journal", "j"], "give a study to run"),
        (["study", "show", "flat_floor", "--set", "height=2"], "'dataset' alone has a size"),
        (["study", "table", "flat_floor", "--journal", "j", "--separate"], "no option of --of arms"),
        (["study", "run", "flat_flor", "--journal", "j"], "flat_floor"),
        (["study", "table", "flat_floor", "--journal", "nothing.jsonl"], "no journal"),
        (
            ["study", "table", "flat_floor", "--journal", "empty.jsonl", "--by", "gait.hight"],
            "gait.swing_height",
        ),
        (["study", "show", "flat_floor", "--arm", "hard"], "soft"),
        (["study", "table", "flat_floor", "--journal", "empty.jsonl", "-o", "a.txt"], r"\.png"),
        (["study", "table", "flat_floor", "--journal", "empty.jsonl", "-o", "a.png"], "nothing to draw"),
        pytest.param(
            ["study", "table", "authority", "--journal", "empty.jsonl", "-o", "a.png"],
            "18 rows .* 7 at most",
            marks=pytest.mark.slow,
        ),
        (
            ["study", "table", "flat_floor", "--journal", "empty.jsonl", "--of", "swings"],
            "no walk .* variable stiffness",
        ),
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


@pytest.mark.slow
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
    assert main(["study", "table", str(study), "--journal", str(journal), "-o", str(figure)]) == RAN
    assert figure.stat().st_size > 5000 and capsys.readouterr().out == f"{figure}\n"
    table = tmp_path / "walks.csv"
    assert main(["study", "table", str(study), "--journal", str(journal), "-o", str(table)]) == RAN
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["arm"] for row in rows] == ["flat", "variable"] * 2
    assert [row["status"] for row in rows] == ["done", "done", "missing", "missing"]
    assert (
        rows[0]["steps_done"] == "2" and float(rows[0]["zmp_error.mean"]) > 0.0 and not rows[2]["steps_done"]
    )
    capsys.readouterr()
    assert main(["study", "table", str(study), "--journal", str(journal), "--of", "swings", "--json"]) == RAN
    swings = json.loads(capsys.readouterr().out)["rows"]["level"]
    assert (swings["walks"], swings["swings"], swings["reached"]) == (1, 2, 1.0)
    assert main(["study", "show", "flat_floor", "--cell", "talos"]) == RAN
    assert set(json.loads(capsys.readouterr().out)["cells"]) == {"talos"}
