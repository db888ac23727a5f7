"""Files of strangers: other units, other tools. Each works, or one line names the way out."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from meshes import CORNERS, dae, obj, stl, text_stl

from wbc import Plant, RobotDescription
from wbc.base.errors import InputError, ModelError, UnknownNameError
from wbc.robots import files, load
from wbc.sim.plant.model import drawing_model
from wbc.sim.terrain.spec import terrain

EXAMPLES = Path(__file__).parents[2] / "examples"
URDF = (EXAMPLES / "biped.urdf").read_text(encoding="utf-8")
MJCF = (EXAMPLES / "biped.xml").read_text(encoding="utf-8")
FEET = {"left_sole": "left_foot", "right_sole": "right_foot"}


def scaled(what: str, factor: float, xml: str = URDF) -> str:
    """Return the file with all numbers of an attribute times a factor."""

    def change(match: re.Match[str]) -> str:
        return match[1] + " ".join(f"{float(each) * factor:.9g}" for each in match[2].split()) + '"'

    return re.sub(rf'({what}=")([^"]+)"', change, xml)


def test_a_file_that_is_no_utf_8_is_refused(tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_bytes(b'<robot name="\xff"/>')
    with pytest.raises(InputError, match=r"robot\.urdf is not a URDF"):
        RobotDescription.from_urdf(tmp_path / "robot.urdf")


@pytest.mark.parametrize("link", ["trunk", "left_foot"])
def test_a_link_with_the_name_of_mujocos_ground_is_renamed(link: str) -> None:
    feet = {side: "world_link" if name == link else name for side, name in FEET.items()}
    description = RobotDescription.from_urdf(URDF.replace(f'"{link}"', '"world"'), **feet)
    own = RobotDescription.from_urdf(URDF, **FEET)
    np.testing.assert_allclose(description.robot().mass_matrix, own.robot().mass_matrix, atol=1e-12)
    assert Plant(description).model.body("world_link").id > 0
    assert any("'world_link'" in line for line in description.derived)


SPACE = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
UNREADABLE = {
    "xacro": (f'<robot name="r" {SPACE}><xacro:include filename="leg"/></robot>', "xacro FILE > robot.urdf"),
    "radians read as degrees": (MJCF.replace('<compiler angle="radian"/>', ""), 'angle="radian"'),
    "meshes elsewhere": (
        MJCF.replace("<worldbody>", '<asset><mesh file="part.STL"/></asset><worldbody>', 1),
        "--without-meshes",
    ),
    "no torque limits, no feet": (re.sub(' effort="[^"]+"', "", URDF), "--left left_foot --right right_foot"),
}


@pytest.mark.parametrize("what", UNREADABLE)
def test_what_cannot_be_read_is_refused_with_the_way_out(what: str) -> None:
    xml, way_out = UNREADABLE[what]
    read = RobotDescription.from_mjcf if xml in (MJCF,) or "<mujoco" in xml else RobotDescription.from_urdf
    with pytest.raises(ModelError) as caught:
        read(xml)
    assert way_out in str(caught.value) and "\n" not in str(caught.value)


def test_sensors_of_a_limb_are_no_imu_of_an_mjcf() -> None:
    sensors = '<sensor><gyro site="foot_imu"/><accelerometer site="foot_imu"/></sensor></mujoco>'
    xml = re.sub("<sensor>.*</sensor>", "", MJCF, flags=re.DOTALL).replace("</mujoco>", sensors)
    xml = xml.replace('<geom fromto="-0.06 0.045', '<site name="foot_imu"/><geom fromto="-0.06 0.045', 1)
    assert RobotDescription.from_mjcf(xml).imu.link == "trunk"


# Shapes

TRUNK = re.search(r'<link name="trunk">.*?</link>', URDF, re.DOTALL)[0]  # type: ignore[index]
INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'


def with_shape(shape: str) -> str:
    """Return the URDF of the biped with another shape of its trunk."""
    shapes = f"<collision><geometry>{shape}</geometry></collision>"
    return URDF.replace(TRUNK, re.sub(r"<visual>.*?</visual>", shapes, TRUNK, flags=re.DOTALL))


def with_mesh(folder: Path, name: str, content: str | bytes, attributes: str = "") -> RobotDescription:
    """Return the biped with a mesh as its trunk."""
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    (folder / "robot.urdf").write_text(with_shape(f'<mesh filename="{name}" {attributes}/>'))
    return RobotDescription.from_urdf(folder / "robot.urdf", **FEET)


def size_of_trunk(robot: RobotDescription) -> np.ndarray:
    return np.ptp(np.array(robot.collision_hulls()["trunk"][0].points), axis=0)  # type: ignore[union-attr]


UNITS = {
    "one scale": ("trunk.stl", stl(1e3 * CORNERS), 'scale="0.001"'),
    "one scale between blanks": ("trunk.stl", stl(1e3 * CORNERS), 'scale=" 1e-3 "'),
    "mirrored": ("trunk.STL", stl(1e3 * CORNERS), 'scale="-0.001 0.001 0.001"'),
    "text": ("trunk.stl", text_stl(CORNERS), ""),
    "obj": ("trunk.obj", obj(CORNERS), ""),
    "centimetres": ("trunk.dae", dae(1e2 * CORNERS, '<unit name="cm" meter="0.01"/>'), ""),
    "inches": ("trunk.DAE", dae(CORNERS / 0.0254, "<unit\nmeter = '0.0254'/>"), ""),
    "scaled millimetres": ("trunk.dae", dae(1e2 * CORNERS, '<unit meter="1e-3"/>'), 'scale="10 10 10"'),
    "no unit": ("trunk.dae", dae(CORNERS, ""), ""),
    "a unit that is none": ("trunk.dae", dae(CORNERS, '<unit meter="inch"/>'), ""),
}
"""File of the same trunk of 0.2 x 0.3 x 0.4 m, its content, and attributes in the URDF."""


@pytest.mark.parametrize("what", UNITS)
def test_meshes_of_all_units_and_scales_have_their_size_drawn_and_touched(what: str, tmp_path: Path) -> None:
    robot = with_mesh(tmp_path, *UNITS[what])
    np.testing.assert_allclose(size_of_trunk(robot), [0.2, 0.3, 0.4], atol=1e-6)
    if what in ("mirrored", "inches", "scaled millimetres"):
        model = drawing_model(robot, robot.robot(), terrain("flat"))
        drawn = sorted(np.ptp(model.mesh_vert, axis=0).tolist())  # along its principal axes
        assert drawn == pytest.approx([0.2, 0.3, 0.4], abs=1e-6)
    assert any("scale" in line for line in robot.derived) == ("one scale" in what)


LFS = "version https://git-lfs.github.com/spec/v1\noid sha256:0a\nsize 48284\n"
BROKEN = {
    "pointer.stl": (LFS, "git lfs pull"),
    "pointer.obj": (LFS, "git lfs pull"),
    "pointer.dae": (LFS, "git lfs pull"),
    "empty.stl": ("", "empty"),
    "page.stl": ("<!DOCTYPE html><html></html>", "web"),
    "cut.stl": (stl(CORNERS)[:-60], "cut off"),
    "short.stl": (b"404: Not Found", "cut off"),
    "text.stl": (text_stl(CORNERS)[:-200], "cut off"),
    "cut.obj": (obj(CORNERS)[:60], "cut off"),
    "cut.dae": (dae(CORNERS, "")[:-300], "cut off"),
    "nan.stl": (stl(CORNERS * np.nan), "no numbers"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_mesh_that_is_none_is_named(name: str, tmp_path: Path) -> None:
    """In the notes of a URDF, whose shapes are optional; as the reason why MuJoCo refuses an MJCF."""
    content, why = BROKEN[name]
    robot = with_mesh(tmp_path, name, content)
    assert any(name in line and why in line for line in robot.derived)
    assert "trunk" not in robot.collision_hulls() and "trunk" not in robot.collision_shapes()
    if name in ("pointer.stl", "cut.obj", "nan.stl"):
        asset = f'<asset><mesh name="m" file="{name}"/></asset><worldbody><geom type="mesh" mesh="m"/>'
        (tmp_path / "robot.xml").write_text(MJCF.replace("<worldbody>", asset, 1))
        with pytest.raises(ModelError, match=rf"{name}.*{why}"):
            RobotDescription.from_mjcf(tmp_path / "robot.xml")


def lamp(limits: str, kind: str = "revolute", joint: str = "pan", link: str = "lamp", more: str = "") -> str:
    """Return the biped with a lamp on its trunk."""
    ends = f'<parent link="trunk"/><child link="{link}"/><axis xyz="0 0 1"/>'
    limit = f'<limit {limits} effort="10" velocity="2"/>'
    added = f'<link name="{link}">{INERTIAL}</link><joint name="{joint}" type="{kind}">{ends}{limit}{more}</joint>'
    return URDF.replace("</robot>", f"{added}</robot>")


WRONG = {
    "two scales": (with_shape('<mesh filename="a.stl" scale="1 1"/>'), ("trunk", "'1 1'", "1 or 3 numbers")),
    "a scale of zero": (with_shape('<mesh filename="a.stl" scale="0"/>'), ("trunk", "scale", "'0'")),
    "a scale that is none": (with_shape('<mesh filename="a.stl" scale="0,001"/>'), ("trunk", "scale", "'0,001'")),
    "a box of one size": (with_shape('<box size="0.1"/>'), ("trunk", "box", "'0.1'")),
    "a radius that is none": (with_shape('<sphere radius="big"/>'), ("trunk", "radius", "'big'")),
    "a length of NaN": (with_shape('<cylinder radius="1" length="nan"/>'), ("trunk", "length", "'nan'")),
    "both limits above": (lamp('lower="inf" upper="inf"'), ("pan", "'inf'", "finite")),
    "a slide without end": (lamp('lower="-inf" upper="inf"', "prismatic"), ("pan", "'-inf'", "finite")),
    "a limit of a comma": (lamp('lower="-1,5" upper="1"'), ("pan", "-1,5")),
    "an infinite ratio": (
        lamp('lower="-1" upper="1"', more='<mimic joint="left_knee" multiplier="inf"/>'),
        ("pan", "multiplier", "'inf'"),
    ),
    "the joint universe": (lamp('lower="-1" upper="1"', joint="universe"), ("universe", "rename")),
    "a joint without a name": (URDF.replace('<joint name="left_knee"', "<joint"), ("left_thigh", "left_shin", "name")),
    "a joint with a blank as its name": (lamp('lower="-1" upper="1"', joint=" "), ("trunk", "lamp", "no name")),
    "a link without a name": (URDF.replace("</robot>", "<link/></robot>"), ("<link> number 14", "no name")),
    "a prefix": (
        URDF.replace("<robot ", '<d:robot xmlns:d="http://d" ').replace("</robot>", "</d:robot>"),
        ("<robot>", "prefix"),
    ),
    "many links": (URDF.replace("</robot>", 2000 * '<link name="a"/>' + "</robot>"), ("2000 links", "got 2013")),
    "many joints": (
        URDF.replace(
            "</robot>",
            "".join(
                f'<link name="a{i}">{INERTIAL}</link><joint name="j{i}" type="continuous"><parent link="trunk"/>'
                f'<child link="a{i}"/></joint>'
                for i in range(300)
            )
            + "</robot>",
        ),
        ("256 joints", "312"),
    ),
    "nothing that moves": (f'<robot name="r"><link name="a">{INERTIAL}</link></robot>', ("joints that move", "0")),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_elements_of_a_urdf_that_cannot_be_are_named(what: str) -> None:
    """By link or joint, the value that stands there, and the rule."""
    xml, words = WRONG[what]
    with pytest.raises(ModelError) as caught:
        RobotDescription.from_urdf(xml, **({} if "moves" in what else FEET))
    said = str(caught.value)
    assert all(word in said for word in words) and "\n" not in said, said


# Limits and names


@pytest.mark.parametrize(
    ("limits", "found"),
    [
        ('lower="-inf" upper="inf"', (-np.inf, np.inf)),
        ('lower="-Infinity" upper="+INF"', (-np.inf, np.inf)),
        ('lower="-1e400" upper="1e400"', (-np.inf, np.inf)),
        ('lower="-inf" upper="1"', (-np.inf, 1.0)),
        ('lower="-1" upper="inf"', (-1.0, np.inf)),
    ],
)
def test_infinite_limits_are_none(limits: str, found: tuple[float, float]) -> None:
    description = RobotDescription.from_urdf(lamp(limits), **FEET)
    robot = description.robot()
    i = robot.joint_index("pan")
    assert (robot.position_lower[i], robot.position_upper[i]) == found
    assert any(line.startswith("joint 'pan': ") for line in description.derived)
    if "1e400" in limits:
        assert np.isfinite(Plant(description).truth().com).all()
    written = f'name="left_knee" limited="true" range="{found[0]} {found[1]}"'
    xml = re.sub(r'name="left_knee" range="[^"]*"', written, MJCF)
    own = RobotDescription.from_mjcf(xml).robot()
    i = own.joint_index("left_knee")
    assert (own.position_lower[i], own.position_upper[i]) == found


@pytest.mark.parametrize(
    ("joint", "link"),
    [("root_joint", "lamp"), ("root_joint_", "lamp"), ("pan", "root_joint"), ("pan", "universe")],
)
def test_names_of_the_parsers_own_are_names_as_others(joint: str, link: str) -> None:
    description = RobotDescription.from_urdf(lamp('lower="-1" upper="1"', joint=joint, link=link), **FEET)
    robot, own = description.robot(), RobotDescription.from_urdf(lamp('lower="-1" upper="1"'), **FEET).robot()
    order = [
        *range(6),
        *(6 + own.joint_index("pan" if name == joint else name) for name in robot.joint_names),
    ]
    np.testing.assert_allclose(robot.mass_matrix, own.mass_matrix[np.ix_(order, order)], atol=1e-12)
    if link == "universe":
        np.testing.assert_allclose(Plant(description).truth().com, own.com, atol=1e-5)


def test_a_default_namespace_and_a_robot_without_a_name_are_read(tmp_path: Path) -> None:
    own = RobotDescription.from_urdf(URDF, **FEET)
    for xml in (
        URDF.replace("<robot ", '<robot xmlns="http://drake.mit.edu" xmlns:xsi="http://x" xsi:at="a" '),
        URDF.replace("<robot ", "<robot xmlns='http://drake.mit.edu' "),
        URDF.replace('<link name="trunk"', '<link xmlns="http://drake.mit.edu" name="trunk"'),
    ):
        (tmp_path / "robot.urdf").write_text(xml)
        assert files.describe(tmp_path / "robot.urdf", FEET).joint_names == own.joint_names
    nameless = RobotDescription.from_urdf(re.sub('<robot name="[^"]*"', "<robot", URDF), **FEET)
    assert nameless.name == "robot" and Plant(nameless)


@pytest.mark.parametrize("name", ["robot.mjcf", "ROBOT.XML", "robot.Xml", "robot.txt"])
def test_an_mjcf_of_any_ending_is_read_with_its_meshes(name: str, tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "trunk.stl").write_bytes(stl(CORNERS))
    assets = '<asset><mesh name="m" file="trunk.stl"/></asset><compiler meshdir="meshes"/><worldbody>'
    (tmp_path / name).write_text(MJCF.replace("<worldbody>", assets, 1))
    own = RobotDescription.from_mjcf(EXAMPLES / "biped.xml")
    assert RobotDescription.from_mjcf(tmp_path / name).digest == own.digest
    if not name.endswith("txt"):
        assert load(str(tmp_path / name)).urdf.partition(">")[2] == own.urdf.partition(">")[2]


def test_options_and_joints_that_do_not_exist_are_refused_by_every_reader() -> None:
    values = {"gains": (1.0, 1.0), "position_limits": (0.0, 1.0)}
    doors = (
        "half_sitting",
        "lock",
        "gains",
        "armature",
        "position_limits",
        "velocity_limits",
        "torque_limits",
    )
    for read in (
        partial(RobotDescription.from_urdf, URDF, **FEET),
        partial(RobotDescription.from_mjcf, MJCF),
    ):
        for door in doors:
            with pytest.raises(UnknownNameError, match="'left_knee_joint'.*'left_knee'"):
                read(**{door: {"left_knee_joint": values.get(door, 0.5)}})
        with pytest.raises(UnknownNameError, match="'halfsitting'.*'half_sitting'"):
            read(halfsitting={"left_knee": 0.9})
