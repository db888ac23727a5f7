"""Steering: a velocity or a goal that is asked for becomes the velocity of the steps, for planned and free steps.

    Steering         what is asked for, limits, and the velocity towards a goal
    PathSteering     of free steps: at every tick the velocity of the next steps, held to a path
    SteeredSteps     of planned steps: footsteps with that velocity, within the reach of the legs

Towards a far goal the robot walks face first; near it, it walks as it stands, in all directions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

from wbc.base.errors import InputError
from wbc.base.numbers import lag_gain
from wbc.base.vectors import Point, along
from wbc.core.robot import SIDES
from wbc.walking.plans.footsteps import CLOSED, Footstep, FootstepPlan, Place, other
from wbc.walking.plans.gait import Gait, pace
from wbc.walking.plans.planners import opens, steps_along
from wbc.walking.plans.reach import Extent, Reach, over
from wbc.walking.plans.sources import (
    AT_REST,
    DriveSettings,
    FootstepSource,
    Standing,
    Velocity,
    VelocityLimits,
    checked_velocity,
    close_up,
)
from wbc.walking.stepping.law import SIDEWAYS, Pace
from wbc.walking.stepping.settings import RobotSize, SteppingConstants, SteppingSettings, in_si

LEADER_TURN = 4.0 / 3.0
"""Turn of the outer foot over that of the step; the inner one takes 2/3 and turns inwards."""

TURN_REACH = 0.9
"""Ratio of the greatest turn of a foot that steps may use."""

TRIES = 2
"""Landings beside a goal after which a robot stands as near to it as its landings are to their plans."""

AHEAD, STOPPING = 4, 0.1
"""Steps that are planned ahead, before the one that closes up; length of a step above which a robot that is to stop
takes a shorter one before it closes up, m: no step of a robot of half a metre is as long."""

PLANNED_NEAR, PLANNED_ARRIVED = 0.6, (0.02, 0.05)
"""Distance from which on a goal is walked to face first, m; distance and turn from which on it is reached, m and rad,
by planned steps, which land where they are planned."""

SETTING_OFF = 0.5
"""Time whose change of velocity a robot that stands sets off with, s."""


class Steering:
    """Orders that a robot is steered by.

    Attributes:
        target: Commanded velocity: forward (m/s), left (m/s), turn (rad/s); None for a stand, or with a goal.
        goal: Place (m) and heading (rad) to walk to; None without one, and once the robot is there.
        limits: Largest velocities that the walk accepts without limiting them.
        near: Distance up to which a goal is walked to without being faced, m.
        extent: Extent of the ground, m; None is endless.
    """

    def __init__(self, limits: VelocityLimits, near: float, extent: Extent | None = None) -> None:
        """Stand."""
        self.limits, self.near, self.extent = limits, near, extent
        self.target: Velocity | None = None
        self.goal: Place | None = None

    @property
    def pending(self) -> bool:
        """True while a velocity or a goal asks for steps."""
        return self.target is not None or self.goal is not None

    def command(self, velocity: Sequence[float] | None) -> None:
        """Take a velocity, forward (m/s), left (m/s), turn (rad/s); None, or zero, for a stand."""
        checked = checked_velocity(velocity)
        self.target, self.goal = checked if any(checked) else None, None

    def go_to(self, x: float, y: float, yaw: float) -> None:
        """Take a goal, place (m) and heading (rad); an `InputError` for one beside the ground."""
        if self.extent is not None:
            low_x, high_x, low_y, high_y = self.extent
            if not (low_x <= x <= high_x and low_y <= y <= high_y):
                raise InputError(f"the ground {over(self.extent)}, got the goal ({x:g}, {y:g})")
        self.target, self.goal = None, (x, y, yaw)

    def limited(self, velocity: Velocity) -> Velocity:
        """Return a velocity with each part cut to what can be walked."""
        (x, y, turn), (forward, back, aside, most_turn) = velocity, self.limits
        return (
            min(max(x, -back), forward),
            min(max(y, -aside), aside),
            min(max(turn, -most_turn), most_turn),
        )

    def away(self, place: Point, heading: float) -> tuple[float, float]:
        """Return distance (m) and turn (rad) from a place and heading to the goal."""
        assert self.goal is not None
        x, y, yaw = self.goal
        return math.hypot(x - place[0], y - place[1]), math.remainder(yaw - heading, math.tau)

    def approach(
        self, place: Point, heading: float, time: float, cruise: float, towards: float | None
    ) -> Velocity:
        """Return the velocity to the goal from a place and heading, which takes a `time`, s, at most `cruise`, m/s.

        `towards` is the direction in which a far goal is walked to, rad, straight to it when None.
        """
        assert self.goal is not None
        (x, y, _), (distance, turn) = self.goal, self.away(place, heading)
        dx, dy = x - place[0], y - place[1]
        if distance > self.near:
            off = math.remainder((math.atan2(dy, dx) if towards is None else towards) - heading, math.tau)
            return min(cruise, distance / time) * max(0.0, math.cos(off)) ** 4, 0.0, off / time
        ahead, aside = along((math.cos(heading), math.sin(heading)), dx, dy)
        return min(max(ahead / time, -cruise), cruise), aside / time, turn / time


# ---- free steps -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class PathConstants:
    """Constants of the steering of free steps, in units of the robot."""

    near: Annotated[float, "h"] = 0.8  # a goal within it is walked to without being faced: turns cost steps
    # Angle from the line to a far goal to the goal from which on a new line is begun: ground turned the robot aside.
    astray: Annotated[float, "rad"] = 0.8
    goal_time: Annotated[float, "1/ω"] = 4.0  # of the approach to a near goal, some two steps
    arrived: Annotated[float, "h"] = 0.15  # what steps reach: landings serve the balance
    arrived_turn: Annotated[float, "rad"] = 0.15
    slow_turn: Annotated[float, "ω"] = (
        0.05  # from which on steps become quick: headings turn as a foot stands
    )
    path_lag: Annotated[float, "1/ω"] = 2.0  # of the path behind a robot that walks sideways or turns
    speed_lag: Annotated[float, "1/ω"] = 8.0  # of the velocity by which the robot falls short
    # Greatest one: where feet carry is known to centimetres; twice if fast.
    speed_bias: Annotated[float, "hω"] = 0.08
    drift_gain: Annotated[float, "ω"] = 0.124  # of the way back to the path
    drift_speed: Annotated[float, "hω"] = 0.041
    turned: Annotated[float, "rad"] = 0.35  # of the pelvis from the heading, at most: a push may turn it


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
        goes: False for a robot that is to stand.
        held: Width of the soles that has held in the last steps, of that from which on steps are slow; 1 at most.
        follows: True while the steps are footsteps that are given.
        climbs: Height to the next stair of these, up or down, m; 0 on the level.
    """

    def __init__(
        self,
        settings: SteppingSettings,
        scale: RobotSize,
        constants: SteppingConstants,
        heading: float,
        dt: float,
        extent: Extent | None = None,
        held: float = 0.0,
    ) -> None:
        """Stand, with settings and constants of the law in SI units, on a ground of an extent, m, and `held` by it."""
        self._sole, self._plan_time, self._held_gain = scale.sole, constants.plan_time, constants.held_gain
        self._s, self._c, self._dt = settings, in_si(PathConstants(), scale), dt
        self._pace = pace = Pace.of(constants, settings, scale)
        self._path_gain = lag_gain(dt, self._c.path_lag)
        self.turn_to(heading)
        self.velocity: Point = (0.0, 0.0)
        self.turn = 0.0
        self.held, self.goes, self.follows, self.climbs = held, True, False, 0.0
        self._path: Point | None = None
        self._line: tuple[Point, float] | None = None  # start and direction of the line to a far goal
        self._goal: Place | None = None  # to which that line leads
        self._missing = 0.0  # forward velocity by which the steps fall short of what is asked for, m/s
        aside = min(SIDEWAYS * (settings.widest - settings.gap) / settings.step_time, settings.fastest_aside)
        forward = pace.fastest(settings.step_time)
        back = min(settings.fastest_back, forward)
        super().__init__(VelocityLimits(forward, back, aside, settings.fastest_turn), self._c.near, extent)

    @property
    def step_time(self) -> float:
        """Time T of a step at this velocity, s."""
        return self._pace.time(self.velocity[0], self._slow)

    @property
    def fast_share(self) -> float:
        """Share from 0 to 1 by which the walk is a fast one: 1 from twice the speed on at which hips decide."""
        return min(max(abs(self.velocity[0]) / self._pace.quick - 1.0, 0.0), 1.0)

    @property
    def _slow(self) -> float:
        """Time of a step at low speed, s: quick in fast walks and in turns, and before a stand, nearer the middle."""
        s = self._s
        if self.follows:
            if self.climbs < 0.0:
                return s.slow_time
            held = 1.0 if self.climbs else self.held
            return s.step_time + held * max(min(self._plan_time, s.slow_time) - s.step_time, 0.0)
        brisk = max(abs(self.velocity[0]) / s.cruise, abs(self.turn) / self._c.slow_turn)
        slow = self.held * min(max(2.0 - brisk, 0.0), 1.0) if self.goes else 0.0
        return s.step_time + slow * (s.slow_time - s.step_time)

    def rest(self, place: Point) -> None:
        """Start again from a stand at a place, m."""
        self.velocity, self.turn, self._path, self._missing = (0.0, 0.0), 0.0, place, 0.0
        self.follows = False

    def land(self, held: float) -> None:
        """Take in a landing: the width of the sole that has held, of that from which on steps are slow."""
        less, more = self._held_gain
        self.held += (less if held < self.held else more) * (held - self.held)

    def climb(self, height: float) -> None:
        """Take the height to the next stair of the footsteps to come, m; 0 on the level."""
        self.climbs = height

    def follow_footsteps(self) -> None:
        """Take the time of steps that footsteps take, from the shift of the weight before them on."""
        self.follows = True

    def along(self, velocity: Point, heading: float) -> None:
        """Take velocity, m/s, and heading, rad, from footsteps; no path is held."""
        self.follow_footsteps()
        self.goes = True
        self.velocity, self.turn, self._path, self._missing = velocity, 0.0, None, 0.0
        most = self._s.fastest_turn * self._dt
        self.turn_to(self.heading + min(max(math.remainder(heading - self.heading, math.tau), -most), most))

    def turn_to(self, heading: float) -> None:
        """Set the heading, rad."""
        self.heading, self.direction = heading, (math.cos(heading), math.sin(heading))

    def turn_with(self, heading: float) -> None:
        """Go on from where the pelvis faces, rad, if something has turned it far from the heading.

        Feet that held on to the heading would cross beneath it.
        """
        off = math.remainder(heading - self.heading, math.tau)
        if abs(off) > self._c.turned:
            self.turn_to(self.heading + off - math.copysign(self._c.turned, off))

    def arrives(self, place: Point) -> bool:
        """Return True, and drop the goal, if it is reached at a place, m."""
        if self.goal is None:
            return False
        distance, turn = self.away(place, self.heading)
        if distance >= self._c.arrived or abs(turn) >= self._c.arrived_turn:
            return False
        self.goal = None
        return True

    def overruns(self, place: Point) -> bool:
        """Return True if a robot at a place, m, could soon stop no more on the ground with the commanded velocity."""
        if self.extent is None or self.target is None:
            return False
        x, y, _ = self.limited(self.target)
        u, v = self.velocity if any(self.velocity) else (x, y)
        (cos, sin), (length, width), s = self.direction, self._sole, self._s
        stop = math.hypot(u, v) / (2.0 * s.acceleration) + s.step_time  # s, at this velocity
        width += max(0.5 * s.width, s.gap + abs(v) * s.step_time / SIDEWAYS)  # feet that come apart
        ends = self.extent[:2], self.extent[2:]
        for at, (low, high), (a, b) in zip(place, ends, ((cos, -sin), (sin, cos)), strict=True):
            towards, ahead = a * x + b * y, stop * (a * u + b * v)
            room = abs(a) * length + abs(b) * width
            if (towards > 0.0 and at + ahead + room > high) or (towards < 0.0 and at + ahead - room < low):
                return True
        return False

    def update(self, place: Point, speed: Point) -> StepVelocity:
        """Return the velocity of the next steps, from place (m) and speed (m/s) of the CoM in the world."""
        s, dt, self.follows = self._s, self._dt, False
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
        return StepVelocity((held[0] + self._missing, held[1]), self.pending, self.fast_share * self._missing)

    def _wanted(self, place: Point) -> Velocity:
        """Return the velocity that target or goal ask for, within the limits."""
        if self.goal != self._goal:
            self._goal, self._line = self.goal, None
        if self.goal is None:
            return AT_REST if self.target is None else self.limited(self.target)
        c, (x, y, _), (distance, _) = self._c, self.goal, self.away(place, self.heading)
        if distance > c.near:
            straight = math.atan2(y - place[1], x - place[0])
            if self._line is None or abs(math.remainder(straight - self._line[1], math.tau)) > c.astray:
                self._line = place, straight
        else:
            self._line, self._path = None, place  # a near goal is walked to as one stands
            if self.arrives(place):
                return AT_REST
        towards = None if self._line is None else self._line[1]
        return self.limited(self.approach(place, self.heading, c.goal_time, self._s.cruise, towards))

    def _held(self, place: Point, turn: float) -> Point:
        """Return the velocity of the steps plus the one back to the path, whose point moves on beside the robot."""
        c, (x, y) = self._c, self.velocity
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
        most = c.drift_speed
        back = -c.drift_gain * (ahead - taken), -c.drift_gain * aside
        return x + min(max(back[0], -most), most), y + min(max(back[1], -most), most)

    def _make_up(self, asked: Point, speed: Point) -> None:
        """Integrate the velocity by which the robot falls short, forward: where feet carry is known to centimetres."""
        c, (cos, sin) = self._c, self.direction
        short = asked[0] - cos * speed[0] - sin * speed[1]
        # What a brisk walk gained while it fell behind its ramp must be gone before the legs can follow no more.
        lag = c.speed_lag * (self._slow / self.step_time) ** 4
        missing, most = self._missing + short * self._dt / lag, (1.0 + self.fast_share) * c.speed_bias
        self._missing = min(max(missing, -most), most)


# ---- planned steps --------------------------------------------------------------------------------------------------


class SteeredSteps(FootstepSource):
    """Footsteps of a robot that is steered.

    Sideways the foot on the side of the motion opens by two steps' worth and the other one closes; in turns the outer
    foot takes the greater part. The last steps to a goal have its heading.

    Attributes:
        steering: What is asked for.
        granted: Velocity of the present plan: the commanded one, limited in change, by the settings and by the reach of
            the legs.
        pace: Speed of the gait (`SPEEDS`), m/s: that of the velocity.
    """

    granted: Velocity
    to_check = 0

    def __init__(
        self,
        reach: Reach,
        settings: DriveSettings | None = None,
        steering: Steering | None = None,
        granted: Velocity = AT_REST,
        pace: float = 0.0,
    ) -> None:
        """Stand; `granted` and `pace` are those of the robot now."""
        self.settings = s = settings or DriveSettings()
        self.steering = steering or Steering(s.limits, PLANNED_NEAR)
        self.granted, self.pace = granted, pace
        self._wish: Velocity = granted  # before the limits of the reach
        self._asked: tuple[Velocity, float, Gait] | None = None  # last asked of the reach
        self._share = 1.0  # of that velocity within reach
        self._reach = reach
        self._time: float | None = None
        self._stop: int | None = None  # steps begun when the stop was commanded
        self._goal: Place | None = None  # last one
        self._forget()

    def _forget(self) -> None:
        """Begin to walk to a goal."""
        self._stops = False  # the goal has been reached by feet that stride
        self._aim: tuple[int, Footstep] | None = None  # number and place of the step that was planned last
        self._missed = dict.fromkeys(SIDES, 0.0)  # distance of a foot from where it was to land, m
        self._beside, self._tries = False, 0  # no further from the goal than that; landings there

    @property
    def order(self) -> object:  # type: ignore[override]
        """Velocity and goal that are asked for."""
        return self.steering.target, self.steering.goal

    def footsteps(self, now: Standing) -> FootstepPlan:
        """See `FootstepSource`."""
        past, self._time = self._time, now.time
        steering = self.steering
        if steering.goal is None:
            wanted = steering.target or AT_REST
        else:
            wanted = self._towards_goal(now)
            if wanted == AT_REST and now.first is None:
                steering.goal = None  # it stands there
        if wanted == AT_REST:
            plan = self._stopping(now)
        else:
            self._stop = None
            self._ramp(wanted, 0.0 if past is None else now.time - past)
            _, left, turn = wanted
            side = now.first or ("right" if (left or turn) < 0.0 else "left")
            asked = self._wish, now.start.spacing, now.start.gait
            if asked != self._asked:  # a constant velocity keeps its ratio within reach
                self._asked, (self.pace, self._share) = asked, self._fit(*asked)
            forward, left, turn = self._wish
            self.granted = self._share * forward, self._share * left, self._share * turn
            gait = Gait.at_speed(self.pace, now.start.gait)
            cycle = gait.cycle
            dx, dy, turn = (cycle * part for part in self.granted)
            plan = replace(now.start, gait=gait, steps=_steps(now.start, side, [(dx, dy, turn)] * AHEAD))
        self._aim = (now.begun, plan.steps[0]) if plan.steps else None
        return plan

    def _ramp(self, wanted: Velocity, time: float) -> None:
        """Let the velocity wished for follow the one that is asked for, for a time (s)."""
        if self.granted == AT_REST:
            time = SETTING_OFF
        parts = [
            now + max(-rate * time, min(rate * time, part - now))
            for now, part, rate in zip(
                self._wish, self.steering.limited(wanted), self.settings.acceleration, strict=True
            )
        ]
        self._wish = (parts[0], parts[1], parts[2])

    def _stopping(self, now: Standing) -> FootstepPlan:
        """Come to a stand: a shorter step where the last one was long, then the foot that closes up."""
        if self._stop is None:
            self._stop = now.begun - now.swings  # the step that has begun is the first of two
        gait = Gait.at_speed(self.pace, now.start.gait)
        start = replace(now.start, gait=gait)
        cycle = gait.cycle
        dx, dy, turn = (0.5 * cycle * part for part in self.granted)
        last = now.begun - self._stop > 0 or math.hypot(2.0 * dx, 2.0 * dy) < STOPPING
        if now.first is not None and not last:
            return replace(start, steps=_steps(start, now.first, [(dx, dy, turn)]))
        self.granted, self._wish, self.pace = AT_REST, AT_REST, 0.0
        return start if now.first is None else close_up(start, now.first)

    def _towards_goal(self, now: Standing) -> Velocity:
        """Return the velocity towards the goal, at most what the next two steps need; zero where it is reached."""
        s, start, steering = self.settings, now.start, self.steering
        if steering.goal != self._goal:
            self._goal = steering.goal
            self._forget()
        if self._aim is not None and now.begun - now.swings > self._aim[0]:
            aim = self._aim[1]
            landed = start.foot(aim.side)
            self._missed[aim.side] = math.hypot(landed.x - aim.x, landed.y - aim.y)
            self._tries += self._beside
        px, py, heading = start.middle
        if now.first is not None:  # feet that stride: the middle is beside the foot that stands
            px, py, heading = start.foot(other(now.first)).middle(start.spacing)
        away, turn = steering.away((px, py), heading)
        # Feet that close up may stay where they are by as much as `CLOSED`: a stand is no worse for that.
        more = CLOSED if self._stops and now.first is None else (0.0, 0.0)
        near, missed = PLANNED_ARRIVED[0] + more[0], max(self._missed.values())
        self._beside = away < near + missed
        if self._tries >= TRIES:  # a robot whose landings are always put off would march for ever
            near += missed
        self._stops = away < near and abs(turn) < PLANNED_ARRIVED[1] + more[1]
        if self._stops:
            return AT_REST
        gait = Gait.for_speed(self.granted, start.gait)
        two = 2.0 * gait.cycle
        return steering.approach((px, py), heading, two, s.fastest[0], None)

    def _fit(self, velocity: Velocity, spacing: float, gait: Gait) -> tuple[float, float]:
        """Return the speed of the gait for a velocity, and the greatest ratio of the velocity within reach."""
        speed = pace(velocity)
        strains = self._strains(
            velocity, speed, gait, 1.0
        )  # what the whole velocity does not, no part of it does
        if not strains and self._within(velocity, speed, spacing, gait, 1.0):
            return speed, 1.0
        low, high = 0.0, 1.0
        for _ in range(8):
            middle = 0.5 * (low + high)
            if self._within(velocity, speed, spacing, gait, middle) and not (
                strains and self._strains(velocity, speed, gait, middle)
            ):
                low = middle
            else:
                high = middle
        return speed, low

    def _strains(self, velocity: Velocity, speed: float, gait: Gait, share: float) -> bool:
        """True if steps with the ratio `share` of a velocity take more than hip and knee give in their time."""
        gait = Gait.at_speed(speed, gait)
        dx, dy, _ = (share * gait.cycle * part for part in velocity)
        return self._reach.effort(gait, -dx, dx, 2.0 * dy) > 1.0

    def _within(self, velocity: Velocity, speed: float, spacing: float, gait: Gait, share: float) -> bool:
        """True if both feet's steps with the ratio `share` of a velocity are within reach, and no soles overlap."""
        r, s = self._reach, self.settings.reach
        gait = Gait.at_speed(speed, gait)
        cycle = gait.cycle
        dx, dy, turn = (share * cycle * part for part in velocity)
        wider = s * (r.max_spacing - spacing)
        outer = LEADER_TURN * abs(turn)  # the inner foot may turn half as far, and does
        # Steps that are long and wide at once take more of the hip than each alone.
        effort = (dx / (s * r.max_length)) ** 2 + (2.0 * dy / max(wider, 1e-6)) ** 2
        if effort > 1.0 or outer > TURN_REACH * r.max_yaw:
            return False
        for side in SIDES:
            stance = Footstep(other(side), 0.0, 0.0)
            (step,) = steps_along(
                stance.middle(spacing), 0.0, spacing, side, [(dx, dy, turn)], _shares, close=False
            )
            forward, left, _, _ = step.seen_from(stance)
            far = abs(forward) > s * r.max_length or not r.min_spacing <= abs(left) <= r.max_spacing
            if far or r.overlap(stance, step):
                return False
        return True


def _shares(side: str, left: float, turn: float) -> tuple[float, float]:
    return 2.0 * opens(side, left), LEADER_TURN if opens(side, turn) else 2.0 - LEADER_TURN


def _steps(
    start: FootstepPlan, side: str, moves: Sequence[tuple[float, float, float]]
) -> tuple[Footstep, ...]:
    """Steps from the foot that stands, and the one that closes up."""
    stance = start.foot(other(side))
    return steps_along(stance.middle(start.spacing), stance.z, start.spacing, side, moves, _shares)
