"""Law of the stepping walk: when and where to put the next foot, in closed form.

The robot is a pendulum that turns about its contact p. The angular momentum L about the contact gives the velocity that
falls; with the mass m, the height h of the CoM over the contact and ω² = g/h, the divergent component of motion is

    ξ = c + (L_y, −L_x) / (m h ω),        ξ(t) = p + (ξ − p) e^{ωt}   while the contact stays.

L about the contact hardly feels the joints, and an impact at the new contact leaves it as it is: ξ needs no filter.

A walk with the velocity v, the step time T and the distance w between the feet is a periodic orbit of ξ. With
E = e^{ωT} the offset of ξ from the foot that lands is, at every landing,

    b_x = v_x T / (E − 1)  ahead,        b_y = w / (1 + E) − δ  inwards,  δ = ± v_y T / (E − 1),

and each step ends at E times these offsets from the stance foot. Time and place follow from ξ at every tick: the step
lasts until the lateral offset has grown to that of the orbit, or the one ahead has outgrown its own by a stretch, and
the foot lands so that b is left.

Sources: time and place of steps as feedback: M. Khadiv et al., IEEE T-RO 36(3), 2020; angular momentum about the
contact: Y. Gong, J. Grizzle, J. Dyn. Sys. Meas. Control 144(12), 2022; the lateral orbit: X. Xiong, A. Ames,
IEEE T-RO 38(6), 2022.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from wbc.core.robot import GRAVITY
from wbc.core.vectors import Vector, add_cross

Point = tuple[float, float]
"""x, y, m."""

SIDEWAYS = 0.8
"""Greatest ratio of the distance between the feet by which they come together in a walk to the side."""

NEAR = 1e-3
"""Least offset that is divided by, m: it takes longer than any step to grow."""


class Divergent(NamedTuple):
    """Divergent component of motion, by the angular momentum about the contact.

    Attributes:
        x: In the world, m.
        y: In the world, m.
        omega: Natural frequency of the pendulum, 1/s.
    """

    x: float
    y: float
    omega: float


def divergent_component(
    com: Vector, velocity: Vector, spin: Vector, contact: Vector, mass: float, least_height: float
) -> Divergent:
    """Return ξ = c + (L_y, −L_x) / (m h ω) with L = k + m (c − p) × ċ.

    Centre of mass c, its velocity ċ and the angular momentum k about it (kg m²/s), contact point p, mass m; the height
    of the CoM over the contact is counted as `least_height` at least, m.
    """
    arm = (com[0] - contact[0], com[1] - contact[1], com[2] - contact[2])
    momentum = add_cross(spin, arm, (mass * velocity[0], mass * velocity[1], mass * velocity[2]))
    height = max(arm[2], least_height)
    omega = math.sqrt(GRAVITY / height)
    scale = 1.0 / (mass * height * omega)
    return Divergent(com[0] + momentum[1] * scale, com[1] - momentum[0] * scale, omega)


class Orbit(NamedTuple):
    """Periodic orbit of ξ over steps of the nominal time.

    Attributes:
        ahead: Offset b_x of ξ ahead of the foot that lands, m.
        inwards: Offset b_y of ξ from the foot that lands towards the other one, m.
        outwards: Offset of ξ from the stance foot towards the swing foot at the end of a step, E (w/(1+E) + δ), m.
        forward: Offset of ξ ahead of the stance foot at the end of a step, E b_x, m.
    """

    ahead: float
    inwards: float
    outwards: float
    forward: float

    @staticmethod
    def of(velocity: Point, side: float, width: float, time: float, pace: float, omega: float) -> Orbit:
        """Return the orbit of a velocity, forward and left, m/s.

        The side is 1 if the left foot swings, −1 if the right one does; w is the distance between the feet, m, T the
        step time, s, for the orbit ahead the time that steps take, the pace, s. Walking sideways shifts the offsets by
        at most `SIDEWAYS` w/(1 + E).
        """
        growth = math.exp(omega * time)
        still = width / (1.0 + growth)
        drift = time / (growth - 1.0)
        shift = min(max(side * velocity[1] * drift, -SIDEWAYS * still), SIDEWAYS * still)
        paced = math.exp(omega * pace)
        ahead = velocity[0] * pace / (paced - 1.0)
        return Orbit(ahead, still - shift, growth * (still + shift), paced * ahead)


def remaining_time(
    ahead: float, aside: float, orbit: Orbit, omega: float, over: float, stretch: float
) -> float:
    """Return the time until ξ has grown to the end of a step, ln(min(outwards / aside, most / |ahead|)) / ω, s.

    Offsets of ξ from the stance foot are `ahead` of it and `aside`, towards the swing foot, m; most = E |b_x| +
    `stretch`, m. From `over`, m, beyond the stance foot on, the swing foot must close up at once: 0 is returned.
    """
    if aside < -over:
        return 0.0
    most = abs(orbit.forward) + stretch
    growth = min(orbit.outwards / max(aside, NEAR), most / max(abs(ahead), NEAR))
    return max(math.log(growth), 0.0) / omega


def foothold(contact: Point, dcm: Divergent, remaining: float, offset: Point) -> Point:
    """Return the place where a foot lands so that an offset is left: p + (ξ − p) e^{ω t} − b.

    Contact point p, m, DCM ξ, time t to the landing, s, offset b in the world, m, natural frequency ω, 1/s.
    """
    growth = math.exp(dcm.omega * remaining)
    return (
        contact[0] + (dcm.x - contact[0]) * growth - offset[0],
        contact[1] + (dcm.y - contact[1]) * growth - offset[1],
    )
