"""The stabilizer as a task that anybody adds to a controller."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from at_rest import at_rest
from properties import by_default

import wbc
from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY
from wbc.core.trajectories import minimum_jerk
from wbc.robots import load
from wbc.tasks.stabilizer.gains import StabilizerGains
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.tasks.stabilizer.task import StabilizerTask

CONTROLS = {"torque": wbc.TorqueControl, "hybrid": wbc.HybridControl, "position": wbc.PositionControl}


def standing(mode: str) -> tuple[wbc.Plant, wbc.PositionControl | wbc.TorqueControl, StabilizerTask]:
    """Return a plant, and a controller of one's own that balances by the task."""
    description = load("hrp4_class")
    plant = wbc.Plant(
        description,
        control_period=0.005 if mode == "position" else 0.002,
        noise="realistic",
        seed=1,
        visuals=False,
    )
    robot = description.robot()
    controller = wbc.Controller(robot, plant.control_period)
    observer = wbc.Observer(robot, adopt=mode != "position")
    soles = controller.add(wbc.SoleContact("left_foot"), wbc.SoleContact("right_foot"))
    drives = "position" if mode == "position" else "torque"
    task = StabilizerTask(soles, drives=drives)  # type: ignore[arg-type]
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


def test_a_reset_takes_the_heading_anew() -> None:
    """A robot that has been turned by 90° and pushed ahead gets the desired acceleration of one that has not."""
    outputs = []
    for turn in (0.0, 0.5 * np.pi):
        description = load("hrp4_class")
        robot = description.robot()
        controller = wbc.Controller(robot, 0.005)
        soles = controller.add(wbc.SoleContact("left_foot"), wbc.SoleContact("right_foot"))
        task = controller.add(StabilizerTask(soles, gains=StabilizerGains(dcm_p=(2.0, 8.0))))
        q, spin = np.array(robot.q), pin.SE3(pin.exp3(np.array([0.0, 0.0, turn])), np.zeros(3))
        q[:7] = pin.SE3ToXYZQUAT(spin * pin.XYZQUATToSE3(q[:7]))
        robot.update(q, robot.v)
        task.target = spin.act(np.array(task.target))
        controller.reset()
        robot.update(q, np.concatenate([[0.05, 0.03, 0.0], np.zeros(robot.nv - 3)]))
        wrenches = np.zeros((2, 6))
        wrenches[:, 2] = 0.5 * robot.mass * GRAVITY
        measurement: Any = SimpleNamespace(wrenches=wrenches)
        task.observe(measurement, 0.005)
        assert task.output is not None
        outputs.append(spin.rotation.T @ task.output.com_acceleration)
    np.testing.assert_allclose(outputs[1], outputs[0], atol=1e-9)


class Seen(StabilizerTask):
    """Keeps the pendulum that it hands to the stabilizer."""

    def _pendulum(self) -> Pendulum:
        self.seen = super()._pendulum()
        return self.seen


def test_a_target_that_moves_is_a_pendulum_over_the_zmp_that_accelerates_it() -> None:
    """c̈ = ω² (c − z), with ω² = g / h, along a move of minimum jerk."""
    robot = load("hrp4_class").robot()
    controller = wbc.Controller(robot, 0.005)
    soles = controller.add(wbc.SoleContact("left_foot"), wbc.SoleContact("right_foot"))
    task = controller.add(Seen(soles))
    controller.add(wbc.PostureTask(weight=0.1))
    start, way, duration = np.array(task.target), np.array([0.02, -0.015, 0.0]), 0.3
    task.move_to(start + way, duration=duration)
    pushes = []
    for tick in range(50):
        controller.solve(at_rest(robot, tick * 0.005))
        p, height = task.seen, start[2]  # the soles are at height zero
        np.testing.assert_allclose(p.com_acceleration[:2], GRAVITY / height * (p.com - p.zmp)[:2], atol=1e-9)
        share, slope = minimum_jerk(min(tick * 0.005 / duration, 1.0))
        np.testing.assert_allclose(p.com, start + share * way, atol=1e-9)
        np.testing.assert_allclose(p.com_velocity, slope / duration * way, atol=1e-9)
        pushes.append(np.abs(p.com_acceleration).max())
    assert max(pushes) == pytest.approx(10.0 / np.sqrt(3.0) * 0.02 / duration**2, rel=1e-2)


@pytest.mark.slow
def test_the_com_follows_a_target_that_moves() -> None:
    plant, control, task = standing("torque")
    run(plant, control, 0.2)
    goal = task.target + [0.0, 0.03, -0.04]
    task.move_to(goal, duration=1.0)
    run(plant, control, 1.8)
    np.testing.assert_allclose(task.target, goal, atol=1e-9)
    np.testing.assert_allclose(control.observer.robot.com, goal, atol=0.012)


def test_tasks_on_the_wrenches_come_and_go_with_it() -> None:
    _, control, task = standing("torque")
    controller = control.controller
    assert [part.name for part in task.parts] == ["left_foot wrench", "right_foot wrench"]
    assert set(task.parts) < set(controller.tasks)
    controller.remove(task)
    assert not {task, *task.parts} & set(controller.tasks)
    assert not standing("position")[2].parts


@pytest.mark.parametrize("order", ["right, left", "by frame"])
def test_the_order_of_the_contacts_changes_nothing(order: str) -> None:
    """The robot leans to its left in position control, where the commanded robot is not the measured one."""
    commands = []
    for given in (True, False):
        description = load("hrp4_class")
        plant = wbc.Plant(description, visuals=False)
        robot = description.robot()
        controller, observer = wbc.Controller(robot, plant.control_period), wbc.Observer(robot)
        names = [robot.sole("right_foot").frame, "left_foot"] if order == "by frame" else order.split(", ")
        soles = [
            wbc.SoleContact(name if name.endswith(("sole", "_foot")) else f"{name}_foot")
            for name in (["left", "right"] if given else names)
        ]
        controller.add(*soles)
        task = StabilizerTask(soles, drives="position")
        controller.add(task, wbc.PostureTask(weight=0.1), wbc.OrientationTask(robot.base_frame))
        controller.add(wbc.JointLimits(), wbc.TorqueLimits())
        control = wbc.PositionControl(controller, observer)
        task.target = task.target + [0.0, 0.02, 0.0]
        for _ in range(40):
            measurement = plant.measure()
            command = control.command(measurement)
            plant.step(command)
        assert task.output is not None and list(task.wrenches) == ["left_foot", "right_foot"]
        wrenches = task.output.feet.wrenches
        assert wrenches[0, 2] > wrenches[1, 2] + 20.0
        commands.append(command.joint_position)
    np.testing.assert_allclose(commands[0], commands[1], atol=1e-6)


def weight_on_both(robot: wbc.Robot, time: float) -> wbc.Measurement:
    wrenches = np.array([[0.0, 0.0, 0.5 * robot.mass * GRAVITY, 0.0, 0.0, 0.0]] * 2)
    return wbc.Measurement(
        time, robot.q[7:].copy(), np.zeros(robot.na), np.zeros(3), np.array([0.0, 0.0, GRAVITY]), wrenches
    )


@pytest.mark.parametrize("side", [0, 1])
def test_a_foot_that_has_been_set_down_elsewhere_stays_there(side: int) -> None:
    robot = load("hrp4_class").robot()
    controller = wbc.Controller(robot, 0.005)
    soles = controller.add(wbc.SoleContact("left_foot"), wbc.SoleContact("right_foot"))
    task = StabilizerTask(soles, drives="position")
    controller.add(task, wbc.PostureTask(weight=0.1))
    foot, ticks = soles[side], 30
    controller.solve(weight_on_both(robot, 0.0))
    foot.active = False
    for tick in range(ticks):
        controller.solve(weight_on_both(robot, 0.005 * tick))
    q = np.array(robot.q)
    q[7 + robot.joint_index(f"{('left', 'right')[side]}_hip_pitch")] -= 0.15
    robot.update(q, np.zeros(robot.nv))
    foot.active = True
    there = np.array(foot.placement.translation)
    for tick in range(3):
        assert controller.solve(weight_on_both(robot, 0.005 * (ticks + tick))).ok
        np.testing.assert_allclose(foot.target.translation, there, atol=1e-3)
    other = soles[1 - side]
    np.testing.assert_allclose(other.target.translation, other.placement.translation, atol=1e-3)


def test_a_task_that_is_removed_leaves_the_feet_at_rest_and_is_removed_before_them() -> None:
    _, control, task = standing("position")
    controller, robot = control.controller, control.controller.robot
    left, right = controller.contacts
    with pytest.raises(InputError, match="needs"):
        controller.remove(left)
    task.target = task.target + [0.02, 0.0, 0.0]
    for tick in range(10):
        controller.solve(weight_on_both(robot, 0.005 * tick))
    assert left.velocity.any() and right.velocity.any()
    controller.remove(task)
    for contact in (left, right):
        np.testing.assert_array_equal(contact.velocity, 0.0)
        np.testing.assert_allclose(contact.target.homogeneous, contact.placement.homogeneous, atol=1e-12)
    assert controller.solve(weight_on_both(robot, 0.1)).ok
    controller.remove(left, right)


@pytest.mark.parametrize("drives", ["torque", "position"])
def test_a_robot_whose_contacts_are_both_off_is_solved_without_feedback(drives: Any) -> None:
    robot = load("hrp4_class").robot()
    controller = wbc.Controller(robot, 0.005)
    feet = controller.add(wbc.SoleContact("left_foot", ramp=0.0), wbc.SoleContact("right_foot", ramp=0.0))
    task = controller.add(StabilizerTask(feet, drives=drives))  # type: ignore[arg-type]
    controller.solve(weight_on_both(robot, 0.0))
    for on in (False, True):
        for contact in feet:
            contact.active = on  # type: ignore[union-attr]
        assert controller.solve(weight_on_both(robot, 0.005)).ok
        assert (task.output is not None) == bool(task.wrenches) == on


def test_it_needs_two_feet_and_a_controller() -> None:
    left = wbc.SoleContact("left_foot")
    robot = load("hrp4_class").robot()
    for contacts in (
        (left,),
        left,
        (left, left),
        (left, "right_foot"),
        (left, wbc.FixedContact("left_sole")),
    ):
        with pytest.raises(InputError, match=r"needs two feet|contacts(\[1\])? of StabilizerTask"):
            StabilizerTask(contacts)  # type: ignore[arg-type]
    twice = left, wbc.SoleContact(robot.sole("left_foot").frame)
    with pytest.raises(InputError, match="two different soles"):
        wbc.Controller(robot, 0.005).add(StabilizerTask(twice))
    with pytest.raises(InputError, match="controller"):
        _ = StabilizerTask((left, wbc.SoleContact("right_foot"))).stabilizer


def test_the_com_has_the_given_damping_along_the_axes_that_have_a_stiffness() -> None:
    soles = wbc.SoleContact("left_foot"), wbc.SoleContact("right_foot")
    for drives, axes in (("torque", (0.0, 0.0, 1.0)), ("position", (1.0, 1.0, 1.0))):
        given = StabilizerTask(soles, drives=drives, stiffness=9.0, damping=5.0)  # type: ignore[arg-type]
        usual = StabilizerTask(soles, drives=drives, stiffness=9.0)  # type: ignore[arg-type]
        for task, damping in ((given, 5.0), (usual, 6.0)):
            np.testing.assert_array_equal(task.stiffness, np.multiply(9.0, axes))
            np.testing.assert_array_equal(task.damping, np.multiply(damping, axes))


@pytest.mark.parametrize("axes", [("z",), ("x", "y"), "xyz"])
def test_a_stabilizer_of_some_axes_is_refused(axes: Any) -> None:
    with pytest.raises(InputError, match="all axes"):
        StabilizerTask((wbc.SoleContact("left_foot"), wbc.SoleContact("right_foot")), axes=axes)
