"""Robots never seen: what is derived from a bare URDF, and what is refused."""

from __future__ import annotations

import dataclasses
import pickle
import re
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from urdf_biped import ANKLE, FEET, FOOT_BOX, SHIN, THIGH, biped, described

from wbc.base.errors import InputError, ModelError, UnknownNameError
from wbc.core.frames import FrameDescription
from wbc.core.robot import Robot
from wbc.robots import RobotDescription, urdf
from wbc.robots.derivation.inertia import defect
from wbc.robots.mesh_files import mesh_folders, resolve
from wbc.robots.report import standing_torques
from wbc.robots.write_urdf import write


def mujoco_mass_matrix(description: RobotDescription) -> np.ndarray:
    """M at half-sitting from MuJoCo, joints in our order, base turned the same way as the world."""
    spec = mujoco.MjSpec.from_string(description.urdf_without_geometry())
    spec.worldbody.first_body().add_freejoint()
    model = spec.compile()
    data = mujoco.MjData(model)
    ids = [model.joint(name).id for name in description.joint_names]
    data.qpos[model.jnt_qposadr[ids]] = [description.half_sitting[name] for name in description.joint_names]
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    places = np.concatenate([np.arange(6), model.jnt_dofadr[ids]])
    return full[np.ix_(places, places)] + np.diag([0.0] * 6 + description.armature_array.tolist())


def test_urdf_and_sole_links_are_enough(tmp_path: Path) -> None:
    path = tmp_path / "biped.urdf"
    path.write_text(biped(geometry=FOOT_BOX))
    description = RobotDescription.from_urdf(path, **FEET)
    robot = description.robot()
    assert description.name == "biped"
    assert description.source == str(path)
    assert (robot.soles[0].length, robot.soles[0].width) == pytest.approx((0.20, 0.09))
    np.testing.assert_allclose(description.ankle("right_foot"), [-0.03, 0.0, 0.06], atol=1e-12)
    left, right = (robot.placement(sole.frame) for sole in robot.soles)
    for placement in (left, right):
        np.testing.assert_allclose(placement.rotation, np.eye(3), atol=1e-6)
        assert abs(placement.translation[2]) < 1e-6
    np.testing.assert_allclose(robot.com[:2], 0.0, atol=1e-6)
    knee = description.half_sitting["l_knee"]
    assert (
        knee == pytest.approx(description.half_sitting["r_knee"]) == pytest.approx(np.radians(40), abs=1e-6)
    )
    assert left.translation[1] - right.translation[1] == pytest.approx(0.2, abs=1e-6)
    np.testing.assert_array_equal(description.torque_limit, 80.0)
    np.testing.assert_allclose(mujoco_mass_matrix(description), robot.mass_matrix, atol=1e-9)


@pytest.mark.parametrize(
    "shape",
    [
        FOOT_BOX.replace("collision", "visual"),
        '<collision><origin xyz="0.03 0 -0.05" rpy="0 1.5707963267948966 0"/>'
        '<geometry><box size="0.02 0.09 0.20"/></geometry></collision>',
        "".join(
            f'<collision><origin xyz="{x} {y} -0.05"/><geometry><sphere radius="0.01"/></geometry></collision>'
            for x in (-0.07, 0.13)
            for y in (-0.045, 0.045)
        ),
        '<collision><origin xyz="0.03 0 -0.05"/><geometry><cylinder radius="0.09" length="0.02"/></geometry>'
        "</collision>" + FOOT_BOX,
        FOOT_BOX + '<collision><geometry><box size="0.30 0.30 0.10"/></geometry></collision>',
        "".join(
            f'<collision><origin xyz="0.03 {y} -0.05" rpy="0 1.5707963267948966 0"/>'
            '<geometry><capsule radius="0.01" length="0.2"/></geometry></collision>'
            for y in (-0.045, 0.045)
        ),
    ],
    ids=["visual", "turned box", "four spheres", "cylinder around a box", "wide shape above", "two capsules"],
)  # fmt: skip
def test_sole_rectangle_from_any_shape(shape: str) -> None:
    description = RobotDescription.from_urdf(biped(geometry=shape), **FEET)
    sole = description.soles[0]
    assert sole.length == pytest.approx(0.20)
    assert sole.width == pytest.approx(0.18 if "cylinder" in shape else 0.09)
    np.testing.assert_allclose(description.ankle("left_foot"), [-0.03, 0.0, 0.06], atol=1e-9)


def test_sole_rectangle_from_a_mesh(tmp_path: Path) -> None:
    corners = np.array([[x, y, z] for x in (-0.05, 0.15) for y in (-0.04, 0.04) for z in (-0.06, -0.02)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [triangle for a, b, c, d in sides for triangle in ((a, b, c), (a, c, d))]
    lines = [f"v {x} {y} {z}" for x, y, z in corners * 1000] + [
        f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces
    ]
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "foot.obj").write_text("\n".join(lines))
    mesh = '<mesh filename="package://parts/foot.obj" scale="0.001 0.001 0.001"/>'
    shape = f"<collision><geometry>{mesh}</geometry></collision>"
    description = RobotDescription.from_urdf(biped(geometry=shape), **FEET, package_dirs=(tmp_path,))
    assert (description.soles[0].length, description.soles[0].width) == pytest.approx((0.20, 0.08))
    np.testing.assert_allclose(description.ankle("left_foot"), [-0.05, 0.0, 0.06], atol=1e-9)
    # Without the file nothing says how far below the ankle the ground is, unless a frame does.
    with pytest.raises(ModelError, match="left_foot"):
        RobotDescription.from_urdf(biped(geometry=shape), **FEET)
    below = {
        f"{side}_sole": FrameDescription("sole", f"{side[0]}_ankle_roll_link", (0.0, 0.0, -ANKLE))
        for side in ("left", "right")
    }
    lost = RobotDescription.from_urdf(biped(geometry=shape), **below)
    ratios = np.array([0.152, 0.055]) / 0.530 * (THIGH + SHIN + ANKLE)
    assert (lost.soles[0].length, lost.soles[0].width) == pytest.approx(tuple(ratios))
    assert "no usable geometry" in "\n".join(lost.derived)
    assert [sole.frame for sole in lost.soles] == ["left_foot_sole", "right_foot_sole"]


@pytest.mark.parametrize("turn", [np.pi, 0.5 * np.pi, -0.5 * np.pi])
def test_a_root_that_looks_elsewhere_is_turned(turn: float) -> None:
    """The same biped seen from a base whose x axis points to the heels, or to a side."""
    xml = write(urdf.read(biped()).mechanism(False, turn), "turned", {}, shapes=True)
    description = RobotDescription.from_urdf(xml, **FEET)
    assert any("new root link" in line for line in description.derived)
    assert_same(description.robot(), described().robot())
    if turn == np.pi:
        with pytest.raises(ModelError, match="swapped soles"):
            RobotDescription.from_urdf(biped(), left_sole=FEET["right_sole"], right_sole=FEET["left_sole"])


def assert_same(one: Robot, other: Robot) -> None:
    """Compare two robots in half-sitting: mass matrix without the base's own frame, soles and torques."""
    assert one.joint_names == other.joint_names
    np.testing.assert_allclose(one.q, other.q, atol=1e-6)
    np.testing.assert_allclose(one.mass_matrix, other.mass_matrix, atol=1e-6)
    for sole in ("left_foot", "right_foot"):
        placements = [robot.placement(robot.sole(sole).frame) for robot in (one, other)]
        assert placements[0].isApprox(placements[1], 1e-6)


def test_locked_joints_are_fixed_at_their_position() -> None:
    free = RobotDescription.from_urdf(biped(), **FEET, half_sitting={"l_elbow": -0.7, "r_elbow": -0.7})
    locked = RobotDescription.from_urdf(biped(), **FEET, lock={"l_elbow": -0.7, "r_elbow": -0.7})
    assert set(free.joint_names) - set(locked.joint_names) == {"l_elbow", "r_elbow"}
    one, other = free.robot(), locked.robot()
    np.testing.assert_allclose(one.com, other.com, atol=1e-6)
    with pytest.raises(UnknownNameError, match="'l_elbow'"):
        RobotDescription.from_urdf(biped(), **FEET, lock={"l_elbw": 0.0})
    with pytest.raises(InputError, match="'l_elbow'"):
        RobotDescription.from_urdf(biped(), **FEET, lock={"l_elbow": -40.0})  # degrees


def test_a_turned_sole_link_gets_a_straight_sole_frame() -> None:
    """Some URDFs give the foot axes of its own; the sole must still look forward and up."""
    turned = "".join(
        f'<link name="{s}_foot"/><joint name="{s}_foot_fix" type="fixed"><parent link="{s}_ankle_roll_link"/>'
        f'<child link="{s}_foot"/><origin xyz="0.01 0 -{ANKLE}" rpy="0 1.5707963267948966 0.3"/></joint>'
        for s in "lr"
    )
    description = RobotDescription.from_urdf(
        biped(geometry="", after=turned), left_sole="l_foot", right_sole="r_foot", sole_size=(0.18, 0.08)
    )
    robot = description.robot()
    for sole in robot.soles:
        np.testing.assert_allclose(robot.placement(sole.frame).rotation, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(description.ankle("left_foot"), [-0.01, 0.0, ANKLE], atol=1e-9)
    assert "are not those of the base" in "\n".join(description.derived)


@pytest.mark.parametrize(("root", "kind"), [("world", "fixed"), ("odom", "floating"), ("footprint", "fixed")])
def test_any_root(root: str, kind: str) -> None:
    """A root that stands for the world, or that carries nothing, makes no difference to either library."""
    before = f'<link name="{root}"/>'
    after = f'<joint name="fix" type="{kind}"><parent link="{root}"/><child link="trunk"/></joint>'
    plain = described()
    other = RobotDescription.from_urdf(biped(geometry=FOOT_BOX, before=before, after=after), **FEET)
    assert other.robot().nv == plain.robot().nv
    np.testing.assert_allclose(mujoco_mass_matrix(other), plain.robot().mass_matrix, atol=1e-9)
    np.testing.assert_allclose(other.kp, plain.kp)
    if root == "world":
        renamed = RobotDescription.from_urdf(biped(geometry=FOOT_BOX, root="anything"), **FEET)
        assert renamed.torso == "anything"
        np.testing.assert_allclose(renamed.kp, plain.kp)


def soft(xml: str, *, joint: str = "l_knee", own: str = "", control: str = "") -> RobotDescription:
    """Return a robot with an element in a joint, and one of ros2_control."""
    start = xml.index(f'<joint name="{joint}"')
    end = xml.index("</joint>", start)
    block = (
        f'<ros2_control name="c" type="system"><joint name="{joint}">{control}</joint></ros2_control></robot>'
    )
    return RobotDescription.from_urdf((xml[:end] + own + xml[end:]).replace("</robot>", block), **FEET)


def command(low: str, high: str, kind: str = "position") -> str:
    """Return a command interface of ros2_control with a range."""
    params = f'<param name="min">{low}</param><param name="max">{high}</param>'
    return f'<command_interface name="{kind}">{params}</command_interface>'


SOFT = {  # elements → range of a knee of [-0.1, 2.6], said
    "inside": (
        '<safety_controller soft_lower_limit="0.15" soft_upper_limit="1.3" k_velocity="9"/>',
        "",
        (0.15, 1.3),
    ),
    "one side": (
        '<safety_controller soft_lower_limit="-9" soft_upper_limit="1.3" k_velocity="9"/>',
        "",
        (None, 1.3),
    ),
    "wider": (
        '<safety_controller soft_lower_limit="-9" soft_upper_limit="9" k_velocity="9"/>',
        "",
        (None, None),
    ),
    "none": ('<safety_controller k_velocity="9"/>', "", (None, None)),
    "beside": (
        '<safety_controller soft_lower_limit="8" soft_upper_limit="9" k_velocity="9"/>',
        "",
        (None, None),
    ),
    "command": ("", command("0.15", "1.3"), (0.15, 1.3)),
    "both": (
        '<safety_controller soft_lower_limit="0.1" soft_upper_limit="1.2" k_velocity="9"/>',
        command("0.15", "1.3"),
        (0.15, 1.2),
    ),
    "speed": ("", command("0.15", "1.3", "velocity"), (None, None)),
    "least": (
        "",
        '<command_interface name="position"><param name="min">0.2</param></command_interface>',
        (0.2, None),
    ),
    "most": (
        "",
        '<command_interface name="position"><param name="max">1.1</param></command_interface>',
        (None, 1.1),
    ),
}


@pytest.mark.parametrize("what", SOFT)
def test_soft_limits_bound_a_joint_and_are_named(what: str) -> None:
    own, control, (low, high) = SOFT[what]
    plain = described()
    robot = soft(biped(geometry=FOOT_BOX), own=own, control=control)
    knee = robot.joint_names.index("l_knee")
    before, after = ([float(side[knee]) for side in each.position_limits] for each in (plain, robot))
    assert after == [before[0] if low is None else low, before[1] if high is None else high]
    said = [line for line in robot.derived if "l_knee" in line and ("safety" in line or "ros2" in line)]
    assert bool(said) == (after != before or what == "beside")
    if what == "none":
        with pytest.raises(ModelError, match="l_knee.*not a number"):
            soft(biped(geometry=FOOT_BOX), control=command("${low}", "1.3"))


def changed(xml: str, joint: str, kind: str, inside: str = "") -> str:
    """Return a URDF with a joint of another type and with a further element in it."""
    before, own, after = re.split(f'(<joint name="{joint}".*?)(?=</joint>)', xml, maxsplit=1)
    return before + own.replace('type="revolute"', f'type="{kind}"') + inside + after


def test_a_joint_without_end_has_the_range_of_what_is_coupled_to_it_or_that_is_given() -> None:
    """The follower moves by 2 · leader + 0.5 within ±1.5 rad; a joint that slides goes on sliding."""
    mimic = '<mimic joint="l_elbow" multiplier="2" offset="0.5"/>'
    xml = changed(changed(biped(), "l_elbow", "continuous"), "r_elbow", "revolute", mimic)
    robot = RobotDescription.from_urdf(xml, **FEET).robot()
    i = robot.joint_index("l_elbow")
    assert (robot.position_lower[i], robot.position_upper[i]) == pytest.approx((-1.0, 0.5))
    xml = changed(changed(biped(), "l_elbow", "continuous"), "r_elbow", "prismatic")
    given = {"l_elbow": (-0.7, 0.9), "r_elbow": (-0.1, 0.2), "l_roll": (-0.3, 0.4)}
    robot = RobotDescription.from_urdf(xml, **FEET, position_limits=given).robot()
    for name, bounds in given.items():
        i = robot.joint_index(name)
        assert (robot.position_lower[i], robot.position_upper[i]) == pytest.approx(bounds)
    kinds = {name: robot.model.joints[robot.model.getJointId(name)].shortname() for name in given}
    assert [name for name, kind in kinds.items() if kind.startswith("JointModelP")] == ["r_elbow"]


PLACES = {
    "relative": "../meshes/hull 1.obj",
    "file": "file://../meshes/hull%201.obj",
    "whole path": "{home}/meshes/hull 1.obj",
    "whole URL": "file://{home}/meshes/hull%201.obj",
    "URL of this machine": "file://localhost{home}/meshes/hull%201.obj",
    "backslashes": "..\\meshes\\hull 1.obj",
    "package around the file": "package://my_robot/meshes/hull 1.obj",
    "package by another name": "package://other/meshes/hull 1.obj",
    "model": "model://my_robot/meshes/hull 1.obj",
    "nowhere": "package://my_robot/meshes/gone.obj",
    "unexpanded": "$(find my_robot)/meshes/hull 1.obj",
}


def test_meshes_are_found_from_the_folder_of_the_file_or_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the working directory, and after the description has been pickled."""
    home = tmp_path / "my_robot"
    for folder in ("urdf", "meshes"):
        (home / folder).mkdir(parents=True)
    hull = home / "meshes" / "hull 1.obj"
    hull.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    monkeypatch.chdir(tmp_path)
    for what, name in PLACES.items():
        folders, notes = mesh_folders([name.format(home=home)], (), home / "urdf")
        found, lost = resolve(name.format(home=home), folders), what in ("nowhere", "unexpanded")
        assert (found is None) == bool(notes) == lost and (lost or hull.samefile(found)), what
    shape = f'<collision><geometry><mesh filename="{PLACES["relative"]}"/></geometry></collision>'
    xml = biped(geometry=FOOT_BOX).replace('<link name="trunk">', f'<link name="trunk">{shape}', 1)
    (home / "urdf" / "robot.urdf").write_text(xml)
    robot = pickle.loads(pickle.dumps(RobotDescription.from_urdf(home / "urdf" / "robot.urdf", **FEET)))
    assert len(robot.collision_shapes()["trunk"]) == 1


def test_missing_limits_come_from_mass_and_size() -> None:
    """Ranges of half a turn, speeds of 6 rad/s and 0.5 m/s, torques that can carry the robot."""
    tail = "".join(
        f'<link name="{name}">{MASS.replace("1", mass, 1)}</link><joint name="{name}_joint" type="{kind}">'
        f'<parent link="trunk"/><child link="{name}"/><axis xyz="0 0 1"/>{limit}</joint>'
        for name, kind, mass, limit in (
            ("finger", "revolute", "1e-3", ""),
            ("lift", "prismatic", "0.5", '<limit lower="-3.1415927" upper="3.1415927"/>'),
        )
    )
    without = RobotDescription.from_urdf(biped(geometry=FOOT_BOX, limits="", after=tail), **FEET)
    robot = without.robot()
    np.testing.assert_allclose(robot.position_upper, np.pi)
    slides = np.arange(robot.na) == robot.joint_index("lift_joint")
    np.testing.assert_allclose(robot.velocity_limit, np.where(slides, 0.5, 6.0))
    moment = robot.mass * 9.80665 * robot.com[2]
    legs = [robot.joint_index(name) for leg in without.legs for name in leg]
    np.testing.assert_allclose(robot.torque_limit[legs], 0.25 * moment, rtol=1e-9)
    others = np.delete(np.arange(robot.na), legs)
    least, lift = (robot.torque_limit[robot.joint_index(f"{name}_joint")] for name in ("finger", "lift"))
    assert (least, lift) == pytest.approx((0.005 * moment, 3.0 * 0.5 * 9.80665))
    rng = np.random.default_rng(1)
    for _ in range(20):
        q = np.array(robot.half_sitting)
        q[7:] = rng.uniform(-np.pi, np.pi, robot.na)
        gravity = np.abs(pin.computeGeneralizedGravity(robot.model, robot.data, q)[6:])
        assert (robot.torque_limit[others] >= gravity[others]).all()
    assert "torque limits not given" in "\n".join(without.derived)
    # MuJoCo is fed the same limits.
    assert without.urdf.count('effort="0"') == 0


def test_an_imu_is_a_link_called_so_nearest_to_the_root_and_the_torso_carries_the_arms() -> None:
    def fixed(*names: tuple[str, str]) -> str:
        return "".join(
            f'<link name="{name}"/><joint name="{name}_imu_fix" type="fixed"><parent link="{parent}"/>'
            f'<child link="{name}"/><origin xyz="0 0 0.1"/></joint>'
            for name, parent in names
        )

    hand, trunk = ("imu_hand", "l_elbow_link"), ("Body_IMU", "trunk")
    for links, frame in (((hand, trunk), "Body_IMU"), ((hand,), "trunk"), ((), "trunk")):
        description = RobotDescription.from_urdf(biped(after=fixed(*links)), **FEET)
        assert description.imu.frame == frame and any(
            f"IMU: frame '{frame}'" in each for each in description.derived
        )
        assert description.torso == "trunk"


def test_random_inertias_are_judged_as_mujoco_judges_them() -> None:
    """MuJoCo compiles a body of the inertias that we accept, and refuses the others."""
    rng, accepted = np.random.default_rng(3), 0
    for _ in range(100):
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        inertia = axes @ np.diag(rng.uniform(0.001, 0.02, 3)) @ axes.T
        spec = mujoco.MjSpec()
        body = spec.worldbody.add_body(mass=2.0, explicitinertial=True)
        body.fullinertia = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        if fine := not defect(2.0, inertia):
            spec.compile()
        else:
            with pytest.raises(ValueError, match="inertia"):
                spec.compile()
        accepted += fine
    assert 20 < accepted < 80


def test_joints_that_only_stand_near_their_torque_limit_are_doubted() -> None:
    fine = described().robot()
    torque = 80.0 * standing_torques(fine)["l_knee"]
    for share, doubted in ((0.61, True), (0.59, False)):
        limit = torque / share
        weak = RobotDescription.from_urdf(biped().replace('effort="80"', f'effort="{limit}"'), **FEET)
        line = "standing still takes more than 60% of the torque limit of: l_knee 61%, r_knee 61%"
        assert (line in weak.doubts()) == doubted


MASS = '<inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'


CIRCLE = "".join(
    f'<link name="{a}"/><joint name="{a}{b}" type="fixed"><parent link="{a}"/><child link="{b}"/></joint>'
    for a, b in (("one", "two"), ("two", "one"))
)


def first(pattern: str, by: str) -> str:
    """Return the biped with the first match of a pattern replaced."""
    return re.sub(pattern, by, biped(), count=1, flags=re.DOTALL)


FILES: dict[str, tuple[str, str]] = {
    "a missing file": ("nowhere/robot.urdf", "nowhere/robot.urdf"),
    "an MJCF": ("<mujoco><worldbody/></mujoco>", "<robot>"),
    "no links": ('<robot name="r"/>', "links"),
    "two roots": (biped(before='<link name="stray"/>'), "stray"),
    "a circle": (biped(after=CIRCLE), "two"),
    "a child that is missing": (first('<child link="l_knee_link"', '<child link="gone"'), "gone"),
    "two links of a name": (first('<link name="r_elbow_link"', '<link name="l_elbow_link"'), "l_elbow_link"),
    "an axis of zero": (first(r'(name="l_knee".*?<axis xyz=)"[^"]*"', r'\1"0 0 0"'), "l_knee"),
    "a planar joint": (biped(kind="planar"), "planar"),
    "crossed limits": (biped(limits='lower="1" upper="1" effort="1" velocity="1"'), "hip_yaw"),
}


@pytest.mark.parametrize("what", FILES)
def test_a_file_that_is_no_robot_is_refused(what: str) -> None:
    source, named = FILES[what]
    with pytest.raises((InputError, ModelError), match=named):
        RobotDescription.from_urdf(source, **FEET)


OPTIONS: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"left_sole": "l_ankle_rol_link"}, UnknownNameError, "l_ankle_roll_link"),
    ({"right_sole": "l_ankle_roll_link"}, ModelError, "leg"),
    ({"left_sole": "trunk"}, ModelError, "root"),
    ({"sole_size": (200, 100)}, InputError, "length"),
    ({"half_sitting": {"l_knee": 3.0}}, InputError, "l_knee"),
    ({"position_limits": {"l_ankle_pitch": (0.5, 0.8)}}, ModelError, "half-sitting within the joint limits"),
    ({"armature": -0.1}, InputError, "armature"),
    ({"torque_limits": {"l_knee": 0.0}}, InputError, "torque"),
    ({"position_limits": {"l_knee": (1.0, 0.0)}}, InputError, "l_knee"),
]


@pytest.mark.parametrize(("options", "error", "named"), OPTIONS)
def test_an_option_that_does_not_fit_is_refused(
    options: dict[str, Any], error: type[Exception], named: str
) -> None:
    with pytest.raises(error, match=named):
        RobotDescription.from_urdf(biped(), **{**FEET, **options})


@pytest.mark.parametrize(("heavier", "said"), [(0.02, False), (0.4, True)])
def test_legs_of_another_mass_are_doubtful_from_a_hundredth_on(heavier: float, said: bool) -> None:
    """A leg weighs 6 kg: 4 joints of 0.5 kg and two links of 2 kg; one shin is made heavier."""
    xml = biped()
    at = xml.index('<link name="r_knee_link">')
    one = xml[:at] + xml[at:].replace('<mass value="2"/>', f'<mass value="{2.0 + heavier}"/>', 1)
    lines = [line for line in RobotDescription.from_urdf(one, **FEET).doubts() if "differ in mass" in line]
    assert lines == ([f"the legs differ in mass: 6.00 and {6.0 + heavier:.2f} kg"] if said else [])


@pytest.mark.parametrize(
    ("dynamics", "said"), [('damping="0"', False), ('damping="0.5"', True), ('friction="2"', True)]
)
def test_damping_of_a_urdf_is_left_out_and_said_to_be_where_it_is_any(dynamics: str, said: bool) -> None:
    xml = biped().replace('<axis xyz="0 0 1"/>', f'<axis xyz="0 0 1"/><dynamics {dynamics}/>')
    derived = RobotDescription.from_urdf(xml, **FEET).derived
    line = "damping and friction that the URDF gives 2 joints are left out"
    assert any(line in each for each in derived) == said


@pytest.mark.parametrize("lacks", ["mass", "inertia"])
def test_an_inertial_without_mass_or_inertia_is_refused(lacks: str) -> None:
    xml = re.sub(rf"<{lacks} [^>]*/>", "", biped(), count=1)
    with pytest.raises(ModelError, match="must have <mass> and <inertia>"):
        RobotDescription.from_urdf(xml, **FEET)


@pytest.mark.parametrize(("kd", "damping", "said"), [(0.0, 0.0, True), (1.0, 1.0, False), (0.0, 1.0, False)])
def test_servos_without_any_damping_are_doubtful(kd: float, damping: float, said: bool) -> None:
    description = described()
    own = dataclasses.replace(
        description,
        gains={**description.gains, "l_knee": (100.0, kd)},
        damping={"l_knee": damping} if damping else {},
    )
    assert any("without damping" in line and "l_knee" in line for line in own.doubts()) == said
