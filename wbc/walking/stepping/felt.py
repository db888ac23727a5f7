"""State that a stepping walk feels: the robot, where its feet carry, the DCM, and the supported area of a sole."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.base.numbers import ROUNDING, Array, lag_gain
from wbc.base.vectors import Point, Rotation, Vector, part_way
from wbc.core.drive.control import State
from wbc.core.frames import heading
from wbc.core.robot import GRAVITY, Robot
from wbc.tasks.stabilizer.pendulum import zmp_offset
from wbc.walking.contact import GaitPhase
from wbc.walking.stepping.law import Divergent, divergent_component
from wbc.walking.stepping.settings import AreaConstants, GaitValues

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
    mass: float  # mass of the robot with the load that it holds, kg
    speeds: tuple[Vector, Vector] = (ORIGIN, ORIGIN)  # velocities of the soles in the world, m/s
    rates: tuple[Vector, Vector] = (ORIGIN, ORIGIN)  # their angular velocities in the world, rad/s
    hand_wrench: Array | None = None  # wrench of the surroundings on the hands; see `State.hand_wrench`
    compliance: float = 0.0  # depth of a foot over its load, m/N

    def on_sole(self, side: int, x: float, y: float) -> Vector:
        """Return a point of a sole in the world, m."""
        (px, py, pz), ((a, b, _), (c, d, _), (e, f, _)) = self.places[side], self.turns[side]
        return px + a * x + b * y, py + c * x + d * y, pz + e * x + f * y

    def tilting(self, side: int) -> Point:
        """Return the rates at which the far and the left end of a sole rise, over their distance, rad/s."""
        (u, v, _), ((a, b, _), (c, d, _), _) = self.rates[side], self.turns[side]
        return u * c - v * a, u * d - v * b


class BodyReader:
    """Reader of one robot's state; the placements of its soles are looked up once."""

    def __init__(self, robot: Robot) -> None:
        """Look up the soles."""
        left, right = robot.soles
        self.robot = robot
        self.frames: Frames = robot.placement(left.frame), robot.placement(right.frame)
        self._soles = robot.frame_id(left.frame), robot.frame_id(right.frame)
        self._places = self.frames[0].translation, self.frames[1].translation  # views, as the next ones
        self._turns = self.frames[0].rotation, self.frames[1].rotation
        self._pelvis = robot.placement(robot.base_frame).rotation

    def read(self, state: State) -> BodyState:
        """Return the state of a tick."""
        robot = self.robot
        left, right = (pin.getFrameVelocity(robot.model, robot.data, sole, WORLD) for sole in self._soles)
        return BodyState(
            com=robot.com.tolist(),
            velocity=robot.com_velocity.tolist(),
            spin=robot.data.hg.angular.tolist(),
            places=(self._places[0].tolist(), self._places[1].tolist()),
            turns=(self._turns[0].tolist(), self._turns[1].tolist()),
            wrenches=state.measurement.wrenches.tolist(),
            heading=heading(self._pelvis) - state.hip_turn,
            mass=robot.mass,
            speeds=(left.linear.tolist(), right.linear.tolist()),
            rates=(left.angular.tolist(), right.angular.tolist()),
            hand_wrench=state.hand_wrench,
            compliance=state.compliance,
        )


class GaitState:
    """Phase, feet and state of a gait, with its contact point and its DCM, on both feet or on one.

    Attributes:
        phase: Phase now.
        stance: Foot that carries while the present or next step swings: 0 left, 1 right.
        swing: The other foot.
        elapsed: Time since the start of this phase, s: of a step since lift-off.
        state: State of the robot in this tick.
        frames: Placements of its soles.
        dcm: Divergent component of motion: on one foot by the angular momentum about the contact point. A wrench on the
            hands moves it by the offset δ = (M_y, −M_x) / mg of their moment M about that point: ξ + δ runs away from
            the contact as ξ does of a robot without hands.
        offset: That offset δ, m; zero without a wrench.
    """

    state: BodyState
    frames: Frames
    dcm: Divergent
    offset: Point = 0.0, 0.0

    def __init__(self, values: GaitValues) -> None:
        """Begin on both feet."""
        _, law, self._scale, self._dt = values
        self._touch, self._area = law.touch, law.area
        self._gain = lag_gain(self._dt, self._area.cop_lag)
        self._begin(GaitPhase.STANDING, 1)

    def _begin(self, phase: GaitPhase, stance: int, elapsed: float = 0.0) -> None:
        self.phase, self.stance, self.swing, self.elapsed = phase, stance, 1 - stance, elapsed
        self._contact: Vector | None = None
        self._alone = phase is GaitPhase.SINGLE
        self._ahead = 0.0 if phase is GaitPhase.STANDING else self._area.carrying

    def enter(self, phase: GaitPhase, stance: int, elapsed: float = 0.0) -> None:
        """Go on from this tick on in another phase, in which a time, s, is over already.

        The robot is felt anew: about the contact of the foot that stands, or of both feet. Soles carry at their centres
        in a stand, and at their carrying points as soon as the robot walks.
        """
        self._begin(phase, stance, elapsed)
        self.follow()

    @property
    def contact(self) -> Vector:
        """Measured centre of pressure of the feet that carry, low-passed, in the world, m."""
        assert self._contact is not None
        return self._contact

    def take(self, state: BodyState, frames: Frames) -> None:
        """Take in the state of the next tick."""
        self.elapsed += self._dt
        self.state, self.frames = state, frames
        self.follow()

    def follow(self) -> None:
        """Low-pass the contact point and find the DCM about it."""
        now, state, scale = self.contact_point(), self.state, self._scale
        contact = now if self._contact is None else part_way(self._contact, now, self._gain)
        self._contact = contact
        if self._alone:
            self.dcm = divergent_component(
                state.com, state.velocity, state.spin, contact, state.mass, 0.5 * scale.height
            )
        else:
            self.dcm = self.own_dcm(contact[2])
        self.offset = 0.0, 0.0
        if state.hand_wrench is not None:
            dcm, weight = self.dcm, state.mass * GRAVITY
            self.offset = u, v = tuple(zmp_offset(state.hand_wrench, np.array(contact), weight).tolist())
            self.dcm = dcm._replace(x=dcm.x + u, y=dcm.y + v)

    def own_dcm(self, ground: float) -> Divergent:
        """Return the DCM by the CoM's own velocity, ξ = c + ċ/ω, over a ground at a height, m."""
        (x, y, z), (u, v, _) = self.state.com, self.state.velocity
        omega = math.sqrt(GRAVITY / max(z - ground, 0.5 * self._scale.height))
        return Divergent(x + u / omega, y + v / omega, omega)

    def contact_point(self) -> Vector:
        """Return the measured centre of pressure of the feet that carry, in the world, m."""
        if self._alone:
            return self.centre_of_pressure(self.stance)
        (ax, ay, az), (bx, by, bz) = (self.centre_of_pressure(side) for side in (0, 1))
        left, right = (max(row[2], 0.0) for row in self.state.wrenches)
        share = left / (left + right) if left + right > self._touch.least_force else 0.5
        return bx + share * (ax - bx), by + share * (ay - by), bz + share * (az - bz)

    def centre_of_pressure(self, side: int) -> Vector:
        """Return the centre of pressure of a sole within its edges, m; where it carries nothing, where it would."""
        _, _, force, roll, pitch, _ = self.state.wrenches[side]
        if force < self._touch.least_force:
            return self.carrying_point(side)
        length, width = self._scale.sole
        x, y = min(max(-pitch / force, -length), length), min(max(roll / force, -width), width)
        return self.state.on_sole(side, x, y)

    def carrying_point(self, side: int) -> Vector:
        """Return the point of a sole that carries, m."""
        return self.state.on_sole(side, self._ahead, 0.0)

    def outside(self, dcm: Divergent, share: float) -> float:
        """Return the distance of the DCM outside the standing boxes scaled by `share`, m; negative within them."""
        left, right = self.state.places
        half_length, half_width = (0.5 * share * size for size in self._area.standing_box)
        across = left[0] - right[0], left[1] - right[1]
        spacing = math.hypot(*across) + ROUNDING
        ux, uy = across[0] / spacing, across[1] / spacing
        dx, dy = dcm.x - 0.5 * (left[0] + right[0]), dcm.y - 0.5 * (left[1] + right[1])
        return max(abs(dx * uy - dy * ux) - half_length, abs(dx * ux + dy * uy) - 0.5 * spacing - half_width)

    def kicked(self) -> int | None:
        """Return the foot that a push has thrown off the ground while the other one holds, else None."""
        touch, loads, speeds = self._touch, [row[2] for row in self.state.wrenches], self.state.speeds
        for side in (0, 1):
            thrown = loads[side] < touch.lost and math.hypot(*speeds[side]) > touch.kicked
            if thrown and loads[1 - side] > touch.held:
                return side
        return None


class HeldArea:
    """Supported area of the foot that stands, as far as it is known: where the centre of pressure may go.

    It is a point at first, and grows in all directions while the foot does not turn. Where the foot turns over an edge
    it ends at the measured centre of pressure. On rough ground it is reduced on narrow soles, down to a point: it wins
    less there than a wrong estimate costs. On ground that has been level in the last steps it is not, and grows sooner.
    Edges are distances from the carrying point.

    Attributes:
        ahead: Edges behind and ahead, m.
        aside: Edges to the right and to the left, m.
        evenness: Share from 0 to 1 by which the ground counts as level.
    """

    evenness = 0.0

    def __init__(self, sole: tuple[float, float], constants: AreaConstants, dt: float) -> None:
        """Hold a point of a sole of half a length and half a width, m."""
        self._constants, self._dt = constants, dt
        self._spin_gain = lag_gain(dt, constants.spin_lag)
        self._centre = constants.carrying, 0.0
        least, full = constants.trusted
        trust = min(max((sole[1] - least) / (full - least), 0.0), 1.0)
        self._trust = trust
        half = [max(half - constants.margin, 0.0) for half in sole]
        self._most = [max(h - at, 0.0) for h, at in zip(half, self._centre, strict=True)]
        self._least = [min(-h - at, 0.0) for h, at in zip(half, self._centre, strict=True)]
        self.forget()

    def forget(self) -> None:
        """Begin with a point: nothing is known of the ground under the foot."""
        self.ahead, self.aside = [0.0, 0.0], [0.0, 0.0]
        self._spin = [0.0, 0.0]  # rates at which the ends of the sole's axes rise, low-passed, rad/s

    @property
    def width(self) -> float:
        """Half of the extent across the sole, m, as far as rough ground would have it."""
        return min(0.5 * (self.aside[1] - self.aside[0]), self.widest)

    @property
    def widest(self) -> float:
        """The greatest `width`, m."""
        return self._trust * self._most[1]

    def caught(self, share: float) -> tuple[Point, Point]:
        """Return the least and greatest offset of ξ, ahead and aside, that a share of the next sole holds, m.

        On level ground it is expected to be supported as far as the margin, on rough ground as far as it counts there.
        """
        trust = share * max(self._trust, self.evenness)
        (behind, right), (ahead, left) = self._least, self._most
        return (trust * behind, trust * ahead), (trust * right, trust * left)

    def across(self, side: float) -> Point:
        """Return the edges far from the swing foot and near it, m, in the axis towards this foot; 1 is a left one."""
        right, left = self.aside
        return (right, left) if side > 0.0 else (-left, -right)

    def update(self, tilting: Point, wrench: Vector, evenness: float) -> None:
        """Take in a tick: the rates at which the far and the left end of the sole rise, rad/s, and the wrench on it.

        The ground counts as level by a share from 0 to 1.
        """
        self.evenness = evenness
        constants, dt, gain = self._constants, self._dt, self._spin_gain
        self._spin = [spin + gain * (rate - spin) for spin, rate in zip(self._spin, tilting, strict=True)]
        _, _, force, roll, pitch, _ = wrench
        if force < constants.carries:
            return
        grown = constants.area_growth * (1.0 + constants.level_growth * evenness) * dt
        trust = max(self._trust, self.evenness)
        for i, (edges, moment) in enumerate(((self.ahead, -pitch), (self.aside, roll))):
            cop, spin = moment / force - self._centre[i], self._spin[i]
            if abs(spin) < constants.still:
                edges[0] = max(edges[0] - grown, trust * self._least[i])
                edges[1] = min(edges[1] + grown, trust * self._most[i])
            elif spin < -constants.turning:  # the far end goes down: it turns over the far edge
                edges[1] = max(0.0, min(edges[1], cop - constants.inside))
            elif spin > constants.turning:
                edges[0] = min(0.0, max(edges[0], cop + constants.inside))
