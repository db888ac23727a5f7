"""One step on one foot: its time and place are decided as the robot goes, until the foot that has landed takes over.

    step.begin(footsteps, climbs=…, out=…)  at lift-off; `SetOff` in the first step out of a stand
    events = step.update(asked, frames)     push on the swing foot, expected ground, decision, contact
    step.is_over(asked)                     the foot that has landed is to carry
    supported = step.end(asked)             what the landing says of the ground
    step.references()                       CoM, forces of the feet, centre of pressure

`Asked` says what the steering asks for in this tick; the footsteps of a step do not change while it lasts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from wbc.base.numbers import lag_gain
from wbc.base.vectors import Point
from wbc.core.robot import SIDES
from wbc.walking.contact import Event, touch_down
from wbc.walking.ground import LAST_LOOK, GroundEstimate
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.gait import SwingShape
from wbc.walking.stepping.course import FallCourse, PhaseReference
from wbc.walking.stepping.decision import StepDecision, StepState, steps_of_plan, steps_of_velocity
from wbc.walking.stepping.felt import Felt, Frames
from wbc.walking.stepping.law import SIDE, SIDEWAYS, Orbit, StanceAxes
from wbc.walking.stepping.path import StepVelocity
from wbc.walking.stepping.settings import GaitValues, swing_shape
from wbc.walking.stepping.touch import SwingTouch
from wbc.walking.swing import RISE, SwingFoot

LOOKS = 2
"""Number of decisions between two looks at the ground under a landing that moves with each of them."""

ON_TIME = 0.05
"""Part of a step by which a contact may be early or late and is on time."""

HALF = 0.5
"""Part of the way up or down a stair by which the CoM rises or sinks before the foot lands: a leg reaches no deeper,
and a knee that is bent further has no torque to spare."""

STAIR = {"edge": 0.25, "apex": 0.5, "heel": 0.5, "stair": 0.0, "level": 1.0}
"""Shape of the swing on stairs: a sole as long as the tread travels later up and earlier down, above the edge, and up
with its heel first: level behind the body it would meet the end of the ankle's range, and turn the pelvis."""


class Asked(NamedTuple):
    """Steps that are asked for in one tick."""

    steps: StepVelocity  # velocity of the next steps; of footsteps that of the one that swings
    speed: float  # speed of the steps without their way back to a path, m/s
    fast_share: float  # share from 0 to 1 by which the walk is a fast one
    heading: float  # heading of the steps, rad
    direction: Point  # its cosine and sine
    turn: float  # turn of the steps, rad/s
    time: float  # time T of a step, s


class SetOff(NamedTuple):
    """First step out of a stand."""

    pace: float  # time that the steps take, s
    walks: bool = False  # the robot walks already: its foot is in the air, with a speed
    kicked: bool = False  # the foot has been pushed off the ground


class SingleSupport:
    """Step of one walk: one foot stands, and the other one swings.

    Attributes:
        course: Planned motion of the centre of mass.
        decision: Decision of the step.
        touch: Contact of the swing foot.
        first: True in the step that begins in a stand.
        nominal: Time T of a step that is asked for, s.
        duration: Time of the step, s.
        swing: Swing of this step, which has its landing; None before the first decision on it, and after the step.
        met: Time since lift-off at which the swing foot met the ground while the other one still carries, s; else None.
    """

    def __init__(self, values: GaitValues, felt: Felt, ground: GroundEstimate) -> None:
        """Make all parts."""
        settings, constants, scale, dt = values
        self._s, self._c, self._felt, self._ground = settings, constants, felt, ground
        self.course = FallCourse(scale, dt)
        self._dt, self._period = dt, max(1, round(constants.period / dt))  # of decisions, ticks
        self._time_gain = lag_gain(dt, constants.time_lag)
        self._level_gain = lag_gain(dt, constants.level_lag)
        self._shape = swing_shape(settings, constants)
        self.decision = StepDecision(values, ground)
        self.touch = SwingTouch(values, felt, ground)
        self.first, self.nominal, self.duration = True, settings.step_time, 0.0
        self.swing: SwingFoot | None = None
        self.met: float | None = None
        self._ticks = 0  # with a decision on time and place that is open
        self._pace = settings.step_time  # mean time of the last steps, s
        self._feet_height = 0.0  # of the feet that carry, low-passed, m
        self._footsteps: Sequence[Footstep] = ()  # from the one that swings on; none of steps by a velocity
        self._climbs = False  # the landing is a stair, of footsteps or seen
        self._walks = False  # the robot has been in this step before the walk began
        self._planned: Orbit | None = None  # offsets of ξ in this step, along footsteps
        self._stood = 0.0  # height of the foot that stands to which the expected ground belongs, m
        self._tilt = 0.0, 0.0  # pitch and roll of the landing, rad

    # ---- from lift-off to take-over -----------------------------------------------------------------------------

    def begin(
        self, footsteps: Sequence[Footstep] = (), *, climbs: bool = False, out: SetOff | None = None
    ) -> None:
        """Begin a step on the foot that stands.

        Args:
            footsteps: Footsteps from that of the foot that swings on; none of a step by a velocity.
            climbs: True if they climb stairs, up or down.
            out: The first step out of a stand; None for a step that follows another one.
        """
        stands = self._felt.state.places[self._felt.stance][2]
        self.first, self._walks = out is not None and not out.walks, out is not None and out.walks
        self._footsteps, self._climbs, self._planned = footsteps, climbs, None
        self._stood, self._tilt = stands, (0.0, 0.0)
        self.decision.begin()
        self.touch.begin()
        if out is not None:
            self._pace, self._feet_height = out.pace, stands
            self._ground.height = stands
            if out.kicked:
                self.touch.push()
        if footsteps:
            self._ground.height = footsteps[0].z

    def update(self, asked: Asked, frames: Frames) -> tuple[Event, ...]:
        """Decide time and place of the step, move the swing foot, and detect its contact."""
        touch = self.touch
        if self.swing is not None:
            touch.notice_push(self.decision.urgency, self.duration / asked.time, asked.speed)
        self._follow_ground()
        self.decide(asked, frames)
        events = self._meet(asked, frames)
        # Footsteps are planned from where feet are to carry, and those meet the ground at an inner edge.
        touch.track(met=self.met is not None, at_edge=not self._footsteps)
        return events

    def is_over(self, asked: Asked) -> bool:
        """Return True if the foot that has landed is to carry."""
        if self.met is None:
            return False
        c, fast_share = self._c, asked.fast_share
        patience = c.patience_of_plans if self._footsteps else c.patience
        patience += fast_share * (1.0 - patience)  # a fast walk needs all of its time
        late = self._felt.elapsed > max(self._longest(asked), self._waits(asked))
        axes, orbit = self._axes(asked), self._orbit(asked)
        return self.touch.is_to_carry(axes, orbit, patience, fast_share, late=late)

    def end(self, asked: Asked) -> float:
        """End a step whose foot has landed; return the width that its sole has held: see `PathSteering.supported`."""
        assert self.swing is not None
        c, felt, (left, right) = self._c, self._felt, self._felt.state.places
        self._pace += c.pace_gain * (min(felt.elapsed, self._longest(asked)) - self._pace)
        unexpected = (left, right)[felt.swing][2] - self.swing.landing.z
        # Stairs are rough ground only where they are not as expected.
        self._ground.land(unexpected, unexpected if self._climbs else left[2] - right[2])
        self.swing = self.met = None
        return min(self.decision.area.width / c.slow_width, 1.0)

    def references(self) -> PhaseReference:
        """Return the references of a tick."""
        c, felt, state, touch = self._c, self._felt, self._felt.state, self.touch
        self._feet_height += self._level_gain * (self._com_ground() - self._feet_height)
        most = touch.most_forces(met=self.met is not None, stepped=not self.first)
        ahead, aside = cop = self.decision.cop
        motion = self.course.fall(state, state.on_sole(felt.stance, c.carrying + ahead, aside))
        urgency = -1.0 if touch.pushed else self.decision.urgency
        return PhaseReference(motion, self._feet_height, most, cop=cop, urgency=urgency)

    # ---- the ground ---------------------------------------------------------------------------------------------

    def _com_ground(self) -> float:
        """Return the height over which the CoM is to be, m: on stairs it goes half of the way before the landing."""
        stands = self._felt.state.places[self._felt.stance][2]
        return stands + HALF * (self._ground.height - stands) if self._climbs else stands

    def _follow_ground(self) -> None:
        """Move the expected ground with the foot that stands.

        This foot stays where it is. What moves is its estimate, after impacts and flights, and without the ground the
        swing foot would end above the true one.
        """
        moved = self._felt.state.places[self._felt.stance][2] - self._stood
        if abs(moved) > self._c.drifted and self._ground.sight is None:
            self._ground.height += moved
            self._stood += moved

    def _look(self, landing: Footstep, lifted: float) -> Footstep:
        """Return a landing at the height and tilt of the ground seen under it, which are expected from now on.

        Footsteps say where stairs are. Another landing is a stair where it lies far above or below the foot that
        stands, or the place from which the other one was `lifted`, m.
        """
        landing = self._ground.choose(landing)
        self._ground.height = landing.z
        self._tilt = landing.pitch, landing.roll
        if not self._footsteps:
            stands = self._felt.state.places[self._felt.stance][2]
            self._climbs = max(abs(landing.z - stands), abs(landing.z - lifted)) > self._c.stair
        return landing

    # ---- time and place -----------------------------------------------------------------------------------------

    def decide(self, asked: Asked, frames: Frames) -> None:
        """Decide time, place and centre of pressure of the step, and send the swing foot there."""
        self.nominal = asked.time
        if self.met is not None:
            return
        felt, state, decision = self._felt, self._felt.state, self.decision
        swing, self._ticks = self.swing, self._ticks + 1
        evenness = self._ground.level(*self._c.even)
        decision.area.update(state.tilting(felt.stance), state.wrenches[felt.stance], evenness)
        decides = swing is None or self._ticks % self._period == 0
        if decides:
            self._solve(asked)
        self.duration = self._step_time(asked)
        decision.press()
        if swing is None:
            self._begin_swing(self._landing(asked), asked, frames)
            return
        thrown = self.touch.thrown(swing)
        if not decides and thrown is None:
            return
        landing, touch = self._landing(asked), self._touch_time(asked)
        shape, over = swing.shape, -math.inf
        looks = self._ground.sight is not None and self._ticks // self._period % LOOKS == 0
        if looks and touch - felt.elapsed > LAST_LOOK:
            landing = self._look(landing, swing.lifted)
            shape, over = self._swing_shape(), self._ground.way(frames[felt.swing], landing)
        if thrown is not None:
            swing.restart(felt.elapsed, frames[felt.swing], thrown, self._c.swing_push)
        if decision.closes:
            shape = shape._replace(landing_speed=self._c.hardest)
        swing.retarget(felt.elapsed, landing, touch, shape, over)

    def _solve(self, asked: Asked) -> None:
        """Decide the step by what stands now."""
        c, footsteps, stance = self._c, self._footsteps, self.step_state(asked)
        self.course.restart()
        stays = self._ground.sight is None or self.swing is None or self.first
        if footsteps:
            omega, width = stance.dcm.omega, self._s.width
            wish = steps_of_plan(footsteps, c.carrying, width, stance.axes, omega, asked.time)
            self._planned = Orbit.of_wish(wish.places, wish.offsets)
            stance = stance._replace(orbit=self._planned)
            stays = stays or len(footsteps) < 3 or footsteps[0].place == "fixed"
        else:
            forward, left = asked.steps.velocity
            longer = 1.0 + asked.fast_share * (self._pace / asked.time - 1.0)
            forward = (forward - asked.steps.made_up) * longer
            wish = steps_of_velocity((forward, left), self._width(asked), stance)
        look = None if stays else self._touch_time(asked) - self._felt.elapsed
        self.decision.decide(stance, wish, look)

    def _step_time(self, asked: Asked) -> float:
        """Return the time of the step, s: that which was decided, low-passed."""
        s, decision, longest = self._s, self.decision, self._longest(asked)
        shortest = min(s.shortest, decision.end) if decision.closes else s.shortest
        time = min(max(decision.end, shortest), longest)
        if self.swing is None:
            time = asked.time if self.first else min(time, self._c.later * asked.time)
        elif not decision.closes:
            time = self.duration + self._time_gain * (time - self.duration)
        return min(max(time, shortest), longest)

    def _landing(self, asked: Asked) -> Footstep:
        """Return the landing that was decided, on the expected ground."""
        yaw = asked.heading + asked.turn * max(self.duration - self._felt.elapsed, 0.0)
        if self._footsteps:
            yaw = self._footsteps[0].yaw
        place, side = self.decision.place, SIDES[self._felt.swing]
        return Footstep(side, *place, self._ground.height, yaw, *self._tilt)

    def _begin_swing(self, landing: Footstep, asked: Asked, frames: Frames) -> None:
        """Begin the swing from where the foot stands, or go on with that of a robot that walks already."""
        c, felt, ground, touch = self._c, self._felt, self._ground, self._touch_time(asked)
        ground.lift(felt.stance, frames[felt.stance])
        start = frames[felt.swing]
        landing = self._look(landing, float(start.translation[2]))
        self.swing = swing = SwingFoot(start, landing, touch, self._swing_shape(), ground.way(start, landing))
        if self._walks:
            swing.join(felt.elapsed, start, felt.state.speeds[felt.swing], ground.height, c.swing_push)
            swing.retarget(felt.elapsed, landing, touch)

    def _swing_shape(self) -> SwingShape:
        """Return the shape of the swing: on level ground, on rough ground, or on stairs."""
        c = self._c
        speed = min(c.landing_speed + c.landing_gain * self._ground.uneven, c.hardest)
        stair = STAIR if self._climbs else {}
        return self._shape._replace(landing_speed=speed, **stair)

    def step_state(self, asked: Asked) -> StepState:
        """Return the state that the step is decided by."""
        felt, (u, v) = self._felt, self.decision.lagged
        return StepState(
            axes=self._axes(asked),
            cop_command=felt.state.on_sole(felt.stance, self._c.carrying + u, v),
            contact=felt.contact,
            dcm=felt.dcm,
            orbit=self._orbit(asked),
            nominal=asked.time,
            longest=self._longest(asked),
            elapsed=felt.elapsed,
            swing=self._swinging(),
            down=self._time_down(),
            climbs=self._climbs,
        )

    def _axes(self, asked: Asked) -> StanceAxes:
        """Return the axes about the carrying point of the foot that stands."""
        felt = self._felt
        return StanceAxes(SIDE[felt.stance], asked.direction, felt.carrying_point(felt.stance))

    def _orbit(self, asked: Asked) -> Orbit:
        """Return the orbit of the steps that are asked for."""
        if self._planned is not None:
            return self._planned
        felt, velocity, width = self._felt, asked.steps.velocity, self._width(asked)
        return Orbit.of(velocity, SIDE[felt.stance], width, asked.time, self._pace, felt.dcm.omega)

    def _width(self, asked: Asked) -> float:
        """Return the distance between feet, m: of a robot that walks sideways they come apart and together."""
        s = self._s
        return max(s.width, s.gap + abs(asked.steps.velocity[1]) * asked.time / SIDEWAYS)

    def _swinging(self) -> tuple[float, float, float, float]:
        """Return place, m, and velocity, m/s, of the swing foot over the ground, by its reference."""
        if self.swing is None:
            x, y, _ = self._felt.state.places[self._felt.swing]
            return x, y, 0.0, 0.0
        (x, y, _), (u, v, _) = self.swing.motion(self._felt.elapsed)
        return x, y, u, v

    def _time_down(self) -> float:
        """Return the time that the swing foot needs to come straight down, s."""
        height = max(self._felt.state.places[self._felt.swing][2] - self._ground.height, 0.0)
        return self._c.piece + math.sqrt(RISE * height / self._c.lift)

    # ---- contact of the swing foot ------------------------------------------------------------------------------

    def _meet(self, asked: Asked, frames: Frames) -> tuple[Event, ...]:
        """Detect that the swing foot has met the ground, or has lost it again."""
        swing, touch, elapsed = self.swing, self.touch, self._felt.elapsed
        if swing is None:
            return ()
        if self.met is None:
            if touch.bears(self.duration) and not self.rubs(asked, swing.landing):
                self.met = elapsed
                soon = ON_TIME * self._s.step_time
                return (touch_down(elapsed - self._touch_time(asked), soon, soon),)
        elif touch.loses(elapsed - self.met):
            self.met = None
            swing.resume(elapsed, frames[self._felt.swing])
        return ()

    def rubs(self, asked: Asked, landing: Footstep) -> bool:
        """Return True if the swing foot is to go on to its landing over what it has met; see `SwingTouch.rubs`."""
        left = self._touch_time(asked) - self._felt.elapsed
        return self.touch.rubs(self._axes(asked), self._orbit(asked), left, landing)

    def _touch_share(self, asked: Asked) -> float:
        """Return the share of the time of a step at which the foot meets the expected ground."""
        c = self._c
        if self._footsteps:
            return c.touch_of_plans
        return c.touch + asked.fast_share * (c.late_touch - c.touch)

    def _touch_time(self, asked: Asked) -> float:
        """Return the time of this step at which the foot meets the expected ground, s."""
        return self._touch_share(asked) * self.duration

    def _longest(self, asked: Asked) -> float:
        """Return the longest time of this step, s."""
        return self._s.longest * asked.time

    def _waits(self, asked: Asked) -> float:
        """Return until when since lift-off a foot on the ground may wait, s: a late one as long as others."""
        return (self.met or 0.0) + (self._s.longest - self._touch_share(asked)) * asked.time
