"""Simulations: the plant, models and engines of others, trials in them, grounds, scenes, the rig of feet, and studies.

`wbc.sim.studies` runs many trials, and has their journals and tables. A new kind of experiment goes into a folder of
its own beside `balance` and `walks`, with a `TrialSpec`, a `Trial` and a `TrialResult`.
"""

from wbc.sim.balance.standing import stand
from wbc.sim.balance.tracking import TrackSpec, track_motion
from wbc.sim.foreign.engine import EngineContacts, EngineLoop, EnginePush
from wbc.sim.foreign.mujoco_model import MujocoLoop
from wbc.sim.foreign.shared import SharedPlant
from wbc.sim.plant.eyes import DepthCamera, DepthView
from wbc.sim.plant.fitting import with_feet
from wbc.sim.plant.physics import PhysicsSettings
from wbc.sim.plant.plant import Plant
from wbc.sim.plant.server import RobotServer
from wbc.sim.rig.press import press
from wbc.sim.rig.rig import FootTest
from wbc.sim.scenes.base import Scene, make_scene, scene_kind
from wbc.sim.simulation.machine import Machine
from wbc.sim.simulation.sensors import SensorNoise, SignalNoise
from wbc.sim.simulation.simulation import DivergedError, Simulation
from wbc.sim.terrain.families.base import FieldFamily, ShapeFamily, family, param
from wbc.sim.terrain.shapes import dome
from wbc.sim.terrain.spec import terrain as make_terrain
from wbc.sim.trial.falls import TrueFallDetector
from wbc.sim.trial.loops import register_loop, trial_loop
from wbc.sim.trial.push import WalkPush
from wbc.sim.trial.trial import Trial, TrialHook
from wbc.sim.walks.plan import WalkPlan
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial, walk

__all__ = [
    # What every simulation of a robot has
    "DivergedError",
    "Simulation",
    # Plant: robot, feet and ground in MuJoCo
    "Machine",
    "PhysicsSettings",
    "Plant",
    "TrueFallDetector",
    "with_feet",
    # Sensors that see the ground
    "DepthCamera",
    "DepthView",
    # A MuJoCo model of one's own
    "MujocoLoop",
    "RobotServer",
    # A physics engine of one's own
    "EngineContacts",
    "EngineLoop",
    "EnginePush",
    # Several robots in one simulation
    "SharedPlant",
    # Plant: sensor errors
    "SensorNoise",
    "SignalNoise",
    # Balance: standing and push recovery
    "stand",
    "TrackSpec",
    "track_motion",
    # Trials, and the simulation in which they run
    "Trial",
    "TrialHook",
    "register_loop",
    "trial_loop",
    # Walks: spec in, result out
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
    "dome",
    # Scenes: things before the robot, and scenes of your own
    "Scene",
    "make_scene",
    "scene_kind",
    # Rig: one foot pressed on a ground
    "FootTest",
    "press",
]
