"""Knowledge of the ground: heights from clouds of points and maps, and the contact of a sole on them.

Convert a new kind of input to a `PointCloud` or an `ElevationMap`. A new question about a landing is a method of
`Footprint`.
"""

from wbc.ground.cloud import ElevationMap, PointCloud
from wbc.ground.height_map import HeightMap
from wbc.ground.known import KnownGround

__all__ = ["ElevationMap", "HeightMap", "KnownGround", "PointCloud"]
