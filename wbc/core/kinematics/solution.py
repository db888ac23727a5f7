"""Results of inverse kinematics: velocities of a step, and a configuration that was searched for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wbc.base.html import html_table
from wbc.base.numbers import Array
from wbc.core.qp.solving.solver import Status
from wbc.core.qp.store import RowStore

HOLDS = 1e-6
"""Multiplier, as a share of the greatest or of one, above which a limit holds something."""


def holding(names: tuple[str, ...], multipliers: Array) -> tuple[str, ...]:
    """Return the names of the limits whose multipliers are not zero, each once."""
    sizes = np.abs(multipliers)
    active = np.flatnonzero(sizes > HOLDS * max(1.0, float(sizes.max(initial=0.0))))
    return tuple(dict.fromkeys(names[i] for i in active))


@dataclass(slots=True, eq=False)
class VelocitySolution:
    """Result of one step; owns its arrays.

    Attributes:
        status: Step of the solver's ladder that succeeded; `RELAXED` where limits, contacts and hard tasks could not
            all be kept. When `ok` is False the velocities are zero.
        velocities: Generalised velocities: base (in its own frame), then joints, shape (nv,), m/s and rad/s.
        values: Velocities of the rows of the QP.
        targets: Wanted velocities of all rows.
        multipliers: Multipliers of the inequalities, positive where the upper bound is active.
        rows: Rows of tasks and limits, with their names.
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
        return holding(self.rows.names, self.multipliers)


@dataclass(frozen=True, slots=True, eq=False)
class ReachResult:
    """Configuration that a search has found.

    Attributes:
        configuration: The configuration, shape (nq,).
        reached: True if every task on a motion, every hard task and every contact is within the tolerance, and no limit
            is violated. Postures, unless they are hard, choose among configurations and do not count.
        errors: Name of a task → length of its error, in each unit of it: (m,), (rad,), or (m, rad) for a pose. Tasks on
            a velocity, such as a momentum, have none: a search does not move.
        missed: What is beyond the tolerance → by how much, such as "0.12 m, 0.3 rad".
        held_by: Names of the limits that hold the configuration where it is, or that are violated. Where no limit is
            either, names of the tasks and contacts that pull against what is missed, or of missed ones that pull
            against each other. Empty where everything is reached, and where a target is out of reach.
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
