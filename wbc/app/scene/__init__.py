"""Scenes: robot, ground, forces and marks as objects and moving matrices, for the live view and for replays.

A new mark on the ground is a layer: a class in a module of its own and one line in `make_layers`.
"""

from wbc.app.scene.layer import Annotations, Layer
from wbc.app.scene.layers import make_layers
from wbc.app.scene.scene import Scene, Snapshot, make_scene
from wbc.app.scene.shapes import SceneObject
from wbc.app.scene.sources import PlantSource, RobotSource

__all__ = [
    "Annotations",
    "Layer",
    "PlantSource",
    "RobotSource",
    "Scene",
    "SceneObject",
    "Snapshot",
    "make_layers",
    "make_scene",
]
