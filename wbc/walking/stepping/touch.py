"""Contact of the foot in the air: whether it has met the ground, is to carry, or is pushed."""

from __future__ import annotations

import math

from wbc.base.numbers import lag_gain
from wbc.base.vectors import Vector, part_way
from wbc.walking.ground import GroundEstimate
from wbc.walking.plans.footsteps import Footstep, moved
from wbc.walking.plans.swing import SwingFoot
from wbc.walking.stepping.felt import ORIGIN, GaitState
from wbc.walking.stepping.law import Orbit, StanceAxes, takes_over, viability
from wbc.walking.stepping.settings import GaitValues

MOST_URGENCY, LEAST_TIME = 0.5, 0.8
"""Urgency of the swing foot up to which its speed is a sign of a push, and time of the step over T from which on."""


class SwingTouch:
    """Contact of the swing foot of one walk."""

    def __init__(self, values: GaitValues, felt: GaitState, ground: GroundEstimate) -> None:
        """Begin a step."""
        self._felt, self._ground = felt, ground
        self._settings, self._law, _, self._dt = values
        self._gain = lag_gain(self._dt, self._law.area.cop_lag)
        self._carrying: Vector = ORIGIN  # low-passed centre of pressure of the swing foot in contact, m
        self.begin()

    def begin(self) -> None:
        """Begin a step: its foot has not been pushed."""
        self._pushed_at = -math.inf  # time since lift-off when the swing foot was pushed last, s
        # Time for which the foot that stands has carried nothing and the other one does, s.
        self._unloaded = 0.0

    def push(self) -> None:
        """Take note of a push on the swing foot in this tick."""
        self._pushed_at = self._felt.elapsed

    @property
    def pushed(self) -> bool:
        """True for a swing foot that was pushed a moment ago: a force on it is that of the push, or of its inertia."""
        return self._felt.elapsed - self._pushed_at < self._law.touch.pushed_time

    def notice_push(self, urgency: float, paced: float, speed: float) -> None:
        """Find whether the swing foot is pushed.

        It is faster then, in the world and past the CoM, than any step without hurry: the ground stops a foot, and only
        a push makes it faster. It is pushed once in a step: a foot that comes back is as fast, and meets the ground.

        Args:
            urgency: Share by which the swing foot goes before the trunk.
            paced: Time of this step over T.
            speed: Speed of the steps, m/s.
        """
        hurries = urgency >= MOST_URGENCY or paced <= LEAST_TIME
        if hurries or not (self.pushed or self._pushed_at == -math.inf):
            return
        state = self._felt.state
        moved = state.speeds[self._felt.swing]
        least = self._law.touch.pushed_speed + 2.0 * speed
        if min(math.hypot(*moved), math.dist(moved, state.velocity)) > least:
            self.push()

    def thrown(self, swing: SwingFoot) -> Vector | None:
        """Return the velocity of a swing foot so far off its motion that legs cannot bring it back, m/s, else None.

        That is where the feedback of its task asks for more than the greatest acceleration of a swing: the trunk would
        pay for it. The motion is that of the last tick.
        """
        felt, (stiffness, damping) = self._felt, self._law.swing.swing_gains
        time = felt.elapsed - self._dt
        here, moved = felt.state.places[felt.swing], felt.state.speeds[felt.swing]
        asked = (
            stiffness * (q - p) + damping * (speed - now)
            for p, now, q, speed in zip(here, moved, *swing.motion(time), strict=True)
        )
        return moved if math.hypot(*asked) > self._law.swing.swing_push else None

    def bears(self, duration: float) -> bool:
        """Return True if the swing foot bears the load of a contact in this tick, in a step of a time, s."""
        law, felt = self._law.touch, self._felt
        may = felt.elapsed > law.early * duration and not self.pushed
        if not may or felt.state.wrenches[felt.swing][2] <= law.met:
            return False
        places = felt.state.places  # no higher than the way over the ground asks for
        ground = max(places[felt.stance][2], self._ground.height)
        return places[felt.swing][2] < ground + law.low * self._settings.swing_height

    def loses(self, since: float) -> bool:
        """Return True if a foot that has been in contact for a time, s, has lost the ground again."""
        law, felt, loads = self._law.touch, self._felt, self._felt.state.wrenches
        lost = loads[felt.swing][2] < law.lost and since > law.lost_time and loads[felt.stance][2] > law.held
        return lost or self.pushed

    def rubs(self, axes: StanceAxes, orbit: Orbit, left: float, landing: Footstep) -> bool:
        """Return True if the swing foot is to go on over what it has met: waiting would not help there.

        That is where ξ runs away from the foot that stands, aside or ahead, and is caught from the landing at its time,
        and not from here. The time that is `left` until then is in s.
        """
        law, felt, dcm = self._law, self._felt, self._felt.dcm
        (x, y, _), (p, q, _) = felt.carrying_point(felt.swing), felt.contact
        ahead, beyond = axes.outwards(dcm.x - x, dcm.y - y)
        on, out = axes.outwards(dcm.x - p, dcm.y - q)
        ahead_of_orbit = ahead * on > 0.0 and abs(ahead) > abs(orbit.ahead) + 0.5 * law.time.stretch
        if left <= 0.0 or not (ahead_of_orbit or out < 0.0):
            return False
        grown = math.exp(dcm.omega * left)
        u, v, _ = moved((landing.x, landing.y, landing.yaw), law.area.carrying, 0.0, 0.0)
        there = axes.outwards(p + grown * (dcm.x - p) - u, q + grown * (dcm.y - q) - v)
        now = viability(ahead, -beyond, orbit, law.time.stretch)
        return law.touch.rubs * now < viability(there[0], -there[1], orbit, law.time.stretch)

    def track(self, *, met: bool, at_edge: bool) -> None:
        """Take in a tick: where the foot in contact carries, and for how long the other one has carried nothing.

        A foot that has `met` the ground `at_edge` carries where its centre of pressure is, low-passed; else at its
        carrying point.
        """
        felt, least = self._felt, self._law.touch.held
        if met:
            loads = felt.state.wrenches
            unloaded = loads[felt.stance][2] < least < loads[felt.swing][2]
            self._unloaded = self._unloaded + self._dt if unloaded else 0.0
        if met and at_edge:
            self._carrying = part_way(self._carrying, felt.centre_of_pressure(felt.swing), self._gain)
        else:
            self._carrying = felt.carrying_point(felt.swing)

    def is_to_carry(
        self, axes: StanceAxes, orbit: Orbit, patience: float, fast_share: float, *, late: bool
    ) -> bool:
        """Return True if the foot in contact is to carry: waiting does not help, or has lasted too long.

        The offset of ξ may be `patience` times that of the orbit. A step is `late` that has lasted its longest time.
        """
        felt, law, dcm = self._felt, self._law, self._felt.dcm
        # The other foot has rolled over an edge, or was kicked away; the impact of a fast foot lasts less long.
        if late or self._unloaded > fast_share * law.touch.lost_time:
            return True
        (x, y, _), (p, q, _) = self._carrying, felt.contact
        ahead, beyond = axes.outwards(dcm.x - x, dcm.y - y)
        there, here = (ahead, -beyond), axes.outwards(dcm.x - p, dcm.y - q)
        return takes_over(there, here, orbit, law.time.stretch, law.touch.wait, patience)

    def most_forces(self, *, met: bool, stepped: bool) -> tuple[float, float]:
        """Return the greatest normal force of each foot, N: the old stance foot unloads, one that waits has `share`.

        A robot that has `stepped` before has an old one.
        """
        law, swing, elapsed = self._law.touch, self._felt.swing, self._felt.elapsed
        most = [law.most_force, law.most_force]
        most[swing] = 0.0
        if met:
            most[swing] = law.share
        elif elapsed < law.unload and stepped and self._felt.state.wrenches[swing][2] > law.lost:
            most[swing] = 2.0 * law.share * (1.0 - elapsed / law.unload)
        return most[0], most[1]
