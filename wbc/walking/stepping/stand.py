"""A robot on both feet: it stands, shifts its weight before steps, and steps out of pushes."""

from __future__ import annotations

import logging
import math
from abc import abstractmethod
from collections.abc import Sequence

from wbc.base.numbers import lag_gain
from wbc.base.vectors import Point, along
from wbc.core.drive.control import State
from wbc.core.robot import SIDES
from wbc.walking.contact import Event, GaitPhase
from wbc.walking.gait import REPLAN, GaitMachine
from wbc.walking.ground import GroundEstimate
from wbc.walking.plans.footsteps import LEAST_STAIR, Footstep
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.reach import Extent, Reach, over
from wbc.walking.plans.sources import FootstepSource, PlanSource, Velocity
from wbc.walking.source import Reference
from wbc.walking.steering import PathSteering, StepVelocity
from wbc.walking.stepping.course import Course, Motion, shifted
from wbc.walking.stepping.decision import StepDecision, StepState, steps_of_plan
from wbc.walking.stepping.felt import BodyReader, BodyState, Felt, Frames
from wbc.walking.stepping.law import Orbit
from wbc.walking.stepping.settings import (
    RobotSize,
    SteppingConstants,
    SteppingSettings,
    in_si,
    swing_shape,
)
from wbc.walking.stepping.touch import SwingTouch

logger = logging.getLogger(__name__)

SHIFTED = 0.6
"""Part of the standing box to which the weight shifts ahead before footsteps: ξ must not leave the box on the way."""

STILL = StepVelocity((0.0, 0.0), True)
"""Steps in place."""


class StandingWalk(GaitMachine):
    """Base of a walk with free steps: all that it does on both feet; `_step` is that of `SteppingWalk`.

    Attributes:
        settings: Settings in SI units.
        constants: Constants of the law in SI units.
        scale: Size of the robot.
        com_height: Height of the CoM over the soles while walking, m.
        steering: Velocity, goal and heading.
        decision: Decision of the step that swings.
        felt: State of the robot in the last tick, with its contact point and its DCM.
        touch: Contact of the foot in the air.
        course: Planned motion of the centre of mass.
        footsteps: Last answer of the planner, from the step that swings now on; none of a walk that is steered.
    """

    com_height: float
    steering: PathSteering

    def __init__(
        self,
        settings: SteppingSettings,
        scale: RobotSize,
        heading: float,
        dt: float,
        reach: Reach | None = None,
        extent: Extent | None = None,
    ) -> None:
        """Stand, with a heading, rad; an `InputError` for steps that cannot be walked.

        Without a `reach` of the legs, footsteps that are asked of a planner are taken as they are. Without an `extent`
        the ground is endless.
        """
        self.settings, self.scale, self.com_height = settings.in_si(scale), scale, scale.height
        self.constants = c = in_si(SteppingConstants(), scale)
        super().__init__(dt, GroundEstimate(c.ground_share, 0.0, scale.leg / 3.0))
        self.reach, self._extent = reach, extent
        self._shape = swing_shape(self.settings, c)
        self._period = max(1, round(c.period / dt))  # of decisions, ticks
        self._gait = Gait(feet_spacing=self.settings.width)
        self._time_gain, self._level_gain = lag_gain(dt, c.time_lag), lag_gain(dt, c.level_lag)
        self.felt = Felt(scale, c, dt)
        self.course = Course(scale, dt)
        self.touch = SwingTouch(self.felt, self.ground, self.settings, c, dt)
        self.begin(heading)

    def begin(self, heading: float) -> None:
        """Stand where the robot stands now, with a heading, rad; all steps and orders before are forgotten."""
        super().begin(heading)
        s, c, scale, dt = self.settings, self.constants, self.scale, self.dt
        self.course.begin()
        self.touch.begin()
        self.felt.begin(None, 0.0)
        self.steering = PathSteering(s, scale, c, heading, dt, self._extent)
        self.decision = StepDecision(s, c, scale, self.ground, dt)
        self.steering.held = min(self.decision.area.widest / c.slow_width, 1.0)
        self.footsteps: Sequence[Footstep] = ()
        self._idle = False  # while the planner asks for a stand
        self._next = 0.0  # time of the next question to a planner in a stand, s
        self._first = True  # in the step that begins in a stand
        self._planned: Orbit | None = None  # offsets of ξ in this step, along footsteps
        self._pace = self.steering.step_time  # mean time of the last steps, s
        self._tilt = (0.0, 0.0)  # pitch and roll of the landing as seen, rad
        self._level = 0.0  # height of the feet that carry, low-passed, m
        self._stood = 0.0  # height of the foot that stands to which the expected ground belongs, m
        self._from: Point = 0.0, 0.0  # CoM at the start of the shift, less its shift by hands, m
        self._ticks = 0
        self._reader: BodyReader | None = None
        # Times for which each foot has been in the air and on the ground, s, of a robot that walks already; until the
        # first tick, or until its foot swings.
        self._joins: tuple[Sequence[float], Sequence[float]] | None = None
        self.progress = self._record()

    def join(self, air: Sequence[float], landed: Sequence[float]) -> None:
        """Begin anew in the step that a robot is in which walks already, after `begin`.

        A foot in the air swings on from its place and with its velocity. Of two feet on the ground the one that has
        landed a moment ago carries, and the other one swings; the robot stands if both have stood for longer.

        Args:
            air: Time for which the left and the right foot have been in the air, s; 0 for one on the ground.
            landed: Time since each of them has landed, s; 0 for one in the air.
        """
        self._joins = air, landed

    # ---- what is asked for --------------------------------------------------------------------------------------

    @property
    def finished(self) -> bool:
        """True when nothing asks for steps and the robot has stood for as long as a step takes."""
        stood = self.phase is GaitPhase.STANDING and self.elapsed >= self.settings.step_time
        return stood and (self.planner is None or self._idle) and not self.steering.pending

    @property
    def fast_share(self) -> float:
        """Share from 0 to 1 by which the walk is a fast one."""
        return 0.0 if self.footsteps else self.steering.fast_share

    @property
    def granted(self) -> Velocity:
        """Velocity of the steps now: forward (m/s), left (m/s) and turn (rad/s)."""
        return (*self.steering.velocity, self.steering.turn)

    def take(self, planner: FootstepSource | None) -> None:
        """Take footsteps from a planner, from the next step on; None for those of the steering."""
        super().take(planner)
        self._idle, self._next = False, 0.0

    def _plan_steps(self, first: str | None) -> None:
        """Take the planner's footsteps; `first` is the side that steps, None for either.

        A plan that is walked, and a planner that fails, are left. A planner that asks for a stand is asked again.
        """
        climbed, self.footsteps, self.steering.climbs = self.steering.climbs, (), 0.0
        if self.planner is None:
            return
        feet = [Footstep.of(*foot) for foot in zip(SIDES, self._frames, strict=True)]
        plan, self._next = self._ask(self.planner, feet, first), self.time + REPLAN
        if plan is None or (not plan.steps and isinstance(self.planner, PlanSource)):
            reason = self.reason
            self.take(None)
            self.reason = reason
        else:
            self.footsteps, self._idle = plan.steps, not plan.steps
            level = abs(feet[0].z - feet[1].z) < LEAST_STAIR  # else the last stair is still ahead of one foot
            self.steering.climbs = plan.rise or (0.0 if level else climbed)

    # ---- the tick -----------------------------------------------------------------------------------------------

    def update(self, state: State) -> Reference:
        """Decide the step, and return where it leaves the robot."""
        if self._reader is None or self._reader.robot is not state.robot:  # in the first tick
            self._reader = BodyReader(state.robot)
        return self.advance(self._reader.read(state), self._reader.frames)

    @property
    def standing_box(self) -> Point:
        """Half of the box of a sole in which the centre of pressure stays in a stand, along and across it, m."""
        length, width = self.constants.standing_box
        return 0.5 * length, 0.5 * width

    def advance(self, state: BodyState, frames: Frames) -> Reference:
        """Stand, shift the weight or step for a tick; feet that stand keep the placements of left and right sole."""
        self._frames = frames
        self.elapsed += self.dt
        self.time += self.dt
        self.felt.take(state)
        events: tuple[Event, ...] = ()
        if self.phase is GaitPhase.STANDING:
            events = self._stand()
        elif self.phase is GaitPhase.DOUBLE:
            events = self._shift()
        if events:  # another mode begins in this tick, about its own contact
            self.felt.follow()
        return self._step(events) if self.phase is GaitPhase.SINGLE else self._on_both_feet(events)

    # ---- on both feet -----------------------------------------------------------------------------------------

    def _stand(self) -> tuple[Event, ...]:
        """Set off when a velocity, a goal or footsteps ask for it, or step out of a push, or walk on."""
        if self._joins is not None:
            return self._walk_on(*self._joins)
        asks = self.planner is not None and self.time >= self._next
        if self.elapsed > self.constants.rest and (asks or self.steering.pending):
            self._plan_steps(None)
            if self.footsteps:
                self.stance = 1 - SIDES.index(self.footsteps[0].side)
            if self.footsteps or self._steers():
                self._enter(GaitPhase.DOUBLE, self._shift_time + self.constants.rest)
                (x, y, _), (u, v) = self.felt.state.com, self.felt.offset  # hands shift the CoM by −δ
                self._from = x + u, y + v
                return (Event.STARTED,)
        return self._step_out()

    def _shift(self) -> tuple[Event, ...]:
        """Lift the first foot when the weight is on the other one, or step out of a push."""
        if self.elapsed < self.duration:
            return self._step_out()
        return self._begin()

    @property
    def _shift_time(self) -> float:
        """Time in which the weight shifts over the foot that will stand, s."""
        c = self.constants
        return c.shift_to_plans if self.footsteps else c.shift_time

    def _steers(self) -> bool:
        """Return True if a velocity or a goal asks a robot that stands for steps; a goal where it stands does not."""
        self._stay_on_ground()
        return self.steering.pending and not self.steering.arrives(self._middle())

    def _stay_on_ground(self) -> None:
        """Come to a stand where the velocity would lead beyond the ground."""
        if self._extent is not None and self.steering.overruns(self._middle()):
            self.steering.command(None)
            self.reason = f"the velocity leads beyond the ground, which {over(self._extent)}"
            logger.warning("%s; the robot comes to a stand", self.reason)

    def _step_out(self) -> tuple[Event, ...]:
        """Step with the foot on whose side the DCM is, if it has left both soles, or with one that was kicked away."""
        state, dcm = self.felt.state, self.felt.dcm
        kicked = self.felt.kicked()
        if kicked is not None:
            self.stance = 1 - kicked
            events = self._begin()
            self.touch.push(self.elapsed)
            return events
        if self.felt.outside(dcm, 1.0) <= 0.0:
            return ()
        left, right = (abs(self._outwards(dcm.x - place[0], dcm.y - place[1])[1]) for place in state.places)
        self.stance = 0 if left > right else 1
        loads = [row[2] for row in state.wrenches]
        if loads[self.stance] < self.constants.least_force < loads[1 - self.stance]:
            self.stance = 1 - self.stance  # a foot that has been kicked away carries nothing
        return self._begin()

    def _walk_on(self, air: Sequence[float], landed: Sequence[float]) -> tuple[Event, ...]:
        """Begin in the step that the feet are in; see `join`."""
        c, state = self.constants, self.felt.state
        least, loads = c.least_force, [row[2] for row in state.wrenches]
        up = [time > 0.0 for time in air]
        if up[0] == up[1]:
            up = [loads[side] < least < loads[1 - side] for side in (0, 1)]
        if max(loads) < least or not (any(up) or min(landed) < c.landed):
            self._joins = None
            return self._step_out()
        self.stance = up.index(False) if any(up) else int(landed[1] < landed[0])
        events = self._begin()
        self._first = False  # the step takes the time that the DCM leaves it
        # A foot may land in the second half of its step.
        self.elapsed = min(max(air), 0.5 * self.steering.step_time)
        return events

    def _begin(self) -> tuple[Event, ...]:
        """Begin to step from a stand."""
        self._level = self.ground.height = self.felt.state.places[self.stance][2]
        self._first, self._pace = True, self.steering.step_time
        self.steering.rest(self._middle())
        self._lift()
        return (Event.LIFT_OFF,)

    def _on_both_feet(self, events: tuple[Event, ...]) -> Reference:
        """References on both feet: the CoM is held over them, or shifted over one of them."""
        s, c, felt = self.settings, self.constants, self.felt
        feet = [felt.carrying_point(side) for side in (0, 1)]
        middle = [0.5 * (a + b) for a, b in zip(*feet, strict=True)]
        if self.phase is GaitPhase.STANDING:
            motion = middle[0], middle[1], 0.0, 0.0, 0.0, 0.0
        else:
            stance, side = feet[self.stance], self._side
            cos, sin = self.steering.direction
            if self.footsteps:
                self.steering.follows = True
                wish = steps_of_plan(self.footsteps, c.carrying, s.width, self._step_state(STILL))
                grown = math.exp(felt.dcm.omega * self.steering.step_time)
                ahead, inside = (
                    (s + b) / grown for s, b in zip(wish.places[:2], wish.offsets[:2], strict=True)
                )
                most = SHIFTED * 0.5 * c.standing_box[0]
                ahead, inside = min(max(ahead, -most - c.carrying), most - c.carrying), side * inside
            else:
                ahead, inside = 0.0, side * c.shift * s.width / (1.0 + math.exp(felt.dcm.omega * s.step_time))
            goal = stance[0] + cos * ahead - sin * inside, stance[1] + sin * ahead + cos * inside
            motion = shifted(self._from, goal, self.elapsed, self._shift_time)
        return self._references(events, (c.most_force, c.most_force), motion, middle[2])

    # ---- of the steps -----------------------------------------------------------------------------------------

    def _lift(self) -> None:
        """Begin a step."""
        self._enter(GaitPhase.SINGLE, self.steering.step_time)
        self._plan_steps(SIDES[1 - self.stance])
        if self.footsteps:
            self.ground.height = self.footsteps[0].z
        self._planned = None
        self._stood, self._tilt = self.felt.state.places[self.stance][2], (0.0, 0.0)

    @abstractmethod
    def _step(self, events: tuple[Event, ...]) -> Reference:
        """Return the references of a tick of a step."""

    @abstractmethod
    def _step_state(self, steps: StepVelocity) -> StepState:
        """Return the state that a step is decided by."""

    def _enter(self, phase: GaitPhase, duration: float) -> None:
        super()._enter(phase, duration)
        stance = self.stance if phase is GaitPhase.SINGLE else None
        self.felt.begin(stance, 0.0 if phase is GaitPhase.STANDING else self.constants.carrying)
        self.decision.begin()
        self.touch.begin()

    def _ahead(self) -> tuple[float, tuple[Footstep, ...], float]:
        landings = () if self.swing is None else (self.swing.landing,)
        return self.steering.heading, landings, self.settings.step_time

    # ---- geometry ---------------------------------------------------------------------------------------------

    @property
    def _side(self) -> float:
        """1 if the left foot swings, −1 if the right one does."""
        return 1.0 if self.stance == 1 else -1.0

    def _outwards(self, x: float, y: float) -> Point:
        """Return the parts of a vector along the heading and outwards, to the side of the foot that swings."""
        ahead, left = along(self.steering.direction, x, y)
        return ahead, self._side * left

    def _middle(self) -> Point:
        """Return the place of the robot: along the heading that of the CoM, across it the middle of the feet, m."""
        return self.felt.state.middle(self.steering.direction)

    def _references(
        self,
        events: tuple[Event, ...],
        most_force: tuple[float, float],
        motion: Motion,
        level: float,
    ) -> Reference:
        """Return the references of a tick, from the motion of the CoM over feet at a level, m."""
        laden = self.felt.state.mass / self.scale.mass  # by what it holds
        high, speed = self.course.rise(self.felt.state.com[2] - level)
        pendulum = self.course.pendulum(motion, (high + level, speed), self.felt.contact[2])
        flies = None if self.swing is None else self.air
        places = [place if side == flies else place.copy() for side, place in enumerate(self._frames)]
        return self._reference(
            pendulum,
            places,
            events,
            most_push=self.constants.swing_push,
            most_force=(laden * most_force[0], laden * most_force[1]),
            cop=self.decision.cop,
            urgency=-1.0 if self.touch.is_pushed(self.elapsed) else self.decision.urgency,
        )
