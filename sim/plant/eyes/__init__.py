"""Sensors of a plant that see the ground: each makes clouds of points, at its rate and with its errors.

A new one is settings with `rate` and `latency`, whose `start` returns what makes a cloud of a plant as it is now.
"""

from wbc.sim.plant.eyes.depth import DepthCamera, DepthView
from wbc.sim.plant.eyes.toes import ToeSensors

__all__ = ["DepthCamera", "DepthView", "ToeSensors"]
