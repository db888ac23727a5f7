"""Feet: soles, their actuator and range sensor, and what ground a swinging foot has seen.

What needs MuJoCo lives in the modules whose names end in `_mjcf` and is imported from there.
"""

from __future__ import annotations

from wbc.feet.sensing.range_sensor import RangeSampler, RangeSensor
from wbc.feet.sensing.scan import GroundScan, Profile, ScanSettings, toe_sensor
from wbc.feet.soles.actuator import StiffnessActuator, StiffnessState
from wbc.feet.soles.catalog import foot, foot_name, foot_names, register_foot
from wbc.feet.soles.contact import (
    LOOP_CLOSURE,
    PAPER_SOLE_GROUND,
    SOLE_GROUND,
    ConstraintLaw,
    ContactSpheres,
    effective_time_constant,
    solver_parameters,
)
from wbc.feet.soles.foot import Foot
from wbc.feet.soles.model import FootParts
from wbc.feet.soles.rigid import FlatFoot, RigidFoot
from wbc.feet.soles.soft import LongArchFoot, SoftFoot, TransverseBending, VariableStiffnessFoot
from wbc.feet.soles.sole import FootFit, SoleGeometry
from wbc.feet.stiffness.clusters import Clusters
from wbc.feet.stiffness.dataset import StiffnessTable
from wbc.feet.stiffness.features import FeatureSet, select_features
from wbc.feet.stiffness.model import ModelSettings, StiffnessModel
from wbc.feet.stiffness.roughness import Roughness, RoughnessSettings

__all__ = [
    "LOOP_CLOSURE",
    "PAPER_SOLE_GROUND",
    "SOLE_GROUND",
    "Clusters",
    "ConstraintLaw",
    "FeatureSet",
    "FlatFoot",
    "Foot",
    "FootFit",
    "FootParts",
    "GroundScan",
    "LongArchFoot",
    "ModelSettings",
    "Profile",
    "RangeSampler",
    "RangeSensor",
    "RigidFoot",
    "Roughness",
    "RoughnessSettings",
    "ScanSettings",
    "SoftFoot",
    "ContactSpheres",
    "SoleGeometry",
    "StiffnessActuator",
    "StiffnessModel",
    "StiffnessState",
    "StiffnessTable",
    "TransverseBending",
    "VariableStiffnessFoot",
    "effective_time_constant",
    "foot",
    "foot_name",
    "foot_names",
    "register_foot",
    "select_features",
    "solver_parameters",
    "toe_sensor",
]
