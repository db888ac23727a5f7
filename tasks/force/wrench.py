"""Tasks on variables of the QP of accelerations: the wrench of a contact, and joint torques."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from wbc.base.checked import checked
from wbc.base.errors import unknown_name
from wbc.base.numbers import Array
from wbc.core.qp.contact import Contact
from wbc.core.qp.options import POSE_AXES, TaskOptions
from wbc.core.qp.solving.problem import Problem
from wbc.core.qp.task import VariableTask
from wbc.tasks.motion.posture import JointTask, JointValues


class WrenchTask(VariableTask):
    """Task that brings the wrench of one contact to a target.

    Rows and residual are along the chosen axes of the contact frame, N and Nm. The weight is a cost per N² and (Nm)²,
    10⁻³ by default. The wrench is that of the ground on the robot, which it has while the contact stands still as the
    QP holds it: a contact whose frame is not where the robot touches moves, and its pull-back is missing in the force.
    The task acts on the wrench of the tick itself, so it has no stiffness and no damping. A contact that is off, or
    that is not in the controller, has zero wrench whatever the target is. A hard task therefore has an effect only
    while its contact is active.
    """

    __slots__ = ("_axes", "_columns", "_contact", "_loaded", "_order", "_size")
    unit = "N|Nm"
    usual = {"weight": 1e-3}

    @checked
    def __init__(
        self,
        contact: Contact,
        target: ArrayLike | None = None,
        *,
        axes: str | Sequence[str] | None = None,
        **options: Unpack[TaskOptions],
    ) -> None:
        """Describe the task.

        Args:
            contact: The contact.
            target: Wrench of a sole contact, [force; moment] in the sole frame at the sole centre, shape (6,), N and
                Nm, or force of a point contact, shape (3,), N; zero when None.
            axes: Axes of the contact frame to control: x, y, z for the force, and roll, pitch, yaw for the moment; all
                axes of the contact when None.
            **options: See `TaskOptions`.
        """
        self._contact, self._size = contact, contact.dim
        every = POSE_AXES[: self._size]
        chosen = every if axes is None else axes
        super().__init__(f"{self.contact} wrench", every, axes=chosen, **options)
        self._axes = np.arange(self._size)[self._choice.keep]
        self.target = np.zeros(self._size) if target is None else target

    @property
    def contact(self) -> str:
        """Name of the contact."""
        return self._contact.name

    def waits_for(self) -> object:
        """Return the contact."""
        return self._contact

    def bind_problem(self, problem: Problem) -> None:
        """Find the force variables of the contact."""
        if self.contact not in problem.contacts:
            unknown_name("contact", self.contact, problem.contacts)
        self._columns = problem.contacts[self.contact].start + self._axes
        self._order = np.arange(self.dim)
        self._loaded = problem.loaded[self.contact]

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `Task.evaluate`."""
        if self._hard and not self._loaded:
            jacobian[:], error[:] = 0.0, 0.0
            return
        jacobian[self._order, self._columns] = 1.0
        error[:] = self._target[self._axes]


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
        np.subtract(self._target, self._torque_bias[self._selection], out=error)
