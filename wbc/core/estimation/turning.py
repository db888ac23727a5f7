"""Comparison of the gyroscope with legs and accelerometer, by the feet that carry the robot.

A gyroscope that is wrong by ω about a horizontal axis seems to turn every foot by ω. It adds h ω to the velocity that a
leg gives the inertial measurement unit (IMU), with the height h of the IMU, and makes the tilt wrong, so that a part of
gravity seems to accelerate the robot. The accelerometer shows none of this. Where a foot truly turns, as on a stone or
a soft sole, or when it slaps down from an edge, the accelerometer shows what the leg shows. A push moves legs and IMU
alike, since they belong to one body: so the comparison needs no calm robot.
"""

from __future__ import annotations

from collections.abc import Sequence

from wbc.base.lag import lag_gain
from wbc.base.vectors import Vector
from wbc.core.estimation.feet import MEMORY, SMOOTHING
from wbc.core.robot import GRAVITY

CARRYING, SETTLED = 0.4, 0.04
"""Share of the load from which a foot carries, and time for which it must have carried until it is compared, s: the
blow of its landing moves leg and IMU as no model knows."""

TURN, LEGS, DIFFERENT, LASTING = 0.05, 0.03, 0.65, 0.06
"""Speed from which a foot turns, rad/s; velocity from which an error of the gyroscope shows in the legs, m/s; greatest
difference of what the legs show from this velocity, over it, which is 1 if the foot truly turns; and time for which all
this must last, s."""

OFFSET = 1.0
"""Time constant with which a lasting difference, an accelerometer's bias, is taken for normal, s."""


class TurnComparison:
    """Comparison of the turn of each foot that carries with the velocity of its leg and the accelerometer.

    Attributes:
        wrong: True while a foot turns, by the gyroscope, as only a wrong gyroscope explains.
    """

    def __init__(self, dt: float, height: float, feet: int) -> None:
        """Start with nothing known.

        Args:
            dt: Control period, s.
            height: Height of the IMU over the soles of the robot, m.
            feet: Number of feet.
        """
        self._dt, self._height = dt, height
        self._keep, self._gain = 1.0 - lag_gain(dt, MEMORY), lag_gain(dt, SMOOTHING)
        self._slowly = lag_gain(dt, OFFSET)
        self._feet = [_Foot() for _ in range(feet)]
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self.wrong = False
        for foot in self._feet:
            foot.leave()
            foot.offset = 0j

    def compare(
        self,
        feet: Sequence[Vector],
        rotations: Sequence[Vector],
        shares: Sequence[float],
        force: Sequence[float],
    ) -> None:
        """Compare in one tick.

        Args:
            feet: Velocities of the feet against the IMU, in the world, m/s.
            rotations: Angular velocities of the feet by encoders and gyroscope, in the world, rad/s.
            shares: Shares of the load that the feet bear.
            force: Specific force at the IMU, in the world, m/s².
        """
        dt, keep, gain, slowly, height = self._dt, self._keep, self._gain, self._slowly, self._height
        shown = dt * complex(force[0], force[1])
        self.wrong = False
        for foot, (x, y, _), (a, b, _), share in zip(self._feet, feet, rotations, shares, strict=True):
            leg, turn = -complex(x, y), complex(b, -a)
            if share <= CARRYING:
                if foot.carried:
                    foot.leave()
            elif foot.carried >= SETTLED:
                foot.moved = keep * foot.moved + leg - foot.leg - shown
                foot.tilt = keep * foot.tilt + dt * turn
                foot.expected = keep * foot.expected + height * (turn - foot.turn) - GRAVITY * dt * foot.tilt
                foot.offset += slowly * (foot.moved - foot.offset)
                foot.smooth_moved += gain * (foot.moved - foot.offset - foot.smooth_moved)
                foot.smooth_expected += gain * (foot.expected - foot.smooth_expected)
                foot.smooth_turn += gain * (turn - foot.smooth_turn)
                size = abs(foot.smooth_expected)
                alike = abs(foot.smooth_moved - foot.smooth_expected) < DIFFERENT * size
                explained = size > LEGS and abs(foot.smooth_turn) > TURN and alike
                foot.since = foot.since + dt if explained else 0.0
                self.wrong |= foot.since >= LASTING
            foot.leg, foot.turn = leg, turn
            if share > CARRYING:
                foot.carried += dt


class _Foot:
    """State of one foot: velocities as x + iy in the world, m/s, of the IMU by its leg.

    Attributes:
        carried: Time for which it has carried, s; 0 while it does not.
        leg: Velocity by the leg in the last tick.
        turn: Direction in which a turn of the foot moves the IMU, times its speed, in the last tick, rad/s.
        moved: Velocity that the accelerometer does not show, over the last time.
        tilt: Angle by which the foot has turned over the last time, rad.
        expected: Velocity that the leg shows by a gyroscope that is wrong by the turn, over the last time.
        offset: `moved` after a slow low-pass; the only thing that a swing leaves.
        smooth_moved: `moved` without `offset`, after a low-pass.
        smooth_expected: `expected` after a low-pass.
        smooth_turn: `turn` after a low-pass.
        since: Time for which only a wrong gyroscope has explained the turn, s.
    """

    __slots__ = (
        "carried", "leg", "turn", "moved", "tilt", "expected", "offset",
        "smooth_moved", "smooth_expected", "smooth_turn", "since",
    )  # fmt: skip

    def __init__(self) -> None:
        """Start with nothing known."""
        self.offset = 0j
        self.leave()

    def leave(self) -> None:
        """Forget what belongs to the last support."""
        self.carried = self.since = 0.0
        self.leg = self.turn = self.moved = self.tilt = self.expected = 0j
        self.smooth_moved = self.smooth_expected = self.smooth_turn = 0j
