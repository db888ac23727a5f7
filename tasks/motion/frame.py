"""Tasks on the position, orientation and pose of a frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.core.errors import Array, InputError, finite_array
from wbc.core.robot import Robot
from wbc.tasks.motion.axes import POSE_AXES, POSITION_AXES, ROTATION_AXES
from wbc.tasks.motion.moving import Placing, Turning
from wbc.tasks.motion.target import T, TargetTask
from wbc.tasks.options import MotionOptions


def rotation_matrix(what: str, value: ArrayLike) -> Array:
    """Return a copy of a rotation matrix, shape (3, 3), that is `what` in messages.

    Raises `InputError` for one that is not finite, orthonormal and right-handed (to 1e-6).
    """
    matrix = finite_array(what, value, (3, 3))
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    lengths = (a * a + b * b + c * c, d * d + e * e + f * f, g * g + h * h + i * i)
    products = (a * d + b * e + c * f, a * g + b * h + c * i, d * g + e * h + f * i)
    handedness = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    if not (
        handedness > 0.0
        and min(lengths) >= 1.0 - 1e-6
        and max(lengths) <= 1.0 + 1e-6
        and min(products) >= -1e-6
        and max(products) <= 1e-6
    ):
        raise InputError(f"{what} must be a rotation matrix, got\n{matrix}")
    return matrix


def pose(what: str, value: pin.SE3) -> pin.SE3:
    """Return a copy of a pose that is `what` in messages.

    Raises `InputError` for what is no `pinocchio.SE3`, or is not finite, or whose rotation is none.
    """
    if not isinstance(value, pin.SE3):
        raise InputError(f"{what} must be a pinocchio.SE3, got {value!r}")
    return pin.SE3(
        rotation_matrix(f"rotation of {what}", value.rotation),
        finite_array(f"translation of {what} (m)", value.translation, (3,)),
    )


class FrameTask(TargetTask[T]):
    """Base of tasks on a frame.

    Attributes:
        frame: Frame of the robot.
    """

    def __init__(self, frame: str, name: str, choices: Sequence[str], options: MotionOptions) -> None:
        """Describe the task; see `TargetTask`. Stiffness 30 1/s² by default."""
        self.frame = frame
        super().__init__(name, choices, {"stiffness": 30.0, **options})

    def bind(self, robot: Robot) -> None:
        """Resolve frame and joints.

        Raises:
            UnknownNameError: The robot has no such frame or joint.
        """
        super().bind(robot)
        self._id = robot.frame_id(self.frame)
        self._placement = robot.data.oMf[self._id]
        self._rotation, self._translation = self._placement.rotation, self._placement.translation
        self._model, self._data, self._world = robot.model, robot.data, pin.LOCAL_WORLD_ALIGNED


class PositionTask(FrameTask[Array]):
    """Bring the origin of a frame to a point of the world.

    Error and residual are along the chosen world axes, m and m/s²; the weight is a cost per (m/s²)². Weight 1 and
    stiffness 30 1/s² by default.
    """

    unit = "m"

    def __init__(self, frame: str, target: ArrayLike | None = None, **options: Unpack[MotionOptions]) -> None:
        """Describe the task.

        Args:
            frame: Frame of the robot.
            target: Point in the world, shape (3,), m; the present one when None.
            **options: See `MotionOptions`.
        """
        super().__init__(frame, f"{frame} position", POSITION_AXES, options)
        if target is not None:
            self.target = target

    def _present(self, robot: Robot) -> Array:
        return np.array(robot.placement(self.frame).translation)

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `MotionTask.evaluate`."""
        assert self._target is not None
        full = pin.getFrameJacobian(self._model, self._data, self._id, self._world)
        acceleration = pin.getFrameClassicalAcceleration(self._model, self._data, self._id, self._world)
        difference = self._target - self._translation
        self._write((jacobian, error, drift), (full[:3], difference, acceleration.linear))


class OrientationTask(FrameTask[Array]):
    """Turn a frame, such as the pelvis or the torso, to an orientation in the world.

    The error is the rotation vector from the present to the target orientation, along the chosen world axes, rad; the
    weight is a cost per (rad/s²)². Weight 1 and stiffness 30 1/s² by default.
    """

    unit = "rad"
    _course_of = Turning

    def __init__(self, frame: str, target: ArrayLike | None = None, **options: Unpack[MotionOptions]) -> None:
        """Describe the task.

        Args:
            frame: Frame of the robot.
            target: Rotation from the frame to the world, shape (3, 3); the present one when None.
            **options: See `MotionOptions`.
        """
        super().__init__(frame, f"{frame} orientation", ROTATION_AXES, options)
        if target is not None:
            self.target = target

    def _present(self, robot: Robot) -> Array:
        return np.array(robot.placement(self.frame).rotation)

    def _checked(self, value: Any) -> Array:
        return rotation_matrix(f"target of task '{self.name}'", value)

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `MotionTask.evaluate`."""
        assert self._target is not None
        full = pin.getFrameJacobian(self._model, self._data, self._id, self._world)
        acceleration = pin.getFrameClassicalAcceleration(self._model, self._data, self._id, self._world)
        rotation = pin.log3(np.dot(self._target, self._rotation.T))
        self._write((jacobian, error, drift), (full[3:], rotation, acceleration.angular))


class PoseTargetTask(FrameTask[pin.SE3]):
    """Base of tasks on a frame whose target is a pose."""

    unit = "m|rad"
    _course_of = Placing

    def _present(self, robot: Robot) -> pin.SE3:
        return pin.SE3(robot.placement(self.frame))

    def _checked(self, value: Any) -> pin.SE3:
        return pose(f"target of task '{self.name}'", value)


class PoseTask(PoseTargetTask):
    """Bring a frame to a pose in the world.

    Rows are along the chosen world axes: position, m, then rotation, rad; the weight is a cost per (m/s²)² and
    (rad/s²)². Weight 1 and stiffness 30 1/s² by default.
    """

    def __init__(self, frame: str, target: pin.SE3 | None = None, **options: Unpack[MotionOptions]) -> None:
        """Describe the task.

        Args:
            frame: Frame of the robot.
            target: Pose in the world; the present one when None.
            **options: See `MotionOptions`.
        """
        super().__init__(frame, f"{frame} pose", POSE_AXES, options)
        self._difference = np.zeros(6)
        if target is not None:
            self.target = target

    def _store(self, target: pin.SE3) -> None:
        self._target, self._goal_rotation, self._goal = target, target.rotation, target.translation

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `MotionTask.evaluate`."""
        full = pin.getFrameJacobian(self._model, self._data, self._id, self._world)
        acceleration = pin.getFrameClassicalAcceleration(self._model, self._data, self._id, self._world)
        difference = self._difference
        np.subtract(self._goal, self._translation, out=difference[:3])
        difference[3:] = pin.log3(np.dot(self._goal_rotation, self._rotation.T))
        self._write((jacobian, error, drift), (full, difference, acceleration.vector))
