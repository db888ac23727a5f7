"""A process that damps the machine when the control loop no longer gives signs of life.

It reads a pickled driver from its standard input and the loop's heartbeat from shared memory, and sends nothing as long
as the heart beats. It outlives the loop: a controller that is killed leaves a machine that is damped.
"""

from __future__ import annotations

import contextlib
import math
import mmap
import os
import pickle
import signal
import struct
import subprocess
import sys
import tempfile
import time
from typing import Any

from wbc.base.processes import child_command
from wbc.machine.clock import ask_priority, let_timers_slack
from wbc.machine.loop import Driver, MachineError

BEAT = struct.Struct("<dd")
"""Time of the last beat, and its longest age (s): 0 before the first beat, below 0 once the loop has ended."""

WATCHING = b"watching\n"
"""Line with which the process says that it has the driver and watches."""

CHECK_PERIOD = 0.001
"""Period of the check of a loop that is not watched, s."""

DAMP_PERIOD = 0.002
"""Period of damping commands, s."""

DAMP_TIME = 3.0
"""Time for which a machine without a loop is damped, s."""


class Guard:
    """The guard, as the loop sees it."""

    def __init__(self, driver: Driver, age: float, priority: int | None = None) -> None:
        """Start the process and wait until it watches; `age` is the longest time between two beats, s."""
        self._age = age
        try:
            copy = pickle.dumps(driver)
        except Exception as error:  # whatever a driver of the user's own cannot hand on
            raise MachineError(
                f"the guard needs a copy of the driver, and a {type(driver).__name__} cannot be pickled ({error}): "
                "open its wire at the first call; guard=False runs without"
            ) from error
        if hasattr(os, "memfd_create"):
            self._fd = os.memfd_create("wbc_guard")
        else:
            self._fd, name = tempfile.mkstemp(prefix="wbc_guard_")
            os.unlink(name)  # the descriptor is enough
        os.ftruncate(self._fd, mmap.PAGESIZE)
        self._memory = mmap.mmap(self._fd, mmap.PAGESIZE)
        self._memory[: BEAT.size] = BEAT.pack(0.0, 0.0)
        self._process = subprocess.Popen(
            child_command("wbc.machine.guard", str(self._fd), str(priority or 0), str(os.getpid())),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=[self._fd],
            start_new_session=True,
        )
        assert self._process.stdin is not None and self._process.stdout is not None
        try:
            self._process.stdin.write(copy)
            self._process.stdin.flush()
            watching = self._process.stdout.readline() == WATCHING
        except BrokenPipeError:
            watching = False
        if not watching:
            self.close()
            raise MachineError(
                f"the guard's process cannot use a {type(driver).__name__} (its error is above): define the driver in "
                "a module that the program imports, and let damp() work in another process; guard=False runs without"
            )

    def beat(self) -> None:
        """Say that the loop lives."""
        BEAT.pack_into(self._memory, 0, time.monotonic(), self._age)

    def alarm(self) -> None:
        """Say that the loop cannot damp the machine: the process damps until the next beat."""
        BEAT.pack_into(self._memory, 0, -math.inf, self._age)

    def close(self) -> None:
        """End the process."""
        BEAT.pack_into(self._memory, 0, time.monotonic(), -1.0)
        try:
            self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
        with contextlib.suppress(BrokenPipeError), self._process:  # closes its pipes and waits
            pass
        self._memory.close()
        os.close(self._fd)


def watch(driver: Any, memory: mmap.mmap, parent: int) -> None:
    """Damp whenever the heart has stood for too long; return when the loop has ended, well or damped for a while.

    `parent` is the number of the loop's process; another parent means that the loop's process has ended.
    """
    damped_since: float | None = None
    while True:
        now = time.monotonic()
        beat, age = BEAT.unpack_from(memory, 0)
        if age < 0.0:
            return
        dead = age > 0.0 and now - beat >= age
        if not dead:
            damped_since = None
            if age == 0.0 and os.getppid() != parent:
                return
            # A beat moves the end on: until the present one there is nothing to see.
            time.sleep(max(0.0, beat + age - now) if age > 0.0 else CHECK_PERIOD)
            continue
        damped_since = now if damped_since is None else damped_since
        if now - damped_since > DAMP_TIME and os.getppid() != parent:
            return
        with contextlib.suppress(Exception):  # a wire that fails now may carry the next one
            driver.damp()
        time.sleep(DAMP_PERIOD)


def main() -> None:
    """Run the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    driver = pickle.load(sys.stdin.buffer)
    memory = mmap.mmap(int(sys.argv[1]), mmap.PAGESIZE)
    ask_priority(int(sys.argv[2]))
    let_timers_slack(1)
    driver.damp()  # opens the wire; the loop has sent no command yet
    os.write(sys.stdout.fileno(), WATCHING)
    watch(driver, memory, int(sys.argv[3]))
