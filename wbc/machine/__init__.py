"""Machines: drivers and the control loop for robots that run in real time, and the conformance check of any loop.

A driver for a new wire is a class derived from `Driver` with its three methods, in a module of its own.
"""

from wbc.machine.conformance import conformance
from wbc.machine.loop import Driver, DriverLoop
from wbc.machine.phases import RunSettings
from wbc.machine.report import RunReport
from wbc.machine.run import Runner, run
from wbc.machine.udp import UdpDriver, UdpRobot
from wbc.machine.unitree import UnitreeDriver

__all__ = [
    # Interfaces
    "Driver",
    "DriverLoop",
    # The loop of a machine
    "run",
    "Runner",
    "RunSettings",
    "RunReport",
    # Wires
    "UdpDriver",
    "UdpRobot",
    "UnitreeDriver",
    # Check of a loop
    "conformance",
]
