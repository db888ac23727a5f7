"""Assembly of the QP of velocities: targets, damping and levels of tasks.

Variables are the generalised velocities v (base, joints). The rows have fixed places, see `wbc.core.qp.store`.

    minimise   ½ Σ weight · (J v − target velocity − rate · error)²
               + ½ (regularisation + damping · Σ weight · error²) v²
    subject to J_c v = rate · error of each contact, and of each hard task
               velocities of joints, distances, the centre of mass … within their bounds

The second cost is the damping of Levenberg and Marquardt by the error that is left: near a singular posture a target
that is far away causes no high speed, and at the target nothing is damped. A rate acts as 1/dt at most: beyond it, a
step would go past the target.

The same rows with a rate of one and steps in place of velocities are a step of Gauss and Newton towards all targets.

Source: T. Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method", T-RO 27(5), 2011.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import daqp
import numpy as np

from wbc.base.numbers import Array
from wbc.core.limits.base import Limit
from wbc.core.qp.contact import Contact
from wbc.core.qp.motion import Block
from wbc.core.qp.solving.problem import Problem
from wbc.core.qp.solving.solution import holding
from wbc.core.qp.solving.solver import RAISED, Status
from wbc.core.qp.store import RowStore, consecutive, rows_in
from wbc.core.qp.task import SelectionTask, Task
from wbc.core.robot import Robot

HARD = 1e3
"""Cost per squared error of a hard row, and per squared violation of a limit, in the cost of a configuration."""

LOWER = 1e-4
"""Factor of the costs of a level against those of the one before in the cost of a configuration."""


@dataclass(slots=True)
class Level:
    """Rows of one of the lower levels of priority, and their damping as of the last step."""

    matrix: Array
    target: Array
    weight: Array
    rows: slice  # among all rows
    cost: Array  # weighted errors
    damping: float


class VelocityAssembly(RowStore):
    """The QP of some tasks, contacts and limits; made anew when one is added or removed.

    Attributes:
        lower: Rows of the lower levels, the more important first.
        damping: Cost per squared velocity of every coordinate as of the last step.
    """

    def __init__(
        self,
        robot: Robot,
        levels: Sequence[Sequence[Task]],
        contacts: Sequence[Contact],
        limits: Sequence[Limit],
        regularisation: float,
        damping: float,
        dt: float,
    ) -> None:
        """Allocate the problem for a control period, s, and place these items, which are bound to the robot."""
        super().__init__(robot, levels, contacts, limits, 1)
        self._regularisation, self._per_error = regularisation, damping
        p, n = self.problem, self.targets.size
        self._gain, self._cost = np.zeros(n), np.zeros(n)  # rate that acts, 1/s; weighted errors
        self.lower: list[Level] = []
        for rows in consecutive(p.target.size, *(rows_in(level) for level in levels[1:]))[1:]:
            matrix = self._lower_matrix[rows.start - p.target.size : rows.stop - p.target.size]
            weight, cost = self._numbers.weight[rows], self._cost[rows]
            self.lower.append(Level(matrix, self.targets[rows], weight, rows, cost, regularisation))
        self._soft = slice(p.n_eq, p.target.size)  # rows whose errors damp
        self._soft_error, self._soft_cost = self._error[self._soft], self._cost[self._soft]
        self._soft_weight, self._velocity = p.soft_weight, self._numbers.velocity
        # Tasks on a velocity: momenta with Jacobian, target and error, selections with columns and targets.
        on_velocity = [block for block in self._tasks if block.item.of_velocity]
        self._momenta = [
            (block.jacobian, self.targets[block.place], block.error)
            for block in on_velocity
            if not isinstance(block.item, SelectionTask)
        ]
        self._kept = [
            (block.item.columns, self.targets[block.place])
            for block in on_velocity
            if isinstance(block.item, SelectionTask)
        ]
        self._standing = np.zeros(len(self.names))  # values of the limits' rows without a step
        self._dt, self.damping = dt, regularisation

    # ---- a step -------------------------------------------------------------------------------------------------

    def write(self) -> None:
        """Fill the QP of velocities at the present state of the robot."""
        self._fill()
        error, soft_error, targets = self._bounded_error(), self._soft_error, self.targets
        if error is not self._error:
            soft_error = error[self._soft]
        np.multiply(self._gain, error, out=targets)
        targets += self._velocity
        for jacobian, momentum, lacking in self._momenta:
            np.add(lacking, jacobian.dot(self._robot.v), out=momentum)
            lacking.fill(0.0)  # it is no distance, and damps nothing
        for columns, kept in self._kept:
            kept[:] = self._robot.v[columns]
        cost = np.multiply(self._soft_weight, soft_error, out=self._soft_cost)
        self.damp(self._regularisation + self._per_error * float(cost.dot(soft_error)))
        for level in self.lower:
            left = error[level.rows]
            cost = np.multiply(level.weight, left, out=level.cost)
            level.damping = self._regularisation + self._per_error * float(cost.dot(left))
        for limit, matrix, lower, upper in self._limits:
            limit.write_velocity(self._dt, matrix, lower, upper)
        if self._demands:
            self._cut_demands()

    def _take_gains(self) -> None:
        """Compute what follows from rates, weights and bounds."""
        super()._take_gains()
        np.minimum(self._numbers.rate, 1.0 / self._dt, out=self._gain)

    def write_step(self) -> float:
        """Fill the QP of a step towards all targets; return the cost of the present configuration."""
        self._fill()
        self.targets[:] = self._error
        for limit, matrix, lower, upper in self._limits:
            limit.write_step(matrix, lower, upper)
        for level in self.lower:
            level.damping = self.damping
        return self._cost_of(self._error, self._standing)

    def cost_after(self, step: Array) -> float:
        """Return the cost of the configuration after a step, were the rows that `write_step` has filled exact."""
        p, values = self.problem, self.values(step)
        left = self.residuals(step, values, self.targets)
        return self._cost_of(left, values[p.target.size : len(p.rows)])

    def values(self, x: Array) -> Array:
        """Return all rows times velocities or a step, shape (nv,), those of the lower levels last; a new array."""
        values: Array = self.problem.rows.dot(x)
        return np.concatenate((values, self._lower_matrix.dot(x))) if self.lower else values

    def _cost_of(self, error: Array, values: Array) -> float:
        """Return the cost of the errors of all rows, and of limits that the values of their rows violate."""
        p, cost = self.problem, np.multiply(self._numbers.weight, error, out=self._cost)
        cost[: p.n_eq] = HARD * error[: p.n_eq]
        for number, level in enumerate(self.lower, 1):
            cost[level.rows] *= LOWER**number
        beyond = np.maximum(np.maximum(p.lower - values, values - p.upper), 0.0)
        return float(cost.dot(error)) + HARD * float(beyond.dot(beyond))

    def holding(self, multipliers: Array, tolerance: float) -> tuple[str, ...]:
        """Return the names of the limits with multipliers that leave no more than a tolerance of room, each once."""
        p = self.problem
        full = np.where(multipliers > 0.0, p.upper < tolerance, p.lower > -tolerance)
        return tuple(dict.fromkeys(holding(self.names, multipliers * full)))

    def damp(self, damping: float) -> None:
        """Write the cost per squared velocity, or step, of every coordinate, and those of selections."""
        self.damping = damping
        self._write_diagonal(damping)

    @property
    def present(self) -> list[Block]:
        """Rows of all tasks, and of the contacts that hold their frames."""
        return [*self._tasks, *(block for block in self._contacts if block.engaged)]

    def pull(self, block: Block) -> tuple[float, float]:
        """Return the length of the gradient of the cost of some rows, and its share of the greatest for such an error.

        A contact counts as if each of its rows had a weight of one.
        """
        task = isinstance(block.item, Task)
        weighted = block.error * self._numbers.weight[block.place] if task else block.error
        if isinstance(block.item, SelectionTask):
            return float(np.linalg.norm(weighted)), 1.0
        most = float(np.linalg.norm(block.jacobian, 2) * np.linalg.norm(weighted))
        pull = float(np.linalg.norm(block.jacobian.T.dot(weighted)))
        return pull, pull / most if most > 0.0 else 0.0

    def violated(self, tolerance: float) -> dict[str, str]:
        """Return the limits whose rows are violated by more than a tolerance → by how much."""
        found = {}
        for limit, _, lower, upper in self._limits:
            beyond = np.maximum(lower, -upper)
            if beyond.size and beyond.max() > tolerance:
                row = int(beyond.argmax())
                found[limit.name] = limit.violation(row, float(beyond[row]))
        return found


RANK = 1e-6
"""Ratio to the largest singular value below which rows leave a direction free."""


def solve_levels(
    problem: Problem, x: Array, lower: Sequence[Level], damping: float
) -> tuple[Array, Array, Status | None]:
    """Return the velocities of all levels, the multipliers of the inequalities at the last one, and why there are none.

    The velocities of a level are x + N z, where x are those of the levels before, and N is the projection onto the
    velocities that change none of their rows, nor those of contacts and hard tasks. Limits hold at every level. The
    size of a level's QP does not depend on the rank of N. It always has a solution: standing still within a level.

    Source: O. Kanoun, F. Lamiraux, P.-B. Wieber, "Kinematic control of redundant manipulators: generalizing the
    task-priority framework to inequality tasks", T-RO 27(4), 2011.

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
