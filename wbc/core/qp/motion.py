"""Motion rows of the QP: what tasks and contacts have in common, a name, a robot and the gains of their reference."""

from __future__ import annotations

import weakref
from abc import ABC
from dataclasses import dataclass
from typing import Any, ClassVar, SupportsIndex

import numpy as np
from numpy.typing import ArrayLike

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array, read_only
from wbc.core.robot import Robot

RATE = 10.0
"""Velocity per error in inverse kinematics where none is given, 1/s: an error is gone to a third in 0.1 s."""


@dataclass(slots=True)
class Rows:
    """Values of rows, one for each, of shape (dim,); views into the controller's arrays once bound."""

    error: Array
    drift: Array
    stiffness: Array
    damping: Array
    rate: Array
    velocity: Array
    acceleration: Array
    weight: Array
    bound: Array

    @staticmethod
    def zeros(dim: int) -> Rows:
        """Return rows of zeros, whose error has no bound."""
        rows = Rows(*(np.zeros(dim) for _ in range(9)))
        rows.bound.fill(np.inf)
        return rows

    def view(self, rows: slice) -> Rows:
        """Return the given rows as views."""
        return Rows(*(getattr(self, field)[rows] for field in Rows.__dataclass_fields__))

    def copy_from(self, other: Rows) -> None:
        """Copy all values of `other`."""
        for field in Rows.__dataclass_fields__:
            getattr(self, field)[:] = getattr(other, field)


class Motion(ABC):  # noqa: B024 (its subclasses have the abstract methods)
    """Base of tasks and contacts: rows that follow a motion.

    Attributes:
        name: Name in status tables and solutions, unique within a controller.
        dim: Number of rows.
        revision: Number that changes with gains, weights and bounds.
    """

    __slots__ = ("_critical", "_owner", "_robot", "_rows", "name", "revision")

    _kind: ClassVar[str] = "task"
    dim: int
    _owner: weakref.ref[Any] | None

    def __init__(self, name: str, stiffness: ArrayLike, damping: ArrayLike | None) -> None:
        """Allocate `dim` rows, and set their gains; see the properties."""
        self.name, self.revision = name, 0
        self._rows = Rows.zeros(self.dim)
        self._robot: Robot | None = None
        self._owner = None
        self._critical = True
        self._rows.rate.fill(RATE)
        self.stiffness = stiffness
        if damping is not None:
            self.damping = damping

    def __reduce_ex__(self, protocol: SupportsIndex) -> str | tuple[Any, ...]:
        """Refuse a copy where the robot is bound, which cannot be copied either."""
        if self._robot is not None:
            self._robot.__reduce__()
        return super().__reduce_ex__(protocol)

    @property
    def robot(self) -> Robot:
        """Robot of the controller."""
        if self._robot is None:
            raise InputError(
                f"{self._kind} '{self.name}' belongs to no controller yet; add it first (its own `bind`, if it has "
                "one, calls super().bind(robot))"
            )
        return self._robot

    @checked
    def bind(self, robot: Robot) -> None:
        """Resolve names against the robot, whose state is up to date; called when a controller gets it.

        Who overrides it calls `super().bind(robot)` first.
        """
        self._robot = robot

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows from the present state of the robot; see `Task.evaluate` and `Contact.evaluate`."""
        raise NotImplementedError

    def first_order(self, jacobian: Array, error: Array) -> None:
        """Fill the rows without the drift, for inverse kinematics: a class overrides it beside `evaluate` to save time.

        Where a class below has another `evaluate`, that one counts.
        """
        self.evaluate(jacobian, error, self._rows.drift)

    @property
    def stiffness(self) -> Array:
        """Acceleration per error, 1/s², shape (dim,), read-only; assigning one makes an unset damping critical."""
        return read_only(self._rows.stiffness)

    @stiffness.setter
    def stiffness(self, value: ArrayLike) -> None:
        stiffness = self._checked_gain("stiffness (1/s²)", value)
        if self._critical:
            self._set_damping(self._critical_damping(stiffness))
        self._rows.stiffness[:] = stiffness
        self.revision += 1

    @property
    def damping(self) -> Array:
        """Acceleration per velocity error, 1/s, shape (dim,), read-only; assign None to make it critical again.

        A critical damping that is read and assigned stays critical.
        """
        return read_only(self._rows.damping)

    @damping.setter
    def damping(self, value: ArrayLike | None) -> None:
        itself = value is not None and np.may_share_memory(value, self._rows.damping)
        if value is None:
            self._set_damping(self._critical_damping(self._rows.stiffness))
        else:
            self._set_damping(self._checked_gain("damping (1/s)", value))
        self._critical = value is None or (self._critical and itself)
        self.revision += 1

    @property
    def rate(self) -> Array:
        """Velocity per error in inverse kinematics, 1/s, shape (dim,), read-only; assign a scalar or an array."""
        return read_only(self._rows.rate)

    @rate.setter
    def rate(self, value: ArrayLike) -> None:
        self._rows.rate[:] = self._checked_gain("rate (1/s)", value)
        self.revision += 1

    def _critical_damping(self, stiffness: Array) -> Array:
        """Return the damping of rows that are given none, 1/s, of the shape of the stiffness."""
        return np.asarray(2.0 * np.sqrt(stiffness))

    def _set_damping(self, damping: Array) -> None:
        """Take a damping over, 1/s, scalar or shape (dim,)."""
        self._rows.damping[:] = damping

    def _checked_gain(
        self, what: str, value: ArrayLike, *, most: float = np.inf, above_zero: bool = False
    ) -> Array:
        """Return a scalar or an array of shape (dim,) of numbers from zero on, or above it, after a check."""
        gain = finite_array(f"{what} of {self._kind} '{self.name}'", value)
        if gain.shape not in ((), (self.dim,)):
            raise InputError(
                f"{what} of {self._kind} '{self.name}' must be a scalar or have shape ({self.dim},), got {gain.shape}"
            )
        if (gain < 0.0).any() or (gain > most).any() or (above_zero and (gain == 0.0).any()):
            rule = "above zero" if above_zero else "≥ 0" if most == np.inf else f"from 0 to {most:g}"
            raise InputError(f"{what} of {self._kind} '{self.name}' must be {rule}, got {gain}")
        return gain


def has_first_order(motion: Motion) -> bool:
    """Return true where `first_order` is made beside the `evaluate` that counts, or below it."""
    for kind in type(motion).__mro__:
        if "first_order" in vars(kind):
            return kind is not Motion
        if "evaluate" in vars(kind):
            return False
    return False
