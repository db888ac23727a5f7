"""Base of tasks with a target for each joint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array, finite_scalar, read_only
from wbc.core.qp.options import GainOptions, TaskOptions, distinct_joints, joint_columns
from wbc.core.qp.task import Task
from wbc.core.robot import Robot

JointValues = ArrayLike | Mapping[str, float]
"""A value for each joint of a task, shape (number of joints,), or joint name → value for some of them."""


class JointTask(Task):
    """Base of tasks on joints, of which each has a row and a target."""

    __slots__ = ("_columns", "_joints", "_pending")

    def __init__(
        self,
        name: str,
        target: JointValues | None,
        joints: str | Sequence[str] | None,
        options: TaskOptions | GainOptions,
    ) -> None:
        """Describe the task: its name, targets, joints (all when None) and options, each where none is given."""
        self._joints = None if joints is None else distinct_joints(joints)
        self._columns: NDArray[np.intp]
        super().__init__(name, len(self._joints or [""]), **options)
        self._pending = [] if target is None else [target]  # until the joints are known

    @checked
    def bind(self, robot: Robot) -> None:
        """Resolve the joints, and take the present values as targets where none were given."""
        if self._joints is None:
            self._joints = list(robot.joint_names)
            self._resize(robot.na)
        self._columns = joint_columns(robot, self._joints)
        super().bind(robot)
        if not self._target.settled:
            self._target.value = self.present(robot)
            for given in self._pending:
                self._target.value = self.checked(given)

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints of the task, in the order of its rows."""
        return self.robot.joint_names if self._joints is None else tuple(self._joints)

    @property
    def target(self) -> Array:
        """Targets, shape (dim,), `unit`, read-only; assign an array, or joint name → target for some joints."""
        if self._target.value is None:
            raise InputError(f"task '{self.name}' has no target before it is added to a controller")
        return read_only(self._target.value)

    @target.setter
    def target(self, value: JointValues) -> None:
        if self._target.value is None:
            self._pending = [*self._pending, value] if isinstance(value, Mapping) else [value]
            return
        Task.target.fset(self, value)  # type: ignore[attr-defined]
        if not self._target.settled:  # what could not be added is not tried again
            self._pending = [self._target.value]

    def checked(self, value: JointValues, others: Array | None = None) -> Array:
        """Return targets after a check, shape (dim,); those that are not given are those of `others`, or stay."""
        if not isinstance(value, Mapping):
            return finite_array(f"target of task '{self.name}' ({self.unit})", value, (self.dim,))
        changed = np.array(self._target.value if others is None else others)
        for joint, target in value.items():
            changed[self._row(joint)] = finite_scalar(f"target of joint '{joint}' ({self.unit})", target)
        return changed

    def _row(self, joint: str) -> int:
        self.robot.joint_index(joint)
        if joint not in self.joints:
            raise InputError(f"joint '{joint}' is not part of task '{self.name}'")
        return self.joints.index(joint)
