"""Choices of axes and joints, by name."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from wbc.base.errors import InputError, names_in, unknown_name
from wbc.core.robot import Robot

POSITION_AXES = ("x", "y", "z")
ROTATION_AXES = ("roll", "pitch", "yaw")
POSE_AXES = (*POSITION_AXES, *ROTATION_AXES)

BASE = "base"
"""Name of the six coordinates of the floating base in a choice of joints."""


def axis_mask(task: str, axes: Sequence[str], choices: Sequence[str]) -> NDArray[np.bool_]:
    """Return a mask of shape (len(choices),): which of `choices` are in `axes`, given once each in the same order."""
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
    """Return the velocity coordinates of joints; `UnknownNameError` if the robot has no such joint."""
    return np.array([robot.base_dof + robot.joint_index(joint) for joint in joints], dtype=np.intp)


def other_columns(robot: Robot, joints: Sequence[str] | None) -> NDArray[np.intp]:
    """Return the velocity coordinates that a task limited to `joints` must not use; none when it may use all.

    A task that may move only some joints may not move the floating base, unless "base" is among them.
    """
    if joints is None:
        return np.zeros(0, dtype=np.intp)
    used = joint_columns(robot, [joint for joint in joints if joint != BASE])
    if BASE in joints:
        used = np.concatenate([np.arange(robot.base_dof), used])
    return np.setdiff1d(np.arange(robot.nv), used)


def distinct_joints(joints: str | Sequence[str]) -> list[str]:
    """Return the names as a list, a single name as a list of one; `InputError` for none at all, or one twice."""
    chosen = names_in("joints", joints)
    if not chosen or len(set(chosen)) != len(chosen):
        raise InputError(f"joints must be distinct, at least one; got {chosen}")
    return chosen
