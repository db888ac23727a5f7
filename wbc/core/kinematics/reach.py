"""Search for a configuration that reaches all targets: damped steps of Gauss and Newton within the limits.

A step may raise the cost if the next one lowers it below the least so far: where a weak posture moves along what strong
tasks leave free, each step raises their errors a little, which the next one takes back. If it does not, the search goes
back to the best configuration with more damping.

Source: R. M. Chamberlain, M. J. D. Powell, C. Lemarechal, H. C. Pedersen, "The watchdog technique for forcing
convergence in algorithms for constrained optimization", Mathematical Programming Study 16, 1982.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.kinematics.assembly import VelocityAssembly
from wbc.core.limits.pairs import random_joints
from wbc.core.qp.contact import Contact
from wbc.core.qp.solving.solver import Status
from wbc.core.qp.task import SelectionTask, Task
from wbc.core.robot import Robot

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-9, 1e6
"""Cost per squared step at first, at least and at most."""

SHARE = 0.01
"""Damping at first over the cost of the configuration, if that is less."""

SETTLED = 1e-7
"""Damping below which a small step means that the configuration is settled, whether or not targets are reached."""

LESS, MORE = 0.2, 4.0
"""Factors of the damping after a good step, and after two that did not lower the cost."""

POOR = 0.25
"""Share of the foreseen reduction of the cost below which a step is poor."""

STILL = 1e-10
"""Step that moves nothing, rad or m."""

PULLS = 0.1
"""Share of the greatest gradient that an error can have above which its task pulls on joints that could lessen it."""


@dataclass(frozen=True, slots=True, eq=False)
class ReachResult:
    """Configuration that a search has found.

    Attributes:
        configuration: The configuration, shape (nq,).
        reached: True if every task on a motion, every hard task and every contact is within the tolerance, and no limit
            is violated. Postures, unless they are hard, choose among configurations and do not count.
        errors: Name of a task → length of its error, in each unit of it: (m,), (rad,), or (m, rad) for a pose; the
            greatest error of a posture's joints, (m, rad) where some slide. Tasks on a velocity, such as a momentum,
            have none: a search does not move.
        missed: Name of a task or contact beyond the tolerance → by how much, such as "0.12 m, 0.3 rad".
        held_by: Names of the limits that hold the configuration or are violated; without such limits, of the tasks and
            contacts that pull against what is missed, or of missed ones that pull against each other. Empty where
            everything is reached, and where a target is out of reach.
        iterations: Number of steps of the last start.
        starts: Number of configurations from which the search began.
    """

    configuration: Array
    reached: bool
    errors: Mapping[str, tuple[float, ...]]
    missed: Mapping[str, str]
    held_by: tuple[str, ...]
    iterations: int
    starts: int

    def __str__(self) -> str:
        if self.reached:
            return f"reached in {self.iterations} steps"
        missed = ", ".join(f"{name} by {size}" for name, size in self.missed.items())
        held = (
            "; held by " + ", ".join(self.held_by)
            if self.held_by
            else "; nothing holds it: it is out of reach"
        )
        return f"not reached: {missed}{held}"


@dataclass(frozen=True, slots=True)
class Search:
    """Search of one solver, whose robot moves.

    Attributes:
        robot: The robot.
        tasks: All tasks that are on a configuration.
        assembly: Assembly of the QP.
        solve: Solves the QP that is written: variables, multipliers and status.
        update: Sets the configuration of the robot.
        tolerance: Greatest error of a target, m and rad.
    """

    robot: Robot
    tasks: Sequence[Task]
    assembly: VelocityAssembly
    solve: Callable[[], tuple[Array, Array, Status]]
    update: Callable[[Array], None]
    tolerance: float

    def run(self, iterations: int, starts: int, seed: int) -> ReachResult:
        """Search from the present configuration, then from random ones; see `InverseKinematics.reach`."""
        random, start = np.random.default_rng(seed), self.robot.q.copy()
        cost, best = self._descend(iterations, 1)
        for number in range(2, starts + 1):
            if best.reached:
                break
            q = start.copy()
            q[self.robot.base_nq :] = random_joints(self.robot, random)
            self.update(q)
            found, result = self._descend(iterations, number)
            if result.reached or not found >= cost:  # or the one before is none
                cost, best = found, result
        return best

    def _descend(self, iterations: int, number: int) -> tuple[float, ReachResult]:
        """Go down from the present configuration; return the cost that is left, and the result."""
        robot, assembly = self.robot, self.assembly
        best, astray = robot.q.copy(), False
        cost = least = assembly.write_step()
        damping = max(min(FIRST_DAMPING, SHARE * cost), LEAST_DAMPING)
        iteration, status = 0, Status.SOLVED
        for iteration in range(1, iterations + 1):  # noqa: B007 (its last value counts)
            assembly.damp(damping)
            step, _, status = self.solve()
            if not status.ok:
                break
            size = float(np.abs(step).max())
            foreseen = cost - assembly.cost_after(step)
            self.update(pin.integrate(robot.model, robot.q, step))
            trial = assembly.write_step()
            if trial <= least or size < STILL:
                gain = 1.0 if astray or foreseen <= 0.0 else (cost - trial) / foreseen
                if gain > POOR:
                    damping = max(LESS * damping, LEAST_DAMPING)
                best[:], astray, cost, least = robot.q, False, trial, trial
                if size < STILL or (size < self.tolerance and (damping < SETTLED or not self._missed())):
                    break
            elif not astray:
                astray, cost = True, trial
            else:
                astray, damping = False, MORE * damping
                if damping > MOST_DAMPING:
                    break
                self.update(best)
                cost = assembly.write_step()
        self.update(best)
        assembly.write_step()
        missed = self._missed()
        held: tuple[str, ...] = ()
        if not status.ok:
            held = tuple(assembly.not_finite()) or ("the search",)
            missed = missed or dict.fromkeys(held, status.value)
        elif missed:  # the multipliers of a step that is damped as much as errors are left
            assembly.damp(max(least, FIRST_DAMPING))
            _, multipliers, _ = self.solve()
            held = assembly.holding(multipliers, self.tolerance) or tuple(assembly.violated(self.tolerance))
            held = held or self._pulling(missed)
        errors = {task.name: tuple(size for *_, size in task.sizes(task.error)) for task in self.tasks}
        return least, ReachResult(best, not missed, errors, missed, held, iteration, number)

    def _missed(self) -> dict[str, str]:
        """Return what is beyond the tolerance → by how much, at the rows that are written."""
        missed = {}
        for block in self.assembly.present:
            if _counts(block.item):
                parts = block.item.sizes(block.error)
                far = [f"{size:.3g} {unit}" for unit, _, size in parts if not size <= self.tolerance]
                if far:
                    missed[_label(block.item)] = ", ".join(far)
        return missed | self.assembly.violated(self.tolerance)

    def _pulling(self, missed: Mapping[str, str]) -> tuple[str, ...]:
        """Return the names of tasks and contacts that hold what is missed, where joints could lessen its error.

        Where nothing else pulls, those that are missed pull against each other.
        """
        pulls = {_label(block.item): self.assembly.pull(block) for block in self.assembly.present}
        against = tuple(name for name in missed if name in pulls and pulls[name][1] > PULLS)
        if not against:
            return ()
        most = max(pull for pull, _ in pulls.values())
        others = tuple(name for name, (pull, _) in pulls.items() if name not in missed and pull > 0.01 * most)
        return others or (against if len(against) > 1 else ())


def _counts(item: Task | Contact) -> bool:
    """Return true for rows whose target is to be reached: not for postures, which only choose."""
    if isinstance(item, Contact):
        return True
    return item.hard or (not isinstance(item, SelectionTask) and not item.idle)


def _label(item: Task | Contact) -> str:
    """Return the name of a task, or that of a contact as one."""
    return f"contact {item.name}" if isinstance(item, Contact) else item.name
