"""Reports for people: which constraints contradict each other, and what holds tasks off their targets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import qpsolvers

from wbc.base.numbers import Array
from wbc.core.qp.solving.problem import Problem
from wbc.core.qp.store import RowStore
from wbc.core.qp.task import NEAR, SelectionTask, Task

SLACK_TOLERANCE = 1e-4
"""Violation below which a group counts as satisfied, in the unit of its rows."""

OPPOSES = 0.1
"""Share of the gradient of a task that another one takes off, from which that one is named."""

STUCK = 1e-6
"""Share of the gradient of a task along free directions below which contacts and hard tasks hold it."""


def violated_groups(problem: Problem) -> dict[str, float]:
    """Return group → largest violation of those that cannot all be satisfied, worst first, by the elastic QP.

    The dynamics of the floating base are physics and stay exact; all other rows have a slack for each bound, at a
    quadratic cost.
    """
    p = problem
    n, physics = p.diagonal.size, p.n_physics
    above, below = np.isfinite(p.upper) & (p.upper < 1e20), np.isfinite(p.lower) & (p.lower > -1e20)
    relaxed = p.n_eq - physics
    n_slack = relaxed + int(above.sum() + below.sum())  # one for each bound: those of one row may cross
    identity = np.eye(n_slack)
    # Least violation first: the objective of the tasks is dropped, but for a trace that makes the answer unique.
    hessian = np.diag(np.concatenate([np.full(n, 1e-12), np.ones(n_slack)]))
    solution = qpsolvers.solve_problem(
        qpsolvers.Problem(
            hessian,
            np.zeros(n + n_slack),
            np.hstack([np.vstack([p.inequality[above], -p.inequality[below]]), -identity[relaxed:]]),
            np.concatenate([p.upper[above], -p.lower[below]]),
            np.hstack([p.equality, np.vstack([np.zeros((physics, n_slack)), identity[:relaxed]])]),
            np.array(p.equality_target),
        ),
        solver="daqp",
    )
    if not solution.found:
        return {"floating-base dynamics": float("inf")}
    off = np.abs(p.equality @ solution.x[:n] - p.equality_target)
    values = p.inequality @ solution.x[:n]
    beyond = np.maximum(values - p.upper, p.lower - values)
    groups = [(name, off[rows]) for name, rows in p.equality_groups.items() if rows.start >= physics]
    groups += [(name, beyond[rows]) for name, rows in p.inequality_groups.items()]
    violated = {name: float(found.max(initial=0.0)) for name, found in groups}
    worst_first = sorted(violated.items(), key=lambda item: -item[1])
    return {name: value for name, value in worst_first if value > SLACK_TOLERANCE}


def held_back(
    tasks: Sequence[Task], rows: RowStore, residuals: Mapping[str, Array], multipliers: Array
) -> dict[str, tuple[str, ...]]:
    """Return the tasks that others hold off their targets → names of the tasks and limits that do, strongest first.

    At the solution, the gradients of all costs and the multipliers of all limits add up to zero in the directions that
    contacts, hard tasks and dynamics leave free. Along the gradient of a task, those of the others that oppose it are
    what holds it back. A task with a smaller residual than that of an error with which it is reached is left out.

    Args:
        tasks: Soft tasks.
        rows: Rows of the QP that has been solved.
        residuals: Name of a task → its residual.
        multipliers: Multipliers of the inequalities.
    """
    p = rows.problem
    pulls: dict[str, Array] = {}
    for task in tasks:
        cost = task._numbers.weight * residuals[task.name]
        if isinstance(task, SelectionTask):
            pulls[task.name] = np.zeros(p.diagonal.size)
            pulls[task.name][np.arange(p.diagonal.size)[task.columns]] = cost
        else:
            pulls[task.name] = cost @ p.rows[rows.places[task.name]]
    for row in np.flatnonzero(multipliers).tolist():
        limit = rows.names[row]
        pulls[limit] = pulls.get(limit, 0.0) + multipliers[row] * p.inequality[row]
    _, sizes, axes = np.linalg.svd(p.equality, full_matrices=False)
    axes = axes[sizes > 1e-9 * sizes.max(initial=0.0)]
    found = {}
    for name in (task.name for task in tasks if is_far(task, rows, residuals)):
        free = pulls[name] - axes.T @ (axes @ pulls[name])
        shares = {
            other: -float(pull @ free / (free @ free)) for other, pull in pulls.items() if other != name
        }
        strong = [
            other for other in sorted(shares, key=lambda other: -shares[other]) if shares[other] > OPPOSES
        ]
        firm = np.linalg.norm(free) < STUCK * np.linalg.norm(pulls[name])
        found[name] = ("contacts and hard tasks",) if firm else tuple(strong) or ("the reach of the robot",)
    return found


def is_far(task: Task, rows: RowStore, residuals: Mapping[str, Array]) -> bool:
    """Return true for a task whose residual is beyond that of an error with which it is reached."""
    gains = rows.error_gain(task)
    return any(
        size > NEAR.get(unit, NEAR["m"]) * (float(gains[part].max()) or 1.0)
        for unit, part, size in task.sizes(residuals[task.name])
    )
