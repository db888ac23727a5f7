"""A point mass on two point feet that does at every tick as the stepping gait says, without a simulator.

The stance foot carries the weight at its foothold, the mass keeps its height and moves as the linear inverted pendulum;
the swing foot is where its reference is, and lands where that reaches the ground.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from pendulum import com_after

from wbc.base.numbers import Array
from wbc.base.vectors import Vector
from wbc.walking.contact import GaitPhase
from wbc.walking.plans.check import Extent
from wbc.walking.source import Reference
from wbc.walking.stepping.felt import BodyState
from wbc.walking.stepping.gait import SteppingWalk
from wbc.walking.stepping.settings import RobotSize, SteppingSettings

SCALE = RobotSize(0.6, leg=0.62, mass=33.0, sole=(0.085, 0.03), ankle=0.035, stride=0.5, swing=65.0)
"""Size of the robot g1, in round numbers."""

Frames = tuple[pin.SE3, pin.SE3]


class Tick(NamedTuple):
    """Input and output of the gait in one tick."""

    time: float
    state: BodyState
    frames: Frames
    reference: Reference


def scaled(k: float) -> RobotSize:
    """Return the size of a robot k times as large, of the same material."""
    s = SCALE
    sole = k * s.sole[0], k * s.sole[1]
    return RobotSize(k * s.height, k * s.leg, k**3 * s.mass, sole, k * s.ankle, k * s.stride, s.swing)


class PointMass:
    """The mass, its feet and its gait, which can be steered between two ticks.

    Attributes:
        gait: The gait.
        com: Centre of mass, m.
        speed: Its velocity over the ground, m/s; add to it to push the mass.
        time: Time since the start, s.
        ticks: All ticks until now.
        ground: Height of the ground under the left and under the right foot, m.
    """

    def __init__(
        self,
        scale: RobotSize = SCALE,
        dt: float = 0.004,
        settings: SteppingSettings | None = None,
        extent: Extent | None = None,
    ) -> None:
        """Stand at the origin, heading along x, on a ground of an extent, m."""
        self.scale, self.dt = scale, dt
        self.gait = SteppingWalk(settings or SteppingSettings(), scale, 0.0, dt, extent=extent)
        self.com = np.array([0.0, 0.0, scale.height])
        self.speed = np.zeros(2)
        self.time = 0.0
        self.ticks: list[Tick] = []
        self.ground = [0.0, 0.0]
        self._feet = [
            pin.SE3(np.eye(3), np.array([0.0, side * scale.height * 0.11 / 0.6, 0.0])) for side in (1, -1)
        ]
        self._load = [0.5, 0.5]

    def run(self, seconds: float, each: Callable[[Tick], None] | None = None) -> list[Tick]:
        """Go on for a time (s), and return its ticks."""
        first = len(self.ticks)
        for _ in range(round(seconds / self.dt)):
            self.ticks.append(tick := self._tick())
            if each is not None:
                each(tick)
        return self.ticks[first:]

    def _tick(self) -> Tick:
        gait, dt, weight = self.gait, self.dt, self.scale.weight
        self.time += dt
        frames = (pin.SE3(self._feet[0]), pin.SE3(self._feet[1]))
        wrenches = []
        for side, load in enumerate(self._load):
            x, y = self.pressure(side)
            wrenches.append([0.0, 0.0, load * weight, y * load * weight, -x * load * weight, 0.0])
        state = BodyState(
            self.com.tolist(),
            (float(self.speed[0]), float(self.speed[1]), 0.0),
            (0.0, 0.0, 0.0),
            (frames[0].translation.tolist(), frames[1].translation.tolist()),
            (frames[0].rotation.tolist(), frames[1].rotation.tolist()),
            wrenches,
            gait.steering.heading,  # the pelvis turns with the walk
            self.scale.mass,
            self._speeds(),
        )
        reference = gait.advance(state, frames)
        self._move(reference)
        return Tick(self.time, state, frames, reference)

    def _speeds(self) -> tuple[Vector, Vector]:
        """Return the velocities of the feet, m/s: one that swings moves as its reference."""
        last = self.ticks[-1].reference if self.ticks else None
        left, right = (
            last.feet[side].velocity[:3].tolist()
            if last is not None and last.progress.air == side
            else [0.0, 0.0, 0.0]
            for side in (0, 1)
        )
        return left, right

    def pressure(self, side: int) -> tuple[float, float]:
        """Return where a sole carries, m: where its reference says in steps, at its centre in a stand."""
        if not self.ticks or (last := self.ticks[-1].reference).progress.phase is GaitPhase.STANDING:
            return 0.0, 0.0
        ahead, aside = last.cop if side == last.progress.stance else (0.0, 0.0)
        return self.gait.constants.area.carrying + ahead, aside

    def _move(self, reference: Reference) -> None:
        dt, omega = self.dt, self.scale.omega
        com, speed = self.com[:2], self.speed
        if reference.progress.phase is not GaitPhase.SINGLE:
            c, pendulum, (stiffness, damping) = self.gait.constants, reference.pendulum, (0.0, 0.0)
            stiffness, damping = c.stand.shift_gains
            if reference.progress.phase is GaitPhase.STANDING:
                stiffness, damping = c.stand.stand_gain * omega**2, (1.0 + c.stand.stand_gain) * omega
            acceleration: Array = pendulum.com_acceleration[:2] + (
                stiffness * (pendulum.com[:2] - com) + damping * (pendulum.com_velocity[:2] - speed)
            )
            self.com[:2], self.speed = (
                com + speed * dt + 0.5 * acceleration * dt**2,
                speed + acceleration * dt,
            )
            self._load = [0.5, 0.5]
            return
        stance = reference.progress.stance
        carrying, (ahead, aside) = self.gait.constants.area.carrying, reference.cop
        contact = self._feet[stance].act(np.array([carrying + ahead, aside, 0.0]))[:2]
        self.com[:2], self.speed = com_after(com, speed, contact, omega, dt)
        self._load = [0.0, 0.0]
        self._load[stance] = 1.0
        swing = reference.progress.air
        if swing is not None:
            motion = reference.feet[swing].placement
            self._feet[swing] = pin.SE3(
                pin.rpy.rpyToMatrix(0.0, 0.0, pin.rpy.matrixToRpy(motion.rotation)[2]),
                np.array([*motion.translation[:2], max(motion.translation[2], self.ground[swing])]),
            )
            if motion.translation[2] > self.ground[swing]:
                return
        if (
            reference.progress.elapsed > 0.5 * reference.progress.duration
        ):  # it has landed, and carries a part
            self._load[1 - stance] = 0.25
            self._load[stance] = 0.75


def moved(tick: Tick, place: pin.SE3) -> tuple[BodyState, Frames]:
    """Return the input of a tick in a world that is moved and turned about the vertical."""
    s, rotation = tick.state, place.rotation
    frames = (place * tick.frames[0], place * tick.frames[1])
    return BodyState(
        place.act(np.array(s.com)).tolist(),
        (rotation @ s.velocity).tolist(),
        (rotation @ s.spin).tolist(),
        (frames[0].translation.tolist(), frames[1].translation.tolist()),
        (frames[0].rotation.tolist(), frames[1].rotation.tolist()),
        s.wrenches,
        s.heading + pin.rpy.matrixToRpy(rotation)[2],
        s.mass,
        ((rotation @ s.speeds[0]).tolist(), (rotation @ s.speeds[1]).tolist()),
    ), frames


MIRROR = np.diag([1.0, -1.0, 1.0])


def mirrored(frame: pin.SE3) -> pin.SE3:
    """Return a placement in a world whose left is right."""
    return pin.SE3(MIRROR @ frame.rotation @ MIRROR, MIRROR @ frame.translation)


def mirrored_input(tick: Tick) -> tuple[BodyState, Frames]:
    """Return the input of a tick in a world whose left is right."""
    s = tick.state
    frames = (mirrored(tick.frames[1]), mirrored(tick.frames[0]))
    signs = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    x, y, z = s.spin
    return BodyState(
        (MIRROR @ s.com).tolist(),
        (MIRROR @ s.velocity).tolist(),
        (-x, y, -z),
        (frames[0].translation.tolist(), frames[1].translation.tolist()),
        (frames[0].rotation.tolist(), frames[1].rotation.tolist()),
        [(signs * s.wrenches[1]).tolist(), (signs * s.wrenches[0]).tolist()],
        -s.heading,
        s.mass,
        ((MIRROR @ s.speeds[1]).tolist(), (MIRROR @ s.speeds[0]).tolist()),
    ), frames


def angle(a: float, b: float) -> float:
    """Return the difference of two angles, rad."""
    return math.remainder(a - b, 2.0 * math.pi)
