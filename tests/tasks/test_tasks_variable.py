"""Tasks on torques and contact wrenches, and the torques themselves against Pinocchio's inverse dynamics."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from properties import by_default
from task_factory import ROBOTS, arm, left_hand, near_half_sitting, standing

from wbc.base.numbers import Array
from wbc.core.qp.contact import PointContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.solving.solution import Solution
from wbc.tasks import CoMTask, JointTorqueTask, PostureTask, WrenchTask

robots = pytest.mark.parametrize("name", by_default(ROBOTS, "hrp4_class"))


def inverse_dynamics(controller: Controller, solution: Solution) -> Array:
    """Generalised forces that the solved motion needs beside the solved contact wrenches, by `pin.rnea`."""
    robot = controller.robot
    external = pin.StdVec_Force()
    total = [pin.Force.Zero() for _ in range(robot.model.njoints)]
    for contact in controller.contacts:
        frame = robot.model.frames[robot.frame_id(contact.frame)]
        wrench = solution.wrenches[contact.name]
        if contact.dim == 6:
            force = frame.placement.act(pin.Force(wrench[:3], wrench[3:]))
        else:  # in a frame whose z axis is the normal, which here is the world's
            rotation = robot.data.oMi[frame.parentJoint].rotation
            linear = rotation.T @ wrench
            force = pin.Force(linear, np.cross(frame.placement.translation, linear))
        total[frame.parentJoint] += force
    external.extend(total)
    data = robot.model.createData()
    return pin.rnea(robot.model, data, robot.q, robot.v, solution.accelerations, external)


@robots
def test_torques_are_those_of_inverse_dynamics(name: str) -> None:
    rng = np.random.default_rng(1)
    controller = standing(name)
    hand = PointContact(left_hand(controller.robot), min_force=2.0, ramp=0.0)
    controller.add(hand, CoMTask())
    for _ in range(5):
        controller.update(*near_half_sitting(controller.robot, rng, 0.05, 0.3))
        solution = controller.solve()
        assert solution.ok
        force = inverse_dynamics(controller, solution)
        np.testing.assert_allclose(force[:6], 0.0, atol=1e-4)
        np.testing.assert_allclose(solution.torques, force[6:], atol=1e-5)
        assert np.linalg.norm(solution.wrenches[hand.name]) > 1.0


@robots
def test_outside_forces_enter_the_dynamics_once_however_often_a_tick_is_solved(name: str) -> None:
    controller = standing(name)
    robot, joint = controller.robot, arm(controller.robot)[0]
    controller.add(CoMTask(), JointTorqueTask({joint: 2.0}, joints=joint, hard=True))
    robot.update(*near_half_sitting(robot, np.random.default_rng(3), 0.05, 0.3))
    bias = robot.bias.copy()
    jacobian = pin.getFrameJacobian(
        robot.model, robot.data, robot.frame_id(left_hand(robot)), pin.LOCAL_WORLD_ALIGNED
    )
    controller.outside = jacobian[:3].T @ [10.0, -5.0, -20.0]
    solutions = [controller.solve() for _ in range(3)]
    for solution in solutions:
        assert solution.ok
        force = inverse_dynamics(controller, solution) - controller.outside
        np.testing.assert_allclose(force[:6], 0.0, atol=1e-4)
        np.testing.assert_allclose(solution.torques, force[6:], atol=1e-5)
        assert solution.torques[robot.joint_index(joint)] == pytest.approx(2.0, abs=1e-6)
    np.testing.assert_array_equal(robot.bias, bias)  # others read it, too


@robots
def test_hard_torques_are_met_and_soft_ones_come_near(name: str) -> None:
    controller = standing(name)
    joints = arm(controller.robot)[::-1]
    free = controller.solve().torques
    index = [controller.robot.joint_index(joint) for joint in joints]
    wanted = free[index] + [0.5, -0.5, 0.2, 0.1]
    task = controller.add(JointTorqueTask(wanted, joints=joints, hard=True))
    solution = controller.solve()
    assert solution.ok
    np.testing.assert_allclose(solution.torques[index], wanted, atol=1e-6)
    controller.remove(task)
    task.hard = False
    controller.add(task)
    distances = []
    for weight in (0.0, 1e-3, 1e-1, 1e6):
        task.weight = weight
        distances.append(float(np.linalg.norm(controller.solve().torques[index] - wanted)))
    assert distances[0] > 0.5
    assert distances == sorted(distances, reverse=True)
    assert distances[-1] < 1e-4


def test_regularised_torques_are_smaller() -> None:
    """With two feet on the ground there are many torques for one motion."""
    controller = standing("hrp4_class")
    task = controller.add(JointTorqueTask(weight=0.0))
    assert task.dim == controller.robot.na
    without = np.linalg.norm(controller.solve().torques)
    task.weight = 1e-6
    solution = controller.solve()
    assert np.linalg.norm(solution.torques) < without - 0.1
    np.testing.assert_allclose(solution.residuals[task.name], solution.torques, atol=1e-9)


@robots
def test_wrench_is_tracked_along_the_chosen_axes(name: str) -> None:
    controller = standing(name)
    robot = controller.robot
    controller.add(PostureTask(name="strong posture"), CoMTask())
    weight = robot.mass * 9.80665
    left = controller.contacts[0]
    task = controller.add(
        WrenchTask(left, [0.0, 0.0, 0.4 * weight, 0.0, 1.0, 0.0], axes=("z", "pitch"), weight=1.0)
    )
    solution = controller.solve()
    np.testing.assert_allclose(solution.wrenches["left_foot"][[2, 4]], [0.4 * weight, 1.0], atol=0.05)
    other = solution.wrenches["right_foot"][2]
    assert other == pytest.approx(0.6 * weight, rel=2e-2)
    np.testing.assert_allclose(
        solution.residuals[task.name], solution.wrenches["left_foot"][[2, 4]] - task.target[[2, 4]], atol=1e-9
    )


def test_force_of_a_point_contact_is_tracked() -> None:
    controller = standing("hrp4_class")
    hand = PointContact(left_hand(controller.robot), ramp=0.0)
    controller.add(hand)
    controller.add(WrenchTask(hand, [0.0, 0.0, 15.0], weight=1e3))
    np.testing.assert_allclose(controller.solve().wrenches[hand.name], [0.0, 0.0, 15.0], atol=1e-2)
