"""The MuJoCo plant: robot, feet and ground as one simulation with drives, sensors and pushes.

A new sensor error goes to `sensors`, a new setting of the physics to `settings`.
"""

from wbc.sim.plant.falls import PelvisLimits, TrueFallDetector
from wbc.sim.plant.fitting import with_feet
from wbc.sim.plant.plant import DivergedError, Plant, real_time_factor
from wbc.sim.plant.sensors import NO_NOISE, NOISE_PRESETS, REALISTIC, SensorNoise, SignalNoise
from wbc.sim.plant.settings import Machine, PhysicsSettings
from wbc.sim.plant.truth import GroundTruth

__all__ = [
    # Plant
    "DivergedError",
    "Machine",
    "PhysicsSettings",
    "Plant",
    "real_time_factor",
    "with_feet",
    # Sensor errors
    "NOISE_PRESETS",
    "NO_NOISE",
    "REALISTIC",
    "SensorNoise",
    "SignalNoise",
    # Ground truth
    "GroundTruth",
    "PelvisLimits",
    "TrueFallDetector",
]
