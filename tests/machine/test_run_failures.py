"""Runs that fail: whatever fails ends in damping, and a process that is killed leaves a damped robot."""
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
from typing import Any

import numpy as np
import pytest
from machine_process import Process
from own_control import OwnControl
from simulated_machine import (
    DESCRIPTION,
    NA,
    PERIOD,
    Ideal,
    bent,
    commands_by_phase,
    make,
)

import wbc
from wbc import Command, Measurement
from wbc.base.errors import InputError
from wbc.machine import Runner
from wbc.machine.clock import ask_priority
from wbc.machine.loop import MachineError
from wbc.machine.report import Phase


class Stopped(wbc.TorqueControl):
    """A control that has given up."""

    stopped = True  # type: ignore[assignment]
    reason = "too many failures"  # type: ignore[assignment]


def stopped() -> Stopped:
    return Stopped(wbc.balance_controller(DESCRIPTION.robot(), PERIOD))


ZERO = np.zeros(NA)
ENDS: dict[str, tuple[dict[str, Any] | Callable[[], Any], Callable[[Ideal, Runner], None] | None, str]] = {
    "silence": ({}, lambda m, _: setattr(m, "silent_after", m.clock.time - 100.0), "no measurement for 1[5-9] ms"),
    "fault": ({}, lambda m, _: setattr(m, "fault", "motor off"), "fault of the machine: motor off$"),
    "emergency stop": ({}, lambda _, r: r.emergency_stop(), "emergency stop$"),
    "repeats": ({}, lambda m, _: m.freeze(), "the machine repeats the same measurement for 1[0-2][0-9] ms$"),
    "exception": ({"command": lambda _: 1 / 0}, None, "ZeroDivisionError of the controller: "),
    "stopped": (stopped, None, "the controller has stopped: too many failures"),
    "no command": ({"command": lambda _: 5}, None, "InputError of the controller: .*Command, got 5$"),
    "released": ({"command": lambda _: Command(ZERO, released=np.ones(3, dtype=bool))}, None, "InputError of the controller: released of a command must be truth values"),
    "NaN": ({"command": lambda _: Command(ZERO * np.nan)}, None, "InputError of the controller: .*joint_torque of joint 'left_hip_pitch_joint' must be a finite number"),
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
    machine, (parts, happens, reason) = Ideal(), ENDS[end]
    runner = make(machine, parts() if callable(parts) else OwnControl(**parts) if parts else None, load=0.0)
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
    machine, said = Ideal(), list[str]()
    damp, left = machine.damp, [fails]

    def failing() -> None:
        left[0] -= 1
        if left[0] >= 0:
            raise OSError("the network is unreachable")
        damp()

    machine.damp = failing  # type: ignore[method-assign]
    runner = make(machine, OwnControl(lambda _: 1 / 0), load=0.0)
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
    machine = Ideal()
    machine.gains = gains
    with pytest.raises(InputError, match="gains of a driver"):
        make(machine).run(1.0)
    assert machine.damped == 50 and machine.commands == 0


def test_a_measurement_that_is_refused_leaves_the_last_command_as_it_is() -> None:
    """For a few ticks on the way to half-sitting; then the motion goes on where it would be."""
    machine = Ideal(bent())
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
    machine = Ideal()
    read = machine.read
    machine.read = lambda timeout: replace(read(timeout) or machine.measure())  # type: ignore[method-assign]
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
    silent, other, dead = (Ideal() for _ in range(3))
    silent.silent_after = -1.0
    other.description = wbc.load_robot("hrp4_class")
    bad = replace(dead.measure(), joint_position=np.full(NA, np.nan))
    dead.read = lambda timeout: bad  # type: ignore[method-assign]
    for machine, words in (
        (silent, "no measurement from the machine within 0.5 s"),
        (other, r"used within 0.5 s: joint_position must have shape \(34,\), got \(29,\)"),
        (dead, "no measurement that can be used within 0.5 s: encoder of "),
    ):
        with pytest.raises(MachineError, match=words):
            balance = wbc.balance_controller(machine.description.robot(), PERIOD)
            make(machine, wbc.TorqueControl(balance), first=0.5).run(1.0)


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
