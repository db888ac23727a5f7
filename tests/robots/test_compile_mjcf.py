"""Files of an MJCF: what is moved, missing, broken or in another format; couplings, shapes and NaN."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from meshes import CORNERS, obj, stl
from mjcf_biped import biped
from mjcf_robot import plain

from wbc.base.errors import InputError, ModelError
from wbc.robots import RobotDescription
from wbc.robots.readers.compile_mjcf import compiled, one_line

ROBOT = """<mujoco><compiler angle="radian"/>{extra}<worldbody><body name="robot">{free}<geom size=".1"/>
<body name="arm" pos=".2 0 0"><joint name="a" axis="0 1 0" actuatorfrcrange="-9 9" {a}/><geom size=".1"/>{arm}
<body name="tip" pos=".2 0 0"><joint name="b" axis="0 1 0" actuatorfrcrange="-9 9" {b}/><geom size=".1"/></body></body>
</body></worldbody>{after}</mujoco>"""


def robot(
    extra: str = "", *, arm: str = "", a: str = "", b: str = "", after: str = "", free: str = ""
) -> str:
    return ROBOT.format(extra=extra, arm=arm, a=a, b=b, after=after, free=free)


@pytest.mark.parametrize(
    ("attributes", "moved"),
    [
        ("", False),
        ('refpos="0.1 0 0"', True),
        ('refquat="1 1 0 0"', True),
        ('refpos="0 0 1" refquat="1 1 0 0"', True),
    ],
)
def test_a_mesh_that_the_file_moves_is_the_box_around_it(
    attributes: str, moved: bool, tmp_path: Path
) -> None:
    (tmp_path / "box.obj").write_text(obj(CORNERS))
    path = tmp_path / "robot.xml"
    asset = f'<asset><mesh name="box" file="box.obj" {attributes}/></asset>'
    path.write_text(robot(asset, arm='<geom type="mesh" mesh="box" mass="0" contype="0" conaffinity="0"/>'))
    assert compiled(path, meshes=True)[1] == ({"box"} if moved else set())
    description = RobotDescription.from_mjcf(path, base="fixed")
    assert description.source == str(path)
    assert any("mesh 'box'" in line for line in description.derived) == moved
    kinds = {shape.kind for shape in description.mechanism.shapes if shape.link == "arm"}
    assert ("mesh" in kinds) != moved and ("box" in kinds) == moved
    sizes = [sorted(s.size) for s in description.mechanism.shapes if s.kind == "box"]
    assert sizes == ([pytest.approx([0.1, 0.15, 0.2], abs=1e-6)] if moved else [])


def test_a_nan_is_named_by_line_and_attribute_unless_it_is_a_name() -> None:
    text = (
        robot().replace("\n", "<!-- a\nb -->\n").replace('name="b" axis="0 1 0"', 'name="b" axis="0 NaN 0"')
    )
    line = text[: text.index("NaN")].count("\n") + 1
    with pytest.raises(ModelError, match=rf"axis of the <joint> in line {line} is NaN"):
        RobotDescription.from_mjcf(text, base="fixed")
    for harmless in ('name="nan"', 'name="nan" class="nan"'):
        text = robot('<default><default class="nan"/></default>').replace('name="b"', harmless)
        assert "nan" in RobotDescription.from_mjcf(text, base="fixed").joint_names


def test_copies_count_as_bodies() -> None:
    two = '<body><geom size=".1"/><body><geom size=".1"/></body></body>'
    text = f'<replicate count="1500" offset="1 0 0">{two}</replicate>'
    with pytest.raises(ModelError, match="may have 2000 bodies, got 3001"):
        RobotDescription.from_mjcf(f"<mujoco><worldbody>{text}</worldbody></mujoco>")


def test_a_urdf_no_xml_and_objects_are_refused_as_an_mjcf() -> None:
    for source, said in (
        ('<robot name="r"/>', "MJCF string is a URDF; use from_urdf"),
        ('<sdf version="1.6"/>', "MJCF string is an SDF; convert it to an MJCF with sdf2mjcf"),
        ("<", "MJCF string is no XML"),
    ):
        with pytest.raises(ModelError, match=said):
            RobotDescription.from_mjcf(source)
    with pytest.raises(InputError, match="must be a path, the XML itself, an MjSpec or an MjModel, got 3"):
        RobotDescription.from_mjcf(3)


def test_files_that_are_missing_or_broken_are_named_with_the_way_out(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    geom = '<geom type="mesh" mesh="m" mass="0"/>'
    for name, content, said in (
        ("gone.stl", None, "gone.stl.*without-meshes"),
        ("cut.stl", stl(CORNERS)[:-60], "cut.stl is cut off.*without-meshes"),
        ("other.ply", b"ply", "no decoder.*other.ply"),
    ):
        if content is not None:
            (tmp_path / name).write_bytes(content)
        path.write_text(robot(f'<asset><mesh name="m" file="{name}"/></asset>', arm=geom))
        with pytest.raises(ModelError, match=said):
            RobotDescription.from_mjcf(path, base="fixed")
    with pytest.raises(ModelError) as error:
        RobotDescription.from_mjcf(robot(arm='<geom type="mesh" mesh="m"/>'), base="fixed")
    assert "without-meshes" not in str(error.value)


def test_messages_of_mujoco_are_one_line_without_their_prefix() -> None:
    assert one_line(ValueError("XML Error: Error: two\n  lines")) == "two lines"
    assert one_line(ValueError("")) == "ValueError"


def test_geoms_of_a_body_are_drawn_by_their_group_and_collide_by_their_masks() -> None:
    """Those of groups 0 to 2 are drawn, all where there is none; of shapes of MuJoCo alone the boxes around them."""
    hidden = (
        '<geom name="g" type="ellipsoid" size=".1 .2 .3" group="4" contype="0" conaffinity="0" mass="0"/>'
    )
    shown = (
        '<geom type="box" size=".1 .1 .1" group="1" contype="0" conaffinity="0" mass="0" rgba=".1 .2 .3 .4"/>'
    )
    for geoms, drawn, touching in (
        ("", ["sphere"], ["sphere"]),
        (shown, ["sphere", "box"], ["sphere"]),
        (hidden, ["sphere"], ["sphere"]),
    ):
        shapes = RobotDescription.from_mjcf(robot(arm=geoms), base="fixed").mechanism.shapes
        own = [shape for shape in shapes if shape.link == "arm"]
        assert [shape.kind for shape in own if shape.role == "visual"] == drawn
        assert [shape.kind for shape in own if shape.role == "collision"] == touching
        if geoms == shown:
            assert own[0].colour != own[1].colour
            assert own[1].colour == pytest.approx((0.1, 0.2, 0.3, 0.4), abs=1e-6)
    alone = robot().replace(
        '<geom size=".1"/>\n<body name="tip"', hidden.replace('mass="0"', "") + '<body name="tip"'
    )
    description = RobotDescription.from_mjcf(alone, base="fixed")
    (box,) = [shape for shape in description.mechanism.shapes if shape.link == "arm"]
    assert (box.kind, box.role) == ("box", "visual") and box.size == pytest.approx([0.1, 0.2, 0.3])
    assert any("ellipsoid 'g'" in line for line in description.derived)


@pytest.mark.parametrize("number", [0, 1])
def test_the_colour_of_a_geom_is_that_of_its_material(number: int) -> None:
    assets = '<asset><material name="m0" rgba=".1 .2 .3 1"/><material name="m1" rgba=".4 .5 .6 1"/></asset>'
    geom = f'<geom type="box" size=".1 .1 .1" material="m{number}" rgba=".5 .5 .5 1" mass="0"/>'
    plain = '<geom type="box" size=".2 .1 .1" rgba=".7 .8 .9 1" mass="0"/>'
    shapes = RobotDescription.from_mjcf(robot(assets, arm=geom + plain), base="fixed").mechanism.shapes
    own, other = (shape.colour for shape in shapes if shape.kind == "box" and shape.role == "visual")
    model = mujoco.MjModel.from_xml_string(robot(assets, arm=geom + plain))
    assert own == pytest.approx(model.mat_rgba[number].tolist())
    assert other == pytest.approx((0.7, 0.8, 0.9, 1.0))


def test_a_field_of_heights_is_no_shape_of_a_robot() -> None:
    assets = '<asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset>'
    description = RobotDescription.from_mjcf(
        robot(assets, arm='<geom name="hill" type="hfield" hfield="h" mass="0"/>'), base="fixed"
    )
    assert any("hfield 'hill', left out" in line for line in description.derived)
    assert {shape.kind for shape in description.mechanism.shapes} == {"sphere"}


def test_gains_and_rotors_of_a_file_give_way_to_those_that_are_given() -> None:
    own = plain()
    given = RobotDescription.from_mjcf(biped(), gains={"left_knee": (7.0, 1.0)}, armature={"left_knee": 0.3})
    assert given.gains == {**own.gains, "left_knee": (7.0, 1.0)}
    assert given.armature == {**own.armature, "left_knee": 0.3}
    assert set(RobotDescription.from_mjcf(biped(), armature=0.4).armature.values()) == {0.4}
    assert not RobotDescription.from_mjcf(biped(), use_gains=False).gains


@pytest.mark.parametrize("what", ["mass", "inertia"])
def test_a_model_with_a_mass_that_is_no_number_is_refused(what: str) -> None:
    model = mujoco.MjModel.from_xml_string(robot())
    getattr(model, f"body_{what}")[2] = np.nan
    with pytest.raises(ModelError, match="body 'arm': mass, inertia and its place must be finite"):
        RobotDescription.from_mjcf(model, base="fixed")


def test_a_robot_without_a_name_is_called_as_its_root() -> None:
    assert RobotDescription.from_mjcf(robot(), base="fixed").name == "robot"
    named = robot().replace("<mujoco>", '<mujoco model="own">')
    assert RobotDescription.from_mjcf(named, base="fixed").name == "own"
    assert RobotDescription.from_mjcf(named, base="fixed", name="other").name == "other"


@pytest.mark.parametrize("tie", ["connect", "weld"])
def test_a_chain_is_closed_at_the_anchor_of_its_equality(tie: str) -> None:
    """By bodies and by sites; not by one that is inactive, and not between parts of one body."""
    arm = '<site name="s1" pos=".3 0 .1"/>'
    free = '<body name="rod" pos=".4 0 .1" euler="0 .3 0"><joint name="c" axis="0 1 0"/>'
    free += '<geom size=".05"/><site name="s2"/></body>'
    xml = robot(arm=arm + free, after="{}")
    anchor = '<equality><{0} name="t" {1}1="tip" {1}2="rod" {2}/></equality>'
    for more, closed in (('anchor="0 0 .05"', True), ('anchor="0 0 .05" active="false"', False)):
        text = xml.format(anchor.format(tie, "body", more)) if "{}" in xml else xml
        description = RobotDescription.from_mjcf(text, base="fixed", torque_limits={"c": 9.0})
        assert bool(description.closures) == closed
        if closed:
            robot_ = description.robot()
            (closure,) = description.closures
            assert closure.rotation == (tie == "weld")
            model = mujoco.MjModel.from_xml_string(text)
            data = mujoco.MjData(model)
            for name, value in description.half_sitting.items():
                data.joint(name).qpos = value
            mujoco.mj_kinematics(model, data)
            tip = data.body("tip" if tie == "connect" else "rod")
            place = tip.xpos + tip.xmat.reshape(3, 3) @ [0.0, 0.0, 0.05]
            for end in (closure.frame, closure.other):
                np.testing.assert_allclose(robot_.placement(end).translation, place, atol=1e-6)
    sites = '<equality><connect name="t" site1="{}" site2="{}"/></equality>'
    beside = robot(
        arm=arm + free.replace("s2", "s3") + '<site name="s2" pos=".1 0 .1"/>', after=sites.format("s1", "s2")
    )
    assert not RobotDescription.from_mjcf(beside, base="fixed", torque_limits={"c": 9.0}).closures
