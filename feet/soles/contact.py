"""The paper's soft-constraint law, its translation to MuJoCo, and the spheres under a sole."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple, get_args

import numpy as np
from pydantic import Field

from wbc.core.errors import Array, InputError, choose, positive
from wbc.core.settings import NonNegative, Positive, settings

Integrator = Literal["discrete", "implicitfast", "implicit", "Euler"]
ConstraintRow = Literal["normal", "friction", "equality"]
Impedance = Annotated[float, Field(ge=0.0001, le=0.9999)]


class SolverParameters(NamedTuple):
    """Values of MuJoCo's `solref` and `solimp` attributes."""

    solref: tuple[float, float]
    solimp: tuple[float, float, float, float, float]


class LawGains(NamedTuple):
    """Coefficients of eq. (1) at one violation.

    `impedance` d has no unit, `damping` b is in 1/s and `stiffness` k in 1/s², so that every term is an
    acceleration.
    """

    impedance: float
    damping: float
    stiffness: float


@settings
class ConstraintLaw:
    """Soft constraint a = (1 − d) a₀ − d b v − d k r with d = d(r), eq. (1) of the paper.

    The paper prints rad/(Nms²) for d; it is a ratio and has no unit.

    Attributes:
        time_constant: t, s.
        damping_ratio: ζ, 1 is critical.
        impedance: d_0 at zero violation and d_max at full violation, each in (0, 1).
        width: Violation at which d reaches d_max, m (MuJoCo's default, the paper gives none).

    Source: Frizza et al., Humanoids 2022, eq. (1)–(2); MuJoCo documentation, "Solver parameters".
    """

    time_constant: Annotated[Positive, "s"]
    damping_ratio: Positive = 1.0
    impedance: tuple[Impedance, Impedance] = (0.9, 0.95)
    width: Annotated[Positive, "m"] = 0.001

    def impedance_at(self, violation: float) -> float:
        """Return d(r): a smooth rise from d_0 to d_max over `width`, power 2 about the middle.

        Args:
            violation: |r|, m.

        Source: MuJoCo documentation, "Impedance" (midpoint 0.5, power 2).
        """
        d_0, d_max = self.impedance
        x = min(abs(violation) / self.width, 1.0)
        y = 2.0 * x * x if x <= 0.5 else 1.0 - 2.0 * (1.0 - x) ** 2
        return d_0 + (d_max - d_0) * y

    def gains(self, violation: float) -> LawGains:
        """Return d(r), b = 2 / (d_max t) and k = d(r) / (d_max² t² ζ²), eq. (2) of the paper.

        The paper prints ζ where MuJoCo has ζ²; they agree at ζ = 1, the value used for all its constraints.

        Args:
            violation: |r|, m.
        """
        d = self.impedance_at(violation)
        d_max, t = self.impedance[1], self.time_constant
        return LawGains(d, 2.0 / (d_max * t), d / (d_max * t * self.damping_ratio) ** 2)


LOOP_CLOSURE = ConstraintLaw(0.002, impedance=(0.9, 0.95))
"""Frontal arch to sole: t = 2 ms, d from 0.9 to 0.95 (paper, section II-B)."""

PAPER_SOLE_GROUND = ConstraintLaw(0.0001, impedance=(0.99, 0.99))
"""Sole to ground as printed: t = 0.1 ms, d = 0.99 against creeping (paper, section II-B)."""

SOLE_GROUND = ConstraintLaw(0.002, impedance=(0.99, 0.99))
"""Sole to ground as used here: t = 2 ms.

With the integrators of 2022 and a step of 1 ms, `refsafe` turns the printed 0.1 ms into 2 ms, so the authors'
simulation will have used 2 ms. With `discrete` the printed value would act as 1 ms: a standing robot with soft feet
then chatters by more than 1 N in a third of the cases on random ground, and the simulation takes 2.5 times as long.
With 2 ms it chatters in 1 case of 14, and the soles sink by less than 0.05 mm (5 grounds x 3 stiffnesses).
"""


def solver_parameters(law: ConstraintLaw) -> SolverParameters:
    """Return a constraint law as MuJoCo's parameters: solref = (t, ζ) and solimp = (d_0, d_max, width, ½, 2).

    MuJoCo does not always use t as it is given: see `effective_time_constant`.
    """
    return SolverParameters((law.time_constant, law.damping_ratio), (*law.impedance, law.width, 0.5, 2.0))


def effective_time_constant(
    law: ConstraintLaw,
    timestep: float,
    *,
    integrator: Integrator = "discrete",
    row: ConstraintRow = "normal",
    violation: float = 0.0,
) -> float:
    """Return the time constant that MuJoCo uses for a constraint row with its `refsafe` protection on, s.

    Explicit and implicit velocity integrators cannot follow a constraint faster than two steps, so they raise any
    smaller t to 2 dt: the paper's 0.1 ms is 2 ms at dt = 1 ms, and the 2 ms loop closure is 4 ms at dt = 2 ms. The
    `discrete` integrator raises t in normal rows alone, until k dt² ≤ 1 with the k of eq. (2): the paper's 0.1 ms is
    1.005 ms at dt = 1 ms. Friction and equality rows keep t as it is given.

    Args:
        law: The constraint.
        timestep: Physics step dt, s.
        integrator: MuJoCo's integrator.
        row: Normal or friction direction of a contact, or an equality.
        violation: |r|, m.

    Source: measured on mujoco 3.17 through `MjData.efc_KBIP`; MuJoCo documentation, "refsafe".
    """
    positive("timestep (s)", timestep)
    choose("integrator", integrator, get_args(Integrator))
    choose("constraint row", row, get_args(ConstraintRow))
    if integrator != "discrete":
        return max(law.time_constant, 2.0 * timestep)
    if row == "normal":
        stable = timestep * math.sqrt(law.impedance_at(violation)) / (law.impedance[1] * law.damping_ratio)
        return max(law.time_constant, stable)
    return law.time_constant


@settings
class ContactSpheres:
    """Contact geometry of a sole: an even grid of small spheres whose lowest points span the rectangle.

    Spheres, because a box on a height field loses contacts beyond 50 per pair and its centre of pressure
    wanders by up to 35 mm. A stone narrower than the lateral spacing can pass between two columns.

    Attributes:
        law: Constraint law of the contact; `PAPER_SOLE_GROUND` is the printed one.
        friction: Coulomb coefficient; larger than the 0.7 that the controller assumes, as a margin.
        condim: Dimension of the contact force: 3 (normal, two tangents), 4 (with spin) or 6 (with rolling).
        spin_friction: Coefficient about the normal, m; used with `condim` 4 and 6.
        rolling_friction: Coefficient of rolling, m; used with `condim` 6.
        radius: Radius of the spheres, m.
        columns: Spheres across the sole.
        rows_per_phalanx: Rows of spheres under each phalanx of a soft sole.
        row_spacing: Largest distance between rows of a rigid sole, m.
        inset: Distance from the edges of the rectangle to the outer sphere centres, m.

    With one row per phalanx a standing robot simulates 1.2 to 1.6 times as fast, but the ankle stands up to 1 mm lower
    on stones and hinge angles differ by up to 0.08 rad. 4 columns cost up to a fifth of the speed, `condim` 4 up to an
    eighth and 6 up to a third; the shape of the sole stays the same.

    Source: friction 0.7 from the authors' public controller configuration; the rest measured on this foot at 1 ms.
    """

    law: ConstraintLaw = SOLE_GROUND
    friction: Positive = 0.8
    condim: Literal[3, 4, 6] = 3
    spin_friction: Annotated[NonNegative, "m"] = 0.005
    rolling_friction: Annotated[NonNegative, "m"] = 0.0001
    radius: Annotated[Positive, "m"] = 0.007
    columns: Annotated[int, Field(ge=2, le=100)] = 3
    rows_per_phalanx: Annotated[int, Field(ge=1, le=100)] = 2
    row_spacing: Annotated[Positive, "m"] = 0.015
    inset: Annotated[NonNegative, "m"] = 0.0

    def rows(self, length: float) -> int:
        """Return the number of rows of a rigid sole of this length (m)."""
        return max(2, math.ceil((length - 2.0 * self.inset) / self.row_spacing) + 1)

    def row_positions(self, length: float, count: int) -> Array:
        """Return the positions of the rows along x of the sole frame, from toe to heel, shape (count,), m."""
        return _even(length, count, self.inset)[::-1].copy()

    def column_positions(self, width: float) -> Array:
        """Return the positions of the columns along y of the sole frame, from right to left, shape (columns,), m."""
        return _even(width, self.columns, self.inset)


def _even(extent: float, count: int, inset: float) -> Array:
    half = extent / 2.0 - inset
    if half <= 0.0:
        raise InputError(f"inset {inset:g} m leaves nothing of a sole {extent:g} m wide")
    return np.linspace(-half, half, count)
