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
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import pinocchio as pin

from wbc.base.checked import checked
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import Period, Positive
from wbc.core.drive.control import State
from wbc.core.robot import GRAVITY, SIDES, Robot
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.contact import Event, GaitPhase, touch_down
from wbc.walking.ground import GroundEstimate
from wbc.walking.lipm.feet import PlannedFeet
from wbc.walking.lipm.phases import HOLD, PlanPhases
from wbc.walking.lipm.preview import PlannedCourse
from wbc.walking.lipm.settings import WalkSettings, law_of
from wbc.walking.lipm.steered_steps import PLANNED_NEAR, SteeredSteps
from wbc.walking.plans.check import Extent, check_plan
from wbc.walking.plans.footsteps import Footstep, FootstepPlan
from wbc.walking.plans.reach import Reach
from wbc.walking.plans.sources import (
    AT_REST,
    REPLAN,
    DriveSettings,
    FootstepSource,
    PlannerError,
    PlanSource,
    Standing,
    Velocity,
    answer_of,
    close_up,
)
from wbc.walking.source import Progress, Reference, ReferenceSource
from wbc.walking.steering import Steering

logger = logging.getLogger(__name__)

DEBOUNCE = 0.01
"""Time that the load of a touch-down must last, s."""


class LipmWalk(ReferenceSource):
    """Walk of one robot along planned steps: those of a plan, a velocity, a goal or a planner.

    Attributes:
        settings: Its `WalkSettings`.
        dt: Control period, s.
        time: Time since the walk began, s.
        phases: Plan as it is now, and the phase that it is in.
        course: Planned motion of the pendulum.
        feet: Places of the feet, and the swing of the one in the air.
        steps_done: Steps that have ended with a foot on the ground.
        ground: What is known of the ground.
        com_height: Height of the CoM over the support while walking, m.
    """

    com_height: float
    ground: GroundEstimate
    steering: Steering

    @checked
    def __init__(
        self,
        robot: Robot,
        plan: FootstepPlan,
        com_height: Annotated[Positive, "m"],
        dt: Period,
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
        self.com_height, self.made_for = com_height, (robot, dt)
        self.reach, self._robot = reach or Reach.of(robot, com_height), robot
        for note in plan.gait.on_grid(dt)[1]:  # of what is given
            logger.warning("%s", note)
        check_plan(plan, self.reach, extent)
        gait, _ = plan.gait.full.on_grid(dt)
        self.lift_room = gait.swing_height
        self._gait, _ = replace(plan.gait, feet_spacing=plan.spacing).on_grid(dt)  # of plans to come
        self._drive = drive or DriveSettings()
        self.steering = Steering(self._drive.limits, PLANNED_NEAR * robot.length_scale, extent)
        self.dt, self.ground = dt, GroundEstimate(s.ground_memory, s.rise_memory, self.reach.max_height)
        self._frames = [robot.frame_id(sole.frame) for sole in robot.soles]
        self._soles = [robot.placement(frame) for frame in self._frames]
        self._laws = [law_of(s, robot, com_height, self.reach, climbs=climbs) for climbs in (False, True)]
        preview, self._adjuster = self._laws[False]
        self.time, self.steps_done = 0.0, 0
        self._pace = 0.0  # of the last plan, m/s
        self._next = 0.0  # time of the next plan, s
        self._asked: tuple[FootstepSource | None, object] = (None, None)  # planner and order of the last plan
        self._swung = False  # since the last plan: one is due on both feet
        self._started: tuple[Event, ...] = ()  # events before the next update
        self._loaded = 0.0  # time for which the swing foot has borne the load of a touch-down, s
        self.phases = PlanPhases(replace(plan, steps=(), gait=gait))
        middle = 0.5 * (plan.left.position + plan.right.position)
        rest = Pendulum.at_rest(middle + (0.0, 0.0, com_height) if com is None else com, float(middle[2]))
        self.course = PlannedCourse(self.phases, preview, rest)
        self.feet = PlannedFeet(self.phases, self.course, self.ground, self.reach, dt)
        if plan.steps:
            self.take(PlanSource(plan))
            self.plan_steps()
        self.progress = self._record()

    # ---- what is asked for --------------------------------------------------------------------------------------

    @property
    def finished(self) -> bool:
        """True when what a planner has asked for is walked and the robot stands."""
        planner = self.planner
        return self.phases.rests and (planner is None or self._has_asked(planner))

    @property
    def remaining(self) -> Sequence[Footstep]:
        """See `ReferenceSource`."""
        return self.progress.upcoming

    @property
    def granted(self) -> Velocity:
        """Velocity of the present plan: forward (m/s), left (m/s) and turn (rad/s)."""
        granted = None if self.planner is None else self.planner.granted
        if granted is None:
            return self.phases.velocity
        return AT_REST if self.phases.rests else granted

    def take(self, planner: FootstepSource | None) -> None:
        """Take footsteps from a planner, from the next tick on; None for those of the steering."""
        before, elsewhere = self.planner, False
        if planner is None and isinstance(before, SteeredSteps):
            planner, elsewhere = before, self.steering.goal not in (None, before.goal)
        elif planner is None:
            planner = self._steered_steps()
        super().take(planner)
        climbs = False
        if isinstance(planner, PlanSource):
            planner.begin(self.reach, self.steering.extent)
            climbs = planner.plan.climbs
        if elsewhere or planner is not before or isinstance(planner, PlanSource):
            self.feet.drift.begin()
            if not elsewhere or self.phases.rests:  # a robot on its way goes on: goals may come in every tick
                self._next, self._swung, self._asked = 0.0, True, (None, None)
        if climbs or self.phases.rests:  # a robot that is to stop may do so on a stair
            self.course.preview, self._adjuster = self._laws[climbs]

    def _steered_steps(self) -> SteeredSteps:
        """Return a planner that is steered, and goes on from the velocity granted now; to stop on a plan, from rest."""
        pace, granted = 0.0 if self.phases.rests else self._pace, self.granted
        if isinstance(self.planner, PlanSource) and not self.steering.pending:
            granted = AT_REST
        return SteeredSteps(self.reach, self._drive, self.steering, granted, pace)

    def _has_asked(self, planner: FootstepSource) -> bool:
        """Return True if the last plan is that of a planner by its present order.

        A planner of the user's own whose order fails, or is not to be compared, is asked anew, and refused where it is.
        """
        try:
            return self._asked == (planner, planner.order)
        except Exception:
            return False

    def _is_to_plan(self, planner: FootstepSource) -> bool:
        """Return True if the footsteps are to be planned anew, as the description of this file says."""
        phases, due = self.phases, self.time >= self._next
        if phases.phase is not GaitPhase.SINGLE:
            return self._swung or (due and not isinstance(planner, PlanSource))
        due = due and not self._has_asked(planner) and not phases.comes_to_rest
        self._swung |= not due
        return due

    def plan_steps(self) -> None:
        """Plan the footsteps anew if it is time to."""
        planner, phases, drift = self.planner, self.phases, self.feet.drift
        if planner is None or not self._is_to_plan(planner):
            return
        self._next, self._swung = self.time + REPLAN, False
        feet = phases.plan.feet(phases.step + (phases.swing is not None))
        plan = self._ask(planner, drift.planner_feet(feet))
        if plan is not None:
            self._steer(drift.present_plan(plan))
            self._pace = planner.pace
            self._asked = planner, planner.order  # which may have ended with its answer
            return
        self.steering.command(None)  # the robot comes to a stand
        if not isinstance(planner, (SteeredSteps, PlanSource)):
            self.planner = None  # what one of the user's own grants is refused as well
        self.planner = stand = self._steered_steps()
        plan = self._ask(stand, feet)
        if plan is None:
            plan, first = FootstepPlan(*feet, (), phases.gait), phases.next_side
            plan = plan if first is None else close_up(plan, first)
        self._steer(plan)

    def _ask(self, planner: FootstepSource, feet: Sequence[Footstep]) -> FootstepPlan | None:
        """Return a planner's next steps from where the feet stand, the one that swings where it lands.

        The answer is None where the planner has none, and `reason` says why.
        """
        swings, (left, right) = self.phases.swing is not None, feet
        start, begun = FootstepPlan(left, right, (), self._gait), self.steps_done + swings
        now = Standing(start, self.phases.next_side, begun, swings, self.time, self.reach)
        try:
            return answer_of(planner, now, self.steering.extent, self.dt)
        except PlannerError as error:
            self.reason = str(error)
            return None

    def _steer(self, plan: FootstepPlan) -> None:
        """Replace all steps that have not begun, by none for a stand; a robot that stands sets off."""
        phases = self.phases
        if not plan.steps and phases.ended:
            return  # it stands, or comes to rest
        steps = self.ground.settled(plan.steps, swings=phases.swing is not None)
        self.ground.height = 0.0
        if phases.steer(tuple(steps), plan.gait.full):
            self._started = (Event.STARTED,)
        self.feet.replan()

    # ---- phases -------------------------------------------------------------------------------------------------

    def _change_phase(
        self, loads: Sequence[float], soles: Sequence[pin.SE3], measured: Sequence[pin.SE3] | None
    ) -> tuple[Event, ...]:
        """Change the phase where contact, by the normal force on left and right foot, N, and time say so.

        The feet are at the placements of the `soles` when they lift and when they land.
        """
        weight, phases = self._robot.mass * GRAVITY, self.phases
        if phases.phase is GaitPhase.SINGLE:
            return self._touch_down(loads[1 - phases.stance] / weight, soles)
        if phases.phase is GaitPhase.STANDING or phases.elapsed < phases.duration - ROUNDING:
            return ()
        if phases.ended:
            phases.stand()
            return (Event.STOPPED,)
        s, leaving = self.settings.phases, SIDES.index(phases.landing.side)
        free = loads[leaving] <= s.lift_off * weight and loads[1 - leaving] >= s.stance * weight
        if not free and phases.elapsed < phases.duration + s.max_wait - ROUNDING:
            return ()
        self._loaded = 0.0
        self.feet.lift(soles, measured)
        return (Event.LIFT_OFF if free else Event.FORCED_LIFT_OFF,)

    def _touch_down(self, load: float, soles: Sequence[pin.SE3]) -> tuple[Event, ...]:
        """End the single support where the swing foot has met the ground, by its load over the weight, or must."""
        s, phases, credit = self.settings.phases, self.phases, 0.0
        loaded = load >= s.touch_down
        self._loaded = self._loaded + self.dt if loaded else 0.0
        touched = loaded and self._loaded >= DEBOUNCE - ROUNDING
        left = phases.duration - phases.elapsed
        if left > ROUNDING:
            if not (touched and phases.elapsed >= s.early * phases.duration):
                return ()
            event, credit = Event.EARLY_TOUCH_DOWN, left  # for the double support: the rhythm is kept
        elif touched:
            event = touch_down(-left, ROUNDING, 0.5 * HOLD)
        elif left <= -s.max_late + ROUNDING:
            event = Event.NO_TOUCH_DOWN if s.max_late > 0.0 else Event.TOUCH_DOWN
        else:
            return ()
        self.feet.land(soles, credit)
        self.steps_done += 1
        return (event,)

    # ---- the tick -----------------------------------------------------------------------------------------------

    def update(self, state: State) -> Reference:
        """Plan the footsteps anew if it is time to, and return the references of the walk."""
        # Filtered loads: a foot that has just met the ground presses in jerks.
        places, measured = state.robot.data.oMf, None
        if self.phases.swing is None:  # else no foot can lift
            measured = [places[frame] for frame in self._frames]
        return self.advance(state.load.tolist(), self._soles, state.dcm, state.turned, measured)

    def advance(
        self,
        loads: Sequence[float],
        soles: Sequence[pin.SE3] | None = None,
        dcm: Array | None = None,
        turned: float = 0.0,
        measured: Sequence[pin.SE3] | None = None,
    ) -> Reference:
        """Compute one tick.

        Args:
            loads: Normal forces on left and right foot, N.
            soles: Placements of the soles as they are; as planned when None.
            dcm: Measured DCM, m; None leaves landings as planned.
            turned: Angle by which soles have turned on the ground in the last period, rad.
            measured: Placements of the soles by the encoders; None for those of `soles`.
        """
        self.plan_steps()
        phases, course, feet = self.phases, self.course, self.feet
        self.time += self.dt
        course.advance(self.dt)
        phases.elapsed += self.dt
        if phases.phase is not GaitPhase.STANDING:
            feet.drift.turn(turned)
        events = self._started + self._change_phase(loads, feet.places if soles is None else soles, measured)
        self._started = ()
        if events or (phases.overdue and course.since >= 0.5 * HOLD - ROUNDING):
            if course.since > 0.0:  # a swing that begins has planned already
                course.plan()
        elif dcm is not None and self._adjuster is not None:
            feet.adjust(dcm, self._adjuster)
        if self.ground.news:
            feet.look()
        motions = feet.motions()
        self.progress = self._record(events)
        return Reference(course.pendulum(), motions, self.progress)

    def _record(self, events: tuple[Event, ...] = ()) -> Progress:
        """Return the record of the step as it is now, with the events of a tick."""
        now, swing = self.phases, self.phases.swing
        return Progress(
            phase=now.phase,
            stance=now.stance,
            swing=swing,
            contact=(swing != 0, swing != 1),
            heading=self.feet.heading,
            steps_done=self.steps_done,
            elapsed=now.elapsed,
            duration=now.duration,
            upcoming=now.plan.steps[now.step :],
            cycle=now.gait.cycle,
            events=events,
        )
