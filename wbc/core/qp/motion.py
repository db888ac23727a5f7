"""Motion rows of the QP: what tasks and contacts have in common, a name, a robot and the gains of their reference."""

from __future__ import annotations

from abc import ABC
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar, SupportsIndex

import numpy as np
from numpy.typing import ArrayLike

from wbc.base.checked import checked
from wbc.base.errors import InputError, WbcError, shown
from wbc.base.numbers import Array, one_or_each, read_only
from wbc.core.owned import Owned
from wbc.core.qp.options import Choice
from wbc.core.robot import Robot

OPTIONS = "it is an option with which this is made: make another one"
"""Advice in place of an assignment to such an option of a task or a contact."""

RATE = 10.0
"""Velocity per error in inverse kinematics where none is given, 1/s: an error is gone to a third in 0.1 s."""

NONE = np.array([[0.0]] * 6 + [[np.inf]])
"""Numbers of a row that asks for nothing; see `RowNumbers`."""


class RowNumbers:
    """Numbers of rows that do not depend on the state: one for each row, of shape (dim,).

    Attributes:
        values: All of them, shape (7, dim); the others are views of it.
        feed: Velocity and acceleration of the target, shape (2, dim).
        velocity: Velocity of the target.
        acceleration: Acceleration of the target.
        stiffness: Acceleration per error.
        damping: Acceleration per velocity error.
        rate: Velocity per error.
        weight: Cost that acts at present.
        bound: Largest error that acts.
    """

    __slots__ = (
        "acceleration", "bound", "damping", "feed", "rate", "stiffness", "values", "velocity", "weight",
    )  # fmt: skip

    def __init__(self, values: Array) -> None:
        """Name the rows of an array, shape (7, dim)."""
        self.values: Array = values
        self.feed: Array = values[:2]
        self.velocity, self.acceleration, self.stiffness, self.damping = values[:4]
        self.rate, self.weight, self.bound = values[4:]

    @staticmethod
    def zeros(dim: int) -> RowNumbers:
        """Return rows of zeros, whose error has no bound."""
        return RowNumbers(np.repeat(NONE, dim, axis=1))

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy the array; the names follow."""
        return RowNumbers, (self.values,)


class Motion(Owned, ABC):  # noqa: B024 (its subclasses have the abstract methods)
    """Base of tasks and contacts: rows that follow a motion.

    Attributes:
        name: Name in status tables and solutions, unique within a controller.
        dim: Number of rows.
        revision: Number that changes with gains, weights and bounds.
    """

    __slots__ = ("_critical", "_fed", "_numbers", "_robot", "revision")

    _kind: ClassVar[str] = "task"
    _choice = Choice("all rows", 1, None, None)
    dim: int

    def __init__(self, name: str, stiffness: ArrayLike, damping: ArrayLike | None) -> None:
        """Allocate `dim` rows, and set their gains; see the properties."""
        kind = type(self)
        if kind.evaluate is Motion.evaluate and (
            kind.measure is Motion.measure or kind.drift is Motion.drift
        ):
            raise InputError(f"{kind.__name__} needs a method `evaluate`, or `measure` and `drift`")
        self._owner = None
        self.name, self.revision = name, 0
        self._fed = False  # the target has had a velocity or an acceleration: it may be another in every tick
        self._numbers = RowNumbers.zeros(self.dim)
        self._robot: Robot | None = None
        self._critical = True
        self._numbers.rate.fill(RATE)
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

    def _parts(self) -> list[tuple[str, Any]]:
        """Unit and rows of each part of the error that is one vector."""
        parts = [("m", slice(0, 3)), ("rad", slice(3, self.dim))]
        return parts[: 1 if self.dim <= 3 else 2]

    def sizes(self, rows: Array) -> list[tuple[str, Any, float]]:
        """Return unit, place and length of each part of some rows, shape (dim,), that is one vector."""
        return [(unit, part, float(np.linalg.norm(rows[part]))) for unit, part in self._parts()]

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows from the present state of the robot: by `measure` and `drift`, unless a class overrides it.

        Args:
            jacobian: To fill: velocity of the rows per generalised velocity, shape (rows, nv).
            error: To fill: target − measured, shape (rows,).
            drift: To fill: acceleration of the rows at zero generalised acceleration, J̇·v, shape (rows,).
        """
        self.measure(jacobian, error)
        drift[:] = self.drift()

    def measure(self, jacobian: Array, error: Array) -> None:
        """Fill Jacobian, shape (rows, nv), and error, shape (rows,); with `drift` it stands for `evaluate`."""
        raise NotImplementedError

    def drift(self) -> Array:
        """Return the drift of the rows, shape (rows,); `measure` was called before."""
        raise NotImplementedError

    def evaluated(self) -> tuple[Array, Array, Array]:
        """Return Jacobian, shape (dim, nv), error and drift, shape (dim,), at the present state, checked.

        Rows that cannot be evaluated, move with no joint, or have numbers that are not finite are an `InputError`.
        """
        rows = jacobian, error, drift = self._unfilled(), np.zeros(self.dim), np.zeros(self.dim)
        with self._guarded():
            Block(self, slice(0, self.dim), *rows).fill()
        for what, values in zip(("Jacobian", "error", "drift"), rows, strict=True):
            if not np.isfinite(values).all():
                raise InputError(f"{what} of {self._kind} '{self.name}' must be finite, got {shown(values)}")
        if not jacobian.any():
            raise InputError(
                f"{self._kind} '{self.name}' must move with some joint, its Jacobian is zero; evaluate writes into the "
                "array that it is given: jacobian[:] = …"
            )
        return jacobian, error, drift

    def _unfilled(self) -> Array:
        """Return the Jacobian before `evaluate` fills it, shape (dim, nv)."""
        return np.zeros((self.dim, self.robot.nv))

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """Make an `InputError` of whatever a task of one's own raises."""
        try:
            yield
        except WbcError:
            raise
        except Exception as failure:
            raise InputError(
                f"{self._kind} '{self.name}' cannot be evaluated: {type(failure).__name__}: {failure}"
            ) from failure

    @property
    def stiffness(self) -> Array:
        """Acceleration per error, 1/s², shape (dim,), read-only; assigning one makes an unset damping critical."""
        return read_only(self._numbers.stiffness)

    @stiffness.setter
    def stiffness(self, value: ArrayLike) -> None:
        stiffness = self._checked_gain("stiffness (1/s²)", value)
        if self._critical:
            self._set_damping(self._critical_damping(stiffness))
        self._numbers.stiffness[:] = stiffness
        self.revision += 1

    @property
    def damping(self) -> Array:
        """Acceleration per velocity error, 1/s, shape (dim,), read-only; assign None to make it critical again.

        A critical damping that is read and assigned stays critical.
        """
        return read_only(self._numbers.damping)

    @damping.setter
    def damping(self, value: ArrayLike | None) -> None:
        itself = value is not None and np.may_share_memory(value, self._numbers.damping)
        if value is None:
            self._set_damping(self._critical_damping(self._numbers.stiffness))
        else:
            self._set_damping(self._checked_gain("damping (1/s)", value))
        self._critical = value is None or (self._critical and itself)
        self.revision += 1

    @property
    def rate(self) -> Array:
        """Velocity per error in inverse kinematics, 1/s, shape (dim,), read-only; assign a scalar or an array."""
        return read_only(self._numbers.rate)

    @rate.setter
    def rate(self, value: ArrayLike) -> None:
        self._numbers.rate[:] = self._checked_gain("rate (1/s)", value)
        self.revision += 1

    def _critical_damping(self, stiffness: Array) -> Array:
        """Return the damping of rows that are given none, 1/s, of the shape of the stiffness."""
        return np.asarray(2.0 * np.sqrt(stiffness))

    def _set_damping(self, damping: Array) -> None:
        """Take a damping over, 1/s, scalar or shape (dim,)."""
        self._numbers.damping[:] = damping

    def _checked_gain(self, what: str, value: ArrayLike, **limits: Any) -> Array:
        """Return a scalar, or numbers of shape (dim,), as one number for each row, after a check of their range."""
        return one_or_each(f"{what} of {self._kind} '{self.name}'", value, self.dim, low=0.0, **limits)


class Block:
    """Rows of one task or contact in the arrays of a QP: where they stand, and how they are filled.

    Attributes:
        item: The task or contact.
        place: Its rows among those of the QP.
        jacobian: View of the Jacobian, shape (dim, nv).
        error: View of the errors, shape (dim,).
        evaluate: Fills the arrays in `full` at the present state.
        full: Jacobian, error and drift of all axes; of the first order, where a class has `measure`, without the drift.
        trims: True if the rows are to be trimmed.
        revision: Revision of the item whose numbers have been taken.
        engaged: True while a contact holds its frame; None before the first tick.
        reserved: Equalities of a contact: its motion, or, where that is a cost, its force while it is off; those of a
            hard task on variables of the QP.
        feed: View of the velocities and accelerations of targets, shape (2, dim).
        force: Numbers of a contact's force in the QP.
    """

    __slots__ = (
        "_rows", "engaged", "error", "evaluate", "feed", "force", "full", "item", "jacobian", "place", "reserved",
        "revision", "trims",
    )  # fmt: skip

    def __init__(
        self, item: Any, place: slice, jacobian: Array, error: Array, drift: Array, order: int = 2
    ) -> None:
        """Take the item, which is bound, and the arrays to fill."""
        self.item, self.place, self.jacobian, self.error = item, place, jacobian, error
        self.revision = -1
        self.engaged: bool | None = None
        self.reserved: slice | None = None
        self.feed: Array = np.zeros((2, 0))
        self.force: Any = None
        self._rows: tuple[Array, ...] = (jacobian, error, drift)
        self.full: tuple[Array, ...] = self._rows
        if item._choice.keep is not ...:
            n = item._choice.n_rows
            self.full = np.zeros((n, jacobian.shape[1])), np.zeros(n), np.zeros(n)
        self.evaluate = item.evaluate
        if order == 1 and type(item).evaluate is Motion.evaluate:
            self._rows, self.full, self.evaluate = self._rows[:2], self.full[:2], item.measure
        self.trims = item._choice.trims

    def fill(self) -> None:
        """Fill the rows at the present state of the robot."""
        self.evaluate(*self.full)
        if self.trims:
            self.trim()

    def trim(self) -> None:
        """Take the rows that the task has chosen; see `Choice`."""
        item = self.item
        item._choice.trim(self._rows, self.full, item._numbers.damping, item.robot.v)

    def take(self) -> None:
        """Note that the numbers of the item as they are now have been taken."""
        self.revision, self.trims = self.item.revision, self.item._choice.trims

    def clear(self) -> None:
        """Set all rows to zero."""
        for rows in self._rows:
            rows[:] = 0.0
