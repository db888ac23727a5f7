"""Deadlines, what a loop costs the system, and the guard's heart, on clocks that are made up."""

from __future__ import annotations

import io
import mmap
import os
import pickle
import time
import types
from typing import Any

import numpy as np
import pytest

from wbc.machine import clock, guard
from wbc.machine.guard import BEAT, DAMP_PERIOD, watch
from wbc.machine.loop import MachineError
from wbc.machine.report import RunReport


def test_the_guard_goes_on_when_a_damping_command_fails() -> None:
    memory, tries = mmap.mmap(-1, mmap.PAGESIZE), []

    def damp() -> None:
        tries.append(BEAT.unpack_from(memory, 0)[1])
        if len(tries) == 5:
            BEAT.pack_into(memory, 0, 0.0, -1.0)  # the loop ends
        raise OSError("the network is unreachable")

    BEAT.pack_into(memory, 0, -np.inf, 0.015)
    watch(types.SimpleNamespace(damp=damp), memory, os.getppid())
    assert tries == [0.015] * 5


def test_the_guard_damps_at_the_moment_at_which_a_beat_is_too_old(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beats move that moment on; between two looks the guard sleeps until it."""
    memory, now, damped = mmap.mmap(-1, mmap.PAGESIZE), [5.0], list[float]()

    def sleep(seconds: float) -> None:
        now[0] += seconds + 1e-6  # never too early
        if now[0] < 5.05:  # the loop lives
            BEAT.pack_into(memory, 0, now[0] - 0.001, 0.015)

    def damp() -> None:
        damped.append(now[0])
        if len(damped) == 3:
            BEAT.pack_into(memory, 0, 0.0, -1.0)

    monkeypatch.setattr(guard.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(guard.time, "sleep", sleep)
    BEAT.pack_into(memory, 0, 5.0, 0.015)
    watch(types.SimpleNamespace(damp=damp), memory, os.getppid())
    # Beats at 5.000, 5.014, 5.028 and 5.042 s.
    assert damped == pytest.approx(5.042 + 0.015 + DAMP_PERIOD * np.arange(3), abs=1e-4)


def test_a_clock_sleeps_until_shortly_before_an_instant_and_never_too_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now, slept = [7.0], list[float]()

    def sleep(seconds: float) -> None:
        slept.append(seconds)
        now[0] += seconds

    def monotonic() -> float:
        now[0] += 1e-5  # each look takes time
        return now[0]

    monkeypatch.setattr(clock.time, "monotonic", monotonic)
    monkeypatch.setattr(clock.time, "sleep", sleep)
    for deadline in (7.1, 7.2, 7.05):
        clock.Clock().sleep_until(deadline)
        assert max(deadline, 7.1) <= now[0] < max(deadline, 7.2) + 1e-4
    assert slept == pytest.approx([0.1 - clock.SPIN, 0.1 - clock.SPIN], abs=1e-4)


class Child:
    """A process of the guard that says a line."""

    def __init__(self, says: bytes) -> None:
        self.stdin, self.stdout, self.ended = io.BytesIO(), io.BytesIO(says), 0
        self.given: tuple[str, ...] = ()

    def __call__(self, command: tuple[str, ...], **options: object) -> Child:
        self.given = (*command, *map(str, options["pass_fds"]))  # type: ignore[call-overload]
        return self

    def wait(self, timeout: float) -> None:
        self.ended += 1

    def __enter__(self) -> None: ...

    def __exit__(self, *error: object) -> None: ...


def test_a_guard_gets_the_driver_and_the_number_of_its_loop_and_sees_beats_alarms_and_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    child = Child(guard.WATCHING)
    monkeypatch.setattr(guard.subprocess, "Popen", child)
    driver = types.SimpleNamespace(name="drives")
    made = guard.Guard(driver, 0.015, 7)  # type: ignore[arg-type]
    assert pickle.loads(child.stdin.getvalue()) == driver
    *_, memory, priority, parent, passed = child.given
    assert (priority, parent) == ("7", str(os.getpid())) and memory == passed
    seen = mmap.mmap(os.dup(int(memory)), mmap.PAGESIZE)
    assert BEAT.unpack_from(seen, 0) == (0.0, 0.0)
    before = time.monotonic()
    made.beat()
    beat, age = BEAT.unpack_from(seen, 0)
    assert before <= beat <= time.monotonic() and age == 0.015
    made.alarm()
    assert BEAT.unpack_from(seen, 0) == (-np.inf, 0.015)
    made.close()
    assert BEAT.unpack_from(seen, 0)[1] == -1.0 and child.ended == 1
    seen.close()
    for says in (b"", b"Traceback\n", b"watching"):
        monkeypatch.setattr(guard.subprocess, "Popen", child := Child(says))
        with pytest.raises(MachineError, match="SimpleNamespace"):
            guard.Guard(driver, 0.015)  # type: ignore[arg-type]
        assert child.given[-3] == "0" and child.ended == 1
    with pytest.raises(MachineError, match="pickled"):
        guard.Guard(lambda: None, 0.015)  # type: ignore[arg-type]


def test_a_report_counts_ticks_in_classes_of_their_times() -> None:
    """Ends of classes in ms; what is beyond the last one is in a class without an end; the text has the totals."""
    late, busy = np.array([0.0, 0.04, 0.06, 3.0, 250.0]) * 1e-3, np.array([0.6, 0.7, 0.8, 0.9, 15.0]) * 1e-3
    got = clock.Quiet(memory_locked=True, priority=50, page_faults=(7, 900))
    report = RunReport(0.002, "stopped", (), 5, 4, 6, late, busy, 0.0123, got)
    counts = report.histogram()
    assert counts["late"] == [2, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] and sum(counts["busy"]) == 5
    assert counts["busy"] == [0, 0, 0, 0, 4, 0, 0, 0, 1, 0, 0, 0]
    lines = str(report).splitlines()
    assert lines[0] == "stopped after 5 ticks of 2 ms"
    assert "missed: 4, periods skipped: 6" in lines[1] and "12.3 ms" in lines[1]
    assert "locked: yes" in lines[2] and "priority: 50" in lines[2] and "disk 7" in lines[2]
    assert lines[4].split() == ["0.05", "2", "0"] and lines[-1].split() == ["inf", "1", "0"]
    assert not any("clouds" in line for line in lines)
    blind = RunReport(0.002, "stopped", (), 5, 4, 6, late, busy, blind="no camera")
    assert "no clouds of points: no camera" in str(blind) and "locked: no" in str(blind)


def test_a_priority_is_asked_for_above_zero_where_the_system_has_a_real_time_scheduler(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[tuple[int, int, int]] = []
    monkeypatch.setattr(os, "SCHED_FIFO", 1, raising=False)
    monkeypatch.setattr(os, "sched_param", lambda priority: priority, raising=False)
    monkeypatch.setattr(os, "sched_setscheduler", lambda *given: asked.append(given), raising=False)
    for priority, got in ((0, 0), (-3, 0), (1, 1), (99, 99)):
        assert clock.ask_priority(priority) == got
    assert asked == [(0, 1, 1), (0, 1, 99)]

    def refused(*given: int) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refused)
    assert clock.ask_priority(5) == 0
    monkeypatch.delattr(os, "sched_setscheduler")
    assert clock.ask_priority(5) == clock.ask_priority(0) == 0


@pytest.mark.parametrize("locks", [True, False])
def test_what_a_loop_costs_the_system_is_counted_from_its_beginning_and_given_back(
    locks: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A program has its own scheduler and timers afterwards."""
    calls: list[Any] = []

    class Library:
        """The C library of a system."""

        def mlockall(self, what: int) -> int:
            calls.append(("lock", what))
            return 0 if locks else -1

        def munlockall(self) -> None:
            calls.append("unlock")

        def prctl(self, what: int, *given: int) -> int:
            if what == clock.SET_SLACK:
                calls.append(("timers", *given))
            return 50_000

    usage = iter([(100, 2000), (103, 2050)])
    monkeypatch.setattr(clock.ctypes, "CDLL", lambda *given, **named: Library())
    monkeypatch.setattr(
        clock.resource,
        "getrusage",
        lambda who: types.SimpleNamespace(**dict(zip(("ru_majflt", "ru_minflt"), next(usage), strict=True))),
    )
    monkeypatch.setattr(clock, "ask_priority", lambda priority: priority)
    monkeypatch.setattr(os, "sched_getscheduler", lambda process: 2, raising=False)
    monkeypatch.setattr(os, "sched_getparam", lambda process: 80, raising=False)
    monkeypatch.setattr(os, "sched_setscheduler", lambda *given: calls.append(given), raising=False)
    clock.gc.freeze()
    assert clock.gc.isenabled()
    with clock.quiet(7 if locks else None) as got:
        assert not clock.gc.isenabled() and got.memory_locked == locks and got.priority == (7 if locks else 0)
        assert calls == [("lock", clock.LOCK_ALL), ("timers", 1, 0, 0, 0)]
        calls.clear()
    assert clock.gc.isenabled() and clock.gc.get_freeze_count() > 0, "what a program has frozen stays so"
    assert got.page_faults == (3, 50)
    back = [("timers", 50_000, 0, 0, 0)]
    assert calls == ([(0, 2, 80), *back, "unlock"] if locks else back)
