"""Motion of the pendulum over a broken line of ZMPs, in closed form.

The DCM is known backwards from the point of rest at the end of the walk, the CoM follows it forwards:

    ξ(t) = z + ż/ω + e^{ω(t − T)} (ξ_T − z_T − ż/ω)      on each piece, ending at T.

Source: Englsberger et al., IEEE T-RO 31(2), 2015 (backward recursion of the DCM).
"""

from __future__ import annotations

import math
from bisect import bisect_right

import numpy as np

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.tasks.stabilizer.pendulum import Pendulum, natural_frequency
from wbc.walking.lipm.height import HeightProfile


def dcm_backwards(times: Array, zmp: Array, omega: float) -> Array:
    """Return the DCM at knots (s) of a line of ZMPs, shape (k, 2), m, that leads to its end, where it rests."""
    knots: list[float] = np.asarray(times, dtype=float).tolist()
    points: list[list[float]] = np.asarray(zmp, dtype=float).tolist()
    x, y = points[-1]
    dcm = [(x, y)]
    for i in range(len(knots) - 2, -1, -1):
        span = knots[i + 1] - knots[i]
        decay = math.exp(-omega * span)
        (x0, y0), (x1, y1) = points[i], points[i + 1]
        lead_x, lead_y = (x1 - x0) / span / omega, (y1 - y0) / span / omega
        x = x0 + lead_x + decay * (x - x1 - lead_x)
        y = y0 + lead_y + decay * (y - y1 - lead_y)
        dcm.append((x, y))
    return np.array(dcm[::-1])


class Pattern:
    """Motion of the pendulum from a start on, without end.

    Attributes:
        times: Knots, from the start of the pattern, shape (k,), s.
        zmp: ZMP at the knots, shape (k, 2), m; at rest after the last one.
        dcm: DCM at the knots, shape (k, 2), m.
        omega: Natural frequency, 1/s.
        height: Height of the CoM over the support, m.
    """

    def __init__(
        self,
        times: Array,
        zmp: Array,
        com: Array,
        com_velocity: Array,
        height: float,
        profile: HeightProfile,
    ) -> None:
        """Follow a line of ZMPs at times from 0; of the CoM and its velocity only the convergent part is used."""
        self.times, self.zmp = np.asarray(times, dtype=float), np.asarray(zmp, dtype=float)
        span = self.times[1:] - self.times[:-1]
        if self.times[0] != 0.0 or not (span > 0.0).all():
            raise InputError(f"times of a pattern must increase from 0, got {self.times}")
        self.height = height
        self.omega = omega = natural_frequency(self.height)
        self._profile = profile
        self._knots: list[float] = self.times.tolist()
        self._rate = np.zeros_like(self.zmp)
        np.divide(self.zmp[1:] - self.zmp[:-1], span[:, None], out=self._rate[:-1])
        self.dcm = dcm_backwards(self.times, self.zmp, omega)
        convergent = [(np.asarray(com) - np.asarray(com_velocity) / omega).tolist()]
        for dt, (x, y), (rate_x, rate_y) in zip(
            span.tolist(), self.zmp.tolist(), self._rate.tolist(), strict=False
        ):
            decay = math.exp(-omega * dt)
            lag_x, lag_y = x - rate_x / omega, y - rate_y / omega
            u, v = convergent[-1]
            convergent.append(
                [lag_x + dt * rate_x + decay * (u - lag_x), lag_y + dt * rate_y + decay * (v - lag_y)]
            )
        # ZMP, its rate, DCM and convergent part at each knot, as plain numbers for `at`.
        pieces = np.concatenate((self.zmp, self._rate, self.dcm, convergent), axis=1)
        if not math.isfinite(pieces.sum()):
            raise InputError("ZMP, CoM and its velocity of a pattern must be finite")
        self._pieces: list[list[float]] = pieces.tolist()

    @property
    def duration(self) -> float:
        """Time of the last knot, s."""
        return float(self.times[-1])

    def at(self, time: float) -> Pendulum:
        """Return the pendulum at a time from the start of the pattern (s, not negative)."""
        com, velocity, zmp, zmp_velocity = self._horizontal(time)
        level, climb, push = self._profile.at(time)
        square = self.omega * self.omega
        acceleration = (square * (com[0] - zmp[0]), square * (com[1] - zmp[1]), push)
        # One array and its parts: making an array costs more than a slice.
        all_ = np.array(
            (*com, level + self.height, *velocity, climb, *acceleration, *zmp, level, *zmp_velocity, climb)
        )
        return Pendulum(all_[:3], all_[3:6], all_[6:9], all_[9:12], all_[12:], self.omega)

    def dcm_at(self, time: float) -> Array:
        """Return the DCM at a time from the start of the pattern (s, not negative), shape (2,), m."""
        (x, y), (speed_x, speed_y), _, _ = self._horizontal(time)
        return np.array((x + speed_x / self.omega, y + speed_y / self.omega))

    def _horizontal(self, time: float) -> tuple[tuple[float, float], ...]:
        """Return CoM (m) and its velocity (m/s), ZMP (m) and its velocity (m/s)."""
        i = max(0, bisect_right(self._knots, time) - 1)
        omega, dt = self.omega, max(0.0, time - self._knots[i])
        x0, y0, rate_x, rate_y, dcm_x, dcm_y, convergent_x, convergent_y = self._pieces[i]
        x, y = x0 + dt * rate_x, y0 + dt * rate_y
        grow = math.exp(omega * dt)
        lead_x, lead_y = rate_x / omega, rate_y / omega
        if i < len(self._knots) - 1:  # at rest nothing may grow out of rounding
            dcm_x = x + lead_x + grow * (dcm_x - x0 - lead_x)
            dcm_y = y + lead_y + grow * (dcm_y - y0 - lead_y)
        convergent_x = x - lead_x + (convergent_x - x0 + lead_x) / grow
        convergent_y = y - lead_y + (convergent_y - y0 + lead_y) / grow
        half = 0.5 * omega
        return (
            (0.5 * (dcm_x + convergent_x), 0.5 * (dcm_y + convergent_y)),
            (half * (dcm_x - convergent_x), half * (dcm_y - convergent_y)),
            (x, y),
            (rate_x, rate_y),
        )
