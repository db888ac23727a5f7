"""Catch on one foot: a robot pushed over the outer edge of its stance foot swings the free leg out, and lands it wide.

Neither a landing nor a cross-over helps against such a push: the other foot would have to come down beyond the stance
foot. What helps is angular momentum. The trunk leans over the edge (`wbc.walking.stabilizer.lean`), and the free leg is
thrown the other way; a foot that comes to rest d further out moves the DCM back by κ d, κ being the share of the leg
(`wbc.walking.pattern.reaction`). With the ZMP at the edge the DCM then comes back by itself:

    out    the free foot goes out and stays in the air; the plan waits, its touch-down is put off
    back   the DCM is inside the edge, all parts at rest: the plan goes on from there; the foot comes over its landing
    down   the trunk is upright again, so that the leg is long enough: the foot comes down, wide
    both   double support as long as the DCM takes to come over to the foot that has landed

*At rest* is the DCM when trunk and leg have stopped, which costs what their spin has given.

Source: A. Hofmann, M. Popovic, H. Herr, "Exploiting angular momentum to enhance bipedal center-of-mass control", ICRA
2009 (trunk and free leg as sources of moment). Phases and conditions are ours.
"""

from __future__ import annotations

import enum
import math
from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np

from wbc.core.errors import Array
from wbc.core.settings import NonNegative, Positive, Share, settings
from wbc.walking.pattern.swing import SwingFoot
from wbc.walking.planning.footsteps import SIDES, Footstep
from wbc.walking.planning.phases import Phase, WalkPhases
from wbc.walking.planning.schedule import SoleSizes

PUT_OFF = 0.6
"""Time that the plan has until touch-down while the foot waits, s; it is given anew before 0.2 s of it have passed."""

STRAYED = 0.03
"""Distance of the DCM from the plan at which it is planned anew, m."""

MARGIN = 0.01
"""Distance of the ZMP from the edge with which the way of the DCM is timed, m."""

AHEAD = 0.03
"""Distance of the DCM from the centre of the next stance foot, to the inner side, at its lift-off, m."""


@settings
class CatchSettings:
    """Settings of the catch on one foot.

    Attributes:
        enabled: True to catch pushes.
        trigger_room: Distance of the DCM from the outer edge of the stance foot below which a push is caught, m.
        trigger_error: Least distance of the DCM from the plan, outward, for that, m.
        leg_way: Way of the foot outward from its planned landing, as a share of the height of the CoM.
        landing_way: Distance outward at which it lands, as a share of the height of the CoM; within reach.
        leg_roll: Roll of the foot that is out, rad/m: ankles have less range than hips.
        leg_time: Duration of the way out, s.
        return_time: Duration of the way from there over the landing, s.
        lowering_time: Duration of the way down, s.
        wait_height: Height at which the foot waits, m.
        caught_room: Room of the DCM at rest at which the plan goes on from it, m.
        landing_room: Room of the DCM at rest from which on the foot may come down, m.
        upright: Lean of the trunk below which it may come down, rad.
        longest_catch: Longest time on one foot, s.
    """

    enabled: bool = False
    trigger_room: Annotated[NonNegative, "m"] = 0.02
    trigger_error: Annotated[Positive, "m"] = 0.04
    leg_way: Share = 0.45
    landing_way: Share = 0.25
    leg_roll: Annotated[NonNegative, "rad/m"] = 1.2
    leg_time: Annotated[Positive, "s"] = 0.35
    return_time: Annotated[Positive, "s"] = 0.5
    lowering_time: Annotated[Positive, "s"] = 0.2
    wait_height: Annotated[NonNegative, "m"] = 0.05
    caught_room: Annotated[NonNegative, "m"] = 0.045
    landing_room: Annotated[NonNegative, "m"] = 0.05
    upright: Annotated[Positive, "rad"] = 0.25
    longest_catch: Annotated[Positive, "s"] = 2.5


class Trunk(NamedTuple):
    """Trunk of a robot whose push is caught.

    Attributes:
        angle: Lean, rad.
        sway: Shift of the DCM that stopping the trunk costs, m.
    """

    angle: float
    sway: tuple[float, float]


class Turn(NamedTuple):
    """Result of a tick.

    Attributes:
        active: True while a push is caught: no other adjustment is made.
        replan: True if the pattern is to be planned anew.
        dcm: DCM from which it then goes on, shape (2,), m; that of the pattern when None.
    """

    active: bool
    replan: bool = False
    dcm: Array | None = None


class _State(enum.Enum):
    NONE = enum.auto()
    OUT = enum.auto()
    BACK = enum.auto()
    DOWN = enum.auto()
    BOTH = enum.auto()


class _Room(NamedTuple):
    """Room of the DCM to the outer edge of the stance foot, m; the direction outward has shape (2,)."""

    outward: Array
    now: float
    at_rest: float
    error: float


class Catch:
    """Catch on one foot for one walk.

    Attributes:
        settings: Settings.
        sink: Depth under the landing of the swing foot at which the ground is, m: below zero while it waits.
    """

    def __init__(
        self,
        settings: CatchSettings,
        sizes: SoleSizes,
        height: float,
        omega: float,
        period: float,
        share: float,
        widest: float,
    ) -> None:
        """Begin without a push.

        Args:
            settings: Settings.
            sizes: (length, width) of the left and of the right sole, m.
            height: Height of the CoM over the support, m.
            omega: Natural frequency, 1/s.
            period: Control period, s.
            share: κ of the robot.
            widest: Greatest lateral distance between the soles' centres, m.
        """
        self.settings = settings
        self.sink = 0.0
        self._sizes, self._height, self._omega, self._period = sizes, height, omega, period
        self._share, self._widest = share, widest
        self._state = _State.NONE
        self._landing: Footstep | None = None
        self._there = 0.0  # time at which the foot is out, from lift-off, s

    @property
    def active(self) -> bool:
        """True while a push is caught."""
        return self._state is not _State.NONE

    def on_one_foot(
        self,
        phases: WalkPhases,
        swing: SwingFoot,
        planned: Footstep,
        dcm: Array,
        reference: Array,
        velocity: Array,
        trunk: Trunk,
    ) -> Turn:
        """Run a tick of a single support.

        Args:
            phases: Phases; their landing and time of touch-down are changed.
            swing: Swing; its motion is changed.
            planned: Landing of the swing as planned at lift-off.
            dcm: Measured DCM, shape (2,) or (3,), m.
            reference: DCM of the pattern, shape (2,), m.
            velocity: Velocity of the swing foot, shape (6,), m/s and rad/s.
            trunk: Trunk.
        """
        s, stance = self.settings, phases.plan.stance(phases.step)
        room = self._room(stance, dcm, reference, trunk, velocity)
        if self._state in (_State.NONE, _State.BOTH):
            self._state = _State.NONE
            if not (room.now < s.trigger_room and room.error > s.trigger_error and phases.remaining > 0.1):
                return Turn(False)
            self._throw(phases, swing, stance, planned, room.outward)
            return Turn(True, True)
        assert self._landing is not None
        elapsed, landing = phases.elapsed, self._landing
        least = min(room.now, room.at_rest)
        overdue = elapsed > s.longest_catch
        calm = np.asarray(dcm)[:2] + max(room.now - room.at_rest, 0.0) * room.outward
        if self._state is _State.OUT:
            if overdue or (least > s.caught_room and elapsed >= self._there - 0.05):
                self._state, self._there = _State.BACK, elapsed + s.return_time
                self._wait(swing, elapsed, landing)
            else:
                if phases.remaining >= PUT_OFF - 0.2:
                    return Turn(True)
                phases.retime(PUT_OFF)
                return Turn(True, True)
        elif self._state is _State.BACK:
            if overdue or (least > s.landing_room and trunk.angle < s.upright and elapsed >= self._there):
                self._state, self.sink = _State.DOWN, 0.0
                swing.retarget(elapsed, landing, elapsed + s.lowering_time)
            elif float(np.hypot(*(calm - reference))) <= STRAYED and phases.remaining >= 0.3:
                return Turn(True)
        else:
            return Turn(True)
        way = self._way(stance, landing, least, room.outward)
        least_time = s.lowering_time if self._state is _State.DOWN else 0.4
        phases.retime(self._on_grid(max(way - phases.plan.gait.double_support + 0.05, least_time)))
        return Turn(True, True, calm)

    def on_both_feet(self, phases: WalkPhases, dcm: Array, reference: Array, trunk: Trunk) -> Turn:
        """Run a tick of a double support, or of a stand.

        Args:
            phases: Phases; the duration of the double support is changed.
            dcm: Measured DCM, shape (2,) or (3,), m.
            reference: DCM of the pattern, shape (2,), m.
            trunk: Trunk.
        """
        if phases.phase is not Phase.DOUBLE or phases.step >= len(phases.plan):
            self._state = _State.NONE
            return Turn(False)
        begins = self._state is not _State.BOTH
        self._state, self.sink = _State.BOTH, 0.0
        strayed = float(np.hypot(*(np.asarray(dcm)[:2] - reference))) > STRAYED + MARGIN
        if not (begins or strayed) or phases.elapsed > self.settings.longest_catch:
            return Turn(True)
        # The foot that stood alone leaves next; steps that were taken may be forgotten (`WalkPhases.steer`).
        stance, landed = phases.plan.lift_off(phases.step), phases.plan.stance(phases.step)
        room = self._room(stance, dcm, reference, trunk, None)
        way = max(self._way(stance, landed, room.now, room.outward), 0.1)
        end = phases.elapsed + way
        phases.duration = self._on_grid(max(phases.duration, end) if begins else end)
        return Turn(True, True, np.asarray(dcm)[:2])

    def _throw(
        self,
        phases: WalkPhases,
        swing: SwingFoot,
        stance: Footstep,
        step: Footstep,
        outward: Array,
    ) -> None:
        """Throw the foot out, away from the edge that the push goes over."""
        s = self.settings
        beside = math.hypot(step.x - stance.x, step.y - stance.y)
        wide = min(s.landing_way * self._height, max(0.0, self._widest - beside))
        self._landing = self._shifted(step, -wide * outward)
        way = s.leg_way * self._height
        lean = math.copysign(s.leg_roll * way, 1.0 if step.side == "left" else -1.0)
        out = self._shifted(step, -way * outward)
        self._state, self._there = _State.OUT, phases.elapsed + s.leg_time
        self.sink = -s.wait_height
        phases.land(self._landing, carry=True)
        phases.retime(PUT_OFF)
        self._wait(swing, phases.elapsed, replace(out, roll=out.roll + lean))

    def _wait(self, swing: SwingFoot, now: float, place: Footstep) -> None:
        """Let the foot go to a place and wait there in the air."""
        above = replace(place, z=place.z + self.settings.wait_height)
        swing.retarget(now, above, self._there)
        swing.throw(now, above, self._there)

    def _room(
        self, stance: Footstep, dcm: Array, reference: Array, trunk: Trunk, velocity: Array | None
    ) -> _Room:
        """Room of the DCM; without a velocity no foot swings."""
        sign = 1.0 if stance.side == "left" else -1.0
        outward = sign * np.array((-math.sin(stance.yaw), math.cos(stance.yaw)))
        half = 0.5 * self._sizes[SIDES.index(stance.side)][1]
        point = np.asarray(dcm)[:2]
        now = half - float(outward @ (point - (stance.x, stance.y)))
        spin = float(outward @ trunk.sway)
        if velocity is not None:
            spin -= self._share / self._omega * float(outward @ velocity[:2])
        return _Room(outward, now, now - spin, float(outward @ (point - reference)))

    def _way(self, stance: Footstep, landed: Footstep, room: float, outward: Array) -> float:
        """Time in which the DCM comes over to the foot that lands, with the ZMP at the outer edge of the other, s."""
        half = 0.5 * self._sizes[SIDES.index(stance.side)][1]
        goal = half - float(outward @ np.array((landed.x - stance.x, landed.y - stance.y))) - AHEAD
        time = math.log(max(goal / max(room - MARGIN, 0.005), 1.0)) / self._omega
        return min(time, 1.2)

    def _on_grid(self, time: float) -> float:
        return round(time / self._period) * self._period

    @staticmethod
    def _shifted(step: Footstep, shift: Array) -> Footstep:
        return replace(step, x=step.x + float(shift[0]), y=step.y + float(shift[1]))
