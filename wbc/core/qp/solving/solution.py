"""Solution: the result of a tick of the controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wbc.base.html import html_table
from wbc.base.numbers import Array
from wbc.core.qp.solving.solver import Status

HOLDS = 1e-6
"""Multiplier, as a share of the greatest or of one, above which a limit holds something."""


def holding(names: tuple[str, ...], multipliers: Array) -> tuple[str, ...]:
    """Return the names of the limits whose multipliers are not zero, in the order of the rows."""
    sizes = np.abs(multipliers)
    active = np.flatnonzero(sizes > HOLDS * max(1.0, float(sizes.max(initial=0.0))))
    return tuple(names[i] for i in active)


class Timings(NamedTuple):
    """Wall time of the phases of a tick, s."""

    model: float
    assembly: float
    solve: float
    decode: float

    @property
    def total(self) -> float:
        """Wall time of the whole tick, s."""
        return self.model + self.assembly + self.solve + self.decode


@dataclass(frozen=True)
class Layout:
    """Names and places of variables and rows; made anew only when tasks, contacts or limits are added or removed."""

    nv: int  # number of accelerations, the first variables
    contacts: Mapping[str, slice]  # name → slice of the variables
    tasks: Mapping[str, slice]  # name → slice of the residual rows
    units: Mapping[str, str]  # name of a task → unit of its residual
    limits: tuple[str, ...]  # name, one for each inequality row


@dataclass(slots=True, eq=False)  # not frozen: that makes it four times as slow to make
class Solution:
    """Result of one tick; owns its arrays.

    Attributes:
        status: Step of the solver's ladder that succeeded. When `ok` is False the arrays hold the last good solution.
        variables: Accelerations, then contact wrenches, shape (n,).
        torques: Joint torques, shape (na,), Nm (or N).
        iterations: Outer iterations of the solver.
        timings: Wall time of each phase, s.
        layout: Names and places of variables and rows.
        residual_rows: Achieved minus reference of equalities and soft rows of the QP, then of all selections.
        multipliers: Multipliers of the inequalities, shape (n_in,), positive where the upper bound is active.
    """

    status: Status
    variables: Array
    torques: Array
    iterations: int
    timings: Timings
    layout: Layout
    residual_rows: Array
    multipliers: Array

    def __repr__(self) -> str:
        limits = self.active_limits
        return f"Solution({self.status.name.lower()}, {len(limits)} active limits, {1e6 * self.timings.total:.0f} µs)"

    def _repr_html_(self) -> str:
        lines = [f"{self!r}"]
        for name, rows in self.residuals.items():
            lines.append(f"{name}  {np.abs(rows).max(initial=0.0):.3g}  {self.layout.units.get(name, '')}")
        lines += [
            f"{name}  {'  '.join(f'{force:.1f}' for force in wrench)}  N, Nm"
            for name, wrench in self.wrenches.items()
        ]
        return html_table(
            "\n".join([*lines, *(f"limit  {name}" for name in dict.fromkeys(self.active_limits))])
        )

    @property
    def ok(self) -> bool:
        """True if the QP was solved."""
        return self.status.ok

    @property
    def accelerations(self) -> Array:
        """Generalised accelerations: base (in its own frame), then joints, shape (nv,), m/s² and rad/s²."""
        return self.variables[: self.layout.nv]

    @property
    def wrenches(self) -> dict[str, Array]:
        """Contact name → force variables: [force; moment] in the sole frame, or a force, N and Nm."""
        return {name: self.variables[rows] for name, rows in self.layout.contacts.items()}

    @property
    def residuals(self) -> dict[str, Array]:
        """Task name → achieved minus reference acceleration (or torque, or wrench), shape (dim,)."""
        return {name: self.residual_rows[rows] for name, rows in self.layout.tasks.items()}

    @property
    def active_limits(self) -> tuple[str, ...]:
        """Names of the active limits, in the order of the rows."""
        return holding(self.layout.limits, self.multipliers)
