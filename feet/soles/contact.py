"""The paper's soft-constraint law, its translation to MuJoCo, and the spheres under a sole."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from wbc.base.numbers import Array
from wbc.base.settings import Positive, settings

Impedance = Annotated[float, Field(ge=0.0001, le=0.9999)]


@settings
class ConstraintLaw:
    """Soft constraint a = (1 − d) a₀ − d b v − d k r with d = d(r), b = 2 / (d_max t), k = 1 / (d_max² t² ζ²).

    Eq. (1)–(2) of the paper, which prints rad/(Nms²) for d, a ratio that has no unit, and ζ where MuJoCo has ζ²: they
    agree at ζ = 1, the value used for all its constraints. MuJoCo raises a t that is too short for its step: explicit
    and implicit velocity integrators to 2 dt, `discrete` in normal rows alone, until d k dt² ≤ 1.

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

    @property
    def solref(self) -> tuple[float, float]:
        """MuJoCo's `solref`: t and ζ."""
        return self.time_constant, self.damping_ratio

    @property
    def solimp(self) -> tuple[float, float, float, float, float]:
        """MuJoCo's `solimp`: d_0, d_max, width, ½ and 2."""
        return *self.impedance, self.width, 0.5, 2.0


LOOP_CLOSURE = ConstraintLaw(0.002, impedance=(0.9, 0.95))
"""Frontal arch to sole: t = 2 ms, d from 0.9 to 0.95 (paper, section II-B)."""

SOLE_GROUND = ConstraintLaw(0.002, impedance=(0.99, 0.99))
"""Sole to ground: t = 2 ms; printed are t = 0.1 ms, and d = 0.99 against creeping (paper, section II-B).

With the integrators of 2022 and a step of 1 ms, `refsafe` turns the printed 0.1 ms into 2 ms, so the authors'
simulation will have used 2 ms. With `discrete` the printed value would act as 1 ms: a standing robot with soft feet
then chatters by more than 1 N in a third of the cases on random ground, and the simulation takes 2.5 times as long.
With 2 ms it chatters in 1 case of 14, and the soles sink by less than 0.05 mm (5 grounds x 3 stiffnesses).
"""


@settings
class ContactSpheres:
    """Contact geometry of a sole: an even grid of small spheres whose lowest points span the rectangle.

    Spheres, because a box on a height field loses contacts beyond 50 per pair and its centre of pressure
    wanders by up to 35 mm. A stone narrower than the lateral spacing can pass between two columns.

    Attributes:
        law: Constraint law of the contact.
        friction: Coulomb coefficient; larger than the 0.7 that the controller assumes, as a margin.
        radius: Radius of the spheres, m.
        columns: Spheres across the sole.
        row_spacing: Largest distance between rows of a rigid sole, m.

    4 columns cost up to a fifth of the speed, friction about the normal up to an eighth, rolling friction up to a
    third; the shape of the sole stays the same.

    Source: friction 0.7 from the authors' public controller configuration; the rest measured on this foot at 1 ms.
    """

    law: ConstraintLaw = SOLE_GROUND
    friction: Positive = 0.8
    radius: Annotated[Positive, "m"] = 0.007
    columns: Annotated[int, Field(ge=2, le=100)] = 3
    row_spacing: Annotated[Positive, "m"] = 0.015

    def rows(self, length: float) -> int:
        """Return the number of rows of a rigid sole of this length (m)."""
        return max(2, math.ceil(length / self.row_spacing) + 1)

    def row_positions(self, length: float, count: int) -> Array:
        """Return the positions of the rows along x of the sole frame, from toe to heel, shape (count,), m."""
        return np.linspace(-length / 2.0, length / 2.0, count)[::-1].copy()

    def column_positions(self, width: float) -> Array:
        """Return the positions of the columns along y of the sole frame, from right to left, shape (columns,), m."""
        return np.linspace(-width / 2.0, width / 2.0, self.columns)
