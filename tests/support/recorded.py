"""A short walk on soft soles with noisy sensors, recorded once for all tests of a process."""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import wbc
from wbc.app.log.reader import Log
from wbc.app.log.recorder import Recorder
from wbc.core.signals import Command, Measurement
from wbc.feet import RangeSensor, foot
from wbc.feet.stiffness.model import StiffnessDecision
from wbc.sim.plant.fitting import with_feet
from wbc.sim.terrain.spec import terrain
from wbc.tasks.scheduling.policies import SwingScan
from wbc.tasks.scheduling.stiffness import StepStiffness, StiffnessScheduler, StiffnessTiming
from wbc.walking.control import WalkingControl
from wbc.walking.plans.footsteps import FootstepPlan
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.planners import walk_distance
from wbc.walking.settings import WalkingControlSettings

GAIT = Gait(single_support=0.6, double_support=0.2, initial_double_support=0.5, final_double_support=0.3)
SECONDS = 3.0

Hook = Callable[[wbc.Plant, WalkingControl, Measurement, Command], None]


def make_walk(mode: str = "position", velocity_ratio: float = 1.0) -> tuple[wbc.Plant, WalkingControl]:
    soft, robot = foot("soft"), wbc.load_robot("hrp4_class")
    description = with_feet(robot, soft)
    period = 0.005 if mode == "position" else 0.002
    plant = wbc.Plant(robot, foot=soft, noise="realistic", seed=3, control_period=period)
    model = description.robot()
    model.velocity_limit.setflags(write=True)
    model.velocity_limit[:] *= velocity_ratio
    plan = walk_distance(FootstepPlan.standing(model, GAIT), 0.15)
    settings = WalkingControlSettings(mode="torque" if mode == "torque" else "position")
    return plant, WalkingControl(model, plan, period, settings)


def run(plant: wbc.Plant, walk: WalkingControl, seconds: float, *hooks: Hook) -> None:
    while plant.time < seconds - 1e-9 and not walk.finished:
        measurement = plant.measure()
        command = walk.command(measurement)
        for hook in hooks:
            hook(plant, walk, measurement, command)
        plant.step(command)


def recorded_stand(
    path: Path,
    robot: str = "hrp4_class",
    ticks: int = 3,
    *,
    control: type[wbc.PositionControl | wbc.TorqueControl] = wbc.PositionControl,
    shown: Callable[[wbc.Plant], Any] = lambda plant: plant,
    **options: Any,
) -> Log:
    """The log of a stand of a plant of some options, with what is shown of it to the recorder."""
    plant = wbc.Plant(wbc.load_robot(robot), **options)
    whole = control(wbc.balance_controller(plant.description.robot(), plant.control_period))
    with Recorder(path) as record:
        for _ in range(ticks):
            measurement = plant.measure()
            command = whole.command(measurement)
            record(shown(plant), whole, measurement, command)
            plant.step(command)
    return Log.open(path)


@functools.cache
def recorded_walk() -> Path:
    """The log of it; written with a signal of our own."""
    path = Path(tempfile.mkdtemp(prefix="wbc-test-")) / "walk.arrow"
    plant, walk = make_walk()
    with Recorder(path, spec={"gait": GAIT}, title="a short walk") as record:
        record.add("own/answer", lambda _: 42.0, unit="m", about="to everything")
        run(plant, walk, SECONDS, record)
    return path


@functools.cache
def recorded_scans() -> tuple[Path, tuple[StepStiffness, ...]]:
    """The log of a walk that sets its soles, and what happened to their stiffness in each step."""
    path = Path(tempfile.mkdtemp(prefix="wbc-test-")) / "scans.arrow"
    variable, robot = foot("variable"), wbc.load_robot("hrp4_class")
    ground = terrain("roof_tiles", 0.01, seed=2, start=0.1)
    plant = wbc.Plant(robot, foot=variable, terrain=ground, seed=3, range_sensor=RangeSensor())
    model = with_feet(robot, variable).robot()
    plan = walk_distance(FootstepPlan.standing(model, GAIT), 0.25)

    def policy(swing: SwingScan) -> StiffnessDecision:
        assert swing.profile is not None
        height = float(np.ptp(swing.profile.z))
        return StiffnessDecision(10.0 + 20.0 * swing.step, cluster=2, features={"height": height})

    task = StiffnessScheduler(model, variable, policy, StiffnessTiming(min_length=0.05))
    walk = WalkingControl(model, plan, plant.control_period, stiffness=task)
    with Recorder(path) as record:
        run(plant, walk, 2.5, record)
    return path, tuple(task.steps)
