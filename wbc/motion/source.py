"""Tracking of a clip: a source of references for the controller of a walk.

    clip  →  pendulum, feet, contacts  →  stabilizer  →  tasks  →  command
          →  joints and trunk, with velocities and accelerations  ↗

All references are computed before the first tick. Joints and the base's position follow cubic splines through the
frames, its orientation a spline of rotations; the rest is kinematics and the rate of the centroidal momentum, without
further differences. The pendulum has the ZMP of all bodies (`zmp_of`), and accelerates as that asks,

    c̈* = (c̈_z + g) (c − z) / h,

so that fast arms are no disturbance: the wrench that the stabilizer wants is the one that the motion makes.

Feet that stand are contacts and yield to the measured wrenches as in a walk; a foot in the air follows the clip from
where it was lifted, and stands where it has landed. Early ground ends a swing.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation, RotationSpline

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import Period
from wbc.core.drive.control import State
from wbc.core.estimation.momentum import TOUCH_DOWN
from wbc.core.frames import heading
from wbc.core.robot import GRAVITY, Robot
from wbc.core.trajectories import minimum_jerk
from wbc.motion.clip import MotionClip
from wbc.motion.contacts import find_contacts
from wbc.motion.kinematics import (
    FORCE_SMOOTHING,
    BodyMotion,
    Soles,
    least_lift,
    moved,
    offset_between,
    zmp_of,
)
from wbc.tasks.stabilizer.distribution import DistributionSettings
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.contact import Event, GaitPhase
from wbc.walking.plans.footsteps import mean_heading
from wbc.walking.plans.leg import Leg
from wbc.walking.plans.sources import DriveSettings
from wbc.walking.plans.swing import FootMotion
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.source import Progress, Reference, ReferenceSource, WholeBody
from wbc.walking.table import TaskGains

START = 0.1
"""Greatest distance of a joint from the first frame of a clip at which tracking may begin, rad."""

FADE = 0.2
"""Time in which a foot that is lifted goes over to the path of the clip, s."""

EARLY = 0.1
"""Time before its landing from which on a foot that bears a load has met the ground, s."""


def tracking_settings() -> WalkingControlSettings:
    """Return the settings of a walk's controller that tracks a clip.

    The cost of a foot depends on its load, and the soles press evenly. The posture task holds the joints, but those of
    the legs only weakly, since soles, centre of mass and pelvis determine the legs.
    """
    return WalkingControlSettings(
        distribution=DistributionSettings(by_load=True),
        tasks=TaskGains(posture_weight=1.0, posture_stiffness=100.0),
    )


class MotionSource(ReferenceSource):
    """Source of references that follow a clip, and then stand in its last frame.

    Steering raises an `InputError`.

        clip = make_feasible(robot, given).clip
        robot.update(clip.configurations(robot)[0], np.zeros(robot.nv))
        source = MotionSource(robot, clip, plant.control_period)
        control = WalkingControl(robot, source, plant.control_period, tracking_settings())

    Attributes:
        clip: The clip, moved to the place of the robot.
        configurations: Configurations of the clip at the ticks, shape (T, nq).
        motion: References of all ticks, from the clip.
        tick: Index of the present tick in `motion`.
        com_height: Height of the CoM over the soles at the start, m.
    """

    unsteered = (
        "a robot that tracks a clip cannot be steered, nor stopped before: it stands when the clip is over"
    )

    @checked
    def __init__(self, robot: Robot, clip: MotionClip, dt: Period) -> None:
        """Move the clip to the place where the robot stands; the motion begins with the first tick.

        Args:
            robot: The robot, in the first frame of the clip, anywhere on level ground.
            clip: Clip of its joints.
            dt: Control period, s.

        Raises:
            InputError: The robot leaves the ground in the clip (the message has the time), or it does not stand as in
                the first frame.
        """
        self.made_for, self._dt = (robot, dt), dt
        q = clip.configurations(robot)
        motion = BodyMotion.of(robot, q, clip.rate)
        _, standing = find_contacts(motion, clip.standing)
        off = abs(robot.q[7:] - q[0, 7:])
        worst = int(off.argmax())
        if not off[worst] <= START:
            raise InputError(
                f"the robot must stand as the clip begins, every joint within {START:g} rad; joint "
                f"'{robot.joint_names[worst]}' is at {robot.q[7 + worst]:.3f} rad, in the clip at "
                f"{q[0, 7 + worst]:.3f} rad"
            )
        soles = [robot.placement(sole.frame) for sole in robot.soles[:2]]
        left, right = (place.copy() for place in soles)
        ground = 0.5 * float(left.translation[2] + right.translation[2])
        self.com_height = min(float(robot.com[2]) - ground, Leg(robot).bent_height(DriveSettings().stretch))
        self.clip = placed(clip, motion.soles[0], (left, right))
        self.configurations, self.motion = clip_references(robot, self.clip, standing, ground, dt)
        self.tick = 0
        self._feet = [TrackedFoot(sole, dt) for sole in soles]
        self._load, self._ahead = TOUCH_DOWN * robot.mass * GRAVITY, round(EARLY / dt)

    @property
    def finished(self) -> bool:
        """True when the clip is over and the robot stands in its last frame."""
        return self.tick >= len(self.motion) - 1

    @property
    def landings(self) -> int:
        """Number of landings so far."""
        return sum(foot.landings for foot in self._feet)

    def update(self, state: State) -> Reference:
        """Return the references of this tick, and land or lift the feet."""
        last = len(self.motion) - 1
        self.tick = i = min(round(state.time / self._dt), last)
        given, soon = self.motion[i], self.motion[min(i + self._ahead, last)].progress.contact
        bears = [load > self._load for load in state.load.tolist()]
        events: tuple[Event, ...] = ()
        for side, foot in enumerate(self._feet):
            planned = given.progress.contact[side]
            events += foot.switch(i, given.feet[side], planned=planned, early=soon[side] and bears[side])
        left, right = (foot.motion(i, each) for foot, each in zip(self._feet, given.feet, strict=True))
        contact = self._feet[0].stands, self._feet[1].stands
        phase = GaitPhase.DOUBLE if all(contact) else GaitPhase.SINGLE
        swing = None if all(contact) else contact.index(False)
        now = Progress(
            phase=GaitPhase.STANDING if self.finished else phase,
            stance=0 if swing is None else 1 - swing,
            swing=swing,
            contact=contact,
            heading=given.progress.heading,
            steps_done=self.landings,
            events=events,
        )
        return given._replace(feet=(left, right), progress=now)


class TrackedFoot:
    """One sole of a robot that tracks a clip: it stands at a place, or follows the clip from where it was lifted.

    Attributes:
        landings: Number of its landings so far.
    """

    def __init__(self, sole: pin.SE3, dt: float) -> None:
        """Stand where the sole is, whose placement is that of every tick."""
        self._sole, self._dt = sole, dt
        self._place, self.landings = sole.copy(), 0
        self._lifted: tuple[int, Array] | None = None  # tick of lift-off, and offset from the clip there
        self._early = False  # it stands before its time

    @property
    def stands(self) -> bool:
        """True for a sole on the ground."""
        return self._lifted is None

    def switch(self, i: int, given: FootMotion, *, planned: bool, early: bool) -> tuple[Event, ...]:
        """Lift or land when the clip says so, by a `planned` contact, or when the foot meets the ground `early`."""
        if self._lifted is None:
            if planned or self._early:
                self._early = self._early and not planned
                return ()
            self._lifted = i, offset_between(given.placement, self._sole)
            return (Event.LIFT_OFF,)
        if not (planned or early):
            return ()
        self._lifted, self._early, self._place = None, not planned, pin.SE3(self._sole)
        self.landings += 1
        return (Event.TOUCH_DOWN if planned else Event.EARLY_TOUCH_DOWN,)

    def motion(self, i: int, given: FootMotion) -> FootMotion:
        """Return the motion in a tick: at rest where the sole stands; in the air the given one, from where it was."""
        if self._lifted is None:
            return FootMotion.at_rest(self._place)
        begin, offset = self._lifted
        x = (i - begin) * self._dt / FADE
        if x >= 1.0:
            return given
        way, slope = minimum_jerk(x)
        curvature = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)
        return FootMotion(
            moved(given.placement, (1.0 - way) * offset),
            given.velocity - slope / FADE * offset,
            given.acceleration - curvature / FADE**2 * offset,
        )


def clip_references(
    robot: Robot, clip: MotionClip, standing: Array, ground: float, dt: float
) -> tuple[Array, tuple[Reference, ...]]:
    """Return configurations, shape (T, nq), and references of the ticks of a clip, of a period, s.

    `standing` is true where the left and the right sole stand in each frame, shape (frames, 2); `ground` is the height
    of the ground, m.
    """
    q, v, a = splines(robot, clip, dt)
    body = _Motion.of(robot, q, v, a)
    com, acceleration = body.com, body.acceleration
    # The pendulum whose ZMP is that of the motion of all bodies.
    zmp = zmp_of(com, acceleration, body.turning / robot.mass, ground)
    zmp = gaussian_filter1d(zmp, FORCE_SMOOTHING / dt, axis=0, mode="nearest")
    height = com[:, 2:] - ground
    asked = acceleration.copy()
    asked[:, :2] = least_lift(acceleration) * (com[:, :2] - zmp) / height
    points = np.insert(zmp, 2, ground, axis=1)
    rates = np.insert(np.gradient(zmp, dt, axis=0), 2, 0.0, axis=1)
    omega = np.sqrt(GRAVITY / height[:, 0]).tolist()
    pendulums = zip(com, body.velocity, asked, points, rates, omega, strict=True)
    nearest = np.minimum(np.round(np.arange(len(q)) * dt * clip.rate).astype(int), len(clip) - 1)
    return q, tuple(
        Reference(
            Pendulum(*pendulum),
            (left, right),
            Progress(contact=tuple(contact), heading=_facing(left.placement, right.placement)),
            body=WholeBody(
                com_acceleration=acceleration[i],
                trunk=[(m.placement.rotation, m.velocity[3:], m.acceleration[3:]) for m in trunk],
                position=q[i, 7:],
                velocity=v[i, 6:],
                acceleration=a[i, 6:],
            ),
        )
        for i, (pendulum, contact, (left, right), trunk) in enumerate(
            zip(pendulums, standing[nearest].tolist(), body.soles, body.trunk, strict=True)
        )
    )


class _Motion(NamedTuple):
    """Motion of the bodies in T ticks, in the world."""

    com: Array  # centre of mass, shape (T, 3), m
    velocity: Array  # its velocity, shape (T, 3), m/s
    acceleration: Array  # its acceleration, shape (T, 3), m/s²
    turning: Array  # rate of the angular momentum about it, shape (T, 3), Nm
    soles: list[list[FootMotion]]  # of each tick, left and right
    trunk: list[list[FootMotion]]  # of each tick, pelvis and torso

    @staticmethod
    def of(robot: Robot, q: Array, v: Array, a: Array) -> _Motion:
        """Compute all motions of configurations, velocities and accelerations."""
        model, data, count = robot.model, robot.model.createData(), len(q)
        soles = [robot.frame_id(sole.frame) for sole in robot.soles[:2]]
        parts = [robot.frame_id(part) for part in robot.trunk_frames]
        com, velocity, acceleration, turning = (np.empty((count, 3)) for _ in range(4))
        made = _Motion(com, velocity, acceleration, turning, [], [])

        def motion(frame: int) -> FootMotion:
            speed = pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            change = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            return FootMotion(data.oMf[frame].copy(), speed.vector.copy(), change.vector.copy())

        for i in range(count):
            turning[i] = pin.computeCentroidalMomentumTimeVariation(model, data, q[i], v[i], a[i]).angular
            pin.centerOfMass(model, data, q[i], v[i], a[i])
            com[i], velocity[i], acceleration[i] = data.com[0], data.vcom[0], data.acom[0]
            pin.updateFramePlacements(model, data)
            made.soles.append([motion(sole) for sole in soles])
            made.trunk.append([motion(part) for part in parts])
        return made


def splines(robot: Robot, clip: MotionClip, dt: float) -> tuple[Array, Array, Array]:
    """Return configurations, velocities and accelerations of a clip at the ticks of a period, s."""
    frames = clip.configurations(robot)
    count = math.ceil(clip.duration / dt - ROUNDING) + 1
    t = np.minimum(np.arange(count) * dt, clip.duration)
    columns = CubicSpline(clip.times, np.delete(frames, range(3, 7), axis=1), bc_type="clamped")
    turn = RotationSpline(clip.times, Rotation.from_quat(frames[:, 3:7]))
    rotation = turn(t)
    body = rotation.inv()
    rates, rate_changes = turn(t, 1), turn(t, 2)
    place, speed, change = columns(t), columns(t, 1), columns(t, 2)
    q = np.hstack([place[:, :3], rotation.as_quat(), place[:, 3:]])
    # The base's velocity is along its own axes; its spatial acceleration lacks the turn of the velocity.
    linear = body.apply(speed[:, :3])
    v = np.hstack([linear, rates, speed[:, 3:]])
    a = np.hstack([body.apply(change[:, :3]) - np.cross(rates, linear), rate_changes, change[:, 3:]])
    a[0], a[-1], v[0], v[-1] = 0.0, 0.0, 0.0, 0.0  # a clip begins and ends at rest
    return q, v, a


def placed(clip: MotionClip, own: Soles, soles: Soles) -> MotionClip:
    """Return a clip moved and turned about the vertical: its soles, first at `own` places, begin at others."""
    rotation = pin.utils.rotate("z", _facing(*soles) - _facing(*own))
    here = 0.5 * (soles[0].translation + soles[1].translation)
    there = 0.5 * (own[0].translation + own[1].translation)
    base = clip.base.copy()
    base[:, :3] = (base[:, :3] - there) @ rotation.T + here
    base[:, 3:] = (Rotation.from_matrix(rotation) * Rotation.from_quat(base[:, 3:])).as_quat()
    return replace(clip, base=base)


def _facing(left: pin.SE3, right: pin.SE3) -> float:
    """Return the heading of a robot by its soles, rad."""
    return mean_heading(heading(left.rotation), heading(right.rotation))
