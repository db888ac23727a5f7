"""Hybrid control: references, torques and gains of one command, their limits, and drives that follow them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from task_factory import standing

from wbc import Command, HybridControl, InputError, Measurement, Plant, balance_controller, walk
from wbc.core.drive.failures import FailurePolicy
from wbc.core.drive.gate import CommandGate
from wbc.core.estimation.falls import FallReason
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


@pytest.mark.parametrize("gains", [{"kp": -1.0}, {"kd": np.nan}])
def test_gains_that_no_servo_has_are_refused(gains: dict[str, float]) -> None:
    robot = G1.robot()
    wrong = {name: np.full(robot.na, value) for name, value in gains.items()}
    with pytest.raises(InputError, match=next(iter(gains))):
        HybridControl(balance_controller(robot, DT), **wrong)


@pytest.mark.parametrize("seed", range(2))
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


@pytest.mark.parametrize("seed", range(3))
def test_what_is_not_known_of_a_joint_is_counted_as_the_worst_that_is_possible(seed: int) -> None:
    """Whatever q and q̇ are where they are NaN: within the limit, with damping left where there is room for it."""
    robot, rng = G1.robot(), np.random.default_rng(seed)
    gate, limit, na = CommandGate(robot, DT), robot.torque_limit, robot.na
    q, v = robot.half_sitting[7:], rng.normal(size=na)
    lost, unseen = rng.random((2, na)) < 0.4
    measured = np.where(lost, np.nan, q), np.where(unseen, np.nan, v)
    gains = np.full(na, 200.0), np.full(na, 8.0)
    reference = q + rng.uniform(-0.01, 0.01, na), rng.normal(size=na)
    torque = rng.uniform(-1.5, 1.5, na) * limit
    sent = gate.pass_on_with_gains(torque, *reference, gains, measured)
    for _ in range(50):
        real_q = np.where(lost, rng.uniform(robot.position_lower, robot.position_upper), q)
        real_v = np.where(unseen, 2.0 * robot.velocity_limit * rng.choice([-1.0, 1.0], na), v)
        total = sent.joint_torque + sent.kp * (sent.joint_position - real_q)
        total += sent.kd * (sent.joint_velocity - real_v)
        assert (np.abs(total) <= limit * (1.0 + 1e-9)).all() and (np.abs(sent.joint_torque) <= limit).all()
    easy = gate.pass_on_with_gains(0.2 * limit, q, np.zeros(na), gains, measured)
    assert (easy.kd > 0.0).all() and (easy.kp[~lost] > 0.0).all() and not easy.kp[lost].any()


@pytest.mark.parametrize(
    ("fault", "fallen"), [("velocity", False), ("encoder", False), ("encoder", True), ("nothing", True)]
)
def test_a_hybrid_command_keeps_the_limits_where_readings_are_refused(fault: str, fallen: bool) -> None:
    """At joints that truly move, fast: what the machine applies is by their real position and velocity."""
    control = HybridControl(standing("g1", DT))
    robot, measurement = control.controller.robot, plant().measure()
    control.command(measurement)
    if fallen:
        control.sensing.falls.reason = FallReason.DOWN
    for tick in range(1, 30):
        speed = 0.9 * robot.velocity_limit * np.sin(np.arange(1.0, robot.na + 1.0)) * min(1.0, 0.1 * tick)
        given = replace(measurement, time=measurement.time + tick * DT, joint_velocity=speed)
        received: object = {
            "velocity": replace(given, joint_velocity=np.full(robot.na, 1e6)),
            "encoder": replace(given, joint_position=np.full(robot.na, np.nan)),
            "nothing": None,
        }[fault]
        command = control.command(received)  # type: ignore[arg-type]
        total = command.joint_torque + command.kp * (command.joint_position - measurement.joint_position)
        total += command.kd * (command.joint_velocity - speed)
        assert (np.abs(total) <= 1.0001 * robot.torque_limit).all(), (tick, control.status())


def test_what_leaves_a_gate_is_nearest_to_what_was_asked_and_what_was_cut_is_named() -> None:
    """Wrong numbers become no torque, no speed and the last reference; a posture out of range comes back in steps."""
    robot = G1.robot()
    gate, limit, names = CommandGate(robot, DT), robot.torque_limit, robot.joint_names
    lower, upper, speed = robot.position_lower, robot.position_upper, 2.0 * robot.velocity_limit
    start = np.array(robot.half_sitting[7:])
    start[3], start[4] = upper[3] + 0.5, lower[4] - 0.5
    gate.reset(start)
    torque, position, velocity = 0.5 * limit, start.copy(), -0.9 * speed
    torque[:3] = np.nan, 2.0 * limit[1], -2.0 * limit[2]
    position[5:8] = np.nan, start[6] + 10.0, start[7] - 10.0
    position[3:5] = upper[3], start[4] - 0.1
    velocity[8:11] = np.nan, 3.0 * speed[9], -3.0 * speed[10]
    sent = gate.pass_on(torque, position, velocity)
    step = DT * speed
    np.testing.assert_allclose(sent.joint_torque, [0.0, limit[1], -limit[2], *0.5 * limit[3:]])
    expected = start.copy()
    expected[3], expected[6], expected[7] = start[3] - step[3], start[6] + step[6], start[7] - step[7]
    np.testing.assert_allclose(sent.joint_position, expected, atol=1e-12)
    expected = -0.9 * speed
    expected[8:11] = 0.0, speed[9], -speed[10]
    np.testing.assert_allclose(sent.joint_velocity, expected)
    assert gate.faults == tuple(names[:11])
    for changes, faults in ((0.9e-6, ()), (1.1e-6, tuple(names))):  # rounding is cut unsaid
        assert (np.abs(gate.pass_on((1.0 + changes) * limit).joint_torque) <= limit).all()
        assert gate.faults == faults
    good = gate.pass_on(0.0 * limit, sent.joint_position, 0.0 * speed)  # still out of range, and no further
    np.testing.assert_array_equal(good.joint_position, sent.joint_position)
    assert gate.faults == ()


@pytest.mark.parametrize("share", [-3.0, -1.01, 0.5, 1.01, 3.0])
def test_a_command_of_any_origin_is_cut_at_every_joint_that_asks_for_too_much(share: float) -> None:
    """Even if all of them do, by torques alone and with gains of its own."""
    robot = load("g1").robot()
    gate, limit = CommandGate(robot, 0.002), robot.torque_upper
    q, v = robot.half_sitting[7:], np.zeros(robot.na)
    expected = np.clip(share * limit, robot.torque_lower, limit)
    np.testing.assert_allclose(gate.admit(Command(share * limit), (q, v)).joint_torque, expected)
    sent = gate.admit(Command(share * limit, q + 0.01, v, kp=np.full(robot.na, 10.0), kd=v + 1.0), (q, v))
    total = sent.joint_torque + sent.kp * 0.01  # type: ignore[operator]
    np.testing.assert_allclose(total, np.clip(share * limit + 0.1, robot.torque_lower, limit), atol=0.11)
    assert (np.abs(total) <= limit + 1e-9).all() and (np.abs(sent.joint_torque) <= limit + 1e-9).all()


@pytest.mark.parametrize("unknown", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("speeds", [True, False])
def test_a_command_of_any_origin_has_no_stiffness_where_a_joint_is_nowhere(
    unknown: float, speeds: bool
) -> None:
    """The command is that of the other way through the gate; joints that are known keep theirs."""
    robot = G1.robot()
    gate, na = CommandGate(robot, DT), robot.na
    q, still = np.array(robot.half_sitting[7:]), np.zeros(robot.na)
    gains, torque = (np.full(na, 400.0), np.full(na, 2.0)), 0.1 * robot.torque_limit
    measured = q.copy(), still.copy()
    measured[0][3] = measured[1][4] = unknown
    given = Command(torque, q, still if speeds else None, kp=gains[0], kd=gains[1])
    sent = gate.admit(given, measured)
    measured[0][3] = measured[1][4] = np.nan
    other = gate.pass_on_with_gains(torque, q, still, gains, measured)
    for name in ("joint_torque", "kp", "kd"):
        np.testing.assert_allclose(getattr(sent, name), getattr(other, name), rtol=1e-12)
    assert sent.kp is not None and sent.kd is not None
    assert sent.kp[3] == 0.0 and (np.delete(sent.kp, 3) == 400.0).all() and sent.joint_torque[3] == torque[3]
    assert sent.kd[4] * 2.0 * robot.velocity_limit[4] <= robot.torque_limit[4]


def test_drives_of_one_direction_get_no_torque_of_the_other() -> None:
    """From all ways through the gate: torques, torques with references, gains of the control, a foreign command."""
    rng, names = np.random.default_rng(3), G1.joint_names
    most = G1.robot().torque_limit
    ranges = {}
    for i, name in enumerate(names):
        weak = float(rng.choice([0.0, 0.1])) * float(most[i])
        ranges[name] = (-weak, float(most[i])) if i % 2 else (-float(most[i]), weak)
    robot = replace(G1, torque_ranges=ranges).robot()
    least, most = robot.torque_lower, robot.torque_upper
    gate, q = CommandGate(robot, DT), robot.half_sitting[7:]
    kp, kd, still = np.full(robot.na, 300.0), np.full(robot.na, 5.0), np.zeros(robot.na)
    for _ in range(20):
        torque = rng.uniform(-1.5, 1.5, robot.na) * robot.torque_limit
        beyond = (torque < least) | (torque > most)
        expected = np.clip(torque, least, most)
        for sent in (gate.pass_on(torque), gate.pass_on(torque, q, still)):
            np.testing.assert_array_equal(sent.joint_torque, expected)
            assert gate.faults == tuple(name for name, cut in zip(names, beyond, strict=True) if cut)
        np.testing.assert_array_equal(gate.admit(Command(torque), (q, still)).joint_torque, expected)
        position, speed = q + rng.uniform(-0.3, 0.3, robot.na), rng.uniform(-5.0, 5.0, robot.na)
        hybrid = Command(torque, position, still, kp=kp, kd=kd)
        for sent in (
            gate.pass_on_with_gains(torque, position, still, (kp, kd), (q, speed)),
            gate.admit(hybrid, (q, speed)),
        ):
            assert sent.joint_position is not None and sent.kp is not None and sent.kd is not None
            total = sent.joint_torque + sent.kp * (sent.joint_position - q) - sent.kd * speed
            for each in (sent.joint_torque, total):
                assert (each >= least - 1e-5).all() and (each <= most + 1e-5).all()
    gate.pass_on(0.5 * (least + most))
    assert gate.faults == ()


def test_a_failing_robot_is_held_by_its_servos_and_a_stopped_one_damped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    policy = FailurePolicy(stop_after=0.02)
    controller = standing("g1", DT)
    robot = controller.robot
    control = HybridControl(controller, failure_policy=policy)
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


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["g1", "hrp4_class", "talos"])
def test_a_robot_stands_in_hybrid_control_with_noisy_sensors(robot: str) -> None:
    result = StandTrial(
        StandSpec(robot=robot, mode="hybrid", seconds=1.0, noise="realistic"), visuals=False
    ).run()
    assert result.upright and result.failures == 0
    assert result.com_error < 0.015


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["g1", "hrp4_class", "talos"])
def test_a_robot_walks_in_hybrid_control(robot: str) -> None:
    result = walk(robot=robot, mode="hybrid", distance=0.6)
    assert result.fall is None and result.failures == 0
