"""References of a walk, tick by tick: phases, pattern, swing foot and step adjustment put together.

    foot loads, DCM, soles  →  phases  →  (events: swing, landing)  →  pattern  →  references for this tick

A walk knows neither the QP nor the simulator; it hands out targets. Everything that could be wrong with a plan is
refused when the walk is made.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import Share, settings
from wbc.core.robot import GRAVITY, SIDES, Robot
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.contact import Event, GaitPhase
from wbc.walking.ground import LAST_LOOK, NOTICED, GroundEstimate
from wbc.walking.lipm.adjustment import FREEZE, AdjustmentSettings, StepAdjuster
from wbc.walking.lipm.pattern import Pattern
from wbc.walking.lipm.phases import HOLD, PhaseSettings, WalkPhases
from wbc.walking.lipm.preview import PreviewController, PreviewSettings
from wbc.walking.lipm.schedule import ZmpTarget
from wbc.walking.plans.footsteps import Footstep, FootstepPlan, SoleSizes, heading, mean_heading
from wbc.walking.plans.gait import StepGait
from wbc.walking.plans.reach import Reach, check_plan
from wbc.walking.source import Reference
from wbc.walking.swing import FootMotion, SwingFoot

logger = logging.getLogger(__name__)

TOUCH_DOWNS = (Event.EARLY_TOUCH_DOWN, Event.TOUCH_DOWN, Event.LATE_TOUCH_DOWN, Event.NO_TOUCH_DOWN)


CLIMBING_INWARD = 0.01
"""Greatest distance of the planned ZMP to the inner side in a plan with stairs, m: the further inward the ZMP, the more
torque the hips need, and on a stair they have none to spare."""

TURNED, MOST_TURN = 0.02, 0.04
"""Angle by which soles have turned on the ground from which on the landings to come are turned back, and greatest angle
of that in a step, rad."""

REPLAN = 0.1
"""Time between plans of the pattern, s; each event plans it anew as well."""


@settings
class WalkSettings:
    """Settings of a walk.

    Attributes:
        preview: Preview control; the ZMP is planned 20 mm to the inner side of a stance foot, because rough ground tips
            robots outward. It stays one margin within the margin of a sole, that of the preview or of the adjustment,
            whichever is greater: 10 mm to the inner side of `g1`, 18 mm of `hrp4_class`.
        phases: Loads and times at which phases change.
        adjustment: Step adjustment; None for none.
        ground_memory: Share of the unexpected height of a landing by which the next landings are moved.
        rise_memory: Share of that height by which the expected rise from step to step changes. Where the ground keeps
            rising, or the estimate drifts (by a millimetre or two a step), feet would always land too early.
    """

    preview: PreviewSettings = field(default_factory=lambda: PreviewSettings(target=ZmpTarget(inward=0.02)))
    phases: PhaseSettings = field(default_factory=PhaseSettings)
    adjustment: AdjustmentSettings | None = field(default_factory=AdjustmentSettings)
    ground_memory: Share = 0.5
    rise_memory: Share = 0.1


@dataclass(frozen=True, slots=True)
class _PlannedSwing:
    """The plan that a swing is adjusted against."""

    pattern: Pattern
    begin: float  # of the pattern, from lift-off, s
    landing: Footstep
    duration: float  # from lift-off to touch-down, s
    transfer: float  # from touch-down until the new foot has taken over, s
    dcm: Array  # when it has, shape (2,), m


class Walk:
    """A walk of one robot.

    Attributes:
        phases: State machine, with the plan as it is now.
        notes: One message for each timing of the plan that was rounded to the control period.
        period: Control period, s.
        reach: Reach of the robot's legs.
        sole_sizes: (length, width) of the left and of the right sole, m.
        omega: Natural frequency of the pendulum, 1/s.
        com_height: Height of the CoM over the support while walking, m.
        ground: What is known of the ground.
        drift_correction: Yaw-drift correction of the remaining footsteps: their motion since it was set, for soles that
            have turned on the ground, which the estimated world follows.
    """

    def __init__(
        self,
        robot: Robot,
        plan: FootstepPlan,
        com_height: float,
        period: float,
        settings: WalkSettings | None = None,
        *,
        reach: Reach | None = None,
        extent: tuple[float, float, float, float] | None = None,
        com: Array | None = None,
    ) -> None:
        """Check a plan and stand at its start, with the CoM at `com` if it is not over the feet."""
        self.settings = s = settings or WalkSettings()
        self.period = period
        self.reach = reach or Reach.of(robot, com_height)
        gait, self.notes = plan.gait.full.on_grid(period)
        for note in self.notes:
            logger.warning("%s", note)
        if gait.single_support < gait.swing.shortest:
            raise InputError(
                f"single_support must be at least {gait.swing.shortest:g} s for take-off, swing and landing, got "
                f"{gait.single_support:g} s"
            )
        plan = replace(plan, gait=gait)
        check_plan(plan, robot, self.reach, extent)
        left, right = robot.soles[:2]
        self.sole_sizes: SoleSizes = ((left.length, left.width), (right.length, right.width))
        preview, self._swing_gait = s.preview, gait
        adjustment = None if s.adjustment is None else s.adjustment.sized(robot.length_scale)
        margin = preview.margin * robot.length_scale
        inward = preview.target.inward
        if plan.climbs:  # as planned: on rough ground, landings make a plan that climbs, too
            self._swing_gait = gait.for_stairs()
            inward = min(inward, CLIMBING_INWARD)
        most = _most_inward(
            0.5 * min(left.width, right.width),
            margin if adjustment is None else max(margin, adjustment.margin),
        )
        inward = max(-most, min(most, inward))
        preview = replace(preview, margin=margin, target=replace(preview.target, inward=inward))
        self._preview = PreviewController(self.sole_sizes, com_height, preview)
        self.omega, self.com_height = self._preview.omega, com_height
        self._adjuster: StepAdjuster | None = None
        if adjustment is not None:
            self._adjuster = StepAdjuster(self.omega, self.reach, self.sole_sizes, adjustment)

        self.phases = WalkPhases(plan, robot.mass * GRAVITY, s.phases)
        self._robot = robot
        self._events: tuple[Event, ...] = ()  # those of `start`, for the next update
        self._feet = [FootMotion.at_rest(plan.left.placement), FootMotion.at_rest(plan.right.placement)]
        self._yaws = [heading(motion.placement.rotation) for motion in self._feet]
        self._swing: SwingFoot | None = None
        self._planned_swing: _PlannedSwing | None = None
        middle = 0.5 * (plan.left.position + plan.right.position)
        if com is None:
            com = middle + (0.0, 0.0, com_height)
        rest = Pendulum.at_rest(com, float(middle[2]))
        self._rest = rest if len(plan) else None  # until the walk starts
        self._pattern = self._preview.plan(self.phases.supports(), rest)
        self._pattern_status = self._preview.status
        self._time = 0.0  # since the pattern was planned, s
        self.drift_correction = pin.SE3.Identity()
        self._turned = 0.0  # angle by which soles have turned since landings were turned back last, rad
        self.ground = GroundEstimate(s.ground_memory, s.rise_memory, self.reach.max_height)

    @property
    def finished(self) -> bool:
        """True when all steps are done and the robot stands."""
        return self.phases.finished

    @property
    def steps_done(self) -> int:
        """Completed single supports."""
        return self.phases.completed

    def start(self) -> None:
        """Begin to walk with the next update; `InputError` if the robot walks already, or there is no step to take."""
        self._events = (self.phases.start(),)
        self._rest, self._time = None, 0.0
        self._replan()

    def stop(self) -> None:
        """Come to a stand safely; a walk that stands, or stops already, is left alone."""
        if self._rest is not None:
            return
        # The height of the last landing, at which the other foot closes up, contains that of the ground.
        if not self.phases.stop(self.ground.height):
            return
        self._replan()
        if self._swing is not None:
            self._plan_swing(self._swing.landing)

    def steer(self, steps: Sequence[Footstep], gait: StepGait | None = None) -> None:
        """Replace all steps that have not begun; a robot that stands sets off with the next update."""
        phases = self.phases
        if gait is not None and gait.single_support < gait.swing.shortest:
            raise InputError(
                f"single_support must be at least {gait.swing.shortest:g} s, got {gait.single_support:g} s"
            )
        phases.steer(self.ground.settled(steps, swings=self._swing is not None), gait)
        self.ground.height = 0.0
        self._swing_gait = self._swing_gait if gait is None else gait
        if phases.phase is GaitPhase.STANDING and steps:
            self._events = (phases.start(),)
            if self._rest is not None:
                self._rest, self._time = None, 0.0
        self._replan()
        if self._swing is not None:
            self._plan_swing(self._swing.landing)

    def update(
        self,
        loads: Sequence[float],
        soles: Sequence[pin.SE3] | None = None,
        dcm: Array | None = None,
        turned: float = 0.0,
    ) -> Reference:
        """Compute one tick.

        Args:
            loads: Normal forces on left and right foot, N.
            soles: Placements of the soles as they are; as planned when None.
            dcm: Measured DCM, m; None leaves landings as planned.
            turned: Angle by which soles have turned on the ground in the last period, rad.
        """
        self._time += self.period
        if self.phases.phase is not GaitPhase.STANDING:
            self._turned += turned
        self.phases.weight = self._robot.mass * GRAVITY
        events = self._events + self.phases.update(loads, self.period)
        self._events = ()
        placements = [motion.placement for motion in self._feet] if soles is None else list(soles)
        for event in events:
            if event in (Event.LIFT_OFF, Event.FORCED_LIFT_OFF):
                self._lift(placements)
            elif event in TOUCH_DOWNS:
                self._land(placements)
        overdue = self.phases.overdue
        interval = 0.5 * HOLD if overdue else REPLAN
        if self._rest is None and (events or self._time >= interval - ROUNDING):
            if self._time > 0.0:  # a swing that begins has planned already
                self._replan()
        elif dcm is not None and self._adjuster and self._swing is not None and not overdue:
            self._adjust(dcm, self._adjuster, self._swing)
        if self._swing is not None:
            if self.ground.news:
                self._look(self._swing)
            side = SIDES.index(self._swing.landing.side)
            self._feet[side] = motion = self._swing.at(self.phases.elapsed)
            self._yaws[side] = heading(motion.placement.rotation)
        return Reference(
            self._pattern.at(self._time) if self._rest is None else self._rest,
            (self._feet[0], self._feet[1]),
            self.phases.contact,
            mean_heading(*self._yaws),
            self.phases.phase,
            self.phases.step,
            events,
            stance=self.phases.stance,
        )

    def _lift(self, placements: list[pin.SE3]) -> None:
        """Start a swing from the foot's placement."""
        self._turn_back(placements[self.phases.stance])
        step = self.phases.plan.steps[self.phases.step]
        side = SIDES.index(step.side)
        self.ground.lift(1 - side, placements[1 - side])
        landing = self.ground.expect(step, self._near(step))
        self.phases.set_landing(landing, carry=False)
        over, shape = self.ground.way(placements[side], landing), self._swing_gait.swing
        # Where what is seen is not there, the ground is where it was felt.
        shape = shape._replace(search_depth=shape.search_depth + self.ground.raised)
        self._swing = SwingFoot(placements[side], landing, self.phases.duration, shape, over)
        self._replan()
        self._plan_swing(landing)

    def _turn_back(self, stance: pin.SE3) -> None:
        """Turn the landings to come about the foot that stands, against what soles have turned on the ground."""
        if abs(self._turned) < TURNED:
            return
        turn = max(-MOST_TURN, min(MOST_TURN, -self._turned))
        self._turned += turn
        rotation = pin.rpy.rpyToMatrix(0.0, 0.0, turn)
        move = pin.SE3(rotation, stance.translation - rotation.dot(stance.translation))
        self.drift_correction = move * self.drift_correction
        self.phases.set_landing(self.phases.plan.steps[self.phases.step].moved(move))

    def _near(self, step: Footstep) -> Callable[[float, float], bool] | None:
        """Return which places near a step may be chosen; None if it stays, as the last two do: the goal is met."""
        if step.place == "fixed" or self.phases.step >= len(self.phases.plan) - 2:
            return None
        stance, reach = self.phases.plan.stance(self.phases.step), self.reach
        outwards = 1.0 if step.side == "left" else -1.0

        def allowed(x: float, y: float) -> bool:
            forward, left, _, _ = replace(step, x=x, y=y).seen_from(stance)
            return (
                abs(forward) <= reach.max_length and reach.min_spacing <= outwards * left <= reach.max_spacing
            )

        return allowed

    def _look(self, swing: SwingFoot) -> None:
        """Move the landing to the height that is seen under it, while the foot can follow."""
        phases = self.phases
        if phases.remaining < LAST_LOOK or phases.overdue:
            return
        now = phases.plan.steps[phases.step]
        seen = self.ground.under(now)
        if abs(seen.z - now.z) < NOTICED:
            return
        self.ground.height += seen.z - now.z
        phases.set_landing(seen, carry=False)
        swing.retarget(phases.elapsed, seen, swing.duration)
        self._replan()

    def _land(self, placements: list[pin.SE3]) -> None:
        """End a swing: the foot stands at its placement, and the plan goes on from there."""
        assert self._swing is not None
        planned = self._swing.landing
        side = SIDES.index(planned.side)
        # A copy: a placement that is handed in may be the model's own, which moves on with the foot.
        self._feet[side] = motion = FootMotion.at_rest(pin.SE3(placements[side]))
        self._yaws[side] = heading(motion.placement.rotation)
        landed = Footstep.of(planned.side, placements[side])
        self.ground.land(landed.z - planned.z, landed.z - float(placements[1 - side].translation[2]))
        # Its tilt is that of a stone or of a correction: the pattern needs place and heading alone.
        self.phases.set_landing(replace(landed, pitch=planned.pitch, roll=planned.roll), carry=False)
        self._swing = None

    def _replan(self) -> None:
        """Plan the pattern anew from the pendulum as planned; what is measured is left to the stabilizer."""
        self._pattern = self._preview.plan(self.phases.supports(), self._pattern.at(self._time))
        self._time = 0.0
        status = self._preview.status
        if not status.ok and self._pattern_status.ok:
            logger.warning("no ZMP could be planned (%s); it follows the reference", status.name)
        self._pattern_status = status

    def _plan_swing(self, landing: Footstep) -> None:
        """Keep the swing as it is planned now: adjustments are made against it."""
        phases, gait = self.phases, self.phases.plan.gait.full
        last = phases.step + 1 >= len(phases.plan)
        transfer = 0.5 * (gait.final_double_support if last else gait.double_support)
        begin, duration = phases.elapsed, phases.duration
        dcm = self._pattern.dcm_at(duration - begin + transfer)
        self._planned_swing = _PlannedSwing(self._pattern, begin, landing, duration, transfer, dcm)

    def _adjust(self, dcm: Array, adjuster: StepAdjuster, swing: SwingFoot) -> None:
        """Catch the pendulum by landing and time; against the plan at lift-off: one change does not add to another."""
        assert self._planned_swing is not None
        phases, settings, planned = self.phases, adjuster.settings, self._planned_swing
        elapsed, remaining = phases.elapsed, planned.duration - phases.elapsed
        if phases.remaining <= FREEZE or remaining <= FREEZE:
            return
        landing, time = adjuster.adjust(
            np.asarray(dcm)[:2],
            planned.pattern.dcm_at(elapsed - planned.begin),
            planned.dcm,
            planned.landing,
            phases.plan.stance(phases.step),
            remaining,
            planned.transfer,
            self._preview.settings.target,
        )
        now = phases.plan.steps[phases.step]
        time = max(self.period, round(time / self.period) * self.period)
        moved = math.hypot(landing.x - now.x, landing.y - now.y)
        if moved < 0.5 * settings.threshold and abs(time - phases.remaining) < 2.5 * self.period:
            return
        if self.ground.sight is not None:
            landing = self.ground.under(replace(landing, z=now.z))
        phases.set_landing(landing, carry=True)
        phases.retime(time)
        swing.retarget(elapsed, landing, elapsed + time)
        self._replan()


def _most_inward(half_width: float, margin: float) -> float:
    """Return the greatest distance of the planned ZMP from the middle of a sole to a side, m.

    Step adjustment answers what no ZMP within the sole's margin can. Without room on a side it would answer every error
    of the DCM to that side, the constant ones of sensors as well, and the walk would leave its line. The room is one
    margin, or half of what the margin leaves of a sole that is narrower than six margins.
    """
    left = half_width - margin
    return max(left - margin, 0.5 * left, 0.0)
