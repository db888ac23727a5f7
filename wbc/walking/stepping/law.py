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

An example: with h = 0.6 m, ω is 4.04/s. Steps of T = 0.408 s let an offset of ξ grow by E = 5.2. In a walk at 0.3 m/s
with w = 0.22 m, ξ is b = (29, 35) mm ahead and inwards of the foot that lands. When the step on this foot ends, ξ is
E b = (151, 185) mm from it, and the next foot lands at (151 − 29, 185 + 35) mm, which is (v T, w). A push that moves ξ
outwards by 20 mm as a step begins moves its landing outwards by 20 E = 104 mm.

Sources: time and place of steps as feedback: M. Khadiv et al., IEEE T-RO 36(3), 2020; angular momentum about the
contact: Y. Gong, J. Grizzle, J. Dyn. Sys. Meas. Control 144(12), 2022; the lateral orbit: X. Xiong, A. Ames,
IEEE T-RO 38(6), 2022.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from wbc.base.vectors import Point, Vector, add_cross, along
from wbc.core.robot import GRAVITY
from wbc.walking.plans.swing import RISE
from wbc.walking.stepping.settings import ConstantsInSI, RobotSize, SettingsInSI

SIDEWAYS = 0.8
"""Greatest ratio of the distance between the feet by which they come together in a walk to the side."""

SIDE = -1.0, 1.0
"""Side of the foot that swings while the left or the right one stands: 1 for the left foot, −1 for the right one."""

LEAST_OFFSET = 1e-3
"""Regularisation of divisions by a DCM offset, m: an offset this small takes longer than any step to grow."""


class StanceAxes(NamedTuple):
    """Axes of a step: ahead, along the heading, and outwards, to the side of the foot that swings."""

    side: float  # 1 if the left foot swings, −1 if the right one does
    direction: Point  # cosine and sine of the heading
    pivot: Vector  # carrying point of the foot that stands, m

    def outwards(self, x: float, y: float) -> Point:
        """Return the parts of a vector ahead and outwards."""
        ahead, left = along(self.direction, x, y)
        return ahead, self.side * left

    def offset(self, x: float, y: float) -> Point:
        """Return how far a point is ahead and outwards of the pivot, m."""
        return self.outwards(x - self.pivot[0], y - self.pivot[1])

    def point(self, ahead: float, outwards: float) -> Point:
        """Return the point in the world that is so far ahead and outwards of the pivot, m."""
        (cos, sin), left = self.direction, self.side * outwards
        return self.pivot[0] + cos * ahead - sin * left, self.pivot[1] + sin * ahead + cos * left


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


class Pace(NamedTuple):
    """Time of a step by its speed, and the speed that legs can walk at."""

    brisk: float  # speed about which steps begin to take longer, m/s
    quick: float  # speed from which on the torque of the hips decides, m/s
    swing: float  # speed over the least time of its steps by this torque, m/s²
    stride: float  # longest step, m
    longest: float  # longest time of a step, s

    @staticmethod
    def of(constants: ConstantsInSI, settings: SettingsInSI, scale: RobotSize) -> Pace:
        """Return the pace of a robot whose hips swing its legs with a share of their torque.

        A foot that passes from rest to rest over two steps of the length v T in the share t of the time T is
        accelerated by 10/√3 · 2 v T / (t T)² at most.
        """
        swing = settings.effort * scale.swing * constants.swing.late_touch**2 / (2.0 * RISE)
        longest = settings.longest * settings.step_time
        return Pace(constants.time.brisk, constants.time.quick, swing, scale.stride, longest)

    def time(self, speed: float, slow: float) -> float:
        """Return the time T of a step at a forward speed, m/s, with that of a slow step, s.

        Legs swing over a longer step in more time. In a fast walk it is the least that the hips have torque for.
        """
        speed = abs(speed)
        slowed = max(min(speed, 2.0 * self.quick - speed), 0.0)
        grown: float = (1.0 + (slowed / self.brisk) ** 4) ** 0.125
        return max(slow * grown, speed / self.swing)

    def fastest(self, slow: float) -> float:
        """Return the greatest speed whose steps are not too long and do not take too long, m/s."""
        low, high = 0.0, self.stride / slow
        for _ in range(40):
            speed = 0.5 * (low + high)
            time = self.time(speed, slow)
            low, high = (low, speed) if speed * time > self.stride or time > self.longest else (speed, high)
        return low


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

    @staticmethod
    def of_wish(places: Sequence[float], offsets: Sequence[float]) -> Orbit:
        """Return the offsets of steps that are asked for, ahead and outwards in turn, m."""
        return Orbit(offsets[0], -offsets[1], -offsets[3], places[0] + offsets[0])


def takes_over(there: Point, here: Point, orbit: Orbit, stretch: float, wait: float, patience: float) -> bool:
    """Return True if the foot in contact is to carry now: waiting on the other foot would make it no more viable.

    The viability of a place is the ratio of the orbit's offset to that of ξ there, aside or, with half a stretch,
    ahead, whichever is less: its logarithm over ω is the time by which the next step may be longer than the orbit's.
    1 over `patience` is enough. While the foot that stands carries on, ξ moves on by (ξ − p)(e^{ωt} − 1): usually
    towards the new foot, and past it; away from it where ξ is beyond the outer edge, and ahead. The greater need
    decides: a foot far aside of ξ is no help to one that runs away ahead.

    Offsets of ξ ahead and inwards, m: `there` from the foot in contact towards the other one, `here` from the foot that
    stands towards the one in contact; waiting is judged by a time of `wait`, 1/ω.
    """
    grown = math.exp(wait) - 1.0
    now = viability(there[0], there[1], orbit, stretch)
    later = viability(there[0] + grown * here[0], there[1] - grown * here[1], orbit, stretch)
    return now >= min(later, 1.0 / patience)


def viability(ahead: float, inwards: float, orbit: Orbit, stretch: float) -> float:
    """Return the viability of a place from which ξ is so far ahead and inwards, m: see `takes_over`."""
    aside = orbit.inwards / max(inwards, LEAST_OFFSET)
    return min(aside, (abs(orbit.ahead) + 0.5 * stretch) / max(abs(ahead), LEAST_OFFSET))
