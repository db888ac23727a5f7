"""Explanations for people: which constraints contradict each other, and a table of a controller's state."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import qpsolvers

if TYPE_CHECKING:
    from wbc.core.qp.controller import Controller, Problem
    from wbc.core.qp.solution import Solution

SLACK_TOLERANCE = 1e-4
"""Violation below which a group counts as kept, in the unit of its rows."""


def violated_groups(problem: Problem) -> dict[str, float]:
    """Solve the elastic problem: every row but the wrench cones and dynamics may be violated, at a quadratic price.

    The dynamics of the floating base are physics and stay exact; all else has one slack per row.

    Args:
        problem: An assembled problem.

    Returns:
        Group → largest violation, for the groups that cannot all be kept, worst first; empty if all can.
    """
    p = problem
    n, n_eq, n_in = p.diagonal.size, p.n_eq, p.lower.size
    physics = p.equality_groups["floating-base dynamics"].stop
    n_slack = n_eq - physics + n_in
    identity = np.eye(n_slack)
    # Least violation first: the objective of the tasks is dropped, but for a trace that makes the answer unique.
    hessian = np.diag(np.concatenate([np.full(n, 1e-12), np.ones(n_slack)]))
    equality = np.hstack([p.equality, np.vstack([np.zeros((physics, n_slack)), identity[: n_eq - physics]])])
    rows = np.hstack([p.inequality, identity[n_eq - physics :]])
    above, below = np.isfinite(p.upper) & (p.upper < 1e20), np.isfinite(p.lower) & (p.lower > -1e20)
    solution = qpsolvers.solve_problem(
        qpsolvers.Problem(
            hessian,
            np.zeros(n + n_slack),
            np.vstack([rows[above], -rows[below]]),
            np.concatenate([p.upper[above], -p.lower[below]]),
            equality,
            np.array(p.equality_target),
        ),
        solver="daqp",
    )
    if not solution.found:
        return {"floating-base dynamics": float("inf")}
    slack = np.abs(solution.x[n:])
    violated = {}
    for name, block in p.equality_groups.items():
        if block.start >= physics:
            violated[name] = float(slack[block.start - physics : block.stop - physics].max(initial=0.0))
    for name, block in p.inequality_groups.items():
        violated[name] = float(slack[n_eq - physics :][block].max(initial=0.0))
    worst_first = sorted(violated.items(), key=lambda item: -item[1])
    return {name: value for name, value in worst_first if value > SLACK_TOLERANCE}


def status_table(controller: Controller, solution: Solution | None) -> str:
    """Write a table: tasks with weight, error and residual, contacts with their forces, limits that push."""
    lines = [f"{controller.robot!r}  period {1e3 * controller.dt:g} ms"]
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
    for task in controller.tasks:
        weight = "hard" if task.hard else f"{task.weight.max():.3g}"
        error = f"{np.abs(task.error).max():.3g} {task.unit}"
        residual = (
            f"{np.abs(residuals[task.name]).max():.3g} {task.residual_unit}"
            if task.name in residuals
            else "–"
        )
        lines.append(f"{task.name:<24}{task.dim:>5}  {weight:>9}  {error:>12}  {residual:>14}")
    lines.append(f"{'acceleration (all)':<24}{controller.robot.nv:>5}  {controller.regularisation:>9.3g}")
    wrenches = {} if solution is None else solution.wrenches
    for contact in controller.contacts:
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
