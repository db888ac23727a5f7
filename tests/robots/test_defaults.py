"""Feet, torso, IMU, rotors and the direction of sight that are derived of a robot."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from urdf_biped import FEET, FOOT_BOX, biped

from wbc.base.errors import InputError, ModelError
from wbc.core.frames import FrameDescription, Sole
from wbc.robots import RobotDescription
from wbc.robots.derivation.defaults import feet_hint
from wbc.robots.derivation.legs import heading


def link(name: str, mass: float, parent: str, xyz: str = "0 0 0", kind: str = "revolute") -> str:
    """Return a link that turns about y at a place in its parent, or is fixed there."""
    inertia = '<inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/>'
    return (
        f'<link name="{name}"><inertial><mass value="{mass}"/>{inertia}</inertial></link><joint name="{name}_joint" '
        f'type="{kind}"><parent link="{parent}"/><child link="{name}"/><origin xyz="{xyz}"/><axis xyz="0 1 0"/>'
        '<limit lower="-1" upper="1" effort="9" velocity="9"/></joint>'
    )


def chain(names: str, mass: float, parent: str, xyz: str) -> str:
    """Return links that turn, each at the place of the one before."""
    made = ""
    for name in names.split():
        made += link(name, mass, parent, xyz)
        parent, xyz = name, "0 0 0"
    return made


def star(*ends: tuple[str, float, float]) -> pin.Model:
    """Return a heavy ball with a limb for each name, y and depth below it, m."""
    inertia = '<inertia ixx="9" iyy="9" izz="9" ixy="0" ixz="0" iyz="0"/>'
    ball = f'<link name="ball"><inertial><mass value="1e5"/>{inertia}</inertial></link>'
    limbs = "".join(link(name, 1e-3, "ball", f"0 {y} {-depth}") for name, y, depth in ends)
    return pin.buildModelFromXML(f'<robot name="star">{ball}{limbs}</robot>', pin.JointModelFreeFlyer())


@pytest.mark.parametrize(
    ("depths", "feet"),
    [
        ((1.0, 1.0), True),
        ((1.0, 0.86), True),
        ((1.0, 0.84), False),
        ((1.0, 1.0, 0.84), True),
        ((1.0, 1.0, 0.86), False),
        ((1.0, 1.0, 1.0, 1.0), False),
        ((1.0, 1.0, -1.0, -2.0), True),
        ((1.0, -1.0), False),
        ((1.0,), False),
    ],
)
def test_two_limbs_that_end_lowest_by_more_than_a_seventh_are_feet(
    depths: tuple[float, ...], feet: bool
) -> None:
    """Of a quadruped and of an arm there are none; the left foot is the one with the larger y, in any order."""
    sides = [("a", -0.3), ("b", 0.2), ("c", 0.5), ("d", -0.6)]
    ends = [(name, y, depth) for (name, y), depth in zip(sides, depths, strict=False)]
    for order in (ends, ends[::-1]):
        hint = feet_hint(star(*order))
        assert bool(hint) == feet
        assert not feet or hint == "left_sole='b', right_sole='a' (--left b --right a)"


def test_a_link_called_sole_is_the_hint_of_a_foot() -> None:
    xml = biped(
        after="".join(link(f"{s}_sole", 0.1, f"{s}_ankle_roll_link", "0 0 -0.06", "fixed") for s in "lr")
    )
    model = RobotDescription.from_urdf(xml).pinocchio_model()
    assert "left_sole='l_sole', right_sole='r_sole'" in feet_hint(model)


ARMS = chain("la lb lc", 0.5, "chest", "0 0.2 0.3") + chain("ra rb rc", 0.5, "chest", "0 -0.2 0.3")


@pytest.mark.parametrize(
    ("more", "torso"),
    [
        (link("chest", 6.0, "trunk") + ARMS, "chest"),
        (link("chest", 6.0, "trunk") + ARMS + chain("ha hb hc", 9.0, "chest", "0 0 0.5"), "chest"),
        (link("chest", 6.0, "trunk") + chain("la lb lc", 0.5, "chest", "0 0.2 0.3"), "trunk"),
        (
            link("chest", 6.0, "trunk")
            + chain("la lb", 0.5, "chest", "0 0.2 0.3")
            + chain("ra rb", 0.5, "chest", "0 -0.2 0.3"),
            "trunk",
        ),
        (
            link("chest", 6.0, "trunk")
            + ARMS
            + link("head", 7.0, "chest")
            + chain("ea eb ec", 0.1, "head", "0 0.1 0")
            + chain("fa fb fc", 0.1, "head", "0 -0.1 0"),
            "head",
        ),
        (
            link("chest", 6.0, "trunk")
            + ARMS
            + link("head", 5.0, "chest")
            + chain("ea eb ec", 0.1, "head", "0 0.1 0")
            + chain("fa fb fc", 0.1, "head", "0 -0.1 0"),
            "chest",
        ),
    ],
)
def test_the_torso_is_the_heaviest_link_above_the_root_with_two_limbs_of_three_joints(
    more: str, torso: str
) -> None:
    description = RobotDescription.from_urdf(biped(after=more), **FEET)
    assert description.torso == torso and f"torso: link '{torso}'" in description.derived


def test_rotors_that_are_not_given_are_a_ninth_of_a_kilogram_metre_squared_of_talos_by_mass_and_size() -> (
    None
):
    """0.1 kg m² of a robot of 90.27 kg and 0.877 m; the others scale with m h²."""
    own = RobotDescription.from_urdf(biped(), armature={"l_knee": 0.3, "r_knee": 0.0}, **FEET)
    robot = own.robot()
    expected = 0.1 * (robot.mass / 90.27) * (robot.com[2] / 0.877) ** 2
    assert own.armature["l_knee"] == 0.3 and own.armature["r_knee"] == 0.0
    rest = [value for name, value in own.armature.items() if "knee" not in name]
    assert rest == pytest.approx([expected] * 16, rel=1e-6)
    assert f"armature of 16 joints: {expected:.3g} kg m², from mass and size" in own.derived
    arm = RobotDescription.from_urdf(biped(), armature={"l_knee": 0.3})
    assert "armature of 17 joints: no rotor inertia in the file, zero is taken" in arm.derived
    whole = RobotDescription.from_urdf(biped(), armature=0.2, **FEET)
    assert set(whole.armature.values()) == {0.2} and not any("armature" in line for line in whole.derived)


@pytest.mark.parametrize(("y", "taken"), [(0.009, True), (-0.009, True), (0.011, False), (-0.011, False)])
def test_a_frame_called_imu_is_taken_within_a_centimetre_of_the_middle(y: float, taken: bool) -> None:
    tail = link("tail", 0.5, "trunk", f"-0.1 {y} 0.2") + link("tail_imu", 0.01, "tail", "0 0 0", "fixed")
    description = RobotDescription.from_urdf(biped(after=tail), **FEET)
    assert (description.imu.frame == "tail_imu") == taken
    assert any("imu='tail_imu' takes it" in line for line in description.derived) != taken


def test_of_two_imus_the_one_nearer_to_the_root_is_taken() -> None:
    tail = link("tail", 0.5, "trunk") + link("imu_a", 0.01, "tail", "0 0 0", "fixed")
    both = tail + link("z_imu", 0.01, "trunk", "0 0 0", "fixed")
    assert RobotDescription.from_urdf(biped(after=both), **FEET).imu.frame == "z_imu"


@pytest.mark.parametrize("turn", [0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi])
@pytest.mark.parametrize("lean", [0.0, 0.4, -0.4])
def test_a_robot_looks_to_where_its_toes_are_from_its_left_and_right_foot(turn: float, lean: float) -> None:
    """To the nearest right angle, the left foot being to the left; with toes behind the feet are swapped."""
    for toes, looks in ((0.05, turn), (-0.05, 0.0)):
        model, soles = pin.Model(), []
        root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
        for side, y in (("left", 0.2), ("right", -0.3)):
            spin = pin.rpy.rpyToMatrix(0.0, 0.0, turn + lean)
            hip = model.addJoint(
                root, pin.JointModelRY(), pin.SE3(np.eye(3), spin @ [0.1, y, -0.5]), f"{side}_hip"
            )
            foot = pin.SE3(np.eye(3), spin @ [toes, 0.0, -0.1])
            model.addFrame(pin.Frame(f"{side}_sole", hip, 0, foot, pin.FrameType.OP_FRAME))
            soles.append(Sole(f"{side}_sole", "a", name=f"{side}_foot", length=0.2, width=0.1))
        found = heading(model, (soles[0], soles[1]), False)
        assert np.cos(found - looks) == pytest.approx(1.0)
        # Feet that were found by their y alone: toes behind say that the robot looks backward.
        if turn == 0.0 and toes < 0.0:
            assert heading(model, (soles[0], soles[1]), True) == np.pi


def test_a_sole_at_the_ankle_is_one_that_nobody_placed() -> None:
    """Two millimetres below the last joint are no ankle."""
    for depth, fine in ((0.0021, True), (0.0019, False), (-0.0021, True)):
        feet = {
            f"{side}_sole": FrameDescription("at", f"{side[0]}_ankle_roll_link", (0.0, 0.0, -depth))
            for side in ("left", "right")
        }
        if fine:
            RobotDescription.from_urdf(biped(geometry=""), sole_size=(0.2, 0.1), **feet)
        else:
            with pytest.raises(ModelError, match=r"at the ankle, 1\.9 mm from the last joint"):
                RobotDescription.from_urdf(biped(geometry=""), sole_size=(0.2, 0.1), **feet)


def test_a_sole_that_nothing_places_is_told_with_the_reason() -> None:
    with pytest.raises(ModelError, match="'l_ankle_roll_link' has no geometry that says where the ground is"):
        RobotDescription.from_urdf(biped(geometry=""), **FEET)


def test_an_arm_without_torque_limits_needs_them_and_what_looks_like_a_humanoid_feet() -> None:
    xml = biped(limits="")
    with pytest.raises(ModelError, match=r"give torque_limits, or its feet: left_sole="):
        RobotDescription.from_urdf(xml)
    arm = (
        '<robot name="arm"><link name="base"/>'
        + link("tip", 1.0, "base").replace('effort="9" ', "")
        + "</robot>"
    )
    with pytest.raises(ModelError, match=r"joints without torque limits: tip_joint; give torque_limits$"):
        RobotDescription.from_urdf(arm, base="fixed")


def test_soles_that_are_given_must_be_those_of_two_legs_left_and_right() -> None:
    def sole(name: str, side: str, frame: str, depth: float = 0.06) -> Sole:
        return Sole(frame, f"{side}_ankle_roll_link", (0.0, 0.0, -depth), name=name, length=0.2, width=0.1)

    good = RobotDescription.from_urdf(
        biped(), left_sole=sole("left_foot", "l", "a"), right_sole=sole("right_foot", "r", "b")
    )
    assert [each.frame for each in good.soles] == ["a", "b"]
    alike = RobotDescription.from_urdf(
        biped(), left_sole=sole("left_foot", "l", "a"), right_sole=sole("right_foot", "r", "a")
    )
    assert [each.frame for each in alike.soles] == ["left_foot_sole", "right_foot_sole"]
    for left, right, said in (
        (
            sole("left_foot", "l", "a"),
            sole("left_foot", "r", "b"),
            "given for 'right_foot' is called 'left_foot'",
        ),
        (sole("left_foot", "l", "a"), sole("right_foot", "l", "b"), "on the same leg"),
        (sole("left_foot", "r", "a"), sole("right_foot", "l", "b"), "lies to the right"),
    ):
        with pytest.raises((InputError, ModelError), match=said):
            RobotDescription.from_urdf(biped(), left_sole=left, right_sole=right)


def test_a_frame_with_the_name_of_a_sole_elsewhere_keeps_it() -> None:
    frames = "".join(
        link(f"{n}_foot_sole", 0.01, f"{n[0]}_ankle_roll_link", "0 0 0.02", "fixed")
        for n in ("left", "right")
    )
    description = RobotDescription.from_urdf(biped(geometry=FOOT_BOX, after=frames), **FEET)
    assert [sole.frame for sole in description.soles] == ["left_foot_sole_contact", "right_foot_sole_contact"]
    robot = description.robot()
    for sole in description.soles:
        assert robot.placement(sole.frame).translation[2] == pytest.approx(0.0, abs=1e-6)
        assert robot.placement(f"{sole.name}_sole").translation[2] == pytest.approx(0.08, abs=1e-6)
