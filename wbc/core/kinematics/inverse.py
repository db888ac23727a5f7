"""Inverse kinematics: velocities and configurations for the tasks, contacts and limits of a controller."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, overload

import numpy as np
import pinocchio as pin

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array, whole_number
from wbc.base.settings import Count, NonNegative, Period, Positive, Seed
from wbc.core.kinematics.assembly import VelocityAssembly
from wbc.core.kinematics.levels import solve_levels
from wbc.core.kinematics.reach import Search
from wbc.core.kinematics.solution import ReachResult, VelocitySolution
from wbc.core.limits.base import Limit
from wbc.core.qp.diagnosis import violated_groups
from wbc.core.qp.items import Item, Items, ItemT
from wbc.core.qp.solver import QpSolver, SolverSettings, Status
from wbc.core.qp.task import Task, VariableTask
from wbc.core.robot import Robot

SOLVER = SolverSettings(tolerance=1e-9, relaxation=1e6)
"""Settings of the solver: where contacts and hard tasks contradict each other, or limits, each of them gives way."""


class InverseKinematics(Items):
    """Differential inverse kinematics of one robot.

        ik = wbc.InverseKinematics(robot, dt=0.01)
        hand = ik.add(wbc.PoseTask("panda_hand"))
        ik.add(wbc.PostureTask(weight=1e-3), wbc.JointLimits())
        hand.move_to(pose)
        while not hand.reached:
            ik.step()

    A task asks for the velocity of its target plus `rate` times its error; contacts do not move, and limits hold for
    positions, velocities and, where they are given, accelerations. `wbc.core.kinematics.assembly` states the QP.

    Attributes:
        robot: The robot whose configuration is read, and by `step` and `update` written.
    """

    _noun = "solver of inverse kinematics"

    @checked
    def __init__(
        self,
        robot: Robot,
        dt: Period,
        *,
        regularisation: Positive = 1e-6,
        damping: NonNegative = 0.1,
    ) -> None:
        """Make a solver without tasks, contacts or limits; `add` them.

        Args:
            robot: The robot.
            dt: Period of a step, s.
            regularisation: Cost per squared velocity of every coordinate, above zero: it makes the answer unique.
            damping: Cost per squared velocity of every coordinate, per weighted squared error that is left: it bounds
                the speeds of joints near a singular posture, and is gone at the target.
        """
        super().__init__(robot, dt)
        self._regularisation, self._damping = regularisation, damping
        self._levels: dict[int, int] = {}  # id of a task → its level, where it is not the first
        self._solution: VelocitySolution | None = None
        self._close_chains()
        self._rebuild()

    @property
    def solution(self) -> VelocitySolution | None:
        """Result of the last step: status, residuals, active limits; None before the first one."""
        return self._solution

    # ---- tasks, contacts and limits -----------------------------------------------------------------------------

    @overload
    def add(self, item: ItemT, /, *, level: int = 0) -> ItemT: ...
    @overload
    def add(self, item: Item, /, *items: Item, level: int = 0) -> tuple[Item, ...]: ...
    def add(self, item: Item, /, *items: Item, level: int = 0) -> Any:
        """Add tasks, contacts and limits, and return the item, or all of several as a tuple.

        Args:
            item: The first of them.
            *items: Further ones.
            level: Priority of these tasks, 0 first: a level decides on what those before it leave free, whatever its
                weights are. Contacts, limits and hard tasks have no level: they hold at every one.

        Raises:
            InputError: See `Controller.add`. Tasks on forces and torques, tasks that read sensors, and limits of
                torques have no place among velocities.
        """
        whole_number("level of a task", level, low=0)
        for each in (item, *items):
            if level and (not isinstance(each, Task) or each.hard):
                raise InputError(f"{each!r} holds at every level: add it without one")
        added = super().add(item, *items)
        if level:
            self._levels |= {id(each): level for each in (item, *items)}
        return added

    def remove(self, *items: Item) -> None:
        """Take tasks, contacts or limits out again."""
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
                if type(item).observe is not Task.observe:
                    raise InputError(f"{item!r} reads sensors: it has no place in inverse kinematics")
            if isinstance(item, Limit) and type(item).write_step is Limit.write_step:
                raise InputError(
                    f"limit '{item.name}' has no place in inverse kinematics: "
                    f"{type(item).__name__} has no `write_step`, which bounds a step of the configuration"
                )

    def _rebuild(self) -> None:
        """Make QP and solver of what there is now."""
        order = sorted({0, *self._levels.values()})
        levels = [[task for task in self._tasks if self._levels.get(id(task), 0) == level] for level in order]
        self._assembly = VelocityAssembly(
            self.robot, levels, self._contacts, self._limits, self._regularisation, self._damping
        )
        self._solver = QpSolver(self._assembly.problem, SOLVER)
        self._reads_all = any(each.reads == "all" for each in self._items())
        self._dirty = False
        self._refresh()

    # ---- steps --------------------------------------------------------------------------------------------------

    def update(self, q: Array) -> None:
        """Set the configuration, shape (nq,); frames, the CoM and their Jacobians follow, forces do not."""
        self._move(self.robot.check_configuration("configuration", q))

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
            robot.compute_jacobians()

    def solve(self) -> Array:
        """Return the velocities at the present configuration: base in its own frame, then joints, shape (nv,).

        Nothing is raised where contacts and hard tasks contradict each other: look at the `solution`, and call
        `diagnose`.
        """
        if self._dirty:
            self._rebuild()
        if self._moving:
            self._moving = [task for task in self._moving if task.move_on(self._dt)]
        assembly, solver = self._assembly, self._solver
        assembly.write(self._dt)
        velocities, multipliers, status = self._solve()
        values = solver.values if not assembly.lower else assembly.problem.rows.dot(velocities)
        achieved = assembly.achieved(velocities, values)
        self._solution = VelocitySolution(
            status, velocities, achieved, multipliers, assembly.places, assembly.names
        )
        return velocities

    def _solve(self) -> tuple[Array, Array, Status]:
        """Solve the QP that is written; return variables, multipliers and status."""
        assembly, solver = self._assembly, self._solver
        status = solver.solve()
        if not status.ok:
            return np.zeros(self.robot.nv), np.zeros(len(assembly.names)), status
        x, multipliers = solver.x, solver.multipliers
        if assembly.lower:
            x, multipliers = solve_levels(assembly.problem, x, assembly.lower, assembly.damping)
        return x, multipliers, status

    def step(self) -> Array:
        """Solve, move the robot by one period, and return the velocities, shape (nv,)."""
        velocities = self.solve()
        robot = self.robot
        robot.v[:] = velocities
        self._move(pin.integrate(robot.model, robot.q, self._dt * velocities))
        return velocities

    @checked
    def reach(
        self,
        tolerance: Positive = 1e-4,
        iterations: Count = 200,
        *,
        starts: Count = 1,
        seed: Seed = 0,
    ) -> ReachResult:
        """Search for a configuration in which all targets are reached; the robot stays where it is.

        The search makes steps of Gauss and Newton with the damping of Levenberg and Marquardt, within the limits of
        positions: rates, velocities and accelerations do not count. It ends within the tolerance, or where no step
        lowers the weighted errors.

        Args:
            tolerance: Greatest error of a task, m and rad.
            iterations: Most steps of a start.
            starts: Number of starts: the present configuration, then random positions of the joints within their
                limits, until the targets are reached.
            seed: Seed of the random positions.

        Returns:
            The configuration with the least cost, what is not reached in it, and what holds it there.
        """
        if self._dirty:
            self._rebuild()
        robot = self.robot
        before = robot.q.copy()
        try:
            found = Search(robot, self._tasks, self._assembly, self._solve, self._move, tolerance)
            return found.run(iterations, starts, seed)
        finally:
            self._move(before)

    def diagnose(self) -> dict[str, float]:
        """Return contacts, hard tasks and limits that contradict each other, name → violation, worst first."""
        if self._dirty:
            self._rebuild()
            self._assembly.write(self._dt)
        return violated_groups(self._assembly.problem)
