"""The LIPM walk as a source of references: along a plan of footsteps, or steered.

    planner  →  steps from where the feet stand  →  check  →  walk  →  references

On both feet the steps are planned anew every tenth of a second; with a foot in the air only when the planner or its
command has changed, and not while the last foot is about to land. A planner that fails, or asks for a step that the
robot cannot take, is dropped: the robot comes to a stand, and the reason is logged.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.core.drive.control import State
from wbc.core.robot import Robot
from wbc.walking.contact import GaitPhase
from wbc.walking.lipm.walk import Walk
from wbc.walking.plans.footsteps import FootstepPlan, check_start
from wbc.walking.plans.reach import Extent, Reach, bent_height
from wbc.walking.plans.sources import (
    AT_REST,
    FootstepSource,
    Standing,
    Velocity,
    close_up,
    dropped,
    next_steps,
)
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.source import Progress, Reference, ReferenceSource
from wbc.walking.steering import PLANNED_NEAR, SteeredSteps, Steering

REPLAN = 0.1
"""Time between plans of the footsteps on both feet, s."""


class LipmWalk(ReferenceSource):
    """LIPM walk along a plan of footsteps, or steered by velocities, goals, plans and planners.

    Attributes:
        walk: Phases, pattern and swing.
        settings: Settings of a walk that is steered.
        planner: Planner of the footsteps; None for the plan that the walk began with.
        com_height: Height of the CoM over the support while walking, m.
        reason: Reason for which the last planner was dropped; empty if none was.
    """

    com_height: float
    steering: Steering

    def __init__(
        self,
        robot: Robot,
        plan: FootstepPlan,
        dt: float,
        settings: WalkingControlSettings,
        extent: Extent | None = None,
    ) -> None:
        """Walk along a plan from the first tick, without steps stand; endless ground when `extent` is None.

        Raises `InputError` for a plan that cannot be walked or begins elsewhere.
        """
        check_start(robot, plan)
        s = settings
        ground = 0.5 * (plan.left.z + plan.right.z)
        height = float(robot.com[2]) - ground if s.com_height is None else s.com_height
        reach = None
        if not len(plan):
            if s.com_height is None:
                height = min(height, bent_height(robot, s.drive.stretch))
            # Bent knees reach further ahead; to the side ankles must roll by what the robot sways.
            reach = replace(Reach.of(robot, height), max_spacing=Reach.of(robot).max_spacing)
        self.walk = walk = Walk(
            robot, plan, height, dt, s.walk, reach=reach, extent=extent, com=np.array(robot.com)
        )
        self.settings, self.com_height, self.ground = s.drive, height, walk.ground
        self.steering = Steering(s.drive.limits, PLANNED_NEAR)
        self._robot, self._extent, self._walk_settings = robot, extent, s.walk
        self._soles = [robot.placement(sole.frame) for sole in robot.soles]
        self._gait, _ = replace(plan.gait, feet_spacing=plan.spacing).on_grid(dt)
        self.swing_height = walk.plan.gait.full.swing_height
        self._pace = 0.0  # of the last plan, m/s
        self._next = 0.0  # time of the next plan, s
        self._planned: tuple[FootstepSource | None, object] = (None, None)
        self._landed = False
        self._steered = not len(plan)  # a plan from the start is walked as it is

    def begin(self, heading: float) -> None:
        """Stand where the robot stands now, with the heading of its feet; steps and orders before are forgotten."""
        del heading
        robot, before = self._robot, self.walk
        plan, com = FootstepPlan.standing(robot, self._gait), np.array(robot.com)
        self.walk = walk = Walk(
            robot, plan, self.com_height, before.period, self._walk_settings, reach=before.reach, com=com
        )
        walk.ground.sight = before.ground.sight
        self.ground, self.planner, self._planned, self._steered = walk.ground, None, (None, None), True
        self.steering.command(None)
        self.reason, self._pace, self._next = "", 0.0, 0.0

    def update(self, state: State) -> Reference:
        """Plan the footsteps anew if it is time to, and return the references of the walk."""
        self.plan_steps(state.time)
        # Filtered loads: a foot that has just met the ground presses in jerks.
        return self.walk.update(state.load.tolist(), self._soles, state.dcm, state.turned)

    def progress(self, last: Reference | None) -> Progress:
        """Return the present phase and the number of steps."""
        gait = self.walk.plan.gait.full
        return self.walk.progress(
            self.walk.plan.steps[self.walk.step :], gait.single_support + gait.double_support
        )

    @property
    def finished(self) -> bool:
        """True when the plan, or what a planner has asked for, is walked and the robot stands."""
        planner = self.planner
        pending = planner is not None and self._planned != (planner, planner.order)
        return self.walk.finished and not pending

    @property
    def steered(self) -> bool:
        """True if footsteps come, or may come, from a planner; False for a walk along its first plan."""
        return self._steered

    def _steered_steps(self) -> SteeredSteps:
        """Return a planner that is steered, and goes on from the velocity granted now."""
        walk, pace = self.walk, 0.0 if self.walk.finished else self._pace
        return SteeredSteps(walk.reach, walk.sole_sizes, self.settings, self.steering, self.granted, pace)

    @property
    def granted(self) -> Velocity:
        """Velocity of the present plan: forward (m/s), left (m/s) and turn (rad/s)."""
        granted = None if self.planner is None else self.planner.granted
        if granted is None:
            return _mean_velocity(self.walk)
        return AT_REST if self.walk.finished else granted

    def stop(self) -> None:
        """Come to a stand."""
        if self.planner is None:
            self.walk.stop()
        else:
            self.velocity = None

    def take(self, planner: FootstepSource | None) -> None:
        """Take footsteps from a planner, from the next tick on; None for those of the steering."""
        before = self.planner
        if planner is None:
            goes_on = isinstance(before, SteeredSteps) and self.steering.goal is None
            planner = before if goes_on else self._steered_steps()
        super().take(planner)
        self._steered = True
        if planner is not before:
            self._next, self.walk.drift_correction = 0.0, pin.SE3.Identity()

    def go_to(self, x: float, y: float, yaw: float) -> None:
        """Walk to a place (m) and heading (rad) of the middle between the feet, and stand there."""
        if self._extent is not None:
            low_x, high_x, low_y, high_y = self._extent
            if not (low_x <= x <= high_x and low_y <= y <= high_y):
                raise InputError(
                    f"the ground extends over x from {low_x:g} to {high_x:g} and y from {low_y:g} to {high_y:g} m, "
                    f"got the goal ({x:g}, {y:g})"
                )
        super().go_to(x, y, yaw)

    def plan_steps(self, time: float) -> None:
        """Plan the footsteps anew if it is time to, by the time since the start of the walk, s."""
        planner, walk = self.planner, self.walk
        if planner is None:
            return
        swings = walk.phase is GaitPhase.SINGLE
        if swings:
            if (planner, planner.order) == self._planned or time < self._next or self._comes_to_rest:
                self._landed = True
                return
        elif time < self._next and not self._landed:
            return
        self._landed = False
        self._next = time + REPLAN
        self._planned = planner, planner.order
        now = walk.standing(self._gait, time)
        try:
            plan = next_steps(planner, self._unturned(now), self._robot, walk.reach, self._extent)
            self._steer(plan.moved(walk.drift_correction) if self._turns else plan)
            self._pace, self._planned = planner.pace, (planner, planner.order)
        except Exception as error:  # of a planner of the user's own, too: the robot comes to a stand
            self._drop(error, now)

    @property
    def _turns(self) -> bool:
        """True if soles have turned on the ground since the planner was taken."""
        return not self.walk.drift_correction.isIdentity(0.0)

    def _unturned(self, now: Standing) -> Standing:
        """Return the feet in the world that the planner was taken in."""
        return (
            now._replace(start=now.start.moved(self.walk.drift_correction.inverse())) if self._turns else now
        )

    @property
    def _comes_to_rest(self) -> bool:
        """True in the last moments of the last step: no ZMP takes the DCM from its rest to another step that soon."""
        walk = self.walk
        return walk.step + 1 >= len(walk.plan) and walk.duration - walk.elapsed < REPLAN

    def _steer(self, plan: FootstepPlan) -> None:
        walk = self.walk
        if not plan.steps and walk.step >= len(walk.plan):
            return  # it stands, or comes to rest
        gait = plan.gait.full
        if gait is not walk.plan.gait:
            gait, _ = gait.on_grid(walk.period)
        walk.steer(plan.steps, gait)

    def _drop(self, error: Exception, now: Standing) -> None:
        """Come to a stand for a reason."""
        self.reason = dropped(error)
        self.steering.command(None)
        self.planner = stand = self._steered_steps()
        try:
            self._steer(stand.footsteps(now))
        except InputError:
            side = now.first
            self.walk.steer(() if side is None else close_up(now.start, side).steps)


def _mean_velocity(walk: Walk) -> Velocity:
    """Mean velocity over the next two steps of a plan, seen from the foot that stands."""
    plan, step = walk.plan, walk.step
    if step + 2 > len(plan):
        return AT_REST
    forward, left, _, turn = plan.steps[step + 1].seen_from(plan.stance(step))
    gait = plan.gait.full
    two = 2.0 * (gait.single_support + gait.double_support)
    return forward / two, left / two, turn / two
