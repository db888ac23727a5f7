"""The QP of the controller: against another solver, and with constraints that contradict each other."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from properties import by_default
from task_factory import ROBOTS, left_hand, make_robot, near_half_sitting, right_hand, standing

from wbc.base.errors import InputError
from wbc.core.kinematics.inverse import InverseKinematics
from wbc.core.limits.collision import CollisionLimit
from wbc.core.limits.com_polygon import CoMPolygonLimit
from wbc.core.limits.joint import JointLimits, TorqueLimits
from wbc.core.limits.obstacles import CollisionSphere
from wbc.core.qp.contact import PointContact, SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.items import Item
from wbc.core.qp.solving.solver import Status, solve_by_qpsolvers
from wbc.core.robot import GRAVITY, Robot
from wbc.robots import load
from wbc.tasks import (
    CoMTask,
    ImpedanceTask,
    JointTorqueTask,
    MomentumTask,
    OrientationTask,
    PositionTask,
    PostureTask,
    RelativeFrameTask,
    WrenchTask,
)
from wbc.tasks.stabilizer.task import StabilizerTask

robots = pytest.mark.parametrize("name", by_default(ROBOTS, "hrp4_class"))


def everything(name: str) -> Controller:
    """A controller with one of each."""
    robot = make_robot(name)
    controller = Controller(robot, 0.002)
    hands = (left_hand(robot), right_hand(robot))
    left, _ = controller.add(*(SoleContact(f"{side}_foot", friction=0.4) for side in ("left", "right")))
    controller.add(CoMTask(), PostureTask(), OrientationTask(robot.torso_frame), MomentumTask())
    controller.add(PositionTask(hands[0]), RelativeFrameTask(hands[1], robot.base_frame, weight=0.5))
    controller.add(ImpedanceTask(hands[0], weight=0.1), JointTorqueTask(weight=1e-5))
    controller.add(WrenchTask(left, axes=("roll", "pitch"), weight=1e-3))
    controller.add(JointLimits(), TorqueLimits(ratio=0.9), CoMPolygonLimit())
    controller.add(CollisionLimit([hands], shapes={hand: CollisionSphere(0.05) for hand in hands}))
    return controller


@robots
def test_without_tasks_and_contacts_a_robot_falls_freely(name: str) -> None:
    controller = Controller(make_robot(name), 0.002)
    controller.add(TorqueLimits())
    solution = controller.solve()
    robot = controller.robot
    com_acceleration = pin.jacobianCenterOfMass(robot.model, robot.data, robot.q) @ solution.accelerations
    np.testing.assert_allclose(com_acceleration, [0.0, 0.0, -GRAVITY], atol=1e-6)


@robots
@pytest.mark.parametrize("states", by_default((25, 500), 25))
def test_accelerations_agree_with_daqp(name: str, states: int) -> None:
    """At random states, with targets far enough for limits to push."""
    rng = np.random.default_rng(1)
    controller = everything(name)
    robot = controller.robot
    half = np.array(controller.task("com").target)
    compared, pushed = 0, 0
    for _ in range(states):
        controller.task("com").target = half + rng.normal(scale=[0.05, 0.05, 0.02])
        controller.task("momentum").target = rng.normal(size=6)
        controller.update(*near_half_sitting(robot, rng, 0.05, 0.2))
        for contact in controller.contacts:
            contact.reset()
        solution = controller.solve()
        problem = controller.problem
        other = solve_by_qpsolvers("daqp", problem)
        if other is None:
            assert solution.status is Status.RELAXED or controller.diagnose()
            continue
        assert solution.status is not Status.RELAXED and solution.ok
        np.testing.assert_allclose(solution.accelerations, other[0][: robot.nv], atol=1e-3)
        compared += 1
        pushed += bool(solution.active_limits)
    assert compared >= 0.8 * states
    assert pushed >= 0.4 * states


def test_diagnosis_names_a_hard_posture_against_joint_limits() -> None:
    controller = standing("hrp4_class", posture=False)
    joint = "left_elbow_pitch"
    robot = controller.robot
    far = robot.position_lower[robot.joint_index(joint)]  # 1 rad of error acts: 100 rad/s²
    controller.add(JointLimits(acceleration=10.0), CoMTask())
    controller.add(PostureTask({joint: far}, joints=[joint], hard=True, stiffness=100.0))
    assert not controller.solve().ok
    assert {"hard task 'posture'", "joint limits"} == set(controller.diagnose())


def test_tasks_can_be_taken_out_and_put_back() -> None:
    controller = everything("hrp4_class")
    before = controller.solve().accelerations
    tasks = [controller.task(name) for name in ("com", "momentum", "joint torques", "left_foot wrench")]
    controller.remove(*tasks)
    assert controller.solve().ok
    controller.add(*tasks)
    np.testing.assert_allclose(controller.solve().accelerations, before, atol=1e-4)
    table = controller.status_table()
    for task in controller.tasks:
        assert task.name[:20] in table


def two_soles(name: str = "hrp4_class") -> tuple[Controller, SoleContact, SoleContact]:
    robot = make_robot(name)
    controller = Controller(robot, 0.005)
    left, right = SoleContact("left_foot"), SoleContact("right_foot")
    controller.add(CoMTask(), PostureTask(), OrientationTask(robot.torso_frame), left, right)
    controller.solve()
    return controller, left, right


@pytest.mark.parametrize(
    "refused",
    [
        lambda robot: WrenchTask("left_hand"),
        lambda robot: SoleContact("left_foot"),
        lambda robot: PositionTask("no such frame"),
        lambda robot: TorqueLimits(rate=-1.0),
    ],
)
def test_an_item_that_is_refused_changes_nothing(refused: Callable[[Robot], Item]) -> None:
    """Neither the velocity of a contact, which acts on the next tick, nor the solver's memory."""
    controller, left, _ = two_soles()
    counts = controller.solver_counts
    with pytest.raises(InputError):
        controller.add(refused(controller.robot))
    left.velocity = [0.0, 0.0, 0.0, 0.0, 0.2, 0.0]
    solution = controller.solve()
    jacobian = pin.getFrameJacobian(controller.robot.model, controller.robot.data, left.frame_id, pin.LOCAL)
    expected = [0.0, 0.0, 0.0, 0.0, left.damping[4] * 0.2, 0.0]
    np.testing.assert_allclose(jacobian @ solution.accelerations, expected, atol=1e-6)
    assert sum(controller.solver_counts.values()) == sum(counts.values()) + 1


@pytest.mark.parametrize("hard", [False, True])
def test_a_task_on_a_wrench_acts_while_its_contact_is_there_and_on(hard: bool) -> None:
    controller, left, _ = two_soles()
    controller.add(WrenchTask(left, [8.0, 0.0, 60.0, 0.0, 0.0, 0.0], axes=["x", "z"], hard=hard, weight=1.0))

    def force(ticks: int = 25) -> list[float]:
        for _ in range(ticks):
            solution = controller.solve()
            assert solution.ok, controller.diagnose()
        wrench = solution.wrenches.get("left_foot", np.zeros(6))
        return [float(wrench[0]), float(wrench[2])]

    assert force() == pytest.approx([8.0, 60.0], abs=0.5)
    left.active = False
    assert force() == pytest.approx([0.0, 0.0], abs=1e-6)
    controller.remove(left)
    assert force() == [0.0, 0.0]
    left.active = True
    controller.add(left)
    assert force() == pytest.approx([8.0, 60.0], abs=0.5)


def test_a_tick_that_fails_keeps_the_last_wrenches_under_their_names() -> None:
    controller, left, right = two_soles()
    wrenches = {name: np.array(wrench) for name, wrench in controller.solution.wrenches.items()}  # type: ignore[union-attr]
    controller.remove(left)
    hand = PointContact(left_hand(controller.robot))
    controller.add(hand, WrenchTask(right, [0.0, 0.0, -50.0, 0.0, 0.0, 0.0], axes="z", hard=True))
    failed = controller.solve()
    assert not failed.ok
    np.testing.assert_array_equal(failed.wrenches["right_foot"], wrenches["right_foot"])
    np.testing.assert_array_equal(failed.wrenches[hand.name], 0.0)
    again = controller.solve()
    np.testing.assert_array_equal(again.wrenches["right_foot"], wrenches["right_foot"])


def test_a_diagnosis_changes_no_contact() -> None:
    controller, left, _ = two_soles()
    left.active = False
    controller.add(PositionTask(left_hand(controller.robot)))
    before = left.force_ranges()
    for _ in range(3):
        assert controller.diagnose() == {}
        controller.status_table()
    assert left.force_ranges() == before


def settled(controller: Controller, seconds: float = 4.0) -> None:
    """Integrate the accelerations of a controller until it rests."""
    robot, dt = controller.robot, controller.dt
    for _ in range(round(seconds / dt)):
        v = robot.v + dt * controller.solve().accelerations
        robot.update(pin.integrate(robot.model, robot.q, dt * 0.5 * (robot.v + v)), v)


@pytest.mark.parametrize("name", ["hrp4_class", "talos"])
def test_by_default_a_posture_leaves_a_hand_at_its_target_and_a_heavy_one_is_named(name: str) -> None:
    """Where a posture holds a hand back, the weighted residuals cancel along the hand's gradient."""
    for weight, holds in ((None, False), (0.1, True)):
        controller = standing(name, dt=0.01, posture=False)
        robot = controller.robot
        posture = PostureTask() if weight is None else PostureTask(weight=weight)
        hand = PositionTask(left_hand(robot))
        controller.add(CoMTask(), posture, OrientationTask(robot.torso_frame), hand)
        hand.target = hand.target + [0.15, 0.05, 0.2]
        settled(controller)
        assert controller.solve().ok
        distance = float(np.linalg.norm(hand.target - hand.present(robot)))
        assert (distance > 0.07) if holds else (distance < 0.01)
        assert hand.reached is not holds
        assert (hand.held_back_by[:1] == ("posture",)) if holds else not hand.held_back_by
        assert ("held back by posture" in controller.status_table()) is holds


def test_what_holds_a_task_back_is_named_a_limit_what_must_not_move_or_the_reach() -> None:
    controller = standing("hrp4_class", dt=0.01, posture=False)
    robot = controller.robot
    foot = controller.add(PositionTask(robot.soles[0].frame))
    foot.target = foot.target + [0.0, 0.0, 0.1]
    controller.solve()
    assert foot.held_back_by == ("contacts and hard tasks",)
    arm = load("panda").robot()
    kinematics = InverseKinematics(arm, 0.01)
    elbow = kinematics.add(PostureTask(joints=["panda_joint4"], weight=1.0))
    kinematics.add(JointLimits(margin=0.1))
    elbow.target = {"panda_joint4": arm.position_upper[3]}
    for _ in range(400):
        kinematics.step()
    assert elbow.held_back_by == ("limits of panda_joint4",)
    kinematics.remove(elbow)
    hand, other = PositionTask("panda_hand"), PositionTask("panda_hand", name="other")
    kinematics.add(hand)
    kinematics.add(other, level=1)
    hand.target = hand.target + [3.0, 0.0, 0.0]
    for _ in range(400):
        kinematics.step()
    assert hand.held_back_by == ("the reach of the robot",) and other.held_back_by == (hand.name,)


def test_a_posture_has_the_default_weight_of_its_solver_unless_it_is_given_one() -> None:
    robot = make_robot("hrp4_class")
    controller, kinematics = Controller(robot, 0.01), InverseKinematics(robot, 0.01)
    usual, given, assigned = PostureTask(), PostureTask(weight=1e-3), PostureTask()
    assigned.weight = 1e-3
    for solver, weight in ((controller, 1e-3), (kinematics, 1e-4), (controller, 1e-3)):
        for task, expected in ((usual, weight), (given, 1e-3), (assigned, 1e-3)):
            solver.add(task)
            task.weight = task.weight  # gives none
            np.testing.assert_array_equal(task.weight, expected)
            solver.remove(task)


def test_a_tick_without_the_measurement_that_a_task_reads_is_refused() -> None:
    """A compliance of a hand goes by the wrench that is assigned, one of a sole by the measured one."""
    controller = standing("hrp4_class")
    hand = controller.add(ImpedanceTask(left_hand(controller.robot)))
    hand.measured_wrench = [0.0, 0.0, 10.0, 0.0, 0.0, 0.0]
    controller.solve()
    assert hand.compliance_velocity[2] > 0.0
    sole = controller.add(ImpedanceTask(controller.robot.soles[0].frame))
    with pytest.raises(InputError, match=f"{sole.name}.*measurement"):
        controller.solve()
    controller.remove(sole)
    feet = controller.contacts
    balance = controller.add(StabilizerTask(feet))
    with pytest.raises(InputError, match=f"{balance.name}.*measurement"):
        controller.solve()
