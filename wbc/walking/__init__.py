"""Walking: sources of references (a LIPM walk, a stepping walk, a stand), and the control that follows them.

What both laws share stands here: swing, contact, ground, tasks, control. The law that plans is in `planning`, `pattern`
and `lipm`, the one that decides steps as they go in `stepping`; another source derives from `ReferenceSource`.
"""

from wbc.core.control import State
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.auto import AutoControl, AutoControlSettings
from wbc.walking.control import WalkingControl
from wbc.walking.hands.hand import HandSettings, HandState
from wbc.walking.hands.reaching import ArmSettings
from wbc.walking.load import LoadSettings
from wbc.walking.planning.footsteps import Footstep, FootstepPlan
from wbc.walking.planning.gait import Gait, StepGait
from wbc.walking.planning.phases import PhaseSettings
from wbc.walking.planning.planners import climb_stairs, turn_in_place, walk_distance, walk_path, walk_velocity
from wbc.walking.planning.sources import DriveSettings, FootstepSource, Standing
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.source import Reference, ReferenceSource, StandSource
from wbc.walking.stepping.control import SteppingControl, SteppingControlSettings
from wbc.walking.stepping.settings import SteppingSettings
from wbc.walking.swing import FootMotion
from wbc.walking.walk import WalkSettings

__all__ = [
    # Control: a measurement in, a command out
    "WalkingControl",
    "WalkingControlSettings",
    # A walk that changes its law while it stands
    "AutoControl",
    "AutoControlSettings",
    # Sources of references
    "Reference",
    "ReferenceSource",
    "StandSource",
    "State",
    "Pendulum",
    "FootMotion",
    # A walk that balances by its steps
    "StepGait",
    "SteppingControl",
    "SteppingControlSettings",
    "SteppingSettings",
    # Arms: hands that go to targets
    "ArmSettings",
    "LoadSettings",
    "WalkSettings",
    # Planning: footsteps, and the phases in which they are taken
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
    "Standing",
    "PhaseSettings",
    # Hands that press and grip
    "HandSettings",
    "HandState",
]
