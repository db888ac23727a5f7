"""Comparison of two legs with the accelerometer: which foot carries the robot, and whether the gyroscope is right.

A foot that carries the robot rests on the ground: the velocity that its leg gives the inertial measurement unit (IMU)
changes as the accelerometer says. A foot in the air moves as its swing asks. So legs and accelerometer alone tell which
foot carries, and a foot that rests beside the foot which carries stands on the ground, too.

A gyroscope that is wrong by ω about a horizontal axis seems to turn every foot by ω. It adds h ω to the velocity that a
leg gives the IMU, with the height h of the IMU, and makes the tilt wrong, so that a part of gravity seems to accelerate
the robot. The accelerometer shows none of this. Where a foot truly turns, as on a stone or a soft sole, or when it
slaps down from an edge, the accelerometer shows what the leg shows.

Pushes change nothing of either, since legs and IMU belong to one body: so these comparisons need no calm robot.
`GyroscopeComparison` has a smaller threshold and does: it compares the leg that stands with the accelerometer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from wbc.base.numbers import lag_gain
from wbc.base.vectors import Vector, part_way
from wbc.core.estimation.foot import STILL
from wbc.core.robot import GRAVITY

MEMORY = 0.3
"""Time over which velocities of a leg and of the accelerometer are compared, s."""

SMOOTHING = 0.03
"""Low-pass of speeds, s."""

OFFSET = 1.0
"""Time constant with which a lasting difference, an accelerometer's bias, is taken for normal, s."""


class CarrierThresholds(NamedTuple):
    """Thresholds of the comparison of force sensors with the legs.

    In walks (see `wbc.core.estimation.checks.consistency`) the leg that carries moves by 0.05 m/s against the
    accelerometer at most, under pushes by 0.08 m/s.

    Attributes:
        moves: Velocity of a leg that the accelerometer does not show, from which on its foot moves, m/s.
        more: Ratio of that velocity to that of the other leg from which on the foot moves.
        alone: Least part of the weight that the foot which seems to carry the robot reports.
        silent: Greatest part of the weight that the other one reports then.
        rests: Speed of the feet against each other up to which both stand, m/s.
        missing: Part of the weight that force sensors do not report, of a robot that may be lighter by 30 % than its
            description.
        nearly: Greatest difference of the vertical specific force from gravity, over gravity, at which the ground must
            carry the weight.
        lasting: Time for which a contradiction must last, s.
    """

    moves: float = 0.15
    more: float = 3.0
    alone: float = 0.6
    silent: float = 0.05
    rests: float = 0.1
    missing: float = 0.35
    nearly: float = 0.15
    lasting: float = 0.1


class TurnThresholds(NamedTuple):
    """Thresholds of a foot that seems to turn as only a wrong gyroscope explains.

    In walks all of this holds for 0.02 s at most, with a difference down to 0.34.

    Attributes:
        supports: Share of the load from which on a foot supports the robot, so that its leg tells how the IMU moves.
        settled: Time for which it must have done so, s: the blow of its landing moves leg and IMU as no model knows.
        turn: Speed from which on a foot turns, rad/s.
        velocity: Velocity from which on an error of the gyroscope shows in the legs, m/s.
        different: Greatest difference of what the legs show from this velocity, over it; it is 1 if the foot truly
            turns.
        lasting: Time for which all this must last, s.
    """

    supports: float = 0.4
    settled: float = 0.04
    turn: float = 0.05
    velocity: float = 0.03
    different: float = 0.65
    lasting: float = 0.06


class GyroscopeThresholds(NamedTuple):
    """Thresholds of the comparison of the gyroscope with the leg that stands.

    A foot that turns, as on stones, moves the accelerometer, too; an error of the gyroscope does not. In walks
    the difference is 0.024 m/s at most.

    Attributes:
        difference: Greatest difference between the speeds of legs and accelerometer within `MEMORY`, m/s, while the
            foot on the ground seems to turn.
        turn: Speed from which on the foot on the ground seems to turn, rad/s.
        lasting: Time for which the difference must be too large while the robot stays calm, s.
        blind: Factor of the greatest difference where wrenches are estimated: there the loads of feet that land come
            late, and legs seem to jerk.
        blind_lasting: Time for which it must be too large there, s.
        spin: Speed about the vertical above which a foot on the ground slides, so that speeds are not compared, rad/s.
        slap: Speed about a horizontal axis above which a foot that carries slaps down from an edge, rad/s.
        slapped: Time for which legs and accelerometer are not compared after that, s: the foot leaves the ground in
            part, and its end is a blow.
        remembered: Time for which a doubt stays, s: the difference fades while the gyroscope stays wrong.
    """

    difference: float = 0.035
    turn: float = 0.05
    lasting: float = 0.1
    blind: float = 1.5
    blind_lasting: float = 0.15
    spin: float = 0.5
    slap: float = 2.0
    slapped: float = 0.05
    remembered: float = 1.0


CARRIER, TURN, GYROSCOPE = CarrierThresholds(), TurnThresholds(), GyroscopeThresholds()


class LegComparison:
    """Comparison of the legs of a robot with its accelerometer, and with force sensors and gyroscope.

    Attributes:
        together: True while the feet do not move against each other.
        swapped: True while the foot in the air reports the weight, and the one on the ground none.
        silent: Index of a foot that stands on the ground, carries a part of the weight, and reports no force; else
            None.
        turns: True while a foot turns, by the gyroscope, as only a wrong gyroscope explains.
    """

    def __init__(self, dt: float, height: float) -> None:
        """Start with nothing known; dt is the control period, s, `height` that of the IMU over the soles, m."""
        self._dt, self._height = dt, height
        self._keep, self._gain = 1.0 - lag_gain(dt, MEMORY), lag_gain(dt, SMOOTHING)
        self._slowly = lag_gain(dt, OFFSET)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self.swapped, self.together, self.turns = False, True, False
        self.silent: int | None = None
        self._legs = _Leg(), _Leg()
        self._last: Sequence[Vector] | None = None
        self._between: Vector = STILL
        self._since = [0.0, 0.0]
        self._alone: int | None = None  # foot that carries the robot by its sensor

    def move(
        self,
        feet: Sequence[Vector],
        rotations: Sequence[Vector],
        shares: Sequence[float],
        force: Sequence[float],
    ) -> None:
        """Compare the legs with accelerometer and gyroscope in one tick.

        Args:
            feet: Velocities of the two feet against the IMU, in the world, m/s.
            rotations: Angular velocities of the feet by encoders and gyroscope, in the world, rad/s.
            shares: Shares of the load that the feet bear.
            force: Specific force at the IMU, in the world, m/s².
        """
        last, self._last, self.turns = self._last or feet, feet, False
        dt, keep, gain = self._dt, self._keep, self._gain
        fx, fy, fz = dt * force[0], dt * force[1], dt * (force[2] - GRAVITY)
        for leg, (x, y, z), (u, v, w), (p, q, _), share in zip(
            self._legs, feet, last, rotations, shares, strict=True
        ):
            (a, b, c), change = leg.parted, complex(u - x - fx, v - y - fy)
            leg.parted = keep * a + change.real, keep * b + change.imag, keep * c + w - z - fz
            leg.smooth = part_way(leg.smooth, leg.parted, gain)
            self.turns |= self._turns(leg, change, complex(q, -p), share)
        (x, y, z), (u, v, w) = feet
        self._between = a, b, c = part_way(self._between, (x - u, y - v, z - w), gain)
        self.together = a * a + b * b + c * c < CARRIER.rests**2

    def _turns(self, leg: _Leg, change: complex, turn: complex, share: float) -> bool:
        """Return True if a foot seems to turn as only a wrong gyroscope explains; see `_Leg`."""
        dt, keep, gain = self._dt, self._keep, self._gain
        if share <= TURN.supports:
            leg.leave()
        elif leg.carried >= TURN.settled:
            leg.moved = keep * leg.moved + change
            leg.tilt = keep * leg.tilt + dt * turn
            leg.expected = keep * leg.expected + self._height * (turn - leg.turn) - GRAVITY * dt * leg.tilt
            leg.offset += self._slowly * (leg.moved - leg.offset)
            leg.smooth_moved += gain * (leg.moved - leg.offset - leg.smooth_moved)
            leg.smooth_expected += gain * (leg.expected - leg.smooth_expected)
            leg.smooth_turn += gain * (turn - leg.smooth_turn)
            size = abs(leg.smooth_expected)
            alike = abs(leg.smooth_moved - leg.smooth_expected) < TURN.different * size
            explained = size > TURN.velocity and abs(leg.smooth_turn) > TURN.turn and alike
            leg.since = leg.since + dt if explained else 0.0
        leg.turn = turn
        leg.carried += dt if share > TURN.supports else 0.0
        return leg.since >= TURN.lasting

    def compare(self, parts: Sequence[float], gravity: float) -> None:
        """Compare the force sensors with the motion of the feet in one tick.

        Args:
            parts: Parts of the weight that the force sensors report, after a low-pass.
            gravity: Vertical specific force over gravity, after a low-pass.
        """
        carrying = 0 if parts[0] > parts[1] else 1
        few = parts[1 - carrying] < CARRIER.silent
        alone = carrying if few and parts[carrying] > CARRIER.alone else None
        if alone != self._alone and alone is not None:  # its swing is over
            for leg in self._legs:
                leg.parted = leg.smooth = STILL
        self._alone = alone
        sizes = [math.hypot(*leg.smooth) for leg in self._legs]
        moves = alone is not None and sizes[carrying] > max(CARRIER.moves, CARRIER.more * sizes[1 - carrying])
        nearly = abs(gravity - 1.0) < CARRIER.nearly
        missing = few and self.together and nearly and parts[0] + parts[1] < 1.0 - CARRIER.missing
        for i, wrong in enumerate((moves, missing)):
            self._since[i] = self._since[i] + self._dt if wrong else 0.0
        self.swapped = self._since[0] >= CARRIER.lasting
        self.silent = 1 - carrying if self._since[1] >= CARRIER.lasting else None


class _Leg:
    """State of one leg; horizontal velocities of the IMU by the leg are x + iy in the world, m/s.

    Attributes:
        parted: Velocity that the accelerometer does not show, over the last time, in the world, m/s.
        smooth: The same after a low-pass.
        offset: `moved` after a slow low-pass; the only thing of a support that a swing leaves.
        carried: Time for which the foot has carried, s; 0 while it does not.
        turn: Direction in which a turn of the foot moves the IMU, times its speed, in the last tick, rad/s.
        moved: Velocity that the accelerometer does not show, over the last time of this support.
        tilt: Angle by which the foot has turned over the last time, rad.
        expected: Velocity that the leg shows by a gyroscope that is wrong by the turn, over the last time.
        smooth_moved: `moved` without `offset`, after a low-pass.
        smooth_expected: `expected` after a low-pass.
        smooth_turn: `turn` after a low-pass.
        since: Time for which only a wrong gyroscope has explained the turn, s.
    """

    def __init__(self) -> None:
        """Start with nothing known."""
        self.parted: Vector = STILL
        self.smooth: Vector = STILL
        self.offset = 0j
        self.leave()

    def leave(self) -> None:
        """Forget what belongs to the last support."""
        self.carried = self.since = 0.0
        self.turn = self.moved = self.tilt = self.expected = 0j
        self.smooth_moved = self.smooth_expected = self.smooth_turn = 0j


class GyroscopeComparison:
    """Comparison of the velocity by the leg that stands with that by the accelerometer; x + iy in the world, m/s."""

    def __init__(self, dt: float) -> None:
        """Start with nothing known; dt is the control period, s."""
        self._dt, self._smoothing = dt, lag_gain(dt, SMOOTHING)
        self._keep, self._offset_gain = 1.0 - lag_gain(dt, MEMORY), lag_gain(dt, OFFSET)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self._drift = self._offset = self._parted = (
            0j  # difference, what of it is normal, the rest after a low-pass
        )
        self._turned: Vector = STILL  # turn of the foot since the difference has been too large, rad
        # Time for which the difference has been too large, and for which a slap and a doubt still count, s.
        self._suspected = self._slapped = self._doubted = 0.0

    def update(self, stance: Vector, unexplained: complex, *, blind: bool, steady: bool, turns: bool) -> bool:
        """Compare for one tick; return True while the gyroscope is doubted.

        Args:
            stance: Angular velocity of the foot that stands, by encoders and gyroscope, in the world, rad/s.
            unexplained: Change of the legs' velocity that the accelerometer does not show (`InertialFilter`).
            blind: True if wrenches are estimated.
            steady: True for a calm robot on its feet.
            turns: True if a foot turns as only a wrong gyroscope explains (`LegComparison`).
        """
        g = GYROSCOPE
        most, lasting = (g.blind * g.difference, g.blind_lasting) if blind else (g.difference, g.lasting)
        u, v, w = stance
        self._slapped = g.slapped if math.hypot(u, v) > g.slap else self._slapped - self._dt
        if turns:
            self._doubted = g.remembered
        if not steady or abs(w) > g.spin or self._slapped > 0.0:  # or slides, or steps out of a push
            self._suspected = 0.0
            self._drift, self._parted, unexplained = self._offset, 0j, 0j
        self._drift = drift = self._keep * self._drift + unexplained
        self._offset += self._offset_gain * (drift - self._offset)
        self._parted += self._smoothing * (drift - self._offset - self._parted)
        if abs(self._parted) > most:
            self._suspected += self._dt
            x, y, z = self._turned
            self._turned = x + self._dt * u, y + self._dt * v, z + self._dt * w
            if self._suspected >= lasting and math.hypot(*self._turned) > g.turn * self._suspected:
                self._doubted = g.remembered
        elif self._suspected:
            self._suspected, self._turned = 0.0, STILL
        if self._doubted <= 0.0:
            return False
        self._doubted -= self._dt
        return True
