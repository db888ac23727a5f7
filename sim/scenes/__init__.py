"""Scenes: things before the robot, by name with parameters, that hands and the rest of the body touch.

    >>> make_scene("wall", distance=0.6).distance
    0.6

A new scene goes into `things`.
"""

from wbc.sim.scenes import things  # noqa: F401 - registers the scenes
