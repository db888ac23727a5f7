"""Robots as they are: bolted to the world, with coupled joints, with joints that turn without end."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from closed_chains import RODS, four_bar_knee, parallel_ankles, three_bars
from mjcf_biped import MOTORS, biped
from mujoco_dynamics import assert_same_dynamics

import wbc
from wbc.base.errors import InputError, ModelError
from wbc.core.conventions import configuration_to_mujoco, velocity_to_mujoco
from wbc.core.model import Closure, Coupling
from wbc.core.robot import GRAVITY
from wbc.robots import RobotDescription
from wbc.tasks import MomentumTask, check_rows

EXAMPLES = Path(__file__).parents[2] / "examples"
URDF = (EXAMPLES / "biped.urdf").read_text(encoding="utf-8")
FEET = {"left_sole": "left_foot", "right_sole": "right_foot"}


def mimic(xml: str, follower: str, leader: str, ratio: float, offset: float = 0.0) -> str:
    """Return the URDF with a joint that moves with another one."""
    start = xml.index(f'<joint name="{follower}"')
    end = xml.index("</joint>", start)
    element = f'<mimic joint="{leader}" multiplier="{ratio}" offset="{offset}"/>'
    return xml[:end] + element + xml[end:]


def in_mujoco(description: RobotDescription) -> mujoco.MjModel:
    """Return MuJoCo's own reading of the description's URDF, with its rotor inertias."""
    spec = mujoco.MjSpec.from_string(description.urdf_without_geometry())
    spec.compiler.fusestatic = False
    if description.base == "floating":
        spec.worldbody.first_body().add_freejoint()
    for name in description.joint_names:
        spec.joint(name).armature = description.armature[name]
    return spec.compile()


COUPLED = {  # what is coupled: follower, leader, ratio and offset
    "to the joint above": [("left_ankle_pitch", "left_knee", -0.5, -0.1)],
    "across branches": [("right_shoulder", "left_shoulder", -1.0, 0.2)],
    "against the order of names": [("left_shoulder", "right_shoulder", 0.7, 0.0)],
    "chain": [
        ("left_ankle_pitch", "left_knee", -0.5, 0.1),
        ("right_ankle_pitch", "left_ankle_pitch", 2.0, -0.2),
    ],
}


def coupled(what: str) -> tuple[RobotDescription, str]:
    """Return a robot without feet with some joints coupled, and its file."""
    xml = ARMED
    for pair in COUPLED[what]:
        xml = mimic(xml, *pair)
    return RobotDescription.from_urdf(xml), xml


def arm(side: str, y: float) -> str:
    """Return an arm of one joint for the biped."""
    inertia = 'ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"'
    return (
        f'<link name="{side}_arm"><inertial><origin xyz="0.02 0 -0.15"/><mass value="1.1"/><inertia {inertia}/>'
        f'</inertial></link><joint name="{side}_shoulder" type="revolute"><parent link="trunk"/>'
        f'<child link="{side}_arm"/><origin xyz="0 {y} 0.3"/><axis xyz="0 1 0"/>'
        '<limit lower="-2" upper="2" effort="20" velocity="9"/></joint>'
    )


ARMED = URDF.replace("</robot>", arm("left", 0.2) + arm("right", -0.2) + "</robot>")


@pytest.mark.parametrize("what", COUPLED)
def test_dynamics_with_coupled_joints_are_those_of_mujoco(what: str) -> None:
    """Mass matrix with what the leader feels, bias and placements; every Jacobian by finite differences."""
    description, _ = coupled(what)
    followers = {pair[0] for pair in COUPLED[what]}
    assert set(description.couplings) == followers and not followers & set(description.joint_names)
    assert_same_dynamics(description, in_mujoco(description), states=5)
    robot = description.robot()
    assert robot.couplings == dict(description.couplings) == description.robot().clone().couplings
    link = "left_foot" if "left_ankle_pitch" in followers else "left_arm"
    for task in (wbc.PoseTask(link), wbc.CoMTask(), MomentumTask(), wbc.PostureTask()):
        check_rows(task, robot)
    q, v = pin.integrate(robot.model, robot.q, 0.1 * np.ones(robot.nv)), np.linspace(-1.0, 1.0, robot.nv)
    twin = description.robot()
    robot.update(q, v)
    twin.update_kinematics(q, v)
    np.testing.assert_allclose(twin.com_velocity, robot.com_velocity, atol=1e-12)
    np.testing.assert_allclose(robot.com_jacobian @ v, robot.com_velocity, atol=1e-12)
    np.testing.assert_allclose(robot.data.Ag @ v, robot.data.hg.vector, atol=1e-10)


def test_a_chain_of_couplings_is_that_of_its_first_joint() -> None:
    description, _ = coupled("chain")
    assert description.couplings["right_ankle_pitch"] == Coupling("left_knee", -1.0, 0.0)


def test_ranges_and_speeds_of_a_leader_are_those_that_its_followers_allow() -> None:
    description = RobotDescription.from_urdf(mimic(ARMED, "left_shoulder", "right_shoulder", -4.0, 1.0))
    robot = description.robot()
    i = robot.joint_index("right_shoulder")
    assert (robot.position_lower[i], robot.position_upper[i]) == pytest.approx((-0.25, 0.75))
    assert robot.velocity_limit[i] == pytest.approx(9.0 / 4.0)
    said = "\n".join(description.derived)
    assert (
        "'left_shoulder' moves with 'right_shoulder': -4" in said
        and "for the range of 'left_shoulder'" in said
    )


def test_a_robot_with_coupled_joints_stands_in_the_plant() -> None:
    """Knees that are coupled, at half-sitting: an equality holds them, the controller's one torque bends both."""
    xml = mimic(ARMED, "right_shoulder", "left_shoulder", -1.0)
    xml = mimic(xml, "right_knee", "left_knee", 1.0)
    description = RobotDescription.from_urdf(xml, **FEET)
    plant = wbc.Plant(description)
    control = wbc.TorqueControl(wbc.balance_controller(description.robot(), plant.control_period))
    start = plant.truth().com
    knees = [plant.model.joint(name) for name in ("left_knee", "right_knee")]
    while plant.time < 0.5:
        plant.step(control.command(plant.measure()))
    assert control.failures == 0 and np.abs(plant.truth().com - start).max() < 3e-3
    left, right = (float(plant.data.qpos[knee.qposadr[0]]) for knee in knees)
    assert left == pytest.approx(right, abs=2e-3) and left > 0.3


WRONG = {
    "itself": ([("left_knee", "left_knee", 1.0)], "'left_knee' is coupled to itself"),
    "two to each other": (
        [("left_knee", "right_knee", 1.0), ("right_knee", "left_knee", 1.0)],
        "'left_knee', 'right_knee'.*coupled to each other",
    ),
    "nobody": ([("left_knee", "knee_of_left", 1.0)], "leader of joint 'left_knee'"),
    "the joint below": (
        [("left_knee", "left_ankle_pitch", 1.0)],
        "'left_knee'.*hangs on it.*other way round",
    ),
    "no number": ([("left_knee", "right_knee", "two")], "multiplier='two'"),
    "no range left": ([("left_shoulder", "right_shoulder", 1.0, 9.0)], "leaves it no range"),
}


@pytest.mark.parametrize("what", WRONG)
def test_couplings_that_cannot_be_are_refused_by_name(what: str) -> None:
    pairs, said = WRONG[what]
    xml = ARMED
    for pair in pairs:
        xml = mimic(xml, *pair)
    with pytest.raises((ModelError, InputError), match=said):
        RobotDescription.from_urdf(xml)


def test_a_locked_leader_fixes_its_followers_and_a_locked_follower_is_free_of_its_leader() -> None:
    xml = mimic(ARMED, "left_shoulder", "right_shoulder", -1.0, 0.5)
    both = RobotDescription.from_urdf(xml, lock={"right_shoulder": 0.2})
    assert not {"left_shoulder", "right_shoulder"} & set(both.joint_names)
    apart = RobotDescription.from_urdf(ARMED, lock={"right_shoulder": 0.2, "left_shoulder": 0.3})
    np.testing.assert_allclose(both.robot().mass_matrix, apart.robot().mass_matrix, atol=1e-12)
    alone = RobotDescription.from_urdf(xml, lock={"left_shoulder": 0.3})
    assert "right_shoulder" in alone.joint_names and not alone.couplings
    still = RobotDescription.from_urdf(
        mimic(ARMED, "left_shoulder", "right_shoulder", 0.0, 0.3), lock={"right_shoulder": 0.2}
    )
    np.testing.assert_allclose(still.robot().mass_matrix, apart.robot().mass_matrix, atol=1e-12)


GEAR = (
    '<equality><joint name="gear" joint1="right_shoulder" joint2="left_shoulder" polycoef="0.1 {ratio} 0 0 0"/>'
    "</equality>"
)
DRIVES = {  # motor that is taken away → the joint that leads
    "second": ('<motor joint="right_shoulder"/>', "left_shoulder"),
    "first": ('<motor joint="left_shoulder"/>', "right_shoulder"),
}


@pytest.mark.parametrize("what", DRIVES)
def test_joints_of_an_mjcf_that_an_equality_couples_are_led_by_the_one_that_is_driven(what: str) -> None:
    """With rotors, friction and springs of both where they are felt."""
    gone, leader = DRIVES[what]
    follower = "left_shoulder" if leader == "right_shoulder" else "right_shoulder"
    xml = biped(extra=GEAR.format(ratio=0.5)).replace(gone, "")
    xml = xml.replace(f'<joint name="{follower}"', f'<joint stiffness="8" armature="0.05" name="{follower}"')
    description = RobotDescription.from_mjcf(xml)
    ratio, offset = (0.5, 0.1) if what == "second" else (2.0, -0.2)
    assert description.couplings == {follower: Coupling(leader, ratio, pytest.approx(offset))}
    assert description.armature[leader] == pytest.approx(0.02 + ratio**2 * 0.05)
    assert description.damping[leader] == pytest.approx(0.5 + ratio**2 * 0.5)
    assert description.frictionloss[leader] == pytest.approx(0.1 + ratio * 0.1)
    assert description.springs[leader] == pytest.approx((8.0 * ratio**2, -offset / ratio))
    assert not any("gear" in line for line in description.doubts())
    model = mujoco.MjModel.from_xml_string(xml)
    assert_same_dynamics(description, model, states=5)
    loop = wbc.sim.MujocoLoop(description, mujoco.MjModel.from_xml_string(xml))
    assert not [note for note in loop.notes if "gear" in note or leader in note]
    control = wbc.TorqueControl(wbc.balance_controller(description.robot(), loop.control_period))
    start = loop.truth().com
    while loop.time < 0.2:
        loop.step(control.command(loop.measure()))
    assert control.failures == 0 and np.abs(loop.truth().com - start).max() < 3e-3


def test_a_joint_that_would_lead_what_carries_it_is_passive_and_named() -> None:
    gear = GEAR.format(ratio=0.5).replace("right_shoulder", "left_shoulder_out")
    description = RobotDescription.from_mjcf(biped(extra=gear).replace('<motor joint="left_shoulder"/>', ""))
    assert not description.couplings and "left_shoulder" not in description.joint_names
    assert any("left_shoulder" in line and "passive" in line for line in description.doubts())


def test_what_a_locked_joint_leads_is_locked_with_it_in_any_order_of_the_file() -> None:
    ties = (
        '<joint joint1="left_shoulder_out" joint2="right_shoulder" polycoef="0 2 0 0 0"/>',
        '<joint joint1="right_shoulder" joint2="left_shoulder" polycoef="0.1 0.5 0 0 0"/>',
    )
    for order in (ties, ties[::-1]):
        xml = biped(extra=f"<equality>{''.join(order)}</equality>")
        for follower in ("right_shoulder", "left_shoulder_out"):
            xml = xml.replace(f'<motor joint="{follower}"/>', "")
        locked = RobotDescription.from_mjcf(xml, lock={"left_shoulder": 0.2}).locked
        assert locked == pytest.approx(
            {"left_shoulder": 0.2, "right_shoulder": 0.2, "left_shoulder_out": 0.4}
        )


def test_an_equality_of_a_higher_degree_or_between_two_drives_is_named() -> None:
    for extra in (GEAR.format(ratio=0.5), GEAR.format(ratio=0.5).replace("0 0 0", "0.1 0 0")):
        description = RobotDescription.from_mjcf(biped(extra=extra))
        assert not description.couplings and any("'gear'" in line for line in description.doubts())


# ---- bolted bases ---------------------------------------------------------------------------------------------------

ARM_MJCF = """<mujoco><option gravity="0 0 -9.80665"/><worldbody><geom type="plane" size="0 0 1"/>
<body name="stand" pos="0.3 -0.2 0.4" euler="10 20 30">{free}<geom size=".1"/>{first}<body name="upper" pos="0 0 .2">
<joint name="shoulder" axis="0 1 0" range="-90 90" actuatorfrcrange="-80 80" armature="0.01"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03"/>
<body name="lower" pos=".3 0 0"><joint name="elbow" axis="0 1 0" range="-120 120" actuatorfrcrange="-40 40"/>
<geom type="capsule" fromto="0 0 0 .2 .05 0" size=".03"/></body></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("free", "first"),
    [("", ""), ("<freejoint/>", ""), ("", '<joint name="turn" axis="0 0 1" actuatorfrcrange="-9 9"/>')],
)
def test_a_bolted_robot_of_an_mjcf_stands_where_the_file_has_it(free: str, first: str) -> None:
    xml = ARM_MJCF.format(free=free, first=first)
    description = RobotDescription.from_mjcf(xml, base="fixed")
    robot = description.robot()
    assert (robot.nq, robot.nv, robot.floating) == (robot.na, robot.na, False)
    assert robot.na == (3 if first else 2)
    assert_same_dynamics(
        description, mujoco.MjModel.from_xml_string(ARM_MJCF.format(free="", first=first)), states=5
    )
    for task in (wbc.PoseTask("lower"), wbc.CoMTask(), MomentumTask(), wbc.PostureTask()):
        check_rows(task, robot)


@pytest.mark.parametrize("source", ["urdf", "mjcf"])
def test_a_bolted_base_is_that_of_a_fixed_contact_without_its_coordinates(source: str) -> None:
    """Same accelerations and torques, same velocities of inverse kinematics."""
    results, place = [], pin.SE3.Identity()
    for base in ("fixed", "floating"):
        if source == "urdf":
            urdf = wbc.load_robot("panda").urdf
            description = RobotDescription.from_urdf(
                urdf, base=base, half_sitting={"panda_joint4": -1.5}, armature=0.01
            )
        else:
            description = RobotDescription.from_mjcf(
                ARM_MJCF.format(free="", first=""), base=base, root="stand", feet=False
            )
        robot, tip = description.robot(), "panda_hand" if source == "urdf" else "lower"
        rng = np.random.default_rng(3)
        q, v = robot.half_sitting.copy(), np.zeros(robot.nv)
        v[robot.base_dof :] = rng.normal(size=robot.na)
        if robot.floating and source == "mjcf":
            q[:7] = pin.SE3ToXYZQUAT(place)
        robot.update(q, v)
        place = robot.placement(robot.base_frame if source == "urdf" else "stand").copy()
        for solver in (wbc.Controller(robot, 0.002), wbc.InverseKinematics(robot, 0.002)):
            hand = solver.add(wbc.PositionTask(tip, weight=1e3))
            solver.add(wbc.PostureTask(weight=1e-2), wbc.JointLimits())
            if robot.floating:
                solver.add(wbc.FixedContact(robot.base_frame, stiffness=0.0, damping=0.0, rate=0.0))
            hand.target = hand.target + [0.01, 0.02, 0.03]
            if isinstance(solver, wbc.Controller):
                solver.add(wbc.TorqueLimits())
                solution = solver.solve()
                assert solution.ok
                results += [solution.accelerations[-robot.na :], solution.torques]
            else:
                results.append(solver.solve()[-robot.na :])
    for one, other in zip(results[:3], results[3:], strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-4)


def test_a_frame_that_is_bolted_to_the_world_needs_no_contact() -> None:
    robot = RobotDescription.from_mjcf(ARM_MJCF.format(free="", first=""), base="fixed").robot()
    for solver in (wbc.Controller(robot, 0.002), wbc.InverseKinematics(robot, 0.002)):
        with pytest.raises(InputError, match="'stand' is bolted to the world"):
            solver.add(wbc.FixedContact("stand"))


def test_a_root_that_stands_for_the_world_stays_where_a_robot_is_bolted() -> None:
    """A pedestal between the link called world and the robot."""
    world = '<link name="world"/><joint name="mount" type="fixed"><parent link="world"/><child link="trunk"/>'
    xml = ARMED.replace("</robot>", f'{world}<origin xyz="1 2 3" rpy="0 0 1"/></joint></robot>')
    robot = RobotDescription.from_urdf(xml, base="fixed").robot()
    np.testing.assert_allclose(robot.placement("trunk").translation, [1.0, 2.0, 3.0])
    assert robot.nv == robot.na


def test_a_base_of_another_kind_is_refused_and_a_bolted_robot_has_no_feet() -> None:
    with pytest.raises(InputError, match="fixed"):
        RobotDescription.from_urdf(ARMED, base="welded")
    with pytest.raises(InputError, match="base='fixed' is for one without"):
        RobotDescription.from_urdf(ARMED, base="fixed", **FEET)
    with pytest.raises(ModelError, match="base='fixed' bolts it to the world"):
        RobotDescription.from_mjcf(ARM_MJCF.format(free="", first=""), feet=False)


# ---- joints without an end ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("source", ["urdf", "mjcf"])
def test_a_joint_that_turns_without_end_has_one_coordinate_and_no_limits(source: str) -> None:
    """It goes on turning, in both solvers, past half a turn and more."""
    if source == "urdf":
        xml = ARMED.replace('name="left_shoulder" type="revolute"', 'name="left_shoulder" type="continuous"')
        description, name = RobotDescription.from_urdf(xml, base="fixed"), "left_shoulder"
    else:
        turn = '<joint name="turn" axis="0 0 1" actuatorfrcrange="-9 9"/>'
        description, name = (
            RobotDescription.from_mjcf(ARM_MJCF.format(free="", first=turn), base="fixed"),
            "turn",
        )
    robot = description.robot()
    i = robot.joint_index(name)
    assert (robot.position_lower[i], robot.position_upper[i]) == (-np.inf, np.inf)
    assert np.isfinite(np.delete(robot.position_upper, i)).all() and np.isfinite(robot.half_sitting).all()
    assert_same_dynamics(description, in_mujoco(description), states=3)
    assert (
        description.summary()["joints"][name]["position"] == [None, None]
        and "without end" in description.report()
    )
    assert not any(name in line for line in description.doubts() if "position limits" in line)
    q = robot.q.copy()
    q[i] = 40.0
    robot.update(q, np.zeros(robot.nv))
    kinematics = wbc.InverseKinematics(robot, 0.1)
    posture = kinematics.add(wbc.PostureTask())
    kinematics.add(wbc.JointLimits())
    posture.target = {name: 42.0}
    result = kinematics.reach()
    assert result.reached and result.configuration[i] == pytest.approx(42.0, abs=1e-3)
    controller = wbc.Controller(robot, 0.002)
    posture = controller.add(wbc.PostureTask())
    controller.add(wbc.JointLimits(), wbc.TorqueLimits())
    posture.target = {name: 42.5}
    assert controller.solve().ok and controller.solve().accelerations[i] > 0.1


@pytest.mark.parametrize("kind", ["planar", "spherical", "floating"])
def test_joints_of_several_coordinates_are_refused_with_the_way_out(kind: str) -> None:
    way = {"planar": "two prismatic", "spherical": "three revolute", "floating": "base alone"}[kind]
    with pytest.raises(ModelError, match=f"'left_shoulder'.*{way}"):
        RobotDescription.from_urdf(
            ARMED.replace('name="left_shoulder" type="revolute"', f'name="left_shoulder" type="{kind}"')
        )
    ball = ARM_MJCF.format(free="", first='<joint name="wrist" type="ball"/>')
    drive = '<actuator><motor joint="{}"/></actuator></mujoco>'
    for xml in (ball, ball.replace("</mujoco>", drive.format("wrist"))):
        with pytest.raises(ModelError, match="'wrist' is a ball joint.*three hinges"):
            RobotDescription.from_mjcf(xml, base="fixed")


def test_a_ball_joint_that_nothing_drives_is_fixed_as_other_passive_joints_are() -> None:
    """In the controller's model alone: in a simulation of the file it swings."""
    inertial = '<inertial pos=".1 0 0" mass=".5" diaginertia="1e-3 1e-3 1e-3"/>'
    tail = f'<body name="tail" pos="-.1 0 .2" quat="0.8 0.6 0 0">{{}}{inertial}</body><joint name="waist"'
    swings, stiff = (
        biped().replace('<joint name="waist"', tail.format(joint), 1)
        for joint in ('<joint name="ball" type="ball" pos="0 .1 0"/>', "")
    )
    description, own = RobotDescription.from_mjcf(swings), RobotDescription.from_mjcf(stiff)
    np.testing.assert_array_equal(description.robot().mass_matrix, own.robot().mass_matrix)
    assert any("passive" in line and "ball" in line for line in description.doubts())
    loop = wbc.sim.MujocoLoop(description, mujoco.MjModel.from_xml_string(swings), control_period=0.002)
    control = wbc.TorqueControl(wbc.balance_controller(description.robot(), 0.002))
    while loop.time < 0.1:
        loop.step(control.command(loop.measure()))
    assert control.failures == 0 and abs(loop.truth().com - description.robot().com).max() < 0.01
    tie = '<equality><connect body1="tail" body2="left_arm" anchor=".1 0 0"/></equality></mujoco>'
    with pytest.raises(ModelError, match="'ball' is a ball joint"):
        RobotDescription.from_mjcf(swings.replace("</mujoco>", tie))


SEVERAL = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.80665"/><worldbody>
<body name="base" pos=".1 0 1">
<joint name="lift" type="slide" axis="0 0 1"/><geom size=".1"/><body name="arm" pos=".2 .1 0" euler=".3 -.2 .5">
<joint name="one" axis="1 0 1" pos=".05 0 .1" ref=".2"/><joint name="two" type="slide" axis="0 1 1" ref="-.1"/>
<joint name="three" axis="0 1 0" pos="0 .1 -.1"/><geom type="capsule" fromto="0 0 0 .3 0 .1" size=".03"/>
<body name="hand" pos=".3 0 0"><joint name="four" axis="0 0 1" pos="-.02 0 0"/><geom size=".05"/></body></body></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("held", ["", "one", "two", "three", "one two", "two three", "one two three", "four"])
def test_any_joints_of_a_body_with_several_may_be_locked(held: str) -> None:
    """Anchors, references, hinges and slides: places of bodies, mass matrix and bias are MuJoCo's."""
    model, lock = mujoco.MjModel.from_xml_string(SEVERAL), {name: 0.1 * len(name) for name in held.split()}
    every = [model.joint(i).name for i in range(model.njnt)]
    limits = dict.fromkeys((name for name in every if name not in lock), 9.0)
    description = RobotDescription.from_mjcf(SEVERAL, base="fixed", lock=lock, torque_limits=limits)
    assert list(description.joint_names) == [*limits]
    robot, data, rng = description.robot(), mujoco.MjData(model), np.random.default_rng(2)
    free = [int(model.joint(name).dofadr[0]) for name in description.joint_names]
    for name, value in lock.items():
        data.joint(name).qpos = value
    for _ in range(3):
        data.qpos[free], data.qvel[free] = rng.normal(size=(2, len(free)))
        mujoco.mj_forward(model, data)
        robot.update(data.qpos[free], data.qvel[free])
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        np.testing.assert_allclose(robot.mass_matrix, full[np.ix_(free, free)], atol=1e-11)
        np.testing.assert_allclose(robot.bias, data.qfrc_bias[free], atol=1e-10)
        for link in ("base", "arm", "hand"):
            place = robot.placement(link)
            np.testing.assert_allclose(place.translation, data.body(link).xpos, atol=1e-12)
            np.testing.assert_allclose(place.rotation.ravel(), data.body(link).xmat, atol=1e-12)


# ---- closed chains --------------------------------------------------------------------------------------------------

BIPED = (EXAMPLES / "biped.xml").read_text(encoding="utf-8")
BIPED = BIPED.replace("</worldbody>", '<geom name="floor" type="plane" size="0 0 1"/></worldbody>')


def closed(what: str) -> tuple[RobotDescription, mujoco.MjModel]:
    """Return a robot with closed chains, and its model."""
    if what == "ankles":
        xml = parallel_ankles(BIPED)
        return RobotDescription.from_mjcf(xml, left_sole="left_foot", right_sole="right_foot"), (
            mujoco.MjModel.from_xml_string(xml)
        )
    xml = four_bar_knee("<freejoint/>" if what == "floating knee" else "")
    base = "floating" if what == "floating knee" else "fixed"
    return RobotDescription.from_mjcf(xml, base=base, feet=False), mujoco.MjModel.from_xml_string(xml)


def in_motion(description: RobotDescription, seed: int) -> tuple[wbc.Robot, list[wbc.LoopClosure]]:
    """Return a robot at a random posture in which its chains close, moving so that they stay closed."""
    robot, rng = description.robot(), np.random.default_rng(seed)
    ik = wbc.InverseKinematics(robot, 0.01)
    posture = ik.add(wbc.PostureTask(weight=1e-3))
    ik.add(wbc.JointLimits())
    driven = [i for i in range(robot.na) if i not in robot.passive]
    target = robot.q[robot.base_nq :].copy()
    target[driven] += rng.uniform(-0.15, 0.15, len(driven))
    posture.target = np.clip(
        target, np.maximum(robot.position_lower, -3.0), np.minimum(robot.position_upper, 3.0)
    )
    for _ in range(200):
        v = ik.step()
    closures = [contact for contact in ik.contacts if isinstance(contact, wbc.LoopClosure)]
    rows = np.concatenate([rows_of(closure)[0] for closure in closures])
    v = rng.normal(size=robot.nv)
    v -= np.linalg.pinv(rows) @ (rows @ v)
    robot.update(robot.q.copy(), v)
    return robot, closures


def rows_of(closure: wbc.LoopClosure) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return Jacobian, error and drift of a closure."""
    rows = np.zeros((closure.dim, closure.robot.nv)), np.zeros(closure.dim), np.zeros(closure.dim)
    closure.evaluate(*rows)
    return rows


@pytest.mark.parametrize("what", ["knee", "floating knee", "ankles"])
def test_motion_and_forces_of_a_closed_chain_are_those_of_mujocos_equations(what: str) -> None:
    """Its mass matrix, its bias and the rows of its own equalities: accelerations under the torques of the solution.

    Forces in the chain do no work and give no momentum, passive joints have no torque.
    """
    description, model = closed(what)
    robot, closures = in_motion(description, 1)
    assert all(max(closure.gap()) < 1e-6 for closure in closures)
    controller = wbc.Controller(robot, 0.002)
    driven = [name for name in robot.joint_names if name not in description.passive]
    posture = controller.add(wbc.PostureTask(joints=driven, stiffness=400.0))
    controller.add(wbc.TorqueLimits())
    posture.target = {name: description.half_sitting[name] + 0.3 for name in driven[-1:]}
    solution = controller.solve()
    assert solution.ok
    assert not solution.torques[robot.passive].any()
    assert np.abs(np.delete(solution.torques, robot.passive)).max() > 0.1
    tau = np.concatenate([np.zeros(robot.base_dof), solution.torques])
    forces = sum(
        rows_of(closure)[0].T @ solution.wrenches[closure.name]
        for closure in controller.contacts
        if isinstance(closure, wbc.LoopClosure)
    )
    left = robot.mass_matrix @ solution.accelerations + robot.bias - tau - forces
    np.testing.assert_allclose(left, 0.0, atol=1e-5)  # joints without a drive included
    inner = robot.mass_matrix @ solution.accelerations + robot.bias - tau
    assert inner @ robot.v == pytest.approx(0.0, abs=1e-5) and np.abs(inner).max() > 0.05
    if robot.floating:
        assert np.abs(inner[:6]).max() < 1e-6  # no momentum

    data, ids = mujoco.MjData(model), [model.joint(name).id for name in robot.joint_names]
    dofs, base = model.jnt_dofadr[ids], [] if not robot.floating else list(range(6))
    if robot.floating:
        configuration_to_mujoco(robot.q, model.jnt_qposadr[ids], data.qpos)
        velocity_to_mujoco(robot.q, robot.v, dofs, data.qvel)
    else:
        data.qpos[model.jnt_qposadr[ids]], data.qvel[dofs] = robot.q, robot.v
    model.dof_frictionloss[:] = 0.0
    model.opt.gravity[2] = -GRAVITY
    model.dof_armature[base] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(
        mujoco.mjtDisableBit.mjDSBL_LIMIT
    )
    for _ in range(2):  # rows of its equalities and their change along the motion
        mujoco.mj_forward(model, data)
        if not _:
            before, full = equality_rows(model, data), np.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, full)
            force = data.qfrc_passive - data.qfrc_bias
            force[dofs] += solution.torques
            mujoco.mj_integratePos(model, data.qpos, data.qvel, 1e-6)
    drift = (equality_rows(model, data) - before) @ data.qvel / 1e-6
    n = len(before)
    kkt = np.block([[full, before.T], [before, np.zeros((n, n))]])
    found = np.linalg.lstsq(kkt, np.concatenate([force, -drift]), rcond=None)[0][: model.nv]
    np.testing.assert_allclose(
        found[dofs], solution.accelerations[robot.base_dof :], atol=2e-3 * np.abs(found).max()
    )


def equality_rows(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return MuJoCo's own Jacobian of its equalities, shape (rows, nv)."""
    rows = data.efc_J.reshape(-1, model.nv) if not mujoco.mj_isSparse(model) else None
    if rows is None:
        rows = np.zeros((data.nefc, model.nv))
        mujoco.mju_sparse2dense(rows, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    return np.array(rows[data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)])


@pytest.mark.parametrize(("what", "dim"), [("knee", 2), ("ankles", 3)])
def test_rows_of_a_closure_are_the_change_of_its_gap(what: str, dim: int) -> None:
    """Out of the plane of four bars there is none. Error, Jacobian and drift by finite differences, open chains too."""
    description, _ = closed(what)
    robot = description.robot()
    closure = description.closures[0]
    for rotation in (False, True):
        contact = wbc.LoopClosure(closure.frame, closure.other, rotation=rotation)
        contact.bind(robot)
        if not rotation:
            assert contact.dim == dim
        rng = np.random.default_rng(0)
        q = robot.half_sitting.copy()
        spread = (
            0.2 if not rotation else 0.0
        )  # orientations, with the linear change of a rotation, where they are one
        q[robot.base_nq :] += spread * rng.normal(size=robot.na)
        v = rng.normal(size=robot.nv)
        robot.update(q, v)
        jacobian, _, drift = rows_of(contact)
        ends = []
        for step in (1e-6, -1e-6):
            robot.update(pin.integrate(robot.model, q, step * v), v)
            ends.append(rows_of(contact))
        if not rotation:
            np.testing.assert_allclose(jacobian @ v, -(ends[0][1] - ends[1][1]) / 2e-6, atol=1e-6)
        np.testing.assert_allclose(drift, (ends[0][0] - ends[1][0]) @ v / 2e-6, atol=1e-5)
        robot.update(robot.half_sitting.copy(), np.zeros(robot.nv))


OPTIONS = ("stiffness", "damping", "rate", "wrench_weight", "motion_weight")


def test_a_closure_keeps_what_is_given_for_its_rows() -> None:
    """Along axes in which the chain does not open there is no row."""
    given = {name: np.arange(1.0, 7.0) * (k + 1) for k, name in enumerate(OPTIONS)}
    robot = wbc.load_robot("hrp4_class").robot()
    hands = wbc.LoopClosure("left_hand", "right_hand", motion_weight=1.0)
    for name, values in given.items():
        setattr(hands, name, values)
    controller = wbc.Controller(robot, 0.002)
    for _ in range(2):
        controller.add(hands)
        for name, values in given.items():
            np.testing.assert_array_equal(getattr(hands, name), values, name)
        controller.remove(hands)
    description, _ = closed("knee")
    closure, robot = description.closures[0], description.robot()
    knee = wbc.LoopClosure(closure.frame, closure.other, rotation=False)
    knee.wrench_weight = [1.0, 2.0, 3.0]
    knee.bind(robot)
    lines = np.abs(knee.directions)
    np.testing.assert_allclose(knee.wrench_weight, lines @ [1.0, 2.0, 3.0])
    assert set(lines.ravel()) == {0.0, 1.0} and knee.dim == 2


def test_a_biped_with_rods_at_its_ankles_stands_in_its_own_model() -> None:
    description, model = closed("ankles")
    assert {"left_ankle_pitch", "right_ankle_roll"} <= set(description.passive)
    with pytest.raises(ModelError, match="left_inner.*MujocoLoop"):
        wbc.Plant(description)
    loop = wbc.sim.MujocoLoop(description, model)
    assert not loop.notes and set(loop.actuators.kinds) == {"motor", "none"}
    control = wbc.TorqueControl(wbc.balance_controller(description.robot(), loop.control_period))
    start = loop.truth().com
    loop.push("trunk", [25.0, 10.0, 0.0], 0.1)
    while loop.time < 0.4:
        loop.step(control.command(loop.measure()))
    assert control.failures == 0 and control.status() == "ok"
    assert np.abs(loop.truth().com - start).max() < 0.01
    wrenches = control.controller.solution.wrenches
    assert abs(wrenches["left_inner"][2]) > 10.0


def test_inverse_kinematics_keeps_a_chain_closed_and_closes_an_open_one() -> None:
    description, _ = closed("knee")
    robot = description.robot()
    ik = wbc.InverseKinematics(robot, 0.01)
    shin = ik.add(wbc.OrientationTask("shin"))
    ik.add(wbc.PostureTask(weight=1e-6), wbc.JointLimits())
    (closure,) = ik.contacts
    shin.target = pin.rpy.rpyToMatrix(0.0, 0.4, 0.0)
    result = ik.reach()
    knee, crank = (result.configuration[robot.joint_index(name)] for name in ("knee", "crank"))
    assert result.reached and knee == pytest.approx(0.4, abs=1e-3) and abs(crank) > 0.3
    robot.q[:] = result.configuration
    robot.q[robot.joint_index("rod")] += 0.2
    ik.update(robot.q.copy())
    assert closure.gap()[0] > 0.01
    for _ in range(300):
        ik.step()
    assert closure.gap()[0] < 1e-6


def test_closed_chains_that_cannot_be_are_refused_by_name() -> None:
    short = (
        four_bar_knee()
        .replace('fromto="0 0 0 .06 0 0"', 'fromto="0 0 0 .06 0 0"')
        .replace('anchor="-.02 0 -.2"', 'anchor="-.02 0 -.9"')
    )
    far = RobotDescription.from_mjcf(short, base="fixed")  # closed where the file has it
    assert far.closures
    with pytest.raises(ModelError, match="'four bars' does not close in half-sitting.* mm"):
        RobotDescription.from_mjcf(four_bar_knee(), base="fixed", half_sitting={"crank": 1.3, "knee": -1.9})
    with pytest.raises(InputError, match="'shin' twice"):
        wbc.LoopClosure("shin", "shin")
    robot = RobotDescription.from_mjcf(four_bar_knee(), base="fixed").robot()
    with pytest.raises(InputError, match="no joint moves 'shin' against 'four bars_2'"):
        wbc.Controller(robot, 0.002).add(wbc.LoopClosure("shin", "four bars_2"))


CLOSURES: dict[str, tuple[float, object, str]] = {
    "too far": (
        0.9,
        Closure("tie", "end", "place", False),
        "'tie' does not close.* 'end' and 'place' stay .* mm",
    ),
    "turned": (0.9, Closure("tie", "end", "place", True), "'end' and 'place' stay .* mm and .*°"),
    "no frame": (0.3, Closure("tie", "ende", "place", False), "'ende'.*'end'"),
    "one frame": (0.3, Closure("tie", "end", "end", False), "'end' twice"),
    "one body": (0.3, Closure("tie", "end", "down", False), "'end' to 'down'.*one rigid body"),
    "a pair of names": (0.3, ("end", "place"), "class Closure.*'place'"),
}


@pytest.mark.parametrize("what", CLOSURES)
def test_closures_of_a_urdf_that_cannot_be_are_refused_by_name(what: str) -> None:
    x, closure, said = CLOSURES[what]
    with pytest.raises((ModelError, InputError), match=said):
        RobotDescription.from_urdf(three_bars(x), base="fixed", closures=[closure])  # type: ignore[list-item]


def test_a_closure_of_a_urdf_closes_where_its_joints_let_it() -> None:
    near = Closure("tie", "end", "place", True)
    robot = RobotDescription.from_urdf(three_bars(0.35), base="fixed", closures=[near]).robot()
    apart = robot.placement("end").actInv(robot.placement("place"))
    assert np.linalg.norm(pin.log6(apart).vector) < 1e-6


TIES = {
    "to the world": {"tie": "connect", "one": "right", "two": "world", "at": 'anchor="0 0 -.2"'},
    "from the world": {"tie": "connect", "one": "world", "two": "right", "at": 'anchor=".2 0 1"'},
    "weld": {"tie": "weld", "one": "bar", "two": "right", "at": 'anchor="0 0 0"'},
}


@pytest.mark.parametrize("what", ["to the world", "from the world"])
def test_a_chain_that_closes_at_the_world_of_a_bolted_robot(what: str) -> None:
    """A parallelogram: its bar stays level, and half of its weight rests on the far end."""
    description = RobotDescription.from_mjcf(RODS.format(**TIES[what]), base="fixed")
    assert description.passive == ("bar", "right") and not any(
        "'foot'" in line for line in description.doubts()
    )
    robot = description.robot()
    ik = wbc.InverseKinematics(robot, 0.01)
    ik.add(wbc.PostureTask({"left": 0.4}, joints=["left"]), wbc.JointLimits())
    found = dict(zip(robot.joint_names, ik.reach().configuration.tolist(), strict=True))
    assert found == pytest.approx({"left": 0.4, "bar": -0.4, "right": 0.4}, abs=1e-4)
    controller = wbc.Controller(robot, 0.002)
    controller.add(wbc.PostureTask(joints=["left"], hard=True))
    solution = controller.solve()
    (closure,) = controller.contacts
    force = closure.directions.T @ solution.wrenches[closure.name]
    bar, right = (float(robot.model.inertias[robot.model.getJointId(name)].mass) for name in ("bar", "right"))
    assert abs(force[2]) == pytest.approx(GRAVITY * (0.5 * bar + right), rel=1e-3)


def test_a_weld_of_what_one_joint_moves_leaves_that_joint_alone_out() -> None:
    """A weld across a single hinge: all rows but those that the hinge turns are none."""
    robot = RobotDescription.from_mjcf(RODS.format(**TIES["weld"]), base="fixed").robot()
    controller = wbc.Controller(robot, 0.002)
    assert controller.contacts[0].dim == 1
    controller.add(wbc.PostureTask())
    solution = controller.solve()
    assert solution.ok and solution.accelerations[robot.joint_index("right")] == pytest.approx(0.0, abs=1e-6)


def test_a_chain_of_a_urdf_is_closed_by_a_pair_of_frames() -> None:
    own = RobotDescription.from_mjcf(four_bar_knee(), base="fixed")
    again = RobotDescription.from_urdf(
        own.urdf, base="fixed", closures=own.closures, passive=own.passive, armature=dict(own.armature)
    )
    one, two = own.robot(), again.robot()
    np.testing.assert_allclose(one.mass_matrix, two.mass_matrix, atol=1e-12)
    assert two.closures == one.closures and (two.passive == one.passive).all()
    with pytest.raises(InputError, match="wheel"):
        RobotDescription.from_urdf(own.urdf, base="fixed", closures=own.closures, passive=["wheel"])


def test_joints_that_are_locked_are_told_with_those_that_they_lead() -> None:
    xml = mimic(ARMED, "right_shoulder", "left_shoulder", -1.0, 0.2)
    description = RobotDescription.from_urdf(xml, lock={"left_shoulder": 0.3}, **FEET)
    assert dict(description.locked) == pytest.approx({"left_shoulder": 0.3, "right_shoulder": -0.1})
    described = RobotDescription.from_mjcf(biped(), lock={"waist": 0.1})
    assert described.locked["waist"] == 0.1 and "waist" not in described.joint_names
    assert not RobotDescription.from_urdf(ARMED, **FEET).locked


# ---- SDF ------------------------------------------------------------------------------------------------------------

BAR = """<link name="{name}"><pose>{x} 0 {z} 0.1 {turn} 0.2</pose><inertial><pose>0 0 0.05 0 0 0.3</pose>
<mass>{mass}</mass><inertia><ixx>0.02</ixx><iyy>0.01</iyy><izz>0.015</izz><ixy>0.001</ixy></inertia></inertial>
<collision name="{name}"><geometry>
<cylinder><radius>0.02</radius><length>0.1</length></cylinder></geometry></collision></link>"""
PIN = """<joint name="{name}" type="{kind}"><parent>{one}</parent><child>{two}</child><pose>{pose}</pose>
<axis><xyz>0 1 0</xyz>{frame}<limit><lower>-1</lower><upper>1</upper><effort>30</effort></limit>
<dynamics><damping>0.1</damping><spring_stiffness>7</spring_stiffness></dynamics></axis></joint>"""


def bars(
    *, joints: str = "", links: str = "", closing: str = "revolute", hang: tuple[str, str] = ("base", "rod")
) -> str:
    """Return the SDF of four bars, each turned otherwise, with axes along y of the model."""
    made = "".join(
        BAR.format(name=name, x=x, z=z, turn=0.3 * i, mass=1 + i)
        for i, (name, x, z) in enumerate(
            (("base", 0, 1), ("crank", 0.2, 1), ("coupler", 0.25, 0.8), ("rod", 0, 0.8))
        )
    )
    axis = "<use_parent_model_frame>1</use_parent_model_frame>"
    pins = "".join(
        PIN.format(name=name, kind=kind, one=one, two=two, pose="0 0 0 0 0 0", frame=axis)
        for name, kind, one, two in (
            ("drive", "revolute", "base", "crank"),
            ("knee", "revolute", "crank", "coupler"),
            ("hip", "revolute", *hang),
            ("pin", closing, "rod", "coupler"),
        )
    ).replace('name="pin" type="revolute"><parent>rod</parent><child>coupler</child><pose>0 0 0 0', PIN_AT)
    return f'<sdf version="1.6"><model name="bars">{made}{links}{pins}{joints}</model></sdf>'


MOUNT = '<joint name="mount" type="fixed"><parent>world</parent><child>base</child></joint>'
PIN_AT = 'name="pin" type="revolute"><parent>rod</parent><child>coupler</child><pose>0.05 0 0.1 0'


def test_an_sdf_is_read_as_the_tree_of_its_first_joints_and_the_others_close_chains(tmp_path: Path) -> None:
    """Joints lie and turn where the file says, whichever way round it names their links; by path, text and spec."""
    path = tmp_path / "bars.sdf"
    path.write_text(bars(), encoding="utf-8")
    spec = wbc.robots.read_sdf(path)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    places = {"crank": [0.2, 0, 1], "coupler": [0.25, 0, 0.8], "rod": [0, 0, 0.8], "base": [0, 0, 1]}
    for link, place in places.items():
        np.testing.assert_allclose(data.body(link).xpos, place, atol=1e-9)
    for joint, link in (("drive", "crank"), ("knee", "coupler"), ("hip", "rod")):
        number = model.joint(joint).id
        np.testing.assert_allclose(data.xaxis[number], [0.0, 1.0, 0.0], atol=1e-9)
        np.testing.assert_allclose(data.xanchor[number], places[link], atol=1e-9)
        assert model.jnt_stiffness[number] == 7.0 and tuple(model.jnt_actfrcrange[number]) == (-30.0, 30.0)
    assert abs(data.efc_pos[:3]).max() < 1e-9  # the chain closes where it is read
    wanted = data.body("coupler").xpos + data.body("coupler").xmat.reshape(3, 3) @ [0.05, 0.0, 0.1]
    ours = data.body("rod").xpos + data.body("rod").xmat.reshape(3, 3) @ model.eq_data[0][3:6]
    np.testing.assert_allclose(ours, wanted, atol=1e-9)
    swapped = wbc.robots.read_sdf(_written(tmp_path, bars(hang=("rod", "base"), joints=MOUNT))).compile()
    other = mujoco.MjData(swapped)
    mujoco.mj_forward(swapped, other)
    number = swapped.joint("hip").id  # the joint is at the base, and turns the rod the other way
    np.testing.assert_allclose(other.xaxis[number], [0.0, -1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(other.xanchor[number], places["base"], atol=1e-9)
    for source in (path, bars(), spec):
        description = RobotDescription.from_mjcf(source, feet=False)
        assert [closure.name for closure in description.closures] == ["pin"]
        assert description.robot().mass == pytest.approx(10.0)
    assert wbc.load_robot(_toml(tmp_path, path)).closures


def _written(folder: Path, text: str) -> Path:
    path = folder / "other.sdf"
    path.write_text(text, encoding="utf-8")
    return path


def _toml(folder: Path, path: Path) -> Path:
    """Return a description of a robot without feet in a file."""
    toml = folder / "bars.toml"
    toml.write_text(f'file = "{path.name}"\nfeet = false\n', encoding="utf-8")
    return toml


def test_a_ball_joint_of_an_sdf_is_three_hinges_and_a_joint_to_the_world_bolts_the_robot() -> None:
    ball = PIN.format(name="ball", kind="ball", one="rod", two="tip", pose="0 0 0 0 0 0", frame="")
    tip = BAR.format(name="tip", x=0, z=0.5, turn=0.1, mass=1)
    limits = dict.fromkeys(("ball_x", "ball_y", "ball_z"), 1.0)
    description = RobotDescription.from_mjcf(
        bars(links=tip, joints=ball + MOUNT), base="fixed", torque_limits=limits
    )
    assert set(limits) <= set(description.joint_names)
    assert not description.robot().floating


@pytest.mark.parametrize(
    ("low", "high", "found"),
    [
        ("-0.5", "1", (-0.5, 1.0)),
        ("-inf", "1", (-np.inf, 1.0)),
        ("-1e16", "1", (-np.inf, 1.0)),
        ("-1", "Infinity", (-1.0, np.inf)),
        ("-1e16", "inf", (-np.inf, np.inf)),
    ],
)
def test_limits_of_an_sdf_may_be_endless_on_either_side(
    low: str, high: str, found: tuple[float, float]
) -> None:
    limit = f"<limit><lower>{low}</lower><upper>{high}</upper><effort>5</effort></limit>"
    pin_of = PIN.format(name="neck", kind="revolute", one="base", two="tip", pose="0 0 0 0 0 0", frame="")
    pin_of = re.sub(r"<limit>.*?</limit>", "", pin_of, flags=re.DOTALL).replace("</axis>", f"{limit}</axis>")
    tip = BAR.format(name="tip", x=0, z=0.5, turn=0.1, mass=1)
    robot = RobotDescription.from_mjcf(bars(links=tip, joints=pin_of), feet=False).robot()
    i = robot.joint_index("neck")
    assert (robot.position_lower[i], robot.position_upper[i]) == found


BAD_SDFS = {  # text → words of the error
    "no model": ('<sdf version="1.6"/>', "one <model>"),
    "no name": (
        bars().replace('<joint name="knee"', "<joint"),
        "<joint> must have a name of its own, got none for",
    ),
    "a name twice": (
        bars().replace('"rod"', '"base"', 1),
        "<link> must have a name of its own, got 'base' twice",
    ),
    "no link": ('<sdf version="1.6"><model name="a"/></sdf>', "no link"),
    "no XML": ("<sdf><model>", "SDF string"),
    "other link": (bars(hang=("base", "nowhere")), "'hip' names link 'nowhere'"),
    "loose link": (bars(links=BAR.format(name="far", x=0, z=0, turn=0, mass=1)), "no joint ties link 'far'"),
    "screw": (bars(closing="screw"), "'pin' closes a chain and is of type 'screw'"),
    "pose of words": (bars().replace("0 0 0.05 0 0 0.3", "up"), "6 finite numbers, got 'up'"),
    "endless pose": (bars().replace("0 0 0.05 0 0 0.3", "0 0 inf 0 0 0"), "6 finite numbers"),
    "other frame": (
        bars().replace("<pose>0 0 0 0", '<pose relative_to="base">0 0 0 0'),
        "without relative_to",
    ),
}


@pytest.mark.parametrize("what", BAD_SDFS)
def test_an_sdf_that_cannot_be_read_is_refused_by_name(what: str) -> None:
    text, words = BAD_SDFS[what]
    with pytest.raises(ModelError, match=words):
        RobotDescription.from_mjcf(text, feet=False)


def test_what_is_no_sdf_is_no_sdf(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="is no SDF"):
        wbc.robots.read_sdf(_written(tmp_path, RODS))
    with pytest.raises(InputError, match=r"missing\.sdf"):
        wbc.robots.read_sdf(tmp_path / "missing.sdf")


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
