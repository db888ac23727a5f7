"""Drive a robot over UDP: ramp to the stand, balance, sink.

python examples/machine/robot.py --robot g1 & python examples/machine/stand.py --robot g1
"""

from __future__ import annotations

import argparse

import numpy as np

import wbc
from wbc.machine import RunReport, RunSettings, UdpDriver, run


def main(arguments: list[str] | None = None) -> RunReport:
    """Stand for a time."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", default="g1")
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=7700)
    parser.add_argument("--secret", help="shared with the robot; needed where it is on another computer")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--priority", type=int, default=None, help="of the real-time scheduler, 1 to 99")
    parser.add_argument("--timeout", type=float, default=0.015, help="longest silence of either side, s")
    options = parser.parse_args(arguments)
    description = wbc.load_robot(options.robot)
    control = wbc.TorqueControl(wbc.balance_controller(description.robot(), 0.002))
    driver = UdpDriver(description, options.host, options.port, secret=options.secret)
    settings = RunSettings(
        robot_timeout=options.timeout, control_timeout=options.timeout, priority=options.priority
    )
    report = run(driver, control, rate=500, until=options.seconds, settings=settings)
    print(report)
    for what, times in (("late", report.late), ("busy", report.busy)):
        print(
            what, *(f"{share} %: {1e3 * np.percentile(times, share):.2f} ms" for share in (50, 99, 99.9, 100))
        )
    return report


if __name__ == "__main__":
    main()
