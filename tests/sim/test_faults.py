"""Whatever the sensors say: a command in every tick, within all limits, and lasting faults are named."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faults import CHANGES, MODES, faults, run, silence
from hypothesis import given
from hypothesis import strategies as st
from properties import examples

from wbc import Measurement, Plant, PositionControl, TorqueControl, balance_controller
from wbc.core.signals import SIGNALS
from wbc.robots import load
from wbc.sim import Machine, TrialHook, WalkPlan, WalkSpec, walk
from wbc.sim.balance.standing import StandSpec, StandTrial
from wbc.sim.studies import Study
from wbc.sim.studies.kinds import PushLimitSpec
from wbc.sim.trial.falls import TrueFallDetector
from wbc.sim.trial.push import WalkPush
from wbc.sim.trial.trial import TrialTick
from wbc.walking import WalkingControl, WalkingControlSettings

ROUNDS = 6
"""Runs in which all faults of one tick come one after the other, in each task and with each kind of control."""

QUICK_CHANGES = (("masses +30 %", "position"), ("hard tasks that contradict each other", "torque"))
"""Other masses and tasks that the default run tries; the slow one tries all."""


ROOT = Path(__file__).parents[2]
STUDIES = (
    "flat_floor",
    "pushed_walks",
    "rough_ground",
    "seeing",
    "stepping",
    "seeing_stairs",
    "push_recovery",
)


@pytest.mark.parametrize(
    ("task", "mode", "number"),
    [
        pytest.param(
            task,
            mode,
            number,
            marks=()
            if (task, mode, number) == ("stand", "position", 0)
            else (pytest.mark.slow, pytest.mark.long),
        )
        for task in ("stand", "walk")
        for mode in MODES
        for number in range(ROUNDS)
    ],
)
def test_faulty_ticks_do_no_harm(task: str, mode: str, number: int) -> None:
    """Each fault comes once in each task and with each kind of control, for one tick."""
    report = run(task, mode, list(faults())[number::ROUNDS], lasting=False)
    assert report.raised is None and report.wild is None
    assert not report.stopped, f"one tick must not stop a robot for good: {report.last}"
    assert report.upright, report.last


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "task", "mode"),
    [
        (name, task, mode)
        for fault, name in enumerate(faults())
        for kind, mode in enumerate(MODES)
        for task in [("stand", "walk")[(fault + kind) % 2]]
    ],
)
def test_a_lasting_fault_is_named_and_harmless_to_the_drives(name: str, task: str, mode: str) -> None:
    """Each fault meets each kind of control; with one or two of them the robot stands, otherwise it walks."""
    report = run(task, mode, [name], lasting=True)
    assert report.raised is None and report.wild is None
    if faults()[name][1]:
        in_the_air = (
            task == "walk" and name == "right force sensor dead"
        )  # until it carries the robot, at 3.0 s
        assert report.named <= (0.8 if in_the_air else 0.2), f"named after {report.named} s: {report.status}"
    else:
        assert report.upright or math.isfinite(report.named), "fell without a word"


BLIND = Machine(force_sensors=False, torque_sensors=True)


class Doubts(TrialHook):
    """Collects what the monitor doubts in a walk, until the robot falls."""

    def __init__(self) -> None:
        self.found: list[str] = []

    def tick(self, tick: TrialTick) -> None:
        if tick.control.fallen is None:
            self.found += tick.control.drives.sensing.monitor.doubts

    def start(self, trial: Any) -> None:
        trial.control.drives.watch()


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("mode", ["position", "torque"])
@pytest.mark.parametrize(
    "ground",
    [
        {"foot": "rigid", "terrain": "stones", "amplitude": 0.02},
        {"foot": "soft", "terrain": "stones", "amplitude": 0.03},
        {"foot": "soft", "terrain": "slats"},
        {"robot": "talos"},
        {"robot": "g1"},
        {"foot": "flat", "terrain": "boards", "amplitude": 0.02, "seed": 8404, "machine": BLIND},
    ],
)
def test_nothing_is_doubted_of_good_sensors_on_any_ground(ground: dict[str, Any], mode: str) -> None:
    look = Doubts()
    result = walk(WalkSpec(mode=mode, plan=WalkPlan(distance=0.8), **ground), hooks=[look])
    assert result.fall is None and not look.found


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("number", range(6))
@pytest.mark.parametrize("name", STUDIES)
def test_nothing_is_doubted_of_good_sensors_in_walks_of_the_studies(name: str, number: int) -> None:
    """Six trials of each study, up to 1.5 m, each pushed four times: 42 walks and up to 168 pushes."""
    trials = list(
        Study.from_json(json.loads((ROOT / "examples" / "studies" / f"{name}.json").read_text())).trials()
    )
    rng = np.random.default_rng((STUDIES.index(name), number))
    spec = trials[int(rng.integers(len(trials)))].spec
    spec = spec.trial if isinstance(spec, PushLimitSpec) else spec
    assert isinstance(spec, WalkSpec)
    pushes = tuple(
        WalkPush(impulse=rng.uniform(0.1, 0.6), direction=rng.uniform(-3.1, 3.1), duration=0.1, time=time)
        for time in (1.5, 3.0, 4.5, 6.0)
    )
    plan = (
        spec.plan if spec.plan.distance is None else replace(spec.plan, distance=min(spec.plan.distance, 1.5))
    )
    look = Doubts()
    walk(replace(spec, plan=plan, pushes=pushes, noise=("none", "realistic")[number % 2]), hooks=[look])
    assert not look.found


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("noise", ["none", "realistic"])
@pytest.mark.parametrize("seed", range(6))
def test_nothing_is_doubted_of_good_sensors_of_a_robot_that_is_punched(seed: int, noise: str) -> None:
    """On any link, in any direction, in every other run while it walks; of a robot that falls, until then."""
    description, rng = load("g1"), np.random.default_rng(seed)
    plant = Plant(description, noise=noise, seed=seed, control_period=0.002, visuals=False)
    settings = WalkingControlSettings(mode="torque")
    walking = WalkingControl(description.robot(), None, plant.control_period, settings)
    monitor, times, found = walking.drives.watch(), (0.5, 1.8, 3.1, 4.4), []
    walking.velocity = (0.3, 0.0, 0.0) if seed % 2 else None
    links = [
        plant.model.body(i).name for i in np.flatnonzero(plant.of_robot) if plant.model.body_mass[i] > 0.1
    ]
    while plant.time < 6.0 and walking.fallen is None:
        if min(abs(plant.time - time) for time in times) < 1e-6:
            way = rng.normal(size=3)
            force = rng.uniform(0.2, 0.9) * plant.robot.mass / 0.08 * way / np.linalg.norm(way)
            plant.push(str(rng.choice(links)), tuple(force.tolist()), 0.08)
        plant.step(walking.command(plant.measure()))
        found += [(round(plant.time, 3), doubt) for doubt in monitor.doubts]
    assert not found


@pytest.mark.parametrize(
    ("name", "task", "mode"),
    [
        pytest.param(
            name,
            task,
            mode,
            marks=() if task == "stand" and (name, mode) in QUICK_CHANGES else pytest.mark.slow,
        )
        for name in CHANGES
        for task in ("stand", "walk")
        for mode in MODES
    ],
)
def test_other_masses_and_infeasible_tasks_get_no_wild_command(name: str, task: str, mode: str) -> None:
    report = run(task, mode, [name], lasting=True)
    assert report.raised is None and report.wild is None
    # Contacts of free steps have a cost of motion, so that limits without torque leave a solution: the robot sinks.
    yielding = name == "limits that contradict each other" and task == "walk" and mode != "position"
    if yielding:
        assert not report.upright
    elif CHANGES[name][1]:
        assert report.named <= 0.2, f"named after {report.named} s: {report.status}"
    elif name.startswith("masses"):
        assert report.upright and not report.stopped and math.isinf(report.named)


@cache
def controls() -> tuple[Any, Measurement]:
    description = load("hrp4_class")
    plant = Plant(description, machine=Machine(torque_sensors=True, hand_sensors=True), visuals=False)
    position = PositionControl(balance_controller(description.robot(), plant.control_period))
    torque = TorqueControl(balance_controller(description.robot(), plant.control_period))
    return (position, torque), plant.measure()


NUMBERS = st.one_of(st.floats(width=64), st.sampled_from([0.0, 1e3, -1e9, 1e200, math.nan, -math.inf]))
GARBAGE = st.one_of(
    st.none(), st.text(max_size=5), st.lists(NUMBERS, max_size=40), st.integers(), st.floats()
)
NAMES = (*SIGNALS, "joint_torque", "hand_wrenches", "sole_range", "sole_stiffness")


@examples(20)
@given(data=st.data())
@silence()
def test_no_garbage_gets_a_command_beyond_the_limits_or_an_exception(data: st.DataObject) -> None:
    (position, torque), measurement = controls()
    given: Any = measurement
    if data.draw(st.booleans()):
        changes: dict[str, Any] = {}
        for name in data.draw(st.sets(st.sampled_from(NAMES))):
            array = np.array(getattr(measurement, name))
            if data.draw(st.booleans()):
                changes[name] = data.draw(GARBAGE)
            else:
                array.flat[data.draw(st.integers(0, array.size - 1))] = data.draw(NUMBERS)
                changes[name] = array
        given = replace(measurement, time=data.draw(NUMBERS), **changes)
    else:
        given = data.draw(GARBAGE)
    robot = torque.controller.robot
    for control in (position, torque):
        control.reset()
        control.command(measurement)
        command = control.command(given)
        assert (np.abs(command.joint_torque) <= robot.torque_limit).all()
        if command.joint_position is not None:
            assert (command.joint_position >= robot.position_lower).all()
            assert (command.joint_position <= robot.position_upper).all()
            step = np.abs(command.joint_position - robot.half_sitting[7:])
            assert (step <= 4.0 * robot.velocity_limit * control.controller.dt + 1e-12).all()


@pytest.mark.parametrize(
    ("robot", "change"),
    [
        ("hrp4_class", lambda f: np.roll(f, 1)),
        pytest.param("g1", lambda f: f + [6.0, 0.0, 0.0], marks=pytest.mark.slow),
        pytest.param("g1", lambda f: np.roll(f, 1), marks=pytest.mark.slow),
        pytest.param("hrp4_class", lambda f: f + [0.0, -6.0, 0.0], marks=pytest.mark.slow),
        pytest.param("talos", lambda f: f + [6.0, 0.0, 0.0], marks=pytest.mark.slow),
    ],
)
def test_an_accelerometer_that_points_elsewhere_is_named_and_left_out(robot: str, change: Any) -> None:
    """For 100 ms, in position control; before and after it nothing is refused."""
    stand = StandTrial(StandSpec(robot=robot, mode="position", seconds=1.2, noise="realistic"), visuals=False)
    named = []
    while stand.plant.time < 1.2:
        measurement = stand.plant.measure()
        if 0.8 <= measurement.time < 0.9:
            measurement = replace(measurement, specific_force=change(measurement.specific_force))
        stand.plant.step(stand.control.command(measurement))
        if "accelerometer" in stand.control.status():
            named.append(measurement.time)
    assert named and named[0] < 0.83 and 0.85 < named[-1] < 1.0
    assert not TrueFallDetector(stand.plant.robot).fallen(stand.plant.truth().q)


@pytest.mark.parametrize("mode", ["position", pytest.param("torque", marks=pytest.mark.slow)])
def test_a_gyroscope_that_is_off_about_the_vertical_is_named_in_a_stand(mode: Any) -> None:
    """By 0.6 rad/s: both feet seem to turn alike. The jump looks like a push, so it is named once that is over."""
    stand = StandTrial(
        StandSpec(robot="hrp4_class", mode=mode, seconds=1.8, noise="realistic"), visuals=False
    )
    monitor, named = stand.control.watch(), list[float]()
    while stand.plant.time < 1.8 and not named:
        measurement = stand.plant.measure()
        if measurement.time >= 0.8:
            turned = measurement.angular_velocity + (0.0, 0.0, 0.6)
            measurement = replace(measurement, angular_velocity=turned)
        stand.plant.step(stand.control.command(measurement))
        if "encoders and gyroscope disagree" in monitor.doubts:
            named.append(measurement.time)
    assert named and 0.8 < named[0] < 1.7
    assert stand.control.fallen is None and not stand.control.failures


def test_a_robot_that_cannot_be_caught_says_so_before_it_lies_on_the_ground() -> None:
    stand = StandTrial(StandSpec(robot="g1", mode="torque", seconds=3.0), visuals=False)
    said: list[float] = []
    stand.plant.push("base", (120.0, 0.0, 0.0), 0.4)
    while stand.plant.time < 3.0 and stand.plant.com_height > 0.4:
        stand.plant.step(stand.control.command(stand.plant.measure()))
        if "balance lost" in stand.control.status():
            said.append(stand.plant.time)
    assert stand.plant.time < 3.0 and said and 0.1 < said[0] < stand.plant.time - 0.1
