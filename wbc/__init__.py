"""Whole-body QP control for humanoids.

Tasks, contacts and limits become one quadratic program over Pinocchio dynamics, solved at every control tick; a MuJoCo
plant with rigid, soft or variable-stiffness feet stands in for the machine. These names are what a first program
needs; everything else is in `wbc.core`, `wbc.robots`, `wbc.feet`, `wbc.tasks`, `wbc.walking`, `wbc.sim` and `wbc.app`.
"""

from typing import TYPE_CHECKING, Any

from wbc._version import __version__
from wbc.core.control import PositionControl, TorqueControl
from wbc.core.estimation.observer import Observer
from wbc.core.limits.rows import JointLimits, TorqueLimits
from wbc.core.qp.contact import PointContact, SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.robot import Robot
from wbc.robots import RobotDescription
from wbc.robots import load as load_robot
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.motion.frame import OrientationTask, PoseTask, PositionTask
from wbc.tasks.motion.posture import PostureTask

if TYPE_CHECKING:
    from wbc.sim import Plant

__all__ = [
    "CoMTask",
    "Controller",
    "JointLimits",
    "Observer",
    "OrientationTask",
    "Plant",
    "PointContact",
    "PoseTask",
    "PositionControl",
    "PositionTask",
    "PostureTask",
    "Robot",
    "RobotDescription",
    "SoleContact",
    "TorqueControl",
    "TorqueLimits",
    "__version__",
    "load_robot",
]


def __getattr__(name: str) -> Any:  # the simulator is loaded when it is asked for: a real robot needs none
    if name == "Plant":
        from wbc.sim import Plant  # noqa: PLC0415

        return Plant
    raise AttributeError(f"module 'wbc' has no attribute '{name}'")
