"""Robots in files of the user's own: an MJCF, a URDF or a TOML description."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest
from mjcf_biped import biped

from wbc.base.errors import InputError, UnknownNameError
from wbc.core.frames import FrameDescription
from wbc.robots import RobotDescription, files, frames, load, registry

BIPED = Path(__file__).parents[2] / "examples" / "biped.urdf"

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


def test_a_file_in_the_folder_of_its_user_is_read_anew_when_it_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A path that begins with ~, in a TOML beside other files."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "home").mkdir()
    robot = tmp_path / "home" / "biped.xml"
    robot.write_text(biped())
    mine = tmp_path / "mine.toml"
    mine.write_text("file = '~/biped.xml'\n")
    before = load(mine)
    robot.write_text(biped().replace('mass="', 'mass="1'))
    os.utime(robot, (2e9, 2e9))
    assert load(mine).robot().mass > 1.5 * before.robot().mass


def test_a_frame_that_is_there_already_is_the_same_one_or_refused() -> None:
    """The same by its name, its link and its place in this."""
    model = load("hrp4_class").pinocchio_model()
    links = frames.link_names(model)
    place = FrameDescription("mark", links[3], (0.1, 0.0, 0.0), (0.0, 0.0, 0.3))
    frames.add_frame(model, place)
    count = model.nframes
    frames.add_frame(model, place)
    assert model.nframes == count and frames.same_place(model, place)
    at = model.frames[model.getFrameId("mark")]
    body = frames.body_frame(model, links[3])
    assert (
        at.placement.isApprox(body.placement * place.placement, 1e-12) and at.parentJoint == body.parentJoint
    )
    for wrong in (
        replace(place, link=links[4]),
        replace(place, translation=(0.1, 0.0, 1e-3)),
        replace(place, rpy=(0.0, 0.0, 0.31)),
    ):
        assert not frames.same_place(model, wrong)
        with pytest.raises(InputError, match="'mark'"):
            frames.add_frame(model, wrong)


def test_shapes_of_links_are_of_who_asked_for_them() -> None:
    for made in (load("hrp4_class").collision_hulls, load("hrp4_class").collision_shapes):
        mine, links = made(), set(made())
        del mine["left_hand"]
        mine["pelvis"].clear()
        assert set(made()) == links and made()["pelvis"]


@pytest.mark.parametrize(
    "name", ["\0.urdf", "a\ud800.xml", f"{'x' * 5000}.toml", "~nobody-at-all/a.urdf", "~\0/a.xml"]
)
def test_a_path_that_no_file_has_is_one_of_no_robot(name: str) -> None:
    for read in (load, RobotDescription.from_urdf, RobotDescription.from_mjcf):
        with pytest.raises(InputError, match="^no (robot|URDF|MJCF) file .*; give"):
            read(name)


def test_a_mesh_of_too_long_a_name_is_not_found() -> None:
    mesh = f'<visual><geometry><mesh filename="{"x" * 5000}.stl"/></geometry></visual></link>'
    text = BIPED.read_text(encoding="utf-8").replace("</link>", mesh, 1)
    robot = RobotDescription.from_urdf(text, left_sole="left_foot", right_sole="right_foot")
    assert any("1 of 1 meshes are not found" in line for line in robot.derived)
