"""One foot in the estimate of the base: what it bears, how it moves, and the point of it that rests."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pinocchio as pin

from wbc.base.vectors import Rotation, Vector, add_cross, turned, turned_all
from wbc.core.estimation.sinking import Sinking
from wbc.core.frames import Sole

SLIDES = 0.12
"""Speed against the steady velocity of the inertial unit from which a foot that carries slips, m/s. In walks over
stones of 30 mm a foot that rests has 0.08 m/s at most."""

TURNS = 0.5
"""Speed by which this threshold grows with the speed at which a foot seems to turn over, m: a gyroscope that is wrong
moves a foot, too, and turns it."""

CARRIES, SETTLED = 0.2, 0.03
"""Share of the load of a foot that carries, and time for which it must have carried before it can slip, s: the legs
jerk at a landing. It counts at once while no foot rests, since the ground is the same. Feet that carry and rest beside
each other do not slip: an accelerometer that is wrong shows the same of both."""


class FootEstimate:
    """State of one foot, in plain numbers: its load, its motion, and its anchor, the point of it that rests.

    Attributes:
        load: Normal force after the low-pass, N.
        load_share: Share of the load that the foot bears.
        share: The same, but 0 for a foot that moves: the share of the estimate that comes from the foot.
        lifts: True if the foot moves up or down faster than feet that stand.
        slides: True if the foot carries and slips along the ground.
        moves: True if it moves in any way that a foot at rest does not.
        motion: Velocity of the CoP in the world while the base turns but does not move, m/s.
        rotation: Angular velocity in the world, rad/s.
        arm: Vector from the centre of the sole to the CoP in the base frame, m.
        point: CoP in the base frame, m.
        axis: First axis of the sole in the base frame.
        ahead: The same axis in the world.
        anchor: Place of the anchor in the world, m.
        yaw: Heading of the foot at rest, rad.
        cop: CoP over the sole, ahead of its centre and to the left, m.
        rolled: Way up of the CoP over the sole, m.
        sinks: Velocity at which the foot sinks by its load, m/s.
        carried: Time for which the foot has carried, s.
        sunk: Time for which it has seemed to sink into the ground under a load, s.
        quick: True if it is faster than a foot at rest, also while it must be taken for one, after a flight.
    """

    __slots__ = (
        "_half", "ahead", "anchor", "arm", "axis", "carried", "cop", "lifts", "load", "load_share", "motion", "moves",
        "point", "quick", "rolled", "rotation", "share", "sinks", "slides", "sunk", "yaw",
    )  # fmt: skip

    def __init__(self, sole: Sole) -> None:
        """Begin with a foot without load."""
        self._half = 0.5 * sole.length, 0.5 * sole.width
        self.motion: Vector = (0.0, 0.0, 0.0)
        self.rotation: Vector = (0.0, 0.0, 0.0)

    def reset(self, sole: pin.SE3) -> None:
        """Rest without load where the sole is."""
        self.load = self.load_share = self.share = self.rolled = self.sinks = self.carried = self.sunk = 0.0
        self.lifts = self.slides = self.moves = self.quick = False
        self.cop = 0.0, 0.0
        self.anchor: Vector = tuple(sole.translation.tolist())
        self.yaw = yaw_of(sole.rotation[:, 0].tolist())

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
        low-passes of load and CoP, `least` is the force without a share, N.
        """
        (_, _, force, roll, pitch, _), (to_load, to_cop) = wrench, gains
        before, rotation = self.load, sole[0]
        self.load = before + to_load * (max(force, 0.0) - before)
        self.load_share = max(self.load - least, 0.0)  # to be divided by that of all feet
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
        self.sinks = sinking.steady * (self.load - before) / dt if dt > 0.0 else 0.0
        at_x, at_y, at_z = self.anchor
        self.anchor = at_x + step_x, at_y + step_y, at_z + step_z - sunk
        self.rolled += step_z

    def move(self, rate: pin.Motion, base: Rotation, spin: Vector) -> None:
        """Take in how the foot moves: its velocity in the base frame, and the spin of the base in the world, rad/s."""
        turning = rate.angular.tolist()
        at_cop = add_cross(rate.linear.tolist(), turning, self.arm)
        sliding, (u, v, w), point, self.ahead = turned_all(base, (at_cop, turning, self.point, self.axis))
        (x, y, z), (a, b, c) = add_cross(sliding, spin, point), spin
        self.motion, self.rotation = (x, y, z + self.sinks), (u + a, v + b, w + c)

    def judge(
        self,
        expected: Sequence[float],
        steady: complex,
        most: tuple[float, float, float],
        dt: float,
        *,
        sliding: bool,
    ) -> None:
        """Find out whether the foot lifts, slips, sinks or moves in another way.

        `expected` is the velocity that the base is to have, m/s, `steady` its steady horizontal part; `most` are speeds
        of a foot at rest: at most, after a time without any, and along the ground, m/s. `sliding` is True while no foot
        rests.
        """
        (x, y, z), (u, v, w), (slip, fastest, farthest) = self.motion, expected, most
        speed = math.hypot(x + u, y + v, z + w)
        self.moves, self.quick, self.lifts = speed > fastest, speed > slip, abs(z + w) > fastest
        self.sunk = self.sunk + dt if z + w < -fastest and self.load_share > 0.0 else 0.0
        self.carried = self.carried + dt if self.load_share > CARRIES else 0.0
        along = 0.0
        if self.carried > (0.0 if sliding else SETTLED):
            along = abs(complex(x, y) + steady)
            if not sliding:
                along -= TURNS * math.hypot(*self.rotation[:2])
        self.slides = along > farthest and not self.lifts
        self.quick |= along > SLIDES

    def rest(self) -> None:
        """Take the foot for one at rest, whatever it seems to do."""
        self.share, self.sunk = self.load_share, 0.0
        self.slides = self.quick = False


def yaw_of(axis: Vector) -> float:
    """Return the heading of a direction, such as the x axis of a frame, rad."""
    return math.atan2(axis[1], axis[0])
