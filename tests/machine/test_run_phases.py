"""Phases of a run, by a machine that stands still and is told how much its soles carry; in simulated time."""

from __future__ import annotations

import itertools
import logging
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hanging import SimulatedTime
from own_control import OwnControl

import wbc
from wbc import Command, Measurement
from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY
from wbc.machine import Driver, Runner, RunSettings
from wbc.machine.inlet import Inlet
from wbc.machine.loads import SoleLoads
from wbc.machine.loop import MachineError
from wbc.machine.report import Phase, RunReport
from wbc.walking import WalkingControl, WalkingControlSettings

DESCRIPTION = wbc.load_robot("g1")
ROBOT = DESCRIPTION.robot()
PERIOD = 0.01


class StillMachine(Driver):
    """A robot at half-sitting whose soles feel a share of its weight, as a function of the time, s."""

    def __init__(self, share: Callable[[float], float]) -> None:
        self.description, self.clock = DESCRIPTION, SimulatedTime()
        self.begin, self.share, self.damped = self.clock.time, share, 0
        self.sent: list[Command] = []
        self._told = -1.0
        self._up = ROBOT.placement(ROBOT.imu_frame).rotation.T @ [0.0, 0.0, GRAVITY]
        self.change: Callable[[Measurement], Measurement] = lambda m: m

    @property
    def now(self) -> float:
        return self.clock.time - self.begin

    def read(self, timeout: float) -> Measurement | None:
        if self.now <= self._told:
            self.clock.time += timeout
            return None
        self._told = self.now
        wrench = np.zeros((2, 6))
        wrench[:, 2] = 0.5 * self.share(self.now) * ROBOT.mass * GRAVITY
        rest = ROBOT.half_sitting[7:].copy()
        return self.change(Measurement(self.now, rest, np.zeros(ROBOT.na), np.zeros(3), self._up, wrench))

    def write(self, command: Command) -> None:
        self.sent.append(command)

    def damp(self) -> None:
        self.damped += 1


def runner_of(machine: StillMachine, control: Any = None, **options: float) -> Runner:
    if control is None:
        control = wbc.PositionControl(wbc.balance_controller(DESCRIPTION.robot(), PERIOD))
    settings = RunSettings(**{"fade": 0.2, "blend": 0.2, "stop": 0.1} | options)  # type: ignore[arg-type]
    return Runner(machine, control, 1.0 / PERIOD, settings=settings, guard=False, clock=machine.clock)


def begun(report: RunReport) -> list[tuple[str, float]]:
    return [(phase.name, round(time, 6)) for phase, time in report.phases]


def test_phases_begin_when_the_feet_touch_carry_and_are_lifted() -> None:
    """From 1 s on a fifth of the weight, from 1.4 s on all of it, from 2.2 s on none: each must last for its time."""

    def share(time: float) -> float:
        return 0.0 if time < 1.0 or time > 2.2 else 0.2 if time < 1.4 else 1.0

    machine = StillMachine(share)
    phases = begun(runner_of(machine).run(2.6))
    assert [name for name, _ in phases] == ["START", "HANG", "STAND", "RUN", "HANG", "STOP", "DAMPED"]
    start, hang, stand, run, again, stop, damped = (time for _, time in phases)
    assert (start, hang) == (
        0.0,
        pytest.approx(0.7),
    )  # 0.2 s of stiffness, and half a second at least to get there
    assert 1.05 <= stand <= 1.25 and 1.7 <= run <= 1.85  # for 0.05 s and 0.3 s, after the loads are smoothed
    assert again == pytest.approx(2.41, abs=0.011)  # for 0.2 s
    assert stop == pytest.approx(2.61, abs=0.011) and damped == pytest.approx(stop + 0.1, abs=0.011)
    assert machine.damped >= 50


@pytest.mark.parametrize(
    ("load", "touch", "reached"), [(0.9, 0.15, "RUN"), (0.1, 0.08, "STAND"), (0.1, 0.5, "HANG")]
)
def test_a_phase_is_left_at_its_share_of_the_weight(load: float, touch: float, reached: str) -> None:
    machine = StillMachine(lambda time: load)
    phases = begun(runner_of(machine, touch=touch).run(1.8))
    assert phases[-3][0] == reached


def test_a_robot_that_is_lifted_before_it_stands_hangs_again() -> None:
    """0.2 s after it carries less than a third of a touch."""

    def share(time: float) -> float:
        return 0.3 if 1.2 < time < 1.5 else 0.0

    phases = begun(runner_of(StillMachine(share)).run(2.1))
    assert [name for name, _ in phases] == ["START", "HANG", "STAND", "HANG", "STOP", "DAMPED"]
    assert phases[2][1] > 1.25 and 1.7 <= phases[3][1] <= 1.95


def test_a_robot_must_carry_itself_for_a_time_however_long_it_has_hung(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its feet touch from 1 s on, carry nothing from 1.2 s on, and all of it from one tick to the next at 1.38 s."""

    def share(_: object) -> float:
        return 0.0 if machine.now < 1.0 or 1.2 < machine.now < 1.38 else 0.2 if machine.now < 1.2 else 1.0

    machine = StillMachine(lambda time: 1.0)
    monkeypatch.setattr(SoleLoads, "share", property(share))
    phases = begun(runner_of(machine).run(1.8))
    assert [name for name, _ in phases] == ["START", "HANG", "STAND", "RUN", "STOP", "DAMPED"]
    assert phases[3][1] == pytest.approx(1.38 + 0.3, abs=0.011)


@pytest.mark.parametrize("until", [1.2, 9.0])
def test_a_machine_that_is_slower_than_its_stamps_hangs_until_it_keeps_up(
    monkeypatch: pytest.MonkeyPatch, until: float
) -> None:
    machine = StillMachine(lambda time: 1.0)
    monkeypatch.setattr(Inlet, "pace", property(lambda _: 0.5 if machine.now < until else 1.0))
    report = runner_of(machine).run(1.4)
    phases = begun(report)
    if until > 2.0:
        assert report.reason == "stopped; the machine runs at 0.5 of real time"
        assert [name for name, _ in phases] == ["START", "HANG", "STOP", "DAMPED"]
    else:
        assert [name for name, _ in phases[:3]] == ["START", "HANG", "STAND"] and 1.2 < phases[2][1] < 1.4


def test_measurements_that_stay_refused_end_the_run_with_their_time_and_reason() -> None:
    machine = StillMachine(lambda time: 1.0)
    runner = runner_of(machine)

    def until() -> bool:
        if machine.now > 0.3:
            machine.change = lambda m: Measurement(
                m.time,
                m.joint_position[:-1],
                m.joint_velocity,
                m.angular_velocity,
                m.specific_force,
                m.sole_wrench,
            )
        return False

    report = runner.run(until)
    assert report.reason.startswith("measurements refused for 100 ms: ") and "joint_position" in report.reason
    assert report.phases[-1][1] == pytest.approx(0.42, abs=0.021)


def test_the_rate_is_that_of_the_controller_and_timeouts_are_longer_than_a_period() -> None:
    machine = StillMachine(lambda time: 1.0)
    control = wbc.PositionControl(wbc.balance_controller(DESCRIPTION.robot(), 0.004))
    with pytest.raises(InputError, match=r"made for .*\(250 Hz\), its loop has .*\(100 Hz\)"):
        Runner(machine, control, 100.0, guard=False)
    own = OwnControl()
    for timeout, good in ((0.0101, True), (0.01, False), (0.009, False)):
        for name in ("robot_timeout", "control_timeout"):
            settings = RunSettings(**{name: timeout})  # type: ignore[arg-type]
            if good:
                Runner(machine, own, 100.0, settings=settings, guard=False)  # type: ignore[arg-type]
                continue
            with pytest.raises(InputError, match=r"100 Hz, 0\.01 s a period"):
                Runner(machine, own, 100.0, settings=settings, guard=False)  # type: ignore[arg-type]


def test_a_robot_whose_controller_does_not_begin_is_balanced_on() -> None:
    """A walk refuses to begin with its feet far from its references, for example."""

    class Refusing(wbc.TorqueControl):
        def reset(self, q: Any = None) -> None:
            if q is not None:
                raise InputError("not from here")
            super().reset()

    control = Refusing(wbc.balance_controller(DESCRIPTION.robot(), PERIOD))
    report = runner_of(StillMachine(lambda time: 1.0), control).run(2.5)
    phases = [name for name, _ in begun(report)]
    assert phases[-3:] == ["STAND", "STOP", "DAMPED"] and "RUN" not in phases
    assert report.reason == "stopped"


def test_a_control_begins_anew_whenever_its_run_does(caplog: pytest.LogCaptureFixture) -> None:
    """Otherwise it would go on from where it was lifted, with the estimate of then; so it does in a second run."""
    begins: list[float] = []

    class Noted(wbc.PositionControl):
        def reset(self, q: Any = None) -> None:
            begins.append(machine.now)
            super().reset(q)

    machine = StillMachine(lambda time: 0.0 if 1.6 < time < 2.0 else 1.0)
    control = Noted(wbc.balance_controller(DESCRIPTION.robot(), PERIOD))
    report = runner_of(machine, control).run(3.2)
    runs = [time for phase, time in report.phases if phase is Phase.RUN]
    assert len(runs) == 2 and begins[-2:] == pytest.approx(runs) and control.failures == 0
    first, machine = machine, StillMachine(lambda time: 1.0)
    caplog.clear()
    runner_of(machine, control).run(1.3)
    assert not [record for record in caplog.records if record.levelno >= logging.WARNING]
    np.testing.assert_allclose(machine.sent[125].joint_torque, first.sent[125].joint_torque, atol=1e-9)


def test_a_control_of_another_robot_and_a_robot_without_feet_are_refused_before_a_machine_moves() -> None:
    machine, other = StillMachine(lambda time: 1.0), wbc.load_robot("hrp4_class")
    with pytest.raises(InputError, match=r"hrp4_class.* machine is .*g1"):
        runner_of(machine, wbc.TorqueControl(wbc.balance_controller(other.robot(), PERIOD)))
    machine.description = wbc.load_robot("panda")
    with pytest.raises(InputError, match="two feet"):
        runner_of(machine, OwnControl(lambda measurement: Command(np.zeros(9))))


@pytest.mark.parametrize("mode", ["position", "torque"])
def test_a_walk_that_has_walked_is_refused_before_a_machine_moves(mode: str) -> None:
    machine = StillMachine(lambda now: 0.0)
    walk = WalkingControl(DESCRIPTION.robot(), None, PERIOD, WalkingControlSettings(mode=mode))  # type: ignore[arg-type]
    runner_of(machine, walk)
    walk.command(Measurement.resting(ROBOT))
    with pytest.raises(InputError, match="cannot begin anew"):
        runner_of(machine, walk)
    assert not machine.sent


def test_a_machine_of_which_nothing_is_heard_is_not_started() -> None:
    machine = StillMachine(lambda time: 1.0)
    machine.read = lambda timeout: setattr(machine.clock, "time", machine.clock.time + timeout)  # type: ignore
    runner = runner_of(machine, first=0.7)
    with pytest.raises(MachineError, match="from the machine within 0.7 s$"):
        runner.run(1.0)
    assert (
        machine.now == pytest.approx(0.7 + 50 * 0.002, abs=0.011)
        and machine.damped == 50
        and not machine.sent
    )


def test_a_message_that_is_late_is_waited_for_a_period_and_up_to_the_time_out() -> None:
    """Whatever comes is the beat of the loop; after the last one it is a period and what is left of the time-out."""
    machine = StillMachine(lambda time: 1.0)
    runner = runner_of(machine, robot_timeout=0.025)
    heard, waited, read = [], [], machine.read

    def listen(timeout: float) -> Measurement | None:
        if machine.now > 0.305:
            waited.append(timeout)
            machine.clock.time += timeout
            return None
        if timeout == 0.0 and machine.now < 0.2:  # it comes 3 ms after the loop has looked for it
            return None
        machine.clock.time += 0.003 * (machine.now < 0.2)
        got = read(timeout)
        if got is not None:
            heard.append(machine.now)
        return got

    machine.read = listen  # type: ignore[method-assign]
    report = runner.run(1.0)
    assert report.reason == "no measurement for 25 ms"
    first = heard[0]
    assert (
        report.ages == pytest.approx(max(b - a for a, b in itertools.pairwise(heard))) == pytest.approx(0.013)
    )
    early = [b - a for a, b in itertools.pairwise(heard) if b < 0.2]
    assert first == pytest.approx(0.003) and len(early) > 10
    assert early[1:] == pytest.approx([0.013] * len(early[1:]))  # a period after the last one came, and 3 ms
    assert [t for t in waited if t > 0.0] == pytest.approx([0.01, 0.005], abs=1e-9)


@pytest.mark.parametrize("leaves", [False, True])
def test_released_joints_are_held_where_they_are_unless_the_driver_sends_nothing_to_them(
    leaves: bool,
) -> None:
    machine = StillMachine(lambda time: 1.0)
    machine.leaves_released = leaves
    released = np.arange(ROBOT.na) > 20
    own = Command(np.full(ROBOT.na, 1.0), released=released)
    runner = runner_of(machine, OwnControl(lambda measurement: own), load=0.0)
    runner.run(1.7)
    last = [command for command in machine.sent if command.kp is None or command.kp[0] == 0.0][-1]
    assert runner._phases.begun[-3][0] is Phase.RUN
    if leaves:
        assert last.released is not None and (last.released == released).all() and last.kp is None
        return
    assert last.released is None and last.kp is not None and last.joint_position is not None
    assert (last.joint_position[released] == ROBOT.half_sitting[7:][released]).all()
    assert (last.kp[released] == np.array(DESCRIPTION.kp)[released]).all() and not last.kp[~released].any()
    assert not last.joint_torque[released].any() and (last.joint_torque[~released] == 1.0).all()
