"""Preview control: a motion of the ZMP inside the supports that takes the DCM to the plan, and the course of a walk.

The ZMP is a broken line with knots z_k: the first one is where it is now, the others are the ends of the next supports,
some within the present one, and the middle of the next. The pendulum over it is known in closed form, so that the DCM
now is linear in them,

    ξ_0 = Σ_k w_k z_k + e^{−ω T} ξ_N,

and a small QP finds their distances δ_k from the reference, with Δ_k the time that belongs to a knot:

    minimise  Σ_k Δ_k |δ_k|² + s |ξ_0 − the DCM as planned or as measured|²     subject to  z_k inside the support.

A knot between two supports belongs to the single one, so that its limits are those of one sole: with both ends of a
ramp in a sole each, the ramp is within their hull. A knot within a double support stays on the strip between the soles.
From the horizon on the plan is the analytic one, which comes to rest: there is no horizon effect, and a start on the
analytic plan gives that plan back.

Source: the boundedness constraint of N. Scianca et al., IEEE T-RO 36(4), 2020 (intrinsically stable MPC), with the tail
of the analytic plan.
"""

from __future__ import annotations

import cmath
import logging
import math
from collections.abc import Sequence
from dataclasses import field
from typing import Annotated

import daqp
import numpy as np

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING
from wbc.base.settings import NonNegative, settings
from wbc.core.robot import SIDES
from wbc.core.trajectories import Follower
from wbc.tasks.stabilizer.pendulum import Pendulum, natural_frequency
from wbc.walking.lipm.pattern import Pattern, dcm_backwards
from wbc.walking.lipm.phases import PlanPhases
from wbc.walking.lipm.schedule import HeightProfile, SupportPhase, ZmpTarget, zmp_reference
from wbc.walking.plans.footsteps import Footstep, SoleSizes

logger = logging.getLogger(__name__)

SUPPORTS, PARTS, INTERVAL, REST = 8, (4, 2), 0.1, 0.5
"""Supports after the present one whose ends are knots, of four steps; greatest numbers of parts of the present and of
the next one, and their least time, s; time of the last piece where the walk ends within the horizon, s."""

DCM_WEIGHT = 1e6
"""Cost s of a DCM that no ZMP inside the supports takes to the plan, s: it is met unless it cannot be."""


@settings
class PreviewSettings:
    """Settings of the preview controller.

    Attributes:
        margin: Distance of the ZMP from the edge of the support, m; `LipmWalk` scales it down for a small robot.
        target: Reference of the ZMP under a stance foot.
    """

    margin: Annotated[NonNegative, "m"] = 0.008
    target: ZmpTarget = field(default_factory=ZmpTarget)


Area = tuple[complex, complex, complex]
"""Rectangle: its axis e^{iφ}, its centre, and half of its size along and across that axis as parts of a number, m."""


class PreviewController:
    """Planner of the pendulum over a horizon; a plan whose QP is not solved keeps its reference, and is logged."""

    def __init__(self, sizes: SoleSizes, height: float, settings: PreviewSettings | None = None) -> None:
        """Set up; an `InputError` for a margin or a target that does not fit into a sole."""
        self.settings = s = settings or PreviewSettings()
        self.height, self.omega = height, natural_frequency(height)
        self._room = {}
        for side, (length, width) in zip(SIDES, sizes, strict=True):
            if 2.0 * s.margin >= min(length, width):
                raise InputError(
                    f"preview margin of {s.margin:g} m leaves nothing of a sole of {length:g} × {width:g} m"
                )
            self._room[side] = room = complex(0.5 * length - s.margin, 0.5 * width - s.margin)
            if abs(s.target.forward) > room.real or abs(s.target.inward) > room.imag:
                raise InputError(
                    f"target of the ZMP, {s.target.forward:g} m forward and {s.target.inward:g} m inward, must be at "
                    f"most {room.real:g} and {room.imag:g} m from the centre of a sole of {length:g} × {width:g} m"
                )

    def plan(self, supports: Sequence[SupportPhase], start: Pendulum) -> Pattern:
        """Plan from the pendulum through a schedule to rest."""
        times, points, areas = self._knots(supports, complex(*start.zmp[:2].tolist()))
        dcm = start.com[:2] + start.com_velocity[:2] / self.omega
        error = complex(*dcm.tolist()) - dcm_backwards(times, points, self.omega)[0]
        if abs(error) > ROUNDING:
            self._shift(times, points, areas, error)
        return Pattern(times, points, start, HeightProfile(supports, self.height, start))

    def _knots(
        self, supports: Sequence[SupportPhase], now: complex
    ) -> tuple[list[float], list[complex], list[Area]]:
        """Return times and reference of all knots, and the areas of those that are free, from the second one on."""
        times, points, areas = [0.0], [now], list[Area]()
        supports = [support for support in supports if support.duration > ROUNDING] or supports[-1:]
        for i, (support, end) in enumerate(
            zip(supports, zmp_reference(supports, self.settings.target), strict=True)
        ):
            span = max(support.duration, ROUNDING)
            parts = min(PARTS[i], max(1, math.ceil(span / INTERVAL - 1e-6))) if i < len(PARTS) else 1
            begin, point = times[-1], points[-1]
            times += [begin + span * k / parts for k in range(1, parts + 1)]
            points += [point + (end - point) * k / parts for k in range(1, parts + 1)]
            if i <= SUPPORTS:
                following = supports[min(i + 1, len(supports) - 1)]
                areas += [self._area(support.feet)] * (parts - 1)
                areas.append(self._area(support.feet if support.single else following.feet))
        if len(areas) == len(times) - 1:  # the walk ends within the horizon
            times.append(times[-1] + REST)
            points.append(points[-1])
        return times, points, areas

    def _area(self, feet: Sequence[Footstep]) -> Area:
        """Return the area of the ZMP on one foot, or the strip between two."""
        places = [complex(foot.x, foot.y) for foot in feet]
        if len(feet) == 1:
            return cmath.rect(1.0, feet[0].yaw), places[0], self._room[feet[0].side]
        way = places[1] - places[0]
        axis = way / abs(way)
        across = [1j * axis * cmath.rect(1.0, -foot.yaw) for foot in feet]  # in the axes of each foot
        rooms = [self._room[foot.side] for foot in feet]
        half = min(
            min(room.real / max(abs(n.real), ROUNDING), room.imag / max(abs(n.imag), ROUNDING))
            for n, room in zip(across, rooms, strict=True)
        )
        return axis, 0.5 * sum(places), complex(0.5 * abs(way), half)

    def _shift(self, times: list[float], points: list[complex], areas: list[Area], error: complex) -> None:
        """Move the free knots so that the plan begins with a DCM that is off its reference by an error, m."""
        free, spans = len(areas), np.diff(times[: len(areas) + 2])
        axes, centres, halves = (np.array(part) for part in zip(*areas, strict=True))
        x = self.omega * spans
        fall, before = np.exp(-x), np.exp(-self.omega * np.array(times[: free + 1]))
        mean = (1.0 - fall) / x
        # Each piece gives to its two ends: linear shape functions.
        weights = before[:-1] * (mean - fall)[:-1] + before[1:] * (1.0 - mean)[1:]
        gain = weights * axes
        rows = np.zeros((2, 2 * free))
        rows[0, ::2] = rows[1, 1::2] = gain.real
        rows[0, 1::2], rows[1, ::2] = -gain.imag, gain.imag
        hessian = DCM_WEIGHT * rows.T @ rows
        hessian[np.diag_indices(2 * free)] += np.repeat(0.5 * (spans[:-1] + spans[1:]), 2)
        gradient = -DCM_WEIGHT * (np.array((error.real, error.imag)) @ rows)
        off = (centres - np.array(points[1 : free + 1])) * axes.conj()
        low, high = (off - halves).view(float), (off + halves).view(float)
        solved, _, flag, _ = daqp.solve(
            hessian, gradient, np.zeros((0, 2 * free)), high, low, np.zeros(2 * free, np.int32)
        )
        if flag <= 0:
            logger.warning("a preview was not solved (DAQP: %d): the plan does not begin with the DCM", flag)
            return
        for k, shift in enumerate((solved.view(complex) * axes).tolist(), start=1):
            points[k] += shift


FELT = 30.0
"""Time from which on the steps of a plan change the DCM now by less than rounding, 1/ω."""


class PlannedCourse:
    """Planned motion of the pendulum while steps change: a pattern, and the way over to it from the one before.

    Attributes:
        preview: Preview control, which plans the next pattern; set another one, of the same height, at any time.
        pattern: Pattern of the steps as they are.
        since: Time since it was planned, s.
    """

    def __init__(self, phases: PlanPhases, preview: PreviewController, start: Pendulum) -> None:
        """Stand at rest."""
        self._phases, self.preview = phases, preview
        self._off = Follower(1.0 / preview.omega, 0j)  # of the reference of the CoM from the pattern, m
        self.pattern: Pattern = preview.plan(phases.supports(), start)
        self.since = 0.0

    def advance(self, dt: float) -> None:
        """Go on by a tick, s."""
        self.since += dt
        self._off.follow(-self._off.value, dt)

    def plan(self) -> None:
        """Plan the pattern anew from the pendulum as planned; what is measured is left to the stabilizer."""
        steps = math.ceil(FELT / (self.preview.omega * self._phases.gait.cycle))
        before = self.pattern.at(self.since)
        self.pattern, self.since = self.preview.plan(self._phases.supports(steps), before), 0.0
        now = self.pattern.at(0.0)
        self._off.value += complex(*(before.com - now.com)[:2].tolist())
        self._off.velocity += complex(*(before.com_velocity - now.com_velocity)[:2].tolist())

    def pendulum(self) -> Pendulum:
        """Return the reference of the pendulum: the CoM goes over to a pattern that begins elsewhere.

        A pattern begins elsewhere where no ZMP within the supports takes the DCM to the steps that are new, as after a
        push. The reference of the CoM and its velocity go on, and come to the pattern as quickly as the DCM falls. The
        ZMP is that of the pattern.
        """
        pendulum, off = self.pattern.at(self.since), self._off
        if abs(off.value) + abs(off.velocity) / self.preview.omega < ROUNDING:
            return pendulum
        com, velocity, acceleration, zmp, zmp_velocity, omega = pendulum
        way, speed, push = off.value, off.velocity, off.acceleration
        # One array and its parts: making an array costs more than a slice.
        added = np.array((way.real, way.imag, 0.0, speed.real, speed.imag, 0.0, push.real, push.imag, 0.0))
        moved = com + added[:3], velocity + added[3:6], acceleration + added[6:]
        return Pendulum(*moved, zmp, zmp_velocity, omega)
