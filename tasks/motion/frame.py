"""Pose, position and orientation of a frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.core.errors import Array, InputError, finite_array
from wbc.core.qp.task import MotionTask
from wbc.core.robot import Robot
from wbc.tasks.motion.axes import POSE_AXES, POSITION_AXES, ROTATION_AXES, axis_mask, other_columns


def rotation_matrix(what: str, value: ArrayLike) -> Array:
    """Validate a rotation matrix.

    Args:
        what: How the message calls it.
        value: Matrix of shape (3, 3).

    Raises:
        InputError: Not a finite, orthonormal, right-handed matrix (to 1e-6).
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
    """Validate a pose and copy it.

    Args:
        what: How the message calls it.
        value: The pose.

    Raises:
        InputError: Not a `pinocchio.SE3`, or one that is not finite or whose rotation is none.
    """
    if not isinstance(value, pin.SE3):
        raise InputError(f"{what} must be a pinocchio.SE3, got {value!r}")
    return pin.SE3(
        rotation_matrix(f"rotation of {what}", value.rotation),
        finite_array(f"translation of {what} (m)", value.translation, (3,)),
    )


class FrameTask(MotionTask):
    """What tasks on a frame have in common: the frame, the axes, and the joints that may be used; subclass it."""

    def __init__(
        self,
        frame: str,
        choices: Sequence[str],
        axes: Sequence[str],
        joints: Sequence[str] | None,
        name: str,
        weight: ArrayLike,
        stiffness: ArrayLike,
        damping: ArrayLike | None,
        hard: bool,
    ) -> None:
        self.frame = frame
        mask = axis_mask(name, axes, choices)
        self._keep = None if mask.all() else np.flatnonzero(mask)
        self._only_joints = joints
        super().__init__(
            name, int(mask.sum()), weight=weight, stiffness=stiffness, damping=damping, hard=hard
        )

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
        self._unused = other_columns(robot, self._only_joints)

    def _write_jacobian(self, jacobian: Array, full: Array) -> None:
        jacobian[:] = full if self._keep is None else full[self._keep]
        if self._unused is not None:
            jacobian[:, self._unused] = 0.0


class PositionTask(FrameTask):
    """Bring the origin of a frame to a point of the world.

    Error and residual are along the chosen world axes, m and m/s²; the weight is a cost per (m/s²)².
    """

    unit = "m"

    def __init__(
        self,
        frame: str,
        target: ArrayLike | None = None,
        *,
        axes: Sequence[str] = POSITION_AXES,
        joints: Sequence[str] | None = None,
        name: str | None = None,
        weight: ArrayLike = 1.0,
        stiffness: ArrayLike = 30.0,
        damping: ArrayLike | None = None,
        hard: bool = False,
    ) -> None:
        """Describe the task.

        Args:
            frame: Frame of the robot.
            target: Point in the world, shape (3,), m; the present one when None.
            axes: World axes that matter, out of x, y, z.
            joints: Joints that may be used, "base" for the floating base; all of them when None.
            name: Name of the task; made from the frame when None.
            weight: Cost per (m/s²)².
            stiffness: 1/s².
            damping: 1/s; critical when None.
            hard: Make it a constraint.

        Raises:
            InputError: An unknown axis, or a target that is not a finite point.
        """
        name = name or f"{frame} position"
        super().__init__(frame, POSITION_AXES, axes, joints, name, weight, stiffness, damping, hard)
        self._target: Array | None = None
        if target is not None:
            self.target = target

    @property
    def target(self) -> Array:
        """Point in the world, shape (3,), m."""
        return (
            np.array(self.robot.placement(self.frame).translation) if self._target is None else self._target
        )

    @target.setter
    def target(self, value: ArrayLike) -> None:
        self._target = finite_array(f"target of task '{self.name}' (m)", value, (3,))

    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`."""
        super().bind(robot)
        if self._target is None:
            self._target = np.array(self._translation)

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `MotionTask.evaluate`."""
        full = pin.getFrameJacobian(self._model, self._data, self._id, self._world)
        self._write_jacobian(jacobian, full[:3])
        assert self._target is not None
        difference = self._target - self._translation
        acceleration = pin.getFrameClassicalAcceleration(
            self._model, self._data, self._id, self._world
        ).linear
        keep = self._keep
        error[:] = difference if keep is None else difference[keep]
        drift[:] = acceleration if keep is None else acceleration[keep]


class OrientationTask(FrameTask):
    """Turn a frame, such as the pelvis or the torso, to an orientation in the world.

    The error is the rotation vector from the present to the wanted orientation, along the chosen world axes, rad;
    the weight is a cost per (rad/s²)².
    """

    unit = "rad"

    def __init__(
        self,
        frame: str,
        target: ArrayLike | None = None,
        *,
        axes: Sequence[str] = ROTATION_AXES,
        joints: Sequence[str] | None = None,
        name: str | None = None,
        weight: ArrayLike = 1.0,
        stiffness: ArrayLike = 30.0,
        damping: ArrayLike | None = None,
        hard: bool = False,
    ) -> None:
        """Describe the task.

        Args:
            frame: Frame of the robot.
            target: Rotation from the frame to the world, shape (3, 3); the present one when None.
            axes: World axes that matter, out of roll (about x), pitch (about y), yaw (about z).
            joints: Joints that may be used, "base" for the floating base; all of them when None.
            name: Name of the task; made from the frame when None.
            weight: Cost per (rad/s²)².
            stiffness: 1/s².
            damping: 1/s; critical when None.
            hard: Make it a constraint.

        Raises:
            InputError: An unknown axis, or a target that is not a rotation matrix.
        """
        name = name or f"{frame} orientation"
        super().__init__(frame, ROTATION_AXES, axes, joints, name, weight, stiffness, damping, hard)
        self._target: Array | None = None
        if target is not None:
            self.target = target

    @property
    def target(self) -> Array:
        """Rotation from the frame to the world, shape (3, 3)."""
        return np.array(self.robot.placement(self.frame).rotation) if self._target is None else self._target

    @target.setter
    def target(self, value: ArrayLike) -> None:
        self._target = rotation_matrix(f"target of task '{self.name}'", value)

    def follow(self, target: Array, velocity: Array | None = None, acceleration: Array | None = None) -> None:
        """Set target and feed-forwards for one tick, unchecked: for a controller that makes them itself.

        Args:
            target: Rotation from the frame to the world, shape (3, 3); kept, not copied.
            velocity: Angular velocity along the task's axes, shape (dim,), rad/s; unchanged when None.
            acceleration: Its derivative, shape (dim,), rad/s²; unchanged when None.
        """
        self._target = target
        if velocity is not None:
            self._rows.velocity[:] = velocity
        if acceleration is not None:
            self._rows.acceleration[:] = acceleration

    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`."""
        super().bind(robot)
        if self._target is None:
            self._target = np.array(self._rotation)

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `MotionTask.evaluate`."""
        full = pin.getFrameJacobian(self._model, self._data, self._id, self._world)
        self._write_jacobian(jacobian, full[3:])
        assert self._target is not None
        rotation = pin.log3(np.dot(self._target, self._rotation.T))
        acceleration = pin.getFrameClassicalAcceleration(
            self._model, self._data, self._id, self._world
        ).angular
        keep = self._keep
        error[:] = rotation if keep is None else rotation[keep]
        drift[:] = acceleration if keep is None else acceleration[keep]


class PoseTask(FrameTask):
    """Bring a frame to a pose in the world.

    Rows are along the chosen world axes: position, m, then rotation, rad; the weight is a cost per (m/s²)² and
    (rad/s²)².
    """

    unit = "m|rad"

    def __init__(
        self,
        frame: str,
        target: pin.SE3 | None = None,
        *,
        axes: Sequence[str] = POSE_AXES,
        joints: Sequence[str] | None = None,
        name: str | None = None,
        weight: ArrayLike = 1.0,
        stiffness: ArrayLike = 30.0,
        damping: ArrayLike | None = None,
        hard: bool = False,
    ) -> None:
        """Describe the task.

        Args:
            frame: Frame of the robot.
            target: Pose in the world; the present one when None.
            axes: World axes that matter, out of x, y, z, roll, pitch, yaw.
            joints: Joints that may be used, "base" for the floating base; all of them when None.
            name: Name of the task; made from the frame when None.
            weight: Cost per (m/s²)² and (rad/s²)².
            stiffness: 1/s².
            damping: 1/s; critical when None.
            hard: Make it a constraint.

        Raises:
            InputError: An unknown axis, or a target that is not a pose.
        """
        name = name or f"{frame} pose"
        super().__init__(frame, POSE_AXES, axes, joints, name, weight, stiffness, damping, hard)
        self._position: Array | None = None
        self._orientation: Array | None = None
        self._error = np.zeros(6)
        if target is not None:
            self.target = target

    @property
    def target(self) -> pin.SE3:
        """Pose in the world."""
        if self._orientation is None:
            return self.robot.placement(self.frame).copy()
        return pin.SE3(self._orientation, self._position)

    @target.setter
    def target(self, value: pin.SE3) -> None:
        target = pose(f"target of task '{self.name}'", value)
        self._orientation, self._position = np.array(target.rotation), np.array(target.translation)

    def follow(self, placement: pin.SE3, velocity: Array, acceleration: Array) -> None:
        """Set target and feed-forwards for one tick, unchecked: for a controller that makes them itself.

        Args:
            placement: Pose in the world; kept, not copied.
            velocity: [linear; angular] along the task's axes, shape (dim,), m/s and rad/s.
            acceleration: Its derivative, shape (dim,), m/s² and rad/s².
        """
        self._orientation, self._position = placement.rotation, placement.translation
        self._rows.velocity[:] = velocity
        self._rows.acceleration[:] = acceleration

    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`."""
        super().bind(robot)
        if self._orientation is None:
            self._orientation, self._position = np.array(self._rotation), np.array(self._translation)

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `MotionTask.evaluate`."""
        self._write_jacobian(jacobian, pin.getFrameJacobian(self._model, self._data, self._id, self._world))
        assert self._orientation is not None and self._position is not None
        full = self._error
        np.subtract(self._position, self._translation, out=full[:3])
        full[3:] = pin.log3(np.dot(self._orientation, self._rotation.T))
        acceleration = pin.getFrameClassicalAcceleration(
            self._model, self._data, self._id, self._world
        ).vector
        keep = self._keep
        error[:] = full if keep is None else full[keep]
        drift[:] = acceleration if keep is None else acceleration[keep]
