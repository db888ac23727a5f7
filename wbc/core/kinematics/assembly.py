"""Assembly of the QP of velocities: rows of fixed places, filled at every step.

Variables are the generalised velocities v (base, joints).

    minimise   ½ Σ weight · (J v − target velocity − rate · error)²
               + ½ (regularisation + damping · Σ weight · error²) v²
    subject to J_c v = rate · error of each contact, and of each hard task
               velocities of joints, distances, the centre of mass … within their bounds

The second cost is the damping of Levenberg and Marquardt by the error that is left: near a singular posture a target
that is far away causes no high speed, and at the target nothing is damped. A rate acts as 1/dt at most: beyond it, a
step would go past the target.

    equalities    contacts | hard motion tasks | hard selections
    soft rows     contacts that may yield | motion tasks
    inequalities  limits
    beside them   soft selections, which are a diagonal | rows of lower levels

The same rows with a rate of one and steps in place of velocities are a step of Gauss and Newton towards all targets.

Source: T. Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method", T-RO 27(5), 2011.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc.base.numbers import Array
from wbc.core.kinematics.solution import Achieved, holding
from wbc.core.limits.base import BACK, Attainable, Limit
from wbc.core.limits.joint import JointLimits
from wbc.core.qp.assembly import saturated
from wbc.core.qp.closure import LoopClosure
from wbc.core.qp.contact import Contact
from wbc.core.qp.diagnosis import groups_not_finite
from wbc.core.qp.motion import Rows, has_first_order
from wbc.core.qp.solving.problem import Problem
from wbc.core.qp.task import SelectionTask, Task
from wbc.core.robot import Robot

_NONE = np.zeros((0, 0))
"""Stand-in for the Jacobian of a selection, which a task does not fill."""

HARD = 1e3
"""Cost per squared error of a hard row, and per squared violation of a limit, in the cost of a configuration."""

LOWER = 1e-4
"""Factor of the costs of a level against those of the one before in the cost of a configuration."""


@dataclass(slots=True)
class _ContactSlot:
    """Place of one contact in the QP, views of its values there, and the state that they are written for."""

    contact: Contact
    fill: Callable[[Array, Array], None]
    equalities: slice | None  # its rows among the equalities; None where its motion is a cost
    jacobian: Array
    values: Rows
    revision: int = -1
    engaged: bool | None = None


@dataclass(slots=True)
class Level:
    """Rows of one of the lower levels of priority, and their damping as of the last step."""

    matrix: Array
    target: Array
    weight: Array
    rows: slice  # among all rows
    cost: Array  # weighted errors
    damping: float


class VelocityAssembly:
    """The QP of some tasks, contacts and limits; made anew when one is added or removed.

    Attributes:
        problem: The QP of the first level.
        lower: Rows of the lower levels, the more important first.
        names: Name of each inequality, for reports.
        places: Name of a task → its rows among the residuals.
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
    ) -> None:
        """Allocate the problem and give each of these items, which are bound to the robot, its views."""
        self._robot, self._regularisation, self._per_error = robot, regularisation, damping
        first = levels[0]
        for task in (task for level in levels for task in level):
            task.detach()
        hard = [task for task in first if task.hard]
        hard.sort(key=lambda task: isinstance(task, SelectionTask))
        soft = [task for task in first if not (isinstance(task, SelectionTask) or task.hard)]
        selections = [task for task in first if isinstance(task, SelectionTask) and not task.hard]
        firm = [contact for contact in contacts if contact.motion_weight is None]
        yielding = [contact for contact in contacts if contact.motion_weight is not None]

        nv = robot.nv
        n_eq = sum(each.dim for each in (*firm, *hard))
        n_soft = sum(each.dim for each in (*yielding, *soft))
        n_lower = [sum(task.dim for task in level) for level in levels[1:]]
        n_selected = sum(task.dim for task in selections)
        n_first = n_eq + n_soft
        self.problem = p = Problem(nv, 0, nv, n_eq, n_soft, sum(limit.dim for limit in limits))
        p.n_physics = 0
        total = n_first + sum(n_lower) + n_selected
        self._rows, self._targets = Rows.zeros(total), np.zeros(total)
        self._excess = np.zeros(total)
        self._gain, self._per_bound = (
            np.zeros(total),
            np.zeros(total),
        )  # rate, 1/s, and 1 / bound of the error
        p.target, p.soft_weight = self._targets[:n_first], self._rows.weight[n_eq:n_first]
        self._lower_matrix = np.zeros((sum(n_lower), nv))
        self._cost = np.zeros(total)

        self._slots: list[_ContactSlot] = []
        self._tasks = [task for level in levels for task in level]
        self._motion: list[tuple[Task, Callable[[Array, Array], None] | None, Array, Array, Array]] = []
        self._selection: list[tuple[Task, Rows]] = []
        self._diagonal: list[tuple[Any, Array, Array]] = []  # columns, weights, targets of soft selections
        self._selected: list[tuple[Any, slice]] = []  # their columns and places
        self._selected_cost = np.zeros(nv)  # sum of their weights on the diagonal
        self._bounded: list[tuple[Task, slice]] = []
        self._momenta: list[tuple[Array, Array, Array]] = []  # Jacobian, target, error of tasks on a velocity
        self._kept: list[tuple[Any, Array]] = []  # columns and targets of selections that keep velocities
        self.places: dict[str, slice] = {}

        at = self._place_contacts(firm, 0)
        at = self._place_tasks(hard, at, p.rows)
        at = self._place_contacts(yielding, at)
        at = self._place_tasks(soft, at, p.rows)
        self.lower: list[Level] = []
        for level, count in zip(levels[1:], n_lower, strict=True):
            rows = slice(at, at + count)
            at = self._place_tasks(level, at, self._lower_matrix, n_first)
            matrix = self._lower_matrix[rows.start - n_first : rows.stop - n_first]
            self.lower.append(
                Level(
                    matrix,
                    self._targets[rows],
                    self._rows.weight[rows],
                    rows,
                    self._cost[rows],
                    regularisation,
                )
            )
        self._place_tasks(selections, at, None)
        # The single soft selection, such as a posture, on consecutive coordinates: the usual case.
        self._posture: tuple[Array, Array, Array] | None = None
        if len(self._diagonal) == 1 and isinstance(self._diagonal[0][0], slice):
            columns, weight, target = self._diagonal[0]
            self._posture = p.linear[columns], weight, target
        self._soft = slice(n_eq, n_first)  # rows whose errors damp
        self._soft_weight, self._soft_error, self._soft_cost = (
            each[self._soft] for each in (self._rows.weight, self._rows.error, self._cost)
        )
        self._hard = n_eq

        self._limits: list[tuple[Limit, Array, Array, Array]] = []
        names: list[str] = []
        at = 0
        single = 0
        for limit in sorted(limits, key=lambda limit: not isinstance(limit, JointLimits)):
            rows = slice(at, at + limit.dim)
            p.inequality_groups[limit.name] = rows
            self._limits.append((limit, p.inequality[rows], p.lower[rows], p.upper[rows]))
            per_joint = isinstance(limit, JointLimits)
            names += [f"limits of {j}" for j in robot.joint_names] if per_joint else [limit.name] * limit.dim
            at = rows.stop
            single = at if per_joint else single
        many, self._many = slice(single, None), at > single
        joints = (p.lower[:single], p.upper[:single]) if single else None
        self._attainable = Attainable(p.inequality[many], p.lower[many], p.upper[many], joints, BACK)
        p.yielding[:] = 1
        p.yielding[:single] = 2
        self.names = tuple(names)
        self._standing = np.zeros(at)  # values of the limits' rows without a step
        self._dt, self._stamp, self.damping = 0.0, -1, regularisation

    # ---- layout -------------------------------------------------------------------------------------------------

    def _place_contacts(self, contacts: Sequence[Contact], at: int) -> int:
        """Place contacts from a row on; return the next row."""
        p = self.problem
        for contact in contacts:
            rows = slice(at, at + contact.dim)
            view = self._rows.view(rows)
            contact.attach(view)
            firm = rows.stop <= p.n_eq
            if firm:
                p.equality_groups[f"motion of contact '{contact.name}'"] = rows
            fill = contact.first_order if has_first_order(contact) else _with_drift(contact, view.drift)
            self._slots.append(_ContactSlot(contact, fill, rows if firm else None, p.rows[rows], view))
            at = rows.stop
        return at

    def _place_tasks(self, tasks: Sequence[Task], at: int, matrix: Array | None, first: int = 0) -> int:
        """Place tasks from a row on, in a matrix whose first row is `first`; return the next row."""
        for task in tasks:
            rows = self.places[task.name] = slice(at, at + task.dim)
            view = self._rows.view(rows)
            task.attach(view)
            self._bounded.append((task, rows))
            jacobian = None if matrix is None else matrix[rows.start - first : rows.stop - first]
            if isinstance(task, SelectionTask):
                self._selection.append((task, view))
                if task.of_velocity:
                    self._kept.append((task.columns, self._targets[rows]))
                if jacobian is None:
                    self._diagonal.append((task.columns, view.weight, self._targets[rows]))
                    self._selected.append((task.columns, rows))
                else:
                    jacobian[:, np.arange(self._robot.nv)[task.columns]] = np.eye(task.dim)
            elif jacobian is not None:
                self._motion.append((task, task.quick(), jacobian, view.error, view.drift))
                if task.of_velocity:
                    self._momenta.append((jacobian, self._targets[rows], view.error))
            if task.hard:
                self.problem.hard_tasks[rows] = True
                self.problem.equality_groups[f"hard task '{task.name}'"] = rows
            at = rows.stop
        return at

    # ---- a step -------------------------------------------------------------------------------------------------

    def write(self, dt: float) -> None:
        """Fill the QP of velocities at the present state of the robot, for a control period, s."""
        self._fill()
        self._take_gains(dt)
        rows, targets = self._rows, self._targets
        error, soft_error = rows.error, self._soft_error
        share = np.multiply(error, self._per_bound, out=self._excess)
        if not share.dot(share) <= 1.0:  # otherwise none is beyond its bound
            error = saturated(rows, self._excess, self._bounded)
            soft_error = error[self._soft]
        np.multiply(self._gain, error, out=targets)
        targets += rows.velocity
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
            limit.write_velocity(dt, matrix, lower, upper)
        if self._many:
            self._attainable.cut()

    def _take_gains(self, dt: float) -> None:
        """Take rates, weights and bounds of errors over where one has changed, or the period, s."""
        stamp = 0
        for task in self._tasks:
            stamp += task.revision
        if stamp == self._stamp and dt == self._dt:
            return
        self._stamp, self._dt = stamp, dt
        np.minimum(self._rows.rate, 1.0 / dt, out=self._gain)
        np.divide(1.0, self._rows.bound, out=self._per_bound)
        self._selected_cost.fill(0.0)
        for columns, weight, _ in self._diagonal:
            self._selected_cost[columns] += weight

    def write_step(self) -> float:
        """Fill the QP of a step towards all targets; return the cost of the present configuration."""
        self._fill()
        self._take_gains(self._dt or 1.0)
        rows, targets = self._rows, self._targets
        targets[:] = rows.error
        for limit, matrix, lower, upper in self._limits:
            limit.write_step(matrix, lower, upper)
        for level in self.lower:
            level.damping = self.damping
        return self._cost_of(rows.error, self._standing)

    def cost_after(self, step: Array) -> float:
        """Return the cost of the configuration after a step, were the rows that `write_step` has filled exact."""
        values = self.problem.rows.dot(step)
        left = self.achieved(step, values).residuals
        return self._cost_of(left, values[self.problem.target.size :])

    def _cost_of(self, error: Array, values: Array) -> float:
        """Return the cost of the errors of all rows, and of limits that the values of their rows violate."""
        p, cost = self.problem, np.multiply(self._rows.weight, error, out=self._cost)
        cost[: self._hard] = HARD * error[: self._hard]
        for number, level in enumerate(self.lower, 1):
            cost[level.rows] *= LOWER**number
        beyond = np.maximum(np.maximum(p.lower - values, values - p.upper), 0.0)
        return float(cost.dot(error)) + HARD * float(beyond.dot(beyond))

    def holding(self, multipliers: Array, tolerance: float) -> tuple[str, ...]:
        """Return the names of the limits with multipliers that leave no more than a tolerance of room, each once."""
        p = self.problem
        full = np.where(multipliers > 0.0, p.upper < tolerance, p.lower > -tolerance)
        return holding(self.names, multipliers * full)

    def _fill(self) -> None:
        for slot in self._slots:
            self._write_contact(slot)
        for motion, quick, jacobian, error, drift in self._motion:
            if not motion.idle:
                if quick is None or motion._spared is not None:
                    motion.fill(jacobian, error, drift)
                else:
                    quick(jacobian, error)
        for selection, view in self._selection:
            selection.evaluate(_NONE, view.error, view.drift)

    def damp(self, damping: float) -> None:
        """Write the cost per squared velocity, or step, of every coordinate, and those of selections."""
        p = self.problem
        self.damping = damping
        np.add(self._selected_cost, damping, out=p.diagonal)
        if self._posture is not None:
            linear, weight, target = self._posture
            np.multiply(weight, target, out=linear)
            return
        p.linear.fill(0.0)
        for columns, weight, target in self._diagonal:
            p.linear[columns] += weight * target

    def _write_contact(self, slot: _ContactSlot) -> None:
        contact, values = slot.contact, slot.values
        contact.advance(np.inf)  # there is no force to ramp
        engaged = contact.engaged
        if engaged:
            slot.fill(slot.jacobian, values.error)
        if engaged != slot.engaged:
            slot.engaged, slot.revision = engaged, -1
            if slot.equalities is not None:
                self.problem.set_empty(slot.equalities, np.full(contact.dim, not engaged))
            if not engaged:
                slot.jacobian[:], values.error[:], contact.velocity[:] = 0.0, 0.0, 0.0
        if slot.revision != contact.revision:
            slot.revision, self._stamp = contact.revision, -1
            values.rate[:] = contact.rate
            values.weight[:] = 0.0 if contact.motion_weight is None else contact.motion_weight

    def achieved(self, x: Array, values: Array) -> Achieved:
        """Return the velocities of all rows of generalised velocities x; `values` are those of the problem's."""
        lower = self._lower_matrix.dot(x) if self.lower else None
        return Achieved(x, values, lower, self._selected, self._targets.copy())

    def pull(self, task: Task) -> tuple[float, float]:
        """Return the length of the gradient of the cost of a task, and its share of the greatest for such an error."""
        rows = self.places[task.name]
        weighted = self._rows.weight[rows] * self._rows.error[rows]
        if isinstance(task, SelectionTask):
            return float(np.linalg.norm(weighted)), 1.0
        n_first = self.problem.target.size
        inside = rows.stop <= n_first
        jacobian = (
            self.problem.rows[rows]
            if inside
            else self._lower_matrix[rows.start - n_first : rows.stop - n_first]
        )
        return _pull(jacobian, weighted)

    def contact_errors(self) -> Mapping[str, tuple[float, float]]:
        """Return the distance (m) and the angle (rad) of each contact that is active from its place."""
        found = dict[str, tuple[float, float]]()
        for slot in self._slots:
            if slot.engaged:
                contact, error = slot.contact, slot.values.error
                sizes = float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))
                found[contact.name] = contact.gap() if isinstance(contact, LoopClosure) else sizes
        return found

    def contact_pulls(self) -> Mapping[str, tuple[float, float]]:
        """Return what `pull` returns, of each contact that is active."""
        return {
            slot.contact.name: _pull(slot.jacobian, slot.values.error) for slot in self._slots if slot.engaged
        }

    def not_finite(self) -> dict[str, float]:
        """Return what has NaN or infinity in it: name of a task or of a group of constraints → NaN."""
        first = [task for task in self._tasks if self.places[task.name].stop <= self.problem.target.size]
        found = groups_not_finite(self.problem, first, self.places)
        for task in self._tasks:
            rows, n_first = self.places[task.name], self.problem.target.size
            values = self._lower_matrix[max(rows.start - n_first, 0) : max(rows.stop - n_first, 0)]
            if not (np.isfinite(self._targets[rows]).all() and np.isfinite(values).all()):
                found[f"{'hard ' * task.hard}task '{task.name}'"] = float("nan")
        return found

    def violated(self, tolerance: float) -> dict[str, str]:
        """Return the limits whose rows are violated by more than a tolerance → by how much."""
        found = {}
        for limit, _, lower, upper in self._limits:
            beyond = np.maximum(lower, -upper)
            if beyond.size and beyond.max() > tolerance:
                row = int(beyond.argmax())
                found[limit.name] = limit.violation(row, float(beyond[row]))
        return found


def _pull(jacobian: Array, weighted: Array) -> tuple[float, float]:
    """Return the length of a gradient, and its share of the greatest for such an error."""
    most = float(np.linalg.norm(jacobian, 2) * np.linalg.norm(weighted))
    pull = float(np.linalg.norm(jacobian.T.dot(weighted)))
    return pull, pull / most if most > 0.0 else 0.0


def _with_drift(contact: Contact, drift: Array) -> Callable[[Array, Array], None]:
    """Return what fills the rows of a contact whose class has no `first_order`; the drift is left alone."""
    return lambda jacobian, error: contact.evaluate(jacobian, error, drift)
