"""Free steps: place and time of every step are decided as the robot goes, from its state to the references of a tick.

    standing ── a velocity, a goal ──▶ shifting ── weight on one foot ──▶ stepping ── slow, feet together ──▶ standing
        └───────────────── a push: the DCM leaves both soles ────────────────▲

A step is decided by `wbc.walking.stepping.decision`; `law` and `program` beside it have the equations, and
docs/stepping_law.md the rules.
"""

from __future__ import annotations

import logging
import math

from wbc.base.checked import checked
from wbc.core.frames import heading
from wbc.core.robot import SIDES, Robot
from wbc.walking.contact import Event, GaitPhase, touch_down
from wbc.walking.ground import LAST_LOOK
from wbc.walking.plans.footsteps import Footstep, mean_heading
from wbc.walking.plans.reach import Extent, Reach
from wbc.walking.source import Reference
from wbc.walking.steering import StepVelocity
from wbc.walking.stepping.decision import StepState, steps_of_plan, steps_of_velocity
from wbc.walking.stepping.law import SIDEWAYS, Orbit
from wbc.walking.stepping.settings import RobotSize, SteppingSettings
from wbc.walking.stepping.stand import StandingWalk
from wbc.walking.stepping.touch import SwingStep
from wbc.walking.swing import RISE

logger = logging.getLogger(__name__)

LOOKS = 2
"""Number of decisions between two looks at the ground under a landing that moves with each of them."""

LET_GO = 0.01
"""Distance of a landing from its footstep from which on a walk says that it was let go, m."""

HALF = 0.5
"""Part of the way up or down a stair by which the CoM rises or sinks before the foot lands: a leg reaches no deeper,
and a knee that is bent further has no torque to spare."""

STAIR = {"edge": 0.25, "apex": 0.5, "heel": 0.5, "stair": 0.0, "level": 1.0}
"""Shape of the swing on stairs: a sole as long as the tread travels later up and earlier down, above the edge, and up
with its heel first: level behind the body it would meet the end of the ankle's range, and turn the pelvis."""


class SteppingWalk(StandingWalk):
    """Walk with free steps, which balance the robot: it stands, walks where it is steered, and stands."""

    @staticmethod
    @checked
    def of(
        robot: Robot,
        dt: float,
        settings: SteppingSettings | None = None,
        com_height: float | None = None,
        extent: Extent | None = None,
    ) -> SteppingWalk:
        """Return a walk of a robot, the CoM at a height over its soles, m, or as far down as the settings' `bend`.

        The ground has an extent, m.
        """
        s = settings or SteppingSettings()
        towards = heading(robot.placement(robot.base_frame).rotation)
        scale = RobotSize.of(robot, s.bend, com_height)
        return SteppingWalk(s, scale, towards, dt, Reach.of(robot, scale.height), extent)

    # ---- stepping ---------------------------------------------------------------------------------------------

    def _step(self, events: tuple[Event, ...]) -> Reference:
        """Decide time and place of the step, move the swing foot, and change feet when it has landed."""
        swing, touch = 1 - self.stance, self.touch
        if self.swing is not None:
            paced, speed = self.duration / self.steering.step_time, math.hypot(*self.steering.velocity)
            touch.fly(swing, self.elapsed, self.decision.urgency, paced, speed)
        self._follow_ground()
        steps = self._steer()
        self._decide(steps)
        events = (*events, *self._meet(steps))
        # Footsteps are planned from where feet are to carry, and those meet the ground at an inner edge.
        touch.carry(swing, met=self.met is not None and not self.footsteps)
        if self.met is not None and touch.is_to_carry(self._now(steps)):
            events = (*events, *self._change_feet(steps.go))
            self.felt.follow()
            if self.phase is GaitPhase.STANDING:
                return self._on_both_feet(events)
            self._decide(steps)
        state = self.felt.state
        self._level += self._level_gain * (self._support() - self._level)
        most = touch.most_forces(self.stance, self.elapsed, met=self.met is not None, stepped=not self._first)
        ahead, aside = self.decision.cop
        zmp = state.on_sole(self.stance, self.constants.carrying + ahead, aside)
        return self._references(events, most, self.course.fall(state, zmp), self._level)

    def _support(self) -> float:
        """Return the height over which the CoM is to be, m: on stairs it goes half of the way before the landing."""
        stands = self.felt.state.places[self.stance][2]
        return stands + HALF * (self.ground.height - stands) if self.steering.climbs else stands

    def _now(self, steps: StepVelocity) -> SwingStep:
        """Return the step of this tick."""
        c, fast_share = self.constants, self.fast_share
        patience = c.patience_of_plans if self.footsteps else c.patience
        return SwingStep(
            self.stance,
            self.steering.direction,
            self._orbit(steps),
            self.elapsed,
            self._touch,
            max(self._longest, self._waits),
            fast_share,
            patience + fast_share * (1.0 - patience),  # a fast walk needs all of its time
        )

    def _follow_ground(self) -> None:
        """Move the expected ground with the foot that stands.

        This foot stays where it is. What moves is its estimate, after impacts and flights, and without the ground the
        swing foot would end above the true one.
        """
        moved = self.felt.state.places[self.stance][2] - self._stood
        if abs(moved) > self.constants.drifted and self.ground.sight is None:
            self.ground.height += moved
            self._stood += moved

    def _steer(self) -> StepVelocity:
        """Return the velocity of the next steps; of footsteps that of the one that swings."""
        state = self.felt.state
        if not self.footsteps:
            self._stay_on_ground()
            self.steering.turn_with(state.heading)
            return self.steering.update((state.com[0], state.com[1]), (state.velocity[0], state.velocity[1]))
        landing, (x, y, _) = self.footsteps[0], state.places[self.stance]
        (a, _, _), (b, _, _), _ = state.turns[self.stance]
        ahead, _ = self._outwards(landing.x - x, landing.y - y)
        going = len(self.footsteps) > 1
        velocity = ahead / self.steering.step_time if going else 0.0
        self.steering.along((velocity, 0.0), mean_heading(math.atan2(b, a), landing.yaw))
        return StepVelocity((velocity, 0.0), going)

    def _orbit(self, steps: StepVelocity) -> Orbit:
        """Return the orbit of the steps that are asked for."""
        if self._planned is not None:
            return self._planned
        time, omega = self.steering.step_time, self.felt.dcm.omega
        return Orbit.of(steps.velocity, self._side, self._width(steps), time, self._pace, omega)

    def _width(self, steps: StepVelocity) -> float:
        """Return the distance between feet, m: of a robot that walks sideways they come apart and together."""
        s = self.settings
        return max(s.width, s.gap + abs(steps.velocity[1]) * self.steering.step_time / SIDEWAYS)

    def _decide(self, steps: StepVelocity) -> None:
        """Decide time, place and centre of pressure of the step, and send the swing foot there."""
        if self.met is not None:
            return
        s, c, side, frames = self.settings, self.constants, 1 - self.stance, self._frames
        state = self.felt.state
        swing, self._ticks = self.swing, self._ticks + 1
        self.decision.area.level = self.ground.level(*c.even)
        self.decision.area.update(state.tilting(self.stance), state.wrenches[self.stance])
        decides = swing is None or self._ticks % self._period == 0
        if decides:
            self._solve(steps)
        nominal, longest = self.steering.step_time, self._longest
        shortest = min(s.shortest, self.decision.end) if self.decision.closes else s.shortest
        wanted = min(max(self.decision.end, shortest), longest)
        if swing is None:
            self.duration = nominal if self._first else min(wanted, c.later * nominal)
        elif self.decision.closes:
            self.duration = wanted
        else:
            self.duration += self._time_gain * (wanted - self.duration)
        self.duration = min(max(self.duration, shortest), longest)
        self.decision.press()
        thrown = None if swing is None else self.touch.thrown(side, swing, self.elapsed - self.dt)
        if not decides and thrown is None:
            return
        touch = self._touch
        turn = self.steering.heading + self.steering.turn * max(self.duration - self.elapsed, 0.0)
        if self.footsteps:
            turn = self.footsteps[0].yaw
        landing = Footstep(SIDES[side], *self.decision.place, self.ground.height, turn, *self._tilt)
        if swing is None:
            self.ground.lift(self.stance, frames[self.stance])
            landing = self._seen(landing)
            speed = min(c.landing_speed + c.landing_gain * self.ground.uneven, c.hardest)
            shape = self._shape._replace(landing_speed=speed)
            if self.steering.climbs:
                shape = shape._replace(**STAIR)
            self._begin_swing(frames, landing, touch, shape)
            if self._joins is not None and self.swing is not None:
                self._joins, ground = None, self.ground.height
                self.swing.join(self.elapsed, frames[side], state.speeds[side], ground, c.swing_push)
                self.swing.retarget(self.elapsed, landing, touch)
            return
        looks = self.ground.sight is not None and self._ticks // self._period % LOOKS == 0
        if looks and touch - self.elapsed > LAST_LOOK:
            landing = self._seen(landing)
            swing.over = max(swing.over, self.ground.way(frames[side], landing))  # of what is left
        if thrown is not None:
            swing.restart(self.elapsed, frames[side], thrown, c.swing_push)
        swing.retarget(self.elapsed, landing, touch, c.hardest if self.decision.closes else None)

    @property
    def _touch_share(self) -> float:
        """Share of the time of a step at which the foot meets the expected ground."""
        c = self.constants
        if self.footsteps:
            return c.touch_of_plans
        return c.touch + self.fast_share * (c.late_touch - c.touch)

    @property
    def _touch(self) -> float:
        """Time of this step at which the foot meets the expected ground, s."""
        return self._touch_share * self.duration

    @property
    def _longest(self) -> float:
        """Longest time of this step, s."""
        return self.settings.longest * self.steering.step_time

    @property
    def _waits(self) -> float:
        """Time since lift-off until which a foot that has met the ground may wait, s: a late one as long as others."""
        return (self.met or 0.0) + (self.settings.longest - self._touch_share) * self.steering.step_time

    def _solve(self, steps: StepVelocity) -> None:
        """Decide the step by what stands now."""
        c, footsteps, stance = self.constants, self.footsteps, self._step_state(steps)
        self.course.decide()
        stays = self.ground.sight is None or self.swing is None or self._first
        if footsteps:
            wish = steps_of_plan(footsteps, c.carrying, self.settings.width, stance)
            self._planned = Orbit.of_wish(wish.places, wish.offsets)
            stance = stance._replace(orbit=self._planned)
            stays = stays or len(footsteps) < 3 or footsteps[0].place == "fixed"
        else:
            forward, left = steps.velocity
            time = self.steering.step_time
            forward = (forward - steps.made_up) * (1.0 + self.fast_share * (self._pace / time - 1.0))
            wish = steps_of_velocity((forward, left), self._width(steps), stance)
        look = None if stays else self._touch - self.elapsed
        self.decision.decide(
            stance, wish, self._longest, look, held=bool(footsteps), climbs=bool(self.steering.climbs)
        )

    def _step_state(self, steps: StepVelocity) -> StepState:
        """Return the state that a step is decided by."""
        felt, (u, v) = self.felt, self.decision.lagged
        return StepState(
            self._side,
            self.steering.direction,
            felt.carrying_point(self.stance),
            felt.state.on_sole(self.stance, self.constants.carrying + u, v),
            felt.contact,
            felt.dcm,
            self._orbit(steps),
            self.steering.step_time,
            self.elapsed,
            self._swinging(),
            self._down(),
        )

    def _swinging(self) -> tuple[float, float, float, float]:
        """Return place, m, and velocity, m/s, of the swing foot over the ground, by its reference."""
        if self.swing is None:
            x, y, _ = self.felt.state.places[1 - self.stance]
            return x, y, 0.0, 0.0
        (x, y, _), (u, v, _) = self.swing.motion(self.elapsed)
        return x, y, u, v

    def _down(self) -> float:
        """Return the time that the swing foot needs to come straight down, s."""
        height = max(self.felt.state.places[1 - self.stance][2] - self.ground.height, 0.0)
        return self.constants.piece + math.sqrt(RISE * height / self.constants.lift)

    def _seen(self, landing: Footstep) -> Footstep:
        """Return a landing at the height and tilt that are seen under it, which are expected from now on."""
        landing = self.ground.under(landing)
        self.ground.height, self._tilt = landing.z, (landing.pitch, landing.roll)
        return landing

    def _meet(self, steps: StepVelocity) -> tuple[Event, ...]:
        """Detect that the swing foot has met the ground, or has lost it again."""
        if self.swing is None:
            return ()
        touch, elapsed = self.touch, self.elapsed
        if self.met is None:
            bears = touch.bears(self.stance, elapsed, self.duration)
            if self._touches(bears and not touch.rubs(self._now(steps), self.swing.landing)):
                self.met = elapsed
                soon = 0.05 * self.settings.step_time
                return (touch_down(elapsed - self._touch, soon, soon),)
        elif touch.loses(self.stance, elapsed - self.met, elapsed):
            self.met = None
            self.swing.resume(elapsed, self._frames[1 - self.stance])
        return ()

    def _change_feet(self, go: bool) -> tuple[Event, ...]:
        """Let the foot that has landed carry; stand if the robot is to stop and can."""
        c, state = self.constants, self.felt.state
        left, right = state.places
        self._pace += c.pace_gain * (min(self.elapsed, self._longest) - self._pace)
        held = min(self.decision.area.width / c.slow_width, 1.0)
        gain = c.held_gain[0] if held < self.steering.held else c.held_gain[1]
        self.steering.held += gain * (held - self.steering.held)
        self.stance = 1 - self.stance
        assert self.swing is not None
        if self.footsteps:
            self._say_missed(self.decision.missed)
        unexpected = state.places[self.stance][2] - self.swing.landing.z
        # Stairs are rough ground only where they are not as planned.
        self.ground.land(unexpected, unexpected if self.steering.climbs else left[2] - right[2])
        self.steps_done += 1
        self._first = False
        slow = math.hypot(*self.steering.velocity) < c.stop_speed
        if (
            not go
            and slow
            and state.apart() < c.stop_length
            and self.felt.outside(self.felt.dcm, c.stop_box) <= 0.0
        ):
            self._enter(GaitPhase.STANDING, 0.0)
            self.reason = "" if self.footsteps else self.reason
            self.steering.rest(self._middle())
            return (Event.STOPPED,)
        self._lift()
        return (Event.LIFT_OFF,)

    def _say_missed(self, missed: float) -> None:
        """Say that a foot has landed so far beside its footstep, m, until one lands on its own again."""
        self.reason = ""
        if missed > LET_GO:
            side = SIDES[self.stance]
            self.reason = (
                f"the {side} foot has landed {1e3 * missed:.0f} mm beside its footstep: what the footstep leaves of "
                "the balance, the next sole could not have caught"
            )
            logger.info("%s", self.reason)
