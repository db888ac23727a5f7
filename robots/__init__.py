"""Robots as data: `load` one by name or file, or describe any with `RobotDescription.from_mjcf` and `from_urdf`.

A new built-in robot is a function in `models/` and a line in `registry`; a new default goes to `derivation/`.
"""

from wbc.robots.derivation.servo import ServoRule
from wbc.robots.description import RobotDescription
from wbc.robots.frames import FrameDescription, SoleDescription
from wbc.robots.registry import load, names, others, register

load_robot = load
"""Name of `load` in `wbc`, where no room says what is loaded."""

__all__ = [
    # Robots by name
    "load",
    "names",
    "others",
    "register",
    # Describe a robot
    "RobotDescription",
    "FrameDescription",
    "SoleDescription",
    "ServoRule",
]
