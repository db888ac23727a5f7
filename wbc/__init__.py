"""Whole-body QP control for humanoids.

Tasks, contacts and limits become one quadratic program (QP) over Pinocchio dynamics, solved at every control tick; a
MuJoCo plant with rigid, soft or variable-stiffness feet stands in for the machine. These names are what first programs
need; everything else is in `wbc.tasks`, `wbc.robots`, `wbc.feet`, `wbc.walking`, `wbc.sim` and `wbc.app`.
"""

import importlib
from typing import TYPE_CHECKING, Any

from wbc._version import __version__

if TYPE_CHECKING:
    from wbc.core.control import FailurePolicy, SafetySettings
    from wbc.core.conventions import (
        configuration_from_mujoco,
        configuration_to_mujoco,
        velocity_from_mujoco,
        velocity_to_mujoco,
    )
    from wbc.core.drive.hybrid import HybridControl
    from wbc.core.drive.position import PositionControl
    from wbc.core.drive.torque import TorqueControl
    from wbc.core.errors import InputError, WbcError
    from wbc.core.estimation.observer import Observer
    from wbc.core.limits.collision import CollisionCapsule, CollisionSphere, SelfCollisionLimit
    from wbc.core.limits.com_polygon import CoMPolygonLimit
    from wbc.core.limits.rows import JointLimits, RowLimit, TorqueLimits
    from wbc.core.qp.contact import FixedContact, PointContact, SoleContact
    from wbc.core.qp.controller import Controller
    from wbc.core.qp.foothold import Foothold
    from wbc.core.qp.solver import SolverSettings
    from wbc.core.qp.task import MotionTask
    from wbc.core.robot import Robot
    from wbc.core.settings import Count, Positive, settings
    from wbc.core.signals import Command, Measurement
    from wbc.machine import conformance, run
    from wbc.robots import RobotDescription
    from wbc.robots import load as load_robot
    from wbc.sim import Plant, WalkSpec, stand, walk
    from wbc.tasks.balance import balance_controller
    from wbc.tasks.motion.com import CoMTask
    from wbc.tasks.motion.frame import OrientationTask, PoseTask, PositionTask
    from wbc.tasks.motion.posture import PostureTask
    from wbc.tasks.stabilizer.task import StabilizerTask
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
    "StabilizerTask",
    "MotionTask",
    "SoleContact",
    "PointContact",
    "FixedContact",
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
    # From measurements to commands
    "Measurement",
    "Command",
    "Observer",
    "PositionControl",
    "TorqueControl",
    "HybridControl",
    "FailurePolicy",
    "SafetySettings",
    "configuration_from_mujoco",
    "configuration_to_mujoco",
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
    "Count",
    # Errors
    "WbcError",
    "InputError",
    # Version
    "__version__",
]

_PLACES = {
    "wbc.core.control": "FailurePolicy SafetySettings",
    "wbc.core.conventions": "configuration_from_mujoco configuration_to_mujoco velocity_from_mujoco velocity_to_mujoco",
    "wbc.core.drive.hybrid": "HybridControl",
    "wbc.core.drive.position": "PositionControl",
    "wbc.core.drive.torque": "TorqueControl",
    "wbc.core.errors": "InputError WbcError",
    "wbc.core.estimation.observer": "Observer",
    "wbc.core.limits.collision": "CollisionCapsule CollisionSphere SelfCollisionLimit",
    "wbc.core.limits.com_polygon": "CoMPolygonLimit",
    "wbc.core.limits.rows": "JointLimits RowLimit TorqueLimits",
    "wbc.core.qp.contact": "FixedContact PointContact SoleContact",
    "wbc.core.qp.controller": "Controller",
    "wbc.core.qp.foothold": "Foothold",
    "wbc.core.qp.solver": "SolverSettings",
    "wbc.core.qp.task": "MotionTask",
    "wbc.core.robot": "Robot",
    "wbc.core.settings": "Count Positive settings",
    "wbc.core.signals": "Command Measurement",
    "wbc.machine": "conformance run",
    "wbc.robots": "RobotDescription load_robot",
    "wbc.sim": "Plant WalkSpec stand walk",
    "wbc.tasks.balance": "balance_controller",
    "wbc.tasks.motion.com": "CoMTask",
    "wbc.tasks.motion.frame": "OrientationTask PoseTask PositionTask",
    "wbc.tasks.motion.posture": "PostureTask",
    "wbc.tasks.stabilizer.task": "StabilizerTask",
    "wbc.walking": "FootstepPlan WalkingControl walk_distance",
}
"""Module → names that come from it, loaded when they are asked for: `import wbc` takes no time."""

_OTHER_NAMES = {"load_robot": "load"}
"""Name here → name in its module."""


def __getattr__(name: str) -> Any:
    for place, names in _PLACES.items():
        if name in names.split():
            globals()[name] = found = getattr(importlib.import_module(place), _OTHER_NAMES.get(name, name))
            return found
    raise AttributeError(f"module 'wbc' has no attribute '{name}'")
