"""Robots as data: `load` a built-in one, or describe any other with `RobotDescription.from_urdf`."""

from wbc.robots.derivation.servo import ServoRule
from wbc.robots.description import RobotDescription
from wbc.robots.frames import FrameDescription, SoleDescription
from wbc.robots.registry import load, names, register

__all__ = [
    "FrameDescription",
    "RobotDescription",
    "ServoRule",
    "SoleDescription",
    "load",
    "names",
    "register",
]
