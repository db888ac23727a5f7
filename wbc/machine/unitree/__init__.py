"""Unitree's low-level topics over DDS: driver of a G1, its motion switcher, and a robot's end of them for simulations.

Needs the extra `unitree`.
"""

from wbc.machine.unitree.dds import DdsError
from wbc.machine.unitree.driver import UnitreeDriver
from wbc.machine.unitree.switch import MotionSwitcher

__all__ = ["DdsError", "MotionSwitcher", "UnitreeDriver"]
