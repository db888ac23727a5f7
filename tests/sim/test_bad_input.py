"""Options that plant, grounds, rig, walks, studies and journals refuse: the type of the error and what it names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from wbc import Plant, PositionControl
from wbc.app.log.recorder import Recorder
from wbc.app.plot.signals import draw_signals
from wbc.app.replay.replay import Replay
from wbc.base.errors import InputError, UnknownNameError
from wbc.core.drive.control import Control
from wbc.feet import foot
from wbc.motion import MotionClip
from wbc.robots import RobotDescription, load
from wbc.sim import (
    DepthCamera,
    FieldFamily,
    FootTest,
    SharedPlant,
    WalkPlan,
    WalkPush,
    WalkSpec,
    dome,
    family,
    make_scene,
    param,
    scene_kind,
    stand,
    walk,
)
from wbc.sim import make_terrain as ground
from wbc.sim.plant.physics import PhysicsSettings
from wbc.sim.studies import (
    Cell,
    Journal,
    Study,
    cluster_executor,
    local_executor,
    read_journal,
    study_entries,
    study_frame,
    study_table,
)
from wbc.sim.studies.outcomes import trial_from_json
from wbc.sim.terrain.spec import Terrain, terrain
from wbc.sim.trial.loops import trial_loop
from wbc.sim.trial.trial import Trial
from wbc.tasks import Behaviour, PostureTask, Program, StateMachine, reached
from wbc.tasks.balance import balance_controller
from wbc.walking import Gait
from wbc.walking.plans.footsteps import Footstep, FootstepPlan

make = partial(Plant, load("hrp4_class"))
soft = partial(WalkSpec, foot="soft")
model = partial(WalkSpec, foot="variable", policy="model")
fixed = partial(WalkSpec, foot="variable", policy="fixed")
study = partial(Study, name="s", cells=(Cell("a", {}),), arms={"flat": {"foot": "flat"}}, seeds=(100, 101))
BOX = (1.0, 2.0, -0.2, 0.2)
"""Sides of an area, m."""
image = partial(terrain, "image", 0.03, metres_per_pixel=0.01)


def areas(*values: float | str | None) -> Terrain:
    return terrain("flat", areas=values)


@cache
def plant() -> Plant:
    return make()


def journal(method: str, value: object) -> None:
    with TemporaryDirectory() as folder, Journal(Path(folder) / "j.jsonl") as made:
        getattr(made, method)(value)


def program(*args: Any, **options: Any) -> None:
    control = PositionControl(balance_controller(plant().robot.clone(), 0.005))
    Program(StateMachine("m", [Behaviour("a", timeout=1.0)]), control).run(*args, **options)


REFUSED: dict[str, list[tuple[Callable[[], object], str]]] = {
    "plant": [
        (lambda: make(foot="sof"), "soft"),
        (lambda: make(timestep=0.0), "timestep"),
        (lambda: make(control_period=0.0025), "period"),
        (lambda: make(initial_configuration=np.zeros(41)), "quaternion"),
        (lambda: make(scene="<mujoco><worldbody><body/></mujoco>"), "scene"),
        (lambda: make(scene=make_scene("wall", distance=0.05)), "wall"),
        (lambda: make(scene="rail").grip("left_hand", "lft handle"), "left handle"),
        (lambda: plant().push("torsso", [1, 0, 0], 0.1), "torso"),
        (lambda: plant().push("universe", [1, 0, 0], 0.1), "no body 'universe'"),
        (lambda: plant().reset(2.0 * plant().robot.half_sitting), "quaternion"),
    ],
    "degrees": [
        (lambda: plant().reset(np.r_[plant().start[:7], 45.0, plant().start[8:]]), "rad"),
        (lambda: WalkSpec(start=(0.0, 0.0, 90.0)), "rad"),
        (lambda: WalkPlan(turn=90.0), "rad"),
        (lambda: WalkPush(impulse=0.1, direction=45.0), "rad"),
        (lambda: FootTest(yaw=15.0), "rad"),
        (lambda: DepthCamera(turn=(0.0, 53.0, 0.0)), "rad"),
        (lambda: SharedPlant({"a": "hrp4_class"}, places={"a": (0.0, 0.0, 180.0)}), "rad"),
    ],
    "a name, a description, a robot": [
        (lambda: Plant(plant().robot, visuals=False), "load_robot"),  # type: ignore[arg-type]
        (lambda: Plant("hrp5_class", visuals=False), "hrp4_class"),
        (lambda: SharedPlant({"a": plant().robot}), "load_robot"),  # type: ignore[dict-item]
        (lambda: walk("g1"), "robot='g1'"),  # type: ignore[arg-type]
        (lambda: stand(load("g1")), "robot='g1'"),  # type: ignore[arg-type]
        (lambda: Plant("hrp4_class", foot=foot, visuals=False), "Foot"),  # type: ignore[arg-type]
    ],
    "ground": [
        (lambda: terrain("stones", smallest=0.2), "smallest"),
        (lambda: terrain("flat", 0.01), "amplitude"),
        (lambda: terrain("slope", length=0.5), "ramp"),
        (lambda: ground("stones", 1e9), "amplitude"),
        (lambda: terrain("flat").profile(1.0, 0.5), "x1"),
        (lambda: terrain("patchwork", families="boards:0.5"), "height"),
        (lambda: terrain("patchwork", families="boards:x"), "height of boards .* must be a number, got 'x'$"),
        (lambda: terrain("patchwork", families="boards:0 stones"), "above 0"),
        (lambda: image(source="none.png"), "none.png"),
        (lambda: image(source=np.array([[np.nan, 1.0], [2.0, 3.0]])), "finite"),
        (lambda: terrain("image", source=np.eye(5)), "metres_per_pixel|scale"),
        (lambda: dome(0.0, 0.0, 1e300, 0.1), r"radius of dome \(m\)"),
        (lambda: dome(0.0, 0.0, 0.1, 1e4), r"top of dome \(m\)"),
    ],
    "a floor that gives, an area": [
        (lambda: terrain("flat", floor_stiffness=0.0), "floor_stiffness"),
        (lambda: terrain("flat", floor_stiffness=np.nan), "floor_stiffness"),
        (lambda: terrain("flat", floor_stiffness=1e7, floor_damping=-1.0), "floor_damping"),
        (lambda: terrain("flat", floor_damping=1e5), "floor_stiffness"),
        (lambda: areas(0.5), "six values"),
        (lambda: areas(*BOX, "friction"), "friction, stiffness, damping, speed"),
        (lambda: areas(*BOX, "frition", 0.2), "did you mean 'friction'"),
        (lambda: areas(2.0, 1.0, -0.2, 0.2, "friction", 0.1), "greater x"),
        (lambda: areas(1.0, 2.0, 0.2, 0.2, "friction", 0.1), "greater y"),
        (lambda: areas(*BOX, "friction", -0.1), "from 0 to 2, got -0.1"),
        (lambda: areas(*BOX, "friction", 2.5), "from 0 to 2, got 2.5"),
        (lambda: areas(*BOX, "friction", np.nan), "finite"),
        (lambda: areas(*BOX, "friction", None), "finite numbers"),
        (lambda: areas(1.0, "wide", -0.2, 0.2, "friction", 0.3), "finite numbers"),
        (lambda: areas(*BOX, "stiffness", 0.0), r"from 1 to 1e\+12 N/m³, got 0"),
        (lambda: areas(*BOX, "speed", 9.0), "m/s, got 9"),
        (lambda: areas(*BOX, "damping", 1e5), "floor_stiffness"),
        (
            lambda: areas(*BOX, "friction", 0.2, 1.5, None, 0.0, None, "friction", 0.3),
            r"friction 0.2 at x 1 to 2 m, .* and that of friction 0.3 at x 1.5 to inf m, y 0 to inf m overlap",
        ),
        (lambda: SharedPlant({"a": "g1"}, terrain=terrain("flat", floor_stiffness=1e7)), "floor_stiffness"),
        (lambda: WalkSpec(terrain_params={"areas": (*BOX, "friction", 3.0)}), "from 0 to 2, got 3"),
    ],
    "rig": [
        (lambda: FootTest(physics=PhysicsSettings(gravity=0.0)), "gravity"),
        (lambda: FootTest(foot=foot("soft", ankle_height=0.01)), "foot"),
    ],
    "walk": [
        (lambda: WalkSpec(foot="flat", stiffness=5.0), "stiffness"),
        (lambda: soft(foot_changes={"stiffness": 1.0}), "stiffness"),
        (lambda: WalkSpec(control_period=0.0025), "0.002"),
        (lambda: WalkSpec(control_period=1e308), r"control_period \(s\)"),
        (lambda: WalkSpec(timestep=1e-300), r"timestep \(s\)"),
        (
            lambda: Plant("hrp4_class", physics=PhysicsSettings(timestep=0.003), visuals=False),
            "multiple of the physics step 0.003",
        ),
        (lambda: WalkSpec(changes={"margin": 0.01}), "distribution.margin"),
        (lambda: WalkSpec(changes={"com_height": 1.5}), "CoM height"),
        (lambda: WalkSpec(gait=Gait(step_length=0.5)), "reach"),
        (lambda: WalkSpec(gait=Gait(swing_height=0.6)), "reach"),
        (
            lambda: WalkSpec(terrain="stones", terrain_params={"length": 2.0}, plan=WalkPlan(distance=5.0)),
            "ground",
        ),
        (lambda: WalkSpec(plan=WalkPlan(stairs="together")), "stairs"),
        (lambda: WalkSpec(plan=WalkPlan(footsteps=(Footstep("left", 0.1, -0.09),))), "reach|overlap"),
        (lambda: WalkSpec(pushes=(WalkPush(impulse=0.1, time=1.0, body="torzo"),)), "torso"),
        (lambda: WalkPlan(distance=1.0, turn=1.0), "distance and turn"),
        (lambda: WalkPush(impulse=0.1, time=1.0, step=2), "time"),
        (lambda: soft(policy="model"), "variable"),
        (lambda: model(policy_params=(("path", "nowhere.json"),)), "nowhere.json"),
    ],
    "study": [
        (lambda: study(reference="hard"), "flat"),
        (lambda: study(cells=(Cell("a", {}), Cell("a", {}))), "'a'"),
        (lambda: study(seeds=(100, 101, 100)), "100"),
        (lambda: study().narrowed(seeds=9), "seeds|from 1"),
        (lambda: Journal(Path("/")), "folder"),
        (lambda: Study.from_json({"name": "s", "cells": [{"name": "a"}]}), "cells of a study"),
        (lambda: Study.from_json({"name": "s", "cells": {"a": 3}}), "cells of a study"),
    ],
    "an object of another kind": [
        (lambda: study_table(3, {}), "study of study_table must be of class Study"),  # type: ignore[arg-type]
        (lambda: study_frame(study(), {"a": 1}), "must be of class Entry"),  # type: ignore[dict-item]
        (lambda: study_table(study(), {}, by="terrain"), "by of study_table must be a sequence"),
        (lambda: trial_from_json([]), "a spec must be a mapping"),  # type: ignore[arg-type]
        (lambda: read_journal(3), "path of read_journal"),  # type: ignore[arg-type]
        (lambda: make_scene([]), "name of make_scene"),  # type: ignore[arg-type]
        (lambda: foot({}), "name of foot"),  # type: ignore[arg-type]
        (lambda: trial_loop([]), "name of trial_loop"),  # type: ignore[arg-type]
        (lambda: Trial(3, Control()), "'robot' is missing in 3"),  # type: ignore[arg-type]
        (lambda: FootstepPlan(1, 2, (), Gait()), "left of a plan must be of class Footstep"),  # type: ignore[arg-type]
        (lambda: replace(FootstepPlan.standing(plant().robot), steps=3), "steps of a plan must be"),
        (lambda: replace(FootstepPlan.standing(plant().robot), gait=None), "gait of a plan must be"),
        (lambda: PostureTask(joint_weights=[1.0]), "joint_weights"),  # type: ignore[arg-type]
        (lambda: plant().push(3, (1.0, 0.0, 0.0), 0.1), "body of Plant.push"),  # type: ignore[arg-type]
        (lambda: study().narrowed("a"), "cells of Study.narrowed must be a sequence"),
        (lambda: load("g1").with_servos("*=1,2"), "gains of RobotDescription.with_servos must be a sequence"),
        (lambda: Replay("walk.arrow"), "log of Replay must be of class Log"),  # type: ignore[arg-type]
        (lambda: Recorder(3), "path of Recorder"),  # type: ignore[arg-type]
        (lambda: plant().sole_pose("left"), "side of Plant.sole_pose"),  # type: ignore[arg-type]
        (lambda: plant().sole_pose(2), "side of Plant.sole_pose"),
        (lambda: PhysicsSettings().apply(plant().model), "spec of PhysicsSettings.apply"),  # type: ignore[arg-type]
        (lambda: study().titled([]), "part of Study.titled"),  # type: ignore[arg-type]
        (lambda: Journal(3), "path of Journal"),  # type: ignore[arg-type]
        (lambda: journal("entry", 3), "a trial must have kind and to_json"),
        (lambda: journal("add", {}), "entry of Journal.add"),
        (lambda: RobotDescription.from_urdf(3), "source of RobotDescription.from_urdf"),  # type: ignore[arg-type]
        (lambda: MotionClip.of("g1", np.zeros((2, 36)), 50.0), "robot of MotionClip.of"),  # type: ignore[arg-type]
        (lambda: MotionClip.of(plant().robot, np.zeros(41), 50.0), r"shape \(T, 41\)"),
        (lambda: family("holes")(int), "derived from Family"),  # type: ignore[type-var]
        (lambda: family("holes")(type("Holes", (FieldFamily,), {})), "'holes' must have .* feature=1.0"),
        (lambda: scene_kind("shelf")(int), "derived from Scene"),  # type: ignore[type-var]
        (lambda: param(1.0, 3), "about of param"),  # type: ignore[arg-type]
        (lambda: study_entries(3, {}), "study of study_entries"),  # type: ignore[arg-type]
        (lambda: local_executor(0), "workers of local_executor"),
        (lambda: cluster_executor(3), "address of cluster_executor"),  # type: ignore[arg-type]
        (lambda: reached("left_hand"), "waits for must have reached"),
        (lambda: program(3), "a plant must have measure and step"),
        (lambda: program(plant(), seconds=-1.0), "seconds of Program.run"),
        (lambda: draw_signals([3], ["time"]), "logs.* of draw_signals must be of class Log"),  # type: ignore[list-item]
    ],
}


@pytest.mark.parametrize(("call", "named"), [(*row,) for rows in REFUSED.values() for row in rows])
def test_an_option_that_cannot_be_used_is_refused(call: Callable[[], Any], named: str) -> None:
    with pytest.raises((InputError, UnknownNameError), match=named):
        call()


@pytest.mark.parametrize("name", ["control_period", "timestep", "steps", "seed"])
def test_what_a_plant_is_made_of_cannot_be_assigned(name: str) -> None:
    before = getattr(plant(), name)
    with pytest.raises(InputError, match=f"{name} of Plant cannot be assigned"):
        setattr(plant(), name, 1)
    assert getattr(plant(), name) == before
