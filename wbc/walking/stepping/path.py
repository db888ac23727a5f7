"""Steps that are asked for: their velocity, which the steering holds to a path, or footsteps, and where both lead."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from wbc.base.numbers import lag_gain
from wbc.base.vectors import Point, along
from wbc.walking.plans.check import Extent
from wbc.walking.plans.footsteps import Footstep, Place
from wbc.walking.plans.sources import AT_REST, Velocity, VelocityLimits
from wbc.walking.steering import Steering
from wbc.walking.stepping.decision import StepState
from wbc.walking.stepping.law import SIDEWAYS, Orbit, Pace, StanceAxes
from wbc.walking.stepping.program import Wish
from wbc.walking.stepping.settings import ConstantsInSI, GaitValues, SettingsInSI

HORIZON = 6
"""Number of footsteps that count: E to that power is beyond any error."""


class StepVelocity(NamedTuple):
    """Velocity of the next steps."""

    velocity: Point  # forward and left, m/s
    go: bool  # true if the robot is to walk; False brings it to a stand
    made_up: float = 0.0  # part of the forward velocity that offsets of ξ make up, and no longer steps, m/s


class PathSteering(Steering):
    """Steering of free steps: their velocity at every tick, held to a path.

    Attributes:
        heading: Heading of the pelvis and of the next steps, rad.
        direction: Cosine and sine of the heading.
        velocity: Velocity of the steps now, forward and left, m/s.
        turn: Turn of the steps now, rad/s.
        supported: Width of the soles that has held in the last steps, of that from which on steps are slow; 1 at most.
    """

    def __init__(
        self, values: GaitValues, heading: float, extent: Extent | None = None, supported: float = 0.0
    ) -> None:
        """Stand with a heading, rad, on a ground of an extent, m, on soles that are `supported` so far."""
        settings, constants, scale, dt = values
        self._settings, self._law, self._sole, self._dt = settings, constants, scale.sole, dt
        near = constants.path.near
        self._pace = pace = Pace.of(constants, settings, scale)
        self._path_gain = lag_gain(dt, self._law.path.path_lag)
        self.turn_to(heading)
        self.velocity: Point = (0.0, 0.0)
        self.turn = 0.0
        self.supported = supported
        self._path: Point | None = None
        self._line: tuple[Point, float] | None = None  # start and direction of the line to a far goal
        self._goal: Place | None = None  # to which that line leads
        self._missing = 0.0  # forward velocity by which the steps fall short of what is asked for, m/s
        aside = min(SIDEWAYS * (settings.widest - settings.gap) / settings.step_time, settings.fastest_aside)
        forward = pace.fastest(settings.step_time)
        back = min(settings.fastest_back, forward)
        super().__init__(VelocityLimits(forward, back, aside, settings.fastest_turn), near, extent)

    @property
    def step_time(self) -> float:
        """Time T of a step of this velocity, s."""
        return self._pace.time(self.velocity[0], self._slow)

    def plan_time(self, stair: float) -> float:
        """Return the time T of a step along footsteps, s, with the height to the next stair, m; 0 on the level."""
        settings = self._settings
        if stair < 0.0:
            return self._pace.time(self.velocity[0], settings.slow_time)
        supported = 1.0 if stair else self.supported
        longer = max(min(self._law.time.plan_time, settings.slow_time) - settings.step_time, 0.0)
        return self._pace.time(self.velocity[0], settings.step_time + supported * longer)

    @property
    def fast_share(self) -> float:
        """Share from 0 to 1 by which the walk is a fast one: 1 from twice the speed on at which hips decide."""
        return min(max(abs(self.velocity[0]) / self._pace.quick - 1.0, 0.0), 1.0)

    @property
    def _slow(self) -> float:
        """Time of a step at low speed, s: quick in fast walks and in turns, and before a stand, nearer the middle."""
        settings = self._settings
        brisk = max(abs(self.velocity[0]) / settings.cruise, abs(self.turn) / self._law.path.slow_turn)
        slow = self.supported * min(max(2.0 - brisk, 0.0), 1.0) if self.pending else 0.0
        return settings.step_time + slow * (settings.slow_time - settings.step_time)

    def rest(self, place: Point) -> None:
        """Start again from a stand at a place, m."""
        self.velocity, self.turn, self._path, self._missing = (0.0, 0.0), 0.0, place, 0.0

    def land(self, supported: float) -> None:
        """Take in a landing: the width of the sole that has held, of that from which on steps are slow."""
        less, more = self._law.area.held_gain
        self.supported += (less if supported < self.supported else more) * (supported - self.supported)

    def follow(self, velocity: Point, heading: float) -> None:
        """Take velocity, m/s, and heading, rad, from footsteps; no path is held."""
        self.velocity, self.turn, self._path, self._missing = velocity, 0.0, None, 0.0
        most = self._settings.fastest_turn * self._dt
        self.turn_to(self.heading + min(max(math.remainder(heading - self.heading, math.tau), -most), most))

    def turn_to(self, heading: float) -> None:
        """Set the heading, rad."""
        self.heading, self.direction = heading, (math.cos(heading), math.sin(heading))

    def turn_with(self, heading: float) -> None:
        """Go on from where the pelvis faces, rad, if something has turned it far from the heading.

        Feet that held on to the heading would cross beneath it.
        """
        off = math.remainder(heading - self.heading, math.tau)
        if abs(off) > self._law.path.pelvis_turn:
            self.turn_to(self.heading + off - math.copysign(self._law.path.pelvis_turn, off))

    def arrives(self, place: Point) -> bool:
        """Return True, and drop the goal, if it is reached at a place, m."""
        if self.goal is None:
            return False
        distance, turn = self.away(place, self.heading)
        if distance >= self._law.path.arrived or abs(turn) >= self._law.path.arrived_turn:
            return False
        self.goal = None
        return True

    def overruns(self, place: Point) -> bool:
        """Return True if a robot at a place, m, could soon stop no more on the ground with the commanded velocity."""
        if self.extent is None or self.target is None:
            return False
        x, y, _ = self.limited(self.target)
        u, v = self.velocity if any(self.velocity) else (x, y)
        (cos, sin), (length, width), settings = self.direction, self._sole, self._settings
        stop = math.hypot(u, v) / (2.0 * settings.acceleration) + settings.step_time  # s, at this velocity
        apart = settings.gap + abs(v) * settings.step_time / SIDEWAYS  # feet that come apart, m
        width += max(0.5 * settings.width, apart)
        ends = self.extent[:2], self.extent[2:]
        for at, (low, high), (a, b) in zip(place, ends, ((cos, -sin), (sin, cos)), strict=True):
            towards, ahead = a * x + b * y, stop * (a * u + b * v)
            room = abs(a) * length + abs(b) * width
            if (towards > 0.0 and at + ahead + room > high) or (towards < 0.0 and at + ahead - room < low):
                return True
        return False

    def update(self, place: Point, speed: Point) -> StepVelocity:
        """Return the velocity of the next steps, from place (m) and speed (m/s) of the CoM in the world."""
        settings, dt = self._settings, self._dt
        forward, left, turn = self._wanted(place)
        change = settings.acceleration * dt
        x, y = self.velocity
        x += min(max(forward - x, -change), change)
        y += min(max(left - y, -change), change)
        self.velocity, self.turn = (x, y), turn
        self.turn_to(self.heading + turn * dt)
        velocity = self._kept_to_path(place, turn)
        fast_share = self.fast_share
        self._make_up(velocity, speed, fast_share)
        return StepVelocity(
            (velocity[0] + self._missing, velocity[1]), self.pending, fast_share * self._missing
        )

    def _wanted(self, place: Point) -> Velocity:
        """Return the velocity that target or goal ask for, within the limits."""
        if self.goal != self._goal:
            self._goal, self._line = self.goal, None
        if self.goal is None:
            return AT_REST if self.target is None else self.limited(self.target)
        law, (x, y, _), (distance, _) = self._law.path, self.goal, self.away(place, self.heading)
        if distance > law.near:
            straight = math.atan2(y - place[1], x - place[0])
            if self._line is None or abs(math.remainder(straight - self._line[1], math.tau)) > law.astray:
                self._line = place, straight
        else:
            self._line, self._path = None, place  # a near goal is walked to as one stands
            if self.arrives(place):
                return AT_REST
        towards = None if self._line is None else self._line[1]
        return self.limited(self.approach(place, self.heading, law.goal_time, self._settings.cruise, towards))

    def _kept_to_path(self, place: Point, turn: float) -> Point:
        """Return the velocity of the steps plus the one back to the path, whose point moves on beside the robot."""
        law, (x, y) = self._law.path, self.velocity
        cos, sin = self.direction
        if self._line is not None:
            (from_x, from_y), direction = self._line
            way_x, way_y = math.cos(direction), math.sin(direction)
            gone = way_x * (place[0] - from_x) + way_y * (place[1] - from_y)
            self._path = from_x + way_x * gone, from_y + way_y * gone
        path = place if self._path is None else self._path
        path = (path[0] + (cos * x - sin * y) * self._dt, path[1] + (sin * x + cos * y) * self._dt)
        ahead, aside = along(self.direction, place[0] - path[0], place[1] - path[1])
        # A robot that walks is never behind its path; one that walks sideways or turns takes it along.
        taken = 0.0 if x == 0.0 and y == 0.0 and turn == 0.0 else ahead
        across = 0.0 if y == 0.0 and turn == 0.0 else aside * self._path_gain
        self._path = (path[0] + cos * taken - sin * across, path[1] + sin * taken + cos * across)
        most = law.drift_speed
        back = -law.drift_gain * (ahead - taken), -law.drift_gain * aside
        return x + min(max(back[0], -most), most), y + min(max(back[1], -most), most)

    def _make_up(self, asked: Point, speed: Point, fast_share: float) -> None:
        """Integrate the velocity by which the robot falls short, forward: where feet carry is known to centimetres."""
        law, (cos, sin) = self._law.path, self.direction
        short = asked[0] - cos * speed[0] - sin * speed[1]
        # What a brisk walk gained while it fell behind its ramp must be gone before the legs can follow no more.
        slow = self._slow
        lag = law.speed_lag * (slow / self._pace.time(self.velocity[0], slow)) ** 4
        missing, most = self._missing + short * self._dt / lag, (1.0 + fast_share) * law.speed_bias
        self._missing = min(max(missing, -most), most)


class Asked(NamedTuple):
    """Steps that are asked for in one tick, of a velocity or along footsteps: it says the same of both."""

    steps: StepVelocity  # velocity of the next steps; of footsteps that of the one that swings
    speed: float  # speed of the steps without their way back to a path, m/s
    fast_share: float  # share from 0 to 1 by which the walk is a fast one; 0 along footsteps
    heading: float  # heading of the steps, rad
    direction: Point  # its cosine and sine
    turn: float  # turn of the steps, rad/s
    time: float  # time T of a step, s
    footsteps: Sequence[Footstep] = ()  # from the one that swings on; none of steps by a velocity

    def wish(self, state: StepState, settings: SettingsInSI, carrying: float, pace: float) -> Wish:
        """Return the steps for the program.

        Feet carry so far ahead of their centres, m. Steps of a fast walk are as long as their `pace` asks for, the mean
        time of the last ones, s.
        """
        if self.footsteps:
            axes, omega = state.axes, state.dcm.omega
            return steps_of_plan(self.footsteps, carrying, settings.width, axes, omega, self.time)
        forward, left = self.steps.velocity
        longer = 1.0 + self.fast_share * (pace / self.time - 1.0)
        return steps_of_velocity(((forward - self.steps.made_up) * longer, left), self.width(settings), state)

    def orbit(self, side: float, settings: SettingsInSI, pace: float, omega: float) -> Orbit:
        """Return the orbit of the velocity; see `Orbit.of`."""
        return Orbit.of(self.steps.velocity, side, self.width(settings), self.time, pace, omega)

    def width(self, settings: SettingsInSI) -> float:
        """Return the distance between feet, m: of a robot that walks sideways they come apart and together."""
        return max(settings.width, settings.gap + abs(self.steps.velocity[1]) * self.time / SIDEWAYS)

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
