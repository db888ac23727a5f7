"""Planned steps: places and times are fixed ahead; phases change by contact and by time, not by time alone.

    planner  →  steps from where the feet stand  →  check
    foot loads, DCM, soles  →  phases  →  (events: swing, landing)  →  pattern  →  references for this tick

On both feet the steps are planned anew every tenth of a second, those of a plan at each landing; with a foot in the air
only when the planner or its command has changed, and not while the last foot is about to land. A planner that fails, or
asks for a step that the robot cannot take, is dropped: the robot comes to a stand, and the reason is logged.

Lift-off waits until the foot that leaves has given its load to the foot that stays. Touch-down is the first load on
the swing foot: early (the swing ends, and the weight may come over at once), on time, or late (the foot reaches on
down, and the pendulum is held meanwhile).
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from wbc.base.numbers import ROUNDING, Array
from wbc.core.drive.control import State
from wbc.core.frames import heading, yaw_rotation
from wbc.core.robot import GRAVITY, SIDES, Robot
from wbc.core.trajectories import Follower
from wbc.tasks.stabilizer.pendulum import Pendulum, natural_frequency
from wbc.walking.contact import Event, GaitPhase, touch_down
from wbc.walking.ground import LAST_LOOK, NOTICED, GroundEstimate
from wbc.walking.lipm.adjustment import FREEZE, PlannedSwing, StepAdjuster
from wbc.walking.lipm.schedule import SupportPhase, schedule
from wbc.walking.lipm.settings import WalkSettings, law_of
from wbc.walking.lipm.steered_steps import PLANNED_NEAR, SteeredSteps
from wbc.walking.plans.footsteps import Footstep, FootstepPlan, mean_heading, other
from wbc.walking.plans.reach import Extent, Reach, check_plan
from wbc.walking.plans.sources import (
    AT_REST,
    REPLAN,
    DriveSettings,
    FootstepSource,
    PlanSource,
    Standing,
    Velocity,
    answer_of,
    close_up,
)
from wbc.walking.source import Progress, Reference, ReferenceSource
from wbc.walking.steering import Steering
from wbc.walking.swing import FootMotion, SwingFoot

logger = logging.getLogger(__name__)

TURNED, MOST_TURN = 0.02, 0.04
"""Angle by which soles have turned on the ground from which on the landings to come are turned back, and greatest angle
of that in a step, rad."""

FELT = 30.0
"""Time from which on the steps of a plan change the DCM now by less than rounding, 1/ω."""

DEBOUNCE, HOLD = 0.01, 0.05
"""Time that the load of a touch-down must last; remaining time that the pattern plans with while a phase waits for a
foot, s."""


class LipmWalk(ReferenceSource):
    """Walk of one robot along planned steps: those of a plan, a velocity, a goal or a planner.

    Attributes:
        settings: Settings.
        dt: Control period, s.
        time: Time since the walk began, s.
        phase: Phase now.
        stance: Foot that carries while the present or next step swings: 0 left, 1 right.
        elapsed: Time since the start of this phase, s.
        duration: Planned length of this phase, s.
        steps_done: Steps that have ended with a foot on the ground.
        swing: Swing of this step; None on both feet.
        ground: What is known of the ground.
        plan: Steps from the one that swings or swings next on, as they are now; landings move.
        step: Index of the step that swings, or that swings next; the number of steps at the end.
        com_height: Height of the CoM over the support while walking, m.
        omega: Natural frequency of the pendulum, 1/s.
        drift_correction: Yaw-drift correction of the remaining footsteps: their motion since the planner was taken, for
            soles that have turned on the ground, which the estimated world follows.
    """

    com_height: float
    ground: GroundEstimate
    steering: Steering

    def __init__(
        self,
        robot: Robot,
        plan: FootstepPlan,
        com_height: float,
        dt: float,
        settings: WalkSettings | None = None,
        *,
        drive: DriveSettings | None = None,
        reach: Reach | None = None,
        extent: Extent | None = None,
        com: Array | None = None,
    ) -> None:
        """Stand at the start of a plan, with the CoM at `com` if it is not over the feet, and walk from there.

        An `InputError` for a plan that cannot be walked on a ground of an extent, m; None is endless.
        """
        self.settings = s = settings or WalkSettings()
        self.com_height, self.omega = com_height, natural_frequency(com_height)
        self.reach, self._robot = reach or Reach.of(robot, com_height), robot
        full, _ = plan.gait.full.on_grid(dt)
        for note in plan.gait.on_grid(dt)[1]:  # of what is given
            logger.warning("%s", note)
        check_plan(plan, self.reach, extent)
        self.lift_room = full.swing_height
        self._gait, _ = replace(plan.gait, feet_spacing=plan.spacing).on_grid(dt)  # of plans to come
        self._drive = drive or DriveSettings()
        self.steering = Steering(self._drive.limits, PLANNED_NEAR, extent)
        self.dt, self.ground = dt, GroundEstimate(s.ground_memory, s.rise_memory, self.reach.max_height)
        self._soles = [robot.placement(sole.frame) for sole in robot.soles]
        self._laws = [law_of(s, robot, com_height, self.reach, climbs=climbs) for climbs in (False, True)]
        if com is None:
            com = 0.5 * (plan.left.position + plan.right.position) + (0.0, 0.0, com_height)
        self._first: FootstepSource | None = None  # from the start on
        self._stand(replace(plan, steps=()), com)
        if plan.steps:
            self.take(PlanSource(plan))
            self._first = self.planner
            self.plan_steps()
        self.progress = self._record()

    def _stand(self, feet: FootstepPlan, com: Array) -> None:
        """Stand on feet, with the CoM at a place, m."""
        self.time, self.steps_done = 0.0, 0
        self._enter(GaitPhase.STANDING, 0.0)
        self.planner, self.reason = None, ""
        self.ground.forget()
        self.plan, self.step = replace(feet, gait=feet.gait.full.on_grid(self.dt)[0]), 0
        self.steering.command(None)
        self._pace = 0.0  # of the last plan, m/s
        self._next = 0.0  # time of the next plan of the footsteps, s
        self._asked: tuple[FootstepSource | None, object] = (None, None)  # planner and order of the last plan
        self._landed = False
        self._planned_swing: PlannedSwing | None = None
        self._schedule: tuple[FootstepPlan, tuple[SupportPhase, ...]] | None = None  # with its plan
        self._places = [foot.placement for foot in self.plan.final]
        self._yaws = [heading(place.rotation) for place in self._places]
        self._begun: tuple[Event, ...] = ()  # events before the next update
        self._face()
        self.drift_correction = pin.SE3.Identity()
        self._turned = 0.0  # angle by which soles have turned since landings were turned back last, rad
        self._preview, self._adjuster = self._laws[False]
        self._since = 0.0  # the pattern was planned, s
        self._off = Follower(1.0 / self.omega, 0j)  # of the reference of the CoM from the pattern, m
        start = Pendulum.at_rest(com, float(0.5 * sum(place.translation[2] for place in self._places)))
        self._pattern = self._preview.plan(self.supports(), start)

    # ---- what is asked for --------------------------------------------------------------------------------------

    @property
    def finished(self) -> bool:
        """True when what a planner has asked for is walked and the robot stands."""
        planner = self.planner
        return self._rests and (planner is None or self._asked == (planner, planner.order))

    @property
    def _rests(self) -> bool:
        """True while the robot stands and has no step to take."""
        return self.phase is GaitPhase.STANDING and self.step >= len(self.plan)

    @property
    def steered(self) -> bool:
        """True if footsteps come, or may come, from another planner; False for a walk along its first plan."""
        return self._first is None or self.planner is not self._first

    @property
    def granted(self) -> Velocity:
        """Velocity of the present plan: forward (m/s), left (m/s) and turn (rad/s)."""
        granted = None if self.planner is None else self.planner.granted
        if granted is None:
            return self._mean_velocity()
        return AT_REST if self._rests else granted

    def _mean_velocity(self) -> Velocity:
        """Return the mean velocity over the next two steps, seen from the foot that stands."""
        plan, step = self.plan, self.step
        if step + 2 > len(plan):
            return AT_REST
        forward, left, _, turn = plan.steps[step + 1].seen_from(plan.stance(step))
        two = 2.0 * self.plan.gait.full.cycle
        return forward / two, left / two, turn / two

    def take(self, planner: FootstepSource | None) -> None:
        """Take footsteps from a planner, from the next tick on; None for those of the steering."""
        before = self.planner
        if planner is None:
            goes_on = isinstance(before, SteeredSteps) and self.steering.goal is None
            planner = before if goes_on else self._steered_steps()
        super().take(planner)
        if planner is not before:
            self._next, self._landed, self.drift_correction = 0.0, True, pin.SE3.Identity()
        climbs = isinstance(planner, PlanSource) and planner.plan.climbs
        if climbs or self._rests:  # a robot that is to stop may do so on a stair
            self._preview, self._adjuster = self._laws[climbs]

    def _steered_steps(self) -> SteeredSteps:
        """Return a planner that is steered, and goes on from the velocity granted now; to stop on a plan, from rest."""
        pace, granted = 0.0 if self._rests else self._pace, self.granted
        if isinstance(self.planner, PlanSource) and not self.steering.pending:
            granted = AT_REST
        return SteeredSteps(self.reach, self._drive, self.steering, granted, pace)

    def plan_steps(self) -> None:
        """Plan the footsteps anew if it is time to."""
        planner, time = self.planner, self.time
        if planner is None:
            return
        if self.phase is GaitPhase.SINGLE:
            if (planner, planner.order) == self._asked or time < self._next or self._comes_to_rest:
                self._landed = True
                return
        elif not self._landed and (time < self._next or isinstance(planner, PlanSource)):
            return
        self._landed = False
        self._next = time + REPLAN
        self._asked = planner, planner.order
        feet, drift = self.plan.feet(self.step + (self.phase is GaitPhase.SINGLE)), self.drift_correction
        turns = not drift.isIdentity(0.0)  # then the planner sees the feet in the world that it was taken in
        seen = [foot.moved(drift.inverse()) for foot in feet] if turns else feet
        plan = self._ask(planner, seen)
        if plan is not None:
            self._steer(plan.moved(drift) if turns else plan)
            self._pace, self._asked = planner.pace, (planner, planner.order)
            return
        self.steering.command(None)  # the robot comes to a stand
        self.planner = stand = self._steered_steps()
        plan = self._ask(stand, feet)
        if plan is None:
            plan, first = FootstepPlan(*feet, (), self.plan.gait), self._next_side
            plan = plan if first is None else close_up(plan, first)
        self._steer(plan)

    def _ask(self, planner: FootstepSource, feet: Sequence[Footstep]) -> FootstepPlan | None:
        """Return a planner's steps from where the feet stand, the one that swings where it lands.

        The answer is None where the planner has none, and `reason` says why.
        """
        swings, (left, right) = self.phase is GaitPhase.SINGLE, feet
        start, begun = FootstepPlan(left, right, (), self._gait), self.steps_done + swings
        now = Standing(start, self._next_side, begun, swings, self.time, self.reach)
        answer = answer_of(planner, now, self.steering.extent, self.dt)
        if isinstance(answer, str):
            self.reason = answer
            return None
        return answer

    @property
    def _next_side(self) -> str | None:
        """Side that steps after the step that has begun; None for either."""
        steps, step = self.plan.steps, self.step
        if self.phase is GaitPhase.SINGLE:
            return other(steps[step].side)
        return steps[step].side if self.phase is GaitPhase.DOUBLE and step < len(steps) else None

    @property
    def _comes_to_rest(self) -> bool:
        """True in the last moments of the last step: no ZMP takes the DCM from its rest to another step that soon."""
        return self.step + 1 >= len(self.plan) and self.duration - self.elapsed < REPLAN

    def _steer(self, plan: FootstepPlan) -> None:
        """Replace all steps that have not begun, by none for a stand; a robot that stands sets off."""
        if not plan.steps and self.step >= len(self.plan):
            return  # it stands, or comes to rest
        full = plan.gait.full
        swings, waited = self.phase is GaitPhase.SINGLE, self.step < len(self.plan)
        steps = self.ground.settled(plan.steps, swings=swings)
        self.ground.expect_at(0.0)
        left, right = self.plan.feet(self.step)
        begun = self.plan.steps[self.step : self.step + 1] if swings else ()
        self.plan, self.step = FootstepPlan(left, right, (*begun, *steps), full), 0
        if self.phase is GaitPhase.STANDING and steps:
            self._begun = (Event.STARTED,)
            self._enter(GaitPhase.DOUBLE, full.initial_double_support)
        elif self.phase is GaitPhase.DOUBLE and waited and not steps:
            self.duration = self.elapsed + full.final_double_support
        elif self.phase is GaitPhase.DOUBLE and steps and not waited:
            # Off again before the robot stood: the weight has yet to come over.
            self.duration = self.elapsed + full.initial_double_support
        self._face()
        self._replan()
        if self.swing is not None:
            self._plan_swing()

    def _face(self) -> None:
        """Stand on the foot beside that of the present step."""
        steps = self.plan.steps
        self.stance = 1 - SIDES.index(steps[min(self.step, len(steps) - 1)].side) if steps else 0

    # ---- phases -------------------------------------------------------------------------------------------------

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
            return (SupportPhase(HOLD, self.plan.final, HOLD),)
        if self._schedule is None or self._schedule[0] is not self.plan:
            self._schedule = self.plan, schedule(self.plan)
        whole = self._schedule[1]
        if self.phase is GaitPhase.STANDING:
            return whole
        index = 2 * self.step + (1 if self.phase is GaitPhase.SINGLE else 0)
        now = whole[index]
        left = max(self.remaining, 1e-3)
        return (SupportPhase(left, now.feet, max(now.total, left)), *whole[index + 1 :])

    def set_landing(self, step: Footstep, *, carry: bool = True) -> None:
        """Set the landing of the foot that swings; see `FootstepPlan.with_step`."""
        self.plan = self.plan.with_step(self.step, step, carry=carry)

    def _enter(self, phase: GaitPhase, duration: float) -> None:
        """Begin a phase, planned to last for a time, s."""
        self.phase, self.elapsed, self.duration = phase, 0.0, duration
        self.swing: SwingFoot | None = None
        self._loaded = 0.0  # time for which the swing foot has borne the load of a touch-down, s

    def _phases(self, loads: Sequence[float], places: Sequence[pin.SE3]) -> tuple[Event, ...]:
        """Change the phase where contact, by the normal force on left and right foot, N, and time say so.

        The feet are at their placements when they lift and when they land.
        """
        weight = self._robot.mass * GRAVITY
        if self.phase is GaitPhase.SINGLE:
            return self._single(loads[1 - self.stance] / weight, places)
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
        self._lift(places)
        return (Event.LIFT_OFF if free else Event.FORCED_LIFT_OFF,)

    def _single(self, load: float, places: Sequence[pin.SE3]) -> tuple[Event, ...]:
        """End the single support where the swing foot has met the ground, by its load over the weight, or must."""
        s, credit = self.settings.phases, 0.0
        loaded = load >= s.touch_down
        self._loaded = self._loaded + self.dt if loaded else 0.0
        touched = loaded and self._loaded >= DEBOUNCE - ROUNDING
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
        self._land(places)
        self.step += 1
        self.steps_done += 1
        self._face()
        gait, last = self.plan.gait.full, self.step >= len(self.plan)
        self._enter(GaitPhase.DOUBLE, credit + (gait.final_double_support if last else gait.double_support))
        return (event,)

    # ---- the tick -----------------------------------------------------------------------------------------------

    def update(self, state: State) -> Reference:
        """Plan the footsteps anew if it is time to, and return the references of the walk."""
        # Filtered loads: a foot that has just met the ground presses in jerks.
        return self.advance(state.load.tolist(), self._soles, state.dcm, state.turned)

    def advance(
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
        self.plan_steps()
        self.time += self.dt
        self._since += self.dt
        self._off.follow(-self._off.value, self.dt)
        self.elapsed += self.dt
        if self.phase is not GaitPhase.STANDING:
            self._turned += turned
        events = self._begun + self._phases(loads, self._places if soles is None else soles)
        self._begun = ()
        overdue, swing = self.overdue, self.swing
        if events or (overdue and self._since >= 0.5 * HOLD - ROUNDING):
            if self._since > 0.0:  # a swing that begins has planned already
                self._replan()
        elif dcm is not None and self._adjuster and swing is not None and not overdue:
            self._adjust(dcm, self._adjuster, swing)
        if swing is not None:
            if self.ground.news:
                self._look(swing)
            self._yaws[1 - self.stance] = swing.heading(self.elapsed)
        feet = [FootMotion.at_rest(place) for place in self._places]
        if swing is not None:
            side = 1 - self.stance
            feet[side] = swing.at(self.elapsed)
            self._places[side] = feet[side].placement
        self.progress = self._record(events)
        return Reference(self._pendulum(), (feet[0], feet[1]), self.progress)

    def _record(self, events: tuple[Event, ...] = ()) -> Progress:
        """Return the record of the step as it is now, with the events of a tick."""
        swing = 1 - self.stance if self.phase is GaitPhase.SINGLE else None
        heading, (plan, step) = mean_heading(*self._yaws), (self.plan, self.step)
        now = self.phase, self.stance, swing, (swing != 0, swing != 1), heading, self.steps_done, self.elapsed
        return Progress(*now, self.duration, plan.steps[step:], plan.gait.full.cycle, events)

    def _lift(self, places: Sequence[pin.SE3]) -> None:
        """Start a swing from the foot's placement."""
        self._turn_back(places[self.stance])
        step, shape = self.plan.steps[self.step], self.plan.gait.full.swing
        self.ground.lift(self.stance, places[self.stance])
        landing = self.ground.expect(step, self._near(step))
        self.set_landing(landing, carry=False)
        # Where what is seen is not there, the ground is where it was felt.
        shape = shape._replace(search_depth=shape.search_depth + self.ground.raised)
        start = places[1 - self.stance]
        self.swing = SwingFoot(start, landing, self.duration, shape, self.ground.way(start, landing))
        self._replan()
        self._plan_swing()

    def _turn_back(self, stance: pin.SE3) -> None:
        """Turn the landings to come about the foot that stands, against what soles have turned on the ground."""
        if abs(self._turned) < TURNED:
            return
        turn = max(-MOST_TURN, min(MOST_TURN, -self._turned))
        self._turned += turn
        rotation = yaw_rotation(turn)
        move = pin.SE3(rotation, stance.translation - rotation.dot(stance.translation))
        self.drift_correction = move * self.drift_correction
        self.set_landing(self.plan.steps[self.step].moved(move))

    def _near(self, step: Footstep) -> Callable[[float, float], bool] | None:
        """Return which places near a step may be chosen; None if it stays, as the last two do: the goal is met."""
        if step.place == "fixed" or self.step >= len(self.plan) - 2:
            return None
        stance, reach = self.plan.stance(self.step), self.reach
        return lambda x, y: reach.allows(stance, replace(step, x=x, y=y))

    def _look(self, swing: SwingFoot) -> None:
        """Move the landing to the height that is seen under it, while the foot can follow."""
        if self.remaining < LAST_LOOK or self.overdue:
            return
        now = self.plan.steps[self.step]
        seen = self.ground.under(now)
        if abs(seen.z - now.z) < NOTICED:
            return
        self.ground.expect_at(self.ground.height + (seen.z - now.z))
        self._retarget(swing, seen, swing.duration, carry=False)

    def _land(self, places: Sequence[pin.SE3]) -> None:
        """End a swing: the foot stands at its placement, and the plan goes on from there."""
        planned, side = self.plan.steps[self.step], 1 - self.stance
        # A copy: the placement may be the model's own, which moves on with the foot.
        self._places[side] = place = pin.SE3(places[side])
        self._yaws[side] = heading(place.rotation)
        landed = Footstep.of(planned.side, place)
        self.ground.land(landed.z - planned.z, landed.z - float(places[1 - side].translation[2]))
        # Its tilt is that of a stone or of a correction: the pattern needs place and heading alone.
        self.set_landing(replace(landed, pitch=planned.pitch, roll=planned.roll), carry=False)

    def _pendulum(self) -> Pendulum:
        """Return the reference of the pendulum: the CoM goes over to a pattern that begins elsewhere.

        A pattern begins elsewhere where no ZMP within the supports takes the DCM to the steps that are new, as after a
        push. The reference of the CoM and its velocity go on, and come to the pattern as quickly as the DCM falls. The
        ZMP is that of the pattern.
        """
        pendulum, off = self._pattern.at(self._since), self._off
        if abs(off.value) + abs(off.velocity) / self.omega < ROUNDING:
            return pendulum
        ways = [np.array((each.real, each.imag, 0.0)) for each in (off.value, off.velocity, off.acceleration)]
        return pendulum.moved(*ways)._replace(zmp=pendulum.zmp)

    def _replan(self) -> None:
        """Plan the pattern anew from the pendulum as planned; what is measured is left to the stabilizer."""
        steps = math.ceil(FELT / (self.omega * self.plan.gait.full.cycle))
        count = 2 * steps + (self.phase is not GaitPhase.SINGLE)  # the last support is one on both feet
        before = self._pattern.at(self._since)
        self._pattern = self._preview.plan(self.supports()[:count], before)
        self._since, now = 0.0, self._pattern.at(0.0)
        self._off.value += complex(*(before.com - now.com)[:2].tolist())
        self._off.velocity += complex(*(before.com_velocity - now.com_velocity)[:2].tolist())

    def _plan_swing(self) -> None:
        """Keep the swing as it is planned now: adjustments are made against it."""
        landing = self.plan.steps[self.step]
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
        time = max(self.dt, round(time / self.dt) * self.dt)
        moved = math.hypot(landing.x - now.x, landing.y - now.y)
        if moved < 0.5 * threshold and abs(time - self.remaining) < 2.5 * self.dt:
            return
        if self.ground.sight is not None:
            landing = self.ground.under(replace(landing, z=now.z))
        self.duration = elapsed + time
        self._retarget(swing, landing, self.duration, carry=True)

    def _retarget(self, swing: SwingFoot, landing: Footstep, duration: float, *, carry: bool) -> None:
        """Change landing and time of touch-down, s, of the plan and of the swing alike; see `set_landing`."""
        self.set_landing(landing, carry=carry)
        swing.retarget(self.elapsed, landing, duration)
        self._replan()
