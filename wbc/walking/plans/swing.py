"""One foot in the air, from lift-off until it meets the ground: its landing and its time may change at any tick.

    up        the foot rises before it travels, and sinks the last stretch without travelling
    apex      a little before half way in time, the swing height above the highest of both ends and the way between them
    landing   the last stretch down at a small speed, so that touch-down is soft, early or not
    late      past the planned time the foot sinks on, to a depth

Every change goes on from position, velocity and acceleration as they are. Up a stair the foot travels later, its heel
first, and down earlier, so that it clears the edge.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array
from wbc.base.vectors import Vector
from wbc.core.frames import pose_of
from wbc.core.robot import GRAVITY
from wbc.core.trajectories import QuinticPath
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.gait import SwingShape

HEEL_TIME = 0.35
"""Time over that of the swing at which the heel of a foot that rises onto a stair is highest over its toes."""

RISE = 10.0 / math.sqrt(3.0)
"""Greatest acceleration of a quintic from rest to rest, over the way and the inverse square of its time."""

LEAST_RISE = 1.02
"""Least time to the apex, over that of a piece: a change at lift-off leaves the rise a piece of its own."""

CLEAR = 0.3
"""Least height of a short swing, of that of a long one."""

REST = np.zeros(6)
REST.setflags(write=False)

COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")


class FootMotion(NamedTuple):
    """Motion of a sole at one instant.

    Attributes:
        placement: Sole frame in the world.
        velocity: [linear; angular] of the sole frame's origin, in world axes, shape (6,), m/s and rad/s.
        acceleration: Derivative of the velocity, shape (6,), m/s² and rad/s².
    """

    placement: pin.SE3
    velocity: Array
    acceleration: Array

    @staticmethod
    def at_rest(placement: pin.SE3) -> FootMotion:
        """Return the motion of a foot that stands; its velocity and acceleration cannot be written."""
        return FootMotion(placement, REST, REST)


class SwingFoot:
    """Swing whose landing and time can be changed on the way.

    Attributes:
        duration: Planned time of touch-down from lift-off, s.
        landing: Planned landing.
        over: Height of the highest ground known on the way, m; −∞ where none is.
        shape: Shape of the swing.
        lifted: Height from which the foot was lifted, m.
    """

    def __init__(
        self, start: pin.SE3, landing: Footstep, duration: float, shape: SwingShape, over: float = -math.inf
    ) -> None:
        """Plan from a foot at rest, for a duration of `SwingShape.shortest` at least, s."""
        self.shape = shape
        self.duration = duration
        self.landing, self.over = landing, over
        self._restart(start, (0.0, 0.0, shape.lift_speed))
        self._plan(0.0)

    def _restart(self, place: pin.SE3, velocity: Vector, push: Vector = (0.0, 0.0, 0.0)) -> None:
        """Begin at a place with a velocity, m/s, and an acceleration, m/s², and without turning."""
        x, y, z = (float(v) for v in place.translation)
        roll, pitch, yaw = (float(v) for v in pin.rpy.matrixToRpy(place.rotation))
        self.lifted = z
        self._c = {
            name: QuinticPath((value, speed, rate))
            for name, value, speed, rate in zip(
                COORDINATES,
                (x, y, z, roll, pitch, yaw),
                (*velocity, 0.0, 0.0, 0.0),
                (*push, 0.0, 0.0, 0.0),
                strict=True,
            )
        }

    @property
    def apex_time(self) -> float:
        """Time of the highest point from lift-off, s."""
        return max(self.shape.apex * self.duration, LEAST_RISE * self.shape.piece)

    def retarget(
        self,
        time: float,
        landing: Footstep,
        duration: float,
        shape: SwingShape | None = None,
        over: float = -math.inf,
    ) -> None:
        """Change landing, time of touch-down and shape; the motion goes on without a jump.

        The shape stays where none is given; the ground on what is left of the way may be known to be higher, m. A
        touch-down comes no sooner than after the least duration of a piece. In the last half of that before it, and
        after it, the foot sinks as planned, unless it is put off, and only its place follows.
        """
        if landing.side != self.landing.side:
            raise InputError(f"the {self.landing.side} foot swings, got a landing of the {landing.side} foot")
        self.landing, self.shape, self.over = landing, shape or self.shape, max(self.over, over)
        piece = self.shape.piece
        if time > self.duration - 0.5 * piece + ROUNDING and duration < time + piece:
            self._plan_place(time, max(duration, self.duration))
            return
        self.duration = max(duration, min(time + piece, self.duration))
        self._plan(time)

    def resume(self, time: float, place: pin.SE3) -> None:
        """Search for the ground from a place at rest, where a foot has lost it again; the time is from lift-off, s."""
        self._restart(place, (0.0, 0.0, 0.0))
        self.duration = min(self.duration, time)
        down = self.lifted - self.shape.search_depth
        self._c["z"].follow(time, (time + self.shape.search_time, (down, 0.0, 0.0)))
        self._plan_place(time, self.duration)

    def restart(self, time: float, place: pin.SE3, velocity: Vector, most: float = math.inf) -> None:
        """Plan anew to the same landing from the place and the velocity (m/s) of a foot that was thrown off its way.

        The acceleration goes on as it was, over the ground with `most` at most, m/s²: a foot that is thrown again and
        again would else begin each time without any, and come late.
        """
        origin, lift = self.lifted, self.shape.lift
        x, y, z = (self._c[name].at(time)[2] for name in COORDINATES[:3])
        x, y = _bounded(x, y, most)
        self._restart(place, velocity, (x, y, min(max(z, -lift), lift)))
        self.lifted = origin
        self._plan(time)

    def join(self, time: float, place: pin.SE3, velocity: Vector, ground: float, most: float) -> None:
        """Go on with a foot that has been in the air for a time, s, over a ground at a height, m; see `restart`."""
        self.lifted = ground
        self.restart(time, place, velocity, most)

    def motion(self, time: float) -> tuple[Vector, Vector]:
        """Return the place, m, and the velocity, m/s, at a time from lift-off, s, in the world."""
        (x, u, _), (y, v, _), (z, w, _) = (self._c[name].at(time) for name in COORDINATES[:3])
        return (x, y, z), (u, v, w)

    def at(self, time: float, most: float = math.inf) -> FootMotion:
        """Return the foot's motion at a time from lift-off, s; past the duration it searches for the ground below.

        Its acceleration over the ground is `most` at most, m/s²: legs have no more.
        """
        (x, vx, ax), (y, vy, ay), (z, vz, az), *angles = [self._c[name].at(time) for name in COORDINATES]
        ax, ay = _bounded(ax, ay, most)
        spin, turning = _spin(*angles)
        rotation = pin.rpy.rpyToMatrix(angles[0][0], angles[1][0], angles[2][0])
        return FootMotion(
            pose_of(rotation, np.array((x, y, z))),
            np.array((vx, vy, vz, *spin)),
            np.array((ax, ay, az, *turning)),
        )

    def heading(self, time: float) -> float:
        """Return the heading at a time from lift-off, s, rad."""
        return self._c["yaw"].at(time)[0]

    def _plan(self, now: float) -> None:
        """Plan the motion from now on: the height, which may put the touch-down off, and then the place."""
        self._plan_height(now)
        self._plan_place(now, self.duration)

    def _plan_place(self, now: float, end: float) -> None:
        """Plan place and tilt from now to the landing at `end`, s: the foot travels between rise and descent."""
        shape, landing = self.shape, self.landing
        step = landing.z - self.lifted
        share = shape.edge * end * min(1.0, abs(step) / shape.swing_height)
        leave = shape.takeoff_time + (share if step > 0.0 else 0.0)
        arrive = end - shape.landing_time - (share if step < 0.0 else 0.0)
        start = max(now, leave)
        # A change that comes late uses up the landing time.
        arrive = arrive if arrive >= start + shape.piece else max(end, start + shape.piece)
        yaw = self._c["yaw"].at(now)[0]
        turned = yaw + math.remainder(landing.yaw - yaw, math.tau)
        for name, goal in (("x", landing.x), ("y", landing.y), ("yaw", turned)):
            self._c[name].follow(start, (arrive, (goal, 0.0, 0.0)))
        level = arrive if shape.level == 1.0 else min(arrive, max(shape.level * end, start + shape.piece))
        self._c["roll"].follow(start, (level, (landing.roll, 0.0, 0.0)))
        down, heel = (level, (landing.pitch, 0.0, 0.0)), HEEL_TIME * end
        # All of it where the stair is half a swing higher than where it begins.
        up = shape.heel * min(2.0 * (step / shape.swing_height - shape.stair), 1.0)
        if up > 0.0 and now < heel - shape.piece:
            self._c["pitch"].follow(now, (heel, (up, 0.0, 0.0)), down)
        else:
            self._c["pitch"].follow(start, down)

    def _plan_height(self, now: float) -> None:
        """Plan the height: up to the apex, down at the landing speed and slower, on down where no ground comes."""
        shape, landing, end = self.shape, self.landing, self.duration
        speed, height = shape.landing_speed, shape.landing_height
        if shape.quickest > 0.0 and now > 0.0:
            drop = max(self._c["z"].at(now)[0] - landing.z - shape.piece * speed, 0.0)
            self.duration = end = max(end, now + shape.quickest * math.sqrt(drop / GRAVITY))
        down = [(end, (landing.z, -speed, 0.0))]
        # A late change, or a short swing, leaves no time to be slow.
        slow = 2.0 * height / max((1.0 + shape.touch) * speed, ROUNDING)
        if height > 0.0 and end - max(now, self.apex_time) > slow + shape.piece:
            down = [
                (end - slow, (landing.z + height, -speed, 0.0)),
                (end, (landing.z, -shape.touch * speed, 0.0)),
            ]
        down.append((end + shape.search_time, (landing.z - shape.search_depth, 0.0, 0.0)))
        top = max(self.lifted, landing.z, self.over) + shape.swing_height
        if shape.lift < math.inf:
            top = min(
                top,
                max(self._reach(now), max(self.lifted, landing.z, self.over) + CLEAR * shape.swing_height),
            )
        if now < self.apex_time - shape.piece and end - self.apex_time >= shape.piece:
            self._c["z"].follow(now, (self.apex_time, (top, 0.0, 0.0)), *down)
        else:
            self._c["z"].follow(now, *down)

    def _reach(self, now: float) -> float:
        """Return the height that a foot can have at its apex, by its acceleration, m."""
        left = max(self.apex_time - now, 0.0)
        z, speed, _ = self._c["z"].at(now)
        return z + max(speed, 0.0) * 0.5 * left + self.shape.lift * left * left / RISE


def _bounded(x: float, y: float, most: float) -> tuple[float, float]:
    """Return a vector of the plane, no longer than `most`."""
    length = math.hypot(x, y)
    return (x, y) if length <= most else (x * most / length, y * most / length)


def _spin(roll: Vector, pitch: Vector, yaw: Vector) -> tuple[Vector, Vector]:
    """Angular velocity and acceleration in the world, of angles, rad, each with its first and second derivative."""
    (_, roll_rate, roll_push), (angle, pitch_rate, pitch_push) = roll, pitch
    heading, yaw_rate, yaw_push = yaw
    cp, sp, cy, sy = math.cos(angle), math.sin(angle), math.cos(heading), math.sin(heading)
    # The axis of roll is (cy cp, sy cp, −sp), that of pitch (−sy, cy, 0), that of yaw the vertical.
    along, across = cp * roll_rate, cp * roll_push - sp * pitch_rate * roll_rate - yaw_rate * pitch_rate
    aside = pitch_push + yaw_rate * along
    return (
        (cy * along - sy * pitch_rate, sy * along + cy * pitch_rate, yaw_rate - sp * roll_rate),
        (cy * across - sy * aside, sy * across + cy * aside, yaw_push - sp * roll_push - pitch_rate * along),
    )
