"""Sources of footsteps for a robot that is steered: a velocity, a goal, a plan, or a planner of one's own.

A source is asked again while the robot walks, and answers with the steps from where the feet stand then. An answer
without steps is a stand. Sources are exchanged at any time; the step that has begun is finished.
"""

from __future__ import annotations

import logging
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, NamedTuple

from wbc.base.errors import InputError, shown
from wbc.base.numbers import finite_array, finite_scalar
from wbc.base.settings import NonNegative, Positive, Share, settings
from wbc.core.robot import SIDES, Robot
from wbc.walking.plans.footsteps import (
    CLOSED,
    Footstep,
    FootstepPlan,
    SoleSizes,
    closing_step,
    mean_heading,
    other,
)
from wbc.walking.plans.gait import Gait, pace
from wbc.walking.plans.planners import Place, moved, opens, steps_along
from wbc.walking.plans.reach import Extent, Reach, check_plan, soles_overlap

logger = logging.getLogger(__name__)

Velocity = tuple[float, float, float]
"""Forward (m/s), left (m/s) and turn (rad/s) of the robot's middle."""

AT_REST: Velocity = (0.0, 0.0, 0.0)

LEADER_TURN = 4.0 / 3.0
"""Turn of the outer foot over that of the step; the inner one takes 2/3 and turns inwards."""

TURN_REACH = 0.9
"""Ratio of the greatest turn of a foot that steps may use."""

TRIES = 2
"""Landings beside a goal after which a robot stands as near to it as its landings are to their plans."""

BESIDE, MORE = 0.25, 6
"""Distance of a foot from its last place in a plan, over the longest step, from which a robot that was pushed takes a
further step; greatest number of these."""

AHEAD, STOPPING = 4, 0.1
"""Steps that are planned ahead, before the one that closes up; length of a step above which a robot that is to stop
takes a shorter one before it closes up, m: no step of a robot of half a metre is as long."""

NEAR, FAR = (0.02, 0.05), 0.6
"""Distance and turn to a goal below which it is reached, m and rad: of the place, at any size; distance above which the
robot walks towards it face first, m."""


@settings
class DriveSettings:
    """Settings of a robot that is steered.

    Attributes:
        acceleration: Greatest change of the granted velocity: forward, left (m/s²) and turn (rad/s²).
        fastest: Greatest velocity granted: forward, left or right (m/s) and turn (rad/s). The defaults are for the
            built-in robots.
        fastest_back: Greatest velocity granted backwards, m/s.
        reach: Ratio of the legs' reach forward and to the side that steps may use; the rest is for step adjustment.
        stretch: Ratio of their length to which the legs stretch of a robot that is driven and whose legs are
            straighter than 0.95 in half-sitting (`g1`): straight legs take no long steps. A given CoM height comes
            first.
    """

    acceleration: Annotated[tuple[Positive, Positive, Positive], "m/s², m/s², rad/s²"] = (0.25, 0.25, 1.0)
    fastest: Annotated[tuple[NonNegative, NonNegative, NonNegative], "m/s, m/s, rad/s"] = (0.3, 0.2, 0.5)
    fastest_back: Annotated[NonNegative, "m/s"] = 0.3
    reach: Share = 0.75
    stretch: Share = 0.92


class Standing(NamedTuple):
    """Feet from which a source plans.

    Attributes:
        start: Feet on the ground, the one in the air where it will land, and the gait; without steps.
        first: Side that steps next; None for either.
        begun: Number of steps begun so far.
        swings: True while a foot is in the air.
        time: Time since the start of the walk, s.
    """

    start: FootstepPlan
    first: str | None
    begun: int
    swings: bool
    time: float


class FootstepSource(ABC):
    """Planner of footsteps that is asked while the robot walks; one of your own writes `footsteps`.

    Attributes:
        target: Commanded velocity; None for a planner that takes none.
        granted: Velocity of the present plan; None for the mean of its next two steps.
        pace: Speed of the gait (`SPEEDS`), m/s.
        within_reach: True if the steps are within reach by construction, also quick ones, which reach further.
    """

    target: Velocity | None = None
    granted: Velocity | None = None
    pace = 0.0
    within_reach = False

    @abstractmethod
    def footsteps(self, now: Standing) -> FootstepPlan:
        """Return the feet with the steps from now on; without steps the robot stands.

        Args:
            now: Feet, side that steps next, and time.
        """


class VelocitySource(FootstepSource):
    """Footsteps of a commanded velocity.

    Sideways the foot on the side of the motion opens by two steps' worth and the other one closes; in turns the outer
    foot takes the greater part.

    Attributes:
        target: Commanded velocity.
        granted: Velocity of the present plan: the commanded one, limited in change, by the settings and by the reach of
            the legs.
        pace: Speed of the gait (`SPEEDS`), m/s: that of the velocity.
    """

    target: Velocity
    granted: Velocity
    within_reach = True

    def __init__(
        self,
        reach: Reach,
        sizes: SoleSizes,
        settings: DriveSettings | None = None,
        granted: tuple[float, float, float] = AT_REST,
    ) -> None:
        """Stand; soles are (length, width) of left and right, m, and `granted` is the velocity of the robot now."""
        self.settings = settings or DriveSettings()
        self.target, self.granted = AT_REST, granted
        self._wish: Velocity = granted  # before the limits of the reach
        self.pace = 0.0
        self._asked: tuple[Velocity, float, Gait] | None = None  # last asked of the reach
        self._share = 1.0  # of that velocity within reach
        self._reach, self._sizes = reach, dict(zip(SIDES, sizes, strict=True))
        self._time: float | None = None
        self._stop: int | None = None  # steps begun when the stop was commanded

    def footsteps(self, now: Standing) -> FootstepPlan:
        """See `FootstepSource`."""
        past, self._time = self._time, now.time
        if self.target == AT_REST:
            return self._stopping(now)
        self._stop = None
        self._ramp(0.0 if past is None else now.time - past)
        side = now.first or self.leader()
        asked = self._wish, now.start.spacing, now.start.gait
        if asked != self._asked:  # a constant velocity keeps its ratio within reach
            self._asked, (self.pace, self._share) = asked, self._fit(*asked)
        gait = Gait.at_speed(self.pace, now.start.gait)
        cycle = gait.single_support + gait.double_support
        self.granted = _scaled(self._wish, self._share)
        dx, dy, turn = (cycle * part for part in self.granted)
        moves = [(dx, dy, turn)] * AHEAD
        return replace(now.start, gait=gait, steps=_steps(now.start, side, moves))

    def leader(self) -> str:
        """Return the side of the motion, which steps first."""
        _, left, turn = self.target
        return "right" if (left or turn) < 0.0 else "left"

    def _ramp(self, time: float) -> None:
        """Let the velocity wished for follow the commanded one for a time (s)."""
        s = self.settings
        fastest = (s.fastest[0] if self.target[0] > 0.0 else s.fastest_back, *s.fastest[1:])
        parts = []
        for now, target, most, rate in zip(self._wish, self.target, fastest, s.acceleration, strict=True):
            # A robot that stands sets off with what it reaches in half a second.
            step = rate * (0.5 if self.granted == AT_REST else time)
            change = max(-most, min(most, target)) - now
            parts.append(now + max(-step, min(step, change)))
        self._wish = (parts[0], parts[1], parts[2])

    def _stopping(self, now: Standing) -> FootstepPlan:
        """Come to a stand: a shorter step where the last one was long, then the foot that closes up."""
        if self._stop is None:
            self._stop = now.begun - now.swings  # the step that has begun is the first of two
        gait = Gait.at_speed(self.pace, now.start.gait)
        start = replace(now.start, gait=gait)
        cycle = gait.single_support + gait.double_support
        left = 2 - (now.begun - self._stop)
        dx, dy, turn = (0.5 * cycle * part for part in self.granted)
        if now.first is None:
            self.granted, self._wish, self.pace = AT_REST, AT_REST, 0.0
            return start
        if left < 2 or math.hypot(2.0 * dx, 2.0 * dy) < STOPPING:
            self.granted, self._wish, self.pace = AT_REST, AT_REST, 0.0
            return close_up(start, now.first)
        return replace(start, steps=_steps(start, now.first, [(dx, dy, turn)]))

    def _fit(self, velocity: Velocity, spacing: float, gait: Gait) -> tuple[float, float]:
        """Return the speed of the gait for a velocity, and the greatest ratio of the velocity within reach."""
        speed = pace(velocity)
        if self._within(velocity, speed, spacing, gait, 1.0):
            return speed, 1.0
        low, high = 0.0, 1.0
        for _ in range(8):
            middle = 0.5 * (low + high)
            if self._within(velocity, speed, spacing, gait, middle):
                low = middle
            else:
                high = middle
        return speed, low

    def _within(self, velocity: Velocity, speed: float, spacing: float, gait: Gait, share: float) -> bool:
        """True if both feet's steps with the ratio `share` of a velocity are within reach, and no soles overlap."""
        r, s = self._reach, self.settings.reach
        gait = Gait.at_speed(speed, gait)
        cycle = gait.single_support + gait.double_support
        dx, dy, turn = (share * cycle * part for part in velocity)
        wider = s * (r.max_spacing - spacing)
        outer, inner = (abs(turn) * part for part in (LEADER_TURN, 2.0 - LEADER_TURN))
        # Steps that are long and wide at once take more of the hip than each alone.
        effort = (dx / (s * r.max_length)) ** 2 + (2.0 * dy / max(wider, 1e-6)) ** 2
        if effort > 1.0 or outer > TURN_REACH * r.max_yaw or inner > 0.5 * TURN_REACH * r.max_yaw:
            return False
        for side in SIDES:
            stance = Footstep(other(side), 0.0, 0.0)
            (step,) = steps_along(
                _middle(stance, spacing), 0.0, spacing, side, [(dx, dy, turn)], _shares, close=False
            )
            forward, left, _, _ = step.seen_from(stance)
            far = abs(forward) > s * r.max_length or not r.min_spacing <= abs(left) <= r.max_spacing
            if far or soles_overlap(stance, step, self._sizes):
                return False
        return True


class GoalSource(FootstepSource):
    """Footsteps to a place: face first from afar, the last steps with the heading of the goal.

    Attributes:
        goal: Place of the robot's middle and heading: x, y (m) and yaw (rad).
        reached: True when the robot stands there.
    """

    within_reach = True

    def __init__(self, goal: tuple[float, float, float], drive: VelocitySource) -> None:
        """Go to a goal, x, y (m) and yaw (rad) in the world, by a source that turns velocities into steps."""
        x, y, yaw = finite_array("goal (m, m, rad)", goal, (3,)).tolist()
        self.goal = (x, y, yaw)
        self.reached = False
        self._drive, self.granted, self.pace = drive, drive.granted, drive.pace
        self._stops = False  # the goal has been reached by feet that stride
        self._aim: tuple[int, Footstep] | None = None  # number and place of the step that was planned last
        self._missed = dict.fromkeys(SIDES, 0.0)  # distance of a foot from where it was to land, m
        self._beside, self._tries = False, 0  # no further from the goal than that; landings there

    def footsteps(self, now: Standing) -> FootstepPlan:
        """See `FootstepSource`."""
        if self.reached:
            return now.start
        drive = self._drive
        if self._aim is not None and now.begun - now.swings > self._aim[0]:
            aim = self._aim[1]
            landed = now.start.left if aim.side == "left" else now.start.right
            self._missed[aim.side] = math.hypot(landed.x - aim.x, landed.y - aim.y)
            self._tries += self._beside
        drive.target = self._velocity(now)
        if drive.target == AT_REST:
            self.reached = now.first is None
        plan = drive.footsteps(now)
        self._aim = (now.begun, plan.steps[0]) if plan.steps else None
        self.granted, self.pace = drive.granted, drive.pace
        return plan

    def _velocity(self, now: Standing) -> Velocity:
        """Velocity towards the goal, at most what the next two steps need."""
        s, start = self._drive.settings, now.start
        x, y, yaw = self.goal
        px, py = 0.5 * (start.left.x + start.right.x), 0.5 * (start.left.y + start.right.y)
        heading = mean_heading(start.left.yaw, start.right.yaw)
        if now.first is not None:  # feet that stride: the middle is beside the foot that stands
            stance = start.right if now.first == "left" else start.left
            px, py, heading = _middle(stance, start.spacing)
        away = math.hypot(x - px, y - py)
        turn = math.remainder(yaw - heading, math.tau)
        # Feet that close up may stay where they are by as much as `CLOSED`: a stand is no worse for that.
        more = CLOSED if self._stops and now.first is None else (0.0, 0.0)
        near, missed = NEAR[0] + more[0], max(self._missed.values())
        self._beside = away < near + missed
        if self._tries >= TRIES:  # a robot whose landings are always put off would march for ever
            near += missed
        self._stops = away < near and abs(turn) < NEAR[1] + more[1]
        if self._stops:
            return AT_REST
        gait = Gait.for_speed(self._drive.granted, start.gait)
        two = 2.0 * (gait.single_support + gait.double_support)
        if away > FAR:
            turn = math.remainder(math.atan2(y - py, x - px) - heading, math.tau)
            slow = max(0.0, 1.0 - abs(turn) / 0.5)
            return slow * min(s.fastest[0], away / two), 0.0, turn / two
        c, sn = math.cos(heading), math.sin(heading)
        dx, dy = c * (x - px) + sn * (y - py), c * (y - py) - sn * (x - px)
        return dx / two, dy / two, turn / two


class PlanSource(FootstepSource):
    """Steps of a footstep plan, one after the other; then a stand.

    The steps stay where they are planned, at the height at which the last landing has found the ground: the estimate of
    the height drifts by millimetres a step. Feet that a push has put elsewhere go back to them: a step that is out of
    reach from there goes as far as it can, and a robot whose feet end beside their places takes further steps.
    """

    def __init__(self, plan: FootstepPlan) -> None:
        """Begin with the first step of a plan; its feet at the start are not looked at."""
        self.plan = plan
        self._gait = plan.gait.full.for_stairs() if plan.climbs else plan.gait.full
        self._begun: int | None = None

    def footsteps(self, now: Standing) -> FootstepPlan:
        """See `FootstepSource`."""
        start = replace(now.start, gait=self._gait)
        if self._begun is None:
            self._begun = now.begun
        done = now.begun - self._begun
        steps = self.plan.steps[done:]
        if (
            now.first is not None and steps and steps[0].side != now.first
        ):  # the other foot had to step out of a push
            closing = close_up(start, now.first).steps or (
                start.left if now.first == "left" else start.right,
            )
            steps = (*closing, *steps)
            self.plan = replace(self.plan, steps=(*self.plan.steps[:done], *steps))
        if 0 < done <= len(self.plan):
            last = self.plan.steps[done - 1]
            rise = (start.left if last.side == "left" else start.right).z - last.z
            steps = tuple(replace(step, z=step.z + rise) for step in steps)
        return replace(start, steps=steps)

    def within_reach_of(
        self, now: Standing, plan: FootstepPlan, reach: Reach, sizes: dict[str, tuple[float, float]]
    ) -> FootstepPlan:
        """Return an answer of `footsteps` with steps that feet reach which stand elsewhere than planned.

        Steps that are fixed, that climb, or that are out of reach from where they are planned stay.
        """
        if self.plan.climbs or not self.plan.steps:
            return plan
        if not plan.steps:
            return self._further(now, plan, reach, sizes)
        first = len(self.plan) - len(plan)
        stance = now.start.right if plan.steps[0].side == "left" else now.start.left
        steps = list(plan.steps)
        for i, step in enumerate(steps):
            near = reach.nearest(stance, step, sizes)
            meant = self.plan.stance(first + i)
            if near is step or step.place == "fixed" or reach.nearest(meant, step, sizes) is not step:
                break
            steps[i] = stance = near
        return replace(plan, steps=tuple(steps))

    def _further(
        self, now: Standing, plan: FootstepPlan, reach: Reach, sizes: dict[str, tuple[float, float]]
    ) -> FootstepPlan:
        """Return a plan without steps with one more, if a foot stands too far beside its last place."""
        assert self._begun is not None
        feet, goals = (dict(zip(SIDES, pair, strict=True)) for pair in (plan.final, self.plan.final))
        off = {
            side: math.dist((feet[side].x, feet[side].y), (goals[side].x, goals[side].y)) for side in SIDES
        }
        more = now.begun - self._begun - len(self.plan)
        if max(off.values()) < BESIDE * reach.max_length or more >= MORE:
            return plan
        side = now.first or max(off, key=off.__getitem__)
        step = reach.nearest(feet[other(side)], replace(goals[side], z=feet[side].z), sizes)
        return replace(plan, steps=(step,))


def planner_of(source: FootstepPlan | FootstepSource) -> FootstepSource:
    """Return the planner of what a walk is to follow."""
    if not isinstance(source, (FootstepPlan, FootstepSource)):
        raise InputError(f"footsteps come from a FootstepPlan or a FootstepSource, got {shown(source)}")
    return PlanSource(source) if isinstance(source, FootstepPlan) else source


def next_steps(
    planner: FootstepSource, now: Standing, robot: Robot, reach: Reach, extent: Extent | None = None
) -> FootstepPlan:
    """Return what a planner answers.

    An `InputError` for a plan with a side out of turn, a step out of reach of the feet, or one that leaves the ground.
    """
    plan = planner.footsteps(now)
    if isinstance(planner, PlanSource):
        sizes = {side: (s.length, s.width) for side, s in zip(SIDES, robot.soles[:2], strict=True)}
        plan = planner.within_reach_of(now, plan, reach, sizes)
    if not isinstance(plan, FootstepPlan):
        raise InputError(f"a planner of footsteps returns a FootstepPlan, got {shown(plan)}")
    if not plan.steps:
        return plan
    if now.first is not None and plan.steps[0].side != now.first:
        raise InputError(
            f"the {now.first} foot steps next, but the first step of the plan is of the {plan.steps[0].side} foot"
        )
    if not planner.within_reach or extent is not None:
        check_plan(replace(plan, left=now.start.left, right=now.start.right), robot, reach, extent)
    return plan


def dropped(error: Exception) -> str:
    """Log, and return, the reason for which a planner is dropped: the robot comes to a stand."""
    ours = isinstance(error, InputError)
    reason = str(error) if ours else f"{type(error).__name__}: {error}"
    logger.warning(
        "footsteps refused (%s); the robot comes to a stand", reason, exc_info=None if ours else error
    )
    return reason


def close_up(start: FootstepPlan, side: str) -> FootstepPlan:
    """Return the feet with one step that brings that foot beside the other; without steps if it stands there."""
    stance, mate = (start.right, start.left) if side == "left" else (start.left, start.right)
    return replace(start, steps=closing_step(stance, mate, start.spacing))


def checked_velocity(velocity: Sequence[float] | None) -> Velocity:
    """Return a commanded velocity: forward, left (m/s) and turn (rad/s), finite, shape (3,); None for a stand."""
    if velocity is None:
        return AT_REST
    x, y, turn = finite_array("velocity (forward m/s, left m/s, turn rad/s)", velocity, (3,)).tolist()
    return (
        finite_scalar("forward velocity (m/s)", x, low=-10.0, high=10.0),
        finite_scalar("velocity to the left (m/s)", y, low=-10.0, high=10.0),
        finite_scalar("turning velocity (rad/s)", turn, low=-10.0, high=10.0),
    )


def _scaled(velocity: Velocity, share: float) -> Velocity:
    forward, left, turn = velocity
    return share * forward, share * left, share * turn


def _shares(side: str, left: float, turn: float) -> tuple[float, float]:
    return 2.0 * opens(side, left), LEADER_TURN if opens(side, turn) else 2.0 - LEADER_TURN


def _steps(
    start: FootstepPlan, side: str, moves: Sequence[tuple[float, float, float]]
) -> tuple[Footstep, ...]:
    """Steps from the foot that stands, and the one that closes up."""
    stance = start.right if side == "left" else start.left
    return steps_along(_middle(stance, start.spacing), stance.z, start.spacing, side, moves, _shares)


def _middle(foot: Footstep, spacing: float) -> Place:
    """Middle (x, y, yaw) between a foot and one that stands beside it."""
    return moved(
        (foot.x, foot.y, foot.yaw), 0.0, -0.5 * spacing if foot.side == "left" else 0.5 * spacing, 0.0
    )
