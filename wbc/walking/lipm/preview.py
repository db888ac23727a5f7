"""Preview control: a motion of the ZMP inside the supports that takes the DCM to the plan.

The ZMP is a broken line with knots z_0 … z_N at fixed times, the first and the last one on the reference; the
pendulum over it is known in closed form, so that the DCM now is linear in the knots,

    ξ_0 = Σ_k B_k z_k + e^{−ω T} ξ_N,

and a small QP of fixed size finds their distances δ_k from the reference:

    minimise  Σ_k Δ_k |δ_k|² + r Σ_k |δ_k − δ_{k−1}|²/Δ_k + s |slack|²
    subject to  ξ_0 + slack = the DCM as planned or as measured,   z_k inside the support.

From the horizon on the plan is the analytic one, which comes to rest: there is no horizon effect, and a start on
the analytic plan gives that plan back.

Source: the boundedness constraint of N. Scianca et al., IEEE T-RO 36(4), 2020 (intrinsically stable MPC), with
the tail of the analytic plan; support rows as in S. Caron et al., ICRA 2019.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field
from typing import Annotated

import numpy as np

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import NonNegative, settings
from wbc.core.qp.problem import Problem
from wbc.core.qp.solver import QpSolver, Status
from wbc.tasks.stabilizer.pendulum import Pendulum, natural_frequency
from wbc.walking.lipm.height import HeightProfile
from wbc.walking.lipm.pattern import Pattern, dcm_backwards
from wbc.walking.lipm.schedule import (
    EDGES,
    SupportPhase,
    ZmpTarget,
    support_area,
    zmp_reference,
)
from wbc.walking.plans.footsteps import SoleSizes

KNOTS, INTERVAL = 16, 0.1
"""Number of knots N; greatest time between them, s: each support is cut into equal parts."""

RATE_WEIGHT, SLACK_WEIGHT = 1e-3, 1e4
"""Cost r of the velocity of the ZMP against the reference's, s²; cost s of a DCM that no ZMP inside the supports takes
to the plan, 1/s²: the slack is zero unless the constraints cannot be met without it."""


@settings
class PreviewSettings:
    """Settings of the preview controller.

    Attributes:
        margin: Distance of the ZMP from the edge of the support, m; `Walk` gives a small robot its share.
        target: Reference of the ZMP under a stance foot.
    """

    margin: Annotated[NonNegative, "m"] = 0.008
    target: ZmpTarget = field(default_factory=ZmpTarget)


class PreviewController:
    """Planner of the pendulum over a horizon.

    Attributes:
        status: Status of the last QP.
    """

    def __init__(self, sizes: SoleSizes, height: float, settings: PreviewSettings | None = None) -> None:
        """Set up the QP; an `InputError` for a margin or a target that does not fit into a sole."""
        self.settings = s = settings or PreviewSettings()
        self.height = height
        self.omega = natural_frequency(height)
        self._sizes = sizes
        for length, width in sizes:
            if 2.0 * s.margin >= min(length, width):
                raise InputError(
                    f"preview margin of {s.margin:g} m leaves nothing of a sole of {length:g} × {width:g} m"
                )
            room = 0.5 * length - s.margin, 0.5 * width - s.margin
            if abs(s.target.forward) > room[0] or abs(s.target.inward) > room[1]:
                raise InputError(
                    f"target of the ZMP, {s.target.forward:g} m forward and {s.target.inward:g} m inward, must be at "
                    f"most {room[0]:g} and {room[1]:g} m from the centre of a sole of {length:g} × {width:g} m"
                )
        free = KNOTS - 1
        self._problem = p = Problem(0, 0, 2 * free + 2, 2, 2 * KNOTS, EDGES * free)
        p.equality[0, -2] = p.equality[1, -1] = 1.0
        p.soft[: 2 * free, : 2 * free] += np.eye(2 * free)
        p.soft[2:, : 2 * free] -= np.eye(2 * free)
        p.diagonal[-2:] = SLACK_WEIGHT
        self._areas: list[Array | None] = [
            None
        ] * free  # normals of the support area of each knot, as written
        self._solver = QpSolver(p)
        self.status = Status.SOLVED

    def plan(self, supports: Sequence[SupportPhase], start: Pendulum) -> Pattern:
        """Plan from the pendulum through a schedule to rest; if the QP fails, along the reference of the ZMP."""
        if not supports:
            raise InputError("a schedule must have at least one support")
        s = self.settings
        ref_times, ref_points = zmp_reference(supports, s.target, start.zmp[:2])
        times, areas = self._grid(supports)
        reference = np.zeros((times.size, 2))
        for axis in (0, 1):
            reference[:, axis] = np.interp(times, ref_times, ref_points[:, axis])
        tail = ref_times > times[-1] + ROUNDING
        tail_times, tail_points = ref_times[tail], ref_points[tail]
        after = np.concatenate((times[-1:], tail_times)), np.concatenate((reference[-1:], tail_points))
        end_dcm = dcm_backwards(*after, self.omega)[0]
        dcm = start.com[:2] + start.com_velocity[:2] / self.omega

        self._fill(times, reference, areas, end_dcm, dcm)
        self.status = self._solver.solve()
        knots = reference.copy()
        if self.status.ok:
            knots[1:-1] += self._solver.x[:-2].reshape(-1, 2)
        return Pattern(
            np.concatenate([times, tail_times]),
            np.concatenate([knots, tail_points]),
            start.com[:2],
            start.com_velocity[:2],
            self.height,
            HeightProfile(supports, self.height, start),
        )

    def _grid(self, supports: Sequence[SupportPhase]) -> tuple[Array, list[tuple[Array, Array]]]:
        """Times of knots 0 … N and the support area of the free knots 1 … N−1."""
        s = self.settings
        times: list[float] = [0.0]
        areas: list[tuple[Array, Array]] = []
        last = supports[-1]
        for support in supports:
            if len(times) > KNOTS + 1:
                break  # beyond the horizon the plan is the analytic one
            if support.duration <= ROUNDING:
                continue
            parts = max(1, math.ceil(support.duration / INTERVAL - 1e-6))
            area = support_area(support.feet, self._sizes, s.margin)
            if support.single and areas:
                areas[-1] = area  # the knot between both supports belongs to the smaller one
            for _ in range(parts):
                times.append(times[-1] + support.duration / parts)
                areas.append(area)
        while len(times) <= KNOTS:  # at the end of the walk: stand on
            times.append(times[-1] + INTERVAL)
            areas.append(support_area(last.feet, self._sizes, s.margin))
        return np.array(times[: KNOTS + 1]), areas[: KNOTS - 1]

    def _fill(
        self, times: Array, reference: Array, areas: list[tuple[Array, Array]], end_dcm: Array, dcm: Array
    ) -> None:
        """Write the QP."""
        p, omega = self._problem, self.omega
        span = times[1:] - times[:-1]
        # ξ_0 = Σ_k weights_k z_k + decay ξ_N: each piece gives to its two ends (linear shape functions).
        x = omega * span
        fall = np.exp(-x)
        before = np.concatenate([[1.0], np.cumprod(fall)])
        weights = np.zeros(span.size + 1)
        weights[:-1] = before[:-1] * (1.0 - (1.0 - fall) / x)
        weights[1:] += before[:-1] * ((1.0 - fall) / x - fall)
        p.equality[0, 0:-2:2] = p.equality[1, 1:-2:2] = weights[1:-1]
        p.target[:2] = dcm - (weights @ reference + before[-1] * end_dcm)
        p.diagonal[:-2] = np.repeat(0.5 * (span[:-1] + span[1:]), 2)
        p.soft_weight[:] = np.repeat(RATE_WEIGHT / span, 2)
        for k, (area, (normals, offsets)) in enumerate(zip(self._areas, areas, strict=True)):
            rows = slice(EDGES * k, EDGES * (k + 1))
            if normals is not area:
                p.inequality[rows, 2 * k : 2 * k + 2] = self._areas[k] = normals
            np.subtract(offsets, normals.dot(reference[k + 1]), out=p.upper[rows])
