"""MuJoCo plant, terrains, trials and studies."""

from wbc.sim.plant import (
    DivergedError,
    GroundTruth,
    PhysicsSettings,
    Plant,
    SensorNoise,
    SignalNoise,
    real_time_factor,
)
from wbc.sim.rig import FootTest, PitchResult, PressResult, SlideResult, drop, pitch, press, slide
from wbc.sim.terrain import (
    ClearanceWarning,
    FieldFamily,
    GroundContact,
    ShapeFamily,
    Site,
    Terrain,
    add_to_spec,
    check_clearance,
    family,
    param,
    terrain,
    terrain_families,
)

__all__ = [
    "DivergedError",
    "GroundTruth",
    "PhysicsSettings",
    "Plant",
    "SensorNoise",
    "SignalNoise",
    "real_time_factor",
    # Terrain: grounds by name, and families of your own
    "terrain",
    "terrain_families",
    "Terrain",
    "add_to_spec",
    "GroundContact",
    "check_clearance",
    "ClearanceWarning",
    "family",
    "param",
    "FieldFamily",
    "ShapeFamily",
    "Site",
    # Rig: tests of one foot
    "FootTest",
    "press",
    "drop",
    "slide",
    "pitch",
    "PressResult",
    "SlideResult",
    "PitchResult",
]
