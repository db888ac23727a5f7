"""Robots in SDF: shapes, inertias and joints are those that the file states."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from wbc.base.errors import ModelError
from wbc.robots import RobotDescription, read_sdf

LINK = '<link name="{name}"><pose>{pose}</pose>{more}</link>'
JOINT = """<joint name="{name}" type="{kind}"><parent>{parent}</parent><child>{child}</child><pose>{pose}</pose>{axis}
</joint>"""
INERTIAL = """<inertial><pose>0.01 0.02 0.03 0.1 0.2 0.3</pose><mass>2.5</mass><inertia><ixx>0.03</ixx><iyy>0.04</iyy>
<izz>0.05</izz><ixy>0.001</ixy><ixz>-0.002</ixz><iyz>0.003</iyz></inertia></inertial>"""


def model_of(folder: Path, links: str, joints: str = "", more: str = "") -> mujoco.MjModel:
    """Return MuJoCo's model of an SDF."""
    path = folder / "robot.sdf"
    path.write_text(
        f'<sdf version="1.6"><model name="m">{more}{links}{joints}</model></sdf>', encoding="utf-8"
    )
    return read_sdf(path).compile()


def pair(
    folder: Path, kind: str = "revolute", axis: str = "", *, swapped: bool = False, far: str = ""
) -> mujoco.MjModel:
    """Return two links and the joint between them, which lies in the axes of its child."""
    links = LINK.format(name="one", pose="0 0 1 0 0 0.5", more=INERTIAL)
    links += LINK.format(name="two", pose="0.3 0.1 1.2 0.4 -0.2 0.7", more=INERTIAL)
    parent, child = ("two", "one") if swapped else ("one", "two")
    joint = JOINT.format(
        name="j", kind=kind, parent=parent, child=child, pose="0.05 -0.02 0.1 0.3 0.1 -0.4", axis=axis
    )
    return model_of(folder, links, joint)


def test_a_model_has_its_name_and_one_without_is_a_robot(tmp_path: Path) -> None:
    for name, found in (('name="bars"', "bars"), ("", "robot")):
        (tmp_path / "a.sdf").write_text(
            f"<sdf><model {name}>{LINK.format(name='a', pose='0 0 0 0 0 0', more='')}</model></sdf>"
        )
        assert read_sdf(tmp_path / "a.sdf").modelname == found


def test_mass_and_inertia_are_those_of_the_file_or_one_each(tmp_path: Path) -> None:
    model = model_of(tmp_path, LINK.format(name="a", pose="0 0 0 0 0 0", more=INERTIAL))
    body = model.body("a")
    assert body.mass[0] == 2.5
    np.testing.assert_allclose(body.ipos, [0.01, 0.02, 0.03])
    full = np.array([[0.03, 0.001, -0.002], [0.001, 0.04, 0.003], [-0.002, 0.003, 0.05]])
    turn = pin.rpy.rpyToMatrix(0.1, 0.2, 0.3)
    w, x, y, z = body.iquat
    own = pin.Quaternion(w, x, y, z).matrix()
    np.testing.assert_allclose(own @ np.diag(body.inertia) @ own.T, turn @ full @ turn.T, atol=1e-9)
    bare = model_of(tmp_path, LINK.format(name="a", pose="0 0 0 0 0 0", more="")).body("a")
    assert bare.mass[0] == 1.0 and bare.inertia.tolist() == [1.0, 1.0, 1.0]


@pytest.mark.parametrize(
    ("shape", "kind", "size"),
    [
        ("<sphere><radius>0.3</radius></sphere>", "SPHERE", [0.3, 0.0, 0.0]),
        ("<box><size>0.2 0.4 0.8</size></box>", "BOX", [0.1, 0.2, 0.4]),
        ("<cylinder><radius>0.3</radius><length>0.8</length></cylinder>", "CYLINDER", [0.3, 0.4, 0.0]),
        ("<capsule><radius>0.3</radius><length>0.8</length></capsule>", "CAPSULE", [0.3, 0.4, 0.0]),
        ("<plane/>", "", []),
    ],
)
@pytest.mark.parametrize(("collide", "mask"), [("", 0), ("<self_collide>true</self_collide>", 1)])
def test_shapes_have_half_the_lengths_of_the_file_and_no_mass(
    shape: str, kind: str, size: list[float], collide: str, mask: int, tmp_path: Path
) -> None:
    """Links touch the ground, and each other where the file says so."""
    own = f'<collision name="c"><pose>0.1 0.2 0.3 0 0 0.5</pose><geometry>{shape}</geometry></collision>'
    model = model_of(tmp_path, LINK.format(name="a", pose="0 0 0 0 0 0", more=INERTIAL + own), more=collide)
    assert model.ngeom == bool(kind)
    if kind:
        assert int(model.geom_type[0]) == int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"))
        np.testing.assert_allclose(model.geom_size[0], size)
        np.testing.assert_allclose(model.geom_pos[0], [0.1, 0.2, 0.3])
        np.testing.assert_allclose(model.geom_quat[0], [np.cos(0.25), 0.0, 0.0, np.sin(0.25)])
        assert (int(model.geom_contype[0]), int(model.geom_conaffinity[0])) == (1, mask)
    assert model.body("a").mass[0] == 2.5


PLACES = {
    "one": pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 0.5), np.array([0.0, 0.0, 1.0])),
    "two": pin.SE3(pin.rpy.rpyToMatrix(0.4, -0.2, 0.7), np.array([0.3, 0.1, 1.2])),
}
AT = pin.SE3(pin.rpy.rpyToMatrix(0.3, 0.1, -0.4), np.array([0.05, -0.02, 0.1]))


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
@pytest.mark.parametrize(
    "in_model", ["", "<use_parent_model_frame>1</use_parent_model_frame>", "expressed_in"]
)
@pytest.mark.parametrize("swapped", [False, True])
def test_a_joint_moves_its_child_about_its_axis_in_the_axes_of_the_joint_or_the_model(
    kind: str, in_model: str, swapped: bool, tmp_path: Path
) -> None:
    """The other link moves the other way where the file names the two the other way round."""
    frame, said = ("", ' expressed_in="__model__"') if in_model == "expressed_in" else (in_model, "")
    limit = "<limit><lower>-0.5</lower><upper>0.8</upper></limit>"
    model = pair(tmp_path, kind, f"<axis><xyz{said}>0 0.6 0.8</xyz>{frame}{limit}</axis>", swapped=swapped)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    moved = "one" if swapped else "two"
    root = model.body(1).name
    joint = PLACES[moved] * AT
    axis = np.array([0.0, 0.6, 0.8]) if in_model else joint.rotation @ [0.0, 0.6, 0.8]
    base = pin.SE3(data.body(root).xmat.reshape(3, 3), data.body(root).xpos)
    to_world = base * PLACES[root].inverse()
    sign = 1.0 if root != moved else -1.0
    number = model.joint("j").id
    np.testing.assert_allclose(data.xaxis[number], sign * (to_world.rotation @ axis), atol=1e-9)
    np.testing.assert_allclose(data.xanchor[number], to_world.act(joint.translation), atol=1e-9)
    slide = int(model.jnt_type[number]) == int(mujoco.mjtJoint.mjJNT_SLIDE)
    assert slide == (kind == "prismatic")
    assert bool(model.jnt_limited[number]) == (kind != "continuous")
    assert kind == "continuous" or model.jnt_range[number].tolist() == [-0.5, 0.8]


def test_effort_damping_friction_and_springs_of_a_joint_are_those_of_the_file(tmp_path: Path) -> None:
    dynamics = (
        "<dynamics><damping>0.1</damping><friction>0.2</friction><spring_stiffness>7</spring_stiffness>"
        "<spring_reference>0.3</spring_reference></dynamics>"
    )
    limits = "<limit><effort>30</effort></limit>"
    model = pair(tmp_path, axis=f"<axis><xyz>1 0 0</xyz>{limits}{dynamics}</axis>")
    joint = model.joint("j")
    assert joint.damping[0] == 0.1 and joint.frictionloss[0] == 0.2 and joint.stiffness[0] == 7.0
    assert model.qpos_spring[joint.qposadr[0]] == 0.3 and not model.jnt_limited[joint.id]
    assert model.jnt_actfrcrange[joint.id].tolist() == [-30.0, 30.0] and model.jnt_actfrclimited[joint.id]
    for effort in ("", *(f"<limit><effort>{text}</effort></limit>" for text in ("-1", "0", "inf", "1e16"))):
        bare = pair(tmp_path, axis=f"<axis><xyz>1 0 0</xyz>{effort}</axis>")
        assert not bare.jnt_actfrclimited[0 if bare.njnt == 1 else bare.joint("j").id]
        assert bare.joint("j").stiffness[0] == bare.joint("j").damping[0] == 0.0


@pytest.mark.parametrize(("kind", "usual"), [("revolute", 20.0), ("prismatic", 1.0)])
def test_a_joint_is_as_fast_as_its_file_says(kind: str, usual: float, tmp_path: Path) -> None:
    """A spec has no place for it but a number of its own; a limit without end is none."""
    for text, speed in (("3", 3.0), ("inf", usual), ("-1", usual), ("1e16", usual), (None, usual)):
        limit = "" if text is None else f"<velocity>{text}</velocity>"
        axis = f"<axis><xyz>0 0 1</xyz><limit>{limit}<effort>9</effort></limit></axis>"
        model = pair(tmp_path, kind, axis)
        robot = RobotDescription.from_mjcf(model, feet=False)
        assert robot.velocity_limit.tolist() == [speed]
        assert any("velocity limits: " in line for line in robot.derived) == (speed == usual)


def test_a_ball_joint_is_three_hinges_in_its_axes_and_a_fixed_one_none(tmp_path: Path) -> None:
    model = pair(tmp_path, "ball", "<axis><dynamics><damping>0.1</damping></dynamics></axis>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    root = data.body("one").xmat.reshape(3, 3) @ PLACES["one"].rotation.T
    axes = np.stack([data.xaxis[model.joint(f"j_{axis}").id] for axis in "xyz"], axis=1)
    np.testing.assert_allclose(axes, root @ (PLACES["two"] * AT).rotation, atol=1e-9)
    assert [model.joint(f"j_{axis}").damping[0] for axis in "xyz"] == [0.1] * 3
    fixed = pair(tmp_path, "fixed")
    assert fixed.njnt == 1  # the free one
    with pytest.raises(ModelError, match="'j' is of type 'screw'"):
        pair(tmp_path, "screw")


def test_an_axis_in_the_frame_of_another_link_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="axis of joint 'j' must be in the frame of the joint .*'one'"):
        pair(tmp_path, axis='<axis><xyz expressed_in="one">0 0 1</xyz></axis>')


@pytest.mark.parametrize(
    ("xyz", "said"), [("0 1", "3 finite numbers"), ("0 nan 1", "3 finite"), ("up", "got 'up'")]
)
def test_an_axis_that_is_none_is_refused(xyz: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=f"axis of joint 'j' must be .*{said}"):
        pair(tmp_path, axis=f"<axis><xyz>{xyz}</xyz></axis>")


def test_links_are_named_once_and_joints_tie_links_of_the_model(tmp_path: Path) -> None:
    links = "".join(LINK.format(name=name, pose="0 0 0 0 0 0", more=INERTIAL) for name in "ab")
    twice = links.replace('"b"', '"a"')
    nameless = links.replace('<link name="b">', "<link>")
    for text, said in ((twice, "'a' twice"), (nameless, "none for number 2")):
        with pytest.raises(ModelError, match=said):
            model_of(tmp_path, text)
    with pytest.raises(ModelError, match="no joint ties link 'b' to 'a'"):
        model_of(tmp_path, links)
    mount = JOINT.format(name="m", kind="fixed", parent="world", child="a", pose="0 0 0 0 0 0", axis="")
    joint = JOINT.format(name="j", kind="revolute", parent="a", child="b", pose="0 0 0 0 0 0", axis="")
    bolted = model_of(tmp_path, links, mount + joint)
    assert bolted.njnt == 1 and bolted.joint(0).name == "j"
    with pytest.raises(ModelError, match="one <model> is required, it has 2"):
        (tmp_path / "two.sdf").write_text('<sdf><model name="a"/><world><model name="b"/></world></sdf>')
        read_sdf(tmp_path / "two.sdf")
