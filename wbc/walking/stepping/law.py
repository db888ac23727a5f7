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

from wbc.base.vectors import Point, Vector, add_cross
from wbc.core.robot import GRAVITY
from wbc.walking.stepping.settings import RobotSize, SteppingSettings
from wbc.walking.swing import RISE

SIDEWAYS = 0.8
"""Greatest ratio of the distance between the feet by which they come together in a walk to the side."""

LEAST_OFFSET = 1e-3
"""Regularisation of divisions by a DCM offset, m: an offset this small takes longer than any step to grow."""


@dataclass(frozen=True, slots=True)
class SteppingConstants:
    """Constants of the law, in units of the robot; docs/measured.md has what parts of it are worth."""

    # ---- Time and place of a step.
    # Velocity about which steps begin to take longer, because longer steps need more time; velocity from which on they
    # take as little time as the torque of the hips lets them.
    brisk: Annotated[float, "hω"] = 0.23
    quick: Annotated[float, "hω"] = 0.21
    # Low-pass of the time of a step: noise of ξ would move it by more than 10 ms.
    time_lag: Annotated[float, "1/ω"] = 0.111
    # Greatest time of a step when it begins, over the nominal time.
    later: float = 1.15
    # Distance of the DCM past the outer CoP bound from which on the step ends as soon as it can.
    outer_cop: Annotated[float, "h"] = 0.008
    # Distance of ξ ahead of its orbit that ends a step which would otherwise wait for ξ aside.
    stretch: Annotated[float, "h"] = 0.09
    # Weight of the last step in the mean time of steps.
    pace_gain: float = 0.2
    # ---- Contact of the foot that stands.
    # Carrying point, ahead of the centre of the sole: between centre and ankle either of them can hold a moment.
    carrying: Annotated[float, "ankle"] = 0.57
    # Low-pass of the measured centre of pressure: force sensors ring at impacts.
    cop_lag: Annotated[float, "1/ω"] = 0.081
    # Size of the box of the centre of pressure about the commanded one: one stone gives no moment.
    box: Annotated[Point, "sole"] = (0.035, 0.067)
    # The same on both feet: what a sole holds on stones.
    standing_box: Annotated[Point, "sole"] = (0.59, 0.67)
    # ---- Supported area of the foot that stands, and the centre of pressure in it.
    # Distance of the greatest area from the edges of the sole.
    margin: Annotated[float, "h"] = 0.026
    # Half width of a sole whose area counts for nothing on rough ground, and of one whose area counts in full.
    trusted: Annotated[Point, "h"] = (0.045, 0.065)
    # Height between the feet up to which the ground counts as level, and from which on as rough.
    even: Annotated[Point, "h"] = (0.01, 0.03)
    # Growth of each edge on rough ground: the whole sole within a step.
    area_growth: Annotated[float, "hω"] = 0.09
    # The part of the growth that level ground adds, over that on rough ground.
    level_growth: float = 4.0
    # Distance of the edge of an area from the measured centre of pressure, where the foot turns over this edge.
    inside: Annotated[float, "h"] = 0.0064
    # Greatest rate of a foot that stands; least rate of a foot that turns over an edge; low-pass of both rates.
    still: Annotated[float, "ω"] = 0.07
    turning: Annotated[float, "ω"] = 0.14
    spin_lag: Annotated[float, "1/ω"] = 0.044
    # Normal force from which on the centre of pressure shows where a foot holds.
    carries: Annotated[float, "mg"] = 0.3
    # Greatest speed of the commanded centre of pressure: moments do not jump.
    cop_speed: Annotated[float, "hω"] = 0.36
    # Greatest difference of measured and commanded centre of pressure that counts.
    cop_error: Annotated[float, "h"] = 0.038
    # Part of the half sole that the next foot is expected to hold: stones hold less than all.
    next_area: float = 0.3
    # Period of the program.
    period: Annotated[float, "1/ω"] = 0.021
    # Half of the supported width in the last steps from which on steps are slow.
    slow_width: Annotated[float, "h"] = 0.04
    # Weight of the last step in this width, where it is less and where it is more.
    held_gain: Point = (0.8, 0.3)
    # ---- The foot that has landed takes over.
    # Offset of ξ over that of the orbit up to which the next step is long enough.
    patience: float = 1.5
    # Time ahead for which waiting is judged, 1/ω.
    wait: float = 0.2
    # Greatest force of a foot that waits: more would move the contact point.
    share: Annotated[float, "mg"] = 0.3
    # Time in which the foot that has carried gives up its load.
    unload: Annotated[float, "1/ω"] = 0.20
    # Greatest force of a foot: with twice the weight robots jump to gain yaw moment.
    most_force: Annotated[float, "mg"] = 1.4
    # Force from which on a foot is in contact, and the least one of both feet together.
    least_force: Annotated[float, "mg"] = 0.061
    # Least force of a foot that carries alone. Where ξ is far aside a force up has a moment about the CoM, and the QP
    # would rather give up the force than let the trunk turn; but a trunk comes upright again, and a fall does not.
    carried: Annotated[float, "mg"] = 0.5
    # ---- Swing, over the time of the step.
    apex: float = 0.42
    # Time at which the foot meets the expected ground: a foot that comes late fells robots.
    touch: float = 0.88
    # The same in a walk of twice the velocity `quick`, whose long steps need the time.
    late_touch: float = 0.95
    # Time at which the sole is level: one that is still tilted rubs at edges.
    level: float = 0.3
    # Greatest acceleration over the ground: a long step takes its time.
    swing_push: Annotated[float, "g"] = 6.5
    # Stiffness and damping of the task of the swing foot's place.
    swing_gains: tuple[Annotated[float, "ω²"], Annotated[float, "ω"]] = (30.6, 9.9)
    # Distance of a landing from the one that was asked for, from which on the swing foot goes before the trunk, and at
    # which it does so in full.
    urgent: Annotated[Point, "h"] = (0.2, 0.5)
    lift_speed: Annotated[float, "hω"] = 0.206
    # Greatest acceleration upwards: hips lack torque for more in a short step.
    lift: Annotated[float, "g"] = 4.0
    # Speed of a landing: soft on level ground, quicker by `haste` for each height between the feet in the last steps,
    # and at most as the third one says.
    landing_speed: Annotated[float, "hω"] = 0.103
    haste: Annotated[float, "ω"] = 4.3
    hardest: Annotated[float, "hω"] = 0.25
    # Depth of the search for the ground, at which a leg is still not straight, and its time.
    search: Annotated[float, "h"] = 0.20
    search_time: Annotated[float, "1/ω"] = 1.21
    # Least time of a piece of the swing's motion.
    piece: Annotated[float, "1/ω"] = 0.2
    # ---- Contact of the foot in the air.
    # Part of the step before which a force is that of a foot that rubs.
    early: float = 0.5
    # Speed of a swing foot, beside twice the velocity of the walk, from which on a push has hurled it; time for which
    # its force is no contact then, and for which it goes after the trunk.
    hurled: Annotated[float, "hω"] = 1.2
    hurled_time: Annotated[float, "1/ω"] = 0.4
    # Speed of a foot without load in a stand from which on it has been kicked away.
    kicked: Annotated[float, "hω"] = 0.2
    # Change of the height of a foot that stands from which on its estimate has moved, and not the foot.
    drifted: Annotated[float, "h"] = 0.033
    # Height of the swing foot over the ground, in heights of a swing, above which its force is no contact.
    low: float = 1.1
    # Viability of the planned landing over that of a place where the foot rubs, from which on the foot goes on.
    rubs: float = 1.3
    # Force from which on the foot has met the ground; below which it has lost it again; of the other foot, which must
    # hold meanwhile, or it is a flight; time for which that must last.
    met: Annotated[float, "mg"] = 0.122
    lost: Annotated[float, "mg"] = 0.015
    held: Annotated[float, "mg"] = 0.18
    lost_time: Annotated[float, "1/ω"] = 0.12
    # ---- Height.
    # Low-pass of the height of the feet that carry: the CoM need not follow each stone.
    level_lag: Annotated[float, "1/ω"] = 1.01
    # Part of an unexpected height that the next landing expects.
    ground_share: float = 0.75
    # ---- Choice of a place on ground that is seen.
    # Cost of a landing away from the program's, over the program's own cost in h².
    balance_cost: Annotated[float, "h"] = 3.0
    # Part of the step's time from which on a place is chosen.
    choice: float = 0.15
    # Move of the program's landing from which on another place is chosen.
    again: Annotated[float, "h"] = 0.03
    # ---- Both feet.
    shift_time: Annotated[float, "1/ω"] = 2.83
    # Place of ξ when the shift ends, in b_y of a step in place: the first step begins late.
    shift: float = 1.3
    shift_gains: tuple[Annotated[float, "ω²"], Annotated[float, "ω"]] = (2.45, 3.2)
    rest: Annotated[float, "1/ω"] = 0.6
    stand_gain: float = 0.74
    # Greatest speed, and greatest distance between the feet, at which the robot stands again: a wide stand holds no
    # push to the side. Size of the box in which ξ must be, over the standing box.
    stop_speed: Annotated[float, "hω"] = 0.02
    stop_length: Annotated[float, "h"] = 0.6
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


class Pace(NamedTuple):
    """Time of a step by its speed, and the speed that legs can walk at."""

    brisk: float  # speed about which steps begin to take longer, m/s
    quick: float  # speed from which on the torque of the hips decides, m/s
    swing: float  # speed over the least time of its steps by this torque, m/s²
    stride: float  # longest step, m
    longest: float  # longest time of a step, s

    @staticmethod
    def of(constants: SteppingConstants, settings: SteppingSettings, scale: RobotSize) -> Pace:
        """Return the pace of a robot whose hips swing its legs with a share of their torque, all in SI units.

        A foot that passes from rest to rest over two steps of the length v T in the share t of the time T is
        accelerated by 10/√3 · 2 v T / (t T)² at most.
        """
        c, s = constants, settings
        swing = s.effort * scale.swing * c.late_touch**2 / (2.0 * RISE)
        return Pace(c.brisk, c.quick, swing, scale.stride, s.longest * s.step_time)

    def time(self, speed: float, slow: float) -> float:
        """Return the time T of a step at a forward speed, m/s, with that of a slow step, s.

        Legs swing over a longer step in more time. In a fast walk it is the least that the hips have torque for.
        """
        speed = abs(speed)
        slowed = max(min(speed, 2.0 * self.quick - speed), 0.0)
        grown = (1.0 + (slowed / self.brisk) ** 4) ** 0.125
        return max(slow * float(grown), speed / self.swing)

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
