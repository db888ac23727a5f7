"""Walking: the control of a robot that walks, and the sources of references that it follows.

control     the control: what is asked of a robot, and the tick; steered: what it has in common with policies
source      what the control follows in every tick; another one derives from `ReferenceSource`
steering    the velocity or goal that is asked for, for planned and free steps
plans       footsteps: plans, gait, swing and reach of the legs, and who is asked for them while the robot walks
lipm        planned steps of position control: preview control, step adjustment
stepping    free steps of torque and hybrid control, which are decided as the robot goes
ground, contact, tasks    the same for both: what is known of the ground … the targets of the tasks
table       costs and gains of the tasks, for planned and free steps
balance     the stabilizer of planned steps, and of references of one's own
assembly    drives, source of references and tasks by the mode of the control
settings    the settings of the control
body, hands, load    what else is asked of the robot: set-points of the body, hands, the load that they hold
"""

from wbc.core.drive.control import State
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.contact import GaitPhase
from wbc.walking.control import WalkingControl
from wbc.walking.hands.hand import HandSettings
from wbc.walking.load import LoadSettings
from wbc.walking.plans.footsteps import FootstepPlan
from wbc.walking.plans.gait import Gait, StepGait
from wbc.walking.plans.planners import climb_stairs, turn_in_place, walk_distance, walk_path, walk_velocity
from wbc.walking.plans.swing import FootMotion
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.source import Progress, Reference, ReferenceSource, StandSource
from wbc.walking.steered import SteeredControl
from wbc.walking.stepping.settings import SteppingSettings

__all__ = [
    # Control: a measurement in, a command out
    "SteeredControl",
    "WalkingControl",
    "WalkingControlSettings",
    # Sources of references
    "Reference",
    "Progress",
    "GaitPhase",
    "ReferenceSource",
    "StandSource",
    "State",
    "Pendulum",
    "FootMotion",
    "SteppingSettings",
    # Planning: footsteps, and the phases in which they are taken
    "FootstepPlan",
    "Gait",
    "StepGait",
    "climb_stairs",
    "turn_in_place",
    "walk_distance",
    "walk_path",
    "walk_velocity",
    # Hands that press and grip, and loads that they hold
    "HandSettings",
    "LoadSettings",
]
