"""The loop of a machine: start, rate, failures and stop; in simulated time, and with processes that are killed."""
# ruff: noqa: E501 - one failure a line

from __future__ import annotations

import contextlib
import itertools
import os
import re
import time
import types
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from at_rest import at_rest
from hanging import SimulatedTime
from machine_process import Process

import wbc
from wbc import Command, Measurement
from wbc.base.errors import InputError
from wbc.ground import PointCloud
from wbc.machine import Driver, Runner, RunSettings
from wbc.machine.clock import ask_priority
from wbc.machine.loads import SoleLoads
from wbc.machine.loop import MachineError, Parking
from wbc.machine.report import Phase
from wbc.machine.start import SafeStart
from wbc.sim import Machine, MujocoLoop, Plant

DESCRIPTION = wbc.load_robot("g1")
PERIOD = 0.004
NA = len(DESCRIPTION.joint_names)


@cache
def plant_model() -> mujoco.MjModel:
    return Plant(DESCRIPTION).model


class SimulatedMachine(Driver):
    """A machine in simulated time, on the ground, that can fall silent."""

    def __init__(
        self, clock: SimulatedTime, q: np.ndarray | None = None, *, torques: bool | None = None
    ) -> None:
        self.description = DESCRIPTION
        sensors = None if torques is None else Machine(force_sensors=False, torque_sensors=torques)
        self.loop = MujocoLoop(DESCRIPTION, plant_model(), control_period=PERIOD, machine=sensors)
        if q is not None:
            self.loop.reset(q)
        self.clock, self.commands, self.damped = clock, 0, 0
        self.silent_after = float("inf")
        self._told = -1.0

    def read(self, timeout: float) -> Measurement | None:
        measurement = self.loop.measure()
        if measurement.time <= self._told or self.clock.time - 100.0 > self.silent_after:
            self.clock.time += timeout
            return None
        self._told = measurement.time
        return measurement

    def freeze(self) -> None:
        """Send the same measurement again and again from now on."""
        frozen = self.loop.measure()
        self.read = lambda timeout: replace(frozen)  # type: ignore[method-assign]

    def write(self, command: Command) -> None:
        self.commands += 1
        self.loop.step(command)

    def damp(self) -> None:
        self.damped += 1
        q, zero = self.loop.measure().joint_position, np.zeros(NA)
        self.loop.step(Command(zero, q, zero, kp=zero, kd=0.1 * DESCRIPTION.kd))


def make(machine: SimulatedMachine, control: Any = None, **options: object) -> Runner:
    if control is None:
        control = wbc.TorqueControl(wbc.balance_controller(DESCRIPTION.robot(), PERIOD))
    values = {"fade": 0.2, "blend": 0.2, "stop": 0.2} | options
    settings = RunSettings(**values)  # type: ignore[arg-type]
    return Runner(machine, control, 1.0 / PERIOD, settings=settings, guard=False, clock=machine.clock)


def bent() -> np.ndarray:
    """Standing with knees bent more than at half-sitting, arms elsewhere."""
    joints = {"left_shoulder_pitch_joint": 0.4, "right_elbow_joint": 0.3, "waist_yaw_joint": 0.1}
    for side in ("left", "right"):
        for part, change in (("hip_pitch", -0.15), ("knee", 0.3), ("ankle_pitch", -0.15)):
            name = f"{side}_{part}_joint"
            joints[name] = DESCRIPTION.half_sitting[name] + change
    return DESCRIPTION.robot().configuration(joints)


@pytest.mark.slow
def test_a_robot_goes_from_any_posture_to_the_stand_and_sinks_at_the_end() -> None:
    machine = SimulatedMachine(SimulatedTime(), bent())
    runner = make(machine)
    sent, speeds, heights = commands_by_phase(machine, runner), [], []

    def watch() -> bool:
        speeds.append(np.abs(machine.loop.measure().joint_velocity).max())
        heights.append(machine.loop.truth().com[2])
        return machine.clock.time > 102.5

    report = runner.run(watch)
    assert [phase.name for phase, _ in report.phases] == ["START", "STAND", "RUN", "STOP", "DAMPED"]
    assert report.reason == "stopped" and report.missed == 0 and report.ticks == machine.commands
    first = sent[Phase.START][0]
    assert first.kp is not None and first.kp.max() < 0.05 * DESCRIPTION.kp.max()  # faded in
    assert np.abs(first.joint_torque).max() < 1.0
    assert max(speeds) < 3.0
    com = DESCRIPTION.robot().com
    assert heights[-1] == pytest.approx(com[2], abs=5e-3)  # stands
    assert machine.damped >= 50


def commands_by_phase(machine: SimulatedMachine, runner: Runner) -> dict[Phase, list[Command]]:
    """Commands that a runner sends from now on, by its phase."""
    sent: dict[Phase, list[Command]] = {phase: [] for phase in Phase}
    write = machine.write

    def keep(command: Command) -> None:
        sent[runner.phase].append(command)
        write(command)

    machine.write = keep  # type: ignore[method-assign]
    return sent


def test_joints_of_somebody_else_are_held_where_they_were_let_go_and_never_limp() -> None:
    gains = np.full(NA, 40.0), np.full(NA, 2.0)
    parking, released = Parking(gains), np.arange(NA) > 14
    first, later = np.linspace(0.0, 1.0, NA), np.full(NA, 5.0)
    own = Command(np.full(NA, 3.0), released=released)
    for position in (first, later):
        sent = parking.hold(own, position)
        assert sent.joint_position is not None and sent.kp is not None and sent.kd is not None
        assert (sent.joint_position[released] == first[released]).all() and sent.released is None
        assert (sent.kp[released] == 40.0).all() and not sent.joint_torque[released].any()
        assert (sent.kp[~released] == 0.0).all() and (sent.joint_torque[~released] == 3.0).all()
    assert parking.hold(Command(np.zeros(NA)), later).joint_position is None  # all are taken back
    sent = parking.hold(own, later)
    assert sent.joint_position is not None and (sent.joint_position[released] == 5.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("leaves", [False, True])
def test_a_run_holds_joints_of_somebody_else_unless_the_driver_leaves_them(leaves: bool) -> None:
    machine = SimulatedMachine(SimulatedTime())
    machine.leaves_released = leaves
    control = wbc.TorqueControl(wbc.balance_controller(DESCRIPTION.robot(), PERIOD))
    arm = [name for name in DESCRIPTION.joint_names if "left_elbow" in name or "left_wrist" in name]
    released = control.release(arm)
    assert released is not None
    runner = make(machine, control)
    sent = commands_by_phase(machine, runner)
    runner.run(2.0)
    for command in sent[Phase.RUN][100:]:
        assert (command.released is not None) is leaves
        if not leaves:
            assert command.kp is not None and command.kp[released.index].min() > 0.0
    assert len(sent[Phase.RUN]) > 100


def test_a_stop_holds_the_joints_where_they_are_while_stiffness_and_torques_fall() -> None:
    machine = SimulatedMachine(SimulatedTime(), bent())
    runner = make(machine)
    sent = commands_by_phase(machine, runner)
    runner.run(0.3)  # on the way to half-sitting
    stop, kp = sent[Phase.STOP], machine.description.kp
    assert len(stop) >= 45 and not sent[Phase.HANG] and not sent[Phase.RUN]
    held = stop[0].joint_position
    assert held is not None and np.abs(held - bent()[7:]).max() < 0.1
    assert np.abs(held - DESCRIPTION.robot().half_sitting[7:]).max() > 0.2
    assert all((c.joint_position == held).all() and not np.any(c.joint_velocity) for c in stop)
    assert all((c.kd == machine.description.kd).all() for c in stop)
    shares = np.array([command.kp / kp for command in stop])
    np.testing.assert_allclose(shares, shares[:, :1] * np.ones(NA))
    assert shares[0, 0] > 0.95 and shares[-1, 0] < 0.05 and (np.diff(shares[:, 0]) < 0.0).all()
    assert np.abs(stop[-1].joint_torque).max() < 0.1 * np.abs(stop[0].joint_torque).max()


class Ideal(Driver):
    """A robot on the ground whose joints are at once where they are sent, and whose base leans by a pitch, rad."""

    def __init__(self) -> None:
        self.description, self.clock = DESCRIPTION, SimulatedTime()
        self.robot, self.damped, self._told = DESCRIPTION.robot(), 0, -1.0
        self.q, self.pitch, self.rate = np.array(self.robot.half_sitting[7:]), 0.0, 0.0

    def read(self, timeout: float) -> Measurement | None:
        now = round(self.clock.time / PERIOD) * PERIOD
        if now <= self._told:
            self.clock.time += timeout
            return None
        self.pitch += self.rate * (now - self._told) if self._told > 0.0 else 0.0
        self._told = now
        up = pin.rpy.rpyToMatrix(0.0, self.pitch, 0.0).T @ [0.0, 0.0, 9.80665]
        still = at_rest(self.robot, now - 100.0, joint_position=self.q.copy(), specific_force=up)
        return replace(still, angular_velocity=np.array([0.0, self.rate, 0.0]))

    def write(self, command: Command) -> None:
        if command.joint_position is not None:
            self.q = command.joint_position.copy()

    def damp(self) -> None:
        self.damped += 1


def test_a_controller_takes_over_by_and_by() -> None:
    """From the stand to the controller's own command, here no torque at all."""
    machine = Ideal()
    own = types.SimpleNamespace(command=lambda measurement: Command(np.zeros(NA)))
    runner = make(machine, own, load=0.0, fade=0.02, stop=0.0)  # type: ignore[arg-type]
    sent = commands_by_phase(machine, runner)  # type: ignore[arg-type]
    report = runner.run(lambda: len(sent[Phase.RUN]) == 60)
    assert report.reason == "stopped" and machine.damped == 50
    taken = sent[Phase.RUN]
    blended = [command for command in taken if command.kp is not None]
    assert len(blended) == 50 and all(command.kp is None for command in taken[50:])  # 0.2 s
    damping = [float(command.kd[0]) for command in blended if command.kd is not None]
    np.testing.assert_allclose(np.array(damping) / damping[0], 1.0 - np.arange(50) / 50.0, atol=0.03)


@pytest.mark.parametrize("on_fall", ["damp", "go on"])
def test_a_robot_that_tips_over_under_a_control_of_ones_own_is_damped_unless_it_is_to_go_on(
    on_fall: str,
) -> None:
    machine, zero = Ideal(), np.zeros(NA)
    hold = Command(zero, machine.q.copy(), zero)
    runner = make(
        machine, types.SimpleNamespace(command=lambda _: hold), load=0.0, fade=0.02, stop=0.0, on_fall=on_fall
    )  # type: ignore[arg-type]
    ran = [0]

    def until() -> bool:
        ran[0] += runner.phase is Phase.RUN
        machine.rate = 2.0 if ran[0] > 10 and machine.pitch < 1.2 else 0.0
        return ran[0] > 400

    report = runner.run(until)
    assert report.reason.startswith("the robot has fallen: ") == (on_fall == "damp")
    assert (machine.pitch > 0.5) and (report.reason == "stopped") == (on_fall == "go on")


@pytest.mark.slow
def test_clouds_of_a_driver_reach_a_controller_that_sees_and_trouble_no_other() -> None:
    for sees in (True, False):
        machine, sent, seen = SimulatedMachine(SimulatedTime()), [], []

        def clouds(sent: list[PointCloud] = sent, machine: SimulatedMachine = machine) -> list[PointCloud]:
            sent.append(PointCloud(np.zeros((5, 3)), machine.clock.time, "pelvis"))
            return sent[-1:]

        machine.clouds = clouds  # type: ignore[method-assign]
        control = types.SimpleNamespace(command=lambda measurement: Command(np.zeros(NA)))
        if sees:
            control.see = seen.append
        make(machine, control, load=0.0).run(0.2)
        assert len(sent) > 20
        assert [cloud.time for cloud in seen] == ([cloud.time for cloud in sent] if sees else [])


def test_cameras_that_fail_leave_a_control_blind_and_the_report_says_so(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A time-out, something else than clouds, and a control that refuses what it sees: the run goes on."""
    for wrong in (lambda: 1 / 0, lambda: [PointCloud(np.zeros((5, 3)), 0.0, "pelvis")]):
        caplog.clear()
        machine, asked = SimulatedMachine(SimulatedTime()), []

        def clouds(asked: list[int] = asked, wrong: Callable[[], Any] = wrong) -> Any:
            asked.append(1)
            return wrong() if 20 <= len(asked) < 40 else ()

        machine.clouds = clouds  # type: ignore[method-assign]
        control = types.SimpleNamespace(
            command=lambda measurement: Command(np.zeros(NA)), see=lambda _: 1 / 0
        )
        report = make(machine, control, load=0.0, stop=0.0).run(0.2)
        assert report.reason == "stopped" and len(asked) > 45
        assert report.blind and f"no clouds of points: {report.blind}" in str(report)
        said = [text for text in caplog.messages if "clouds of points" in text]
        assert len(said) == 2 and report.blind in said[0] and "come again" in said[1]


@pytest.mark.slow
@pytest.mark.parametrize("own", [True, False])
def test_a_robot_that_falls_in_a_run_is_damped(own: bool) -> None:
    """Under the library's control, and under one of the user's own that knows nothing of falls."""
    machine = SimulatedMachine(SimulatedTime())
    zero = np.zeros(NA)
    hold = Command(zero, np.array(DESCRIPTION.robot().half_sitting[7:]), zero)
    control = types.SimpleNamespace(command=lambda measurement: hold) if own else None
    runner, heights, damp = make(machine, control, load=0.0), [], machine.damp

    def until() -> bool:
        if runner.phase is Phase.RUN and not machine.pushed:  # type: ignore[attr-defined]
            machine.pushed = True  # type: ignore[attr-defined]
            machine.loop.push("torso_link", (150.0, 0.0, 0.0), 0.2)
        return machine.clock.time > 106.0

    def damped() -> None:
        heights.append(float(machine.loop.truth().com[2]))
        damp()

    machine.damp, machine.pushed = damped, False  # type: ignore[method-assign, attr-defined]
    report = runner.run(until)
    assert report.reason.startswith(("the robot has fallen: ", "the controller has stopped")), report.reason
    assert report.phases[-2][0] is Phase.RUN and heights[0] > 0.15


@pytest.mark.slow
def test_a_control_in_position_mode_stands_on_the_servos_until_it_takes_over_and_hangs_when_lifted() -> None:
    machine = SimulatedMachine(SimulatedTime(), bent())
    runner, read = (
        make(machine, wbc.PositionControl(wbc.balance_controller(DESCRIPTION.robot(), PERIOD))),
        machine.read,
    )

    def lifted(timeout: float) -> Measurement | None:
        """From 1.6 s on the soles feel nothing."""
        measurement = read(timeout)
        late = measurement is not None and machine.clock.time > 101.6
        return replace(measurement, sole_wrench=np.zeros((2, 6))) if late else measurement

    machine.read = lifted  # type: ignore[method-assign]
    sent = commands_by_phase(machine, runner)
    phases = [phase.name for phase, _ in runner.run(2.0).phases]
    assert phases == ["START", "HANG", "STAND", "RUN", "HANG", "STOP", "DAMPED"]
    assert all((command.kp == DESCRIPTION.kp).all() for command in sent[Phase.STAND])


class Stopped(wbc.TorqueControl):
    """A control that has given up."""

    stopped = True  # type: ignore[assignment]


def stopped() -> Stopped:
    control = Stopped(wbc.balance_controller(DESCRIPTION.robot(), PERIOD))
    control.reset = lambda q=None: setattr(control, "reason", "too many failures")  # type: ignore[method-assign]
    return control


ZERO = np.zeros(NA)
ENDS: dict[str, tuple[dict[str, Any] | Callable[[], Any], Callable[[SimulatedMachine, Runner], None] | None, str]] = {
    "silence": ({}, lambda m, _: setattr(m, "silent_after", m.clock.time - 100.0), "no measurement for 1[5-9] ms"),
    "fault": ({}, lambda m, _: setattr(m, "fault", "motor off"), "fault of the machine: motor off$"),
    "emergency stop": ({}, lambda _, r: r.emergency_stop(), "emergency stop$"),
    "repeats": ({}, lambda m, _: m.freeze(), "the machine repeats the same measurement for 1[0-2][0-9] ms$"),
    "exception": ({"command": lambda _: 1 / 0}, None, "ZeroDivisionError of the controller: "),
    "stopped": (stopped, None, "the controller has stopped: too many failures"),
    "no command": ({"command": lambda _: 5}, None, "InputError of the controller: .*Command, got 5$"),
    "NaN": ({"command": lambda _: Command(ZERO * np.nan)}, None, "InputError of the controller: .*joint_torque of joint 'left_hip_pitch_joint' is not finite"),
}  # fmt: skip
"""Name → another control, or its parts, what happens in tick 20, and the reason of the end."""


@pytest.mark.parametrize(
    "end",
    [
        pytest.param(e, marks=() if e in ("silence", "exception", "repeats") else pytest.mark.slow)
        for e in ENDS
    ],
)
def test_whatever_fails_ends_in_damping(end: str) -> None:
    machine, (parts, happens, reason) = SimulatedMachine(SimulatedTime()), ENDS[end]
    runner = make(
        machine, parts() if callable(parts) else types.SimpleNamespace(**parts) if parts else None, load=0.0
    )
    sent = commands_by_phase(machine, runner)

    def until() -> bool:
        if happens is not None and runner.ticks == 20:
            happens(machine, runner)
        return machine.clock.time > 105.0

    report = runner.run(until)
    assert report.phases[-1][0] is Phase.DAMPED and re.match(reason, report.reason), report.reason
    most = 0.1 / PERIOD if end == "repeats" else 4
    assert machine.damped >= 50 and (happens is None or machine.commands <= 21 + most)
    assert all(np.isfinite(c.joint_torque).all() for commands in sent.values() for c in commands)
    with pytest.raises(InputError, match="Runner"):
        runner.run(1.0)


@pytest.mark.parametrize("fails", [3, 10**9], ids=["for a while", "always"])
def test_damping_that_fails_is_tried_again_and_the_guard_damps_meanwhile(fails: int) -> None:
    machine, said = SimulatedMachine(SimulatedTime()), list[str]()
    damp, left = machine.damp, [fails]

    def failing() -> None:
        left[0] -= 1
        if left[0] >= 0:
            raise OSError("the network is unreachable")
        damp()

    machine.damp = failing  # type: ignore[method-assign]
    runner = make(machine, types.SimpleNamespace(command=lambda _: 1 / 0), load=0.0)
    runner._guard = types.SimpleNamespace(  # type: ignore[assignment]
        beat=lambda: said.append("beat"),
        alarm=lambda: said.append("alarm"),
        close=lambda: said.append("close"),
    )
    runner._make_guard = lambda: runner._guard  # type: ignore[method-assign]
    if fails > 3:
        with pytest.raises(MachineError, match="0 of 50 commands .*unreachable"):
            runner.run(1.0)
        assert said[-100:] == [*["alarm"] * 99, "close"] and 10**9 - left[0] > 1000
        return
    assert "ZeroDivisionError" in runner.run(1.0).reason
    assert machine.damped == 50 and said[-54:] == [*["alarm"] * 3, *["beat"] * 50, "close"]


@pytest.mark.parametrize("gains", ["stiff", (ZERO[:3], ZERO[:3]), (ZERO * np.nan, ZERO), (ZERO,)])
def test_gains_of_a_driver_that_are_none_are_refused_and_the_joints_damped(gains: Any) -> None:
    machine = SimulatedMachine(SimulatedTime())
    machine.gains = gains
    with pytest.raises(InputError, match="gains of a driver"):
        make(machine).run(1.0)
    assert machine.damped == 50 and machine.commands == 0


def test_a_measurement_that_is_refused_leaves_the_last_command_as_it_is() -> None:
    """For a few ticks on the way to half-sitting; then the motion goes on where it would be."""
    machine = SimulatedMachine(SimulatedTime(), bent())
    read, ticks = machine.read, [0]

    def broken(timeout: float) -> Measurement | None:
        measurement = read(timeout)
        if measurement is None:
            return None
        ticks[0] += 1
        bad = np.full(NA - 1, 0.0)
        return replace(measurement, joint_position=bad) if 30 <= ticks[0] < 35 else measurement

    machine.read = broken  # type: ignore[method-assign]
    runner = make(machine, stop=0.0)
    sent = commands_by_phase(machine, runner)
    runner.run(0.3)
    start = sent[Phase.START]
    same = [one is other for one, other in itertools.pairwise(start)]
    assert sum(same) == 5 and same[same.index(True) : same.index(True) + 5] == [True] * 5
    stiff = np.array([command.kp.max() for command in start if command.kp is not None]) / DESCRIPTION.kp.max()
    first = same.index(True)
    assert stiff[first + 6] - stiff[first] == pytest.approx(6 * PERIOD / 0.2, rel=0.2)


def test_a_tick_that_takes_too_long_is_counted_and_not_caught_up_with() -> None:
    """Ticks go on at their own times: the next one at the first that has not passed."""
    machine = SimulatedMachine(SimulatedTime())
    read = machine.read
    machine.read = lambda timeout: replace(read(timeout) or machine.loop.measure())  # type: ignore[method-assign]
    runner = make(machine, stop=0.0)
    begins: list[float] = []
    extra = dict(zip((5, 10, 15), (0.5, 1.4, 2.6), strict=True))  # periods

    def slow() -> bool:
        begins.append(machine.clock.time)
        machine.clock.time += extra.get(len(begins), 0.0) * PERIOD
        return len(begins) == 20

    report = runner.run(slow)
    assert (report.missed, report.skipped, report.ticks) == (2, 3, 20)
    assert f"{report.ticks} ticks of 4 ms" in str(report)
    steps, expected, busy = np.diff(begins) / PERIOD, np.ones(19), np.zeros(20)
    expected[[9, 14]] = 2.0, 3.0
    busy[[4, 9, 14]] = PERIOD * np.array(list(extra.values()))
    assert steps == pytest.approx(expected) and report.busy == pytest.approx(busy) and not report.late.any()


def test_a_machine_that_sends_nothing_of_this_robot_is_not_started() -> None:
    silent, other, dead = (SimulatedMachine(SimulatedTime()) for _ in range(3))
    silent.silent_after = -1.0
    other.description = wbc.load_robot("hrp4_class")
    bad = replace(dead.loop.measure(), joint_position=np.full(NA, np.nan))
    dead.read = lambda timeout: bad  # type: ignore[method-assign]
    for machine, words in (
        (silent, "no measurement from the machine within 0.5 s"),
        (other, r"has 29 joints, 'hrp4_class' has 34"),
        (dead, "no measurement that can be used within 0.5 s: encoder of "),
    ):
        with pytest.raises(MachineError, match=words):
            make(machine, first=0.5).run(1.0)


# ---- processes that are killed ---------------------------------------------------------------------------------------


@pytest.fixture
def processes() -> Iterator[contextlib.ExitStack]:
    with contextlib.ExitStack() as stack:
        yield stack


TIMEOUT = 0.015
"""Longest silence of either side, s, where the processes may ask for the real-time scheduler."""

PROMISED = 0.020
"""Time from the death of either side to damping, s."""

BUSY_TIMEOUT = 1.0
"""Longest silence where the processes wait for other programs, s: nothing is promised there but that damping comes."""

ATTEMPTS = 6
"""A machine may take the processors away from any program, a virtual one above all: one attempt must be in time."""


def promised() -> bool:
    """Return True if this process may ask for the real-time scheduler."""
    if not ask_priority(60):
        return False
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return True


def in_time(attempt: Callable[[float], float]) -> None:
    """Run an attempt, given the longest silence, until it takes no longer than promised; it returns its time, s."""
    times: list[float] = []
    timeout = TIMEOUT if promised() else BUSY_TIMEOUT
    while len(times) < (ATTEMPTS if promised() else 1):
        times.append(attempt(timeout))
        print(f"damped after {1e3 * times[-1]:.1f} ms")
        if times[-1] < PROMISED:
            break
    assert min(times) < (PROMISED if promised() else float("inf")), times


def drive(processes: contextlib.ExitStack, watchdog: float, timeout: float) -> tuple[Process, Process]:
    """Return a robot and a controller that drives it, in processes of their own."""
    for _ in range(2 * ATTEMPTS):
        robot = processes.enter_context(Process("robot", str(watchdog)))
        control = processes.enter_context(Process("control", robot.line("port")[1], str(timeout)))
        if control.line("runs", "ended")[0] == "runs":
            return robot, control
        processes.close()  # deadlines were missed before it ran
    raise AssertionError("no control that runs")


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("killed", ["controller", "guarded controller", "robot"])
def test_a_process_that_is_killed_leaves_a_damped_robot(processes: contextlib.ExitStack, killed: str) -> None:
    """By the robot's own watchdog; without one by the guard that outlives the controller; by the controller."""

    def attempt(timeout: float) -> float:
        robot, control = drive(processes, 100.0 if "guarded" in killed else timeout, timeout)
        time.sleep(0.5)
        if killed == "robot":
            robot.kill_now()
            return 1e-3 * float(control.line("ended")[2].split("no measurement for ")[1].split()[0])
        if control.poll() is not None:  # it has missed its deadline before: there is nothing to kill
            processes.close()
            return float("inf")
        begin = control.kill_now()
        while (damped := float(robot.line("damped")[1])) < begin:
            pass
        processes.close()
        return damped - begin

    in_time(attempt)


# ---- start and guard ------------------------------------------------------------------------------------------------


@cache
def standing() -> Measurement:
    """Measurement of a robot that stands on its servos, with the torques of its drives."""
    plant = Plant(DESCRIPTION, control_period=PERIOD, machine=Machine(torque_sensors=True))
    for _ in range(150):
        plant.step(plant.hold())
    return plant.measure()


def test_torques_of_the_start_carry_the_limbs_less_what_the_soles_press() -> None:
    """Those of a robot that stands, but for what its soles do besides pressing."""
    measurement, gains, robot = standing(), (DESCRIPTION.kp, DESCRIPTION.kd), DESCRIPTION.robot()
    loads = SoleLoads(DESCRIPTION, PERIOD, gains)
    for i in range(500):
        loads.wrenches(replace(measurement, time=PERIOD * i))
    assert measurement.joint_torque is not None and np.abs(measurement.joint_torque).max() > 10.0
    wanted = np.array(measurement.joint_torque)
    q = loads.posture(measurement)
    for sole, wrench in zip(robot.soles, measurement.wrenches, strict=True):
        jacobian = pin.computeFrameJacobian(robot.model, robot.data, q, robot.frame_id(sole.frame), pin.LOCAL)
        wanted += (wrench * [1.0, 1.0, 0.0, 1.0, 1.0, 1.0]) @ jacobian[:, 6:]
    start = SafeStart(robot, measurement, loads, fade=0.2, speed=1.0, gains=gains)
    np.testing.assert_allclose(start.carry(replace(measurement, time=2.0)), wanted, atol=2.0)


def test_a_stop_starts_from_loads_and_attitude_of_its_own_time() -> None:
    """After a long run on both feet the right one is in the air and the trunk leans: by measurements, and by an observer."""
    gains, robot = (DESCRIPTION.kp, DESCRIPTION.kd), DESCRIPTION.robot()
    weight, still = robot.mass * 9.80665, np.zeros(NA)

    def measured(time: float, left: float, pitch: float) -> Measurement:
        wrench = np.zeros((2, 6))
        wrench[:, 2] = left * weight, (1.0 - left) * weight
        up = 9.80665 * np.array([-np.sin(pitch), 0.0, np.cos(pitch)])
        return Measurement(time, robot.half_sitting[7:].copy(), still, np.zeros(3), up, wrench)

    for observed in (False, True):
        loads = SoleLoads(DESCRIPTION, PERIOD, gains)
        for i in range(300):
            loads.wrenches(measured(PERIOD * i, 0.5, 0.0))
        stop = measured(9.0, 1.0, 0.2)
        if observed:
            q = np.array(robot.half_sitting)
            q[3:7] = [0.0, np.sin(0.1), 0.0, np.cos(0.1)]
            loads.adopt(stop.time, q, np.zeros(robot.nv), np.array([weight, 0.0]))
        for i in range(3):
            loads.wrenches(replace(stop, time=9.0 + PERIOD * i))
        np.testing.assert_allclose(loads.normal, [weight, 0.0], atol=1.0)
        np.testing.assert_allclose(loads.posture(stop)[3:7], [0.0, np.sin(0.1), 0.0, np.cos(0.1)], atol=1e-3)
