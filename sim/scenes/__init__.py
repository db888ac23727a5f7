"""Scenes: things before the robot, by name with parameters, that hands and the rest of the body touch.

    >>> make_scene("wall", distance=0.6).distance
    0.6

A new scene goes into `things`.
"""

from wbc.sim.scenes import things  # noqa: F401 - registers the scenes
from wbc.sim.scenes.base import Scene, make_scene, param, scene_kind, scene_kinds

__all__ = [
    # Scenes by name
    "Scene",
    "make_scene",
    "scene_kinds",
    # A scene of your own
    "param",
    "scene_kind",
]
