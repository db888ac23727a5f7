"""Linear inverted pendulum: the centre of mass over a zero-tilting moment point; points of contact wrenches.

    c̈ = ω² (c − z),   ω² = g / h

with the CoM c, the ZMP z, both horizontal, and the height h of the CoM over the ZMP. The divergent component
of motion ξ = c + ċ/ω runs away from the ZMP, the convergent one ζ = c − ċ/ω towards it:

    ξ̇ = ω (ξ − z),   ζ̇ = −ω (ζ − z),   c = (ξ + ζ) / 2.

Over a ZMP that moves with constant velocity both have closed forms (`wbc.walking.lipm.pattern`).

Source: Kajita et al., IROS 2001; Takenaka et al., IROS 2009; Englsberger et al., IEEE T-RO 31(2), 2015.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wbc.base.errors import WbcError
from wbc.base.numbers import Array, finite_array, finite_scalar
from wbc.base.vectors import add_cross
from wbc.core.robot import GRAVITY


def natural_frequency(height: float) -> float:
    """Return ω = √(g / h), 1/s, at a height of the CoM over the ZMP, m; `InputError` if it is not above zero."""
    return math.sqrt(GRAVITY / finite_scalar("height of the CoM over the ZMP (m)", height, above=0.0))


def dcm(com: Array, com_velocity: Array, omega: float) -> Array:
    """Return the divergent component of motion ξ = c + ċ/ω, m; any shape."""
    return com + com_velocity / omega


class Pendulum(NamedTuple):
    """Reference of the pendulum at one instant, in the world.

    Attributes:
        com: Centre of mass, shape (3,), m.
        com_velocity: Velocity of the CoM, shape (3,), m/s.
        com_acceleration: Acceleration of the CoM, shape (3,), m/s².
        zmp: Zero-tilting moment point on the support surface, shape (3,), m.
        zmp_velocity: Velocity of the ZMP, shape (3,), m/s.
        omega: Natural frequency of the pendulum, 1/s.
    """

    com: Array
    com_velocity: Array
    com_acceleration: Array
    zmp: Array
    zmp_velocity: Array
    omega: float

    @property
    def dcm(self) -> Array:
        """Divergent component of motion, at the height of the CoM, shape (3,), m."""
        return self.com + self.com_velocity / self.omega

    def moved(self, shift: Array, velocity: Array, acceleration: Array) -> Pendulum:
        """Return the pendulum with a motion that is added to that of its CoM, and with the ZMP of this motion.

        Args:
            shift: Displacement of the CoM, shape (3,), m.
            velocity: Its velocity, shape (3,), m/s.
            acceleration: Its acceleration, shape (3,), m/s².
        """
        zmp = self.zmp.copy()
        zmp[:2] += shift[:2] - acceleration[:2] / self.omega**2
        return self._replace(
            com=self.com + shift,
            com_velocity=self.com_velocity + velocity,
            com_acceleration=self.com_acceleration + acceleration,
            zmp=zmp,
        )

    @staticmethod
    def at_rest(com: Array, ground: float = 0.0) -> Pendulum:
        """Return the pendulum of a CoM that rests over its ZMP.

        Args:
            com: Centre of mass in the world, shape (3,), m.
            ground: Height of the ground, m.
        """
        com = finite_array("com (m)", com, (3,))
        omega = natural_frequency(com[2] - ground)
        zero = np.zeros(3)
        return Pendulum(np.array(com), zero, zero, np.array([com[0], com[1], ground]), zero, omega)


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
    fx, fy, fz, *moment = wrench.tolist()
    if not fz >= MIN_FORCE:
        raise NoContactForceError(f"no ZMP: vertical force {fz:.3g} N is below {MIN_FORCE:g} N")
    x, y, z = point.tolist()
    mx, my, _ = add_cross(moment, (fx, fy, fz), (x, y, z))  # about the point; it vanishes at the ZMP
    return np.array((x - my / fz, y + mx / fz, z))


def zmp_offset(outside: Array, point: Array, weight: float) -> Array:
    """Return the offset δ by which a wrench moves the ZMP z of the feet, m: the pendulum turns about z − δ.

    `outside` is the wrench of the surroundings on all but the feet, [force; moment] at the world origin, shape (6,), N
    and Nm; `point` the ZMP of the feet, shape (3,), m; `weight` the vertical force of the pendulum, N.
    """
    fx, fy, fz, *moment = outside.tolist()
    mx, my, _ = add_cross(moment, (fx, fy, fz), point.tolist())
    return np.array((my / weight, -mx / weight))
