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

from wbc.core.contact import Contact
from wbc.core.errors import Array, InputError, non_negative, positive, unknown_name
from wbc.core.limits import JointLimits, RowLimit, TorqueLimits
from wbc.core.robot import BASE_DOF, Robot
from wbc.core.signals import Measurement
from wbc.core.solution import Layout, Solution, Timings
from wbc.core.solver import QpSolver, SolverSettings, Status
from wbc.core.task import MotionTask, Rows, SelectionTask, Task, VariableTask

Limit = JointLimits | TorqueLimits | RowLimit
Item = Task | Contact | JointLimits | TorqueLimits | RowLimit
ItemT = TypeVar("ItemT", bound=Item)


@dataclass(slots=True)
class Problem:
    """Arrays of the quadratic program, with their layout.

    Attributes:
        nv: Number of accelerations.
        na: Number of joints; the first na inequality rows are the torques.
        hessian: H, shape (n, n).
        gradient: g, shape (n,).
        equality: A, shape (n_eq, n): base dynamics, contact motion, hard tasks.
        equality_rhs: b, shape (n_eq,).
        inequality: C, shape (n_in, n): torques, joint accelerations, wrench cones, row limits.
        lower: l, shape (n_in,).
        upper: u, shape (n_in,).
        contacts: Contact name → slice of the variables.
        groups: Name → slice of the equality rows, then of the inequality rows, for diagnosis.
    """

    nv: int
    na: int
    hessian: Array
    gradient: Array
    equality: Array
    equality_rhs: Array
    inequality: Array
    lower: Array
    upper: Array
    contacts: dict[str, slice]
    equality_groups: dict[str, slice]
    inequality_groups: dict[str, slice]

    @property
    def torque_matrix(self) -> Array:
        """Rows T with joint torques τ = T x + joint bias, shape (na, n)."""
        return self.inequality[: self.na]


@dataclass(slots=True)
class _ContactSlot:
    contact: Contact
    jacobian: Array  # (dim, nv), the motion rows of the contact
    force: Array  # (dim, dim), the same rows over the contact's own force
    rhs: Array  # (dim,)
    cone_upper: Array
    normal: slice
    revision: int
    engaged: bool | None
    rows: slice


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
        regularisation: float = 1e-6,
        settings: SolverSettings | None = None,
    ) -> None:
        """Make a controller without tasks, contacts or limits; `add` them.

        Args:
            robot: The robot; its state is read, never written, by `solve`.
            dt: Control period, s.
            regularisation: Cost per squared acceleration of every variable; shown in the status table.
            settings: Of the solver.

        Raises:
            InputError: A period that is not positive, or a negative regularisation.
        """
        self.robot = robot
        self.dt = positive("control period (s)", dt)
        self._regularisation = non_negative("regularisation", regularisation)
        self._settings = settings or SolverSettings()
        self._tasks: list[Task] = []
        self._contacts: list[Contact] = []
        self._joint_limits: JointLimits | None = None
        self._torque_limits: TorqueLimits | None = None
        self._row_limits: list[RowLimit] = []
        self._dirty = True
        self.model_time = 0.0
        self._solution: Solution | None = None

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
        motion = [t for t in self._tasks if isinstance(t, MotionTask)]
        selection = [t for t in self._tasks if isinstance(t, SelectionTask)]
        variable = [t for t in self._tasks if isinstance(t, VariableTask)]
        soft_motion, hard_motion = [t for t in motion if not t.hard], [t for t in motion if t.hard]
        hard = [*hard_motion, *(t for t in selection if t.hard), *(t for t in variable if t.hard)]

        n_force = sum(c.dim for c in self._contacts)
        n = nv + n_force
        n_eq = BASE_DOF + n_force + sum(t.dim for t in hard)
        n_joint = na if self._joint_limits is not None else 0
        n_cone = sum(c.cone.shape[0] + 1 for c in self._contacts)
        n_in = na + n_joint + n_cone + sum(limit.dim for limit in self._row_limits)
        p = Problem(
            nv,
            na,
            np.zeros((n, n)),
            np.zeros(n),
            np.zeros((n_eq, n)),
            np.zeros(n_eq),
            np.zeros((n_in, n)),
            np.full(n_in, -np.inf),
            np.full(n_in, np.inf),
            {},
            {"floating-base dynamics": slice(0, BASE_DOF)},
            {"torque limits": slice(0, na)},
        )
        self.problem = p

        # Views of the dynamics, [M, −Jᵀ], split into the base (equalities) and the joints (torque rows).
        self._base_mass, self._base_force = p.equality[:BASE_DOF, :nv], p.equality[:BASE_DOF, nv:]
        self._joint_mass, self._joint_force = p.inequality[:na, :nv], p.inequality[:na, nv:]
        self._base_rhs = p.equality_rhs[:BASE_DOF]
        contact_rows = slice(BASE_DOF, BASE_DOF + n_force)
        self._contact_base_t = p.equality[contact_rows, :BASE_DOF].T
        self._contact_joint_t = p.equality[contact_rows, BASE_DOF:nv].T
        self._torque_lower, self._torque_upper = p.lower[:na], p.upper[:na]
        self._torque_bounds = (np.full(na, -np.inf), np.full(na, np.inf))
        if n_joint:
            rows = slice(na, 2 * na)
            p.inequality[rows, BASE_DOF:nv] = np.eye(na)
            p.inequality_groups["joint limits"] = rows
        self._joint_bounds = (p.lower[na : na + n_joint], p.upper[na : na + n_joint])

        row, col, cone_row = BASE_DOF, nv, na + n_joint
        self._slots: list[_ContactSlot] = []
        names = [f"torque of {j}" for j in robot.joint_names]
        names += [f"limits of {j}" for j in robot.joint_names] if n_joint else []
        self._force_diagonal = np.zeros(n_force)
        for contact in self._contacts:
            rows, cols = slice(row, row + contact.dim), slice(col, col + contact.dim)
            cone_rows = slice(cone_row, cone_row + contact.cone.shape[0])
            normal = slice(cone_rows.stop, cone_rows.stop + 1)
            p.inequality[normal, col + contact.force_axis] = 1.0
            p.contacts[contact.name] = cols
            p.equality_groups[f"motion of contact '{contact.name}'"] = rows
            p.inequality_groups[f"wrench cone of contact '{contact.name}'"] = slice(
                cone_rows.start, normal.stop
            )
            names += [f"wrench cone of {contact.name}"] * contact.cone.shape[0] + [
                f"normal force of {contact.name}"
            ]
            self._force_diagonal[col - nv : col - nv + contact.dim] = contact.wrench_weight
            self._slots.append(
                _ContactSlot(
                    contact,
                    p.equality[rows, :nv],
                    p.equality[rows, cols],
                    p.equality_rhs[rows],
                    p.upper[cone_rows],
                    normal,
                    -1,
                    None,
                    cone_rows,
                )
            )
            row, col, cone_row = rows.stop, cols.stop, normal.stop

        self._row_blocks = []
        for limit in self._row_limits:
            rows = slice(cone_row, cone_row + limit.dim)
            p.inequality_groups[limit.name] = rows
            self._row_blocks.append((limit, p.inequality[rows, :nv], p.lower[rows], p.upper[rows]))
            names += [limit.name] * limit.dim
            cone_row = rows.stop

        # Row values of all tasks stand together: soft motion, hard motion, selections, tasks on all variables.
        ordered = [*soft_motion, *hard_motion, *selection, *variable]
        total = sum(t.dim for t in ordered)
        self._rows = Rows.zeros(total)
        self._reference, self._velocity = np.zeros(total), np.zeros(total)
        self._residual = np.zeros(total)
        n_soft, n_hard = sum(t.dim for t in soft_motion), sum(t.dim for t in hard_motion)
        self._jacobian, self._weighted = np.zeros((n_soft, nv)), np.zeros((n_soft, nv))
        self._weighted_reference = np.zeros(n_soft)
        self._gram = np.zeros((nv, nv))
        self._soft, self._hard = slice(0, n_soft), slice(n_soft, n_soft + n_hard)
        hard_rows = slice(row, row + n_hard)
        self._hard_jacobian, self._hard_rhs = p.equality[hard_rows, :nv], p.equality_rhs[hard_rows]
        self._motion: list[tuple[MotionTask, Array, Array, Array]] = []
        self._selection: list[tuple[SelectionTask, Array, slice]] = []
        self._hard_selection: list[tuple[Array, slice]] = []
        self._variable: list[tuple[VariableTask, Array, Array, slice]] = []
        at, slices, units = 0, {}, {}
        for task in ordered:
            rows = slice(at, at + task.dim)
            view = self._rows.view(rows)
            task.attach(view)
            slices[task.name], units[task.name] = rows, task.unit
            own = slice(row, row + task.dim)
            if isinstance(task, MotionTask):
                jacobian = p.equality[own, :nv] if task.hard else self._jacobian[rows]
                self._motion.append((task, jacobian, view.error, view.drift))
            elif isinstance(task, SelectionTask):
                self._selection.append((task, view.error, rows))
                if task.hard:
                    p.equality[own, np.arange(nv)[task.columns]] = np.eye(task.dim)
                    self._hard_selection.append((p.equality_rhs[own], rows))
            else:
                matrix = p.equality[own] if task.hard else np.zeros((task.dim, n))
                reference = p.equality_rhs[own] if task.hard else self._reference[rows]
                self._variable.append((task, matrix, reference, rows))
            if task.hard:
                p.equality_groups[f"hard task '{task.name}'"] = own
                row = own.stop
            at = rows.stop
        for task, _, _, _ in self._variable:
            task.bind_problem(p)

        self._diagonal = np.zeros(n)
        self._diagonal[nv:] = self._force_diagonal
        self._hessian_diagonal = p.hessian.reshape(-1)[:: n + 1]
        self._layout = Layout(nv, p.contacts, slices, units, tuple(names))
        self._solver = QpSolver(n, n_eq, n_in, self._settings)
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
            for task in self._tasks:
                task.observe(measurement, self.dt)
        p = self.problem
        self._assemble()
        assembled = perf_counter()
        solver = self._solver
        status = solver.solve(
            p.hessian, p.gradient, p.equality, p.equality_rhs, p.inequality, p.lower, p.upper
        )
        solved = perf_counter()
        if status.ok:
            x = solver.x.copy()
            self._torques = torques = solver.rows[: p.na] + self.robot.bias[BASE_DOF:]
            residual = self._residuals(x)
            multipliers = solver.z.copy()
        else:
            last = self._solution
            x = np.zeros(p.gradient.size) if last is None else last.variables
            torques = np.array(self.robot.bias[BASE_DOF:]) if last is None else last.torques
            residual, multipliers = np.full(self._residual.size, np.nan), np.zeros(solver.z.size)
            if x.size != p.gradient.size:
                x = np.zeros(p.gradient.size)
        timings = Timings(self.model_time, assembled - start, solved - assembled, perf_counter() - solved)
        self._solution = solution = Solution(
            status, x, torques, solver.iterations, timings, self._layout, residual, multipliers
        )
        return solution

    def reset(self) -> None:
        """Forget the past: solver guesses, torques of the last tick, places where contacts were made."""
        self._torques = self._solution = None
        self._dirty = True
        for contact in self._contacts:
            contact.reset()

    def _assemble(self) -> None:
        """Write the present state of everything into the problem."""
        robot, p, rows = self.robot, self.problem, self._rows
        nv, dt = p.nv, self.dt
        mass = robot.mass_matrix.T  # symmetric, stored by columns: the transpose is contiguous by rows
        self._base_mass[:] = mass[:BASE_DOF]
        self._joint_mass[:] = mass[BASE_DOF:]
        for slot in self._slots:
            self._write_contact(slot, dt)
        np.negative(self._contact_base_t, out=self._base_force)
        np.negative(self._contact_joint_t, out=self._joint_force)
        bias = robot.bias
        np.negative(bias[:BASE_DOF], out=self._base_rhs)

        for motion, jacobian, error, drift in self._motion:
            motion.evaluate(jacobian, error, drift)
        for selection, error, _ in self._selection:
            selection.evaluate(error)
        velocity, reference = self._velocity, self._reference
        np.dot(self._jacobian, robot.v, out=velocity[self._soft])
        if self._hard_rhs.size:
            np.dot(self._hard_jacobian, robot.v, out=velocity[self._hard])
        for selection, _, block in self._selection:
            velocity[block] = robot.v[selection.columns]
        np.subtract(rows.velocity, velocity, out=reference)
        reference *= rows.damping
        np.multiply(rows.stiffness, rows.error, out=velocity)
        reference += velocity
        reference += rows.acceleration
        reference -= rows.drift
        if self._hard_rhs.size:
            self._hard_rhs[:] = reference[self._hard]
        for rhs, block in self._hard_selection:
            rhs[:] = reference[block]

        root = np.sqrt(rows.weight[self._soft])
        np.multiply(self._jacobian, root[:, None], out=self._weighted)
        np.multiply(reference[self._soft], root, out=self._weighted_reference)
        weighted = self._weighted
        np.dot(weighted.T, weighted, out=self._gram)
        gradient, hessian, diagonal = p.gradient, p.hessian, self._diagonal
        np.dot(self._weighted_reference, weighted, out=gradient[:nv])
        diagonal[:nv] = self._regularisation
        for selection, _, block in self._selection:
            if not selection.hard:
                weight = rows.weight[block]
                diagonal[selection.columns] += weight
                gradient[selection.columns] += weight * reference[block]
        if self._variable:
            self._assemble_variable_tasks()
        else:
            hessian[:nv, :nv] = self._gram
            self._hessian_diagonal[nv:] = 0.0
            gradient[nv:] = 0.0
        self._hessian_diagonal += diagonal
        np.negative(gradient, out=gradient)

        if self._torque_limits is not None:
            self._torque_limits.write(dt, self._torques, *self._torque_bounds)
            np.subtract(self._torque_bounds[0], bias[BASE_DOF:], out=self._torque_lower)
            np.subtract(self._torque_bounds[1], bias[BASE_DOF:], out=self._torque_upper)
        if self._joint_limits is not None:
            self._joint_limits.write(dt, *self._joint_bounds)
        for limit, matrix, lower, upper in self._row_blocks:
            limit.write(dt, matrix, lower, upper)

    def _write_contact(self, slot: _ContactSlot, dt: float) -> None:
        contact = slot.contact
        contact.advance(dt)
        engaged = contact.engaged
        p = self.problem
        if engaged:
            contact.write_motion(slot.jacobian, slot.rhs)
            if not contact._held.all():
                free = ~contact._held
                slot.jacobian[free] = 0.0
                slot.rhs[free] = 0.0
        if engaged != slot.engaged:
            slot.engaged = engaged
            slot.force[:] = np.diag((~contact._held).astype(float)) if engaged else np.eye(contact.dim)
            # A contact that is off has zero force: its cone rows are moved off their bounds, where they would all be
            # active at once.
            slot.cone_upper[:] = 0.0 if engaged else 1.0
            if not engaged:
                slot.jacobian[:] = 0.0
                slot.rhs[:] = 0.0
            slot.revision = -1
        if slot.revision != contact.revision:
            slot.revision = contact.revision
            p.inequality[slot.rows, p.contacts[contact.name]] = contact.cone
            low, high = contact.normal_force_range if engaged else (-1.0, 1.0)
            p.lower[slot.normal], p.upper[slot.normal] = low, high

    def _assemble_variable_tasks(self) -> None:
        p, nv = self.problem, self.problem.nv
        p.hessian[:] = 0.0
        p.gradient[nv:] = 0.0
        for task, matrix, reference, block in self._variable:
            task.evaluate(matrix, reference)
            if task.hard:
                self._reference[block] = reference
                continue
            weighted = matrix * self._rows.weight[block][:, None]
            p.hessian += np.dot(matrix.T, weighted)
            p.gradient += np.dot(reference, weighted)
        p.hessian[:nv, :nv] += self._gram

    def _residuals(self, x: Array) -> Array:
        """Achieved minus wanted, for all rows of all tasks; a new array."""
        residual = self._residual
        a = x[: self.robot.nv]
        np.dot(self._jacobian, a, out=residual[self._soft])
        if self._hard_rhs.size:
            np.dot(self._hard_jacobian, a, out=residual[self._hard])
        for selection, _, block in self._selection:
            residual[block] = a[selection.columns]
        for _, matrix, _, block in self._variable:
            np.dot(matrix, x, out=residual[block])
        return residual - self._reference

    # ---- explanations -------------------------------------------------------------------------------------------

    def diagnose(self) -> dict[str, float]:
        """Find out which constraints contradict each other, with slack on every group; slow, for use off the tick.

        Returns:
            Name of a group → largest violation in its own unit, for the groups that cannot be kept, worst first.
            Empty when the problem has a solution.
        """
        from wbc.core.diagnosis import violated_groups  # noqa: PLC0415 (not needed by a tick)

        if self._dirty:
            self._build()
            self._assemble()
        return violated_groups(self.problem)

    def status_table(self) -> str:
        """Return a table of tasks, contacts and limits as of the last tick, to print."""
        from wbc.core.diagnosis import status_table  # noqa: PLC0415 (not needed by a tick)

        return status_table(self, self._solution)


__all__ = ["Controller", "Problem", "Solution", "Status"]
