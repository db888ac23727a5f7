"""Solver of a tick's QP: a ladder of methods, of which the first nearly always succeeds.

The ladder: active set of the last tick; DAQP, an exact active-set method, started from there; DAQP with costs that are
all alike, for any point that satisfies the constraints. If there is one, DAQP solves without a guess, or with the small
costs raised. If there is none, DAQP solves a relaxed problem: limits of the robot give way, and hard tasks and contact
motion if asked for. No solution is used unless its primal residual, computed here, is small: ProxQP, which the settings
may name in place of the ladder, has been seen to report PROXQP_SOLVED with a residual of 890
(WARM_START_WITH_PREVIOUS_RESULT, proxsuite 0.7.2).
"""

from __future__ import annotations

import enum
import math

import numpy as np
import qpsolvers

from wbc.base.errors import UnknownNameError
from wbc.base.numbers import Array
from wbc.base.settings import Positive, settings
from wbc.base.vectors import largest
from wbc.core.qp.solving.active_set import ActiveSet
from wbc.core.qp.solving.other_solvers import DaqpSolver, Relaxed, solve_by_qpsolvers
from wbc.core.qp.solving.problem import Problem

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
    """By the active set of the tick before, by DAQP from there, or by the solver that the settings name."""
    FALLBACK = "fallback"
    """By DAQP without a guess."""
    BADLY_SCALED = "badly scaled"
    """By DAQP with small costs raised: weights span too many decades, or friction is nearly zero."""
    RELAXED = "relaxed"
    """By DAQP, with limits, hard tasks or contact motion as costs: they could not all be satisfied."""
    INFEASIBLE = "infeasible"
    """None: hard constraints contradict each other, whatever limits give way."""
    REFUSED = "refused"
    """None: the QP has NaN or infinity in it."""

    def __init__(self, value: str) -> None:
        self.ok = value not in ("infeasible", "refused")


_SOLVED = Status.SOLVED
"""For the tick: a look-up in an enumeration takes ten times as long as one in a module."""

CORRECTIONS = 1
"""Number of corrections of the active set in a tick before DAQP takes over."""


@settings
class SolverSettings:
    """Settings of the ladder; the defaults are measured on streams of humanoid QPs.

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
    """

    def __init__(self, problem: Problem, settings: SolverSettings | None = None) -> None:
        """Prepare for a problem, whose arrays are read by every `solve`."""
        self.problem = problem
        self.settings = settings or SolverSettings()
        self._fast = ActiveSet(problem, self.settings.tolerance, CORRECTIONS)
        self.iterations = 0
        rescues = ("DAQP without a guess", "badly scaled", "relaxed", "other", "failed")
        self.counts = dict.fromkeys(("active set", "DAQP", *rescues), 0)
        self._daqp = DaqpSolver(problem, min(self.settings.tolerance, 1e-7))
        self._no_guess = np.zeros(problem.lower.size)
        self._by_active_set = self.settings.solver == "auto"
        self._steady = True  # the active set was the same in the last tick as in the one before

    @property
    def x(self) -> Array:
        """Solution of the last `solve`, shape (n,); no later one writes into it."""
        return self._fast.x

    @property
    def values(self) -> Array:
        """All rows of the problem times `x`; no later solve writes into them."""
        return self._fast.values

    @property
    def multipliers(self) -> Array:
        """Multipliers of the inequalities, shape (n_in,), positive where the upper bound is active; as `x`."""
        return self._fast.multipliers

    def solve(self) -> Status:
        """Solve, and store the results. Nothing is raised: the status tells of failures."""
        p = self.problem
        if self._by_active_set and self._steady and self._fast.solve():
            self.iterations = self._fast.iterations
            self.counts["active set"] += 1
            return _SOLVED
        hopeless = without_solution(p)
        if hopeless is not None:
            self.counts["failed"] += 1
            return hopeless
        hessian, gradient, by = p.hessian, p.gradient, self.settings.solver
        self._steady = True
        if by in ("auto", "daqp"):
            solved = self._solve_by_daqp(hessian, gradient)
        else:
            solved = self._solve_by_other(hessian, gradient)
        return _SOLVED if solved else self._rescue(hessian, gradient)

    def _solve_by_daqp(self, hessian: Array, gradient: Array) -> bool:
        """Solve with DAQP from the active set of the last tick; return True if its solution is accepted."""
        before = self.multipliers
        solution = self._daqp.solve(hessian, gradient, before)
        self.iterations = self._daqp.iterations
        if solution is None or not self._accept(solution[0], solution[2]):
            return False
        self._steady = bool(((solution[2] != 0.0) == (before != 0.0)).all())
        self._fast.guess(self.multipliers)
        self.counts["DAQP"] += 1
        return True

    def _solve_by_other(self, hessian: Array, gradient: Array) -> bool:
        """Solve with a solver of qpsolvers; return True if its solution is accepted."""
        by, tolerance = self.settings.solver, self.settings.tolerance
        solution = solve_by_qpsolvers(by, self.problem, hessian, gradient, tolerance)
        if solution is None or not self._accept(*solution):
            return False
        self.counts["other"] += 1
        return True

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
        if self._daqp.solve(alike, np.zeros(p.diagonal.size), self._no_guess) is not None:
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
            if tasks.any() and self._daqp.solve(hessian, gradient, self._no_guess, Relaxed(tasks, kept, 1.0)):
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
        solution = self._daqp.solve(hessian, gradient, self._no_guess, relaxed)
        return solution is not None and self._accept(solution[0], solution[2], relaxed)

    def _accept(self, x: Array, z: Array, relaxed: Relaxed | None = None) -> bool:
        """Accept a solution if it is feasible and complementary: no multiplier belongs to a bound that is far away.

        Rows that are relaxed need not be satisfied.

        ProxQP has been seen to keep multipliers of its guess and still report PROXQP_SOLVED: 8 of 1,499 random states
        of a humanoid, with accelerations off by up to 0.14 rad/s².
        """
        values = self.problem.rows.dot(x)
        room = self._room(values, relaxed)
        if room is None:
            return False
        active = z.nonzero()[0]
        if active.size and relaxed is None:  # an exact solver's multipliers of rows that yield are great
            (above, below), force = room, z[active]
            distance = np.minimum(np.where(force > 0.0, above[active], below[active]), 1e3)
            if not largest(np.abs(force) * distance) <= COMPLEMENTARITY:
                return False
        fast = self._fast
        fast.x, fast.values, fast.multipliers = x, values, z
        return True

    def _room(self, values: Array, relaxed: Relaxed | None = None) -> tuple[Array, Array] | None:
        """Distances of the inequalities to both bounds, of all rows times a solution; None if it violates a row.

        Rows that are relaxed need not be satisfied.
        """
        p, tolerance = self.problem, self.settings.residual_tolerance
        error, bounded = values[: p.n_eq] - p.equality_target, values[p.n_eq + p.n_soft :]
        above, below = p.upper - bounded, bounded - p.lower
        if relaxed is not None:
            error[relaxed.equalities] = 0.0
            above[relaxed.inequalities] = below[relaxed.inequalities] = np.inf
        feasible = (
            math.isfinite(values.dot(values))
            and np.abs(error).max(initial=0.0) <= tolerance
            and (
                not above.size
                or (above[above.argmin()] >= -tolerance and below[below.argmin()] >= -tolerance)
            )
        )
        return (above, below) if feasible else None


def without_solution(problem: Problem) -> Status | None:
    """Return why a QP need not be tried: NaN or infinity in targets or bounds, bounds that cross; None if it may be."""
    p = problem
    room = p.upper - p.lower
    finite = math.isfinite(p.target.dot(p.target) + p.linear.dot(p.linear))
    if finite and (room >= 0.0).all():
        return None
    return Status.INFEASIBLE if finite and not np.isnan(room).any() else Status.REFUSED
