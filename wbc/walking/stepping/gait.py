"""Free steps: place and time of every step are decided as the robot goes, from its state to the references of a tick.

    standing ── a velocity, a goal ──▶ shifting ── weight on one foot ──▶ stepping ── slow, feet together ──▶ standing
        └───────────────── a push: the DCM leaves both soles ────────────────▲

`SteppingWalk` decides which of these phases it is in, and its parts do the work of a tick in this order:

    felt.take(state, frames)                state, contact point and DCM of the robot       `felt`
    stand.joined, pushed, shift             on both feet: does a step begin?                `double_support`
    steering.update → Asked                 velocity or footsteps that are asked for        `path`
    step.update(asked)                      on one foot: time, place, contact of the swing  `single_support`
        decision.decide(state, wish)        where and when the foot lands                   `decision`, `program`
        touch.bears, rubs, is_to_carry      whether it has landed, and is to carry          `touch`
    step.end()                              the foot that has landed carries
    stand or step → PhaseReference          CoM, forces of the feet, centre of pressure     `course`

`law` and `program` have the equations, and docs/stepping_law.md the rules.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from typing import Annotated

from wbc.base.checked import checked
from wbc.base.settings import Angle, Period, Positive
from wbc.base.vectors import Point, along
from wbc.core.drive.control import State
from wbc.core.frames import heading
from wbc.core.robot import SIDES, Robot
from wbc.walking.contact import Event, GaitPhase
from wbc.walking.ground import GroundEstimate
from wbc.walking.plans.check import Extent, over
from wbc.walking.plans.footsteps import LEAST_STAIR, Footstep, FootstepPlan, mean_heading
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.reach import Reach
from wbc.walking.plans.sources import (
    REPLAN,
    FootstepSource,
    PlannerError,
    PlanSource,
    Standing,
    Velocity,
    answer_of,
)
from wbc.walking.plans.swing import FootMotion
from wbc.walking.source import Progress, Reference, ReferenceSource
from wbc.walking.stepping.course import HeightCourse
from wbc.walking.stepping.double_support import DoubleSupport
from wbc.walking.stepping.felt import BodyReader, BodyState, Frames, GaitState
from wbc.walking.stepping.path import Asked, PathSteering, StepVelocity
from wbc.walking.stepping.settings import GaitValues, RobotSize, SteppingConstants, SteppingSettings
from wbc.walking.stepping.single_support import SetOff, SingleSupport

logger = logging.getLogger(__name__)

TOLD = 0.01
"""Distance of a landing from its footstep from which on the log tells it, m."""


class SteppingWalk(ReferenceSource):
    """Walk with free steps, which balance the robot: it stands, walks where it is steered, and stands.

    Attributes:
        settings: Settings in SI units.
        constants: Constants of the law in SI units.
        scale: Size of the robot.
        dt: Control period, s.
        com_height: Height of the CoM over the soles while walking, m.
        reach: Reach of the legs, which bounds footsteps that are asked for; None where they are taken as they are.
        ground: What is known of the ground.
        steering: Velocity, goal and heading.
        felt: Phase and stance foot, and the state of the robot in the last tick with its contact point and its DCM.
        height: Height of the centre of mass.
        stand: Both feet on the ground.
        step: The step, on one foot.
        footsteps: Last answer of the planner, from the step that swings now on; none of a walk that is steered.
        stair: Height to the next stair of these, up or down, m; 0 on the level.
        time: Time since the gait began, s.
        steps_done: Steps that have ended with a foot on the ground.
        missed: Distance from its footstep at which the last foot carries, as measured, m; 0 in a walk that is steered.
    """

    com_height: float
    ground: GroundEstimate
    steering: PathSteering

    @checked
    def __init__(
        self,
        settings: SteppingSettings,
        scale: RobotSize,
        heading: Angle,
        dt: Period,
        reach: Reach | None = None,
        extent: Extent | None = None,
        constants: SteppingConstants | None = None,
    ) -> None:
        """Stand, with a heading, rad; an `InputError` for steps that cannot be walked.

        Without a `reach` of the legs, footsteps that are asked of a planner are taken as they are. Without an `extent`
        the ground is endless.
        """
        self._values = GaitValues.of(settings, constants or SteppingConstants(), scale, dt)
        self.settings, self.constants, self.scale, self.dt = self._values
        self.made_for = None, dt
        self.com_height, self.reach, self._extent = scale.height, reach, extent
        self._gait = Gait(feet_spacing=self.settings.width)  # of the footsteps that are asked for
        self.ground = GroundEstimate(self.constants.swing.ground_share, 0.0, scale.leg / 3.0)
        self.begin(heading)

    @staticmethod
    @checked
    def of(
        robot: Robot,
        dt: Period,
        settings: SteppingSettings | None = None,
        com_height: Annotated[Positive, "m"] | None = None,
        extent: Extent | None = None,
        constants: SteppingConstants | None = None,
    ) -> SteppingWalk:
        """Return a walk of a robot, the CoM at a height over its soles, m, or as far down as the settings' `bend`.

        The ground has an extent, m. The constants of the law are the defaults when None.
        """
        s = settings or SteppingSettings()
        towards = heading(robot.placement(robot.base_frame).rotation)
        scale = RobotSize.of(robot, s.bend, com_height)
        walk = SteppingWalk(s, scale, towards, dt, Reach.of(robot, scale.height), extent, constants)
        walk.made_for = robot, dt
        return walk

    def begin(self, heading: float, joins: tuple[Sequence[float], Sequence[float]] | None = None) -> None:
        """Begin where the robot is now, with a heading, rad; all steps and orders before are forgotten.

        The robot stands. One that walks already `joins` in the step that it is in: each foot has been in the air, and
        on the ground, for a time, s; see `WalkingControl.begin`. A foot in the air swings on from its place and with
        its velocity. Of two feet on the ground the one that has landed a moment ago carries, and the other one swings;
        the robot stands if both have stood for longer.
        """
        values, self.felt = self._values, GaitState(self._values)
        self.time, self.steps_done, self.missed = 0.0, 0, 0.0
        self.planner, self.reason = None, ""
        self.footsteps: Sequence[Footstep] = ()
        self.stair = 0.0
        self._idle = False  # while the planner asks for a stand, and after the last step of a plan
        self._next = 0.0  # time of the next question to a planner in a stand, s
        self.ground.forget()
        self.height = HeightCourse(self.scale, self.dt)
        self.stand = DoubleSupport(values, self.felt)
        self.step = SingleSupport(values, self.felt, self.ground)
        supported = min(self.step.decision.area.widest / self.constants.area.slow_width, 1.0)
        self.steering = PathSteering(values, heading, self._extent, supported)
        self._reader: BodyReader | None = None
        self._joins = joins  # until the first tick
        self.progress = self._record()

    # ---- what is asked for --------------------------------------------------------------------------------------

    @property
    def finished(self) -> bool:
        """True when nothing asks for steps and the robot has stood for as long as a step takes."""
        stood = self.felt.phase is GaitPhase.STANDING and self.felt.elapsed >= self.settings.step_time
        return stood and (self.planner is None or self._idle) and not self.steering.pending

    @property
    def fast_share(self) -> float:
        """Share from 0 to 1 by which the walk is a fast one."""
        return 0.0 if self.footsteps else self.steering.fast_share

    @property
    def step_time(self) -> float:
        """Time T of a step now, s."""
        return self.steering.plan_time(self.stair) if self.footsteps else self.steering.step_time

    @property
    def remaining(self) -> Sequence[Footstep] | None:
        """See `ReferenceSource`."""
        return None if self.steering.pending and not self.footsteps else self.footsteps

    @property
    def granted(self) -> Velocity:
        """Velocity of the steps now: forward (m/s), left (m/s) and turn (rad/s)."""
        return (*self.steering.velocity, self.steering.turn)

    @property
    def standing_box(self) -> Point:
        """Half of the box of a sole in which the centre of pressure stays in a stand, along and across it, m."""
        length, width = self.constants.area.standing_box
        return 0.5 * length, 0.5 * width

    def take(self, planner: FootstepSource | None) -> None:
        """Take footsteps from a planner, from the next step on; None for those of the steering."""
        if isinstance(planner, PlanSource):
            planner.begin(self.reach, self._extent)
        super().take(planner)
        self._idle, self._next = False, 0.0

    # ---- the tick -----------------------------------------------------------------------------------------------

    def update(self, state: State) -> Reference:
        """Decide the step, and return where it leaves the robot."""
        if self._reader is None or self._reader.robot is not state.robot:  # in the first tick
            self._reader = BodyReader(state.robot)
        return self.advance(self._reader.read(state), self._reader.frames)

    def advance(self, state: BodyState, frames: Frames) -> Reference:
        """Stand, shift the weight or step for a tick; feet that stand keep the placements of left and right sole."""
        self.time += self.dt
        self.felt.take(state, frames)
        events: tuple[Event, ...] = ()
        if self.felt.phase is not GaitPhase.SINGLE:
            events = self._leave_stand()
        if self.felt.phase is GaitPhase.SINGLE:
            events += self.step.update(self._asked(self._steer()))
            if self.step.is_over():
                events += self._change_feet()
        return self._references(events)

    def _steer(self) -> StepVelocity:
        """Return the velocity of the next steps; of footsteps that of the one that swings."""
        felt, state = self.felt, self.felt.state
        if not self.footsteps:
            self._stay_on_ground()
            self.steering.turn_with(state.heading)
            return self.steering.update((state.com[0], state.com[1]), (state.velocity[0], state.velocity[1]))
        landing, (x, y, _) = self.footsteps[0], state.places[felt.stance]
        (a, _, _), (b, _, _), _ = state.turns[felt.stance]
        ahead, _ = along(self.steering.direction, landing.x - x, landing.y - y)
        going = len(self.footsteps) > 1
        velocity = ahead / self.step_time if going else 0.0
        self.steering.follow((velocity, 0.0), mean_heading(math.atan2(b, a), landing.yaw))
        return StepVelocity((velocity, 0.0), going)

    def _asked(self, steps: StepVelocity) -> Asked:
        """Return what the step is asked for in this tick, with the velocity of the next steps."""
        s = self.steering
        return Asked(
            steps,
            speed=math.hypot(*s.velocity),
            fast_share=self.fast_share,
            heading=s.heading,
            direction=s.direction,
            turn=s.turn,
            time=self.step_time,
            footsteps=self.footsteps,
        )

    def _references(self, events: tuple[Event, ...]) -> Reference:
        """Return the references of a tick in the phase that it has led to."""
        felt, step, steering, state = self.felt, self.step, self.steering, self.felt.state
        if felt.phase is GaitPhase.SINGLE:
            now = step.references()
        elif felt.phase is GaitPhase.STANDING:
            now = self.stand.standing()
        else:
            now = self.stand.shifting(steering.direction, self.step_time)
        high, speed = self.height.rise(state.com[2] - now.feet_height)
        pendulum = self.height.pendulum(now.motion, (high + now.feet_height, speed), felt.contact[2])
        laden = state.mass / self.scale.mass  # by what it holds
        most_force = laden * now.most_force[0], laden * now.most_force[1]
        self.progress = progress = self._record((most_force[0] > 0.0, most_force[1] > 0.0), events)
        feet = [
            step.swing.at(felt.elapsed, self.constants.swing.swing_push)
            if side == progress.air and step.swing is not None
            else FootMotion.at_rest(place.copy())
            for side, place in enumerate(felt.frames)
        ]
        return Reference(
            pendulum, (feet[0], feet[1]), progress, most_force=most_force, cop=now.cop, urgency=now.urgency
        )

    def _record(self, contact: tuple[bool, bool] = (True, True), events: tuple[Event, ...] = ()) -> Progress:
        """Return the record of the step as it is now, with the contacts and events of a tick."""
        step, felt = self.step, self.felt
        swing = felt.swing if felt.phase is GaitPhase.SINGLE else None
        if swing is None:
            shifts = felt.phase is GaitPhase.DOUBLE
            duration, cycle = self.stand.duration if shifts else 0.0, self.step_time
        else:
            duration, cycle = step.duration, step.asked.time
        return Progress(
            phase=felt.phase,
            stance=felt.stance,
            swing=swing,
            contact=contact,
            heading=self.steering.heading,
            steps_done=self.steps_done,
            elapsed=felt.elapsed,
            duration=duration,
            upcoming=() if step.swing is None else (step.swing.landing,),
            cycle=cycle,
            events=events,
            landed=step.met is not None,
            fast_share=self.fast_share,
        )

    # ---- from phase to phase ------------------------------------------------------------------------------------

    def _leave_stand(self) -> tuple[Event, ...]:
        """Walk on, shift the weight, or step, where the feet, the time, orders or a push ask for it."""
        felt, stand, joins = self.felt, self.stand, self._joins
        self._joins = None
        if joins is not None:
            stance = stand.joined(*joins)
            if stance is not None:
                return self._set_off(stance, walks=max(joins[0]))
        elif felt.phase is GaitPhase.DOUBLE:
            stand.delay()
            if felt.elapsed >= stand.duration:
                return self._set_off(felt.stance)
        elif self._is_to_walk():
            return self._shift()
        kicked = felt.kicked()
        stance = stand.pushed(self.steering.direction) if kicked is None else 1 - kicked
        return () if stance is None else self._set_off(stance, kicked=kicked is not None)

    def _is_to_walk(self) -> bool:
        """Return True if a robot that stands is asked for steps; its planner is asked for footsteps."""
        asks = self.planner is not None and self.time >= self._next
        if self.felt.elapsed <= self.constants.stand.rest or not (asks or self.steering.pending):
            return False
        self._plan_steps(None)
        if self.footsteps:
            return True
        self._stay_on_ground()  # a goal where the robot stands asks for nothing
        return self.steering.pending and not self.steering.arrives(self._middle())

    def _shift(self) -> tuple[Event, ...]:
        """Begin to shift the weight over the foot that will stand."""
        stance = self.felt.stance
        if self.footsteps:
            stance = 1 - SIDES.index(self.footsteps[0].side)
        self.stand.shift(self.footsteps)
        self.felt.enter(GaitPhase.DOUBLE, stance)
        return (Event.STARTED,)

    def _set_off(self, stance: int, *, walks: float | None = None, kicked: bool = False) -> tuple[Event, ...]:
        """Begin to step from a stand.

        A robot that walks already has a foot that has been in the air for a time, s; another foot was kicked away.
        """
        out = SetOff(self.step_time, walks is not None, kicked)
        self.steering.rest(self._middle())
        # A foot may land in the second half of its step.
        elapsed = 0.0 if walks is None else min(walks, 0.5 * self.step_time)
        self._lift(stance, elapsed, out)
        return (Event.LIFT_OFF,)

    def _lift(self, stance: int, elapsed: float = 0.0, out: SetOff | None = None) -> None:
        """Begin a step on a foot, for which the planner is asked, at a time since lift-off, s."""
        self.felt.enter(GaitPhase.SINGLE, stance, elapsed)
        if out is None and self._idle and isinstance(self.planner, PlanSource):
            self.footsteps, self.stair = (), 0.0  # a step back to the end of a plan begins in a stand
        else:
            self._plan_steps(SIDES[1 - stance])
        ground = self.footsteps[0].z if self.footsteps else None
        self.step.begin(ground, climbs=bool(self.footsteps and self.stair), out=out)

    def _change_feet(self) -> tuple[Event, ...]:
        """Let the foot that has landed carry; stand if the robot is to stop and can."""
        law, felt, state, steering = self.constants, self.felt, self.felt.state, self.steering
        steering.land(self.step.end())
        landed = felt.swing
        self.steps_done += 1
        self._idle |= isinstance(self.planner, PlanSource) and len(self.footsteps) == 1
        (x, y, _), asked = state.places[landed], self.footsteps[0] if self.footsteps else None
        self.missed = 0.0 if asked is None else math.hypot(x - asked.x, y - asked.y)
        if self.missed > TOLD:
            logger.info(
                "the %s foot has landed %.0f mm beside its footstep; the balance moved the landing by %.0f mm",
                SIDES[landed],
                1e3 * self.missed,
                1e3 * self.step.decision.displaced,
            )
        slow = math.hypot(*steering.velocity) < law.stand.stop_speed
        left, right = state.places
        near = slow and math.hypot(left[0] - right[0], left[1] - right[1]) < law.stand.stop_length
        steps = self.step.asked.steps
        if not steps.go and near and felt.outside(felt.dcm, law.stand.stop_box) <= 0.0:
            felt.enter(GaitPhase.STANDING, landed)
            self.footsteps = ()
            steering.rest(self._middle())
            return (Event.STOPPED,)
        self._lift(landed)
        self.step.decide(self._asked(steps))
        return (Event.LIFT_OFF,)

    # ---- what asks for steps ------------------------------------------------------------------------------------

    def _plan_steps(self, first: str | None) -> None:
        """Take the planner's footsteps; `first` is the side that steps, None for either.

        A planner that fails is left. One that asks for a stand is asked again; a plan is left that has no further step
        for a robot that stands.
        """
        before, self.footsteps, self.stair = self.stair, (), 0.0
        if self.planner is not None:
            left, right = (Footstep.of(*foot) for foot in zip(SIDES, self.felt.frames, strict=True))
            start = FootstepPlan(left, right, (), self._gait)
            now = Standing(start, first, self.steps_done, False, self.time, self.reach)
            self._next = self.time + REPLAN
            try:
                plan = answer_of(self.planner, now, self._extent, self.dt)
            except PlannerError as error:
                self.take(None)
                self.reason = str(error)
                return
            if first is None and not plan.steps and isinstance(self.planner, PlanSource):
                self.take(None)
            else:
                self.footsteps, self._idle = plan.steps, not plan.steps
                climbs = abs(left.z - right.z) >= LEAST_STAIR  # the last stair is still ahead of one foot
                self.stair = plan.rise or (before if climbs else 0.0)

    def _stay_on_ground(self) -> None:
        """Come to a stand where the velocity would lead beyond the ground."""
        if self._extent is not None and self.steering.overruns(self._middle()):
            self.steering.command(None)
            self.reason = f"the velocity leads beyond the ground, which {over(self._extent)}"
            logger.warning("%s; the robot comes to a stand", self.reason)

    def _middle(self) -> Point:
        """Return the place of the robot: along the heading that of the CoM, across it the middle of the feet, m."""
        state, (cos, sin) = self.felt.state, self.steering.direction
        (x, y, _), (left, right) = state.com, state.places
        _, aside = along((cos, sin), 0.5 * (left[0] + right[0]) - x, 0.5 * (left[1] + right[1]) - y)
        return x - sin * aside, y + cos * aside
