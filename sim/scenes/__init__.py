"""Scenes: things before the robot, by name with parameters, that hands and the rest of the body touch.

    >>> make_scene("wall", distance=0.6).distance
    0.6

A new scene goes into `things`, or into `loose` where a robot walks on it.
"""

from wbc.sim.scenes import loose, things  # noqa: F401 - registers the scenes
