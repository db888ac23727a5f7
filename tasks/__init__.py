"""What the controller can want: tasks, each a plain object whose target is an attribute."""

from wbc.tasks.admittance import AdmittanceTask, DampingTask
from wbc.tasks.com import CoMTask
from wbc.tasks.compliance import ComplianceTask
from wbc.tasks.cop import CoPTask
from wbc.tasks.frame import FrameTask, OrientationTask, PoseTask, PositionTask
from wbc.tasks.impedance import FirstOrderImpedanceTask, ImpedanceTask
from wbc.tasks.momentum import MomentumTask
from wbc.tasks.posture import PostureTask
from wbc.tasks.relative import RelativeFrameTask
from wbc.tasks.torque import JointTorqueTask
from wbc.tasks.wrench import WrenchTask

__all__ = [
    "AdmittanceTask",
    "CoMTask",
    "CoPTask",
    "ComplianceTask",
    "DampingTask",
    "FirstOrderImpedanceTask",
    "FrameTask",
    "ImpedanceTask",
    "JointTorqueTask",
    "MomentumTask",
    "OrientationTask",
    "PoseTask",
    "PositionTask",
    "PostureTask",
    "RelativeFrameTask",
    "WrenchTask",
]
