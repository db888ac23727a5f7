"""Motions: clips of joint positions read from the field's formats, measured, made feasible for a robot, and tracked."""

from wbc.motion.clip import MotionClip
from wbc.motion.contacts import Contacts, ContactSettings
from wbc.motion.feasible import FeasibleMotion, FilterSettings, make_feasible
from wbc.motion.files import MOTION_FORMATS, read_motion, write_motion
from wbc.motion.generator import MOTIONS, make_motion
from wbc.motion.inverse_kinematics import KinematicWeights
from wbc.motion.measures import MotionMeasures, check_motion
from wbc.motion.track import MotionControl, TrackSettings, first_configuration

__all__ = [
    # Clips and their files
    "MotionClip",
    "MOTION_FORMATS",
    "read_motion",
    "write_motion",
    # Made by rule
    "MOTIONS",
    "make_motion",
    # Measured, and made feasible
    "Contacts",
    "ContactSettings",
    "FeasibleMotion",
    "FilterSettings",
    "KinematicWeights",
    "MotionMeasures",
    "check_motion",
    "make_feasible",
    # Tracked
    "MotionControl",
    "TrackSettings",
    "first_configuration",
]
