"""Motion of the swing foot from lift-off to landing: continuous acceleration, and a landing that may move on the way.

    up        the foot rises before it travels, and sinks the last stretch without travelling
    apex      a little before half way in time, the swing height above the higher end
    landing   the last stretch down at a small constant speed, so that touch-down is soft, early or not
    late      past the planned time the foot sinks on, to a depth

Up a stair the foot travels later and down earlier, so that it clears the edge.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.core.errors import ROUNDING, Array, InputError, positive
from wbc.core.vectors import Vector
from wbc.tasks.trajectories import Quintic
from wbc.walking.planning.footsteps import Footstep
from wbc.walking.planning.gait import Gait

SHORTEST = 0.05
"""Least duration of a piece of the motion, s: ten periods of 5 ms, so that a late change stays a motion."""

EDGE_SHARE = 0.2
"""Ratio of the swing by which the foot travels later up, or earlier down, a stair as high as the swing."""

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
        """Return the motion of a foot that stands."""
        return FootMotion(placement, np.zeros(6), np.zeros(6))


class _Coordinate:
    """One coordinate of the foot as quintics in a row, at rest before the first."""

    def __init__(self, value: float) -> None:
        self._pieces: list[tuple[float, Quintic[float]]] = []
        self._value = value

    def at(self, time: float) -> tuple[float, float, float]:
        for start, piece in reversed(self._pieces):
            if time >= start:
                return piece.at(min(time - start, piece.duration))
        return (self._value, 0.0, 0.0)

    def follow(self, start: float, *goals: tuple[float, tuple[float, float, float]]) -> None:
        """Go to each (time, state) in turn from `start` on; the motion before stays."""
        state = self.at(start)
        self._pieces = [(t, p) for t, p in self._pieces if t < start]
        for time, goal in goals:
            self._pieces.append((start, Quintic(state, goal, time - start)))
            start, state = time, goal


def shortest_swing(gait: Gait) -> float:
    """Return the least duration of a swing, s."""
    return gait.takeoff_time + gait.landing_time + 2.0 * SHORTEST


class SwingFoot:
    """Swing whose landing and time can be changed on the way.

    Attributes:
        duration: Planned time of touch-down from lift-off, s.
        landing: Planned landing.
    """

    def __init__(self, start: pin.SE3, landing: Footstep, duration: float, gait: Gait) -> None:
        """Plan from a foot at rest, its sole frame at lift-off, to a landing after `duration` seconds.

        Raises `InputError` for a duration that the take-off and landing times of the gait do not fit into.
        """
        self._gait = gait
        self.duration = positive("duration of the swing (s)", duration)
        self.landing = landing
        if duration < shortest_swing(gait):
            raise InputError(
                f"a swing of {duration:g} s leaves less than {2 * SHORTEST:g} s between take-off "
                f"({gait.takeoff_time:g} s) and landing ({gait.landing_time:g} s)"
            )
        self._origin = float(start.translation[2])
        x, y, z = (float(v) for v in start.translation)
        roll, pitch, yaw = (float(v) for v in pin.rpy.matrixToRpy(start.rotation))
        values = (x, y, z, roll, pitch, yaw)
        self._c = {name: _Coordinate(value) for name, value in zip(COORDINATES, values, strict=True)}
        self._plan(0.0)

    @property
    def apex_time(self) -> float:
        """Time of the highest point from lift-off, s."""
        return max(self._gait.apex * self.duration, 1.02 * SHORTEST)

    def retarget(self, time: float, landing: Footstep, duration: float) -> None:
        """Change landing and time of touch-down; position, velocity and acceleration go on without a jump.

        Times are from lift-off, s. A touch-down is put off where less than 50 ms would be left. Raises `InputError` for
        a landing of the other foot.
        """
        if landing.side != self.landing.side:
            raise InputError(f"the {self.landing.side} foot swings, got a landing of the {landing.side} foot")
        self.landing, self.duration = landing, max(duration, time + SHORTEST)
        self._plan(time)

    def at(self, time: float) -> FootMotion:
        """Return the foot's motion at a time from lift-off, s; past the duration it searches for the ground below."""
        (x, vx, ax), (y, vy, ay), (z, vz, az), *angles = [self._c[name].at(time) for name in COORDINATES]
        spin, turning = _spin(*angles)
        rotation = pin.rpy.rpyToMatrix(angles[0][0], angles[1][0], angles[2][0])
        return FootMotion(
            pin.SE3(rotation, np.array((x, y, z))),
            np.array((vx, vy, vz, *spin)),
            np.array((ax, ay, az, *turning)),
        )

    def _plan(self, now: float) -> None:
        """Plan all coordinates from now to the landing: the foot travels between rise and descent."""
        self._plan_height(now)
        gait, landing, end = self._gait, self.landing, self.duration
        step = landing.z - self._origin
        share = EDGE_SHARE * end * min(1.0, abs(step) / gait.swing_height)
        leave = gait.takeoff_time + (share if step > 0.0 else 0.0)
        arrive = end - gait.landing_time - (share if step < 0.0 else 0.0)
        start = max(now, leave)
        # A change that comes late uses up the landing time.
        arrive = arrive if arrive >= start + SHORTEST else max(end, start + SHORTEST)
        yaw = self._c["yaw"].at(now)[0]
        goals = {
            "x": landing.x,
            "y": landing.y,
            "roll": landing.roll,
            "pitch": landing.pitch,
            "yaw": yaw + math.remainder(landing.yaw - yaw, math.tau),
        }
        for name, goal in goals.items():
            self._c[name].follow(start, (arrive, (goal, 0.0, 0.0)))

    def _plan_height(self, now: float) -> None:
        """Plan the height: up to the apex, down at the landing speed, on down where no ground comes."""
        gait, landing, end = self._gait, self.landing, self.duration
        speed, height = gait.landing_speed, gait.landing_height
        down = [(end, (landing.z, -speed, 0.0))]
        # A late change, or a short swing, leaves no time to be slow.
        if height > 0.0 and end - max(now, self.apex_time) > height / max(speed, ROUNDING) + SHORTEST:
            down.insert(0, (end - height / speed, (landing.z + height, -speed, 0.0)))
        down.append((end + gait.search_time, (landing.z - gait.search_depth, 0.0, 0.0)))
        top = max(self._origin, landing.z) + gait.swing_height
        if now < self.apex_time - SHORTEST and end - self.apex_time >= SHORTEST:
            self._c["z"].follow(now, (self.apex_time, (top, 0.0, 0.0)), *down)
        else:
            self._c["z"].follow(now, *down)


def _spin(roll: Vector, pitch: Vector, yaw: Vector) -> tuple[Vector, Vector]:
    """Angular velocity and acceleration in the world, of angles, rad, each with its first and second derivative."""
    (_, roll_rate, roll_push), (angle, pitch_rate, pitch_push), (heading, yaw_rate, yaw_push) = (
        roll,
        pitch,
        yaw,
    )
    cp, sp, cy, sy = math.cos(angle), math.sin(angle), math.cos(heading), math.sin(heading)
    # The axis of roll is (cy cp, sy cp, −sp), that of pitch (−sy, cy, 0), that of yaw the vertical.
    along, across = cp * roll_rate, cp * roll_push - sp * pitch_rate * roll_rate - yaw_rate * pitch_rate
    aside = pitch_push + yaw_rate * along
    return (
        (cy * along - sy * pitch_rate, sy * along + cy * pitch_rate, yaw_rate - sp * roll_rate),
        (cy * across - sy * aside, sy * across + cy * aside, yaw_push - sp * roll_push - pitch_rate * along),
    )
