"""Strict priorities: one QP for each level of tasks, in order, each in the null space of those above.

    start     the constraints with the first level as cost and a trace of regularisation                    → x_0
    level k   minimise ½ Σ_k weight · (row · x − target)²   with x = x_{k−1} + N u, u subject to the bounds → x_k

The columns of N span the null space of the equalities and of the rows of all levels above, so that nothing of theirs
can change. u = 0 satisfies the bounds: a level always has a solution. Often it is the only one, as more bounds are
tight than freedom is left; DAQP gives up at such a vertex, and a non-negative least-squares problem proves it optimal.
Regularisation, wrench costs and selections on the diagonal belong to the last level; in the others they would leak into
tasks.

Sources: O. Kanoun, F. Lamiraux, P.-B. Wieber, IEEE T-RO 27(4), 2011 (levels with inequalities); M. de Lasa,
I. Mordatch, A. Hertzmann, ACM TOG 29(4), 2010 (null spaces).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import daqp
import numpy as np
from scipy.linalg.lapack import dgeqp3, dormqr, dposv, dtrtrs
from scipy.optimize import nnls

from wbc.core.errors import Array
from wbc.core.qp.other_solvers import AT_LOWER, AT_UPPER, MAX_ITERATIONS
from wbc.core.qp.problem import Problem
from wbc.core.qp.solver import QpSolver, SolverSettings, Status, without_solution
from wbc.core.vectors import largest

TRACE = 1e-6
"""Cost of every variable at the start."""

PROXIMAL = (1e-8, 1e-6, 1e-4, 1e-2, 1.0)
"""Proximal terms that are tried in levels whose cost leaves directions free: without one DAQP calls some of them
infeasible. They do not change the solution."""

LAST_PROXIMAL = (0.0, 1e-4, 1e-2, 1.0)
"""Proximal terms that are tried in the last level."""

ROOM = 1e-8
"""Violation of a bound that is let pass."""

ACCEPTED = 1e-6
"""Violation of a bound that is let pass in a solution of DAQP, and distance at which a bound is tight."""

OPTIMAL = 1e-6
"""Largest part of a gradient that no tight bound has to balance where staying counts as optimal."""

INDEPENDENT = 1e-9
"""Least part of a row, against the largest, that others do not imply."""


class LevelSolver:
    """Solver of a QP whose soft rows stand in levels, with the results of `QpSolver`.

    Attributes:
        x: Solution of the last `solve`, shape (n,).
        values: All rows of the problem times x.
        multipliers: Multipliers of the inequalities in the last level, shape (n_in,), positive at the upper bound.
        iterations: Iterations of all levels together.
        counts: Number of ticks that each step of the ladder has solved, of the first level; and of lower levels that
            changed nothing as DAQP gave up.
    """

    def __init__(self, problem: Problem, dims: Sequence[int], settings: SolverSettings | None = None) -> None:
        """Make the QP of the first level.

        Args:
            problem: The problem; its arrays are read by every `solve`, its soft rows stand in the order of the levels.
            dims: Number of soft rows of each level, the highest priority first; two levels at least.
            settings: Settings of the first level's solver.
        """
        self.problem = p = problem
        n, n_in = p.diagonal.size, p.lower.size
        self._first = first = Problem(p.nv, p.na, n, p.n_eq, dims[0], n_in)
        first.lower, first.upper, first.n_physics, first.contacts = p.lower, p.upper, p.n_physics, p.contacts
        first.soft_weight, first.diagonal[:] = p.soft_weight[: dims[0]], TRACE
        self._first_target = p.target[: p.n_eq + dims[0]]
        self._solver = QpSolver(first, settings)
        ends = np.cumsum(dims)
        self._levels = [slice(int(end - dim), int(end)) for dim, end in zip(dims, ends, strict=True)]
        self._guesses = [np.zeros(n_in) for _ in dims]
        self._sense = np.zeros(n_in, dtype=np.intc)
        self.x, self.values, self.multipliers = np.zeros(n), np.zeros(p.rows.shape[0]), np.zeros(n_in)
        self.iterations = self._given_up = 0

    @property
    def counts(self) -> dict[str, int]:
        """Number of ticks that each step of the ladder has solved, of the first level."""
        return self._solver.counts | {"levels given up": self._given_up}

    def solve(self) -> Status:
        """Solve level after level; the status is that of the first one unless a row is not finite."""
        p, first, solver = self.problem, self._first, self._solver
        hopeless = without_solution(p)  # the first level sees the targets of its own rows alone
        if hopeless is not None:
            return hopeless
        end = first.n_eq + first.n_soft
        first.rows[:end], first.inequality[:] = p.rows[:end], p.inequality
        first.target[:], first.empty = self._first_target, p.empty
        status = solver.solve()
        self.iterations = solver.iterations
        if not status.ok:
            return status
        self.multipliers[:] = 0.0
        x, basis = solver.x, null_space(p.equality)[1]
        values = p.inequality.dot(x)
        for k, rows in enumerate(self._levels):
            if not basis.shape[1]:
                break
            last = k == len(self._levels) - 1
            weight = p.soft_weight[rows]
            acting = weight > 0.0  # a task without weight binds no lower level
            soft, target = p.soft[rows][acting], p.target[p.n_eq :][rows][acting]
            moved, wanted = soft.dot(basis), target - soft.dot(x)
            if last:
                step = self._last_step(x, values, basis, moved, wanted, weight[acting], self._guesses[k])
            else:
                lengths = np.linalg.norm(soft, axis=1)
                least, free = null_space(moved, wanted, float(lengths.max(initial=0.0)))
                if free.shape[1] == basis.shape[1]:
                    continue  # the levels above leave it nothing to decide
                if least is not None and self._holds(values, basis.dot(least)):
                    step = least
                else:
                    hessian = moved.T.dot(moved * weight[acting][:, None])
                    gradient = -moved.T.dot(weight[acting] * wanted)
                    step = self._by_daqp(hessian, gradient, values, basis, self._guesses[k], PROXIMAL)
            x = x + basis.dot(step)
            if not last:
                values, basis = p.inequality.dot(x), basis.dot(free)
        p.rows.dot(x, out=self.values)
        if not math.isfinite(self.values.dot(self.values)):  # a row of a lower level is not
            for guess in self._guesses:
                guess.fill(0.0)
            return Status.REFUSED
        self.x = x
        return status

    def _holds(self, values: Array, step: Array) -> bool:
        """Return True if the bounds hold after a step; `values` are the inequalities before it."""
        p = self.problem
        after = p.inequality.dot(step)
        after += values
        return largest(after - p.upper) <= ROOM and largest(p.lower - after) <= ROOM

    def _last_step(
        self, x: Array, values: Array, basis: Array, moved: Array, wanted: Array, weight: Array, guess: Array
    ) -> Array:
        """Return the step of the last level along the columns of a basis, shape (columns,)."""
        p = self.problem
        hessian = moved.T.dot(moved * weight[:, None])
        hessian += basis.T.dot(basis * p.diagonal[:, None])
        gradient = basis.T.dot(p.diagonal * x - p.linear)
        gradient -= moved.T.dot(weight * wanted)
        if not guess.any():  # none of the bounds acted in the last tick
            _, step, info = dposv(hessian, -gradient)
            if info == 0 and self._holds(values, basis.dot(step)):
                self.multipliers[:] = 0.0
                return np.asarray(step)
        step = self._by_daqp(hessian, gradient, values, basis, guess, LAST_PROXIMAL)
        self.multipliers[:] = guess
        return step

    def _by_daqp(
        self,
        hessian: Array,
        gradient: Array,
        values: Array,
        basis: Array,
        guess: Array,
        proximal: Sequence[float],
    ) -> Array:
        """Return the step that minimises a cost inside the bounds, shape (columns,); zero if DAQP gives up."""
        p = self.problem
        self._sense[:] = 0
        active = guess.nonzero()[0]
        self._sense[active] = np.where(guess[active] > 0.0, AT_UPPER, AT_LOWER)
        matrix = np.ascontiguousarray(p.inequality.dot(basis))
        upper, lower = np.maximum(p.upper - values, 0.0), np.minimum(p.lower - values, 0.0)
        for term in proximal:
            step, _, flag, info = daqp.solve(
                hessian, gradient, matrix, upper, lower, self._sense, iter_limit=MAX_ITERATIONS, eps_prox=term
            )
            self.iterations += int(info["iterations"])
            if flag >= 1:
                after = matrix.dot(step)
                if largest(after - upper) <= ACCEPTED and largest(lower - after) <= ACCEPTED:
                    guess[:] = info["lam"]
                    return np.asarray(step)
            if term == proximal[0] and _is_optimal(gradient, matrix, upper, lower, guess):
                return np.zeros(gradient.size)
            self._sense[:] = 0
        self._given_up += 1
        guess[:] = 0.0
        return np.zeros(gradient.size)


def _is_optimal(gradient: Array, matrix: Array, upper: Array, lower: Array, multipliers: Array) -> bool:
    """Return True, and write the multipliers, if tight bounds leave no step from zero that lowers a cost.

    Args:
        gradient: Gradient of the cost at zero, shape (n,).
        matrix: Rows of the bounds, shape (m, n).
        upper: Upper bounds, not below zero, shape (m,).
        lower: Lower bounds, not above zero, shape (m,).
        multipliers: Where the multipliers are written, shape (m,), positive at upper bounds.
    """
    above, below = np.flatnonzero(upper <= ACCEPTED), np.flatnonzero(lower >= -ACCEPTED)
    if not above.size + below.size:
        return False
    try:
        pushes, rest = nnls(np.vstack([matrix[above], -matrix[below]]).T, -gradient)
    except (RuntimeError, ValueError):  # too many iterations; NaN
        return False
    if rest > OPTIMAL * math.sqrt(gradient.dot(gradient)):
        return False
    multipliers[:] = 0.0
    multipliers[above] += pushes[: above.size]
    multipliers[below] -= pushes[above.size :]
    return True


def null_space(rows: Array, wanted: Array | None = None, length: float = 0.0) -> tuple[Array | None, Array]:
    """Return the least vector that rows take to what is wanted, and an orthonormal basis of those they take to zero.

    Args:
        rows: Shape (m, n).
        wanted: Shape (m,); zero when None.
        length: Length of the longest row before the rows were brought into this space: what is left of one that others
            imply is rounding, however short all of them are.

    Returns:
        The vector, shape (n,), None if the rows are dependent; the basis, shape (n, n − rank).
    """
    count, n = rows.shape
    if not count:
        return np.zeros(n), np.eye(n)
    factor, order, tau, _, _ = dgeqp3(rows.T)
    diagonal = np.abs(factor.diagonal())
    least = INDEPENDENT * max(float(diagonal[0]), length)
    rank = int((diagonal > least).sum())
    columns = np.zeros((n, n - rank + 1), order="F")
    columns.reshape(-1, order="F")[n + rank :: n + 1] = 1.0
    solved = rank == count
    if solved and wanted is not None:
        columns[:rank, 0] = dtrtrs(factor[:rank], wanted[order - 1], trans=1)[0]
    found, _, _ = dormqr("L", "N", factor[:, : tau.size], tau, columns, 64 * n)
    return (found[:, 0] if solved else None), found[:, 1:]
