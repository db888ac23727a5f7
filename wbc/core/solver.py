"""The quadratic program's solver: a persistent ProxQP object and what to do when it fails.

    minimise ½ xᵀ H x + gᵀ x   subject to   A x = b,   l ≤ C x ≤ u

The ladder: the persistent object, warm-started by its last result; a fresh object without a guess; DAQP, an exact
active-set method; nothing. A solution is used only if its primal residual, computed here, is small: ProxQP has been
seen to report PROXQP_SOLVED with a residual of 890 (WARM_START_WITH_PREVIOUS_RESULT, proxsuite 0.7.2).
"""

from __future__ import annotations

import enum
import logging
import math
from dataclasses import dataclass

import numpy as np
import proxsuite
import qpsolvers

from wbc.core.errors import Array, positive

logger = logging.getLogger(__name__)


class Status(enum.Enum):
    """How a tick's problem was solved, if at all."""

    SOLVED = "solved"
    """By the persistent solver."""
    RECOVERED = "recovered"
    """By a fresh solver without a guess."""
    FALLBACK = "fallback"
    """By DAQP."""
    INFEASIBLE = "infeasible"
    """Not at all: hard constraints contradict each other, or every solver gave up."""
    REFUSED = "refused"
    """Not tried: the problem holds NaN or infinity."""

    @property
    def ok(self) -> bool:
        """True if there is a solution."""
        return self in (Status.SOLVED, Status.RECOVERED, Status.FALLBACK)


@dataclass(frozen=True)
class SolverSettings:
    """Settings of ProxQP; the defaults are measured on streams of humanoid problems.

    Attributes:
        tolerance: Largest primal and dual residual, absolute: m/s², N and Nm. Below 1e-9 ProxQP shows outliers.
        residual_tolerance: Largest primal residual accepted of any solver.
        max_iterations: Outer iterations; with the inner ones, the only time limit that ProxQP has.
        max_inner_iterations: Iterations of each inner problem.
        equality_penalty: Proximal parameter μ of the equalities. With ProxQP's default 1e-3 most problems need
            two outer iterations, with 1e-7 one: 49 µs against 37 µs for 50 variables, 18 equalities, 96 rows.
    """

    tolerance: float = 1e-6
    residual_tolerance: float = 1e-5
    max_iterations: int = 100
    max_inner_iterations: int = 100
    equality_penalty: float = 1e-7

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            positive(f"solver setting '{name}'", getattr(self, name))


class QpSolver:
    """One problem of fixed size, solved again and again.

    Attributes:
        x: Solution of the last `solve`, shape (n,); overwritten by the next one.
        z: Multipliers of the inequality rows, shape (n_in,); positive where the upper bound pushes.
        rows: C x, shape (n_in,).
        iterations: Outer iterations of the last solve.
    """

    def __init__(self, n: int, n_eq: int, n_in: int, settings: SolverSettings | None = None) -> None:
        """Prepare for problems of n variables, n_eq equalities and n_in inequality rows."""
        self._size = (n, n_eq, n_in)
        self._settings = settings or SolverSettings()
        self._persistent: proxsuite.proxqp.dense.QP | None = None
        self.x = np.zeros(n)
        self.z = np.zeros(n_in)
        self.rows = np.zeros(n_in)
        self.iterations = 0
        self._equality = np.zeros(n_eq)
        self._excess = np.zeros(n_in)

    def reset(self) -> None:
        """Forget the last result; the next solve starts afresh."""
        self._persistent = None

    def solve(self, H: Array, g: Array, A: Array, b: Array, C: Array, lower: Array, upper: Array) -> Status:  # noqa: N803
        """Solve, and keep solution and multipliers in `x` and `z`.

        All arrays are C-ordered float64. Nothing is raised: the status says what happened.
        """
        # NaN and infinity in the state reach g, b and the bounds; comparisons with NaN are false.
        np.subtract(upper, lower, out=self._excess)
        if not (math.isfinite(g.dot(g) + b.dot(b)) and self._excess.min() >= 0.0):
            self._persistent = None
            return Status.REFUSED
        solved = proxsuite.proxqp.QPSolverOutput.PROXQP_SOLVED
        qp = self._persistent
        if qp is not None:
            qp.update(H=H, g=g, A=A, b=b, C=C, l=lower, u=upper, update_preconditioner=False)
            qp.solve()
            results = qp.results
            self.iterations = int(results.info.iter)
            if results.info.status == solved and self._accept(results.x, A, b, C, lower, upper):
                self.z[:] = results.z
                return Status.SOLVED
        first = qp is None
        qp = self._fresh(proxsuite.proxqp.InitialGuess.NO_INITIAL_GUESS)
        qp.init(H, g, A, b, C, lower, upper)
        qp.solve()
        self.iterations = int(qp.results.info.iter)
        if qp.results.info.status == solved and self._accept(qp.results.x, A, b, C, lower, upper):
            self.z[:] = qp.results.z
            qp.settings.initial_guess = proxsuite.proxqp.InitialGuess.COLD_START_WITH_PREVIOUS_RESULT
            self._persistent = qp
            if not first:
                logger.info("ProxQP failed with its last result as guess; a fresh solver succeeded")
            return Status.SOLVED if first else Status.RECOVERED
        self._persistent = None
        solution = self._daqp(H, g, A, b, C, lower, upper)
        if solution is not None and self._accept(solution, A, b, C, lower, upper):
            self.z[:] = 0.0
            logger.warning("ProxQP failed (%s); DAQP succeeded", qp.results.info.status)
            return Status.FALLBACK
        return Status.INFEASIBLE

    def _accept(self, x: Array, A: Array, b: Array, C: Array, lower: Array, upper: Array) -> bool:  # noqa: N803
        """Copy x and C x; return True if the primal residual is small."""
        self.x[:] = x
        x = self.x
        np.dot(C, x, out=self.rows)
        np.dot(A, x, out=self._equality)
        self._equality -= b
        tolerance = self._settings.residual_tolerance
        if not (self._equality.max() <= tolerance and self._equality.min() >= -tolerance):
            return False
        np.subtract(self.rows, upper, out=self._excess)
        if not self._excess.max() <= tolerance:
            return False
        np.subtract(lower, self.rows, out=self._excess)
        return bool(self._excess.max() <= tolerance)

    def _fresh(self, guess: proxsuite.proxqp.InitialGuess) -> proxsuite.proxqp.dense.QP:
        dense = proxsuite.proxqp.dense
        # The backend is named because the automatic choice changes with the number of rows, to one twice as slow.
        qp = dense.QP(*self._size, False, dense.HessianType.Dense, dense.DenseBackend.PrimalDualLDLT)
        settings, ours = qp.settings, self._settings
        settings.eps_abs, settings.eps_rel = ours.tolerance, 0.0
        settings.eps_primal_inf = settings.eps_dual_inf = (
            1e-8  # 1e-4, the default, calls feasible problems infeasible
        )
        settings.max_iter, settings.max_iter_in = ours.max_iterations, ours.max_inner_iterations
        settings.default_mu_eq = ours.equality_penalty
        settings.check_duality_gap = False
        settings.compute_timings = False
        settings.verbose = False
        settings.initial_guess = guess
        return qp

    @staticmethod
    def _daqp(H: Array, g: Array, A: Array, b: Array, C: Array, lower: Array, upper: Array) -> Array | None:  # noqa: N803
        """Solve with DAQP through qpsolvers, which writes two-sided rows as two one-sided ones."""
        above, below = np.isfinite(upper) & (upper < 1e20), np.isfinite(lower) & (lower > -1e20)
        problem = qpsolvers.Problem(
            H, g, np.vstack([C[above], -C[below]]), np.concatenate([upper[above], -lower[below]]), A, b
        )
        try:
            solution = qpsolvers.solve_problem(problem, solver="daqp")
        except (qpsolvers.QPError, ValueError, ArithmeticError) as error:
            logger.warning("DAQP failed: %s", error)
            return None
        return solution.x if solution.found else None
