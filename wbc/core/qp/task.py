"""Base of tasks: rows of a least-squares objective, or of a hard constraint, over the variables of the QP.

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
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Literal, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.base.errors import InputError, WbcError, shown, unknown_name
from wbc.base.numbers import Array, whole_number
from wbc.core.qp.axes import POSITION_AXES, axis_mask, distinct_joints, other_columns
from wbc.core.qp.motion import RATE, Rows, has_first_order, read_only
from wbc.core.qp.problem import Problem
from wbc.core.qp.target import Targeted
from wbc.core.robot import Reads, Robot
from wbc.core.signals import Measurement

Drives = Literal["torque", "position"]
"""Kind of the commands to the drives; "torque" for hybrid control as well."""

ERROR_BOUNDS = {"m": 0.1, "rad": 1.0}
"""Unit → greatest component of an error that acts, unless a task is given another: far above those of a motion that is
followed. Errors of other units have no bound."""

NEAR = {"m": 0.01, "rad": 0.05}
"""Unit → error within which a task has reached its target."""

SLOW = {"m": 0.05, "rad": 0.2}
"""Unit → speed below which a task has reached its target, per second."""


class TaskOptions(TypedDict, total=False):
    """Options of all tasks; an unknown one raises an `UnknownNameError`, a value out of range an `InputError`.

    Attributes:
        name: Name in status tables and solutions, unique within a controller; made from the class and the frame or
            contact when None.
        weight: Cost per squared residual unit, scalar or shape (dim,), ≥ 0; without effect on a hard task.
        hard: Make the rows a constraint instead of a cost; False by default.
    """

    name: str | None
    weight: ArrayLike
    hard: bool


class GainOptions(TaskOptions, total=False):
    """Options of tasks with an error: those of all tasks, and gains.

    Attributes:
        stiffness: Acceleration per error, 1/s², scalar or shape (dim,), ≥ 0.
        damping: Acceleration per velocity error, 1/s, scalar or shape (dim,), ≥ 0; critical, 2·√stiffness, when None,
            the default.
        rate: Velocity per error in inverse kinematics, where stiffness and damping are not used, 1/s, scalar or shape
            (dim,), ≥ 0; 10 by default.
        error_bound: Greatest component of the error that acts, in its unit (m, rad), scalar or shape (dim,), > 0: a
            longer error acts as one of this length in its direction, so that a target out of reach pulls no harder
            the further away it is. 0.1 m (of the centre of mass 0.3 m) and 1 rad by default; `math.inf` for none.
    """

    stiffness: ArrayLike
    damping: ArrayLike | None
    rate: ArrayLike
    error_bound: ArrayLike | None


class MotionOptions(GainOptions, total=False):
    """Options of motion tasks: those of tasks with an error, and a choice of axes and joints.

    Attributes:
        axes: Axes to control, each with a row; all by default. Out of x, y, z for a position, roll (about x), pitch
            (about y), yaw (about z) for an orientation, all six for a pose.
        joints: Joints that the task may use, "base" for the floating base; all of them when None, the default.
    """

    axes: str | Sequence[str]
    joints: str | Sequence[str] | None


class Task(Targeted):
    """Base of all tasks: rows over the accelerations, unless it is a `SelectionTask` or a `VariableTask`.

    A task of your own has `evaluate`, which fills its rows, and `bind`, which looks names up. `present` and `checked`
    give it a target that is checked, moved and followed: a number for each axis unless they say otherwise.

    Attributes:
        name: Name in status tables and solutions, unique within a controller.
        dim: Number of rows; fixed once the task has been added to a controller.
        unit: Unit of the error, with a bar between those of position and rotation; the residual is in `unit`/s² for
            motion tasks.
        usual: Options of the tasks of a class where none are given.
        of_velocity: True of a class whose error is one of a velocity: in inverse kinematics its target is what the
            velocities make of the rows, whatever `rate` is.
        drives: Drives for which the rows are made, "torque" (hybrid control as well) or "position"; None for all.
        reads: State of the robot that the rows of a class need in inverse kinematics.
        spared_acceleration: Accelerations of the coordinates in `spared` as they are expected, shape (n,).
        idle: True while the weight is zero: the rows are left as they were, and cost no time.
    """

    __slots__ = (
        "_full", "_hard", "_keep", "_linear_rows", "_n_rows", "_only_joints", "_spared", "_unused", "dim", "idle",
        "spared_acceleration",
    )  # fmt: skip

    usual: ClassVar[MotionOptions] = {}
    of_velocity: ClassVar[bool] = False
    reads: ClassVar[Reads] = "all"
    drives: Drives | None = None

    def __init__(self, name: str, rows: int | Sequence[str], /, **options: Unpack[MotionOptions]) -> None:
        """Describe the task; gains can be changed at any time.

        Args:
            name: Name where the options give none.
            rows: Number of rows, at least 1, or their names in order, of which the option `axes` chooses.
            **options: See `MotionOptions`. Weight 1 and stiffness 0 where neither they nor `usual` say otherwise.
        """
        given: dict[str, Any] = {**self.usual, **options}
        name = given.pop("name", None) or name
        if not isinstance(name, str):
            raise InputError(f"the name of a task must be text, got {shown(name)}")
        self._keep: slice | NDArray[np.intp] = slice(None)  # the chosen ones of all rows
        self._linear_rows: int | None = None  # the others are of a rotation
        self._n_rows = rows if isinstance(rows, int) else len(rows)  # of all axes
        if isinstance(rows, int):
            self.dim = whole_number(f"number of rows of task '{name}'", rows, low=1)
        else:
            mask = axis_mask(name, given.pop("axes", rows), rows)
            kept = np.flatnonzero(mask)
            self.dim, first = kept.size, int(kept[0])
            self._keep = slice(first, first + self.dim) if kept[-1] == first + self.dim - 1 else kept
            self._linear_rows = int(mask[[axis in POSITION_AXES for axis in rows]].sum())
        joints = given.pop("joints", None)
        self._only_joints = None if joints is None else distinct_joints(joints)
        self._unused: NDArray[np.intp] | None = None
        self._full: tuple[Array, Array, Array] | None = None  # rows of all axes, where some are chosen
        self._spared: NDArray[np.intp] | None = None
        self.spared_acceleration = np.zeros(0)
        self._hard = self.idle = False
        super().__init__(name, given.pop("stiffness", 0.0), given.pop("damping", None))
        self.rate = given.pop("rate", RATE)
        self.weight = given.pop("weight", 1.0)
        self.hard = given.pop("hard", False)
        bound = given.pop("error_bound", None)
        self.error_bound = self._usual_bound() if bound is None else bound
        for option in given:
            unknown_name(f"option of task '{name}'", option, {*MotionOptions.__annotations__} - {option})

    @property
    def hard(self) -> bool:
        """True if the rows are constraints instead of costs."""
        return self._hard

    @hard.setter
    def hard(self, value: bool) -> None:
        if self._owner is not None and self._owner() is not None:
            raise InputError(
                f"task '{self.name}' is in a controller, where hard is fixed: remove it, assign hard, and add it again"
            )
        if not isinstance(value, (bool, np.bool_)):
            raise InputError(f"hard of task '{self.name}' must be true or false, got {shown(value)}")
        self._hard = bool(value)
        self.idle = not (self._hard or self._rows.weight.any())

    @property
    def weight(self) -> Array:
        """Cost per squared residual unit, shape (dim,), read-only; assign a scalar or an array."""
        return read_only(self._rows.weight)

    @weight.setter
    def weight(self, value: ArrayLike) -> None:
        self._weigh(self._checked_gain("weight", value))

    def _weigh(self, weight: Array) -> None:
        """Take a weight over, scalar or shape (dim,)."""
        self._rows.weight[:] = weight
        self.revision += 1
        self.idle = not (self._hard or self._rows.weight.any())

    @property
    def error_bound(self) -> Array:
        """Greatest component of the error that acts, `unit`, shape (dim,), read-only; assign one, or inf for none."""
        return read_only(self._rows.bound)

    @error_bound.setter
    def error_bound(self, value: ArrayLike) -> None:
        what = f"error_bound of task '{self.name}' ({self.unit})"
        try:
            bound = np.broadcast_to(np.asarray(value, dtype=float), (self.dim,))
        except (TypeError, ValueError, OverflowError):
            raise InputError(
                f"{what} must be a scalar or have shape ({self.dim},), got {shown(value)}"
            ) from None
        if not (bound > 0.0).all():
            raise InputError(f"{what} must be above zero, got {shown(value)}")
        self._rows.bound[:] = bound
        self.revision += 1

    def _usual_bound(self) -> ArrayLike:
        """Bound of the error of a task that is given none, `unit`, scalar or shape (dim,)."""
        bounds = [ERROR_BOUNDS.get(unit, np.inf) for unit in self.unit.split("|")]
        if self._linear_rows is None:
            return bounds[0] if len(bounds) == 1 else np.inf
        return np.where(np.arange(self.dim) < self._linear_rows, bounds[0], bounds[-1])

    def _parts(self) -> list[tuple[str, slice]]:
        """Unit and rows of each part of the error that is one vector."""
        units, linear = self.unit.split("|"), self._linear_rows
        if linear is None:
            return [(self.unit, slice(0, self.dim))]
        parts = ((units[0], slice(0, linear)), (units[-1], slice(linear, self.dim)))
        return [(unit, part) for unit, part in parts if part.stop > part.start]

    def saturate(self, error: Array) -> None:
        """Shorten an error, shape (dim,), `unit`, that is beyond the bound to it, in its own direction.

        Positions and rotations are shortened each by themselves.
        """
        bound = self._rows.bound
        for _, part in self._parts():
            over = float((abs(error[part]) / bound[part]).max())
            if over > 1.0:
                error[part] /= over

    @property
    def error(self) -> Array:
        """Target − measured at the last tick, shape (dim,), `unit`; a copy."""
        return np.array(self._rows.error)

    @property
    def residual_unit(self) -> str:
        """Unit of the residual: that of an acceleration of the error."""
        return "|".join(f"{unit}/s²" for unit in self.unit.split("|"))

    @property
    def velocity(self) -> Array:
        """Measured velocity of the rows now, shape (dim,), `unit`/s."""
        return np.asarray(evaluated(self)[0] @ self.robot.v)

    @property
    def speed(self) -> float:
        """Measured speed now, `unit`/s: that of the fastest of position, rotation and joints."""
        return max(self._sizes(self.velocity))

    @property
    def reached(self) -> bool:
        """True once the target has arrived, and the robot there: within 10 mm and 0.05 rad, below 0.05 m/s, 0.2 rad/s.

        It is the robot of the controller, in position control with open feedback the commanded one.
        """
        if self.moving:
            return False
        jacobian, error, _ = evaluated(self)
        sizes = zip(self._parts(), self._sizes(error), self._sizes(jacobian @ self.robot.v), strict=True)
        return all(off <= NEAR[unit] and speed <= SLOW[unit] for (unit, _), off, speed in sizes)

    def _sizes(self, rows: Array) -> list[float]:
        """Length of each part of some rows."""
        return [float(np.linalg.norm(rows[part])) for _, part in self._parts()]

    # ---- what a controller calls ----------------------------------------------------------------------------------

    def reset(self) -> None:
        """Reset internal state, such as the offset of a compliance task, and end a move; targets stay."""
        self._stop()

    def bind(self, robot: Robot) -> None:
        """Resolve names, and take the present state as target where none was given; see `Motion.bind`.

        The rows of a task that does not `observe` are then evaluated once, so that mistakes show before the first tick.
        """
        super().bind(robot)
        self._unused = other_columns(robot, self._only_joints)
        if self._n_rows != self.dim:
            self._full = np.zeros((self._n_rows, robot.nv)), np.zeros(self._n_rows), np.zeros(self._n_rows)
        if self._target.open:
            self._target.value = self._target.present = self.present(robot)

    def keeps(self) -> Sequence[object]:
        """Return the contact objects that must not be removed before the task."""
        return ()

    def let_go(self) -> None:  # noqa: B027 (optional)
        """Undo what the task has set at other objects than its own rows: it is being removed."""

    def observe(self, measurement: Measurement, dt: float) -> None:  # noqa: B027 (optional)
        """Read the sensors before the rows are written, at every tick of dt, s; a task overrides it."""

    @abstractmethod
    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows from the present state of `self.robot`, those of all axes of the task.

        Args:
            jacobian: To fill: velocity of the task per generalised velocity, shape (rows, nv).
            error: To fill: target − measured, shape (rows,).
            drift: To fill: task acceleration at zero generalised acceleration, J̇·v, shape (rows,).
        """

    def fill(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows of the chosen axes, with the chosen joints; as `evaluate`, for the controller."""
        if self._full is None:
            self.evaluate(jacobian, error, drift)
        else:
            self.evaluate(*self._full)
            jacobian[:], error[:], drift[:] = (rows[self._keep] for rows in self._full)
        if self._spared is not None:
            drift += jacobian[:, self._spared].dot(self.spared_acceleration)
            self._leave_out(self._spared, jacobian, drift)
        if self._unused is not None:
            self._leave_out(self._unused, jacobian, drift)

    def quick(self) -> Callable[[Array, Array], None] | None:
        """Return what fills Jacobian and error alone, for inverse kinematics; None where `fill` has to."""
        direct = self._full is None and self._unused is None and has_first_order(self)
        return self.first_order if direct else None

    def _leave_out(self, coordinates: NDArray[np.intp], jacobian: Array, drift: Array) -> None:
        """Take coordinates out of the task; their velocities are damped as those of the others."""
        drift += self._rows.damping * jacobian[:, coordinates].dot(self.robot.v[coordinates])
        jacobian[:, coordinates] = 0.0

    @property
    def spared(self) -> NDArray[np.intp]:
        """Velocity coordinates whose motion counts but that the task does not use, shape (n,); none until they are set.

        They are, for the centre of mass, those of an arm with a task of its own, and for a hand those of the body that
        carries it. Assigning them sets their expected accelerations to zero. The motion of joints that the option
        `joints` leaves out counts as well, with no acceleration expected.
        """
        return np.zeros(0, dtype=np.intp) if self._spared is None else self._spared

    @spared.setter
    def spared(self, value: NDArray[np.intp]) -> None:
        self._spared = value if len(value) else None
        self.spared_acceleration = np.zeros(len(value))

    def attach(self, rows: Rows) -> None:
        """Move the row values into views of the controller's arrays."""
        rows.copy_from(self._rows)
        self._rows = rows

    def detach(self) -> None:
        """Move the row values back into separate arrays."""
        self.attach(Rows.zeros(self.dim))

    def _resize(self, dim: int) -> None:
        """Change the number of rows before the task is attached, keeping uniform gains."""
        old, self._rows = self._rows, Rows.zeros(dim)
        self.dim = self._n_rows = dim
        for field in ("weight", "stiffness", "damping", "rate", "bound"):
            values = getattr(old, field)
            if values.size != dim and not (values == values[0]).all():
                raise InputError(f"{field} of task '{self.name}' must be a scalar or have shape ({dim},)")
            getattr(self._rows, field)[:] = values if values.size == dim else values[0]

    def __repr__(self) -> str:
        return f"{type(self).__name__}('{self.name}', dim={self.dim}{', hard' if self.hard else ''})"


class SelectionTask(Task):
    """Base of tasks whose rows select single coordinates: they cost the QP nothing but a diagonal.

    `evaluate` fills the error alone. Every row is a part of the error by itself.

    Attributes:
        columns: Velocity coordinates of the rows, distinct, shape (dim,) or a slice; `bind` sets them.
    """

    __slots__ = ()
    columns: slice | NDArray[np.intp]

    def saturate(self, error: Array) -> None:
        """Bring each component of an error, shape (dim,), `unit`, within its bound."""
        bound = self._rows.bound
        np.minimum(np.maximum(error, -bound, out=error), bound, out=error)

    def _sizes(self, rows: Array) -> list[float]:
        """Greatest component of some rows."""
        return [float(abs(rows).max())]


class VariableTask(Task):
    """Base of tasks on torques and wrenches: rows over all variables of the QP, matrix · x = reference.

    `evaluate` fills the matrix, shape (dim, number of variables), in place of the Jacobian, and the reference, shape
    (dim,), in place of the error.
    """

    __slots__ = ()

    @property
    def residual_unit(self) -> str:
        """Unit of the residual: that of the variables."""
        return self.unit

    def bind_problem(self, problem: Problem) -> None:  # noqa: B027 (optional)
        """Look up contacts or torque rows; called whenever the layout of the QP has changed.

        A task whose contact is not in the QP raises an `UnknownNameError`, and has no effect while it is not.
        """

    def waits_for(self) -> object | None:
        """Return the contact object of the task, which may be added after it; None where nothing may."""
        return None

    def fill(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `evaluate`."""
        self.evaluate(jacobian, error, drift)


def fill_guarded(task: Task, *rows: Array) -> None:
    """Fill the rows of a task; whatever a task of one's own raises is an `InputError`."""
    try:
        task.fill(*rows)
    except WbcError:
        raise
    except Exception as failure:
        raise InputError(
            f"task '{task.name}' cannot be evaluated: {type(failure).__name__}: {failure}"
        ) from failure


def evaluated(task: Task) -> tuple[Array, Array, Array]:
    """Return Jacobian, shape (dim, nv), error and drift, shape (dim,), of a bound task at the present state, checked.

    Rows that cannot be evaluated, move with no joint, or have numbers that are not finite are an `InputError`.
    """
    if isinstance(task, VariableTask):
        raise InputError(f"task '{task.name}' is on variables of the QP: it has neither error nor speed")
    jacobian, error, drift = np.zeros((task.dim, task.robot.nv)), np.zeros(task.dim), np.zeros(task.dim)
    fill_guarded(task, jacobian, error, drift)
    if isinstance(task, SelectionTask):
        jacobian = np.eye(task.robot.nv)[task.columns]
    for what, rows in (("Jacobian", jacobian), ("error", error), ("drift", drift)):
        if not np.isfinite(rows).all():
            raise InputError(f"{what} of task '{task.name}' must be finite, got {shown(rows)}")
    if not jacobian.any():
        raise InputError(
            f"task '{task.name}' must move with some joint, its Jacobian is zero; evaluate writes into the array that "
            "it is given: jacobian[:] = …"
        )
    return jacobian, error, drift
