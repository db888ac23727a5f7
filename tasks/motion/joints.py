"""Base of tasks with a target for each joint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wbc.core.errors import Array, InputError, finite_array, finite_scalar
from wbc.core.qp.task import Task, read_only
from wbc.core.robot import Robot
from wbc.tasks.motion.axes import distinct_joints, joint_columns

JointValues = ArrayLike | Mapping[str, float]
"""A value for each joint of a task, shape (number of joints,), or joint name → value for some of them."""


class JointTask(Task):
    """Base of tasks on joints, of which each has a row and a target."""

    def __init__(
        self,
        name: str,
        target: JointValues | None,
        joints: str | Sequence[str] | None,
        options: Mapping[str, Any],
    ) -> None:
        """Describe the task: name where the options give none, targets, joints (all when None) and checked options.

        Raises `InputError` for no joint at all, a joint twice, or an option out of range.
        """
        self._joints = None if joints is None else distinct_joints(joints)
        gains = dict(options)
        super().__init__(gains.pop("name", None) or name, len(self._joints or [""]), **gains)
        self._target: Array | None = None
        self._pending = target

    def bind(self, robot: Robot) -> None:
        """Resolve the joints, and take the present values as targets where none were given.

        Raises:
            UnknownNameError: The robot has no such joint.
            InputError: A target of the wrong shape.
        """
        super().bind(robot)
        if self._joints is None:
            self._joints = list(robot.joint_names)
            self._resize(robot.na)
        self._columns = joint_columns(robot, self._joints)
        if not self.accepted:
            self._target = self._present(robot)
            if self._pending is not None:
                self._target = self._targets(self._pending, self._target)

    def _present(self, robot: Robot) -> Array:
        """Targets of joints for which none were given, shape (dim,); a new array."""
        raise NotImplementedError

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints of the task, in the order of its rows."""
        return self.robot.joint_names if self._joints is None else tuple(self._joints)

    @property
    def target(self) -> Array:
        """Targets, shape (dim,), `unit`, read-only; assign an array, or joint name → target for some joints."""
        if self._target is None:
            raise InputError(f"task '{self.name}' has no target before it is added to a controller")
        return read_only(self._target)

    @target.setter
    def target(self, value: JointValues) -> None:
        if self._target is None:
            self._pending = value
            return
        if not self.accepted:
            self._pending = value
        target = self._targets(value, self._target)
        if self._held:
            self._take_over()
        self._target = target

    def _targets(self, value: JointValues, others: Array) -> Array:
        """Return targets after a check, shape (dim,); those that are not given are those of `others`."""
        if not isinstance(value, Mapping):
            return finite_array(f"target of task '{self.name}' ({self.unit})", value, (self.dim,))
        changed = np.array(others)
        for joint, target in value.items():
            changed[self._row(joint)] = finite_scalar(f"target of joint '{joint}' ({self.unit})", target)
        return changed

    def saturate(self, error: Array) -> None:
        """Bring the error of each joint into its bound; see `Task.saturate`."""
        bound = self._rows.bound
        np.minimum(np.maximum(error, -bound, out=error), bound, out=error)

    def _row(self, joint: str) -> int:
        self.robot.joint_index(joint)
        if joint not in self.joints:
            raise InputError(f"joint '{joint}' is not part of task '{self.name}'")
        return self.joints.index(joint)
