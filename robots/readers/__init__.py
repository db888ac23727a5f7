"""Readers of robot files other than URDF: each writes the robot as one URDF and says what else the file gives.

Modules that end in `_mjcf` import MuJoCo; they are imported when an MJCF is read and not before.
"""
