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

TIMER_SLACK = 29
"""PR_SET_TIMERSLACK of Linux: how late the kernel may wake this process to save power, ns."""

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
        collections: Garbage collections during the loop.
    """

    memory_locked: bool = False
    priority: int = 0
    page_faults: tuple[int, int] = (0, 0)
    collections: int = 0


def ask_priority(priority: int) -> int:
    """Ask for the real-time scheduler; return the priority under SCHED_FIFO (1 to 99) that was got, 0 without it."""
    if priority > 0 and hasattr(os, "sched_setscheduler"):
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
            return priority
    return 0


def keep_timers_sharp() -> None:
    """Have the kernel wake this process as soon as a sleep ends, where it can be asked."""
    with contextlib.suppress(OSError, AttributeError):  # there is none but on Linux
        ctypes.CDLL(None, use_errno=True).prctl(TIMER_SLACK, 1, 0, 0, 0)


@contextlib.contextmanager
def quiet(priority: int | None) -> Iterator[Quiet]:
    """Keep garbage collector, pager and scheduler out of a loop as far as this process may; never fail."""
    got = Quiet()
    enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    before_collections = sum(entry["collections"] for entry in gc.get_stats())
    with contextlib.suppress(OSError, AttributeError):
        got.memory_locked = ctypes.CDLL(None, use_errno=True).mlockall(LOCK_ALL) == 0
    keep_timers_sharp()
    got.priority = ask_priority(priority or 0)
    start = resource.getrusage(resource.RUSAGE_SELF)
    try:
        yield got
    finally:
        end = resource.getrusage(resource.RUSAGE_SELF)
        got.page_faults = (end.ru_majflt - start.ru_majflt, end.ru_minflt - start.ru_minflt)
        got.collections = sum(entry["collections"] for entry in gc.get_stats()) - before_collections
        if got.priority:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        if got.memory_locked:
            ctypes.CDLL(None).munlockall()
        if enabled:
            gc.enable()
