"""Forces that a contact can transmit with Coulomb friction: cones as matrices F with F f ≤ 0."""

from __future__ import annotations

import math

import numpy as np

from wbc.base.numbers import Array, finite_scalar


def mean_distance(half_length: float, half_width: float) -> float:
    """Return the mean distance d of the points of a rectangle from its centre, m; even pressure holds μ f_z d."""
    x, y = half_length, half_width
    return float(np.hypot(x, y) / 3 + x**2 / (6 * y) * np.arcsinh(y / x) + y**2 / (6 * x) * np.arcsinh(x / y))


def rectangle_wrench_cone(
    half_length: float, half_width: float, friction: float, *, even: bool = False
) -> Array:
    """Return the cone of wrenches that a rectangular sole can transmit with Coulomb friction at its corners.

    Args:
        half_length: Half extent along x, m.
        half_width: Half extent along y, m.
        friction: Coulomb coefficient μ of the ground; forces are those of the pyramid inside its friction cone (see
            `inner_friction`).
        even: Scale the bounds of the yaw moment so that the greatest one is that of even pressure, ν f_z d with d the
            mean distance of the points from the centre and ν the friction of the pyramid, instead of ν (X + Y) f_z:
            with friction at its corners alone a sole holds about twice as much.

    Returns:
        Matrix F with F w ≤ 0 for a wrench w = [force; moment] in the sole frame at its centre, shape (16, 6).

    Source: Caron, Pham, Nakamura, "Stability of surface contacts for humanoid robots: closed-form formulae of the
    contact wrench cone for rectangular support areas", ICRA 2015, eq. (9)–(14).
    """
    x = finite_scalar("half length (m)", half_length, above=0.0)
    y = finite_scalar("half width (m)", half_width, above=0.0)
    mu = inner_friction(friction)
    cone = np.zeros((16, 6))
    cone[0:4, 0:3] = friction_pyramid(friction)
    cone[4:6, 2], cone[4:6, 3] = -y, [1, -1]  # CoP inside the rectangle: |m_x| ≤ Y f_z
    cone[6:8, 2], cone[6:8, 4] = -x, [1, -1]  # and |m_y| ≤ X f_z
    row = 8
    # Yaw moment within its bounds: ± m_z ≤ μ (X + Y) f_z − |Y f_x ± μ m_x| − |X f_y ± μ m_y|.
    for yaw in (1.0, -1.0):
        for s in (1.0, -1.0):
            for t in (1.0, -1.0):
                cone[row] = [s * y, t * x, -mu * (x + y), yaw * s * mu, yaw * t * mu, yaw]
                row += 1
    if even:
        cone[8:, 5] *= (x + y) / mean_distance(x, y)
    return cone


def inner_friction(friction: float) -> float:
    """Return ν = μ / √2, with which the pyramid |f_x|, |f_y| ≤ ν f_z is inside the cone √(f_x² + f_y²) ≤ μ f_z."""
    return finite_scalar("friction", friction, above=0.0) / math.sqrt(2.0)


def friction_pyramid(friction: float) -> Array:
    """Return the pyramid of forces of a point inside its friction cone: a matrix F with F f ≤ 0, shape (4, 3).

    They are |f_x|, |f_y| ≤ μ / √2 f_z with the Coulomb coefficient μ, so that √(f_x² + f_y²) ≤ μ f_z.
    """
    mu = inner_friction(friction)
    return np.array([[1, 0, -mu], [-1, 0, -mu], [0, 1, -mu], [0, -1, -mu]], dtype=float)


def box_wrench_cone(half_length: float, half_width: float, friction: float, torsion: float) -> Array:
    """Return the cone of wrenches of a box whose load may be anywhere in it: a matrix F with F w ≤ 0, shape (10, 6).

    It is the friction pyramid, and |m_x| ≤ half width · f_z, |m_y| ≤ half length · f_z, |m_z| ≤ torsion · f_z.
    """
    cone = np.zeros((10, 6))
    cone[:4, :3] = friction_pyramid(friction)
    cone[4:, 2] = np.repeat([-half_width, -half_length, -torsion], 2)
    for row, axis in ((4, 3), (6, 4), (8, 5)):
        cone[row : row + 2, axis] = [1.0, -1.0]
    return cone
