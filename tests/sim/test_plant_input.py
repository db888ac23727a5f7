"""Input that the plant refuses: its message, and that nothing moves."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wbc.core.errors import InputError, MeasurementError, UnknownNameError
from wbc.core.signals import Command
from wbc.feet.soles.contact import ContactSpheres
from wbc.feet.soles.rigid import FlatFoot
from wbc.robots import load
from wbc.sim import DivergedError, Plant
from wbc.sim.balance.standing import StandSpec, StandTrial
from wbc.sim.plant.settings import steps_per_tick
from wbc.sim.trial.loop import TrialHook

FEW_SPHERES = FlatFoot(ContactSpheres(row_spacing=0.1))


@pytest.fixture(scope="module")
def plant() -> Plant:
    return Plant(load("hrp4_class"), foot=FEW_SPHERES)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"foot": "sof"}, UnknownNameError, "soft"),
        ({"terrain": "stone"}, UnknownNameError, "stones"),
        ({"noise": "realistik"}, UnknownNameError, "realistic"),
        ({"timestep": 0.0}, InputError, r"timestep \(s\) must lie in \[1e-06, 1\], got 0"),
        ({"control_period": -0.005}, InputError, "control period"),
        ({"control_period": 0.0025}, InputError, "whole multiple"),
        ({"control_period": 0.0005}, InputError, "whole multiple"),
        ({"seed": -1}, InputError, "seed"),
        ({"initial_configuration": np.zeros(3)}, InputError, "shape"),
        ({"initial_configuration": np.zeros(41)}, InputError, "quaternion"),
    ],
)
def test_refuses_bad_options(options: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        Plant(load("hrp4_class"), **options)


def test_period_and_step_are_independent() -> None:
    pairs = (0.005, 0.001), (0.005, 0.0025), (0.001, 0.001), (0.3, 1e-4)
    assert [steps_per_tick(*pair) for pair in pairs] == [5, 2, 1, 3000]


def with_nan(array: np.ndarray[Any, Any], place: int = 3) -> np.ndarray[Any, Any]:
    array = array.copy()
    array[place] = np.nan
    return array


def test_refuses_bad_commands_without_moving() -> None:
    plant = Plant(load("hrp4_class"), foot=FEW_SPHERES)
    twin = Plant(load("hrp4_class"), foot=FEW_SPHERES)
    na, good = plant.robot.na, plant.hold()
    zero, position = good.joint_torque, good.joint_position
    assert position is not None
    name = plant.robot.joint_names[3]
    bad = [
        (Command(zero, with_nan(position), zero), f"joint_position of joint '{name}'"),
        (Command(zero, position, with_nan(zero)), f"joint_velocity of joint '{name}'"),
        (Command(with_nan(zero)), f"joint_torque of joint '{name}'"),
        (Command(np.full(na, np.inf), position, zero), "joint_torque"),
        (Command(np.zeros(na - 1), position, zero), "shape"),
        (Command(zero, np.zeros(1), zero), "shape"),
        (Command(zero, position, np.zeros((na, 1))), "shape"),
        (Command(zero, position.tolist(), zero), "arrays"),  # type: ignore[arg-type]
        (Command(zero, None, zero), "position reference"),
        (Command(zero, position, zero, np.array([5.0, 5.0])), "fixed stiffness"),
        (None, "a plant takes a Command, got None"),
    ]
    for _ in range(3):
        for command, message in bad:
            with pytest.raises(InputError, match=message):
                plant.step(command)  # type: ignore[arg-type]
        plant.step(good)
        twin.step(good)
        assert plant.time == twin.time
        np.testing.assert_array_equal(plant.data.qpos, twin.data.qpos)


def test_refuses_bad_stiffness() -> None:
    plant = Plant(load("hrp4_class"), foot="variable")
    zero = np.zeros(plant.robot.na)
    for stiffness in ([-1.0, 5.0], [5.0, 2001.0], [5.0, np.nan], [5.0], [[5.0, 5.0]]):
        with pytest.raises(InputError, match="stiffness"):
            plant.step(Command(zero, plant.hold().joint_position, zero, np.array(stiffness)))
    assert plant.time == 0.0
    np.testing.assert_array_equal(plant.measure().sole_stiffness, [5.0, 5.0])


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (("torsso", [1, 0, 0], 0.1), UnknownNameError, "torso"),
        (("torso", [1, 0], 0.1), InputError, "force"),
        (("torso", [1, 0, np.nan], 0.1), InputError, "force"),
        (("torso", [1, 0, 0], 0.0), InputError, "duration"),
        (("torso", [1, 0, 0], 0.1, [0, np.inf, 0]), InputError, "attack"),
    ],
)
def test_refuses_bad_pushes(
    plant: Plant, arguments: tuple[Any, ...], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        plant.push(*arguments)


def test_pushes_any_link_or_frame(plant: Plant) -> None:
    plant.reset()
    robot = plant.robot
    names = [f.name for f in robot.model.frames if f.parentJoint > 0]
    for name in ["torso", "base", *names]:
        plant.push(name, [0.0, 0.0, 1.0], 0.001)
    plant.step(plant.hold())
    assert plant.diverged is None
    plant.reset()


def test_a_simulation_that_diverges_is_no_fall(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log

    class Poison(TrialHook):
        def after(self, trial: Any) -> None:
            trial.plant.data.qvel[7] = float("nan")

    with pytest.raises(DivergedError, match=r"cannot go on: simulation diverged before 0\.01"):
        StandTrial(StandSpec(noise="none")).run([Poison()])


def test_divergence_is_recorded_refused_and_undone(
    plant: Plant, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    command = plant.hold()
    for poison in ("nan", "1e11"):
        plant.reset()
        before = plant.measure()
        plant.step(command)
        plant.data.qvel[7] = float(poison)
        with caplog.at_level(logging.INFO):
            plant.step(command)
        assert plant.diverged is not None and "diverged before 0.0100 s" in plant.diverged
        assert "MuJoCo" in caplog.text
        with pytest.raises(MeasurementError, match="diverged"):
            plant.measure()
        with pytest.raises(DivergedError, match="reset"):
            plant.step(command)
        plant.reset()
        assert plant.diverged is None
        np.testing.assert_array_equal(plant.measure().joint_position, before.joint_position)
        plant.step(command)
        assert np.isfinite(plant.measure().sole_wrench).all()
    assert list(tmp_path.iterdir()) == []


def test_measurements_cannot_be_written_to(plant: Plant) -> None:
    plant.reset()
    with pytest.raises(ValueError, match="read-only"):
        plant.measure().joint_position[0] = 1.0


def test_reset_refuses_bad_states(plant: Plant) -> None:
    q = plant.robot.half_sitting
    for bad, message in ((q[:-1], "shape"), (with_nan(q, 8), "finite"), (2.0 * q, "quaternion")):
        with pytest.raises(InputError, match=message):
            plant.reset(bad)
    with pytest.raises(InputError, match="velocity"):
        plant.reset(q, velocity=np.zeros(q.size))
