"""Figures of robots, solutions and moves in closed form: one value each, its unit, and where it comes from."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.base.errors import InputError, MeasurementError, ModelError
from wbc.core.estimation.checks.plausibility import Plausibility
from wbc.core.qp.move import Coordinates, Move, PoseCoordinates, RotationCoordinates, least_turn
from wbc.core.qp.solving.solution import Layout, Solution, Timings
from wbc.core.qp.solving.solver import Status
from wbc.core.robot import GRAVITY, Robot, force_scale
from wbc.core.signals import Measurement
from wbc.core.trajectories import Follower, Quintic, Ramp, Trajectory, approach, minimum_jerk
from wbc.robots import load

G1, PANDA = load("g1"), load("panda")


# ---- robots ---------------------------------------------------------------------------------------------------------


def test_a_torque_is_a_share_of_the_limit_in_its_own_direction() -> None:
    names = G1.robot().joint_names
    ranges = {
        name: (-0.5 * float(most), float(most))
        for name, most in zip(names, G1.robot().torque_limit, strict=True)
    }
    robot = replace(G1, torque_ranges=ranges).robot()
    most = G1.robot().torque_limit
    np.testing.assert_allclose(robot.torque_upper, most)
    np.testing.assert_allclose(robot.torque_lower, -0.5 * most)
    np.testing.assert_allclose(robot.torque_limit, most)
    np.testing.assert_allclose(robot.torque_share(0.4 * most), 0.4)
    np.testing.assert_allclose(robot.torque_share(-0.4 * most), 0.8)
    np.testing.assert_allclose(
        robot.torque_share(np.array([-0.25 * most, 2.0 * most])), [[0.5] * 29, [2.0] * 29]
    )
    assert not robot.torque_share(np.zeros(29)).any()


def test_springs_and_damping_beside_the_drives_are_part_of_the_bias() -> None:
    """A spring has k (q − q₀), a damped joint d q̇."""
    knee, hip = "left_knee_joint", "right_hip_pitch_joint"
    plain = G1.robot()
    robot = replace(G1, springs={knee: (50.0, 0.2)}, damping={hip: 3.0}).robot()
    q, v = robot.half_sitting.copy(), np.linspace(-0.5, 0.6, robot.nv)
    i, j = robot.joint_index(knee), robot.joint_index(hip)
    spring, damped = 50.0 * (q[7 + i] - 0.2), 3.0 * v[6 + j]
    expected = np.zeros(robot.na)
    expected[i] = spring
    np.testing.assert_allclose(robot.spring_torques(np.array([q, q])), [expected] * 2)
    expected[j] += damped
    np.testing.assert_allclose(robot.passive_torques(q, v), expected)
    plain.update(q, v)
    robot.update(q, v)
    np.testing.assert_allclose(np.array(robot.bias)[6:], np.array(plain.bias)[6:] + expected, atol=1e-9)
    np.testing.assert_allclose(np.array(robot.bias)[:6], np.array(plain.bias)[:6], atol=1e-9)


def test_settings_of_a_small_robot_are_scaled_by_its_height_and_its_mass() -> None:
    """0.67 m of the CoM over the sole and 30 kg are taken as they are."""
    assert [force_scale(mass) for mass in (3.0, 15.0, 30.0, 60.0)] == pytest.approx([0.1, 0.5, 1.0, 1.0])
    for name in ("g1", "hrp4_class"):
        robot = load(name).robot()
        model, data = robot.model, robot.model.createData()
        com = pin.centerOfMass(model, data, robot.half_sitting)
        pin.updateFramePlacements(model, data)
        height = com[2] - data.oMf[robot.frame_id(robot.soles[0].frame)].translation[2]
        assert robot.length_scale == pytest.approx(min(1.0, height / 0.67))
        assert robot.force_scale == min(1.0, robot.mass / 30.0)
    assert PANDA.robot().length_scale == 1.0, "without feet nothing is scaled"


@pytest.mark.parametrize(("end", "sign"), [("position_upper", 1.0), ("position_lower", -1.0)])
def test_a_joint_may_be_held_a_fiftieth_of_a_radian_beyond_its_end_and_a_finger_2_mm(
    end: str, sign: float
) -> None:
    robot = PANDA.robot()
    for name, beyond in (("panda_joint4", 0.02), ("panda_finger_joint1", 0.002)):
        index = robot.joint_index(name)
        limit = float(getattr(robot, end)[index])
        robot.check_range("position of joint", [index], np.array([limit + sign * 0.99 * beyond]))
        with pytest.raises(InputError, match=rf"'{name}' \({'m' if 'finger' in name else 'rad'}\)"):
            robot.check_range("position of joint", [index], np.array([limit + sign * 1.01 * beyond]))
        robot.check_range("position of joint", [index], np.array([limit + sign * 2.5 * beyond]), 3.0 * 0.02)


def test_a_configuration_stands_with_its_lower_sole_on_the_ground() -> None:
    robot = G1.robot()
    q = robot.configuration({"left_knee_joint": 1.2})
    assert q[7 + robot.joint_index("left_knee_joint")] == 1.2
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    left, right = (float(data.oMf[robot.frame_id(sole.frame)].translation[2]) for sole in robot.soles)
    assert right == pytest.approx(0.0, abs=1e-9) and left > 0.05
    with pytest.raises(InputError):
        robot.configuration({"left_knee_joint": 9.0})


def test_a_load_counts_from_the_next_update_on_for_all_clones() -> None:
    robot = G1.robot()
    twin, before = robot.clone(), robot.mass
    robot.carry("left_hand", 2.5, (0.1, 0.0, 0.0))
    assert robot.mass == before
    q = np.array(robot.q)
    robot.update(q, np.zeros(robot.nv))
    assert robot.mass == pytest.approx(before + 2.5) and float(robot.total_mass) == robot.mass
    assert twin.mass == before
    twin.update_kinematics(q, np.zeros(robot.nv))
    assert twin.mass == pytest.approx(before + 2.5)
    np.testing.assert_allclose(twin.com, robot.com, atol=1e-12)
    place = robot.placement("left_hand").act(np.array([0.1, 0.0, 0.0]))
    empty = G1.robot()
    expected = (before * empty.com + 2.5 * place) / (before + 2.5)
    np.testing.assert_allclose(robot.com, expected, atol=1e-9)
    robot.carry("left_hand", 0.0)
    robot.update_jacobians(q)
    assert robot.mass == pytest.approx(before)
    robot.update(q, np.zeros(robot.nv))
    np.testing.assert_allclose(robot.com, empty.com, atol=1e-9)


@pytest.mark.parametrize(
    ("off", "good"), [(0.9e-3, True), (-0.9e-3, True), (1.2e-3, False), (-1.2e-3, False)]
)
def test_the_length_of_a_quaternion_is_one_within_a_thousandth(off: float, *, good: bool) -> None:
    robot = G1.robot()
    q, v = np.array(robot.half_sitting), np.zeros(robot.nv)
    q[3:7] = np.array([0.6, 0.0, 0.0, 0.8]) * (1.0 + off)
    if good:
        robot.update(q, v)
    else:
        with pytest.raises(InputError):
            robot.update(q, v)


def test_limits_that_a_model_leaves_open_are_none_and_wrong_ones_are_refused() -> None:
    def arm(**limits: Any) -> Robot:
        model = pin.Model()
        model.name = "arm"
        joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "elbow")
        model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
        model.addFrame(pin.Frame("base", 0, 0, pin.SE3.Identity(), pin.BODY))
        for name, value in limits.items():
            setattr(model, name, np.array([value]))
        return Robot(model, (), np.zeros(1))

    free = arm(upperVelocityLimit=0.0, upperEffortLimit=1e9, lowerPositionLimit=-1.0, upperPositionLimit=1.0)
    assert free.velocity_limit[0] == free.torque_limit[0] == 1e5 and free.torque_lower[0] == -1e5
    good = {
        "lowerPositionLimit": -1.0,
        "upperPositionLimit": 1.0,
        "upperVelocityLimit": 2.0,
        "upperEffortLimit": 3.0,
    }
    robot = arm(**good)
    assert (robot.velocity_limit[0], robot.torque_upper[0], robot.torque_lower[0]) == (2.0, 3.0, -3.0)
    arm(**good | {"lowerPositionLimit": 1.0})
    arm(**good | {"upperEffortLimit": 0.0})
    for wrong in ({"lowerPositionLimit": 1.1}, {"upperVelocityLimit": -1.0}, {"upperEffortLimit": -1.0}):
        with pytest.raises(ModelError, match="'elbow' needs"):
            arm(**good | wrong)


def test_joints_of_a_limb_are_in_their_order_from_the_trunk() -> None:
    robot = G1.robot()
    left = [
        robot.joint_names[joint] for joint in robot.joints_between(robot.soles[0].frame, robot.base_frame)
    ]
    parts = ["hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll"]
    assert left == [f"left_{part}_joint" for part in parts]
    assert [robot.joint_names[joint] for joint in robot.leg_joints] == [
        f"{side}_{part}_joint" for side in ("left", "right") for part in parts
    ]
    arm = PANDA.robot()
    hand = arm.joints_between("panda_hand", arm.base_frame)
    assert hand == list(range(7))


# ---- solutions ------------------------------------------------------------------------------------------------------


def test_a_solution_has_its_parts_by_name_and_limits_that_push() -> None:
    layout = Layout(
        3,
        {"foot": slice(3, 6)},
        {"hand": slice(0, 2), "head": slice(2, 3)},
        {"hand": "m/s²"},
        ("a", "b", "b", "c"),
    )
    timings = Timings(1e-6, 2e-6, 4e-6, 8e-6)
    solution = Solution(
        Status.SOLVED, np.arange(6.0), np.zeros(3), 4, timings, layout, np.array([0.5, -2.0, 3.0]),
        np.array([0.0, -2.0, 3e-6, 1e-6]),
    )  # fmt: skip
    assert timings.total == pytest.approx(15e-6)
    np.testing.assert_array_equal(solution.accelerations, [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(solution.wrenches["foot"], [3.0, 4.0, 5.0])
    np.testing.assert_array_equal(solution.residuals["hand"], [0.5, -2.0])
    np.testing.assert_array_equal(solution.residuals["head"], [3.0])
    assert solution.active_limits == ("b", "b"), "from a millionth of the greatest multiplier on"
    solution.multipliers = np.array([2e-6, 0.9e-6, -2e-6, 0.0])
    assert solution.active_limits == ("a", "b"), "and a millionth at least"
    assert repr(solution) == "Solution(solved, 2 active limits, 15 µs)"
    cells = re.sub("<[^>]*>", " ", solution._repr_html_()).split()
    rows = "hand 2 m/s² head 3 foot 3.0 4.0 5.0 N, Nm limit a limit b"
    assert " ".join(cells) == f"{solution!r} {rows}"


def test_a_status_table_has_the_greatest_number_of_each_task_and_the_force_of_each_contact() -> None:
    controller = wbc.balance_controller(G1.robot(), 0.005)
    table = controller.status_table().splitlines()
    assert "period 5 ms" in table[0] and table[1] == "not solved yet"
    com = controller.task("com")
    com.weight = np.array([3.0, 70.0, 5.0])
    com.scale = 0.5
    com.target = com.target + [0.01, -0.02, 0.005]
    assert controller.solve().ok
    solution = controller.solution
    assert solution is not None
    lines = controller.status_table().splitlines()
    (row,) = [line.split() for line in lines if line.startswith("com ")]
    residual = np.abs(solution.residuals["com"]).max()
    assert row[:5] == ["com", "3", "35", "0.02", "m"] and float(row[5]) == pytest.approx(residual, rel=5e-3)
    t = solution.timings
    assert f"{1e6 * t.total:.0f} µs (model {1e6 * t.model:.0f}, assembly {1e6 * t.assembly:.0f}" in lines[1]
    for name, force in solution.wrenches.items():
        (line,) = [line for line in lines if line.startswith(f"contact {name}")]
        assert [float(part) for part in line.split()[3:]] == pytest.approx(force.tolist(), abs=0.051)
    assert lines[-1].startswith("active limits: ")


# ---- moves ----------------------------------------------------------------------------------------------------------


def test_a_minimum_jerk_begins_and_ends_at_rest() -> None:
    """10 s³ − 15 s⁴ + 6 s⁵ and its derivative 30 s² (1 − s)²."""
    for s, value, rate in (
        (0.0, 0.0, 0.0),
        (0.25, 0.103515625, 1.0546875),
        (0.5, 0.5, 1.875),
        (1.0, 1.0, 0.0),
    ):
        assert minimum_jerk(s) == pytest.approx((value, rate))
    ramp, curve = Ramp(1.0), Quintic((1.0, 0.0, 0.0), (3.0, 0.0, 0.0), 0.5)
    ramp.advance(0.1)
    assert ramp.value == 1.0
    ramp.to(3.0, 0.5)
    for tick in range(1, 7):
        ramp.advance(0.1)
        assert ramp.value == pytest.approx(curve.at(min(0.1 * tick, 0.5))[0])
    assert ramp.value == ramp.goal == 3.0


def test_a_follower_is_a_critically_damped_mass() -> None:
    """From 0 to 1 by 1 − (1 + t/T) e^{−t/T}."""
    follower, dt = Follower(0.2, 0.0), 1e-4
    for _ in range(4000):
        follower.follow(1.0 - follower.value, dt)
    t = 4000 * dt / 0.2
    assert follower.value == pytest.approx(1.0 - (1.0 + t) * math.exp(-t), abs=1e-3)
    assert follower.velocity == pytest.approx(t / 0.2 * math.exp(-t), rel=1e-2)
    assert follower.acceleration == pytest.approx((1.0 - t) / 0.2**2 * math.exp(-t), rel=2e-2)


def test_an_approach_is_bounded_in_speed_and_acceleration_and_brakes_in_time() -> None:
    """√(a d) towards what is near, 8/s d at last, and no change of more than a dt in a tick."""
    dt, way = 0.01, np.array([0.6, -0.8])
    rest = np.zeros(2)
    np.testing.assert_allclose(approach(5.0 * way, rest, 0.3, 2.0, dt), 0.02 * way)
    np.testing.assert_allclose(approach(5.0 * way, 0.299 * way, 0.3, 2.0, dt), 0.3 * way)
    np.testing.assert_allclose(approach(0.045 * way, 0.295 * way, 0.9, 2.0, dt), 0.3 * way, rtol=1e-9)
    np.testing.assert_allclose(approach(0.001 * way, 0.01 * way, 0.9, 2.0, dt), 0.008 * way, rtol=1e-9)
    np.testing.assert_allclose(approach(rest, 0.015 * way, 0.9, 2.0, dt), 0.0, atol=1e-12)
    np.testing.assert_allclose(approach(-5.0 * way, 0.3 * way, 0.3, 2.0, dt), 0.28 * way)


def test_a_move_is_there_after_its_duration_and_says_so_in_the_tick_after() -> None:
    move = Move(
        Coordinates(np.array([1.0, 2.0]), np.asarray), [np.array([2.0, 0.0])], (None, None), duration=0.4
    )
    for tick in range(4):
        target, velocity, _ = move.now()
        value, rate = minimum_jerk(tick / 4)
        np.testing.assert_allclose(target, [1.0 + value, 2.0 - 2.0 * value], atol=1e-12)
        np.testing.assert_allclose(velocity, np.array([1.0, -2.0]) * rate / 0.4, atol=1e-12)
        assert not move.arrived and move.advance(0.1)
    assert move.arrived and not move.advance(0.1)
    np.testing.assert_allclose(move.now()[0], [2.0, 0.0], atol=1e-12)


def test_turns_between_rotations_are_the_shorter_ones_and_of_more_than_one_go_on() -> None:
    base = pin.utils.rotate("x", 0.4)
    places = RotationCoordinates(base, np.asarray)
    turn = np.array([0.0, 0.0, 2.5])
    first = places.of(pin.exp3(turn) @ base, np.zeros(3))
    np.testing.assert_allclose(first, turn, atol=1e-9)
    second = places.of(pin.exp3(2.0 * turn) @ base, first)
    np.testing.assert_allclose(second, 2.0 * turn, atol=1e-9)
    np.testing.assert_allclose(
        places.of(pin.exp3(2.0 * turn) @ base, np.zeros(3)), [0, 0, 5.0 - math.tau], atol=1e-9
    )
    rotation, spin, _ = places.target(0.3 * turn, turn, np.zeros(3))
    np.testing.assert_allclose(rotation, pin.exp3(0.3 * turn) @ base, atol=1e-12)
    np.testing.assert_allclose(spin, turn, atol=1e-12)
    poses = PoseCoordinates(pin.SE3(base, np.array([1.0, 2.0, 3.0])), lambda pose: pose)
    np.testing.assert_allclose(poses.start, [1.0, 2.0, 3.0, 0.0, 0.0, 0.0])
    at = poses.of(pin.SE3(pin.exp3(turn) @ base, np.array([2.0, 2.0, 2.0])), poses.start)
    np.testing.assert_allclose(at, [2.0, 2.0, 2.0, *turn], atol=1e-9)


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 1.2, 3.1, math.pi])
def test_a_least_turn_is_about_the_normal_of_both_directions(angle: float) -> None:
    axis = np.array([0.0, 0.6, 0.8])
    normal = np.cross(axis, np.array([1.0, 0.0, 0.0]))
    direction = pin.exp3(angle * normal) @ axis
    turn = least_turn(axis, direction)
    assert np.linalg.norm(turn) == pytest.approx(angle, rel=1e-6)
    np.testing.assert_allclose(pin.exp3(turn) @ axis, direction, atol=1e-9)
    if angle < 3.0:
        np.testing.assert_allclose(turn, angle * normal, atol=1e-9)


@pytest.mark.parametrize(
    "begin", [((0.4, -0.2), None), (None, (1.0, 0.5)), ((0.3, 0.1), (-1.0, 2.0)), (None, None)]
)
def test_a_trajectory_goes_on_with_the_velocity_and_the_acceleration_at_its_start(begin: Any) -> None:
    """Between two points it is the quintic of the states of its ends."""
    velocity, acceleration = begin
    path = Trajectory([(0.1, 0.2), (1.0, -0.3)], 0.8, velocity=velocity, acceleration_at_start=acceleration)
    zero = np.zeros(2)
    start = np.array([0.1, 0.2]), *(zero if part is None else np.array(part) for part in begin)
    curve = Quintic(start, (np.array([1.0, -0.3]), zero, zero), 0.8)
    for time in (0.0, 0.1, 0.4, 0.79):
        for part, expected in zip(path.at(time), curve.at(time), strict=True):
            np.testing.assert_allclose(part, expected, atol=1e-9)
    np.testing.assert_allclose(path.at(0.8)[0], [1.0, -0.3])
    assert not np.any(path.at(0.9)[1:])


# ---- what has changed -----------------------------------------------------------------------------------------------


def test_each_change_of_a_contact_or_a_task_raises_its_revision() -> None:
    """So that two of them between two ticks are seen."""
    controller = wbc.balance_controller(G1.robot(), 0.005)
    contact, task = controller.contacts[0], controller.task("com")
    point = controller.add(wbc.PointContact("left_hand", friction=0.5))
    for item, changes in (
        (
            contact,
            {
                "wrench_weight": 1e-3, "friction": 0.6, "min_force": 12.0, "max_force": 900.0, "stiffness": 50.0,
                "damping": 9.0, "rate": 11.0, "active": False,
            },
        ),
        (point, {"friction": 0.7, "wrench_weight": 1e-4, "min_force": 3.0}),
        (
            task,
            {
                "weight": 5.0, "scale": 0.5, "stiffness": 40.0, "damping": 7.0, "rate": 3.0, "error_bound": 0.1,
                "spared": np.array([20]),
            },
        ),
    ):  # fmt: skip
        for name, value in changes.items():
            before = item.revision
            setattr(item, name, value)
            if name == "active":
                item.advance(0.005)
            assert item.revision > before, name
    contact.active = True
    before = contact.revision
    contact.set_box(0.1, 0.05)
    assert contact.revision > before


# ---- measurements ---------------------------------------------------------------------------------------------------

HRP4 = load("hrp4_class").robot()
WEIGHT = HRP4.mass * GRAVITY
DT = 0.005


def rest(time: float, **changes: Any) -> Measurement:
    wrench = np.zeros((2, 6))
    wrench[:, 2] = 0.5 * WEIGHT
    up = HRP4.placement(HRP4.imu_frame).rotation.T @ np.array([0.0, 0.0, GRAVITY])
    still = np.zeros(HRP4.na)
    return replace(Measurement(time, HRP4.half_sitting[7:].copy(), still, np.zeros(3), up, wrench), **changes)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("share", [0.99, 1.01])
def test_torques_and_wrenches_of_hands_are_left_out_beyond_their_ranges(sign: float, share: float) -> None:
    """Three times the limits of joints, ten weights, and these over the length of a sole."""
    limit, longest = HRP4.torque_limit, max(sole.length for sole in HRP4.soles)
    for place, unit in ((1, "N"), (5, "Nm")):
        checks, hands, torque = Plausibility(HRP4, DT), np.zeros((2, 6)), np.zeros(HRP4.na)
        most = 10.0 * WEIGHT * (1.0 if unit == "N" else longest)
        hands[1, place], torque[7] = sign * share * most, sign * share * 3.0 * limit[7]
        used, _ = checks.check(rest(0.0, hand_wrenches=hands, joint_torque=torque))
        assert used.hand_wrenches is not None and np.isfinite(used.hand_wrenches[0]).all()
        assert np.isnan(used.hand_wrenches[1]).all() == (share > 1.0)
        assert (used.joint_torque is None) == (share > 1.0)
        assert len(checks.faults) == (2 if share > 1.0 else 0)
        checks.check(rest(DT))
        assert checks.faults == ()


def test_a_clock_may_step_by_twenty_periods_and_one_that_has_jumped_is_adopted_after_a_while() -> None:
    checks = Plausibility(HRP4, DT)
    checks.check(rest(1.0))
    used, anew = checks.check(rest(1.0 + 19.9 * DT))
    assert used.time == pytest.approx(1.0 + 19.9 * DT) and not anew
    with pytest.raises(MeasurementError, match=rf"steps must lie in \[0, {20 * DT:g}\] s"):
        checks.check(rest(1.0 + 40.0 * DT))
    with pytest.raises(MeasurementError):
        checks.check(rest(0.5))
    begun = checks.stamps.time
    for tick in range(1, 6):  # 30 ms of steps
        with pytest.raises(MeasurementError):
            checks.check(rest(0.5 + tick * DT))
    assert checks.stamps.time == begun, "it is refused without being adopted"
    used, anew = checks.check(rest(0.5 + 6.01 * DT))
    assert anew and used.time == pytest.approx(0.5 + 6.01 * DT)
    assert not checks.check(rest(0.5 + 7.0 * DT))[1]
