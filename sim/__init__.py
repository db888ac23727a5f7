"""MuJoCo plant, terrains, trials and studies."""

from wbc.sim.plant import (
    DivergedError,
    GroundTruth,
    PhysicsSettings,
    Plant,
    SensorNoise,
    SignalNoise,
    real_time_factor,
)

__all__ = [
    "DivergedError",
    "GroundTruth",
    "PhysicsSettings",
    "Plant",
    "SensorNoise",
    "SignalNoise",
    "real_time_factor",
]
