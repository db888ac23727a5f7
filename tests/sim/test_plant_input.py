"""Input that the plant refuses: its message, and that nothing moves."""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wbc.base.errors import InputError, MeasurementError
from wbc.core.drive.position import PositionControl
from wbc.core.signals import Command
from wbc.feet.soles.contact import ContactSpheres
from wbc.feet.soles.rigid import FlatFoot
from wbc.robots import RobotDescription, load
from wbc.sim import DivergedError, Plant, Trial
from wbc.tasks.balance import balance_controller
from wbc.walking import FootstepPlan, WalkingControl

BIPED = (Path(__file__).parents[2] / "examples" / "biped.urdf").read_text()

FEW_SPHERES = FlatFoot(ContactSpheres(row_spacing=0.1))


@pytest.fixture(scope="module")
def plant() -> Plant:
    return Plant(load("hrp4_class"), foot=FEW_SPHERES, visuals=False)


def with_nan(array: np.ndarray[Any, Any], place: int = 3) -> np.ndarray[Any, Any]:
    array = array.copy()
    array[place] = np.nan
    return array


def test_refuses_bad_commands_without_moving() -> None:
    plant = Plant(load("hrp4_class"), foot=FEW_SPHERES, visuals=False)
    twin = Plant(load("hrp4_class"), foot=FEW_SPHERES, visuals=False)
    na, good = plant.robot.na, plant.hold()
    zero, position = good.joint_torque, good.joint_position
    assert position is not None
    name = plant.robot.joint_names[3]
    bad = [
        (Command(zero, with_nan(position), zero), name),
        (Command(zero, position, with_nan(zero)), name),
        (Command(with_nan(zero)), name),
        (Command(np.zeros(na - 1), position, zero), "shape"),
        (Command(zero, None, 1.0 + zero), "position"),
        (Command(zero, position, zero, np.array([5.0, 5.0])), "stiffness"),
        (Command(zero, 1e200 * (1.0 + position**2), zero), plant.robot.joint_names[0]),
    ]
    for value in (-1.0, np.nan, np.inf, 1e200):  # of one joint, or of all alike
        for gains in (np.full(na, value), np.where(np.arange(na) == 3, value, 1.0)):
            fine = np.ones(na)
            bad += [
                (Command(zero, position, zero, kp=k, kd=d), "k[pd] of joint")
                for k, d in ((gains, fine), (fine, gains))
            ]
            bad += [
                (Command(zero, position, zero, kp=gains), "kp of joint"),
                (Command(zero, position, zero, kd=gains), "kd of joint"),
            ]
    for _ in range(3):
        for command, named in bad:
            with pytest.raises(InputError, match=named), np.errstate(over="ignore"):
                plant.step(command)
        plant.step(good)
        twin.step(good)
        assert plant.time == twin.time
        np.testing.assert_array_equal(plant.data.qpos, twin.data.qpos)


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


@pytest.mark.parametrize("effort", ["1e9", "0"])
def test_a_torque_limit_that_stands_for_none_is_derived_and_doubted(effort: str) -> None:
    text = re.sub(r'effort="[^"]+"', f'effort="{effort}"', BIPED, count=1)
    robot = RobotDescription.from_urdf(text, left_sole="left_foot", right_sole="right_foot")
    assert 10.0 < robot.torque_limit[0] < 1000.0
    assert any("torque limits" in line for line in robot.doubts())
    plant = Plant(robot, foot=FEW_SPHERES, visuals=False)
    plant.step(Command(np.full(robot.robot().na, 1e5)))
    assert abs(plant.model.actuator_forcerange[0]).max() == robot.torque_limit[0]


def test_a_plant_takes_the_name_of_a_robot_and_refuses_a_quaternion_that_is_none(plant: Plant) -> None:
    assert Plant("hrp4_class", foot=FEW_SPHERES, visuals=False).description is load("hrp4_class")
    before = plant.data.qpos.copy()
    for length in (0.0, 1.1, 0.9):
        q = np.array(plant.robot.half_sitting)
        q[3:7] *= length
        for pose in (plant.reset, lambda q: Plant("hrp4_class", initial_configuration=q, visuals=False)):
            with pytest.raises(InputError, match="quaternion"):
                pose(q)
    np.testing.assert_array_equal(plant.data.qpos, before)


def test_a_control_made_for_another_period_is_refused_before_anything_moves() -> None:
    """The commands of a control know its period; a trial compares both when it is made."""
    plant_period, control_period = 0.004, 0.006
    plant = Plant(load("hrp4_class"), control_period=plant_period, visuals=False)
    robot = plant.description.robot()
    control = PositionControl(balance_controller(robot, control_period))
    periods = f"{1e3 * control_period:g} ms.*{1e3 * plant_period:g} ms"
    with pytest.raises(InputError, match=periods):
        plant.step(control.command(plant.measure()))
    assert plant.time == 0.0
    robot = plant.description.robot()
    walking = WalkingControl(robot, FootstepPlan.standing(robot), control_period)
    with pytest.raises(InputError, match=periods):
        Trial(plant, walking)
