"""Points of contact wrenches: the centre of pressure under a sole, the ZMP of all soles together."""

from __future__ import annotations

import numpy as np

from wbc.base.errors import WbcError
from wbc.base.numbers import Array

MIN_FORCE = 1.0
"""Normal force below which a wrench has no meaningful point, N (mc_rtc's `MIN_NET_TOTAL_FORCE_ZMP`).

No share of the weight: sensors, whose noise is in newtons, make the point meaningless."""


class NoContactForceError(WbcError):
    """A normal force too small to have a centre of pressure."""


def cop(wrench: Array) -> Array:
    """Return the centre of pressure of a contact in its sole plane, as a point in the sole frame, shape (2,), m.

    The wrench is [force; moment] in the sole frame at the sole centre, shape (6,), N and Nm. Raises
    `NoContactForceError` when the normal force is below `MIN_FORCE`.
    """
    force = wrench[2]
    if not force >= MIN_FORCE:
        raise NoContactForceError(
            f"no centre of pressure: normal force {force:.3g} N is below {MIN_FORCE:g} N"
        )
    return np.array([-wrench[4] / force, wrench[3] / force])


def level_zmp(wrench: Array, point: Array) -> Array:
    """Return the zero-tilting moment point of a wrench on the level of a point, in the world, shape (3,), m.

    The wrench is [force; moment] at the world origin in world axes, shape (6,), N and Nm. Raises `NoContactForceError`
    when the vertical force is below `MIN_FORCE`.

    Source: Sardain & Bessonnet, IEEE T-SMC-A 34(5), 2004.
    """
    fx, fy, fz, mx, my, _ = wrench.tolist()
    if not fz >= MIN_FORCE:
        raise NoContactForceError(f"no ZMP: vertical force {fz:.3g} N is below {MIN_FORCE:g} N")
    x, y, z = point.tolist()
    # Moment about the point; it vanishes at the ZMP.
    mx -= y * fz - z * fy
    my -= z * fx - x * fz
    return np.array((x - my / fz, y + mx / fz, z))


def zmp_offset(outside: Array, point: Array, weight: float) -> Array:
    """Return the offset δ by which a wrench moves the ZMP z of the feet, m: the pendulum turns about z − δ.

    `outside` is the wrench of the surroundings on all but the feet, [force; moment] at the world origin, shape (6,), N
    and Nm; `point` the ZMP of the feet, shape (3,), m; `weight` the vertical force of the pendulum, N.
    """
    fx, fy, fz, mx, my, _ = outside.tolist()
    x, y, z = point.tolist()
    mx -= y * fz - z * fy
    my -= z * fx - x * fz
    return np.array((my / weight, -mx / weight))
