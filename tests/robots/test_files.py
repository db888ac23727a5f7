"""Robots in files of the user's own: an MJCF, a URDF or a TOML description."""

from __future__ import annotations

import inspect
import json
from pathlib import Path
from typing import Any

import pytest
from mjcf_biped import biped

from wbc.core.errors import InputError, UnknownNameError
from wbc.robots import FrameDescription, RobotDescription, ServoRule, SoleDescription, files, load, registry

SOLE = {"link": "left_foot", "translation": [0.03, 0.0, -0.07], "length": 0.2, "width": 0.1}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "biped.xml"
    path.write_text(f"<?xml version='1.0'?>\n<!-- <robot> -->\n{biped()}")
    return path


def test_every_kind_of_value_is_written_and_read_again(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = {
        "left_sole": SOLE,
        "right_sole": SOLE | {"link": "right_foot", "name": "right_foot", "frame": "flat"},
        "imu": {"link": "chest", "rpy": [0.0, 0.1, 0.0]},
        "servo": {"frequency": 6},
        "gains": {"left_knee": [150.0, 4.0]},
        "lock": {"waist": 0.2},
        "sole_size": [0.3, 0.1],
        "armature": 1e-3,
        "use_gains": False,
        "licence": 'of "me", é',
    }
    taken: dict[str, Any] = {}

    def take(source: Path, **options: Any) -> None:
        taken.update(options, source=source)

    take.__signature__ = inspect.signature(RobotDescription.from_mjcf)  # type: ignore[attr-defined]
    monkeypatch.setattr(RobotDescription, "from_mjcf", take)
    path, at = file.with_name("mine.toml"), (0.03, 0.0, -0.07)
    files.write(path, file, parameters)
    files.read(path)
    assert taken == {
        "source": file,
        "name": "mine",
        "left_sole": SoleDescription("left_sole", "left_foot", at, name="left_foot", length=0.2, width=0.1),
        "right_sole": SoleDescription("flat", "right_foot", at, name="right_foot", length=0.2, width=0.1),
        "imu": FrameDescription("imu", "chest", rpy=(0.0, 0.1, 0.0)),
        "servo": ServoRule(frequency=6.0),
        "gains": {"left_knee": (150.0, 4.0)},
        "lock": {"waist": 0.2},
        "sole_size": (0.3, 0.1),
        "armature": 1e-3,
        "use_gains": False,
        "licence": 'of "me", é',
    }  # fmt: skip


def test_a_changed_description_is_read_anew_and_a_stamp_is_of_its_content(file: Path) -> None:
    path = file.with_name("mine.toml")
    files.write(path, file, {})
    mine = str(path)
    before = load(mine)
    stamp = registry.stamped(mine)
    assert stamp == f"{mine}#{before.digest}" and load(stamp) is before is load(mine)
    assert registry.stamped("g1") == "g1" and registry.stamped(stamp) == stamp
    assert registry.stamped(str(file)) == f"{file}#{load(str(file)).digest}"
    path.write_text(f"file = {json.dumps(str(file))}\nhalf_sitting = {{ waist = 0.3 }}\n")
    assert before.half_sitting["waist"] == 0.0
    after = load(mine)
    assert after.half_sitting["waist"] == 0.3 and after.name == "mine" and after.soles[0].length > 0.18
    with pytest.raises(InputError, match=f"content {before.digest}, now it is {after.digest}$"):
        load(stamp)
    with pytest.raises(UnknownNameError, match="'g1'"):
        load("g11")
