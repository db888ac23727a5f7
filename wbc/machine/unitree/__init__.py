"""Unitree's low-level topics over DDS: driver of a G1.

Needs the extra `unitree`.
"""

from wbc.machine.unitree.dds import DdsError
from wbc.machine.unitree.driver import UnitreeDriver

__all__ = ["DdsError", "UnitreeDriver"]
