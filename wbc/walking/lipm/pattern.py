"""Motion of the pendulum over a broken line of ZMPs, in closed form.

The DCM is known backwards from the point of rest at the end of the walk, the CoM follows it forwards:

    ξ(t) = z + ż/ω + e^{ω(t − T)} (ξ_T − z_T − ż/ω)      on each piece, ending at T.

Points on the ground are complex numbers x + iy, m. Source: Englsberger et al., IEEE T-RO 31(2), 2015 (backward
recursion of the DCM).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from wbc.tasks.stabilizer.pendulum import Pendulum, natural_frequency
from wbc.walking.lipm.schedule import HeightProfile


def dcm_backwards(times: Sequence[float], zmp: Sequence[complex], omega: float) -> list[complex]:
    """Return the DCM at knots (s) of a line of ZMPs that leads to its end, where it rests."""
    dcm = [zmp[-1]]
    for i in range(len(times) - 2, -1, -1):
        span = times[i + 1] - times[i]
        lead = (zmp[i + 1] - zmp[i]) / (span * omega)
        dcm.append(zmp[i] + lead + math.exp(-omega * span) * (dcm[-1] - zmp[i + 1] - lead))
    return dcm[::-1]


class Pattern:
    """Motion of the pendulum from a start on, without end.

    Attributes:
        times: Knots, from the start of the pattern, s.
        zmp: ZMP at the knots; at rest after the last one.
        dcm: DCM at the knots.
        omega: Natural frequency, 1/s.
    """

    def __init__(
        self, times: Sequence[float], zmp: Sequence[complex], start: Pendulum, profile: HeightProfile
    ) -> None:
        """Follow a line of ZMPs at times from 0; of the start only the convergent part of the CoM is used."""
        self.times, self.zmp, self._profile = times, zmp, profile
        self.omega = omega = natural_frequency(profile.height)
        self.dcm = dcm_backwards(times, zmp, omega)
        (x, y), (u, v) = start.com[:2].tolist(), start.com_velocity[:2].tolist()
        convergent = complex(x - u / omega, y - v / omega)
        self._pieces: list[tuple[complex, ...]] = []  # ZMP, its rate, DCM and convergent part at each knot
        for i, point in enumerate(zmp):
            span = 0.0 if i + 1 == len(zmp) else times[i + 1] - times[i]
            rate = (zmp[i + 1] - point) / span if span else 0j
            self._pieces.append((point, rate, self.dcm[i], convergent))
            lag = point - rate / omega
            convergent = lag + span * rate + math.exp(-omega * span) * (convergent - lag)

    def at(self, time: float) -> Pendulum:
        """Return the pendulum at a time from the start of the pattern (s, not negative)."""
        dcm, convergent, zmp, rate = self._horizontal(time)
        level, climb, push = self._profile.at(time)
        omega = self.omega
        com, speed = 0.5 * (dcm + convergent), 0.5 * omega * (dcm - convergent)
        pushed = omega * omega * (com - zmp)
        # One array and its parts: making an array costs more than a slice.
        parts = np.array(
            (
                *(com.real, com.imag, level + self._profile.height, speed.real, speed.imag, climb),
                *(pushed.real, pushed.imag, push, zmp.real, zmp.imag, level, rate.real, rate.imag, climb),
            )
        )
        return Pendulum(parts[:3], parts[3:6], parts[6:9], parts[9:12], parts[12:], omega)

    def dcm_at(self, time: float) -> complex:
        """Return the DCM at a time from the start of the pattern (s, not negative)."""
        return self._horizontal(time)[0]

    def _horizontal(self, time: float) -> tuple[complex, complex, complex, complex]:
        """Return DCM, convergent part c − ċ/ω, ZMP and its rate."""
        i = max(0, bisect_right(self.times, time) - 1)
        dt, (zmp, rate, dcm, convergent) = max(0.0, time - self.times[i]), self._pieces[i]
        grow, lead = math.exp(self.omega * dt), rate / self.omega
        now = zmp + dt * rate
        if i < len(self.times) - 1:  # at rest nothing may grow out of rounding
            dcm = now + lead + grow * (dcm - zmp - lead)
        return dcm, now - lead + (convergent - zmp + lead) / grow, now, rate
