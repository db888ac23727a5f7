"""Choice of axes and joints, shared by the tasks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.core.errors import Array, InputError, names_in, unknown_name
from wbc.core.qp.task import ERROR_BOUNDS, MotionTask
from wbc.core.robot import BASE_DOF, Robot
from wbc.tasks.motion.moving import MovingTask
from wbc.tasks.options import MotionOptions

POSITION_AXES = ("x", "y", "z")
ROTATION_AXES = ("roll", "pitch", "yaw")
POSE_AXES = (*POSITION_AXES, *ROTATION_AXES)

BASE = "base"
"""Name of the six coordinates of the floating base in a choice of joints."""


class AxesTask(MovingTask, MotionTask):
    """Base of motion tasks with a choice of axes and joints.

    Attributes:
        spared_acceleration: Accelerations of the coordinates in `spared` as they are expected, shape (n,).
    """

    def __init__(self, name: str, choices: Sequence[str], options: MotionOptions) -> None:
        """Describe the task.

        Args:
            name: Name of the task where the options give none.
            choices: Axes to choose from, in the order of the rows.
            options: Options, with the defaults of the task filled in.

        Raises:
            UnknownNameError: An unknown option or axis.
            InputError: An axis twice or out of order, or a gain out of range.
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

    def bind(self, robot: Robot) -> None:
        """Resolve the joints.

        Raises:
            UnknownNameError: The robot has no such joint.
        """
        super().bind(robot)
        self._unused = other_columns(robot, self._only_joints)

    def _default_bound(self) -> ArrayLike:
        if "|" not in self.unit:
            return super()._default_bound()
        linear, angular = (ERROR_BOUNDS.get(unit, np.inf) for unit in self.unit.split("|"))
        return np.where(np.arange(self.dim) < self._linear_rows, linear, angular)

    def _vectors(self) -> Sequence[slice]:
        parts = (slice(0, self._linear_rows), slice(self._linear_rows, self.dim))
        return [part for part in parts if part.stop > part.start]

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


def axis_mask(task: str, axes: Sequence[str], choices: Sequence[str]) -> NDArray[np.bool_]:
    """Return which of `choices` are in `axes`.

    Args:
        task: Name of the task, for the message.
        axes: Names of axes, each at most once, in the order of the choices.
        choices: Names allowed, in order.

    Returns:
        Mask of shape (len(choices),).

    Raises:
        InputError: No axis at all, one twice, or in another order.
        UnknownNameError: An axis that is not among the choices.
    """
    chosen = names_in(f"axes of task '{task}'", axes)
    if not chosen or len(set(chosen)) != len(chosen):
        raise InputError(f"task '{task}' needs axes out of {', '.join(choices)}, each once; got {chosen}")
    for axis in chosen:
        if axis not in choices:
            unknown_name(f"axis for task '{task}'", axis, choices)
    in_order = [axis for axis in choices if axis in chosen]
    if list(chosen) != in_order:
        raise InputError(
            f"task '{task}' has its rows in the order {', '.join(choices)}; give the axes so, as {tuple(in_order)}, "
            f"not {tuple(chosen)}"
        )
    return np.array([axis in chosen for axis in choices])


def joint_columns(robot: Robot, joints: Iterable[str]) -> NDArray[np.intp]:
    """Return the velocity coordinates of joints.

    Raises:
        UnknownNameError: The robot has no such joint.
    """
    return np.array([BASE_DOF + robot.joint_index(joint) for joint in joints], dtype=np.intp)


def other_columns(robot: Robot, joints: Sequence[str] | None) -> NDArray[np.intp] | None:
    """Return the velocity coordinates that a task limited to `joints` must not use; None when it may use all.

    The floating base counts as not selected unless "base" is among the joints: a task that may move only some
    joints may not move the base.

    Raises:
        UnknownNameError: The robot has no such joint.
    """
    if joints is None:
        return None
    used = joint_columns(robot, [joint for joint in joints if joint != BASE])
    if BASE in joints:
        used = np.concatenate([np.arange(BASE_DOF), used])
    return np.setdiff1d(np.arange(robot.nv), used)


def distinct_joints(joints: str | Sequence[str]) -> list[str]:
    """Return the names as a list; a single name counts as a list of one.

    Raises:
        InputError: No joint at all, or one twice.
    """
    chosen = names_in("joints", joints)
    if not chosen or len(set(chosen)) != len(chosen):
        raise InputError(f"joints must be distinct, at least one; got {chosen}")
    return chosen
