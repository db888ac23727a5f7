"""Walking: footstep plans, pattern and swing foot, put together with the stabilizer in `WalkingControl`.

Whatever decides on footsteps goes into `planning`, on reference motion into `pattern`; feedback is in
`wbc.tasks.stabilizer`.
"""

from wbc.walking.body import Body
from wbc.walking.control import WalkingControl
from wbc.walking.hands.hand import HandSettings, HandState
from wbc.walking.hands.reaching import ArmSettings
from wbc.walking.load import LoadSettings
from wbc.walking.planning.footsteps import Footstep, FootstepPlan
from wbc.walking.planning.gait import Gait
from wbc.walking.planning.phases import Event, PhaseSettings
from wbc.walking.planning.planners import climb_stairs, turn_in_place, walk_distance, walk_path, walk_velocity
from wbc.walking.planning.sources import DriveSettings, Standing
from wbc.walking.progress import WalkingLike
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.stepping.control import SteppingControl, SteppingControlSettings
from wbc.walking.stepping.settings import SteppingSettings
from wbc.walking.walk import Walk, WalkSettings

__all__ = [
    # Control: a measurement in, a command out
    "WalkingControl",
    "WalkingControlSettings",
    "WalkingLike",
    # A walk that balances by its steps
    "SteppingControl",
    "SteppingControlSettings",
    "SteppingSettings",
    # Set-points of the body
    "Body",
    # Arms: hands that go to targets
    "ArmSettings",
    "LoadSettings",
    # References of a walk, for a controller of one's own
    "Walk",
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
    "Standing",
    "Event",
    "PhaseSettings",
    # Stabilizer: feedback, wrenches and corrections
    # Hands that press and grip
    "HandSettings",
    "HandState",
]
