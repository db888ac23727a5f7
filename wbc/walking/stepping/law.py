"""Law of the stepping walk: the pendulum, the orbit of its steps and which foot carries, in closed form.

The robot is a pendulum that turns about its contact p. The angular momentum L about the contact gives the velocity that
falls; with the mass m, the height h of the CoM over the contact and ω² = g/h, the divergent component of motion is

    ξ = c + (L_y, −L_x) / (m h ω),        ξ(t) = p + (ξ − p) e^{ωt}   while the contact stays.

L about the contact hardly feels the joints, and an impact at the new contact leaves it as it is: ξ needs no filter.

A walk with the velocity v, the step time T and the distance w between the feet is a periodic orbit of ξ. With
E = e^{ωT} the offset of ξ from the foot that lands is, at every landing,

    b_x = v_x T / (E − 1)  ahead,        b_y = w / (1 + E) − δ  inwards,  δ = ± v_y T / (E − 1),

and each step ends at E times these offsets from the stance foot. `wbc.walking.stepping.program` weighs them against the
steps that are asked for.

Sources: time and place of steps as feedback: M. Khadiv et al., IEEE T-RO 36(3), 2020; angular momentum about the
contact: Y. Gong, J. Grizzle, J. Dyn. Sys. Meas. Control 144(12), 2022; the lateral orbit: X. Xiong, A. Ames,
IEEE T-RO 38(6), 2022.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from wbc.base.vectors import Vector, add_cross
from wbc.core.robot import GRAVITY

Point = tuple[float, float]
"""x, y, m."""

SIDEWAYS = 0.8
"""Greatest ratio of the distance between the feet by which they come together in a walk to the side."""

LEAST_OFFSET = 1e-3
"""Regularisation of divisions by a DCM offset, m: an offset this small takes longer than any step to grow."""


@dataclass(frozen=True, slots=True)
class SteppingConstants:
    """Constants of the law, in units of the robot; docs/measured.md has what parts of it are worth."""

    # Time and place.
    brisk: Annotated[float, "hω"] = 0.23  # velocity about which steps begin to take longer: hips lack torque
    time_lag: Annotated[float, "1/ω"] = 0.12  # noise of ξ would move the time by more than 10 ms
    later: float = 1.15  # greatest time of a step at its begin, over the nominal one
    outer_cop: Annotated[float, "h"] = 0.008  # DCM past the outer CoP bound: step at once
    stretch: Annotated[float, "h"] = (
        0.09  # of ξ ahead beyond the orbit: ends a step that would wait for ξ aside
    )
    pace_gain: float = 0.2  # weight of the last step in the mean time of steps
    # The place that carries: between the centre of the sole and the ankle, where either can hold a moment.
    carrying: Annotated[float, "ankle"] = 0.57
    cop_lag: Annotated[float, "1/ω"] = 0.081  # force sensors ring at impacts
    box: Annotated[Point, "sole"] = (0.035, 0.067)  # one stone gives no moment
    standing_box: Annotated[Point, "sole"] = (0.59, 0.67)  # what a sole holds on stones
    # Area that is believed to hold, and the centre of pressure in it.
    margin: Annotated[float, "h"] = 0.026  # between the greatest area and the edges of a sole
    trusted: Annotated[Point, "h"] = (
        0.045,
        0.065,
    )  # half width of a sole whose area counts for nothing; in full
    area_growth: Annotated[float, "hω"] = 0.09  # of each edge: the whole sole within a step
    even: tuple[Annotated[float, "h"], Annotated[float, "h"]] = (
        0.01,
        0.03,
    )  # heights between the feet up to which the ground counts as level, and from which on as rough
    level_growth: float = 4.0  # of the growth of the area on level ground, over that on rough ground
    inside: Annotated[float, "h"] = 0.0064  # between the edge of an area that ends and the measured CoP
    still: Annotated[float, "ω"] = 0.07  # greatest rate of a foot that stands
    turning: Annotated[float, "ω"] = 0.14  # least rate of a foot that turns over an edge
    spin_lag: Annotated[float, "1/ω"] = 0.053  # of these rates: differences of noisy angles
    carries: Annotated[float, "mg"] = 0.3  # from which on the CoP shows where a foot holds
    cop_speed: Annotated[float, "hω"] = 0.36  # of the commanded CoP: no jump of the moments
    cop_error: Annotated[float, "h"] = (
        0.038  # greatest difference of measured and commanded CoP that is believed
    )
    next_area: float = (
        0.3  # ratio of the half sole that the next foot is expected to hold: stones hold less than all
    )
    period: Annotated[float, "1/ω"] = 0.021  # of the program
    slow_width: Annotated[float, "h"] = 0.04  # half of the width that has held, from which on steps are slow
    held_gain: Point = (
        0.8,
        0.3,
    )  # weight of the last step in what feet have held, where it is less and where it is more
    # Taking over.
    patience: float = 1.5  # offset of ξ over the orbit's from which on a next step is long enough
    wait: float = 0.2  # time ahead for which waiting is judged, 1/ω
    share: Annotated[float, "mg"] = 0.3  # of a foot that waits: more would move the contact point
    unload: Annotated[float, "1/ω"] = 0.20
    most_force: Annotated[float, "mg"] = 1.4  # with 2 robots jump to gain yaw moment
    least_force: Annotated[float, "mg"] = 0.061  # of the foot that stands: no flight
    carried: Annotated[float, "mg"] = (
        0.5  # of a foot that carries alone: a trunk that turns costs less than a fall
    )
    # Swing, over the time of the step.
    apex: float = 0.42
    touch: float = 0.88  # a foot that comes late is what fells robots
    level: float = 0.3  # a sole that is still tilted rubs at edges
    swing_push: Annotated[float, "g"] = (
        4.5  # greatest acceleration over the ground: a long step takes its time
    )
    swing_gains: tuple[Annotated[float, "ω²"], Annotated[float, "ω"]] = (30.6, 9.9)
    lift_speed: Annotated[float, "hω"] = 0.206
    lift: Annotated[float, "g"] = (
        4.0  # greatest acceleration upwards: hips lack torque for more in a short step
    )
    landing_speed: Annotated[float, "hω"] = 0.103  # soft on level ground …
    haste: Annotated[float, "ω"] = 4.3  # … and quicker for each height between the feet in the last steps
    hardest: Annotated[float, "hω"] = 0.25
    search: Annotated[float, "h"] = 0.20  # as deep as a leg is still not straight
    search_time: Annotated[float, "1/ω"] = 1.21
    piece: Annotated[float, "1/ω"] = 0.2
    # Contact of the foot in the air.
    early: float = 0.5  # before, a force is a foot that rubs
    rubs: float = (
        1.3  # ratio of the viability of a landing to that of a place met before, from which on a foot goes on
    )
    met: Annotated[float, "mg"] = 0.122
    lost: Annotated[float, "mg"] = 0.015
    held: Annotated[float, "mg"] = 0.18  # of the other foot, or it is a flight
    lost_time: Annotated[float, "1/ω"] = 0.12
    # Height.
    level_lag: Annotated[float, "1/ω"] = 1.01  # of the CoM over the feet: it need not follow each stone
    ground_share: float = 0.75  # of an unexpected height that the next landing expects
    # Choice of a place on ground that is seen.
    balance_cost: Annotated[float, "h"] = (
        3.0  # of a landing away from the program's, over the program's cost in h²
    )
    choice: float = 0.15  # share of the step's time from which on a place is chosen
    again: Annotated[float, "h"] = 0.03  # move of the program's landing from which on another one is chosen
    # Both feet.
    shift_time: Annotated[float, "1/ω"] = 2.83
    shift: float = 1.3  # place of ξ at its end, in b_y of a step in place: the first step begins late
    shift_gains: tuple[Annotated[float, "ω²"], Annotated[float, "ω"]] = (2.45, 3.2)
    rest: Annotated[float, "1/ω"] = 0.6
    stand_gain: float = 0.74
    stop_speed: Annotated[float, "hω"] = 0.02
    stop_length: Annotated[float, "h"] = 0.6  # a wide stand holds no push to the side
    stop_box: float = 0.9


class Divergent(NamedTuple):
    """Divergent component of motion, by the angular momentum about the contact."""

    x: float  # in the world, m
    y: float  # in the world, m
    omega: float  # natural frequency of the pendulum, 1/s


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


def step_time(speed: float, slow: float, brisk: float) -> float:
    """Return the time T of a step at a forward speed: `slow`, s, and beyond `brisk`, m/s, with the root of the speed.

    Legs swing over a longer step in more time: their length and their time grow alike.
    """
    return slow * float((1.0 + (speed / brisk) ** 4) ** 0.125)


class Orbit(NamedTuple):
    """Periodic orbit of ξ over steps of the nominal time."""

    ahead: float  # offset b_x of ξ ahead of the foot that lands, m
    inwards: float  # offset b_y of ξ from the foot that lands towards the other one, m
    closing: float  # the same of the next foot, w/(1+E) + δ, m
    forward: float  # offset of ξ ahead of the stance foot at the end of a step, E b_x, m

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
        return Orbit(ahead, still - shift, still + shift, paced * ahead)


def takes_over(there: Point, here: Point, orbit: Orbit, stretch: float, wait: float, patience: float) -> bool:
    """Return True if the foot in contact is to carry now: waiting on the other foot would make it no more viable.

    The viability of a place is the ratio of the orbit's offset to that of ξ there, aside or, with half a stretch,
    ahead, whichever is less: its logarithm over ω is the time by which the next step may be longer than the orbit's.
    1 over `patience` is enough. While the foot that stands carries on, ξ moves on by (ξ − p)(e^{ωt} − 1): usually
    towards the new foot, and past it; away from it where ξ is beyond the outer edge. Where it runs away ahead, by more
    than half a stretch, nothing is waited for.

    Offsets of ξ ahead and inwards, m: `there` from the foot in contact towards the other one, `here` from the foot that
    stands towards the one in contact; waiting is judged by a time of `wait`, 1/ω.
    """
    if there[0] * here[0] > 0.0 and abs(there[0]) > abs(orbit.ahead) + 0.5 * stretch:
        return True
    grown = math.exp(wait) - 1.0
    now = viability(there[0], there[1], orbit, stretch)
    later = viability(there[0] + grown * here[0], there[1] - grown * here[1], orbit, stretch)
    return now >= min(later, 1.0 / patience)


def viability(ahead: float, inwards: float, orbit: Orbit, stretch: float) -> float:
    """Return the viability of a place from which ξ is so far ahead and inwards, m: see `takes_over`."""
    aside = orbit.inwards / max(inwards, LEAST_OFFSET)
    return min(aside, (abs(orbit.ahead) + 0.5 * stretch) / max(abs(ahead), LEAST_OFFSET))
