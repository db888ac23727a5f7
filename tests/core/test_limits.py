"""Joint and torque limits: never crossed, never empty; limits of all kinds: a solution, and a way back from outside."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import by_default, examples
from task_factory import ROBOTS, integrate, make_robot, right_hand, standing

import wbc
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.limits.joint import BrakingLaw, JointLimits
from wbc.core.limits.torque import TorqueLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.solving.solver import Status
from wbc.core.robot import Robot
from wbc.robots import load
from wbc.tasks import CoMTask, PostureTask, check_rows

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
    while runs < 300:
        robot = make_robot(ROBOTS[runs % 3])
        limits = JointLimits(acceleration=acceleration)
        limits.bind(robot)
        dt = float(rng.choice(PERIODS))
        viable_start(robot, limits, rng)
        joints = DoubleIntegrators(robot, limits, dt)
        kind = int(rng.integers(4))
        held = requests(kind, rng, robot.na, 0.0, dt)
        for tick in range(300):
            joints.step(held if kind == 0 else requests(kind, rng, robot.na, tick * dt, dt))
            assert (joints.q <= limits.upper + TOLERANCE).all()
            assert (joints.q >= limits.lower - TOLERANCE).all()
            assert (np.abs(joints.v) <= limits.velocity + TOLERANCE).all()
            # Between the ticks, too: where a joint turns round within a period.
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


def test_joint_never_passes_its_bound_between_ticks() -> None:
    rng = np.random.default_rng(2)
    robot = make_robot("g1")
    limits = JointLimits(margin=0.0)
    limits.bind(robot)
    dt = 0.005
    joints = DoubleIntegrators(robot, limits, dt)
    for _ in range(20):
        viable_start(robot, limits, rng)
        for _ in range(60):
            q, v = joints.q.copy(), joints.v.copy()
            joints.step(np.full(robot.na, 1e4))
            a = (joints.v - v) / dt
            turn = np.clip(-v / np.where(a == 0.0, 1e-12, a), 0.0, dt)
            peak = q + v * turn + 0.5 * a * turn**2
            assert (peak <= limits.upper + TOLERANCE).all()


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("speed", [0.0, -0.2, 0.25])
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


@pytest.mark.parametrize("dt", PERIODS)
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
        for _ in range(300):
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
    for joint in ("left_elbow_pitch", "neck_yaw", "left_wrist_yaw"):
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


# ---- limits of all kinds: one way back ----------------------------------------------------------------------------

WAYS = ("panda", "hrp4_class", "g1", "talos")


@cache
def model_of(name: str) -> Robot:
    return load(name).robot()


def hand_of(robot: Robot) -> str:
    return "panda_hand" if robot.name == "panda" else right_hand(robot)


def anywhere(robot: Robot, rng: np.random.Generator) -> Array:
    """A configuration inside, at the edge, outside of the limits of joints, or where many joints are singular."""
    low, high = np.maximum(robot.position_lower, -3.0), np.minimum(robot.position_upper, 3.0)
    q = np.array(robot.half_sitting)
    starts = (
        rng.uniform(low, high),
        np.where(rng.random(robot.na) < 0.5, low, high),
        rng.uniform(low - 0.3, high + 0.3),
        np.zeros(robot.na),
    )
    q[robot.base_nq :] = starts[rng.integers(len(starts))]
    return q


def some_limits(robot: Robot, rng: np.random.Generator) -> list[wbc.Limit]:
    """Limits that know nothing of each other, nor of where the robot is."""
    frame, place = hand_of(robot), robot.placement(hand_of(robot)).translation
    low = place + rng.uniform(-0.6, 0.2, 3)
    high = low + rng.uniform(0.0, 0.4, 3)
    low[rng.random(3) < 0.4], high[rng.random(3) < 0.4] = -np.inf, np.inf
    axis, direction = rng.normal(size=(2, 3))
    if rng.random() < 0.3:
        direction = -robot.placement(frame).rotation @ axis
    found: list[wbc.Limit] = [
        wbc.FramePositionLimit(
            frame, lower=low, upper=high, time_constant=float(rng.choice([0.02, 0.1, 0.5]))
        ),
        wbc.AxisConeLimit(frame, float(rng.uniform(0.01, 3.0)), axis=axis, direction=direction),
        wbc.FrameSpeedLimit(
            frame, linear=float(rng.uniform(0.02, 1.0)), angular=float(rng.uniform(0.05, 2.0))
        ),
    ]
    if robot.soles:
        corners = robot.com[:2] + rng.uniform(-0.1, 0.1, (6, 2))
        found.append(wbc.CoMPolygonLimit(corners, time_constant=0.3, margin=0.001))
    return [limit for limit in found if rng.random() < 0.6]


def of_joints(rng: np.random.Generator) -> JointLimits:
    acceleration = float(rng.uniform(1.0, 50.0)) if rng.random() < 0.4 else None
    return JointLimits(acceleration=acceleration, velocity_ratio=float(rng.choice([0.05, 0.5, 1.0])))


@examples(30)
@given(seed=st.integers(0, 10_000), name=st.sampled_from(WAYS), dt=st.sampled_from([0.001, 0.01, 0.05]))
def test_inverse_kinematics_has_a_solution_whatever_the_limits_and_the_start(
    seed: int, name: str, dt: float
) -> None:
    robot, rng = model_of(name).clone(), np.random.default_rng(seed)
    robot.update(anywhere(robot, rng), np.zeros(robot.nv))
    ik = wbc.InverseKinematics(robot, dt)
    ik.add(*(SoleContact(sole.name) for sole in robot.soles), of_joints(rng), PostureTask(weight=1e-3))
    for limit in some_limits(robot, rng):
        ik.add(limit)
    for _ in range(15):
        ik.step()
        assert ik.solution is not None and ik.solution.ok, ik.diagnose()
    assert np.isfinite(ik.reach(iterations=10).configuration).all()


@examples(30)
@given(
    seed=st.integers(0, 10_000), speed=st.sampled_from([0.0, 1.0, 5.0]), dt=st.sampled_from([0.001, 0.005])
)
def test_a_controller_has_a_solution_whatever_the_limits_and_the_start(
    seed: int, speed: float, dt: float
) -> None:
    """A bolted robot can always let its joints go; with feet on the ground forces are limited, too."""
    robot, rng = model_of("panda").clone(), np.random.default_rng(seed)
    q, v = anywhere(robot, rng), speed * rng.normal(size=robot.nv)
    robot.update(q, v)
    controller = Controller(robot, dt)
    controller.add(of_joints(rng), TorqueLimits(), PostureTask())
    for limit in some_limits(robot, rng):
        controller.add(limit)
    for _ in range(20):
        controller.update(q, v)
        solution = controller.solve()
        assert solution.ok, controller.diagnose()
        assert (np.abs(solution.torques) <= robot.torque_limit + 1e-4).all()
        q, v = integrate(controller, q, v, solution.accelerations)


def rooms(robot: Robot, frame: str, box: tuple[Array, Array], axis: Array, direction: Array) -> float:
    hand = robot.placement(frame)
    place, angle = hand.translation, np.arccos(np.clip((hand.rotation @ axis) @ direction, -1.0, 1.0))
    joints = robot.q[robot.base_nq :]
    ends = (robot.position_upper - joints).min(), (joints - robot.position_lower).min()
    return float(min(*(place - box[0]), *(box[1] - place), 0.3 - angle, *ends))


@pytest.mark.parametrize("way", ["velocities", "accelerations"])
@pytest.mark.parametrize("seed", range(8))
def test_a_robot_that_starts_outside_all_limits_comes_back_in(way: str, seed: int) -> None:
    """To a box and a cone about where the hand can be, with joints up to 0.2 rad outside of their ranges."""
    rng, name = np.random.default_rng(seed), WAYS[seed % 4]
    robot, frame = model_of(name).clone(), hand_of(model_of(name))
    low, high = np.maximum(robot.position_lower, -3.0), np.minimum(robot.position_upper, 3.0)
    trunk = robot.torso_frame if robot.floating else robot.base_frame
    arm = robot.base_nq + np.array(robot.joints_between(frame, trunk))
    goal, start = np.array(robot.half_sitting), np.array(robot.half_sitting)
    near = goal[robot.base_nq :] + rng.uniform(-0.5, 0.5, robot.na)  # which the drives can hold
    goal[arm] = np.clip(near, low + 0.3, high - 0.3)[arm - robot.base_nq]
    away = np.clip(goal[robot.base_nq :] + rng.uniform(-1.5, 1.5, robot.na), low - 0.2, high + 0.2)
    start[arm] = away[arm - robot.base_nq]
    robot.update(goal, np.zeros(robot.nv))
    hand, axis = pin.SE3(robot.placement(frame)), rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    box = hand.translation - 0.1, hand.translation + 0.1
    robot.update(start, np.zeros(robot.nv))
    assert rooms(robot, frame, box, axis, hand.rotation @ axis) < -0.05
    posture = PostureTask(weight=1e-2)
    items = [
        *(SoleContact(sole.name) for sole in robot.soles),
        *((CoMTask(weight=10.0), wbc.CoMPolygonLimit()) if robot.floating else ()),
        *(JointLimits(), posture),
        wbc.FramePositionLimit(frame, lower=box[0], upper=box[1]),
        wbc.AxisConeLimit(frame, 0.3, axis=axis, direction=hand.rotation @ axis),
    ]
    if way == "velocities":
        ik = wbc.InverseKinematics(robot, 0.01)
        ik.add(*items)
        posture.follow(goal[robot.base_nq :])
        for _ in range(300):
            ik.step()
    else:
        controller = Controller(robot, 0.005)
        controller.add(*items, TorqueLimits())
        posture.follow(goal[robot.base_nq :])
        q, v = start, np.zeros(robot.nv)
        for _ in range(800):
            controller.update(q, v)
            solution = controller.solve()
            assert solution.ok, controller.diagnose()
            q, v = integrate(controller, q, v, solution.accelerations)
        robot.update(q, v)
    assert rooms(robot, frame, box, axis, hand.rotation @ axis) > -1e-3


@pytest.mark.parametrize("angle", [0.1, 0.5, 2.5])
def test_an_axis_comes_back_from_the_opposite_direction(angle: float) -> None:
    robot = model_of("panda").clone()
    axis = robot.placement("panda_hand").rotation.T @ np.array([0.0, 0.0, -1.0])
    ik = wbc.InverseKinematics(robot, 0.01)
    ik.add(JointLimits(), PostureTask(weight=1e-4), wbc.AxisConeLimit("panda_hand", angle, axis=axis))
    for _ in range(400):
        ik.step()
    assert (robot.placement("panda_hand").rotation @ axis)[2] > np.cos(angle) - 1e-3


@pytest.mark.parametrize("above", [0.001, 0.2])
def test_what_no_joint_can_change_asks_for_nothing(above: float) -> None:
    """The upper arm is upright, where no joint lowers the elbow at first order, and the plane is below it."""
    robot = model_of("panda").clone()
    q = np.array(robot.half_sitting)
    q[1] = 0.0
    robot.update(q, np.zeros(robot.nv))
    top = robot.placement("panda_link3").translation[2]
    limit = wbc.FramePositionLimit("panda_link3", upper=(np.inf, np.inf, top - above))
    controller = Controller(robot, 0.005)
    controller.add(PostureTask(), TorqueLimits(), JointLimits())
    free = controller.solve().accelerations
    controller.add(limit)
    solution = controller.solve()
    assert solution.status is Status.SOLVED
    np.testing.assert_allclose(solution.accelerations, free, atol=1e-6)
    controller.remove(limit)
    ik = wbc.InverseKinematics(robot, 0.005)
    posture = ik.add(PostureTask())
    ik.add(JointLimits(), limit)
    ik.step()
    assert ik.solution is not None and ik.solution.status is Status.SOLVED
    posture.target = posture.target + np.eye(robot.na)[1] * 0.8  # once the arm leans, the limit leads it down
    for _ in range(400):
        ik.step()
    assert above > 0.1 or robot.placement("panda_link3").translation[2] < top - above + 1e-4


@pytest.mark.filterwarnings("error")
def test_bounds_on_one_side_are_numbers() -> None:
    robot = model_of("panda").clone()
    limit = wbc.FramePositionLimit("panda_hand", upper=(1.0, np.inf, np.inf))
    limit.bind(robot)
    rows, lower, upper = np.zeros((3, robot.nv)), np.zeros(3), np.zeros(3)
    for write in (partial(limit.write, 0.005), limit.write_step, partial(limit.write_velocity, 0.005)):
        write(rows, lower, upper)
        assert np.isneginf(lower).all() and np.isinf(upper[1:]).all() and np.isfinite(upper[0])


def test_limits_that_contradict_each_other_give_way_and_are_named() -> None:
    """Two walls that leave no room: the hand stays between them, and hard tasks do not push a limit aside."""
    robot = model_of("panda").clone()
    place = robot.placement("panda_hand").translation.copy()
    ik = wbc.InverseKinematics(robot, 0.01)
    walls = [
        wbc.FramePositionLimit("panda_hand", upper=(np.inf, place[1] - 0.05, np.inf), name="right"),
        wbc.FramePositionLimit("panda_hand", lower=(-np.inf, place[1] + 0.05, -np.inf), name="left"),
    ]
    ik.add(JointLimits(), PostureTask(weight=1e-4), *walls)
    for _ in range(100):
        ik.step()
    assert ik.solution is not None and ik.solution.status is Status.RELAXED
    assert set(ik.diagnose()) == {"right", "left"}
    assert robot.placement("panda_hand").translation[1] == pytest.approx(place[1], abs=0.01)
    ik.remove(walls[1])
    ik.add(wbc.PositionTask("panda_hand", place + [0.0, 0.1, 0.0], hard=True))
    for _ in range(200):
        ik.step()
    assert robot.placement("panda_hand").translation[1] == pytest.approx(place[1] - 0.05, abs=1e-3)


@pytest.mark.parametrize("always", [False, True])
def test_torques_with_other_wrenches_keep_limits_and_rates_too(always: bool) -> None:
    """Whether each tick has other wrenches, or some have; those of the solution follow on them without a jump."""
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


class Straight(wbc.Barrier):
    """Keep the elbow of a Panda from bending beyond an angle, as one's own limit would."""

    def __init__(self, most: float) -> None:
        super().__init__("elbow", 1, time_constant=0.05)
        self.most = most

    def measure(self, rows: Array, below: Array, above: Array) -> None:
        rows[:] = np.eye(self.robot.nv)[3]
        below[:], above[:] = np.inf, self.most - self.robot.q[3]

    def drift(self) -> Array:
        return np.zeros(1)


@pytest.mark.parametrize("outside", [False, True])
def test_a_barrier_of_ones_own_holds_in_both_solvers(outside: bool) -> None:
    """Its room shrinks at room / time constant at most; from outside it comes back."""
    robot = model_of("panda").clone()
    most = float(robot.q[3]) + (-0.2 if outside else 0.2)
    ik, limit = wbc.InverseKinematics(robot, 0.01), Straight(most)
    with pytest.raises(InputError, match="added"):
        _ = limit.robot
    check_rows(Straight(most), model_of("panda"))
    posture = PostureTask(weight=1.0, stiffness=400.0, error_bound=np.inf)
    ik.add(JointLimits(), limit, posture)
    posture.follow(robot.q + 0.5)
    for _ in range(100):
        before = most - float(robot.q[3])
        ik.step()
        left = most - float(robot.q[3])
        assert left >= before - max(before * 0.01 / 0.05, -0.01) - 1e-9  # at 1 rad/s at most from outside
    assert left == pytest.approx(0.0, abs=1e-4)
    ik.remove(limit, posture)
    robot = model_of("panda").clone()
    controller = Controller(robot, 0.002)
    controller.add(JointLimits(), limit)
    task = controller.add(PostureTask(weight=1.0, stiffness=400.0, error_bound=np.inf))
    task.follow(robot.q + 0.5)
    q, v = np.array(robot.q), np.zeros(robot.nv)
    for _ in range(800):
        controller.update(q, v)
        q, v = integrate(controller, q, v, controller.solve().accelerations)
        assert outside or q[3] < most + 1e-5
    assert q[3] == pytest.approx(most, abs=1e-3)
