"""Base of tasks: rows of a least-squares objective, or of a hard constraint, over the variables of the QP.

A task gives its Jacobian, its error and its drift at the present state, and keeps its target, weight, gains and
feed-forward. `wbc.core.qp.store` puts the rows of all tasks into one QP, whose reference acceleration is

    reference = feed-forward acceleration + stiffness · error
                + damping · (feed-forward velocity − Jacobian · v) − drift,

and whose cost is ½ Σ weight · (Jacobian · acceleration − reference)². An error beyond its bound is shortened to the
bound, so that a distant target does not cause a larger acceleration.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal, NoReturn, Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbc.base.checked import checked as checked_arguments
from wbc.base.errors import InputError, unknown_name
from wbc.base.numbers import Array, finite_array, one_or_each, read_only
from wbc.core.frames import FixedPose
from wbc.core.qp.motion import RATE, Motion, RowNumbers
from wbc.core.qp.move import USUAL_SPEED, Coordinates, Move, coordinates
from wbc.core.qp.options import Choice, MotionOptions
from wbc.core.qp.solving.problem import Problem
from wbc.core.robot import Reads, Robot
from wbc.core.signals import Measurement
from wbc.core.trajectories import Duration

Drives = Literal["torque", "position"]
"""Kind of the commands to the drives; "torque" for hybrid control as well."""

ERROR_BOUNDS = {"m": 0.1, "rad": 1.0}
"""Unit → default bound of each component of an error, far above the errors of a followed motion; others have none."""

NEAR = {"m": 0.01, "rad": 0.05}
"""Unit → error within which a task has reached its target."""

SLOW = {"m": 0.05, "rad": 0.2}
"""Unit → speed below which a task has reached its target, per second."""


class Task(Motion):
    """Base of all tasks: rows over the generalised accelerations.

    The rows of a `SelectionTask` select single coordinates; those of a `VariableTask` are over all variables of the QP.

    Derive a task of your own from this class. Its `evaluate` fills the rows, and its `bind` looks names up. By default
    the target is one number for each axis; for a target of another type override `present`, which returns the target at
    which the error is zero, and `checked`, which checks a new target.

    Attributes:
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
        "_choice", "_hard", "_held_by", "_move", "_present", "_scale", "_settled", "_target", "_weighed", "_weight",
        "dim", "idle",
    )  # fmt: skip

    usual: ClassVar[MotionOptions] = {}
    kinematic_weight: ClassVar[float | None] = None
    of_velocity: ClassVar[bool] = False
    reads: ClassVar[Reads] = "all"
    drives: Drives | None = None
    unit: ClassVar[str] = "m"
    _choice: Choice
    _held_by: str | None
    _over_joints: ClassVar[bool] = True  # of which some can be chosen

    def __init__(self, name: str, rows: int | Sequence[str], /, **options: Unpack[MotionOptions]) -> None:
        """Describe the task; gains can be changed at any time.

        Args:
            name: Default name, for options without a name.
            rows: Number of rows, at least 1, or the names of the rows in order, from which the option `axes` can
                choose.
            **options: See `MotionOptions`. The weight is 1 and the stiffness 0 unless they or `usual` have others.
        """
        given: dict[str, Any] = {**self.usual, **options}
        named = given.pop("name", None)
        name = name if named is None else named
        axes = None if isinstance(rows, int) else given.pop("axes", None)
        joints = given.pop("joints", None) if self._over_joints else None
        self._choice = Choice(name, rows, axes, joints)
        self.dim = self._choice.dim
        # The target is the present state, and the same object, where none was given, until a controller has the task.
        self._target: Any = None
        self._present: Any = None
        self._move: Move | None = None
        self._settled, self._held_by = False, None
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
    @checked_arguments
    def hard(self, value: bool) -> None:
        if value == self._hard:
            return
        if self.owner is not None:
            raise InputError(
                f"task '{self.name}' is in a controller, where hard is fixed: remove it, assign hard, and add it again"
            )
        self._hard = value
        self._act()

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
        np.multiply(self._weight, self._scale, out=self._numbers.weight)
        self.revision += 1
        self.idle = not (self._hard or self._numbers.weight.any())

    def _used_joints(self, robot: Robot) -> Sequence[str] | None:
        """Return the joints that the task may use; None for all."""
        return self._choice.joints

    @property
    def spared(self) -> NDArray[np.intp]:
        """Velocity coordinates whose motion the task expects but does not use, shape (n,), read-only; empty at first.

        For the centre of mass they are, for example, those of an arm that has a task of its own; for a hand, those of
        the body that carries the hand. Assigning them sets their expected accelerations to zero. Joints that the option
        `joints` leaves out are taken into account as well, with an expected acceleration of zero.
        """
        return self._choice.spared

    @spared.setter
    def spared(self, value: NDArray[np.intp]) -> None:
        if np.size(value) and not self._over_joints:
            raise InputError(
                f"the rows of task '{self.name}' are not over joints of which it could spare some"
            )
        self._choice.spare(self.name, value)
        self.revision += 1

    @property
    def spared_acceleration(self) -> Array:
        """Expected accelerations of the coordinates in `spared`, shape (n,), read-only; assign an array."""
        return read_only(self._choice.expected[: self._choice.spared.size])

    @spared_acceleration.setter
    def spared_acceleration(self, value: Array) -> None:
        expected = self._choice.expected[: self._choice.spared.size]
        expected[:] = finite_array(f"spared_acceleration of task '{self.name}'", value, expected.shape)

    def _critical_damping(self, stiffness: Array) -> Array:
        """Return none for a task on a velocity, whose error decays with its stiffness alone; see `Motion`."""
        return 0.0 * stiffness if self.of_velocity else super()._critical_damping(stiffness)

    @property
    def error_bound(self) -> Array:
        """Bound of each component of the error, `unit`, shape (dim,), read-only; assign one, or inf for no bound."""
        return read_only(self._numbers.bound)

    @error_bound.setter
    def error_bound(self, value: ArrayLike) -> None:
        what = f"error_bound of task '{self.name}' ({self.unit})"
        self._numbers.bound[:] = one_or_each(what, value, self.dim, above=0.0, unbounded=True)
        self.revision += 1

    def _usual_bound(self) -> ArrayLike:
        """Bound of the error of a task that is given none, `unit`, scalar or shape (dim,)."""
        bound = np.full(self.dim, np.inf)
        for unit, part in self._parts():
            bound[part] = ERROR_BOUNDS.get(unit, np.inf)
        return bound

    def _parts(self) -> list[tuple[str, Any]]:
        """Unit and rows of each part of the error that is one vector."""
        units, linear = self.unit.split("|"), self._choice.n_linear
        if linear is None:
            return [(self.unit, slice(0, self.dim))]
        parts = ((units[0], slice(0, linear)), (units[-1], slice(linear, self.dim)))
        return [(unit, part) for unit, part in parts if part.stop > part.start]

    def saturate(self, error: Array) -> None:
        """Shorten an error, shape (dim,), `unit`, to its bound, without a change of its direction.

        The parts of position and rotation are shortened separately.
        """
        bound = self._numbers.bound
        for _, part in self._parts():
            over = float((abs(error[part]) / bound[part]).max())
            if over > 1.0:
                error[part] /= over

    @property
    def error(self) -> Array:
        """Error at the last tick, target − measured, shape (dim,), `unit`; a copy. Zero before the first one."""
        return np.zeros(self.dim) if self.owner is None else np.asarray(self.owner._assembly.error_of(self))

    @property
    def residual_unit(self) -> str:
        """Unit of the residual: that of an acceleration of the error."""
        return "|".join(f"{unit}/s²" for unit in self.unit.split("|"))

    @property
    def velocity(self) -> Array:
        """Present velocity of the rows, shape (dim,), `unit`/s."""
        return np.asarray(self.evaluated()[0] @ self.robot.v)

    @property
    def speed(self) -> float:
        """Present speed, `unit`/s: the largest of those of position, rotation and joints."""
        return max(size for *_, size in self.sizes(self.velocity))

    @property
    def reached(self) -> bool:
        """True if no move goes on and the robot is at the target: within 10 mm and 0.05 rad, below 0.05 m/s, 0.2 rad/s.

        An error in any other unit counts by the numbers for metres; a task for which these are wrong overrides this.
        `held_back_by` says why a task is not reached.
        The robot is that of the controller: in position control with open feedback it is the commanded robot.
        """
        if self.moving:
            return False
        jacobian, error, _ = self.evaluated()
        near = all(size <= NEAR.get(unit, NEAR["m"]) for unit, _, size in self.sizes(error))
        velocity = jacobian @ self.robot.v
        return near and all(size <= SLOW.get(unit, SLOW["m"]) for unit, _, size in self.sizes(velocity))

    @property
    def held_back_by(self) -> tuple[str, ...]:
        """Names of the tasks and limits that held the task off its target in the last tick, the strongest first.

        Empty if nothing did: then the robot is at the target or on its way. "contacts and hard tasks" stand for what
        must not move, "the reach of the robot" for a target that no joint brings nearer. Slow, not for the tick.
        """
        return () if self.owner is None else self.owner.held_back().get(self.name, ())

    # ---- target -------------------------------------------------------------------------------------------------

    @property
    def held_by(self) -> str | None:
        """Name of what to use instead, where another part sets the target at every tick; None where it is free."""
        return self._held_by

    @held_by.setter
    @checked_arguments
    def held_by(self, value: str | None) -> None:
        self._held_by = value

    def present(self, robot: Robot) -> Any:
        """Return the target at which the present error is zero, as a copy; zero unless a task says otherwise."""
        return np.zeros(self._choice.n_rows)

    def checked(self, value: Any) -> Any:
        """Return a target after a check, as a copy: a number for each of all axes unless a task says otherwise."""
        return finite_array(f"target of task '{self.name}' ({self.unit})", value, (self._choice.n_rows,))

    @property
    def target(self) -> Any:
        """Target, in the form and unit of the constructor, read-only; assign one, or see `move_to`."""
        target = self._target
        if target is None:
            target = self.present(self.robot)
        return FixedPose(target) if isinstance(target, pin.SE3) else read_only(target)

    @target.setter
    def target(self, value: Any) -> None:
        target = self.checked(value)
        self._take_over()
        self._target = target

    def follow(self, target: Any, velocity: Array | None = None, acceleration: Array | None = None) -> None:
        """Set target and feed-forwards for one tick, unchecked: for a controller that makes them itself.

        Args:
            target: The target; kept, not copied.
            velocity: Its velocity along the task's axes, shape (dim,), `unit`/s; unchanged when None.
            acceleration: Its acceleration along them, shape (dim,), `unit`/s²; unchanged when None.
        """
        self._target = target
        self._feed(velocity, acceleration)

    def _feed(self, velocity: ArrayLike | None, acceleration: ArrayLike | None) -> None:
        """Take the rates of the target over, each of shape (dim,); None leaves one as it is."""
        rates, self._fed = self._feedforward(), True
        if velocity is not None:
            rates[0][:] = velocity
        if acceleration is not None:
            rates[1][:] = acceleration

    @property
    def feedforward_velocity(self) -> Array:
        """Velocity of the target, shape (dim,), `unit`/s, read-only."""
        return read_only(self._feedforward()[0])

    @feedforward_velocity.setter
    def feedforward_velocity(self, value: ArrayLike) -> None:
        velocity = finite_array(f"feed-forward velocity of task '{self.name}'", value, (self.dim,))
        self._take_over()
        self._feed(velocity, None)

    @property
    def feedforward_acceleration(self) -> Array:
        """Acceleration of the target, shape (dim,), `unit`/s², read-only."""
        return read_only(self._feedforward()[1])

    @feedforward_acceleration.setter
    def feedforward_acceleration(self, value: ArrayLike) -> None:
        acceleration = finite_array(f"feed-forward acceleration of task '{self.name}'", value, (self.dim,))
        self._take_over()
        self._feed(None, acceleration)

    def _feedforward(self) -> tuple[Array, Array]:
        """Return the arrays of velocity and acceleration of the target, each of shape (dim,)."""
        return self._numbers.velocity, self._numbers.acceleration

    def _take_over(self) -> None:
        """End a move, or refuse a target that another part sets."""
        if self._held_by is not None:
            raise InputError(
                f"the target of task '{self.name}' is set at every tick by another part: use {self._held_by}"
            )
        self._stop()

    @checked_arguments
    def move_to(
        self,
        target: Any,
        *,
        duration: Duration | None = None,
        speed: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
    ) -> None:
        """Move the target to another one on a minimum jerk trajectory, from the next tick on.

        A move goes on from where the target is, with the velocity of a move that it replaces, and at rest otherwise.
        It sets target, feed-forward velocity and acceleration at every tick. Whatever is assigned to one of these ends
        it. The same order once more, as from a program that gives it at every tick, changes nothing.

        Args:
            target: As it is assigned to `target`.
            duration: s; the least within the limits when None.
            speed: Greatest speed of the target, `unit`/s; for a pose a pair (linear, angular), for joints that of each.
                0.2 m/s and 1 rad/s when None and no duration is given.
            acceleration: Greatest acceleration, `unit`/s², as `speed`; reaches that speed in 0.2 s when None and no
                duration is given.
        """
        self.move_through([target], duration=duration, speed=speed, acceleration=acceleration)

    @checked_arguments
    def move_through(
        self,
        targets: Sequence[Any],
        *,
        duration: Duration | None = None,
        speed: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
    ) -> None:
        """Move the target through others, without a stop, to rest at the last after `duration`; see `move_to`.

        Rotations, and directions, move along rotation vectors from the present one. It is an `InputError` if they turn
        by more than half a turn between two of the targets.
        """
        if self.owner is None:
            raise InputError(f"task '{self.name}' can move its target once a controller has it: add it first")
        if not isinstance(targets, (Sequence, np.ndarray)) or len(targets) == 0:
            raise InputError(f"task '{self.name}' moves through one or more targets, got {targets!r}")
        if self._held_by is not None:
            self._take_over()
        if duration is None and speed is None:
            speed = self._usual_speed()
        limits = {"duration": duration, "speed": speed, "acceleration": acceleration}
        rates: tuple[Array | None, Array | None] = (None, None)
        if self._move is not None:
            if self._move.is_of(targets, limits):
                return
            now = self._move.now()  # to where the target is at the next tick
            self._put(*now)
            rates = now[1:]
        self._move = Move(self._coordinates(), targets, rates, **limits)

    def _usual_speed(self) -> ArrayLike | None:
        """Return the greatest speed of a target where none is given, of each part of its coordinates."""
        usual = [USUAL_SPEED[unit] for unit in self.unit.split("|") if unit in USUAL_SPEED]
        return usual[0] if len(usual) == 1 else usual or None

    def _coordinates(self) -> Coordinates:
        """Return coordinates of targets, from the present one on."""
        return coordinates(self.target, self.checked)

    def _put(self, target: Any, velocity: Array, acceleration: Array) -> None:
        """Set the target of one tick of a move, and its rates along all axes."""
        self.follow(
            target, np.asarray(velocity)[self._choice.keep], np.asarray(acceleration)[self._choice.keep]
        )

    @property
    def moving(self) -> bool:
        """True while the target moves; a move of a task that no controller has waits for one."""
        return self._move is not None and self.owner is not None

    def move_on(self, dt: float) -> None:
        """Move a target that is on its way on by one tick of dt, s."""
        move = self._move
        if move is not None:
            self._put(*move.now())
            if not move.advance(dt):
                self._move = None

    def _stop(self) -> None:
        """End a move, if there is one, where the target is."""
        move = self._move
        if move is not None:
            still = np.zeros(move.coordinates.start.size)
            self._move = None
            self._put(self.target, still, still)

    # ---- what a controller calls ----------------------------------------------------------------------------------

    def reset(self) -> None:
        """Reset internal state, such as the offset of a compliance task, and end a move; targets do not change."""
        self._stop()

    def bind(self, robot: Robot) -> None:
        """Resolve names, and take the present state as the target if none was given; see `Motion.bind`.

        The rows of a task without `observe` are then evaluated once, so that mistakes show before the first tick.
        """
        super().bind(robot)
        self._choice.bind(robot, self._used_joints(robot))
        self.revision += 1
        if self._target is self._present and not self._settled:
            self._target = self._present = self.present(robot)

    def keeps(self) -> Sequence[object]:
        """Return the contact objects that must not be removed before the task."""
        return ()

    def let_go(self) -> None:  # noqa: B027 (optional)
        """Undo the changes that the task has made to other objects; called when the task is removed."""

    @property
    def listens(self) -> bool:
        """True for a task that reads the sensors: it has an `observe` of its own."""
        return getattr(self.observe, "__func__", None) is not Task.observe

    def observe(self, measurement: Measurement, dt: float) -> None:  # noqa: B027 (optional)
        """Read the sensors, at every tick of dt, s, before the rows are written; for subclasses to override."""

    def unobserved(self, dt: float) -> None:
        """Go on in a tick of dt, s, whose `Controller.solve` gets no measurement, or refuse by an `InputError`."""
        raise InputError(
            f"task '{self.name}' reads sensors: give the measurement of the tick, controller.solve(measurement)"
        )

    def _resize(self, dim: int) -> None:
        """Change the number of rows of a task without a choice of axes, whose numbers are the same for all rows."""
        if dim == self.dim:
            return
        values = self._numbers.values
        if (values != values[:, :1]).any():
            raise InputError(
                f"gains and weights of task '{self.name}' must be scalars or have shape ({dim},)"
            )
        self._numbers = RowNumbers(np.repeat(values[:, :1], dim, axis=1))
        self._weight, self._scale = np.resize(self._weight, dim), np.resize(self._scale, dim)
        self.dim = self._choice.dim = self._choice.n_rows = dim

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
    _over_joints = False

    def _unfilled(self) -> Array:
        return np.eye(self.robot.nv)[self.columns]

    def saturate(self, error: Array) -> None:
        """Clip each component of an error, shape (dim,), `unit`, to its bound."""
        bound = self._numbers.bound
        np.minimum(np.maximum(error, -bound, out=error), bound, out=error)

    def sizes(self, rows: Array) -> list[tuple[str, Any, float]]:
        """Return unit, place and greatest component of each part of some rows, shape (dim,)."""
        return [(unit, part, float(abs(rows[part]).max())) for unit, part in self._parts()]


class VariableTask(Task):
    """Base of tasks on torques and wrenches: rows over all variables x of the QP, matrix · x = reference.

    `evaluate` fills the matrix, shape (dim, number of variables), in place of the Jacobian, and the reference, shape
    (dim,), in place of the error.
    """

    __slots__ = ()
    _over_joints = False

    @property
    def residual_unit(self) -> str:
        """Unit of the residual: that of the variables."""
        return self.unit

    def evaluated(self) -> NoReturn:
        """Refuse: the rows are not over accelerations."""
        raise InputError(f"task '{self.name}' is on variables of the QP: it has neither error nor speed")

    def try_on(self, problem: Problem) -> None:
        """Evaluate the rows once over the variables of a problem, so that mistakes show before the first tick."""
        self.bind_problem(problem)
        with self._guarded():
            self.evaluate(np.zeros((self.dim, problem.diagonal.size)), np.zeros(self.dim), np.zeros((0, 0)))

    def bind_problem(self, problem: Problem) -> None:  # noqa: B027 (optional)
        """Look up contacts or torque rows; called after each change of the QP's layout.

        A task whose contact is not in the QP raises an `UnknownNameError`; it has no effect until the contact is added.
        """

    def waits_for(self) -> object | None:
        """Return the contact of the task if it may be added after the task; None otherwise."""
        return None
