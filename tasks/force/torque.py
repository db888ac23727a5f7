"""Task on joint torques."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Unpack

import numpy as np

from wbc.base.numbers import Array
from wbc.core.qp.kinds import VariableTask
from wbc.core.qp.options import TaskOptions
from wbc.core.qp.solving.problem import Problem
from wbc.tasks.motion.joints import JointTask, JointValues


class JointTorqueTask(JointTask, VariableTask):
    """Task that brings joint torques to a target; the default target, zero, keeps them small.

    Rows and residual are in Nm (N for prismatic joints). The weight is a cost per (Nm)², 10⁻⁴ by default. The task acts
    on the torque of the tick itself, so it has no stiffness and no damping.
    """

    __slots__ = ("_selection", "_torque_bias", "_torque_rows")
    unit = "Nm"
    usual = {"weight": 1e-4}

    def __init__(
        self,
        target: JointValues | None = None,
        *,
        joints: str | Sequence[str] | None = None,
        **options: Unpack[TaskOptions],
    ) -> None:
        """Describe the task.

        Args:
            target: Torques of the task's joints, shape (number of joints,), Nm, or joint name → torque for some of
                them; zero for all others.
            joints: Joint or joints of the task; all when None.
            **options: See `TaskOptions`.
        """
        super().__init__("joint torques", target, joints, options)

    def bind_problem(self, problem: Problem) -> None:
        """Find the torque rows; see `VariableTask.bind_problem`."""
        self._torque_rows, self._torque_bias = problem.torque_matrix, problem.torque_bias
        self._selection = self._columns - self.robot.base_dof

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `Task.evaluate`.

        The torque rows of the QP do not contain the bias, so it is added here.
        """
        jacobian[:] = self._torque_rows[self._selection]
        np.subtract(self._target.value, self._torque_bias[self._selection], out=error)
