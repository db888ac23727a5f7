"""Task on the wrench of a contact, for control at the level of dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from wbc.base.errors import InputError, unknown_name
from wbc.base.numbers import Array
from wbc.core.qp.axes import POSE_AXES
from wbc.core.qp.contact import Contact
from wbc.core.qp.problem import Problem
from wbc.core.qp.task import TaskOptions, VariableTask


class WrenchTask(VariableTask):
    """Bring the wrench of one contact to a target.

    Rows and residual are along the chosen axes of the contact frame, N and Nm; the weight is a cost per N² and (Nm)²,
    10⁻³ by default. The wrench is what the ground does to the robot. It is instantaneous: there is no stiffness, and no
    damping. A contact that is off, or is not in the controller, has zero wrench, whatever the target: a hard task
    acts while its contact is active.
    """

    __slots__ = ("_axes", "_columns", "_contact", "_loaded", "_order", "_size")
    unit = "N|Nm"
    usual = {"weight": 1e-3}

    def __init__(
        self,
        contact: Contact | str,
        target: ArrayLike | None = None,
        *,
        axes: str | Sequence[str] | None = None,
        **options: Unpack[TaskOptions],
    ) -> None:
        """Describe the task.

        Args:
            contact: The contact, or its name, which then must be a sole's.
            target: All force variables of the contact, [force; moment] in the sole frame at the sole centre, shape
                (6,), or the force of a point contact, shape (3,), N and Nm; zero when None.
            axes: Axes of the contact frame to control: x, y, z of the force, roll, pitch, yaw of the moment; all that
                the contact has when None.
            **options: See `TaskOptions`.
        """
        self._contact = contact
        self._size = contact.dim if isinstance(contact, Contact) else len(POSE_AXES)
        every = POSE_AXES[: self._size]
        chosen = every if axes is None else axes
        super().__init__(f"{self.contact} wrench", every, axes=chosen, **options)
        self._axes = np.arange(self._size)[self._keep]
        self.target = np.zeros(self._size) if target is None else target

    @property
    def contact(self) -> str:
        """Name of the contact."""
        return self._contact.name if isinstance(self._contact, Contact) else self._contact

    def waits_for(self) -> object | None:
        """Return the contact, where the task was given it and not its name."""
        return self._contact if isinstance(self._contact, Contact) else None

    def bind_problem(self, problem: Problem) -> None:
        """Find the force variables of the contact."""
        if self.contact not in problem.contacts:
            unknown_name("contact", self.contact, problem.contacts)
        block = problem.contacts[self.contact]
        if block.stop - block.start != self._size:
            raise InputError(
                f"contact '{self.contact}' of task '{self.name}' has {block.stop - block.start} force variables, "
                f"not {self._size}; give the contact itself instead of its name"
            )
        self._columns = block.start + self._axes
        self._order = np.arange(self.dim)
        self._loaded = problem.loaded

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `Task.evaluate`."""
        if self._hard and not self._loaded[self.contact]:
            jacobian[:], error[:] = 0.0, 0.0
            return
        jacobian[self._order, self._columns] = 1.0
        error[:] = self._target.value[self._axes]
