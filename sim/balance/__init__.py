"""Simulated balance: stands, push recovery, and motions that are tracked.

A new kind of experiment on a standing robot goes here, as a module with its spec, its result and one function.
"""

from wbc.sim.balance.push_recovery import (
    PushCell,
    PushResult,
    PushTableSpec,
    StandPushSpec,
    format_push_table,
    largest_push,
    push_standing,
    push_table,
)
from wbc.sim.balance.standing import StandResult, StandSpec, StandTrial, centre_of_pressure, stand
from wbc.sim.balance.tracking import TrackResult, TrackSpec, TrackTrial, track_motion

__all__ = [
    # Standing
    "StandResult",
    "StandSpec",
    "StandTrial",
    "centre_of_pressure",
    "stand",
    # Push recovery
    "PushCell",
    "PushResult",
    "PushTableSpec",
    "StandPushSpec",
    "format_push_table",
    "largest_push",
    "push_standing",
    "push_table",
    # Motions
    "TrackResult",
    "TrackSpec",
    "TrackTrial",
    "track_motion",
]
