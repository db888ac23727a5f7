"""Sensors of a plant that see the ground: each makes clouds of points, at its rate and with its errors.

A new one is settings with `rate` and `latency`, whose `start` returns what makes a cloud of a `wbc.Plant` as it is now.
The plant imports this room, so that here its type is any.
"""

from wbc.sim.plant.eyes.depth import DepthCamera, DepthView
from wbc.sim.plant.eyes.toes import Eyes, ToeSensors

__all__ = ["DepthCamera", "DepthView", "Eyes", "ToeSensors"]
