"""Task on the wrench of a contact, for control at the level of dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from wbc.core.errors import Array, InputError, finite_array, unknown_name
from wbc.core.qp.contact import AXES, Contact
from wbc.core.qp.problem import Problem
from wbc.core.qp.task import VariableTask, read_only
from wbc.tasks.motion.axes import axis_mask
from wbc.tasks.options import TaskOptions


class WrenchTask(VariableTask):
    """Bring the wrench of one contact to a target.

    Rows and residual are along the chosen axes of the contact frame, N and Nm; the weight is a cost per N² and (Nm)²,
    10⁻³ by default. The wrench is what the ground does to the robot. It is instantaneous: there is no stiffness, and no
    damping. A contact that is off has zero wrench, whatever the target.
    """

    unit = "N|Nm"

    def __init__(
        self,
        contact: Contact | str,
        target: ArrayLike | None = None,
        *,
        axes: Sequence[str] | None = None,
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
        size = contact.dim if isinstance(contact, Contact) else len(AXES)
        rest: dict[str, Any] = {"weight": 1e-3, **options}
        name = rest.pop("name", None) or f"{self.contact} wrench"
        mask = axis_mask(name, AXES[:size] if axes is None else axes, AXES[:size])
        self._axes = np.flatnonzero(mask)
        super().__init__(name, self._axes.size, **rest)
        self._size = size
        self.target = np.zeros(size) if target is None else target

    @property
    def contact(self) -> str:
        """Name of the contact."""
        return self._contact.name if isinstance(self._contact, Contact) else self._contact

    @property
    def target(self) -> Array:
        """Force variables in the contact frame, shape (6,), or (3,) for a point contact, N and Nm, read-only."""
        return read_only(self._target)

    @target.setter
    def target(self, value: ArrayLike) -> None:
        target = finite_array(f"target of task '{self.name}' (N, Nm)", value, (self._size,))
        if self._held:
            self._take_over()
        self._target = target

    def follow(self, target: Array) -> None:
        """Set the target for one tick, unchecked: for a controller that makes it itself.

        Args:
            target: As `target`, shape (6,) or (3,), N and Nm; kept, not copied.
        """
        self._target = target

    def waits_for(self) -> object | None:
        """Return the contact, where the task was given it and not its name."""
        return self._contact if isinstance(self._contact, Contact) else None

    def bind_problem(self, problem: Problem) -> None:
        """Find the force variables of the contact.

        Raises:
            UnknownNameError: The controller has no such contact.
            InputError: The contact has another number of force variables.
        """
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

    def evaluate(self, matrix: Array, reference: Array) -> None:
        """Fill the rows; see `VariableTask.evaluate`."""
        matrix[self._order, self._columns] = 1.0
        reference[:] = self._target[self._axes]
