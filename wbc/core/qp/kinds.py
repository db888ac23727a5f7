"""Tasks whose rows are not over a motion: on single coordinates, and on torques and wrenches."""

from __future__ import annotations

from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.qp.solving.problem import Problem
from wbc.core.qp.task import Task


class SelectionTask(Task):
    """Base of tasks whose rows select single coordinates: they only change the diagonal of the QP's cost.

    `evaluate` fills only the error. Each row has its own error bound.

    Attributes:
        columns: Velocity coordinates of the rows, distinct, shape (dim,) or a slice; `bind` sets them.
    """

    __slots__ = ()
    columns: slice | NDArray[np.intp]
    _over_joints = False

    def _unfilled(self) -> Array:
        return np.eye(self.robot.nv)[self.columns]

    def saturate(self, error: Array) -> None:
        """Clip each component of an error, shape (dim,), `unit`, to its bound."""
        bound = self._numbers.bound
        np.minimum(np.maximum(error, -bound, out=error), bound, out=error)

    def _sizes(self, rows: Array) -> list[float]:
        """Greatest component of some rows."""
        return [float(abs(rows).max())]


class VariableTask(Task):
    """Base of tasks on torques and wrenches: rows over all variables x of the QP, matrix · x = reference.

    `evaluate` fills the matrix, shape (dim, number of variables), in place of the Jacobian, and the reference, shape
    (dim,), in place of the error.
    """

    __slots__ = ()
    _over_joints = False

    @property
    def residual_unit(self) -> str:
        """Unit of the residual: that of the variables."""
        return self.unit

    def evaluated(self) -> NoReturn:
        """Refuse: the rows are not over accelerations."""
        raise InputError(f"task '{self.name}' is on variables of the QP: it has neither error nor speed")

    def try_on(self, problem: Problem) -> None:
        """Evaluate the rows once over the variables of a problem, so that mistakes show before the first tick."""
        self.bind_problem(problem)
        with self._guarded():
            self.evaluate(np.zeros((self.dim, problem.diagonal.size)), np.zeros(self.dim), np.zeros((0, 0)))

    def bind_problem(self, problem: Problem) -> None:  # noqa: B027 (optional)
        """Look up contacts or torque rows; called after each change of the QP's layout.

        A task whose contact is not in the QP raises an `UnknownNameError`; it has no effect until the contact is added.
        """

    def waits_for(self) -> object | None:
        """Return the contact of the task if it may be added after the task; None otherwise."""
        return None
