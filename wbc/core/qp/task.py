"""Bases of tasks: rows of a least-squares objective, or of a hard constraint, over the variables of the QP.

A task owns a block of rows in the arrays of its controller. Setting its weight, gains or feed-forward writes into
that block at once, so that a tick only asks each task for what depends on the state: its Jacobian, its error and its
drift. The controller then computes the reference acceleration of all tasks together,

    reference = feed-forward acceleration + stiffness · error
                + damping · (feed-forward velocity − Jacobian · v) − drift,

and minimises ½ Σ weight · (Jacobian · acceleration − reference)². An error beyond its bound acts as one of that size: a
target out of reach pulls no harder the further away it is.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wbc.core.attributes import FixedAttributes
from wbc.core.errors import Array, InputError, WbcError, finite_array, shown, unknown_name, whole_number
from wbc.core.qp.problem import Problem
from wbc.core.robot import Robot
from wbc.core.signals import Measurement

ERROR_BOUNDS = {"m": 0.1, "rad": 1.0}
"""Unit → greatest component of an error that acts, unless a task is given another: far above those of a motion that is
followed. Errors of other units have no bound."""


OPTIONS = ("name", "weight", "stiffness", "damping", "error_bound", "hard", "axes", "joints")
"""Options of tasks; axes are those of motion tasks."""


@dataclass(slots=True)
class Rows:
    """Per-row values of one or several tasks, each of shape (dim,); views into the controller's arrays once bound."""

    error: Array
    drift: Array
    stiffness: Array
    damping: Array
    velocity: Array
    acceleration: Array
    weight: Array
    bound: Array

    @staticmethod
    def zeros(dim: int) -> Rows:
        """Return rows of zeros, whose error has no bound."""
        rows = Rows(*(np.zeros(dim) for _ in range(8)))
        rows.bound.fill(np.inf)
        return rows

    def view(self, rows: slice) -> Rows:
        """Return the given rows as views."""
        return Rows(*(getattr(self, field)[rows] for field in Rows.__dataclass_fields__))

    def copy_from(self, other: Rows) -> None:
        """Copy all values of `other`."""
        for field in Rows.__dataclass_fields__:
            getattr(self, field)[:] = getattr(other, field)


class Task(FixedAttributes):
    """Base of all tasks; subclass `MotionTask`, `SelectionTask` or `VariableTask`, not this.

    An attribute that a task does not have after its constructor, its `bind` and its first evaluation is refused.

    Attributes:
        name: Name in status tables and solutions, unique within a controller.
        dim: Number of rows; fixed once the task has been added to a controller.
        unit: Unit of the error; the residual is in `unit`/s² for motion tasks.
        idle: True while the weight is zero: the rows are left as they were, and cost no time.
        accepted: True once a controller has taken the task; from then on its target stays.
    """

    unit = "m"
    idle = False
    _set_by: str | None = None
    _held = False  # by another part that sets the target, or by a move

    def __init__(
        self,
        name: str,
        dim: int,
        *,
        weight: ArrayLike = 1.0,
        stiffness: ArrayLike = 0.0,
        damping: ArrayLike | None = None,
        error_bound: ArrayLike | None = None,
        hard: bool = False,
        **unknown: object,
    ) -> None:
        """Set gains; they can be changed at any time.

        Args:
            name: Name of the task, unique within a controller.
            dim: Number of rows, at least 1.
            weight: Cost per squared residual unit, scalar or shape (dim,), ≥ 0; unused when `hard`.
            stiffness: Acceleration per error, 1/s², scalar or shape (dim,), ≥ 0.
            damping: Acceleration per velocity error, 1/s; critical, 2·√stiffness, when None.
            error_bound: Greatest component of the error that acts, `unit`, scalar or shape (dim,), > 0; that of
                `ERROR_BOUNDS` when None.
            hard: Make the rows a constraint.
            **unknown: None: an option of another name is an error with the nearest ones.

        Raises:
            UnknownNameError: An option that tasks do not have.
            InputError: A gain that is negative, not finite or of the wrong shape.
        """
        if not isinstance(name, str):
            raise InputError(f"the name of a task must be text, got {shown(name)}")
        for option in unknown:
            unknown_name(f"option of task '{name}'", option, {*OPTIONS} - {option})
        self._dim = whole_number(f"number of rows of task '{name}'", dim, low=1)
        self.name = name
        self._rows = Rows.zeros(self._dim)
        self.hard = hard
        self._critical = True
        self._robot: Robot | None = None
        self.accepted = False
        self.weight = weight
        self.stiffness = stiffness
        self.error_bound = self._default_bound() if error_bound is None else error_bound
        if damping is not None:
            self.damping = damping

    @property
    def dim(self) -> int:
        """Number of rows."""
        return self._dim

    @property
    def hard(self) -> bool:
        """True if the rows are constraints instead of costs.

        Raises:
            InputError: Assigned while a controller has the task, or not true or false.
        """
        return self._hard

    @hard.setter
    def hard(self, value: bool) -> None:
        owner = vars(self).get("_owner")
        if owner is not None and owner() is not None:
            raise InputError(
                f"task '{self.name}' is in a controller, where hard is fixed: remove it, assign hard, and add it again"
            )
        if not isinstance(value, (bool, np.bool_)):
            raise InputError(f"hard of task '{self.name}' must be true or false, got {shown(value)}")
        self._hard = bool(value)
        self.idle = not (self._hard or self._rows.weight.any())

    @property
    def robot(self) -> Robot:
        """The robot whose state the task reads.

        Raises:
            InputError: The task has not been added to a controller yet.
        """
        if self._robot is None:
            raise InputError(
                f"task '{self.name}' belongs to no controller yet; add it first (its own `bind`, if it has one, calls "
                "super().bind(robot))"
            )
        return self._robot

    @property
    def weight(self) -> Array:
        """Cost per squared residual unit, shape (dim,), read-only; assign a scalar or an array."""
        return read_only(self._rows.weight)

    @weight.setter
    def weight(self, value: ArrayLike) -> None:
        self._rows.weight[:] = self._gain("weight", value)
        self.idle = not (self._hard or self._rows.weight.any())

    @property
    def stiffness(self) -> Array:
        """Acceleration per error, 1/s², shape (dim,), read-only; assigning one makes an unset damping critical."""
        return read_only(self._rows.stiffness)

    @stiffness.setter
    def stiffness(self, value: ArrayLike) -> None:
        stiffness = self._gain("stiffness (1/s²)", value)
        if self._critical:
            self._set_damping(2.0 * np.sqrt(stiffness))
        self._rows.stiffness[:] = stiffness

    @property
    def damping(self) -> Array:
        """Acceleration per velocity error, 1/s, shape (dim,), read-only; assign None to make it critical again."""
        return read_only(self._rows.damping)

    @damping.setter
    def damping(self, value: ArrayLike | None) -> None:
        if value is None:
            self._set_damping(2.0 * np.sqrt(self._rows.stiffness))
        else:
            self._set_damping(self._gain("damping (1/s)", value))
        self._critical = value is None

    def _set_damping(self, damping: Array) -> None:
        """Take a damping over, 1/s, scalar or shape (dim,)."""
        self._rows.damping[:] = damping

    @property
    def error_bound(self) -> Array:
        """Greatest component of the error that acts, `unit`, shape (dim,), read-only; assign one, or inf for none."""
        return read_only(self._rows.bound)

    @error_bound.setter
    def error_bound(self, value: ArrayLike) -> None:
        what = f"error_bound of task '{self.name}' ({self.unit})"
        try:
            bound = np.broadcast_to(np.asarray(value, dtype=float), (self._dim,))
        except (TypeError, ValueError, OverflowError):
            raise InputError(
                f"{what} must be a scalar or have shape ({self._dim},), got {shown(value)}"
            ) from None
        if not (bound > 0.0).all():
            raise InputError(f"{what} must be above zero, got {shown(value)}")
        self._rows.bound[:] = bound

    def saturate(self, error: Array) -> None:
        """Shorten an error that is beyond the bound to it, in its own direction.

        Args:
            error: Error of the task, shape (dim,), `unit`; positions and rotations are shortened each by themselves.
        """
        for part in self._vectors():
            over = float((abs(error[part]) / self._rows.bound[part]).max())
            if over > 1.0:
                error[part] /= over

    def _default_bound(self) -> ArrayLike:
        """Bound of the error of a task that is given none, `unit`, scalar or shape (dim,)."""
        return ERROR_BOUNDS.get(self.unit, np.inf)

    def _vectors(self) -> Sequence[slice]:
        """Rows of the error that are one vector; all of them unless a task says otherwise."""
        return (slice(0, self._dim),)

    @property
    def feedforward_velocity(self) -> Array:
        """Velocity of the target, shape (dim,), `unit`/s, read-only."""
        return read_only(self._rows.velocity)

    @feedforward_velocity.setter
    def feedforward_velocity(self, value: ArrayLike) -> None:
        velocity = self._vector("feed-forward velocity", value)
        if self._held:
            self._take_over()
        self._rows.velocity[:] = velocity

    @property
    def feedforward_acceleration(self) -> Array:
        """Acceleration of the target, shape (dim,), `unit`/s², read-only."""
        return read_only(self._rows.acceleration)

    @feedforward_acceleration.setter
    def feedforward_acceleration(self, value: ArrayLike) -> None:
        acceleration = self._vector("feed-forward acceleration", value)
        if self._held:
            self._take_over()
        self._rows.acceleration[:] = acceleration

    @property
    def error(self) -> Array:
        """Target − measured at the last tick, shape (dim,), `unit`; a copy."""
        return np.array(self._rows.error)

    @property
    def residual_unit(self) -> str:
        """Unit of the residual: that of an acceleration of the error."""
        return "|".join(f"{unit}/s²" for unit in self.unit.split("|"))

    def set_by(self, setting: str | None) -> None:
        """State that another part sets the target at every tick: what is assigned from then on is an error, not lost.

        Args:
            setting: What to use instead, such as "walking.body.com_height"; None to let the target be assigned again.
        """
        self._set_by = setting
        self._held = setting is not None

    @property
    def held_by(self) -> str | None:
        """What to use instead of assigning a target that another part sets at every tick; None where it is free."""
        return self._set_by

    def move_on(self, dt: float) -> bool:
        """Move a target that is on its way on by one tick; `wbc.tasks` has the tasks whose targets move.

        Args:
            dt: Control period, s.

        Returns:
            True if it is still on its way.
        """
        return False

    def _take_over(self) -> None:
        """Refuse a target that another part sets; called by the setters of a target that is held."""
        if self._set_by is not None:
            raise InputError(
                f"the target of task '{self.name}' is set at every tick by another part: use {self._set_by}"
            )

    def reset(self) -> None:  # noqa: B027 (optional)
        """Reset internal state, such as the offset of a compliance task; targets stay."""

    def bind(self, robot: Robot) -> None:
        """Resolve names of frames and joints, and take the present state as target where none was given.

        Called once, when the task is added to a controller. Override it; call `super().bind(robot)` first. The rows of
        a task that does not `observe` are then evaluated once, so that mistakes show before the first tick.

        Args:
            robot: The robot of the controller, with its state up to date.

        Raises:
            UnknownNameError: A frame or joint that the robot does not have.
        """
        self._robot = robot
        self._fixed = False  # a task of one's own makes attributes here

    def accept(self) -> None:
        """Keep target and attributes: a controller has taken the task."""
        self.accepted = True
        self.fix_attributes()

    def observe(self, measurement: Measurement, dt: float) -> None:  # noqa: B027 (optional)
        """Read the sensors before the rows are written; does nothing unless a task overrides it.

        Args:
            measurement: Measurement of this tick.
            dt: Control period, s.
        """

    def attach(self, rows: Rows) -> None:
        """Move the row values into views of the controller's arrays."""
        rows.copy_from(self._rows)
        self._rows = rows

    def detach(self) -> None:
        """Move the row values back into separate arrays."""
        self.attach(Rows.zeros(self._dim))

    def _resize(self, dim: int) -> None:
        """Change the number of rows before the task is attached, keeping uniform gains."""
        old, self._rows, self._dim = self._rows, Rows.zeros(dim), dim
        for field in ("weight", "stiffness", "damping", "bound"):
            values = getattr(old, field)
            if values.size != dim and not (values == values[0]).all():
                raise InputError(f"{field} of task '{self.name}' must be a scalar or have shape ({dim},)")
            getattr(self._rows, field)[:] = values if values.size == dim else values[0]

    def _gain(self, what: str, value: ArrayLike) -> Array:
        array = finite_array(f"{what} of task '{self.name}'", value)
        if array.shape not in ((), (self._dim,)):
            raise InputError(
                f"{what} of task '{self.name}' must be a scalar or have shape ({self._dim},), got {array.shape}"
            )
        if (array < 0.0).any():
            raise InputError(f"{what} of task '{self.name}' must not be negative, got {array}")
        return array

    def _vector(self, what: str, value: ArrayLike) -> Array:
        return finite_array(f"{what} of task '{self.name}'", value, (self._dim,))

    def __repr__(self) -> str:
        return f"{type(self).__name__}('{self.name}', dim={self.dim}{', hard' if self.hard else ''})"


def read_only(values: Array) -> Array:
    """Return a view that cannot be written: what is assigned is checked, an element that is written is not."""
    view = values.view()
    view.flags.writeable = False
    return view


class MotionTask(Task):
    """A task on a motion: rows over the generalised accelerations.

    A task of your own needs `bind`, to look up names, and `evaluate`, to fill its rows.
    """

    @abstractmethod
    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows from the present state of `self.robot`.

        Args:
            jacobian: To fill: velocity of the task per generalised velocity, shape (dim, nv).
            error: To fill: target − measured, shape (dim,).
            drift: To fill: task acceleration at zero generalised acceleration, J̇·v, shape (dim,).
        """


class SelectionTask(Task):
    """A task on single variables, whose Jacobian is a selection: it costs nothing but a diagonal.

    Attributes:
        columns: Velocity coordinates that the rows select, distinct, shape (dim,) or a slice.
    """

    columns: slice | np.ndarray[tuple[int], np.dtype[np.intp]]

    @abstractmethod
    def evaluate(self, error: Array) -> None:
        """Fill target − measured, shape (dim,)."""


class VariableTask(Task):
    """A task on all variables of the QP, accelerations and contact forces: for torques and wrenches.

    Its rows have no gains: the task is `matrix · x = reference`.
    """

    @property
    def residual_unit(self) -> str:
        """Unit of the residual: that of the variables themselves."""
        return self.unit

    def waits_for(self) -> object | None:
        """Return the contact object of the task, which may be added after it; None where nothing may."""
        return None

    def bind_problem(self, problem: Problem) -> None:
        """Look up contacts or torque rows; called whenever the layout of the QP has changed.

        Raises:
            UnknownNameError: A contact that the controller does not have.
        """

    @abstractmethod
    def evaluate(self, matrix: Array, reference: Array) -> None:
        """Fill the rows.

        Args:
            matrix: To fill, shape (dim, number of variables).
            reference: To fill, shape (dim,).
        """


def evaluated(task: MotionTask | SelectionTask) -> tuple[Array, Array, Array]:
    """Return Jacobian, shape (dim, nv), error and drift, shape (dim,), of a bound task at the present state, checked.

    Rows that cannot be evaluated, move with no joint, or have numbers that are not finite are an `InputError`.
    """
    jacobian, error, drift = np.zeros((task.dim, task.robot.nv)), np.zeros(task.dim), np.zeros(task.dim)
    try:
        if isinstance(task, SelectionTask):
            jacobian = np.eye(task.robot.nv)[task.columns]
            task.evaluate(error)
        else:
            task.evaluate(jacobian, error, drift)
    except WbcError:
        raise
    except Exception as failure:  # whatever a task of one's own may raise
        raise InputError(
            f"task '{task.name}' cannot be evaluated: {type(failure).__name__}: {failure}"
        ) from failure
    for what, rows in (("Jacobian", jacobian), ("error", error), ("drift", drift)):
        if not np.isfinite(rows).all():
            raise InputError(f"{what} of task '{task.name}' must be finite, got {shown(rows)}")
    if not jacobian.any():
        raise InputError(
            f"task '{task.name}' must move with some joint, its Jacobian is zero; evaluate writes into the array that "
            "it is given: jacobian[:] = …"
        )
    return jacobian, error, drift
