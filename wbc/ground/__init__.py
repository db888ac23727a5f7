"""Knowledge of the ground: heights from clouds of points and maps, and the contact of a sole on them.

A new kind of input becomes a `PointCloud` or an `ElevationMap`; a new question about a landing is a method of
`Footprint`.
"""

from wbc.ground.cloud import ElevationMap, PointCloud
from wbc.ground.footprint import Footprint, FootprintSettings
from wbc.ground.height_map import HeightMap, HeightMapSettings
from wbc.ground.known import GroundSettings, KnownGround

__all__ = [
    # Inputs
    "PointCloud",
    "ElevationMap",
    # Heights on cells
    "HeightMap",
    "HeightMapSettings",
    # What a sole would meet
    "Footprint",
    "FootprintSettings",
    # All of it for one robot
    "KnownGround",
    "GroundSettings",
]
