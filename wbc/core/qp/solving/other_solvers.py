"""Solvers of a QP: DAQP called directly on two-sided rows, and any dense solver of qpsolvers for cross-checks."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import daqp
import numpy as np
import qpsolvers

from wbc.base.numbers import Array
from wbc.core.qp.solving.problem import Problem

logger = logging.getLogger(__name__)

EQUALITY, FREE, AT_UPPER, AT_LOWER, YIELDING = 5, 0, 1, 3, 8
"""Flags of DAQP's `sense`: an equality, an inequality, those that are guessed to be active, and one with slack."""

UNBOUNDED = 1e30
"""Bound that DAQP takes for none."""

MAX_ITERATIONS = 1000
"""Changes of the active set after which DAQP gives up; a tick with a hundred rows takes 10 to 60."""


SLACK = 1e-4
"""Violation of an inequality that yields to the costs alone, as a share of what they would have of it."""

Mask = np.ndarray[tuple[int], np.dtype[np.bool_]]


@dataclass(frozen=True, slots=True)
class Relaxed:
    """Rows of a problem that are costs in place of constraints.

    Attributes:
        equalities: Mask, shape (n_eq,).
        inequalities: Mask, shape (n_in,).
        cost: Cost per squared violation of an equality.
    """

    equalities: Mask
    inequalities: Mask
    cost: float


class DaqpSolver:
    """DAQP on one problem whose numbers change, with arrays that are reused.

    DAQP is an exact dual active-set method; the same numbers give the same solution, bit for bit.

    Attributes:
        iterations: Iterations of the last solve.
    """

    def __init__(self, problem: Problem, tolerance: float) -> None:
        """Prepare for a problem, whose arrays are read by every `solve`; the tolerance is that of a row."""
        self._problem, self._tolerance = problem, tolerance
        rows = problem.n_eq + problem.lower.size
        self._rows = np.zeros((rows, problem.diagonal.size))
        self._upper, self._lower = np.zeros(rows), np.zeros(rows)
        self._sense = np.zeros(rows, dtype=np.intc)
        self.iterations = 0

    def solve(
        self, hessian: Array, gradient: Array, guess: Array, relaxed: Relaxed | None = None
    ) -> tuple[Array, Array, Array] | None:
        """Solve the problem with its Hessian, shape (n, n), and gradient, shape (n,), from a guess of the active set.

        The guess are multipliers of the inequalities, shape (n_in,): those that are not zero are tried first.
        All rows are constraints but those that are relaxed. Returned are the solution, and multipliers of the
        equalities and of the inequalities; None without a solution.
        """
        p, n_eq = self._problem, self._problem.n_eq
        rows, upper, lower, sense = self._rows, self._upper, self._lower, self._sense
        rows[:n_eq], rows[n_eq:] = p.equality, p.inequality
        upper[:n_eq] = lower[:n_eq] = p.equality_target
        upper[n_eq:], lower[n_eq:] = p.upper, p.lower
        sense[:n_eq], sense[n_eq:] = EQUALITY, FREE
        if p.empty is not None:  # rows 0 = 0, which DAQP would find dependent
            self._free(np.flatnonzero(p.empty))
        active = guess.nonzero()[0]
        sense[n_eq:][active] = np.where(guess[active] > 0.0, AT_UPPER, AT_LOWER)
        if relaxed is not None:
            given = relaxed.equalities.nonzero()[0]
            soft, target = p.equality[given], p.equality_target[given]
            hessian = hessian + relaxed.cost * np.dot(soft.T, soft)
            gradient = gradient - relaxed.cost * np.dot(target, soft)
            self._free(given)
            sense[n_eq:][relaxed.inequalities] = YIELDING
        x, _, flag, info = daqp.solve(
            hessian,
            gradient,
            rows,
            upper,
            lower,
            sense,
            primal_tol=self._tolerance,
            iter_limit=MAX_ITERATIONS,
            rho_soft=SLACK,
        )
        self.iterations = int(info["iterations"])
        if flag < 1:
            return None
        return x, info["lam"][:n_eq], info["lam"][n_eq:]

    def _free(self, rows: np.ndarray[tuple[int], np.dtype[np.intp]]) -> None:
        self._sense[rows] = FREE
        self._upper[rows], self._lower[rows] = UNBOUNDED, -UNBOUNDED


def solve_by_qpsolvers(
    name: str, problem: Problem, hessian: Array, gradient: Array, tolerance: float = 1e-6
) -> tuple[Array, Array] | None:
    """Solve with any solver of qpsolvers, which splits two-sided rows into one-sided ones.

    The tolerance is the largest absolute residual of ProxQP, whose own of 1e-3 is coarse; others have theirs.
    Returned are the solution, shape (n,), and multipliers of the inequalities, shape (n_in,); None without a solution.
    """
    try:
        options = {"eps_abs": tolerance, "eps_rel": 0.0} if name == "proxqp" else {}
        solution = qpsolvers.solve_problem(standard_form(problem, hessian, gradient), name, **options)
    except (qpsolvers.QPError, ValueError, ArithmeticError) as error:
        logger.warning("%s failed: %s", name, error)
        return None
    if not solution.found or solution.x is None:
        return None
    multipliers = np.zeros(problem.lower.size)
    if solution.z is not None:
        above, below = problem.upper < 1e20, problem.lower > -1e20
        multipliers[above] += solution.z[: above.sum()]
        multipliers[below] -= solution.z[above.sum() :]
    return solution.x, multipliers


def standard_form(
    p: Problem, hessian: Array | None = None, gradient: Array | None = None
) -> qpsolvers.Problem:
    """Return a problem in the form of qpsolvers, for cross-checks; Hessian and gradient if computed already."""
    above, below = p.upper < 1e20, p.lower > -1e20
    return qpsolvers.Problem(
        p.hessian if hessian is None else hessian,
        p.gradient if gradient is None else gradient,
        np.vstack([p.inequality[above], -p.inequality[below]]),
        np.concatenate([p.upper[above], -p.lower[below]]),
        np.array(p.equality),
        np.array(p.equality_target),
    )
