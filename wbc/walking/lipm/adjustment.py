"""Step adjustment: place and time of a landing with which the pendulum can be caught.

Over the planned ZMP, a DCM error of e now is one of e · e^{ωT} when the foot has landed and taken over, T from now. An
error that no ZMP within the stance foot brings back asks for another place or time of the landing, such that the DCM
is as planned relative to the new foot. With the exponential of time τ = e^{ωT} as unknown this is linear,

    u + b = z + (ξ − z) τ + δ (1 − τ*)

with the landing u, the DCM b over it, the one constant ZMP z that stands for the planned motion, and the shift δ
of the ZMP by feedback (taken at the planned time). A small QP weighs all changes within the limits of the sole, of the
leg and of time:

    minimise  w_u |u − u*|² + w_τ (τ/τ* − 1)² + w_b |b − b*|² + w_δ |δ|².

Source: M. Khadiv, A. Herzog, S. A. A. Moosavian, L. Righetti, "Walking control based on step timing adaptation",
IEEE T-RO 36(3), 2020, eq. (9)–(13).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np

from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, settings
from wbc.core.qp.problem import Problem
from wbc.core.qp.solver import QpSolver
from wbc.core.robot import SIDES
from wbc.walking.lipm.schedule import ZmpTarget
from wbc.walking.plans.footsteps import Footstep, SoleSizes
from wbc.walking.plans.reach import Reach

LANDING_COST, TIME_COST, OFFSET_COST, SHIFT_COST = 1.0, 0.05, 100.0, 0.01
"""Costs of a landing away from the plan, 1/m², of a relative change of e^{ωT}, of a DCM away from the plan relative to
the landing foot, and of a shift of the ZMP within the stance foot, 1/m²."""

SHORTEST, LONGEST, FREEZE = 0.05, 0.1, 0.05
"""Least time from now to touch-down, greatest stretch of the time left, time before touch-down in which the step stays,
s: a foot needs that much to come down."""

SAME_TIME = 0.05
"""Relative change of e^{ωT} below which the time of touch-down counts as unchanged."""


@settings
class AdjustmentSettings:
    """Limits of step adjustment.

    Attributes:
        margin: Distance of the ZMP from the edge of the stance foot, m.
        backward: Greatest shift of the ZMP towards the heel, m. With a step that comes early the DCM lags behind; the
            heel would have to push it on, and seldom carries on stones.
        threshold: Change of landing below which the step stays as planned, m.
        max_shift: Greatest distance of a landing from the plan, forward and sideways, m.
    """

    margin: Annotated[NonNegative, "m"] = 0.01
    backward: Annotated[NonNegative, "m"] = 0.03
    threshold: Annotated[NonNegative, "m"] = 0.005
    max_shift: Annotated[tuple[NonNegative, NonNegative], "m"] = (0.15, 0.12)

    def sized(self, scale: float) -> AdjustmentSettings:
        """Return the settings with their lengths times a factor, for a small robot (`Robot.length_scale`)."""
        forward, aside = self.max_shift
        return replace(
            self,
            margin=scale * self.margin,
            backward=scale * self.backward,
            threshold=scale * self.threshold,
            max_shift=(scale * forward, scale * aside),
        )


class StepAdjuster:
    """QP of step adjustment for one robot."""

    def __init__(
        self, omega: float, reach: Reach, sizes: SoleSizes, settings: AdjustmentSettings | None = None
    ) -> None:
        """Set up the QP for a natural frequency, 1/s, and (length, width) of the left and of the right sole, m."""
        self.settings = settings or AdjustmentSettings()
        self._omega = omega
        self._reach = reach
        margin = self.settings.margin
        self._half = [[max(0.5 * size - margin, 1e-3) for size in sole] for sole in sizes]  # less the margin
        # Unknowns: landing, shift of the ZMP, relative time τ/τ*, DCM over the landing; in the stance foot's axes.
        self._problem = p = Problem(0, 0, 7, 2, 1, 5)
        p.equality[:, 0:2] = p.equality[:, 5:7] = np.eye(2)
        p.inequality[:, :5] = np.eye(5)
        p.diagonal[:] = (*[LANDING_COST] * 2, *[SHIFT_COST] * 2, TIME_COST, *[OFFSET_COST] * 2)
        p.soft_weight[:] = 1e-9  # the solver wants one soft row
        self._solver = QpSolver(p)

    def adjust(
        self,
        dcm: Array,
        planned: Array,
        at_landing: Array,
        step: Footstep,
        stance: Footstep,
        remaining: float,
        transfer: float,
        target: ZmpTarget,
    ) -> tuple[Footstep, float]:
        """Return landing and time to touch-down, s; as planned where a ZMP within the stance foot is enough.

        The DCM is measured, and planned, now and `at_landing`, when the new foot has taken over, in the world, m; the
        times are to touch-down (`remaining`), and from there until the new foot has taken over (`transfer`), s.
        """
        s, omega = self.settings, self._omega
        if remaining <= FREEZE:
            return step, remaining
        c, sn = math.cos(stance.yaw), math.sin(stance.yaw)
        ahead, left = target.in_sole(stance.side)
        length, width = self._half[SIDES.index(stance.side)]
        shift_low = (min(0.0, max(-length - ahead, -s.backward)), min(0.0, -width - left))
        shift_high = (max(0.0, length - ahead), max(0.0, width - left))
        grow = math.exp(omega * (remaining + transfer))
        if self._idle(dcm, planned, (c, sn), grow, shift_low, shift_high):
            return step, remaining
        to_world = np.array([[c, -sn], [sn, c]])
        origin = np.array([stance.x, stance.y])
        now, plan_now, plan_then = (
            (np.asarray(x[:2]) - origin) @ to_world for x in (dcm, planned, at_landing)
        )
        landing = (np.array([step.x, step.y]) - origin) @ to_world
        offset = plan_then - landing
        self._write_motion(now, (plan_now * grow - plan_then) / (grow - 1.0), grow, landing, offset)
        low, high = self._bounds(landing, step.side, s.max_shift)
        shortest = math.exp(omega * (max(SHORTEST, FREEZE) - remaining))
        self._problem.lower[:] = (*low, *shift_low, min(1.0, shortest))
        self._problem.upper[:] = (*high, *shift_high, math.exp(omega * LONGEST))
        if not self._solver.solve().ok:
            return step, remaining
        x = self._solver.x
        if float(np.hypot(*(x[:2] - landing))) <= s.threshold and abs(x[4] - 1.0) < SAME_TIME:
            return step, remaining
        place = origin + to_world @ x[:2]
        time = remaining + math.log(max(x[4], 1e-6)) / omega
        return replace(step, x=float(place[0]), y=float(place[1])), time

    def _write_motion(self, dcm: Array, zmp: Array, grow: float, landing: Array, offset: Array) -> None:
        """Write the equation of the module, with σ = τ/τ*, and the costs, all in the stance foot's axes."""
        p = self._problem
        # u − δ (1 − τ*) − (ξ − z) τ* σ + b = z
        p.equality[:, 2:4] = (grow - 1.0) * np.eye(2)
        p.equality[:, 4] = -(dcm - zmp) * grow
        p.target[:2] = zmp
        p.linear[:] = p.diagonal * (*landing, 0.0, 0.0, 1.0, *offset)

    def _idle(
        self,
        dcm: Array,
        planned: Array,
        heading: tuple[float, float],
        grow: float,
        low: Sequence[float],
        high: Sequence[float],
    ) -> bool:
        """True if the planned step is already optimal, so that the QP can be skipped.

        The plan with the ZMP shifted by δ = e τ*/(τ* − 1), for a DCM error e, keeps the equation. If the stance foot
        can take this shift, its cost bounds the least cost from above, and with it every change:

            w_u |u − u*|² ≤ w_δ |δ|²,   w_τ (τ/τ* − 1)² ≤ w_δ |δ|².
        """
        s, (c, sn) = self.settings, heading
        ratio = grow / (grow - 1.0)
        x, y = ratio * float(dcm[0] - planned[0]), ratio * float(dcm[1] - planned[1])
        x, y = c * x + sn * y, c * y - sn * x
        if not (low[0] <= x <= high[0] and low[1] <= y <= high[1]):
            return False
        # A hundredth more, for the solver's tolerance.
        cost = 1.01 * SHIFT_COST * (x * x + y * y)
        return cost <= LANDING_COST * s.threshold**2 and cost <= TIME_COST * SAME_TIME**2

    def _bounds(self, landing: Array, side: str, shift: tuple[float, float]) -> tuple[Array, Array]:
        """Box of landings in the stance foot's axes: within reach and within `shift` of the plan."""
        r = self._reach
        sides = (r.min_spacing, r.max_spacing) if side == "left" else (-r.max_spacing, -r.min_spacing)
        low = np.maximum([-r.max_length, sides[0]], landing - shift)
        high = np.minimum([r.max_length, sides[1]], landing + shift)
        # A plan at the edge of the reach, or beyond it, stays possible.
        return np.minimum(low, landing), np.maximum(high, landing)
