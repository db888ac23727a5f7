"""What the controller can want: tasks, each a plain object whose target is an attribute."""

from wbc.tasks.admittance import AdmittanceTask, DampingTask
from wbc.tasks.com import CoMTask
from wbc.tasks.compliance import ComplianceTask
from wbc.tasks.cop import CoPTask
from wbc.tasks.frame import FrameTask, OrientationTask, PoseTask, PositionTask
from wbc.tasks.impedance import FirstOrderImpedanceTask, ImpedanceTask
from wbc.tasks.momentum import MomentumTask
from wbc.tasks.policies import (
    FixedPolicy,
    GroundPolicy,
    ModelPolicy,
    StiffnessPolicy,
    register_stiffness_policy,
    stiffness_policy,
    stiffness_policy_names,
)
from wbc.tasks.posture import PostureTask
from wbc.tasks.relative import RelativeFrameTask
from wbc.tasks.stiffness import StiffnessTask
from wbc.tasks.stiffness_record import StepStiffness, StiffnessTiming
from wbc.tasks.torque import JointTorqueTask
from wbc.tasks.wrench import WrenchTask

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
    "StiffnessTask",
    "StiffnessTiming",
    "WrenchTask",
    "register_stiffness_policy",
    "stiffness_policy",
    "stiffness_policy_names",
]
