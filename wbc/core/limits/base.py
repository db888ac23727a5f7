"""Base of limits: rows over the accelerations with bounds that never contradict each other."""

from __future__ import annotations

import weakref
from abc import ABC, abstractmethod
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.base.settings import Count, NonNegative, Positive
from wbc.core.robot import Reads, Robot

OPTIONS = "it follows from the robot and from the options with which the limit was made: make another limit"
"""Advice in place of an assignment to a bound."""

ATTAINABLE = 100.0
"""Acceleration of a coordinate up to which a limit asks for it, rad/s² or m/s²: the most braking of joints."""

BACK = 1.0
"""Speed of a coordinate up to which a limit asks for it from outside, rad/s or m/s; of a step rad or m."""

RECOVERY = 2.0
"""Greatest acceleration back from outside of a bound where none is given, m/s² or rad/s²."""

SHARE = 0.9
"""Share of what the joints attain up to which a limit asks for it: all of it would leave one velocity alone."""


class Limit(ABC):
    """Base of limits on the generalised acceleration: lower ≤ rows · acceleration ≤ upper.

    Attributes:
        name: Name in status tables and messages.
        dim: Number of rows, fixed once the limit is bound.
        reads: State of the robot that the rows need in inverse kinematics; see `Task`.
        step_unit: Unit of the bounds of `write_step`, for messages.
    """

    reads: ClassVar[Reads] = "all"
    step_unit: ClassVar[str] = ""

    name: str
    dim: int
    _owner: weakref.ref[Any] | None = None

    @abstractmethod
    def bind(self, robot: Robot) -> None:
        """Resolve names against the robot."""

    @abstractmethod
    def write(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill the rows.

        Args:
            dt: Control period, s.
            rows: To fill, shape (dim, nv); the same array at every tick, zero at first.
            lower: To fill, shape (dim,); −inf where there is no bound.
            upper: To fill, shape (dim,); inf where there is no bound.
        """

    def write_step(self, rows: Array, lower: Array, upper: Array) -> None:
        """Fill rows and bounds of a step of the configuration, lower ≤ rows · step ≤ upper, for inverse kinematics.

        The arguments are those of `write`. A step is a velocity times a time, shape (nv,). A limit that does not
        override this method cannot be used in inverse kinematics.
        """
        raise InputError(f"limit '{self.name}' bounds no step of the configuration")

    def violation(self, row: int, size: float) -> str:
        """Return by how much a row of `write_step` is violated, for messages."""
        return f"{size:.3g} {self.step_unit}".rstrip()

    def write_velocity(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill rows and bounds of the velocity for inverse kinematics with a period dt, s; by default, from a step."""
        self.write_step(rows, lower, upper)
        lower /= dt
        upper /= dt


class Barrier(Limit):
    """Base of limits that keep coordinates of the robot between bounds.

    A subclass fills its rows and the rooms, the distances of the coordinates to their bounds, and returns the drift.
    The rest is one law for all of them. A room may shrink at room / time constant at most, so that it never falls
    below zero (the velocity damper of Faverjon & Tournassoud, ICRA 1987). A row demands at most the acceleration room /
    time constant² + recovery away from its bound, which is enough from inside. From outside it brings the coordinate
    back. No row demands more than joints attain. Two bounds of one row never cross, because what is room for one is
    lacking for the other.
    """

    _time: float
    _back: float  # the recovery
    _robot: Robot

    @checked
    def __init__(
        self,
        name: str,
        dim: Count,
        *,
        time_constant: Annotated[Positive, "s"] = 0.1,
        recovery: Annotated[NonNegative, "m/s² or rad/s²"] = RECOVERY,
    ) -> None:
        """Describe the limit: its name, its number of rows, a time constant, s, and a recovery, m/s² or rad/s²."""
        self.name, self.dim, self._time, self._back = name, dim, time_constant, recovery

    def bind(self, robot: Robot) -> None:
        """Take the robot; who overrides it calls `super().bind(robot)`."""
        self._robot = robot

    @property
    def robot(self) -> Robot:
        """Robot of the controller."""
        if not hasattr(self, "_robot"):
            raise InputError(f"limit '{self.name}' has no robot before it is added to a controller")
        return self._robot

    @abstractmethod
    def measure(self, rows: Array, below: Array, above: Array) -> None:
        """Fill rows and rooms at the present configuration.

        Args:
            rows: Velocity of the coordinates per generalised velocity, to fill, shape (dim, nv); see `write`.
            below: Coordinate less its lower bound, to fill, shape (dim,): negative outside, inf where there is none.
            above: Upper bound less the coordinate, to fill in the same way.
        """

    @abstractmethod
    def drift(self) -> Array:
        """Return the accelerations of the coordinates at no generalised acceleration; `measure` was called before."""

    def write(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill rows and bounds of the acceleration; see `Limit.write`."""
        self.measure(rows, lower, upper)
        speed, drift = rows.dot(self._robot.v), self.drift()
        if lower[lower.argmin()] < np.inf:
            np.negative(self._brake(lower, -speed, dt), out=lower)
            lower -= drift
        else:
            lower.fill(-np.inf)
        if upper[upper.argmin()] < np.inf:
            upper[:] = self._brake(upper, speed, dt)
            upper -= drift
        _cut_off(ATTAINABLE, rows, lower, upper)

    def _brake(self, room: Array, speed: Array, dt: float) -> Array:
        """Return the greatest accelerations towards a bound at rooms and at speeds towards it."""
        final = room / self._time
        final -= speed
        final /= dt
        # At the speed room / time constant a coordinate needs the deceleration room / time constant², and a little more
        # because a period passes before the bound reacts.
        least = np.maximum(room, 0.0)
        least *= -(1.0 + 2.0 * dt / self._time) / self._time**2
        least -= self._back
        return np.maximum(final, least, out=final)

    def write_step(self, rows: Array, lower: Array, upper: Array) -> None:
        """Fill rows and bounds of a step; see `Limit.write_step`."""
        self.measure(rows, lower, upper)
        np.negative(lower, out=lower)

    def write_velocity(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill rows and bounds of the velocity; see `Limit.write_velocity`."""
        self.write_step(rows, lower, upper)
        lower /= max(dt, self._time)
        upper /= max(dt, self._time)
        _cut_off(BACK, rows, lower, upper)


def _cut_off(most: float, rows: Array, lower: Array, upper: Array) -> None:
    """Cut demands off where each coordinate would have to give more than `most`."""
    if not lower.size or not demands(lower, upper):
        return
    attainable = most * np.abs(rows).sum(axis=1)
    np.minimum(lower, attainable, out=lower)
    np.maximum(upper, -attainable, out=upper)


def demands(lower: Array, upper: Array) -> bool:
    """Return true if zero is not within all bounds, of which there is at least one."""
    return bool(lower[lower.argmax()] > 0.0 or upper[upper.argmin()] < 0.0)


class Attainable:
    """Demands of limits on many joints, cut off at what the intervals of single joints allow.

    A row of a limit that is violated demands a motion. The joints may be too slow for it, or at their own bounds. Then
    the row demands what they attain, so that it contradicts no interval of a joint.
    """

    def __init__(
        self, rows: Array, lower: Array, upper: Array, joints: tuple[Array, Array] | None, fastest: float
    ) -> None:
        """Prepare for rows with bounds, and for intervals of the joints, if any; all are views that others fill.

        Args:
            rows: Rows of limits on many joints, shape (n, nv).
            lower: Their lower bounds, shape (n,).
            upper: Their upper bounds, shape (n,).
            joints: Lower and upper bounds of each joint, shapes (na,); they belong to the last coordinates.
            fastest: What a coordinate attains that has no bound.
        """
        self._rows, self._lower, self._upper = rows, lower, upper
        self._bounds, self._fastest = joints, fastest
        self._low, self._high = np.full(rows.shape[1], -fastest), np.full(rows.shape[1], fastest)

    def cut(self) -> None:
        """Cut the demands of all rows off; there is at least one row."""
        lower, upper = self._lower, self._upper
        # Where a joint must move, all rows may need all others.
        moved = self._bounds is not None and demands(*self._bounds)
        if not (moved or demands(lower, upper)):
            return
        low, high = self._low, self._high
        if self._bounds is not None:
            least, most = self._bounds
            joints = slice(low.size - least.size, None)
            low[joints] = np.where(np.isfinite(least), least, np.minimum(most, -self._fastest))
            high[joints] = np.where(np.isfinite(most), most, np.maximum(least, self._fastest))
        chosen = slice(None) if moved else (lower > 0.0) | (upper < 0.0)
        rows = self._rows[chosen]
        middle, reach = rows.dot(0.5 * (low + high)), np.abs(rows).dot(0.5 * SHARE * (high - low))
        lower[chosen] = np.minimum(lower[chosen], middle + reach)
        upper[chosen] = np.maximum(upper[chosen], middle - reach)


def for_joints(what: str, value: ArrayLike, robot: Robot) -> Array:
    """Return one number for each actuated joint, shape (na,), of one for all or one for each."""
    numbers = np.array(value, dtype=float)
    if numbers.shape not in ((), (robot.na,)):
        raise InputError(f"{what} must be one number or have shape ({robot.na},), got shape {numbers.shape}")
    return np.array(np.broadcast_to(numbers, (robot.na,)))
