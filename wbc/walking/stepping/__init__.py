"""Walk that balances by its steps: place and time of every step are decided at every tick.

A rule for where or when to step goes into `law`, what the robot does between two steps into `gait`.
"""

from wbc.walking.stepping.control import SteppingControl, SteppingControlSettings
from wbc.walking.stepping.gait import BodyState, SteppingGait
from wbc.walking.stepping.law import Divergent, Orbit, divergent_component, foothold, remaining_time
from wbc.walking.stepping.settings import Scale, SteppingSettings
from wbc.walking.stepping.tasks import SteppingGains
from wbc.walking.stepping.walk import SteppingWalk

__all__ = [
    "BodyState",
    "Divergent",
    "Orbit",
    "Scale",
    "SteppingControl",
    "SteppingControlSettings",
    "SteppingGains",
    "SteppingGait",
    "SteppingSettings",
    "SteppingWalk",
    "divergent_component",
    "foothold",
    "remaining_time",
]
