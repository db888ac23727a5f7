"""The QP of the controller: against another solver, and with constraints that contradict each other."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from properties import by_default
from task_factory import ROBOTS, left_hand, make_robot, near_half_sitting, right_hand, standing

from wbc.core.limits.collision import CollisionSphere, SelfCollisionLimit
from wbc.core.limits.com_polygon import CoMPolygonLimit
from wbc.core.limits.joint import JointLimits
from wbc.core.limits.torque import TorqueLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.other_solvers import solve_by_qpsolvers
from wbc.core.robot import GRAVITY
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

robots = pytest.mark.parametrize("name", by_default(ROBOTS, "hrp4_class"))


def everything(name: str) -> Controller:
    """A controller with one of each."""
    robot = make_robot(name)
    controller = Controller(robot, 0.002)
    hands = (left_hand(robot), right_hand(robot))
    controller.add(SoleContact("left_foot", friction=0.4), SoleContact("right_foot", friction=0.4))
    controller.add(CoMTask(), PostureTask(), OrientationTask(robot.torso_frame), MomentumTask())
    controller.add(PositionTask(hands[0]), RelativeFrameTask(hands[1], robot.base_frame, weight=0.5))
    controller.add(ImpedanceTask(hands[0], weight=0.1), JointTorqueTask(weight=1e-5))
    controller.add(WrenchTask("left_foot", axes=("roll", "pitch"), weight=1e-3))
    controller.add(JointLimits(), TorqueLimits(ratio=0.9), CoMPolygonLimit())
    controller.add(SelfCollisionLimit([hands], shapes={hand: CollisionSphere(0.05) for hand in hands}))
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
        other = solve_by_qpsolvers("daqp", problem, problem.hessian, problem.gradient)
        if other is None:
            assert not solution.ok
            assert controller.diagnose()
            continue
        assert solution.ok
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
