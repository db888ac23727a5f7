"""Task on joint torques."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from wbc.core.errors import Array, check_options, finite_array, finite_scalar, unknown_name
from wbc.core.qp.problem import Problem
from wbc.core.qp.task import VariableTask
from wbc.core.robot import BASE_DOF, Robot
from wbc.tasks.motion.axes import distinct_joints, joint_columns
from wbc.tasks.options import TaskOptions


class JointTorqueTask(VariableTask):
    """Bring joint torques to given ones; with the default target, zero, keep them small.

    Rows and residual are in Nm (N for sliding joints); the weight is a cost per (Nm)², 10⁻⁴ by default. Torques are
    instantaneous: there is no stiffness, and no damping.
    """

    unit = "Nm"

    def __init__(
        self,
        target: ArrayLike | Mapping[str, float] | None = None,
        *,
        joints: Sequence[str] | None = None,
        **options: Unpack[TaskOptions],
    ) -> None:
        """Describe the task.

        Args:
            target: Torques of the task's joints, shape (number of joints,), Nm, or joint name → torque for some of
                them; zero for all others.
            joints: Joints of the task; all when None.
            **options: See `TaskOptions`.

        Raises:
            UnknownNameError: An unknown option.
            InputError: No joint at all, a joint twice, or a value that is not finite or out of range.
        """
        check_options(self, TaskOptions, options)
        rest: dict[str, Any] = {"weight": 1e-4, **options}
        name = rest.pop("name", None) or "joint torques"
        self._joints = None if joints is None else distinct_joints(joints)
        super().__init__(name, len(self._joints or [""]), **rest)
        self._pending = target
        self._target: Array | None = None

    def bind(self, robot: Robot) -> None:
        """Resolve the joints.

        Raises:
            UnknownNameError: The robot has no such joint.
            InputError: A target of the wrong shape.
        """
        super().bind(robot)
        if self._joints is None:
            self._joints = list(robot.joint_names)
            self._resize(robot.na)
        self._columns = joint_columns(robot, self._joints)
        if self._target is None:
            self._target = np.zeros(self.dim)
            if self._pending is not None:
                self.target = self._pending

    def bind_problem(self, problem: Problem) -> None:
        """Find the torque rows; see `VariableTask.bind_problem`."""
        self._torque_rows = problem.torque_matrix
        self._selection = self._columns - BASE_DOF

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints of the task, in the order of its rows."""
        return self.robot.joint_names if self._joints is None else tuple(self._joints)

    @property
    def target(self) -> Array:
        """Torques, shape (dim,), Nm; assign an array, or joint name → torque for some joints."""
        return np.zeros(self.dim) if self._target is None else self._target

    @target.setter
    def target(self, value: ArrayLike | Mapping[str, float]) -> None:
        if self._target is None:
            self._pending = value
        elif isinstance(value, Mapping):
            changed = np.array(self._target)
            for joint, torque in value.items():
                if joint not in self.joints:
                    unknown_name(f"joint of task '{self.name}'", joint, self.joints)
                changed[self.joints.index(joint)] = finite_scalar(f"torque of joint '{joint}' (Nm)", torque)
            self._target = changed
        else:
            self._target = finite_array(f"target of task '{self.name}' (Nm)", value, (self.dim,))

    def evaluate(self, matrix: Array, reference: Array) -> None:
        """Fill the rows; see `VariableTask.evaluate`. Torque rows leave out the joints' bias, which is added back."""
        assert self._target is not None
        matrix[:] = self._torque_rows[self._selection]
        np.subtract(self._target, self.robot.bias[self._columns], out=reference)
