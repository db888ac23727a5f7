"""Robots as data: `load` one by name or file, or describe any with `RobotDescription.from_mjcf` and `from_urdf`.

Where to start, in the order of the data:

- `description`: a robot as data, and the models made from it; `frames` are its soles and other frames.
- `registry` and `files`: robots by name; a file of one's own and its TOML.
- `urdf`: the one URDF string that Pinocchio and MuJoCo read. `readers/`: an MJCF, compiled by MuJoCo, becomes one:
  tree, drives, feet, forces that the controller does not know.
- `derivation/`: what a file does not say; `complete` has the order, `defaults` the rules.
- `report`: facts and doubts.

A new built-in robot is a function in `models/` and a line in `registry`; a new default goes to `derivation/`.
"""

from typing import TYPE_CHECKING

from wbc.base.errors import missing_from
from wbc.robots.derivation.servo import ServoRule
from wbc.robots.description import RobotDescription
from wbc.robots.registry import load, names, register

load_robot = load
"""Name of `load` in `wbc`, where no room says what is loaded."""

__all__ = [
    # Robots by name
    "load",
    "names",
    "register",
    # Describe a robot
    "RobotDescription",
    "ServoRule",
]

if not TYPE_CHECKING:
    __getattr__ = missing_from(__name__)
