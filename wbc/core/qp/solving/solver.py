"""Solver of a tick's QP: a ladder of methods, of which the first nearly always succeeds.

The methods are those of `Status`; `QpSolver._rescue` has the order of the last ones. No solution is used unless its
primal residual, computed here, is small: ProxQP, which the settings may name in place of the ladder, has been seen to
report PROXQP_SOLVED with a residual of 890 (WARM_START_WITH_PREVIOUS_RESULT, proxsuite 0.7.2).
"""

from __future__ import annotations

import enum
import logging
import math
from dataclasses import dataclass
from operator import attrgetter

import daqp
import numpy as np
import qpsolvers

from wbc.base.errors import UnknownNameError
from wbc.base.numbers import Array
from wbc.base.settings import Positive, settings
from wbc.base.vectors import largest
from wbc.core.qp.solving.active_set import ActiveSet
from wbc.core.qp.solving.problem import Problem

logger = logging.getLogger(__name__)

EQUALITY, FREE, AT_UPPER, AT_LOWER, YIELDING = 5, 0, 1, 3, 8
"""Flags of DAQP's `sense`: an equality, an inequality, those that are guessed to be active, and one with slack."""

UNBOUNDED = 1e30
"""Bound that DAQP takes for none."""

MAX_ITERATIONS = 1000
"""Changes of the active set after which DAQP gives up; a tick with a hundred rows takes 10 to 60."""

DAQP_TOLERANCE = 1e-7
"""Greatest violation of a row by DAQP."""

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


def solve_by_qpsolvers(name: str, problem: Problem, tolerance: float = 1e-6) -> tuple[Array, Array] | None:
    """Solve with any solver of qpsolvers, which splits two-sided rows into one-sided ones.

    The tolerance is the largest absolute residual of ProxQP, whose own of 1e-3 is coarse; others have theirs.
    Returned are the solution, shape (n,), and multipliers of the inequalities, shape (n_in,); None without a solution.
    """
    try:
        options = {"eps_abs": tolerance, "eps_rel": 0.0} if name == "proxqp" else {}
        solution = qpsolvers.solve_problem(standard_form(problem), name, **options)
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


def standard_form(p: Problem) -> qpsolvers.Problem:
    """Return a problem in the form of qpsolvers."""
    above, below = p.upper < 1e20, p.lower > -1e20
    return qpsolvers.Problem(
        p.hessian,
        p.gradient,
        np.vstack([p.inequality[above], -p.inequality[below]]),
        np.concatenate([p.upper[above], -p.lower[below]]),
        np.array(p.equality),
        np.array(p.equality_target),
    )


RAISED = (1e-10, 1e-8, 1e-6, 1e-4, 1e-2)
"""Least cost of a variable as shares of the greatest, from which on badly scaled problems are tried."""

EVEN = (0.0, 1e-4, 1e-2)
"""Costs of all variables, as shares of the greatest, with which a relaxed problem is tried."""

COMPLEMENTARITY = 1e-3
"""Largest product of a multiplier and the distance to its bound that counts as zero, in units of the cost."""


class Status(enum.Enum):
    """Step of the ladder that solved a tick's QP, if any.

    Attributes:
        ok: True if there is a solution.
    """

    ok: bool

    SOLVED = "solved"
    """Solved by the active set of the tick before, by DAQP from there, or by the solver that the settings name."""
    FALLBACK = "fallback"
    """Solved by DAQP without a guess."""
    BADLY_SCALED = "badly scaled"
    """Solved by DAQP with small costs raised: weights span too many decades, or friction is nearly zero."""
    RELAXED = "relaxed"
    """Solved by DAQP with limits, hard tasks or contact motion as costs: not all of them could be satisfied."""
    INFEASIBLE = "infeasible"
    """No solution: hard constraints contradict each other, whatever limits give way."""
    REFUSED = "refused"
    """No solution: the QP has NaN or infinity in it."""

    def __init__(self, value: str) -> None:
        self.ok = value not in ("infeasible", "refused")


_SOLVED = Status.SOLVED
"""For the tick: a look-up in an enumeration takes ten times as long as one in a module."""

CORRECTIONS = 1
"""Number of corrections of the active set in a tick before DAQP takes over."""


@settings
class SolverSettings:
    """Settings of the ladder of QP solvers; the defaults are measured on streams of humanoid QPs.

    Attributes:
        solver: "auto" for the ladder. "daqp", or any dense solver that qpsolvers finds installed, such as "proxqp",
            solves all ticks; the rest of the ladder helps where it fails.
        tolerance: Largest residual of equalities of the active set, and primal residual of ProxQP, m/s², N and Nm.
        residual_tolerance: Largest primal residual accepted of any solver.
        relaxation: Cost per squared violation of hard tasks and contact motion, when not all of them can be satisfied;
            such a tick is "infeasible" when None. Dynamics, torque limits and wrench cones are always satisfied.
    """

    solver: str = "auto"
    tolerance: Positive = 1e-6
    residual_tolerance: Positive = 1e-5
    relaxation: Positive | None = None

    def __post_init__(self) -> None:
        if self.solver not in solver_names():
            raise UnknownNameError(
                f"no dense solver '{self.solver}'; choices: {', '.join(solver_names())}; further ones, such as piqp, "
                "after `pip install qpsolvers[NAME]`"
            )


def solver_names() -> tuple[str, ...]:
    """Return the values of `SolverSettings.solver`: the ladder, and every dense solver that is installed."""
    dense = sorted(set(qpsolvers.dense_solvers) & set(qpsolvers.available_solvers))
    return ("auto", *dict.fromkeys(("daqp", *dense)))


class QpSolver:
    """Solver of one QP whose numbers change from tick to tick; see the module for the ladder.

    Attributes:
        iterations: Iterations of the solver that succeeded, or of the last one that failed.
        counts: Number of ticks that each step of the ladder has solved.
        x: Solution of the last `solve`, shape (n,); no later one writes into it, nor into the arrays below.
        values: All rows of the problem times `x`.
        multipliers: Multipliers of the inequalities, shape (n_in,), positive where the upper bound is active.
    """

    x = property(attrgetter("_fast.x"))
    values = property(attrgetter("_fast.values"))
    multipliers = property(attrgetter("_fast.multipliers"))

    def __init__(self, problem: Problem, settings: SolverSettings | None = None) -> None:
        """Prepare for a problem, whose arrays are read by every `solve`."""
        self.problem = problem
        self.settings = settings or SolverSettings()
        self._fast = ActiveSet(problem, self.settings.tolerance, CORRECTIONS)
        self.iterations = 0
        rescues = ("DAQP without a guess", "badly scaled", "relaxed", "other", "failed")
        self.counts = dict.fromkeys(("active set", "DAQP", *rescues), 0)
        rows = problem.n_eq + problem.lower.size  # of DAQP, whose arrays are reused
        self._rows = np.zeros((rows, problem.diagonal.size))
        self._upper, self._lower = np.zeros(rows), np.zeros(rows)
        self._sense = np.zeros(rows, dtype=np.intc)
        self._no_guess = np.zeros(problem.lower.size)
        self._by_active_set = self.settings.solver == "auto"
        self._steady = True  # the active set was the same in the last tick as in the one before

    def solve(self) -> Status:
        """Solve, and store the results. Nothing is raised: the status tells of failures."""
        p = self.problem
        if self._by_active_set and self._steady and self._fast.solve():
            self.iterations = self._fast.iterations
            self.counts["active set"] += 1
            return _SOLVED
        room, finite = p.upper - p.lower, math.isfinite(p.target.dot(p.target) + p.linear.dot(p.linear))
        if not (
            finite and (room >= 0.0).all()
        ):  # bounds that cross, or NaN or infinity: it need not be tried
            self.counts["failed"] += 1
            return Status.INFEASIBLE if finite and not np.isnan(room).any() else Status.REFUSED
        hessian, gradient, before = p.hessian, p.gradient, self.multipliers
        self._steady, by_daqp = True, self.settings.solver in ("auto", "daqp")
        if by_daqp:
            found = self._by_daqp(hessian, gradient, before)
        else:
            found = solve_by_qpsolvers(self.settings.solver, p, self.settings.tolerance)
        if found is None or not self._accept(*found):
            return self._rescue(hessian, gradient)
        if by_daqp:
            self._steady = bool(((self.multipliers != 0.0) == (before != 0.0)).all())
            self._fast.guess(self.multipliers)
        self.counts["DAQP" if by_daqp else "other"] += 1
        return _SOLVED

    def _by_daqp(
        self, hessian: Array, gradient: Array, guess: Array, relaxed: Relaxed | None = None
    ) -> tuple[Array, Array] | None:
        """Solve with DAQP, an exact dual active-set method, from a guess of the active set.

        Hessian and gradient have shapes (n, n) and (n,). The guess are multipliers of the inequalities, shape (n_in,):
        those that are not zero are tried first. All rows are constraints but those that are relaxed. Returned are the
        solution, and multipliers of the inequalities; None without a solution. The same numbers give the same solution,
        bit for bit.
        """
        p, n_eq = self.problem, self.problem.n_eq
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
            primal_tol=min(self.settings.tolerance, DAQP_TOLERANCE),
            iter_limit=MAX_ITERATIONS,
            rho_soft=SLACK,
        )
        self.iterations = int(info["iterations"])
        return None if flag < 1 else (x, info["lam"][n_eq:])

    def _free(self, rows: np.ndarray[tuple[int], np.dtype[np.intp]]) -> None:
        self._sense[rows] = FREE
        self._upper[rows], self._lower[rows] = UNBOUNDED, -UNBOUNDED

    def _rescue(self, hessian: Array, gradient: Array) -> Status:
        """Solve without a guess, or with small costs raised, or with tasks relaxed.

        Whether the constraints can be satisfied is decided in 0.1 ms, with costs that are all alike: DAQP with costs of
        twelve decades is wrong in one of three ticks that it calls infeasible.
        """
        p = self.problem
        if not np.isfinite(p.rows).all():
            self.counts["failed"] += 1
            return Status.REFUSED
        alike = np.eye(p.diagonal.size)
        if self._by_daqp(alike, np.zeros(p.diagonal.size), self._no_guess) is not None:
            largest_cost = float(hessian.diagonal().max())
            if self._by_daqp_alone(hessian, gradient):
                self.counts["DAQP without a guess"] += 1
                return Status.FALLBACK
            for share in RAISED:
                if self._by_daqp_alone(hessian + share * largest_cost * alike, gradient):
                    self.counts["badly scaled"] += 1
                    return Status.BADLY_SCALED
        if self._relax(hessian, gradient):
            self.counts["relaxed"] += 1
            return Status.RELAXED
        self.counts["failed"] += 1
        return Status.INFEASIBLE

    def _relax(self, hessian: Array, gradient: Array) -> bool:
        """Solve with as few rows as costs as there is a solution for; return True if there is one.

        Limits give way last, but for those that ask for a way back from outside: hard tasks give way before them, and
        contact motion after them. Limits of single joints give way after the others. Where hard tasks may not give way,
        limits do not give way to them.
        """
        p, relaxation = self.problem, self.settings.relaxation
        none, tasks, rest = np.zeros_like(p.hard_tasks), p.hard_tasks, np.arange(p.n_eq) >= p.n_physics
        asking = (p.lower > 0.0) | (p.upper < 0.0)
        first, any_asking, all_limits = asking & (p.yielding == 1), asking & (p.yielding > 0), p.yielding > 0
        kept = np.zeros_like(asking)
        if relaxation is None:
            if tasks.any() and self._by_daqp(hessian, gradient, self._no_guess, Relaxed(tasks, kept, 1.0)):
                return False
            steps = [(none, first), (none, any_asking), (none, all_limits)]
        else:
            steps = [(tasks, kept), (tasks, first)] if any_asking.any() else []
            steps += [(rest, kept), (rest, first), (rest, any_asking), (rest, all_limits)]
        different = {(rows.tobytes(), limits.tobytes()): (rows, limits) for rows, limits in steps}
        different.pop((none.tobytes(), kept.tobytes()), None)
        alike = float(hessian.diagonal().max()) * np.eye(p.diagonal.size)
        return any(
            self._by_daqp_alone(hessian + share * alike, gradient, Relaxed(rows, limits, relaxation or 0.0))
            for share in EVEN
            for rows, limits in different.values()
        )

    def _by_daqp_alone(self, hessian: Array, gradient: Array, relaxed: Relaxed | None = None) -> bool:
        """Solve with DAQP without a guess; return True if its solution is accepted."""
        found = self._by_daqp(hessian, gradient, self._no_guess, relaxed)
        return found is not None and self._accept(*found, relaxed)

    def _accept(self, x: Array, z: Array, relaxed: Relaxed | None = None) -> bool:
        """Accept a solution if it is feasible and complementary: no multiplier belongs to a bound that is far away.

        Rows that are relaxed need not be satisfied.

        ProxQP has been seen to keep multipliers of its guess and still report PROXQP_SOLVED: 8 of 1,499 random states
        of a humanoid, with accelerations off by up to 0.14 rad/s².
        """
        p, tolerance, values = self.problem, self.settings.residual_tolerance, self.problem.rows.dot(x)
        error, bounded = values[: p.n_eq] - p.equality_target, values[p.n_eq + p.n_soft :]
        above, below = p.upper - bounded, bounded - p.lower
        if relaxed is not None:
            error[relaxed.equalities] = 0.0
            above[relaxed.inequalities] = below[relaxed.inequalities] = np.inf
        if not (math.isfinite(values.dot(values)) and np.abs(error).max(initial=0.0) <= tolerance):
            return False
        if above.size and not (above[above.argmin()] >= -tolerance and below[below.argmin()] >= -tolerance):
            return False
        active = z.nonzero()[0]
        if active.size and relaxed is None:  # an exact solver's multipliers of rows that yield are great
            force = z[active]
            distance = np.minimum(np.where(force > 0.0, above[active], below[active]), 1e3)
            if not largest(np.abs(force) * distance) <= COMPLEMENTARITY:
                return False
        fast = self._fast
        fast.x, fast.values, fast.multipliers = x, values, z
        return True
