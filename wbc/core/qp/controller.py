"""Controller of a robot: holds tasks, contacts and limits, and solves their QP at every tick.

`wbc.core.qp.assembly` states the QP and writes it, `wbc.core.qp.solver` solves it.
"""

from __future__ import annotations

import weakref
from collections.abc import Mapping, Sequence
from time import perf_counter
from typing import Any, TypeVar, overload

import numpy as np

from wbc.core.errors import Array, InputError, as_period, choose, shown, unknown_name
from wbc.core.limits.base import Limit
from wbc.core.limits.joint import JointLimits
from wbc.core.limits.torque import TorqueLimits
from wbc.core.qp.assembly import Assembly
from wbc.core.qp.contact import Contact
from wbc.core.qp.diagnosis import groups_not_finite, status_table, violated_groups
from wbc.core.qp.problem import Problem
from wbc.core.qp.solution import Solution, Timings
from wbc.core.qp.solver import QpSolver, SolverSettings
from wbc.core.qp.task import Task, evaluated, fill_guarded
from wbc.core.robot import Robot
from wbc.core.settings import Positive
from wbc.core.signals import Measurement

Item = Task | Contact | Limit
ItemT = TypeVar("ItemT", bound=Item)


class Controller:
    """Whole-body controller of one robot.

    Attributes:
        robot: The robot whose state the controller reads; update it before `solve`, or call `update`.
        model_time: Wall time of the last model update, s; reported in the timings of the next solution.
        outside: Generalised forces of the surroundings beside the contacts, shape (nv,), Nm and N: of what holds a
            robot that does not stand yet. They enter the dynamics of every tick; None for none.
    """

    def __init__(
        self,
        robot: Robot,
        dt: float,
        *,
        regularisation: Positive = 1e-4,
        settings: SolverSettings | None = None,
    ) -> None:
        """Make a controller without tasks, contacts or limits; `add` them.

        Args:
            robot: The robot; its state is read, never written, by `solve`.
            dt: Control period, s.
            regularisation: Cost per squared acceleration of every coordinate, above zero: it makes the answer unique,
                and is shown in the status table.
            settings: Settings of the solver.
        """
        self.robot = robot
        self._dt = as_period(dt)
        self._regularisation = regularisation
        self._settings = settings or SolverSettings()
        self._tasks: list[Task] = []
        self._contacts: list[Contact] = []
        self._limits: list[Limit] = []
        self._moving: list[Task] = []  # tasks whose targets are on their way
        self.model_time = 0.0
        self._solution: Solution | None = None
        self.outside: Array | None = None
        self._torques: Array | None = None  # of the last tick
        self._rebuild()

    @property
    def dt(self) -> float:
        """Control period, s; limits, force ramps and the control that runs the controller are made for it."""
        return self._dt

    @property
    def problem(self) -> Problem:
        """The QP as of the last tick."""
        return self._assembly.problem

    @property
    def solution(self) -> Solution | None:
        """Result of the last tick; None before the first one."""
        return self._solution

    @property
    def solver_counts(self) -> dict[str, int]:
        """Number of ticks since the last change of the layout, by the solver that solved them; and of those failed."""
        return dict(self._solver.counts)

    # ---- tasks, contacts and limits -------------------------------------------------------------------------------

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
        """Limits in the order in which they were added."""
        return tuple(self._limits)

    @overload
    def add(self, item: ItemT, /) -> ItemT: ...
    @overload
    def add(self, item: Item, /, *items: Item) -> tuple[Item, ...]: ...
    def add(self, item: Item, /, *items: Item) -> Item | tuple[Item, ...]:
        """Add tasks, contacts and limits, and return the item, or all of several as a tuple.

        Names are resolved, and targets not given become the present state. An item that cannot be added, such as one
        whose name is taken or whose rows cannot be evaluated, is an `InputError`; none is added then.
        """
        new, present = _with_parts(item, *items), self._items()
        for each in new:
            self._check_addable(each, present)
            present.append(each)
        # Binding changes nothing that counts until the item is in a controller: each is bound anew when it is added.
        for each in new:
            self._bind(each)
        self._check_names(new)
        self._check_variable_tasks(new)
        for each in new:
            self._list_of(each).append(each)
            each._owner = weakref.ref(self)
            if isinstance(each, Task):
                each.accepted = True
        self._dirty = True
        return (item, *items) if items else item

    def _check_addable(self, item: Item, others: Sequence[Item]) -> None:
        """Refuse an item that may not stand beside the others, or is another controller's."""
        if not isinstance(item, (Task, Contact, Limit)):
            raise InputError(f"a controller takes tasks, contacts and limits, not {item!r}")
        if any(item is other for other in others):
            raise InputError(f"{item!r} has been added already")
        for kind in (JointLimits, TorqueLimits):
            if isinstance(item, kind) and any(isinstance(other, kind) for other in others):
                raise InputError(f"there are {item.name} already; remove them first")
        if _owner(item) is not None:
            raise InputError(f"{item!r} belongs to another controller; remove it there, or make a second one")
        if isinstance(item, Task) and item.accepted and item._robot is not self.robot:
            raise InputError(f"{item!r} has been bound to another robot; make a second one")

    def _bind(self, item: Item) -> None:
        """Bind an item to the robot, and evaluate it once."""
        item.bind(self.robot)
        if isinstance(item, Task) and item._robot is None:
            raise InputError(f"{item!r} has not been bound: its bind must call super().bind(robot) first")
        if isinstance(item, Task) and item.kind != "variables" and type(item).observe is Task.observe:
            evaluated(item)  # one that reads sensors has none yet
        if isinstance(item, Limit):
            name, dim = getattr(item, "name", None), getattr(item, "dim", None)
            if not isinstance(name, str) or not isinstance(dim, (int, np.integer)):
                raise InputError(
                    f"limit {type(item).__name__} needs a name, text, and dim, its number of rows, once it is bound; "
                    f"got {shown(name)} and {shown(dim)}"
                )

    def _check_names(self, new: Sequence[Item]) -> None:
        """Refuse names that are taken; a contact of a sole has its name from the robot, when it is bound."""
        names = {item.name for item in self._items()}
        for item in new:
            if item.name in names:
                raise InputError(f"the name '{item.name}' is taken; give one of the two another name")
            names.add(item.name)

    def _check_variable_tasks(self, new: Sequence[Item]) -> None:
        """Refuse tasks on all variables that cannot be bound to the QP, or evaluated: they would fail at every tick."""
        contacts = [*self._contacts, *(item for item in new if isinstance(item, Contact))]
        tasks = [item for item in new if isinstance(item, Task) and item.kind == "variables"]
        tasks = [task for task in tasks if task.waits_for() in (None, *contacts)]
        if not tasks:
            return
        problem = Assembly(self.robot, [], contacts, [], self._regularisation).problem
        for task in tasks:
            task.bind_problem(problem)
            fill_guarded(
                task, np.zeros((task.dim, problem.diagonal.size)), np.zeros(task.dim), np.zeros((0, 0))
            )

    def _items(self) -> list[Item]:
        items: list[Item] = [*self._tasks, *self._contacts, *self._limits]
        return items

    def _list_of(self, item: Item) -> list[Any]:
        if isinstance(item, Task):
            return self._tasks
        return self._contacts if isinstance(item, Contact) else self._limits

    def remove(self, *items: Item) -> None:
        """Take tasks, contacts or limits out again."""
        for item in items:
            if _owner(item) is not self:
                raise InputError(f"{item!r} is not part of this controller")
        for item in {id(item): item for item in _with_parts(*items)}.values():
            if isinstance(item, Task):
                item.detach()
            of_kind = self._list_of(item)
            of_kind[:] = [other for other in of_kind if other is not item]
            self._moving = [other for other in self._moving if other is not item]
            item._owner = None
        self._dirty = True

    def task(self, name: str) -> Task:
        """Return a task by name."""
        return _by_name("task", name, self._tasks)

    def contact(self, name: str) -> Contact:
        """Return a contact by name."""
        return _by_name("contact", name, self._contacts)

    def move(self, task: Task) -> None:
        """Advance the target of one of the tasks at every tick until it has arrived; its `move_to` calls this."""
        if not any(task is other for other in self._moving):
            self._moving.append(task)

    # ---- the tick -----------------------------------------------------------------------------------------------

    def update(self, q: Array, v: Array) -> None:
        """Update the robot's state; the same as `robot.update`, and timed."""
        start = perf_counter()
        self.robot.update(q, v)
        self.model_time = perf_counter() - start

    def solve(self, measurement: Measurement | None = None) -> Solution:
        """Solve the QP at the present state of the robot; a measurement is for tasks that read sensors.

        An infeasible QP raises nothing: look at the solution's `status`, and call `diagnose` for the constraints that
        contradict each other.
        """
        start = perf_counter()
        if self._dirty:
            self._rebuild()
        if self._moving:
            self._moving = [task for task in self._moving if task.move_on(self._dt)]
        assembly, solver = self._assembly, self._solver
        if measurement is not None:
            for task in assembly.listening:
                task.observe(measurement, self._dt)
        assembly.write(self._dt, self._torques, self.outside)
        assembled = perf_counter()
        status = solver.solve()
        solved = perf_counter()
        last = self._solution
        if status.ok:
            x = solver.x.copy()
            self._torques = torques = solver.values[assembly.torque_rows] + assembly.problem.torque_bias
            residual = assembly.residuals(x, solver.values)
            multipliers = solver.multipliers.copy()
        else:
            known = last is not None and last.variables.size == solver.x.size
            x = last.variables if last is not None and known else np.zeros(solver.x.size)
            torques = assembly.problem.torque_bias.copy() if last is None else last.torques
            residual = np.full(assembly.n_residuals, np.nan)
            multipliers = np.zeros(solver.multipliers.size)
        timings = Timings(self.model_time, assembled - start, solved - assembled, perf_counter() - solved)
        self._solution = solution = Solution(
            status, x, torques, solver.iterations, timings, assembly.layout, residual, multipliers
        )
        return solution

    def torques(self, solution: Solution, wrenches: Mapping[str, Array]) -> Array:
        """Return the joint torques, shape (na,), Nm, of a solution's motion with other wrenches on some contacts.

        `wrenches` is name of a contact → wrench in place of the solution's, in the frame of the contact, N and Nm.
        """
        x, columns = solution.variables.copy(), solution.layout.contacts
        for name, wrench in wrenches.items():
            if name not in columns:
                unknown_name("contact", name, columns)
            x[columns[name]] = wrench
        problem = self._assembly.problem
        torques: Array = np.dot(problem.torque_matrix, x)
        torques += problem.torque_bias
        return torques

    def _rebuild(self) -> None:
        """Make QP and solver of what the controller has now."""
        items = self._tasks, self._contacts, self._limits
        self._assembly = Assembly(self.robot, *items, self._regularisation)
        self._solver = QpSolver(self._assembly.problem, self._settings)
        self._dirty = False

    def reset(self) -> None:
        """Reset solver guesses, torques of the last tick, places and force ramps of contacts, and tasks."""
        self._torques = self._solution = None
        self._dirty = True
        for task in self._tasks:
            task.reset()
        for contact in self._contacts:
            contact.reset()

    # ---- explanations -------------------------------------------------------------------------------------------

    def diagnose(self) -> dict[str, float]:
        """Return the constraints that contradict each other, found with slack on every group; slow, not for the tick.

        That is name of a group → largest violation in its own unit, worst first; empty when the QP has a solution. If
        there is NaN or infinity in the QP, it is NaN for the tasks and groups that have it.
        """
        if self._dirty:
            self._rebuild()
            self._assembly.write(self._dt, self._torques, self.outside)
        problem, places = self.problem, self._assembly.layout.tasks
        return groups_not_finite(problem, self._tasks, places) or violated_groups(problem)

    def __repr__(self) -> str:
        lists: dict[str, Sequence[Item]] = {
            "tasks": self._tasks,
            "contacts": self._contacts,
            "limits": self._limits,
        }
        held = "; ".join(
            f"{kind} {', '.join(i.name for i in items)}" for kind, items in lists.items() if items
        )
        return f"Controller({self.robot!r}, dt={self._dt:g} s{f'; {held}' if held else ''})"

    def status_table(self) -> str:
        """Return a table of tasks, contacts and limits as of the last tick, to print."""
        items = self._tasks, self._contacts
        return status_table(self.robot, self.dt, *items, self._regularisation, self._solution)


def _owner(item: Item) -> Controller | None:
    """Return the controller that has an item; None if none has."""
    owner: weakref.ref[Controller] | None = getattr(item, "_owner", None)
    return None if owner is None else owner()


def _with_parts(*items: Item) -> tuple[Item, ...]:
    """Return items, each followed by the items that come and go with it."""
    return tuple(part for item in items for part in (item, *getattr(item, "parts", ())))


def _by_name(kind: str, name: str, items: Sequence[ItemT]) -> ItemT:
    named = {item.name: item for item in items}
    return named[choose(kind, name, named)]
