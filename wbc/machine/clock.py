"""Time of a control loop: absolute deadlines, and what keeps the operating system and Python out of the way."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import resource
import time
from collections.abc import Iterator
from dataclasses import dataclass

SPIN = 150e-6
"""Time before a deadline from which the loop no longer sleeps, s: a sleep ends late by this much as a rule."""

SET_SLACK, GET_SLACK = 29, 30
"""PR_SET_TIMERSLACK and PR_GET_TIMERSLACK of Linux: how late the kernel may wake this process to save power, ns."""

LOCK_ALL = 3
"""MCL_CURRENT | MCL_FUTURE: no page of this process is swapped out."""


class Clock:
    """Monotonic clock of this machine; the same for all of its processes."""

    def now(self) -> float:
        """Return the time, s."""
        return time.monotonic()

    def sleep_until(self, deadline: float) -> None:
        """Return at an instant, s; at once if it has passed."""
        left = deadline - time.monotonic()
        if left > SPIN:
            time.sleep(left - SPIN)
        while time.monotonic() < deadline:
            pass


@dataclass
class Quiet:
    """Settings that the operating system granted for the time of a loop.

    Attributes:
        memory_locked: No page is swapped out.
        priority: Priority of the real-time scheduler, 0 without it.
        page_faults: Page faults that read from the disk, and those that did not, during the loop.
    """

    memory_locked: bool = False
    priority: int = 0
    page_faults: tuple[int, int] = (0, 0)


def ask_priority(priority: int) -> int:
    """Ask for the real-time scheduler; return the priority under SCHED_FIFO (1 to 99) that was got, 0 without it."""
    if priority > 0 and hasattr(os, "sched_setscheduler"):
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
            return priority
    return 0


def let_timers_slack(slack: int) -> int:
    """Set how late the kernel may wake this process after a sleep, ns, 0 for its default; return what it was before."""
    before = 0
    with contextlib.suppress(OSError, AttributeError):  # there is none but on Linux
        prctl = ctypes.CDLL(None).prctl
        before = max(0, int(prctl(GET_SLACK, 0, 0, 0, 0)))
        prctl(SET_SLACK, slack, 0, 0, 0)
    return before


@contextlib.contextmanager
def quiet(priority: int | None) -> Iterator[Quiet]:
    """Keep garbage collector, pager and scheduler out of a loop as far as this process may; never fail.

    Afterwards they are as the program had them, and no page is locked.
    """
    got = Quiet()
    with contextlib.suppress(OSError, AttributeError):
        scheduler = os.sched_getscheduler(0), os.sched_getparam(0)
    enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    with contextlib.suppress(OSError, AttributeError):
        got.memory_locked = ctypes.CDLL(None).mlockall(LOCK_ALL) == 0
    slack = let_timers_slack(1)
    got.priority = ask_priority(priority or 0)
    start = resource.getrusage(resource.RUSAGE_SELF)
    try:
        yield got
    finally:
        end = resource.getrusage(resource.RUSAGE_SELF)
        got.page_faults = (end.ru_majflt - start.ru_majflt, end.ru_minflt - start.ru_minflt)
        if got.priority:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(0, *scheduler)
        let_timers_slack(slack)
        if got.memory_locked:
            ctypes.CDLL(None).munlockall()
        if enabled:
            gc.enable()
