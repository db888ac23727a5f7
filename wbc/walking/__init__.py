"""Walking: sources of references (a LIPM walk, a stepping walk, a stand), and the control that follows them.

source      what a control follows in every tick; another one derives from `ReferenceSource`
plans       footsteps: plans, gait, reach of the legs, and who is asked for them while the robot walks
lipm        law of planned footsteps: phases, preview control, step adjustment
stepping    law of steps that are decided at every tick
ground, swing, contact, tasks, balance, control    the same for both laws: what is known of the ground … the tick
walking_control    the control with both laws
body, hands, load, falls
"""

from wbc.core.drive.control import State
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.hands.hand import HandSettings
from wbc.walking.load import LoadSettings
from wbc.walking.plans.footsteps import FootstepPlan
from wbc.walking.plans.gait import Gait, StepGait
from wbc.walking.plans.planners import climb_stairs, turn_in_place, walk_distance, walk_path, walk_velocity
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.source import Reference, ReferenceSource, StandSource
from wbc.walking.stepping.control import SteppingControl, SteppingControlSettings
from wbc.walking.swing import FootMotion
from wbc.walking.walking_control import WalkingControl

__all__ = [
    # Control: a measurement in, a command out
    "WalkingControl",
    "WalkingControlSettings",
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
    # Arms: hands that go to targets
    "LoadSettings",
    # Planning: footsteps, and the phases in which they are taken
    "FootstepPlan",
    "Gait",
    "climb_stairs",
    "turn_in_place",
    "walk_distance",
    "walk_path",
    "walk_velocity",
    # Hands that press and grip
    "HandSettings",
]
