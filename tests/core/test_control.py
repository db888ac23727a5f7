"""Torque and position control of a moving robot, without a simulator: failed ticks, references, closed loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from at_rest import at_rest
from task_factory import near_half_sitting, standing

from wbc.core.control import FailurePolicy
from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import TorqueControl
from wbc.core.qp.controller import Controller
from wbc.core.qp.solver import Status
from wbc.core.robot import Robot
from wbc.tasks import CoMTask

DT = 0.005


def speeds(robot: Robot, seed: int = 0) -> np.ndarray:
    """Speeds of both signs, none near zero, rad/s."""
    rng = np.random.default_rng(seed)
    return np.asarray(rng.uniform(0.05, 0.2, robot.na) * rng.choice([-1.0, 1.0], robot.na))


def fail_from_now_on(controller: Controller, monkeypatch: pytest.MonkeyPatch) -> None:
    solve = controller.solve
    failed = next(status for status in Status if not status.ok)
    monkeypatch.setattr(controller, "solve", lambda m=None: replace(solve(m), status=failed))


def test_a_failed_tick_brakes_every_joint_that_moves_and_a_stopped_robot_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    controller = standing("hrp4_class", DT)
    robot, policy = controller.robot, FailurePolicy()
    control = TorqueControl(controller)
    held = control.command(at_rest(robot, 0.0)).joint_torque.copy()
    assert control.solution is not None and control.solution.ok and np.abs(held).max() > 1.0
    fail_from_now_on(controller, monkeypatch)
    stopped = False
    for tick in range(1, 40):
        moving = speeds(robot, tick)
        torque = control.command(at_rest(robot, tick * DT, joint_velocity=moving)).joint_torque
        braking = torque if control.stopped else torque - held
        assert (braking * moving < 0.0).all()
        np.testing.assert_allclose(braking, -policy.joint_damping * robot.torque_limit * moving, rtol=1e-9)
        stopped |= control.stopped
    assert stopped


def test_held_references_slow_down_to_a_stop_as_the_policy_says(monkeypatch: pytest.MonkeyPatch) -> None:
    controller = standing("hrp4_class", DT)
    robot, policy = controller.robot, FailurePolicy(damping_time=0.04)
    control = PositionControl(controller, policy=policy)
    control.command(at_rest(robot, 0.0))
    control.v[6:] = start = speeds(robot)
    fail_from_now_on(controller, monkeypatch)
    left = 1.0 - DT / policy.damping_time
    for tick in range(1, 11):
        before = control.q[7:].copy()
        command = control.command(at_rest(robot, tick * DT))
        np.testing.assert_allclose(command.joint_velocity, start * left**tick, rtol=1e-9)
        # Over a tick the reference moves by the mean of its speeds at both ends.
        mean = 0.5 * (1.0 + left) * start * left ** (tick - 1)
        np.testing.assert_allclose(command.joint_position - before, DT * mean, rtol=1e-9)
    for tick in range(11, 40):
        command = control.command(at_rest(robot, tick * DT))
    assert control.stopped
    np.testing.assert_allclose(command.joint_velocity, 0.0, atol=1e-12)
    frozen = command.joint_position
    command = control.command(at_rest(robot, 40 * DT))
    np.testing.assert_allclose(command.joint_position, frozen, atol=1e-12)


@pytest.mark.parametrize("time", [0.05, 0.2])
def test_in_closed_loop_references_are_drawn_to_the_estimate_of_a_moving_robot(time: float) -> None:
    """Both fade into the estimate as (1 − e^{−dt/T}), and the accelerations of the solution come on top."""
    controller = standing("hrp4_class", DT)
    robot = controller.robot
    control = PositionControl(controller, feedback="closed", reference_time=time)
    control.q[7:] += 0.02 * np.sign(speeds(robot, 1))
    control.v[6:] = speeds(robot, 2)
    share = -np.expm1(-DT / time)
    for tick in range(5):
        q, v = control.q.copy(), control.v.copy()
        control.command(at_rest(robot, tick * DT, joint_velocity=speeds(robot, 3)))
        estimate, solution = control.observer.robot, control.solution
        assert solution is not None and solution.ok
        drawn = v + share * (estimate.v - v)
        np.testing.assert_allclose(control.v, drawn + DT * solution.accelerations, atol=1e-9)
        q = pin.integrate(robot.model, q, share * pin.difference(robot.model, q, estimate.q))
        q = pin.integrate(robot.model, q, DT * drawn + 0.5 * DT**2 * solution.accelerations)
        np.testing.assert_allclose(pin.difference(robot.model, control.q, q), 0.0, atol=1e-9)


def test_a_tick_whose_targets_fail_holds_the_last_torques() -> None:
    control = PositionControl(standing("hrp4_class", DT))
    robot = control.controller.robot
    first = control.command(at_rest(robot, 0.0))
    state = control.estimate(at_rest(robot, DT))
    refused = control.refuse(state, RuntimeError("no such table"))
    held = control.act(refused)
    assert not refused.ok and control.failures == 1 and "no such table" in control.status()
    np.testing.assert_array_equal(held.joint_torque, first.joint_torque)


def test_wrenches_of_a_stabilizer_take_the_place_of_the_solutions_in_the_torques() -> None:
    """With the QP's own wrenches the torques are the QP's; another force f changes them by −Jᵀ f."""
    control = TorqueControl(standing("hrp4_class", DT))
    robot = control.controller.robot
    state = control.estimate(at_rest(robot, 0.0))
    command = control.act(state)
    solution = control.solution
    assert solution is not None
    own = np.array(list(solution.wrenches.values()))
    np.testing.assert_allclose(control.controller.torques(solution, own), command.joint_torque, atol=1e-8)
    more = own.copy()
    more[0, 2] += 10.0
    frame = robot.frame_id(robot.soles[0].frame)
    jacobian = pin.getFrameJacobian(robot.model, robot.data, frame, pin.LOCAL)[:, 6:]
    change = control.controller.torques(solution, more) - command.joint_torque
    np.testing.assert_allclose(change, -10.0 * jacobian[2], atol=1e-8)


def test_outside_forces_take_part_in_the_equations_of_motion_and_residuals_are_what_is_left_of_tasks() -> (
    None
):
    controller = standing("g1", DT)
    robot, rng = controller.robot, np.random.default_rng(0)
    com = controller.add(CoMTask(np.array(robot.com) + [0.03, -0.02, 0.01]))
    controller.update(*near_half_sitting(robot, rng, 0.02, 0.1))
    for outside in (np.zeros(robot.nv), rng.normal(size=robot.nv)):
        controller.outside = outside
        solution = controller.solve()
        assert solution.ok
        pin.centerOfMass(robot.model, robot.data, robot.q, robot.v, solution.accelerations)
        asked = com.stiffness * (com.target - robot.com) - com.damping * robot.com_velocity
        np.testing.assert_allclose(solution.residuals["com"], robot.data.acom[0] - asked, atol=1e-6)
        left = robot.mass_matrix @ solution.accelerations + robot.bias - outside
        left[6:] -= solution.torques
        for sole in robot.soles:
            frame = robot.frame_id(sole.frame)
            left -= (
                pin.getFrameJacobian(robot.model, robot.data, frame, pin.LOCAL).T
                @ solution.wrenches[sole.name]
            )
        np.testing.assert_allclose(left, 0.0, atol=1e-5)
