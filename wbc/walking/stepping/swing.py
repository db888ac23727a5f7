"""Reference of the swing foot, which is replanned at every tick because its landing moves at every tick."""

from __future__ import annotations

import math

from wbc.tasks.trajectories import jerk_to_rest
from wbc.walking.stepping.law import Point
from wbc.walking.stepping.settings import SteppingSettings

MOST_ACCELERATION = 40.0
"""Greatest acceleration of a foot that follows its landing, m/s²: four times gravity."""


class SwingReference:
    """Place, velocity and acceleration of the swing foot over the ground, and its height.

    Along the ground: a quintic from the reference as it is to rest at the landing; near the end a critically damped
    follower. In height: up to the apex, down to the expected ground, and from there on down at the search speed, even
    if the time of the step still changes.

    Attributes:
        place: Reference over the ground, m.
        velocity: m/s.
        acceleration: m/s².
        height: Height, its velocity and its acceleration, m, m/s and m/s².
    """

    def __init__(self, settings: SteppingSettings, dt: float) -> None:
        """Start at the origin; `lift` begins a swing."""
        self._s, self._dt = settings, dt
        self.lift((0.0, 0.0, 0.0))

    def lift(self, start: tuple[float, float, float]) -> None:
        """Begin a swing from a place at rest, m."""
        self.hold(start)
        self._from = start[2]
        self._sinks_since: float | None = None  # time since lift-off, s
        self.height = (start[2], 0.0, 0.0)

    def hold(self, place: tuple[float, float, float]) -> None:
        """Rest over the ground at a place, m."""
        self.place, self.velocity, self.acceleration = (place[0], place[1]), (0.0, 0.0), (0.0, 0.0)

    def travel(self, elapsed: float, time: float, landing: Point) -> None:
        """Move on by one period towards a landing, m; times since lift-off and of the step are in s."""
        dt, left = self._dt, self._s.settle * time - elapsed
        if left > 1.25 * self._s.follow:
            coordinates = [
                jerk_to_rest(x, v, a, to, left, dt)
                for x, v, a, to in zip(self.place, self.velocity, self.acceleration, landing, strict=True)
            ]
            (x, vx, ax), (y, vy, ay) = coordinates
            self.place, self.velocity, self.acceleration = (x, y), (vx, vy), (ax, ay)
        else:
            self._follow(landing)

    def _follow(self, landing: Point) -> None:
        """Move on by one period as a critically damped follower with a bounded acceleration."""
        dt, lag, (x, y), (u, v) = self._dt, self._s.follow, self.place, self.velocity
        a, b = ((landing[0] - x) / lag - 2.0 * u) / lag, ((landing[1] - y) / lag - 2.0 * v) / lag
        share = MOST_ACCELERATION / max(math.hypot(a, b), MOST_ACCELERATION)
        a, b = share * a, share * b
        u, v = u + a * dt, v + b * dt
        self.place, self.velocity, self.acceleration = (x + u * dt, y + v * dt), (u, v), (a, b)

    def rise(self, elapsed: float, time: float, ground: float, speed: float) -> None:
        """Set the height from that of the expected ground, m, and the speed with which the foot is to meet it, m/s.

        Times since lift-off and of the step are in s.
        """
        s = self._s
        high, apex, touch = max(self._from, ground) + s.swing_height, s.apex * time, s.touch * time
        if self._sinks_since is None and elapsed >= touch:
            self._sinks_since = elapsed
        if self._sinks_since is not None:
            depth = s.search_speed * (elapsed - self._sinks_since)
            self.height = (ground - min(depth, s.search), -s.search_speed if depth < s.search else 0.0, 0.0)
        elif elapsed < apex:
            self.height = _cubic(self._from, s.lift_speed, high, 0.0, apex, elapsed)
        else:
            self.height = _cubic(high, 0.0, ground, -speed, touch - apex, elapsed - apex)


def _cubic(
    start: float, start_speed: float, end: float, end_speed: float, duration: float, time: float
) -> tuple[float, float, float]:
    """Return position, velocity and acceleration at a time of the cubic between two positions and velocities."""
    s = min(max(time / duration, 0.0), 1.0)
    cubic = 2.0 * (start - end) + duration * (start_speed + end_speed)
    square = 3.0 * (end - start) - duration * (2.0 * start_speed + end_speed)
    return (
        start + (start_speed * duration + (square + cubic * s) * s) * s,
        start_speed + (2.0 * square + 3.0 * cubic * s) * s / duration,
        (2.0 * square + 6.0 * cubic * s) / (duration * duration),
    )
