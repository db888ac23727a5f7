"""Programs of the tests of machines: a robot and a controller, each in a process of its own, that say when they damp.

python tests/support/machine_process.py robot WATCHDOG     python tests/support/machine_process.py control PORT TIMEOUT
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

from unitree_robot import UnitreeRobot

import wbc
from wbc.machine import Runner, RunSettings, UdpDriver, UdpRobot
from wbc.machine.clock import ask_priority
from wbc.machine.report import Phase
from wbc.sim import MujocoLoop, Plant, RobotServer

ROBOT = "g1"
PERIOD = 0.004
PRIORITY = 50
"""Under SCHED_FIFO, where this is allowed: other programs of the machine are then no part of what is measured."""


class Process(subprocess.Popen[str]):
    """One of these programs, and the lines that it prints; killed at the end of a `with`."""

    def __init__(self, *arguments: str) -> None:
        super().__init__([sys.executable, __file__, *arguments], stdout=subprocess.PIPE, text=True)

    def line(self, *words: str) -> list[str]:
        """Wait for a line that begins with one of some words."""
        assert self.stdout is not None
        for line in self.stdout:
            if line.split()[0] in words:
                return line.split(maxsplit=2)
        raise AssertionError(f"no line {words}")

    def kill_now(self) -> float:
        """Kill it; return the time just before, s."""
        own = ask_priority(60)  # as the programs: this one must not wait between clock and signal
        now = time.monotonic()
        self.send_signal(signal.SIGKILL)
        if own:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        return now

    def __exit__(self, *error: object) -> None:
        self.kill()
        super().__exit__(None, None, None)


def robot(watchdog: float) -> None:
    """Run a robot; print the clock whenever damping begins or ends."""
    description = wbc.load_robot(ROBOT)
    loop = MujocoLoop(description, Plant(description, visuals=False).model, control_period=PERIOD)
    wire = UdpRobot(description, 0)
    server = RobotServer(loop, wire, watchdog=watchdog)
    print("port", wire.port, ask_priority(PRIORITY), flush=True)
    was, end = False, time.monotonic() + 300.0

    def looked_at() -> bool:
        nonlocal was
        if server.damped != was:
            was = server.damped
            print("damped" if was else "driven", time.monotonic(), flush=True)
        return time.monotonic() > end

    server.run(looked_at)


def unitree() -> None:
    """Run a G1 that hangs at a band for a moment and speaks Unitree's topics in domain 7."""
    description = wbc.load_robot(ROBOT)
    loop = MujocoLoop(description, Plant(description, visuals=False).model, control_period=PERIOD)
    server = RobotServer(loop, UnitreeRobot(description, domain=7), watchdog=5.0, band=1.0)
    print("ready", flush=True)
    end = time.monotonic() + 60.0
    server.run(lambda: time.monotonic() > end)


def control(port: int, timeout: float) -> None:
    """Drive the robot; print when the controller runs, and when it has damped and why."""
    description = wbc.load_robot(ROBOT)
    controller = wbc.TorqueControl(wbc.balance_controller(description.robot(), PERIOD))
    settings = RunSettings(
        fade=0.2, blend=0.2, robot_timeout=timeout, control_timeout=timeout, priority=PRIORITY
    )
    runner = Runner(UdpDriver(description, port=port), controller, 1.0 / PERIOD, settings=settings)
    told = False

    def tell() -> bool:
        nonlocal told
        if runner.phase is Phase.RUN and not told:
            told = True
            print("runs", time.monotonic(), flush=True)
        return False

    report = runner.run(tell)
    begun = time.monotonic() - report.phases[-1][1]
    print("ended", begun, report.reason, flush=True)


if __name__ == "__main__":
    programs = {
        "robot": lambda: robot(float(sys.argv[2])),
        "control": lambda: control(int(sys.argv[2]), float(sys.argv[3])),
    }
    (programs | {"unitree": unitree})[sys.argv[1]]()
