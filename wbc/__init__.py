"""Whole-body QP control for humanoids.

Tasks, contacts and limits become one quadratic program (QP) over Pinocchio dynamics, solved at every control tick; a
MuJoCo plant with rigid, soft or variable-stiffness feet stands in for the machine. These names are what first programs
need; everything else is in `wbc.tasks`, `wbc.robots`, `wbc.feet`, `wbc.walking`, `wbc.sim` and `wbc.app`.
"""

import importlib
from typing import TYPE_CHECKING, Any

from wbc._version import __version__
from wbc.core.control import PositionControl, TorqueControl
from wbc.core.errors import InputError, WbcError
from wbc.core.estimation.observer import Observer
from wbc.core.limits.rows import JointLimits, TorqueLimits
from wbc.core.qp.contact import PointContact, SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.task import MotionTask
from wbc.core.robot import Robot
from wbc.core.signals import Command, Measurement
from wbc.robots import RobotDescription
from wbc.robots import load as load_robot
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.motion.frame import OrientationTask, PoseTask, PositionTask
from wbc.tasks.motion.posture import PostureTask

if TYPE_CHECKING:
    from wbc.sim import Plant, WalkSpec, balance_controller, stand, walk
    from wbc.walking import FootstepPlan, WalkingControl, walk_distance

__all__ = [
    # Robots
    "RobotDescription",
    "Robot",
    "load_robot",
    # Controller: tasks, contacts and limits in one QP
    "Controller",
    "CoMTask",
    "OrientationTask",
    "PoseTask",
    "PositionTask",
    "PostureTask",
    "MotionTask",
    "SoleContact",
    "PointContact",
    "JointLimits",
    "TorqueLimits",
    # From measurements to commands
    "Measurement",
    "Command",
    "Observer",
    "PositionControl",
    "TorqueControl",
    # Standing and walking
    "balance_controller",
    "WalkingControl",
    "FootstepPlan",
    "walk_distance",
    # Simulation
    "Plant",
    "WalkSpec",
    "stand",
    "walk",
    # Errors
    "WbcError",
    "InputError",
    # Version
    "__version__",
]

_LAZY = {
    "Plant": "wbc.sim",
    "WalkSpec": "wbc.sim",
    "balance_controller": "wbc.sim",
    "stand": "wbc.sim",
    "walk": "wbc.sim",
    "FootstepPlan": "wbc.walking",
    "WalkingControl": "wbc.walking",
    "walk_distance": "wbc.walking",
}
"""Names that are loaded when they are asked for: a controller of a real robot needs no simulator."""


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(importlib.import_module(_LAZY[name]), name)
    raise AttributeError(f"module 'wbc' has no attribute '{name}'")
