"""Balance, walk, or run a policy in Unitree's own simulator of the G1, over its topics (DDS).

Start unitree_mujoco with its G1 of 29 joints (domain 1, interface lo; its band holds the robot), then this program. Let
the robot down with the keys of the simulator (8), and take the band off (9) once it stands.

python examples/machine/unitree_simulator.py --what walk --velocity 0.2 0 0
python examples/machine/unitree_simulator.py --what policy --policy walk.onnx --velocity 0.3 0 0
"""

from __future__ import annotations

import argparse
from typing import Any

import wbc
from wbc.machine import RunReport, RunSettings, UnitreeDriver, run
from wbc.policy import PolicyControl, PolicyGuard
from wbc.walking import WalkingControlSettings

RATE = 250.0
"""Ticks a second, 1/s."""


def control_of(what: str, policy: Any = None) -> Any:
    """Return a control that balances, one that walks, or a policy under a guard."""
    robot = wbc.load_robot("g1").robot()
    if what == "stand":
        return wbc.TorqueControl(wbc.balance_controller(robot, 1.0 / RATE))
    if what == "walk":
        return wbc.WalkingControl(robot, None, 1.0 / RATE, WalkingControlSettings(mode="hybrid"))
    return PolicyGuard(PolicyControl(robot, policy, 1.0 / RATE))


def main(arguments: list[str] | None = None) -> RunReport:
    """Drive the robot of the simulator for a time."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--what", choices=("stand", "walk", "policy"), default="walk")
    parser.add_argument("--policy", help="ONNX file, with a description in its metadata or beside it")
    parser.add_argument("--velocity", type=float, nargs=3, default=(0.0, 0.0, 0.0), help="m/s, m/s, rad/s")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--interface", default="lo")
    parser.add_argument("--domain", type=int, default=1)
    options = parser.parse_args(arguments)
    control = control_of(options.what, options.policy)
    if options.what != "stand" and any(options.velocity):
        control.velocity = options.velocity
    driver = UnitreeDriver("g1", options.interface, domain=options.domain)
    settings = RunSettings(robot_timeout=0.05, control_timeout=0.05)
    report = run(driver, control, rate=RATE, until=options.seconds, settings=settings)
    print(report)
    return report


if __name__ == "__main__":
    main()
