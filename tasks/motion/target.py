"""Base of motion tasks with a target: a point, a rotation or a pose, that is assigned, moved, or set at every tick."""

from __future__ import annotations

from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array, finite_array
from wbc.core.qp.task import read_only
from wbc.core.robot import Robot
from wbc.tasks.motion.axes import AxesTask
from wbc.tasks.motion.moving import Course

T = TypeVar("T", bound=Any)
"""Kind of the target: an array, or a pose."""


class TargetTask(AxesTask, Generic[T]):
    """Base of motion tasks with a target; a kind of task states what it is at present, and how one is checked.

    Points are the targets here; `_checked`, `_present` and `_course_of` are what other kinds replace.
    """

    _target: T | None = None
    _course_of: ClassVar[Any] = Course

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
        """Resolve names, and take what is at present as target when none was given; see `Task.bind`."""
        super().bind(robot)
        if self._target is None:
            self._store(self._present(robot))

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
