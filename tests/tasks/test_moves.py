"""Targets that move: trajectories against their equations, and every task that has `move_to`."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import strategies as st
from task_factory import arm, left_hand, right_hand, standing

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.kinematics.inverse import InverseKinematics
from wbc.core.qp.controller import Controller
from wbc.core.qp.move import (
    Coordinates,
    DirectionCoordinates,
    Move,
    PoseCoordinates,
    RotationCoordinates,
    least_turn,
)
from wbc.core.robot import Robot
from wbc.robots import load
from wbc.tasks import (
    CoMTask,
    ImpedanceTask,
    MomentumTask,
    OrientationTask,
    PoseTask,
    PositionTask,
    PostureTask,
    RelativeFrameTask,
    VectorOrientationTask,
)

DT = 0.005
POINTS = st.lists(st.tuples(*[st.floats(-2.0, 2.0)] * 3), min_size=2, max_size=5)

TASKS: dict[str, tuple[Callable[[Robot], Any], Callable[[Any, Robot], Any]]] = {
    "com": (lambda robot: CoMTask(weight=1e3), lambda now, _: now + [0.02, 0.01, -0.05]),
    "position": (
        lambda robot: PositionTask(left_hand(robot), weight=100.0),
        lambda now, _: now + [0.05, 0.03, 0.1],
    ),
    "orientation": (
        lambda robot: OrientationTask(left_hand(robot), weight=100.0),
        lambda now, _: pin.exp3(np.array([0.2, -0.3, 0.1])) @ now,
    ),
    "direction": (
        lambda robot: VectorOrientationTask(left_hand(robot), weight=100.0),
        lambda now, _: pin.exp3(np.array([0.1, -0.3, 0.2])) @ now,
    ),
    "pose": (lambda robot: PoseTask(left_hand(robot), weight=100.0), lambda now, _: moved(now)),
    "relative": (
        lambda robot: RelativeFrameTask(left_hand(robot), right_hand(robot), weight=100.0),
        lambda now, _: moved(now),
    ),
    "yielding": (lambda robot: ImpedanceTask(left_hand(robot), weight=100.0), lambda now, _: moved(now)),
    "posture": (
        lambda robot: PostureTask(name="arm", joints=arm(robot), weight=100.0),
        lambda now, robot: {arm(robot)[0]: now[0] + 0.2},
    ),
}


def moved(pose: pin.SE3) -> pin.SE3:
    return pin.SE3(
        pin.exp3(np.array([0.1, 0.2, -0.2])) @ pose.rotation, pose.translation + np.array([0.04, 0.02, 0.06])
    )


def step(controller: Controller) -> None:
    """Solve, and let the robot do what was solved for."""
    robot, solution = controller.robot, controller.solve()
    assert solution.ok
    v = robot.v + DT * solution.accelerations
    robot.update(pin.integrate(robot.model, robot.q, 0.5 * DT * (robot.v + v)), v)


# ---- moves -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "ways", [[(0.0, 1.0, 0.2)], [(0.0, 1.0, 0.2), (0.0, 0.0, 1.0)], [(-1.0, 0.3, 0.0), (0.0, -1.0, 0.5)]]
)
def test_a_direction_that_moves_has_the_rates_of_its_own_motion(
    ways: list[tuple[float, float, float]],
) -> None:
    """The velocity is d × ḋ, and the acceleration is its derivative; both by central differences."""

    def unit(value: Any) -> Array:
        return np.array(value) / np.linalg.norm(value)

    move = Move(DirectionCoordinates(np.array([1.0, 0.0, 0.0]), unit), ways, (None, None), speed=1.0)
    duration, h = move._trajectory.duration, 1e-5

    def at(time: float) -> tuple[Array, Array, Array]:
        return move.coordinates.target(*move._trajectory.at(time))

    for time in np.linspace(0.05, 0.95, 19) * duration:
        direction, velocity, acceleration = at(time)
        before, after = at(time - h), at(time + h)
        np.testing.assert_allclose(velocity, np.cross(direction, (after[0] - before[0]) / (2 * h)), atol=1e-6)
        np.testing.assert_allclose(acceleration, (after[1] - before[1]) / (2 * h), atol=1e-6)
    np.testing.assert_allclose(at(duration)[0], unit(ways[-1]), atol=1e-9)


X, Y, Z = np.eye(3)


TILTED = np.array([0.6, 0.0, 0.8])


@pytest.mark.parametrize(
    ("axis", "angles"),
    [(Z, (120, 240, 360)), (TILTED, (90, 180, 270, 360)), (TILTED, (-120, -240, -360)), (Z, (150, 300, 450))],
    ids=["z", "tilted", "back", "further"],
)
def test_a_move_around_passes_whole_turns_without_a_way_back(axis: Array, angles: tuple[int, ...]) -> None:
    """Rotations about one axis turn by the sum of the angles between them: rotations, poses and directions."""
    across = np.cross(axis, X) / np.linalg.norm(np.cross(axis, X))
    turns = [pin.exp3(np.radians(angle) * axis) for angle in angles]
    moves: list[tuple[Coordinates, list[Any], Callable[[Any], Array]]] = [
        (RotationCoordinates(np.eye(3), np.asarray), turns, lambda now: now @ across),
        (DirectionCoordinates(across, np.asarray), [turn @ across for turn in turns], lambda now: now),
        (
            PoseCoordinates(pin.SE3.Identity(), lambda pose: pose),
            [pin.SE3(turn, i * X) for i, turn in enumerate(turns)],
            lambda now: now.rotation @ across,
        ),
    ]
    for coordinates, targets, direction in moves:
        assert _turned(coordinates, targets, direction) == pytest.approx(abs(angles[-1]), abs=0.1)


def _turned(coordinates: Coordinates, targets: list[Any], direction: Callable[[Any], Array]) -> float:
    """Angle that a direction passes on a move, degrees."""
    move = Move(coordinates, targets, (None, None), duration=2.0)
    ends = [direction(coordinates.target(*move._trajectory.at(t))[0]) for t in np.linspace(0.0, 2.0, 250)]
    return float(np.degrees(sum(np.linalg.norm(b - a) for a, b in itertools.pairwise(ends))))


def test_a_direction_that_turns_round_goes_on_about_the_axis_of_its_way() -> None:
    """A direction to one across and on to the opposite passes half a turn, whatever the axes."""
    for across, end in itertools.permutations([X, Y, Z, -Z], 2):
        if across @ end == 0.0:
            coordinates = DirectionCoordinates(-end, np.asarray)
            assert _turned(coordinates, [across, end], np.asarray) == pytest.approx(180.0, abs=0.1)


def test_a_move_with_a_long_way_round_between_two_of_its_targets_is_refused() -> None:
    """Rotation vectors about axes that are not parallel do not close after a whole turn."""
    turns = [pin.exp3(np.radians(angle) * Z) for angle in (120, 240, 358)]
    turns[-1] = turns[-1] @ pin.exp3(0.2 * X)
    with pytest.raises(InputError, match="half a turn at most"):
        Move(RotationCoordinates(np.eye(3), np.asarray), turns, (None, None), duration=3.0)


def test_a_direction_turns_the_shorter_way_between_any_two_of_its_targets() -> None:
    ways = [(np.cos(angle), np.sin(angle), 0.0) for angle in (1.7, 3.5, 5.2)]
    coordinates = DirectionCoordinates(np.array([1.0, 0.0, 0.0]), np.array)
    move = Move(coordinates, ways, (None, None), speed=1.0)
    times = np.linspace(0.0, move._trajectory.duration, 100)
    ends = [coordinates.target(*move._trajectory.at(float(t)))[0] for t in times]
    assert np.unwrap([np.arctan2(end[1], end[0]) for end in ends])[-1] == pytest.approx(5.2)


@pytest.mark.parametrize("turned", [0.0, 0.3, np.pi - 1e-9, np.pi])
def test_the_least_turn_brings_an_axis_to_a_direction(turned: float) -> None:
    down, ahead = (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)
    for axis, across in ((ahead, (0.0, 1.0, 0.0)), (down, ahead), ((0.48, 0.6, 0.64), (0.8, 0.0, -0.6))):
        direction = np.cos(turned) * np.array(axis) + np.sin(turned) * np.array(across)
        turn = least_turn(np.array(axis), direction)
        np.testing.assert_allclose(pin.exp3(turn) @ axis, direction, atol=1e-6)
        assert np.linalg.norm(turn) == pytest.approx(turned, abs=1e-6)


# ---- tasks ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", TASKS)
def test_a_target_moves_and_the_robot_arrives_with_it(case: str) -> None:
    make, goal_of = TASKS[case]
    controller = standing("hrp4_class", dt=DT)
    robot = controller.robot
    task = controller.add(make(robot))
    goal = goal_of(task.target, robot)
    task.move_to(goal, duration=0.8)
    assert task.moving and not task.reached
    errors, speeds = [], []
    while task.moving:
        step(controller)
        errors.append(float(np.abs(task.error).max()))
        speeds.append(task.speed)
    assert len(errors) == pytest.approx(0.8 / DT, abs=2)
    assert max(errors) < 2e-3  # feed-forwards leave nothing to catch up
    assert max(speeds) > 10.0 * speeds[-1] and task.reached
    if isinstance(goal, pin.SE3):
        assert goal.isApprox(task.target, 1e-9)
    elif isinstance(goal, dict):
        np.testing.assert_allclose(task.target[0], goal[arm(robot)[0]])
    else:
        np.testing.assert_allclose(task.target, goal, atol=1e-12)
    np.testing.assert_array_equal(task.feedforward_velocity, np.zeros(task.dim))


def test_a_move_goes_on_from_where_the_target_is_and_how_it_moves() -> None:
    controller = standing("hrp4_class", dt=DT)
    com = controller.add(CoMTask(name="centre"))
    com.move_to(com.target - [0.0, 0.0, 0.1], speed=0.2)
    for _ in range(60):
        step(controller)
    before, velocity = com.target.copy(), com.feedforward_velocity.copy()
    com.move_to(com.target + [0.0, 0.03, 0.05], speed=0.2)
    step(controller)
    np.testing.assert_allclose(com.target, before + DT * velocity, atol=1e-5)
    np.testing.assert_allclose(com.feedforward_velocity, velocity, atol=5.0 * DT)
    held = com.target.copy()
    com.target = held  # an assignment ends it
    step(controller)
    np.testing.assert_array_equal(com.target, held)
    np.testing.assert_array_equal(com.feedforward_velocity, np.zeros(3))
    assert not com.moving


def test_the_target_of_a_task_that_is_removed_waits_and_moves_on_in_the_controller_that_gets_the_task() -> (
    None
):
    controller = standing("hrp4_class", dt=DT)
    com = controller.add(CoMTask(name="centre"))
    goal = com.target - [0.0, 0.0, 0.05]
    com.move_to(goal, duration=0.2)
    for _ in range(10):
        controller.solve()
    controller.remove(com)
    waits = com.target.copy()
    controller.solve()
    np.testing.assert_array_equal(com.target, waits)
    assert not com.moving
    assert goal[2] < waits[2] < goal[2] + 0.05
    controller.add(com)
    assert com.moving
    for _ in range(50):
        controller.solve()
    assert not com.moving
    np.testing.assert_allclose(com.target, goal, atol=1e-12)


@pytest.mark.parametrize(
    ("axes", "off", "reached"),
    [
        (("roll", "pitch", "yaw"), 0.04, True),
        (("roll", "pitch", "yaw"), 0.06, False),
        (("x", "y", "z"), 0.008, True),
        (("x", "y", "z"), 0.04, False),
        (("z", "yaw"), 0.008, True),
        (("z", "yaw"), 0.04, False),
    ],
)
def test_a_pose_is_reached_within_the_bound_of_each_of_its_units(
    axes: tuple[str, ...], off: float, reached: bool
) -> None:
    controller = standing("hrp4_class")
    task = controller.add(PoseTask(left_hand(controller.robot), axes=axes))
    target = task.target
    shift = np.array([axis in axes for axis in ("x", "y", "z", "roll", "pitch", "yaw")], dtype=float)
    shift *= off / np.sqrt(max(shift[:3].sum(), shift[3:].sum()))
    task.target = pin.SE3(pin.exp3(shift[3:]) @ target.rotation, target.translation + shift[:3])
    assert task.reached == reached


def test_a_momentum_is_reached_when_the_robot_has_it() -> None:
    controller = standing("hrp4_class")
    robot, task = controller.robot, controller.add(MomentumTask())
    assert task.reached
    task.target = [0.2 * robot.mass, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert not task.reached
    v = np.zeros(robot.nv)
    v[:3] = robot.placement(robot.base_frame).rotation.T @ [0.2, 0.0, 0.0]
    robot.update(robot.q, v)
    assert task.reached
    task.target = [0.2 * robot.mass, 0.0, 0.0, 0.0, 0.0, 100.0]
    assert not task.reached


# ---- what a user cannot do by mistake -----------------------------------------------------------------------------


def test_an_attribute_that_a_task_does_not_have_is_refused() -> None:
    for task in (CoMTask(), standing("hrp4_class").add(CoMTask(name="centre"))):
        with pytest.raises(AttributeError, match="wieght"):
            task.wieght = 3.0  # type: ignore[attr-defined]
        task.weight = 3.0


@pytest.mark.parametrize("limits", [{}, {"duration": 0.3}, {"speed": 0.5, "acceleration": 3.0}])
def test_a_stream_of_equal_orders_is_one_order_and_the_last_of_a_stream_decides(limits: Any) -> None:
    robot = load("panda").robot()
    ik, paths = InverseKinematics(robot, 0.01), []
    hand = ik.add(PositionTask("panda_hand"))
    start = np.array(hand.target)
    goal = start + [0.05, 0.0, -0.05]
    for told in (1, 100):
        hand.target = start
        path = []
        for tick in range(100):
            if tick < told:
                hand.move_to(goal.tolist(), **limits)
            ik.solve()
            path.append(np.array(hand.target))
        paths.append(path)
    np.testing.assert_array_equal(*paths)
    np.testing.assert_allclose(paths[0][-1], goal, atol=1e-12)
    hand.move_to(start, **limits)
    ik.solve()
    hand.move_to(goal, **limits)
    hand.move_to(start, duration=0.1)
    for _ in range(12):
        ik.solve()
    np.testing.assert_allclose(hand.target, start, atol=1e-12)
