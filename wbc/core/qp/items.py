"""Tasks, contacts and limits of a solver: adding and removing them, finding them by name, moving targets.

`Controller` solves for accelerations and forces, `InverseKinematics` for velocities; both take the same objects.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import Any, ClassVar, TypeVar, overload

import numpy as np

from wbc.base.checked import fixed
from wbc.base.errors import InputError, choose, shown
from wbc.core.limits.base import Barrier, Limit
from wbc.core.limits.joint import JointLimits, TorqueLimits
from wbc.core.qp.closure import LoopClosure
from wbc.core.qp.contact import Contact
from wbc.core.qp.diagnosis import held_back, is_far, violated_groups
from wbc.core.qp.released import ReleasedJoints
from wbc.core.qp.store import RowStore
from wbc.core.qp.task import Task, VariableTask
from wbc.core.robot import Robot

Item = Task | Contact | Limit
ItemT = TypeVar("ItemT", bound=Item)

ANOTHER = "make another solver"
"""Advice on options that stay."""


class Items:
    """Base of solvers that have tasks, contacts and limits.

    Attributes:
        robot: The robot whose state the solver reads.
        dt: Control period, s; limits, force ramps and moves of targets are made for it.
        regularisation: Cost per squared value of every coordinate.
    """

    robot: Robot = fixed("make another solver; `update` moves the robot")
    dt: float = fixed(ANOTHER)
    regularisation: float = fixed(ANOTHER)
    _assembly: RowStore

    _noun: ClassVar[str] = "controller"
    _kinematic: ClassVar[bool] = False

    def __init__(self, robot: Robot, dt: float, regularisation: float) -> None:
        """Begin without tasks, contacts or limits."""
        self.robot, self.dt, self.regularisation = robot, dt, regularisation
        self._tasks: list[Task] = []
        self._contacts: list[Contact] = []
        self._limits: list[Limit] = []
        self._dirty = True  # the layout of the QP is not that of the items
        self._levels: dict[int, int] = {}  # id of a task → its level, where it is not the first
        self._solution: Any = None  # of the last tick
        self._solved: RowStore | None = None  # rows of that tick

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
        names = {item.name for item in self._items()}
        for each in new:  # a contact of a sole has its name from the robot, when it is bound
            if each.name in names:
                raise InputError(f"the name '{each.name}' is taken; give one of the two another name")
            names.add(each.name)
        self._check_together(new)
        for each in new:
            self._list_of(each).append(each)
            each._owner = weakref.ref(self)
            if isinstance(each, Task):
                each._settled = True
                each.weigh_as_usual(kinematic=self._kinematic)
        self._changed()
        return (item, *items) if items else item

    def _changed(self) -> None:
        """Note that the layout of the QP is to be made anew, since items have come or gone."""
        self._dirty = True

    def _close_chains(self) -> None:
        """Add what holds the closed chains of the robot."""
        for each in self.robot.closures:
            self.add(LoopClosure(each.frame, each.other, rotation=each.rotation, name=each.name))

    def _check_addable(self, item: Item, others: Sequence[Item]) -> None:
        """Refuse an item that may not stand beside the others, or is another controller's."""
        if not isinstance(item, (Task, Contact, Limit)):
            raise InputError(f"a {self._noun} takes tasks, contacts and limits, not {item!r}")
        if any(item is other for other in others):
            raise InputError(f"{item!r} has been added already")
        for kind in (JointLimits, TorqueLimits):
            if isinstance(item, kind) and any(isinstance(other, kind) for other in others):
                raise InputError(f"there are {item.name} already; remove them first")
        if item.owner is not None:
            raise InputError(f"{item!r} belongs to another controller; remove it there, or make a second one")
        if isinstance(item, Task) and item._settled and item._robot is not self.robot:
            raise InputError(f"{item!r} has been bound to another robot; make a second one")

    def _bind(self, item: Item) -> None:
        """Bind an item to the robot, and evaluate it once."""
        bind(item, self.robot)
        if isinstance(item, Task) and not isinstance(item, VariableTask) and not item.listens:
            item.evaluated()  # one that reads sensors has none yet
        if isinstance(item, Limit):
            name, dim = getattr(item, "name", None), getattr(item, "dim", None)
            if not isinstance(name, str) or not isinstance(dim, (int, np.integer)):
                raise InputError(
                    f"limit {type(item).__name__} needs a name, text, and dim, its number of rows, once it is bound; "
                    f"got {shown(name)} and {shown(dim)}"
                )

    def _check_together(self, new: Sequence[Item]) -> None:
        """Refuse items, which are bound, that the solver cannot use."""

    def _items(self) -> list[Item]:
        items: list[Item] = [*self._tasks, *self._contacts, *self._limits]
        return items

    def _list_of(self, item: Item) -> list[Any]:
        if isinstance(item, Task):
            return self._tasks
        return self._contacts if isinstance(item, Contact) else self._limits

    def remove(self, *items: Item) -> None:
        """Take tasks, contacts or limits out again.

        A contact that a task cannot do without, such as a `StabilizerTask`, can only be removed with the task, or after
        it: otherwise it is an `InputError`, and nothing is removed. A `WrenchTask` without its contact has no effect.
        """
        if not items:
            return
        for item in items:
            if getattr(item, "owner", None) is not self:
                raise InputError(f"{item!r} is not part of this {self._noun}")
        gone = {id(item): item for item in _with_parts(*items)}
        for task in self._tasks:
            kept = [] if id(task) in gone else [each for each in task.keeps() if id(each) in gone]
            if kept:
                raise InputError(
                    f"task '{task.name}' needs {kept[0]!r}: remove the task with it, or before it"
                )
        for item in gone.values():
            if isinstance(item, Task):
                item.let_go()
            of_kind = self._list_of(item)
            of_kind[:] = [other for other in of_kind if other is not item]
            item._owner = None
        self._changed()

    def task(self, name: str) -> Task:
        """Return a task by name."""
        named = {task.name: task for task in self._tasks}
        return named[choose("task", name, named)]

    def contact(self, name: str) -> Contact:
        """Return a contact by name."""
        named = {contact.name: contact for contact in self._contacts}
        return named[choose("contact", name, named)]

    def held_back(self) -> dict[str, tuple[str, ...]]:
        """Return the tasks that others hold off their targets at the last tick → names of what does; slow.

        A task on a lower level is held back by the tasks on the levels before it.
        """
        solution, rows = self._solution, self._assembly
        if solution is None or not solution.ok or self._solved is not rows:
            return {}
        residuals, level = solution.residuals, {t.name: self._levels.get(id(t), 0) for t in self._tasks}
        soft = [
            task
            for task in self._tasks
            if task.name in residuals and not (task.hard or task.idle or isinstance(task, ReleasedJoints))
        ]
        first = [task for task in soft if not level[task.name]]
        found = held_back(first, rows, residuals, solution.multipliers)
        for task in soft:
            if level[task.name] and is_far(task, rows, residuals):
                above = (each for each in self._tasks if level[each.name] < level[task.name])
                found[task.name] = tuple(each.name for each in above if not each.idle)
        return found

    def diagnose(self) -> dict[str, float]:
        """Return the constraints that contradict each other, found with slack on every group; slow, not for the tick.

        The result maps the name of a group of constraints (contacts, hard tasks, limits) to its largest violation in
        the group's own unit, largest first. It is empty when the QP has a solution. If the QP contains NaN or infinity,
        the result is NaN for the tasks and groups that contain it.
        """
        if self._dirty:
            self._rebuild()
            self._write()
        return self._assembly.not_finite() or violated_groups(self._assembly.problem)

    def _rebuild(self) -> None:
        """Make QP and solver of what there is now."""
        raise NotImplementedError

    def _write(self) -> None:
        """Write the present state into the QP."""
        raise NotImplementedError

    def _move_targets(self) -> None:
        """Move all targets that are on their way on by one tick."""
        for task in self._tasks:
            if task._move is not None:
                task.move_on(self.dt)

    def __repr__(self) -> str:
        lists = ("tasks", self.tasks), ("contacts", self.contacts), ("limits", self.limits)
        held = "; ".join(f"{kind} {', '.join(i.name for i in items)}" for kind, items in lists if items)
        return f"{type(self).__name__}({self.robot!r}, dt={self.dt:g} s{f'; {held}' if held else ''})"


def bind(item: Item, robot: Robot) -> None:
    """Bind an item to a robot, whose state is up to date; refuse one whose own `bind` has kept it from its base."""
    item.bind(robot)
    if isinstance(item, (Task, Contact, Barrier)) and getattr(item, "_robot", None) is not robot:
        raise InputError(f"bind of '{item.name}' must call super().bind(robot) first")


def _with_parts(*items: Item) -> tuple[Item, ...]:
    """Return items, each followed by the items that come and go with it."""
    return tuple(part for item in items for part in (item, *getattr(item, "parts", ())))
