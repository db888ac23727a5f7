"""Motions: clips of joint positions read from the field's formats, measured, made feasible for a robot, and tracked."""

from wbc.motion.clip import MotionClip
from wbc.motion.feasible import make_feasible
from wbc.motion.files import read_motion, write_motion
from wbc.motion.measures import check_motion
from wbc.motion.source import MotionSource, tracking_settings

__all__ = [
    # Clips and their files
    "MotionClip",
    "read_motion",
    "write_motion",
    # Measured, and made feasible
    "check_motion",
    "make_feasible",
    # Tracked
    "MotionSource",
    "tracking_settings",
]
