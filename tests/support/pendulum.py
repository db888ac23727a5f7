"""Closed form of the pendulum, in other words than the library's."""

from __future__ import annotations

import numpy as np

from wbc.core.errors import Array


def com_after(com: Array, velocity: Array, zmp: Array, omega: float, time: float) -> tuple[Array, Array]:
    """Return CoM (m) and its velocity (m/s) after a time (s) over a ZMP at rest (m)."""
    c, s = np.cosh(omega * time), np.sinh(omega * time)
    return zmp + c * (com - zmp) + s / omega * velocity, omega * s * (com - zmp) + c * velocity
