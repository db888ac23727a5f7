"""Controls of one's own: they have the estimate, the failures and the released joints of their drives."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import wbc
from wbc.base.errors import InputError
from wbc.core.drive.control import State
from wbc.machine import Runner
from wbc.sim import Trial
from wbc.tasks import Behaviour, Program, StateMachine

HRP4, DT = wbc.load_robot("hrp4_class"), 0.005


class Held(wbc.Control):
    """A law that holds half-sitting with servos, in place of the QP, until it is broken."""

    restarts = True

    def __init__(self) -> None:
        robot = HRP4.robot()
        self.drives = wbc.TorqueControl(wbc.balance_controller(robot, DT))
        self.rest, self.none = np.array(robot.half_sitting[7:]), np.zeros(robot.na)
        self.gains, self.broken, self.seen = (np.array(HRP4.kp), np.array(HRP4.kd)), False, 0

    def act(self, state: State) -> wbc.Command:
        return self.drives.relay(state, self.law)

    def law(self, state: State) -> wbc.Command:
        if self.broken:
            raise ValueError("broken")
        m = state.measurement
        return self.drives.gate.pass_on_with_gains(
            self.none, self.rest, self.none, self.gains, (m.joint_position, m.joint_velocity)
        )

    def see(self, seen: Any) -> None:
        self.seen += 1


def run(plant: wbc.Plant, control: wbc.Control, seconds: float) -> wbc.Command:
    end = plant.time + seconds
    while plant.time < end - 1e-9:
        command = control.command(plant.measure())
        plant.step(command)
    return command


def test_a_law_that_fails_is_held_and_then_stopped_until_the_control_begins_anew() -> None:
    plant, control = wbc.Plant(HRP4, control_period=DT, visuals=False), Held()
    stands = run(plant, control, 0.5)
    assert control.status() == "ok" and control.fallen is None and stands.kp is not None
    control.broken = True
    run(plant, control, DT)
    assert control.drives.failing and "ValueError" in control.status()
    control.broken = False
    assert run(plant, control, DT).kp is not None and control.status() == "ok"
    control.broken = True
    run(plant, control, 0.15)
    control.broken = False
    assert run(plant, control, 0.05).kp is None and control.drives.stopped
    plant.reset()
    control.reset()
    assert run(plant, control, 0.3).kp is not None and not control.drives.stopped


@pytest.mark.parametrize(
    ("drives", "gains", "references"),
    [(wbc.PositionControl, True, True), (wbc.HybridControl, True, True), (wbc.TorqueControl, False, True)]
    + [(wbc.PositionControl, False, False), (wbc.HybridControl, False, False)],
)
def test_the_command_of_a_law_is_held_where_it_is_not_of_the_gate(
    drives: type[wbc.PositionControl | wbc.TorqueControl | wbc.HybridControl], gains: bool, references: bool
) -> None:
    """Neither gate nor drives know the references and torques of a law that makes its commands alone."""
    control, measured = Held(), wbc.Plant(HRP4, control_period=DT, visuals=False).measure()
    control.drives = drives(wbc.balance_controller(HRP4.robot(), DT))  # type: ignore[assignment]
    servos = dict(zip(("kp", "kd"), control.gains, strict=True)) if gains and references else {}
    position = control.rest + 0.001 if references else None
    torque = np.full_like(control.rest, 0.1)
    command = wbc.Command(torque, position, None if position is None else control.none + 0.5, **servos)

    def law(state: State) -> wbc.Command:
        if control.broken:
            raise ValueError("broken")
        return command.copy()

    control.law = law  # type: ignore[method-assign]
    sent = control.command(measured)
    for array in (sent.joint_torque, sent.joint_position):
        if array is not None:
            array[:] = np.nan  # a driver may do what it likes with the arrays of a command
    control.broken = True
    for tick in (1, 2):
        held = control.command(replace(measured, time=measured.time + tick * DT))
        np.testing.assert_allclose(held.joint_torque, torque, atol=1e-12)
        if position is None:
            assert held.joint_position is None
        else:
            np.testing.assert_array_equal(held.joint_position, position)
            np.testing.assert_array_equal(held.joint_velocity, control.none)
        np.testing.assert_array_equal(held.kp, command.kp)
        assert control.drives.failures == tick


def test_a_law_is_not_asked_in_a_tick_that_has_failed_by_its_measurement() -> None:
    control = Held()
    control.broken = True
    control.command(None)  # type: ignore[arg-type]
    assert control.drives.failures == 1 and "broken" not in control.status()


def test_a_command_of_a_law_that_has_a_wrong_shape_or_a_negative_gain_is_not_held() -> None:
    own, plant = Held(), wbc.Plant(HRP4, control_period=DT, visuals=False)
    na, m = plant.robot.na, plant.measure()
    state = own.drives.estimate(m)
    good = own.drives.relay(state, lambda _: wbc.Command(np.full(na, 1.0)))
    for torque, position, kp in (
        (np.full(1, 9.0), None, None),
        (np.full(na, 9.0), np.zeros(2), None),
        (np.full(na, 9.0), np.zeros(na), np.zeros(2)),
        (np.full(na, 9.0), np.zeros(na), np.full(na, -5.0)),
    ):
        wrong = wbc.Command(torque, position, None if position is None else np.zeros(na), kp=kp, kd=kp)
        held = own.drives.relay(state, lambda _, wrong=wrong: wrong)
        assert own.drives.failing and held.joint_position is None and held.kp is None
        np.testing.assert_allclose(held.joint_torque, good.joint_torque, atol=1e-6)
    own.drives.relay(state, lambda _: good)  # a row of failures tells its first reason
    held = own.drives.relay(state, lambda _: None)  # type: ignore[arg-type, return-value]
    assert "must return a wbc.Command" in own.drives.status()
    np.testing.assert_allclose(held.joint_torque, good.joint_torque, atol=1e-6)


@pytest.mark.parametrize("gains", [True, False])
def test_torques_of_a_law_are_within_the_limits_of_the_robot(gains: bool) -> None:
    """Of the law itself and of the servos that it asks for, now and while its command is held."""
    own, m = Held(), wbc.Plant(HRP4, control_period=DT, visuals=False).measure()
    kp, limit = np.full(HRP4.robot().na, 1e3), own.drives.controller.robot.torque_limit
    far = wbc.Command(1e5 + own.none, own.rest + 50.0, own.none, kp=kp, kd=own.none)
    state, own_state = own.drives.estimate(m), (m.joint_position, m.joint_velocity)
    command = far if gains else wbc.Command(1e5 + own.none)
    for law in (lambda _: command, lambda _: None):
        sent = own.drives.relay(state, law)
        applied = sent.drive_torque(*own_state, (own.none, own.none))
        assert (np.abs(applied) <= limit * (1.0 + 1e-9)).all()
        assert (np.abs(sent.joint_torque) <= limit).all()
        assert f"command clipped: {', '.join(HRP4.joint_names)}" in own.drives.status()
    own.drives.relay(state, lambda _: wbc.Command(own.none))
    assert own.drives.status() == "ok"


def test_joints_that_a_law_has_clipped_by_the_gate_itself_are_told() -> None:
    own, m = Held(), wbc.Plant(HRP4, control_period=DT, visuals=False).measure()
    own.rest = own.rest.copy()
    own.rest[3] += 1.0  # faster than the joint
    own.command(m)
    assert own.status() == f"command clipped: {HRP4.joint_names[3]}"


def test_joints_of_a_torque_alone_are_damped_while_the_command_of_a_law_is_held() -> None:
    plant, control = wbc.Plant(HRP4, control_period=DT, visuals=False), Held()
    for gain in control.gains:
        gain[-1] = 0.0
    sent = run(plant, control, 0.1)
    control.broken = True
    held = run(plant, control, DT)
    assert sent.kd is not None and held.kd is not None and held.kp is not None
    assert sent.kd[-1] == held.kp[-1] == 0.0 < held.kd[-1]
    np.testing.assert_array_equal(held.kd[:-1], sent.kd[:-1])


def test_joints_that_are_released_are_not_in_the_command_of_a_law() -> None:
    plant, control = wbc.Plant(HRP4, control_period=DT, visuals=False), Held()
    released = control.drives.release(HRP4.joint_names[-2:])
    command = run(plant, control, 0.02)
    assert released is not None and command.released is not None and command.kp is not None
    assert (command.released == released.mask).all()
    assert not command.kp[released.index].any() and command.kp[~released.mask].all()


def test_a_program_is_a_control_that_hands_all_on() -> None:
    control = Held()
    program = Program(
        StateMachine("m", [Behaviour("wait", timeout=0.1)], {"wait": {"timeout": "end"}}), control
    )
    assert program.acting is control and program.drives is control.drives and program.dt == DT
    program.see(None)
    assert control.seen == 1
    trial = Trial(wbc.Plant(HRP4, control_period=DT, visuals=False), program)
    with trial.running():
        trial.advance(0.2)
    assert program.ended and trial.drives is control.drives and program.status() == control.status() == "ok"


def test_a_walk_is_reset_before_its_first_tick_alone() -> None:
    walking = wbc.WalkingControl(HRP4.robot(), None, DT)
    q = walking.controller.robot.half_sitting.copy()
    q[0] += 0.05
    walking.reset(q)
    assert walking.drives.observer.robot.q[0] == pytest.approx(q[0]) and not walking.restarts
    walking.command(wbc.Plant(HRP4, control_period=DT, visuals=False).measure())
    with pytest.raises(InputError, match="anew"):
        walking.reset()


REFUSED: list[tuple[Callable[[], object], type[Exception]]] = [
    (lambda: wbc.Control().command(wbc.Plant(HRP4, visuals=False).measure()), NotImplementedError),
    (lambda: Trial(wbc.Plant(HRP4, control_period=DT, visuals=False), math.sqrt), InputError),  # type: ignore[arg-type]
    (lambda: Trial(wbc.Plant(HRP4, control_period=0.002, visuals=False), Held()), InputError),
    (lambda: Program(StateMachine("m", [Behaviour("a", timeout=1.0)]), wbc.Control()), InputError),
    (lambda: Runner(math.sqrt, Held()), InputError),  # type: ignore[arg-type]
]


@pytest.mark.parametrize(("call", "kind"), REFUSED)
def test_what_is_no_control_is_refused(call: Callable[[], object], kind: type[Exception]) -> None:
    with pytest.raises(kind):
        call()


@pytest.mark.parametrize("gains", [True, False])
def test_the_arrays_of_a_law_stay_as_they_are(gains: bool) -> None:
    """A joint that somebody else has moved has its stiffness again as soon as it is taken back."""
    control, m = Held(), wbc.Plant(HRP4, control_period=DT, visuals=False).measure()
    kp, kd = control.gains if gains else (None, None)
    own = wbc.Command(np.full_like(control.rest, 0.1), control.rest, control.none, kp=kp, kd=kd)
    before, elbow = own.copy(), HRP4.joint_names.index("left_elbow_pitch")
    control.law = lambda state: own  # type: ignore[method-assign]
    for tick, joints in enumerate((["left_elbow_pitch"], [])):
        control.drives.release(joints)
        sent = control.command(replace(m, time=m.time + tick * DT))
        assert sent.joint_torque[elbow] == (0.0 if joints else 0.1)
        for name in ("joint_torque", "joint_position", "joint_velocity", "kp", "kd"):
            np.testing.assert_array_equal(getattr(own, name), getattr(before, name))


def test_references_of_a_law_whose_gains_are_those_of_the_machine_are_within_range_and_speed() -> None:
    """Also while they are held in a tick that fails; a joint that is beyond its range may stay there."""
    own, m = Held(), wbc.Plant(HRP4, control_period=DT, visuals=False).measure()
    robot = own.drives.controller.robot
    asked = wbc.Command(own.none, own.rest + 50.0, own.none + 1e4)
    state = own.drives.estimate(m)
    for sent in (
        own.drives.relay(state, lambda _: asked),
        own.drives.relay(state._replace(ok=False), own.law),
    ):
        assert sent.joint_position is not None and sent.joint_velocity is not None and sent.kp is None
        np.testing.assert_allclose(sent.joint_position, robot.position_upper)
        assert (np.abs(sent.joint_velocity) <= 2.0 * robot.velocity_limit).all()
        assert own.drives.gate.faults
    beyond = robot.position_upper + 0.05
    sent = own.drives.gate.admit(wbc.Command(own.none, beyond), (beyond, own.none))
    np.testing.assert_array_equal(sent.joint_position, beyond)
