"""Scenes: robot, ground, forces and marks as objects and moving matrices, for the live view and for replays.

A new mark on the ground is a layer: a class in a module of its own and one line in `make_layers`.
The process that serves a live view needs a scene and no simulator: names are loaded when they are used.
"""
