"""Base of tasks: rows of a least-squares objective, or of a hard constraint, over the variables of the QP.

A task gives its Jacobian, its error and its drift at the present state; its weight, gains and feed-forward are numbers
that it keeps. `wbc.core.qp.store` puts the rows of all tasks into one QP, and computes the reference acceleration of
all of them together,

    reference = feed-forward acceleration + stiffness · error
                + damping · (feed-forward velocity − Jacobian · v) − drift,

and minimises ½ Σ weight · (Jacobian · acceleration − reference)². An error beyond its bound is shortened to the bound,
so that a distant target does not cause a larger acceleration.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import EllipsisType
from typing import Any, ClassVar, Literal, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.base.errors import InputError, WbcError, shown, unknown_name
from wbc.base.numbers import Array, read_only, whole_number
from wbc.core.qp.axes import POSITION_AXES, axis_mask, distinct_joints, other_columns
from wbc.core.qp.motion import RATE, Block, Rows
from wbc.core.qp.solving.problem import Problem
from wbc.core.qp.target import Targeted
from wbc.core.robot import Reads, Robot
from wbc.core.signals import Measurement

Drives = Literal["torque", "position"]
"""Kind of the commands to the drives; "torque" for hybrid control as well."""

ERROR_BOUNDS = {"m": 0.1, "rad": 1.0}
"""Unit → default bound of each component of an error, far above the errors of a followed motion; others have none."""

NEAR = {"m": 0.01, "rad": 0.05}
"""Unit → error within which a task has reached its target."""

SLOW = {"m": 0.05, "rad": 0.2}
"""Unit → speed below which a task has reached its target, per second."""


class TaskOptions(TypedDict, total=False):
    """Options of all tasks.

    An unknown option raises an `UnknownNameError`, and a value out of range an `InputError`.

    Attributes:
        name: Name in status tables and solutions, unique within a controller; when None, it is made from the class and
            the frame or contact.
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
        rate: Velocity per error in inverse kinematics, 1/s, scalar or shape (dim,), ≥ 0; 10 by default. Inverse
            kinematics does not use stiffness and damping.
        error_bound: Largest component of the error, in its unit (m, rad), scalar or shape (dim,), > 0. A longer error
            is shortened to the bound, in its own direction, so that a distant target does not cause a larger
            acceleration. 0.1 m (for the centre of mass 0.3 m) and 1 rad by default; `math.inf` for no bound.
    """

    stiffness: ArrayLike
    damping: ArrayLike | None
    rate: ArrayLike
    error_bound: ArrayLike | None


class MotionOptions(GainOptions, total=False):
    """Options of motion tasks: those of tasks with an error, and a choice of axes and joints.

    Attributes:
        axes: Axes to control, one row each; all by default. A position has x, y and z. An orientation has roll (about
            x), pitch (about y) and yaw (about z). A pose has all six.
        joints: Joints that the task may use, with "base" for the floating base; all when None, the default.
    """

    axes: str | Sequence[str]
    joints: str | Sequence[str] | None


class Task(Targeted):
    """Base of all tasks: rows over the generalised accelerations.

    The rows of a `SelectionTask` select single coordinates; those of a `VariableTask` are over all variables of the QP.

    Derive a task of your own from this class. Its `evaluate` fills the rows, and its `bind` looks names up. By default
    the target is one number for each axis; for a target of another type override `present`, which returns the target at
    which the error is zero, and `checked`, which checks a new target.

    Attributes:
        name: Name in status tables and solutions, unique within a controller.
        dim: Number of rows; fixed once the task has been added to a controller.
        unit: Unit of the error, such as "m", or "m|rad" for position and rotation. For motion tasks the unit of the
            residual is `unit`/s².
        usual: Default options of all tasks of the class.
        kinematic_weight: Default weight of the class in inverse kinematics, where it is another one than in `usual`.
        of_velocity: True for a class whose error is that of a velocity, such as a momentum. It has no damping unless
            one is given. In inverse kinematics the velocity of its rows is then the target itself, and `rate` has no
            effect.
        drives: Kind of drives for which the rows are made: "position", or "torque" for torque and hybrid control; None
            for all.
        reads: Part of the robot's state that the rows of the class need in inverse kinematics.
        idle: True while no weight acts; the rows are then not evaluated, and cost no time.
    """

    __slots__ = (
        "_expected", "_hard", "_keep", "_left_out", "_linear_rows", "_n_rows", "_only_joints", "_scale", "_spared",
        "_unused", "_weighed", "_weight", "dim", "idle",
    )  # fmt: skip

    usual: ClassVar[MotionOptions] = {}
    kinematic_weight: ClassVar[float | None] = None
    of_velocity: ClassVar[bool] = False
    reads: ClassVar[Reads] = "all"
    drives: Drives | None = None

    def __init__(self, name: str, rows: int | Sequence[str], /, **options: Unpack[MotionOptions]) -> None:
        """Describe the task; gains can be changed at any time.

        Args:
            name: Default name, for options without a name.
            rows: Number of rows, at least 1, or the names of the rows in order, from which the option `axes` can
                choose.
            **options: See `MotionOptions`. The weight is 1 and the stiffness 0 unless they or `usual` have others.
        """
        given: dict[str, Any] = {**self.usual, **options}
        name = given.pop("name", None) or name
        if not isinstance(name, str):
            raise InputError(f"the name of a task must be text, got {shown(name)}")
        self._keep: slice | NDArray[np.intp] | EllipsisType = ...  # the chosen ones of all rows
        self._linear_rows: int | None = None  # the others are of a rotation
        self._n_rows = rows if isinstance(rows, int) else len(rows)  # of all axes
        if isinstance(rows, int):
            self.dim = whole_number(f"number of rows of task '{name}'", rows, low=1)
        else:
            mask = axis_mask(name, given.pop("axes", rows), rows)
            kept = np.flatnonzero(mask)
            self.dim, first = kept.size, int(kept[0])
            if self.dim < self._n_rows:
                self._keep = slice(first, first + self.dim) if kept[-1] == first + self.dim - 1 else kept
            self._linear_rows = int(mask[[axis in POSITION_AXES for axis in rows]].sum())
        joints = given.pop("joints", None)
        self._only_joints = None if joints is None else distinct_joints(joints)
        # Coordinates that the rows leave out: those in `spared`, then those of joints that the task must not use.
        self._spared = self._unused = np.zeros(0, dtype=np.intp)
        self._left_out: NDArray[np.intp] | None = None
        self._expected = np.zeros(0)  # their accelerations
        self._hard = self.idle = False
        super().__init__(name, given.pop("stiffness", 0.0), given.pop("damping", None))
        self.rate = given.pop("rate", RATE)
        self._weight, self._scale, self._weighed = np.ones(self.dim), np.ones(self.dim), False
        self.weight = given.pop("weight", 1.0)
        self._weighed = "weight" in options
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
        if isinstance(value, (bool, np.bool_)) and value == self._hard:
            return
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
        return read_only(self._weight)

    @weight.setter
    def weight(self, value: ArrayLike) -> None:
        self._weighed = self._weighed or not np.may_share_memory(value, self._weight)  # which changes nothing
        self._weigh(self._checked_gain("weight", value))

    def weigh_as_usual(self, *, kinematic: bool) -> None:
        """Take the default weight for the solver that gets the task, inverse kinematics or not, if none was given."""
        if not self._weighed and self.kinematic_weight is not None:
            self._weigh(self.kinematic_weight if kinematic else self.usual["weight"])

    def _weigh(self, weight: ArrayLike) -> None:
        """Take a weight over, scalar or shape (dim,)."""
        self._weight[:] = weight
        self._act()

    @property
    def scale(self) -> Array:
        """Ratio by which the weight acts at present, shape (dim,), read-only; assign a scalar or an array, ≥ 0.

        It is for who uses the task for a time, such as a walk that lets a foot swing and stand: the weight stays as it
        was set.
        """
        return read_only(self._scale)

    @scale.setter
    def scale(self, value: ArrayLike) -> None:
        self._scale[:] = self._checked_gain("scale", value)
        self._act()

    def _act(self) -> None:
        """Write the weight that acts."""
        np.multiply(self._weight, self._scale, out=self._rows.weight)
        self.revision += 1
        self.idle = not (self._hard or self._rows.weight.any())

    def _critical_damping(self, stiffness: Array) -> Array:
        """Return none for a task on a velocity, whose error decays with its stiffness alone; see `Motion`."""
        return 0.0 * stiffness if self.of_velocity else super()._critical_damping(stiffness)

    @property
    def error_bound(self) -> Array:
        """Bound of each component of the error, `unit`, shape (dim,), read-only; assign one, or inf for no bound."""
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
        """Shorten an error, shape (dim,), `unit`, to its bound, without a change of its direction.

        The parts of position and rotation are shortened separately.
        """
        bound = self._rows.bound
        for _, part in self._parts():
            over = float((abs(error[part]) / bound[part]).max())
            if over > 1.0:
                error[part] /= over

    @property
    def error(self) -> Array:
        """Error at the last tick, target − measured, shape (dim,), `unit`; a copy. Zero before the first one."""
        owner = None if self._owner is None else self._owner()
        return np.zeros(self.dim) if owner is None else np.asarray(owner.error_of(self))

    @property
    def residual_unit(self) -> str:
        """Unit of the residual: that of an acceleration of the error."""
        return "|".join(f"{unit}/s²" for unit in self.unit.split("|"))

    @property
    def velocity(self) -> Array:
        """Present velocity of the rows, shape (dim,), `unit`/s."""
        return np.asarray(evaluated(self)[0] @ self.robot.v)

    @property
    def speed(self) -> float:
        """Present speed, `unit`/s: the largest of those of position, rotation and joints."""
        return max(self._sizes(self.velocity))

    @property
    def reached(self) -> bool:
        """True if no move goes on and the robot is at the target: within 10 mm and 0.05 rad, below 0.05 m/s, 0.2 rad/s.

        An error in any other unit counts by the numbers for metres; a task for which these are wrong overrides this.
        `held_back_by` says why a task is not reached.
        The robot is that of the controller: in position control with open feedback it is the commanded robot.
        """
        if self.moving:
            return False
        jacobian, error, _ = evaluated(self)
        sizes = zip(self._parts(), self._sizes(error), self._sizes(jacobian @ self.robot.v), strict=True)
        return all(
            off <= NEAR.get(unit, NEAR["m"]) and speed <= SLOW.get(unit, SLOW["m"])
            for (unit, _), off, speed in sizes
        )

    @property
    def held_back_by(self) -> tuple[str, ...]:
        """Names of the tasks and limits that held the task off its target in the last tick, the strongest first.

        Empty if nothing did: then the robot is at the target or on its way. "contacts and hard tasks" stand for what
        must not move, "the reach of the robot" for a target that no joint brings nearer. Slow, not for the tick.
        """
        owner = None if self._owner is None else self._owner()
        return () if owner is None else owner.held_back().get(self.name, ())

    def _sizes(self, rows: Array) -> list[float]:
        """Length of each part of some rows."""
        return [float(np.linalg.norm(rows[part])) for _, part in self._parts()]

    # ---- what a controller calls ----------------------------------------------------------------------------------

    def reset(self) -> None:
        """Reset internal state, such as the offset of a compliance task, and end a move; targets do not change."""
        self._stop()

    def bind(self, robot: Robot) -> None:
        """Resolve names, and take the present state as the target if none was given; see `Motion.bind`.

        The rows of a task without `observe` are then evaluated once, so that mistakes show before the first tick.
        """
        super().bind(robot)
        self._use_only(robot, self._only_joints)
        if self._target.open:
            self._target.value = self._target.present = self.present(robot)

    def keeps(self) -> Sequence[object]:
        """Return the contact objects that must not be removed before the task."""
        return ()

    def let_go(self) -> None:  # noqa: B027 (optional)
        """Undo the changes that the task has made to other objects; called when the task is removed."""

    def observe(self, measurement: Measurement, dt: float) -> None:  # noqa: B027 (optional)
        """Read the sensors, at every tick of dt, s, before the rows are written; for subclasses to override."""

    def unobserved(self, dt: float) -> None:
        """Go on in a tick of dt, s, whose `Controller.solve` gets no measurement, or refuse by an `InputError`."""
        raise InputError(
            f"task '{self.name}' reads sensors: give the measurement of the tick, controller.solve(measurement)"
        )

    def _use_only(self, robot: Robot, joints: Sequence[str] | None) -> None:
        """Leave all coordinates but those of some joints out; they are expected not to accelerate."""
        self._unused = other_columns(robot, joints)
        self._leave_out()

    @property
    def spared(self) -> NDArray[np.intp]:
        """Velocity coordinates whose motion the task expects but does not use, shape (n,); empty at first.

        For the centre of mass they are, for example, those of an arm that has a task of its own; for a hand, those of
        the body that carries the hand. Assigning them sets their expected accelerations to zero. Joints that the option
        `joints` leaves out are taken into account as well, with an expected acceleration of zero.
        """
        return self._spared

    @spared.setter
    def spared(self, value: NDArray[np.intp]) -> None:
        array = np.asarray(value)
        if array.ndim != 1 or (array.size and (array.dtype.kind not in "iu" or array.min() < 0)):
            raise InputError(
                f"spared of task '{self.name}' must be numbers of velocity coordinates, shape (n,), got {shown(value)}"
            )
        self._spared = array.astype(np.intp, copy=False)
        self._leave_out()

    @property
    def spared_acceleration(self) -> Array:
        """Expected accelerations of the coordinates in `spared`, shape (n,)."""
        return self._expected[: self._spared.size]

    @spared_acceleration.setter
    def spared_acceleration(self, value: Array) -> None:
        self._expected[: self._spared.size] = value

    def _leave_out(self) -> None:
        """Note the coordinates that the rows leave out, spared ones first, with accelerations of zero."""
        columns = np.concatenate([self._spared, np.setdiff1d(self._unused, self._spared)])
        self._left_out, self._expected = columns if columns.size else None, np.zeros(columns.size)
        self.revision += 1

    def _resize(self, dim: int) -> None:
        """Change the number of rows before the task is attached, keeping uniform gains."""
        old, self._rows = self._rows, Rows.zeros(dim)
        self.dim = self._n_rows = dim
        self._weight, self._scale = np.resize(self._weight, dim), np.resize(self._scale, dim)
        for field in ("weight", "stiffness", "damping", "rate", "bound"):
            values = getattr(old, field)
            if values.size != dim and not (values == values[0]).all():
                raise InputError(f"{field} of task '{self.name}' must be a scalar or have shape ({dim},)")
            getattr(self._rows, field)[:] = values if values.size == dim else values[0]

    def __repr__(self) -> str:
        return f"{type(self).__name__}('{self.name}', dim={self.dim}{', hard' if self.hard else ''})"


class SelectionTask(Task):
    """Base of tasks whose rows select single coordinates: they only change the diagonal of the QP's cost.

    `evaluate` fills only the error. Each row has its own error bound.

    Attributes:
        columns: Velocity coordinates of the rows, distinct, shape (dim,) or a slice; `bind` sets them.
    """

    __slots__ = ()
    columns: slice | NDArray[np.intp]

    def saturate(self, error: Array) -> None:
        """Clip each component of an error, shape (dim,), `unit`, to its bound."""
        bound = self._rows.bound
        np.minimum(np.maximum(error, -bound, out=error), bound, out=error)

    def _sizes(self, rows: Array) -> list[float]:
        """Greatest component of some rows."""
        return [float(abs(rows).max())]


class VariableTask(Task):
    """Base of tasks on torques and wrenches: rows over all variables x of the QP, matrix · x = reference.

    `evaluate` fills the matrix, shape (dim, number of variables), in place of the Jacobian, and the reference, shape
    (dim,), in place of the error.
    """

    __slots__ = ()

    @property
    def residual_unit(self) -> str:
        """Unit of the residual: that of the variables."""
        return self.unit

    def bind_problem(self, problem: Problem) -> None:  # noqa: B027 (optional)
        """Look up contacts or torque rows; called after each change of the QP's layout.

        A task whose contact is not in the QP raises an `UnknownNameError`; it has no effect until the contact is added.
        """

    def waits_for(self) -> object | None:
        """Return the contact of the task if it may be added after the task; None otherwise."""
        return None


@contextmanager
def guarded(task: Task) -> Iterator[None]:
    """Make an `InputError` of whatever a task of one's own raises."""
    try:
        yield
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
    with guarded(task):
        Block(task, slice(0, task.dim), jacobian, error, drift).fill()
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
