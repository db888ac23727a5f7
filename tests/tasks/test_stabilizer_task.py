"""The stabilizer as a task that anybody adds to a controller."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from properties import by_default

import wbc
from wbc.core.errors import InputError
from wbc.core.robot import GRAVITY
from wbc.robots import load
from wbc.tasks import StabilizerTask
from wbc.tasks.stabilizer.gains import StabilizerGains
from wbc.tasks.stabilizer.pendulum import Pendulum

CONTROLS = {"torque": wbc.TorqueControl, "hybrid": wbc.HybridControl, "position": wbc.PositionControl}


def standing(mode: str) -> tuple[wbc.Plant, wbc.PositionControl | wbc.TorqueControl, StabilizerTask]:
    """Return a plant, and a controller of one's own that balances by the task."""
    description = load("hrp4_class")
    plant = wbc.Plant(
        description, control_period=0.005 if mode == "position" else 0.002, noise="realistic", seed=1
    )
    robot = description.robot()
    controller = wbc.Controller(robot, plant.control_period)
    observer = wbc.Observer(robot, adopt=mode != "position")
    soles = controller.add(wbc.SoleContact("left_foot"), wbc.SoleContact("right_foot"))
    drives = "position" if mode == "position" else "torque"
    task = StabilizerTask(soles, drives=drives, estimate=observer.robot)  # type: ignore[arg-type]
    controller.add(task, wbc.PostureTask(weight=0.1), wbc.OrientationTask(robot.base_frame, weight=10.0))
    controller.add(wbc.JointLimits(), wbc.TorqueLimits())
    return plant, CONTROLS[mode](controller, observer), task


def run(plant: wbc.Plant, control: wbc.PositionControl | wbc.TorqueControl, seconds: float) -> None:
    end = plant.time + seconds
    while plant.time < end - 1e-9:
        plant.step(control.command(plant.measure()))


@pytest.mark.parametrize("mode", by_default(CONTROLS, "torque"))
def test_a_pushed_robot_comes_back_to_its_target(mode: str) -> None:
    """A force of 60 N for 0.1 s, ahead and to the left; the desired wrenches carry the weight."""
    plant, control, task = standing(mode)
    run(plant, control, 0.2)
    plant.push("torso", [42.0, 42.0, 0.0], 0.1)
    run(plant, control, 1.8)
    assert task.output is not None and control.failures == 0
    assert np.linalg.norm((plant.truth().com - task.target)[:2]) < 0.012
    assert task.output.feet.wrenches[:, 2].sum() == pytest.approx(plant.robot.mass * GRAVITY, rel=0.05)


def test_the_com_follows_a_target_that_moves() -> None:
    plant, control, task = standing("torque")
    run(plant, control, 0.2)
    goal = task.target + [0.0, 0.03, -0.04]
    task.move_to(goal, duration=1.0)
    run(plant, control, 1.8)
    np.testing.assert_allclose(task.target, goal, atol=1e-9)
    np.testing.assert_allclose(control.observer.robot.com, goal, atol=0.012)


@pytest.mark.parametrize("contact", [(True, True), (True, False)])
@pytest.mark.parametrize("drives", ["torque", "position"])
def test_a_tick_hands_the_output_of_the_stabilizer_to_the_qp(drives: Any, contact: tuple[bool, bool]) -> None:
    """On torques the feedback's acceleration and the wrenches, by load; on positions the shift and the feet."""
    robot = load("hrp4_class").robot()
    controller = wbc.Controller(robot, 0.005)
    soles = controller.add(wbc.SoleContact("left_foot"), wbc.SoleContact("right_foot"))
    gains = StabilizerGains(com_admittance=(0.5, 0.3))
    task = controller.add(StabilizerTask(soles, drives=drives, gains=gains, moment_by_load=True))
    task.target = goal = np.array(robot.com) + [0.02, -0.03, 0.01]
    np.testing.assert_array_equal(task.target, goal)
    weight = robot.mass * GRAVITY
    wrenches = np.array([[3.0, 2.0, 0.7 * weight, 5.0, -4.0, 1.0], [1.0, -2.0, 0.3 * weight, -2.0, 3.0, 0.5]])
    task.observe(SimpleNamespace(wrenches=wrenches), 0.005)  # type: ignore[arg-type]
    rest = Pendulum.at_rest(goal)
    pendulum = rest._replace(
        com_velocity=np.array([0.2, -0.1, 0.05]), com_acceleration=np.array([0.3, 0.4, -0.2])
    )
    for _ in range(3):
        out = task.update(pendulum, wrenches, contact, 0.3, 0.005)
    places = [pin.SE3(robot.placement(sole.frame)) for sole in robot.soles]
    task.apply(pendulum, contact, places, (0.6, -0.7))
    com, velocity, push = goal.copy(), pendulum.com_velocity.copy(), pendulum.com_acceleration.copy()
    if drives == "torque":
        push[:2] = out.com_acceleration[:2]
        loads = out.feet.wrenches[:, 2]
        for side, part in enumerate(task.parts):
            if contact[side]:
                np.testing.assert_array_equal(part.target, out.feet.wrenches[side])
                share = loads[side] / loads.sum() if all(contact) else 0.5
                np.testing.assert_allclose(part.weight, 1e-3 * np.repeat((1.0, (0.5 / share) ** 2), 3))
    else:
        com[:2] += out.com_offset
        velocity[:2] += out.com_velocity_offset
        push[:2] += out.com_acceleration_offset
        assert np.abs(out.com_offset).min() > 1e-6 or not all(contact)
        for side, foot in enumerate(soles):
            if contact[side]:
                assert foot.target.isApprox(out.corrections[side].apply(places[side])[0], 1e-12)
    np.testing.assert_allclose(task._target, com)
    np.testing.assert_allclose(task.feedforward_velocity, velocity)
    np.testing.assert_allclose(task.feedforward_acceleration, push + [0.6, -0.7, 0.0])


def test_tasks_on_the_wrenches_come_and_go_with_it() -> None:
    _, control, task = standing("torque")
    controller = control.controller
    assert [part.name for part in task.parts] == ["left_foot wrench", "right_foot wrench"]
    assert set(task.parts) < set(controller.tasks)
    controller.remove(task)
    assert not {task, *task.parts} & set(controller.tasks)
    assert not standing("position")[2].parts


def test_it_needs_two_feet_and_a_controller() -> None:
    left = wbc.SoleContact("left_foot")
    with pytest.raises(InputError, match="needs two feet"):
        StabilizerTask((left,))
    with pytest.raises(InputError, match="belongs to no controller yet"):
        _ = StabilizerTask((left, wbc.SoleContact("right_foot"))).stabilizer
