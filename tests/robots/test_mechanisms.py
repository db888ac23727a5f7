"""Robots as they are: bolted to the world, with coupled joints, with joints that turn without end."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from mjcf_biped import biped
from mujoco_dynamics import assert_same_dynamics

import wbc
from wbc.base.errors import InputError, ModelError
from wbc.core.model import Coupling
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
    "itself": (
        [("left_knee", "left_knee", 1.0)],
        "'left_knee' are coupled to each other: none of them leads",
    ),
    "two to each other": (
        [("left_knee", "right_knee", 1.0), ("right_knee", "left_knee", 1.0)],
        "'left_knee', 'right_knee'.*coupled to each other",
    ),
    "nobody": ([("left_knee", "knee_of_left", 1.0)], "leader 'knee_of_left' of joint 'left_knee'"),
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
    gone, leader = DRIVES[what]
    follower = "left_shoulder" if leader == "right_shoulder" else "right_shoulder"
    xml = biped(extra=GEAR.format(ratio=0.5)).replace(gone, "")
    xml = xml.replace(f'<joint name="{follower}"', f'<joint stiffness="8" armature="0.05" name="{follower}"')
    description = RobotDescription.from_mjcf(xml)
    ratio, offset = (0.5, 0.1) if what == "second" else (2.0, -0.2)
    assert description.couplings == {follower: Coupling(leader, ratio, pytest.approx(offset))}
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


def test_joints_that_are_locked_are_told_with_those_that_they_lead() -> None:
    xml = mimic(ARMED, "right_shoulder", "left_shoulder", -1.0, 0.2)
    description = RobotDescription.from_urdf(xml, lock={"left_shoulder": 0.3}, **FEET)
    assert dict(description.locked) == pytest.approx({"left_shoulder": 0.3, "right_shoulder": -0.1})
    described = RobotDescription.from_mjcf(biped(), lock={"waist": 0.1})
    assert described.locked["waist"] == 0.1 and "waist" not in described.joint_names
    assert not RobotDescription.from_urdf(ARMED, **FEET).locked
