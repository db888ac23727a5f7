"""Task on the positions of all joints, or of some of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from wbc.core.errors import Array, InputError, check_options, finite_array, finite_scalar, non_negative
from wbc.core.qp.task import SelectionTask
from wbc.core.robot import BASE_DOF, Robot
from wbc.tasks.motion.axes import distinct_joints, joint_columns
from wbc.tasks.options import GainOptions


class PostureTask(SelectionTask):
    """Bring joints to given positions; what is left free by all other tasks goes here.

    Error and residual are in rad and rad/s² (m and m/s² for sliding joints); the weight is a cost per (rad/s²)².
    Weight 0.1 and stiffness 20 1/s² by default.
    """

    unit = "rad"

    def __init__(
        self,
        target: ArrayLike | Mapping[str, float] | None = None,
        *,
        joints: Sequence[str] | None = None,
        joint_weights: Mapping[str, float] | None = None,
        **options: Unpack[GainOptions],
    ) -> None:
        """Describe the task.

        Args:
            target: Positions of the task's joints, shape (number of joints,), or joint name → position for some of
                them; the present posture for all others.
            joints: Joints of the task; all when None.
            joint_weights: Joint name → factor on the weight; it stays when the weight is changed.
            **options: See `GainOptions`.

        Raises:
            UnknownNameError: An unknown option.
            InputError: No joint at all, a joint twice, or a value that is not finite or out of range.
        """
        check_options(self, GainOptions, options)
        gains: dict[str, Any] = {"weight": 0.1, "stiffness": 20.0, **options}
        name = gains.pop("name", None) or "posture"
        self._joints = None if joints is None else distinct_joints(joints)
        self._factor: Array | None = None
        self._factors = {
            joint: non_negative(f"weight of joint '{joint}' in task '{name}'", factor)
            for joint, factor in (joint_weights or {}).items()
        }
        super().__init__(name, len(self._joints or [""]), **gains)
        self._pending = target
        self._target: Array | None = None

    def bind(self, robot: Robot) -> None:
        """Resolve the joints, and take the present posture where no target was given.

        Raises:
            UnknownNameError: The robot has no such joint.
            InputError: A target of the wrong shape.
        """
        super().bind(robot)
        if self._joints is None:
            self._joints = list(robot.joint_names)
            self._resize(robot.na)
        columns = joint_columns(robot, self._joints)
        whole = bool((columns == np.arange(BASE_DOF, robot.nv)).all()) if columns.size == robot.na else False
        self.columns = slice(BASE_DOF, robot.nv) if whole else columns
        self._positions = slice(7, robot.nq) if whole else columns + 1
        if self._factor is None:
            factor = np.ones(self.dim)
            for joint, value in self._factors.items():
                factor[self._row(joint)] = value
            self._factor = factor
            self._rows.weight *= factor
        if self._target is None:
            self._target = np.array(robot.q[self._positions])
        if self._pending is not None:
            self.target = self._pending
            self._pending = None

    @property
    def weight(self) -> Array:
        """Cost per squared residual with the factors of the joints in it, shape (dim,); assign one without them."""
        return self._rows.weight

    @weight.setter
    def weight(self, value: ArrayLike) -> None:
        weight = self._gain("weight", value)
        self._rows.weight[:] = weight if self._factor is None else weight * self._factor

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints of the task, in the order of its rows."""
        if self._joints is None:
            return self.robot.joint_names
        return tuple(self._joints)

    @property
    def target(self) -> Array:
        """Positions, shape (dim,), rad (or m); assign an array, or joint name → position for some joints."""
        if self._target is None:
            raise InputError(f"task '{self.name}' has no target before it is added to a controller")
        return self._target

    @target.setter
    def target(self, value: ArrayLike | Mapping[str, float]) -> None:
        if self._target is None:
            self._pending = value
        elif isinstance(value, Mapping):
            changed = np.array(self._target)
            for joint, position in value.items():
                changed[self._row(joint)] = finite_scalar(f"target of joint '{joint}' (rad)", position)
            self._target = changed
        else:
            self._target = finite_array(f"target of task '{self.name}' (rad)", value, (self.dim,))

    def evaluate(self, error: Array) -> None:
        """Fill target − measured; see `SelectionTask.evaluate`."""
        assert self._target is not None
        np.subtract(self._target, self.robot.q[self._positions], out=error)

    def _row(self, joint: str) -> int:
        self.robot.joint_index(joint)
        if joint not in self.joints:
            raise InputError(f"joint '{joint}' is not part of task '{self.name}'")
        return self.joints.index(joint)
