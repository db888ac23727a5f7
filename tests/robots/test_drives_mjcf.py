"""Drives, springs, sensors and keyframes of an MJCF, and the forces beside them: MuJoCo's own figures."""

from __future__ import annotations

import itertools

import mujoco
import pytest
from mjcf_biped import MOTORS, biped

from wbc.base.errors import InputError, ModelError
from wbc.robots import RobotDescription
from wbc.robots.derivation.servo import read_gains
from wbc.robots.readers.drives_mjcf import keyframes, passive_joints, read_drives, sensors
from wbc.robots.readers.forces_mjcf import unmodelled
from wbc.robots.readers.tree_mjcf import Tree, find_tree

ARM = """<mujoco><compiler angle="radian" autolimits="true"/><worldbody>
<body name="base" pos="1 5 0" euler="0 0 {turn}">{root}<geom name="stand" size=".1"/><site name="root_site"/>
<body name="upper" pos="0 0 .2"><joint name="a" axis="0 1 0" {a}/><geom name="tube" type="capsule"
fromto="0 0 0 .3 0 0" size=".03"/><site name="upper_site"/>
<body name="lower" pos=".3 .2 0"><joint name="b" axis="0 1 0" {b}/><geom type="capsule" fromto="0 0 0 .2 .05 0"
size=".03"/><site name="lower_site" pos=".1 0 0"/></body></body></body>
<body name="crane" pos="0 3 2"><joint name="lift" type="slide"/><geom name="hook" size=".1"/><site name="hook_site"/>
</body><site name="beam" pos="0 0 3"/></worldbody>{extra}</mujoco>"""


def arm(
    extra: str = "", *, a: str = "", b: str = "", root: str = "", turn: float = 0.0, drives: str = ""
) -> tuple[mujoco.MjModel, Tree]:
    """Return a model of two joints beside a crane, and the robot in it."""
    actuators = f"<actuator>{drives}</actuator>" if drives else ""
    xml = ARM.format(a=a, b=b, root=root, turn=turn, extra=actuators + extra)
    model = mujoco.MjModel.from_xml_string(xml)
    return model, find_tree(model, "base", {}, not root)


RANGES = {  # actuators, attributes of the joint → least and greatest torque, or None
    "motor": ('<motor joint="a" gear="2" ctrlrange="-3 5"/>', "", (-6.0, 10.0)),
    "the other way round": ('<motor joint="a" gear="-2" ctrlrange="-3 5"/>', "", (-10.0, 6.0)),
    "two": (
        '<motor joint="a" gear="2" ctrlrange="-3 5"/><motor joint="a" gear="-3" ctrlrange="-5 10"/>',
        "",
        (-36.0, 25.0),
    ),
    "one way": ('<motor joint="a" gear="2" ctrlrange="-9 -4"/>', "", (-18.0, -8.0)),
    "gain": ('<general joint="a" gear="2" gainprm="5" ctrlrange="-2 3"/>', "", (-20.0, 30.0)),
    "negative gain": ('<general joint="a" gear="2" gainprm="-5" ctrlrange="-2 3"/>', "", (-30.0, 20.0)),
    "forces": (
        '<general joint="a" gear="2" gainprm="5" ctrlrange="-2 3" forcerange="-8 9"/>',
        "",
        (-16.0, 18.0),
    ),
    "one force": (
        '<general joint="a" gear="2" gainprm="5" ctrlrange="-2 3" forcerange="-30 9"/>',
        "",
        (-20.0, 18.0),
    ),
    "joint": ('<motor joint="a" gear="2" ctrlrange="-3 5"/>', 'actuatorfrcrange="-4 7"', (-4.0, 7.0)),
    "one side of the joint": (
        '<motor joint="a" gear="2" ctrlrange="-3 5"/>',
        'actuatorfrcrange="-9 7"',
        (-6.0, 7.0),
    ),
    "joint alone": ('<motor joint="a" gear="2"/>', 'actuatorfrcrange="-4 7"', (-4.0, 7.0)),
    "none": ('<motor joint="a" gear="2"/>', "", None),
    "no gear": ('<motor joint="a" gear="0" ctrlrange="-1 1"/>', "", None),
}


@pytest.mark.parametrize("what", RANGES)
def test_torques_of_a_joint_are_those_that_mujoco_can_send_to_it(what: str) -> None:
    """At the ends of all controls."""
    drives, joint, expected = RANGES[what]
    model, tree = arm(drives=drives, a=joint)
    assert read_drives(tree).torque.get("a") == expected
    if expected is not None:
        data, sent = mujoco.MjData(model), []
        ends = [(-1e3, 1e3) for _ in range(model.nu)]  # MuJoCo clamps them
        for controls in itertools.product(*ends):
            data.ctrl[:] = controls
            mujoco.mj_forward(model, data)
            sent.append(float(data.qfrc_actuator[model.joint("a").dofadr[0]]))
        assert (min(sent), max(sent)) == expected


def test_the_range_of_an_activation_bounds_a_torque() -> None:
    lag = '<general joint="a" dyntype="filter" dynprm="0.1" gainprm="10" gear="2" actrange="-1 2" ctrlrange="-5 5"/>'
    assert read_drives(arm(drives=lag)[1]).torque["a"] == (-20.0, 40.0)
    off = '<option><flag clampctrl="disable"/></option>'
    motor = '<motor joint="a" gear="2" ctrlrange="-3 5"/>'
    assert "a" not in read_drives(arm(off, drives=motor)[1]).torque


@pytest.mark.parametrize(
    "drives",
    [
        '<position joint="a" gear="3" kp="200" kv="10"/>',
        '<position joint="a" gear="-3" kp="200" kv="10"/><position joint="a" gear="2" kp="50" kv="4"/>',
        '<general joint="a" gear="0.5" gainprm="70" biastype="affine" biasprm="3 -70 -8"/>',
        '<pid joint="a" gear="2" kp="900" kv="9"/>',
    ],
)
def test_gains_are_how_fast_the_torques_of_mujoco_change_with_place_and_speed(drives: str) -> None:
    model, tree = arm(drives=drives)
    found = read_drives(tree)
    data, dof = mujoco.MjData(model), int(model.joint("a").dofadr[0])

    def torque(q: float, v: float) -> float:
        data.qpos[model.joint("a").qposadr[0]], data.qvel[dof] = q, v
        mujoco.mj_forward(model, data)
        return float(data.qfrc_actuator[dof])

    slopes = torque(0, 0) - torque(1, 0), torque(0, 0) - torque(0, 1)
    assert found.gains == {"a": pytest.approx(slopes)}
    assert not read_drives(arm(drives='<velocity joint="a" kv="5"/>')[1]).gains


def test_springs_rotors_and_friction_of_a_follower_are_felt_at_its_leader() -> None:
    """By virtual work: what the follower, at −0.5 q + 0.2, adds to the torque of the leader at any place q."""
    own = 'stiffness="30" springref="0.1" armature="0.3" damping="0.4" frictionloss="0.5"'
    follower = 'stiffness="80" springref="0.7" armature="0.02" damping="0.6" frictionloss="0.8"'
    tie = '<equality><joint joint1="b" joint2="a" polycoef="0.2 -0.5 0 0 0"/></equality>'
    found = read_drives(arm(tie, a=own, b=follower, drives='<motor joint="a"/>')[1])
    stiffness, rest = found.springs["a"]
    for q in (-1.0, 0.0, 2.0):
        torque = -30.0 * (q - 0.1) + 0.5 * 80.0 * (-0.5 * q + 0.2 - 0.7)
        assert -stiffness * (q - rest) == pytest.approx(torque)
    assert found.armature == {"a": pytest.approx(0.3 + 0.25 * 0.02)}
    assert found.damping == {"a": pytest.approx(0.4 + 0.25 * 0.6)}
    assert found.frictionloss == {"a": pytest.approx(0.5 + 0.5 * 0.8)}
    bare = read_drives(arm(tie, a="", b="", drives='<motor joint="a"/>')[1])
    assert not bare.springs and not bare.damping and not bare.frictionloss


@pytest.mark.parametrize(
    ("joint", "place"),
    [
        ("", 0.0),
        ('ref="0.3"', 0.3),
        ('stiffness="5" springref="0.4"', 0.4),
        ('stiffness="5" springref="2" range="-1 1"', 1.0),
        ('stiffness="5" springref="-2" range="-1 1"', -1.0),
        ('springref="0.4"', 0.0),
    ],
)
def test_a_joint_that_nothing_drives_rests_where_its_spring_holds_it(joint: str, place: float) -> None:
    motor = '<motor joint="a"/>'
    assert passive_joints(arm(b=joint, drives=motor)[1]) == {"b": pytest.approx(place)}
    tie = '<equality><joint joint1="b" joint2="a"/></equality>'
    assert passive_joints(arm(tie, b=joint, drives=motor)[1]) == {}
    assert passive_joints(arm(b=joint)[1]) == {}, "with no drives at all every joint is taken as driven"
    assert passive_joints(arm(b=joint, drives='<motor joint="lift"/>')[1]) == {}


@pytest.mark.parametrize(
    ("joint", "drives", "said"),
    [
        ('actuatorfrcrange="-5 5"', '<motor joint="a" forcerange="10 20"/>', "joint 'a'"),
        ('actuatorfrcrange="-5 5"', '<motor joint="a" forcerange="5 20"/>', "joint 'a'"),
        ('actuatorfrcrange="0 5"', '<motor joint="a" ctrlrange="-6 -1"/>', "joint 'a'"),
        (
            "",
            '<motor name="m" joint="a" forcerange="-5 5" ctrlrange="10 20"/><motor joint="a"/>',
            "actuator 'm'",
        ),
        ("", '<motor name="m" joint="a" gear="-1" forcerange="-5 5" ctrlrange="10 20"/>', "actuator 'm'"),
    ],
)
def test_ranges_of_torques_that_exclude_each_other_are_refused(joint: str, drives: str, said: str) -> None:
    with pytest.raises(ModelError, match=f"{said}: its ranges of torques, .*, have no range in common"):
        read_drives(arm(a=joint, drives=drives)[1])


ROPE = '<tendon><spatial name="rope"><site site="{}"/><site site="{}"/></spatial></tendon>'
OTHER = {  # actuator, other sections → what it drives
    "site": ('<motor name="m" site="upper_site" gear="0 0 1 0 0 0"/>', "", "a site of the robot"),
    "suction": ('<adhesion name="m" body="upper" ctrlrange="0 1"/>', "", "a body of the robot"),
    "rope": ('<motor name="m" tendon="rope"/>', ROPE.format("lower_site", "beam"), "tendon 'rope'"),
    "other site": ('<motor name="m" site="hook_site" gear="0 0 1 0 0 0"/>', "", ""),
    "other suction": ('<adhesion name="m" body="crane" ctrlrange="0 1"/>', "", ""),
    "other rope": ('<motor name="m" tendon="rope"/>', ROPE.format("hook_site", "beam"), ""),
    "group that is off": (
        '<motor name="m" site="upper_site" gear="0 0 1 0 0 0" group="3"/>',
        '<option actuatorgroupdisable="3"/>',
        "",
    ),
}


@pytest.mark.parametrize("what", OTHER)
def test_drives_of_the_robot_that_turn_no_joint_are_refused(what: str) -> None:
    drives, extra, said = OTHER[what]
    tree = arm(extra, drives=f'<motor joint="a"/><motor joint="b"/>{drives}')[1]
    if said:
        with pytest.raises(ModelError, match=f"'m' drives {said}"):
            passive_joints(tree)
    else:
        passive_joints(tree)


def test_keyframes_are_read_by_joint_those_to_stand_in_first() -> None:
    keys = "".join(
        f'<key {name} qpos="{q} {q + 0.1} 0"/>'
        for name, q in (("", 0.1), ('name="walk"', 0.2), ('name="my_stand"', 0.3), ('name="Home"', 0.4))
    )
    assert keyframes(arm(f"<keyframe>{keys}</keyframe>")[1]) == [
        (name, {"a": pytest.approx(q), "b": pytest.approx(q + 0.1)})
        for name, q in (("Home", 0.4), ("my_stand", 0.3), ("0", 0.1), ("walk", 0.2))
    ]


@pytest.mark.parametrize("turn", [0.0, 1.0])
def test_the_imu_is_a_site_with_both_sensors_nearest_to_the_root_and_on_no_limb(turn: float) -> None:
    """The lower arm lies 0.2 m beside the root, along its own y axis."""
    gyro, accelerometer = '<gyro site="{}"/>', '<accelerometer name="acc_{0}" site="{0}"/>'
    for parts, site in (
        ((gyro, "upper_site"), "upper_site"),
        ((gyro, "upper_site", accelerometer, "upper_site"), "upper_site"),
        ((gyro, "upper_site", accelerometer, "root_site"), "root_site"),
        ((gyro, "root_site", gyro, "upper_site", accelerometer, "upper_site"), "upper_site"),
        ((gyro, "upper_site", gyro, "root_site"), "root_site"),
        ((gyro, "lower_site", accelerometer, "lower_site"), None),
        ((gyro, "lower_site", accelerometer, "upper_site"), "upper_site"),
        ((gyro, "hook_site"), None),
    ):
        text = "".join(kind.format(at) for kind, at in zip(parts[::2], parts[1::2], strict=True))
        imu, roles = sensors(arm(f"<sensor>{text}</sensor>", turn=turn, root="<freejoint/>")[1])
        assert (imu.frame if imu else None) == site
        if imu and accelerometer in parts and parts[parts.index(accelerometer) + 1] == site:
            assert roles["accelerometer"] == f"acc_{site}"
        pairs = [*zip(parts[::2], parts[1::2], strict=True)]
        if imu and (gyro, site) in pairs:
            assert roles["gyroscope"] == f"sensor {pairs.index((gyro, site))}"


def test_force_and_torque_sensors_have_the_roles_of_their_bodies() -> None:
    text = '<force name="f" site="lower_site"/><torque site="lower_site"/><force site="hook_site"/><clock/>'
    imu, roles = sensors(arm(f"<sensor>{text}</sensor>")[1])
    assert imu is None and roles == {"lower force": "f", "lower torque": "sensor 1"}


NOTES = {  # sections, attributes of joint a, actuators → figures of the only note, or None
    "nothing": ("", "", "", None),
    "gravity": ('<option gravity="0.5 0 -9.79"/>', "", "", ("(0.5, 0, -9.79)",)),
    "gravity to the side": ('<option gravity="3 4 0"/>', "", "", ("(3, 4, 0)",)),
    "gravity upward": ('<option gravity="0 0 9.81"/>', "", "", ("(0, 0, 9.81)",)),
    "a little gravity": ('<option gravity="0 0 -9.82"/>', "", "", None),
    "no gravity": (
        '<option gravity="0 0 -9.82"><flag gravity="disable"/></option>',
        "",
        "",
        ("nothing falls",),
    ),
    "straight": ("", 'stiffness="5" damping="1"', "", None),
    "delays": (
        "",
        "",
        '<motor joint="a" delay=".01" nsample="8"/><motor joint="b" delay=".02" nsample="8"/><motor joint="a"/>',
        ("delay of 2 actuators, up to 20 ms",),
    ),
    "lags": (
        "",
        "",
        '<general joint="a" dyntype="filter" dynprm=".1"/><general joint="b" dyntype="filterexact" dynprm=".05"/>'
        '<general joint="b" dyntype="none" dynprm=".5"/>',
        ("lag of 2 actuators, up to 100 ms",),
    ),
    "an integral": ("", "", '<pid joint="a" kp="900" ki="1"/>', ("'a' of joint 'a'", "pid with an integral")),
    "integrated": ("", "", '<intvelocity joint="a" kp="9" actrange="-1 1"/>', ("integrated control",)),
    "a damper": ("", "", '<damper joint="a" kv="2" ctrlrange="0 1"/>', ("gain that depends on",)),
    "a muscle": ("", "", '<muscle joint="a" lengthrange="0 1"/>', ("muscle",)),
    "a muscle that is off": (
        '<option actuatorgroupdisable="3"/>',
        "",
        '<muscle joint="a" lengthrange="0 1" group="3"/>',
        ("1 actuators whose group is disabled", "'a' (group 3)"),
    ),
    "another group": ('<option actuatorgroupdisable="3"/>', "", '<motor joint="a" group="4"/>', None),
    "crane's delay": ("", "", '<motor joint="lift" delay=".01" nsample="8"/>', None),
}


@pytest.mark.parametrize("what", NOTES)
def test_forces_beside_the_drives_are_named_with_their_figures(what: str) -> None:
    extra, joint, drives, figures = NOTES[what]
    if "gravity" not in extra and "<option" not in extra:
        extra += '<option gravity="0 0 -9.80665"/>'
    extra = extra.replace(
        "<option ", "<option " if "gravity=" in extra else '<option gravity="0 0 -9.80665" '
    )
    extra = extra.replace("<option>", '<option gravity="0 0 -9.80665">')
    model, tree = arm(extra, a=joint, drives=drives)
    found = unmodelled(model, tree.bodies, {number: name for name, number in tree.joints.items()})
    assert len(found) == (figures is not None), found
    assert all(each in found[0] for each in figures or ())


PULLED = {  # tendon, actuators → parts that act on the robot
    "spring": ('<spatial name="t" stiffness="5" springlength="1">{}</spatial>', "", "spring"),
    "damper": ('<spatial name="t" damping="5">{}</spatial>', "", "damping"),
    "friction": ('<spatial name="t" frictionloss="5">{}</spatial>', "", "dry friction"),
    "limits": ('<spatial name="t" range="0 9">{}</spatial>', "", "limits"),
    "both": ('<spatial name="t" stiffness="5" damping="5">{}</spatial>', "", "spring, damping"),
    "rotor": ('<spatial name="t">{}</spatial>', '<motor tendon="t" armature="0.1" group="4"/>', "armature"),
    "its damping": (
        '<spatial name="t">{}</spatial>',
        '<motor tendon="t" damping="0.1" group="4"/>',
        "damping",
    ),
    "nothing": ('<spatial name="t">{}</spatial>', "", ""),
}


@pytest.mark.parametrize("what", PULLED)
@pytest.mark.parametrize("ends", [("lower_site", "beam"), ("beam", "upper_site"), ("hook_site", "beam")])
def test_what_a_tendon_does_to_the_robot_is_named(what: str, ends: tuple[str, str]) -> None:
    tendon, drives, parts = PULLED[what]
    sites = "".join(f'<site site="{end}"/>' for end in ends)
    options = '<option gravity="0 0 -9.80665" actuatorgroupdisable="4"/>'
    model, tree = arm(options + f"<tendon>{tendon.format(sites)}</tendon>", drives=drives)
    found = unmodelled(model, tree.bodies, {number: name for name, number in tree.joints.items()})
    mine = [line for line in found if "tendon 't'" in line]
    assert bool(mine) == (bool(parts) and "hook_site" not in ends)
    assert not mine or mine[0].endswith(f"({parts})")


@pytest.mark.parametrize(
    ("attributes", "said"),
    [
        ('damping="3"', "damping of 3 Ns/m"),
        ('armature="0.3"', "armature of 0.3 kg"),
        ('frictionloss="0.7"', "dry friction of 0.7 N"),
        ('stiffness="9"', "spring of 9 N/m"),
        ("", ""),
    ],
)
def test_what_holds_a_floating_base_to_the_world_is_named_with_its_figure(attributes: str, said: str) -> None:
    free = f'<joint name="float" type="free" {attributes}/>'
    model, tree = arm('<option gravity="0 0 -9.80665"/>', root=free, a='damping="8"', b='armature="8"')
    found = unmodelled(model, tree.bodies, {number: name for name, number in tree.joints.items()})
    assert len(found) == bool(said)
    assert not found or f"of the base: {said}" in found[0]


def test_actuators_that_push_a_floating_base_are_named() -> None:
    rocket = '<motor name="rocket" joint="float" group="{}"/>'
    for group, named in ((0, True), (4, False)):
        options = '<option gravity="0 0 -9.80665" actuatorgroupdisable="4"/>'
        model, tree = arm(
            options,
            root='<joint name="float" type="free"/>',
            drives=rocket.format(group) + '<motor joint="a"/>',
        )
        found = unmodelled(model, tree.bodies, {number: name for name, number in tree.joints.items()})
        assert any("'rocket'" in line for line in found) == named


@pytest.mark.parametrize(
    ("tie", "named"),
    [
        ('<weld name="t" body1="upper" body2="crane"/>', True),
        ('<weld name="t" body1="crane" body2="lower"/>', True),
        ('<connect name="t" body1="crane" body2="world" anchor="0 0 0"/>', False),
        ('<connect name="t" site1="lower_site" site2="hook_site"/>', True),
        ('<connect name="t" site1="hook_site" site2="beam"/>', False),
        ('<weld name="t" body1="upper" body2="crane" active="false"/>', False),
        ('<joint name="t" joint1="a"/>', True),
        ('<joint name="t" joint1="lift"/>', False),
        ('<joint name="t" joint1="a" active="false"/>', False),
    ],
)
def test_equalities_that_hold_the_robot_are_named(tie: str, named: bool) -> None:
    model, tree = arm(f'<option gravity="0 0 -9.80665"/><equality>{tie}</equality>')
    joints = {number: name for name, number in tree.joints.items()}
    found = unmodelled(model, tree.bodies, joints)
    assert [("'t'" in line) for line in found] == [True] * named
    assert not unmodelled(model, tree.bodies, joints, [0]), "one that the description has"
    off = ARM.format(
        a="",
        b="",
        root="",
        turn=0.0,
        extra=f'<option gravity="0 0 -9.80665"><flag equality="disable"/></option><equality>{tie}</equality>',
    )
    assert all(
        "equality is disabled" in line
        for line in unmodelled(mujoco.MjModel.from_xml_string(off), tree.bodies, joints)
    )


@pytest.mark.parametrize(
    ("controls", "torques"), [("-2 5", (-2.0, 5.0)), ("-9 -4", (-9.0, -4.0)), ("0 3", (0.0, 3.0))]
)
def test_drives_of_one_direction_alone_are_ranges_of_a_description(
    controls: str, torques: tuple[float, float]
) -> None:
    drives = f'<motor joint="a" ctrlrange="-5 5"/><motor joint="b" ctrlrange="{controls}"/>'
    xml = ARM.format(a="", b="", root="", turn=0.0, extra=f"<actuator>{drives}</actuator>")
    description = RobotDescription.from_mjcf(xml, root="base", base="fixed")
    robot = description.robot()
    assert description.torque_ranges == {"b": torques}
    assert list(zip(robot.torque_lower.tolist(), robot.torque_upper.tolist(), strict=True)) == [
        (-5.0, 5.0),
        torques,
    ]


@pytest.mark.parametrize(
    ("attributes", "limit"),
    [
        ('gear="2" ctrlrange="-40 40" ctrllimited="false"', None),
        ('gear="2" ctrlrange="-40 40"', 80.0),
        ('gear="2" ctrlrange="-40 40" forcerange="-30 30"', 60.0),
    ],
)
def test_the_torque_of_a_motor_is_bounded_by_what_its_file_limits(
    attributes: str, limit: float | None
) -> None:
    """A range of controls that limits nothing is no bound of a torque."""
    drives = MOTORS.replace('gear="2" ctrlrange="-40 40"', attributes)
    description = RobotDescription.from_mjcf(biped(drives=drives))
    found = description.torque_limit[description.joint_names.index("left_knee")]
    assert (found == pytest.approx(80.0 if limit is None else limit)) == (limit is not None)


def test_gains_of_a_pattern_are_those_of_all_joints_that_fit() -> None:
    names = ("left_knee", "right_knee", "waist")
    assert read_gains(["*knee*=100,2"], names) == {"left_knee": (100.0, 2.0), "right_knee": (100.0, 2.0)}
    assert read_gains(["*=1,0.5", "waist=7,3"], names)["waist"] == (7.0, 3.0)
    for text in ("*elbow*=1,2", "*knee*=1", "*knee*"):
        with pytest.raises(InputError):
            read_gains([text], names)


def test_an_actuator_without_gear_drives_nothing() -> None:
    """A coupling leads a joint that nothing drives."""
    tie = (
        '<equality><joint joint1="right_shoulder" joint2="left_shoulder" polycoef="0 0.5 0 0 0"/></equality>'
    )
    motor = '<motor joint="right_shoulder"/>'
    loose = MOTORS.replace(motor, '<motor joint="right_shoulder" gear="0"/>')
    assert motor in MOTORS
    assert "right_shoulder" in RobotDescription.from_mjcf(biped(drives=loose, extra=tie)).couplings
    assert "right_shoulder" not in RobotDescription.from_mjcf(biped(extra=tie)).couplings
