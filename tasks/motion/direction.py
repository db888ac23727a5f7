"""Tasks on a direction of a frame: one of its axes along a direction of the world, or towards a point."""

from __future__ import annotations

import math
from typing import Any, Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.core.errors import ROUNDING, Array, InputError, finite_array
from wbc.core.qp.task import read_only
from wbc.core.robot import Robot
from wbc.tasks.motion.axes import ROTATION_AXES, other_columns
from wbc.tasks.motion.frame import FrameTask
from wbc.tasks.motion.moving import Course
from wbc.tasks.options import MotionOptions

NEAREST = 0.05
"""Least distance of a point that the gaze task divides by, m."""


def least_turn(axis: Array, direction: Array) -> Array:
    """Return the least rotation vector that turns an axis to a direction, rad; these have length 1, all shape (3,)."""
    cross = np.cross(axis, direction)
    sine, cosine = float(np.linalg.norm(cross)), float(axis @ direction)
    if sine < 1e-6:
        if cosine > 0.0:
            return np.zeros(3)
        cross = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])  # half a turn, about any axis across
        return np.asarray(math.pi / np.linalg.norm(cross) * cross)
    return math.atan2(sine, cosine) / sine * cross


def unit_vector(what: str, value: ArrayLike) -> Array:
    """Return a vector of length 1, shape (3,); `InputError` for what is not three finite numbers, or all zero."""
    vector = finite_array(what, value, (3,))
    length = float(np.linalg.norm(vector))
    if length < ROUNDING:
        raise InputError(f"{what} must not be zero, got {vector}")
    return vector / length


class DirectionTask(FrameTask[Array]):
    """Turn one axis of a frame to a direction of the world; turning about that axis costs nothing.

    The error is the least rotation vector from axis a to direction d, along the chosen axes of the world, rad; the rows
    are ω − a (a · ω), of which two are independent. The weight is a cost per (rad/s²)². Weight 1 and stiffness 30 1/s²
    by default.
    """

    unit = "rad"
    _what = "direction"

    def __init__(
        self,
        frame: str,
        target: ArrayLike | None = None,
        *,
        axis: ArrayLike = (1.0, 0.0, 0.0),
        **options: Unpack[MotionOptions],
    ) -> None:
        """Describe the task.

        Args:
            frame: Frame of the robot.
            target: Direction in the world, shape (3,), of any length; the present one when None.
            axis: Axis of the frame, shape (3,), of any length.
            **options: See `MotionOptions`.
        """
        super().__init__(frame, f"{frame} {self._what}", ROTATION_AXES, options)
        self._axis = unit_vector(f"axis of task '{self.name}'", axis)
        self._jacobian = np.zeros((3, 0))
        if target is not None:
            self.target = target

    @property
    def axis(self) -> Array:
        """Axis of the frame, of length 1, shape (3,), read-only."""
        return read_only(self._axis)

    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`."""
        super().bind(robot)
        self._jacobian = np.zeros((3, robot.nv))

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `MotionTask.evaluate`.

        With ȧ = ω × a, the drift of ω − a (a · ω) is ω̇ − a (a · ω̇) − ȧ (a · ω), at no joint acceleration.
        """
        full, turn, a, spin, push = self._turning()
        self._write(
            (jacobian, error, drift), (full, turn, push - a * (a @ push) - np.cross(spin, a) * (a @ spin))
        )

    def _turning(self) -> tuple[Array, Array, Array, Array, Array]:
        """Return Jacobian, error, the axis in the world, and angular velocity and acceleration of the frame."""
        frame = pin.getFrameJacobian(self._model, self._data, self._id, self._world)[3:]
        spin = pin.getFrameVelocity(self._model, self._data, self._id, self._world).angular
        push = pin.getFrameClassicalAcceleration(self._model, self._data, self._id, self._world).angular
        a = self._rotation @ self._axis
        np.subtract(frame, np.outer(a, a @ frame), out=self._jacobian)
        direction = self._direction()
        turn = np.cross(a, direction)
        if turn @ turn > 1e-12 or a @ direction < 0.0:  # closer, the sine is the angle
            turn = least_turn(a, direction)
        return self._jacobian, turn, a, spin, push

    def _direction(self) -> Array:
        assert self._target is not None
        return self._target

    def _present(self, robot: Robot) -> Array:
        return np.asarray(robot.placement(self.frame).rotation @ self._axis)

    def _checked(self, value: Any) -> Array:
        return unit_vector(f"target of task '{self.name}'", value)

    def _course(self) -> Course:
        return _Directions(self.target, self._checked)


class GazeTask(DirectionTask):
    """Turn one axis of a frame, such as the head's, to a point of the world, whatever the body does.

        controller.add(GazeTask("head", [1.5, 0.4, 1.0]))

    It has the joints between base and frame, neck and waist of a head, unless others are given: with its legs `g1` fell
    when it looked to the side at the end of a walk. With d the unit vector to the point and r its distance, the rows
    are those of `DirectionTask` and d × v / r, by which a frame that moves turns past the point. Weight 1 and stiffness
    30 1/s² by default; a point 1 m ahead when none is given.
    """

    _what = "gaze"

    def __init__(
        self,
        frame: str,
        target: ArrayLike | str | None = None,
        *,
        axis: ArrayLike = (1.0, 0.0, 0.0),
        **options: Unpack[MotionOptions],
    ) -> None:
        """Describe the task.

        Args:
            frame: Frame of the robot.
            target: Point in the world, shape (3,), m, or a frame of the robot to follow, such as a hand; a point 1 m
                ahead when None.
            axis: Axis of the frame, shape (3,), of any length.
            **options: See `MotionOptions`.
        """
        self._followed: str | None = None
        self._followed_id: int | None = None
        if isinstance(target, str):
            self._followed, target = target, None
        super().__init__(frame, target, axis=axis, **options)

    @property
    def target(self) -> Array:
        """Point in the world, shape (3,), m, read-only; assign one, or a frame of the robot to follow."""
        if self._followed_id is not None:
            return read_only(self._data.oMf[self._followed_id].translation)
        return super().target

    @target.setter
    def target(self, value: ArrayLike | str) -> None:
        if isinstance(value, str):
            self._followed, self._followed_id = value, self.robot.frame_id(value)
            return
        DirectionTask.target.fset(self, value)  # type: ignore[attr-defined]
        self._followed = self._followed_id = None

    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`."""
        super().bind(robot)
        self._followed_id = None if self._followed is None else robot.frame_id(self._followed)
        carriers = [robot.joint_names[joint] for joint in robot.joints_between(self.frame, robot.base_frame)]
        if self._only_joints is None and carriers:
            self._unused = other_columns(robot, carriers)

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `MotionTask.evaluate`. With ḋ = −(v − d (d · v)) / r and ṙ = −d · v."""
        full, turn, a, spin, push = self._turning()
        linear = pin.getFrameJacobian(self._model, self._data, self._id, self._world)[:3]
        v = pin.getFrameVelocity(self._model, self._data, self._id, self._world).linear
        rising = pin.getFrameClassicalAcceleration(self._model, self._data, self._id, self._world).linear
        if (other := self._followed_id) is not None:  # from a target that moves
            data, world = self._data, self._world
            linear = linear - pin.getFrameJacobian(self._model, data, other, world)[:3]
            v = v - pin.getFrameVelocity(self._model, data, other, world).linear
            rising = rising - pin.getFrameClassicalAcceleration(self._model, data, other, world).linear
        d, r = self._direction(), self._distance()
        along = float(d @ v)
        full += pin.skew(d) @ linear / r
        rate = (d * along - v) / r
        slope = push - a * (a @ push) - np.cross(spin, a) * (a @ spin)
        slope += (np.cross(rate, v) + np.cross(d, rising) + np.cross(d, v) * along / r) / r
        self._write((jacobian, error, drift), (full, turn, slope))

    def _way(self) -> Array:
        assert self._target is not None
        if self._followed_id is not None:
            return np.asarray(self._data.oMf[self._followed_id].translation - self._translation)
        return np.asarray(self._target - self._translation)

    def _direction(self) -> Array:
        way = self._way()
        return np.asarray(way / max(float(np.linalg.norm(way)), ROUNDING))

    def _distance(self) -> float:
        return max(float(np.linalg.norm(self._way())), NEAREST)

    def _present(self, robot: Robot) -> Array:
        return np.asarray(robot.placement(self.frame).act(self._axis))

    def _checked(self, value: Any) -> Array:
        return finite_array(f"target of task '{self.name}' (m)", value, (3,))

    def _course(self) -> Course:
        return Course(self.target, self._checked)

    def _put(self, target: Any, velocity: Array, acceleration: Array) -> None:
        self._target = target  # no feed-forward: it would need the distance, and a gaze moves slowly


class _Directions(Course):
    """Directions as the least rotation vectors from the first one, rad."""

    def __init__(self, start: Array, check: Any) -> None:
        super().__init__(np.zeros(3), check)
        self._from = np.array(start)

    def point(self, target: Any, before: Array) -> Array:
        return least_turn(self._from, self._check(target))

    def motion(self, place: Array, velocity: Array, acceleration: Array) -> tuple[Any, Array, Array]:
        rotation, left = pin.exp3(place), pin.Jexp3(place).T
        direction = rotation @ self._from
        rates = [left @ rate for rate in (velocity, acceleration)]
        return (direction, *(rate - direction * (direction @ rate) for rate in rates))
