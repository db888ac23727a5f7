"""Scenes: robot, ground, forces and marks as objects and moving matrices, for the live view and for replays.

A new mark on the ground is a layer: a class in a module of its own and one line in `make_layers`.
The process that serves a live view needs a scene and no simulator: names are loaded when they are used.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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

_MODULES = {
    "layer": ("Annotations", "Layer"),
    "layers": ("make_layers",),
    "scene": ("Scene", "Snapshot", "make_scene"),
    "shapes": ("SceneObject",),
    "sources": ("PlantSource", "RobotSource"),
}


def __getattr__(name: str) -> Any:
    for module, names in _MODULES.items():
        if name in names:
            return getattr(importlib.import_module(f"wbc.app.scene.{module}"), name)
    raise AttributeError(f"module 'wbc.app.scene' has no attribute '{name}'")
