"""Feet: soles and their actuators, the range sensor under the toe, and the stiffness for a roughness of the ground.

A new foot goes into `soles/`, a new sensor into `sensing/`, a new model of stiffness into `stiffness/`. The names of
modules that need MuJoCo end in `_mjcf`; they are not exported here.
"""

from __future__ import annotations

from wbc.feet.sensing.range_sensor import RangeSensor
from wbc.feet.sensing.roughness import roughness
from wbc.feet.soles.actuator import StiffnessActuator
from wbc.feet.soles.catalog import foot, register_foot
from wbc.feet.soles.foot import Foot, FootFit, FootParts, fitted_sole
from wbc.feet.soles.soft import SoftFoot, VariableStiffnessFoot
from wbc.feet.stiffness.model import StiffnessModel

__all__ = [
    # Feet by name
    "foot",
    "register_foot",
    # Designs
    "SoftFoot",
    "VariableStiffnessFoot",
    # A design of your own
    "Foot",
    "FootFit",
    "FootParts",
    "fitted_sole",
    # Actuator of the sole
    "StiffnessActuator",
    # Range sensor and scanned profile
    "RangeSensor",
    # Roughness of a profile
    "roughness",
    # Stiffness from roughness
    "StiffnessModel",
]
