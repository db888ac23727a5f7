"""Robots in files: `wbc robots check`, `wbc robots add`, TOML descriptions and paths as names."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from mjcf_biped import biped

from wbc.app import cli
from wbc.core.errors import UnknownNameError
from wbc.robots import load, others, saved

Captured = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def configuration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    folder = tmp_path / "configuration"
    monkeypatch.setattr(saved.platformdirs, "user_config_path", lambda name: folder / name)
    yield folder


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


def test_add_makes_a_name_for_every_later_command(capfd: Captured, file: Path, configuration: Path) -> None:
    words = ("robots", "add", str(file), "--left", "left_foot", "--right", "right_foot", "--name", "mine")
    code, out, _ = wbc_command(capfd, *words, "--lock", "right_reach=0.1", "--json")
    assert code == cli.RAN
    assert Path(json.loads(out)["file"]) == configuration / "wbc" / "robots" / "mine.toml"
    assert "mine" in others()
    assert load("mine") is load("mine")
    assert load("mine").name == "mine" and "right_reach" not in load("mine").joint_names
    for robot in ("mine", str(file)):
        code, out, _ = wbc_command(capfd, "stand", "--robot", robot, "--seconds", "0.05", "--json")
        assert code == cli.RAN and json.loads(out)["upright"]
    with pytest.raises(UnknownNameError, match="'mine'"):
        load("mime")


def test_a_urdf_whose_feet_are_not_named_is_described_and_said_not_to_walk(capfd: Captured) -> None:
    code, out, err = wbc_command(capfd, "robots", "check", "examples/biped.urdf")
    assert code == 0 and not err
    assert "no feet" in out and "--left left_foot --right right_foot" in out


def test_a_stand_with_failed_ticks_is_a_failure(capfd: Captured, tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "examples" / "biped.urdf").read_text()
    (tmp_path / "weak.urdf").write_text(re.sub(r'effort="[^"]+"', 'effort="0.05"', text))
    (tmp_path / "weak.toml").write_text(
        "file = 'weak.urdf'\nleft_sole = 'left_foot'\nright_sole = 'right_foot'\n"
    )
    code, out, err = wbc_command(capfd, "stand", "--robot", str(tmp_path / "weak.toml"), "--seconds", "0.3")
    assert code == cli.FAILED and "stood" not in out and "infeasible" in err
