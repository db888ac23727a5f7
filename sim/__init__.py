"""Simulation: the MuJoCo plant, stands and walks on it, terrains, the rig for feet, and studies.

A new experiment goes to a room of its own beside `balance` and `walks`: spec, result, one function.
"""

from wbc.sim.balance import (
    BalanceGains,
    PushResult,
    PushTableSpec,
    StandPushSpec,
    StandResult,
    StandSpec,
    StandTrial,
    balance_controller,
    largest_push,
    push_standing,
    push_table,
    stand,
)
from wbc.sim.plant import (
    NO_NOISE,
    NOISE_PRESETS,
    REALISTIC,
    DivergedError,
    GroundTruth,
    PelvisLimits,
    PhysicsSettings,
    Plant,
    SensorNoise,
    SignalNoise,
    TrueFallDetector,
    real_time_factor,
    with_feet,
)
from wbc.sim.walks import (
    Fall,
    Spread,
    Touchdowns,
    TrialSettings,
    WalkHook,
    WalkPlan,
    WalkPush,
    WalkResult,
    WalkSpec,
    WalkTick,
    WalkTrial,
    WallClock,
    walk,
)

__all__ = [
    # Plant: robot, feet and ground in MuJoCo
    "DivergedError",
    "GroundTruth",
    "PelvisLimits",
    "PhysicsSettings",
    "Plant",
    "TrueFallDetector",
    "real_time_factor",
    "with_feet",
    # Plant: sensor errors
    "NOISE_PRESETS",
    "NO_NOISE",
    "REALISTIC",
    "SensorNoise",
    "SignalNoise",
    # Balance: standing and push recovery
    "BalanceGains",
    "PushResult",
    "PushTableSpec",
    "StandPushSpec",
    "StandResult",
    "StandSpec",
    "StandTrial",
    "balance_controller",
    "largest_push",
    "push_standing",
    "push_table",
    "stand",
    # Walks: spec in, result out
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
    "walk",
]
