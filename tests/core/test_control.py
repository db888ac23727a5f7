"""Torque and position control of a moving robot, without a simulator: failed ticks, references, closed loop."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from at_rest import at_rest
from task_factory import near_half_sitting, standing

from wbc.base.errors import InputError, UnknownNameError
from wbc.core.drive.failures import FailurePolicy
from wbc.core.drive.position import PositionControl
from wbc.core.drive.servos import Servos
from wbc.core.drive.torque import HybridControl, TorqueControl
from wbc.core.estimation.falls import FallReason
from wbc.core.estimation.observer import Observer
from wbc.core.qp.contact import PointContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.solving.solver import Status
from wbc.core.robot import GRAVITY, Robot
from wbc.core.signals import Command
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
    control = PositionControl(controller, failure_policy=policy)
    control.command(at_rest(robot, 0.0))
    control._v[6:] = start = speeds(robot)
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
    control._q[7:] += 0.02 * np.sign(speeds(robot, 1))
    control._v[6:] = speeds(robot, 2)
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
    assert control.refuse(refused, RuntimeError("twice")) is refused and control.failures == 1
    np.testing.assert_array_equal(held.joint_torque, first.joint_torque)


@pytest.mark.parametrize("hand_first", [False, True])
def test_wrenches_of_a_stabilizer_take_the_place_of_the_solutions_in_the_torques(hand_first: bool) -> None:
    controller = standing("hrp4_class", DT)
    robot = controller.robot
    hand = PointContact("left_hand", ramp=0.0)
    if hand_first:
        feet = controller.contacts
        controller.remove(*feet)
        controller.add(hand, *feet)
    else:
        controller.add(hand)
    robot.update(*near_half_sitting(robot, np.random.default_rng(2), 0.05, 0.3))
    control = TorqueControl(controller, Observer(robot, adopt=True))
    solution = controller.solve()
    own = {sole.name: solution.wrenches[sole.name] for sole in robot.soles}
    np.testing.assert_allclose(controller.torques(solution, own), solution.torques, atol=1e-9)
    other = {name: wrench + (1.0, 2.0, 30.0, 1.0, 2.0, 3.0) for name, wrench in own.items()}
    expected = solution.torques.copy()
    for sole in robot.soles:
        jacobian = pin.getFrameJacobian(robot.model, robot.data, robot.frame_id(sole.frame), pin.LOCAL)
        expected -= jacobian[:, 6:].T @ (other[sole.name] - own[sole.name])
    np.testing.assert_allclose(controller.torques(solution, other), expected, atol=1e-9)
    command = control.act(control.estimate(at_rest(robot, 0.0)), other)
    assert control.solution is not None
    np.testing.assert_allclose(command.joint_torque, controller.torques(control.solution, other), atol=1e-9)
    with pytest.raises(UnknownNameError, match="did you mean 'left_foot'"):
        controller.torques(solution, {"left_feet": own["left_foot"]})


@pytest.mark.parametrize("drive", [PositionControl, TorqueControl, HybridControl])
def test_what_a_driver_does_to_a_command_changes_nothing(
    drive: type[PositionControl | TorqueControl | HybridControl], monkeypatch: pytest.MonkeyPatch
) -> None:
    controls = [drive(standing("hrp4_class", DT)) for _ in range(2)]
    commands: list[list[Command]] = [[], []]
    for tick in range(6):
        for control, sent, spoilt in zip(controls, commands, (False, True), strict=True):
            if tick == 3:
                fail_from_now_on(control.controller, monkeypatch)
            measured = at_rest(control.controller.robot, tick * DT)
            command = control.command(replace(measured, sole_wrench=None) if tick else measured)
            sent.append(command.copy())
            for part in (command.joint_torque, command.joint_position, command.joint_velocity, command.kp):
                if spoilt and part is not None:
                    np.multiply(part, -3.0, out=part)
    for good, other in zip(*commands, strict=True):
        for name in ("joint_torque", "joint_position", "joint_velocity", "kp", "kd"):
            np.testing.assert_array_equal(getattr(good, name), getattr(other, name))


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


# ---- figures --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_balance_is_lost_where_the_dcm_is_farther_from_every_foot_than_the_limit_over_the_height(
    yaw: float,
) -> None:
    """ξ = c + ċ √(h/g), with the height h of the CoM over the lower foot."""
    controller = standing("hrp4_class", DT)
    control, robot = TorqueControl(controller), controller.robot
    q, v = np.array(robot.half_sitting), np.zeros(robot.nv)
    q[:2], q[2] = (3.0, -2.0), q[2] + 0.4
    q[3:7] = 0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    v[:2] = 0.5, 0.3
    robot.update(q, v)
    soles = [np.array(robot.placement(sole.frame).translation) for sole in robot.soles]
    height = float(robot.com[2]) - min(sole[2] for sole in soles)
    dcm = robot.com[:2] + robot.com_velocity[:2] * math.sqrt(height / GRAVITY)
    least = min(float(np.linalg.norm(dcm - sole[:2])) for sole in soles) / height
    for share in (0.999, 1.001):
        control.dcm_limit = share * least
        assert ("balance lost" in control.status()) == (share < 1.0)


@pytest.mark.parametrize("ticks", [0, 1, 4])
def test_a_control_stops_once_failures_have_lasted_longer_than_its_policy_says(
    ticks: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    controller = standing("hrp4_class", DT)
    control = TorqueControl(controller, failure_policy=FailurePolicy(stop_after=(ticks + 0.5) * DT))
    control.command(at_rest(controller.robot, 0.0))
    assert not control.failing and control.fallen is None
    fail_from_now_on(controller, monkeypatch)
    for tick in range(1, ticks + 3):
        control.command(at_rest(controller.robot, tick * DT))
        assert control.failing and control.failures == tick
        assert control.stopped == (tick > ticks) == control.status().startswith("stopped: ")
        assert control.fallen is (FallReason.SOLVER if tick > ticks else None)
    assert control.time == pytest.approx((ticks + 3) * DT)


def test_servos_are_as_soft_as_a_share_of_what_was_derived_and_stiff_enough_at_given_ankles() -> None:
    """Three hundredths of derived gains; 0.4 m g h at each ankle whose gain is given."""
    names, kp, kd = (
        ("hip", "left_ankle", "right_ankle"),
        np.array([500.0, 79.0, 81.0]),
        np.array([5.0, 3.0, 2.0]),
    )
    for given, soft in (
        ((), None),
        (("left_ankle",), "left_ankle"),
        (("right_ankle",), None),
        (("hip", "left_ankle", "right_ankle"), "left_ankle"),
    ):
        servos = Servos(kp, kd, frozenset(given), names, names[1:], tipping=200.0)
        assert servos.soft_ankle == soft
        share = np.array([1.0 if name in given else 0.03 for name in names])
        np.testing.assert_allclose(servos.soft(), [share * kp, share * kd])
        if soft is None:
            servos.check_position_control()
        else:
            with pytest.raises(InputError, match=r"kp of 80 Nm/rad .*\(0.4 m g h\), 'left_ankle' has 79"):
                servos.check_position_control()


def test_a_position_control_that_is_damped_holds_nothing_and_brakes_each_joint() -> None:
    """Gains of zero and damping over the torque limit, about where the joints are within their ranges."""
    controller = standing("hrp4_class", DT)
    robot, control = controller.robot, PositionControl(controller)
    control.command(at_rest(robot, 0.0))
    control.sensing.falls.reason = FallReason.DOWN
    q = at_rest(robot, DT).joint_position + 0.01
    q[3] = robot.position_upper[3] + 0.1
    moving = speeds(robot)
    command = control.command(at_rest(robot, DT, joint_position=q, joint_velocity=moving))
    assert command.kp is not None and command.kd is not None and not command.kp.any()
    np.testing.assert_allclose(command.kd, 0.02 * robot.torque_limit)
    np.testing.assert_allclose(command.joint_velocity, 0.0, atol=1e-12)
    np.testing.assert_allclose(command.joint_torque, 0.0, atol=1e-9)
    assert control.status().startswith("fallen: ") and "damped" in control.status()
