"""Descriptions read from MJCF: the dynamics are MuJoCo's, the file's values are kept, bad files are named."""

from __future__ import annotations

import re
import tracemalloc
from pathlib import Path

import mujoco
import numpy as np
import pytest
from mjcf_biped import CAPSULES, MOTORS, biped
from mjcf_robot import plain
from mujoco_dynamics import assert_same_dynamics

from wbc.base.errors import ModelError, UnknownNameError
from wbc.robots import RobotDescription
from wbc.robots.derivation.link_shapes import link_shapes
from wbc.robots.mechanism import placement_of
from wbc.sim import Plant


def test_the_dynamics_are_those_of_mujoco(tmp_path: Path) -> None:
    """Anchors, references, two joints in a body, frames, slides and a second free body included."""
    xml, path = biped(), tmp_path / "biped.xml"
    path.write_text(xml)
    model = mujoco.MjModel.from_xml_string(xml)
    assert plain().name == "little_biped"
    assert_same_dynamics(plain(), model)
    for source in (path, mujoco.MjSpec.from_string(xml), model):
        assert RobotDescription.from_mjcf(source).digest == plain().digest


def test_what_the_file_says_is_kept() -> None:
    description = plain()
    names = description.joint_names
    torque = dict(zip(names, description.torque_limit, strict=True))
    assert torque["left_knee"] == 80.0 and torque["waist"] == 60.0
    assert description.gains == {"waist": (200.0, 10.0)}  # the damping of its joint, 0.5, acts beside it
    assert set(description.armature.values()) == {0.02}
    assert description.damping["left_knee"] == 0.5 and description.frictionloss["left_knee"] == 0.1
    assert description.imu.frame == "imu_here" and description.imu.link == "pelvis"
    np.testing.assert_allclose(description.imu.rpy, [0.0, 0.0, np.pi / 2], atol=1e-12)
    assert description.sensors == {
        "gyroscope": "turning",
        "accelerometer": "pushing",
        "left_foot force": "left_load",
    }
    low, high = description.position_limits
    knee = names.index("left_knee")
    np.testing.assert_allclose(np.degrees([low[knee], high[knee]]), [-5.0, 140.0])
    assert any("ball" in line for line in description.derived)


def test_joints_have_the_order_of_the_file_and_sites_are_frames() -> None:
    description = plain()
    model = mujoco.MjModel.from_xml_string(biped())
    names = [model.joint(i).name for i in range(model.njnt)]
    assert list(description.joint_names) == [name for name in names if name in description.joint_names]
    robot, data = description.robot(), mujoco.MjData(model)
    data.joint("floating").qpos = [*robot.q[:3], 1.0, 0.0, 0.0, 0.0]
    for name, value in description.half_sitting.items():
        data.joint(name).qpos = value
    mujoco.mj_kinematics(model, data)
    for site in ("imu_here", "left_load_cell"):
        place = robot.placement(site)
        np.testing.assert_allclose(place.translation, data.site(site).xpos, atol=1e-9)
        np.testing.assert_allclose(place.rotation.ravel(), data.site(site).xmat, atol=1e-9)


def test_a_site_may_have_any_name_in_the_plant() -> None:
    """Also those of the plant's own sites."""
    names = {"imu_here": "imu_site", "left_load_cell": "left_hand site"}
    xml = biped()
    for old, new in names.items():
        xml = xml.replace(f'"{old}"', f'"{new}"')
    description = RobotDescription.from_mjcf(xml, hands={"left_hand": "left_arm", "right_hand": "right_arm"})
    plant = Plant(description, scene="<mujoco/>")
    assert plant.model.site("imu_site").id >= 0 and description.robot().frame_id("left_hand site")
    plant.step(plant.hold())
    feet = RobotDescription.from_mjcf(
        biped().replace('"left_foot"', '"foot"').replace("left_load_cell", "left_foot")
    )
    robot = feet.robot()
    assert (
        robot.frame_id("left_foot") == robot.frame_id(feet.soles[0].frame) != robot.frame_id("left_foot_site")
    )


def test_an_mjcf_is_a_urdf_for_other_engines() -> None:
    """The same dynamics, shapes, and places of links and sites; joints of one link get a link each."""
    urdf = RobotDescription.from_urdf(plain().urdf, armature=dict(plain().armature))
    own, again = plain().robot(), urdf.robot()
    shapes = [each.collision_shapes() for each in (plain(), urdf)]
    assert set(shapes[0]) == set(shapes[1])
    for link in shapes[0]:
        for one, other in zip(shapes[0][link], shapes[1][link], strict=True):
            assert type(one) is type(other) and one.radius == pytest.approx(other.radius)
    rng = np.random.default_rng(4)
    values, speeds = ({name: rng.uniform(-0.3, 0.3) for name in own.joint_names} for _ in range(2))
    for robot in (own, again):
        q, v = np.array(robot.half_sitting), np.zeros(robot.nv)
        q[:3] = 0.0
        q[7:], v[6:] = ([each[name] for name in robot.joint_names] for each in (values, speeds))
        robot.update(q, v)
    order = [own.joint_index(name) for name in again.joint_names]
    damping = own.damping * own.v[6:]
    np.testing.assert_allclose(again.bias[6:], (own.bias[6:] - damping)[order], atol=1e-6)
    frames = [f.name for f in own.model.frames if again.model.existFrame(f.name) and "universe" not in f.name]
    assert {"imu_here", "left_load_cell", "left_foot", "left_shin"} <= {*frames}
    for frame in frames:
        assert again.placement(frame).isApprox(own.placement(frame), 1e-9), frame


def test_armature_that_a_default_class_gives_the_free_joint_is_named_and_left_out_on_both_sides() -> None:
    """No rotor turns a floating base: neither in the controller's model nor in the plant's."""
    xml = biped().replace('<freejoint name="floating"/>', '<joint name="floating" type="free"/>')
    assert mujoco.MjModel.from_xml_string(xml).dof_armature[:12].any(), (
        "a joint takes it, a freejoint does not"
    )
    description = RobotDescription.from_mjcf(xml)
    assert any("'floating'" in line and "armature of 0.02" in line for line in description.doubts())
    np.testing.assert_array_equal(description.robot().mass_matrix, plain().robot().mass_matrix)
    np.testing.assert_array_equal(Plant(description).model.dof_armature[:6], 0.0)


FEET = {
    "capsules": CAPSULES,
    "box": '<geom class="foot" type="box" size="0.105 0.05 0.02" pos="0.035 0 -0.05"/>',
    "spheres": "".join(
        f'<geom class="foot" type="sphere" size="0.02" pos="{x} {y} -0.05"/>'
        for x in (-0.07, 0.14)
        for y in (-0.05, 0.05)
    ),
    "cylinder": '<geom class="foot" type="cylinder" size="0.05 0.02" pos="0.035 0 -0.05"/>',
    # Turned by 30° each stands 9.45 mm in front of its middle and 22.91 mm below it.
    "ellipsoids": "".join(
        f'<geom class="foot" type="ellipsoid" size="0.03 0.01 0.02" euler="0 30 0" pos="{x - 0.00945} {y} -0.04709"/>'
        for x in (-0.07, 0.14)
        for y in (-0.05, 0.05)
    ),
    "mesh": '<geom class="foot" type="mesh" mesh="shoe" pos="0.035 0 -0.05" euler="90 0 0"/>',
    "mesh with a chamfer": '<geom class="foot" type="mesh" mesh="boot" pos="0.035 0 0"/>',
}
SHOE = (
    '<asset><mesh name="shoe" vertex="-0.105 -0.02 -0.05 0.105 -0.02 -0.05 -0.105 0.02 -0.05 0.105 0.02 -0.05 '
    '-0.105 -0.02 0.05 0.105 -0.02 0.05 -0.105 0.02 0.05 0.105 0.02 0.05"/><mesh name="boot" vertex="{}"/></asset>'
).format(
    " ".join(
        f"{x} {y} {z}"
        for y in (-0.05, 0.05)
        for x, z in ((-0.105, -0.07), (0.105, -0.07), (0.15, -0.03), (0.15, 0.25), (-0.105, 0.25))
    )
)
SIZES = {"capsules": (0.19, 0.08), "cylinder": (0.1, 0.1)}


@pytest.mark.parametrize("kind", FEET)
def test_soles_come_from_the_geoms_that_touch_the_ground(kind: str) -> None:
    description = RobotDescription.from_mjcf(biped(FEET[kind], extra=SHOE if "mesh" in kind else ""))
    for sole in description.soles:
        np.testing.assert_allclose((sole.length, sole.width), SIZES.get(kind, (0.21, 0.1)), atol=1e-3)
        np.testing.assert_allclose(description.ankle(sole.name), [-0.035, 0.0, 0.07], atol=1e-3)


def test_a_sole_of_a_fine_mesh_takes_memory_in_proportion_to_its_vertices() -> None:
    """A matrix of vertices by vertices would take 128 MB here, and gigabytes for the meshes of real robots."""
    x, y = np.meshgrid(np.linspace(-0.105, 0.105, 80), np.linspace(-0.05, 0.05, 50))
    bottom = np.stack([x.ravel(), y.ravel(), np.full(x.size, -0.07)], axis=1)
    top = [[x, y, 0.02] for x in (-0.08, 0.08) for y in (-0.04, 0.04)]
    vertices = " ".join(f"{value:.6f}" for value in np.concatenate([bottom, top]).ravel())
    foot = '<geom class="foot" type="mesh" mesh="boot" pos="0.035 0 0"/>'
    model = mujoco.MjModel.from_xml_string(
        biped(foot, extra=f'<asset><mesh name="boot" vertex="{vertices}"/></asset>')
    )
    tracemalloc.start()
    try:
        description = RobotDescription.from_mjcf(model)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    np.testing.assert_allclose(
        (description.soles[0].length, description.soles[0].width), (0.21, 0.1), atol=1e-3
    )
    assert most < 8 * len(bottom) ** 2 / 4


def test_feet_are_named_by_body_site_or_geom() -> None:
    site = (
        '<site name="{0}_sole" pos="0.03 0 -0.07"/>'
        '<geom name="{0}_box" class="foot" type="box" size="0.1 0.05 0.02" pos="0.03 0 -0.05"/>'
    )
    xml = biped("<site/>")
    for side in ("left", "right"):
        xml = xml.replace(
            f'<site name="{side}_load_cell" pos="0 0 -0.03"/>',
            f'<site name="{side}_load_cell"/>' + site.format(side),
        )
    by = {
        what: RobotDescription.from_mjcf(xml, left_sole=f"left_{what}", right_sole=f"right_{what}")
        for what in ("foot", "sole", "box")
    }
    for what, description in by.items():
        np.testing.assert_allclose(
            description.ankle("left_foot"), [-0.03, 0.0, 0.07], atol=1e-9, err_msg=what
        )
        np.testing.assert_allclose(description.soles[1].length, 0.2, atol=1e-9)
    with pytest.raises(UnknownNameError, match="'left_foot'"):
        RobotDescription.from_mjcf(xml, left_sole="left_fot")


SHAM = (
    '<geom name="{0}_a" type="box" size="0.1 0.05 0.02" pos="0.03 0 -0.05"/>'
    '<geom name="{0}_b" type="box" size="0.12 0.06 0.02" pos="0.03 0 -0.04" group="3"/>'
)
PAIRS = "".join(
    f'<pair geom1="{one}" geom2="{two}"/>' for one, two in (("left_a", "ground"), ("ground", "right_a"))
)
APART = "".join(
    f'<exclude body1="{one}" body2="{two}"/>'
    for one, two in (("world", "left_foot"), ("right_foot", "world"))
)


@pytest.mark.parametrize(
    ("geoms", "extra", "length", "says"),
    [
        (SHAM, "", 0.24, "those of group 3"),
        (SHAM.replace('group="3"', 'group="2"'), "", 0.2, "all its geoms"),
        (SHAM, f"<contact>{PAIRS}</contact>", 0.2, ""),
        (SHAM.replace("<geom ", '<geom class="foot" '), "", 0.2, ""),
        (
            SHAM.replace("<geom ", '<geom class="foot" '),
            f"<contact>{APART}</contact>",
            0.24,
            "those of group 3",
        ),
        (SHAM.replace("<geom ", '<geom conaffinity="1" ', 1), "", 0.2, ""),
        (SHAM.replace("<geom ", '<geom contype="1" ', 1), "", 0.2, ""),
        (SHAM.replace("<geom ", '<geom contype="2" conaffinity="4" ', 1), "", 0.24, "those of group 3"),
    ],
)
def test_a_sole_is_what_touches_the_ground_else_what_is_drawn_as_collisions(
    geoms: str, extra: str, length: float, says: str
) -> None:
    xml = biped("<site/>", extra=extra)
    for side in ("left", "right"):
        cell = f'<site name="{side}_load_cell"'
        xml = xml.replace(f'{cell} pos="0 0 -0.03"/>', f"{cell}/>{geoms.format(side)}")
    description = RobotDescription.from_mjcf(xml)
    assert description.soles[0].length == pytest.approx(length) and description.soles[
        1
    ].length == pytest.approx(length)
    said = [line for line in description.derived if "no geom" in line]
    assert len(said) == (2 if says else 0) and all(says in line for line in said)


@pytest.mark.parametrize(("tilt", "noted"), [(0.9, False), (10.0, True)])
def test_the_sole_of_a_foot_that_is_tilted_in_the_file_is_its_flat_side(tilt: float, noted: bool) -> None:
    """Of one that is nearly level the axes are those of the base."""
    box = f'<geom class="foot" type="box" size="0.1 0.05 0.02" euler="0 {tilt} 0" pos="0.03 0 -0.05"/>'
    description = RobotDescription.from_mjcf(biped(box))
    note = "left_foot: at qpos0 the foot is tilted by 10°; the sole is its flat side"
    assert (note in description.derived) == noted
    for sole in description.soles:
        np.testing.assert_allclose(sole.rpy, [0.0, np.radians(tilt) if noted else 0.0, 0.0], atol=1e-4)
        assert sole.length == pytest.approx(0.2, abs=1e-3) if noted else sole.length > 0.1


def test_a_file_is_read_without_its_meshes_where_no_mass_is_theirs(tmp_path: Path) -> None:
    assets = '<asset><texture name="skin" type="2d" file="gone.png"/><material name="skin" texture="skin"/>{}</asset>'
    hat = '<geom type="mesh" mesh="hat" material="skin" contype="0" conaffinity="0"/>'
    file = tmp_path / "biped.xml"
    xml = biped(extra=assets.format('<mesh name="hat" file="gone.obj"/>'))
    file.write_text(xml.replace('<joint name="waist"', f'{hat}<joint name="waist"'))
    without = RobotDescription.from_mjcf(file, meshes=False)
    np.testing.assert_allclose(without.robot().mass_matrix, plain().robot().mass_matrix, atol=1e-12)
    assert set(plain().robot().velocity_limit) == {20.0, 1.0}, "of hinges and of a slide: an MJCF gives none"
    with pytest.raises(ModelError, match="gone"):
        RobotDescription.from_mjcf(file)
    file.write_text(xml.replace('<joint name="left_shoulder"', f'{hat}<joint name="left_shoulder"'))
    with pytest.raises(ModelError, match="'left_arm'"):
        RobotDescription.from_mjcf(file, meshes=False)


def key(name: str, bend: float, arm: float = 0.3) -> str:
    """Return a keyframe: the ball, the floating base, the legs with a knee bend (rad), the upper body."""
    leg = f"0 0 {-0.5 * bend} {bend + np.radians(20.0)} {-0.5 * bend} 0"
    qpos = f"2 0 0.1 1 0 0 0  0 0 0.9 1 0 0 0  {leg} {leg} 0 {arm} 0 {arm} 0"
    return f'<keyframe><key name="{name}" qpos="{qpos}"/></keyframe>'


@pytest.mark.parametrize("turn", [(24, -23, -5)])
def test_half_sitting_is_found_where_legs_are_spread_at_zero(turn: tuple[int, int, int]) -> None:
    """Ankles that roll by 12° cannot hold the feet flat as far apart as spread legs have them; nearer they can."""
    xml = biped().replace('axis="1 0 0" range="-30 30"', 'axis="1 0 0" range="-12 12"')
    for side, sign in (("left", 1), ("right", -1)):
        euler = f"{sign * turn[0]} {turn[1]} {sign * turn[2]}"
        xml = xml.replace(f'<body name="{side}_hip" pos', f'<body name="{side}_hip" euler="{euler}" pos')
    description = RobotDescription.from_mjcf(xml)
    robot = description.robot()
    low, high = description.position_limits
    joints = [description.half_sitting[name] for name in description.joint_names]
    assert (joints >= low).all() and (joints <= high).all()
    places = [robot.placement(sole.frame) for sole in robot.soles]
    middle = 0.5 * (places[0].translation + places[1].translation)
    np.testing.assert_allclose(robot.com[:2], middle[:2], atol=1e-6)
    for place in places:
        np.testing.assert_allclose(place.rotation[2], [0.0, 0.0, 1.0], atol=1e-5)
        assert abs(place.translation[2]) < 1e-5


def test_half_sitting_is_a_keyframe_in_which_the_robot_stands() -> None:
    stands = RobotDescription.from_mjcf(biped(extra=key("stand", 0.6)))
    assert "half-sitting: keyframe 'stand'" in stands.derived
    assert stands.half_sitting["left_knee"] == pytest.approx(0.6 + np.radians(20.0))
    straight = RobotDescription.from_mjcf(biped(extra=key("stand", 0.0)))
    assert straight.half_sitting["left_shoulder"] == pytest.approx(0.3)
    assert straight.half_sitting["left_knee"] == pytest.approx(np.radians(40.0), abs=0.02)


def test_a_root_that_looks_backward_is_turned() -> None:
    """Everything below the pelvis turned by half a turn: feet that are found and feet that are named."""
    xml = biped()
    start, end = xml.index('<body name="left_hip"'), xml.rindex("</body>", 0, xml.index("</worldbody>"))
    backward = f'{xml[:start]}<frame euler="0 0 180">{xml[start:end]}</frame>{xml[end:]}'
    plain = RobotDescription.from_mjcf(xml).robot()
    for names in ({}, {"left_sole": "left_foot", "right_sole": "right_foot"}):
        turned = RobotDescription.from_mjcf(backward, **names)
        assert any("new root link 'pelvis_forward'" in line for line in turned.derived)
        assert turned.soles[0].link == "left_foot"
        robot = turned.robot()
        for sole in ("left_foot", "right_foot"):
            place, expected = (each.placement(each.sole(sole).frame) for each in (robot, plain))
            np.testing.assert_allclose(place.rotation, expected.rotation, atol=1e-6)
            np.testing.assert_allclose(place.translation[1:], expected.translation[1:], atol=1e-2)


def test_locked_joints_are_fixed_where_they_are_told() -> None:
    xml = biped()
    description = RobotDescription.from_mjcf(xml, lock={"waist": 0.4, "right_reach": 0.1})
    assert not {"waist", "right_reach"} & set(description.joint_names)
    spec = mujoco.MjSpec.from_string(xml)
    model = spec.compile()
    data = mujoco.MjData(model)
    robot = description.robot()
    for name, value in description.half_sitting.items():
        data.qpos[model.joint(name).qposadr] = value
    data.joint("waist").qpos, data.joint("right_reach").qpos = 0.4, 0.1
    data.joint("floating").qpos = [*robot.q[:3], 1.0, 0.0, 0.0, 0.0]
    mujoco.mj_forward(model, data)
    for body in ("right_arm", "left_arm", "chest", "left_foot"):
        np.testing.assert_allclose(robot.placement(body).translation, data.body(body).xpos, atol=1e-9)


OTHER = (
    '<body name="other" pos="0 3 1"><freejoint/><geom size="0.1"/>'
    '<body name="arm"><joint name="j"/><geom size="0.1"/></body></body></worldbody>'
)
STRING = '<tendon><fixed name="string"><joint joint="left_shoulder" coef="1"/></fixed></tendon>'
PULLER = '<motor name="puller" tendon="string"/></actuator>'
INERTIA = "0.08 0.06 0.05"
END = "</worldbody>"
BAD = {
    "two robots": ([(END, OTHER)], "'other'"),
    "no free joint": ([('<freejoint name="floating"/>', "")], "root='pelvis'"),
    "tendon drive": ([(END, END + STRING), ("</actuator>", PULLER)], "'puller'"),
    "negative inertia": ([(INERTIA, "0.08 -0.06 0.05")], "inertia"),
    "actuator on no joint": ([('joint="waist"', 'joint="wiast"')], "wiast"),
    "no XML": ([(biped(), "<<<")], "MJCF string"),
}


@pytest.mark.parametrize("what", BAD)
def test_bad_files_are_refused_by_name(what: str) -> None:
    changes, named = BAD[what]
    xml = biped()
    for old, new in changes:
        assert old in xml
        xml = xml.replace(old, new)
    with pytest.raises(ModelError, match=named):
        RobotDescription.from_mjcf(xml)


CORNERS = [(0, 0, 0), (0.2, 0, 0), (0, 0.2, 0), (0, 0, 0.2)]
OBJ = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS) + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
INLINE = " ".join(str(each) for corner in CORNERS for each in corner)
MESHES = {
    "meshdir": ('meshdir="parts"', 'file="hull.obj"'),
    "assetdir": ('assetdir="parts"', 'file="hull.obj"'),
    "meshdir before assetdir": ('assetdir="none" meshdir="parts"', 'file="hull.obj"'),
    "strippath": ('meshdir="parts" strippath="true"', 'file="C/of/others/hull.obj"'),
    "relative": ("", 'file="../robot/parts/hull.obj"'),
    "moved": ('meshdir="parts"', 'file="hull.obj" refpos="0.1 0 0"'),
    "in the file": ("", f'vertex="{INLINE}"'),
    "built in": ("", 'builtin="wedge" params="4 4 30 30 0"'),
}


SCENE = (
    '<mujoco><asset><model name="it" file="robot/robot.xml"/></asset><worldbody>'
    '<attach model="it" body="pelvis" prefix="r/"/></worldbody></mujoco>'
)


@pytest.mark.parametrize(
    ("what", "kind"),
    [
        *((what, "path") for what in MESHES),
        *(("meshdir", kind) for kind in ("model", "spec", "attached", "scene")),
    ],
)
def test_meshes_are_found_whatever_the_file_names_and_whoever_attaches_it(
    what: str, kind: str, tmp_path: Path
) -> None:
    """Shapes of the chest are those of MuJoCo's compiled mesh; where no file has it so, the box around it."""
    compiler, mesh = MESHES[what]
    home, file = tmp_path / "robot", tmp_path / "robot" / "robot.xml"
    (home / "parts").mkdir(parents=True)
    (home / "parts" / "hull.obj").write_text(OBJ)
    xml = biped(extra=f'<compiler {compiler}/><asset><mesh name="hull" {mesh}/></asset>')
    xml = xml.replace(
        '<option gravity="0 0 -9.80665"/>', ""
    )  # MuJoCo warns of one that a scene does not have
    hull = '<geom type="mesh" mesh="hull" mass="0" pos="0.1 0.2 0.3" contype="0" conaffinity="0"/>'
    file.write_text(xml.replace('<joint name="waist"', f'{hull}<joint name="waist"'))
    (tmp_path / "scene.xml").write_text(SCENE)
    model = mujoco.MjModel.from_xml_path(str(file))
    source: object = {"path": file, "model": model, "scene": tmp_path / "scene.xml"}.get(kind)
    if kind in ("spec", "attached"):
        source = own = mujoco.MjSpec.from_file(str(file))
    if kind == "attached":
        source = mujoco.MjSpec()
        source.attach(own, frame=source.worldbody.add_frame(), prefix="r/")
    description = RobotDescription.from_mjcf(source)
    chest = next(name for name in ("chest", "r/chest") if name in description.mechanism.inertias)
    boxed = what in ("moved", "in the file", "built in")
    assert any("boxes around them: mesh" in line for line in description.derived) == boxed
    (shape,) = (
        shape for shape in link_shapes(description.mechanism, description.package_dirs) if shape.link == chest
    )
    geom = int(np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)[0])
    place = placement_of(model.geom_pos[geom], model.geom_quat[geom])
    inside = [shape.place.actInv(place.act(np.array(each, dtype=float))) for each in model.mesh_vert]
    np.testing.assert_array_less(np.abs(inside).max(axis=0), np.array(shape.size) + 1e-6)
    assert np.abs(inside).max() == pytest.approx(max(shape.size), abs=1e-6)


COVER = '<geom type="box" size="0.5 0.5 0.5" group="2" contype="0" conaffinity="0" mass="0"/>'
TOUCHING = {
    "mask": ('<geom name="own" size="0.07" group="3"/>', ""),
    "shown": ('<geom name="own" size="0.07" group="0"/>', ""),
    "pair": (
        '<geom name="own" size="0.07" contype="0" conaffinity="0" group="1"/>',
        '<contact><pair geom1="own" geom2="ground"/></contact>',
    ),
    "by convention": ('<geom name="own" size="0.07" contype="0" conaffinity="0" group="3"/>', ""),
    "ellipsoid": ('<geom name="own" type="ellipsoid" size="0.07 0.05 0.04" group="3"/>', ""),
}


@pytest.mark.parametrize("what", TOUCHING)
def test_collision_shapes_are_the_geoms_that_touch(what: str) -> None:
    geom, extra = TOUCHING[what]
    xml = biped(extra=extra).replace('<joint name="waist"', f'{COVER}{geom}<joint name="waist"')
    description = RobotDescription.from_mjcf(xml)
    (shape,) = description.collision_shapes()["chest"]
    assert shape.radius == pytest.approx(0.05 if what == "ellipsoid" else 0.07)
    assert any("ellipsoid 'own'" in line for line in description.derived) == (what == "ellipsoid")


TOE = """
<geom class="foot" type="box" size="0.05 0.05 0.02" pos="-0.02 0 -0.05"/>
<body name="{side}_toe" pos="0.06 0 -0.05"><joint name="{side}_toe" axis="0 1 0" range="-20 60"/>
<inertial pos="0.03 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>
<geom class="foot" type="box" size="0.04 0.05 0.02" pos="0.04 0 0"/></body>
"""
SPLIT = "".join(
    TOE.replace("_toe", f"_toe{i}")
    .replace('pos="0.06 0 ', f'pos="0.06 {y} ')
    .replace("0.04 0.05", "0.04 0.02")
    for i, y in enumerate((-0.03, 0.03))
)


@pytest.mark.parametrize("driven", [True, False])
@pytest.mark.parametrize("foot", [TOE, SPLIT], ids=["one toe", "two toes"])
def test_a_foot_of_several_bodies_is_what_touches_the_ground_under_the_ankle(foot: str, driven: bool) -> None:
    """A toe that no actuator drives is no joint of the controller, and said to be none."""
    feet = {side: foot.format(side=side) for side in ("left", "right")}
    toes = re.findall(r'joint name="(\w+)"', "".join(feet.values()))
    motors = MOTORS + "".join(f'<motor joint="{toe}" gear="5" ctrlrange="-1 1"/>' for toe in toes)
    xml = biped("<site/>", drives=motors if driven else MOTORS)
    for side, shapes in feet.items():
        cell = f'<site name="{side}_load_cell" pos="0 0 -0.03"/>'
        xml = xml.replace(cell, cell + shapes)
    description = RobotDescription.from_mjcf(xml)
    for sole in description.soles:
        assert (sole.link, sole.length, sole.width) == (sole.name, pytest.approx(0.21), pytest.approx(0.1))
        np.testing.assert_allclose(description.ankle(sole.name), [-0.035, 0.0, 0.07], atol=1e-9)
    assert (set(toes) <= set(description.joint_names)) is driven
    assert any("left_toe" in line for line in description.doubts()) is not driven
    if driven:
        named = RobotDescription.from_mjcf(xml, left_sole="left_foot", right_sole="right_foot")
        assert named.soles == description.soles


def test_a_file_that_cannot_be_parsed_is_named(tmp_path: Path) -> None:
    file = tmp_path / "mine.xml"
    for content, message in (
        (biped().replace("<worldbody>", '<include file="gone.xml"/><worldbody>'), "gone.xml"),
        (biped()[:-20], "parse error"),
    ):
        file.write_text(content)
        with pytest.raises(ModelError, match=rf"mine\.xml'?: .*{message}"):
            RobotDescription.from_mjcf(file)
    file.write_text(f"<!-- mass='nan'\n <inertial mass=\"nan\"/> -->{biped()}")
    assert RobotDescription.from_mjcf(file).joint_names == plain().joint_names
