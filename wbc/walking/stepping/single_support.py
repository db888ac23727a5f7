"""One step on one foot: its time and place are decided as the robot goes, until the foot that has landed takes over."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from wbc.base.numbers import lag_gain
from wbc.base.vectors import Point, Vector
from wbc.core.robot import SIDES
from wbc.walking.contact import Event, touch_down
from wbc.walking.ground import LAST_LOOK, GroundEstimate
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.gait import SwingShape
from wbc.walking.plans.swing import RISE, SwingFoot
from wbc.walking.stepping.course import FallCourse, PhaseReference
from wbc.walking.stepping.decision import StepDecision, StepState
from wbc.walking.stepping.felt import GaitState
from wbc.walking.stepping.law import SIDE, Orbit, StanceAxes
from wbc.walking.stepping.path import Asked
from wbc.walking.stepping.settings import GaitValues, swing_shape
from wbc.walking.stepping.touch import SwingTouch

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


class SetOff(NamedTuple):
    """First step out of a stand."""

    pace: float  # time that the steps take, s
    walks: bool = False  # the robot walks already: its foot is in the air, with a speed
    kicked: bool = False  # the foot has been pushed off the ground


@dataclass(slots=True)
class OneStep:
    """State of one step, from its lift-off on."""

    stood: float  # height of the foot that stands to which the expected ground belongs, m
    climbs: bool  # true for a landing on a stair, of footsteps or seen
    out: SetOff | None  # the first step out of a stand; None for a step that follows another one
    tilt: Point = (0.0, 0.0)  # pitch and roll of the landing, rad
    orbit: Orbit | None = None  # offsets of ξ along footsteps by the last decision; None by a velocity


class SingleSupport:
    """Step of one walk: one foot stands, and the other one swings.

    Attributes:
        asked: Steps that are asked for in this tick.
        course: Planned motion of the centre of mass.
        decision: Decision of the step.
        touch: Contact of the swing foot.
        duration: Time of the step, s.
        swing: Swing of this step, which has its landing; None before the first decision on it, and after the step.
        met: Time since lift-off at which the swing foot met the ground while the other one still carries, s; else None.
    """

    asked: Asked

    def __init__(self, values: GaitValues, felt: GaitState, ground: GroundEstimate) -> None:
        """Make all parts."""
        settings, constants, scale, dt = values
        self._settings, self._law, self._felt, self._ground = settings, constants, felt, ground
        self.course = FallCourse(scale, dt)
        self._period = max(1, round(constants.time.period / dt))  # of decisions, ticks
        self._time_gain = lag_gain(dt, constants.time.time_lag)
        self._level_gain = lag_gain(dt, constants.swing.level_lag)
        self._shape = swing_shape(settings, constants)
        self.decision = StepDecision(values, ground)
        self.touch = SwingTouch(values, felt, ground)
        self.duration = 0.0
        self.swing: SwingFoot | None = None
        self.met: float | None = None
        self._one = OneStep(0.0, climbs=False, out=None)
        self._ticks = 0  # with a decision on time and place that is open
        self._pace = settings.step_time  # mean time of the last steps, s
        self._feet_height = 0.0  # of the feet that carry, low-passed, m

    # ---- from lift-off to take-over -----------------------------------------------------------------------------

    def begin(self, ground: float | None = None, *, climbs: bool = False, out: SetOff | None = None) -> None:
        """Begin a step on the foot that stands.

        Args:
            ground: Height of the landing by footsteps, m; None without them.
            climbs: True for footsteps that climb stairs, up or down.
            out: The first step out of a stand; None for a step that follows another one.
        """
        stands = self._stands
        self._one = OneStep(stands, climbs, out)
        self.decision.begin()
        self.touch.begin()
        if out is not None:
            self._pace, self._feet_height = out.pace, stands
            self._ground.height = stands
            if out.kicked:
                self.touch.push()
        if ground is not None:
            self._ground.height = ground

    @property
    def first(self) -> bool:
        """True in the step that begins in a stand."""
        return self._one.out is not None and not self._one.out.walks

    @property
    def _stands(self) -> float:
        """Height of the foot that stands, m."""
        return self._felt.state.places[self._felt.stance][2]

    def update(self, asked: Asked) -> tuple[Event, ...]:
        """Decide time and place of the step, move the swing foot, and detect its contact."""
        touch = self.touch
        if self.swing is not None:
            touch.notice_push(self.decision.urgency, self.duration / asked.time, asked.speed)
        self._follow_ground()
        self.decide(asked)
        events = self._meet()
        # Footsteps are planned from where feet are to carry, and those meet the ground at an inner edge.
        touch.track(met=self.met is not None, at_edge=not asked.footsteps)
        return events

    def is_over(self) -> bool:
        """Return True if the foot that has landed is to carry."""
        if self.met is None:
            return False
        # A foot on the ground may wait: a late one as long as others.
        waits = self.met + (self._settings.longest - self.asked.touch_share(self._law)) * self.asked.time
        late = self._felt.elapsed > max(self._longest, waits)
        patience, fast_share = self.asked.patience(self._law), self.asked.fast_share
        return self.touch.is_to_carry(self._axes(), self._orbit(), patience, fast_share, late=late)

    def end(self) -> float:
        """End a step whose foot has landed; return the width that its sole has held: see `PathSteering.supported`."""
        assert self.swing is not None
        law, felt, (left, right) = self._law, self._felt, self._felt.state.places
        self._pace += law.time.pace_gain * (min(felt.elapsed, self._longest) - self._pace)
        unexpected = (left, right)[felt.swing][2] - self.swing.landing.z
        # Stairs are rough ground only where they are not as expected.
        self._ground.land(unexpected, unexpected if self._one.climbs else left[2] - right[2])
        self.swing = self.met = None
        return min(self.decision.area.width / law.area.slow_width, 1.0)

    def references(self) -> PhaseReference:
        """Return the references of a tick."""
        law, felt, state, touch = self._law, self._felt, self._felt.state, self.touch
        self._feet_height += self._level_gain * (self._com_ground() - self._feet_height)
        most = touch.most_forces(met=self.met is not None, stepped=not self.first)
        ahead, aside = cop = self.decision.cop
        motion = self.course.fall(state, state.on_sole(felt.stance, law.area.carrying + ahead, aside))
        urgency = -1.0 if touch.pushed else self.decision.urgency
        return PhaseReference(motion, self._feet_height, most, cop=cop, urgency=urgency)

    # ---- the ground ---------------------------------------------------------------------------------------------

    def _com_ground(self) -> float:
        """Return the height over which the CoM is to be, m: on stairs it goes half of the way before the landing."""
        stands = self._stands
        return stands + HALF * (self._ground.height - stands) if self._one.climbs else stands

    def _follow_ground(self) -> None:
        """Move the expected ground with the foot that stands, while it bears.

        This foot stays where it is. What moves is its estimate, after impacts and flights, and without the ground the
        swing foot would end above the true one. A foot that bears nothing was kicked away, and flies over the ground.
        """
        felt, law, moved = self._felt, self._law, self._stands - self._one.stood
        bears = felt.state.wrenches[felt.stance][2] > law.touch.held
        if bears and abs(moved) > law.touch.drifted and self._ground.sight is None:
            self._ground.height += moved
            self._one.stood += moved

    def _on_seen_ground(self, landing: Footstep, lifted: float) -> Footstep:
        """Return a landing at the height and tilt of the ground seen under it; expect these from now on.

        Footsteps say where stairs are. Another landing is a stair where it lies far above or below the foot that
        stands, or the place from which the other one was `lifted`, m.
        """
        landing = self._ground.choose(landing)
        self._ground.height, self._one.tilt = landing.z, (landing.pitch, landing.roll)
        if not self.asked.footsteps:
            high = max(abs(landing.z - self._stands), abs(landing.z - lifted))
            self._one.climbs = high > self._law.swing.stair
        return landing

    # ---- time and place -----------------------------------------------------------------------------------------

    def decide(self, asked: Asked) -> None:
        """Decide time, place and centre of pressure of the step, and send the swing foot there."""
        self.asked = asked
        if self.met is not None:
            return
        felt, state, decision = self._felt, self._felt.state, self.decision
        swing, self._ticks = self.swing, self._ticks + 1
        evenness = self._ground.level(*self._law.area.even)
        decision.area.update(state.tilting(felt.stance), state.wrenches[felt.stance], evenness)
        decides = swing is None or self._ticks % self._period == 0
        if decides:
            self._solve()
        self.duration = self._step_time()
        decision.press()
        if swing is None:
            self._begin_swing()
            return
        thrown = self.touch.thrown(swing)
        if decides or thrown is not None:
            self._retarget(swing, thrown)

    def _solve(self) -> None:
        """Decide the step by what stands now."""
        state, asked = self.step_state(), self.asked
        self.course.restart()
        wish = asked.wish(state, self._settings, self._law.area.carrying, self._pace)
        if asked.footsteps:
            self._one.orbit = orbit = Orbit.of_wish(wish.places, wish.offsets)
            state = state._replace(orbit=orbit)
        steps = asked.footsteps  # those that are fixed, and the last ones, stay on seen ground
        stays = self._ground.sight is None or self.swing is None or self.first
        stays |= bool(steps) and (len(steps) <= 2 or steps[0].fixed)
        self.decision.decide(state, wish, None if stays else self._touch_time() - self._felt.elapsed)

    def _step_time(self) -> float:
        """Return the time of the step, s: that which was decided, low-passed."""
        settings, decision, longest, nominal = self._settings, self.decision, self._longest, self.asked.time
        shortest = min(settings.shortest, decision.end) if decision.closes else settings.shortest
        time = min(max(decision.end, shortest), longest)
        if self.swing is None:
            time = nominal if self.first else min(time, self._law.time.later * nominal)
        elif not decision.closes:
            time = self.duration + self._time_gain * (time - self.duration)
        return min(max(time, shortest), longest)

    def _landing(self) -> Footstep:
        """Return the landing that was decided, on the expected ground."""
        felt, yaw = self._felt, self.asked.yaw(self.duration - self._felt.elapsed)
        return Footstep(SIDES[felt.swing], *self.decision.place, self._ground.height, yaw, *self._one.tilt)

    def _begin_swing(self) -> None:
        """Begin the swing from where the foot stands, or go on with that of a robot that walks already."""
        felt, ground, touch, out = self._felt, self._ground, self._touch_time(), self._one.out
        ground.lift(felt.stance, felt.frames[felt.stance])
        start = felt.frames[felt.swing]
        landing = self._on_seen_ground(self._landing(), float(start.translation[2]))
        self.swing = swing = SwingFoot(start, landing, touch, self._swing_shape(), ground.way(start, landing))
        if out is not None and out.walks:
            speed, most = felt.state.speeds[felt.swing], self._law.swing.swing_push
            swing.join(felt.elapsed, start, speed, ground.height, most)
            swing.retarget(felt.elapsed, landing, touch)

    def _retarget(self, swing: SwingFoot, thrown: Vector | None) -> None:
        """Send the swing foot to the landing that was decided; one that was thrown off has a velocity, m/s."""
        felt, ground, landing, touch = self._felt, self._ground, self._landing(), self._touch_time()
        here, shape, over = felt.frames[felt.swing], swing.shape, -math.inf
        looks = ground.sight is not None and self._ticks // self._period % LOOKS == 0
        if looks and touch - felt.elapsed > LAST_LOOK:
            landing = self._on_seen_ground(landing, swing.lifted)
            shape, over = self._swing_shape(), ground.way(here, landing)
        if thrown is not None:
            swing.restart(felt.elapsed, here, thrown, self._law.swing.swing_push)
        if self.decision.closes:
            shape = shape._replace(landing_speed=self._law.swing.hardest)
        swing.retarget(felt.elapsed, landing, touch, shape, over)

    def _swing_shape(self) -> SwingShape:
        """Return the shape of the swing: on level ground, on rough ground, or on stairs."""
        law = self._law.swing
        speed = min(law.landing_speed + law.landing_gain * self._ground.uneven, law.hardest)
        return self._shape._replace(landing_speed=speed, **(STAIR if self._one.climbs else {}))

    def step_state(self) -> StepState:
        """Return the state that the step is decided by."""
        felt, (u, v) = self._felt, self.decision.lagged
        return StepState(
            axes=self._axes(),
            cop_command=felt.state.on_sole(felt.stance, self._law.area.carrying + u, v),
            contact=felt.contact,
            dcm=felt.dcm,
            orbit=self._orbit(),
            nominal=self.asked.time,
            longest=self._longest,
            elapsed=felt.elapsed,
            swing=self._swinging(),
            down=self._time_down(),
            climbs=self._one.climbs,
        )

    def _axes(self) -> StanceAxes:
        """Return the axes about the carrying point of the foot that stands."""
        felt = self._felt
        return StanceAxes(SIDE[felt.stance], self.asked.direction, felt.carrying_point(felt.stance))

    def _orbit(self) -> Orbit:
        """Return the orbit of the steps that are asked for."""
        if self._one.orbit is not None:
            return self._one.orbit
        return self.asked.orbit(SIDE[self._felt.stance], self._settings, self._pace, self._felt.dcm.omega)

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
        return self._law.swing.piece + math.sqrt(RISE * height / self._law.swing.lift)

    def _touch_time(self) -> float:
        """Return the time of this step at which the foot meets the expected ground, s."""
        return self.asked.touch_share(self._law) * self.duration

    @property
    def _longest(self) -> float:
        """Longest time of this step, s."""
        return self._settings.longest * self.asked.time

    # ---- contact of the swing foot ------------------------------------------------------------------------------

    def _meet(self) -> tuple[Event, ...]:
        """Detect that the swing foot has met the ground, or has lost it again."""
        swing, touch, elapsed = self.swing, self.touch, self._felt.elapsed
        if swing is None:
            return ()
        if self.met is None:
            if touch.bears(self.duration) and not self.rubs(swing.landing):
                self.met = elapsed
                soon = ON_TIME * self._settings.step_time
                return (touch_down(elapsed - self._touch_time(), soon, soon),)
        elif touch.loses(elapsed - self.met):
            self.met = None
            swing.resume(elapsed, self._felt.frames[self._felt.swing])
        return ()

    def rubs(self, landing: Footstep) -> bool:
        """Return True if the swing foot is to go on to its landing over what it has met; see `SwingTouch.rubs`."""
        left = self._touch_time() - self._felt.elapsed
        return self.touch.rubs(self._axes(), self._orbit(), left, landing)
