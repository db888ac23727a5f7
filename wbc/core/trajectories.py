"""Trajectories: the references of targets that move, and the polynomials and followers that they are made of.

Swing feet, hands, the height of the pendulum and `move_to` of every task use these and no others.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import Annotated, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field
from scipy.interpolate import make_interp_spline

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array, one_or_each, read_only
from wbc.base.settings import Positive

ValueT = TypeVar("ValueT", float, Array, complex)

SAMPLES = 100
"""Samples of a piece, with which the greatest speed and acceleration of a path are found: to 0.1 % of them."""

KEPT = 1.0 + 1e-6
"""Ratio to a limit up to which it is kept."""

DURATIONS, TRIALS, REFINEMENTS = (1e-3, 1e3), 100, 5
"""Times among which that of a path which begins in motion is looked for, s, their number, and passes of that search: to
1e-5 of the time."""

LONGEST = 86_400.0
"""Longest time of a trajectory, s: a day."""

Duration = Annotated[Positive, Field(le=LONGEST), "s"]
"""Time of a trajectory, s."""

LAST_RATE = 8.0
"""Greatest speed over the distance that is left, 1/s: a lag of 0.125 s at the end, where the root alone has a kink."""

APART = 0.05
"""Least time between the beginnings of two changes of a `Ramp`, over the duration of the second."""

RUN_UP = 0.2
"""Time in which the greatest speed is reached where only a speed is given, s: bounds the acceleration of short ways."""


def minimum_jerk(s: ValueT) -> tuple[ValueT, ValueT]:
    """Return the share of the way from rest to rest at a share of the time, from 0 to 1, and its slope.

    That of Flash & Hogan, 1985, as in `Quintic`; shares are numbers or arrays.
    """
    return 10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5, 30.0 * s**2 * (1.0 - s) ** 2


class Quintic(Generic[ValueT]):
    """Polynomial of fifth order with given position, velocity and acceleration at both ends.

    Of all motions between these states in that time it has the least mean squared jerk.

    Attributes:
        duration: Time between the ends, s.

    Source: Flash & Hogan, "The coordination of arm movements", Journal of Neuroscience 5(7), 1985, appendix A.
    """

    def __init__(
        self, start: tuple[ValueT, ValueT, ValueT], end: tuple[ValueT, ValueT, ValueT], duration: float
    ) -> None:
        """Fit to position, velocity and acceleration at both ends, of one shape, and the time between them, s."""
        self.duration = duration
        p0, v0, a0 = start
        p1, v1, a1 = end
        t = duration
        d = p1 - p0 - v0 * t - 0.5 * a0 * t * t
        v = (v1 - v0 - a0 * t) * t
        a = (a1 - a0) * t * t
        self._c: tuple[ValueT, ...] = (
            p0,
            v0,
            0.5 * a0,
            (10.0 * d - 4.0 * v + 0.5 * a) / t**3,
            (-15.0 * d + 7.0 * v - a) / t**4,
            (6.0 * d - 3.0 * v + 0.5 * a) / t**5,
        )

    def at(self, time: float) -> tuple[ValueT, ValueT, ValueT]:
        """Return position, velocity and acceleration at a time between the ends."""
        c0, c1, c2, c3, c4, c5 = self._c
        t = time
        return (
            c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))),
            c1 + t * (2 * c2 + t * (3 * c3 + t * (4 * c4 + t * 5 * c5))),
            2 * c2 + t * (6 * c3 + t * (12 * c4 + t * 20 * c5)),
        )


Motion = tuple[float, float, float]
"""Value of a coordinate, and its first and second derivative."""


class QuinticPath:
    """One coordinate that goes through given motions at given times along quintics, and rests at the last.

    It may be planned anew in every tick: a quintic is fitted when it is asked for, and a state kept until the next.
    """

    def __init__(self, start: Motion) -> None:
        """Stay in a motion, which is the state at any time before the first piece."""
        self._first = start
        self._pieces: list[tuple[float, Motion, Motion, float]] = []  # start, its state, goal, duration
        self._fitted: tuple[object, Quintic[float]] = (None, Quintic((0.0,) * 3, (0.0,) * 3, 1.0))
        self._time, self._state = 0.0, start  # asked for last

    def at(self, time: float) -> Motion:
        """Return value, velocity and acceleration at a time, s; after the last piece those of its goal."""
        if time == self._time:
            return self._state
        self._time, self._state = time, self._first
        for piece in reversed(self._pieces):
            start, state, goal, duration = piece
            if time >= start:
                if self._fitted[0] is not piece:
                    self._fitted = piece, Quintic(state, goal, duration)
                self._state = self._fitted[1].at(min(time - start, duration))
                break
        return self._state

    def follow(self, start: float, *goals: tuple[float, Motion]) -> None:
        """Go to each (time, motion) in turn from `start` on, s; the motion before stays."""
        state = self.at(start)
        pieces = self._pieces
        while pieces and pieces[-1][0] >= start:
            pieces.pop()
        for time, goal in goals:
            pieces.append((start, state, goal, time - start))
            start, state = time, goal


class Ramp(Generic[ValueT]):
    """A value, a number or an array, that goes to its goal by `minimum_jerk`.

    A goal that comes on the way adds its change to those that are still going on. So a goal that changes in every tick
    is followed, and the value is always a weighted mean of its goals.

    Attributes:
        value: Present value.
        goal: Value in the end.
    """

    def __init__(self, value: ValueT) -> None:
        """Rest at a value."""
        self.value: ValueT = value
        self.goal: ValueT = value
        self._base: ValueT = value
        # Elapsed time and duration, s, and the goals before and after each change.
        self._changes: list[tuple[float, float, ValueT, ValueT]] = []

    def to(self, goal: ValueT, duration: float) -> None:
        """Let the goal be another one; the change takes a time, s, and begins with the next period."""
        waits = self._changes and self._changes[-1][0] == 0.0
        before = self._changes.pop()[2] if waits else self.goal
        self._changes.append((0.0, duration, before, goal))
        self.goal = goal

    def advance(self, dt: float) -> None:
        """Advance by a period, s; in the first part of a change the next one waits, so that there are never many."""
        changes, last = self._changes, math.inf
        for i, (elapsed, duration, before, goal) in enumerate(changes):
            if elapsed > 0.0 or last >= APART * duration:
                changes[i] = elapsed + dt, duration, before, goal
            last = elapsed
        while changes and changes[0][0] >= changes[0][1]:
            self._base = changes.pop(0)[3]
        self.value = self.after(0.0)

    def after(self, time: float) -> ValueT:
        """Return the value that it will have after a time, s."""
        value = self._base
        for elapsed, duration, before, goal in self._changes:
            share, _ = minimum_jerk(min((elapsed + time) / duration, 1.0))
            value = value + share * (goal - before)
        return value


class Follower(Generic[ValueT]):
    """Value that follows its goal like a critically damped mass: two low-passes in a row.

    Attributes:
        value: Present value.
        velocity: Its derivative.
        acceleration: The derivative of that.
    """

    def __init__(self, time_constant: float, value: ValueT) -> None:
        """Rest at a value; the time constant, s, is that of each low-pass."""
        self._rate = 1.0 / time_constant
        self.value: ValueT = value
        self.velocity: ValueT = 0.0 * value
        self.acceleration: ValueT = self.velocity

    def follow(self, error: ValueT, dt: float) -> None:
        """Advance by a period, s, towards a goal: `error` is goal minus value."""
        self.acceleration = self._rate * self._rate * error - 2.0 * self._rate * self.velocity
        self.velocity = self.velocity + dt * self.acceleration
        self.value = self.value + dt * self.velocity


class Trajectory:
    """Minimum jerk through waypoints to rest at the last: a quintic spline whose first four derivatives are continuous.

        trajectory = Trajectory([[0, 0, 1.0], [0.2, 0, 1.1], [0.4, 0, 1.0]], speed=0.3)
        position, velocity, acceleration = trajectory.at(0.5)

    Between two points alone, x(s) = x₀ + (x₁ − x₀) (10 s³ − 15 s⁴ + 6 s⁵), s = t / T: the greatest speed is
    15/8 · |x₁ − x₀| / T, the greatest acceleration 10/√3 · |x₁ − x₀| / T². Waypoints in between are passed at times in
    proportion to the distance, without a stop.

    Attributes:
        duration: Duration, s.
        end: Last point, shape (n,), read-only.

    Source: Flash & Hogan, Journal of Neuroscience 5(7), 1985: of all motions through the points at these times it has
    the least mean squared jerk, which makes it a spline of degree 5 (de Boor, "A Practical Guide to Splines", ch. 13).
    """

    @checked
    def __init__(
        self,
        points: Sequence[ArrayLike] | Array,
        duration: Duration | None = None,
        *,
        speed: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        parts: Sequence[slice] | None = None,
        velocity: ArrayLike | None = None,
        acceleration_at_start: ArrayLike | None = None,
    ) -> None:
        """Fit.

        Args:
            points: Start, waypoints and end, each of shape (n,); two points that follow each other differ, unless all
                are the same.
            duration: Time from the first point to the last, s; the least within the limits when None.
            speed: Greatest speed, above zero; one for each part, or one for all. None for no limit, with a duration.
            acceleration: Greatest acceleration, above zero; that which reaches the greatest speed in 0.2 s when None
                and no duration is given.
            parts: Coordinates that are one vector, such as position and rotation of a pose; all of them when None.
            velocity: Velocity at the start, shape (n,); at rest when None.
            acceleration_at_start: Shape (n,); none when None, or where the limits can only be kept without.
        """
        waypoints = [finite_array("points of a trajectory", point) for point in points]
        if len(waypoints) < 2 or waypoints[0].ndim != 1 or len({p.shape for p in waypoints}) > 1:
            raise InputError(
                f"a trajectory needs two or more points of one shape (n,), got shapes {[p.shape for p in waypoints]}"
            )
        steps = np.diff(np.array(waypoints), axis=0)
        parts = (slice(0, waypoints[0].size),) if parts is None else parts
        speeds, accelerations = (
            None
            if limit is None
            else one_or_each(f"greatest {what} of a trajectory", limit, len(parts), above=0.0)
            for what, limit in (("speed", speed), ("acceleration", acceleration))
        )
        if duration is None and speeds is None:
            raise InputError("a trajectory needs a duration or a speed, got neither")
        if duration is None and speeds is not None and accelerations is None:
            accelerations = speeds / RUN_UP
        self.end = read_only(waypoints[-1])
        begin = [
            np.zeros(waypoints[0].size)
            if rate is None
            else finite_array(f"{what} at the start", rate, waypoints[0].shape)
            for what, rate in (("velocity", velocity), ("acceleration", acceleration_at_start))
        ]
        # Of each step, in seconds at full speed where there is one: of the part that takes longest.
        each = np.array([np.linalg.norm(steps[:, part], axis=1) for part in parts])
        lengths: Array = (each if speeds is None else each / speeds[:, None]).max(axis=0)
        lengths = np.where(lengths > 1e-12, lengths, 0.0)
        self.duration = duration or 0.0
        self._starts: list[float] = []
        self._pieces = np.zeros((0, 6, self.end.size))  # coefficients of each piece, over its own time
        if not lengths.any() and not begin[0].any():
            return
        if not lengths.all():
            if len(waypoints) > 2:
                i = int(lengths.argmin())
                raise InputError(
                    f"points of a trajectory that follow each other must differ, {i} and {i + 1} are {waypoints[i]}"
                )
            lengths = np.ones(1)
        path = _Path(np.array(waypoints), begin, lengths, parts, speeds, accelerations)
        found, excess = path.find(duration)
        if excess > KEPT and begin[1].any():
            begin[1] = np.zeros_like(begin[1])
            without = _Path(np.array(waypoints), begin, lengths, parts, speeds, accelerations)
            if (again := without.find(duration))[1] < excess:
                path, (found, excess) = without, again
        if duration is not None and excess > KEPT:
            least, _ = path.find(None)
            rule = "at least" if duration < least else "nearer to"
            raise InputError(
                f"duration of a trajectory must be {rule} {least:.4g} s to keep its greatest speed and acceleration, "
                f"got {duration:g} s"
            )
        self.duration = found
        self._starts, self._pieces = path.pieces(found)

    def at(self, time: float) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration, shape (n,), at a time since the start, s; at rest outside."""
        if not self._starts or time >= self.duration:
            return self.end.copy(), np.zeros(self.end.size), np.zeros(self.end.size)
        piece = bisect_right(self._starts, max(time, 0.0)) - 1
        t = max(time, 0.0) - self._starts[piece]
        t2, t3, t4 = t * t, t**3, t**4
        powers = (1.0, t, t2, t3, t4, t4 * t), (0.0, 1.0, 2.0 * t, 3.0 * t2, 4.0 * t3, 5.0 * t4)
        rates = np.array((*powers, (0.0, 0.0, 2.0, 6.0 * t, 12.0 * t2, 20.0 * t3)))
        position, velocity, acceleration = rates.dot(self._pieces[piece])
        return position, velocity, acceleration


class _Path:
    """Minimum jerk through waypoints, as a function of the time T that it takes.

    Over the share of the time, the path is linear in its points, in T v₀ and in T² a₀, with velocity and acceleration
    at the start: a spline of the three side by side gives it for every T.
    """

    def __init__(
        self,
        points: Array,
        begin: Sequence[Array],
        lengths: Array,
        parts: Sequence[slice],
        speeds: Array | None,
        accelerations: Array | None,
    ) -> None:
        self._shares = shares = np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()
        self._rests = not (begin[0].any() or begin[1].any())
        terms, n = 1 if self._rests else 3, points.shape[1]  # by powers of T
        ends, first, second = np.zeros((len(points), terms, n)), *np.zeros((2, terms, n))
        ends[:, 0] = points
        if not self._rests:
            first[1], second[2] = begin
        still = np.zeros(terms * n)
        spline = make_interp_spline(
            shares,
            ends.reshape(len(points), -1),
            k=5,
            bc_type=([(1, first.ravel()), (2, second.ravel())], [(1, still), (2, still)]),
        )

        def rates(at: Array, order: int) -> Array:
            return np.asarray(spline(at, order)).reshape(at.size, terms, n)

        #: Of each piece the coefficients over the share of the time, shape (pieces, 6, terms, n).
        self._pieces = np.stack([rates(shares[:-1], k) / math.factorial(k) for k in range(6)], axis=1)
        inner = np.linspace(0.0, 1.0, SAMPLES + 1)
        samples = (shares[:-1, None] + np.diff(shares)[:, None] * inner).ravel()
        # Order of a derivative, and its square over that of the limit, by powers of T: shape (powers, parts · samples).
        self._limits: list[tuple[int, Array]] = []
        for order, limits in ((1, speeds), (2, accelerations)):
            if limits is not None:
                sampled, squares = rates(samples, order), np.zeros((2 * terms - 1, samples.size, n))
                for i, j in np.ndindex(terms, terms):
                    squares[i + j] += sampled[:, i] * sampled[:, j]
                over = []
                for part, limit in zip(parts, limits, strict=True):
                    at_start = begin[order - 1][part]  # what is exceeded there may be
                    over.append(squares[..., part].sum(axis=2) / max(limit**2, at_start.dot(at_start)))
                self._limits.append((order, np.concatenate(over, axis=1)))

    def find(self, duration: float | None) -> tuple[float, float]:
        """Return a duration, s, the least that keeps the limits when None, and its excess; see `_excess`."""
        found = self._least_duration() if duration is None else duration
        return found, float(self._excess(np.array([found]))[0])

    def _excess(self, durations: Array) -> Array:
        """Return the time that each duration, shape (m,), s, lacks to keep all limits, as a ratio: 1 where none."""
        excess = np.zeros(durations.size)
        for order, squares in self._limits:
            powers = durations[:, None] ** (np.arange(len(squares)) - 2.0 * order)
            most = np.maximum(powers.dot(squares).max(axis=1), 0.0)
            np.maximum(excess, most ** (0.5 / order), out=excess)
        return excess

    def _least_duration(self) -> float:
        """Return the least time, s, in which the path keeps its limits; 0 without any.

        A path that begins in motion may keep them in some times alone, or in none: then it is the time in which it
        exceeds them least.
        """
        if self._rests or not self._limits:  # rates are in proportion to 1/T and 1/T²
            return float(self._excess(np.ones(1))[0])
        durations, least = np.geomspace(*DURATIONS, TRIALS), 0.0
        for _ in range(REFINEMENTS):
            excess = self._excess(durations)
            kept = np.flatnonzero(excess <= KEPT)
            best = int(kept[0]) if kept.size else int(excess.argmin())
            ends = durations[max(best - 1, 0)], durations[min(best + 1, durations.size - 1)]
            least, durations = float(durations[best]), np.linspace(*ends, 20)
        return least

    def pieces(self, duration: float) -> tuple[list[float], Array]:
        """Return the times at which the pieces begin, s, and their coefficients over time, shape (pieces, 6, n)."""
        terms = self._pieces.shape[2]
        coefficients = np.einsum("pktn,t->pkn", self._pieces, duration ** np.arange(float(terms)))
        coefficients /= duration ** np.arange(6.0)[:, None]
        return (duration * self._shares[:-1]).tolist(), coefficients


def approach(displacement: Array, velocity: Array, speed: float, acceleration: float, dt: float) -> Array:
    """Return the next velocity of a point on its way to rest at a goal that may move.

    `displacement` (from the point to the goal, m or rad) and velocities, per second, have shape (n,). Half of the
    greatest `acceleration` brakes before the goal; the velocity changes by `acceleration` · dt at most.
    """
    distance = math.sqrt(float(displacement @ displacement))
    wanted = np.zeros_like(displacement)
    if distance > 0.0:
        fastest = min(speed, math.sqrt(acceleration * distance), LAST_RATE * distance)
        wanted = displacement * (fastest / distance)
    change = wanted - velocity
    size = math.sqrt(float(change @ change))
    if size > acceleration * dt:
        change *= acceleration * dt / size
    return np.asarray(velocity + change)
