"""Readers of URDF and MJCF: the mechanism of the robot, and what else the file gives.

Modules that end in `_mjcf` import MuJoCo; they are imported when an MJCF is read and not before.
"""
