"""Joint and torque limits: never crossed, never empty, and a way back from outside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from properties import by_default
from task_factory import ROBOTS, integrate, make_robot, standing

from wbc.base.numbers import Array
from wbc.core.limits.joint import BrakingLaw, JointLimits, TorqueLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.robot import Robot
from wbc.robots import load
from wbc.tasks import CoMTask, PostureTask

robots = pytest.mark.parametrize("name", by_default(ROBOTS, "hrp4_class"))
PERIODS = (0.001, 0.002, 0.0033, 0.005)
TOLERANCE = 1e-9


class DoubleIntegrators:
    """The joints of a robot as independent double integrators under a limit's intervals."""

    def __init__(self, robot: Robot, limits: JointLimits, dt: float) -> None:
        self.robot, self.limits, self.dt = robot, limits, dt
        self.rows = np.zeros((robot.na, robot.nv))
        self.lower, self.upper = np.zeros(robot.na), np.zeros(robot.na)
        self.q, self.v = robot.q[7:], robot.v[6:]  # the limit reads the state of the robot

    def step(self, request: Array) -> None:
        self.limits.write(self.dt, self.rows, self.lower, self.upper)
        assert (self.lower <= self.upper).all()
        assert np.isfinite(self.lower[self.lower > -np.inf]).all()
        acceleration = np.clip(request, self.lower, self.upper)
        self.q += self.v * self.dt + 0.5 * acceleration * self.dt**2
        self.v += acceleration * self.dt


def requests(kind: int, rng: np.random.Generator, na: int, time: float, dt: float) -> Array:
    """Accelerations that a controller might command: pushes, waves, noise, and bang-bang."""
    push = rng.choice([-1.0, 1.0], na)
    if kind == 0:
        return 1e4 * push
    if kind == 1:
        return 300.0 * np.sin(2 * np.pi * time * np.linspace(0.3, 8.0, na))
    if kind == 2:
        return 200.0 * rng.normal(size=na)
    return np.full(na, 1e3 if int(time / 0.35) % 2 else -1e3)


def viable_start(robot: Robot, limits: JointLimits, rng: np.random.Generator) -> None:
    """Joints anywhere inside, no faster than braking allows."""
    share = rng.uniform(0.0, 1.0, robot.na)
    q = limits.lower + share * (limits.upper - limits.lower)
    fast_up = np.minimum(np.sqrt(2.0 * limits.braking * (limits.upper - q)), limits.velocity)
    fast_down = np.minimum(np.sqrt(2.0 * limits.braking * (q - limits.lower)), limits.velocity)
    robot.q[7:], robot.v[6:] = q, rng.uniform(-0.98 * fast_down, 0.98 * fast_up)


@pytest.mark.parametrize("acceleration", [None, 40.0])
def test_runs_into_the_limits_cross_none(acceleration: float | None) -> None:
    rng = np.random.default_rng(1)
    runs, nearest = 0, np.inf
    while runs < 100:
        robot = make_robot(ROBOTS[runs % 3])
        limits = JointLimits(acceleration=acceleration)
        limits.bind(robot)
        dt = float(rng.choice(PERIODS))
        viable_start(robot, limits, rng)
        joints = DoubleIntegrators(robot, limits, dt)
        kind = int(rng.integers(4))
        held = requests(kind, rng, robot.na, 0.0, dt)
        for tick in range(250):
            q, v = joints.q.copy(), joints.v.copy()
            joints.step(held if kind == 0 else requests(kind, rng, robot.na, tick * dt, dt))
            a = (joints.v - v) / dt
            turn = np.clip(-v / np.where(a == 0.0, 1e-12, a), 0.0, dt)
            for place in (
                joints.q,
                q + v * turn + 0.5 * a * turn**2,
            ):  # and where it turns round within a period
                assert (place <= limits.upper + TOLERANCE).all()
                assert (place >= limits.lower - TOLERANCE).all()
            assert (np.abs(joints.v) <= limits.velocity + TOLERANCE).all()
            nearest = min(nearest, float((limits.upper - joints.q).min()))
        runs += robot.na
    assert nearest < 1e-3  # the runs did run into the limits


@pytest.mark.parametrize("dt", PERIODS)
def test_the_braking_law_uses_the_whole_distance_and_no_more(dt: float) -> None:
    """After the period, braking at ā ends exactly at the bound."""
    rng = np.random.default_rng(7)
    braking = rng.uniform(5.0, 100.0, 200)
    distance, velocity = rng.uniform(0.05, 1.0, 200), rng.uniform(-1.0, 1.0, 200)
    final = BrakingLaw(braking, dt)(distance, velocity)
    assert (final > 0.0).all()
    left = distance - 0.5 * dt * (velocity + final)
    np.testing.assert_allclose(final**2 / (2.0 * braking), left, rtol=1e-9)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("speed", by_default([0.0, -0.2, 0.25], 0.25))
def test_the_way_back_into_the_range_is_no_faster_than_the_velocity_limit(side: float, speed: float) -> None:
    robot = make_robot("hrp4_class")
    limits = JointLimits(velocity_ratio=0.1)
    limits.bind(robot)
    robot.q[7:] = np.where(side > 0, limits.upper, limits.lower) + 0.3 * side
    robot.v[6:] = -side * np.minimum(speed, limits.velocity)
    joints, greatest = DoubleIntegrators(robot, limits, 0.005), np.zeros(robot.na)
    before = joints.q.copy()
    for _ in range(200):
        joints.step(np.zeros(robot.na))
        greatest = np.maximum(greatest, np.abs(joints.v))
    assert (greatest <= np.maximum(limits.velocity, abs(speed)) + TOLERANCE).all()
    assert (side * (before - joints.q) > 0.5 * np.minimum(limits.velocity, 0.3)).all()


@pytest.mark.parametrize("dt", by_default(PERIODS, 0.0033))
def test_joint_outside_its_limits_comes_back_and_stays(dt: float) -> None:
    rng = np.random.default_rng(3)
    robot = make_robot("talos")
    limits = JointLimits()
    limits.bind(robot)
    side = rng.choice([-1.0, 1.0], robot.na)
    beyond = rng.uniform(0.0, 0.3, robot.na)
    robot.q[7:] = np.where(side > 0, limits.upper + beyond, limits.lower - beyond)
    robot.v[6:] = rng.uniform(-1.0, 1.0, robot.na)
    joints = DoubleIntegrators(robot, limits, dt)
    ticks = round(2.0 / dt)
    for tick in range(ticks):
        joints.step(side * 1e3)  # pushed further out all the time
        if tick * dt > 1.5:
            assert (joints.q <= limits.upper + 1e-3).all()
            assert (joints.q >= limits.lower - 1e-3).all()


def test_interval_is_never_empty_wherever_the_joints_are() -> None:
    rng = np.random.default_rng(4)
    robot = make_robot("hrp4_class")
    kinds = [{}, {"acceleration": 10.0}, {"position": False}, {"velocity": False}]
    for limits in (JointLimits(**kind) for kind in kinds):
        limits.bind(robot)
        rows, lower, upper = np.zeros((robot.na, robot.nv)), np.zeros(robot.na), np.zeros(robot.na)
        for _ in range(100):
            robot.q[7:] = rng.normal(scale=3.0, size=robot.na)
            robot.v[6:] = rng.normal(scale=30.0, size=robot.na)
            limits.write(float(rng.choice(PERIODS)), rows, lower, upper)
            assert (lower <= upper).all()


def test_viable_joint_needs_no_more_than_the_braking_deceleration() -> None:
    rng = np.random.default_rng(5)
    robot = make_robot("g1")
    limits = JointLimits(velocity=False)
    limits.bind(robot)
    rows, lower, upper = np.zeros((robot.na, robot.nv)), np.zeros(robot.na), np.zeros(robot.na)
    for _ in range(200):
        viable_start(robot, limits, rng)
        limits.write(0.001, rows, lower, upper)
        assert (upper >= -limits.braking * (1 + 1e-9)).all()
        assert (lower <= limits.braking * (1 + 1e-9)).all()


@robots
def test_torques_stay_within_limit_and_rate(name: str) -> None:
    controller = standing(name, dt=0.002, posture=False)
    robot = controller.robot
    ratio, rate = 0.8, 2000.0
    com = CoMTask(weight=1e3)
    controller.add(com, PostureTask(), TorqueLimits(ratio=ratio, rate=rate))
    q, v = np.array(robot.q), np.array(robot.v)
    start, before, limited, named = np.array(com.target), None, 0, False
    for tick in range(150):
        com.target = start + np.array([0.0, 0.03 * np.sign(np.sin(40.0 * tick * controller.dt)), 0.0])
        controller.update(q, v)
        solution = controller.solve()
        assert solution.ok, controller.diagnose()
        assert (np.abs(solution.torques) <= ratio * robot.torque_limit + 1e-4).all()
        if before is not None:
            change = np.abs(solution.torques - before)
            assert (change <= rate * controller.dt + 1e-4).all()
            limited += int((change > 0.99 * rate * controller.dt).sum())
        named |= any("torque of" in limit for limit in solution.active_limits)
        before = solution.torques
        q, v = integrate(controller, q, v, solution.accelerations)
        if tick == 100:  # torques do not jump with what is added, either
            knee = robot.joints_between(robot.soles[0].frame, robot.base_frame)[3]
            target = {robot.joint_names[knee]: robot.q[7 + knee] + 0.5}
            controller.add(PostureTask(target, joints=list(target), name="knee", weight=1.0, stiffness=200.0))
    assert limited > 0 and named


@pytest.mark.parametrize("share", [0.0, 0.02])
@pytest.mark.parametrize("direction", [1, -1])
def test_a_drive_of_one_direction_is_not_asked_to_brake_with_what_it_lacks(
    share: float, direction: int
) -> None:
    """The joint is pulled into its bound; a drive without any torque against it keeps no bound there."""
    description = load("hrp4_class")
    for joint in ("left_elbow_pitch", "neck_yaw"):
        most = float(description.torque_limit[description.joint_names.index(joint)])
        weak, strong = -direction * share * most, direction * most
        robot = replace(description, torque_ranges={joint: (min(weak, strong), max(weak, strong))}).robot()
        i, limits = robot.joint_index(joint), JointLimits()
        posture = PostureTask(stiffness=30.0)
        controller = Controller(robot, 0.005)
        controller.add(CoMTask(), posture, *(SoleContact(sole.name) for sole in robot.soles))
        controller.add(limits, TorqueLimits())
        bound = robot.position_upper[i] if direction > 0 else robot.position_lower[i]
        goal = np.array(robot.half_sitting[7:])
        goal[i] = float(bound) + 0.3 * direction
        posture.follow(goal)  # unchecked: it is out of the joint's range
        q, v = np.array(robot.q), np.array(robot.v)
        for _ in range(80):
            controller.update(q, v)
            solution = controller.solve()
            assert solution.ok, (joint, controller.diagnose())
            q, v = integrate(controller, q, v, solution.accelerations)
            assert share == 0.0 or direction * (q[7 + i] - bound) < 1e-3
        assert limits.braking[i] <= max(100.0 * share, 0.3 * share * most / robot.mass_matrix[6 + i, 6 + i])


def test_a_joint_without_torque_and_without_bounds_makes_no_qp_wrong() -> None:
    description = load("hrp4_class")
    given, model = description.robot(), description.pinocchio_model()
    i = given.joint_index("left_elbow_pitch")
    model.upperEffortLimit[6 + i] = 0.0
    model.lowerPositionLimit[7 + i], model.upperPositionLimit[7 + i] = -np.inf, np.inf
    robot = Robot(model, given.soles, given.half_sitting)
    controller = Controller(robot, 0.005)
    controller.add(CoMTask(), PostureTask(), *(SoleContact(sole.name) for sole in robot.soles))
    controller.add(JointLimits(), TorqueLimits())
    solution = controller.solve()
    assert solution.ok and abs(solution.torques[i]) < 1e-5
    law = BrakingLaw(np.array([0.0, 2.0, 0.0]), 0.005)
    np.testing.assert_array_equal(law(np.array([np.inf, np.inf, -0.1]), np.zeros(3)), np.inf)


@pytest.mark.parametrize("always", by_default([False, True], False))
def test_torques_with_other_wrenches_keep_limits_and_rates_too(always: bool) -> None:
    """Each tick has other wrenches, or some have; those of the solution follow on them without a jump."""
    controller = standing("hrp4_class", dt=0.002, posture=False)
    robot, rng, ratio, rate = controller.robot, np.random.default_rng(0), 0.8, 500.0
    controller.add(CoMTask(), PostureTask(), TorqueLimits(ratio=ratio, rate=rate))
    before, differ, settled = None, 0, False
    for tick in range(120):
        solution = controller.solve()
        own, other = solution.wrenches, None
        if tick < 60 and (always or tick % 7 < 3):
            other = {name: own[name] + 50.0 * rng.normal(size=6) for name in ("left_foot", "right_foot")}
        torques = controller.torques(solution, other)
        np.testing.assert_array_equal(controller.torques(solution, other), torques)
        assert (np.abs(torques) <= ratio * robot.torque_limit + 1e-6).all()
        if before is not None:
            assert (np.abs(torques - before) <= rate * controller.dt + 1e-6).all()
        before = torques
        differ += int(np.abs(torques - solution.torques).max() > 1.0)
        settled = bool((torques == solution.torques).all())
    assert differ > 10 and settled
