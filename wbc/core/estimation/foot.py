"""One foot in the estimate of the base: what it bears, how it moves, and the point of it that rests."""

from __future__ import annotations

import math

import pinocchio as pin

from wbc.base.vectors import Rotation, Vector, add_cross, part_way, turned, turned_all
from wbc.core.estimation.sinking import Sinking
from wbc.core.frames import Sole

STILL = (0.0, 0.0, 0.0)
"""No motion."""


class FootEstimate:
    """State of one foot, in plain numbers: its load, its motion, and its anchor, the point of it that rests.

    Attributes:
        load: Normal force after the low-pass, N.
        motion: Velocity of the CoP in the world while the base turns but does not move, m/s.
        rotation: Angular velocity in the world, rad/s.
        arm: Vector from the centre of the sole to the CoP in the base frame, m.
        point: CoP in the base frame, m.
        axis: First axis of the sole in the base frame.
        ahead: Heading of that axis in the world, rad.
        anchor: Place of the anchor in the world, m.
        yaw: Heading of the foot at rest, rad.
        cop: CoP over the sole, ahead of its centre and to the left, m.
        rolled: Way up of the CoP over the sole, m.
    """

    __slots__ = (
        "_half", "_sinks", "ahead", "anchor", "arm", "axis", "cop", "load", "motion", "point", "rolled", "rotation",
        "yaw",
    )  # fmt: skip

    def __init__(self, sole: Sole, place: pin.SE3) -> None:
        """Begin with a foot that rests without load, and its sole at a place in the world."""
        self._half = 0.5 * sole.length, 0.5 * sole.width
        self.cop = 0.0, 0.0
        self._sinks = 0.0  # velocity at which the foot sinks by its load, m/s
        self.load = self.rolled = 0.0
        self.motion: Vector = STILL
        self.rotation: Vector = STILL
        self.anchor: Vector = tuple(place.translation.tolist())
        self.yaw = yaw_of(place.rotation[:, 0].tolist())

    def bear(
        self,
        wrench: Vector,
        base: Rotation,
        sole: tuple[Rotation, Vector],
        gains: tuple[float, float],
        least: float,
        sinking: Sinking,
        dt: float,
    ) -> None:
        """Take in the wrench on the sole; the anchor moves over the sole with the CoP.

        `base` is the rotation of the base, `sole` that of the sole and its place in the base; `gains` are those of the
        low-passes of load and CoP, `least` is the force without a CoP, N.
        """
        (_, _, force, roll, pitch, _), (to_load, to_cop) = wrench, gains
        before, rotation = self.load, sole[0]
        self.load = before + to_load * (max(force, 0.0) - before)
        x = y = 0.0
        if force > least:
            length, width = self._half
            x = min(max(-pitch / force, -length), length)
            y = min(max(roll / force, -width), width)
        old_x, old_y = self.cop
        dx, dy = to_cop * (x - old_x), to_cop * (y - old_y)
        self.cop = x, y = old_x + dx, old_y + dy
        (a, b, _), (c, d, _), (e, f, _) = rotation
        self.arm = u, v, w = a * x + b * y, c * x + d * y, e * x + f * y
        at_x, at_y, at_z = sole[1]
        self.point, self.axis = (at_x + u, at_y + v, at_z + w), (a, c, e)
        step_x, step_y, step_z = turned(base, (a * dx + b * dy, c * dx + d * dy, e * dx + f * dy))
        sunk = sinking.compliance * (self.load - before)
        self._sinks = sinking.steady * (self.load - before) / dt if dt > 0.0 else 0.0
        at_x, at_y, at_z = self.anchor
        self.anchor = at_x + step_x, at_y + step_y, at_z + step_z - sunk
        self.rolled += step_z

    def move(self, rate: pin.Motion, base: Rotation, spin: Vector) -> None:
        """Take in how the foot moves: its velocity in the base frame, and the spin of the base in the world, rad/s."""
        turning = rate.angular.tolist()
        at_cop = add_cross(rate.linear.tolist(), turning, self.arm)
        sliding, (u, v, w), point, axis = turned_all(base, (at_cop, turning, self.point, self.axis))
        (x, y, z), (a, b, c) = add_cross(sliding, spin, point), spin
        self.motion, self.rotation = (x, y, z + self._sinks), (u + a, v + b, w + c)
        self.ahead = yaw_of(axis)

    def turn(self) -> None:
        """Rest with the present heading."""
        self.yaw = self.ahead

    def draw(self, place: Vector, yaw: float, share: float) -> None:
        """Draw the anchor and the heading at rest a share of the way to a place in the world, m, and a heading, rad."""
        self.anchor = part_way(self.anchor, place, share)
        self.yaw += share * wrapped(yaw - self.yaw)


def yaw_of(axis: Vector) -> float:
    """Return the heading of a direction, such as the x axis of a frame, rad."""
    return math.atan2(axis[1], axis[0])


def wrapped(angle: float) -> float:
    """Return an angle within half a turn, rad."""
    return math.remainder(angle, math.tau)
