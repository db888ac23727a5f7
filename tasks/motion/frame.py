"""Tasks on a frame: its position, orientation, pose, and the direction of one of its axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar, Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.checked import checked, result
from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array, finite_array, read_only
from wbc.core.frames import (
    frame_jacobian,
    pose,
    relative_drift,
    relative_jacobian,
    rotation_matrix,
    unit_vector,
)
from wbc.core.qp.motion import OPTIONS
from wbc.core.qp.move import Coordinates, DirectionCoordinates, least_turn
from wbc.core.qp.options import POSE_AXES, POSITION_AXES, ROTATION_AXES, MotionOptions
from wbc.core.qp.task import Task
from wbc.core.robot import Robot


class FrameTask(Task):
    """Base of tasks on a frame, whose target is a pose unless a task says otherwise.

    Weight 1 and stiffness 30 1/s² by default; the weight is a cost per (m/s²)² and (rad/s²)². With `axes` of a part of
    a rotation, the error is that of this part, wherever the frame has turned about the others: with roll and pitch, the
    tilt, whatever the heading.

    Attributes:
        frame: Frame of the robot.
    """

    __slots__ = (
        "_data", "_frame", "_id", "_model", "_placement", "_rotation", "_translation", "_turned", "_world",
    )  # fmt: skip
    usual = {"stiffness": 30.0}
    reads = "kinematics"
    frame: str = result("_frame", OPTIONS)
    _part: ClassVar[str] = "vector"  # of the motion of the frame, that of the task

    def __init__(
        self, frame: str, what: str, rows: tuple[str, ...], target: Any, options: MotionOptions
    ) -> None:
        """Describe the task, by default named after frame and `what`; see `Task`."""
        self._frame = frame
        super().__init__(f"{frame} {what}", rows, **options)
        chosen = np.array(rows)[self._choice.keep]
        self._turned = [axis for axis, name in enumerate(ROTATION_AXES) if name in chosen]
        if target is not None:
            self.target = target

    def _turn(self, rotation: Array) -> Array:
        """Return the rotation vector of a rotation matrix about the axes of the task, rad, shape (3,).

        About two axes, it is the least turn after which only one about the third axis is left: of roll and pitch, the
        tilt. About one axis, it is the angle by which the rotation twists about it: of yaw, the heading.
        """
        axes = self._turned
        if len(axes) in (0, 3):
            return np.asarray(pin.log3(rotation))
        if len(axes) == 2:
            free = 3 - sum(axes)
            return least_turn(rotation[free], np.eye(3)[free])
        turn, axis = np.zeros(3), axes[0]
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn[axis] = math.atan2(rotation[j, i] - rotation[i, j], rotation[i, i] + rotation[j, j])
        return turn

    def bind(self, robot: Robot) -> None:
        """Resolve frame and joints."""
        super().bind(robot)
        self._id = robot.frame_id(self.frame)
        self._placement = robot.data.oMf[self._id]
        self._rotation, self._translation = self._placement.rotation, self._placement.translation
        self._model, self._data, self._world = robot.model, robot.data, pin.LOCAL_WORLD_ALIGNED

    def present(self, robot: Robot) -> Any:
        """Return the pose of the frame."""
        return pin.SE3(robot.placement(self.frame))

    def checked(self, value: Any) -> Any:
        """Return a pose after a check, as a copy."""
        return pose(f"target of task '{self.name}'", value)

    def drift(self) -> Array:
        """Return the acceleration of the frame, or its part that is the task's; see `Motion.drift`."""
        motion = pin.getFrameClassicalAcceleration(self._model, self._data, self._id, self._world)
        part: Array = getattr(motion, self._part)
        return part


class PositionTask(FrameTask):
    """Task that brings the origin of a frame to a point of the world.

    Error and residual are along the chosen world axes, m and m/s².
    """

    __slots__ = ()
    _part = "linear"

    def __init__(self, frame: str, target: ArrayLike | None = None, **options: Unpack[MotionOptions]) -> None:
        """Describe the task; the target is a point in the world, shape (3,), m, the present one when None."""
        super().__init__(frame, "position", POSITION_AXES, target, options)

    def present(self, robot: Robot) -> Array:
        """Return the origin of the frame, shape (3,), m."""
        return np.array(robot.placement(self.frame).translation)

    def checked(self, value: ArrayLike) -> Array:
        """Return a point after a check, shape (3,), m."""
        return finite_array(f"target of task '{self.name}' (m)", value, (3,))

    def measure(self, jacobian: Array, error: Array) -> None:
        """Fill Jacobian and error; see `Motion.measure`."""
        jacobian[:] = frame_jacobian(self._model, self._data, self._id, self._world)[:3]
        np.subtract(self._target, self._translation, out=error)


class OrientationTask(FrameTask):
    """Task that turns a frame, such as the pelvis or the torso, to an orientation in the world.

    The error is the rotation vector from the present to the target orientation, along the chosen world axes, rad; see
    `FrameTask` for what it is with some axes alone.
    """

    __slots__ = ()
    unit = "rad"
    _part = "angular"

    def __init__(self, frame: str, target: ArrayLike | None = None, **options: Unpack[MotionOptions]) -> None:
        """Describe the task; the target is a rotation matrix to the world, shape (3, 3), the present one when None."""
        super().__init__(frame, "orientation", ROTATION_AXES, target, options)

    @property
    def rotation(self) -> Array:
        """Present rotation matrix of the frame, shape (3, 3); a view that changes with the robot."""
        rotation: Array = self._rotation
        return rotation

    def present(self, robot: Robot) -> Array:
        """Return the rotation of the frame, shape (3, 3)."""
        return np.array(robot.placement(self.frame).rotation)

    def checked(self, value: ArrayLike) -> Array:
        """Check a rotation matrix, shape (3, 3), and return a copy."""
        return rotation_matrix(f"target of task '{self.name}'", value)

    def measure(self, jacobian: Array, error: Array) -> None:
        """Fill Jacobian and error; see `Motion.measure`."""
        jacobian[:] = frame_jacobian(self._model, self._data, self._id, self._world)[3:]
        error[:] = self._turn(self._target.dot(self._rotation.T))


class PoseTask(FrameTask):
    """Task that brings a frame to a pose in the world.

    Rows are along the chosen world axes: position, m, then rotation, rad.
    """

    __slots__ = ()
    unit = "m|rad"

    def __init__(self, frame: str, target: pin.SE3 | None = None, **options: Unpack[MotionOptions]) -> None:
        """Describe the task; the target is a `pin.SE3` in the world, the present pose when None."""
        super().__init__(frame, "pose", POSE_AXES, target, options)

    def measure(self, jacobian: Array, error: Array) -> None:
        """Fill Jacobian and error; see `Motion.measure`."""
        target = self._target
        jacobian[:] = frame_jacobian(self._model, self._data, self._id, self._world)
        np.subtract(target.translation, self._translation, out=error[:3])
        error[3:] = self._turn(target.rotation.dot(self._rotation.T))


class RelativeFrameTask(FrameTask):
    """Task that brings a frame to a pose relative to another frame of the robot, such as one hand to the other.

    The rows are along the axes of the reference frame: first the position of the origin of `frame`, m, then the
    rotation, rad. With axes=("x", "y", "z") the task controls only the position, with axes=("roll", "pitch", "yaw")
    only the orientation. The task does not resist a motion of both frames together.
    """

    __slots__ = ("_reference", "_reference_id", "_reference_placement")
    reference: str = result("_reference", OPTIONS)
    unit = "m|rad"

    @checked
    def __init__(
        self, frame: str, reference: str, target: pin.SE3 | None = None, **options: Unpack[MotionOptions]
    ) -> None:
        """Describe the task; the target is the pose of `frame` in `reference`, a `pin.SE3`, or the present one."""
        if frame == reference:
            raise InputError(f"a relative task needs two frames, got '{frame}' twice")
        self._reference = reference
        super().__init__(frame, f"in {reference}", POSE_AXES, target, options)

    def present(self, robot: Robot) -> pin.SE3:
        """Return the pose of the frame in the other one."""
        return robot.placement(self.reference).actInv(robot.placement(self.frame))

    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`."""
        super().bind(robot)
        self._reference_id = robot.frame_id(self.reference)
        self._reference_placement = robot.data.oMf[self._reference_id]

    def measure(self, jacobian: Array, error: Array) -> None:
        """Fill Jacobian and error; see `Motion.measure`.

        The velocity is that of `wbc.core.frames.relative_jacobian`, along the axes of the reference.
        """
        back = self._reference_placement.rotation.T
        rows = relative_jacobian(self._model, self._data, self._id, self._reference_id)
        jacobian[:3], jacobian[3:] = np.dot(back, rows[:3]), np.dot(back, rows[3:])
        target, offset = self._target, self._translation - self._reference_placement.translation
        np.subtract(target.translation, np.dot(back, offset), out=error[:3])
        error[3:] = self._turn(np.dot(target.rotation, np.dot(self._rotation.T, back.T)))

    def drift(self) -> Array:
        """Return the acceleration in the reference, shape (6,); see `Motion.drift`."""
        back = self._reference_placement.rotation.T
        parts = relative_drift(self._model, self._data, self._id, self._reference_id)
        return np.concatenate([np.dot(back, part) for part in parts])


NEAREST = 0.05
"""Least distance of a point that the gaze task divides by, m."""


def _turning(task: FrameTask, axis: Array, direction: Array, jacobian: Array, error: Array) -> Array:
    """Fill the rows ω − a (a · ω) of an axis a that turns to a direction, and return their drift.

    With ȧ = ω × a, the drift is ω̇ − a (a · ω̇) − ȧ (a · ω), at no joint acceleration.
    """
    model, data, frame, world = task._model, task._data, task._id, task._world
    full = frame_jacobian(model, data, frame, world)[3:]
    spin = pin.getFrameVelocity(model, data, frame, world).angular
    rate = pin.getFrameClassicalAcceleration(model, data, frame, world).angular
    a = task._rotation @ axis
    np.subtract(full, np.outer(a, a @ full), out=jacobian)
    error[:] = least_turn(a, direction)
    return np.asarray(rate - a * (a @ rate) - np.cross(spin, a) * (a @ spin))


class VectorOrientationTask(FrameTask):
    """Task that turns one axis of a frame to a direction of the world; rotations about that axis are free.

    The error is the shortest rotation vector from the axis a to the direction d, along the chosen world axes, rad. The
    rows are ω − a (a · ω); two of the three are independent.
    """

    __slots__ = ("_axis",)
    unit = "rad"

    def __init__(
        self,
        frame: str,
        target: ArrayLike | None = None,
        *,
        axis: ArrayLike = (1.0, 0.0, 0.0),
        **options: Unpack[MotionOptions],
    ) -> None:
        """Describe the task; target and axis have shape (3,) and any length; the target is as now when None."""
        self._axis = unit_vector(f"axis of '{frame}'", axis)
        super().__init__(frame, "direction", ROTATION_AXES, target, options)

    @property
    def axis(self) -> Array:
        """Axis of the frame, of length 1, shape (3,), read-only."""
        return read_only(self._axis)

    def present(self, robot: Robot) -> Array:
        """Return the direction of the axis, shape (3,)."""
        return np.asarray(robot.placement(self.frame).rotation @ self._axis)

    def checked(self, value: ArrayLike) -> Array:
        """Check a direction, shape (3,), and return it with length 1."""
        return unit_vector(f"target of task '{self.name}'", value)

    def _coordinates(self) -> Coordinates:
        return DirectionCoordinates(self.target, self.checked)

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `Task.evaluate`."""
        drift[:] = _turning(self, self._axis, self._target, jacobian, error)


class LookAtTask(FrameTask):
    """Task that turns one axis of a frame, such as that of a camera in the head, to a point of the world.

        controller.add(LookAtTask("head", [1.5, 0.4, 1.0]))

    By default the task uses the joints between base and frame: for a head, these are neck and waist. With the joints of
    the legs, `g1` fell when it looked to the side at the end of a walk. With the unit vector d to the point and the
    distance r to it, the rows are those of `VectorOrientationTask` plus d × v / r, since a frame that moves with
    velocity v sees the point in another direction.
    """

    __slots__ = ("_axis",)
    unit = "rad"

    def __init__(
        self,
        frame: str,
        target: ArrayLike | None = None,
        *,
        axis: ArrayLike = (1.0, 0.0, 0.0),
        **options: Unpack[MotionOptions],
    ) -> None:
        """Describe the task; the axis of the frame has shape (3,) and any length.

        The target is a point in the world, shape (3,), m; when None, it is the point 1 m away along the axis.
        """
        self._axis = unit_vector(f"axis of '{frame}'", axis)
        super().__init__(frame, "gaze", ROTATION_AXES, target, options)

    def present(self, robot: Robot) -> Array:
        """Return the point 1 m away along the axis, shape (3,), m."""
        return np.asarray(robot.placement(self.frame).act(self._axis))

    def checked(self, value: ArrayLike) -> Array:
        """Return a point after a check, shape (3,), m."""
        return finite_array(f"target of task '{self.name}' (m)", value, (3,))

    def _put(self, target: Any, velocity: Array, acceleration: Array) -> None:
        self._target = np.array(target)  # no feed-forward: it needs the distance, and a gaze moves slowly

    def _used_joints(self, robot: Robot) -> Sequence[str] | None:
        """Return the joints of the option `joints`, or those between base and frame, if there are any."""
        carriers = robot.joints_between(self.frame, robot.base_frame)
        return super()._used_joints(robot) or [robot.joint_names[joint] for joint in carriers] or None

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `Task.evaluate`. With ḋ = −(v − d (d · v)) / r and ṙ = −d · v."""
        model, data, frame, world = self._model, self._data, self._id, self._world
        way = self._target - self._translation
        distance = float(np.linalg.norm(way))
        d, r = way / max(distance, ROUNDING), max(distance, NEAREST)
        drift[:] = _turning(self, self._axis, d, jacobian, error)
        linear = frame_jacobian(model, data, frame, world)[:3]
        v = pin.getFrameVelocity(model, data, frame, world).linear
        rate = pin.getFrameClassicalAcceleration(model, data, frame, world).linear
        along = float(d @ v)
        jacobian += pin.skew(d) @ linear / r
        drift += (np.cross(d, rate) + np.cross(d, v) * (2.0 * along / r)) / r  # ḋ × v = d × v (d · v) / r
