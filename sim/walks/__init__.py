"""Simulated walks: spec in, result out."""

from wbc.sim.walks.hooks import WalkHook, WalkTick
from wbc.sim.walks.plans import WalkPlan
from wbc.sim.walks.push import WalkPush
from wbc.sim.walks.result import Fall, Spread, Touchdowns, WalkResult, WallClock
from wbc.sim.walks.run import WalkTrial, run_walk
from wbc.sim.walks.settings import TrialSettings
from wbc.sim.walks.spec import WalkSpec

__all__ = [
    "Fall",
    "Spread",
    "Touchdowns",
    "TrialSettings",
    "WalkHook",
    "WalkPlan",
    "WalkPush",
    "WalkResult",
    "WalkSpec",
    "WalkTick",
    "WalkTrial",
    "WallClock",
    "run_walk",
]
