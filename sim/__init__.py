"""MuJoCo plant, terrains, trials and studies."""

from wbc.sim.plant import DivergedError, Plant, real_time_factor
from wbc.sim.sensors import SensorNoise, SignalNoise
from wbc.sim.settings import PhysicsSettings
from wbc.sim.truth import GroundTruth

__all__ = [
    "DivergedError",
    "GroundTruth",
    "PhysicsSettings",
    "Plant",
    "SensorNoise",
    "SignalNoise",
    "real_time_factor",
]
