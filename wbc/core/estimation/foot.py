"""Feet in the estimate of the base: what each bears, how it moves, its point that rests, and which feet rest.

Feet that rest on the ground are the references of the estimate: those that bear load and neither slip, lift nor sink.
The inertial measurement unit says how fast the base moves, the legs say how fast each foot moves against it. A foot
that moves faster than feet that stand is no reference. While there is none, the inertial velocity drifts, so that more
speed counts as rest the longer this lasts. A foot that slips slowly is found by the *steady* inertial velocity, which a
foot that begins to slip has not yet pulled along.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import pinocchio as pin

from wbc.base.vectors import Rotation, Vector, add_cross, part_way, turned_all
from wbc.core.estimation.sinking import Sinking
from wbc.core.frames import Sole, heading

STILL = (0.0, 0.0, 0.0)
"""No motion."""

UNAIDED = 2.0
"""Error of the inertial velocity that may have come up while no foot rested, over the time, m/s²."""

SLIDES = 0.12
"""Speed against the steady velocity of the inertial unit from which a foot that carries slips, m/s. In walks over
stones of 30 mm a foot that rests has 0.08 m/s at most."""

DRIFTS = 0.3
"""Growth of this speed with the time since a foot has rested, m/s²."""

TURNS = 0.5
"""Its growth with the speed at which a foot seems to turn over, m: a gyroscope that is wrong moves a foot, too, and
turns it."""

CARRIES, SETTLED = 0.2, 0.03
"""Share of the load of a foot that carries, and time for which it must have carried before it can slip, s: the legs
jerk at a landing. It counts at once while no foot rests, since the ground is the same."""

STRUCK = 0.03
"""Time for which a foot that bears the robot must seem to sink into the ground until its velocity counts at once, s:
the accelerometer's samples have missed an impact. A foot that lands on an edge seems to sink for 0.02 s."""


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


@dataclass(slots=True)
class FeetAtRest:
    """Feet that rest in one tick, and those that move.

    Attributes:
        shares: Share of each foot in the estimate, that of its load; the sum is 1, or 0 while no foot rests.
        lifts: True for each foot that moves up or down faster than feet that stand, by gyroscope and accelerometer.
            A load on such a leg does not come from the ground.
        slides: True for each foot that carries and slips along the ground, by gyroscope and accelerometer.
        struck: True if the foot that bears the robot is taken for one at rest, whatever the inertial velocity says.
        sliding: True from the tick in which no foot rests, as one slips, until feet and inertial unit agree again.
    """

    shares: list[float]
    lifts: list[bool]
    slides: list[bool]
    struck: bool = False
    sliding: bool = False


class RestDetector:
    """Detector of the feet that rest."""

    def __init__(self, feet: int) -> None:
        """Begin with a number of feet that have carried nothing."""
        self._carried = [0.0] * feet  # time for which each foot has carried, s
        self._sunk = [0.0] * feet  # time for which it has seemed to sink into the ground under a load, s
        self._unaided = 0.0  # time since a foot has rested, s
        self._sliding = False

    def update(
        self,
        feet: Sequence[SoleMotion],
        loads: Sequence[float],
        velocity: Vector | None,
        steady: complex,
        slip: float,
        dt: float,
    ) -> FeetAtRest:
        """Find the feet that rest in one tick.

        Args:
            feet: Motions of the feet in this tick.
            loads: Share of the load that each of them bears.
            velocity: Inertial velocity of the base in the world, m/s; None in the first tick, in which all feet rest.
            steady: Its steady horizontal part, x + iy, m/s.
            slip: Greatest speed of a foot that stands, m/s.
            dt: Time since the last tick, s.
        """
        unaided, none = self._unaided + dt, [False] * len(feet)
        lifts, slides, moves, quick = none.copy(), none.copy(), none.copy(), none.copy()
        if velocity is not None:
            fastest, farthest = slip + UNAIDED * unaided, SLIDES + DRIFTS * unaided
            u, v, w = velocity
            settled = 0.0 if self._sliding else SETTLED
            for i, (foot, load) in enumerate(zip(feet, loads, strict=True)):
                x, y, z = foot.velocity
                speed, rise = math.hypot(x + u, y + v, z + w), z + w
                self._carried[i] = carried = self._carried[i] + dt if load > CARRIES else 0.0
                along = 0.0  # by the steady velocity; a foot that has carried for less cannot slip yet
                if carried > settled:
                    along = abs(complex(x, y) + steady)
                    if not self._sliding:
                        p, q, _ = foot.rotation
                        along -= TURNS * math.hypot(p, q)
                self._sunk[i] = self._sunk[i] + dt if rise < -fastest and load > 0.0 else 0.0
                lifts[i], moves[i] = abs(rise) > fastest, speed > fastest
                slides[i] = along > farthest and not lifts[i]
                quick[i] = speed > slip or along > SLIDES
            if True in slides and all(self._carried) and _alike(feet):
                slides = none
        parts = [0.0 if moves[i] or slides[i] else load for i, load in enumerate(loads)]
        total, struck = sum(parts), False
        if total == 0.0:
            bearing = loads.index(max(loads))
            struck = self._sunk[bearing] >= STRUCK
            if struck:
                self._sunk[bearing], slides[bearing], quick[bearing] = 0.0, False, False
                parts[bearing] = total = loads[bearing]
        if total == 0.0:
            self._unaided, self._sliding = unaided, self._sliding or True in slides
            return FeetAtRest(parts, lifts, slides, sliding=self._sliding)
        if not any([quick[i] and part > 0.0 for i, part in enumerate(parts)]):
            self._unaided, self._sliding = 0.0, False
        return FeetAtRest([part / total for part in parts], lifts, slides, struck, self._sliding)


def _alike(feet: Sequence[SoleMotion]) -> bool:
    """Return True for feet that rest beside each other: it is not the feet that move, but the accelerometer errs."""
    (a, b, _), (c, d, _) = feet[0].velocity, feet[-1].velocity
    return len(feet) > 1 and math.hypot(a - c, b - d) < SLIDES
