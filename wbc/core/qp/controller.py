"""Controller of a robot: holds tasks, contacts and limits, and solves their QP at every tick.

`wbc.core.qp.assembly` states the QP and writes it, `wbc.core.qp.solving.solver` solves it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from time import perf_counter

import numpy as np

from wbc.base.checked import checked, fixed, result
from wbc.base.errors import InputError, names_in, shown, unknown_name
from wbc.base.html import html_table
from wbc.base.numbers import Array
from wbc.base.settings import Period, Positive
from wbc.core.qp.assembly import Assembly
from wbc.core.qp.contact import Contact
from wbc.core.qp.items import ANOTHER, Item, Items
from wbc.core.qp.released import ReleasedJoints
from wbc.core.qp.solving.problem import Problem
from wbc.core.qp.solving.solution import Solution, Timings
from wbc.core.qp.solving.solver import QpSolver, SolverSettings
from wbc.core.qp.task import Drives, Task, VariableTask
from wbc.core.robot import Robot
from wbc.core.signals import Measurement

NO_TORQUES: tuple[Array | None, bool] = (None, False)
"""Commanded torques, shape (na,), Nm, None before the first tick, and True for others than those of the solution."""


class Controller(Items):
    """Whole-body controller of one robot: `add` tasks, contacts and limits; `solve` the QP of each tick.

    Attributes:
        settings: Settings of the solver.
        model_time: Wall time of the last model update, s; it is part of the timings of the next solution.
        drives: Kind of drive commands, "torque" or "position", of the control that runs the controller; None while no
            control runs it.
        measured: Robot whose state is estimated from the sensors: `robot`, or in position control another one, which
            the control that runs the controller sets.
        problem: QP of the last tick.
        solution: Result of the last tick; None before the first one.
        released: Joints that another controller moves, see `release`; None while there are none.
    """

    settings: SolverSettings = fixed(ANOTHER)
    problem: Problem = result("_assembly.problem", "`solve` writes it")
    solution: Solution | None = result("_solution", "`solve` makes one")
    released: ReleasedJoints | None = result("_released", "`release` chooses joints")
    _assembly: Assembly
    _solution: Solution | None

    @checked
    def __init__(
        self,
        robot: Robot,
        dt: Period,
        *,
        regularisation: Positive = 1e-4,
        settings: SolverSettings | None = None,
    ) -> None:
        """Make a controller without tasks, contacts or limits; `add` them.

        Args:
            robot: The robot; update it before `solve`, which reads its state and writes nothing, or call `update`.
            dt: Control period, s.
            regularisation: Cost per squared acceleration of every coordinate, above zero. It makes the solution of the
                QP unique, and has a row in the status table.
            settings: Settings of the solver.
        """
        super().__init__(robot, dt, regularisation)
        self.settings = settings or SolverSettings()
        self.model_time = 0.0
        self._outside: Array | None = None
        self._released: ReleasedJoints | None = None
        self.measured = robot
        self.drives: Drives | None = None
        self._torques: Array | None = None  # of the last solution
        self._commanded = self._before = NO_TORQUES  # in the last tick, and in the one before
        self._close_chains()
        self._rebuild()

    @property
    def outside(self) -> Array | None:
        """Generalised forces of the surroundings in addition to the contacts, shape (nv,), Nm and N; None for none.

        A crane that holds the robot is an example. They enter the dynamics at every tick: the array is not copied, so
        that who has assigned it may fill it anew.
        """
        return self._outside

    @outside.setter
    def outside(self, value: Array | None) -> None:
        if value is not None and (not isinstance(value, np.ndarray) or value.shape != (self.robot.nv,)):
            raise InputError(
                f"outside of a controller must be an array of shape ({self.robot.nv},), got {shown(value)}"
            )
        self._outside = value

    @property
    def solver_counts(self) -> dict[str, int]:
        """Number of ticks since the last change of the layout, by the solver that solved them, and of failed ticks."""
        return dict(self._solver.counts)

    def run_by(self, drives: Drives, measured: Robot) -> None:
        """Take the kind of drives and the estimated robot of a control; refuse tasks that are made for other drives."""
        _check_drives(self._tasks, drives)
        self.drives, self.measured = drives, measured

    def _check_together(self, new: Sequence[Item]) -> None:
        """Refuse tasks for other drives, and those on all variables that cannot be bound to the QP or evaluated."""
        _check_drives([item for item in new if isinstance(item, Task)], self.drives)
        contacts = [*self._contacts, *(item for item in new if isinstance(item, Contact))]
        tasks = [item for item in new if isinstance(item, VariableTask)]
        tasks = [task for task in tasks if task.waits_for() in (None, *contacts)]
        if tasks:
            alone = Assembly(self.robot, (), contacts, (), self.regularisation)
            for task in tasks:
                task.try_on(alone.problem)

    def release(self, joints: Sequence[str]) -> ReleasedJoints | None:
        """Leave exactly these joints to another controller, such as a teleoperator; an empty list takes all back.

        The QP knows their motion (see `wbc.core.qp.released`). Their torques are those that this motion needs. The
        controller does not apply their limits.

        Args:
            joints: Names of joints that are not in a leg.

        Raises:
            UnknownNameError: The robot has no such joint.
            InputError: A joint in a leg or given twice, or the QP shares the joints with a policy.
        """
        released, before = self.check_release(joints), self._released
        if before is not None:
            if released is not None and released.joints == before.joints:
                return before  # with what has been told and measured of them
            self.remove(before)
        return released if released is None else self.add(released)

    def check_release(self, joints: Sequence[str]) -> ReleasedJoints | None:
        """Return the joints that `release` would return, and release nothing; it raises the same errors."""
        names = names_in("joints to release", joints)
        if self._released is not None and self._released.commanded:
            raise InputError("joints of a policy whose arms the QP moves are shared by these two already")
        return ReleasedJoints(self.robot, names) if names else None

    def _changed(self) -> None:
        super()._changed()
        self._released = next((task for task in self._tasks if isinstance(task, ReleasedJoints)), None)

    # ---- the tick -----------------------------------------------------------------------------------------------

    def update(self, q: Array, v: Array) -> None:
        """Update the robot's state: configuration, shape (nq,), and velocity, shape (nv,); see `Robot.update`."""
        start = perf_counter()
        self.robot.update(q, v)
        self.model_time = perf_counter() - start

    def solve(self, measurement: Measurement | None = None) -> Solution:
        """Solve the QP at the present state of the robot.

        Tasks that read sensors need the measurement: without it they raise an `InputError`.

        An infeasible QP raises no error. Check the `status` of the solution, and call `diagnose` for the constraints
        that contradict each other.
        """
        start = perf_counter()
        if self._dirty:
            self._rebuild()
        self._move_targets()
        self._before = self._commanded
        assembly, solver = self._assembly, self._solver
        for task in assembly.listening:
            if measurement is None:
                task.unobserved(self.dt)
            else:
                task.observe(measurement, self.dt)
        for contact in self._contacts:
            contact.advance(self.dt)
        self._write()
        assembled = perf_counter()
        status = solver.solve()
        solved = perf_counter()
        last = self._solution
        if status.ok:
            x = solver.x
            self._torques = torques = solver.values[assembly.torque_rows] + assembly.problem.torque_bias
            if self.robot.passive.size:  # zero up to the solver's tolerance
                torques[self.robot.passive] = 0.0
            self._commanded = torques, False
            residual = assembly.residuals(x, solver.values, assembly.targets)
            multipliers = solver.multipliers
        else:
            x = self._variables_of(last)
            torques = assembly.problem.torque_bias.copy() if last is None else last.torques
            residual = np.full(assembly.targets.size, np.nan)
            multipliers = np.zeros(solver.multipliers.size)
        timings = Timings(self.model_time, assembled - start, solved - assembled, perf_counter() - solved)
        self._solved = assembly
        self._solution = solution = Solution(
            status, x, torques, solver.iterations, timings, assembly.layout, residual, multipliers
        )
        return solution

    def _write(self) -> None:
        """Write the present state into the QP."""
        self._assembly.write(self.dt, self._torques, self._outside, self._released)

    def _variables_of(self, last: Solution | None) -> Array:
        """Return the variables of the last tick by their names: wrenches of contacts that are new are zero."""
        layout, x = self._assembly.layout, np.zeros(self.problem.diagonal.size)
        if last is None:
            return x
        if last.layout is layout:
            return last.variables
        x[: layout.nv] = last.accelerations
        for name, columns in layout.contacts.items():
            before = last.layout.contacts.get(name, slice(0, 0))
            if before.stop - before.start == columns.stop - columns.start:
                x[columns] = last.variables[before]
        return x

    def torques(self, solution: Solution, wrenches: Mapping[str, Array] | None) -> Array:
        """Return the joint torques of the motion of a solution with other wrenches at some contacts, shape (na,), Nm.

        They are cut off at the torque limits, and change since the tick before no faster than these allow.

        Args:
            solution: Solution of this tick.
            wrenches: Name of a contact → wrench that replaces that of the solution, in the contact frame,
                shape (dim,), N and Nm; None for none.
        """
        before, differed = self._before
        if not (wrenches or differed):
            return solution.torques
        torques = solution.torques
        if wrenches:
            x, columns = solution.variables.copy(), solution.layout.contacts
            for name, wrench in wrenches.items():
                if name not in columns:
                    unknown_name("contact", name, columns)
                place = columns[name]
                if np.asarray(wrench).shape != (place.stop - place.start,):
                    raise InputError(
                        f"wrench of contact '{name}' must have shape ({place.stop - place.start},), got "
                        f"{np.shape(wrench)}"
                    )
                x[place] = wrench
            if not math.isfinite(x.dot(x)):
                raise InputError(f"wrenches of contacts must be finite, got {shown(wrenches)}")
            problem = self._assembly.problem
            torques = np.asarray(problem.torque_matrix.dot(x) + problem.torque_bias)
        torques = self._assembly.kept(torques, self.dt, before, self.released)
        self._commanded = torques, bool(wrenches) or bool((torques != solution.torques).any())
        return torques

    def _rebuild(self) -> None:
        """Make QP and solver of what the controller has now."""
        items = self._tasks, self._contacts, self._limits
        self._assembly = Assembly(self.robot, *items, self.regularisation)
        self._solver = QpSolver(self._assembly.problem, self.settings)
        self._dirty = False

    def reset(self) -> None:
        """Reset tasks, contacts (places and force ramps), limits, torques of the last tick and guesses of the solver.

        The QP is made anew at once, where it has been solved or its items have changed, so that no tick has to.
        """
        for task in self._tasks:
            task.reset()
        for contact in self._contacts:
            contact.reset()
        for limit in self._limits:
            limit.reset()
        if self._dirty or self._solution is not None:
            self._rebuild()
        self._torques = self._solution = None
        self._commanded = self._before = NO_TORQUES

    # ---- explanations -------------------------------------------------------------------------------------------

    def status_table(self) -> str:
        """Return a printable table of the last tick: tasks with what holds them back, contacts, active limits."""
        robot, solution, held = self.robot, self._solution, self.held_back()
        lines = [f"{robot!r}  period {1e3 * self.dt:g} ms"]
        if solution is None:
            lines.append("not solved yet")
        else:
            t = solution.timings
            lines.append(
                f"{solution.status.value} in {solution.iterations} iterations, {1e6 * t.total:.0f} µs (model "
                f"{1e6 * t.model:.0f}, assembly {1e6 * t.assembly:.0f}, solve {1e6 * t.solve:.0f}, "
                f"decode {1e6 * t.decode:.0f})"
            )
        lines.append(f"{'task':<24}{'rows':>5}  {'weight':>9}  {'error':>12}  {'residual':>14}")
        residuals = {} if solution is None else solution.residuals
        for task in self._tasks:
            weight = "hard" if task.hard else f"{(task.weight * task.scale).max():.3g}"
            error = f"{np.abs(task.error).max():.3g} {task.unit}"
            residual = (
                f"{np.abs(residuals[task.name]).max():.3g} {task.residual_unit}"
                if task.name in residuals
                else "–"
            )
            by = f"  held back by {', '.join(held[task.name])}" if task.name in held else ""
            lines.append(f"{task.name:<24}{task.dim:>5}  {weight:>9}  {error:>12}  {residual:>14}{by}")
        lines.append(f"{'acceleration (all)':<24}{robot.nv:>5}  {self.regularisation:>9.3g}")
        wrenches = {} if solution is None else solution.wrenches
        for contact in self._contacts:
            state = "active" if contact.active else ("unloading" if contact.engaged else "off")
            force = wrenches.get(contact.name)
            text = "" if force is None else "  " + " ".join(f"{f:8.1f}" for f in force)
            lines.append(f"{'contact ' + contact.name:<24}{state:>10}{text}")
        if solution is not None:
            active = solution.active_limits
            names = [
                f"{name} (×{active.count(name)})" if active.count(name) > 1 else name
                for name in dict.fromkeys(active)
            ]
            lines.append("active limits: " + (", ".join(names) or "none"))
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return html_table(self.status_table())


def _check_drives(tasks: Sequence[Task], drives: Drives | None) -> None:
    """Refuse tasks that are made for other drives than a control commands."""
    for task in tasks:
        if drives is not None and task.drives not in (None, drives):
            mode = "position control" if drives == "position" else "torque and hybrid control"
            raise InputError(
                f"task '{task.name}' is made for drives='{task.drives}', and {mode} needs drives='{drives}'"
            )
