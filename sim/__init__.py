"""Simulation: the MuJoCo plant, stands and walks on it, terrains, the rig for feet, and studies.

A new experiment goes to a room of its own beside `balance` and `walks`: a `TrialSpec`, a `Trial`, a `TrialResult`.
"""

from wbc.sim.balance import TrackSpec, stand, track_motion
from wbc.sim.loop import MujocoLoop, RobotServer, SharedPlant
from wbc.sim.plant import (
    DivergedError,
    Machine,
    PhysicsSettings,
    Plant,
    SensorNoise,
    SignalNoise,
    TrueFallDetector,
    with_feet,
)
from wbc.sim.rig import FootTest, press
from wbc.sim.scenes import Scene, make_scene, scene_kind
from wbc.sim.studies import Journal, Study, cluster_executor, read_journal, register_trial, study_table, sweep
from wbc.sim.terrain import FieldFamily, ShapeFamily, bar, dome, family, param, plate, stone
from wbc.sim.terrain import (
    terrain as make_terrain,
)
from wbc.sim.trial import Trial, TrialHook
from wbc.sim.walks import WalkHook, WalkPlan, WalkPush, WalkSpec, WalkTrial, walk

__all__ = [
    # Plant: robot, feet and ground in MuJoCo
    "DivergedError",
    "Machine",
    "PhysicsSettings",
    "Plant",
    "TrueFallDetector",
    "with_feet",
    # A MuJoCo model of one's own
    "MujocoLoop",
    "RobotServer",
    # Several robots in one simulation
    "SharedPlant",
    # Plant: sensor errors
    "SensorNoise",
    "SignalNoise",
    # Balance: standing and push recovery
    "stand",
    "TrackSpec",
    "track_motion",
    # The loop of all simulations
    "Trial",
    "TrialHook",
    # Walks: spec in, result out
    "WalkHook",
    "WalkPlan",
    "WalkPush",
    "WalkSpec",
    "WalkTrial",
    "walk",
    # Terrain: grounds by name, and families of your own
    "make_terrain",
    "family",
    "param",
    "FieldFamily",
    "ShapeFamily",
    "bar",
    "dome",
    "plate",
    "stone",
    # Scenes: things before the robot, and scenes of your own
    "Scene",
    "make_scene",
    "scene_kind",
    # Rig: tests of one foot
    "FootTest",
    "press",
    # Studies: many trials, journals and tables
    "Journal",
    "Study",
    "cluster_executor",
    "read_journal",
    "register_trial",
    "study_table",
    "sweep",
]
