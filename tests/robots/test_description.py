"""Descriptions as values: what their hash is of, what they refuse, and names and files by which they are found."""

from __future__ import annotations

import dataclasses
import json
import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from urdf_biped import FEET, FOOT_BOX, biped, described

import wbc
from wbc.base.errors import InputError, ModelError
from wbc.base.settings import from_json, to_json
from wbc.core.frames import FrameDescription
from wbc.core.model import Closure
from wbc.robots import RobotDescription, files, load, registry, urdf
from wbc.robots.derivation.servo import ServoRule


def test_a_hash_is_of_all_that_models_are_made_from_and_of_nothing_else() -> None:
    description = described()
    heavier = RobotDescription.from_urdf(biped().replace('mass value="15"', 'mass value="15.5"'), **FEET)
    left, right = description.soles
    tie = Closure("tie", "l_elbow_link", "r_elbow_link", False)
    changes: list[dict[str, Any]] = [
        {"armature": description.armature | {"l_knee": 0.5}},
        {"half_sitting": description.half_sitting | {"l_elbow": 0.5}},
        {"hands": {"left_hand": "l_elbow_link"}},
        {"gains": {"l_knee": (100.0, 1.0)}},
        {"damping": {"l_knee": 0.5}},
        {"frictionloss": {"l_knee": 0.5}},
        {"springs": {"l_knee": (5.0, 0.1)}},
        {"torque_ranges": {"l_knee": (-5.0, 80.0)}},
        {"foot_inertia": {"left_foot": (0.5, *[0.0] * 3, 1e-3, 0.0, 1e-3, 0.0, 0.0, 1e-3)}},
        {"soles": (left, dataclasses.replace(right, length=0.19))},
        {"imu": FrameDescription("mine", "trunk", (0.0, 0.0, 0.1))},
        {"torso": "l_hip_yaw_link"},
        {"servo": ServoRule(frequency=9.0)},
        {"closures": (tie,)},
        {"passive": ("l_elbow",)},
        {"mechanism": heavier.mechanism},
    ]
    hashes = [dataclasses.replace(description, **change).digest for change in changes]
    assert len({description.digest, *hashes}) == len(changes) + 1
    for same in (
        {"name": "other"},
        {"licence": "own"},
        {"source": "me"},
        {"height": 1.0},
        {"derived": ("a",)},
    ):
        assert dataclasses.replace(description, **same).digest == description.digest
    bare = RobotDescription.from_urdf(biped())
    assert RobotDescription.from_urdf(biped(), base="fixed").digest != bare.digest


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "one sole": ({"soles": 1}, "soles must be"),
    "bolted feet": ({"mechanism": "fixed"}, "a robot with feet is not bolted"),
    "a base": ({"base": "fixed"}, "'base'"),
    "a file": ({"xml": biped()}, "'xml'"),
    "no knee": ({"half_sitting": {"l_elbow": 0.0}}, "half-sitting must give every joint; missing: l_hip_yaw"),
    "no rotor": ({"armature": {"l_elbow": 0.0}}, "armature must give every joint"),
    "negative rotor": ({"armature": "-"}, r"armature\['l_knee'\] of RobotDescription"),
    "negative damping": ({"damping": {"l_knee": -1.0}}, r"damping\['l_knee'\] of RobotDescription"),
    "negative friction": (
        {"frictionloss": {"l_knee": -1.0}},
        r"frictionloss\['l_knee'\] of RobotDescription",
    ),
    "negative gain": ({"gains": {"l_knee": (-1.0, 0.0)}}, r"gains\['l_knee'\]\[0\] of RobotDescription"),
    "negative damping gain": (
        {"gains": {"l_knee": (1.0, -1.0)}},
        r"gains\['l_knee'\]\[1\] of RobotDescription",
    ),
    "unknown spring": ({"springs": {"knee": (1.0, 0.0)}}, "'knee'"),
    "unknown passive": ({"passive": ("knee",)}, "'knee'"),
    "passive twice": ({"passive": ("l_knee", "l_knee")}, "named once each, got l_knee, l_knee"),
    "unknown range": ({"torque_ranges": {"knee": (-1.0, 1.0)}}, "'knee'"),
    "reversed range": ({"torque_ranges": {"l_knee": (10.0, 5.0)}}, "'l_knee' must have low < high"),
    "empty range": ({"torque_ranges": {"l_knee": (5.0, 5.0)}}, "'l_knee' must have low < high"),
    "range without end": ({"torque_ranges": {"l_knee": (-math.inf, 5.0)}}, r"torque_ranges\['l_knee'\]\[0\]"),
    "pushing spring": ({"springs": {"l_knee": (-5.0, 0.0)}}, r"springs\['l_knee'\]\[0\] of RobotDescription"),
    "spring at nowhere": ({"springs": {"l_knee": (5.0, math.nan)}}, r"springs\['l_knee'\]\[1\]"),
    "foot of no sole": ({"foot_inertia": {"left": (1.0,) * 10}}, "no sole 'left'"),
    "foot that floats up": ({"foot_inertia": {"left_foot": (-1.0, *[0.0] * 9)}}, "mass above 0, got -1 kg"),
    "foot of no body": ({"foot_inertia": {"left_foot": (1.0,) * 10}}, "'left_foot' is that of no body"),
    "nine numbers": ({"foot_inertia": {"left_foot": (1.0,) * 9}}, r"foot_inertia\['left_foot'\]"),
    "too far": ({"half_sitting": "+"}, "half-sitting of joint 'l_knee'"),
}


@pytest.mark.parametrize("what", WRONG)
def test_values_that_cannot_be_are_refused_by_joint(what: str) -> None:
    description = described()
    changes, said = WRONG[what]
    if "mechanism" in changes:
        changes = {"mechanism": RobotDescription.from_urdf(biped(), base="fixed").mechanism}
    if changes.get("soles"):
        changes = {"soles": description.soles[:1]}
    if changes.get("armature") == "-":
        changes = {"armature": description.armature | {"l_knee": -0.1}}
    if changes.get("half_sitting") == "+":
        changes = {"half_sitting": description.half_sitting | {"l_knee": 2.6}}
    with pytest.raises((InputError, ModelError), match=said):
        dataclasses.replace(description, **changes)


def test_a_mechanism_with_a_joint_without_torque_limit_is_refused() -> None:
    weak = urdf.read(biped().replace('effort="80"', 'effort="0"', 1))
    with pytest.raises(ModelError, match="must have torque limits: l_hip_yaw have none"):
        dataclasses.replace(described(), mechanism=weak.mechanism(False))


@pytest.mark.parametrize("name", ["talos", "panda", "examples/biped.xml"])
def test_a_description_in_json_is_the_same_to_the_last_bit(name: str) -> None:
    robot = load(name)
    again = from_json(RobotDescription, json.loads(json.dumps(to_json(robot))))
    assert again.digest == robot.digest and again.joint_names == robot.joint_names
    one, other = robot.pinocchio_model(), again.pinocchio_model()
    assert list(one.inertias) == list(other.inertias) and list(one.frames) == list(other.frames)
    assert list(one.jointPlacements) == list(other.jointPlacements) and again.couplings == robot.couplings
    plain = to_json(robot)
    for wrong in ({}, 5, {"joints": [plain["mechanism"]["joints"][0] | {"parent": 9}]}, {"carried": [[1.0]]}):
        values = {**plain["mechanism"], **wrong} if wrong and isinstance(wrong, dict) else wrong
        with pytest.raises(InputError, match="links and joints of a robot cannot be read"):
            from_json(RobotDescription, plain | {"mechanism": values})


def test_servos_know_what_it_takes_to_stand_and_which_gains_are_the_users() -> None:
    description = dataclasses.replace(described(), gains={"l_knee": (100.0, 2.0)})
    robot, servos = description.robot(), description.servos
    assert servos.tipping == pytest.approx(robot.mass * 9.80665 * robot.com[2], rel=1e-9)
    assert set(servos.ankles) == {f"{s}_{joint}" for s in "lr" for joint in ("ankle_pitch", "ankle_roll")}
    i = robot.joint_index("l_knee")
    assert (servos.kp[i], servos.kd[i]) == (100.0, 2.0) and servos.given == {"l_knee"}
    assert {name for name, joint in description.summary()["joints"].items() if joint["gains"] == "given"} == {
        "l_knee"
    }
    arm = RobotDescription.from_urdf(biped())
    assert arm.servos.tipping == 0.0 and arm.servos.ankles == ()
    np.testing.assert_allclose(arm.kp, (2.0 * np.pi * 8.0) ** 2 * arm.effective_inertia)
    with pytest.raises(
        InputError, match="a walk needs two feet.*--left l_ankle_roll_link --right r_ankle_roll_link"
    ):
        arm.needs_feet("a walk")
    description.needs_feet("a walk")


def test_the_stiffest_leg_is_that_of_the_height_over_its_soles_wherever_the_robot_is() -> None:
    description = described()
    model, frames = description.pinocchio_model(), tuple(sole.frame for sole in description.soles)
    q = description.robot().half_sitting
    raised = q + np.eye(len(q))[2]
    rule = description.servo
    np.testing.assert_allclose(rule.bound(model, raised, frames), rule.bound(model, q, frames))


def test_one_foot_alone_is_refused() -> None:
    for foot in FEET:
        with pytest.raises(InputError, match="left_sole and right_sole, or none of both"):
            RobotDescription.from_urdf(biped(), **{foot: FEET[foot]})  # type: ignore[arg-type]


def test_shapes_without_geometry_or_of_another_kind_are_left_out() -> None:
    def shape(inside: str, material: str = "") -> str:
        return f'<visual><origin xyz="0 0 0.1"/>{inside}{material}</visual>'

    odd = shape("") + shape("<geometry/>") + shape('<geometry><plane size="1"/></geometry>')
    ball = '<geometry><sphere radius="0.1"/></geometry>'
    colours = {
        '<material name="m"><color rgba="0.1 2 -1 1"/></material>': (0.1, 1.0, 0.0, 1.0),
        '<material name="n"><color rgba="0.1 0.2 0.3"/></material>': None,
        '<material><color rgba="0 0 1 1"/></material>': (0.0, 0.0, 1.0, 1.0),
        '<material name="o"><color rgba="1,0,0,1"/></material>': None,
        '<material name="p"><color rgba="nan 0 0 1"/></material>': None,
        "": None,
    }
    for material, colour in colours.items():
        description = RobotDescription.from_urdf(
            biped(geometry=FOOT_BOX + odd + shape(ball, material)), **FEET
        )
        shapes = [each for each in description.mechanism.shapes if each.link == "l_ankle_roll_link"]
        assert [each.kind for each in shapes] == ["box", "sphere"]
        assert shapes[0].size.tolist() == [0.1, 0.045, 0.01] and shapes[1].size.tolist() == [0.1]
        assert shapes[1].colour == colour and shapes[1].place.translation.tolist() == [0.0, 0.0, 0.1]


def test_a_material_may_be_used_before_the_link_that_defines_it() -> None:
    use = '<visual><geometry><sphere radius="0.1"/></geometry><material name="red"/></visual>'
    define = use.replace('name="red"/>', 'name="red"><color rgba="1 0 0 1"/></material>')
    xml = (
        biped()
        .replace('<link name="trunk">', f'<link name="trunk">{use}')
        .replace('<link name="r_elbow_link">', f'<link name="r_elbow_link">{define}')
    )
    shapes = [
        each for each in RobotDescription.from_urdf(xml, **FEET).mechanism.shapes if each.kind == "sphere"
    ]
    assert [each.link for each in shapes] == ["trunk", "r_elbow_link"]
    assert [each.colour for each in shapes] == [(1.0, 0.0, 0.0, 1.0)] * 2


# Names and files


def test_a_description_is_found_by_the_name_that_a_spec_keeps() -> None:
    g1, mine = load("g1"), described()
    assert all(registry.name_of(each) == "g1" for each in (g1, "g1", pickle.loads(pickle.dumps(g1))))
    name = registry.name_of(mine)
    assert name == f"biped#{mine.digest}" and load(name) is mine and registry.stamped(name) == name
    disguised = dataclasses.replace(mine, name="g1")
    assert registry.name_of(disguised) == f"g1#{mine.digest}" and load("g1") is g1
    assert {"panda", "go1"} <= set(registry.others()) and not {*registry.others()} & {*registry.names()}
    assert wbc.load_robot("panda") is load("panda")


@pytest.mark.parametrize(
    ("name", "path"),
    [("a.toml", True), ("a.XML", True), ("a/b", True), ("a\\b", True), ("g1", False), ("urdf", False)],
)
def test_names_with_an_ending_or_a_slash_are_paths(name: str, path: bool) -> None:
    assert files.is_path(name) == path


def test_a_file_of_a_robot_that_is_not_there_or_names_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no robot file .*gone\.xml"):
        load(tmp_path / "gone.xml")
    (tmp_path / "a.toml").write_text("feet = false\n")
    with pytest.raises(InputError, match="must name the file of the robot"):
        load(tmp_path / "a.toml")


def test_the_hand_of_panda_points_straight_down_in_front_of_it() -> None:
    robot = load("panda").robot()
    hand = robot.placement("panda_hand")
    np.testing.assert_allclose(hand.rotation[:, 2], [0.0, 0.0, -1.0], atol=1e-9)
    assert hand.translation[0] > 0.3 and abs(hand.translation[1]) < 1e-9 and hand.translation[2] > 0.3


def test_go1_stands_on_feet_below_its_hips_with_knees_to_the_rear() -> None:
    """Thighs and calves of one length, bent by 0.9 and −1.8 rad: each foot is under its hip."""
    robot = load("go1").robot()
    for leg in ("FL", "FR", "RL", "RR"):
        hip, calf, foot = (robot.placement(f"{leg}_{part}").translation for part in ("thigh", "calf", "foot"))
        assert foot[0] == pytest.approx(hip[0], abs=1e-3) and calf[0] < hip[0] - 0.1
        assert foot[2] < calf[2] < hip[2]


def test_talos_bends_forward_by_its_second_torso_joint() -> None:
    talos = load("talos")
    assert talos.half_sitting["torso_2_joint"] == 0.006761 and talos.half_sitting["torso_1_joint"] == 0.0
    robot = talos.robot()
    up = robot.placement("torso_2_link").rotation[:, 2]
    assert up == pytest.approx([np.sin(0.006761), 0.0, np.cos(0.006761)], abs=1e-9)
    left, right = (pin.SE3(robot.placement(f"{side}_sole")).translation for side in ("left", "right"))
    assert left[0] == pytest.approx(right[0], abs=1e-9) and left[1] == pytest.approx(-right[1], abs=1e-9)
