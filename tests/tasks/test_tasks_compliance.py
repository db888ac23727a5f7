"""Wrench-driven motion tasks against springs, and against the pose task that they are when nothing pushes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import pinocchio as pin
import pytest
from task_factory import integrate, left_hand, make_robot, near_half_sitting

from wbc.base.errors import MeasurementError
from wbc.base.numbers import Array
from wbc.core.frames import Sole
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.robot import Robot
from wbc.core.signals import Measurement
from wbc.tasks import AdmittanceTask, ComplianceTask, CoMTask, ImpedanceTask, PoseTask, PostureTask

FORCE_STIFFNESS, MOMENT_STIFFNESS = 2e4, 300.0
TARGET = np.array([15.0, -4.0, 30.0, 1.0, -2.0, 0.5])


def robot_with_palm() -> Robot:
    """hrp4_class with a third sole, on the left hand: a foot that can press on something while the robot stands."""
    robot = make_robot("hrp4_class")
    hand = left_hand(robot)
    palm = Sole(hand, hand, name="palm", length=0.1, width=0.08)
    return Robot(robot.model, (*robot.soles, palm), robot.half_sitting, frames=robot.frames)


def measurement(robot: Robot, palm: Array) -> Measurement:
    wrenches = np.zeros((3, 6))
    wrenches[2] = palm
    return Measurement(
        0.0, robot.q[7:], robot.v[6:], np.zeros(3), np.zeros(3), wrenches, np.zeros(3), np.zeros(3)
    )


@dataclass
class Spring:
    """A linear spring in all axes that holds a frame at where it was; wrenches in the frame."""

    home: pin.SE3
    force: float = FORCE_STIFFNESS
    moment: float = MOMENT_STIFFNESS

    def wrench(self, placement: pin.SE3) -> Array:
        away = placement.translation - self.home.translation
        turned = pin.log3(placement.rotation @ self.home.rotation.T)
        back = placement.rotation.T
        return np.concatenate([-self.force * back @ away, -self.moment * back @ turned])


def press(
    make: Callable[[Robot], ComplianceTask], seconds: float, dt: float
) -> tuple[ComplianceTask, Array, Array]:
    """Let the palm of a standing, position-controlled robot hang on a spring: times and wrenches felt."""
    robot = robot_with_palm()
    controller = Controller(robot, dt)
    task = make(robot)
    controller.add(SoleContact("left_foot"), SoleContact("right_foot"), CoMTask(), PostureTask(weight=1e-2))
    controller.add(task)
    task.weight = 1e3
    spring = Spring(robot.placement(task.frame).copy())
    q, v = np.array(robot.q), np.array(robot.v)
    times, felt = [], []
    for tick in range(round(seconds / dt) + 1):
        controller.update(q, v)
        wrench = spring.wrench(robot.placement(task.frame))
        times.append(tick * dt)
        felt.append(wrench)
        solution = controller.solve(measurement(robot, wrench))
        assert solution.ok
        q, v = integrate(controller, q, v, solution.accelerations)
    return task, np.array(times), np.array(felt)


RATE = 10.0  # 1/s
ADMITTANCE = np.repeat([RATE / FORCE_STIFFNESS, RATE / MOMENT_STIFFNESS], 3)


def test_wrench_error_decays_at_admittance_times_stiffness() -> None:
    _, times, felt = press(
        lambda r: AdmittanceTask(
            "palm", admittance=ADMITTANCE, target_wrench=TARGET, time_constant=0.0, stiffness=1e4
        ),
        0.5,
        0.002,
    )
    share = 1.0 - felt / TARGET
    expected = np.exp(-RATE * times)
    np.testing.assert_allclose(share, np.tile(expected[:, None], 6), atol=0.04)


def test_low_pass_makes_the_loop_of_second_order() -> None:
    """Low-pass T and integrator: T s² + s + rate, with a double pole for T = 1 / (4 rate)."""
    time_constant = 0.25 / RATE
    _, times, felt = press(
        lambda r: AdmittanceTask(
            "palm", admittance=ADMITTANCE, target_wrench=TARGET, time_constant=time_constant
        ),
        0.5,
        0.002,
    )
    pole = 0.5 / time_constant
    expected = 1.0 - (1.0 + pole * times) * np.exp(-pole * times)
    np.testing.assert_allclose(felt / TARGET, np.tile(expected[:, None], 6), atol=0.04)


@pytest.mark.parametrize("mass", [(0.0, 0.0), (2.0, 0.5)])
def test_velocity_and_acceleration_of_an_impedance_fulfil_its_law_at_the_end_of_each_period(
    mass: tuple[float, float],
) -> None:
    """Mass · a + damper · v + spring · x = error; without a mass its derivative, damper · a + spring · v = rate."""
    rng, dt = np.random.default_rng(3), 0.005
    task = ImpedanceTask("palm", mass=mass, spring=(300.0, 20.0), damper=(50.0, 3.0))
    robot = robot_with_palm()
    task.bind(robot)
    for wrench in rng.normal(scale=[5, 5, 5, 0, 0, 0.1], size=(20, 6)):  # turned about one axis alone
        error, rate = rng.normal(size=(2, 6)) * [1, 1, 1, 0, 0, 1]
        velocity, acceleration = task.comply(error, rate, dt)
        place = task.offset_vector() + dt * velocity
        heavy, spring, damper = task.mass, task.spring, task.damper
        if mass[0]:
            given = heavy * acceleration + damper * velocity + spring * place
            np.testing.assert_allclose(acceleration, (velocity - task.compliance_velocity) / dt, atol=1e-9)
            np.testing.assert_allclose(given, error, atol=1e-9)
        else:
            np.testing.assert_allclose(damper * velocity + spring * place, error, atol=1e-9)
            np.testing.assert_allclose(damper * acceleration + spring * velocity, rate, atol=1e-9)
        task.observe(measurement(robot, wrench), dt)
    assert np.abs(task.offset_vector()[[0, 1, 2, 5]]).min() > 1e-5
    usual = ImpedanceTask("palm", mass=(2.0, 1.0), spring=(50.0, 1.0)).damper
    np.testing.assert_allclose(usual[:3], 2.0 * np.sqrt(2.0 * 50.0), err_msg="critical")


LAWS: dict[str, Callable[..., ComplianceTask]] = {
    "admittance": partial(AdmittanceTask, "palm", admittance=(2e-3, 0.1)),
    "spring and damper": partial(
        ImpedanceTask, "palm", mass=(0.0, 0.0), spring=(800.0, 50.0), damper=(100.0, 10.0)
    ),
    "impedance": partial(ImpedanceTask, "palm", spring=(800.0, 50.0)),
}


@pytest.mark.parametrize(("spring", "damper"), [(1e6, 1.0), (1e6, 1e5), (0.0, 1e5), (10.0, 1e-3)])
@pytest.mark.parametrize("mass", [0.0, 1.0])
def test_no_spring_or_damper_is_too_stiff_for_the_period(spring: float, damper: float, mass: float) -> None:
    dt, force = 0.005, 20.0
    task = ImpedanceTask(
        "palm",
        mass=(mass, 1.0),
        spring=(spring, 1.0),
        damper=(damper if mass == 0.0 or spring == 0.0 else 2.0 * np.sqrt(mass * spring), 1.0),
    )
    robot = robot_with_palm()
    task.bind(robot)
    seen = measurement(robot, np.array([force, 0.0, 0.0, 0.0, 0.0, 0.0]))
    furthest = max(force * 400 * dt / damper if spring == 0.0 else force / spring, 1e-9)
    for _ in range(400):
        task.observe(seen, dt)
        assert 0.0 <= task.offset_vector()[0] <= 2.0 * furthest + 1e-9
    if spring == 1e6:
        np.testing.assert_allclose(task.offset_vector()[0], force / spring, rtol=1e-3)


@pytest.mark.parametrize("law", LAWS)
def test_without_wrench_error_it_is_a_pose_task(law: str) -> None:
    rng = np.random.default_rng(1)
    answers = []
    for compliant in (True, False):
        robot = robot_with_palm()
        controller = Controller(robot, 0.002)
        target = robot.placement(left_hand(robot)) * pin.SE3(
            pin.exp3(np.array([0.2, -0.1, 0.1])), np.full(3, 0.05)
        )
        task = LAWS[law](stiffness=30.0) if compliant else PoseTask(left_hand(robot), target, stiffness=30.0)
        task.target = target
        task.weight = 7.0
        controller.add(SoleContact("left_foot"), SoleContact("right_foot"), PostureTask())
        controller.add(task)
        rng = np.random.default_rng(1)
        controller.update(*near_half_sitting(robot, rng, 0.03, 0.2))
        felt = np.zeros(6)
        if isinstance(task, ComplianceTask):
            task.target_wrench = felt = rng.normal(size=6)
        solution = controller.solve(measurement(robot, felt))
        assert solution.ok
        answers.append(solution.accelerations)
    np.testing.assert_allclose(answers[0], answers[1], atol=1e-4)


def test_velocity_is_kept_within_its_bound_and_a_reset_takes_the_offset_back() -> None:
    robot, bound = robot_with_palm(), np.repeat([0.05, 0.2], 3)
    task = AdmittanceTask("palm", admittance=(1e-3, 1e-1), velocity_bound=(0.05, 0.2), time_constant=0.01)
    task.bind(robot)
    for sign in (1.0, -1.0):
        task.measured_wrench = np.full(6, sign * 500.0)
        for _ in range(50):
            task.observe(measurement(robot, task.measured_wrench), 0.001)
            assert np.all(np.abs(task.compliance_velocity) <= bound + 1e-12)
        np.testing.assert_allclose(task.compliance_velocity, sign * bound)
    assert task.offset_vector().any()
    task.reset()
    np.testing.assert_array_equal(task.offset_vector(), 0.0)


def test_a_law_gets_the_filtered_wrench_error_and_its_derivative() -> None:
    """A step w behind a low-pass T: w (1 − e^(−t/T)) and w/T e^(−t/T); without a low-pass, w and zero."""

    class Seen(ComplianceTask):
        def comply(self, error: Array, rate: Array, dt: float) -> tuple[Array, Array]:
            self.seen = error.copy(), rate.copy()
            return np.zeros(6), np.zeros(6)

    robot, step = robot_with_palm(), np.array([20.0, -10.0, 5.0, 1.0, 2.0, -3.0])
    for time_constant, dt in ((0.05, 0.002), (0.02, 0.01), (0.0, 0.005)):
        task = Seen("palm", time_constant=time_constant, target_wrench=step)
        task.bind(robot)
        task.measured_wrench = 2.0 * step
        for tick in range(1, 11):
            task.observe(measurement(robot, task.measured_wrench), dt)
            left = np.exp(-tick * dt / time_constant) if time_constant else 0.0
            np.testing.assert_allclose(task.seen[0], step * (1.0 - left), atol=1e-12)
            np.testing.assert_allclose(
                task.seen[1], step * left / time_constant if time_constant else 0.0 * step, atol=1e-9
            )
        np.testing.assert_array_equal(task.wrench_error, task.seen[0])


def test_a_constant_wrench_moves_the_reference_along_a_screw() -> None:
    """Velocities are along the axes of the reference, which turn with it."""
    robot, seconds, dt = robot_with_palm(), 1.0, 1e-3
    task = AdmittanceTask("palm", admittance=(1e-3, 1e-3), velocity_bound=(10, 10), time_constant=0.0)
    task.bind(robot)
    task.measured_wrench = wrench = np.array([200.0, -100.0, 50.0, 300.0, 500.0, -700.0])
    for _ in range(round(seconds / dt)):
        task.observe(measurement(robot, task.measured_wrench), dt)
    screw = pin.exp6(pin.Motion(1e-3 * seconds * wrench))
    np.testing.assert_allclose(task.offset.homogeneous, screw.homogeneous, atol=1e-4)


def test_measurement_with_nan_changes_nothing() -> None:
    robot = robot_with_palm()
    task = AdmittanceTask("palm", admittance=(1e-3, 1e-1))
    task.bind(robot)
    task.observe(measurement(robot, np.full(6, 10.0)), 0.002)
    before = task.offset_vector(), task.wrench_error, task.compliance_velocity
    with pytest.raises(MeasurementError, match="palm|hand"):
        task.observe(measurement(robot, np.full(6, np.nan)), 0.002)
    for was, now in zip(
        before, (task.offset_vector(), task.wrench_error, task.compliance_velocity), strict=True
    ):
        np.testing.assert_array_equal(was, now)
