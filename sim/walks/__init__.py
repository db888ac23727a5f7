"""Simulated walks: spec in, result out.

What a walk is asked to do is a field of the spec; a new figure goes to `meter` and `result`.
"""

from wbc.sim.trial.push import WalkPush
from wbc.sim.walks.plans import WalkPlan
from wbc.sim.walks.prepare import PreparedWalk
from wbc.sim.walks.result import Fall, Spread, Touchdowns, WalkResult, WallClock, objective
from wbc.sim.walks.settings import TrialSettings
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkHook, WalkTick, WalkTrial, walk

__all__ = [
    # Spec
    "PreparedWalk",
    "TrialSettings",
    "WalkPlan",
    "WalkPush",
    "WalkSpec",
    # Walk
    "WalkHook",
    "WalkTick",
    "WalkTrial",
    "walk",
    # Result
    "Fall",
    "Spread",
    "Touchdowns",
    "WalkResult",
    "WallClock",
    "objective",
]
