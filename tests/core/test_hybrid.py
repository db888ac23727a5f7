"""Hybrid control: references, torques and gains of one command, their limits, and drives that follow them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from properties import by_default
from task_factory import standing

from wbc import Command, HybridControl, InputError, Measurement, Plant, balance_controller, walk
from wbc.core.control import FailurePolicy
from wbc.core.gate import CommandGate
from wbc.core.robot import Robot
from wbc.feet.soles.contact import ContactSpheres
from wbc.feet.soles.rigid import FlatFoot
from wbc.robots import load
from wbc.sim.balance.standing import StandSpec, StandTrial

DT = 0.002
G1 = load("g1")


def plant(**options: object) -> Plant:
    return Plant(G1, foot=FlatFoot(ContactSpheres(row_spacing=0.1)), control_period=DT, **options)  # type: ignore[arg-type]


def bare(robot: Robot, reference_time: float = 0.02) -> HybridControl:
    kp, kd = np.full(robot.na, 60.0), np.full(robot.na, 1.5)
    return HybridControl(balance_controller(robot, DT), kp=kp, kd=kd, reference_time=reference_time)


def test_references_are_where_the_torques_lead_until_the_next_command() -> None:
    """So the servos of a robot that moves as its model says add nothing, whatever their gains."""
    simulated, control = plant(), bare(G1.robot(), 0.0)
    for _ in range(50):
        command = control.command(simulated.measure())
        simulated.step(command)
    robot, solution = control.controller.robot, control.solution
    assert solution is not None and command.joint_position is not None and command.joint_velocity is not None
    step = DT * solution.accelerations[6:]
    np.testing.assert_allclose(command.joint_velocity, robot.v[6:] + step, atol=1e-12)
    np.testing.assert_allclose(
        command.joint_position, robot.q[7:] + DT * (robot.v[6:] + 0.5 * step), atol=1e-12
    )
    np.testing.assert_array_equal(command.joint_torque, solution.torques)
    np.testing.assert_array_equal(command.kp, control.kp)
    measured = simulated.measure()
    servo = control.kp * (command.joint_position - measured.joint_position)
    servo += control.kd * (command.joint_velocity - measured.joint_velocity)
    assert np.abs(servo).max() < 0.01 * np.abs(command.joint_torque).max()


@pytest.mark.parametrize(("time", "share"), [(0.0, 1.0), (0.02, 0.12)])
def test_a_velocity_that_is_measured_wrong_reaches_the_references_weakened(time: float, share: float) -> None:
    """Servos that answer late to their own speed shake joints of little inertia."""
    references = []
    for error in (0.0, 0.1):
        simulated, control = plant(), bare(G1.robot(), time)
        for _ in range(20):
            simulated.step(control.command(simulated.measure()))
        measured = simulated.measure()
        wrong = measured.joint_velocity.copy()
        wrong[-1] += error
        command = control.command(replace(measured, joint_velocity=wrong))
        assert command.joint_velocity is not None and control.solution is not None
        references.append(command.joint_velocity[-1] - DT * control.solution.accelerations[-1])
    assert 0.0 < references[1] - references[0] < 0.1 * share + 1e-9


def test_gains_are_those_given_and_a_soft_share_of_those_derived() -> None:
    ankle = G1.legs[0][-1]
    some = replace(G1, gains={ankle: (40.0, 1.0)})
    robot = some.robot()
    control = HybridControl(balance_controller(robot, DT))
    i = robot.joint_index(ankle)
    assert (control.kp[i], control.kd[i]) == (40.0, 1.0)
    others = np.arange(robot.na) != i
    np.testing.assert_allclose(control.kp[others], 0.03 * G1.kp[others])
    np.testing.assert_allclose(control.kd[others], 0.03 * G1.kd[others])


@pytest.mark.parametrize("gains", [{"kp": -1.0}, {"kd": np.nan}])
def test_gains_that_no_servo_has_are_refused(gains: dict[str, float]) -> None:
    robot = G1.robot()
    wrong = {name: np.full(robot.na, value) for name, value in gains.items()}
    with pytest.raises(InputError, match=next(iter(gains))):
        HybridControl(balance_controller(robot, DT), **wrong)


@pytest.mark.parametrize("seed", range(5))
def test_feedforward_and_servos_together_keep_the_torque_limits(seed: int) -> None:
    """Each stays within, and their sum; the sum is kept where the feed-forward's own limit lets it."""
    robot, rng = G1.robot(), np.random.default_rng(seed)
    gate = CommandGate(robot, DT)
    measured = robot.half_sitting[7:], np.zeros(robot.na)
    kp, kd = np.full(robot.na, 3000.0), np.full(robot.na, 50.0)
    position = measured[0] + rng.uniform(-0.02, 0.02, robot.na)
    velocity = rng.uniform(-1.0, 1.0, robot.na)
    torque = rng.uniform(-2.0, 2.0, robot.na) * robot.torque_limit
    sent = gate.pass_on_with_gains(torque, position, velocity, (kp, kd), measured)
    assert sent.joint_position is not None and sent.joint_velocity is not None
    limit = robot.torque_limit
    servo = kp * (sent.joint_position - measured[0]) + kd * (sent.joint_velocity - measured[1])
    wanted = np.clip(torque + servo, -limit, limit)
    within = np.abs(wanted - servo) <= limit  # where the feed-forward's own limit leaves it
    np.testing.assert_allclose((sent.joint_torque + servo)[within], wanted[within], atol=1e-9)
    softened = sent.kp * (sent.joint_position - measured[0]) + sent.kd * (sent.joint_velocity - measured[1])
    assert within.any() and not within.all()
    assert (np.abs(sent.joint_torque) <= limit + 1e-9).all()
    assert (np.abs(sent.joint_torque + softened) <= limit + 1e-9).all()
    most = np.maximum(np.abs(torque + servo), np.abs(torque))
    assert set(gate.faults) == {robot.joint_names[i] for i in (most > limit).nonzero()[0]}


def test_a_failing_robot_is_held_by_its_servos_and_a_stopped_one_damped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    policy = FailurePolicy(stop_after=0.02)
    controller = standing("g1", DT)
    robot = controller.robot
    control = HybridControl(controller, policy=policy)
    simulated = plant()
    good = control.command(simulated.measure())
    simulated.step(good)
    monkeypatch.setattr(
        controller, "solve", lambda m=None: (_ for _ in ()).throw(RuntimeError("no solution"))
    )
    held = control.command(simulated.measure())
    np.testing.assert_array_equal(held.joint_torque, good.joint_torque)
    np.testing.assert_array_equal(held.joint_position, good.joint_position)
    np.testing.assert_array_equal(held.joint_velocity, np.zeros(robot.na))
    np.testing.assert_array_equal(held.kp, control.kp)
    for _ in range(15):
        simulated.step(held)
        held = control.command(simulated.measure())
    assert control.stopped
    measured: Measurement = simulated.measure()
    np.testing.assert_array_equal(held.kp, np.zeros(robot.na))
    np.testing.assert_array_equal(held.joint_torque, np.zeros(robot.na))
    np.testing.assert_array_equal(held.joint_velocity, np.zeros(robot.na))
    assert (held.kd >= policy.joint_damping * robot.torque_limit).all()
    assert np.abs(measured.joint_position).max() > 0.0


def test_a_first_measurement_that_cannot_be_used_is_answered_with_finite_numbers() -> None:
    """After a reset, too: the last measurement is that of another configuration."""
    robot = G1.robot()
    control = bare(robot)
    good = plant().measure()
    unknown = np.full(robot.na, np.nan)
    for measurement in (
        replace(good, joint_position=unknown),
        replace(good, joint_position=unknown, sole_wrench=None),
        replace(good, joint_position=np.zeros(3)),
        None,
    ):
        control.reset()
        start = control.q.copy()
        command = control.command(measurement)  # type: ignore[arg-type]
        assert control.failing
        np.testing.assert_array_equal(command.joint_torque, np.zeros(robot.na))
        np.testing.assert_array_equal(command.joint_position, start)
    control.reset()
    assert control.command(good) is not None and not control.failing
    other = robot.half_sitting.copy()
    other[7:] += 0.1 * (robot.position_upper - robot.half_sitting[7:])
    control.reset(other)
    command = control.command(replace(good, joint_position=unknown))
    np.testing.assert_array_equal(command.joint_torque, np.zeros(robot.na))


def test_the_plants_drives_apply_the_gains_of_the_command() -> None:
    simulated = plant()
    na, hold = simulated.robot.na, simulated.hold()
    assert hold.joint_position is not None
    kp, kd = np.linspace(5.0, 20.0, na), np.linspace(0.5, 1.0, na)
    for _ in range(3):  # the same gains again are the same servos
        before = simulated.measure()
        command = Command(np.full(na, 0.1), hold.joint_position + 0.02, np.full(na, 0.2), kp=kp, kd=kd)
        simulated.step(command)
    after = simulated.measure()
    law = [
        0.1 + kp * (hold.joint_position + 0.02 - m.joint_position) + kd * (0.2 - m.joint_velocity)
        for m in (before, after)
    ]
    low, high = np.minimum(*law), np.maximum(*law)
    slack = 0.02 * np.abs(high) + 1e-3
    assert ((low - slack <= simulated.joint_torque) & (simulated.joint_torque <= high + slack)).all()
    simulated.step(Command(np.zeros(na)))
    np.testing.assert_array_equal(simulated.joint_torque, np.zeros(na))
    simulated.step(hold)
    stiff = G1.kp * (hold.joint_position - simulated.measure().joint_position)
    assert np.abs(simulated.joint_torque).max() > 1.0 and np.abs(stiff).max() > 1.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kp": np.zeros(3)}, "kp of a command must be numbers of shape"),
        ({"kd": np.full(29, np.nan)}, "kd of joint 'left_hip_pitch_joint' is not finite"),
        ({"kp": np.full(29, -1.0)}, "not negative"),
        ({"kp": np.zeros(29), "joint_position": None, "joint_velocity": None}, "needs a position reference"),
    ],
)
def test_gains_of_a_command_that_cannot_be_used_are_refused(change: dict[str, object], message: str) -> None:
    simulated = plant()
    with pytest.raises(InputError, match=message):
        simulated.step(replace(simulated.hold(), **change))  # type: ignore[arg-type]
    assert simulated.time == 0.0


@pytest.mark.parametrize("robot", by_default(["g1", "hrp4_class", "talos"], "g1"))
def test_a_robot_stands_in_hybrid_control_with_noisy_sensors(robot: str) -> None:
    result = StandTrial(StandSpec(robot=robot, mode="hybrid", seconds=1.0, noise="realistic")).run()
    assert result.upright and result.failures == 0
    assert result.com_error_mm < 15.0


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["g1", "hrp4_class", "talos"])
def test_a_robot_walks_in_hybrid_control(robot: str) -> None:
    result = walk(robot=robot, mode="hybrid", distance=0.6)
    assert result.fall is None and result.failures == 0
