"""Closed form of the pendulum, in other words than the library's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from wbc.base.numbers import Array
from wbc.tasks.stabilizer.pendulum import Pendulum, natural_frequency
from wbc.walking.lipm.pattern import Pattern
from wbc.walking.lipm.schedule import HeightProfile, SupportPhase, ZmpTarget, zmp_reference
from wbc.walking.lipm.settings import PhaseSettings
from wbc.walking.plans.footsteps import Footstep, SoleSizes

BY_TIME = PhaseSettings(touch_down=1.0, early=1.0, lift_off=1.0, stance=0.0, max_wait=0.0, max_late=0.0)
"""Feet lift and land as planned, whatever they carry."""


def com_after(com: Array, velocity: Array, zmp: Array, omega: float, time: float) -> tuple[Array, Array]:
    """Return CoM (m) and its velocity (m/s) after a time (s) over a ZMP at rest (m)."""
    c, s = np.cosh(omega * time), np.sinh(omega * time)
    return zmp + c * (com - zmp) + s / omega * velocity, omega * s * (com - zmp) + c * velocity


def analytic_pattern(supports: Sequence[SupportPhase], height: float, start: Pendulum) -> Pattern:
    """Return the plan whose ZMP rests under the stance feet, from any state of the pendulum.

    One more knot in the middle of the first support gives the DCM its present value; unlike in the preview controller
    it may lie outside the support.
    """
    times, points = [0.0], [complex(*start.zmp[:2])]
    for support, end in zip(supports, zmp_reference(supports, ZmpTarget()), strict=True):
        if support.duration > 1e-9:
            times.append(times[-1] + support.duration)
            points.append(end)
    times.insert(1, 0.5 * times[1])
    points.insert(1, 0.5 * (points[0] + points[1]))
    profile = HeightProfile(supports, height, start)
    free = Pattern(times, points, start, profile)
    nudged = [*points[:1], points[1] + 1.0, *points[2:]]
    gain = Pattern(times, nudged, start, profile).dcm[0] - free.dcm[0]
    dcm = complex(*(start.com + start.com_velocity / natural_frequency(height))[:2])
    points[1] += (dcm - free.dcm[0]) / gain
    return Pattern(times, points, start, profile)


def support_area(feet: Sequence[Footstep], sizes: SoleSizes, margin: float = 0.0) -> tuple[Array, Array]:
    """Return half-planes N z ≤ d of the convex hull of feet less a margin (m): shapes (n, 2), (n,)."""
    corners = []
    for foot in feet:
        half = 0.5 * np.array(sizes[0 if foot.side == "left" else 1]) - margin
        turn = pin.rpy.rpyToMatrix(0.0, 0.0, foot.yaw)[:2, :2]
        corners += [foot.position[:2] + turn @ (half * sign) for sign in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    equations = ConvexHull(np.array(corners)).equations
    return equations[:, :2], -equations[:, 2]
