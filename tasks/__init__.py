"""Tasks of the controller, and the scheduler of the soles' stiffness.

A task is a plain object whose target is an attribute.

A new motion task goes into a file in `motion/`, a new force task into a file in `force/`; each needs a line here and a
test. `balance` has the tasks of a robot that stands, `stabilizer` the DCM stabilizer of walks.
"""

from wbc.core.qp.task import SelectionTask, VariableTask
from wbc.tasks.behaviours import Behaviour, Program, StateMachine, after, reached
from wbc.tasks.check import check_rows
from wbc.tasks.force.compliance import AdmittanceTask, ComplianceTask, ImpedanceTask
from wbc.tasks.force.wrench import JointTorqueTask, WrenchTask
from wbc.tasks.motion.com import CoMOverFeetTask, CoMTask, MomentumTask
from wbc.tasks.motion.frame import (
    LookAtTask,
    OrientationTask,
    PoseTask,
    PositionTask,
    RelativeFrameTask,
    VectorOrientationTask,
)
from wbc.tasks.motion.posture import PostureTask
from wbc.tasks.motion.relations import (
    DistanceTask,
    JointCouplingTask,
    LowAccelerationTask,
    ManipulabilityTask,
)
from wbc.tasks.scheduling.policies import StiffnessPolicy, SwingScan, register_stiffness_policy
from wbc.tasks.scheduling.stiffness import StiffnessScheduler

__all__ = [
    # Motion tasks
    "CoMTask",
    "CoMOverFeetTask",
    "PositionTask",
    "OrientationTask",
    "PoseTask",
    "VectorOrientationTask",
    "LookAtTask",
    "RelativeFrameTask",
    "PostureTask",
    "MomentumTask",
    "DistanceTask",
    "JointCouplingTask",
    "ManipulabilityTask",
    "LowAccelerationTask",
    # Force tasks
    "JointTorqueTask",
    "WrenchTask",
    "AdmittanceTask",
    "ImpedanceTask",
    # Behaviours: states, one after another
    "Behaviour",
    "StateMachine",
    "Program",
    "after",
    "reached",
    # Bases for tasks of one's own, beside wbc.Task
    "SelectionTask",
    "VariableTask",
    "ComplianceTask",
    "check_rows",
    # Stiffness scheduling
    "StiffnessScheduler",
    "StiffnessPolicy",
    "SwingScan",
    "register_stiffness_policy",
]
