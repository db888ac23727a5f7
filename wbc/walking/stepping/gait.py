"""Gait of the stepping walk: from the state of the robot to the references of this tick.

    standing ── a velocity, a goal ──▶ shifting ── weight on one foot ──▶ stepping ── slow, feet together ──▶ standing
        └───────────────── a push: the DCM leaves both soles ────────────────▲

Nothing is planned ahead of the foot in the air, so that no plan can be missed. `wbc.walking.stepping.law` has the
equations, docs/stepping.md the figures.
"""

from __future__ import annotations

import enum
import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.core.errors import ROUNDING, Array
from wbc.core.lag import lag_gain
from wbc.core.robot import GRAVITY, SIDES
from wbc.core.vectors import Rows, Vector
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.pattern.swing import FootMotion
from wbc.walking.planning.footsteps import Footstep
from wbc.walking.planning.phases import Event, Phase
from wbc.walking.source import NO_REACTION, Reference, Support
from wbc.walking.stepping.law import (
    SIDEWAYS,
    Divergent,
    Orbit,
    Point,
    divergent_component,
    foothold,
    remaining_time,
)
from wbc.walking.stepping.settings import Scale, SteppingSettings
from wbc.walking.stepping.steering import Steering
from wbc.walking.stepping.swing import SwingReference

LEVEL: Vector = (0.0, 0.0, 0.0)

PACE_GAIN = 0.2
"""Weight of the last step in the mean time of steps."""


class BodyState(NamedTuple):
    """State of the robot, as far as the gait reads it, in plain numbers.

    Attributes:
        com: Centre of mass in the world, m.
        velocity: Its velocity, m/s.
        spin: Angular momentum about the centre of mass, kg m²/s.
        places: Centres of the left and of the right sole, m.
        turns: Rotations of the soles, row by row.
        wrenches: Wrenches on the soles in their frames, N and Nm.
    """

    com: Vector
    velocity: Vector
    spin: Vector
    places: tuple[Vector, Vector]
    turns: tuple[Rows, Rows]
    wrenches: Rows


class _Mode(enum.Enum):
    STANDING = 0
    SHIFTING = 1
    STEPPING = 2


class SteppingGait:
    """Gait of one walk.

    Attributes:
        settings: Settings in SI units.
        scale: Size of the robot.
        steering: Velocity, goal and heading.
        stance: Foot that carries, or carried last: 0 left, 1 right.
        steps_done: Steps that have ended.
        ground: Height of the ground, low-passed, m.
    """

    def __init__(self, settings: SteppingSettings, scale: Scale, heading: float, dt: float) -> None:
        """Stand, with settings in units of the robot's size, the heading (rad) and the control period (s).

        Raises `InputError` for steps that cannot be walked.
        """
        self.settings, self.scale, self._dt = settings.in_si(scale), scale, dt
        self.steering = Steering(self.settings, heading, dt)
        self.steps_done = 0
        self.ground = 0.0
        self._swing = SwingReference(self.settings, dt)
        self._mode = _Mode.STANDING
        self.stance = 1
        self._elapsed = 0.0  # in this mode, or since lift-off
        self._time = self.settings.step_time  # of the step
        self._contact: tuple[float, float, float] | None = None  # low-passed centre of pressure, in the world
        self._met: float | None = None  # time since lift-off at which the swing foot met the ground
        self._carrying = (0.0, 0.0, 0.0)  # low-passed centre of pressure of the swing foot in contact, m
        self._since_stand = 0  # steps
        self._pace = self.settings.step_time  # mean time of the last steps, s
        self._uneven = 0.0  # greatest height between the feet in the last steps, m
        self._from: Vector = LEVEL  # CoM at the start of the shift
        s = self.settings
        self._cop_gain, self._time_gain = lag_gain(dt, s.cop_lag), dt / max(s.time_lag, dt)
        self._ground_gain = lag_gain(dt, s.ground_lag)

    @property
    def stands(self) -> bool:
        """True once the robot has stood for as long as a step takes."""
        return self._mode is _Mode.STANDING and self._elapsed >= self.settings.step_time

    def update(self, state: BodyState, frames: tuple[pin.SE3, pin.SE3]) -> Reference:
        """Compute one tick; feet that stand keep the placements of left and right sole."""
        self._elapsed += self._dt
        dcm = self._pendulum(state)
        events: tuple[Event, ...] = ()
        if self._mode is _Mode.STANDING:
            events = self._stand(state, dcm)
        elif self._mode is _Mode.SHIFTING:
            events = self._shift(state)
        if events:  # another mode begins in this tick, about its own contact
            dcm = self._pendulum(state)
        if self._mode is _Mode.STEPPING:
            return self._step(state, dcm, frames, events)
        return self._on_both_feet(state, dcm, frames, events)

    # ---- contact and pendulum ---------------------------------------------------------------------------------

    def _pendulum(self, state: BodyState) -> Divergent:
        """Low-pass the contact point and return the DCM about it."""
        now = self._contact_point(state)
        self._contact = now if self._contact is None else _towards(self._contact, now, self._cop_gain)
        if self._mode is not _Mode.STEPPING:  # on two feet the CoM's own velocity: ξ = c + ċ/ω
            height = max(state.com[2] - self._contact[2], 0.5 * self.scale.height)
            omega = math.sqrt(GRAVITY / height)
            (x, y, _), (u, v, _) = state.com, state.velocity
            return Divergent(x + u / omega, y + v / omega, omega)
        return divergent_component(
            state.com, state.velocity, state.spin, self._contact, self.scale.mass, 0.5 * self.scale.height
        )

    def _contact_point(self, state: BodyState) -> tuple[float, float, float]:
        """Return the measured centre of pressure of the stance foot, of both feet in a stand, in the world, m."""
        if self._mode is _Mode.STEPPING:
            return self._centre_of_pressure(state, self.stance)
        (ax, ay, az), (bx, by, bz) = (self._centre_of_pressure(state, side) for side in (0, 1))
        left, right = (max(row[2], 0.0) for row in state.wrenches)
        share = left / (left + right) if left + right > self.settings.least_force else 0.5
        return bx + share * (ax - bx), by + share * (ay - by), bz + share * (az - bz)

    def _centre_of_pressure(self, state: BodyState, side: int) -> tuple[float, float, float]:
        """Return the centre of pressure of a sole within its edges, its foothold where it carries nothing, m."""
        _, _, force, roll, pitch, _ = state.wrenches[side]
        if force < self.settings.least_force:
            return self._foothold(state, side)
        length, width = self.scale.sole
        x, y = min(max(-pitch / force, -length), length), min(max(roll / force, -width), width)
        return _on_sole(state, side, x, y)

    def _foothold(self, state: BodyState, side: int) -> tuple[float, float, float]:
        """Return the point of a sole that carries, m."""
        return _on_sole(state, side, self.settings.foothold if self._mode is not _Mode.STANDING else 0.0, 0.0)

    # ---- on both feet -----------------------------------------------------------------------------------------

    def _stand(self, state: BodyState, dcm: Divergent) -> tuple[Event, ...]:
        """Set off when a velocity or a goal asks for it, or step out of a push."""
        s = self.settings
        if self.steering.pending and self._elapsed > s.rest:
            self._enter(_Mode.SHIFTING)
            self._from = state.com
            return (Event.STARTED,)
        if self._outside(state, dcm, 1.0) > 0.0:
            left, right = (abs(self._along(dcm.x - place[0], dcm.y - place[1])[1]) for place in state.places)
            self.stance = 0 if left > right else 1
            return self._begin(state)
        return ()

    def _shift(self, state: BodyState) -> tuple[Event, ...]:
        """Lift the first foot when the weight is on the other one."""
        if self._elapsed < self.settings.shift_time + self.settings.rest:
            return ()
        return self._begin(state)

    def _begin(self, state: BodyState) -> tuple[Event, ...]:
        """Begin to step from a stand."""
        self.ground = state.places[self.stance][2]
        self._since_stand, self._pace = 0, self.settings.step_time
        self.steering.rest(self._middle(state))
        self._lift(state)
        return (Event.LIFT_OFF,)

    def _on_both_feet(
        self, state: BodyState, dcm: Divergent, frames: tuple[pin.SE3, pin.SE3], events: tuple[Event, ...]
    ) -> Reference:
        """References on both feet: the CoM is held over them, or shifted over one of them."""
        s, omega = self.settings, dcm.omega
        feet = [self._foothold(state, side) for side in (0, 1)]
        middle = [0.5 * (a + b) for a, b in zip(*feet, strict=True)]
        height = self.scale.height + middle[2]
        if self._mode is _Mode.STANDING:
            # The ZMP beyond the DCM brings it back: p = ξ + k (ξ − middle).
            wanted = [xi + s.stand_gain * (xi - at) for xi, at in zip(dcm[:2], middle[:2], strict=True)]
            acceleration = [omega * omega * (c - p) for c, p in zip(state.com[:2], wanted, strict=True)]
            phase, duration, heights = Phase.STANDING, 0.0, (height, 0.0)
        else:
            share = min(1.0, self._elapsed / s.shift_time)
            rise = share * share * (3.0 - 2.0 * share)
            rise_speed = 6.0 * (share - share * share) / s.shift_time
            stance, side = feet[self.stance], 1.0 if self.stance == 1 else -1.0
            inside = side * s.shift * s.width / (1.0 + math.exp(omega * s.step_time))
            cos, sin = self._direction
            goal = stance[0] - sin * inside, stance[1] + cos * inside
            stiffness, damping = 2.45 * omega * omega, 3.2 * omega
            acceleration = []
            for c, v, start, end in zip(state.com[:2], state.velocity[:2], self._from[:2], goal, strict=True):
                way = end - start
                acceleration.append(stiffness * (start + way * rise - c) + damping * (way * rise_speed - v))
            way = height - self._from[2]
            phase, duration = Phase.DOUBLE, s.shift_time + s.rest
            heights = self._from[2] + way * rise, way * rise_speed
        return self._reference(
            state,
            dcm,
            frames,
            events,
            phase=phase,
            most_force=(s.most_force, s.most_force),
            height=heights,
            acceleration=(acceleration[0], acceleration[1]),
            duration=duration,
        )

    # ---- stepping ---------------------------------------------------------------------------------------------

    def _step(
        self,
        state: BodyState,
        dcm: Divergent,
        frames: tuple[pin.SE3, pin.SE3],
        events: tuple[Event, ...],
    ) -> Reference:
        """Decide time and place of the step, move the swing foot, and change feet when it has landed."""
        s, dt = self.settings, self._dt
        assert self._contact is not None
        steps = self.steering.update((state.com[0], state.com[1]), (state.velocity[0], state.velocity[1]))
        stance, swing = self.stance, 1 - self.stance
        side = 1.0 if swing == 0 else -1.0
        contact = (self._contact[0], self._contact[1])
        # The feet of a robot that walks sideways come apart and together: so far apart that they do not touch.
        width = max(s.width, s.gap + abs(steps.velocity[1]) * s.step_time / SIDEWAYS)
        step_time = self.steering.step_time
        orbit = Orbit.of(steps.velocity, side, width, step_time, self._pace, dcm.omega)
        ahead, aside = self._along(dcm.x - contact[0], dcm.y - contact[1])
        offset = side * aside

        # Time: until the lateral offset has grown to that of the orbit, or the one ahead outgrows it.
        left = remaining_time(ahead, offset, orbit, dcm.omega, s.over, s.stretch)
        wanted = min(max(self._elapsed + left, s.shortest), s.longest)
        if self._elapsed <= 1.5 * dt:
            self._time = s.step_time if self._since_stand == 0 else min(wanted, 1.15 * step_time)
        if self._met is None:
            self._time += self._time_gain * (wanted - self._time)
        left = max(self._time - self._elapsed, 0.0)

        # Place: where the offsets of the orbit are left, within reach of the stance foot.
        landing = self._landing(state, contact, dcm, left, orbit, side)
        turn = self.steering.heading + steps.turn * left
        self.ground += self._ground_gain * (state.places[stance][2] - self.ground)
        self._swing.travel(self._elapsed, self._time, landing)
        speed = min(s.landing_speed + s.haste * self._uneven, s.hardest)
        self._swing.rise(self._elapsed, self._time, self.ground, speed)

        events = (*events, *self._touch(state, swing))
        self._carry(state, swing)
        if self._met is not None and self._takes_over(dcm, orbit, offset, side):
            events = (*events, *self._change_feet(state, dcm, steps.go))
            if self._mode is _Mode.STANDING:
                return self._on_both_feet(state, self._pendulum(state), frames, events)
            stance, swing = self.stance, 1 - self.stance
        loads = self._most_forces(state)
        foot = Footstep(SIDES[swing], landing[0], landing[1], self.ground, turn)
        return self._reference(
            state,
            dcm,
            frames,
            events,
            phase=Phase.SINGLE,
            most_force=loads,
            height=(self.scale.height + self.ground, 0.0),
            duration=self._time,
            landing=foot,
        )

    def _landing(
        self, state: BodyState, contact: Point, dcm: Divergent, left: float, orbit: Orbit, side: float
    ) -> Point:
        """Return the landing of the centre of the swing foot, m."""
        s, (cos, sin) = self.settings, self._direction
        ahead, aside = orbit.ahead, -side * orbit.inwards
        place = foothold(contact, dcm, left, (cos * ahead - sin * aside, sin * ahead + cos * aside))
        stance = self._foothold(state, self.stance)
        dx, dy = place[0] - stance[0], place[1] - stance[1]
        forward = min(max(cos * dx + sin * dy, -s.reach), s.reach)
        lateral = side * min(max(side * (cos * dy - sin * dx), s.gap), s.widest)
        forward -= s.foothold  # of the centre of the sole, behind the point that carries
        return stance[0] + cos * forward - sin * lateral, stance[1] + sin * forward + cos * lateral

    def _touch(self, state: BodyState, swing: int) -> tuple[Event, ...]:
        """Detect that the swing foot has met the ground, or has lost it again."""
        s, force = self.settings, state.wrenches[swing][2]
        if self._met is None:
            if self._elapsed > s.early * self._time and force > s.contact:
                self._met = self._elapsed
                late = self._elapsed - self._time
                soon = 0.05 * s.step_time
                if late < -soon:
                    return (Event.EARLY_TOUCH_DOWN,)
                return (Event.TOUCH_DOWN if late <= soon else Event.LATE_TOUCH_DOWN,)
        elif (
            force < s.lost
            and self._elapsed - self._met > s.lost_time
            and state.wrenches[self.stance][2] > s.held
        ):
            self._met = None
            self._swing.hold(_tuple(state.places[swing]))
        return ()

    def _carry(self, state: BodyState, swing: int) -> None:
        """Low-pass the place where the foot in contact carries, from its foothold on: it first meets with an edge."""
        if self._met is None:
            self._carrying = self._foothold(state, swing)
        else:
            self._carrying = _towards(self._carrying, self._centre_of_pressure(state, swing), self._cop_gain)

    def _takes_over(self, dcm: Divergent, orbit: Orbit, offset: float, side: float) -> bool:
        """Return True if the foot in contact is to carry: the DCM is near enough, or it cannot wait."""
        s, (x, y, _) = self.settings, self._carrying
        ahead, aside = self._along(dcm.x - x, dcm.y - y)
        inwards = -side * aside
        return (
            inwards <= s.patience * orbit.inwards
            or self._elapsed > s.longest
            or (abs(ahead) > abs(orbit.ahead) + 0.5 * s.stretch and inwards < s.stretch_side)
            or offset < -s.over  # over the outer edge: close up at once
        )

    def _change_feet(self, state: BodyState, dcm: Divergent, go: bool) -> tuple[Event, ...]:
        """Let the foot that has landed carry; stand if the robot is to stop and can."""
        s, (left, right) = self.settings, state.places
        self._uneven = max(abs(left[2] - right[2]), self.settings.memory * self._uneven)
        self._pace += PACE_GAIN * (min(self._elapsed, s.longest) - self._pace)
        self.stance = 1 - self.stance
        self._contact = None
        self.steps_done += 1
        self._since_stand += 1
        apart = math.hypot(left[0] - right[0], left[1] - right[1])
        slow = math.hypot(*self.steering.velocity) < s.stop_speed
        if not go and slow and apart < s.stop_length and self._outside(state, dcm, s.stop_box) <= 0.0:
            self._enter(_Mode.STANDING)
            self.steering.rest(self._middle(state))
            return (Event.STOPPED,)
        self._lift(state)
        self._pendulum(state)
        return (Event.LIFT_OFF,)

    def _lift(self, state: BodyState) -> None:
        self._enter(_Mode.STEPPING)
        self._time, self._met = self.settings.step_time, None
        self._swing.lift(_tuple(state.places[1 - self.stance]))

    def _enter(self, mode: _Mode) -> None:
        self._mode, self._elapsed, self._contact = mode, 0.0, None

    def _most_forces(self, state: BodyState) -> tuple[float, float]:
        """Return the greatest normal force of each foot, N: the old stance foot unloads, one that waits has `share`."""
        s, swing = self.settings, 1 - self.stance
        most = [s.most_force, s.most_force]
        most[swing] = 0.0
        if self._met is not None:
            most[swing] = s.share
        elif self._elapsed < s.unload and self._since_stand > 0 and state.wrenches[swing][2] > s.lost:
            most[swing] = 2.0 * s.share * (1.0 - self._elapsed / s.unload)
        return most[0], most[1]

    # ---- geometry ---------------------------------------------------------------------------------------------

    @property
    def _direction(self) -> Point:
        """Cosine and sine of the heading."""
        heading = self.steering.heading
        return math.cos(heading), math.sin(heading)

    def _along(self, x: float, y: float) -> Point:
        """Return the parts of a vector along the heading and to its left."""
        cos, sin = self._direction
        return cos * x + sin * y, cos * y - sin * x

    def _middle(self, state: BodyState) -> Point:
        (x, y, _), (left, right) = state.com, state.places
        cos, sin = self._direction
        # Along the path the CoM, across it the middle of the feet.
        _, aside = self._along(0.5 * (left[0] + right[0]) - x, 0.5 * (left[1] + right[1]) - y)
        return x - sin * aside, y + cos * aside

    def _outside(self, state: BodyState, dcm: Divergent, share: float) -> float:
        """Return the distance of the DCM outside the standing boxes scaled by `share`, m; negative within them."""
        s, (left, right) = self.settings, state.places
        half_length, half_width = (0.5 * share * size for size in s.standing_box)
        across = left[0] - right[0], left[1] - right[1]
        spacing = math.hypot(*across) + ROUNDING
        ux, uy = across[0] / spacing, across[1] / spacing
        dx, dy = dcm.x - 0.5 * (left[0] + right[0]), dcm.y - 0.5 * (left[1] + right[1])
        return max(abs(dx * uy - dy * ux) - half_length, abs(dx * ux + dy * uy) - 0.5 * spacing - half_width)

    def _reference(
        self,
        state: BodyState,
        dcm: Divergent,
        frames: tuple[pin.SE3, pin.SE3],
        events: tuple[Event, ...],
        *,
        phase: Phase,
        most_force: tuple[float, float],
        height: tuple[float, float],
        duration: float,
        acceleration: Point | None = None,
        landing: Footstep | None = None,
    ) -> Reference:
        assert self._contact is not None
        (x, y, _), (u, v, _) = state.com, state.velocity
        pendulum = Pendulum(
            np.array((x, y, height[0])),
            np.array((u, v, height[1])),
            np.array((0.0, 0.0, 0.0) if acceleration is None else (*acceleration, 0.0)),
            np.array(self._contact),
            np.zeros(3),
            dcm.omega,
        )
        feet = [FootMotion.at_rest(pin.SE3(frame)) for frame in frames]
        swing = None
        if landing is not None and self._met is None:
            swing = 1 - self.stance
            feet[swing] = self._swing_motion(landing.yaw)
        return Reference(
            pendulum,
            (feet[0], feet[1]),
            (most_force[0] > 0.0, most_force[1] > 0.0),
            self.steering.heading,
            phase,
            self.steps_done,
            events,
            NO_REACTION,
            landing,
            self._elapsed,
            duration,
            Support(self.stance, swing, most_force, acceleration is not None, dcm),
        )

    def _swing_motion(self, yaw: float) -> FootMotion:
        """Return the reference of the swing foot, which stays level."""
        swing = self._swing
        (x, y), (u, v), (a, b) = swing.place, swing.velocity, swing.acceleration
        z, rise, c = swing.height
        velocity, acceleration = np.zeros(6), np.zeros(6)
        velocity[:3], acceleration[:3] = (u, v, rise), (a, b, c)
        rotation: Array = pin.rpy.rpyToMatrix(0.0, 0.0, yaw)
        return FootMotion(pin.SE3(rotation, np.array((x, y, z))), velocity, acceleration)


def _on_sole(state: BodyState, side: int, x: float, y: float) -> tuple[float, float, float]:
    """Return a point of a sole in the world, m."""
    (px, py, pz), ((a, b, _), (c, d, _), (e, f, _)) = state.places[side], state.turns[side]
    return px + a * x + b * y, py + c * x + d * y, pz + e * x + f * y


def _towards(
    place: tuple[float, float, float], goal: tuple[float, float, float], gain: float
) -> tuple[float, float, float]:
    """Return a place moved towards another one by a ratio of the distance: a tick of a low-pass."""
    (x, y, z), (u, v, w) = place, goal
    return x + gain * (u - x), y + gain * (v - y), z + gain * (w - z)


def _tuple(vector: Vector) -> tuple[float, float, float]:
    x, y, z = vector
    return x, y, z
