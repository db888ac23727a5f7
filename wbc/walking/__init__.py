"""Walking: sources of references (a LIPM walk, a stepping walk, a stand), and the control that follows them.

Whatever decides on footsteps goes into `planning`, on reference motion into `pattern`; feedback is in
`wbc.tasks.stabilizer`. Another source derives from `ReferenceSource`.
"""

from wbc.core.control import State
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.control import WalkingControl
from wbc.walking.hands.hand import HandSettings, HandState
from wbc.walking.hands.reaching import ArmSettings
from wbc.walking.load import LoadSettings
from wbc.walking.planning.footsteps import Footstep, FootstepPlan
from wbc.walking.planning.gait import Gait
from wbc.walking.planning.phases import PhaseSettings
from wbc.walking.planning.planners import climb_stairs, turn_in_place, walk_distance, walk_path, walk_velocity
from wbc.walking.planning.sources import DriveSettings, FootstepSource, Standing
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.source import Reference, ReferenceSource, Stand
from wbc.walking.stepping.control import SteppingControl, SteppingControlSettings
from wbc.walking.stepping.settings import SteppingSettings
from wbc.walking.swing import FootMotion
from wbc.walking.walk import WalkSettings

__all__ = [
    # Control: a measurement in, a command out
    "WalkingControl",
    "WalkingControlSettings",
    # Sources of references
    "Reference",
    "ReferenceSource",
    "Stand",
    "State",
    "Pendulum",
    "FootMotion",
    # A walk that balances by its steps
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
