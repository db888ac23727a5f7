"""Robots in files of the user's own: an MJCF, a URDF or a TOML description."""

from __future__ import annotations

import json
import os
import re
from dataclasses import replace
from pathlib import Path

import pytest
from meshes import CORNERS, stl
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


def test_a_robot_is_read_anew_when_a_file_that_it_includes_or_takes_a_mesh_from_has_changed(
    tmp_path: Path,
) -> None:
    """The digest of a stamp is that of what is on the disk, whichever file holds it."""
    (tmp_path / "parts").mkdir()
    part, mesh, scene = (
        tmp_path / "parts" / "body.xml",
        tmp_path / "parts" / "hat.stl",
        tmp_path / "scene.xml",
    )
    hat = '<mujoco><compiler meshdir="parts"/><asset><mesh name="hat" file="hat.stl"/></asset></mujoco>'
    (tmp_path / "hat.xml").write_text(hat)
    bodies = re.search(r"<worldbody>.*</worldbody>", biped(), re.DOTALL)
    assert bodies is not None
    top = biped().replace(bodies[0], '<include file="parts/body.xml"/><include file="hat.xml"/>')
    own = '<body name="hat"><geom type="mesh" mesh="hat" density="500"/></body>'
    hatted = re.sub(r"(<body name=.chest[^>]*>)", rf"\1{own}", bodies[0])
    assert hatted != bodies[0]
    part.write_text(f"<mujoco>{hatted}</mujoco>")
    mesh.write_bytes(stl(CORNERS))
    scene.write_text(top)
    for name, file in ((str(scene), part), (str(tmp_path / "mine.toml"), mesh)):
        (tmp_path / "mine.toml").write_text("file = 'scene.xml'\n")
        before = load(name)
        stamp = registry.stamped(name)
        if file is part:
            part.write_text(part.read_text().replace('mass="', 'mass="1'))
        else:
            mesh.write_bytes(stl(1.5 * CORNERS))
        os.utime(file, (2e9, 2e9))
        after = load(name)
        assert after.robot().mass > before.robot().mass + 1.0
        assert after.digest == files.read(name).digest != before.digest
        with pytest.raises(InputError, match="has changed"):
            load(stamp)


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


@pytest.mark.parametrize("changed", ["rods.xml", "parts.xml", "meshes/rod.obj"])
def test_a_robot_is_read_anew_when_a_file_that_it_refers_to_has_changed(changed: str, tmp_path: Path) -> None:
    corners = [f"v {0.1 * x} {0.1 * y} {0.1 * z}" for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    sides = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    texts = {
        "arm.toml": "file = 'rods.xml'\nfeet = false\nbase = 'fixed'\n",
        "rods.xml": (
            '<mujoco><compiler meshdir="meshes"/><asset><mesh file="rod.obj"/></asset><include file="parts.xml"/>'
            '<actuator><motor joint="j" ctrlrange="-9 9"/><motor joint="k" ctrlrange="-9 9"/></actuator></mujoco>'
        ),
        "parts.xml": (
            '<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0" range="-60 60"/>'
            '<geom type="mesh" mesh="rod" density="500"/>'
            '<body name="b"><joint name="k" axis="0 1 0" range="-60 60"/><geom type="mesh" mesh="rod" density="500"/>'
            "</body></body></worldbody></mujoco>"
        ),
        "meshes/rod.obj": "\n".join([*corners, *(f"f {side}" for side in sides), ""]),
    }
    (tmp_path / "meshes").mkdir()
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    before = load(tmp_path / "arm.toml")
    assert before is load(tmp_path / "arm.toml") and before.robot().mass == pytest.approx(1.0)
    old, new = ("v 0.1", "v 0.2") if changed.endswith("obj") else ('"500"', '"1000"')
    if changed == "rods.xml":
        old, new = '"rod.obj"', '"rod.obj" scale="1 1 2"'
    (tmp_path / changed).write_text(texts[changed].replace(old, new))
    os.utime(tmp_path / changed, (2e9, 2e9))  # MuJoCo keeps meshes of one second
    assert load(tmp_path / "arm.toml").robot().mass == pytest.approx(2.0)


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
