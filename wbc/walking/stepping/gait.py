"""Free steps: place and time of every step are decided as the robot goes, from its state to the references of a tick.

    standing ── a velocity, a goal ──▶ shifting ── weight on one foot ──▶ stepping ── slow, feet together ──▶ standing
        └───────────────── a push: the DCM leaves both soles ────────────────▲

A step is decided by `wbc.walking.stepping.decision`; `law` and `program` beside it have the equations, and
docs/stepping_law.md the rules.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.base.checked import checked
from wbc.base.lag import lag_gain
from wbc.base.numbers import ROUNDING
from wbc.base.vectors import Point, Rotation, Vector, along, part_way
from wbc.core.drive.control import State
from wbc.core.robot import GRAVITY, SIDES, Robot
from wbc.core.trajectories import Follower
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.contact import Event, GaitPhase, touch_down
from wbc.walking.gait import REPLAN, GaitMachine
from wbc.walking.ground import LAST_LOOK, GroundEstimate
from wbc.walking.plans.footsteps import Footstep, heading, mean_heading
from wbc.walking.plans.gait import Gait, SwingShape
from wbc.walking.plans.reach import Extent, Reach, over
from wbc.walking.plans.sources import FootstepSource, PlanSource, Velocity
from wbc.walking.source import Progress, Reference
from wbc.walking.steering import PathSteering, StepVelocity
from wbc.walking.stepping.decision import StepDecision, StepState, steps_of_plan, steps_of_velocity
from wbc.walking.stepping.law import (
    SIDEWAYS,
    Divergent,
    Orbit,
    divergent_component,
    takes_over,
    viability,
)
from wbc.walking.stepping.settings import RobotSize, SteppingConstants, SteppingSettings, in_si
from wbc.walking.swing import REST, RISE, SwingFoot

logger = logging.getLogger(__name__)

LOOKS = 2
"""Number of decisions between two looks at the ground under a landing that moves with each of them."""

CALM, UNHURRIED = 0.5, 0.8
"""Urgency of the swing foot up to which a push may have hurled it, and time of the step over T from which on."""

Frames = tuple[pin.SE3, pin.SE3]
"""Placements of the left and of the right sole."""

ORIGIN: Vector = (0.0, 0.0, 0.0)

WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class BodyState(NamedTuple):
    """State of the robot, as far as the gait reads it, in plain numbers."""

    com: Vector  # centre of mass in the world, m
    velocity: Vector  # its velocity, m/s
    spin: Vector  # angular momentum about the centre of mass, kg m²/s
    places: tuple[Vector, Vector]  # centres of the left and of the right sole, m
    turns: tuple[Rotation, Rotation]  # rotations of the soles, row by row
    wrenches: Sequence[Vector]  # wrenches on the soles in their frames, N and Nm
    heading: float  # heading of the pelvis less what it is to be turned against that of the walk, rad
    speeds: tuple[float, float] = (0.0, 0.0)  # of both soles by the estimate, m/s; only on both feet
    time: float = 0.0  # of the measurement, s; where it stands still, a period has passed


class SteppingWalk(GaitMachine):
    """Walk with free steps, which balance the robot: it stands, walks where it is steered, and stands.

    Attributes:
        settings: Settings in SI units.
        constants: Constants of the law in SI units.
        scale: Size of the robot.
        com_height: Height of the CoM over the soles while walking, m.
        steering: Velocity, goal and heading.
        decision: Decision of the step that swings.
        dcm: Divergent component of motion in the last tick, by the angular momentum about the contact.
        footsteps: Last answer of the planner, from the step that swings now on; none of a walk that is steered.
    """

    com_height: float
    steering: PathSteering
    dcm: Divergent

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
        self._shape = SwingShape(
            self.settings.swing_height,
            apex=c.apex / c.touch,
            takeoff_time=0.0,
            landing_time=0.0,
            landing_speed=c.landing_speed,
            landing_height=0.0,
            search_depth=c.search,
            search_time=c.search_time,
            lift_speed=c.lift_speed,
            edge=0.0,
            heel=0.0,
            quickest=0.5,
            level=c.level,
            lift=c.lift,
            piece=c.piece,
        )
        self._period = max(1, round(c.period / dt))  # of decisions, ticks
        self._gait = Gait(feet_spacing=self.settings.width)
        self._cop_gain, self._time_gain = lag_gain(dt, c.cop_lag), lag_gain(dt, c.time_lag)
        self._level_gain = lag_gain(dt, c.level_lag)
        self.begin(heading)

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

    def begin(self, heading: float) -> None:
        """Stand where the robot stands now, with a heading, rad; all steps and orders before are forgotten."""
        super().begin(heading)
        s, c, scale, dt = self.settings, self.constants, self.scale, self.dt
        self.steering = PathSteering(s, scale, c, heading, dt, self._extent)
        self.decision = StepDecision(s, c, scale, self.ground, dt)
        self.steering.held = min(self.decision.area.widest / c.slow_width, 1.0)
        self.footsteps: Sequence[Footstep] = ()
        self._idle = False  # while the planner asks for a stand
        self._next = 0.0  # time of the next question to a planner in a stand, s
        self._before: BodyState | None = None  # in the last tick
        self._passed = self.dt  # time since then, s: a measurement may have been lost
        self._hurled = -math.inf  # when a push hurled the swing foot, s
        self._contact: Vector | None = None  # low-passed centre of pressure, in the world
        # CoM over the ground as planned, its velocity and acceleration; None until the step is decided.
        self._planned: tuple[float, float, float, float, float, float] | None = None
        self._carrying: Vector = ORIGIN  # low-passed centre of pressure of the swing foot in contact, m
        self._since_stand = 0  # steps
        # Time for which the foot that stands has carried nothing and the other one does, s.
        self._unloaded: float = 0.0
        self._pace = self.steering.step_time  # mean time of the last steps, s
        self._tilt = (0.0, 0.0)  # pitch and roll of the landing as seen, rad
        self._level = 0.0  # height of the feet that carry, low-passed, m
        self._stood = 0.0  # height of the foot that stands to which the expected ground belongs, m
        self._from: Vector = ORIGIN  # CoM at the start of the shift
        self._high: Follower[float] | None = None  # reference of the CoM's height over the feet, m
        self._ticks = 0
        self._seen_robot: Robot | None = None  # that of the state
        # Times for which each foot has been in the air and on the ground, s, of a robot that walks already; until the
        # first tick, or until its foot swings.
        self._joins: tuple[Sequence[float], Sequence[float]] | None = None

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
    def haste(self) -> float:
        """Share from 0 to 1 by which the walk is a fast one."""
        return 0.0 if self.footsteps else self.steering.haste

    @property
    def granted(self) -> Velocity:
        """Velocity of the steps now: forward (m/s), left (m/s) and turn (rad/s)."""
        return (*self.steering.velocity, self.steering.turn)

    def progress(self, last: Reference | None) -> Progress:
        """Return the present phase and the number of steps."""
        return self._progress(() if self.swing is None else (self.swing.landing,), self.settings.step_time)

    def take(self, planner: FootstepSource | None) -> None:
        """Take footsteps from a planner, from the next step on; None for those of the steering."""
        super().take(planner)
        self._idle, self._next = False, 0.0

    def _plan_steps(self, first: str | None) -> None:
        """Take the planner's footsteps; `first` is the side that steps, None for either.

        A plan that is walked, and a planner that fails, are left. A planner that asks for a stand is asked again.
        """
        self.footsteps = ()
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

    # ---- the tick -----------------------------------------------------------------------------------------------

    def update(self, state: State) -> Reference:
        """Decide the step, and return where it leaves the robot."""
        return self.advance(self._body(state), self._frames)

    def _body(self, state: State) -> BodyState:
        robot = state.robot
        if robot is not self._seen_robot:  # in the first tick
            self._seen_robot, (left, right) = robot, robot.soles
            self._soles = robot.frame_id(left.frame), robot.frame_id(right.frame)
            self._frames = robot.placement(left.frame), robot.placement(right.frame)
            self._places = self._frames[0].translation, self._frames[1].translation  # views, as the next ones
            self._turns = self._frames[0].rotation, self._frames[1].rotation
            self._pelvis = robot.placement(robot.base_frame).rotation
        return BodyState(
            robot.com.tolist(),
            robot.com_velocity.tolist(),
            robot.data.hg.angular.tolist(),
            (self._places[0].tolist(), self._places[1].tolist()),
            (self._turns[0].tolist(), self._turns[1].tolist()),
            state.measurement.wrenches.tolist(),
            heading(self._pelvis) - self.hip_turn,
            (0.0, 0.0) if self.phase is GaitPhase.SINGLE else self._speeds(robot),
            state.measurement.time,
        )

    def _speeds(self, robot: Robot) -> tuple[float, float]:
        """Return the speeds of both soles, m/s: with delays the change of a place in one tick is mostly noise."""
        left, right = (pin.getFrameVelocity(robot.model, robot.data, sole).linear for sole in self._soles)
        return math.hypot(*left.tolist()), math.hypot(*right.tolist())

    @property
    def contact(self) -> Vector:
        """Measured centre of pressure of the feet that carry, low-passed, in the world, m."""
        assert self._contact is not None
        return self._contact

    def advance(self, state: BodyState, frames: Frames) -> Reference:
        """Compute one tick; feet that stand keep the placements of left and right sole."""
        self._state, self._frames, before = state, frames, self._before
        passed = 0.0 if before is None else state.time - before.time
        self._passed = passed if passed > 0.0 else self.dt
        self.elapsed += self.dt
        self.time += self.dt
        self._follow_pendulum()
        reference = self._go_on()
        self._before = state
        return reference

    def _go_on(self) -> Reference:
        """Stand, shift the weight or step, and return the references of the tick."""
        events: tuple[Event, ...] = ()
        if self.phase is GaitPhase.STANDING:
            events = self._stand()
        elif self.phase is GaitPhase.DOUBLE:
            events = self._shift()
        if events:  # another mode begins in this tick, about its own contact
            self._follow_pendulum()
        return self._step(events) if self.phase is GaitPhase.SINGLE else self._on_both_feet(events)

    # ---- contact and pendulum ---------------------------------------------------------------------------------

    def _follow_pendulum(self) -> None:
        """Low-pass the contact point and find the DCM about it."""
        now, state, scale = self._contact_point(), self._state, self.scale
        contact = now if self._contact is None else part_way(self._contact, now, self._cop_gain)
        self._contact = contact
        if self.phase is not GaitPhase.SINGLE:
            self.dcm = self._own_dcm(contact[2])
            return
        self.dcm = divergent_component(
            state.com, state.velocity, state.spin, contact, scale.mass, 0.5 * scale.height
        )

    def _own_dcm(self, ground: float) -> Divergent:
        """Return the DCM by the CoM's own velocity, ξ = c + ċ/ω, over a ground at a height, m."""
        (x, y, z), (u, v, _) = self._state.com, self._state.velocity
        omega = math.sqrt(GRAVITY / max(z - ground, 0.5 * self.scale.height))
        return Divergent(x + u / omega, y + v / omega, omega)

    def _contact_point(self) -> Vector:
        """Return the measured centre of pressure of the stance foot, of both feet in a stand, in the world, m."""
        if self.phase is GaitPhase.SINGLE:
            return self._centre_of_pressure(self.stance)
        (ax, ay, az), (bx, by, bz) = (self._centre_of_pressure(side) for side in (0, 1))
        left, right = (max(row[2], 0.0) for row in self._state.wrenches)
        share = left / (left + right) if left + right > self.constants.least_force else 0.5
        return bx + share * (ax - bx), by + share * (ay - by), bz + share * (az - bz)

    def _centre_of_pressure(self, side: int) -> Vector:
        """Return the centre of pressure of a sole within its edges, m; where it carries nothing, where it would."""
        _, _, force, roll, pitch, _ = self._state.wrenches[side]
        if force < self.constants.least_force:
            return self._carrying_point(side)
        length, width = self.scale.sole
        x, y = min(max(-pitch / force, -length), length), min(max(roll / force, -width), width)
        return self._on_sole(side, x, y)

    def _carrying_point(self, side: int) -> Vector:
        """Return the point of a sole that carries, m."""
        return self._on_sole(
            side, self.constants.carrying if self.phase is not GaitPhase.STANDING else 0.0, 0.0
        )

    def _on_sole(self, side: int, x: float, y: float) -> Vector:
        """Return a point of a sole in the world, m."""
        (px, py, pz), ((a, b, _), (c, d, _), (e, f, _)) = self._state.places[side], self._state.turns[side]
        return px + a * x + b * y, py + c * x + d * y, pz + e * x + f * y

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
                self._enter(GaitPhase.DOUBLE, self.constants.shift_time + self.constants.rest)
                self._from = self._state.com
                return (Event.STARTED,)
        return self._step_out()

    def _shift(self) -> tuple[Event, ...]:
        """Lift the first foot when the weight is on the other one, or step out of a push."""
        if self.elapsed < self.duration:
            return self._step_out()
        return self._begin()

    def _steers(self) -> bool:
        """Return True if a velocity or a goal asks a robot that stands for steps; a goal where it stands does not."""
        self._stay_on_ground()
        return self.steering.pending and not self.steering.arrives(self._middle())

    def _stay_on_ground(self) -> None:
        """Come to a stand where the velocity would lead beyond the ground."""
        if self._extent is not None and self.steering.leaves(self._middle()):
            self.steering.command(None)
            self.reason = f"the velocity leads beyond the ground, which {over(self._extent)}"
            logger.warning("%s; the robot comes to a stand", self.reason)

    def _step_out(self) -> tuple[Event, ...]:
        """Step with the foot on whose side the DCM is, if it has left both soles, or with one that was kicked away."""
        state, dcm = self._state, self.dcm
        kicked = self._kicked()
        if kicked is not None:
            self.stance = 1 - kicked
            events = self._begin()
            self._hurled = self.time
            return events
        if self._outside(dcm, 1.0) <= 0.0:
            return ()
        left, right = (abs(self._outwards(dcm.x - place[0], dcm.y - place[1])[1]) for place in state.places)
        self.stance = 0 if left > right else 1
        loads = [row[2] for row in state.wrenches]
        if loads[self.stance] < self.constants.least_force < loads[1 - self.stance]:
            self.stance = 1 - self.stance  # a foot that has been kicked away carries nothing
        return self._begin()

    def _walk_on(self, air: Sequence[float], landed: Sequence[float]) -> tuple[Event, ...]:
        """Begin in the step that the feet are in; see `join`."""
        c, state, robot = self.constants, self._state, self._seen_robot
        least, loads = c.least_force, [row[2] for row in state.wrenches]
        up = [loads[side] < least < loads[1 - side] for side in (0, 1)]
        if robot is None or max(loads) < least or not (any(up) or min(landed) < c.landed):
            self._joins = None
            return self._step_out()
        self.stance = up.index(False) if any(up) else int(landed[1] < landed[0])
        # The next tick has velocities from a tick before.
        moved = [
            pin.getFrameVelocity(robot.model, robot.data, sole, WORLD).linear.tolist() for sole in self._soles
        ]
        left, right = (
            (x - self.dt * u, y - self.dt * v, z - self.dt * w)
            for (x, y, z), (u, v, w) in zip(state.places, moved, strict=True)
        )
        self._before, self._passed = state._replace(places=(left, right)), self.dt
        events = self._begin()
        self._since_stand = 1  # the step takes the time that the DCM leaves it
        # A foot may land in the second half of its step.
        self.elapsed = min(max(air), 0.5 * self.steering.step_time)
        return events

    def _kicked(self) -> int | None:
        """Return the foot that a push has thrown off the ground while the other one holds, else None."""
        c, loads, speeds = self.constants, [row[2] for row in self._state.wrenches], self._state.speeds
        for side in (0, 1):
            if loads[side] < c.lost and loads[1 - side] > c.held and speeds[side] > c.kicked:
                return side
        return None

    def _velocity(self, side: int) -> Vector:
        """Return the velocity of a sole, m/s; zero in the first tick."""
        if self._before is None:
            return ORIGIN
        (x, y, z), (p, q, r), dt = self._state.places[side], self._before.places[side], self._passed
        return (x - p) / dt, (y - q) / dt, (z - r) / dt

    def _begin(self) -> tuple[Event, ...]:
        """Begin to step from a stand."""
        self._level = self.ground.height = self._state.places[self.stance][2]
        self._since_stand, self._pace = 0, self.steering.step_time
        self.steering.rest(self._middle())
        self._lift()
        return (Event.LIFT_OFF,)

    def _on_both_feet(self, events: tuple[Event, ...]) -> Reference:
        """References on both feet: the CoM is held over them, or shifted over one of them."""
        s, c, omega = self.settings, self.constants, self.dcm.omega
        feet = [self._carrying_point(side) for side in (0, 1)]
        middle = [0.5 * (a + b) for a, b in zip(*feet, strict=True)]
        high, speed = self._com_height(self._state.com[2] - middle[2])
        if self.phase is GaitPhase.STANDING:
            course = (middle[0], middle[1], 0.0, 0.0, 0.0, 0.0)
        else:
            share = min(1.0, self.elapsed / c.shift_time)
            rise, rate = share * share * (3.0 - 2.0 * share), 6.0 * (share - share * share) / c.shift_time
            stance, side = feet[self.stance], 1.0 if self.stance == 1 else -1.0
            inside = side * c.shift * s.width / (1.0 + math.exp(omega * s.step_time))
            cos, sin = self.steering.direction
            (x, y, _), goal_x, goal_y = self._from, stance[0] - sin * inside, stance[1] + cos * inside
            u, v = goal_x - x, goal_y - y
            course = (x + rise * u, y + rise * v, rate * u, rate * v, 0.0, 0.0)
        most = c.most_force, c.most_force
        return self._references(events, most, (high + middle[2], speed), course)

    def _com_height(self, now: float) -> tuple[float, float]:
        """Move the CoM's height over the feet on by a tick, from that now, m, to that of the steps."""
        if self._high is None:
            self._high = Follower(1.0 / self.scale.omega, now)
        self._high.follow(self.scale.height - self._high.value, self.dt)
        return self._high.value, self._high.velocity

    def leaves(self, state: State, share: float) -> bool:
        """Return True if the DCM of a robot on both feet has left their standing boxes, scaled by `share`."""
        self._state = self._body(state)
        left, right = self._state.places
        return self._outside(self._own_dcm(0.5 * (left[2] + right[2])), share) > 0.0

    # ---- stepping ---------------------------------------------------------------------------------------------

    def _step(self, events: tuple[Event, ...]) -> Reference:
        """Decide time and place of the step, move the swing foot, and change feet when it has landed."""
        self._fly()
        self._follow_ground()
        steps = self._steer()
        self._decide(steps)
        events = (*events, *self._meet(steps))
        self._carry(1 - self.stance)
        if self.met is not None and self._is_to_carry(steps):
            events = (*events, *self._change_feet(steps.go))
            self._follow_pendulum()
            if self.phase is GaitPhase.STANDING:
                return self._on_both_feet(events)
            self._decide(steps)
        state = self._state
        self._level += self._level_gain * (state.places[self.stance][2] - self._level)
        high, speed = self._com_height(state.com[2] - self._level)
        return self._references(events, self._most_forces(), (high + self._level, speed), self._course())

    def _follow_ground(self) -> None:
        """Move the expected ground with the foot that stands.

        This foot stays where it is. What moves is its estimate, after impacts and flights, and without the ground the
        swing foot would end above the true one.
        """
        moved = self._state.places[self.stance][2] - self._stood
        if abs(moved) > self.constants.drifted and self.ground.sight is None:
            self.ground.height += moved
            self._stood += moved

    def _steer(self) -> StepVelocity:
        """Return the velocity of the next steps; of footsteps that of the one that swings."""
        state = self._state
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
        time, omega = self.steering.step_time, self.dcm.omega
        return Orbit.of(steps.velocity, self._side, self._width(steps), time, self._pace, omega)

    def _width(self, steps: StepVelocity) -> float:
        """Return the distance between feet, m: of a robot that walks sideways they come apart and together."""
        s = self.settings
        return max(s.width, s.gap + abs(steps.velocity[1]) * self.steering.step_time / SIDEWAYS)

    def _decide(self, steps: StepVelocity) -> None:
        """Decide time, place and centre of pressure of the step, and send the swing foot there."""
        if self.met is not None:
            return
        s, c, side, state, frames = self.settings, self.constants, 1 - self.stance, self._state, self._frames
        swing, self._ticks = self.swing, self._ticks + 1
        self.decision.area.level = self._levelness()
        self.decision.area.update(state.turns[self.stance], state.wrenches[self.stance], self._passed)
        decides = swing is None or self._ticks % self._period == 0
        if decides:
            self._solve(steps)
        nominal, longest = self.steering.step_time, self._longest
        shortest = min(s.shortest, self.decision.end) if self.decision.closes else s.shortest
        wanted = min(max(self.decision.end, shortest), longest)
        if swing is None:
            self.duration = min(wanted, c.later * nominal) if self._since_stand else nominal
        elif self.decision.closes:
            self.duration = wanted
        else:
            self.duration += self._time_gain * (wanted - self.duration)
        self.duration = min(max(self.duration, shortest), longest)
        self.decision.press()
        thrown = None if swing is None else self._thrown(swing)
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
            speed = min(c.landing_speed + c.haste * self.ground.uneven, c.hardest)
            self._begin_swing(frames, landing, touch, self._shape._replace(landing_speed=speed))
            if self._joins is not None and self.swing is not None:
                self._joins, ground = None, self.ground.height
                self.swing.join(self.elapsed, frames[side], self._velocity(side), ground, c.swing_push)
                self.swing.retarget(self.elapsed, landing, touch)
            return
        looks = self.ground.sight is not None and self._ticks // self._period % LOOKS == 0
        if looks and touch - self.elapsed > LAST_LOOK:
            landing = self._seen(landing)
            swing.over = max(swing.over, self.ground.way(frames[side], landing))  # of what is left
        if thrown is not None:
            swing.restart(self.elapsed, frames[side], thrown, c.swing_push)
        swing.retarget(self.elapsed, landing, touch, c.hardest if self.decision.closes else None)

    def _thrown(self, swing: SwingFoot) -> Vector | None:
        """Return the velocity of a swing foot so far off its motion that legs cannot bring it back, m/s, else None.

        That is where the feedback of its task asks for more than the greatest acceleration of a swing: the trunk would
        pay for it.
        """
        moved = self._velocity(1 - self.stance)
        here, (stiffness, damping) = self._state.places[1 - self.stance], self.constants.swing_gains
        asked = (
            stiffness * (q - p) + damping * (speed - now)
            for p, now, q, speed in zip(here, moved, *swing.motion(self.elapsed - self.dt), strict=True)
        )
        return moved if math.hypot(*asked) > self.constants.swing_push else None

    def _fly(self) -> None:
        """Find whether a push hurls the swing foot.

        It is faster then, in the world and past the CoM, than any step without hurry: the ground stops a foot, and only
        a push makes it faster. It is hurled once in a step: a foot that comes back is as fast, and meets the ground.
        """
        if self.swing is None:
            return
        most = self.constants.hurled + 2.0 * math.hypot(*self.steering.velocity)
        calm = self.decision.urgency < CALM and self.duration > UNHURRIED * self.steering.step_time
        if not calm or not (self._is_hurled or self._hurled == -math.inf):
            return
        moved = self._velocity(1 - self.stance)
        if min(math.hypot(*moved), math.dist(moved, self._state.velocity)) > most:
            self._hurled = self.time

    @property
    def _is_hurled(self) -> bool:
        """True of a swing foot that was hurled, for a time: a force on it is that of a push, or of its inertia."""
        return self.time - self._hurled < self.constants.hurled_time

    @property
    def _touch_share(self) -> float:
        """Share of the time of a step at which the foot meets the expected ground."""
        c = self.constants
        return c.touch + self.haste * (c.late_touch - c.touch)

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
        c, (u, v), footsteps = self.constants, self.decision.cop, self.footsteps
        self._planned = None  # from what is measured now
        stance = StepState(
            self._side,
            self.steering.direction,
            self._carrying_point(self.stance),
            self._on_sole(self.stance, c.carrying + u, v),
            self.contact,
            self.dcm,
            self._orbit(steps),
            self.steering.step_time,
            self.elapsed,
            self._swinging(),
            self._down(),
        )
        stays = self.ground.sight is None or self.swing is None or self._since_stand == 0
        if footsteps:
            wish = steps_of_plan(footsteps, c.carrying, self.settings.width, stance)
            stays = stays or len(footsteps) < 3 or footsteps[0].place == "fixed"
        else:
            forward, left = steps.velocity
            time = self.steering.step_time
            forward = (forward - steps.made_up) * (1.0 + self.haste * (self._pace / time - 1.0))
            wish = steps_of_velocity((forward, left), self._width(steps), stance)
        look = None if stays else self._touch - self.elapsed
        self.decision.decide(stance, wish, self._longest, look)

    def _course(self) -> tuple[float, float, float, float, float, float]:
        """Return place, m, velocity, m/s, and acceleration, m/s², of the CoM as planned, over the ground.

        From the state in which the step was decided it moves as the pendulum does about the commanded centre of
        pressure.
        """
        square, dt, (ahead, aside) = self.scale.omega**2, self.dt, self.decision.cop
        zx, zy, _ = self._on_sole(self.stance, self.constants.carrying + ahead, aside)
        if self._planned is None:
            (x, y, _), (u, v, _) = self._state.com, self._state.velocity
            a, b = square * (x - zx), square * (y - zy)
        else:
            x, y, u, v, a, b = self._planned
            x, y, u, v = x + dt * (u + 0.5 * dt * a), y + dt * (v + 0.5 * dt * b), u + dt * a, v + dt * b
            a, b = square * (x - zx), square * (y - zy)
        self._planned = x, y, u, v, a, b
        return self._planned

    def _swinging(self) -> tuple[float, float, float, float]:
        """Return place, m, and velocity, m/s, of the swing foot over the ground, by its reference."""
        if self.swing is None:
            x, y, _ = self._state.places[1 - self.stance]
            return x, y, 0.0, 0.0
        (x, y, _), (u, v, _) = self.swing.motion(self.elapsed)
        return x, y, u, v

    def _down(self) -> float:
        """Return the time that the swing foot needs to come straight down, s."""
        height = max(self._state.places[1 - self.stance][2] - self.ground.height, 0.0)
        return self.constants.piece + math.sqrt(RISE * height / self.constants.lift)

    def _levelness(self) -> float:
        """Return the share from 0 to 1 by which the ground has been level in the last steps."""
        full, none = self.constants.even
        return min(max((none - self.ground.uneven) / (none - full), 0.0), 1.0)

    def _seen(self, landing: Footstep) -> Footstep:
        """Return a landing at the height and tilt that are seen under it, which are expected from now on."""
        landing = self.ground.under(landing)
        self.ground.height, self._tilt = landing.z, (landing.pitch, landing.roll)
        return landing

    def _rubs(self, steps: StepVelocity, landing: Footstep) -> bool:
        """Return True if the swing foot is to go on over what it has met: waiting would not help there.

        That is where ξ runs away from the foot that stands, aside or ahead, and is caught from the landing at its time,
        and not from here.
        """
        c, dcm, orbit = self.constants, self.dcm, self._orbit(steps)
        left = self._touch - self.elapsed
        (x, y, _), (p, q, _) = self._state.places[1 - self.stance], self.contact
        ahead, beyond = self._outwards(dcm.x - x, dcm.y - y)
        on, out = self._outwards(dcm.x - p, dcm.y - q)
        ahead_of_orbit = ahead * on > 0.0 and abs(ahead) > abs(orbit.ahead) + 0.5 * c.stretch
        if left <= 0.0 or not (ahead_of_orbit or out < 0.0):
            return False
        grown = math.exp(dcm.omega * left)
        there = self._outwards(p + grown * (dcm.x - p) - landing.x, q + grown * (dcm.y - q) - landing.y)
        now = viability(ahead, -beyond, orbit, c.stretch)
        return c.rubs * now < viability(there[0], -there[1], orbit, c.stretch)

    def _meet(self, steps: StepVelocity) -> tuple[Event, ...]:
        """Detect that the swing foot has met the ground, or has lost it again."""
        c, swing, wrenches = self.constants, 1 - self.stance, self._state.wrenches
        force = wrenches[swing][2]
        if self.met is None:
            may = self.elapsed > c.early * self.duration and not self._is_hurled
            assert self.swing is not None
            met = may and force > c.met and self._is_low(swing) and not self._rubs(steps, self.swing.landing)
            if self._touches(met):
                self.met = self.elapsed
                soon = 0.05 * self.settings.step_time
                return (touch_down(self.elapsed - self._touch, soon, soon),)
            return ()
        assert self.swing is not None
        lost = force < c.lost and self.elapsed - self.met > c.lost_time and wrenches[self.stance][2] > c.held
        if lost or self._is_hurled:
            self.met = None
            self.swing.resume(self.elapsed, self._frames[swing])
        return ()

    def _is_low(self, swing: int) -> bool:
        """Return True if the swing foot is no higher than the way over the ground asks for."""
        ground = max(self._state.places[self.stance][2], self.ground.height)
        return self._state.places[swing][2] < ground + self.constants.low * self.settings.swing_height

    def _carry(self, swing: int) -> None:
        """Low-pass the place where the foot in contact carries, from its carrying point on: it meets with an edge."""
        if self.met is None:
            self._carrying = self._carrying_point(swing)
        else:
            self._carrying = part_way(self._carrying, self._centre_of_pressure(swing), self._cop_gain)

    def _is_to_carry(self, steps: StepVelocity) -> bool:
        """Return True if the foot in contact is to carry: waiting does not help, or has lasted too long."""
        loads, dcm = self._state.wrenches, self.dcm
        unloaded = loads[self.stance][2] < self.constants.held < loads[1 - self.stance][2]
        self._unloaded = self._unloaded + self.dt if unloaded else 0.0
        if self._unloaded > self.haste * self.constants.lost_time:
            return True  # it has rolled over an edge, or was kicked away; the impact of a fast foot lasts less long
        if self.elapsed > max(self._longest, self._waits):
            return True
        c, (x, y, _), (p, q, _) = self.constants, self._carrying, self.contact
        ahead, beyond = self._outwards(dcm.x - x, dcm.y - y)
        there, here = (ahead, -beyond), self._outwards(dcm.x - p, dcm.y - q)
        patience = c.patience + self.haste * (1.0 - c.patience)  # a fast walk needs all of its time
        return takes_over(there, here, self._orbit(steps), c.stretch, c.wait, patience)

    def _change_feet(self, go: bool) -> tuple[Event, ...]:
        """Let the foot that has landed carry; stand if the robot is to stop and can."""
        c, (left, right) = self.constants, self._state.places
        self._pace += c.pace_gain * (min(self.elapsed, self._longest) - self._pace)
        held = min(self.decision.area.width / c.slow_width, 1.0)
        gain = c.held_gain[0] if held < self.steering.held else c.held_gain[1]
        self.steering.held += gain * (held - self.steering.held)
        self.stance = 1 - self.stance
        assert self.swing is not None
        self.ground.land(self._state.places[self.stance][2] - self.swing.landing.z, left[2] - right[2])
        self._contact = None
        self.steps_done += 1
        self._since_stand += 1
        apart = math.hypot(left[0] - right[0], left[1] - right[1])
        slow = math.hypot(*self.steering.velocity) < c.stop_speed
        if not go and slow and apart < c.stop_length and self._outside(self.dcm, c.stop_box) <= 0.0:
            self._enter(GaitPhase.STANDING, 0.0)
            self.steering.rest(self._middle())
            return (Event.STOPPED,)
        self._lift()
        return (Event.LIFT_OFF,)

    def _lift(self) -> None:
        self._enter(GaitPhase.SINGLE, self.steering.step_time)
        self._plan_steps(SIDES[1 - self.stance])
        if self.footsteps:
            self.ground.height = self.footsteps[0].z
        self._stood = self._state.places[self.stance][2]
        self._unloaded = 0.0
        self._hurled, self._tilt = -math.inf, (0.0, 0.0)

    def _enter(self, phase: GaitPhase, duration: float) -> None:
        super()._enter(phase, duration)
        self._contact = None
        self.decision.begin()

    def _most_forces(self) -> tuple[float, float]:
        """Return the greatest normal force of each foot, N: the old stance foot unloads, one that waits has `share`."""
        c, swing = self.constants, 1 - self.stance
        most = [c.most_force, c.most_force]
        most[swing] = 0.0
        if self.met is not None:
            most[swing] = c.share
        elif self.elapsed < c.unload and self._since_stand > 0 and self._state.wrenches[swing][2] > c.lost:
            most[swing] = 2.0 * c.share * (1.0 - self.elapsed / c.unload)
        return most[0], most[1]

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
        (x, y, _), (left, right) = self._state.com, self._state.places
        cos, sin = self.steering.direction
        # Along the path the CoM, across it the middle of the feet.
        way = 0.5 * (left[0] + right[0]) - x, 0.5 * (left[1] + right[1]) - y
        _, aside = along(self.steering.direction, *way)
        return x - sin * aside, y + cos * aside

    def _outside(self, dcm: Divergent, share: float) -> float:
        """Return the distance of the DCM outside the standing boxes scaled by `share`, m; negative within them."""
        left, right = self._state.places
        half_length, half_width = (0.5 * share * size for size in self.constants.standing_box)
        across = left[0] - right[0], left[1] - right[1]
        spacing = math.hypot(*across) + ROUNDING
        ux, uy = across[0] / spacing, across[1] / spacing
        dx, dy = dcm.x - 0.5 * (left[0] + right[0]), dcm.y - 0.5 * (left[1] + right[1])
        return max(abs(dx * uy - dy * ux) - half_length, abs(dx * ux + dy * uy) - 0.5 * spacing - half_width)

    def _references(
        self,
        events: tuple[Event, ...],
        most_force: tuple[float, float],
        height: tuple[float, float],
        course: tuple[float, float, float, float, float, float],
    ) -> Reference:
        """Return the references of a tick, from height and speed of the CoM, and its course over the ground."""
        x, y, u, v, a, b = course
        arm = 1.0 / self.scale.omega**2
        # One array and its parts: making an array costs more than a slice.
        parts = np.array(
            (x, y, height[0], u, v, height[1], a, b, 0.0, x - arm * a, y - arm * b, self.contact[2])
        )
        pendulum = Pendulum(parts[:3], parts[3:6], parts[6:9], parts[9:], REST[:3], self.scale.omega)
        push, heading, cop = self.constants.swing_push, self.steering.heading, self.decision.cop
        flies = None if self.swing is None else self.air
        places = [place if side == flies else place.copy() for side, place in enumerate(self._frames)]
        return self._reference(
            pendulum,
            places,
            heading,
            events,
            most_push=push,
            most_force=most_force,
            cop=cop,
            urgency=-1.0 if self._is_hurled else self.decision.urgency,
        )
