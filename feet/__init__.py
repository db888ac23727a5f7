"""Feet: soles and their actuator, the range sensor under the toe, and stiffness from the roughness of the ground.

A new foot goes to `soles/`, a new sensor to `sensing/`, a new model of stiffness to `stiffness/`. Modules that need
MuJoCo end in `_mjcf` and are imported from there.
"""

from __future__ import annotations

from wbc.feet.sensing.range_sensor import RangeSampler, RangeSensor
from wbc.feet.sensing.scan import (
    PROFILE_STEP,
    GroundScan,
    Profile,
    ScanSettings,
    resample,
    windows,
)
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
from wbc.feet.soles.foot import Foot, fitted_sole
from wbc.feet.soles.parts import FootParts
from wbc.feet.soles.rigid import FlatFoot, RigidFoot
from wbc.feet.soles.soft import LongArchFoot, PaperFoot, SoftFoot, VariableStiffnessFoot, toe_sensor
from wbc.feet.soles.soft_design import TransverseBending
from wbc.feet.soles.sole import SIDES, FootFit, SoleGeometry
from wbc.feet.stiffness.analysis import (
    LearningCurve,
    PrincipalComponents,
    amplitude_trends,
    learning_curve,
    principal_components,
)
from wbc.feet.stiffness.clusters import Clusters
from wbc.feet.stiffness.comparison import candidates, compare, comparison_table
from wbc.feet.stiffness.dataset import ProfileRecipe, StiffnessTable
from wbc.feet.stiffness.features import (
    PAPER_FEATURES,
    WINDOW_FEATURES,
    FeatureSet,
    Selection,
    select_features,
)
from wbc.feet.stiffness.figures import draw_model, labels_figure
from wbc.feet.stiffness.model import (
    DEFAULT_MODEL,
    DEFAULT_TABLE,
    ModelSettings,
    Prediction,
    StiffnessModel,
    default_model,
)
from wbc.feet.stiffness.roughness import (
    PARAMETERS,
    UNITS,
    Roughness,
    RoughnessSettings,
    low_pass,
    profile_roughness,
    roughness,
)
from wbc.feet.stiffness.validation import Candidate, Validation, cross_validate

__all__ = [
    # Feet by name
    "foot",
    "foot_name",
    "foot_names",
    "register_foot",
    # Designs
    "FlatFoot",
    "RigidFoot",
    "SoftFoot",
    "LongArchFoot",
    "PaperFoot",
    "VariableStiffnessFoot",
    "TransverseBending",
    # A design of your own
    "Foot",
    "FootFit",
    "FootParts",
    "SoleGeometry",
    "fitted_sole",
    "SIDES",
    # Contact with the ground
    "ContactSpheres",
    "ConstraintLaw",
    "LOOP_CLOSURE",
    "PAPER_SOLE_GROUND",
    "SOLE_GROUND",
    "effective_time_constant",
    "solver_parameters",
    # Actuator of the sole
    "StiffnessActuator",
    "StiffnessState",
    # Range sensor and scanned profile
    "RangeSensor",
    "RangeSampler",
    "GroundScan",
    "ScanSettings",
    "Profile",
    "PROFILE_STEP",
    "resample",
    "toe_sensor",
    "windows",
    # Roughness of a profile
    "Roughness",
    "RoughnessSettings",
    "PARAMETERS",
    "UNITS",
    "roughness",
    "profile_roughness",
    "low_pass",
    # Stiffness from roughness
    "StiffnessModel",
    "ModelSettings",
    "Prediction",
    "Clusters",
    "FeatureSet",
    "PAPER_FEATURES",
    "WINDOW_FEATURES",
    "DEFAULT_MODEL",
    "default_model",
    # Training data
    "StiffnessTable",
    "ProfileRecipe",
    "DEFAULT_TABLE",
    "Selection",
    "select_features",
    "amplitude_trends",
    "PrincipalComponents",
    "principal_components",
    # Validation of models
    "Candidate",
    "Validation",
    "candidates",
    "compare",
    "comparison_table",
    "cross_validate",
    "LearningCurve",
    "learning_curve",
    "draw_model",
    "labels_figure",
]
