"""One foot in the estimate of the base: what it bears, how it moves, and the point of it that rests."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pinocchio as pin

from wbc.base.vectors import Rotation, Vector, add_cross, part_way, turned_all
from wbc.core.estimation.sinking import Sinking
from wbc.core.frames import Sole, heading

STILL = (0.0, 0.0, 0.0)
"""No motion."""


@dataclass(slots=True)
class SoleMotion:
    """Motion of the sole of a foot in one tick, under a base that turns but does not move.

    Attributes:
        velocity: Velocity of the CoP in the world, m/s.
        rotation: Angular velocity in the world, rad/s.
        arm: Vector from the centre of the sole to the CoP in the base frame, m.
        point: CoP in the base frame, m.
        axis: First axis of the sole in the base frame.
        heading: Heading of that axis in the world, rad.
    """

    velocity: Vector
    rotation: Vector
    arm: Vector
    point: Vector
    axis: Vector
    heading: float


class FootEstimate:
    """Estimate of one foot, in plain numbers: what it bears, and its anchor, the point of it that rests.

    Attributes:
        load: Normal force after the low-pass, N.
        cop: CoP over the sole, ahead of its centre and to the left, m.
        anchor: Place of the anchor in the world, m.
        yaw: Heading of the foot at rest, rad.
        rolled: Way up of the CoP over the sole, m.
    """

    __slots__ = ("_half", "_least", "_sinking", "anchor", "cop", "load", "rolled", "yaw")

    def __init__(self, sole: Sole, place: pin.SE3, least: float, sinking: Sinking) -> None:
        """Begin with a foot that rests without load, and its sole at a place in the world.

        `least` is the force up to which a foot has no CoP, N.
        """
        self._half = 0.5 * sole.length, 0.5 * sole.width
        self._least, self._sinking = least, sinking
        self.cop = 0.0, 0.0
        self.load = self.rolled = 0.0
        self.anchor: Vector = tuple(place.translation.tolist())
        self.yaw = heading(place.rotation)

    def update(
        self,
        wrench: Vector,
        sole: tuple[Rotation, Vector],
        rate: pin.Motion,
        base: Rotation,
        spin: Vector,
        gains: tuple[float, float],
        dt: float,
    ) -> SoleMotion:
        """Take in the wrench on the sole, and return how the foot moves; the anchor moves over the sole with the CoP.

        `sole` is the rotation of the sole and its place in the base, `rate` its velocity in the base frame; `base` is
        the rotation of the base, `spin` its angular velocity in the world, rad/s; `gains` are those of the low-passes
        of load and CoP.
        """
        dx, dy, taken = self._bear(wrench, gains)
        x, y = self.cop
        ((a, b, _), (c, d, _), (e, f, _)), (at_x, at_y, at_z) = sole
        arm = u, v, w = a * x + b * y, c * x + d * y, e * x + f * y
        point, axis = (at_x + u, at_y + v, at_z + w), (a, c, e)
        vx, vy, vz, p, q, r = rate.vector.tolist()
        turning = p, q, r
        at_cop = add_cross((vx, vy, vz), turning, arm)
        step = a * dx + b * dy, c * dx + d * dy, e * dx + f * dy
        (step_x, step_y, step_z), moving, (p, q, r), reach, ahead = turned_all(
            base, (step, at_cop, turning, point, axis)
        )
        sinking, (anchor_x, anchor_y, anchor_z) = self._sinking, self.anchor
        self.anchor = anchor_x + step_x, anchor_y + step_y, anchor_z + step_z - sinking.compliance * taken
        self.rolled += step_z
        (vx, vy, vz), (spin_x, spin_y, spin_z) = add_cross(moving, spin, reach), spin
        sinks = sinking.steady * taken / dt if dt > 0.0 else 0.0
        rotation = p + spin_x, q + spin_y, r + spin_z
        return SoleMotion((vx, vy, vz + sinks), rotation, arm, point, axis, math.atan2(ahead[1], ahead[0]))

    def _bear(self, wrench: Vector, gains: tuple[float, float]) -> tuple[float, float, float]:
        """Take in a wrench on the sole; return by how much its CoP moves over the sole, m, and its load grows, N."""
        (_, _, force, roll, pitch, _), (to_load, to_cop) = wrench, gains
        before = self.load
        self.load = before + to_load * (max(force, 0.0) - before)
        x = y = 0.0
        if force > self._least:
            length, width = self._half
            x = min(max(-pitch / force, -length), length)
            y = min(max(roll / force, -width), width)
        old_x, old_y = self.cop
        dx, dy = to_cop * (x - old_x), to_cop * (y - old_y)
        self.cop = old_x + dx, old_y + dy
        return dx, dy, self.load - before

    def draw(self, place: Vector, yaw: float, share: float) -> None:
        """Draw the anchor and the heading at rest a share of the way to a place in the world, m, and a heading, rad."""
        self.anchor = part_way(self.anchor, place, share)
        self.yaw += share * math.remainder(yaw - self.yaw, math.tau)
