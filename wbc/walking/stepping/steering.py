"""Steering of a stepping walk: a velocity or a goal becomes the velocity of the next steps, held to a path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from wbc.walking.plans.sources import Velocity, checked_velocity
from wbc.walking.source import VelocityLimits
from wbc.walking.stepping.law import SIDEWAYS, Point, step_time
from wbc.walking.stepping.settings import RobotSize, SteppingSettings, in_si


@dataclass(frozen=True, slots=True)
class SteeringConstants:
    """Constants of the steering, in units of the robot."""

    near: Annotated[float, "h"] = 0.8  # a goal within it is walked to without being faced: turns cost steps
    # Angle from the line to a far goal to the goal from which on a new line is begun: ground turned the robot aside.
    astray: Annotated[float, "rad"] = 0.8
    goal_time: Annotated[float, "1/ω"] = 4.0  # of the approach to a near goal, some two steps
    arrived: Annotated[float, "h"] = 0.15  # what steps reach: landings serve the balance
    arrived_turn: Annotated[float, "rad"] = 0.15
    slow_turn: Annotated[float, "ω"] = (
        0.05  # from which on steps become quick: a heading turns while a foot stands
    )
    path_lag: Annotated[float, "1/ω"] = 2.0  # of the path behind a robot that walks sideways or turns
    speed_lag: Annotated[float, "1/ω"] = 8.0  # of the velocity by which the robot falls short
    speed_bias: Annotated[float, "hω"] = 0.08  # greatest one: where feet carry is known to centimetres
    drift_gain: Annotated[float, "ω"] = 0.124  # of the way back to the path
    drift_speed: Annotated[float, "hω"] = 0.041


class StepVelocity(NamedTuple):
    """Velocity of the next steps."""

    velocity: Point  # forward and left, m/s
    turn: float  # rad/s
    go: bool  # true if the robot is to walk; False brings it to a stand


class Steering:
    """Steering of one walk.

    Attributes:
        target: Commanded velocity: forward (m/s), left (m/s), turn (rad/s); None for a stand, or with a goal.
        goal: Place (m) and heading (rad) to walk to; None without one.
        heading: Heading of the pelvis and of the next steps, rad.
        direction: Cosine and sine of the heading.
        velocity: Velocity of the steps now, forward and left, m/s.
        turn: Turn of the steps now, rad/s.
        limits: Greatest velocities that are granted.
        goes: False for a robot that is to stand.
        held: Width of the soles that has held in the last steps, of that from which on steps are slow.
    """

    def __init__(
        self, settings: SteppingSettings, scale: RobotSize, brisk: float, heading: float, dt: float
    ) -> None:
        """Stand, with settings in SI units; beyond the velocity `brisk`, m/s, steps take longer."""
        self._s, self._c, self._brisk, self._dt = settings, in_si(SteeringConstants(), scale), brisk, dt
        self.target: Velocity | None = None
        self.goal: tuple[float, float, float] | None = None
        self.turn_to(heading)
        self.velocity: Point = (0.0, 0.0)
        self.turn = 0.0
        self.held, self.goes = 0.0, True
        self._path: Point | None = None
        self._line: tuple[Point, float] | None = None  # start and direction of the line to a goal
        self._missing = 0.0  # forward velocity by which the steps fall short of what is asked for, m/s
        aside = min(SIDEWAYS * (settings.widest - settings.gap) / settings.step_time, settings.fastest_aside)
        most = settings.stride / settings.step_time
        for _ in range(20):  # |v| T(v) is the stride
            most = settings.stride / step_time(most, settings.step_time, brisk)
        self.limits = VelocityLimits(
            min(settings.fastest, most), min(settings.fastest_back, most), aside, settings.fastest_turn
        )

    def command(self, velocity: Sequence[float] | None) -> None:
        """Take a velocity, forward (m/s), left (m/s), turn (rad/s); None, or zero, for a stand."""
        checked = checked_velocity(velocity)
        self.target, self.goal = (checked if velocity is not None and any(checked) else None), None
        self._line = None  # of a goal before

    def go_to(self, x: float, y: float, yaw: float) -> None:
        """Take a goal: place (m) and heading (rad). A far one is walked to along the line from here."""
        self.target, self.goal, self._line = None, (x, y, yaw), None

    @property
    def pending(self) -> bool:
        """True while a velocity or a goal asks for steps."""
        return self.target is not None or self.goal is not None

    @property
    def step_time(self) -> float:
        """Time T of a step at this velocity, s."""
        return step_time(self.velocity[0], self._slow, self._brisk)

    @property
    def _slow(self) -> float:
        """Time of a step at low speed, s: quick in fast walks and in turns, and before a stand, nearer the middle."""
        s = self._s
        brisk = max(abs(self.velocity[0]) / s.cruise, abs(self.turn) / self._c.slow_turn)
        slow = self.held * min(max(2.0 - brisk, 0.0), 1.0) if self.goes else 0.0
        return s.step_time + slow * (s.slow_time - s.step_time)

    def rest(self, place: Point) -> None:
        """Start again from a stand at a place, m."""
        self.velocity, self.turn, self._path, self._missing = (0.0, 0.0), 0.0, place, 0.0

    def along(self, velocity: Point, heading: float) -> None:
        """Take velocity, m/s, and heading, rad, from footsteps; no path is held."""
        self.goes = True
        self.velocity, self.turn, self._path, self._missing = velocity, 0.0, None, 0.0
        most = self._s.fastest_turn * self._dt
        self.turn_to(self.heading + min(max(math.remainder(heading - self.heading, math.tau), -most), most))

    def turn_to(self, heading: float) -> None:
        """Set the heading, rad."""
        self.heading, self.direction = heading, (math.cos(heading), math.sin(heading))

    def update(self, place: Point, speed: Point) -> StepVelocity:
        """Return the velocity of the next steps, from place (m) and speed (m/s) of the CoM in the world."""
        s, dt = self._s, self._dt
        forward, left, turn = self._wanted(place)
        change = s.acceleration * dt
        x, y = self.velocity
        x += min(max(forward - x, -change), change)
        y += min(max(left - y, -change), change)
        self.velocity, self.turn = (x, y), turn
        self.turn_to(self.heading + turn * dt)
        held = self._held(place, turn)
        self._make_up(held, speed)
        self.goes = self.pending
        return StepVelocity((held[0] + self._missing, held[1]), turn, self.pending)

    def _wanted(self, place: Point) -> Velocity:
        """Return the velocity that target or goal ask for, within the limits."""
        if self.goal is None:
            return self.limited(self.target) if self.target is not None else (0.0, 0.0, 0.0)
        s, c, (x, y, yaw) = self._s, self._c, self.goal
        dx, dy = x - place[0], y - place[1]
        distance = math.hypot(dx, dy)
        if distance > c.near:
            towards = math.atan2(dy, dx)
            if self._line is None or abs(math.remainder(towards - self._line[1], math.tau)) > c.astray:
                self._line = place, towards
            off = math.remainder(self._line[1] - self.heading, math.tau)
            return self.limited((s.cruise * max(0.0, math.cos(off)) ** 4, 0.0, off / c.goal_time))
        self._line, self._path = None, place  # a near goal is walked to as one stands
        off = math.remainder(yaw - self.heading, math.tau)
        if distance < c.arrived and abs(off) < c.arrived_turn:
            self.goal = None
            return (0.0, 0.0, 0.0)
        cos, sin = self.direction
        ahead, aside = (cos * dx + sin * dy) / c.goal_time, (cos * dy - sin * dx) / c.goal_time
        return self.limited((min(max(ahead, -s.cruise), s.cruise), aside, off / c.goal_time))

    def limited(self, velocity: Velocity) -> Velocity:
        """Return a velocity with each part cut to what can be walked."""
        (x, y, turn), (forward, back, aside, most_turn) = velocity, self.limits
        return (
            min(max(x, -back), forward),
            min(max(y, -aside), aside),
            min(max(turn, -most_turn), most_turn),
        )

    def _held(self, place: Point, turn: float) -> Point:
        """Return the velocity of the steps plus the one back to the path, whose point moves on beside the robot."""
        c, (x, y) = self._c, self.velocity
        cos, sin = self.direction
        if self._line is not None:
            (from_x, from_y), direction = self._line
            way_x, way_y = math.cos(direction), math.sin(direction)
            along = way_x * (place[0] - from_x) + way_y * (place[1] - from_y)
            self._path = from_x + way_x * along, from_y + way_y * along
        path = place if self._path is None else self._path
        path = (path[0] + (cos * x - sin * y) * self._dt, path[1] + (sin * x + cos * y) * self._dt)
        dx, dy = place[0] - path[0], place[1] - path[1]
        ahead, aside = cos * dx + sin * dy, cos * dy - sin * dx
        # A robot that walks is never behind its path; one that walks sideways or turns takes it along.
        along = 0.0 if x == 0.0 and y == 0.0 and turn == 0.0 else ahead
        across = 0.0 if y == 0.0 and turn == 0.0 else aside * min(self._dt / c.path_lag, 1.0)
        self._path = (path[0] + cos * along - sin * across, path[1] + sin * along + cos * across)
        most = c.drift_speed
        back = -c.drift_gain * (ahead - along), -c.drift_gain * aside
        return x + min(max(back[0], -most), most), y + min(max(back[1], -most), most)

    def _make_up(self, asked: Point, speed: Point) -> None:
        """Integrate the velocity by which the robot falls short, forward: where feet carry is known to centimetres."""
        c, (cos, sin) = self._c, self.direction
        short = asked[0] - cos * speed[0] - sin * speed[1]
        # What a brisk walk gained while it fell behind its ramp must be gone before the legs can follow no more.
        lag = c.speed_lag * (self._slow / self.step_time) ** 4
        missing = self._missing + short * self._dt / lag
        self._missing = min(max(missing, -c.speed_bias), c.speed_bias)
