"""`wbc walk` and `wbc study`."""

from __future__ import annotations

import csv
import json
import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from wbc.app.cli import BAD_INPUT, RAN, main
from wbc.app.commands import walk as walk_command
from wbc.base.errors import InputError
from wbc.sim import WalkSpec


@pytest.mark.slow
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
    clock = ("wall_s", "real_time_factor", "tick_us", "decision_us")
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

    def stop(spec: WalkSpec, **_: object) -> None:
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
    assert WalkSpec.from_json(tomllib.loads(PART)).ground() == WalkSpec.from_json(spec).ground()
    (push,) = spec["pushes"]
    assert push["step"] == 2 and push["direction"] == 1.5
    (tmp_path / "part.json").write_text(json.dumps(tomllib.loads(PART)))
    push_words = ("--push", "impulse=0.05,direction=90,step=1", "--push", "impulse=0.01,step=2")
    other = spec_of("--spec", str(tmp_path / "part.json"), *push_words, "--velocity", "0.1", "0", "0")
    assert other["changes"]["gains.dcm_p"] == [4.0, 4.0] and other["gait"]["single_support"] == 0.7
    assert [push["step"] for push in other["pushes"]] == [1, 2]
    assert other["pushes"][0]["direction"] == pytest.approx(math.pi / 2)
    assert other["plan"] == {"velocity": [0.1, 0.0, 0.0], "steps": 22}
    (tmp_path / "steps.toml").write_text("plan = { velocity = [0.1, 0.0, 0.0], steps = 4 }")
    steps = spec_of("--spec", str(tmp_path / "steps.toml"), "--velocity", "0.15", "0", "0")
    assert steps["plan"] == {"velocity": [0.15, 0.0, 0.0], "steps": 4}


def test_a_drive_of_a_spec_ends_with_a_stand_after_the_seconds_that_are_given(
    tmp_path: Path, spec_of: Callable[..., Any]
) -> None:
    file, rows = tmp_path / "drive.toml", [[0.0, 0.1, 0.0, 0.0], [2.0, 0.2, 0.0, 0.0], [9.0, 0.0, 0.0, 0.0]]
    file.write_text(f"plan.drive = {rows}")
    stand = [0.0, 0.0, 0.0]
    for seconds, kept in (("5", 2), ("2", 1), ("12", 3)):
        ended = rows[:kept] + ([] if kept == 3 else [[float(seconds), *stand]])
        assert spec_of("--spec", str(file), "--seconds", seconds)["plan"]["drive"] == ended


@pytest.mark.parametrize(
    "text", ["seed = 7", 'foot = "soft"', "plan.distance = 0.2", 'mode = "torque"', 'eyes = "depth"']
)
def test_a_file_is_the_same_walk_for_a_program_and_for_the_command(
    text: str, tmp_path: Path, spec_of: Callable[..., Any]
) -> None:
    (tmp_path / "walk.toml").write_text(text)
    (tmp_path / "walk.json").write_text(json.dumps(tomllib.loads(text)))
    for name in ("walk.toml", "walk.json"):
        assert WalkSpec.from_json(spec_of("--spec", str(tmp_path / name))) == WalkSpec.from_json(
            tomllib.loads(text)
        )


@pytest.mark.slow
def test_a_fall_is_a_result(capsys: pytest.CaptureFixture[str]) -> None:
    push = "impulse=1.2,direction=90,step=1,phase=0.3"
    assert main(["walk", "--distance", "0.05", "--push", push]) == RAN
    assert "FELL" in capsys.readouterr().out


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
    table = tmp_path / "walks.csv"
    assert main(["study", "table", str(study), "--journal", str(journal), "-o", str(table)]) == RAN
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["arm"] for row in rows] == ["flat", "variable"] * 2
    assert [row["status"] for row in rows] == ["done", "done", "missing", "missing"]
    assert "amplitude (m)" in rows[0]  # a part of the spec
    assert (
        float(rows[0]["steps_done"]) == 2.0
        and float(rows[0]["zmp_error.mean (m)"]) > 0.0
        and not rows[2]["steps_done"]
    )
    capsys.readouterr()
    assert main(["study", "show", str(tmp_path), "--json"]) == RAN
    assert json.loads(capsys.readouterr().out)["studies"] == [{"name": "small", "about": "", "trials": 4}]
    assert main(["study", "show", str(study), "--arm", "flat"]) == RAN
    assert set(json.loads(capsys.readouterr().out)["arms"]) == {"flat"}


def test_a_velocity_goes_to_the_steps_that_give_it_or_is_refused_with_that_advice(
    spec_of: Callable[..., Any], capsys: pytest.CaptureFixture[str]
) -> None:
    fast = ("--velocity", "0.4", "0", "0")
    assert spec_of(*fast)["mode"] == "torque"
    assert spec_of("--robot", "g1", "--velocity", "0.25", "0", "0")["mode"] == "torque"
    assert spec_of("--velocity", "0.25", "0", "0")["mode"] == "position"
    assert spec_of("--velocity", "0.25", "0.15", "0")["mode"] == "torque"
    capsys.readouterr()
    for words in (
        (*fast, "--mode", "position"),
        ("--velocity", "2", "0", "0"),
        ("--velocity", "0", "0.9", "0"),
    ):
        assert main(["walk", *words]) == BAD_INPUT
        said = capsys.readouterr().err
        assert "give velocities of at most" in said and ("--mode torque" in said) == ("--mode" in words)


def test_grounds_fit_what_is_asked(spec_of: Callable[..., Any]) -> None:
    """A curve, a long way, a way back and a walk that begins askew fit; dimensions that are given stay."""
    for words in (
        ("--velocity", "0.2", "0", "0.1"),
        ("--distance", "200"),
        ("--distance", "-3"),
        ("--spec", "frizza", "--distance", "9"),
        ("--terrain", "boards", "--distance", "5", "--seed", "4"),
    ):
        spec = WalkSpec.from_json(spec_of(*words))
        low_x, high_x, low_y, high_y = spec.extent or (-math.inf, math.inf, -math.inf, math.inf)
        for step in spec.prepare().way.steps:
            assert low_x + 0.1 < step.x < high_x - 0.1 and low_y + 0.1 < step.y < high_y - 0.1
        assert WalkSpec.from_json(spec.to_json()).ground() == spec.ground()
    usual = WalkSpec.from_json(spec_of("--distance", "3")).ground()
    assert (usual.length, usual.width, usual.strip) == (3.0, 1.0, 1.0)
