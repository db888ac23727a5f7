"""Robots as data: `load` returns one by name or file; `RobotDescription.from_urdf` and `from_mjcf` describe others.

Where to start, in the order of the data:

- `description`: a robot as data, and the models that are made from it; `frames`: its soles and other frames.
- `registry` and `files`: robots by name, and robots from a file of your own and its TOML.
- `mechanism`: links, joints and shapes, and the Pinocchio model of them. `urdf` makes it of the records of a
  URDF, which `tidying` settles, and `readers/mechanism_mjcf` of MuJoCo's compiled arrays.
- `readers/`: `robot_urdf` and `robot_mjcf` read a robot, the latter from an MJCF compiled by MuJoCo: tree, drives,
  feet, and the forces that the controller does not know.
- `write_urdf`: the robot as a URDF for other engines; the plant builds its own MuJoCo model of a mechanism.
- `mesh_files`: meshes of a robot, where they are and their vertices.
- `derivation/`: values that a file does not have; `complete` has the order, `defaults` the rules, `soles` where a
  robot touches the ground, `posture` its half-sitting (`legs`, `chains`), `servo` its gains.
- `report`: facts and doubtful values of a description.

A new built-in robot is a function in `models/` and a line in `registry`; a new default goes to `derivation/`.
"""

from wbc.core.frames import Sole
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
    "Sole",
]
