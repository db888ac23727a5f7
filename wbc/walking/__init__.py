"""Walking: footstep plans, pattern, swing foot and stabilizer, put together in `WalkingControl`.

Whatever decides on footsteps goes into `planning`, on reference motion into `pattern`, on feedback into `stabilizer`.
"""

from wbc.walking.control import WalkingControl
from wbc.walking.falls import FallDetector, FallReason, FallSettings
from wbc.walking.hands.hand import HandSettings, HandState
from wbc.walking.hands.hands import Hands
from wbc.walking.hands.reaching import Arm, Arms, ArmSettings
from wbc.walking.load import HeldLoad, LoadSettings
from wbc.walking.pattern.lipm import Pendulum, natural_frequency
from wbc.walking.pattern.pattern import Pattern
from wbc.walking.pattern.preview import PreviewController, PreviewSettings
from wbc.walking.pattern.swing import FootMotion, SwingFoot
from wbc.walking.planning.footsteps import SIDES, Footstep, FootstepPlan
from wbc.walking.planning.gait import Gait
from wbc.walking.planning.phases import Event, Phase, PhaseSettings, WalkPhases
from wbc.walking.planning.planners import climb_stairs, turn_in_place, walk_distance, walk_path, walk_velocity
from wbc.walking.planning.reach import Reach, check_plan
from wbc.walking.planning.schedule import SupportPhase, ZmpTarget, schedule
from wbc.walking.planning.sources import (
    DriveSettings,
    FootstepSource,
    GoalSource,
    PlanSource,
    Standing,
    VelocitySource,
)
from wbc.walking.progress import Progress, WalkingLike
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.stabilizer.adjustment import AdjustmentSettings, StepAdjuster
from wbc.walking.stabilizer.admittance import FootCorrection
from wbc.walking.stabilizer.bias import BiasEstimator, BiasSettings
from wbc.walking.stabilizer.distribution import DistributionSettings, FootWrenches, WrenchDistribution
from wbc.walking.stabilizer.gains import StabilizerGains
from wbc.walking.stabilizer.lean import Lean, LeanSettings
from wbc.walking.stabilizer.stabilizer import Stabilizer, StabilizerOutput
from wbc.walking.stabilizer.zmp import NoContactForceError, cop, net_wrench, zmp
from wbc.walking.stepping.control import SteppingControl, SteppingControlSettings
from wbc.walking.stepping.settings import SteppingSettings
from wbc.walking.tasks import TaskGains
from wbc.walking.walk import Walk, WalkReference, WalkSettings

__all__ = [
    # Control: a measurement in, a command out
    "WalkingControl",
    "WalkingControlSettings",
    "WalkingLike",
    "Progress",
    # A walk that balances by its steps
    "SteppingControl",
    "SteppingControlSettings",
    "SteppingSettings",
    # Arms: hands that go to targets
    "Arms",
    "ArmSettings",
    "Arm",
    "TaskGains",
    "HeldLoad",
    "LoadSettings",
    # References of a walk, for a controller of one's own
    "Walk",
    "WalkReference",
    "WalkSettings",
    # Planning: footsteps, and the phases in which they are taken
    "SIDES",
    "Footstep",
    "FootstepPlan",
    "Gait",
    "climb_stairs",
    "turn_in_place",
    "walk_distance",
    "walk_path",
    "walk_velocity",
    "DriveSettings",
    "FootstepSource",
    "GoalSource",
    "PlanSource",
    "Standing",
    "VelocitySource",
    "Reach",
    "check_plan",
    "SupportPhase",
    "schedule",
    "Event",
    "Phase",
    "PhaseSettings",
    "WalkPhases",
    # Pattern: motion of the pendulum and of the swing foot
    "Pattern",
    "Pendulum",
    "PreviewController",
    "PreviewSettings",
    "ZmpTarget",
    "natural_frequency",
    "FootMotion",
    "SwingFoot",
    # Stabilizer: feedback, wrenches and corrections
    "Stabilizer",
    "StabilizerGains",
    "StabilizerOutput",
    "FootCorrection",
    "DistributionSettings",
    "FootWrenches",
    "WrenchDistribution",
    "BiasEstimator",
    "BiasSettings",
    "Lean",
    "LeanSettings",
    "AdjustmentSettings",
    "StepAdjuster",
    "NoContactForceError",
    "cop",
    "net_wrench",
    "zmp",
    # Hands that press and grip
    "Hands",
    "HandSettings",
    "HandState",
    # Falls
    "FallDetector",
    "FallReason",
    "FallSettings",
]
