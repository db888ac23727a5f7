"""A recorder writes down what happens in a tick, all of it, and changes nothing."""

from __future__ import annotations

import functools
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from properties import by_default
from pydantic_core import from_json as from_json_bytes
from recorded import GAIT, SECONDS, make_walk, recorded_scans, recorded_walk, run

import wbc
from wbc.app.log.header import KEY, decode, encode, make_header, read_plant
from wbc.app.log.reader import Log
from wbc.app.log.recorder import Recorder
from wbc.app.log.signals import Tick
from wbc.base.errors import InputError
from wbc.base.settings import from_json, to_json
from wbc.core.qp.solving.solution import Solution
from wbc.core.signals import Command, Measurement
from wbc.feet import foot
from wbc.sim import Trial
from wbc.sim.terrain.spec import terrain
from wbc.sim.walks.meter import WalkMeter
from wbc.tasks.balance import balance_controller
from wbc.walking import FootstepPlan
from wbc.walking.contact import Event
from wbc.walking.control import WalkingControl


def seen(
    plant: wbc.Plant, walk: WalkingControl, measurement: Measurement, command: Command
) -> dict[str, Any]:
    """Return copies of what a tick knew, one of each source of signals."""
    estimate, solution, reference = walk.drives.observer.robot, walk.drives.solution, walk.reference
    assert solution is not None and reference is not None
    return {
        "time": measurement.time,
        "foot/left/wrench_measured": measurement.sole_wrench[0].copy(),
        "joint/torque_command": command.joint_torque.copy(),
        "com/estimated": np.array(estimate.com),
        "com/reference": np.array(reference.pendulum.com),
        "foot/right/wrench_solved": solution.wrenches["right_foot"].copy(),
        "foot/left/contact": float(reference.progress.contact[0]),
        "truth/com": plant.truth().com.copy(),
        "walk/phase": reference.progress.phase.value,
    }


def test_a_log_holds_every_tick(tmp_path: Path) -> None:
    plant, walk = make_walk(velocity_ratio=0.25)  # so that limits push
    ticks: list[dict[str, Any]] = []
    with Recorder(tmp_path / "walk.arrow") as record:
        run(plant, walk, 0.5, record, lambda *tick: ticks.append(seen(*tick)))
    log = Log.open(tmp_path / "walk.arrow")
    assert len(log) == len(ticks) == 100
    for name in ticks[0]:
        expected = [tick[name] for tick in ticks]
        if isinstance(expected[0], str):
            assert log.texts(name).tolist() == expected, name
        else:  # numbers are kept with 24 bits
            np.testing.assert_allclose(log[name], expected, rtol=2e-7, atol=1e-9, err_msg=name)
    assert log.events[0] == (0.0, Event.STARTED.value)


def test_a_torque_is_over_its_limit_in_the_direction_in_which_it_acts(tmp_path: Path) -> None:
    """Drives that pull with less than they push with, in the log and in the figures of a walk."""
    robot = wbc.load_robot("hrp4_class")
    most = robot.torque_limit
    names = robot.joint_names
    ranges = {
        name: (-0.6 * m, float(m)) if i % 2 else (-float(m), 0.6 * m)
        for i, (name, m) in enumerate(zip(names, most, strict=True))
    }
    robot = replace(robot, torque_ranges=ranges)
    plant, walk = (
        wbc.Plant(robot),
        WalkingControl(model := robot.robot(), FootstepPlan.standing(model), 0.005),
    )
    meter, peak = WalkMeter(plant, walk), 0.0
    with Recorder(tmp_path / "stand.arrow") as record:
        for _ in range(40):
            command = walk.command(measurement := plant.measure())
            record(plant, walk, measurement, command)
            plant.step(command)
            meter.after(None)  # type: ignore[arg-type]
            least, greatest = np.array([ranges[name] for name in names]).T
            share = plant.joint_torque / np.where(plant.joint_torque < 0.0, -least, greatest)
            peak = max(peak, float(np.abs(share).max()))
    log = Log.open(tmp_path / "stand.arrow")
    for name, (low, high) in ranges.items():
        torque, ratio = log[f"truth/joint/torque/{name}"], log[f"truth/joint/torque_ratio/{name}"]
        np.testing.assert_allclose(ratio, torque / np.where(torque < 0.0, -low, high), rtol=1e-6, atol=1e-9)
    assert meter.figures()["peak_torque_ratio"] == pytest.approx(peak) and peak > 0.05


@pytest.mark.slow
def test_recording_changes_nothing(tmp_path: Path) -> None:
    runs = []
    for recorded in (False, True):
        plant, walk = make_walk()
        states: list[np.ndarray] = []

        def watch(plant: wbc.Plant, walk: object, m: object, command: Command, into: Any = states) -> None:
            into.append(np.concatenate([plant.data.qpos, plant.data.qvel, command.joint_torque]))

        if recorded:
            with Recorder(tmp_path / "walk.arrow") as record:
                run(plant, walk, 1.2, record, watch)
        else:
            run(plant, walk, 1.2, watch)
        runs.append(np.array(states))
    assert runs[0].shape[0] > 200
    assert (runs[0] == runs[1]).all()  # to the last bit
    assert np.ptp(runs[0], axis=0).max() > 0.1


def test_a_trial_without_a_spec_is_recorded_by_a_hook(tmp_path: Path) -> None:
    """Trials that a program puts together itself have no spec."""
    plant = wbc.Plant("hrp4_class", seed=4)
    robot = plant.description.robot()
    trial = Trial(plant, WalkingControl(robot, FootstepPlan.standing(robot), plant.control_period))
    recorder = Recorder(tmp_path / "stand.arrow")
    with trial.running([recorder]):
        trial.advance(0.05)
    with pytest.raises(InputError, match="has ended; make another"):
        recorder.start(trial)  # before a tick of another trial
    log = Log.open(tmp_path / "stand.arrow")
    assert len(log) == pytest.approx(10, abs=1) and log.header.get("spec") is None


def test_a_trial_with_a_spec_of_its_own_is_recorded_with_the_seed_of_its_plant(tmp_path: Path) -> None:
    class Stand(Trial):
        spec = GAIT

    plant = wbc.Plant("hrp4_class", seed=4, visuals=False)
    robot = plant.description.robot()
    trial = Stand(plant, WalkingControl(robot, FootstepPlan.standing(robot), plant.control_period))
    with trial.running([Recorder(tmp_path / "stand.arrow")]):
        trial.advance(0.05)
    header = Log.open(tmp_path / "stand.arrow").header
    assert header["seed"] == 4 and header["spec"] == to_json(GAIT)


def test_header_says_where_the_numbers_come_from() -> None:
    log = Log.open(recorded_walk())
    header = log.header
    assert header["seed"] == 3 and header["control_period"] == 0.005 and header["title"] == "a short walk"
    assert from_json(type(GAIT), header["spec"]["gait"]) == GAIT
    assert {"wbc", "git", "files", "libraries"} == set(header["versions"]) and "mujoco" in header["versions"][
        "libraries"
    ]
    assert header["robot"]["name"] == "hrp4_class"
    assert header["robot"]["torque_limit_Nm"]["left_knee_pitch"] > 0.0
    assert log.time[-1] == pytest.approx(SECONDS - 0.005)
    assert (log["own/answer"] == 42.0).all() and log.units["own/answer"] == "m"


def test_tasks_that_come_and_go_leave_right_numbers_and_gaps(tmp_path: Path) -> None:
    plant = wbc.Plant(wbc.load_robot("hrp4_class"), control_period=0.002)
    controller = balance_controller(plant.description.robot(), 0.002)
    control = wbc.TorqueControl(controller)
    solved: list[Solution] = []
    with Recorder(tmp_path / "stand.arrow") as record:
        for i in range(10):
            if i == 4:
                controller.add(wbc.PositionTask(plant.robot.torso_frame, name="late", weight=0.1))
            if i == 7:
                controller.remove(controller.task("posture"))
            measurement = plant.measure()
            command = control.command(measurement)
            record(plant, control, measurement, command)
            plant.step(command)
            assert control.solution is not None
            solved.append(control.solution)
    log = Log.open(tmp_path / "stand.arrow")
    norms = [np.linalg.norm(solution.residuals["com"]) for solution in solved]
    assert log["solver/residual/com"] == pytest.approx(norms)
    forces = [solution.wrenches["left_foot"][2] for solution in solved]
    assert log["foot/left/wrench_solved/fz"] == pytest.approx(forces)
    assert np.isfinite(log["solver/residual/posture"]).tolist() == [True] * 7 + [False] * 3
    assert set(log.texts("solver/status")) == {"solved"}
    assert np.isfinite(log["com/estimated"]).all()


@functools.cache
def standing() -> tuple[wbc.Plant, wbc.PositionControl]:
    plant = wbc.Plant(wbc.load_robot("hrp4_class"), visuals=False)
    return plant, wbc.PositionControl(balance_controller(plant.description.robot(), plant.control_period))


def record_standing(path: Path, ticks: int, *signals: Any, **options: Any) -> Log:
    plant, control = standing()
    measurement, command = plant.measure(), plant.hold()
    with Recorder(path) as record:
        record.add(*signals, **options)
        for _ in range(ticks):
            record(plant, control, measurement, command)
    return Log.open(path)


def test_another_plant_or_robot_or_a_reset_is_another_log(tmp_path: Path) -> None:
    """The truth is copied from the plant of the first tick: without a refusal it would be told of the second one."""
    first, second = (wbc.Plant(wbc.load_robot("hrp4_class"), visuals=False) for _ in range(2))
    control = wbc.PositionControl(balance_controller(first.robot, first.control_period))
    with Recorder(tmp_path / "a.arrow") as record:
        for _ in range(2):
            first.step(first.hold())
            record(first, control, first.measure(), first.hold())
        with pytest.raises(InputError, match="another Recorder"):
            record(second, control, second.measure(), second.hold())
        first.reset()
        with pytest.raises(InputError, match="another Recorder"):
            record(first, control, first.measure(), first.hold())
    assert len(Log.open(record.path)) == 2
    g1 = wbc.Plant(wbc.load_robot("g1"), visuals=False)
    with Recorder(tmp_path / "b.arrow") as record:
        record.write(first.description, first.measure(), first.hold())
        with pytest.raises(InputError, match="another Recorder"):
            record.write(g1.description, g1.measure(), g1.hold())
        for time in (math.nan, math.inf, first.time - 1e-6):  # nobody could read what is written then
            with pytest.raises(InputError, match="another Recorder"):
                record.write(first.description, replace(first.measure(), time=time), first.hold())
        record.write(first.description, first.measure(), first.hold())
    assert len(Log.open(record.path)) == 2


def test_own_signals_of_every_kind(tmp_path: Path) -> None:
    path = tmp_path / "own.arrow"
    count = iter(range(100))
    assert record_standing(path, 3, "own/count", lambda _: next(count), "Nm")["own/count"].tolist() == [
        0,
        1,
        2,
    ]
    array = record_standing(path, 2, "own/place", lambda _: np.array([1.0, 2.0, 3.0]), unit="m")
    assert array.parts("own/place") == ["own/place/x", "own/place/y", "own/place/z"]
    assert array["own/place"].tolist() == [[1.0, 2.0, 3.0]] * 2 and array.units["own/place/y"] == "m"
    assert record_standing(path, 1, "a", lambda _: [1, 2, 3, 4]).parts("a") == ["a/0", "a/1", "a/2", "a/3"]
    assert record_standing(path, 2, "on", lambda _: True)["on"].tolist() == [1.0, 1.0]
    for first, later in ((True, 0.5), (None, "calm"), (1, "calm"), (1, 10**400)):
        values = iter([first, later])
        with pytest.raises(InputError, match=f"began with {first} and cannot keep {later!r:.12}"):
            record_standing(path, 2, "own", lambda _, values=values: next(values))
    states = iter(["calm", None, "calm"])
    assert record_standing(path, 3, "state", lambda _: next(states)).texts("state").tolist() == [
        "calm",
        None,
        "calm",
    ]
    log = record_standing(path, 2, "own/height", lambda tick: tick.plant.truth().com[2], "m")
    assert log["own/height"] == pytest.approx(log["truth/com/z"])
    stamp, frame = 1_780_000_123.456, 2**53 - 1  # seconds since 1970; frames of a camera
    log = record_standing(path, 1, "own", lambda _: [stamp, frame, 0.1])
    assert log.vector("own", 3)[0].tolist() == [stamp, frame, 0.1], "exactly"
    assert record_standing(path, 1, "own/stamp", lambda _: stamp)["own/stamp"].tolist() == [stamp]


@pytest.mark.slow
def test_what_soles_have_seen_and_decided_is_recorded_once_a_step() -> None:
    path, steps = recorded_scans()
    log = Log.open(path)
    sides = log.texts("stiffness/side")
    landed = [i for i, side in enumerate(sides) if side is not None]
    assert len(landed) == len(steps) >= 2
    seen = 0
    for i, step in zip(landed, steps, strict=True):
        assert sides[i] == step.side and log["stiffness/commanded"][i] == pytest.approx(step.commanded)
        assert log["stiffness/actual"][i] == pytest.approx(step.actual)
        assert log.texts("stiffness/fallback")[i] == step.fallback
        if step.profile is None:
            assert log.lists("stiffness/scan/x")[i] is None
            continue
        seen += 1
        np.testing.assert_allclose(log.lists("stiffness/scan/x")[i], step.profile.x, atol=1e-6)
        np.testing.assert_allclose(log.lists("stiffness/scan/z")[i], step.profile.z, atol=1e-6)
        np.testing.assert_allclose(log.lists("stiffness/scan/lateral")[i], step.profile.lateral, atol=1e-6)
        if step.decision is not None:
            assert log["stiffness/cluster"][i] == 2.0
            assert json.loads(log.texts("stiffness/features")[i]) == dict(step.decision.features)
    assert seen >= 2
    others = np.setdiff1d(np.arange(len(log)), landed)
    assert np.isnan(log["stiffness/commanded"][others]).all()
    commanded = log["foot/left/stiffness_command"]
    assert np.ptp(commanded[np.isfinite(commanded)]) + np.ptp(log["foot/right/stiffness"]) > 1.0
    assert np.isfinite(log["foot/left/range"]).mean() > 0.5


@pytest.mark.parametrize("made", by_default(["soft", "paper", "image"], "paper", "image"))
def test_a_plant_comes_back_from_the_header(made: str) -> None:
    heights = np.outer(np.arange(4.0), np.arange(5.0))
    ground = (
        terrain("image", source=heights, metres_per_pixel=0.1)
        if made == "image"
        else terrain("stones", seed=4, areas=(1.0, None, -0.2, 0.2, "friction", 0.3))
    )
    sole = foot("flat" if made == "image" else made)
    plant = wbc.Plant(wbc.load_robot("hrp4_class"), foot=sole, terrain=ground, noise="realistic")
    tick = Tick(plant, None, plant.measure(), plant.hold(), plant.description, model=plant.robot)
    written = encode(make_header(tick, {"largest": np.inf}))
    from_json_bytes(
        written, allow_inf_nan=False
    )  # JSON that every reader takes: the paper's foot has no limit of rate
    assert decode("x", {KEY: written})["spec"] == {"largest": np.inf}
    again = read_plant(decode("x", {KEY: written}) | {"control_period": plant.control_period})
    assert again.foot == sole and again.terrain == ground and again.physics == plant.physics
    assert (again.model.qpos0 == plant.model.qpos0).all() and again.model.ngeom == plant.model.ngeom
    assert (
        again.description.urdf == plant.description.urdf
        and again.description.soles == plant.description.soles
    )
    assert (again.description.kp == plant.description.kp).all()


@pytest.mark.parametrize("signal", [("com/estimated/x", lambda _: 1.0), ("a//b", lambda _: 1.0), ("a", 3.0)])
def test_own_signals_that_cannot_be_kept_are_refused(tmp_path: Path, signal: Any) -> None:
    with pytest.raises(InputError, match=signal[0]):
        record_standing(tmp_path / "own.arrow", 1, *signal)
    record = Recorder(tmp_path / "twice.arrow")
    record.add("own", lambda _: 1.0)
    with pytest.raises(InputError, match="'own' already"):
        record.add("own", lambda _: 2.0)
