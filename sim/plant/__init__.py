"""The MuJoCo plant: robot, feet and ground as one simulation with drives, sensors and pushes."""

from wbc.sim.plant.plant import DivergedError, Plant, real_time_factor
from wbc.sim.plant.sensors import SensorNoise, SignalNoise
from wbc.sim.plant.settings import PhysicsSettings
from wbc.sim.plant.truth import GroundTruth

__all__ = [
    "DivergedError",
    "GroundTruth",
    "PhysicsSettings",
    "Plant",
    "SensorNoise",
    "SignalNoise",
    "real_time_factor",
]
