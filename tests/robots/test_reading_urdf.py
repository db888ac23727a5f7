"""Rules of reading a URDF: limits, couplings, joints that are locked, roots, and a URDF of an MJCF."""

from __future__ import annotations

import dataclasses
import re

import mujoco
import numpy as np
import pytest
from mjcf_biped import biped as mjcf_biped
from urdf_biped import biped

from wbc.base.errors import ModelError
from wbc.core.model import Coupling
from wbc.robots import RobotDescription

INERTIAL = '<inertial><origin xyz="0.1 0.02 -0.03"/><mass value="{}"/><inertia ixx="0.01" iyy="0.02" izz="0.015" ixy="0" ixz="0" iyz="0"/></inertial>'  # fmt: skip # noqa: E501
LIMIT = '<limit lower="-1" upper="1" effort="9" velocity="3"/>'


def link(name: str, mass: float = 1.0) -> str:
    return f'<link name="{name}">{INERTIAL.format(mass)}</link>'


def joint(name: str, parent: str, child: str, inside: str = LIMIT, kind: str = "revolute") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0.2 0.3" rpy="0.3 -0.2 0.5"/><axis xyz="0 3 4"/>{inside}</joint>'
    )


def arm(*joints: str, more: str = "") -> str:
    """Return links a, b, c, d and what is between them."""
    links = "".join(link(name, 1.0 + i) for i, name in enumerate("abcd"[: len(joints) + 1]))
    return f'<robot name="arm">{links}{"".join(joints)}{more}</robot>'


def read(xml: str, **options: object) -> RobotDescription:
    return RobotDescription.from_urdf(xml, base="fixed", **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("limit", "kind", "low", "high"),
    [
        ('lower="-0.5" upper="0.7"', "revolute", -0.5, 0.7),
        ('upper="0.7"', "revolute", 0.0, 0.7),
        ('lower="-0.5"', "revolute", -0.5, 0.0),
        ("", "revolute", -np.pi, np.pi),
        ('lower="-0.5" upper="0.7"', "continuous", -np.inf, np.inf),
        ('lower="-0.5" upper="0.7"', "prismatic", -0.5, 0.7),
    ],
)
def test_a_limit_that_is_not_given_beside_the_other_is_zero(
    limit: str, kind: str, low: float, high: float
) -> None:
    description = read(arm(joint("j", "a", "b", f'<limit {limit} effort="9" velocity="3"/>', kind)))
    assert [float(side[0]) for side in description.position_limits] == pytest.approx([low, high])


def test_a_slide_without_limits_and_an_empty_range_are_refused() -> None:
    for limit, kind, said in (
        ("", "prismatic", "'j' has no position limits"),
        ('lower="0.2" upper="0.2"', "revolute", "'j' has the empty position range"),
        ('lower="0.5" upper="0.2"', "revolute", "'j' has the empty position range"),
        ('lower="-inf" upper="0.2"', "prismatic", "must have finite position limits"),
    ):
        with pytest.raises(ModelError, match=said):
            read(arm(joint("j", "a", "b", f'<limit {limit} effort="9" velocity="3"/>', kind)))


@pytest.mark.parametrize(
    ("speed", "kind", "found"),
    [
        ("3", "revolute", 3.0),
        ("0", "revolute", 6.0),
        ("-1", "revolute", 6.0),
        ("inf", "continuous", 6.0),
        ("0", "prismatic", 0.5),
    ],
)
def test_a_speed_that_is_none_is_that_of_legs(speed: str, kind: str, found: float) -> None:
    limit = f'<limit lower="-1" upper="1" effort="9" velocity="{speed}"/>'
    description = read(arm(joint("j", "a", "b", limit, kind)))
    assert description.velocity_limit.tolist() == [found]
    assert any("no velocity limit given" in line for line in description.derived) == (speed != "3")


SAFE = '<safety_controller soft_lower_limit="{}" soft_upper_limit="{}" k_velocity="9"/>'


@pytest.mark.parametrize(
    ("low", "high", "found", "said"),
    [
        ("-0.5", "0.5", (-0.5, 0.5), "taken as position limits"),
        ("-inf", "0.5", (-np.inf, np.inf), "bound one side of a joint without end alone and are left out"),
        ("-0.5", "inf", (-np.inf, np.inf), "bound one side of a joint without end alone and are left out"),
    ],
)
def test_soft_limits_of_a_joint_without_end_bound_both_sides_or_none(
    low: str, high: str, found: tuple[float, float], said: str
) -> None:
    limit = '<limit effort="9" velocity="3"/>'
    description = read(arm(joint("j", "a", "b", limit + SAFE.format(low, high), "continuous")))
    assert tuple(float(side[0]) for side in description.position_limits) == found
    assert any(said in line for line in description.derived)


def test_a_fixed_joint_needs_neither_axis_nor_leader() -> None:
    """And what follows one is fixed where it would be."""
    odd = joint("k", "b", "c", '<mimic joint="j" multiplier="2"/>', "fixed").replace("0 3 4", "0 0 0")
    assert read(arm(joint("j", "a", "b"), odd)).joint_names == ("j",)
    for mimic, place in (
        ('<mimic joint="k" multiplier="2" offset="1.4"/>', 1.4),
        ('<mimic joint="j" multiplier="0" offset="-0.3"/>', -0.3),
    ):
        follower = joint("l", "c", "d", LIMIT + mimic)
        found = read(arm(joint("j", "a", "b"), joint("k", "b", "c", "", "fixed"), follower))
        wide = joint("l", "c", "d", LIMIT.replace('upper="1"', 'upper="2"'))
        still = read(arm(joint("j", "a", "b"), joint("k", "b", "c", "", "fixed"), wide), lock={"l": place})
        assert found.joint_names == ("j",) and any(f"fixed at {place:g}" in line for line in found.derived)
        np.testing.assert_allclose(found.robot().mass_matrix, still.robot().mass_matrix, atol=1e-12)
        assert found.robot().placement("d").isApprox(still.robot().placement("d"), 1e-12)


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "continuous"])
@pytest.mark.parametrize("axis", ["0 3 4", ""])
def test_a_locked_joint_is_where_a_free_one_would_be(kind: str, axis: str) -> None:
    """By angle or way along its axis, of any length; an axis that is not given is x."""
    xml = arm(joint("j", "a", "b", LIMIT, kind), joint("k", "b", "c"))
    xml = xml.replace('<axis xyz="0 3 4"/>', f'<axis xyz="{axis}"/>' if axis else "", 1)
    free, locked = read(xml).robot(), read(xml, lock={"j": 0.7}).robot()
    q = free.q.copy()
    q[free.joint_index("j")], q[free.joint_index("k")] = 0.7, 0.2
    free.update(q, np.zeros(2))
    locked.update(np.array([0.2]), np.zeros(1))
    for each in "abc":
        assert locked.placement(each).isApprox(free.placement(each), 1e-12)
    np.testing.assert_allclose(locked.mass_matrix, free.mass_matrix[1:, 1:], atol=1e-12)


@pytest.mark.parametrize(
    ("limits", "low", "high", "notes"),
    [
        ("-4 4", -1.0, 1.0, []),
        ("-1 4", -0.75, 1.0, ["[-0.75, 1]"]),
        ("-4 1", -1.0, 0.25, ["[-1, 0.25]"]),
        ("-1 1", -0.75, 0.25, ["[-0.75, 0.25]"]),
    ],
)
def test_a_follower_narrows_the_end_of_its_leader_that_it_cannot_reach(
    limits: str, low: float, high: float, notes: list[str]
) -> None:
    """The follower is at 2 q + 0.5, and twice as fast: 5 rad/s leave 2.5 to the leader, 6 leave it all of its 3."""
    ends = "lower='{}' upper='{}'".format(*limits.split())
    for speed, leader in ((5.0, 2.5), (6.0, 3.0), (9.0, 3.0)):
        follower = (
            f'<limit {ends} effort="9" velocity="{speed}"/><mimic joint="j" multiplier="2" offset="0.5"/>'
        )
        description = read(arm(joint("j", "a", "b"), joint("k", "a", "c", follower)))
        assert description.joint_names == ("j",) and description.couplings == {"k": Coupling("j", 2.0, 0.5)}
        assert [float(side[0]) for side in description.position_limits] == pytest.approx([low, high])
        assert description.velocity_limit[0] == pytest.approx(leader)
        said = [line for line in description.derived if "for the range of 'k'" in line]
        assert [line.split("': ")[1].split(", for")[0] for line in said] == notes
        slower = [line for line in description.derived if "a second, for 'k'" in line]
        assert [line.split("at most ")[1].split()[0] for line in slower] == (["2.5"] if speed == 5.0 else [])


def test_a_leader_behind_its_follower_in_the_file_changes_no_limit_and_no_place() -> None:
    """Joints get another order; each keeps its own limits, and all frames their places."""
    branches = [joint("j", "a", "b"), joint("k", "b", "c"), joint("l", "a", "d")]
    for i in range(3):
        own = f'<limit lower="{-1.0 - i}" upper="{1.5 + i}" effort="{9 + i}" velocity="{3 + i}"/>'
        branches[i] = branches[i].replace(LIMIT, own)
    plain = read(arm(*branches))
    mimic = '<mimic joint="l" multiplier="0.1" offset="0"/>'
    tied = read(arm(branches[0].replace("</joint>", f"{mimic}</joint>"), *branches[1:]))
    assert tied.joint_names == ("l", "k") and plain.joint_names == ("j", "k", "l")
    for what in ("velocity_limit", "torque_limit"):
        one, other = (dict(zip(each.joint_names, getattr(each, what), strict=True)) for each in (plain, tied))
        assert {name: one[name] for name in other} == other
    for side in (0, 1):
        one, other = (
            dict(zip(each.joint_names, each.position_limits[side].tolist(), strict=True))
            for each in (plain, tied)
        )
        assert {name: one[name] for name in other} == other
    first, second = plain.robot(), tied.robot()
    values = {"l": 0.6, "k": -0.4, "j": 0.06}
    for robot in (first, second):
        robot.update(np.array([values[name] for name in robot.joint_names]), np.zeros(robot.nv))
    for frame in "abcd":
        assert second.placement(frame).isApprox(first.placement(frame), 1e-12)
    np.testing.assert_allclose(first.com, second.com, atol=1e-12)


def test_joints_that_follow_do_not_count_as_joints_that_move() -> None:
    """256 may."""
    many = "".join(link(f"n{i}") + joint(f"m{i}", "a", f"n{i}") for i in range(258))
    tied = many.replace("</joint>", '<mimic joint="m1"/></joint>', 1)
    with pytest.raises(ModelError, match="must have 1 to 256 joints that move, got 257"):
        read(f'<robot name="arm">{link("a")}{tied}</robot>')


def test_a_servo_moves_what_is_coupled_to_its_joint_with_it() -> None:
    """The mass matrix shows it, rotors included."""
    follower = joint("k", "a", "c", LIMIT + '<mimic joint="j" multiplier="-2" offset="0.5"/>')
    description = read(arm(joint("j", "a", "b"), follower, joint("l", "c", "d")), armature=0.3)
    robot = description.robot()
    assert description.joint_names == ("j", "l")
    np.testing.assert_allclose(description.effective_inertia, np.diag(robot.mass_matrix), rtol=1e-9)


def test_a_root_of_its_own_stays_and_one_that_floats_or_is_the_world_goes() -> None:
    world = '<link name="world"/>' + joint("m", "world", "a", "", "fixed")
    heavy = link("world", 3.0) + joint("m", "world", "a", "", "fixed")
    two = (
        '<link name="world"/>'
        + joint("m", "world", "a", "", "fixed")
        + link("e")
        + joint("n", "world", "e", "", "fixed")
    )
    for more, mass, removed in ((world, 3.0, True), (heavy, 6.0, False), (two, 4.0, False)):
        description = RobotDescription.from_urdf(arm(joint("j", "a", "b"), more=more))
        assert description.robot().mass == pytest.approx(mass)
        assert any("root link 'world'" in line for line in description.derived) == removed
        assert any("now 'world_link'" in line for line in description.derived) != removed
        assert description.robot().nv == 7
    free = '<link name="odom"/>' + joint("m", "odom", "a", "", "floating")
    for base, how in (("floating", "floats freely"), ("fixed", "is bolted there")):
        description = RobotDescription.from_urdf(arm(joint("j", "a", "b"), more=free), base=base)  # type: ignore[arg-type]
        assert any(f"removed: the robot {how}" in line for line in description.derived)
    with pytest.raises(ModelError, match="of type 'floating'"):
        RobotDescription.from_urdf(
            arm(joint("j", "a", "b"), more=free.replace("/>", f">{INERTIAL.format(1)}</link>", 1))
        )


def test_a_joint_of_another_type_is_refused_with_the_types_and_the_way_out_if_there_is_one() -> None:
    for kind, way in (("screw", ""), ("planar", "; write it as two prismatic joints and a continuous one")):
        with pytest.raises(ModelError) as error:
            read(arm(joint("j", "a", "b", "", kind)))
        said = f"joint 'j' is of type '{kind}'; supported: revolute, continuous, prismatic, fixed{way}"
        assert str(error.value) == said


UNREAD = {
    "gazebo": ("<gazebo/><gazebo/>", "", "not read: 2 <gazebo>"),
    "chain": ('<gazebo><joint name="rod"><parent>a</parent></joint></gazebo>', "rod", "not read: 1 <gazebo>"),
    "loop": ('<loop_joint name="rod"><link1 link="a"/></loop_joint>', "rod", "not read: 1 <loop_joint>"),
    "drive": (
        '<transmission><joint name="rod"><x/></joint></transmission>',
        "",
        "not read: 1 <transmission>",
    ),
}


@pytest.mark.parametrize("what", UNREAD)
def test_what_is_not_read_is_named_and_joints_in_it_are_doubtful(what: str) -> None:
    more, joint, said = UNREAD[what]
    robot = RobotDescription.from_urdf(biped().replace("</robot>", f"{more}</robot>"))
    assert said in robot.derived
    doubts = [line for line in robot.doubts() if "joints that are not read" in line]
    assert len(doubts) == bool(joint) and all(joint in line for line in doubts)


def test_of_two_elements_where_one_is_read_the_first_counts_and_the_others_are_named() -> None:
    heavy = "<inertial><mass value='50'/><inertia ixx='9' iyy='9' izz='9'/></inertial></link>"
    robot = RobotDescription.from_urdf(biped().replace("</link>", heavy, 1))
    assert robot.robot().mass == RobotDescription.from_urdf(biped()).robot().mass
    assert any(line.endswith("one <inertial> is read, it has 2") for line in robot.derived)


def test_a_shape_of_another_kind_is_named_and_a_place_in_another_form_is_refused() -> None:
    cone = '<visual><geometry><cone radius="1"/></geometry></visual></link>'
    robot = RobotDescription.from_urdf(biped().replace("</link>", cone, 1))
    assert any("<cone> of a visual is left out" in line for line in robot.derived)
    for odd in ('quat_xyzw="0 0 0 1"', 'rpy_deg="0 0 90"'):
        with pytest.raises(ModelError, match=f"must be written as xyz and rpy, got {odd.partition('=')[0]}"):
            RobotDescription.from_urdf(biped().replace("<origin ", f"<origin {odd} ", 1))


def test_trees_that_are_none_are_refused_by_link() -> None:
    twice = arm(joint("j", "a", "b"), joint("k", "a", "c"), joint("l", "b", "c"), more="").replace(
        '<link name="d">', '<link name="x">'
    )
    for xml, said in (
        (twice, "'c' is the child of two joints|one root"),
        (arm(joint("j", "a", "b"), joint("j", "b", "c")), "two joints are called 'j'"),
        (arm(joint("j", "a", "b")).replace('"0.1 0.2 0.3"', '"0.1 0.2"'), "xyz of its origin"),
        (arm(joint("j", "a", "b")).replace('"0.1 0.2 0.3"', '"0.1 0.2 1e5"'), "within ±10000"),
        (arm(joint("j", "a", "b")).replace("0 3 4", "0 0 1e-10"), "its axis must not be zero"),
    ):
        with pytest.raises(ModelError, match=said):
            read(xml)


def test_shapes_and_masses_of_an_mjcf_are_those_of_its_urdf() -> None:
    """Kinds, sizes, places and colours of all shapes; between joints of one link is a link of next to no mass."""
    geoms = (
        '<geom type="box" size="0.1 0.2 0.3" pos="0.1 0 0" euler="10 20 30" rgba="0.1 0.2 0.3 1" {0}/>'
        '<geom type="sphere" size="0.15" {0}/><geom type="cylinder" size="0.1 0.3" pos="0 0.1 0" {0}/>'
        '<geom type="capsule" size="0.05 0.2" {0}/>'
    ).format('mass="0" contype="0" conaffinity="0" group="2"')
    xml = mjcf_biped().replace('<joint name="waist"', f'{geoms}<joint name="waist"')
    own = RobotDescription.from_mjcf(xml)
    again = RobotDescription.from_urdf(own.urdf, armature=dict(own.armature))
    shapes = [each.mechanism.shapes for each in (own, again)]
    key = [
        sorted(each, key=lambda s: (s.link, s.role, s.kind, tuple(np.round(s.place.translation, 6))))
        for each in shapes
    ]
    assert len(key[0]) == len(key[1]) > 8
    for one, other in zip(*key, strict=True):
        assert one[:3] == other[:3]
        np.testing.assert_allclose(one.size, other.size, atol=1e-12)
        assert one.place.isApprox(other.place, 1e-9)
        assert one.colour == pytest.approx(other.colour)
    robots = [each.robot() for each in (own, again)]
    for robot in robots:
        robot.update(np.concatenate([[0, 0, 0, 0, 0, 0, 1], np.zeros(robot.na)]), np.zeros(robot.nv))
    order = [*range(6), *(6 + robots[1].joint_index(name) for name in robots[0].joint_names)]
    np.testing.assert_allclose(robots[1].mass_matrix[np.ix_(order, order)], robots[0].mass_matrix, atol=1e-6)


def test_a_foot_inertia_is_a_body_at_the_ankle() -> None:
    """Mass, first moments and second moments about the frame of the ankle, as Pinocchio orders them."""
    own = RobotDescription.from_mjcf(mjcf_biped())
    more = (0.5, 0.01, 0.0, -0.02, 0.003, 0.0, 0.004, 0.0, 0.0, 0.005)
    with_foot = dataclasses.replace(own, foot_inertia={"left_foot": more})
    assert with_foot.robot().mass == pytest.approx(own.robot().mass + 0.5)
    assert with_foot.digest != own.digest
    ankle = with_foot.pinocchio_model().getJointId("left_ankle_roll")
    before, after = (each.pinocchio_model().inertias[ankle] for each in (own, with_foot))
    np.testing.assert_allclose(after.toDynamicParameters() - before.toDynamicParameters(), more, atol=1e-12)


def test_mujoco_reads_the_limits_of_a_urdf_without_geometry_as_pinocchio_does() -> None:
    description = read(
        arm(joint("j", "a", "b"), joint("k", "b", "c", LIMIT, "prismatic"), joint("l", "c", "d"))
    )
    model = mujoco.MjModel.from_xml_string(description.urdf_without_geometry())
    for i, name in enumerate(description.joint_names):
        assert model.joint(name).range.tolist() == [float(side[i]) for side in description.position_limits]
    assert not re.search("<(visual|collision)", description.urdf_without_geometry())
