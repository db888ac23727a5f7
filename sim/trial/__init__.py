"""Trials: one loop, one base of specs, one base of results, used by stands, walks, motions and studies.

A part that any trial can have, such as pushes, goes here; a new experiment to a room of its own.
"""

from wbc.sim.trial.loop import Trial, TrialHook, TrialTick
from wbc.sim.trial.push import PUSH_DURATION, PushSchedule, WalkPush
from wbc.sim.trial.result import TrialResult
from wbc.sim.trial.spec import TrialSpec

__all__ = [
    # What every trial has
    "Trial",
    "TrialHook",
    "TrialResult",
    "TrialSpec",
    "TrialTick",
    # Pushes
    "PUSH_DURATION",
    "PushSchedule",
    "WalkPush",
]
