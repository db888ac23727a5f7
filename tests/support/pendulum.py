"""Closed form of the pendulum, in other words than the library's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.base.numbers import Array
from wbc.tasks.stabilizer.pendulum import Pendulum, natural_frequency
from wbc.walking.lipm.height import HeightProfile
from wbc.walking.lipm.pattern import Pattern
from wbc.walking.lipm.schedule import SupportPhase, ZmpTarget, zmp_reference
from wbc.walking.lipm.walk import PhaseSettings

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
    times, points = zmp_reference(supports, ZmpTarget(), start.zmp[:2])
    keep = np.concatenate([[True], np.diff(times) > 1e-9])
    times, points = times[keep], points[keep]
    times = np.insert(times, 1, 0.5 * times[1])
    points = np.insert(points, 1, 0.5 * (points[0] + points[1]), axis=0)
    profile = HeightProfile(supports, height, start)
    omega = natural_frequency(height)
    com, velocity = start.com[:2], start.com_velocity[:2]
    free = Pattern(times, points, com, velocity, height, profile)
    nudged = points.copy()
    nudged[1] += 1.0
    gain = (Pattern(times, nudged, com, velocity, height, profile).dcm[0] - free.dcm[0])[0]
    points[1] += (com + velocity / omega - free.dcm[0]) / gain
    return Pattern(times, points, com, velocity, height, profile)
