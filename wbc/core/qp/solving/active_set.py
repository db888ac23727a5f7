"""Active-set solver of a tick's QP, which starts from the active set of the tick before.

Between two ticks the set of active inequalities hardly ever changes. Given that set, the QP is a linear system; with
the structure of `Problem` it is a small symmetric one, and checking the result (all rows within their bounds, all
multipliers of the right sign) proves that it is the exact solution.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg.lapack import dposv, dpotrs

from wbc.base.numbers import ROUNDING, Array, read_only, scalar
from wbc.base.vectors import largest
from wbc.core.qp.solving.problem import Problem

_ONE, _SMALLEST_WEIGHT = scalar(1.0), scalar(1e-12)


class _Work:
    """Arrays of systems of one size: their rows, scaled rows, products of these, and views.

    Attributes:
        rows: [linear; R], shape (1 + m, n); `rows_t` is Rᵀ.
        scaled: [linear; R] D⁻¹, shape (1 + m, n).
        products: `scaled` times Rᵀ, shape (1 + m, m).
        of_linear: Its first row, R D⁻¹ linear.
        matrix_t: The others, transposed: symmetric, stored by columns.
        hard_diagonal: Diagonal of the matrix at the equalities.
        soft_diagonal: Diagonal of the matrix at the soft rows.
        shares: [1, λ], shape (1 + m,); `force` is λ.
    """

    __slots__ = (
        "force", "hard_diagonal", "matrix_t", "of_linear", "products", "rows", "rows_t", "scaled", "shares",
        "soft_diagonal",
    )  # fmt: skip

    def __init__(self, rows: Array, n_eq: int, n_linear: int) -> None:
        m = rows.shape[0] - 1
        self.rows, self.rows_t, self.scaled = rows, rows[1:].T, np.zeros(rows.shape)
        self.products = products = np.zeros((m + 1, m))
        self.of_linear, self.matrix_t = products[0], products[1:].T
        diagonal = products.reshape(-1)[m :: m + 1]
        self.hard_diagonal, self.soft_diagonal = diagonal[:n_eq], diagonal[n_eq:n_linear]
        self.shares = np.ones(m + 1)
        self.force = self.shares[1:]


class ActiveSet:
    """Solver of a QP from a guess of its active inequalities, which it proves or corrects.

    With rows R (equalities, soft rows, active inequalities), targets t and the diagonal D, the solution is

        x = D⁻¹ (linear + Rᵀ λ),   (R D⁻¹ Rᵀ + W⁻¹) λ = t − R D⁻¹ linear,

    where W⁻¹ holds the inverse weights of the soft rows and zeros elsewhere: a system of a few dozen unknowns.
    Corrections follow the primal–dual active set method (Hintermüller, Ito, Kunisch, SIAM J. Optim. 13(3), 2002).

    A solve that fails leaves the last solution as it is.

    Attributes:
        x: Solution, shape (n,); a new array after every solve, as those below.
        values: All rows times x, shape (number of rows,).
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
        self._x, self._values = self.x, self.values  # under trial
        self.multipliers = self._no_multipliers = read_only(np.zeros(p.lower.size))
        self.iterations = 0
        self._active = np.zeros(0, dtype=np.intp)
        self._upper_side = np.zeros(0, dtype=bool)
        self._inverse = np.zeros(n)
        self._hard_target = p.target[: p.n_eq]
        # By the number of active inequalities.
        self._works = {0: _Work(p.linear_and_rows, p.n_eq, m)}
        self._force = self._works[0].force
        self._excess, self._shortfall = np.zeros(p.lower.size), np.zeros(p.lower.size)
        self._soft_inverse, self._error = np.zeros(p.n_soft), np.zeros(p.n_eq)
        self._weights = b"none"  # of the soft rows, for which their inverse is

    def guess(self, multipliers: Array) -> None:
        """Take the active set from the multipliers of another solver, shape (n_in,)."""
        threshold = 1e-8 * max(1.0, float(np.abs(multipliers).max(initial=0.0)))
        self._active = (np.abs(multipliers) > threshold).nonzero()[0]
        self._upper_side = multipliers[self._active] > 0.0

    def solve(self) -> bool:
        """Solve; return True if `x` is proved to be the solution."""
        p = self._p
        np.divide(_ONE, p.diagonal, out=self._inverse)
        weights = p.soft_weight.tobytes()
        if weights != self._weights:
            self._weights = weights
            np.divide(_ONE, np.maximum(p.soft_weight, _SMALLEST_WEIGHT), out=self._soft_inverse)
        for iteration in range(1, self._changes + 2):
            self.iterations = iteration
            if not self._step():
                break
            wrong = self._check()
            if wrong is None:
                break
            if not wrong:
                self.x, self.values = self._x, self._values
                return True
        self._active, self._upper_side = self._active[:0], self._upper_side[:0]
        return False

    def _step(self) -> bool:
        """Solve for the present set; return False if its rows are dependent or the result is inexact.

        Of the scaled rows [linear; R] D⁻¹ one product with Rᵀ gives R D⁻¹ linear and the matrix of the system, and one
        with [1, λ] the solution.
        """
        p, active, n_eq, target = self._p, self._active, self._p.n_eq, self._p.target
        if active.size:
            target = np.concatenate((target, np.where(self._upper_side, p.upper[active], p.lower[active])))
            if not math.isfinite(target.dot(target)):
                return False  # an active bound has become infinite
        work = self._works.get(active.size)
        if work is None:  # its arrays are kept for further ticks
            rows = np.zeros((1 + self._n_linear + active.size, self._inverse.size))
            work = self._works[active.size] = _Work(rows, n_eq, self._n_linear)
        rows, rows_t, scaled = work.rows, work.rows_t, work.scaled
        if active.size:
            np.concatenate((p.linear_and_rows, p.inequality[active]), out=rows)
        scaled[:] = self._inverse  # arrays of one shape take NumPy half the time
        np.multiply(rows, scaled, out=scaled)
        scaled.dot(rows_t, out=work.products)
        work.soft_diagonal += self._soft_inverse
        if p.empty is not None:
            work.hard_diagonal += p.empty
        self._force = force = work.force
        np.subtract(target, work.of_linear, out=force)
        if target.size:
            factor, _, info = dposv(work.matrix_t, force, overwrite_a=True, overwrite_b=True)
            if info != 0:
                return False
        for _ in range(3):  # the second and third are refinements, for states with large accelerations
            self._x = x = work.shares.dot(work.scaled)
            self._values = values = p.rows.dot(x)
            if not n_eq:  # rows, if there are any, show that x is finite
                return bool(p.lower.size) or math.isfinite(x.dot(x))
            short = np.subtract(self._hard_target, values[:n_eq], out=self._error)
            if short[short.argmax()] <= self._tolerance and short[short.argmin()] >= -self._tolerance:
                return True
            error = target - x.dot(rows_t)
            error[n_eq : self._n_linear] -= force[n_eq : self._n_linear] * self._soft_inverse
            force += dpotrs(factor, error)[0]
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
                self.multipliers = self._no_multipliers
                return False
            kept, kept_side = active, self._upper_side
        else:
            force = self._force[self._n_linear :]
            forces = np.where(self._upper_side, -force, force)
            wrong = forces < 0.0
            if wrong[wrong.argmax()]:  # bounds that are equal press in either direction
                wrong &= p.upper[active] - p.lower[active] > ROUNDING
            if not (violated or wrong[wrong.argmax()]):
                self.multipliers = np.zeros(p.lower.size)
                self.multipliers[active] = -force
                return False
            kept, kept_side = active[~wrong], self._upper_side[~wrong]
        excess[active] = shortfall[active] = -1.0
        above, below = (excess > tolerance).nonzero()[0], (shortfall > tolerance).nonzero()[0]
        self._active = np.concatenate([kept, above, below])
        self._upper_side = np.concatenate([kept_side, np.ones(above.size, bool), np.zeros(below.size, bool)])
        return None if self._active.size + p.n_eq > p.diagonal.size else True
