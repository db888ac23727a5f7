"""Whole-body QP control for humanoids.

Tasks, contacts and limits become one quadratic program (QP) over Pinocchio dynamics, solved at every control tick; a
MuJoCo plant with rigid, soft or variable-stiffness feet stands in for the machine. These names are what first programs
need; everything else is in `wbc.tasks`, `wbc.robots`, `wbc.feet`, `wbc.walking`, `wbc.sim` and `wbc.app`.
"""

import importlib
from typing import TYPE_CHECKING, Any

from wbc._version import __version__
from wbc.core.control import FailurePolicy, SafetySettings
from wbc.core.drive.hybrid import HybridControl
from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import TorqueControl
from wbc.core.errors import InputError, WbcError
from wbc.core.estimation.observer import Observer
from wbc.core.limits.rows import JointLimits, RowLimit, TorqueLimits, damped_bound
from wbc.core.qp.contact import PointContact, SoleContact, rectangle_wrench_cone
from wbc.core.qp.controller import Controller
from wbc.core.qp.foothold import Foothold
from wbc.core.qp.solver import SolverSettings
from wbc.core.qp.task import MotionTask
from wbc.core.robot import Robot
from wbc.core.settings import Count, NonNegative, Positive, settings
from wbc.core.signals import Command, Measurement
from wbc.robots import RobotDescription
from wbc.robots import load as load_robot
from wbc.tasks.balance import balance_controller
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.motion.frame import OrientationTask, PoseTask, PositionTask
from wbc.tasks.motion.posture import PostureTask

if TYPE_CHECKING:
    from wbc.core.conventions import velocity_from_mujoco, velocity_to_mujoco
    from wbc.core.limits.collision import CollisionCapsule, CollisionSphere, SelfCollisionLimit
    from wbc.core.limits.com_polygon import CoMPolygonLimit
    from wbc.machine import conformance, run
    from wbc.sim import Plant, WalkSpec, stand, walk
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
    "Foothold",
    "JointLimits",
    "TorqueLimits",
    "SelfCollisionLimit",
    "CollisionSphere",
    "CollisionCapsule",
    "CoMPolygonLimit",
    "SolverSettings",
    # Bases and helpers for limits and contacts of one's own
    "RowLimit",
    "damped_bound",
    "rectangle_wrench_cone",
    # From measurements to commands
    "Measurement",
    "Command",
    "Observer",
    "PositionControl",
    "TorqueControl",
    "HybridControl",
    "FailurePolicy",
    "SafetySettings",
    "velocity_from_mujoco",
    "velocity_to_mujoco",
    # Standing and walking
    "balance_controller",
    "WalkingControl",
    "FootstepPlan",
    "walk_distance",
    # Loops of one's own, and machines
    "conformance",
    "run",
    # Simulation
    "Plant",
    "WalkSpec",
    "stand",
    "walk",
    # Settings of one's own
    "settings",
    "Positive",
    "NonNegative",
    "Count",
    # Errors
    "WbcError",
    "InputError",
    # Version
    "__version__",
]

_LAZY = {
    "CoMPolygonLimit": "wbc.core.limits.com_polygon",
    "CollisionCapsule": "wbc.core.limits.collision",
    "CollisionSphere": "wbc.core.limits.collision",
    "SelfCollisionLimit": "wbc.core.limits.collision",
    "velocity_from_mujoco": "wbc.core.conventions",
    "velocity_to_mujoco": "wbc.core.conventions",
    "conformance": "wbc.machine",
    "run": "wbc.machine",
    "Plant": "wbc.sim",
    "WalkSpec": "wbc.sim",
    "stand": "wbc.sim",
    "walk": "wbc.sim",
    "FootstepPlan": "wbc.walking",
    "WalkingControl": "wbc.walking",
    "walk_distance": "wbc.walking",
}
"""Names that are loaded when they are asked for: a first controller needs neither them nor a simulator."""


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(importlib.import_module(_LAZY[name]), name)
    raise AttributeError(f"module 'wbc' has no attribute '{name}'")
