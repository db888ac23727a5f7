"""Steering: the velocity or the goal that a robot is asked for, for planned and free steps.

Towards a far goal the robot walks face first; near it, it walks as it stands, in all directions. The velocity of free
steps is made of it in `wbc.walking.stepping.path`, planned footsteps in `wbc.walking.lipm.steered_steps`.
"""

from __future__ import annotations

import math

from wbc.base.errors import InputError
from wbc.base.vectors import Point, along
from wbc.walking.plans.check import Extent, over
from wbc.walking.plans.footsteps import Place
from wbc.walking.plans.sources import Velocity, VelocityLimits


class Steering:
    """Orders that a robot is steered by.

    Attributes:
        target: Commanded velocity: forward (m/s), left (m/s), turn (rad/s); None for a stand, or with a goal.
        goal: Place (m) and heading (rad) to walk to; None without one, and once the robot is there.
        limits: Largest velocities that the walk accepts without limiting them.
        near: Distance up to which a goal is walked to without being faced, m.
        extent: Extent of the ground, m; None is endless.
    """

    def __init__(self, limits: VelocityLimits, near: float, extent: Extent | None = None) -> None:
        self.limits, self.near, self.extent = limits, near, extent
        self.target: Velocity | None = None
        self.goal: Place | None = None

    @property
    def pending(self) -> bool:
        """True while a velocity or a goal asks for steps."""
        return self.target is not None or self.goal is not None

    def command(self, velocity: Velocity | None) -> None:
        """Take a `checked_velocity`, forward (m/s), left (m/s), turn (rad/s); None, or zero, for a stand."""
        self.target, self.goal = velocity if any(velocity or ()) else None, None

    def go_to(self, x: float, y: float, yaw: float) -> None:
        """Take a goal, place (m) and heading (rad); an `InputError` for one beside the ground."""
        if self.extent is not None:
            low_x, high_x, low_y, high_y = self.extent
            if not (low_x <= x <= high_x and low_y <= y <= high_y):
                raise InputError(f"the ground {over(self.extent)}, got the goal ({x:g}, {y:g})")
        self.target, self.goal = None, (x, y, yaw)

    def limited(self, velocity: Velocity) -> Velocity:
        """Return a velocity with each part cut to what can be walked."""
        (x, y, turn), (forward, back, aside, most_turn) = velocity, self.limits
        return (
            min(max(x, -back), forward),
            min(max(y, -aside), aside),
            min(max(turn, -most_turn), most_turn),
        )

    def away(self, place: Point, heading: float) -> tuple[float, float]:
        """Return distance (m) and turn (rad) from a place and heading to the goal."""
        assert self.goal is not None
        x, y, yaw = self.goal
        return math.hypot(x - place[0], y - place[1]), math.remainder(yaw - heading, math.tau)

    def approach(
        self, place: Point, heading: float, time: float, cruise: float, towards: float | None
    ) -> Velocity:
        """Return the velocity to the goal from a place and heading, which takes a `time`, s, at most `cruise`, m/s.

        `towards` is the direction in which a far goal is walked to, rad, straight to it when None.
        """
        assert self.goal is not None
        (x, y, _), (distance, turn) = self.goal, self.away(place, heading)
        dx, dy = x - place[0], y - place[1]
        if distance > self.near:
            off = math.remainder((math.atan2(dy, dx) if towards is None else towards) - heading, math.tau)
            return min(cruise, distance / time) * max(0.0, math.cos(off)) ** 4, 0.0, off / time
        ahead, aside = along((math.cos(heading), math.sin(heading)), dx, dy)
        return min(max(ahead / time, -cruise), cruise), aside / time, turn / time
