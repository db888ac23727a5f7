"""Planned steps: places and times are fixed ahead; phases change by contact and by time, not by time alone.

    foot loads, DCM, soles  →  phases  →  (events: swing, landing)  →  pattern  →  references for this tick

Lift-off waits until the foot that leaves has given its load to the foot that stays. Touch-down is the first load on
the swing foot: early (the swing ends, and the weight may come over at once), on time, or late (the foot reaches on
down, and the pendulum is held meanwhile). Everything that could be wrong with a plan is refused when the walk is made.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import field, replace
from typing import Annotated

import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import NonNegative, Share, in_units, settings
from wbc.core.robot import GRAVITY, SIDES, Robot
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.contact import Event, GaitPhase, touch_down
from wbc.walking.gait import GaitMachine
from wbc.walking.ground import LAST_LOOK, NOTICED, GroundEstimate
from wbc.walking.lipm.adjustment import FREEZE, AdjustmentSettings, PlannedSwing, StepAdjuster
from wbc.walking.lipm.preview import PreviewController, PreviewSettings
from wbc.walking.lipm.schedule import SupportPhase, ZmpTarget, schedule
from wbc.walking.plans.footsteps import Footstep, FootstepPlan, SoleSizes, heading, mean_heading, other
from wbc.walking.plans.gait import Gait, StepGait
from wbc.walking.plans.reach import Reach, check_plan
from wbc.walking.plans.sources import Standing
from wbc.walking.source import Reference
from wbc.walking.swing import SwingFoot

logger = logging.getLogger(__name__)

TOUCH_DOWNS = (Event.EARLY_TOUCH_DOWN, Event.TOUCH_DOWN, Event.LATE_TOUCH_DOWN, Event.NO_TOUCH_DOWN)


CLIMBING_INWARD = 0.01
"""Greatest distance of the planned ZMP to the inner side in a plan with stairs, m: the further inward the ZMP, the more
torque the hips need, and on a stair they have none to spare."""

TURNED, MOST_TURN = 0.02, 0.04
"""Angle by which soles have turned on the ground from which on the landings to come are turned back, and greatest angle
of that in a step, rad."""

DEBOUNCE, HOLD = 0.01, 0.05
"""Time that the load of a touch-down must last; remaining time that the pattern plans with while a phase waits for a
foot, s."""


@settings
class PhaseSettings:
    """Loads and times at which phases change. Loads are over the robot's weight.

    Attributes:
        touch_down: Load at which a swing foot has met the ground; 0.08 is 30 N of 39 kg.
        early: Ratio of the swing before which a load is a stumble, not a touch-down.
        lift_off: Greatest load of the foot that leaves.
        stance: Least load of the foot that stays.
        max_wait: Longest time that lift-off waits for these two loads, s; then the foot lifts all the same.
        max_late: Longest time that a foot searches for ground, s; then it is taken to stand where it is.
    """

    touch_down: Share = 0.08
    early: Share = 0.6
    lift_off: Share = 0.25
    stance: Share = 0.5
    max_wait: Annotated[NonNegative, "s"] = 0.3
    max_late: Annotated[NonNegative, "s"] = 0.5


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


class Walk(GaitMachine):
    """Walk of one robot along planned steps.

    Attributes:
        plan: Footstep plan as it is now; landings move, and the walk may be steered or stopped.
        step: Index of the step that swings, or that swings next; the number of steps at the end.
        period: Control period, s.
        reach: Reach of the robot's legs.
        sole_sizes: (length, width) of the left and of the right sole, m.
        omega: Natural frequency of the pendulum, 1/s.
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
        """Check a plan, stand at its start, with the CoM at `com` if it is not over the feet, and walk from there."""
        self.settings = s = settings or WalkSettings()
        self.period = period
        self.reach = reach or Reach.of(robot, com_height)
        gait, notes = plan.gait.full.on_grid(period)
        for note in notes:
            logger.warning("%s", note)
        plan = replace(plan, gait=_checked(gait))
        check_plan(plan, robot, self.reach, extent)
        super().__init__(
            period, GroundEstimate(s.ground_memory, s.rise_memory, self.reach.max_height), DEBOUNCE
        )
        left, right = robot.soles[:2]
        self.sole_sizes: SoleSizes = ((left.length, left.width), (right.length, right.width))
        lengths, self._swing_gait = {"m": robot.length_scale}, gait  # a small robot has its share of each
        preview, adjustment = in_units(s.preview, lengths), s.adjustment and in_units(s.adjustment, lengths)
        margin, inward = preview.margin, preview.target.inward
        if plan.climbs:  # as planned: on rough ground, landings make a plan that climbs, too
            self._swing_gait = gait.for_stairs()
            inward = min(inward, CLIMBING_INWARD)
        most = _most_inward(
            0.5 * min(left.width, right.width),
            margin if adjustment is None else max(margin, adjustment.margin),
        )
        inward = max(-most, min(most, inward))
        preview = replace(preview, target=replace(preview.target, inward=inward))
        self._preview = PreviewController(self.sole_sizes, com_height, preview)
        self.omega = self._preview.omega
        self._adjuster: StepAdjuster | None = None
        if adjustment is not None:
            sizes, target = self.sole_sizes, preview.target
            self._adjuster = StepAdjuster(com_height, self.reach, sizes, target, adjustment)
        self._planned_swing: PlannedSwing | None = None

        self._robot = robot
        self.plan, self.step, self._stopping = plan, 0, False
        self._schedule: tuple[FootstepPlan, tuple[SupportPhase, ...]] | None = None  # with its plan
        self._places = [plan.left.placement, plan.right.placement]
        self._yaws = [heading(place.rotation) for place in self._places]
        middle = 0.5 * (plan.left.position + plan.right.position)
        if com is None:
            com = middle + (0.0, 0.0, com_height)
        self._begun: tuple[Event, ...] = ()  # events before the next update
        if plan.steps:
            self._start()
        self._time = 0.0  # since the pattern was planned, s
        self._pattern = self._preview.plan(self.supports(), Pendulum.at_rest(com, float(middle[2])))
        self.drift_correction = pin.SE3.Identity()
        self._turned = 0.0  # angle by which soles have turned since landings were turned back last, rad

    # ---- phases -------------------------------------------------------------------------------------------------

    @property
    def finished(self) -> bool:
        """True when all steps are done and the robot stands."""
        return self.phase is GaitPhase.STANDING and self.step >= len(self.plan)

    @property
    def remaining(self) -> float:
        """Time to the planned end of the phase, s; at least `HOLD` while it waits for a foot."""
        return max(self.duration - self.elapsed, HOLD if self._waits else 0.0)

    @property
    def overdue(self) -> bool:
        """True while lift-off or touch-down is late."""
        return self._waits and self.elapsed >= self.duration - ROUNDING

    @property
    def _waits(self) -> bool:
        return self.phase is GaitPhase.SINGLE or (
            self.phase is GaitPhase.DOUBLE and self.step < len(self.plan)
        )

    def supports(self) -> tuple[SupportPhase, ...]:
        """Return the schedule from now on."""
        if self.step >= len(self.plan) > 0 and self.phase is GaitPhase.STANDING:
            return (SupportPhase(HOLD, self.plan.final, self.step, HOLD),)
        if self._schedule is None or self._schedule[0] is not self.plan:
            self._schedule = self.plan, schedule(self.plan)
        whole = self._schedule[1]
        if self.phase is GaitPhase.STANDING:
            return whole
        index = 2 * self.step + (1 if self.phase is GaitPhase.SINGLE else 0)
        now = whole[index]
        left = max(self.remaining, 1e-3)
        return (SupportPhase(left, now.feet, now.step, max(now.total, left)), *whole[index + 1 :])

    def _start(self) -> None:
        """Begin to walk with the next update."""
        self._begun = (Event.STARTED,)
        self._enter(GaitPhase.DOUBLE, self.plan.gait.full.initial_double_support)

    def stop(self) -> None:
        """Land, bring the other foot beside, and stand; a walk that stands, or stops already, is left alone."""
        if self.phase is GaitPhase.STANDING or self._stopping:
            return
        self._stopping = True
        last = self.step if self.phase is GaitPhase.SINGLE else self.step - 1
        self.plan = plan = self.plan.stopping_after(last)
        if len(plan) > last + 1:
            # The height of the last landing, at which the other foot closes up, contains that of the ground.
            closing = plan.steps[-1]
            self.plan = plan.with_step(len(plan) - 1, replace(closing, z=closing.z - self.ground.height))
        if self.step >= len(plan):
            self.duration = self.elapsed + plan.gait.full.final_double_support
        self._plan_again()

    def steer(self, steps: Sequence[Footstep], gait: StepGait | None = None) -> None:
        """Replace all steps that have not begun, by none for a stand; the gait is as before when None.

        A robot that stands sets off with the next update.
        """
        full = self.plan.gait.full if gait is None else _checked(gait)
        self._swing_gait = self._swing_gait if gait is None else gait
        swings, waited = self.phase is GaitPhase.SINGLE, self.step < len(self.plan)
        steps = self.ground.settled(steps, swings=swings)
        self.ground.height = 0.0
        left, right = self.plan.feet(self.step)
        begun = self.plan.steps[self.step : self.step + 1] if swings else ()
        self.plan = FootstepPlan(left, right, (*begun, *steps), full)
        self.step, self._stopping = 0, False
        if self.phase is GaitPhase.STANDING and steps:
            self._start()
        elif self.phase is GaitPhase.DOUBLE and waited and not steps:
            self.duration = self.elapsed + full.final_double_support
        elif self.phase is GaitPhase.DOUBLE and steps and not waited:
            # Off again before the robot stood: the weight has yet to come over.
            self.duration = self.elapsed + full.initial_double_support
        self._plan_again()

    def _plan_again(self) -> None:
        """Plan pattern and swing anew for steps that have changed."""
        self._replan()
        if self.swing is not None:
            self._plan_swing(self.swing.landing)

    def set_landing(self, step: Footstep, *, carry: bool = True) -> None:
        """Set the landing of the foot that swings, or has landed last; see `FootstepPlan.with_step`."""
        index = self.step if self.phase is GaitPhase.SINGLE else self.step - 1
        self.plan = self.plan.with_step(index, step, carry=carry)

    def standing(self, gait: Gait, time: float) -> Standing:
        """Return the feet as they stand now, with the gait of the plans that begin there, at a time, s."""
        plan, step, swings = self.plan, self.step, self.phase is GaitPhase.SINGLE
        first: str | None = None
        if swings:
            first = other(plan.steps[step].side)
        elif self.phase is GaitPhase.DOUBLE and step < len(plan):
            first = plan.steps[step].side
        left, right = (replace(foot, pitch=0.0, roll=0.0) for foot in plan.feet(step + swings))
        return Standing(FootstepPlan(left, right, (), gait), first, self.steps_done + swings, swings, time)

    def _advance(self, loads: Sequence[float]) -> tuple[Event, ...]:
        """Change the phase where contact, by the normal force on left and right foot, N, and time say so."""
        weight = self._robot.mass * GRAVITY
        if self.phase is GaitPhase.SINGLE:
            return self._single(loads[1 - self.stance] / weight)
        if self.phase is GaitPhase.STANDING or self.elapsed < self.duration - ROUNDING:
            return ()
        if self.step >= len(self.plan):
            self._enter(GaitPhase.STANDING, 0.0)
            return (Event.STOPPED,)
        s, leaving = self.settings.phases, SIDES.index(self.plan.steps[self.step].side)
        free = loads[leaving] <= s.lift_off * weight and loads[1 - leaving] >= s.stance * weight
        if not free and self.elapsed < self.duration + s.max_wait - ROUNDING:
            return ()
        self._enter(GaitPhase.SINGLE, self.plan.gait.full.single_support)
        return (Event.LIFT_OFF if free else Event.FORCED_LIFT_OFF,)

    def _single(self, load: float) -> tuple[Event, ...]:
        """End the single support where the swing foot has met the ground, by its load over the weight, or must."""
        s, credit = self.settings.phases, 0.0
        touched = self._touches(load >= s.touch_down)
        left = self.duration - self.elapsed
        if left > ROUNDING:
            if not (touched and self.elapsed >= s.early * self.duration):
                return ()
            event, credit = Event.EARLY_TOUCH_DOWN, left  # for the double support: the rhythm is kept
        elif touched:
            event = touch_down(-left, ROUNDING, 0.5 * HOLD)
        elif left <= -s.max_late + ROUNDING:
            event = Event.NO_TOUCH_DOWN if s.max_late > 0.0 else Event.TOUCH_DOWN
        else:
            return ()
        self.step += 1
        self.steps_done += 1
        gait, last = self.plan.gait.full, self.step >= len(self.plan)
        self._enter(GaitPhase.DOUBLE, credit + (gait.final_double_support if last else gait.double_support))
        return (event,)

    # ---- the tick -----------------------------------------------------------------------------------------------

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
        self.elapsed += self.period
        if self.phase is not GaitPhase.STANDING:
            self._turned += turned
        flown, places = self.swing, self._places if soles is None else soles
        events = self._begun + self._advance(loads)
        self._begun = ()
        steps = self.plan.steps
        self.stance = 1 - SIDES.index(steps[min(self.step, len(steps) - 1)].side) if steps else 0
        for event in events:
            if event in (Event.LIFT_OFF, Event.FORCED_LIFT_OFF):
                self._lift(places)
            elif event in TOUCH_DOWNS and flown is not None:
                self._land(places, flown.landing)
        overdue, swing = self.overdue, self.swing
        if events or (overdue and self._time >= 0.5 * HOLD - ROUNDING):
            if self._time > 0.0:  # a swing that begins has planned already
                self._replan()
        elif dcm is not None and self._adjuster and swing is not None and not overdue:
            self._adjust(dcm, self._adjuster, swing)
        if swing is not None:
            if self.ground.news:
                self._look(swing)
            self._yaws[1 - self.stance] = swing.heading(self.elapsed)
        reference = self._reference(
            self._pattern.at(self._time), self._places, mean_heading(*self._yaws), events
        )
        if swing is not None:
            self._places[1 - self.stance] = reference.feet[1 - self.stance].placement
        return reference

    def _lift(self, places: Sequence[pin.SE3]) -> None:
        """Start a swing from the foot's placement."""
        self._turn_back(places[self.stance])
        step, shape = self.plan.steps[self.step], self._swing_gait.swing
        self.ground.lift(self.stance, places[self.stance])
        landing = self.ground.expect(step, self._near(step))
        self.set_landing(landing, carry=False)
        # Where what is seen is not there, the ground is where it was felt.
        shape = shape._replace(search_depth=shape.search_depth + self.ground.raised)
        self._begin_swing(places, landing, self.duration, shape)
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
        self.set_landing(self.plan.steps[self.step].moved(move))

    def _near(self, step: Footstep) -> Callable[[float, float], bool] | None:
        """Return which places near a step may be chosen; None if it stays, as the last two do: the goal is met."""
        if step.place == "fixed" or self.step >= len(self.plan) - 2:
            return None
        stance, reach = self.plan.stance(self.step), self.reach
        outwards = 1.0 if step.side == "left" else -1.0

        def allowed(x: float, y: float) -> bool:
            forward, left, _, _ = replace(step, x=x, y=y).seen_from(stance)
            return (
                abs(forward) <= reach.max_length and reach.min_spacing <= outwards * left <= reach.max_spacing
            )

        return allowed

    def _look(self, swing: SwingFoot) -> None:
        """Move the landing to the height that is seen under it, while the foot can follow."""
        if self.remaining < LAST_LOOK or self.overdue:
            return
        now = self.plan.steps[self.step]
        seen = self.ground.under(now)
        if abs(seen.z - now.z) < NOTICED:
            return
        self.ground.height += seen.z - now.z
        self.set_landing(seen, carry=False)
        swing.retarget(self.elapsed, seen, swing.duration)
        self._replan()

    def _land(self, places: Sequence[pin.SE3], planned: Footstep) -> None:
        """End a swing: the foot stands at its placement, and the plan goes on from there."""
        side = SIDES.index(planned.side)
        self._places[side] = place = pin.SE3(
            places[side]
        )  # may be the model's own, which moves on with the foot
        self._yaws[side] = heading(place.rotation)
        landed = Footstep.of(planned.side, place)
        self.ground.land(landed.z - planned.z, landed.z - float(places[1 - side].translation[2]))
        # Its tilt is that of a stone or of a correction: the pattern needs place and heading alone.
        self.set_landing(replace(landed, pitch=planned.pitch, roll=planned.roll), carry=False)

    def _replan(self) -> None:
        """Plan the pattern anew from the pendulum as planned; what is measured is left to the stabilizer."""
        self._pattern = self._preview.plan(self.supports(), self._pattern.at(self._time))
        self._time = 0.0

    def _plan_swing(self, landing: Footstep) -> None:
        """Keep the swing as it is planned now: adjustments are made against it."""
        gait, last = self.plan.gait.full, self.step + 1 >= len(self.plan)
        transfer = 0.5 * (gait.final_double_support if last else gait.double_support)
        stance = self.plan.stance(self.step)
        self._planned_swing = PlannedSwing(
            self._pattern, self.elapsed, landing, stance, self.duration, transfer
        )

    def _adjust(self, dcm: Array, adjuster: StepAdjuster, swing: SwingFoot) -> None:
        """Catch the pendulum by landing and time."""
        if self.remaining <= FREEZE:
            return
        assert self._planned_swing is not None
        threshold, elapsed = adjuster.settings.threshold, self.elapsed
        landing, time = adjuster.adjust(self._planned_swing, elapsed, complex(*dcm[:2].tolist()))
        now = self.plan.steps[self.step]
        time = max(self.period, round(time / self.period) * self.period)
        moved = math.hypot(landing.x - now.x, landing.y - now.y)
        if moved < 0.5 * threshold and abs(time - self.remaining) < 2.5 * self.period:
            return
        if self.ground.sight is not None:
            landing = self.ground.under(replace(landing, z=now.z))
        self.set_landing(landing, carry=True)
        self.duration = elapsed + time
        swing.retarget(elapsed, landing, elapsed + time)
        self._replan()


def _checked(gait: StepGait) -> StepGait:
    """Return a gait; an `InputError` for one without the time for a swing."""
    if gait.single_support < gait.swing.shortest:
        raise InputError(
            f"single_support must be at least {gait.swing.shortest:g} s for take-off, swing and landing, got "
            f"{gait.single_support:g} s"
        )
    return gait


def _most_inward(half_width: float, margin: float) -> float:
    """Return the greatest distance of the planned ZMP from the middle of a sole to a side, m.

    Step adjustment answers what no ZMP within the sole's margin can. Without room on a side it would answer every error
    of the DCM to that side, the constant ones of sensors as well, and the walk would leave its line. The room is one
    margin, or half of what the margin leaves of a sole that is narrower than six margins.
    """
    left = half_width - margin
    return max(left - margin, 0.5 * left, 0.0)
