"""Steps that are asked for in one tick: those of a velocity, or footsteps.

`Asked` says the same of both: time, place and heading of a step, when its foot meets the ground, and how long it waits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from wbc.base.vectors import Point
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.stepping.decision import StepState
from wbc.walking.stepping.law import SIDEWAYS, Orbit, StanceAxes
from wbc.walking.stepping.path import StepVelocity
from wbc.walking.stepping.program import Wish
from wbc.walking.stepping.settings import ConstantsInSI, SettingsInSI

HORIZON = 6
"""Number of footsteps that count: E to that power is beyond any error."""


class Asked(NamedTuple):
    """Steps that are asked for in one tick."""

    steps: StepVelocity  # velocity of the next steps; of footsteps that of the one that swings
    speed: float  # speed of the steps without their way back to a path, m/s
    fast_share: float  # share from 0 to 1 by which the walk is a fast one; 0 along footsteps
    heading: float  # heading of the steps, rad
    direction: Point  # its cosine and sine
    turn: float  # turn of the steps, rad/s
    time: float  # time T of a step, s
    footsteps: Sequence[Footstep] = ()  # from the one that swings on; none of steps by a velocity

    def wish(self, state: StepState, s: SettingsInSI, carrying: float, pace: float) -> Wish:
        """Return the steps for the program.

        Feet carry so far ahead of their centres, m. Steps of a fast walk are as long as their `pace` asks for, the mean
        time of the last ones, s.
        """
        if self.footsteps:
            return steps_of_plan(self.footsteps, carrying, s.width, state.axes, state.dcm.omega, self.time)
        forward, left = self.steps.velocity
        longer = 1.0 + self.fast_share * (pace / self.time - 1.0)
        return steps_of_velocity(((forward - self.steps.made_up) * longer, left), self.width(s), state)

    def orbit(self, side: float, s: SettingsInSI, pace: float, omega: float) -> Orbit:
        """Return the orbit of the velocity; see `Orbit.of`."""
        return Orbit.of(self.steps.velocity, side, self.width(s), self.time, pace, omega)

    def width(self, s: SettingsInSI) -> float:
        """Return the distance between feet, m: of a robot that walks sideways they come apart and together."""
        return max(s.width, s.gap + abs(self.steps.velocity[1]) * self.time / SIDEWAYS)

    def yaw(self, left: float) -> float:
        """Return the heading of a landing, rad, with the time that is left of the step, s."""
        return self.footsteps[0].yaw if self.footsteps else self.heading + self.turn * max(left, 0.0)

    def touch_share(self, law: ConstantsInSI) -> float:
        """Return the share of the time of a step at which the foot meets the expected ground."""
        c = law.swing
        return c.touch_of_plans if self.footsteps else c.touch + self.fast_share * (c.late_touch - c.touch)

    def patience(self, law: ConstantsInSI) -> float:
        """Return the offset of ξ over that of the orbit up to which the next step is long enough."""
        # A fast walk needs all of its time.
        c = law.touch
        return c.patience_of_plans if self.footsteps else c.patience + self.fast_share * (1.0 - c.patience)

    @property
    def may_move(self) -> bool:
        """True for a landing that may be moved on seen ground: footsteps that are fixed, and the last ones, stay."""
        steps = self.footsteps
        return not steps or (len(steps) > 2 and not steps[0].fixed)


def steps_of_velocity(velocity: Point, width: float, state: StepState) -> Wish:
    """Return the steps of a velocity, forward and left, m/s, with feet so far apart, m."""
    orbit, time = state.orbit, state.nominal
    length, drift = velocity[0] * time, state.axes.side * velocity[1] * time
    b, inwards, closing = orbit.ahead, -orbit.inwards, -orbit.closing
    places = length, width + drift, length, width - drift, length, width + drift
    return Wish(places, (b, inwards, b, closing, b, inwards), time)


def steps_of_plan(
    footsteps: Sequence[Footstep], carrying: float, width: float, axes: StanceAxes, omega: float, time: float
) -> Wish:
    """Return planned steps, and offsets from which a pendulum reaches rest at their end, E b = s⁺ + b⁺.

    Feet carry so far ahead of their centres, m; after the plan they would stand so far apart, m. Steps take a time, s.
    """
    growth, ways = math.exp(omega * time), []
    at = 0j
    for step in footsteps[:HORIZON]:
        x, y = step.x + carrying * math.cos(step.yaw), step.y + carrying * math.sin(step.yaw)
        ways.append(complex(*axes.offset(x, y)) - at)
        at += ways[-1]
    offsets = [-0.5 * ways[-1]]  # in the middle of the feet
    for way in ways[:0:-1]:
        offsets.insert(0, (way + offsets[0]) / growth)
    while len(ways) < 3:  # the robot stands: whatever leads on from there
        ways.append(complex(0.0, math.copysign(width, -ways[-1].imag)))
        offsets.append(growth * offsets[-1] - ways[-1])
    (s0, s1, s2), (b0, b1, b2) = ways[:3], offsets[:3]
    places = s0.real, s0.imag, s1.real, -s1.imag, s2.real, s2.imag
    return Wish(places, (b0.real, b0.imag, b1.real, -b1.imag, b2.real, b2.imag), time, promised=True)
