"""Errors of tasks: tilts, twists, bounds, gazes, and rows in one piece or two."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from task_factory import (
    left_hand,
    make_robot,
    random_state,
    rows_of,
    standing,
)

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.tasks import (
    AdmittanceTask,
    LookAtTask,
    OrientationTask,
    PoseTask,
    RelativeFrameTask,
)

TURNS = {
    "orientation": lambda hand, other, **given: OrientationTask(hand, **given),
    "pose": lambda hand, other, **given: PoseTask(hand, **given),
    "relative": RelativeFrameTask,
    "admittance": lambda hand, other, **given: AdmittanceTask(hand, admittance=(1e-3, 1e-1), **given),
}
"""Tasks on the rotation of a frame."""


@pytest.mark.parametrize("free", [0, 1, 2])
@pytest.mark.parametrize("kind", TURNS)
def test_the_error_of_a_tilt_is_the_way_back_whatever_the_free_angle(kind: str, free: int) -> None:
    """It is the least turn after which a rotation about the free axis is left, and shrinks as the Jacobian says.

    Along the axes of the frame, of the world or of the other frame; at no tilt, each column is the derivative.
    """
    robot, rng = make_robot("hrp4_class"), np.random.default_rng(free)
    hand, other = left_hand(robot), robot.torso_frame
    axes = [axis for number, axis in enumerate(("roll", "pitch", "yaw")) if number != free]
    axis, kept = np.eye(3)[free], [number for number in range(3) if number != free]
    for angle in (0.1, -3.1):
        for tilt in (0.0, 2.8) if angle > 0.0 else (0.2,):
            q, v = random_state(robot, rng)
            robot.update(q, v)
            lean = tilt * np.roll([0.0, np.cos(angle), np.sin(angle)], free)  # across the free axis
            place = robot.placement(hand)
            if kind == "relative":
                place = robot.placement(other).actInv(place)
            if kind == "admittance":
                turn = (pin.exp3(angle * axis) @ pin.exp3(lean)).T  # along the axes of the frame
                target: object = pin.SE3(place.rotation @ turn, place.translation)
            else:
                turn = pin.exp3(angle * axis) @ pin.exp3(lean)
                target = pin.SE3(turn @ place.rotation, place.translation)
            task = TURNS[kind](
                hand, other, target=target.rotation if kind == "orientation" else target, axes=axes
            )
            task.bind(robot)
            jacobian, error, _ = rows_of(task, robot)
            sign = -1.0 if kind == "admittance" else 1.0
            np.testing.assert_allclose(error, sign * lean[kept], atol=1e-9)
            columns = np.eye(robot.nv) if tilt == 0.0 else v[None]
            for column in columns:
                ends = []
                for step in (1e-6, -1e-6):
                    robot.update(pin.integrate(robot.model, q, step * column), v)
                    ends.append(rows_of(task, robot)[1])
                change = (ends[0] - ends[1]) / 2e-6
                if tilt == 0.0:
                    np.testing.assert_allclose(change, -jacobian @ column, atol=1e-5)
                else:
                    np.testing.assert_allclose(error @ change, -error @ jacobian @ column, atol=1e-5)


@pytest.mark.parametrize("only", [0, 1, 2])
@pytest.mark.parametrize("kind", TURNS)
def test_the_error_about_one_axis_is_the_twist_whatever_the_tilt(kind: str, only: int) -> None:
    robot, rng = make_robot("hrp4_class"), np.random.default_rng(only)
    hand, other, axis = left_hand(robot), robot.torso_frame, np.eye(3)[only]
    for angle in (0.1, -1.5, 2.6):
        robot.update(*random_state(robot, rng))
        tilt = np.roll([0.0, *rng.normal(size=2)], only)
        place = robot.placement(hand)
        if kind == "relative":
            place = robot.placement(other).actInv(place)
        turn = pin.exp3(tilt) @ pin.exp3(angle * axis)
        rotation = place.rotation @ turn if kind == "admittance" else turn @ place.rotation
        target = rotation if kind == "orientation" else pin.SE3(rotation, place.translation)
        task = TURNS[kind](hand, other, target=target, axes=[("roll", "pitch", "yaw")[only]])
        task.bind(robot)
        np.testing.assert_allclose(rows_of(task, robot)[1], [angle], atol=1e-9)


# Errors out of bounds


def test_an_error_beyond_its_bound_acts_as_one_of_that_size_in_its_direction() -> None:
    """A hand that nothing hinders accelerates to a target far away as to one at the bound on the way to it."""

    def acceleration(distance: float) -> Array:
        controller = standing("hrp4_class")
        hand = controller.add(PoseTask(left_hand(controller.robot), weight=1e3, stiffness=50.0))
        turned = pin.rpy.rpyToMatrix(0.0, 0.0, 0.2) @ hand.target.rotation
        offset = distance * np.array([1.0, 0.5, 0.0])
        hand.target = pin.SE3(turned, hand.target.translation + offset)
        solution = controller.solve()
        assert solution.ok, solution.status
        np.testing.assert_allclose(hand.error, (*offset, 0.0, 0.0, 0.2), atol=1e-9)
        jacobian, _, drift = rows_of(hand, controller.robot)
        return np.asarray(jacobian @ solution.accelerations + drift)

    np.testing.assert_allclose(acceleration(2.0), acceleration(0.1), atol=1e-6)
    np.testing.assert_allclose(acceleration(2.0), (5.0, 2.5, 0.0, 0.0, 0.0, 10.0), atol=0.01)


def test_a_gaze_moves_to_a_point() -> None:
    controller = standing("hrp4_class")
    gaze = controller.add(LookAtTask(controller.robot.torso_frame, [1.0, 0.0, 1.0]))
    gaze.move_to([1.0, 0.5, 1.0], duration=0.01)
    while gaze.moving:
        controller.solve()
    np.testing.assert_allclose(gaze.target, [1.0, 0.5, 1.0], atol=1e-12)
    gaze.held_by = "walking.head"
    with pytest.raises(InputError, match="walking.head"):
        gaze.target = [1.0, 0.0, 1.0]
