"""Sources of footsteps: a plan, or a planner of one's own; `wbc.walking.lipm.steered_steps` has that of velocities.

A source is asked again while the robot walks, and answers with the steps from where the feet stand then. An answer
without steps is a stand. Sources are exchanged at any time; the step that has begun is finished.
"""

from __future__ import annotations

import logging
import math
from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence
from dataclasses import replace
from typing import Annotated, NamedTuple

from wbc.base.errors import InputError, WbcError, shown
from wbc.base.numbers import finite_array, finite_scalar
from wbc.base.settings import NonNegative, Positive, Share, settings
from wbc.core.robot import SIDES
from wbc.walking.plans.check import Extent, check_extent, check_plan
from wbc.walking.plans.footsteps import CLOSED, Footstep, FootstepPlan, other
from wbc.walking.plans.reach import Reach

logger = logging.getLogger(__name__)

REPLAN = 0.1
"""Time between questions to a planner on both feet, s."""

Velocity = tuple[float, float, float]
"""Forward (m/s), left (m/s) and turn (rad/s) of the robot's middle."""

AT_REST: Velocity = (0.0, 0.0, 0.0)

AHEAD = 64
"""Greatest number of steps that a walk plans with: it is asked again at each landing, and later steps do not change its
motion now (`wbc.walking.lipm.preview.FELT` is the time of 34 steps of the quickest gait)."""

BESIDE, MORE = 0.25, 6
"""Distance of a foot from its last place in a plan, over the longest step, from which a robot that was pushed takes a
further step; greatest number of these."""


class PlannerError(WbcError):
    """A planner that fails, or whose footsteps are refused."""


class VelocityLimits(NamedTuple):
    """Largest velocities that the walk accepts without limiting them."""

    forward: float  # m/s
    back: float  # m/s
    aside: float  # m/s
    turn: float  # rad/s


@settings
class DriveSettings:
    """Settings of a robot that is steered.

    Attributes:
        acceleration: Greatest change of the granted velocity: forward, left (m/s²) and turn (rad/s²).
        fastest: Greatest velocity granted: forward, left or right (m/s) and turn (rad/s). The defaults are for the
            built-in robots.
        fastest_back: Greatest velocity granted backwards, m/s.
        reach: Ratio of the legs' reach forward and to the side that steps may use; the rest is for step adjustment.
        stretch: Share of their length to which the legs are stretched in a driven walk. It counts only for robots
            whose legs are straighter than 0.95 in half-sitting (`g1`), because straight legs take no long steps. A
            given CoM height takes precedence.
    """

    acceleration: Annotated[tuple[Positive, Positive, Positive], "m/s², m/s², rad/s²"] = (0.25, 0.25, 1.0)
    fastest: Annotated[tuple[NonNegative, NonNegative, NonNegative], "m/s, m/s, rad/s"] = (0.3, 0.2, 0.5)
    fastest_back: Annotated[NonNegative, "m/s"] = 0.3
    reach: Share = 0.75
    stretch: Share = 0.92

    @property
    def limits(self) -> VelocityLimits:
        """Largest velocities that the walk accepts without limiting them."""
        (forward, aside, turn), back = self.fastest, self.fastest_back
        return VelocityLimits(forward, back, aside, turn)


class Standing(NamedTuple):
    """Feet from which a source plans.

    Attributes:
        start: Feet on the ground, the one in the air where it will land, and the gait; without steps.
        first: Side that steps next; None for either.
        begun: Number of steps begun so far.
        swings: True while a foot is in the air.
        time: Time since the start of the walk, s.
        reach: Reach of the legs; None where it is unknown, and steps are taken as they are.
    """

    start: FootstepPlan
    first: str | None
    begun: int
    swings: bool
    time: float
    reach: Reach | None = None


class FootstepSource(ABC):
    """Planner of footsteps that is asked while the robot walks; one of your own writes `footsteps`.

    Attributes:
        order: What the user asks of the planner; where it changes, steps are asked for anew while a foot is in the air,
            too.
        granted: Velocity of the present plan; None for the mean of its next two steps.
        pace: Speed of the gait (`SPEEDS`), m/s.
        to_check: Number of steps of the next answer that are checked against the reach of the legs and the extent of
            the ground; None for all, 0 for steps that are within reach, which are checked against the extent alone.
    """

    order: Hashable = None
    granted: Velocity | None = None
    pace = 0.0
    to_check: int | None = None

    @abstractmethod
    def footsteps(self, now: Standing) -> FootstepPlan:
        """Return the feet with the steps from now on; without steps the robot stands.

        Args:
            now: Feet, side that steps next, and time.
        """


class PlanSource(FootstepSource):
    """Steps of a footstep plan, one after the other; then a stand.

    The steps stay where they are planned, at the height at which the last landing has found the ground: the estimate of
    the height drifts by millimetres a step. Feet that a push has put elsewhere go back to them: a step that is out of
    reach from there goes as far as it can, and a robot whose feet end beside their places takes further steps.

    An answer has `AHEAD` steps at most, of which the first two are checked from where the feet stand. A walk that takes
    the plan checks all others once (`begin`), because the check of a long plan takes longer than a tick.

    Attributes:
        plan: Plan; a step that a foot takes out of turn becomes a part of it.
    """

    to_check = 2

    def __init__(self, plan: FootstepPlan) -> None:
        """Begin with the first step of a plan; its feet at the start are not looked at."""
        self.plan = self._given = plan
        self._climbs = plan.climbs
        self._gait = plan.gait.full.for_stairs() if self._climbs else plan.gait.full
        self._begun: int | None = None  # steps before the first one of the plan
        self._refusal: InputError | None = None

    def begin(self, reach: Reach | None, extent: Extent | None) -> None:
        """Begin anew, and check all steps but the first two, which feet of the start take.

        The next answer refuses a plan that fails.
        """
        self.plan, self._begun, self._refusal = self._given, None, None
        try:
            check_plan(self.plan, reach, extent, first=2)
        except InputError as error:
            self._refusal = error

    def footsteps(self, now: Standing) -> FootstepPlan:
        """See `FootstepSource`."""
        if self._refusal is not None:
            raise self._refusal
        start = replace(now.start, gait=self._gait)
        sets_off = self._begun is None
        self._begun = now.begun if self._begun is None else self._begun
        done = now.begun - self._begun
        self._keep_turn(start, done, now.first)
        steps: Sequence[Footstep] = self.plan.steps[done : done + AHEAD]
        if 0 < done <= len(self.plan):
            last = self.plan.steps[done - 1]
            rise = start.foot(last.side).z - last.z
            steps = [replace(step, z=step.z + rise) for step in steps]
        if (reach := now.reach) is not None and self.plan.steps and not self._climbs:
            steps = self._reached(start, steps, done, reach) if steps else self._further(now, done, reach)
        if sets_off and reach is not None:  # later, the same effort is enough from places beside these
            check_plan(replace(start, steps=tuple(steps[:2])), reach)
        return replace(start, steps=tuple(steps))

    def _keep_turn(self, start: FootstepPlan, done: int, first: str | None) -> None:
        """Put a step before those to come if the other foot steps `first`, as after a push that made a foot step."""
        steps = self.plan.steps
        if first is not None and done < len(steps) and steps[done].side != first:
            more = close_up(start, first).steps or (start.foot(first),)
            self.plan = replace(self.plan, steps=(*steps[:done], *more, *steps[done:]))

    def _reached(
        self, start: FootstepPlan, steps: Sequence[Footstep], done: int, reach: Reach
    ) -> Sequence[Footstep]:
        """Return steps that feet reach which stand elsewhere than planned, of a plan of which some are done.

        Steps that are fixed, or that are out of reach from where they are planned, stay.
        """
        found, stance = list(steps), start.foot(other(steps[0].side))
        for i, step in enumerate(steps):
            near = reach.nearest(stance, step)
            meant = self.plan.stance(done + i)
            if near is step or step.fixed or reach.nearest(meant, step) is not step:
                break
            found[i] = stance = near
        return found

    def _further(self, now: Standing, done: int, reach: Reach) -> Sequence[Footstep]:
        """Return one more step after the last one, if a foot stands too far beside its last place."""
        feet, goals, off = now.start, self.plan.end, {}
        for side in SIDES:
            foot, goal = feet.foot(side), goals.foot(side)
            off[side] = math.dist((foot.x, foot.y), (goal.x, goal.y))
        if max(off.values()) < BESIDE * reach.max_length or done - len(self.plan) >= MORE:
            return ()
        side = now.first or max(off, key=off.__getitem__)
        goal = replace(goals.foot(side), z=feet.foot(side).z)
        return (reach.nearest(feet.foot(other(side)), goal),)


def next_steps(planner: FootstepSource, now: Standing, extent: Extent | None = None) -> FootstepPlan:
    """Return what a planner answers, `AHEAD` steps at most.

    An `InputError` for a plan with a side out of turn, a step out of reach of the feet, or one that leaves the ground,
    and for a velocity or a pace of the planner that is not of finite numbers: ticks to come read both.
    """
    to_check, plan = planner.to_check, planner.footsteps(now)
    checked_velocity(planner.granted)
    finite_scalar("pace of a planner (m/s)", planner.pace, low=0.0)
    if not isinstance(plan, FootstepPlan):
        raise InputError(f"a planner of footsteps returns a FootstepPlan, got {shown(plan)}")
    if not plan.steps:
        return plan
    if len(plan) > AHEAD:
        plan = replace(plan, steps=plan.steps[:AHEAD])
    if now.first is not None and plan.steps[0].side != now.first:
        raise InputError(
            f"the {now.first} foot steps next, but the first step of the plan is of the {plan.steps[0].side} foot"
        )
    checked = replace(plan, left=now.start.left, right=now.start.right, steps=plan.steps[: to_check or None])
    if to_check != 0:
        check_plan(checked, now.reach, extent, effort=to_check is None)
    elif extent is not None:
        check_extent(checked, now.reach, extent)
    return plan


def answer_of(planner: FootstepSource, now: Standing, extent: Extent | None, dt: float) -> FootstepPlan:
    """Return a planner's steps from where the feet stand, with timings in whole periods of a time, s.

    A `PlannerError`, which is logged, where the planner fails or asks for a step out of reach. The planner sees the
    feet level.
    """
    left, right = (replace(foot, pitch=0.0, roll=0.0) for foot in (now.start.left, now.start.right))
    try:
        plan = next_steps(planner, now._replace(start=replace(now.start, left=left, right=right)), extent)
        return replace(plan, gait=plan.gait.full.on_grid(dt)[0])
    except Exception as error:  # of a planner of the user's own, too
        ours = isinstance(error, InputError)
        reason = str(error) if ours else f"{type(error).__name__}: {error}"
        trace = None if ours else error
        logger.warning("footsteps refused (%s); the robot comes to a stand", reason, exc_info=trace)
        raise PlannerError(reason) from error


def close_up(start: FootstepPlan, side: str) -> FootstepPlan:
    """Return the feet with one step that brings that foot beside the other; without steps if it stands there."""
    stance, spacing = start.foot(other(side)), start.spacing
    x, y, _ = stance.beside(spacing if side == "left" else -spacing)
    beside = replace(stance, side=side, x=x, y=y)
    forward, left, up, turn = start.foot(side).seen_from(beside)
    stands = math.hypot(forward, left) < CLOSED[0] and abs(up) < CLOSED[0] and abs(turn) < CLOSED[1]
    return replace(start, steps=() if stands else (beside,))


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
