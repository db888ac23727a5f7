"""Figures of the core in closed form: what released joints are known to do, steps of time, and who is named."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import wbc
from wbc.base.errors import InputError
from wbc.core.drive.gate import CommandGate
from wbc.core.estimation.checks.plausibility import Plausibility
from wbc.core.estimation.observer import Observer, ObserverSettings
from wbc.core.friction import mean_distance, rectangle_wrench_cone
from wbc.core.qp.released import LAG, RESPONSE
from wbc.core.robot import GRAVITY
from wbc.core.signals import LARGEST_COMMAND, Command, Measurement
from wbc.core.trajectories import QuinticPath

G1 = wbc.load_robot("g1")
DT = 0.005
ARM = ("left_shoulder_pitch_joint", "left_elbow_joint")


# ---- commands -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("place", [0, 1, 3])
@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("kp", -1.0, "from 0 to .*got -1"),
        ("kd", -1e-9, "from 0 to .*got -1e-09"),
        ("joint_torque", math.nan, "finite number .*got nan"),
        ("joint_position", 1.01 * LARGEST_COMMAND, "got 1.01e"),
        ("joint_velocity", -1.01 * LARGEST_COMMAND, "got -1.01e"),
    ],
)
def test_the_joint_of_a_command_that_no_drive_must_get_is_named(
    name: str, value: float, said: str, place: int
) -> None:
    names = ("a", "b", "c", "d")
    parts = {
        each: np.full(4, 2.0) for each in ("joint_torque", "joint_position", "joint_velocity", "kp", "kd")
    }
    good = Command(**parts)
    assert good.check(names) is good
    parts[name][place] = value
    with pytest.raises(InputError, match=rf"{name} of joint '{names[place]}' .*{said}"):
        good.check(names)
    parts[name][place] = 0.0 if name in ("kp", "kd") else math.copysign(LARGEST_COMMAND, value)
    assert good.check(names) is good


@pytest.mark.parametrize("end", [1.0, -1.0])
@pytest.mark.parametrize(("beyond", "counts"), [(0.5e-6, False), (2e-6, True)])
def test_what_is_beyond_a_limit_by_a_millionth_is_cut_and_not_named(
    end: float, beyond: float, counts: bool
) -> None:
    """On all ways through the gate, at both ends, also of drives that pull with less than they push with."""
    names = G1.robot().joint_names
    ranges = {
        name: (-0.6 * float(m), float(m)) for name, m in zip(names, G1.robot().torque_limit, strict=True)
    }
    robot = replace(G1, torque_ranges=ranges).robot()
    least, most = robot.torque_lower, robot.torque_upper
    q, still, joint = robot.half_sitting[7:], np.zeros(robot.na), 4
    limit = most if end > 0.0 else least
    torque = 0.5 * (least + most)
    torque[joint] = limit[joint] + end * beyond * robot.torque_limit[joint]
    none = (still, still)
    for way in range(3):
        gate = CommandGate(robot, DT)
        if way == 0:
            sent = gate.pass_on(torque)
        elif way == 1:
            sent = gate.pass_on(torque, q, still)
        else:
            sent = gate.pass_on_with_gains(torque, q, still, none, (q, still))
        assert sent.joint_torque[joint] == pytest.approx(limit[joint], rel=1e-12)
        assert gate.faults == ((names[joint],) if counts else ())
    admitted = CommandGate(robot, DT).admit(Command(torque), (q, still))
    assert (admitted.joint_torque[joint] == torque[joint]) is not counts
    speed = 2.0 * robot.velocity_limit
    gate, fast = CommandGate(robot, DT), still.copy()
    fast[joint] = end * (1.0 + beyond) * speed[joint]
    sent = gate.pass_on(still, q, fast)
    assert sent.joint_velocity is not None and sent.joint_velocity[joint] == pytest.approx(
        end * speed[joint], rel=1e-12
    )
    assert gate.faults == ((names[joint],) if counts else ())


# ---- released joints ------------------------------------------------------------------------------------------------


def released_arm() -> tuple[Any, Any, np.ndarray, np.ndarray]:
    robot = G1.robot()
    joints = [
        name for name in robot.joint_names if "left" in name and ("elbow" in name or "shoulder_pitch" in name)
    ]
    controller = wbc.balance_controller(robot, DT)
    released = controller.release(joints)
    assert released is not None and len(joints) == 2
    return robot, released, np.array(robot.q), np.zeros(robot.nv)


def test_what_is_told_of_released_joints_is_followed_like_a_critically_damped_mass() -> None:
    """Acceleration a + 2/T (v − q̇) + 1/T² (p − q), at most twice what the torque limit gives the joint alone."""
    robot, released, q, v = released_arm()
    index, rate = released.index, 1.0 / RESPONSE
    q[7 + index], v[6 + index] = (0.3, -0.2), (0.1, 0.4)
    for velocity, push in ((0.0, 0.0), (0.5, -1.0), (np.array([0.2, -0.1]), np.array([1.0, 2.0]))):
        released.tell(q[7 + index] + (0.001, -0.002), velocity, push)
        released.update(q, v, DT)
        expected = push + 2.0 * rate * (velocity - v[6 + index]) + rate**2 * np.array([0.001, -0.002])
        most = 2.0 * robot.torque_limit[index] / np.diag(robot.mass_matrix)[6 + index]
        assert (np.abs(expected) < most).all()
        np.testing.assert_allclose(released.feedforward_acceleration, expected)
    released.tell(q[7 + index] + (9.0, -9.0))
    released.update(q, v, DT)
    np.testing.assert_allclose(released.feedforward_acceleration, most * (1.0, -1.0))
    for bad in (0.3, np.zeros(3), np.array([0.0, math.nan])):
        with pytest.raises(InputError, match="position told"):
            released.tell(bad)


def test_released_joints_that_nobody_tells_of_go_on_as_they_are_measured() -> None:
    """The difference of their velocities, low-passed."""
    _, released, q, v = released_arm()
    index, push = released.index, np.array([0.5, -0.25])
    for tick in range(1, 40):
        released.update(q, v, DT)
        v[6 + index] += DT * push
        gone = (tick - 1) * DT
        expected = push * (1.0 - math.exp(-gone / LAG))
        np.testing.assert_allclose(released.feedforward_acceleration, expected, atol=1e-9)


# ---- paths -----------------------------------------------------------------------------------------------------------


def test_a_path_with_one_goal_is_planned_anew_and_one_that_is_planned_from_its_begin_has_only_new_goals() -> (
    None
):
    path = QuinticPath((0.0, 0.0, 0.0))
    path.follow(0.0, (1.0, (1.0, 0.0, 0.0)))
    path.follow(0.5, (1.5, (2.0, 0.0, 0.0)))
    assert path.at(0.5)[0] == pytest.approx(0.5) and path.at(2.0) == pytest.approx((2.0, 0.0, 0.0))
    path.follow(0.0, (3.0, (5.0, 0.0, 0.0)), (4.0, (6.0, 0.0, 0.0)))
    path.follow(0.0, (1.0, (-1.0, 0.0, 0.0)))
    assert path.at(1.0) == pytest.approx((-1.0, 0.0, 0.0)) == path.at(9.0)


# ---- plausibility ---------------------------------------------------------------------------------------------------


def standing() -> tuple[Any, Measurement]:
    robot = G1.robot()
    wrenches = np.zeros((2, 6))
    wrenches[:, 2] = 0.5 * robot.mass * GRAVITY
    still = np.zeros(robot.na)
    force = robot.placement(robot.imu_frame).rotation.T @ (0.0, 0.0, GRAVITY)
    return robot, Measurement(0.0, np.array(robot.half_sitting[7:]), still, np.zeros(3), force, wrenches)


def test_velocities_for_damping_need_no_wrenches_and_leave_nothing_behind() -> None:
    robot, measurement = standing()
    check = Plausibility(robot, DT)
    check.check(measurement)
    fast = np.array(measurement.joint_velocity)
    fast[3] = 2.0 * check.settings.velocity_margin * robot.velocity_limit[3]
    fast[4] = 0.9 * robot.velocity_limit[4]
    blind = replace(measurement, joint_velocity=fast, sole_wrench=None)
    expected = fast.copy()
    expected[3] = np.nan
    np.testing.assert_array_equal(check.joints(blind)[1], expected)
    np.testing.assert_array_equal(np.isnan(check.joints(blind)[1]), np.arange(robot.na) == 3)
    assert all(np.isnan(part).all() for part in check.joints("nothing"))
    heavy = np.array(measurement.sole_wrench)
    heavy[1, 2] = 1.1 * check.settings.force_ratio * robot.mass * GRAVITY
    check.check(replace(measurement, time=DT, sole_wrench=heavy))
    (reason,) = check.reasons
    assert (
        reason.sensor == f"force sensor of {robot.soles[1].name}" and reason.why == "" and reason.unit == "N"
    )
    assert reason.value == pytest.approx(heavy[1, 2])
    assert reason.high == pytest.approx(check.settings.force_ratio * robot.mass * GRAVITY) == -reason.low


@pytest.mark.parametrize("foot", [0, 1])
def test_the_worst_number_of_a_sensor_is_the_one_that_is_told_with_its_bounds(foot: int) -> None:
    robot, measurement = standing()
    check = Plausibility(robot, DT)
    check.check(measurement)
    most = check.settings.force_ratio * robot.mass * GRAVITY
    wrong = np.array(measurement.sole_wrench)
    wrong[foot, 0], wrong[foot, 4] = 1.5 * most, -3.0 * most * robot.soles[foot].length
    check.check(replace(measurement, time=DT, sole_wrench=wrong))
    (reason,) = check.reasons
    assert reason.sensor == f"force sensor of {robot.soles[foot].name}" and reason.unit == "Nm"
    assert reason.value == pytest.approx(wrong[foot, 4]) and not reason.jump
    assert reason.high == pytest.approx(most * robot.soles[foot].length) == -reason.low


def test_a_jump_is_told_with_what_a_joint_can_travel_in_the_time() -> None:
    robot, measurement = standing()
    check, joint = Plausibility(robot, DT), 5
    check.check(measurement)
    s, before = check.settings, float(measurement.joint_position[joint])
    travel = s.velocity_margin * robot.velocity_limit[joint] * DT + s.position_jump
    jumped = np.array(measurement.joint_position)
    jumped[joint] += 1.1 * travel
    check.check(replace(measurement, time=DT, joint_position=jumped))
    (reason,) = check.reasons
    assert reason.jump and reason.sensor == f"encoder of {robot.joint_names[joint]}" and reason.unit == "rad"
    assert (reason.low, reason.high) == pytest.approx((before - travel, before + travel))


# ---- observer -------------------------------------------------------------------------------------------------------


def felt(robot: Any, time: float, left: Any, right: Any) -> Measurement:
    """A robot at rest with wrenches on its soles."""
    wrenches = np.array([left, right], dtype=float)
    force = robot.placement(robot.imu_frame).rotation.T @ (0.0, 0.0, GRAVITY)
    still = np.zeros(robot.na)
    return Measurement(time, np.array(robot.half_sitting[7:]), still, np.zeros(3), force, wrenches)


def normal(force: float, roll: float = 0.0, pitch: float = 0.0) -> list[float]:
    return [0.0, 0.0, force, roll, pitch, 0.0]


@pytest.mark.parametrize("name", ["g1", "talos"])
def test_feet_share_what_they_carry_beyond_the_least_load(name: str) -> None:
    """The first measurement as it is, later ones low-passed; a pull is no load."""
    robot = wbc.load_robot(name).robot()
    settings = ObserverSettings(load_time_constant=0.02)
    observer, least = Observer(robot, settings), settings.min_load * robot.force_scale
    observer.update(felt(robot, 0.0, normal(least + 90.0), normal(least + 30.0)))
    assert observer.load == pytest.approx([least + 90.0, least + 30.0])
    assert observer.rest.shares == pytest.approx([0.75, 0.25]) == observer.load_shares
    assert min(observer.rest.shares) == pytest.approx(0.25) and any(observer.rest.shares)
    observer.update(felt(robot, 0.01, normal(least + 10.0), normal(-500.0)))
    left = math.exp(-0.01 / 0.02)
    loads = [least + 10.0 + 80.0 * left, (least + 30.0) * left]
    assert observer.load == pytest.approx(loads)
    parts = [max(load - least, 0.0) for load in loads]
    assert observer.rest.shares == pytest.approx([part / sum(parts) for part in parts])
    for tick in range(2, 60):
        observer.update(felt(robot, 0.01 * tick, normal(0.99 * least), normal(0.0)))
    assert not any(observer.rest.shares)


def test_a_centre_of_pressure_is_low_passed_and_within_its_sole() -> None:
    """At (−m_y/f, m_x/f), no further than the edges; a foot without a load has it in the middle."""
    robot = G1.robot()
    settings = ObserverSettings(cop_time_constant=0.05, load_time_constant=0.0)
    observer = Observer(robot, settings)
    half = 0.5 * robot.soles[0].length, 0.5 * robot.soles[0].width
    observer.update(felt(robot, 0.0, normal(200.0, 2.0, -4.0), normal(200.0, 99.0, 99.0)))
    np.testing.assert_allclose([foot.cop for foot in observer._feet], [(0.02, 0.01), (-half[0], half[1])])
    least = settings.min_load * robot.force_scale
    observer.update(felt(robot, 0.02, normal(200.0, 1.0, 1.0), normal(0.9 * least, 1.0, 1.0)))
    left = math.exp(-0.02 / 0.05)
    expected = [(-0.005 + 0.025 * left, 0.005 + 0.005 * left), (-half[0] * left, half[1] * left)]
    np.testing.assert_allclose([foot.cop for foot in observer._feet], expected)


# ---- contacts -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("length", "width"), [(0.1, 0.05), (0.08, 0.08), (0.03, 0.2)])
def test_the_mean_distance_of_a_rectangle_is_the_one_of_its_points(length: float, width: float) -> None:

    count = 400
    x, y = ((np.arange(count) + 0.5) / count * half for half in (length, width))
    assert mean_distance(length, width) == pytest.approx(np.hypot(x[:, None], y).mean(), rel=1e-4)
    corners, even = (rectangle_wrench_cone(length, width, 0.7, even=each) for each in (False, True))
    load = np.array([0.0, 0.0, 100.0, 0.0, 0.0, 0.0])
    nu = 0.7 / math.sqrt(2.0)
    for cone, most in (
        (corners, nu * 100.0 * (length + width)),
        (even, nu * 100.0 * mean_distance(length, width)),
    ):
        for sign in (1.0, -1.0):
            load[5] = sign * 0.999 * most
            assert (cone @ load <= 0.0).all()
            load[5] = sign * 1.001 * most
            assert (cone @ load > 0.0).any()


def test_a_contact_without_bounds_of_its_own_has_those_of_its_robot() -> None:
    """Ten newtons at least, less of a light robot; four times the weight at most, half of it while it is less."""
    for name in ("g1", "talos"):
        robot = wbc.load_robot(name).robot()
        controller = wbc.balance_controller(robot, DT)
        contact = wbc.SoleContact(robot.soles[0].name, ramp=0.2)
        controller.remove(controller.contacts[0])
        controller.add(contact)
        least, most = 10.0 * robot.force_scale, 4.0 * robot.mass * GRAVITY
        assert contact.force_ranges() == pytest.approx((least, most)) and contact.max_force == pytest.approx(
            most
        )
        contact.active = False
        contact.reset()
        contact.active = True
        for tick in range(1, 50):
            contact.advance(DT)
            share = min(tick * DT / 0.2, 1.0)
            assert contact.force_ranges() == pytest.approx((min(least, 0.5 * share * most), share * most))
        contact.max_force = 50.0
        contact.max_force = contact.max_force
        assert contact.force_ranges() == pytest.approx((least, 50.0))
        with pytest.raises(InputError, match="must exceed"):
            contact.min_force = 50.0
