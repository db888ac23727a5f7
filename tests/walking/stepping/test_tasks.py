"""Contacts and tasks of the stepping walk: references switch them, in any order."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest
from task_factory import make_robot

from wbc.core.qp.controller import Controller
from wbc.core.robot import GRAVITY
from wbc.tasks.stabilizer.lean import UPRIGHT, LeanMotion
from wbc.walking.body import Twist
from wbc.walking.contact import GaitPhase
from wbc.walking.source import Progress, Reference
from wbc.walking.stepping.felt import BodyState
from wbc.walking.stepping.gait import SteppingWalk
from wbc.walking.stepping.settings import RobotSize, SteppingConstants, SteppingSettings
from wbc.walking.table import free_table
from wbc.walking.tasks import WalkTasks

DT = 0.002
ROBOT = make_robot("g1")
WEIGHT = ROBOT.mass * GRAVITY
MOST = 1.4 * WEIGHT
SCALE = RobotSize.of(ROBOT, 0.162, float(ROBOT.com[2]))  # as high as it stands


def standing() -> tuple[Controller, WalkTasks, Reference]:
    """Controller and tasks of a robot that stands, and the reference of its stand."""
    robot = make_robot("g1")
    gait = SteppingWalk(SteppingSettings(), SCALE, 0.0, DT)
    controller = Controller(robot, DT)
    tasks = WalkTasks(controller, free_table(robot, gait))
    frames = tuple(robot.placement(sole.frame) for sole in robot.soles)
    wrenches = [[0.0, 0.0, 0.5 * WEIGHT, 0.0, 0.0, 0.0]] * 2
    places, turns = ([getattr(f, name).tolist() for f in frames] for name in ("translation", "rotation"))
    rest = (0.0, 0.0, 0.0)
    state = BodyState(robot.com.tolist(), rest, rest, tuple(places), tuple(turns), wrenches, 0.0, robot.mass)
    return controller, tasks, gait.advance(state, frames)


# Contacts, greatest forces, stance and swing foot.
STATES: dict[str, tuple[tuple[bool, bool], tuple[float, float], int, int | None] | None] = {
    "on both feet": None,
    "left foot up": ((False, True), (0.0, MOST), 1, 0),
    "left foot unloads": ((True, True), (0.01 * WEIGHT, MOST), 1, 0),
    "left foot waits": ((True, True), (0.3 * WEIGHT, MOST), 1, None),
    "right foot unloads": ((True, True), (MOST, 0.01 * WEIGHT), 0, 1),
    "right foot up": ((True, False), (MOST, 0.0), 0, 1),
}


def test_any_state_of_the_feet_may_follow_any_other() -> None:
    """A foot that has given up its load, and must carry at once, can."""
    controller, tasks, reference = standing()
    for name in itertools.chain(*itertools.permutations(STATES, 2)):
        changed, state = reference, STATES[name]
        if state is not None:
            contact, most, stance, swing = state
            progress = Progress(GaitPhase.SINGLE, stance, swing, contact, reference.progress.heading)
            changed = reference._replace(progress=progress, most_force=most)
        step = changed.progress
        balanced = step.phase is not GaitPhase.SINGLE
        tasks.follow(changed)
        solution = controller.solve()
        assert solution.ok
        assert solution.wrenches[tasks.contacts[step.stance].name][2] > 0.01 * WEIGHT
        for side, foot in enumerate(tasks.contacts):
            wrench = solution.wrenches[foot.name]
            assert wrench[2] <= changed.most_force[side] + 1e-6
            assert controller.task(f"{foot.name} swing").idle == (step.swing != side)
            if not step.contact[side]:
                np.testing.assert_allclose(wrench, 0.0, atol=1e-7)
                continue
            full = balanced or side == step.stance
            assert (foot.min_force > 0.0) == full and foot.max_force == changed.most_force[side]
            alone = full and not balanced and not all(step.contact)
            assert wrench[2] > 0.49 * WEIGHT or not alone


def test_an_urgent_swing_foot_is_moved_at_the_cost_of_the_trunk() -> None:
    controller, tasks, reference = standing()
    contact, most, stance, side = (False, True), (0.0, MOST), 1, 0
    pushed = reference.feet[side]._replace(acceleration=np.array([60.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    feet = (pushed, reference.feet[1])
    progress = Progress(GaitPhase.SINGLE, stance, side, contact, reference.progress.heading)
    single = reference._replace(progress=progress, most_force=most, feet=feet)
    missed, tilted = [], []
    for urgency in (0.0, 0.5, 1.0, -1.0, 0.0):
        tasks.follow(single._replace(urgency=urgency))
        solution, robot = controller.solve(), controller.robot
        assert solution.ok
        data = robot.model.createData()
        pin.forwardKinematics(robot.model, data, robot.q, robot.v, np.array(solution.accelerations))
        foot = pin.getFrameClassicalAcceleration(
            robot.model, data, robot.frame_id(robot.soles[side].frame), pin.LOCAL_WORLD_ALIGNED
        )
        missed.append(60.0 - foot.linear[0])
        tilted.append(float(np.linalg.norm(solution.accelerations[3:5])))
    assert missed[0] > missed[1] > missed[2] and tilted[0] < tilted[2]
    assert missed[3] > missed[0] and tilted[3] < tilted[0], "one that was pushed goes after the trunk"
    assert missed[4] == pytest.approx(missed[0], rel=1e-6), "the costs come back"


def test_a_trunk_leans_and_twists_about_the_heading() -> None:
    controller, tasks, reference = standing()
    pelvis = controller.task("pelvis")
    upright = np.array(pelvis.target)
    lean = LeanMotion(
        pin.exp3(np.array([0.1, -0.05, 0.0])), np.array([0.2, 0.1, 0.0]), np.array([0.3, 0.5, 0.0])
    )
    turned = reference._replace(progress=Progress(heading=0.2))
    tasks.follow(turned)
    np.testing.assert_allclose(pelvis.target, pin.utils.rotate("z", 0.2) @ upright, atol=1e-12)
    tasks.follow(turned, lean, Twist(0.05, -0.6, 0.7, False))
    expected = lean.rotation @ pin.utils.rotate("z", 0.25) @ upright
    np.testing.assert_allclose(pelvis.target, expected, atol=1e-12)
    np.testing.assert_allclose(pelvis.feedforward_velocity, (0.2, 0.1, -0.6))
    np.testing.assert_allclose(pelvis.feedforward_acceleration, (0.3, 0.5, 0.7))


def test_a_twist_by_the_waist_turns_the_torso_and_leaves_the_legs() -> None:
    controller, tasks, reference = standing()
    robot, turn = controller.robot, controller.task("torso turn")
    pelvis, torso = (np.array(controller.task(part).target) for part in ("pelvis", "torso"))
    tasks.follow(reference)
    assert turn.idle
    before = controller.solve().accelerations
    tasks.follow(reference, UPRIGHT, Twist(0.2, 0.0, 0.0, by_waist=True))
    np.testing.assert_allclose(controller.task("pelvis").target, pelvis, atol=1e-12)
    for task in (turn, controller.task("torso")):
        np.testing.assert_allclose(task.target, pin.utils.rotate("z", 0.2) @ torso, atol=1e-12)
    change = controller.solve().accelerations - before
    spin = pin.getFrameJacobian(
        robot.model, robot.data, robot.frame_id(robot.torso_frame), pin.LOCAL_WORLD_ALIGNED
    )
    assert spin[5] @ change > 2.0, "towards the twist"
    legs = np.array(robot.leg_joints) + 6
    assert np.abs(change[legs]).max() < 0.2 * (spin[5] @ change)
    tasks.follow(reference)
    assert turn.idle


def test_a_robot_that_stands_where_it_is_to_stand_is_at_rest_under_its_weight() -> None:
    controller, tasks, reference = standing()
    middle = np.mean([contact.target.act(contact.centre) for contact in tasks.contacts], axis=0)
    pendulum = reference.pendulum
    tasks.follow(reference._replace(pendulum=pendulum._replace(com_acceleration=np.zeros(3))))
    solution = controller.solve()
    total = sum(wrench[2] for wrench in solution.wrenches.values())
    assert total == pytest.approx(WEIGHT, rel=0.02)
    assert np.linalg.norm(middle[:2] - ROBOT.com[:2]) < 0.03
    assert np.abs(solution.accelerations).max() < 1.0


def test_a_robot_that_comes_to_a_stand_is_told_the_same_wherever_its_reference_begins() -> None:
    """It is c̈ = ω² (c − z) with z = m + (1 + k)(ξ − m), by which ξ goes to the middle m of the feet at the rate k ω."""
    controller, tasks, reference = standing()
    robot, rest, law = controller.robot, reference.pendulum, SteppingConstants().in_si(SCALE)
    v = np.zeros(robot.nv)
    v[:2] = 0.02, -0.2
    robot.update(robot.q, v)
    omega, middle = rest.omega, np.array(rest.com)

    def falling(com: np.ndarray, speed: np.ndarray) -> np.ndarray:
        return omega**2 * (com - middle - (1.0 + law.stand.stand_gain) * (com + speed / omega - middle))

    now, found = (np.array(robot.com), np.array(robot.com_velocity)), []
    for com, speed in ((middle, np.zeros(3)), now, (middle + [0.01, -0.02, 0.0], np.array([0.1, 0.05, 0.0]))):
        level = np.append(com[:2], middle[2]), np.append(speed[:2], 0.0)
        begun = rest._replace(com=level[0], com_velocity=level[1], com_acceleration=falling(*level))
        tasks.follow(reference._replace(pendulum=begun))
        found.append(np.array(controller.solve().accelerations))
        told = robot.com_jacobian @ found[-1]
        np.testing.assert_allclose(told[:2], falling(*now)[:2], atol=0.05)
    np.testing.assert_allclose(found[1:], [found[0]] * 2, atol=1e-6)


def moving(height: float, speed: float) -> tuple[Controller, WalkTasks, Reference]:
    """The same of a robot that is as much higher than its desired CoM, m, and moves upwards, m/s."""
    controller, tasks, reference = standing()
    robot = controller.robot
    v = np.zeros(robot.nv)
    v[2] = speed
    robot.update(robot.q, v)
    at = np.array(reference.pendulum.com)
    at[2] = robot.com[2] - height
    return controller, tasks, reference._replace(pendulum=reference.pendulum._replace(com=at))


@pytest.mark.parametrize(("height", "speed"), [(0.0, 0.6), (0.03, 0.2), (0.1, 0.0), (0.015, 0.5)])
def test_nothing_makes_a_rising_robot_rise_on(height: float, speed: float) -> None:
    """Its feet slow it down by half of gravity, whatever the tasks ask for, and keep half of its weight."""
    controller, tasks, reference = moving(height, speed)
    tasks.com.follow(controller.robot.com + [0.0, 0.0, 0.2], np.zeros(3), np.array([0.0, 0.0, 20.0]))
    tasks.com.weight = np.full(3, 1e4)  # the worst that tasks can ask for
    tasks.table.rise.height = float(reference.pendulum.com[2])  # type: ignore[union-attr]
    solution = controller.solve()
    assert solution.ok
    drift = controller.robot.com_jacobian[2] @ solution.accelerations
    assert drift == pytest.approx(-0.5 * GRAVITY, abs=0.05)
    assert sum(wrench[2] for wrench in solution.wrenches.values()) == pytest.approx(0.5 * WEIGHT, rel=0.02)


def test_below_its_ceiling_the_rise_is_no_concern() -> None:
    controller, tasks, reference = moving(-0.02, 0.05)
    tasks.follow(reference)
    free = controller.solve().accelerations
    tasks.table.rise.height = np.inf  # type: ignore[union-attr]
    np.testing.assert_allclose(controller.solve().accelerations, free, atol=1e-6)


@pytest.mark.parametrize("joint", ["waist_roll_joint", "waist_pitch_joint"])
@pytest.mark.parametrize("angle", [-0.3, 0.3])
def test_a_folded_trunk_comes_upright_again(joint: str, angle: float) -> None:
    controller, tasks, reference = standing()
    robot = controller.robot
    if joint not in robot.joint_names:
        pytest.skip("no such joint")
    q = np.array(robot.q)
    q[7 + robot.joint_index(joint)] = angle
    robot.update(q, np.zeros(robot.nv))
    tasks.posture.weight = np.zeros(robot.na)
    tasks.follow(reference)
    solution = controller.solve()
    jacobian = pin.getFrameJacobian(
        robot.model, robot.data, robot.frame_id(robot.torso_frame), pin.LOCAL_WORLD_ALIGNED
    )
    axis = 0 if "roll" in joint else 1
    assert (jacobian[3 + axis] @ solution.accelerations) * np.sign(angle) < -5.0


@pytest.mark.parametrize(
    ("off", "roll", "pitch"),
    [(-2.5, 0.3, 0.0), (-0.5, 0.0, -0.4), (0.5, -0.2, 0.3), (1.5, 0.3, 0.0), (3.0, -0.2, 0.3)],
)
def test_a_trunk_that_is_turned_far_comes_upright_about_its_own_tilt(
    off: float, roll: float, pitch: float
) -> None:
    """Its error about the level axes is its tilt, as large and in the same direction as without the turn."""
    controller, tasks, reference = standing()
    robot = controller.robot
    q = np.array(robot.q)
    rotation = pin.rpy.rpyToMatrix(roll, pitch, 0.0)
    q[3:7] = pin.Quaternion(rotation).coeffs()
    robot.update(q, np.zeros(robot.nv))
    tasks.follow(reference._replace(progress=Progress(heading=off)))
    pelvis = controller.task("pelvis")
    error = pin.log3(pelvis.target @ robot.placement(robot.base_frame).rotation.T)
    up = rotation[:, 2]
    tilt = np.array([up[1], -up[0]]) / np.hypot(up[0], up[1]) * np.arccos(up[2])
    np.testing.assert_allclose(error[:2], tilt, atol=0.4 * np.linalg.norm(tilt))
    assert 0.1 < error[2] * np.sign(off) < 0.5


def test_feet_carry_as_their_state_in_the_step_says() -> None:
    """A foot that yields costs a tenth; alone one carries half of the weight; boxes are about the CoP in all ticks."""
    controller, tasks, reference = standing()
    size = RobotSize.of(ROBOT, 0.162, float(ROBOT.com[2]))  # that of `standing`
    law, stance = SteppingConstants().in_si(size), tasks.table.feet
    assert stance is not None
    tasks.follow(reference)
    for contact in tasks.contacts:
        np.testing.assert_allclose(contact.motion_weight, stance.firm)
        np.testing.assert_allclose(contact.centre, 0.0)
        assert contact.min_force == pytest.approx(0.2 * law.touch.least_force)
    for name, state in STATES.items():
        if state is None:
            continue
        touching, most, stands, swing = state
        single = reference._replace(
            progress=Progress(GaitPhase.SINGLE, stands, swing, touching, reference.progress.heading),
            most_force=most,
            cop=(0.01, -0.004),
        )
        tasks.follow(single)
        carrying, other = tasks.contacts[stands], tasks.contacts[1 - stands]
        np.testing.assert_allclose(carrying.motion_weight, stance.single, err_msg=name)
        np.testing.assert_allclose(carrying.centre, (law.area.carrying + 0.01, -0.004, 0.0))
        alone = not all(touching)
        assert carrying.min_force == pytest.approx(
            law.touch.carried if alone else 0.2 * law.touch.least_force
        )
        if not alone:
            np.testing.assert_allclose(other.motion_weight, 0.1 * stance.single)
            np.testing.assert_allclose(other.centre, (law.area.carrying, 0.0, 0.0))
            assert other.min_force == 0.0
        else:
            assert not other.active
    tasks.follow(reference._replace(progress=Progress(GaitPhase.DOUBLE)))
    np.testing.assert_allclose(tasks.contacts[0].centre, (law.area.carrying, 0.0, 0.0))
    gains = tasks.com.stiffness, tasks.com.damping
    for found, own in zip(gains, stance.shift, strict=True):
        np.testing.assert_allclose(found, own)
    tasks.follow(reference)
    for found, own in zip((tasks.com.stiffness, tasks.com.damping), stance.stand, strict=True):
        np.testing.assert_allclose(found, own)
    assert controller.solve().ok


@pytest.mark.parametrize(("off", "target"), [(0.2, 0.2), (0.8, 0.3), (-2.0, -0.3), (3.5, -0.3)])
def test_a_trunk_is_turned_back_by_no_more_than_three_tenths_at_once(off: float, target: float) -> None:
    """In the shorter direction; what leans it and twists it moves on."""
    controller, tasks, reference = standing()
    tasks.follow(
        reference._replace(progress=Progress(heading=off)), UPRIGHT, Twist(0.0, 0.4, 0.5, by_waist=False)
    )
    for name in ("pelvis", "torso"):
        task = controller.task(name)
        turned = pin.log3(task.target @ task.rotation.T)
        np.testing.assert_allclose(turned, (0.0, 0.0, target), atol=1e-6)
        np.testing.assert_allclose(task.feedforward_velocity, (0.0, 0.0, 0.4))
        np.testing.assert_allclose(task.feedforward_acceleration, (0.0, 0.0, 0.5))


@pytest.mark.parametrize("yaw", [0.0, 1.2, -2.5])
def test_a_trunk_stays_as_it_stands_whatever_the_robot_faces_at_the_start(yaw: float) -> None:
    robot = make_robot("g1")
    q = np.array(robot.q)
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.02, -0.03, yaw)).coeffs()
    robot.update(q, np.zeros(robot.nv))
    gait = SteppingWalk.of(robot, DT)
    tasks = WalkTasks(Controller(robot, DT), free_table(robot, gait))
    tasks._turn_trunk(yaw, UPRIGHT, Twist(0.0, 0.1, 0.0, by_waist=False))
    for task, _, _ in tasks._trunk:
        np.testing.assert_allclose(task.target, task.rotation, atol=1e-9)
