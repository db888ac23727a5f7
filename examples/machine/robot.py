"""A robot that runs by itself: a simulation in real time that speaks UDP (`wbc.machine.udp`); stand.py drives it.

python examples/machine/robot.py --robot g1 & python examples/machine/stand.py --robot g1
"""

from __future__ import annotations

import argparse
import time

import wbc
from wbc.machine import UdpRobot
from wbc.machine.clock import ask_priority
from wbc.sim import Machine, RobotServer


def main(arguments: list[str] | None = None) -> RobotServer:
    """Run for a time."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", default="g1")
    parser.add_argument("--port", type=int, default=7700)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--hang", type=float, default=0.0, help="let down from a band after this time, s")
    parser.add_argument("--priority", type=int, default=0, help="of the real-time scheduler, 1 to 99")
    parser.add_argument(
        "--watchdog", type=float, default=0.015, help="longest time for which a command acts, s"
    )
    options = parser.parse_args(arguments)
    description = wbc.load_robot(options.robot)
    loop = wbc.Plant(description, control_period=0.002, machine=Machine(torque_sensors=True))
    wire = UdpRobot(description, options.port)
    server = RobotServer(loop, wire, watchdog=options.watchdog, band=options.hang)
    ask_priority(options.priority)
    end = time.monotonic() + options.seconds
    print(f"listening at port {wire.port}", flush=True)
    server.run(lambda: time.monotonic() > end)
    wire.close()
    return server


if __name__ == "__main__":
    main()
