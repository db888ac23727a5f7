"""Robots as data: `load` a built-in one, or describe any other with `RobotDescription.from_urdf`.

A new built-in robot is a function in `models/` and a line in `registry`; a new default goes to `derivation/`.
"""

from wbc.robots.derivation.servo import ServoRule
from wbc.robots.description import RobotDescription
from wbc.robots.frames import FrameDescription, SoleDescription
from wbc.robots.registry import load, names, register

__all__ = [
    # Robots by name
    "load",
    "names",
    "register",
    # Describe a robot
    "RobotDescription",
    "FrameDescription",
    "SoleDescription",
    "ServoRule",
]
