"""Strict priorities: each level decides on what the levels before it leave free.

The velocities of a level are x + N z, where x are those of the levels before, and N is the projection onto the
velocities that change none of their rows, nor those of contacts and hard tasks. Limits hold at every level. The size of
a level's QP does not depend on the rank of N. It always has a solution, because standing still within a level is one.

Source: O. Kanoun, F. Lamiraux, P.-B. Wieber, "Kinematic control of redundant manipulators: generalizing the
task-priority framework to inequality tasks", T-RO 27(4), 2011.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import daqp
import numpy as np

from wbc.base.numbers import Array
from wbc.core.kinematics.assembly import Level
from wbc.core.qp.solving.problem import Problem
from wbc.core.qp.solving.solver import RAISED, Status

RANK = 1e-6
"""Ratio to the largest singular value below which rows leave a direction free."""


def solve_levels(
    problem: Problem, x: Array, lower: Sequence[Level], damping: float
) -> tuple[Array, Array, Status | None]:
    """Return the velocities of all levels, the multipliers of the inequalities at the last one, and why there are none.

    `x` are the velocities of the first level, shape (nv,), `damping` the cost per squared velocity there. The last
    result is None where all levels are solved.
    """
    p, n = problem, problem.diagonal.size
    sense = np.zeros(p.lower.size, dtype=np.intc)
    multipliers = np.zeros(p.lower.size)
    decided = [p.equality, p.soft[p.soft_weight > 0.0], np.eye(n)[p.diagonal > damping]]
    for level in lower:
        free = projection(np.vstack(decided))
        wanted = level.weight > 0.0
        decided.append(level.matrix[wanted])
        rows = level.matrix[wanted].dot(free)
        weighted = rows * level.weight[wanted][:, None]
        hessian = weighted.T.dot(rows)
        hessian.reshape(-1)[:: n + 1] += level.damping
        gradient = -weighted.T.dot(level.target[wanted] - level.matrix[wanted].dot(x))
        reached = p.inequality.dot(x)
        upper, least = np.maximum(p.upper - reached, 0.0), np.minimum(p.lower - reached, 0.0)
        rows_free = np.ascontiguousarray(p.inequality.dot(free))
        if not math.isfinite(gradient.dot(gradient)):
            return x, multipliers, Status.REFUSED
        most = float(hessian.diagonal().max())
        for share in (0.0, *RAISED):
            costs = hessian + share * most * np.eye(n) if share else hessian
            step, _, flag, info = daqp.solve(costs, gradient, rows_free, upper, least, sense)
            if flag >= 1:
                break
        else:
            return x, multipliers, Status.INFEASIBLE
        x, multipliers = x + free.dot(step), info["lam"]
    return x, multipliers, None


def projection(rows: Array) -> Array:
    """Return the projection onto the vectors that rows map to zero, shape (n, n)."""
    n = rows.shape[1]
    _, values, right = np.linalg.svd(rows, full_matrices=False)
    kept = right[values > RANK * max(float(values.max(initial=0.0)), 1e-12)]
    return np.asarray(np.eye(n) - kept.T.dot(kept))
