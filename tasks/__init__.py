"""What the controller can want: tasks, each a plain object whose target is an attribute."""

from wbc.tasks.force.admittance import AdmittanceTask, DampingTask
from wbc.tasks.force.compliance import ComplianceTask
from wbc.tasks.force.cop import CoPTask
from wbc.tasks.force.impedance import FirstOrderImpedanceTask, ImpedanceTask
from wbc.tasks.force.torque import JointTorqueTask
from wbc.tasks.force.wrench import WrenchTask
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.motion.frame import FrameTask, OrientationTask, PoseTask, PositionTask
from wbc.tasks.motion.momentum import MomentumTask
from wbc.tasks.motion.posture import PostureTask
from wbc.tasks.motion.relative import RelativeFrameTask
from wbc.tasks.scheduling.policies import (
    FixedPolicy,
    GroundPolicy,
    ModelPolicy,
    StiffnessPolicy,
    register_stiffness_policy,
    stiffness_policy,
    stiffness_policy_names,
)
from wbc.tasks.scheduling.record import StepStiffness, StiffnessTiming
from wbc.tasks.scheduling.stiffness import StiffnessScheduler

__all__ = [
    "AdmittanceTask",
    "CoMTask",
    "CoPTask",
    "ComplianceTask",
    "DampingTask",
    "FirstOrderImpedanceTask",
    "FixedPolicy",
    "FrameTask",
    "GroundPolicy",
    "ImpedanceTask",
    "JointTorqueTask",
    "ModelPolicy",
    "MomentumTask",
    "OrientationTask",
    "PoseTask",
    "PositionTask",
    "PostureTask",
    "RelativeFrameTask",
    "StepStiffness",
    "StiffnessPolicy",
    "StiffnessScheduler",
    "StiffnessTiming",
    "WrenchTask",
    "register_stiffness_policy",
    "stiffness_policy",
    "stiffness_policy_names",
]
