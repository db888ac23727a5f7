"""Robots in files of the user's own: an MJCF, a URDF or a TOML description."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from mjcf_biped import biped

from wbc.base.errors import InputError, UnknownNameError
from wbc.robots import files, load, registry

SOLE = {"link": "left_foot", "translation": [0.03, 0.0, -0.07], "length": 0.2, "width": 0.1}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "biped.xml"
    path.write_text(f"<?xml version='1.0'?>\n<!-- <robot> -->\n{biped()}")
    return path


def test_a_description_is_written_and_read_again(file: Path) -> None:
    path = file.with_name("mine.toml")
    soles = {"left_sole": SOLE, "right_sole": SOLE | {"link": "right_foot"}}
    own = {"imu": {"link": "chest"}, "servo": {"frequency": 6}, "gains": {"left_knee": [150.0, 4.0]}}
    files.write(path, file, soles | own | {"lock": {"waist": 0.2}, "licence": 'of "me", é'})
    read = files.read(path)
    assert (read.name, read.licence, read.imu.link, read.servo.frequency) == (
        "mine",
        'of "me", é',
        "chest",
        6.0,
    )
    assert read.gains["left_knee"] == (150.0, 4.0) and "waist" not in read.joint_names
    assert [(sole.link, sole.length) for sole in read.soles] == [("left_foot", 0.2), ("right_foot", 0.2)]


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
