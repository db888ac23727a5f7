"""Fall detector: the first reason of a fall is kept."""

from __future__ import annotations

import enum
import math
from dataclasses import replace
from typing import Annotated

import numpy as np

from wbc.core.errors import ROUNDING, Array
from wbc.core.settings import Count, Positive, settings


class FallReason(enum.Enum):
    """Reason of a fall."""

    DIVERGED = "the simulation diverged"
    SOLVER = "the QP failed"
    HEIGHT = "the robot dropped"
    TILT = "the torso tilted"
    DCM = "the DCM is out of reach"


@settings
class FallSettings:
    """Limits beyond which a walk counts as a fall; the defaults of drop and tilt are those of the first study of walks.

    Attributes:
        drop: Greatest distance of the CoM, or in the true state of the pelvis, below its target, m; this and `dcm` are
            in proportion for a small robot (`Robot.length_scale`).
        tilt: Greatest angle of the torso to the vertical, rad; acos(0.8).
        dcm: Greatest distance of the DCM beyond an edge of the hull of both soles, as they stood when a foot was last
            lifted or put down, m.
        dcm_time: Longest time of the DCM beyond that distance, s.
        failures: Number of failed QPs in a row.
        speed: Greatest speed of joints and base, m/s and rad/s; a faster simulation has diverged.
    """

    drop: Annotated[Positive, "m"] = 0.18
    tilt: Annotated[Positive, "rad"] = 0.6435
    dcm: Annotated[Positive, "m"] = 0.3
    dcm_time: Annotated[Positive, "s"] = 0.1
    failures: Count = 20
    speed: Annotated[Positive, "m/s, rad/s"] = 100.0

    def sized(self, scale: float) -> FallSettings:
        """Return the settings with their lengths times a factor, for a small robot (`Robot.length_scale`)."""
        return replace(self, drop=scale * self.drop, dcm=scale * self.dcm)


TOPPLING = 0.7
"""Ratio of the tilt to that of a fall above which a walk counts as lost: healthy walks reach 0.45."""


class FallDetector:
    """Fall detector of one walk.

    Attributes:
        topples: True while the torso tilts so far that the walk cannot be saved.
        reason: Reason of the fall; None before a fall.
    """

    def __init__(self, settings: FallSettings | None = None) -> None:
        self.settings = settings or FallSettings()
        self.reason: FallReason | None = None
        self.topples = False
        self._toppling = math.cos(TOPPLING * self.settings.tilt)
        self._away = 0.0
        self._failures = 0

    def update(
        self,
        dt: float,
        *,
        q: Array,
        v: Array,
        drop: float,
        torso_up: Array,
        dcm_distance: float = 0.0,
        solved: bool = True,
    ) -> FallReason | None:
        """Check one tick after `dt` seconds; return the reason of a fall, or None.

        `drop` is that of the CoM, or of the pelvis, below its target, m, `torso_up` the torso's vertical axis in the
        world, `dcm_distance` that of the DCM beyond an edge of the soles, m, negative inside.
        """
        self.topples = bool(torso_up[2] < self._toppling)
        if self.reason is not None:
            return self.reason
        s = self.settings
        self._away = self._away + dt if dcm_distance > s.dcm else 0.0
        self._failures = 0 if solved else self._failures + 1
        # NaN fails every comparison. No speed exceeds the norm of all, which is quicker to compute.
        slow = v.dot(v) < s.speed**2 or np.abs(v).max(initial=0.0) < s.speed
        if not (math.isfinite(q.dot(q)) and slow):
            self.reason = FallReason.DIVERGED
        elif self._failures >= s.failures:
            self.reason = FallReason.SOLVER
        elif drop > s.drop:
            self.reason = FallReason.HEIGHT
        elif float(torso_up[2]) < math.cos(s.tilt):
            self.reason = FallReason.TILT
        elif self._away > s.dcm_time + ROUNDING:
            self.reason = FallReason.DCM
        return self.reason
