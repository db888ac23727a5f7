"""Feet: rigid, soft and variable-stiffness soles, their actuator and their range sensor.

What needs MuJoCo lives in the modules whose names end in `_mjcf` and is imported from there.
"""

from __future__ import annotations

from wbc.feet.actuator import StiffnessActuator, StiffnessState
from wbc.feet.catalog import foot, foot_name, foot_names, register_foot
from wbc.feet.contact import (
    LOOP_CLOSURE,
    PAPER_SOLE_GROUND,
    SOLE_GROUND,
    ConstraintLaw,
    SoleContact,
    effective_time_constant,
    solver_parameters,
)
from wbc.feet.foot import Foot
from wbc.feet.model import FootModel
from wbc.feet.range_sensor import RangeSampler, RangeSensor
from wbc.feet.rigid import FlatFoot, RigidFoot
from wbc.feet.soft import SoftFoot, TransverseBending, VariableStiffnessFoot
from wbc.feet.sole import FootFit, SoleGeometry

__all__ = [
    "LOOP_CLOSURE",
    "PAPER_SOLE_GROUND",
    "SOLE_GROUND",
    "ConstraintLaw",
    "FlatFoot",
    "Foot",
    "FootFit",
    "FootModel",
    "RangeSampler",
    "RangeSensor",
    "RigidFoot",
    "SoftFoot",
    "SoleContact",
    "SoleGeometry",
    "StiffnessActuator",
    "StiffnessState",
    "TransverseBending",
    "VariableStiffnessFoot",
    "effective_time_constant",
    "foot",
    "foot_name",
    "foot_names",
    "register_foot",
    "solver_parameters",
]
