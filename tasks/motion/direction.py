"""Tasks on a direction of a frame: one of its axes along a direction of the world, or towards a point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.numbers import ROUNDING, Array, finite_array, read_only
from wbc.core.frames import frame_jacobian, unit_vector
from wbc.core.qp.move import Coordinates, DirectionCoordinates, least_turn
from wbc.core.qp.options import ROTATION_AXES, MotionOptions
from wbc.core.robot import Robot
from wbc.tasks.motion.frame import FrameTask

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
        drift[:] = _turning(self, self._axis, self._target.value, jacobian, error)


class LookAtTask(FrameTask):
    """Task that turns one axis of a frame, such as that of a camera in the head, to a point of the world.

        controller.add(LookAtTask("head", [1.5, 0.4, 1.0]))

    By default the task uses the joints between base and frame: for a head, these are neck and waist. With the joints of
    the legs, `g1` fell when it looked to the side at the end of a walk. With the unit vector d to the point and the
    distance r to it, the rows are those of `VectorOrientationTask` plus d × v / r, since a frame that moves with
    velocity v sees the point in another direction.
    """

    __slots__ = ("_axis", "_followed", "_followed_id")
    unit = "rad"

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
            target: Point in the world, shape (3,), m, or a frame of the robot that it follows, such as a hand. When
                None, it is the point 1 m away along the axis.
            axis: Axis of the frame, shape (3,), of any length.
            **options: See `MotionOptions`.
        """
        self._axis = unit_vector(f"axis of '{frame}'", axis)
        self._followed: str | None = target if isinstance(target, str) else None
        self._followed_id: int | None = None
        point = None if isinstance(target, str) else target
        super().__init__(frame, "gaze", ROTATION_AXES, point, options)

    @property
    def target(self) -> Array:
        """Point in the world, shape (3,), m, read-only; assign a point, or a frame of the robot to follow.

        The point of a frame that is followed may be assigned as it is read: the frame is followed on.
        """
        if self._followed_id is not None:
            return read_only(self._data.oMf[self._followed_id].translation)
        point: Array = super().target
        return point

    @target.setter
    def target(self, value: ArrayLike | str) -> None:
        if isinstance(value, str):
            self._followed_id = None if self._robot is None else self._robot.frame_id(value)
            self._followed = value
            return
        if self._followed_id is not None and np.may_share_memory(value, self.target):
            return
        FrameTask.target.fset(self, value)  # type: ignore[attr-defined]
        self._followed = self._followed_id = None

    def present(self, robot: Robot) -> Array:
        """Return the point 1 m away along the axis, shape (3,), m."""
        return np.asarray(robot.placement(self.frame).act(self._axis))

    def checked(self, value: ArrayLike) -> Array:
        """Return a point after a check, shape (3,), m."""
        return finite_array(f"target of task '{self.name}' (m)", value, (3,))

    def _put(self, target: Any, velocity: Array, acceleration: Array) -> None:
        self._target.value = target  # no feed-forward: it would need the distance, and a gaze moves slowly

    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`."""
        super().bind(robot)
        self._followed_id = None if self._followed is None else robot.frame_id(self._followed)

    def _used_joints(self, robot: Robot) -> Sequence[str] | None:
        """Return the joints of the option `joints`, or those between base and frame, if there are any."""
        carriers = robot.joints_between(self.frame, robot.base_frame)
        return super()._used_joints(robot) or [robot.joint_names[joint] for joint in carriers] or None

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `Task.evaluate`. With ḋ = −(v − d (d · v)) / r and ṙ = −d · v."""
        model, data, frame, world = self._model, self._data, self._id, self._world
        other = self._followed_id
        point = self._target.value if other is None else data.oMf[other].translation
        way = point - self._translation
        distance = float(np.linalg.norm(way))
        d, r = way / max(distance, ROUNDING), max(distance, NEAREST)
        drift[:] = _turning(self, self._axis, d, jacobian, error)
        linear = frame_jacobian(model, data, frame, world)[:3]
        v = pin.getFrameVelocity(model, data, frame, world).linear
        rate = pin.getFrameClassicalAcceleration(model, data, frame, world).linear
        if other is not None:  # a target that moves
            linear = linear - frame_jacobian(model, data, other, world)[:3]
            v = v - pin.getFrameVelocity(model, data, other, world).linear
            rate = rate - pin.getFrameClassicalAcceleration(model, data, other, world).linear
        along = float(d @ v)
        jacobian += pin.skew(d) @ linear / r
        drift += (np.cross(d, rate) + np.cross(d, v) * (2.0 * along / r)) / r  # ḋ × v = d × v (d · v) / r
