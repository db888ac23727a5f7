"""Files of strangers: other encodings, other units, other tools. Each works, or one line names the way out."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from wbc import Plant, RobotDescription
from wbc.base.errors import InputError, ModelError
from wbc.robots import files

EXAMPLES = Path(__file__).parents[2] / "examples"
URDF = (EXAMPLES / "biped.urdf").read_text(encoding="utf-8")
MJCF = (EXAMPLES / "biped.xml").read_text(encoding="utf-8")
FEET = {"left_sole": "left_foot", "right_sole": "right_foot"}
ENCODINGS = {
    "iso-8859-1": "latin-1",
    "utf-16": "utf-16",
    "utf-16le": "utf-16-le",
    "UTF-8": "utf-8-sig",
    "cp1252": "cp1252",
}


def encoded(xml: str, name: str) -> bytes:
    """Return an XML with a comment that is not ASCII in an encoding that its first line names."""
    body = re.sub(r"<\?xml[^>]*\?>", "", xml)
    return f'<?xml version="1.0" encoding="{name}"?><!-- Füße -->{body}'.encode(ENCODINGS[name])


def scaled(what: str, factor: float, xml: str = URDF) -> str:
    """Return the file with all numbers of an attribute times a factor."""

    def change(match: re.Match[str]) -> str:
        return match[1] + " ".join(f"{float(each) * factor:.9g}" for each in match[2].split()) + '"'

    return re.sub(rf'({what}=")([^"]+)"', change, xml)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_file_is_read_in_the_encoding_that_it_declares(encoding: str, tmp_path: Path) -> None:
    """URDF and MJCF, with what the MJCF includes and its meshes beside it."""
    own = RobotDescription.from_urdf(EXAMPLES / "biped.urdf", **FEET)
    (tmp_path / "robot.urdf").write_bytes(encoded(URDF, encoding))
    assert RobotDescription.from_urdf(tmp_path / "robot.urdf", **FEET).urdf == own.urdf
    assert files.describe(tmp_path / "robot.urdf", FEET).urdf == own.urdf
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    (tmp_path / "hat.obj").write_text(corners)
    included = '<mujoco><asset><mesh name="hat" file="hat.obj"/></asset></mujoco>'
    (tmp_path / "hat.xml").write_bytes(encoded(included, encoding))
    xml = MJCF.replace("<worldbody>", '<include file="hat.xml"/><worldbody>', 1)
    (tmp_path / "robot.xml").write_bytes(encoded(xml, encoding))
    described = RobotDescription.from_mjcf(tmp_path / "robot.xml")
    assert described.urdf == RobotDescription.from_mjcf(EXAMPLES / "biped.xml").urdf


def test_a_file_in_no_such_encoding_is_refused(tmp_path: Path) -> None:
    for content in (b'<?xml version="1.0" encoding="klingon"?><robot/>', b'<robot name="\xff"/>'):
        (tmp_path / "robot.urdf").write_bytes(content)
        with pytest.raises(InputError, match=r"robot\.urdf is not a URDF"):
            RobotDescription.from_urdf(tmp_path / "robot.urdf")


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "millimetres"), (1e2, "centimetres"), (1e-3, "scale")])
def test_geometry_in_another_unit_is_named_and_a_size_that_is_given_wins(factor: float, unit: str) -> None:
    """Size found, and the unit that would make it a sole; with the size given the sole is where it is in metres."""
    own = RobotDescription.from_urdf(URDF, **FEET)
    odd = scaled("box size", factor)
    with pytest.raises(ModelError, match=rf"{0.2 * factor:.4g} x {0.1 * factor:.4g} m.*{unit}.*200 x 100 mm"):
        RobotDescription.from_urdf(odd, **FEET)
    given = RobotDescription.from_urdf(odd, sole_size=(0.2, 0.1), **FEET)
    assert [sole.placement for sole in given.soles] == [sole.placement for sole in own.soles]
    smaller = RobotDescription.from_urdf(odd, sole_size=(0.15, 0.08), **FEET)
    assert (smaller.soles[0].length, smaller.soles[0].width) == (0.15, 0.08)


def test_geoms_in_another_unit_are_named() -> None:
    boxes = '<geom type="box" size="100 50 10" pos="0.03 0 -0.065"/>'
    xml = re.sub(r'<geom fromto="-0.06 -?0.045[^>]*/>\s*<geom[^>]*/>', boxes, MJCF)
    with pytest.raises(ModelError, match="200 x 100 m.*in millimetres it would be 200 x 100 mm"):
        RobotDescription.from_mjcf(xml)


@pytest.mark.parametrize(
    ("attribute", "factor", "words"),
    [
        ("<mass value", 1e3, ("2.6e+04 kg", "masses")),
        ("<mass value", 1e-3, ("0.026 kg", "masses")),
        ("i[xyz][xyz]", 1e6, ("inertias", "14 kg")),
        ("i[xyz][xyz]", 1e-6, ("inertias", "14 kg")),
        ("(?:<mass value|i[xyz][xyz])", 1e3, ("2.6e+04 kg", "masses")),
    ],
)
def test_masses_and_inertias_in_another_unit_are_doubted_with_their_figures(
    attribute: str, factor: float, words: tuple[str, ...]
) -> None:
    doubts = RobotDescription.from_urdf(scaled(attribute, factor), **FEET).doubts()
    assert any(all(word in line for word in words) for line in doubts)


def test_good_units_are_not_doubted() -> None:
    for own in (RobotDescription.from_urdf(URDF, **FEET), RobotDescription.from_mjcf(MJCF)):
        assert not [line for line in own.doubts() if "masses" in line or "lengths" in line]


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


def test_feet_of_a_urdf_that_are_not_named_are_found_for_the_message() -> None:
    """A frame called sole before the link; not those of an arm or a quadruped."""
    without = RobotDescription.from_urdf(URDF)
    assert any("--left left_foot --right right_foot" in line for line in without.doubts())
    with pytest.raises(InputError, match="--left left_foot --right right_foot"):
        without.needs_feet("a walk")
    sole = "".join(
        f'<link name="{s}_sole"/><joint name="{s}_fix" type="fixed"><parent link="{s}_foot"/>'
        f'<child link="{s}_sole"/><origin xyz="0.03 0 -0.075"/></joint>'
        for s in ("left", "right")
    )
    soled = RobotDescription.from_urdf(URDF.replace("</robot>", f"{sole}</robot>"))
    assert any("--left left_sole --right right_sole" in line for line in soled.doubts())


@pytest.mark.parametrize(
    ("link", "name"), [("left_foot", "left_foot_ft_imu"), ("left_shin", "imu"), ("trunk", "simulated")]
)
def test_an_imu_is_looked_for_on_the_trunk(link: str, name: str) -> None:
    frame = f'<link name="{name}"/><joint name="i" type="fixed"><parent link="{link}"/><child link="{name}"/></joint>'
    description = RobotDescription.from_urdf(URDF.replace("</robot>", f"{frame}</robot>"), **FEET)
    assert description.imu.frame != name
    assert any(f"imu='{name}'" in line for line in description.derived) == (link != "trunk")
    assert (
        RobotDescription.from_urdf(URDF.replace("</robot>", f"{frame}</robot>"), imu=name, **FEET).imu.frame
        == name
    )


def test_sensors_of_a_limb_are_no_imu_of_an_mjcf() -> None:
    sensors = '<sensor><gyro site="foot_imu"/><accelerometer site="foot_imu"/></sensor></mujoco>'
    xml = re.sub("<sensor>.*</sensor>", "", MJCF, flags=re.DOTALL).replace("</mujoco>", sensors)
    xml = xml.replace('<geom fromto="-0.06 0.045', '<site name="foot_imu"/><geom fromto="-0.06 0.045', 1)
    assert RobotDescription.from_mjcf(xml).imu.link == "trunk"
