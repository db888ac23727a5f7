"""Base of motion tasks with a target: a point, a rotation or a pose, that is assigned, moved, or set at every tick."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbc.core.errors import Array, finite_array
from wbc.core.qp.task import ERROR_BOUNDS, MotionTask, read_only
from wbc.core.robot import Robot
from wbc.tasks.motion.axes import axis_mask, distinct_joints, other_columns
from wbc.tasks.motion.moving import Course, MovingTask
from wbc.tasks.options import MotionOptions

T = TypeVar("T", bound=Any)
"""Kind of the target: an array, or a pose."""


class TargetTask(MovingTask, MotionTask, Generic[T]):
    """Base of motion tasks with a target, and a choice of axes and joints.

    A kind of task states what its target is at present, and how one is checked. Points are the targets here;
    `_checked`, `_present` and `_course_of` are what other kinds replace.

    Attributes:
        spared_acceleration: Accelerations of the coordinates in `spared` as they are expected, shape (n,).
    """

    _target: T | None = None
    _taken = False  # the target is what was present when the task was bound
    _course_of: ClassVar[Any] = Course

    def __init__(self, name: str, choices: Sequence[str], options: MotionOptions) -> None:
        """Describe the task: its name where the options give none, its axes in the order of the rows, and its options.

        Raises `UnknownNameError` for an unknown option or axis, `InputError` for an axis twice or out of order, or a
        gain out of range.
        """
        gains: dict[str, Any] = {**options}
        name = gains.pop("name", None) or name
        mask = axis_mask(name, gains.pop("axes", choices), choices)
        self._keep = None if mask.all() else np.flatnonzero(mask)
        self._linear_rows = int(mask[:3].sum())
        joints = gains.pop("joints", None)
        self._only_joints = None if joints is None else distinct_joints(joints)
        super().__init__(name, int(mask.sum()), **gains)
        self.spared = np.zeros(0, dtype=np.intp)

    @property
    def spared(self) -> NDArray[np.intp]:
        """Velocity coordinates whose motion counts but that the task does not use, shape (n,); none until they are set.

        They are, for the centre of mass, those of an arm with a task of its own, and for a hand those of the body that
        carries it. Assigning them sets their expected accelerations to zero. The motion of joints that the option
        `joints` leaves out counts as well, with no acceleration expected.
        """
        return self._spared

    @spared.setter
    def spared(self, value: NDArray[np.intp]) -> None:
        self._spared = value
        self.spared_acceleration = np.zeros(len(value))

    @property
    def target(self) -> T:
        """Target, in the form and unit of the constructor, read-only or a copy; assign one, or see `move_to`."""
        target: Any = self._present(self.robot) if self._target is None else self._target
        shown: Any = target.copy() if isinstance(target, pin.SE3) else read_only(target)
        return shown  # type: ignore[no-any-return]

    @target.setter
    def target(self, value: Any) -> None:
        target = self._checked(value)
        if self._held:
            self._take_over()
        self._taken = False
        self._store(target)

    def follow(self, target: T, velocity: Array | None = None, acceleration: Array | None = None) -> None:
        """Set target and feed-forwards for one tick, unchecked: for a controller that makes them itself.

        Args:
            target: The target; kept, not copied.
            velocity: Its velocity along the task's axes, shape (dim,), `unit`/s; unchanged when None.
            acceleration: Its acceleration along them, shape (dim,), `unit`/s²; unchanged when None.
        """
        self._store(target)
        if velocity is not None:
            self._rows.velocity[:] = velocity
        if acceleration is not None:
            self._rows.acceleration[:] = acceleration

    def bind(self, robot: Robot) -> None:
        """Resolve names, and take what is at present as target when none was given; see `Task.bind`.

        Raises:
            UnknownNameError: The robot has no such joint.
        """
        super().bind(robot)
        self._unused = other_columns(robot, self._only_joints)
        if self._target is None or (self._taken and not self.accepted):
            self._store(self._present(robot))
            self._taken = True

    def _store(self, target: T) -> None:
        self._target = target

    def _present(self, robot: Robot) -> T:
        """Return the target at which the present error is zero, as a copy."""
        raise NotImplementedError

    def _checked(self, value: Any) -> T:
        """Return a target after a check, as a copy."""
        point: Any = finite_array(f"target of task '{self.name}' (m)", value, (3,))
        return point  # type: ignore[no-any-return]

    def _course(self) -> Course:
        course: Course = self._course_of(self.target, self._checked)
        return course

    def _put(self, target: Any, velocity: Array, acceleration: Array) -> None:
        self._store(target)
        self._feed(np.asarray(velocity), np.asarray(acceleration))

    def _default_bound(self) -> ArrayLike:
        if "|" not in self.unit:
            return super()._default_bound()
        linear, angular = (ERROR_BOUNDS.get(unit, np.inf) for unit in self.unit.split("|"))
        return np.where(np.arange(self.dim) < self._linear_rows, linear, angular)

    def _vectors(self) -> Sequence[slice]:
        parts = (slice(0, self._linear_rows), slice(self._linear_rows, self.dim))
        return [part for part in parts if part.stop > part.start]

    def _units(self) -> Sequence[str]:
        units, linear = self.unit.split("|"), self._linear_rows
        return [units[0]] * (linear > 0) + [units[-1]] * (linear < self.dim)

    def _feed(self, velocity: Array, acceleration: Array) -> None:
        """Set the feed-forwards of the chosen axes from those of all."""
        keep = self._keep
        self._rows.velocity[:] = velocity if keep is None else velocity[keep]
        self._rows.acceleration[:] = acceleration if keep is None else acceleration[keep]

    def _write(self, rows: tuple[Array, Array, Array], values: tuple[Array, Array, Array]) -> None:
        """Write Jacobian, error and drift of all axes into the rows of the chosen ones."""
        (jacobian, error, drift), (full_jacobian, full_error, full_drift), keep = rows, values, self._keep
        if keep is None:
            jacobian[:], error[:], drift[:] = full_jacobian, full_error, full_drift
        else:
            jacobian[:], error[:], drift[:] = full_jacobian[keep], full_error[keep], full_drift[keep]
        if self._spared.size:
            drift += jacobian[:, self._spared].dot(self.spared_acceleration)
            self._leave_out(self._spared, jacobian, drift)
        if self._unused is not None:
            self._leave_out(self._unused, jacobian, drift)

    def _leave_out(self, coordinates: NDArray[np.intp], jacobian: Array, drift: Array) -> None:
        """Take coordinates out of the task; their velocities are damped as those of the others."""
        drift += self._rows.damping * jacobian[:, coordinates].dot(self.robot.v[coordinates])
        jacobian[:, coordinates] = 0.0
