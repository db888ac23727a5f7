"""Motions: clips of robots and of people, read from the field's formats, retargeted, made feasible, and tracked."""

from wbc.motion.clip import MotionClip
from wbc.motion.feasible import FeasibleSettings, make_feasible
from wbc.motion.files import read_motion, read_skeleton, write_motion
from wbc.motion.measures import check_motion
from wbc.motion.retarget import retarget
from wbc.motion.skeleton import SkeletonClip
from wbc.motion.source import MotionSource, tracking_settings

__all__ = [
    # Clips and their files
    "MotionClip",
    "read_motion",
    "write_motion",
    # Motions of people
    "SkeletonClip",
    "read_skeleton",
    "retarget",
    # Measured, and made feasible
    "check_motion",
    "make_feasible",
    "FeasibleSettings",
    # Tracked
    "MotionSource",
    "tracking_settings",
]
