"""Options that tasks share, each stated once: name, weight, gains, axes and joints.

A task takes those of one of these classes as keywords: `**options: Unpack[MotionOptions]`. The class of a task states
its default weight and gains. An unknown option raises an `UnknownNameError`, a value out of range an `InputError`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypedDict

from numpy.typing import ArrayLike


class TaskOptions(TypedDict, total=False):
    """Options of all tasks.

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
        error_bound: Greatest component of the error that acts, in its unit (m, rad), scalar or shape (dim,), > 0: a
            longer error acts as one of this length in its direction, so that a target out of reach pulls no harder
            the further away it is. 0.1 m (of the centre of mass 0.3 m) and 1 rad by default; `math.inf` for none.
    """

    stiffness: ArrayLike
    damping: ArrayLike | None
    error_bound: ArrayLike


class MotionOptions(GainOptions, total=False):
    """Options of motion tasks: those of tasks with an error, and a choice of axes and joints.

    Attributes:
        axes: Axes to control, each with a row; all by default. Out of x, y, z for a position, roll (about x), pitch
            (about y), yaw (about z) for an orientation, all six for a pose.
        joints: Joints that the task may use, "base" for the floating base; all of them when None, the default.
    """

    axes: str | Sequence[str]
    joints: str | Sequence[str] | None


class ComplianceOptions(MotionOptions, total=False):
    """Options of tasks that yield to a wrench: those of motion tasks, a filter and bounds.

    Weight 10 and stiffness 100 1/s² by default: the gain with which the frame follows its reference.

    Attributes:
        time_constant: Time constant of the low-pass on the wrench error, s; none when 0.
        velocity_bound: Clamp of the compliance velocity, shape (6,) or a pair (linear, angular), m/s and rad/s.
        target_wrench: Wrench at which the frame does not yield, [force; moment] in the frame, shape (6,), N and Nm;
            zero by default.
        offset_bound: Greatest offset of the reference, shape (6,) or a pair (linear, angular), m and rad; none when
            None, the default.
    """

    time_constant: float
    velocity_bound: ArrayLike
    target_wrench: ArrayLike | None
    offset_bound: ArrayLike | None
