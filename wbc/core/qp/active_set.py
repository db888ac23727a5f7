"""Active-set solver of a tick's QP, which starts from the active set of the tick before.

Between two ticks the set of active inequalities hardly ever changes. Given that set, the QP is a linear system; with
the structure of `Problem` it is a small symmetric one, and checking the result (all rows within their bounds, all
multipliers of the right sign) proves that it is the exact solution.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg.lapack import dposv, dpotrs

from wbc.base.numbers import ROUNDING, Array, scalar
from wbc.base.vectors import largest
from wbc.core.qp.problem import Problem

_ONE, _SMALLEST_WEIGHT = scalar(1.0), scalar(1e-12)


class ActiveSet:
    """Solver of a QP from a guess of its active inequalities, which it proves or corrects.

    With rows R (equalities, soft rows, active inequalities), targets t and the diagonal D, the solution is

        x = D⁻¹ (linear + Rᵀ λ),   (R D⁻¹ Rᵀ + W⁻¹) λ = t − R D⁻¹ linear,

    where W⁻¹ holds the inverse weights of the soft rows and zeros elsewhere: a system of a few dozen unknowns.
    Corrections follow the primal–dual active set method (Hintermüller, Ito, Kunisch, SIAM J. Optim. 13(3), 2002).

    A solve that fails leaves the last solution as it is.

    Attributes:
        x: Solution, shape (n,); another array after every solve.
        values: All rows times x, shape (number of rows,); another array after every solve.
        multipliers: Multipliers of the inequalities, shape (n_in,), positive where the upper bound is active.
        iterations: Number of systems solved by the last `solve`.
    """

    def __init__(self, problem: Problem, tolerance: float, changes: int) -> None:
        """Start with no inequality active; `solve` reads the problem's arrays, correcting the set `changes` times."""
        self._p = p = problem
        self._tolerance, self._changes = tolerance, changes
        self._n_linear = p.n_eq + p.n_soft
        n, m = p.diagonal.size, self._n_linear
        self.x, self.values = np.zeros(n), np.zeros(p.rows.shape[0])
        self._x, self._values = np.zeros(n), np.zeros(p.rows.shape[0])  # under trial
        self._force = np.zeros(m)
        self.multipliers = np.zeros(p.lower.size)
        self.iterations = 0
        self._active = np.zeros(0, dtype=np.intp)
        self._upper_side = np.zeros(0, dtype=bool)
        self._inverse, self._base = np.zeros(n), np.zeros(n)
        self._linear_rows, self._scaled = p.rows[:m], np.zeros((m, n))
        self._linear_rows_t = self._linear_rows.T
        self._hard_target = p.target[: p.n_eq]
        self._gram = np.zeros((m, m))
        self._soft_diagonal = slice(p.n_eq * (m + 1), m * m, m + 1)
        self._excess, self._shortfall = np.zeros(p.lower.size), np.zeros(p.lower.size)
        self._soft_inverse, self._error = np.zeros(p.n_soft), np.zeros(p.n_eq)

    def guess(self, multipliers: Array) -> None:
        """Take the active set from the multipliers of another solver, shape (n_in,)."""
        threshold = 1e-8 * max(1.0, float(np.abs(multipliers).max(initial=0.0)))
        self._active = (np.abs(multipliers) > threshold).nonzero()[0]
        self._upper_side = multipliers[self._active] > 0.0

    def solve(self) -> bool:
        """Solve; return True if `x` is proved to be the solution."""
        p = self._p
        np.divide(_ONE, p.diagonal, out=self._inverse)
        np.multiply(self._inverse, p.linear, out=self._base)
        np.maximum(p.soft_weight, _SMALLEST_WEIGHT, out=self._soft_inverse)
        np.divide(_ONE, self._soft_inverse, out=self._soft_inverse)
        for iteration in range(1, self._changes + 2):
            self.iterations = iteration
            if not self._step():
                break
            wrong = self._check()
            if wrong is None:
                break
            if not wrong:
                self.x, self._x, self.values, self._values = self._x, self.x, self._values, self.values
                return True
        self._active, self._upper_side = self._active[:0], self._upper_side[:0]
        return False

    def _step(self) -> bool:
        """Solve for the present set; return False if its rows are dependent or the result is inexact."""
        p, active, m = self._p, self._active, self._n_linear
        if active.size:
            rows = np.concatenate((self._linear_rows, p.inequality[active]))
            target = np.concatenate((p.target, np.where(self._upper_side, p.upper[active], p.lower[active])))
            if not math.isfinite(target.dot(target)):
                return False  # an active bound has become infinite
            scaled = rows * self._inverse
            gram = scaled.dot(rows.T)
            diagonal = gram.reshape(-1)[:: gram.shape[0] + 1]
            diagonal[p.n_eq : m] += self._soft_inverse
        else:
            rows, target, scaled, gram = self._linear_rows, p.target, self._scaled, self._gram
            np.multiply(rows, self._inverse, out=scaled)
            scaled.dot(self._linear_rows_t, out=gram)
            gram.reshape(-1)[self._soft_diagonal] += self._soft_inverse
        if p.empty is not None:
            gram.reshape(-1)[: p.n_eq * (gram.shape[0] + 1) : gram.shape[0] + 1] += p.empty
        if not target.size:
            self._x[:] = self._base
            self._force = target
            p.rows.dot(self._x, out=self._values)
            return True
        force = rows.dot(self._base)
        factor, force, info = dposv(
            gram.T, np.subtract(target, force, out=force), overwrite_a=True, overwrite_b=True
        )
        if info != 0:
            return False
        x, values, n_eq, tolerance = self._x, self._values, p.n_eq, self._tolerance
        for _ in range(3):  # the second and third are refinements, for states with large accelerations
            force.dot(scaled, out=x)
            x += self._base
            p.rows.dot(x, out=values)
            short = np.subtract(self._hard_target, values[:n_eq], out=self._error)
            if not n_eq or (short[short.argmax()] <= tolerance and short[short.argmin()] >= -tolerance):
                self._force = force
                return True
            error = target - rows.dot(x)
            error[n_eq:m] -= force[n_eq:m] * self._soft_inverse
            force = force + dpotrs(factor, error)[0]
        return False

    def _check(self) -> bool | None:
        """Correct the set; return True if that was needed, False if it is right, None if it cannot be corrected."""
        p, active, tolerance = self._p, self._active, self._tolerance
        values, excess, shortfall = self._values[self._n_linear :], self._excess, self._shortfall
        np.subtract(values, p.upper, out=excess)
        np.subtract(p.lower, values, out=shortfall)
        violated = not (largest(excess) <= tolerance and largest(shortfall) <= tolerance)
        if not active.size:
            if not violated:
                self.multipliers.fill(0.0)
                return False
            kept, kept_side = active, self._upper_side
        else:
            force = self._force[self._n_linear :]
            forces = np.where(self._upper_side, -force, force)
            wrong = forces < 0.0
            wrong &= p.upper[active] - p.lower[active] > ROUNDING
            if not (violated or wrong.any()):
                self.multipliers.fill(0.0)
                self.multipliers[active] = -force
                return False
            kept, kept_side = active[~wrong], self._upper_side[~wrong]
        excess[active] = shortfall[active] = -1.0
        above, below = (excess > tolerance).nonzero()[0], (shortfall > tolerance).nonzero()[0]
        self._active = np.concatenate([kept, above, below])
        self._upper_side = np.concatenate([kept_side, np.ones(above.size, bool), np.zeros(below.size, bool)])
        return None if self._active.size + p.n_eq > p.diagonal.size else True
