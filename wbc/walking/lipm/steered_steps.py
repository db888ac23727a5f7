"""Planned steps of a robot that is steered: footsteps of a velocity within the reach of the legs, or to a goal."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import islice

from wbc.core.robot import SIDES
from wbc.walking.plans.footsteps import CLOSED, Footstep, FootstepPlan, Place, other
from wbc.walking.plans.gait import Gait, StepGait, pace
from wbc.walking.plans.planners import Move, opens, sides, steps_along
from wbc.walking.plans.reach import Reach
from wbc.walking.plans.sources import AT_REST, DriveSettings, FootstepSource, Standing, Velocity, close_up
from wbc.walking.steering import Steering

LEADER_TURN = 4.0 / 3.0
"""Turn of the outer foot over that of the step; the inner one takes 2/3 and turns inwards."""

TURN_REACH = 0.9
"""Ratio of the greatest turn of a foot that steps may use."""

TRIES = 2
"""Landings beside a goal after which a robot stands as near to it as its landings are to their plans."""

STEERED = 4
"""Steps that are planned ahead, before the one that closes up."""

STOPPING = 0.1
"""Length of a step above which a robot that is to stop takes a shorter one before it closes up, m: no step of a robot
of half a metre is as long."""

PLANNED_NEAR = 0.6
"""Distance from which on a goal is walked to face first, m; a small robot has its share of it."""

PLANNED_ARRIVED = (0.02, 0.05)
"""Distance and turn from which on a goal is reached, m and rad, by planned steps, which land where they are planned: a
tolerance of the goal, whatever the size of the robot."""

SETTING_OFF = 0.5
"""Time whose change of velocity a robot that stands sets off with, s."""


@dataclass(slots=True)
class GoalWay:
    """Way to one goal: how near to their places its landings have come.

    The robot stops within `PLANNED_ARRIVED` of the goal. Where landings miss their places it may never come as near; it
    is beside the goal once it is no further away than that and what they have missed, and stops there after `TRIES`.

    Attributes:
        goal: The goal; None for a velocity.
        stops: True once the goal has been reached by feet that stride.
        aim: Number and place of the step that was planned last.
        missed: Side → distance of the foot from where it was to land, m.
        beside: True while the robot is beside the goal.
        tries: Number of landings beside the goal.
    """

    goal: Place | None = None
    stops: bool = False
    aim: tuple[int, Footstep] | None = None
    missed: dict[str, float] = field(default_factory=lambda: dict.fromkeys(SIDES, 0.0))
    beside: bool = False
    tries: int = 0

    def land(self, now: Standing) -> None:
        """Take in a landing, if there has been one since the last plan."""
        if self.aim is not None and now.begun - now.swings > self.aim[0]:
            aim = self.aim[1]
            landed = now.start.foot(aim.side)
            self.missed[aim.side] = math.hypot(landed.x - aim.x, landed.y - aim.y)
            self.tries += self.beside


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
        self, reach: Reach, settings: DriveSettings, steering: Steering, granted: Velocity, pace: float
    ) -> None:
        """Stand; `granted` and `pace` are those of the robot now."""
        self.settings, self.steering = settings, steering
        self.granted, self.pace = granted, pace
        self._wish: Velocity = granted  # before the limits of the reach
        self._asked: tuple[Velocity, float, Gait] | None = None  # last asked of the reach
        self._share = 1.0  # of that velocity within reach
        self._reach = reach
        self._time: float | None = None
        self._stop: int | None = None  # steps begun when the stop was commanded
        self._way = GoalWay()

    @property
    def goal(self) -> Place | None:
        """Goal that the steps are on their way to; None for a velocity, and once the robot is there."""
        return self._way.goal

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
        if steering.goal is None:
            self._way = GoalWay()  # the same goal begins anew
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
            steps = _steps(now.start, side, _move(self.granted, gait), STEERED)
            plan = replace(now.start, gait=gait, steps=steps)
        self._way.aim = (now.begun, plan.steps[0]) if plan.steps else None
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
        dx, dy, turn = _move(self.granted, gait, 0.5)
        last = now.begun - self._stop > 0 or math.hypot(2.0 * dx, 2.0 * dy) < STOPPING
        if now.first is not None and not last:
            return replace(start, steps=_steps(start, now.first, (dx, dy, turn)))
        self.granted, self._wish, self.pace = AT_REST, AT_REST, 0.0
        return start if now.first is None else close_up(start, now.first)

    def _towards_goal(self, now: Standing) -> Velocity:
        """Return the velocity towards the goal, at most what the next two steps need; zero where it is reached."""
        s, start, steering = self.settings, now.start, self.steering
        way, goal = self._way, steering.goal
        assert goal is not None
        if way.goal is None or math.dist(way.goal, goal) > PLANNED_ARRIVED[0]:
            way = self._way = GoalWay()
        way.goal = goal
        way.land(now)
        px, py, heading = start.middle
        if now.first is not None:  # feet that stride: the middle is beside the foot that stands
            px, py, heading = start.foot(other(now.first)).middle(start.spacing)
        away, turn = steering.away((px, py), heading)
        # Feet that close up may stay where they are by as much as `CLOSED`: a stand is no worse for that.
        more = CLOSED if way.stops and now.first is None else (0.0, 0.0)
        near, missed = PLANNED_ARRIVED[0] + more[0], max(way.missed.values())
        way.beside = away < near + missed
        if way.tries >= TRIES:  # a robot whose landings are always put off would march for ever
            near += missed
        way.stops = away < near and abs(turn) < PLANNED_ARRIVED[1] + more[1]
        if way.stops:
            return AT_REST
        gait = Gait.for_speed(self.granted, start.gait)
        two = 2.0 * gait.cycle
        return steering.approach((px, py), heading, two, s.fastest[0], None)

    def _fit(self, velocity: Velocity, spacing: float, given: Gait) -> tuple[float, float]:
        """Return the speed of the gait for a velocity, and the greatest ratio of the velocity within reach."""
        speed = pace(velocity)
        gait = Gait.at_speed(speed, given)
        strains = self._strains(velocity, gait, 1.0)  # what the whole velocity does not, no part of it does
        if not strains and self._within(velocity, spacing, gait, 1.0):
            return speed, 1.0
        low, high = 0.0, 1.0
        for _ in range(8):
            middle = 0.5 * (low + high)
            strained = strains and self._strains(velocity, gait, middle)
            if not strained and self._within(velocity, spacing, gait, middle):
                low = middle
            else:
                high = middle
        return speed, low

    def _strains(self, velocity: Velocity, gait: StepGait, share: float) -> bool:
        """True if steps with the ratio `share` of a velocity take more than hip and knee give in their time."""
        dx, dy, _ = _move(velocity, gait, share)
        return self._reach.effort(gait, -dx, dx, 2.0 * dy) > 1.0

    def _within(self, velocity: Velocity, spacing: float, gait: StepGait, share: float) -> bool:
        """True if both feet's steps with the ratio `share` of a velocity are within reach, and no soles overlap."""
        r, s = self._reach, self.settings.reach
        dx, dy, turn = _move(velocity, gait, share)
        wider = s * (r.max_spacing - spacing)
        outer = LEADER_TURN * abs(turn)  # the inner foot may turn half as far, and does
        # Steps that are long and wide at once take more of the hip than each alone.
        effort = (dx / (s * r.max_length)) ** 2 + (2.0 * dy / max(wider, 1e-6)) ** 2
        if effort > 1.0 or outer > TURN_REACH * r.max_yaw:
            return False
        for side in SIDES:
            stance = Footstep(other(side), 0.0, 0.0)
            move = _opened(side, (dx, dy, turn))
            (step,) = steps_along(stance.middle(spacing), 0.0, spacing, side, [move], close=False)
            forward, left, _, _ = step.seen_from(stance)
            far = abs(forward) > s * r.max_length or not r.min_spacing <= abs(left) <= r.max_spacing
            if far or r.overlap(stance, step):
                return False
        return True


def _opened(side: str, move: Move) -> Move:
    """Return the motion of the middle in the step of a side, for a mean motion in a step."""
    ahead, left, turn = move
    share = LEADER_TURN if opens(side, turn) else 2.0 - LEADER_TURN
    return ahead, 2.0 * left if opens(side, left) else 0.0, share * turn


def _steps(start: FootstepPlan, side: str, move: Move, count: int = 1) -> tuple[Footstep, ...]:
    """Return steps from the foot that stands, and the one that closes up."""
    stance = start.foot(other(side))
    moves = [_opened(each, move) for each in islice(sides(side), count)]
    return steps_along(stance.middle(start.spacing), stance.z, start.spacing, side, moves)


def _move(velocity: Velocity, gait: StepGait, share: float = 1.0) -> Move:
    """Return the motion of the middle in a step with a ratio of a velocity."""
    forward, left, turn = velocity
    time = share * gait.cycle
    return time * forward, time * left, time * turn
