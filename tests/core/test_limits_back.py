"""Limits of all kinds: a solution wherever the robot is, and one way back from outside."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import by_default, examples
from task_factory import integrate, right_hand

import wbc
from wbc.base.numbers import Array
from wbc.core.limits.joint import JointLimits, TorqueLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.solving.solver import Status
from wbc.core.robot import Robot
from wbc.robots import load
from wbc.tasks import CoMTask, PostureTask, check_rows

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


@examples(12)
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


@examples(12)
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
@pytest.mark.parametrize("seed", by_default(range(8), 0, 1))
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


@pytest.mark.parametrize("angle", by_default([0.1, 0.5, 2.5], 0.5))
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
    """Two walls that leave no room: the hand stays between them."""
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


@pytest.mark.parametrize("slow", [0.02, 1.0])
@pytest.mark.parametrize("where", ["far", "narrow", "opposite"])
def test_one_limit_from_outside_contradicts_no_joint(where: str, slow: float) -> None:
    """It asks for no more than the joints attain, so that nothing gives way; velocities and accelerations."""
    robot = model_of("panda").clone()
    hand = robot.placement("panda_hand")
    place = hand.translation.copy()
    limit = {
        "far": lambda: wbc.FramePositionLimit("panda_hand", upper=(place[0] - 0.35, np.inf, np.inf)),
        "narrow": lambda: wbc.FramePositionLimit(
            "panda_hand", directions=[(0.6, 0.0, 0.8)], lower=[0.0], upper=[0.0]
        ),
        "opposite": lambda: wbc.AxisConeLimit("panda_hand", 0.5, axis=-hand.rotation[2]),
    }[where]()
    ik = wbc.InverseKinematics(robot, 0.01)
    ik.add(JointLimits(velocity_ratio=slow, acceleration=10.0), PostureTask(weight=1e-4), limit)
    for _ in range(20):
        ik.step()
        assert ik.solution is not None and ik.solution.status is Status.SOLVED
    assert np.abs(robot.v / robot.velocity_limit).max() <= slow + 1e-9
    ik.remove(limit)
    robot = model_of("panda").clone()
    controller = Controller(robot, 0.005)
    controller.add(JointLimits(velocity_ratio=slow, acceleration=0.5), PostureTask(), limit)
    q, v = np.array(robot.q), np.zeros(robot.nv)
    for _ in range(20):
        controller.update(q, v)
        solution = controller.solve()
        assert solution.status is Status.SOLVED
        assert np.abs(solution.accelerations).max() <= 0.5 + 1e-6
        q, v = integrate(controller, q, v, solution.accelerations)


@pytest.mark.parametrize("kind", ["box", "cone", "beyond a right angle", "polygon"])
def test_drifts_are_the_derivatives_of_rows_at_constant_velocity(kind: str) -> None:
    """And two bounds of a row never cross, however fast a robot comes."""
    name = "g1" if kind == "polygon" else "panda"
    robot, rng, step = model_of(name).clone(), np.random.default_rng(3), 1e-6
    for _ in range(10):
        low, high = np.maximum(robot.position_lower, -3.0), np.minimum(robot.position_upper, 3.0)
        q, v = np.array(robot.half_sitting), rng.normal(size=robot.nv)
        q[robot.base_nq :] = rng.uniform(low, high)
        robot.update(q, v)
        hand = robot.placement(hand_of(robot))
        axis, across = rng.normal(size=(2, 3))
        turn = pin.exp3(
            rng.uniform(1.7, 3.0) * np.cross(axis, across) / np.linalg.norm(np.cross(axis, across))
        )
        direction = hand.rotation @ (turn if kind != "cone" else turn.T @ turn) @ axis
        limit = {
            "box": lambda place=hand.translation: wbc.FramePositionLimit(
                "panda_hand", lower=place, upper=place
            ),
            "polygon": lambda: wbc.CoMPolygonLimit(
                robot.com[:2] + 0.1 * np.array([[1, 0], [-1, 1], [-1, -1]])
            ),
        }.get(
            kind,
            lambda a=axis, d=direction: wbc.AxisConeLimit("panda_hand", 0.3, axis=a, direction=d + 0.1 * a),
        )()
        limit.bind(robot)
        rows, lower, upper = np.zeros((limit.dim, robot.nv)), np.zeros(limit.dim), np.zeros(limit.dim)
        speeds = []
        for ahead in (step, -step):
            robot.update(pin.integrate(robot.model, q, ahead * v), v)
            limit.measure(rows, lower, upper)
            speeds.append(rows @ v)
        robot.update(q, v)
        limit.measure(rows, lower, upper)
        np.testing.assert_allclose(limit.drift(), (speeds[0] - speeds[1]) / (2 * step), rtol=1e-5, atol=1e-5)
        for fast in (1.0, 100.0):
            robot.update(q, fast * v)
            limit.write(0.005, rows, lower, upper)
            assert (lower <= upper).all()
            limit.write_velocity(0.005, rows, lower, upper)
            assert (lower <= upper).all()


@pytest.mark.parametrize("outside", [0.0, 0.05])
def test_a_hard_task_pushes_no_limit_aside(outside: float) -> None:
    """In a controller the tick has no solution, and it is the task's fault; in inverse kinematics it gives way."""
    robot = model_of("panda").clone()
    place = robot.placement("panda_hand").translation.copy()
    wall = wbc.FramePositionLimit("panda_hand", upper=(np.inf, place[1] - outside, np.inf), name="wall")
    push = wbc.PositionTask("panda_hand", place + [0.0, 0.1, 0.0], hard=True, stiffness=400.0, name="push")
    controller = Controller(robot, 0.005)
    controller.add(JointLimits(), PostureTask(), wall, push)
    assert controller.solve().status is Status.INFEASIBLE
    assert "hard task 'push'" in controller.diagnose()
    controller.remove(wall, push)
    ik = wbc.InverseKinematics(robot, 0.01)
    ik.add(JointLimits(), PostureTask(weight=1e-4), wall, push)
    for _ in range(60):
        ik.step()
        assert robot.placement("panda_hand").translation[1] <= place[1] + 1e-6
    assert ik.solution is not None and ik.solution.status is Status.RELAXED
    assert robot.placement("panda_hand").translation[1] == pytest.approx(place[1] - outside, abs=1e-3)


def test_feet_stay_where_a_hand_cannot_come_back() -> None:
    """The way back to a place out of reach gives way to contacts, and hard tasks give way before them."""
    robot = model_of("talos").clone()
    feet = [pin.SE3(robot.placement(sole.frame)) for sole in robot.soles]
    place = robot.placement(hand_of(robot)).translation.copy()
    ik = wbc.InverseKinematics(robot, 0.002)
    ik.add(*(SoleContact(sole.name) for sole in robot.soles), JointLimits(), PostureTask(weight=1e-4))
    ik.add(
        wbc.FramePositionLimit(hand_of(robot), lower=place + [2.0, 0.0, 0.0], upper=place + [2.1, 0.1, 0.1])
    )
    ik.add(wbc.PositionTask(robot.torso_frame, hard=True))
    for _ in range(150):
        ik.step()
        assert ik.solution is not None and ik.solution.ok
    for sole, before in zip(robot.soles, feet, strict=True):
        assert np.linalg.norm(pin.log6(robot.placement(sole.frame).actInv(before)).vector) < 3e-3
    assert robot.placement(hand_of(robot)).translation[0] > place[0] + 0.2


def test_joints_come_back_before_frames_do() -> None:
    """A joint outside of its range comes back at its own pace, whatever contradictory walls ask for."""
    robot = model_of("panda").clone()
    q = np.array(robot.half_sitting)
    i = robot.joint_index("panda_joint1")
    q[i] = robot.position_upper[i] + 0.3
    ik = wbc.InverseKinematics(robot, 0.01)
    ik.add(JointLimits(margin=0.0), PostureTask(weight=1e-4))
    ik.update(q)
    alone, hand = ik.solve()[i], robot.placement("panda_hand").translation
    assert alone < -2.0
    away = np.array(
        [-np.sin(q[i]), np.cos(q[i]), 0.0]
    )  # where the joint would bring the hand, were it to go on
    for name, way in (("on", 1.0), ("back", -1.0)):
        bound = [way * float(away @ hand) + 1.0]
        ik.add(wbc.FramePositionLimit("panda_hand", directions=[way * away], lower=bound, name=name))
    assert ik.solve()[i] == pytest.approx(alone, rel=1e-6)
    assert ik.solution is not None and ik.solution.status is Status.RELAXED


class Drifting(Straight):
    """A limit whose past counts: its bound moves on whenever it is measured."""

    def reset(self) -> None:
        self.most = float(model_of("panda").q[3]) + 0.1

    def measure(self, rows: Array, below: Array, above: Array) -> None:
        super().measure(rows, below, above)
        self.most += 1e-4


def test_what_a_search_finds_does_not_depend_on_the_past_of_limits() -> None:
    robot = model_of("panda").clone()
    ik = wbc.InverseKinematics(robot, 0.01)
    limit = Drifting(0.0)
    limit.reset()
    ik.add(
        limit, PostureTask(), wbc.PositionTask("panda_hand", robot.placement("panda_hand").translation + 0.3)
    )
    first, again = ik.reach(iterations=20), ik.reach(iterations=20)
    np.testing.assert_array_equal(first.configuration, again.configuration)
