"""The controller: tasks, contacts and limits become one quadratic program, solved at every tick.

Variables are the generalised accelerations a (base, joints) and the contact wrenches f, each in its contact frame.
Torques are eliminated: τ = M_j a + h_j − J_jᵀ f, so that their limits are rows of the problem.

    minimise   ½ Σ weight · (J a − reference)²  +  ½ Σ wrench weight · f²  +  ½ regularisation · a²
    subject to M_b a − J_bᵀ f = −h_b                      the floating base has no motor
               J_c a = −J̇_c v − damping · J_c v + …       what is in contact stays there (or f = 0)
               hard tasks
               τ, joint accelerations, wrench cones, collisions … within their bounds

The layout is fixed between ticks: a contact that is switched changes values, not sizes, so nothing is allocated.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import TypeVar, overload

import numpy as np

from wbc.core.errors import Array, InputError, positive, unknown_name
from wbc.core.limits.rows import JointLimits, RowLimit, TorqueLimits
from wbc.core.qp.contact import Contact
from wbc.core.qp.problem import Problem
from wbc.core.qp.solution import Layout, Solution, Timings
from wbc.core.qp.solver import QpSolver, SolverSettings, Status
from wbc.core.qp.task import MotionTask, Rows, SelectionTask, Task, VariableTask
from wbc.core.robot import BASE_DOF, Robot
from wbc.core.signals import Measurement

Limit = JointLimits | TorqueLimits | RowLimit
Item = Task | Contact | JointLimits | TorqueLimits | RowLimit
ItemT = TypeVar("ItemT", bound=Item)


@dataclass(slots=True)
class _ContactSlot:
    """Where one contact stands in the problem, and which of its values are written there."""

    contact: Contact
    jacobian: Array
    error: Array
    drift: Array
    force: Array  # the motion rows over the contact's own force
    cone: Array  # the cone rows over the contact's own force
    cone_upper: Array
    normal_lower: Array
    normal_upper: Array
    partly_free: bool
    rows: slice
    columns: slice  # the contact's force among all contact forces
    full: Array | None  # Jacobian with the free axes in it, where those keep their force
    revision: int = -1
    engaged: bool | None = None


class Controller:
    """Whole-body controller of one robot.

    Attributes:
        robot: The robot whose state the controller reads; update it before `solve`, or call `update`.
        dt: Control period, s.
        model_time: Wall time of the last model update, s; reported in the timings of the next solution.
    """

    def __init__(
        self,
        robot: Robot,
        dt: float,
        *,
        regularisation: float = 1e-4,
        settings: SolverSettings | None = None,
    ) -> None:
        """Make a controller without tasks, contacts or limits; `add` them.

        Args:
            robot: The robot; its state is read, never written, by `solve`.
            dt: Control period, s.
            regularisation: Cost per squared acceleration of every coordinate, above zero: it makes the answer unique,
                and is shown in the status table.
            settings: Of the solver.

        Raises:
            InputError: A period or regularisation that is not positive.
        """
        self.robot = robot
        self.dt = positive("control period (s)", dt)
        self._regularisation = positive("regularisation", regularisation)
        self._settings = settings or SolverSettings()
        self._tasks: list[Task] = []
        self._contacts: list[Contact] = []
        self._joint_limits: JointLimits | None = None
        self._torque_limits: TorqueLimits | None = None
        self._row_limits: list[RowLimit] = []
        self._dirty = True
        self.model_time = 0.0
        self._solution: Solution | None = None

    @property
    def solution(self) -> Solution | None:
        """Result of the last tick; None before the first one."""
        return self._solution

    # ---- what the problem consists of ---------------------------------------------------------------------------

    @property
    def regularisation(self) -> float:
        """Cost per squared acceleration of every variable."""
        return self._regularisation

    @property
    def tasks(self) -> tuple[Task, ...]:
        """Tasks in the order in which they were added."""
        return tuple(self._tasks)

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """Contacts in the order in which they were added."""
        return tuple(self._contacts)

    @property
    def limits(self) -> tuple[Limit, ...]:
        """All limits."""
        own = [limit for limit in (self._joint_limits, self._torque_limits) if limit is not None]
        return (*own, *self._row_limits)

    @overload
    def add(self, item: ItemT, /) -> ItemT: ...
    @overload
    def add(self, item: Item, /, *items: Item) -> tuple[Item, ...]: ...
    def add(self, item: Item, /, *items: Item) -> Item | tuple[Item, ...]:
        """Add tasks, contacts and limits; names are resolved, and targets not given become the present state.

        Returns:
            The item, or all of them as a tuple when there are several.

        Raises:
            UnknownNameError: A frame, joint or sole that the robot does not have.
            InputError: A name used twice, a second set of joint or torque limits, or not a task, contact or limit.
        """
        for each in (item, *items):
            self._add(each)
        self._dirty = True
        return (item, *items) if items else item

    def _add(self, item: Item) -> None:
        if not isinstance(item, (Task, Contact, JointLimits, TorqueLimits, RowLimit)):
            raise InputError(f"a controller takes tasks, contacts and limits, not {item!r}")
        if isinstance(item, JointLimits) and self._joint_limits is not None:
            raise InputError("there are joint limits already; remove them first")
        if isinstance(item, TorqueLimits) and self._torque_limits is not None:
            raise InputError("there are torque limits already; remove them first")
        if item in (*self._tasks, *self._contacts, *self._row_limits):
            raise InputError(f"{item!r} has been added already")
        if isinstance(item, Task) and item._robot is not None and item._robot is not self.robot:
            raise InputError(f"{item!r} belongs to the controller of another robot")
        item.bind(self.robot)
        taken = {other.name for other in (*self._tasks, *self._contacts, *self.limits)}
        if item.name in taken:
            raise InputError(f"the name '{item.name}' is taken; give one of the two another name")
        if isinstance(item, Task):
            self._tasks.append(item)
        elif isinstance(item, Contact):
            self._contacts.append(item)
        elif isinstance(item, JointLimits):
            self._joint_limits = item
        elif isinstance(item, TorqueLimits):
            self._torque_limits = item
        else:
            self._row_limits.append(item)

    def remove(self, *items: Item) -> None:
        """Take tasks, contacts or limits out again.

        Raises:
            InputError: An item that the controller does not have.
        """
        for item in items:
            if item not in (*self._tasks, *self._contacts, *self.limits):
                raise InputError(f"{item!r} is not part of this controller")
            if isinstance(item, Task):
                item.detach()
                self._tasks.remove(item)
            elif isinstance(item, Contact):
                self._contacts.remove(item)
            elif isinstance(item, JointLimits):
                self._joint_limits = None
            elif isinstance(item, TorqueLimits):
                self._torque_limits = None
            else:
                self._row_limits.remove(item)
        self._dirty = True

    def task(self, name: str) -> Task:
        """Return a task by name.

        Raises:
            UnknownNameError: There is no such task; the nearest names are given.
        """
        for task in self._tasks:
            if task.name == name:
                return task
        unknown_name("task", name, [task.name for task in self._tasks])

    def contact(self, name: str) -> Contact:
        """Return a contact by name.

        Raises:
            UnknownNameError: There is no such contact; the nearest names are given.
        """
        for contact in self._contacts:
            if contact.name == name:
                return contact
        unknown_name("contact", name, [contact.name for contact in self._contacts])

    # ---- layout -------------------------------------------------------------------------------------------------

    def _build(self) -> None:
        """Allocate the problem and hand every item its views; runs when something was added or removed."""
        robot, nv, na = self.robot, self.robot.nv, self.robot.na
        for task in self._tasks:
            task.detach()
        self._listening = [
            task for task in self._tasks if getattr(task.observe, "__func__", None) is not Task.observe
        ]
        motion = [t for t in self._tasks if isinstance(t, MotionTask)]
        selection = [t for t in self._tasks if isinstance(t, SelectionTask)]
        variable = [t for t in self._tasks if isinstance(t, VariableTask)]
        hard_first = [t for t in (*selection, *variable) if t.hard]
        hard_motion = [t for t in motion if t.hard]
        soft = [*(t for t in motion if not t.hard), *(t for t in variable if not t.hard)]

        n_force = sum(c.dim for c in self._contacts)
        n = nv + n_force
        n_eq = BASE_DOF + n_force + sum(t.dim for t in (*hard_first, *hard_motion))
        n_joint = na if self._joint_limits is not None else 0
        n_in = (
            na
            + n_joint
            + sum(c.cone.shape[0] + 1 for c in self._contacts)
            + sum(r.dim for r in self._row_limits)
        )
        self.problem = p = Problem(nv, na, n, n_eq, sum(t.dim for t in soft), n_in)
        p.n_physics = BASE_DOF
        p.equality_groups["floating-base dynamics"] = slice(0, BASE_DOF)
        p.inequality_groups["torque limits"] = slice(0, na)

        # The equalities that are no motion come first, so that contacts, hard and soft motion tasks are neighbours
        # and share their arithmetic: one product with v, one chain of vector operations.
        at = BASE_DOF
        slices: dict[str, slice] = {}
        for task in hard_first:
            slices[task.name] = slice(at, at + task.dim)
            p.equality_groups[f"hard task '{task.name}'"] = slices[task.name]
            at += task.dim
        start = at
        self._block = slice(start, p.n_eq + p.n_soft)
        self._block_matrix, self._block_target = p.rows[self._block, :nv], p.target[self._block]
        self._rows, self._scratch = Rows.zeros(self._block_target.size), np.zeros(self._block_target.size)
        p.soft_weight = self._rows.weight[p.n_eq - start :]

        names = [f"torque of {j}" for j in robot.joint_names]
        names += [f"limits of {j}" for j in robot.joint_names] if n_joint else []
        if n_joint:
            rows = slice(na, 2 * na)
            p.inequality[rows, BASE_DOF:nv] = np.eye(na)
            p.inequality_groups["joint limits"] = rows
        self._joint_bounds = (p.lower[na : na + n_joint], p.upper[na : na + n_joint])

        col, cone_row = nv, na + n_joint
        self._slots: list[_ContactSlot] = []
        for contact in self._contacts:
            rows, cols = slice(at, at + contact.dim), slice(col, col + contact.dim)
            view = self._rows.view(slice(at - start, at - start + contact.dim))
            view.stiffness[:], view.damping[:] = contact.stiffness, contact.damping
            contact.attach(view.velocity)
            cone_rows = slice(cone_row, cone_row + contact.cone.shape[0])
            normal = slice(cone_rows.stop, cone_rows.stop + 1)
            p.inequality[normal, col + contact.force_axis] = 1.0
            p.diagonal[cols] = contact.wrench_weight
            p.contacts[contact.name] = cols
            p.equality_groups[f"motion of contact '{contact.name}'"] = rows
            p.inequality_groups[f"wrench cone of contact '{contact.name}'"] = slice(
                cone_rows.start, normal.stop
            )
            names += [f"wrench cone of {contact.name}"] * contact.cone.shape[0] + [
                f"normal force of {contact.name}"
            ]
            slot = _ContactSlot(
                contact,
                p.equality[rows, :nv],
                view.error,
                view.drift,
                p.equality[rows, cols],
                p.inequality[cone_rows, cols],
                p.upper[cone_rows],
                p.lower[normal],
                p.upper[normal],
                bool(contact.free.any()),
                rows,
                slice(cols.start - nv, cols.stop - nv),
                np.zeros((contact.dim, nv)) if contact.free_force and contact.free.any() else None,
            )
            self._slots.append(slot)
            at, col, cone_row = rows.stop, cols.stop, normal.stop
        contact_rows = slice(start, at)
        self._yielding = [slot for slot in self._slots if slot.full is not None]

        self._motion: list[tuple[MotionTask, Array, Array, Array]] = []
        self._variable: list[tuple[VariableTask, Array, Array]] = []
        for task in (*hard_motion, *soft):
            rows = slices[task.name] = slice(at, at + task.dim)
            view = self._rows.view(slice(at - start, at - start + task.dim))
            task.attach(view)
            if isinstance(task, MotionTask):
                self._motion.append((task, p.rows[rows, :nv], view.error, view.drift))
            elif isinstance(task, VariableTask):
                self._variable.append((task, p.rows[rows], p.target[rows]))
            if task.hard:
                p.equality_groups[f"hard task '{task.name}'"] = rows
            at = rows.stop
        for task in hard_first:
            if isinstance(task, VariableTask):
                self._variable.append((task, p.rows[slices[task.name]], p.target[slices[task.name]]))
        for variable_task, _, _ in self._variable:
            variable_task.bind_problem(p)

        n_selected = sum(t.dim for t in selection)
        self._selected, self._selected_target = Rows.zeros(n_selected), np.zeros(n_selected)
        self._selected_velocity = np.zeros(n_selected)
        self._selection: list[tuple[SelectionTask, Array, slice, Array | None]] = []
        at = 0
        for task in selection:
            rows = slice(at, at + task.dim)
            view = self._selected.view(rows)
            task.attach(view)
            own = None
            if task.hard:
                p.equality[slices[task.name], np.arange(nv)[task.columns]] = np.eye(task.dim)
                own = p.target[slices[task.name]]
            else:
                slices[task.name] = slice(p.rows.shape[0] + at, p.rows.shape[0] + rows.stop)
            self._selection.append((task, view.error, rows, own))
            at = rows.stop

        self._row_blocks = []
        for limit in self._row_limits:
            rows = slice(cone_row, cone_row + limit.dim)
            p.inequality_groups[limit.name] = rows
            self._row_blocks.append((limit, p.inequality[rows, :nv], p.lower[rows], p.upper[rows]))
            names += [limit.name] * limit.dim
            cone_row = rows.stop

        # Views of the dynamics, [M, −Jᵀ], split into the base (equalities) and the joints (torque rows).
        self._base_mass, self._base_force = p.equality[:BASE_DOF, :nv], p.equality[:BASE_DOF, nv:]
        self._joint_mass, self._joint_force = p.inequality[:na, :nv], p.inequality[:na, nv:]
        self._contact_base_t = p.equality[contact_rows, :BASE_DOF].T
        self._contact_joint_t = p.equality[contact_rows, BASE_DOF:nv].T
        self._base_target = p.target[:BASE_DOF]
        self._torque_lower, self._torque_upper = p.lower[:na], p.upper[:na]
        self._torque_bounds = (np.zeros(na), np.zeros(na))
        self._torque_rows = slice(p.n_eq + p.n_soft, p.n_eq + p.n_soft + na)
        self._acceleration_diagonal, self._linear = p.diagonal[:nv], p.linear[:nv]

        units = {task.name: task.unit for task in self._tasks}
        self._layout = Layout(nv, p.contacts, slices, units, tuple(names))
        self._solver = QpSolver(p, self._settings)
        self._torques: Array | None = None
        self._dirty = False

    # ---- the tick -----------------------------------------------------------------------------------------------

    def update(self, q: Array, v: Array) -> None:
        """Update the robot's state; the same as `robot.update`, and timed.

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).
        """
        start = perf_counter()
        self.robot.update(q, v)
        self.model_time = perf_counter() - start

    def solve(self, measurement: Measurement | None = None) -> Solution:
        """Solve the problem at the present state of the robot.

        Args:
            measurement: For tasks that listen to sensors.

        Returns:
            The solution. It never raises because of the problem itself: look at `status`, and call `diagnose` to
            learn which constraints contradict each other.
        """
        start = perf_counter()
        if self._dirty:
            self._build()
        if measurement is not None:
            for task in self._listening:
                task.observe(measurement, self.dt)
        self._assemble()
        assembled = perf_counter()
        solver = self._solver
        status = solver.solve()
        solved = perf_counter()
        last = self._solution
        if status.ok:
            x = solver.x.copy()
            self._torques = torques = solver.values[self._torque_rows] + self.robot.bias[BASE_DOF:]
            residual = self._residuals(x)
            multipliers = solver.multipliers.copy()
        else:
            known = last is not None and last.variables.size == solver.x.size
            x = last.variables if last is not None and known else np.zeros(solver.x.size)
            torques = np.array(self.robot.bias[BASE_DOF:]) if last is None else last.torques
            residual = np.full(self.problem.rows.shape[0] + self._selected_target.size, np.nan)
            multipliers = np.zeros(solver.multipliers.size)
        timings = Timings(self.model_time, assembled - start, solved - assembled, perf_counter() - solved)
        self._solution = solution = Solution(
            status, x, torques, solver.iterations, timings, self._layout, residual, multipliers
        )
        return solution

    def reset(self) -> None:
        """Forget the past: solver guesses, torques of the last tick, places of contacts, what tasks have yielded."""
        self._torques = self._solution = None
        self._dirty = True
        for task in self._tasks:
            task.reset()
        for contact in self._contacts:
            contact.reset()

    def _assemble(self) -> None:
        """Write the present state of everything into the problem."""
        robot, dt = self.robot, self.dt
        v, bias = robot.v, robot.bias
        mass = robot.mass_matrix.T  # symmetric, stored by columns: the transpose is contiguous by rows
        self._base_mass[:] = mass[:BASE_DOF]
        self._joint_mass[:] = mass[BASE_DOF:]
        np.negative(bias[:BASE_DOF], out=self._base_target)
        for slot in self._slots:
            self._write_contact(slot, dt)
        np.negative(self._contact_base_t, out=self._base_force)
        np.negative(self._contact_joint_t, out=self._joint_force)
        for slot in self._yielding:
            assert slot.full is not None
            np.negative(slot.full[:, :BASE_DOF].T, out=self._base_force[:, slot.columns])
            np.negative(slot.full[:, BASE_DOF:].T, out=self._joint_force[:, slot.columns])

        for motion, jacobian, error, drift in self._motion:
            if not motion.idle:
                motion.evaluate(jacobian, error, drift)
        reference(self._rows, np.dot(self._block_matrix, v, out=self._scratch), self._block_target)
        for task, matrix, target in self._variable:
            task.evaluate(matrix, target)

        self._acceleration_diagonal[:] = self._regularisation
        self._linear[:] = 0.0
        velocity, wanted = self._selected_velocity, self._selected_target
        for selection, error, block, _ in self._selection:
            selection.evaluate(error)
            velocity[block] = v[selection.columns]
        reference(self._selected, velocity, wanted)
        for selection, _, block, hard_target in self._selection:
            if hard_target is not None:
                hard_target[:] = wanted[block]
                continue
            weight = self._selected.weight[block]
            self._acceleration_diagonal[selection.columns] += weight
            self._linear[selection.columns] += weight * wanted[block]

        if self._torque_limits is not None:
            lower, upper = self._torque_bounds
            self._torque_limits.write(dt, self._torques, lower, upper)
            np.subtract(lower, bias[BASE_DOF:], out=self._torque_lower)
            np.subtract(upper, bias[BASE_DOF:], out=self._torque_upper)
        if self._joint_limits is not None:
            self._joint_limits.write(dt, *self._joint_bounds)
        for limit, matrix, lower, upper in self._row_blocks:
            limit.write(dt, matrix, lower, upper)

    def _write_contact(self, slot: _ContactSlot, dt: float) -> None:
        contact = slot.contact
        contact.advance(dt)
        engaged = contact.engaged
        if engaged:
            contact.evaluate(slot.jacobian, slot.error, slot.drift)
            if slot.partly_free:
                if slot.full is not None:
                    slot.full[:] = slot.jacobian
                slot.jacobian[contact.free] = 0.0
                slot.error[contact.free] = 0.0
                slot.drift[contact.free] = 0.0
                contact.velocity[contact.free] = 0.0
        if engaged != slot.engaged:
            slot.engaged = engaged
            slot.revision = -1
            zero_force = contact.free & (not contact.free_force)
            slot.force[:] = np.diag(zero_force.astype(float)) if engaged else np.eye(contact.dim)
            # A contact that is off has zero force: its cone rows are moved off their bounds, where they would all be
            # active at once.
            slot.cone_upper[:] = 0.0 if engaged else 1.0
            self.problem.set_empty(slot.rows, engaged & contact.free & contact.free_force)
            if not engaged:
                if slot.full is not None:
                    slot.full[:] = 0.0
                slot.jacobian[:], slot.error[:], slot.drift[:], contact.velocity[:] = 0.0, 0.0, 0.0, 0.0
        if slot.revision != contact.revision:
            slot.revision = contact.revision
            slot.cone[:] = contact.cone
            low, high = contact.normal_force_range if engaged else (-1.0, 1.0)
            slot.normal_lower[:], slot.normal_upper[:] = low, high

    def _residuals(self, x: Array) -> Array:
        """Achieved minus wanted, for all rows of the problem, then for all selections; a new array."""
        values, p = self._solver.values, self.problem
        residual = np.empty(values.size + self._selected_target.size)
        residual[: values.size] = values
        residual[: p.target.size] -= p.target
        for selection, _, block, _ in self._selection:
            at = values.size + block.start
            np.subtract(
                x[selection.columns], self._selected_target[block], out=residual[at : at + selection.dim]
            )
        return residual

    # ---- explanations -------------------------------------------------------------------------------------------

    def diagnose(self) -> dict[str, float]:
        """Find out which constraints contradict each other, with slack on every group; slow, for use off the tick.

        Returns:
            Name of a group → largest violation in its own unit, for the groups that cannot be kept, worst first.
            Empty when the problem has a solution.
        """
        from wbc.core.qp.diagnosis import violated_groups  # noqa: PLC0415 (not needed by a tick)

        if self._dirty:
            self._build()
            self._assemble()
        return violated_groups(self.problem)

    def status_table(self) -> str:
        """Return a table of tasks, contacts and limits as of the last tick, to print."""
        from wbc.core.qp.diagnosis import status_table  # noqa: PLC0415 (not needed by a tick)

        return status_table(self, self._solution)


def reference(rows: Rows, velocity: Array, out: Array) -> None:
    """Reference acceleration of tasks: feed-forward, PD on error and velocity, minus drift.

    Args:
        rows: Values of the tasks.
        velocity: Velocities of the tasks, overwritten.
        out: To fill.
    """
    np.subtract(rows.velocity, velocity, out=out)
    out *= rows.damping
    out += np.multiply(rows.stiffness, rows.error, out=velocity)
    out += rows.acceleration
    out -= rows.drift


__all__ = ["Controller", "Problem", "Solution", "Status"]
