"""Forces of an MJCF beside its drives: named, taken into the model, or switched off."""

from __future__ import annotations

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from mjcf_biped import biped
from mjcf_robot import plain
from mujoco_dynamics import assert_same_dynamics

from wbc import TorqueControl, balance_controller
from wbc.base.errors import ModelError
from wbc.robots import RobotDescription
from wbc.robots.notes import UNMODELLED
from wbc.sim import MujocoLoop, Plant

END = "</worldbody>"


TENDONS = (
    "<tendon>"
    + "".join(
        f'<fixed name="{side}" {{}}><joint joint="{side}_shoulder" coef="1"/></fixed>'
        for side in ("left", "right")
    )
    + "</tendon>"
)
FLAGS = ("gravity", "contact", "constraint", "actuation", "limit")
NAMED = {
    "equalities": (
        '<equality><weld name="stand" body1="chest" body2="world"/>'
        '<connect name="leash" body1="ball" body2="left_arm" anchor="0 0 0"/>'
        '<joint name="gear" joint1="left_knee" joint2="right_knee"/><joint name="stop" joint1="waist"/>'
        '<tendon name="both" tendon1="left" tendon2="right"/></equality>' + TENDONS.format("", ""),
        ["'stand'", "'leash'", "'gear'", "'stop'", "'both'"],
    ),
    "tendons": (TENDONS.format('stiffness="5"', 'damping="1"'), ["'left' (spring)", "'right' (damping)"]),
    "more of tendons": (
        TENDONS.format('armature="0.1"', 'damping="0 1 0"'),
        ["'left' (armature)", "'right' (damping)"],
    ),
    "another planet": (
        '<option gravity="0.5 0 -9.79" density="1000"/>',
        ["gravity (0.5", "density 1000 kg/m³"],
    ),
    "moon": ('<option gravity="0 0 -1.62"/>', ["gravity (0, 0, -1.62)"]),
    "nothing acts": (
        "<option><flag {}/></option>".format(" ".join(f'{flag}="disable"' for flag in FLAGS)),
        [f"{flag} is disabled" for flag in FLAGS],
    ),
}


@pytest.mark.parametrize("what", NAMED)
def test_forces_that_the_controller_does_not_know_are_named_at_the_start(what: str) -> None:
    """By the description, and by the loop in that model with the description of another file."""
    extra, names = NAMED[what]
    xml = biped(extra=extra)
    doubts = [line for line in RobotDescription.from_mjcf(xml).doubts() if UNMODELLED in line]
    assert len(doubts) == len(names) and all(any(name in line for line in doubts) for name in names)
    notes = MujocoLoop(plain(), mujoco.MjModel.from_xml_string(xml)).notes
    assert [line for line in notes if UNMODELLED in line and "other than described" not in line] == doubts


KNEE, OTHER_KNEE = (f'<motor joint="{side}_knee" gear="2" ctrlrange="-40 40"' for side in ("left", "right"))
CHANGED = (
    ('<freejoint name="floating"/>', '<joint name="floating" type="free"/>', "'floating'"),
    (
        KNEE,
        f'<general joint="left_knee" group="4"/>{KNEE} damping="0 2"',
        "damping by a polynomial of left_knee",
    ),
    ('name="waist"', 'name="waist" stiffness="0 5"', "springs by a polynomial of waist"),
    (OTHER_KNEE, f'{OTHER_KNEE} delay="0.01" nsample="8"', "delay of 1 actuators, up to 10 ms"),
    (' kp="200" kv="10"', ' kp="200" kv="10" timeconst="0.02"', "lag of 1 actuators, up to 20 ms"),
    ("</actuator>", '<motor name="rocket" joint="floating"/></actuator>', "'rocket'"),
)


def test_what_elements_do_beside_what_is_read_is_named() -> None:
    xml, names = biped(extra='<option actuatorgroupdisable="4"/>'), ["(group 4)"]
    for old, new, said in CHANGED:
        assert old in xml
        xml = xml.replace(old, new, 1)
        names.append(said)
    doubts = [line for line in RobotDescription.from_mjcf(xml).doubts() if UNMODELLED in line]
    assert len(doubts) == len(names) and all(any(name in line for line in doubts) for name in names)
    notes = MujocoLoop(plain(), mujoco.MjModel.from_xml_string(xml)).notes
    assert set(doubts) <= set(notes)
    damper = '<damper joint="waist" kv="2" ctrlrange="0 1"/></actuator>'
    xml = biped().replace("</actuator>", damper)
    assert any(UNMODELLED in line and "damper" in line for line in RobotDescription.from_mjcf(xml).doubts())
    with pytest.raises(ModelError, match="must be a motor"):
        MujocoLoop(plain(), mujoco.MjModel.from_xml_string(xml))


ROTORS = {
    "own": 'gear="10" armature="0.0004" damping="0.003"',
    "negative gear": 'gear="-7" armature="0.0004" damping="0.003"',
    "group that is off": 'gear="10" armature="0.0004" damping="0.003" group="4"',
}


@pytest.mark.parametrize("what", [*ROTORS, "two", "class"])
def test_rotors_and_friction_of_actuators_are_those_of_their_joints(what: str) -> None:
    """gear² times what the actuator has, as MuJoCo's mass matrix and passive forces have them."""
    own = ROTORS.get(what, ROTORS["own"])
    motor = f'<motor joint="left_knee" {own}/>'
    xml = biped(extra='<option actuatorgroupdisable="4"/>')
    if what == "class":
        xml = xml.replace(
            "<default>",
            '<default><default class="big"><motor gear="10" armature="0.0004" damping="0.003"/></default>',
            1,
        )
        motor = '<motor joint="left_knee" class="big"/>'
    if what == "two":
        motor += '<motor joint="left_knee" gear="3" armature="0.001" damping="0.01"/>'
    xml = xml.replace("</actuator>", f"{motor}</actuator>")
    model = mujoco.MjModel.from_xml_string(xml)
    description = RobotDescription.from_mjcf(xml)
    assert description.armature["left_knee"] > 0.03
    assert_same_dynamics(description, mujoco.MjModel.from_xml_string(xml), states=3)
    data = mujoco.MjData(model)
    dof = int(model.joint("left_knee").dofadr[0])
    data.qvel[dof] = 2.0
    mujoco.mj_forward(model, data)
    assert 2.0 * description.damping["left_knee"] == pytest.approx(-data.qfrc_damper[dof])
    loop = MujocoLoop(description, model)
    assert not any("rotor" in note or "damping" in note for note in loop.notes if "left_knee" in note)
    other = MujocoLoop(plain(), model)
    assert any("rotor inertia of 1 joints" in note and "left_knee" in note for note in other.notes)


@pytest.mark.parametrize(
    ("flag", "name"), [("spring", "springs"), ("damper", "damping"), ("frictionloss", "frictionloss")]
)
def test_what_a_flag_switches_off_is_not_taken_into_the_description(flag: str, name: str) -> None:
    xml = biped(extra=f'<option><flag {flag}="disable"/></option>')
    xml = xml.replace('<joint name="waist"', '<joint name="waist" stiffness="30"')
    description = RobotDescription.from_mjcf(xml)
    assert not getattr(description, name)
    assert any(f"{flag} is disabled" in line for line in description.doubts())


def test_actuators_of_a_group_that_is_off_neither_drive_nor_give_gains() -> None:
    servo = '<position joint="left_knee" kp="300" group="4"/></actuator>'
    extra = '<option actuatorgroupdisable="4"/>'
    description = RobotDescription.from_mjcf(biped(extra=extra).replace("</actuator>", servo))
    assert "left_knee" not in description.gains
    assert "left_knee" in RobotDescription.from_mjcf(biped().replace("</actuator>", servo)).gains
    alone = re.sub(
        r'<motor joint="left_shoulder"/>', '<motor joint="left_shoulder" group="4"/>', biped(extra=extra)
    )
    assert "left_shoulder" not in RobotDescription.from_mjcf(alone).joint_names


def test_springs_and_damping_beside_the_drives_are_forces_of_the_controllers_model() -> None:
    """They are those of MuJoCo, with springs at rest where the file says; the plant has them as well."""
    xml = biped().replace(
        'range="-60 60"/>\n        <inertial',
        'range="-60 60" stiffness="100" springref="-20"/>\n        <inertial',
    )
    xml = xml.replace('<joint name="waist"', '<joint name="waist" stiffness="30"')
    description = RobotDescription.from_mjcf(xml)
    assert description.springs == {
        "waist": (30.0, 0.0),
        "left_ankle_pitch": pytest.approx((100.0, np.radians(-20.0))),
        "right_ankle_pitch": pytest.approx((100.0, np.radians(-20.0))),
    }
    plain, robot = replace(description, springs={}, damping={}).robot(), description.robot()
    q, v = np.array(robot.half_sitting), np.linspace(-2.0, 3.0, robot.nv)
    q[7:] += 0.1
    model = Plant(description).model
    data = mujoco.MjData(model)
    joints = [model.joint(name).id for name in description.joint_names]
    places = model.jnt_dofadr[joints]
    data.qpos[model.jnt_qposadr[joints]], data.qvel[places] = q[7:], v[6:]
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_passive(model, data)
    assert abs(data.qfrc_spring[places]).max() > 1.0 and abs(data.qfrc_damper[places]).min() > 1e-2
    plain.update(q, v)
    for each in (robot, robot.clone()):
        each.update(q, v)
        np.testing.assert_allclose((plain.bias - each.bias)[6:], data.qfrc_passive[places], atol=1e-9)
    loop = MujocoLoop(description, mujoco.MjModel.from_xml_string(xml), control_period=0.002)
    control = TorqueControl(balance_controller(description.robot(), 0.002))
    start = loop.truth().com
    while loop.time < 0.5:
        loop.step(control.command(loop.measure()))
    assert control.failures == 0 and abs(loop.truth().com - start).max() < 5e-3


@pytest.mark.parametrize("gear", [2.0, -2.0])
def test_a_drive_of_one_direction_has_its_limits_in_controller_and_plant(gear: float) -> None:
    knee = '<motor joint="left_knee" gear="2" ctrlrange="-40 40"/>'
    xml = biped().replace(knee, f'<motor joint="left_knee" gear="{gear}" ctrlrange="0 30"/>')
    xml = xml.replace('<joint name="waist"', '<joint name="waist" actuatorfrcrange="-60 20"')
    description = RobotDescription.from_mjcf(xml)
    expected = {"left_knee": (0.0, 60.0) if gear > 0.0 else (-60.0, 0.0), "waist": (-60.0, 20.0)}
    assert description.torque_ranges == expected
    robot, model = description.robot(), Plant(description).model
    for name, (least, most) in expected.items():
        i = robot.joint_index(name)
        assert (robot.torque_lower[i], robot.torque_upper[i]) == (least, most)
        np.testing.assert_array_equal(model.actuator(name).forcerange, (least, most))
    cannot = [line for line in description.doubts() if "left_knee" in line]
    assert bool(cannot) == (gear > 0.0), "standing takes a negative torque of the knee"
    given = RobotDescription.from_mjcf(xml, torque_limits={"left_knee": 50.0})
    assert set(given.torque_ranges) == {"waist"}


def test_what_does_not_act_is_not_named() -> None:
    off = '<equality><joint joint1="left_knee" joint2="right_knee" active="false"/></equality>'
    for extra in (off, TENDONS.format("", ""), '<option wind="1 0 0"/>'):
        assert not any(UNMODELLED in line for line in RobotDescription.from_mjcf(biped(extra=extra)).doubts())
    floating = biped().replace('<body name="chest"', '<body name="chest" gravcomp="1"')
    assert any("gravcomp" in line for line in RobotDescription.from_mjcf(floating).doubts())


def test_a_winch_beside_the_robot_is_none_of_its_drives() -> None:
    crane = '<body name="crane"><joint name="lift" type="slide"/><geom size="0.1"/><site name="hook"/></body>'
    rope = '<tendon><spatial name="rope"><site site="hook"/><site site="beam"/></spatial></tendon>'
    xml = biped(extra=rope).replace(END, f'{crane}<site name="beam" pos="0 0 3"/>{END}')
    xml = xml.replace("</actuator>", '<motor name="winch" tendon="rope"/></actuator>')
    assert RobotDescription.from_mjcf(xml).joint_names == plain().joint_names
    with pytest.raises(ModelError, match="'rope'"):
        RobotDescription.from_mjcf(xml.replace('site="beam"', 'site="imu_here"'))
