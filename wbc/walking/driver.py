"""Driver of a walk: asks a source for footsteps as the robot goes, and hands them to the walk.

    source  →  steps from where the feet stand  →  check  →  walk

On both feet the steps are planned anew every tenth of a second; with a foot in the air only when the source or its
command has changed, and not while the last foot is about to land. A source that fails, or asks for a step that the
robot cannot take, is dropped: the robot comes to a stand, and the reason is logged.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

from wbc.core.errors import InputError, shown
from wbc.core.robot import Robot
from wbc.walking.planning.footsteps import FootstepPlan
from wbc.walking.planning.gait import reaction
from wbc.walking.planning.phases import Phase
from wbc.walking.planning.reach import check_plan
from wbc.walking.planning.sources import (
    AT_REST,
    DriveSettings,
    FootstepSource,
    GoalSource,
    PlanSource,
    Standing,
    Velocity,
    VelocitySource,
    checked_velocity,
    close_up,
)
from wbc.walking.walk import Walk

logger = logging.getLogger(__name__)

Extent = tuple[float, float, float, float]
"""Least and greatest x, least and greatest y of the ground, m."""


class Driver:
    """Driver of one walk.

    Attributes:
        settings: Settings.
        source: Source of the footsteps; None for the plan that the walk began with.
        reason: Reason for which the last source was dropped; empty if none was.
        steered: True if footsteps come, or may come, from a source; False for a walk along its first plan.
    """

    def __init__(
        self,
        walk: Walk,
        robot: Robot,
        settings: DriveSettings | None = None,
        extent: Extent | None = None,
    ) -> None:
        """Leave the walk to its plan.

        Args:
            walk: The walk.
            robot: Its robot, for the soles.
            settings: Settings; the defaults when None.
            extent: The ground; endless when None.
        """
        self.settings = settings or DriveSettings()
        self.source: FootstepSource | None = None
        self.reason = ""
        self._walk, self._robot, self._extent = walk, robot, extent
        plan = walk.phases.plan
        self._gait = replace(plan.gait, feet_spacing=plan.spacing)
        self._pace = 0.0  # of the last plan, m/s
        self._next = 0.0  # time of the next plan, s
        self._planned: tuple[FootstepSource | None, Velocity] = (None, AT_REST)
        self._landed = False
        self.steered = not len(plan)  # a plan from the start is walked as it is

    @property
    def pending(self) -> bool:
        """True from the choice of a source until it is asked for footsteps."""
        return self.source is not None and self._planned[0] is not self.source

    def velocity_source(self) -> VelocitySource:
        """Return a source of velocities that goes on from the velocity granted now."""
        source = VelocitySource(self._walk.reach, self._walk.sole_sizes, self.settings, self.granted)
        source.pace = 0.0 if self._walk.finished else self._pace
        return source

    @property
    def granted(self) -> Velocity:
        """Velocity of the present plan: forward (m/s), left (m/s) and turn (rad/s)."""
        source = self.source
        if isinstance(source, (VelocitySource, GoalSource)):
            return AT_REST if self._walk.finished else source.granted
        return _mean_velocity(self._walk)

    @property
    def velocity(self) -> Velocity | None:
        """Commanded velocity: forward (m/s), left (m/s) and turn (rad/s); None while another source gives the steps.

        A velocity that is not three finite numbers is an `InputError`; None brings the robot to a stand.
        """
        return self.source.target if isinstance(self.source, VelocitySource) else None

    @velocity.setter
    def velocity(self, velocity: Sequence[float] | None) -> None:
        target, source = checked_velocity(velocity), self.source
        if not isinstance(source, VelocitySource):
            source = self.velocity_source()
            self.follow(source)
        source.target = target

    def stop(self) -> None:
        """Come to a stand."""
        if self.source is None:
            self._walk.stop()
        else:
            self.velocity = None

    def follow(self, source: FootstepPlan | FootstepSource) -> None:
        """Take the footsteps from a plan or a source, from the next tick on.

        Raises:
            InputError: Neither a plan nor an object with a method `footsteps`.
        """
        if not callable(getattr(source, "footsteps", None)) and not isinstance(source, FootstepPlan):
            raise InputError(
                f"footsteps come from a FootstepPlan or an object with footsteps(now), got {shown(source)}"
            )
        self.source = PlanSource(source) if isinstance(source, FootstepPlan) else source
        self.reason, self.steered = "", True
        self._next = 0.0

    def go_to(self, x: float, y: float, yaw: float) -> None:
        """Walk to a place and stand there.

        Args:
            x: Place of the middle between the feet in the world, m.
            y: The same, m.
            yaw: Heading there, rad.

        Raises:
            InputError: A place beyond the ground.
        """
        if self._extent is not None:
            low_x, high_x, low_y, high_y = self._extent
            if not (low_x <= x <= high_x and low_y <= y <= high_y):
                raise InputError(
                    f"the ground extends over x from {low_x:g} to {high_x:g} and y from {low_y:g} to {high_y:g} m, "
                    f"got the goal ({x:g}, {y:g})"
                )
        self.follow(GoalSource((x, y, yaw), self.velocity_source()))

    def update(self, time: float) -> None:
        """Plan the footsteps anew if it is time to.

        Args:
            time: Time since the start of the walk, s.
        """
        source, phases = self.source, self._walk.phases
        if source is None:
            return
        swings = phases.phase is Phase.SINGLE
        if swings:
            command = (source, _target(source))
            if command == self._planned or time < self._next or self._comes_to_rest:
                self._landed = True
                return
        elif time < self._next and not self._landed:
            return
        self._landed = False
        self._next = time + self.settings.replan
        self._planned = (source, _target(source))
        now = Standing.of(phases, self._gait, time)
        try:
            plan = source.footsteps(now)
            self._check(plan, now)
            self._steer(plan)
            self._pace = source.pace if isinstance(source, (VelocitySource, GoalSource)) else 0.0
        except Exception as error:  # of a source of the user's own, too: the robot comes to a stand
            self._drop(error, now)

    @property
    def _comes_to_rest(self) -> bool:
        """True in the last moments of the last step: no ZMP takes the DCM from its rest to another step that soon."""
        phases = self._walk.phases
        last = phases.step + 1 >= len(phases.plan)
        return last and phases.duration - phases.elapsed < self.settings.replan

    def _check(self, plan: FootstepPlan, now: Standing) -> None:
        """Check the steps of a plan from where the feet are.

        Raises:
            InputError: A side out of turn, a step out of reach, or one that leaves the ground.
        """
        if not isinstance(plan, FootstepPlan):
            raise InputError(f"a source of footsteps returns a FootstepPlan, got {shown(plan)}")
        if not plan.steps:
            return
        if now.first is not None and plan.steps[0].side != now.first:
            raise InputError(
                f"the {now.first} foot steps next, but the first step of the plan is of the {plan.steps[0].side} foot"
            )
        if isinstance(self.source, (VelocitySource, GoalSource)) and self._extent is None:
            return  # within reach by construction
        checked = replace(plan, left=now.start.left, right=now.start.right)
        reach = self._walk.reach
        if isinstance(self.source, (VelocitySource, GoalSource)):
            reach = replace(reach, max_spacing=reach.widest)
        check_plan(checked, self._robot, reach, self._extent)

    def _steer(self, plan: FootstepPlan) -> None:
        walk = self._walk
        if not plan.steps and walk.phases.step >= len(walk.phases.plan):
            return  # it stands, or comes to rest
        gait = plan.gait
        if plan.steps:
            source = self.source
            walk.reaction = reaction(source.pace) if isinstance(source, (VelocitySource, GoalSource)) else 0.0
        if gait is not walk.phases.plan.gait:
            gait, _ = gait.on_grid(walk.period)
        walk.steer(plan.steps, gait)

    def _drop(self, error: Exception, now: Standing) -> None:
        """Come to a stand for a reason."""
        ours = isinstance(error, InputError)
        self.reason = str(error) if ours else f"{type(error).__name__}: {error}"
        logger.warning(
            "footsteps refused (%s); the robot comes to a stand",
            self.reason,
            exc_info=None if ours else error,
        )
        self.source = stand = self.velocity_source()
        try:
            self._steer(stand.footsteps(now))
        except InputError:
            side = now.first
            self._walk.steer(() if side is None else close_up(now.start, side).steps)


def _target(source: FootstepSource) -> Velocity:
    """Command of a source whose command changes: a velocity."""
    return source.target if isinstance(source, VelocitySource) else AT_REST


def _mean_velocity(walk: Walk) -> Velocity:
    """Mean velocity over the next two steps of a plan, seen from the foot that stands."""
    phases = walk.phases
    plan, step = phases.plan, phases.step
    if step + 2 > len(plan):
        return AT_REST
    forward, left, _, turn = plan.steps[step + 1].seen_from(plan.stance(step))
    two = 2.0 * (plan.gait.single_support + plan.gait.double_support)
    return forward / two, left / two, turn / two
