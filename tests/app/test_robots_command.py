"""Robots in files: `wbc robots check`, TOML descriptions and paths as names."""

from __future__ import annotations

import itertools
import json
import re
from pathlib import Path

import pytest
from mjcf_biped import biped

from wbc.app import cli
from wbc.base.errors import InputError
from wbc.core.qp.controller import Controller
from wbc.core.qp.solving.solution import Solution
from wbc.core.signals import Measurement
from wbc.robots import load

Captured = pytest.CaptureFixture[str]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "biped.xml"
    path.write_text(biped())
    return path


def wbc_command(capfd: Captured, *arguments: str) -> tuple[int, str, str]:
    code = cli.main(list(arguments))
    out, err = capfd.readouterr()
    return code, out, err


def test_check_reports(capfd: Captured, file: Path) -> None:
    code, out, _ = wbc_command(capfd, "robots", "check", str(file))
    assert code == cli.RAN
    assert "190 x 80 mm, from 2 capsules" in out and "doubtful:" in out
    assert "waist" in out and "given" in out and "derived" in out
    code, out, _ = wbc_command(capfd, "robots", "check", str(file), "--lock", "waist=0.2", "--json")
    facts = json.loads(out)
    assert "waist" not in facts["joints"]
    assert any("dry friction up to 0.1 Nm" in line for line in facts["doubts"])


def test_options_that_a_file_needs_are_kept_in_a_file(capfd: Captured, file: Path) -> None:
    mine = file.with_name("mine.toml")
    words = ("robots", "check", str(file), "--left", "left_foot", "--right", "right_foot", "-o", str(mine))
    code, *_ = wbc_command(capfd, *words, "--lock", "right_reach=0.1")
    assert code == cli.RAN
    assert load(str(mine)).name == "mine" and "right_reach" not in load(str(mine)).joint_names
    for robot in (mine, file):
        code, out, _ = wbc_command(capfd, "stand", "--robot", str(robot), "--seconds", "0.05", "--json")
        assert code == cli.RAN and json.loads(out)["upright"]


def test_inertias_that_no_body_can_have_are_repaired_when_asked(capfd: Captured, tmp_path: Path) -> None:
    """A shin whose moments break the triangle inequality: refused with the option that helps, then taken with it."""
    text = (Path(__file__).parents[2] / "examples" / "biped.urdf").read_text()
    wrong = re.sub(r'<inertia ixx="[^"]*"', '<inertia ixx="9.0"', text, count=1)
    assert wrong != text
    (tmp_path / "bad.urdf").write_text(wrong)
    feet = ("--left", "left_foot", "--right", "right_foot")
    words = ("robots", "check", str(tmp_path / "bad.urdf"), *feet, "-o", str(tmp_path / "fixed.toml"))
    code, _, err = wbc_command(capfd, *words)
    assert code == cli.BAD_INPUT and "--repair" in err
    code, *_ = wbc_command(capfd, *words, "--repair", "--package-dir", str(tmp_path))
    assert code == cli.RAN
    written = (tmp_path / "fixed.toml").read_text()
    assert "repair = true" in written and f'package_dirs = ["{tmp_path}"]' in written


def test_a_urdf_whose_feet_are_not_named_is_described_and_said_not_to_walk(capfd: Captured) -> None:
    code, out, err = wbc_command(capfd, "robots", "check", "examples/biped.urdf")
    assert code == 0 and not err
    assert "no feet" in out and "--left left_foot --right right_foot" in out


def test_a_stand_without_torque_is_a_fall(capfd: Captured, tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "examples" / "biped.urdf").read_text()
    (tmp_path / "weak.urdf").write_text(re.sub(r'effort="[^"]+"', 'effort="0.05"', text))
    (tmp_path / "weak.toml").write_text(
        "file = 'weak.urdf'\nleft_sole = 'left_foot'\nright_sole = 'right_foot'\n"
    )
    code, out, _ = wbc_command(capfd, "stand", "--robot", str(tmp_path / "weak.toml"), "--seconds", "0.3")
    assert code == cli.RAN and "FELL" in out and "stood" not in out


def test_a_stand_with_failed_ticks_is_a_failure(capfd: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    solve, ticks = Controller.solve, itertools.count()

    def fails_once(controller: Controller, measurement: Measurement) -> Solution:
        if next(ticks) == 20:
            raise InputError("this tick fails")
        return solve(controller, measurement)

    monkeypatch.setattr(Controller, "solve", fails_once)
    code, out, err = wbc_command(capfd, "stand", "--robot", "g1", "--seconds", "0.3")
    assert code == cli.FAILED and "stood" not in out and "this tick fails" in err
