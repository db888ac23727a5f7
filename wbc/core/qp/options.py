"""Options of tasks and contacts, and the choice of a task: which rows the QP gets, over which coordinates."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from types import EllipsisType
from typing import Annotated, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.base.errors import InputError, choose, names_in, shown
from wbc.base.numbers import Array, finite_scalar
from wbc.base.settings import NonNegative, Positive
from wbc.core.robot import Robot

POSITION_AXES = ("x", "y", "z")
ROTATION_AXES = ("roll", "pitch", "yaw")
POSE_AXES = (*POSITION_AXES, *ROTATION_AXES)

BASE = "base"
"""Name of the six coordinates of the floating base in a choice of joints."""


class TaskOptions(TypedDict, total=False):
    """Options of all tasks.

    An unknown option raises an `UnknownNameError`, and a value out of range an `InputError`.

    Attributes:
        name: Name in status tables and solutions, unique within a controller; when None, it is made from the class and
            the frame or contact.
        weight: Cost per squared residual unit, scalar or shape (dim,), ≥ 0; its default depends on the task. It is
            without effect on a hard task.
        hard: Make the rows a constraint instead of a cost; False by default.
    """

    name: str | None
    weight: ArrayLike
    hard: bool


class GainOptions(TaskOptions, total=False):
    """Options of tasks with an error: those of all tasks, and gains.

    Attributes:
        stiffness: Acceleration per error, 1/s², scalar or shape (dim,), ≥ 0; its default depends on the task.
        damping: Acceleration per velocity error, 1/s, scalar or shape (dim,), ≥ 0; critical, 2·√stiffness, when None,
            the default.
        rate: Velocity per error in inverse kinematics, 1/s, scalar or shape (dim,), ≥ 0; 10 by default. Inverse
            kinematics does not use stiffness and damping.
        error_bound: Largest component of the error, in its unit (m, rad), scalar or shape (dim,), > 0; by default 0.1 m
            (for the centre of mass 0.3 m) and 1 rad, `math.inf` for no bound. A longer error
            is shortened to the bound, in its own direction, so that a distant target does not cause a larger
            acceleration.
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


class ContactOptions(TypedDict, total=False):
    """Options of all contacts.

    Attributes:
        min_force: Smallest normal force while active, N; by default 10 N for a sole, less for a light robot
            (`Robot.force_scale`), and zero for other contacts.
        max_force: Greatest normal force, N; four times the robot's weight (with its load) when None, the default.
        ramp: Time of the force ramp when the contact is switched, s; 0.1 by default. Switched on, the greatest force
            grows from zero; switched off, it decays from what the contact has carried in the last tick.
        stiffness: Pull back to where the contact was made, 1/s²; 100 by default.
        damping: Damping of contact velocity, 1/s; critical when None, the default.
        rate: Velocity per error in inverse kinematics, 1/s: pull back to where the contact was made; 10 by default.
        wrench_weight: Cost per N² and (Nm)² of the force variables, scalar or shape (dim,), above zero;
            by default 1e-6 for the normal force of a sole, 1e-3 for its moments, 1e-8 for a fixed contact or a loop
            closure, and 1e-5 for other forces.
        active: Start active, with full load allowed; True by default.
        motion_weight: Cost of the contact's motion per (m/s²)² and (rad/s²)², scalar or shape (dim,): the contact may
            then give way, on ground of unknown shape, and can make no QP infeasible. None, the default: the contact
            does not move, which is a constraint.
    """

    min_force: Annotated[NonNegative, "N"]
    max_force: Annotated[Positive, "N"] | None
    ramp: Annotated[NonNegative, "s"]
    stiffness: Annotated[NonNegative, "1/s²"]
    damping: Annotated[NonNegative, "1/s"] | None
    rate: Annotated[NonNegative, "1/s"]
    wrench_weight: ArrayLike
    active: bool
    motion_weight: ArrayLike | None


def joint_columns(robot: Robot, joints: Iterable[str]) -> NDArray[np.intp]:
    """Return the velocity coordinates of joints; `UnknownNameError` if the robot has no such joint."""
    return np.array([robot.base_dof + robot.joint_index(joint) for joint in joints], dtype=np.intp)


def distinct_joints(joints: str | Sequence[str]) -> list[str]:
    """Return the names as a list, a single name as a list of one; `InputError` for none at all, or one twice."""
    chosen = names_in("joints", joints)
    if not chosen or len(set(chosen)) != len(chosen):
        raise InputError(f"joints must be distinct, at least one; got {chosen}")
    return chosen


class Choice:
    """Part of a task's rows that the QP gets: the chosen ones of all axes, over all coordinates but those left out.

    Coordinates that are left out accelerate as they are expected to, whatever the QP chooses.

    Attributes:
        dim: Number of chosen rows.
        n_rows: Number of all rows.
        keep: The chosen ones of all rows; an ellipsis for all.
        n_linear: Number of chosen rows that are of a position, before those of a rotation; None for rows without names.
        joints: Names of the joints that the task may use; None for all.
        left_out: Velocity coordinates that are left out: `spared` ones, then those of other joints; None for none.
        expected: Their accelerations, shape of `left_out`.
        spared: Velocity coordinates that are left out beside those of other joints, shape (n,), read-only.
    """

    __slots__ = ("_unused", "dim", "expected", "joints", "keep", "left_out", "n_linear", "n_rows", "spared")

    def __init__(
        self,
        task: str,
        rows: int | Sequence[str],
        axes: str | Sequence[str] | None,
        joints: str | Sequence[str] | None,
    ) -> None:
        """Choose from the rows of a task, their number or their names; None for all axes, or all joints."""
        self.keep: slice | NDArray[np.intp] | EllipsisType = ...
        self.n_linear: int | None = None
        if isinstance(rows, int):
            self.dim = self.n_rows = int(finite_scalar(f"number of rows of task '{task}'", rows, low=1))
        else:
            chosen = names_in(f"axes of task '{task}'", rows if axes is None else axes)
            if not chosen or len(set(chosen)) != len(chosen):
                raise InputError(
                    f"task '{task}' needs axes out of {', '.join(rows)}, each once; got {chosen}"
                )
            for axis in chosen:
                choose(f"axis for task '{task}'", axis, rows)
            kept = np.array([list(rows).index(axis) for axis in chosen])
            if (np.diff(kept) < 0).any():
                raise InputError(
                    f"task '{task}' has its rows in the order {', '.join(rows)}; give the axes so, as "
                    f"{tuple(axis for axis in rows if axis in chosen)}, not {tuple(chosen)}"
                )
            self.dim, self.n_rows = kept.size, len(rows)
            self.n_linear = sum(axis in POSITION_AXES for axis in chosen)
            if self.dim < self.n_rows:
                first, last = int(kept[0]), int(kept[-1])
                self.keep = slice(first, last + 1) if last - first < self.dim else kept
        self.joints = None if joints is None else distinct_joints(joints)
        self.spared = self._unused = np.zeros(0, dtype=np.intp)
        self.left_out: NDArray[np.intp] | None = None
        self.expected = np.zeros(0)

    def bind(self, robot: Robot, joints: Sequence[str] | None) -> None:
        """Leave all coordinates but those of some joints out, which are the chosen ones unless a task has others.

        The floating base is left out, too, unless "base" is among the joints; with None nothing is.
        """
        self._unused = np.zeros(0, dtype=np.intp)
        if joints is not None:
            used = joint_columns(robot, [joint for joint in joints if joint != BASE])
            base = np.arange(robot.base_dof if BASE in joints else 0)
            self._unused = np.setdiff1d(np.arange(robot.nv), np.concatenate([base, used]))
        self._leave_out()

    def spare(self, task: str, value: NDArray[np.intp]) -> None:
        """Leave other coordinates out than so far, after a check."""
        array = np.asarray(value)
        if array.ndim != 1 or (array.size and (array.dtype.kind not in "iu" or array.min() < 0)):
            raise InputError(
                f"spared of task '{task}' must be numbers of velocity coordinates, shape (n,), got {shown(value)}"
            )
        self.spared = array.astype(np.intp)
        self.spared.setflags(write=False)
        self._leave_out()

    def _leave_out(self) -> None:
        columns = np.concatenate([self.spared, np.setdiff1d(self._unused, self.spared)])
        self.left_out, self.expected = columns if columns.size else None, np.zeros(columns.size)

    @property
    def trims(self) -> bool:
        """True if the QP does not get all rows over all coordinates."""
        return self.keep is not ... or self.left_out is not None

    def trim(self, rows: Sequence[Array], full: Sequence[Array], damping: Array, v: Array) -> None:
        """Fill rows of chosen axes from those of all axes, and leave coordinates out.

        Args:
            rows: Jacobian, error and, of the second order, drift, to fill.
            full: The same of all axes; the very `rows` where all axes are chosen.
            damping: Damping of the rows, 1/s; the velocities of coordinates that are left out are damped, too.
            v: Velocity of the robot, shape (nv,).
        """
        if self.keep is not ...:
            for part, every in zip(rows, full, strict=True):
                part[:] = every[self.keep]
        if self.left_out is not None:
            jacobian = rows[0]
            moved = jacobian[:, self.left_out]
            if len(rows) == 3:
                rows[2][:] += moved.dot(self.expected)
                rows[2][:] += damping * moved.dot(v[self.left_out])
            jacobian[:, self.left_out] = 0.0
