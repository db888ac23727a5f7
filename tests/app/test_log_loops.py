"""Logs, figures, replays and the live view of loops that are no plant of this library."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from foreign import foreign_model
from properties import by_default

import wbc
from wbc.app import Log, Recorder, Replay
from wbc.base.errors import InputError
from wbc.core.signals import Command, Measurement
from wbc.sim import MujocoLoop, make_scene

matplotlib.use("Agg")
DESCRIPTION = wbc.load_robot("hrp4_class")


class Own:
    """A loop of the four members that every one has."""

    description, control_period = DESCRIPTION, 0.002

    def __init__(self, loop: MujocoLoop) -> None:
        self.measure, self.step = loop.measure, loop.step


def record(path: Path, how: str, ticks: int = 20) -> Log:
    """Record a stand in a loop of somebody else."""
    loop = MujocoLoop(DESCRIPTION, foreign_model(DESCRIPTION, "motor"), prefix="mine/")
    control = wbc.TorqueControl(wbc.balance_controller(DESCRIPTION.robot(), loop.control_period))
    shown: Any = Own(loop) if how == "own" else loop
    with Recorder(path) as recorder:
        for _ in range(ticks):
            measurement = loop.measure()
            command = control.command(measurement)
            if how in ("loop", "own"):
                recorder(shown, control, measurement, command)
            else:
                solution = control.solution if how != "bare" else None
                recorder.write(
                    DESCRIPTION,
                    measurement,
                    command,
                    solution,
                    truth=loop.truth() if how == "truth" else None,
                    estimate=control.observer.robot if how == "estimate" else None,
                )
            loop.step(command)
    return Log.open(path)


@pytest.mark.parametrize("how", ["loop", "own", "truth", "estimate"])
def test_a_log_of_any_loop_is_drawn_and_replayed(tmp_path: Path, how: str) -> None:
    log = record(tmp_path / "run.arrow", how)
    assert len(log) == 20 and np.isfinite(log["foot/left/wrench_solved/fz"]).all()
    assert np.isfinite(log["joint/torque_measured"]).all()
    assert ("truth/com/x" in log) is (how in ("loop", "truth"))
    replay = Replay(log)
    com = DESCRIPTION.robot().com
    for tick in (0, 19):
        marks = {mark.name: mark for mark in replay.picture(tick).marks}
        np.testing.assert_allclose(marks["com"].points[0], com, atol=2e-3)
        pelvis = replay.stage.data.body(DESCRIPTION.robot().base_frame)
        np.testing.assert_allclose(pelvis.xpos, DESCRIPTION.robot().q[:3], atol=2e-3)
    assert {"ground force 0", "ground force 1"} <= set(marks)
    np.testing.assert_allclose(replay.base_places, np.tile(DESCRIPTION.robot().q[:3], (20, 1)), atol=2e-3)


def test_measurements_and_commands_alone_are_a_log_but_no_replay(tmp_path: Path) -> None:
    log = record(tmp_path / "bare.arrow", "bare", 3)
    assert "solver/status" not in log and "base/estimated/position/x" not in log
    assert np.isfinite(log["imu/specific_force"]).all()
    with pytest.raises(InputError, match="neither the true nor an estimated base"):
        Replay(log)


def test_a_start_of_its_own_is_rebuilt_and_wrists_and_gains_are_logged(tmp_path: Path) -> None:
    start = DESCRIPTION.robot().half_sitting.copy()
    start[0] -= 1.0
    plant = wbc.Plant(DESCRIPTION, scene=make_scene("wall", distance=-0.05), initial_configuration=start)
    control = wbc.HybridControl(wbc.balance_controller(DESCRIPTION.robot(), plant.control_period))
    with Recorder(tmp_path / "wall.arrow") as recorder:
        for _ in range(5):
            measurement = plant.measure()
            command = control.command(measurement)
            recorder(plant, control, measurement, command)
            plant.step(command)
    log = Log.open(tmp_path / "wall.arrow")
    assert measurement.hand_wrenches is not None and command.kp is not None and command.kd is not None
    np.testing.assert_allclose(log["hand/left_hand/wrench_measured"][-1], measurement.hand_wrenches[0], 1e-6)
    np.testing.assert_allclose(log["joint/kp_command"][-1], command.kp, 1e-6)
    np.testing.assert_allclose(log["joint/kd_command"][-1], command.kd, 1e-6)
    replay = Replay(log)
    assert replay.plant.start[0] == pytest.approx(start[0])


@pytest.mark.parametrize("name", by_default(["panda", "go1"], "panda"))
def test_a_robot_without_feet_is_recorded_without_theirs(tmp_path: Path, name: str) -> None:
    """Its base, too, only if it has one; what is of another robot is refused."""
    description = wbc.load_robot(name)
    robot, other = description.robot(), DESCRIPTION.robot()
    parts: list[Any] = [np.zeros(robot.na), np.zeros(robot.na), np.zeros(3), np.zeros(3), None]
    command, begin = Command(robot.q[robot.base_nq :]), Measurement(0.0, *parts)
    with Recorder(tmp_path / "run.arrow") as recorder:
        solved = wbc.balance_controller(other, 0.005).solve()
        for strange in ({"estimate": other}, {"truth": 3}, {"solution": 3}, {"solution": solved}):
            with pytest.raises(InputError):
                recorder.write(description, begin, command, **strange)  # type: ignore[arg-type]
        for k in range(3):
            recorder.write(description, replace(begin, time=0.01 * k), command, estimate=robot)
        with pytest.raises(InputError, match="'joint/position/"):
            recorder.write(description, replace(Measurement.resting(other), time=1.0), command)
    log = Log.open(recorder.path)
    assert len(log) == 3 and ("base/estimated/position/x" in log) == (name == "go1")
    assert not any(signal.startswith("foot/") for signal in log)
    if name == "go1":
        assert Replay(log).picture(2).time == pytest.approx(0.02)
    else:
        with pytest.raises(InputError, match="base"):
            Replay(log)
