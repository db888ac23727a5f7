"""Tasks with a target for each joint: their base, and the positions of all joints or of some of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array, finite_scalar, read_only
from wbc.base.settings import NonNegative
from wbc.core.qp.move import USUAL_SPEED, Coordinates
from wbc.core.qp.options import GainOptions, TaskOptions, distinct_joints, joint_columns
from wbc.core.qp.task import ERROR_BOUNDS, NEAR, SLOW, SelectionTask, Task
from wbc.core.robot import Robot

JointValues = ArrayLike | Mapping[str, float]
"""A value for each joint of a task, shape (number of joints,), or joint name → value for some of them."""


class JointTask(Task):
    """Base of tasks on joints, of which each has a row and a target."""

    __slots__ = ("_columns", "_joints", "_pending")

    def __init__(
        self,
        name: str,
        target: JointValues | None,
        joints: str | Sequence[str] | None,
        options: TaskOptions | GainOptions,
    ) -> None:
        """Describe the task: its name, targets, joints (all when None) and options, each where none is given."""
        self._joints = None if joints is None else distinct_joints(joints)
        self._columns: NDArray[np.intp]
        super().__init__(name, len(self._joints or [""]), **options)
        self._pending = [] if target is None else [self._given(target)]  # until the joints are known

    @checked
    def bind(self, robot: Robot) -> None:
        """Resolve the joints, and take the present values as targets where none were given."""
        if self._joints is None:
            self._resize(robot.na)
        self._columns = joint_columns(robot, self._joints or robot.joint_names)
        super().bind(robot)
        if not self._settled:
            self._target = self.present(robot)
            for given in self._pending:
                self._target = self.checked(given)

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints of the task, in the order of its rows."""
        return self.robot.joint_names if self._joints is None else tuple(self._joints)

    @property
    def target(self) -> Array:
        """Targets, shape (dim,), `unit`, read-only; assign an array, or joint name → target for some joints."""
        if self._target is None:
            raise InputError(f"task '{self.name}' has no target before it is added to a controller")
        return read_only(self._target)

    @target.setter
    def target(self, value: JointValues) -> None:
        if self._target is None:
            given = self._given(value)
            self._pending = [*self._pending, given] if isinstance(given, dict) else [given]
            return
        Task.target.fset(self, value)  # type: ignore[attr-defined]
        if not self._settled:  # what could not be added is not tried again
            self._pending = [self._target]

    def _given(self, value: JointValues) -> Array | dict[str, float]:
        """Return a copy of finite targets, whose joints are not known yet."""
        if isinstance(value, Mapping):
            return {
                joint: finite_scalar(f"target of joint '{joint}' ({self.unit})", each)
                for joint, each in value.items()
            }
        return finite_array(f"target of task '{self.name}' ({self.unit})", value)

    def checked(self, value: JointValues, others: Array | None = None) -> Array:
        """Return targets after a check, shape (dim,); those that are not given are those of `others`, or stay."""
        if not isinstance(value, Mapping):
            return finite_array(f"target of task '{self.name}' ({self.unit})", value, (self.dim,))
        changed = np.array(self._target if others is None else others)
        for joint, target in value.items():
            changed[self._row(joint)] = finite_scalar(f"target of joint '{joint}' ({self.unit})", target)
        return changed

    def _row(self, joint: str) -> int:
        self.robot.joint_index(joint)
        if joint not in self.joints:
            raise InputError(f"joint '{joint}' is not part of task '{self.name}'")
        return self.joints.index(joint)


class PostureTask(JointTask, SelectionTask):
    """Task that brings joints to given positions; with its small weight it uses the freedom that other tasks leave.

    Error and residual are in rad and rad/s² (m and m/s² for prismatic joints). The weight is a cost per (rad/s²)². By
    default the weight is 10⁻³, in inverse kinematics 10⁻⁴, and the stiffness 20 1/s². A hand of weight 1 that moves by
    0.3 m then ends within some millimetres of its target; beside a posture of 0.1 it would miss it by 0.1 m or more.
    """

    __slots__ = ("_factor", "_factors", "_positions", "_slides", "_usual", "columns")
    unit = "rad"
    reads = "kinematics"
    usual = {"weight": 1e-3, "stiffness": 20.0}
    kinematic_weight = 1e-4

    @checked
    def __init__(
        self,
        target: JointValues | None = None,
        *,
        joints: str | Sequence[str] | None = None,
        joint_weights: Mapping[str, NonNegative] | None = None,
        **options: Unpack[GainOptions],
    ) -> None:
        """Describe the task.

        Args:
            target: Positions of the task's joints, shape (number of joints,), rad (or m), or joint name → position for
                some of them; all others keep their present position.
            joints: Joint or joints of the task; all when None.
            joint_weights: Joint name → factor of the weight; later changes of `weight` keep these factors.
            **options: See `GainOptions`.
        """
        self._factor: Array | None = None
        self._factors = joint_weights or {}
        self._slides: NDArray[np.bool_] | None = None  # joints of the task that slide
        self._usual = False  # nobody has given a bound of the error
        super().__init__("posture", target, joints, options)

    def bind(self, robot: Robot) -> None:
        """Resolve the joints, and take the present position of each joint without a target as its target."""
        if self._usual and not self._settled and self._slides is not None:  # it was bound before, in vain
            self._numbers.bound[:] = ERROR_BOUNDS["rad"]
        super().bind(robot)
        columns = self._columns
        whole = columns.size == robot.na and bool((columns == np.arange(robot.base_dof, robot.nv)).all())
        self.columns = slice(robot.base_dof, robot.nv) if whole else columns
        self._positions = slice(robot.base_nq, robot.nq) if whole else columns + (robot.nq - robot.nv)
        if not self._settled:
            self._slides = robot.slides[columns - robot.base_dof]
            if self._usual:
                self._numbers.bound[self._slides] = ERROR_BOUNDS["m"]
                self.revision += 1
            factor = np.ones(self.dim)
            for joint, value in self._factors.items():
                factor[self._row(joint)] = value
            self._factor = factor
            self._act()

    def checked(self, value: JointValues, others: Array | None = None) -> Array:
        """Return a copy of targets, shape (dim,), rad (or m), after a check of the ranges of their joints."""
        target = super().checked(value, others)
        self.robot.check_range("target of joint", self._columns - self.robot.base_dof, target)
        return target

    def present(self, robot: Robot) -> Array:
        """Return the present joint positions, shape (dim,), rad (or m)."""
        return np.array(robot.q[self._columns + (robot.nq - robot.nv)])

    @property
    def reached(self) -> bool:
        """True if no move goes on and all joints are at their targets: within 0.05 rad, below 0.2 rad/s.

        For a joint that slides this is 5 mm, or a tenth of a shorter range, and 20 mm/s (`Robot.per_rad`).
        """
        robot, joints = self.robot, self._columns - self.robot.base_dof
        if self.moving:
            return False
        near = NEAR["rad"] * robot.per_rad
        near[robot.slides] = np.minimum(near, 0.1 * (robot.position_upper - robot.position_lower))[
            robot.slides
        ]
        error, speed = self._target - self.present(robot), robot.v[self._columns]
        slow = SLOW["rad"] * robot.per_rad[joints]
        return bool((abs(error) <= near[joints]).all() and (abs(speed) <= slow).all())

    def _parts(self) -> list[tuple[str, Any]]:
        """Units and rows of the joints that slide and of those that turn."""
        if self._slides is None or not self._slides.any():
            return super()._parts()
        parts = [("m", np.flatnonzero(self._slides)), ("rad", np.flatnonzero(~self._slides))]
        return [(unit, rows) for unit, rows in parts if rows.size]

    def _usual_speed(self) -> Array:
        """Return the greatest speed of each joint, shape (dim,), rad/s (or m/s)."""
        slides = self.robot.slides[self._columns - self.robot.base_dof]
        return np.where(slides, USUAL_SPEED["m"], USUAL_SPEED["rad"])

    def _act(self) -> None:
        """Write the weight that acts, with the factors of the joints."""
        super()._act()
        if self._factor is not None:
            self._numbers.weight *= self._factor
            self.idle = not (self._hard or self._numbers.weight.any())

    def _usual_bound(self) -> ArrayLike:
        self._usual = True
        return super()._usual_bound()

    def _coordinates(self) -> Coordinates:
        return _Joints(self.target, self.checked)

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill target − measured; see `Task.evaluate`."""
        np.subtract(self._target, self.robot.q[self._positions], out=error)


class _Joints(Coordinates):
    """Joint positions; joints that a target does not name stay where they were before."""

    def __init__(self, start: Array, checked: Callable[[Any, Array], Array]) -> None:
        super().__init__(start, np.asarray, [slice(joint, joint + 1) for joint in range(start.size)])
        self._values = checked

    def of(self, target: Any, before: Array) -> Array:
        return self._values(target, before)
