"""The solver of a tick's problem: reuse the active set, else ProxQP, and what to do when that fails too.

Between two ticks the set of inequalities that push hardly ever changes. Given that set, the problem is linear; with
the structure of `Problem` it is one small symmetric system, and checking the result (all rows within their bounds, all
multipliers of the right sign) proves that it is the exact solution. `ActiveSet` does that. Whenever the check fails
after a few corrections of the set, ProxQP solves the problem from scratch and finds the new set.

The ladder: active set; persistent ProxQP, warm-started by the last result; a fresh ProxQP without a guess; DAQP, an
exact active-set method; if asked for, DAQP on a relaxed problem; nothing. No solution is used unless its primal
residual, computed here, is small: ProxQP has been seen to report PROXQP_SOLVED with a residual of 890
(WARM_START_WITH_PREVIOUS_RESULT, proxsuite 0.7.2).
"""

from __future__ import annotations

import enum
import logging
import math
from typing import Annotated

import numpy as np
import proxsuite
import qpsolvers
from pydantic import Field
from scipy.linalg.lapack import dposv, dpotrs

from wbc.core.errors import Array, scalar
from wbc.core.qp.problem import Problem
from wbc.core.settings import Count, Positive, settings

logger = logging.getLogger(__name__)

COMPLEMENTARITY = 1e-3
"""Largest product of a multiplier and the distance to its bound that counts as zero, in units of the cost."""


def largest(values: Array) -> float:
    """The same as `values.max()` for one axis, NaN too, in a quarter of the time."""
    return float(values[values.argmax()])


class Status(enum.Enum):
    """How a tick's problem was solved, if at all."""

    SOLVED = "solved"
    """By the active set of the tick before, or by the persistent ProxQP."""
    RECOVERED = "recovered"
    """By a fresh ProxQP without a guess."""
    FALLBACK = "fallback"
    """By DAQP."""
    RELAXED = "relaxed"
    """By DAQP, with hard tasks and contact motion as costs: they could not all be kept."""
    INFEASIBLE = "infeasible"
    """Not at all: hard constraints contradict each other, or every solver gave up."""
    REFUSED = "refused"
    """Not tried: the problem holds NaN or infinity."""

    @property
    def ok(self) -> bool:
        """True if there is a solution."""
        return self in (Status.SOLVED, Status.RECOVERED, Status.FALLBACK, Status.RELAXED)


@settings
class SolverSettings:
    """Settings of the ladder; the defaults are measured on streams of humanoid problems.

    Attributes:
        tolerance: Largest primal and dual residual of ProxQP, absolute: m/s², N and Nm. Below 1e-9 it shows outliers.
        residual_tolerance: Largest primal residual accepted of any solver.
        max_iterations: Outer iterations of ProxQP; with the inner ones, the only time limit that it has.
        max_inner_iterations: Iterations of each inner problem.
        equality_penalty: ProxQP's proximal parameter μ of the equalities. With its default 1e-3 most problems need
            two outer iterations, with 1e-7 one: 49 µs against 37 µs for 50 variables, 18 equalities, 96 rows.
        active_set_changes: How often a tick may correct the active set before ProxQP takes over; 0 leaves every tick
            to ProxQP.
        relaxation: Cost per squared violation of hard tasks and contact motion, when not all of them can be kept; such
            a tick is "infeasible" when None. Dynamics and inequalities are always kept.
    """

    tolerance: Positive = 1e-6
    residual_tolerance: Positive = 1e-5
    max_iterations: Count = 15
    max_inner_iterations: Count = 30
    equality_penalty: Positive = 1e-7
    active_set_changes: Annotated[int, Field(ge=0)] = 4
    relaxation: Positive | None = None


_ONE, _LEAST_WEIGHT = scalar(1.0), scalar(1e-12)


class ActiveSet:
    """Solves a problem whose active inequalities are guessed, and proves or corrects the guess.

    With rows R (equalities, soft rows, active inequalities), targets t and the diagonal D, the solution is

        x = D⁻¹ (linear + Rᵀ λ),   (R D⁻¹ Rᵀ + W⁻¹) λ = t − R D⁻¹ linear,

    where W⁻¹ holds the inverse weights of the soft rows and zeros elsewhere: a system of a few dozen unknowns.
    Corrections follow the primal–dual active set method (Hintermüller, Ito, Kunisch, SIAM J. Optim. 13(3), 2002).

    Attributes:
        x: Solution, shape (n,).
        values: All rows times x, shape (number of rows,).
        multipliers: Of the inequalities, shape (n_in,), positive where the upper bound pushes.
        equality_multipliers: Of the equalities, shape (n_eq,), positive where they push upwards.
        iterations: Systems solved by the last `solve`.
    """

    def __init__(self, problem: Problem, tolerance: float, changes: int) -> None:
        """Start with no inequality active.

        Args:
            problem: The problem; its arrays are read by every `solve`.
            tolerance: Largest primal residual.
            changes: How often a solve may correct the set.
        """
        self._p = p = problem
        self._tolerance, self._changes = tolerance, changes
        self._n_linear = p.n_eq + p.n_soft
        n, m = p.diagonal.size, self._n_linear
        self.x, self.values = np.zeros(n), np.zeros(p.rows.shape[0])
        self.multipliers = np.zeros(p.lower.size)
        self.equality_multipliers = np.zeros(p.n_eq)
        self.iterations = 0
        self._active = np.zeros(0, dtype=np.intp)
        self._upper_side = np.zeros(0, dtype=bool)
        self._inverse, self._base = np.zeros(n), np.zeros(n)
        self._linear_rows, self._scaled = p.rows[:m], np.zeros((m, n))
        self._gram = np.zeros((m, m))
        self._soft_diagonal = slice(p.n_eq * (m + 1), m * m, m + 1)
        self._excess, self._shortfall = np.zeros(p.lower.size), np.zeros(p.lower.size)
        self._soft_inverse, self._error = np.zeros(p.n_soft), np.zeros(p.n_eq)

    def guess(self, multipliers: Array) -> None:
        """Take the active set from multipliers that another solver has found, shape (n_in,)."""
        threshold = 1e-8 * max(1.0, float(np.abs(multipliers).max(initial=0.0)))
        self._active = (np.abs(multipliers) > threshold).nonzero()[0]
        self._upper_side = multipliers[self._active] > 0.0

    def solve(self) -> bool:
        """Solve; True if `x` is proved to be the solution."""
        p = self._p
        np.divide(_ONE, p.diagonal, out=self._inverse)
        np.multiply(self._inverse, p.linear, out=self._base)
        np.maximum(p.soft_weight, _LEAST_WEIGHT, out=self._soft_inverse)
        np.divide(_ONE, self._soft_inverse, out=self._soft_inverse)
        for iteration in range(1, self._changes + 2):
            self.iterations = iteration
            if not self._step():
                break
            wrong = self._check()
            if wrong is None:
                break
            if not wrong:
                return True
        self._active, self._upper_side = self._active[:0], self._upper_side[:0]
        return False

    def _step(self) -> bool:
        """Solve for the present set; False if its rows depend on each other or the result is inexact."""
        p, active, m = self._p, self._active, self._n_linear
        if active.size:
            rows = np.concatenate([self._linear_rows, p.inequality[active]])
            target = np.concatenate([p.target, np.where(self._upper_side, p.upper[active], p.lower[active])])
            scaled = rows * self._inverse
            gram = np.dot(scaled, rows.T)
            diagonal = gram.reshape(-1)[:: gram.shape[0] + 1]
            diagonal[p.n_eq : m] += self._soft_inverse
        else:
            rows, target, scaled, gram = self._linear_rows, p.target, self._scaled, self._gram
            np.multiply(rows, self._inverse, out=scaled)
            np.dot(scaled, rows.T, out=gram)
            gram.reshape(-1)[self._soft_diagonal] += self._soft_inverse
        if p.empty is not None:
            gram.reshape(-1)[: p.n_eq * (gram.shape[0] + 1) : gram.shape[0] + 1] += p.empty
        if not math.isfinite(target.dot(target)):
            return False  # a bound that was active has gone
        factor, force, info = dposv(
            gram.T, target - np.dot(rows, self._base), overwrite_a=True, overwrite_b=True
        )
        if info != 0:
            return False
        x, values, n_eq, tolerance = self.x, self.values, p.n_eq, self._tolerance
        for _ in range(3):  # the second and third are refinements, for states with large accelerations
            np.dot(force, scaled, out=x)
            x += self._base
            np.dot(p.rows, x, out=values)
            short = np.subtract(p.target[:n_eq], values[:n_eq], out=self._error)
            if short[short.argmax()] <= tolerance and short[short.argmin()] >= -tolerance:
                self._force, self.equality_multipliers = force[m:], force[:n_eq]
                return True
            error = target - np.dot(rows, x)
            error[n_eq:m] -= force[n_eq:m] * self._soft_inverse
            force = force + dpotrs(factor, error)[0]
        return False

    def _check(self) -> bool | None:
        """True if the set had to be corrected, False if it is right, None if it cannot be corrected."""
        p, active, tolerance = self._p, self._active, self._tolerance
        values, excess, shortfall = self.values[self._n_linear :], self._excess, self._shortfall
        np.subtract(values, p.upper, out=excess)
        np.subtract(p.lower, values, out=shortfall)
        violated = not (largest(excess) <= tolerance and largest(shortfall) <= tolerance)
        if not active.size:
            if not violated:
                self.multipliers[:] = 0.0
                return False
            keep_active, keep_side = active, self._upper_side
        else:
            pushes = np.where(self._upper_side, -self._force, self._force)
            wrong = pushes < 0.0
            wrong &= p.upper[active] - p.lower[active] > 1e-9
            if not (violated or wrong.any()):
                self.multipliers[:] = 0.0
                self.multipliers[active] = -self._force
                return False
            keep_active, keep_side = active[~wrong], self._upper_side[~wrong]
        excess[active] = shortfall[active] = -1.0
        above, below = (excess > tolerance).nonzero()[0], (shortfall > tolerance).nonzero()[0]
        self._active = np.concatenate([keep_active, above, below])
        self._upper_side = np.concatenate([keep_side, np.ones(above.size, bool), np.zeros(below.size, bool)])
        return None if self._active.size + p.n_eq > p.diagonal.size else True


class QpSolver:
    """Solves one problem again and again; see the module for the ladder.

    Attributes:
        x: Solution of the last `solve`, shape (n,); overwritten by the next one.
        values: All rows of the problem times x; overwritten by the next solve.
        multipliers: Of the inequalities, shape (n_in,), positive where the upper bound pushes.
        iterations: Of the solver that succeeded, or of the last one that failed.
    """

    def __init__(self, problem: Problem, settings: SolverSettings | None = None) -> None:
        """Prepare for a problem; its arrays are read by every `solve`."""
        self.problem = problem
        self.settings = settings or SolverSettings()
        self._fast = ActiveSet(problem, self.settings.tolerance, self.settings.active_set_changes)
        self._persistent: proxsuite.proxqp.dense.QP | None = None
        self._excess = np.zeros(problem.lower.size)
        self._guess = (np.zeros(problem.diagonal.size), np.zeros(problem.n_eq), np.zeros(problem.lower.size))
        self.x, self.values, self.multipliers = self._fast.x, self._fast.values, self._fast.multipliers
        self.iterations = 0
        self.counts = {"active set": 0, "ProxQP": 0, "fresh ProxQP": 0, "DAQP": 0, "relaxed": 0, "failed": 0}

    def solve(self) -> Status:
        """Solve, and keep the results. Nothing is raised: the status says what happened."""
        p = self.problem
        # NaN and infinity in the state reach the targets and the bounds; comparisons with NaN are false.
        np.subtract(p.upper, p.lower, out=self._excess)
        excess = self._excess
        if not (
            math.isfinite(p.target.dot(p.target) + p.linear.dot(p.linear)) and excess[excess.argmin()] >= 0.0
        ):
            self._persistent = None
            self.counts["failed"] += 1
            return Status.REFUSED
        if self.settings.active_set_changes and self._fast.solve():
            self.iterations = self._fast.iterations
            self.counts["active set"] += 1
            self._keep()
            return Status.SOLVED
        return self._solve_by_proxqp()

    def _keep(self) -> None:
        """Remember an exact answer, from which ProxQP may start later."""
        x, y, z = self._guess
        x[:], z[:] = self.x, self.multipliers
        np.negative(self._fast.equality_multipliers, out=y)

    def _solve_by_proxqp(self) -> Status:
        p = self.problem
        hessian, gradient = p.hessian, p.gradient
        data = (hessian, gradient, p.equality, p.equality_target, p.inequality, p.lower, p.upper)
        first = self._persistent is None
        if self._persistent is not None:
            self._persistent.update(*data, update_preconditioner=False)
            if self._run(self._persistent, self._guess):
                return self._finish("ProxQP", Status.SOLVED, hessian, gradient)
        qp = self._fresh()
        qp.init(*data)
        if self._run(qp):
            qp.settings.initial_guess = proxsuite.proxqp.InitialGuess.WARM_START
            self._persistent = qp
            if first:
                return self._finish("ProxQP", Status.SOLVED, hessian, gradient)
            logger.info("ProxQP failed with its last result as guess; a fresh solver succeeded")
            return self._finish("fresh ProxQP", Status.RECOVERED, hessian, gradient)
        self._persistent = None
        solution = self._daqp(hessian, gradient)
        if solution is not None and self._accept(*solution):
            logger.info("ProxQP failed (%s); DAQP succeeded", qp.results.info.status)
            self.counts["DAQP"] += 1
            return Status.FALLBACK
        if self.settings.relaxation is not None and p.n_physics < p.n_eq:
            solution = self._daqp(hessian, gradient, self.settings.relaxation)
            if solution is not None and self._accept(*solution, n_eq=p.n_physics):
                self.counts["relaxed"] += 1
                return Status.RELAXED
        self.counts["failed"] += 1
        return Status.INFEASIBLE

    def _run(self, qp: proxsuite.proxqp.dense.QP, guess: tuple[Array, Array, Array] | None = None) -> bool:
        """Let ProxQP solve; True if its answer is accepted."""
        qp.solve(*guess) if guess is not None else qp.solve()
        results = qp.results
        self.iterations = int(results.info.iter)
        if results.info.status != proxsuite.proxqp.QPSolverOutput.PROXQP_SOLVED:
            return False
        if not self._accept(results.x, results.z):
            return False
        for kept, found in zip(self._guess, (results.x, results.y, results.z), strict=True):
            kept[:] = found
        return True

    def _finish(self, name: str, status: Status, hessian: Array, gradient: Array) -> Status:
        """Make an answer of ProxQP exact, from its active set or else by DAQP.

        What ProxQP returns depends in the last digits on where its memory lies, so that two runs of a simulation would
        differ; an exact answer does not. One that nothing confirms, as where costs differ by many orders of magnitude,
        is rounded, which hides nearly all of that.
        """
        self.counts[name] += 1
        if self.settings.active_set_changes and not self._polish():
            solution = self._daqp(hessian, gradient)
            if solution is None or not self._accept(*solution):
                logger.debug("neither the active set nor DAQP confirms ProxQP's answer")
                self._cut_off()
            self._fast.guess(self.multipliers)
        return status

    def _cut_off(self) -> None:
        """Round an answer that nothing confirms and whose last digits differ between runs, if it stays acceptable."""
        quantum = 0.1 * self.settings.residual_tolerance
        x = quantum * np.rint(self.x / quantum)
        values = np.dot(self.problem.rows, x)
        if self._room(values, self.problem.n_eq) is not None:
            self.x[:], self.values[:] = x, values
        self.multipliers[:] = _cut(self.multipliers)
        self._guess[0][:], self._guess[1][:], self._guess[2][:] = (
            self.x,
            _cut(self._guess[1]),
            self.multipliers,
        )

    def _polish(self) -> bool:
        """Solve again from the active set of the accepted answer; False, and nothing changed, if that fails."""
        x, values, multipliers = self.x.copy(), self.values.copy(), self.multipliers.copy()
        self._fast.guess(multipliers)
        if self._fast.solve():
            self._keep()
            return True
        self.x[:], self.values[:], self.multipliers[:] = x, values, multipliers
        return False

    def _accept(self, x: Array, z: Array, n_eq: int | None = None) -> bool:
        """Take an answer if it is feasible and no multiplier pushes off a bound that is far away.

        Only the first n_eq equalities have to be kept; all of them when None.

        ProxQP has been seen to keep multipliers of its guess and still report PROXQP_SOLVED: 8 of 1,499 random states
        of a humanoid, with accelerations off by up to 0.14 rad/s².
        """
        values = np.dot(self.problem.rows, x)
        room = self._room(values, self.problem.n_eq if n_eq is None else n_eq)
        if room is None:
            return False
        above, below = room
        if not (np.abs(z) * np.minimum(np.where(z > 0.0, above, below), 1e3)).max() <= COMPLEMENTARITY:
            return False
        self.x[:], self.values[:], self.multipliers[:] = x, values, z
        return True

    def _room(self, values: Array, n_eq: int) -> tuple[Array, Array] | None:
        """Room of the inequalities to their upper and lower bounds; None if an answer does not keep all rows.

        Args:
            values: All rows times the answer.
            n_eq: How many equalities, the first ones, have to be kept.
        """
        p, tolerance = self.problem, self.settings.residual_tolerance
        error, bounded = values[:n_eq] - p.target[:n_eq], values[p.n_eq + p.n_soft :]
        above, below = p.upper - bounded, bounded - p.lower
        kept = np.abs(error).max(initial=0.0) <= tolerance and min(above.min(), below.min()) >= -tolerance
        return (above, below) if kept else None

    def _fresh(self) -> proxsuite.proxqp.dense.QP:
        p, dense, ours = self.problem, proxsuite.proxqp.dense, self.settings
        # The backend is named because the automatic choice changes with the number of rows, to one twice as slow.
        size = (p.diagonal.size, p.n_eq, p.lower.size)
        qp = dense.QP(*size, False, dense.HessianType.Dense, dense.DenseBackend.PrimalDualLDLT)
        options = qp.settings
        options.eps_abs, options.eps_rel = ours.tolerance, 0.0
        # 1e-4, the default, calls feasible problems infeasible.
        options.eps_primal_inf = options.eps_dual_inf = 1e-8
        options.max_iter, options.max_iter_in = ours.max_iterations, ours.max_inner_iterations
        options.default_mu_eq = ours.equality_penalty
        options.check_duality_gap = False
        options.compute_timings = False
        options.verbose = False
        options.initial_guess = proxsuite.proxqp.InitialGuess.NO_INITIAL_GUESS
        return qp

    def _daqp(
        self, hessian: Array, gradient: Array, relaxation: float | None = None
    ) -> tuple[Array, Array] | None:
        """Solve with DAQP through qpsolvers, which writes two-sided rows as two one-sided ones; x and multipliers.

        With a relaxation, all equalities but the physics become costs of that weight.
        """
        p = self.problem
        problem = standard_form(p, hessian, gradient)
        if relaxation is not None:
            rows, target = p.equality[p.n_physics :], p.equality_target[p.n_physics :]
            problem.P = hessian + relaxation * np.dot(rows.T, rows)
            problem.q = gradient - relaxation * np.dot(target, rows)
            problem.A, problem.b = p.equality[: p.n_physics].copy(), p.equality_target[: p.n_physics].copy()
        try:
            solution = qpsolvers.solve_problem(problem, solver="daqp")
        except (qpsolvers.QPError, ValueError, ArithmeticError) as error:
            logger.warning("DAQP failed: %s", error)
            return None
        if not solution.found or solution.x is None:
            return None
        multipliers = np.zeros(p.lower.size)
        if solution.z is not None:
            above, below = p.upper < 1e20, p.lower > -1e20
            multipliers[above] += solution.z[: above.sum()]
            multipliers[below] -= solution.z[above.sum() :]
        return solution.x, multipliers


def _cut(multipliers: Array) -> Array:
    """Multipliers without the digits that are a million times smaller than the greatest."""
    least = 1e-6 * float(np.abs(multipliers).max(initial=0.0))
    return multipliers if least == 0.0 else least * np.rint(multipliers / least)


def standard_form(
    p: Problem, hessian: Array | None = None, gradient: Array | None = None
) -> qpsolvers.Problem:
    """Return a problem as qpsolvers wants it, for cross-checks with any of its solvers.

    Args:
        p: The problem.
        hessian: `p.hessian`, if it has been computed already.
        gradient: `p.gradient`, if it has been computed already.
    """
    above, below = p.upper < 1e20, p.lower > -1e20
    return qpsolvers.Problem(
        p.hessian if hessian is None else hessian,
        p.gradient if gradient is None else gradient,
        np.vstack([p.inequality[above], -p.inequality[below]]),
        np.concatenate([p.upper[above], -p.lower[below]]),
        np.array(p.equality),
        np.array(p.equality_target),
    )
