"""Inverse kinematics: velocities and configurations for the tasks, contacts and limits of a controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
import pinocchio as pin

from wbc.base.checked import checked, fixed, result
from wbc.base.errors import InputError, NoSolutionError
from wbc.base.html import html_table
from wbc.base.numbers import Array, finite_array, scalar
from wbc.base.settings import Count, NonNegative, Ordinal, Period, Positive, Seed
from wbc.core.kinematics.assembly import VelocityAssembly, solve_levels
from wbc.core.kinematics.reach import ReachResult, Search
from wbc.core.limits.base import Limit
from wbc.core.qp.items import ANOTHER, Item, Items, ItemT
from wbc.core.qp.solving.solution import holding
from wbc.core.qp.solving.solver import QpSolver, SolverSettings, Status
from wbc.core.qp.store import RowStore
from wbc.core.qp.task import Task, VariableTask
from wbc.core.robot import Robot

SOLVER = SolverSettings(tolerance=1e-9, relaxation=1e6)
"""Settings of the solver: where contacts and hard tasks contradict each other, or limits, each of them gives way."""


@dataclass(slots=True, eq=False)
class VelocitySolution:
    """Result of one step; owns its arrays.

    Attributes:
        status: Step of the solver's ladder that succeeded; `RELAXED` where limits, contacts and hard tasks could not
            all be kept. When `ok` is False the velocities are zero.
        velocities: Generalised velocities: base (in its own frame), then joints, shape (nv,), m/s and rad/s.
        values: Velocities of all rows, those of the lower levels last.
        targets: Wanted velocities of all rows.
        multipliers: Multipliers of the inequalities, positive where the upper bound is active.
        rows: Places and names of tasks and limits.
    """

    status: Status
    velocities: Array
    values: Array
    targets: Array
    multipliers: Array
    rows: RowStore

    def __repr__(self) -> str:
        return f"VelocitySolution({self.status.name.lower()}, {len(self.active_limits)} active limits)"

    def _repr_html_(self) -> str:
        residuals = [f"{name}  {np.abs(rows).max(initial=0.0):.3g}" for name, rows in self.residuals.items()]
        return html_table(
            "\n".join([f"{self!r}", *residuals, *(f"limit  {name}" for name in self.active_limits)])
        )

    @property
    def ok(self) -> bool:
        """True if the QP was solved."""
        return self.status.ok

    @property
    def residuals(self) -> dict[str, Array]:
        """Task name → achieved minus wanted velocity, shape (dim,), unit of the task per second."""
        residuals = self.rows.residuals(self.velocities, self.values, self.targets)
        return {name: residuals[place] for name, place in self.rows.places.items()}

    @property
    def active_limits(self) -> tuple[str, ...]:
        """Names of the limits that are active, each once."""
        return tuple(dict.fromkeys(holding(self.rows.names, self.multipliers)))


class InverseKinematics(Items):
    """Differential inverse kinematics of one robot: `add` tasks and limits, then `step`.

        ik = wbc.InverseKinematics(robot, dt=0.01)
        hand = ik.add(wbc.PoseTask("panda_hand"))
        ik.add(wbc.PostureTask(), wbc.JointLimits())
        hand.move_to(pose)
        while not hand.reached:
            ik.step()

    Whoever moves the robot calls `solve` and `update` in place of `step`.

    A task asks for the velocity of its target plus `rate` times its error. Contacts do not move. Limits hold for
    positions, for velocities and, if given, for accelerations. `wbc.core.kinematics.assembly` states the QP.

    Attributes:
        damping: As in the constructor, read-only.
        solution: Result of the last step: status, residuals, active limits; None before the first one.
    """

    damping: float = fixed(ANOTHER)
    solution: VelocitySolution | None = result("_solution", "`solve` makes one")
    _noun = "solver of inverse kinematics"
    _kinematic = True
    _assembly: VelocityAssembly
    _solution: VelocitySolution | None

    @checked
    def __init__(
        self, robot: Robot, dt: Period, *, regularisation: Positive = 1e-6, damping: NonNegative = 0.1
    ) -> None:
        """Make a solver without tasks, contacts or limits; `add` them.

        Args:
            robot: The robot. All methods read its configuration and its velocity; `step` and `update` change them.
            dt: Period of a step, s.
            regularisation: Cost per squared velocity of every coordinate, above zero; it makes the solution unique.
            damping: Cost per squared velocity of every coordinate, divided by the weighted squared error. It bounds the
                joint velocities near singular postures, and vanishes as the errors do.
        """
        super().__init__(robot, dt, regularisation)
        self.damping, self._period = damping, scalar(dt)
        self._close_chains()
        self._rebuild()

    # ---- tasks, contacts and limits -----------------------------------------------------------------------------

    @overload
    def add(self, item: ItemT, /, *, level: int = 0) -> ItemT: ...
    @overload
    def add(self, item: Item, /, *items: Item, level: int = 0) -> tuple[Item, ...]: ...
    @checked
    def add(self, item: Item, /, *items: Item, level: Ordinal = 0) -> Any:
        """Add tasks, contacts and limits, and return the item, or all of several as a tuple.

        Args:
            item: The first of them.
            *items: Further ones.
            level: Priority of these tasks; 0 is the highest. A level uses only the freedom that the levels before it
                leave, whatever the weights are. Contacts, limits and hard tasks have no level: they hold at every
                level.

        Raises:
            InputError: See `Controller.add`. Tasks on forces or torques, tasks that read sensors, and torque limits
                cannot be used in inverse kinematics.
        """
        for each in (item, *items):
            if level and (not isinstance(each, Task) or each.hard):
                raise InputError(f"{each!r} holds at every level: add it without `level`")
        added = super().add(item, *items)
        if level:
            self._levels |= {id(each): level for each in (item, *items)}
        return added

    def remove(self, *items: Item) -> None:
        """Remove tasks, contacts or limits."""
        super().remove(*items)
        for item in items:
            self._levels.pop(id(item), None)

    def _check_together(self, new: Sequence[Item]) -> None:
        for item in new:
            if isinstance(item, Task):
                if isinstance(item, VariableTask):
                    raise InputError(
                        f"{item!r} is on forces or torques: it has no place in inverse kinematics"
                    )
                if item.listens:
                    raise InputError(f"{item!r} reads sensors: it has no place in inverse kinematics")
            if isinstance(item, Limit) and type(item).write_step is Limit.write_step:
                raise InputError(
                    f"limit '{item.name}' has no place in inverse kinematics: "
                    f"{type(item).__name__} has no `write_step`, which bounds a step of the configuration"
                )

    def _rebuild(self, tasks: Sequence[Task] | None = None) -> None:
        """Make QP and solver of what there is now, of all tasks or of some."""
        order, tasks = sorted({0, *self._levels.values()}), self._tasks if tasks is None else tasks
        levels = [[task for task in tasks if self._levels.get(id(task), 0) == level] for level in order]
        self._assembly = VelocityAssembly(
            self.robot, levels, self._contacts, self._limits, self.regularisation, self.damping, self.dt
        )
        self._solver = QpSolver(self._assembly.problem, SOLVER)
        self._reads_all = any(each.reads == "all" for each in self._items())
        self._dirty = False
        self._refresh()

    # ---- steps --------------------------------------------------------------------------------------------------

    def update(self, q: Array, v: Array | None = None) -> None:
        """Set the state of the robot, and update frames, the CoM and their Jacobians, but no dynamics.

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,), m/s and rad/s: limits of accelerations start from it. At rest when None.
        """
        robot = self.robot
        q = robot.check_configuration("configuration", q)
        robot.v[:] = 0.0 if v is None else finite_array("velocity", v, (robot.nv,))
        self._move(q)

    def _move(self, q: Array) -> None:
        self.robot.q[:] = q
        if self._dirty:
            self._rebuild()
        else:
            self._refresh()

    def _refresh(self) -> None:
        robot = self.robot
        if self._reads_all:
            robot.update(robot.q, robot.v)
        else:
            robot.update_jacobians()

    def solve(self) -> Array:
        """Return the velocities at the present configuration, shape (nv,): base (in the base frame), then joints.

        No error is raised if there is no solution, or if limits, contacts and hard tasks contradict each other: check
        `solution`, and call `diagnose`. Without a solution the velocities are zero.
        """
        if self._dirty:
            self._rebuild()
        self._move_targets()
        assembly, solver = self._assembly, self._solver
        self._write()
        velocities, multipliers, status = self._solve()
        values = assembly.values(velocities) if assembly.lower else solver.values
        self._solved = assembly
        self._solution = VelocitySolution(
            status, velocities, values, assembly.targets.copy(), multipliers, assembly
        )
        return velocities

    def _write(self) -> None:
        for contact in self._contacts:
            contact.advance(np.inf)  # held, or let go, at once: there is no force to ramp
        self._assembly.write()

    def _solve(self) -> tuple[Array, Array, Status]:
        """Solve the QP that is written; return variables, multipliers and status."""
        assembly, solver = self._assembly, self._solver
        status = solver.solve()
        x, multipliers = solver.x, solver.multipliers
        if assembly.lower and status.ok:
            x, multipliers, failed = solve_levels(assembly.problem, x, assembly.lower, assembly.damping)
            status = failed or status
        if not status.ok:
            return np.zeros(self.robot.nv), np.zeros(len(assembly.names)), status
        return x, multipliers, status

    def step(self, *, hold: bool = False) -> Array:
        """Solve, move the robot by one period, and return the velocities, shape (nv,).

        Args:
            hold: Stand still where there is no solution, in place of an error.

        Raises:
            NoSolutionError: There is no solution; the robot has not moved.
        """
        velocities, robot = self.solve(), self.robot
        status = self._solution.status  # type: ignore[union-attr]
        if not (status.ok or hold):
            named = ", ".join(self.diagnose()) or "nothing by name"
            raise NoSolutionError(
                f"inverse kinematics has no solution, it is {status.value} by {named}: step(hold=True) stands still"
            )
        robot.v[:] = velocities
        self._move(pin.integrate(robot.model, robot.q, self._period * velocities))
        return velocities

    @checked
    def reach(
        self, tolerance: Positive = 1e-4, iterations: Count = 200, *, starts: Count = 1, seed: Seed = 0
    ) -> ReachResult:
        """Search for a configuration in which all targets are reached; the robot's configuration stays as it is.

        The search takes Gauss-Newton steps with Levenberg-Marquardt damping, within the position limits. Rates,
        velocity limits, acceleration limits and tasks on a velocity have no effect. The search ends when all errors are
        within the tolerance, or when no step reduces the weighted errors any more.

        Every search makes rows and a solver of its own: the solution of the last step stays as it is, and what is found
        does not depend on searches before. To make them takes about a tenth of the time of a search.

        Args:
            tolerance: Largest error of a task that counts as reached, m and rad.
            iterations: Largest number of steps from each start.
            starts: Largest number of starts. The first one is the present configuration, the others are random joint
                positions within the limits. No further start is tried once the targets are reached.
            seed: Seed of the random positions.

        Returns:
            The configuration with the smallest cost, the tasks that it does not reach, and the limits that are active
            in it.
        """
        robot = self.robot
        before, velocity = robot.q.copy(), robot.v.copy()
        tasks = [task for task in self._tasks if not task.of_velocity]
        own, dirty = (self._assembly, self._solver), self._dirty  # with the rows of the last step
        robot.v[:] = 0.0
        for limit in self._limits:
            limit.reset()  # distances are searched from where the last search has ended
        self._rebuild(tasks)
        try:
            self._write()
            found = Search(robot, tasks, self._assembly, self._solve, self._move, tolerance)
            return found.run(iterations, starts, seed)
        finally:
            robot.v[:], (self._assembly, self._solver), self._dirty = velocity, own, False
            self._move(before)
            self._dirty = dirty
