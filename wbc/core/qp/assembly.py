"""Assembly of the QP: tasks, contacts and limits become rows of fixed places, filled at every tick.

Variables are the generalised accelerations a (base, joints) and the contact wrenches f, each in its contact frame.
Torques are eliminated: τ = M_j a + h_j − J_jᵀ f, so that their limits are rows of the QP.

    minimise   ½ Σ weight · (J a − reference)²  +  ½ Σ wrench weight · f²  +  ½ regularisation · a²
    subject to M_b a − J_bᵀ f = −h_b                      the floating base has no motor
               J_c a = −J̇_c v − damping · J_c v + …       a contact stays where it is (or f = 0); a cost if it may yield
               hard tasks
               τ, joint accelerations, wrench cones, collisions … within their bounds

The layout is fixed between ticks: a contact that is switched changes values, not sizes, so nothing is allocated.

    equalities    floating base | hard tasks that are no motion | contacts | hard motion tasks
    soft rows     motion tasks | tasks on all variables
    inequalities  torques | joint limits | cone and normal force of each contact | other limits

From the contacts to the last soft row, and on to the selections, which are no rows, all share their arithmetic: one
product with v, one chain of vector operations.
"""

from __future__ import annotations

import itertools
import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.base.errors import UnknownNameError
from wbc.base.numbers import Array
from wbc.base.vectors import largest
from wbc.core.limits.base import ATTAINABLE, Attainable, Limit
from wbc.core.limits.joint import JointLimits
from wbc.core.limits.torque import TorqueLimits
from wbc.core.qp.contact import Contact
from wbc.core.qp.motion import Rows
from wbc.core.qp.released import ReleasedJoints
from wbc.core.qp.solving.problem import Problem
from wbc.core.qp.solving.solution import Layout
from wbc.core.qp.task import SelectionTask, Task, VariableTask
from wbc.core.robot import Robot

logger = logging.getLogger(__name__)

_NONE = np.zeros((0, 0))
"""Stand-in for what a task does not fill: the Jacobian of a selection, the drift of a task on variables."""


def _dim(tasks: Sequence[Task]) -> int:
    """Number of rows of some tasks."""
    return sum(task.dim for task in tasks)


def _consecutive(*counts: int) -> tuple[slice, ...]:
    """Return places one after the other, from 0 on."""
    ends = [0, *itertools.accumulate(counts)]
    return tuple(slice(start, stop) for start, stop in itertools.pairwise(ends))


@dataclass(slots=True)
class _ContactSlot:
    """Place of one contact in the QP, views of its values there, and the state that they are written for."""

    contact: Contact
    rows: slice  # its equalities: of its motion, or, where that is a cost, of its force while it is off
    columns: slice  # its force variables among all contact forces
    jacobian: Array
    error: Array
    drift: Array
    stiffness: Array
    damping: Array
    wrench_weight: Array
    motion_weight: Array | None  # of the motion rows, where they are a cost
    force: Array  # the equalities over the contact's own force
    cone: Array  # the cone rows over the contact's own force
    cone_upper: Array
    normal_lower: Array
    normal_upper: Array
    revision: int = -1
    engaged: bool | None = None


def empty_problem(robot: Robot, contacts: Sequence[Contact]) -> Problem:
    """Return the QP of some contacts alone, unwritten, to try tasks on variables on: it changes nothing elsewhere."""
    nv, na, ends = robot.nv, robot.na, [0, *itertools.accumulate(contact.dim for contact in contacts)]
    problem = Problem(nv, na, nv + ends[-1], robot.base_dof + robot.passive.size + ends[-1], 0, na)
    problem.n_physics = robot.base_dof + robot.passive.size
    for contact, start, stop in zip(contacts, ends, ends[1:], strict=False):
        problem.contacts[contact.name], problem.loaded[contact.name] = (
            slice(nv + start, nv + stop),
            contact.active,
        )
    return problem


class Assembly:
    """The QP of some tasks, contacts and limits; made anew when one is added or removed.

    Attributes:
        problem: The QP.
        layout: Names and places of everything in a solution.
        torque_rows: Rows of the problem that are the joint torques, less the bias.
        listening: Tasks that read the sensors.
    """

    def __init__(
        self,
        robot: Robot,
        tasks: Sequence[Task],
        contacts: Sequence[Contact],
        limits: Sequence[Limit],
        regularisation: float,
    ) -> None:
        """Allocate the problem and give each of these items, which are bound to the robot, its views."""
        self._robot, self._regularisation, self._base_dof = robot, regularisation, robot.base_dof
        self._joint_limits = next((limit for limit in limits if isinstance(limit, JointLimits)), None)
        self._torque_limits = next((limit for limit in limits if isinstance(limit, TorqueLimits)), None)
        row_limits = [limit for limit in limits if not isinstance(limit, (JointLimits, TorqueLimits))]
        for task in tasks:
            task.detach()
        self.listening = [t for t in tasks if getattr(t.observe, "__func__", None) is not Task.observe]
        selection = sorted((t for t in tasks if isinstance(t, SelectionTask)), key=lambda t: t.hard)
        variable = [t for t in tasks if isinstance(t, VariableTask)]
        motion = [t for t in tasks if not isinstance(t, (SelectionTask, VariableTask))]
        hard_first = [t for t in (*selection, *variable) if t.hard]
        hard_motion = [t for t in motion if t.hard]
        soft = [*(t for t in motion if not t.hard), *(t for t in variable if not t.hard)]
        n_soft = _dim(soft) + sum(c.dim for c in contacts if c.motion_weight is not None)

        nv, na, base_dof = robot.nv, robot.na, robot.base_dof
        n_force = sum(c.dim for c in contacts)
        n_joint = na if self._joint_limits is not None else 0
        n_cone = sum(c.cone.shape[0] + len(c.ranged) for c in contacts)
        base, hard_rows, contact_rows, hard_motion_rows, soft_rows = _consecutive(
            base_dof + robot.passive.size, _dim(hard_first), n_force, _dim(hard_motion), n_soft
        )
        torques, joints, cones, other_limits = _consecutive(
            na, n_joint, n_cone, sum(r.dim for r in row_limits)
        )
        self.problem = p = Problem(nv, na, nv + n_force, soft_rows.start, n_soft, other_limits.stop)
        p.n_physics = base.stop
        if robot.floating:
            p.equality_groups["floating-base dynamics"] = slice(0, base_dof)
        if robot.passive.size:
            p.equality_groups["joints without a drive"] = slice(base_dof, base.stop)
        base = slice(0, base_dof)
        p.inequality_groups["torque limits"] = torques
        self._places: dict[str, slice] = {}  # of tasks, among the residuals
        self._limit_names = [f"torque of {joint}" for joint in robot.joint_names]

        # The rows that share their arithmetic, from the contacts to the last soft one, and then the selections.
        shared = slice(contact_rows.start, soft_rows.stop)
        self._start, n_shared = shared.start, shared.stop - shared.start
        n_selected = _dim(selection)
        targets = np.zeros(shared.stop + n_selected)
        p.target, self._selected_target = targets[: shared.stop], targets[shared.stop :]
        self._targets = targets[shared.start :]
        self._shared_matrix = p.rows[shared, :nv]
        self._rows = Rows.zeros(n_shared + n_selected)
        self._velocity, self._excess = np.zeros(n_shared + n_selected), np.zeros(n_shared + n_selected)
        self._bounded: list[tuple[Task, slice]] = []  # tasks whose errors have bounds, and their rows
        self._shared_velocity, self._selected_velocity = self._velocity[:n_shared], self._velocity[n_shared:]
        p.soft_weight = self._rows.weight[soft_rows.start - shared.start : n_shared]
        self._selected = self._rows.view(slice(n_shared, n_shared + n_selected))

        self._slots: list[_ContactSlot] = []
        self._motion: list[tuple[Task, Array, Array, Array]] = []
        self._variable: list[tuple[VariableTask, Array, Array]] = []
        self._selection: list[tuple[SelectionTask, Rows]] = []
        # Of the hard ones: their targets as equalities, and as they are computed.
        self._hard_selection: list[tuple[Array, Array]] = []
        self._row_blocks: list[tuple[Limit, Array, Array, Array]] = []

        self._place_hard_first(hard_first, hard_rows.start)
        if n_joint:
            self._place_joint_limits(joints)
        first_soft = self._place_contacts(contacts, contact_rows.start, soft_rows.start, cones.start)
        self._place_tasks(hard_motion, hard_motion_rows.start)
        self._place_tasks(soft, first_soft)
        for task in hard_first:
            if isinstance(task, VariableTask):
                rows = self._places[task.name]
                self._variable.append((task, p.rows[rows], p.target[rows]))
        self._variable = [each for each in self._variable if self._bound(each[0])]
        self._hard_variable = [
            (self._places[task.name], matrix, target) for task, matrix, target in self._variable if task.hard
        ]
        self._place_selections(selection)
        self._place_row_limits(row_limits, other_limits.start)

        # Views of the dynamics, [M, −Jᵀ], split into the base (equalities) and the joints (torque rows).
        self._mass_carried = robot.mass
        self._yielding = [slot for slot in self._slots if slot.motion_weight is not None]
        mass = robot.mass_matrix.T  # symmetric, stored by columns: the transpose is contiguous by rows
        self._mass = mass[:base_dof], mass[base_dof:]
        self._base_bias, self._joint_bias = robot.bias[:base_dof], robot.bias[base_dof:]
        self._base_mass, self._base_force = p.equality[base, :nv], p.equality[base, nv:]
        self._joint_mass, self._joint_force = p.inequality[torques, :nv], p.inequality[torques, nv:]
        self._contact_base_t = p.equality[contact_rows, :base_dof].T
        self._contact_joint_t = p.equality[contact_rows, base_dof:nv].T
        self._base_target = p.target[base]
        self._passive = robot.passive
        self._passive_rows, self._passive_target = (
            each[base_dof : base_dof + robot.passive.size] for each in (p.equality, p.target)
        )
        self._torque_lower, self._torque_upper = p.lower[torques], p.upper[torques]
        self._torque_bounds = (np.zeros(na), np.zeros(na))
        self._joint_rows = (p.inequality[joints, :nv], p.lower[joints], p.upper[joints])
        self._own_bounds = [(self._torque_lower, self._torque_upper)]  # bounds of single joints
        if n_joint:
            self._own_bounds.append(self._joint_rows[1:])
        many, single = p.inequality[other_limits, :nv], self._joint_rows[1:] if n_joint else None
        self._attainable = Attainable(many, p.lower[other_limits], p.upper[other_limits], single, ATTAINABLE)
        p.yielding[other_limits], p.yielding[joints] = 1, 2
        self._acceleration_diagonal, self._linear = p.diagonal[:nv], p.linear[:nv]
        self.torque_rows = slice(soft_rows.stop, soft_rows.stop + na)
        units = {task.name: task.residual_unit for task in tasks}
        self.layout = Layout(nv, p.contacts, self._places, units, tuple(self._limit_names))

    # ---- layout -------------------------------------------------------------------------------------------------

    def _place_hard_first(self, tasks: Sequence[Task], at: int) -> None:
        """Place the hard tasks that are no motion, from an equality on."""
        for task in tasks:
            rows = self._places[task.name] = slice(at, at + task.dim)
            self.problem.hard_tasks[rows] = True
            self.problem.equality_groups[f"hard task '{task.name}'"] = rows
            at = rows.stop

    def _place_joint_limits(self, rows: slice) -> None:
        """Place one row for each joint."""
        p = self.problem
        p.inequality_groups["joint limits"] = rows
        self._limit_names += [f"limits of {joint}" for joint in self._robot.joint_names]

    def _place_contacts(self, contacts: Sequence[Contact], at: int, soft_at: int, cone_at: int) -> int:
        """Place the contacts, from an equality, a soft row and an inequality on; return the next soft row."""
        p, nv = self.problem, self._robot.nv
        column = nv
        for contact in contacts:
            rows, columns = slice(at, at + contact.dim), slice(column, column + contact.dim)
            cone = slice(cone_at, cone_at + contact.cone.shape[0])
            ranged = list(contact.ranged)
            normal = slice(cone.stop, cone.stop + len(ranged))
            yields = contact.motion_weight is not None
            motion = slice(soft_at, soft_at + contact.dim) if yields else rows
            view = self._view(motion)
            contact.attach(view)
            p.inequality[normal, columns][:, ranged] = np.eye(len(ranged))
            p.contacts[contact.name], p.loaded[contact.name] = columns, contact.active
            p.equality_groups[f"{'force' if yields else 'motion'} of contact '{contact.name}'"] = rows
            p.inequality_groups[f"wrench cone of contact '{contact.name}'"] = slice(cone.start, normal.stop)
            self._limit_names += [f"wrench cone of {contact.name}"] * contact.cone.shape[0]
            self._limit_names += [
                f"{'normal force' if len(ranged) == 1 else 'wrench'} of {contact.name}"
            ] * len(ranged)
            self._slots.append(
                _ContactSlot(
                    contact=contact,
                    rows=rows,
                    columns=slice(columns.start - nv, columns.stop - nv),
                    jacobian=p.rows[motion, :nv],
                    error=view.error,
                    drift=view.drift,
                    stiffness=view.stiffness,
                    damping=view.damping,
                    wrench_weight=p.diagonal[columns],
                    motion_weight=view.weight if yields else None,
                    force=p.equality[rows, columns],
                    cone=p.inequality[cone, columns],
                    cone_upper=p.upper[cone],
                    normal_lower=p.lower[normal],
                    normal_upper=p.upper[normal],
                )
            )
            at, column, cone_at = rows.stop, columns.stop, normal.stop
            soft_at = motion.stop if yields else soft_at
        return soft_at

    def _place_tasks(self, tasks: Sequence[Task], at: int) -> None:
        """Place hard motion tasks and all soft tasks but selections, from a row on."""
        p, nv = self.problem, self._robot.nv
        for task in tasks:
            rows = self._places[task.name] = slice(at, at + task.dim)
            view = self._view(rows)
            task.attach(view)
            self._bounded.append((task, slice(rows.start - self._start, rows.stop - self._start)))
            if isinstance(task, VariableTask):
                self._variable.append((task, p.rows[rows], p.target[rows]))
            else:
                self._motion.append((task, p.rows[rows, :nv], view.error, view.drift))
            if task.hard:
                p.hard_tasks[rows] = True
                p.equality_groups[f"hard task '{task.name}'"] = rows
            at = rows.stop

    def _place_selections(self, tasks: Sequence[SelectionTask]) -> None:
        """Place the selections, soft ones first; hard ones are equalities too.

        The soft ones are on the diagonal, and their residuals after all rows.
        """
        p, at = self.problem, 0
        coordinates = np.arange(self._robot.nv)
        columns = [coordinates[task.columns] for task in tasks]
        self._selected_columns = np.concatenate([coordinates[:0], *columns])
        soft = slice(0, _dim([task for task in tasks if not task.hard]))
        self._soft_columns, self._soft_target = self._selected_columns[soft], self._selected_target[soft]
        self._soft_selected_weight = self._selected.weight[soft]
        for task, chosen in zip(tasks, columns, strict=True):
            block = slice(at, at + task.dim)
            view = self._selected.view(block)
            task.attach(view)
            first = self._shared_velocity.size
            self._bounded.append((task, slice(first + block.start, first + block.stop)))
            if task.hard:
                rows = self._places[task.name]
                p.equality[rows, chosen] = np.eye(task.dim)
                self._hard_selection.append((p.target[rows], self._selected_target[block]))
            else:
                self._places[task.name] = slice(p.rows.shape[0] + at, p.rows.shape[0] + block.stop)
            self._selection.append((task, view))
            at = block.stop

    def _place_row_limits(self, limits: Sequence[Limit], at: int) -> None:
        """Place the limits that are neither of torques nor of single joints, from an inequality on."""
        p, nv = self.problem, self._robot.nv
        for limit in limits:
            rows = slice(at, at + limit.dim)
            p.inequality_groups[limit.name] = rows
            self._row_blocks.append((limit, p.inequality[rows, :nv], p.lower[rows], p.upper[rows]))
            self._limit_names += [limit.name] * limit.dim
            at = rows.stop

    def _bound(self, task: VariableTask) -> bool:
        """Bind a task on all variables; return False, and leave its rows empty, where its contact is not there."""
        try:
            task.bind_problem(self.problem)
        except UnknownNameError:
            logger.warning("task '%s' has no effect: its contact is not in the controller", task.name)
            if task.hard:
                self.problem.set_empty(self._places[task.name], np.ones(task.dim, dtype=bool))
            return False
        return True

    def _view(self, rows: slice) -> Rows:
        """Values of some rows of the problem that share their arithmetic."""
        return self._rows.view(slice(rows.start - self._start, rows.stop - self._start))

    # ---- the tick -----------------------------------------------------------------------------------------------

    def write(
        self,
        dt: float,
        torques: Array | None,
        outside: Array | None = None,
        released: ReleasedJoints | None = None,
    ) -> None:
        """Write the present state of robot, tasks, contacts and limits into the problem.

        Args:
            dt: Control period, s.
            torques: Torques of the last tick, shape (na,), Nm; None at the first one.
            outside: Generalised forces of the surroundings beside the contacts, shape (nv,).
            released: Joints that somebody else moves, within limits of their own.
        """
        base = self._base_dof
        v, torque_bias = self._robot.v, self.problem.torque_bias
        self._base_mass[:], self._joint_mass[:] = self._mass
        np.negative(self._base_bias, out=self._base_target)
        if outside is None:
            torque_bias[:] = self._joint_bias
        else:
            self._base_target += outside[:base]
            np.subtract(self._joint_bias, outside[base:], out=torque_bias)
        if self._robot.mass != self._mass_carried:  # greatest forces may be multiples of the weight
            self._mass_carried = self._robot.mass
            for slot in self._slots:
                slot.revision = -1
        for slot in self._slots:
            self._write_contact(slot)
        np.negative(self._contact_base_t, out=self._base_force)
        np.negative(self._contact_joint_t, out=self._joint_force)
        for slot in self._yielding:
            np.negative(slot.jacobian[:, :base].T, out=self._base_force[:, slot.columns])
            np.negative(slot.jacobian[:, base:].T, out=self._joint_force[:, slot.columns])

        for motion, jacobian, error, drift in self._motion:
            if not motion.idle:
                motion.fill(jacobian, error, drift)
        self._shared_matrix.dot(v, out=self._shared_velocity)
        for selection, rows in self._selection:
            selection.evaluate(_NONE, rows.error, rows.drift)
        # With the default mode NumPy writes into a buffer first.
        v.take(self._selected_columns, out=self._selected_velocity, mode="clip")
        reference(
            self._rows, saturated(self._rows, self._excess, self._bounded), self._velocity, self._targets
        )
        for task, matrix, row_target in self._variable:
            task.evaluate(matrix, row_target, _NONE)
        for places, matrix, row_target in self._hard_variable:
            self.problem.set_empty(places, ~matrix.any(axis=1) & (row_target == 0.0))

        for hard_target, target in self._hard_selection:
            hard_target[:] = target
        columns, weight = self._soft_columns, self._soft_selected_weight
        self._acceleration_diagonal[:] = np.bincount(columns, weight, v.size)
        self._acceleration_diagonal += self._regularisation
        self._linear[:] = np.bincount(columns, weight * self._soft_target, v.size)

        if self._torque_limits is not None:
            lower, upper = self._torque_bounds
            self._torque_limits.interval(dt, torques, lower, upper)
            np.subtract(lower, torque_bias, out=self._torque_lower)
            np.subtract(upper, torque_bias, out=self._torque_upper)
        if self._passive.size:  # no torque: equalities, in place of bounds
            passive = self._passive
            self._passive_rows[:] = self.problem.inequality[passive]
            np.negative(torque_bias[passive], out=self._passive_target)
            self._torque_lower[passive], self._torque_upper[passive] = -np.inf, np.inf
        if self._joint_limits is not None:
            self._joint_limits.write(dt, *self._joint_rows)
        if released is not None:
            for low, high in self._own_bounds:
                low[released.index], high[released.index] = -np.inf, np.inf
        for limit, matrix, lower, upper in self._row_blocks:
            limit.write(dt, matrix, lower, upper)
        if self._row_blocks:
            self._attainable.cut()

    def kept(
        self, torques: Array, dt: float, previous: Array | None, released: ReleasedJoints | None
    ) -> Array:
        """Return torques within their limits, shape (na,), Nm, after those of the last tick; released have none."""
        if self._torque_limits is None:
            return torques
        lower, upper = np.empty_like(torques), np.empty_like(torques)
        self._torque_limits.interval(dt, previous, lower, upper)
        if released is not None:
            lower[released.index], upper[released.index] = -np.inf, np.inf
        return np.clip(torques, lower, upper)

    def _write_contact(self, slot: _ContactSlot) -> None:
        contact = slot.contact
        engaged = contact.engaged
        if engaged:
            contact.evaluate(slot.jacobian, slot.error, slot.drift)
        if engaged != slot.engaged:
            slot.engaged = engaged
            slot.revision = -1
            slot.force[:] = 0.0 if engaged else np.eye(contact.dim)
            # A contact that is off has zero force: its cone rows are moved off their bounds, where they would all be
            # active at once.
            slot.cone_upper[:] = 0.0 if engaged else 1.0
            yields = engaged and slot.motion_weight is not None
            self.problem.set_empty(slot.rows, np.full(contact.dim, yields))
            if not engaged:
                slot.jacobian[:], slot.error[:], slot.drift[:], contact.velocity[:] = 0.0, 0.0, 0.0, 0.0
        if slot.revision != contact.revision:
            slot.revision = contact.revision
            self.problem.loaded[contact.name] = contact.active
            slot.cone[:] = contact.cone
            # Nothing damps a contact that is off: its rows are its forces, and a velocity would ask for one.
            slot.stiffness[:], slot.damping[:] = contact.stiffness, contact.damping if engaged else 0.0
            slot.wrench_weight[:] = contact.wrench_weight
            if slot.motion_weight is not None:
                slot.motion_weight[:] = contact.motion_weight
            low, high = contact.force_ranges() if engaged else (-1.0, 1.0)
            slot.normal_lower[:], slot.normal_upper[:] = low, high

    @property
    def n_residuals(self) -> int:
        """Number of residuals: rows of the problem, then selections."""
        return int(self.problem.rows.shape[0] + self._selected_target.size)

    def residuals(self, x: Array, values: Array) -> Array:
        """Return achieved minus reference, for all rows of the problem, then for all selections; a new array.

        `values` are all rows times the solution x.
        """
        p = self.problem
        residual = np.empty(values.size + self._selected_target.size)
        residual[: values.size] = values
        residual[: p.target.size] -= p.target
        np.subtract(x.take(self._selected_columns), self._selected_target, out=residual[values.size :])
        return residual


def saturated(rows: Rows, excess: Array, bounded: Sequence[tuple[Task, slice]]) -> Array:
    """Return the errors of rows as they act: those beyond the bounds of their tasks, which have places, shortened.

    `excess` is an array of the shape of the errors, which is overwritten.
    """
    np.abs(rows.error, out=excess)
    excess -= rows.bound
    if not bounded or not largest(excess) > 0.0:
        return rows.error
    errors = rows.error.copy()
    for task, place in bounded:
        if largest(excess[place]) > 0.0:
            task.saturate(errors[place])
    return errors


def reference(rows: Rows, error: Array, velocity: Array, out: Array) -> None:
    """Fill `out` with the reference acceleration of tasks: feed-forward, PD on error and velocity, minus drift.

    The velocity is overwritten.
    """
    np.subtract(rows.velocity, velocity, out=out)
    out *= rows.damping
    out += np.multiply(rows.stiffness, error, out=velocity)
    out += rows.acceleration
    out -= rows.drift
