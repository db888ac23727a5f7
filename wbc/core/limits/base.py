"""Base of limits: rows over the accelerations with bounds that never contradict each other."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Annotated, ClassVar, Literal

import numpy as np

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array, scalar
from wbc.base.settings import Count, NonNegative, Positive
from wbc.core.owned import Owned
from wbc.core.robot import Reads, Robot

OPTIONS = "it follows from the robot and from the options with which the limit was made: make another limit"
"""Advice in place of an assignment to a bound."""

ATTAINABLE = 100.0
"""Acceleration of a coordinate up to which a limit asks for it, rad/s² or m/s²: the most braking of joints."""

BACK = 1.0
"""Speed of a coordinate up to which a limit asks for it from outside, rad/s or m/s; of a step rad or m."""

RECOVERY = 2.0
"""Greatest acceleration back from outside of a bound where none is given, m/s² or rad/s²."""

Order = Literal["step", "velocity", "acceleration"]
"""Quantity that rows of a limit bound: steps and velocities of inverse kinematics, accelerations of a controller."""

ZERO = scalar(0.0)
"""Zero, for the tick; see `scalar`."""


class Limit(Owned, ABC):
    """Base of limits on the generalised acceleration: lower ≤ rows · acceleration ≤ upper.

    Attributes:
        name: Name in status tables and messages.
        dim: Number of rows, fixed once the limit is bound.
        reads: State of the robot that the rows need in inverse kinematics; see `Task`.
        step_unit: Unit of the bounds of `write_step`, for messages.
    """

    reads: ClassVar[Reads] = "all"
    step_unit: ClassVar[str] = ""

    _kind = "limit"
    _owner = None
    dim: int

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

    def reset(self) -> None:  # noqa: B027 - most limits have nothing to forget
        """Forget the past, for a controller that begins anew where its robot is now."""

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
        """Fill rows and bounds of the velocity, as `write`, for inverse kinematics; by default, from a step."""
        self.write_step(rows, lower, upper)
        lower /= dt
        upper /= dt

    def __repr__(self) -> str:
        return f"{type(self).__name__}('{self.name}', rows={self.dim})"


class Barrier(Limit):
    """Base of limits that keep coordinates of the robot between bounds.

    A subclass fills its rows and the rooms, the distances of the coordinates to their bounds, and returns the drift.
    The rest is one law for all of them. A room may shrink at room / time constant at most, so that it never falls
    below zero (the velocity damper of Faverjon & Tournassoud, ICRA 1987). A row demands at most the acceleration room /
    time constant² + recovery away from its bound, which is enough from inside. From outside it brings the coordinate
    back. Two bounds of one row never cross, because what is room for one is lacking for the other. A solver cuts what a
    row demands off at what the joints attain.

    Rooms and speeds of all coordinates stand in two rows: those towards the upper bounds, and those towards the lower
    ones. A subclass with another law overrides `_final_speeds`, `_least_accelerations` and `_allowed_speeds`.
    """

    _time: float = 0.1  # time constant
    _back: float = RECOVERY
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
        self._robot, self._dt = robot, 0.0

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
            above: Upper bound less the coordinate, to fill in the same way, shape (dim,).
        """

    @abstractmethod
    def drift(self) -> Array | None:
        """Return the accelerations at no generalised acceleration, shape (dim,), after `measure`; None for zero."""

    def _take_period(self, dt: float) -> None:
        """Make arrays for a new period, s; those without axes take NumPy half the time of numbers."""
        self.__room, self.__speed, self.__bound, self.__least = np.zeros((4, 2, self.dim))
        self._dt, self._per_dt, self.__per_time = dt, scalar(1.0 / dt), scalar(1.0 / self._time)
        self.__per_way = scalar(1.0 / max(dt, self._time))
        # At the speed room / time constant a coordinate needs the deceleration room / time constant², and a little more
        # because a period passes before the bound reacts.
        self.__per_room = scalar(-(1.0 + 2.0 * dt / self._time) / self._time**2)
        self.__recovery = scalar(self._back)

    def _final_speeds(self, room: Array, speed: Array, out: Array) -> Array:
        """Return the greatest speeds towards the bounds at the end of a period, to overwrite, such as in `out`.

        Args:
            room: Distances to the upper and to the lower bounds, shape (2, dim), m or rad.
            speed: Speeds towards them, shape (2, dim), m/s or rad/s.
            out: Array for the result, shape (2, dim), m/s or rad/s.
        """
        return np.multiply(room, self.__per_time, out=out)

    def _least_accelerations(self, room: Array, out: Array) -> Array:
        """Return the least accelerations towards the bounds, which are negative: no row demands more braking.

        They have shape (2, dim) or (), m/s² or rad/s²; for the arguments see `_final_speeds`.
        """
        np.maximum(room, ZERO, out=out)
        out *= self.__per_room
        out -= self.__recovery
        return out

    def _allowed_speeds(self, room: Array, out: Array) -> None:
        """Fill the greatest speeds towards the bounds of inverse kinematics; see `_final_speeds`."""
        np.multiply(room, self.__per_way, out=out)

    def _measure(self, rows: Array, room: Array, order: Order, dt: float) -> Array | None:
        """Fill rows and rooms for an order and its period, s, which is 0 for a step.

        Returns:
            For accelerations the speeds of the coordinates, for velocities those at zero generalised velocity, shape
            (dim,); None for none.
        """
        self.measure(rows, room[1], room[0])
        return np.asarray(rows.dot(self._robot.v)) if order == "acceleration" else None

    def write(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill rows and bounds of the acceleration; see `Limit.write`."""
        if dt != self._dt:
            self._take_period(dt)
        room, speed = self.__room, self.__speed
        speed[0] = self._measure(rows, room, "acceleration", dt)
        np.negative(speed[0], out=speed[1])
        bound = self._final_speeds(room, speed, self.__bound)
        bound -= speed
        bound *= self._per_dt
        np.maximum(bound, self._least_accelerations(room, self.__least), out=self.__bound)
        self._fill(self.drift(), self.__bound, lower, upper)

    def write_step(self, rows: Array, lower: Array, upper: Array) -> None:
        """Fill rows and bounds of a step; see `Limit.write_step`."""
        room = np.zeros((2, self.dim))
        self._measure(rows, room, "step", 0.0)
        upper[:] = room[0]
        np.negative(room[1], out=lower)

    def write_velocity(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill rows and bounds of the velocity; see `Limit.write_velocity`."""
        if dt != self._dt:
            self._take_period(dt)
        others = self._measure(rows, self.__room, "velocity", dt)
        self._allowed_speeds(self.__room, self.__bound)
        self._fill(others, self.__bound, lower, upper)

    def _fill(self, others: Array | None, bound: Array, lower: Array, upper: Array) -> None:
        """Fill bounds from those towards each side, shape (2, dim), less what the coordinates do by themselves."""
        upper[:] = bound[0]
        np.negative(bound[1], out=lower)
        if others is not None:
            upper -= others
            lower -= others


def demands(lower: Array, upper: Array) -> bool:
    """Return true if zero is not within all bounds, of which there is at least one."""
    return bool(lower[lower.argmax()] > 0.0 or upper[upper.argmin()] < 0.0)


def cut_demands(most: float, rows: Array, lower: Array, upper: Array) -> None:
    """Cut demands of rows off where each coordinate would have to give more than `most`; for rows without a store."""
    if demands(lower, upper):
        attainable = most * np.add.reduce(np.abs(rows), axis=1)
        np.minimum(lower, attainable, out=lower)
        np.maximum(upper, -attainable, out=upper)
