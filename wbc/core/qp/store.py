"""Row store: tasks, contacts and limits become rows of fixed places in one QP, filled at every tick.

The order of the QP is that of its variables: 1 for velocities (inverse kinematics), 2 for accelerations (dynamics).
What belongs to one order alone is in the classes of `wbc.core.kinematics.assembly` and `wbc.core.qp.assembly`.

    equalities    dynamics (order 2) | contacts | hard tasks
    soft rows     contacts that may yield | tasks | beside the QP, lower levels (order 1)
    diagonal      tasks that select single coordinates
    inequalities  torques (order 2) | joint limits | cones of forces (order 2) | other limits

From the contacts on, all rows share their arithmetic. A contact that is switched, or a task without a weight, changes
numbers and no sizes, so nothing is allocated between changes of the layout.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from wbc.base.numbers import Array, scalar
from wbc.base.vectors import largest
from wbc.core.limits.base import ATTAINABLE, BACK, Limit, demands
from wbc.core.limits.joint import JointLimits, TorqueLimits
from wbc.core.qp.contact import Contact
from wbc.core.qp.motion import NONE, Block, Motion, RowNumbers
from wbc.core.qp.solving.problem import Problem
from wbc.core.qp.task import SelectionTask, Task, VariableTask
from wbc.core.robot import Robot

NOTHING = np.zeros((0, 0))
"""Stand-in for what a task does not fill: the Jacobian of a selection, the drift of a task on variables."""

SHARE = 0.9
"""Share of what the joints' bounds allow up to which a limit asks for it: all of it would leave one velocity alone."""

SELECTION = 2
"""Place of tasks on single coordinates among the kinds of tasks."""


def rows_in(items: Iterable[Motion | Limit]) -> int:
    """Return the number of rows of some tasks, contacts or limits."""
    return sum(item.dim for item in items)


def consecutive(*counts: int) -> tuple[slice, ...]:
    """Return places one after the other, from 0 on."""
    return tuple(itertools.starmap(slice, itertools.pairwise([0, *itertools.accumulate(counts)])))


def _kind(task: Task) -> int:
    """Order of tasks among rows: on a motion, on variables of the QP, on single coordinates."""
    return SELECTION if isinstance(task, SelectionTask) else int(isinstance(task, VariableTask))


class RowStore:
    """Rows of tasks, contacts and limits in one QP; made anew when one of these is added or removed.

    Attributes:
        problem: The QP.
        targets: Targets of equalities and soft rows of the problem, of lower levels, and of selections.
        places: Name of a task → its rows among the targets.
        names: Name of each inequality, for reports.
    """

    def __init__(
        self,
        robot: Robot,
        levels: Sequence[Sequence[Task]],
        contacts: Sequence[Contact],
        limits: Sequence[Limit],
        order: Literal[1, 2],
    ) -> None:
        """Allocate the QP and place these items, which are bound to the robot; the first level is that of the QP."""
        self._robot, self._order = robot, order
        dynamics = order == 2
        hard = sorted((task for task in levels[0] if task.hard), key=_kind)
        soft = sorted((task for task in levels[0] if not task.hard and _kind(task) < SELECTION), key=_kind)
        lower = [task for level in levels[1:] for task in level]
        selections = [task for task in levels[0] if not task.hard and isinstance(task, SelectionTask)]
        reserved = [contact for contact in contacts if dynamics or not contact._yields]  # equalities
        yielding = [contact for contact in contacts if contact._yields]
        forces = contacts if dynamics else ()
        single = [limit for limit in limits if isinstance(limit, JointLimits)]
        many = [limit for limit in limits if not isinstance(limit, (JointLimits, TorqueLimits))]

        nv, n_torques = robot.nv, robot.na if dynamics else 0
        self._start = robot.base_dof + robot.passive.size if dynamics else 0  # the first row that is stored
        n_eq = self._start + rows_in(reserved) + rows_in(hard)
        n_cones = sum(each.cone.shape[0] + len(each.ranged) for each in forces)
        self._torques, self._joints, self._cones, self._others = consecutive(
            n_torques, rows_in(single), n_cones, rows_in(many)
        )
        self._of_qp, self._of_lower, self._of_selections = qp, beside, selected = consecutive(
            n_eq + rows_in(yielding) + rows_in(soft), rows_in(lower), rows_in(selections)
        )
        self.problem = p = Problem(
            nv, n_torques, nv + rows_in(forces), n_eq, qp.stop - n_eq, self._others.stop
        )
        p.n_physics = self._start
        self.targets = np.zeros(selected.stop)
        p.target, self._selected_target = self.targets[qp], self.targets[selected]
        self._lower_matrix = np.zeros((rows_in(lower), nv))
        n = selected.stop - self._start
        self._numbers = RowNumbers.zeros(n)
        self._error, self._drift = np.zeros(n), np.zeros(n)
        self._scratch, self._per_bound = np.zeros(n), np.zeros(n)
        self._gain: Array = self._numbers.stiffness
        p.soft_weight = self._numbers.weight[n_eq - self._start : qp.stop - self._start]

        self.places: dict[str, slice] = {}
        self._contacts: list[Block] = []
        self._tasks: list[Block] = []  # those on a motion
        self._on_variables: list[Block] = []
        self._changed = True  # numbers that do not change in every tick
        items = (*reserved, *hard, *yielding, *soft, *lower, *selections)
        _, *places = consecutive(self._start, *(item.dim for item in items))
        following = iter(places)
        equalities = {contact.name: next(following) for contact in reserved}
        for task in hard:
            self._place_task(task, next(following), p.rows)
        for contact in contacts:
            self._place_contact(contact, equalities.get(contact.name), following)
        for task in soft:
            self._place_task(task, next(following), p.rows)
        for task in lower:
            self._place_task(task, next(following), self._lower_matrix, beside.start)
        for task in selections:
            self._place_task(task, next(following), None)
        self._place_selections(selections)

        if dynamics:
            p.inequality_groups["torque limits"] = self._torques
        self._limits: list[tuple[Limit, Array, Array, Array]] = []
        torques = [f"torque of {joint}" for joint in robot.joint_names][:n_torques]
        joints = self._place_limits(single, self._joints.start)
        cones = list[str]()
        for each in forces:
            what = "normal force" if len(each.ranged) == 1 else "wrench"
            cones += [f"wrench cone of {each.name}"] * each.cone.shape[0]
            cones += [f"{what} of {each.name}"] * len(each.ranged)
        self.names = (*torques, *joints, *cones, *self._place_limits(many, self._others.start))
        bounds = (p.lower[self._joints], p.upper[self._joints]) if single else None
        # Limits on many joints, intervals of single ones, which are the last coordinates, and what is asked of each.
        self._asking = p.inequality[self._others, :nv], p.lower[self._others], p.upper[self._others]
        self._single, self._most = bounds, (ATTAINABLE if dynamics else BACK) / SHARE
        self._low, self._high = np.full((2, nv), [[-self._most], [self._most]])
        self._demands = bool(many)
        p.yielding[self._others], p.yielding[self._joints] = 1, 2

    # ---- layout -------------------------------------------------------------------------------------------------

    def _place_contact(self, contact: Contact, reserved: slice | None, following: Iterator[slice]) -> None:
        """Place a contact in its equalities, or in the following soft rows where it may yield."""
        rows = next(following) if contact._yields or reserved is None else reserved
        block = self._block(contact, rows, self.problem.rows[rows, : self._robot.nv])
        block.reserved = reserved
        self._contacts.append(block)
        if reserved is not None:
            what = "force" if contact._yields else "motion"
            self.problem.equality_groups[f"{what} of contact '{contact.name}'"] = reserved

    def _place_task(self, task: Task, rows: slice, matrix: Array | None, first: int = 0) -> None:
        """Place a task in a matrix whose first row is `first`, or on the diagonal."""
        p, nv = self.problem, self._robot.nv
        self.places[task.name] = rows
        own = NOTHING if matrix is None else matrix[rows.start - first : rows.stop - first]
        if isinstance(task, VariableTask):
            inside = slice(rows.start - self._start, rows.stop - self._start)
            block = Block(task, inside, own, self.targets[rows], NOTHING)
            block.reserved = rows if task.hard else None
            self._on_variables.append(block)
        else:
            if matrix is not None:
                own[:, :nv] = task._unfilled()
            self._tasks.append(self._block(task, rows, own[:, :nv]))
        if task.hard:
            p.hard_tasks[rows] = True
            p.equality_groups[f"hard task '{task.name}'"] = rows

    def _block(self, item: Task | Contact, rows: slice, jacobian: Array) -> Block:
        inside = slice(rows.start - self._start, rows.stop - self._start)
        block = Block(item, inside, jacobian, self._error[inside], self._drift[inside], self._order)
        block.feed = self._numbers.feed[:, inside]
        return block

    def _place_selections(self, tasks: Sequence[SelectionTask]) -> None:
        """Find the coordinates of soft selections, and the places of their costs."""
        p, coordinates = self.problem, np.arange(self._robot.nv)
        self._columns: NDArray[np.intp] = np.concatenate(
            [coordinates[:0], *(coordinates[task.columns] for task in tasks)]
        )
        self._diagonal, self._linear = p.diagonal[: coordinates.size], p.linear[: coordinates.size]
        self._selected_weight = self._numbers.weight[self._error.size - self._columns.size :]
        self._selected_cost: Array = np.zeros(coordinates.size)  # sum of their weights at each coordinate
        self._even = scalar(0.0)  # cost of every coordinate, in half the time of a float
        # A single selection of consecutive coordinates, such as a posture, is the usual case.
        alone = len(tasks) == 1 and isinstance(tasks[0].columns, slice)
        self._alone = self._linear[tasks[0].columns] if alone else None

    def _place_limits(self, limits: Sequence[Limit], at: int) -> list[str]:
        """Place limits from an inequality on; return the names of their rows."""
        p, nv, names = self.problem, self._robot.nv, list[str]()
        for limit in limits:
            rows = p.inequality_groups[limit.name] = slice(at, at + limit.dim)
            self._limits.append((limit, p.inequality[rows, :nv], p.lower[rows], p.upper[rows]))
            if isinstance(limit, JointLimits):
                names += [f"limits of {joint}" for joint in self._robot.joint_names]
            else:
                names += [limit.name] * limit.dim
            at = rows.stop
        return names

    # ---- the tick -----------------------------------------------------------------------------------------------

    def _fill(self) -> None:
        """Fill Jacobians, errors and drifts at the present state, and take numbers over that have changed."""
        for block in self._contacts:
            contact = block.item
            engaged = contact.engaged
            if engaged != block.engaged or contact.revision != block.revision:
                self._take_contact(block, engaged)
            if engaged:
                block.evaluate(*block.full)
                if contact._fed:
                    block.feed[:] = contact._numbers.feed
        for block in self._tasks:
            task = block.item
            if task.revision != block.revision:
                self._take(block)
            if not task.idle:
                block.evaluate(*block.full)
                if block.trims:
                    block.trim()
                if task._fed:
                    block.feed[:] = task._numbers.feed
        if self._changed:
            self._take_gains()
            self._changed = False

    def _take(self, block: Block) -> None:
        """Take the numbers of a task over."""
        block.take()
        self._numbers.values[:, block.place], self._changed = block.item._numbers.values, True

    def _take_contact(self, block: Block, engaged: bool) -> None:
        """Take the numbers of a contact over, or empty the rows of one that is off."""
        contact = block.item
        if engaged != block.engaged:
            block.engaged = engaged
            if not engaged:
                block.clear()
            if block.reserved is not None:
                empty = engaged and contact._yields if self._order == 2 else not engaged
                self.problem.set_empty(block.reserved, np.full(contact.dim, empty))
        self._take(block)
        if not engaged:
            self._numbers.values[:, block.place] = NONE

    def _take_gains(self) -> None:
        """Compute what follows from weights and bounds."""
        np.divide(1.0, self._numbers.bound, out=self._per_bound)
        self._selected_cost[:] = np.bincount(self._columns, self._selected_weight, self._robot.nv)

    def _bounded_error(self) -> Array:
        """Return the errors of all rows as they act: those beyond the bounds of their tasks shortened."""
        error = self._error
        share = np.multiply(error, self._per_bound, out=self._scratch)
        if share.dot(share) <= 1.0:  # so none is beyond its bound
            return error
        beyond = np.abs(error, out=share)
        beyond -= self._numbers.bound
        if not largest(beyond) > 0.0:
            return error
        error = error.copy()
        for block in self._tasks:
            if largest(beyond[block.place]) > 0.0:
                block.item.saturate(error[block.place])
        return error

    def _write_diagonal(self, cost: float) -> None:
        """Write the costs of single coordinates: the same one for all, and those of selections."""
        self._even.fill(cost)
        np.add(self._selected_cost, self._even, out=self._diagonal)
        if self._alone is not None:
            np.multiply(self._selected_weight, self._selected_target, out=self._alone)
        else:
            pull = self._selected_weight * self._selected_target
            self._linear[:] = np.bincount(self._columns, pull, self._linear.size)

    def _cut_demands(self) -> None:
        """Cut off what limits on many joints demand, of which there is a row at least, at what the joints attain.

        A row of a limit that is violated demands a motion. The joints may be too slow for it, or at their own bounds.
        Then the row demands what they attain, so that it contradicts no interval of a joint.
        """
        (rows, lower, upper), low, high = self._asking, self._low, self._high
        # Where a joint must move, all rows may need all others.
        moved = self._single is not None and demands(*self._single)
        if not (moved or demands(lower, upper)):
            return
        if self._single is not None:
            least, most = self._single
            joints = slice(low.size - least.size, None)
            low[joints] = np.maximum(least, np.minimum(most, -self._most))
            high[joints] = np.minimum(most, np.maximum(least, self._most))
        chosen = slice(None) if moved else (lower > 0.0) | (upper < 0.0)
        rows = rows[chosen]
        middle, reach = rows.dot(0.5 * (low + high)), np.abs(rows).dot(0.5 * SHARE * (high - low))
        lower[chosen] = np.minimum(lower[chosen], middle + reach)
        upper[chosen] = np.maximum(upper[chosen], middle - reach)

    # ---- results ------------------------------------------------------------------------------------------------

    def residuals(self, x: Array, values: Array, targets: Array) -> Array:
        """Return achieved minus wanted of all targets, a new array, of variables x.

        `values` are all rows times x, those beside the QP behind its own.
        """
        residual = np.empty(self.targets.size)
        residual[self._of_qp] = values[self._of_qp]
        if self._lower_matrix.size:
            residual[self._of_lower] = values[len(self.problem.rows) :]
        residual[self._of_selections] = x.take(self._columns)
        residual -= targets
        return residual

    def error_gain(self, task: Task) -> Array:
        """Return what a task asks for per error, shape (dim,): velocity, 1/s, or acceleration, 1/s²."""
        rows = self.places[task.name]
        return np.asarray(self._gain[rows.start - self._start : rows.stop - self._start])

    def error_of(self, task: Task) -> Array:
        """Return the error of a task at the last tick, shape (dim,), a copy; zero for one that is not there."""
        found = [block.error for block in self._tasks if block.item is task]
        return found[0].copy() if found else np.zeros(task.dim)

    def not_finite(self) -> dict[str, float]:
        """Return what has NaN or infinity in it: name of a task or of a group of constraints → NaN."""
        p = self.problem
        finite: NDArray[np.bool_] = np.logical_and.reduce(np.isfinite(p.rows), axis=1)
        finite[: p.target.size] &= np.isfinite(p.target)
        finite[p.target.size :] &= (p.lower < np.inf) & (p.upper > -np.inf)
        groups = {name: finite[rows] for name, rows in p.equality_groups.items()}
        groups |= {name: finite[p.target.size :][rows] for name, rows in p.inequality_groups.items()}
        found = {name: float("nan") for name, inside in groups.items() if not inside.all()}
        for block in (*self._tasks, *self._on_variables):
            task = block.item
            target = self.targets[self._start :][block.place]
            if not (np.isfinite(target).all() and np.isfinite(block.jacobian).all()):
                found[f"{'hard ' * task.hard}task '{task.name}'"] = float("nan")
        return found
