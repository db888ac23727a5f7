"""Base of tasks whose target moves along a trajectory: `move_to`, waypoints, and whether it has arrived."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.core.errors import ROUNDING, Array, InputError
from wbc.core.qp.controller import Controller
from wbc.core.qp.task import MotionTask, SelectionTask, Task, evaluated
from wbc.tasks.trajectories import Trajectory

USUAL_SPEED = {"m": 0.2, "rad": 1.0}
"""Unit → greatest speed of a target that is given neither a duration nor a speed, per second."""

NEAR = {"m": 0.01, "rad": 0.05}
"""Unit → error within which a task has reached its target."""

SLOW = {"m": 0.05, "rad": 0.2}
"""Unit → speed below which a task has reached its target, per second."""

DIFFERENCE = 1e-4
"""Step of the difference that gives the rate of a Jacobian of rotations, rad."""


class Course:
    """Targets as coordinates of a trajectory; of points and joints, these are the targets themselves.

    Attributes:
        start: Coordinates at the start, shape (n,).
        parts: Coordinates that are one vector, with a speed of their own.
    """

    def __init__(
        self, start: Array, check: Callable[[Any], Array], parts: Sequence[slice] = (slice(None),)
    ) -> None:
        """Begin at the present target, shape (n,); `check` returns a target after a check, shape (n,)."""
        self.start, self._check, self.parts = np.array(start), check, parts

    def point(self, target: Any, before: Array) -> Array:
        """Return the coordinates of a target, shape (n,), checked; `before` are those of the one before it."""
        return self._check(target)

    def motion(self, place: Array, velocity: Array, acceleration: Array) -> tuple[Any, Array, Array]:
        """Return target, velocity and acceleration of coordinates and their first and second derivative."""
        return place, velocity, acceleration


class Turning(Course):
    """Rotations as rotation vectors from the first one, along the fixed axes, rad."""

    def __init__(self, base: Array, check: Callable[[Any], Array]) -> None:
        """Begin at a rotation, shape (3, 3); see `Course`."""
        super().__init__(np.zeros(3), check)
        self._base = np.array(base)

    def point(self, target: Any, before: Array) -> Array:
        """Return the rotation vector to a rotation, shape (3,): of those that are the same turn, the nearest."""
        vector = np.asarray(pin.log3(self._check(target) @ self._base.T))
        angle = float(np.linalg.norm(vector))
        if angle < ROUNDING:
            return vector
        axis = vector / angle
        turns = round((float(axis @ before) - angle) / math.tau)
        return np.asarray(vector + math.tau * turns * axis)

    def motion(self, place: Array, velocity: Array, acceleration: Array) -> tuple[Any, Array, Array]:
        """Return rotation, angular velocity and angular acceleration of a rotation vector that changes.

        With the left Jacobian J of the exponential, ω = J(r) ṙ and ω̇ = J(r) r̈ + J̇ ṙ.

        Source: Solà, Deray, Atchuthan, "A micro Lie theory for state estimation in robotics", 2018, eqs. 143, 145.
        """
        rotation = pin.exp3(place) @ self._base
        left, speed = pin.Jexp3(place).T, float(np.linalg.norm(velocity))
        push = left @ acceleration
        if speed > 1e-12:
            step = DIFFERENCE / speed
            ahead, behind = pin.Jexp3(place + step * velocity), pin.Jexp3(place - step * velocity)
            push += (ahead - behind).T @ velocity / (2.0 * step)
        return rotation, left @ velocity, push


class Placing(Course):
    """Poses as a point, m, and a rotation vector, rad."""

    def __init__(self, base: pin.SE3, check: Callable[[Any], pin.SE3]) -> None:
        """Begin at a pose; see `Course`."""
        super().__init__(np.concatenate([base.translation, np.zeros(3)]), check, (slice(0, 3), slice(3, 6)))
        self._turning = Turning(base.rotation, np.asarray)

    def point(self, target: Any, before: Array) -> Array:
        """Return point and rotation vector of a pose, shape (6,)."""
        pose: Any = self._check(target)
        return np.concatenate([pose.translation, self._turning.point(pose.rotation, before[3:])])

    def motion(self, place: Array, velocity: Array, acceleration: Array) -> tuple[Any, Array, Array]:
        """Return pose, velocity and acceleration, shape (6,), of point and rotation vector."""
        rotation, rate, push = self._turning.motion(place[3:], velocity[3:], acceleration[3:])
        return (
            pin.SE3(rotation, place[:3]),
            np.concatenate([velocity[:3], rate]),
            np.concatenate([acceleration[:3], push]),
        )


class MovingTask(Task):
    """Base of tasks with a target that moves.

    A move goes on from where the target is, with its present velocity, and sets target, feed-forward velocity and
    acceleration at every tick. Whatever is assigned to one of these ends it.
    """

    _trajectory: Trajectory | None = None
    _on: Course
    target: Any
    _elapsed = 0.0

    def move_to(
        self,
        target: Any,
        *,
        duration: float | None = None,
        speed: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
    ) -> None:
        """Move the target to another one on a minimum jerk trajectory, from the next tick on.

        Args:
            target: As it is assigned to `target`.
            duration: s; the least within the limits when None.
            speed: Greatest speed of the target, `unit`/s; for a pose a pair (linear, angular), for joints that of each.
                0.2 m/s and 1 rad/s when None and no duration is given.
            acceleration: Greatest acceleration, `unit`/s², as `speed`; reaches that speed in 0.2 s when None and no
                duration is given.

        Raises:
            InputError: A target that cannot be assigned, a duration, speed or acceleration that is not above zero or do
                not agree, a task that no controller has, or whose target something else sets.
        """
        self.move_through([target], duration=duration, speed=speed, acceleration=acceleration)

    def move_through(
        self,
        targets: Sequence[Any],
        *,
        duration: float | None = None,
        speed: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
    ) -> None:
        """Move the target through others, without a stop, to rest at the last; see `move_to`.

        Args:
            targets: One after the other; a rotation between two of them is the shorter turn.
            duration: From the first target to the last, s.
            speed: Greatest speed.
            acceleration: Greatest acceleration.

        Raises:
            InputError: As in `move_to`; no target at all, or the same twice in a row.
        """
        owner, self._trajectory, self._on = self._curve(targets, duration, speed, acceleration)
        self._elapsed, self._held = 0.0, True
        owner.move(self)

    def _curve(
        self,
        targets: Sequence[Any],
        duration: float | None,
        speed: ArrayLike | None,
        acceleration: ArrayLike | None,
    ) -> tuple[Controller, Trajectory, Course]:
        """Return the controller and the trajectory through targets, from the present motion or from rest on."""
        owner: Controller | None = (vars(self).get("_owner") or (lambda: None))()
        if owner is None:
            raise InputError(f"task '{self.name}' can move its target once a controller has it: add it first")
        if not isinstance(targets, (Sequence, np.ndarray)) or len(targets) == 0:
            raise InputError(f"task '{self.name}' moves through one or more targets, got {targets!r}")
        self._refuse_if_set()
        velocity, push = self._rates()
        course = self._course()
        points = [course.start]
        for target in targets:
            points.append(course.point(target, points[-1]))
        if duration is None and speed is None:
            units = self.unit.split("|")
            speed = USUAL_SPEED[units[0]] if len(units) == 1 else [USUAL_SPEED[unit] for unit in units]
        curve = Trajectory(
            points,
            duration,
            speed=speed,
            acceleration=acceleration,
            parts=course.parts,
            velocity=velocity,
            acceleration_at_start=push,
        )
        return owner, curve, course

    @property
    def moving(self) -> bool:
        """True while the target moves."""
        return self._trajectory is not None

    @property
    def velocity(self) -> Array:
        """Measured velocity of the rows now, shape (dim,), `unit`/s."""
        assert isinstance(self, (MotionTask, SelectionTask))
        return np.asarray(evaluated(self)[0] @ self.robot.v)

    @property
    def speed(self) -> float:
        """Measured speed now, `unit`/s: that of the fastest of position, rotation and joints."""
        return self._greatest(self.velocity)

    @property
    def reached(self) -> bool:
        """True once the target has arrived, and the robot there: within 10 mm and 0.05 rad, below 0.05 m/s, 0.2 rad/s.

        It is the robot of the controller, in position control with open feedback the commanded one.
        """
        assert isinstance(self, (MotionTask, SelectionTask))
        if self.moving:
            return False
        jacobian, error, _ = evaluated(self)
        near, slow = ([limits[unit] for unit in self._units()] for limits in (NEAR, SLOW))
        return self._within(error, near) and self._within(jacobian @ self.robot.v, slow)

    def move_on(self, dt: float) -> bool:
        """Move the target on by one tick; see `Task.move_on`."""
        trajectory = self._trajectory
        if trajectory is None:
            return False
        arrived = self._elapsed >= trajectory.duration - ROUNDING
        self._put(*self._on.motion(*trajectory.at(self._elapsed)))
        self._elapsed += dt
        if arrived:
            self._trajectory, self._held = None, False
        return not arrived

    def reset(self) -> None:
        """End a move; the target stays where it is."""
        super().reset()
        self._stop()

    def _refuse_if_set(self) -> None:
        super()._take_over()

    def _take_over(self) -> None:
        self._refuse_if_set()
        self._stop()

    def _stop(self) -> None:
        """End a move, if there is one, where the target is."""
        if self._trajectory is not None:
            self._trajectory, self._held = None, self._set_by is not None
            self._put(self.target, np.zeros(self._on.start.size), np.zeros(self._on.start.size))

    def _rates(self) -> tuple[Array | None, Array | None]:
        """Bring the target to where it is at the next tick, and return how it moves there; None for rest."""
        if self._trajectory is None:
            return None, None
        target, velocity, acceleration = self._on.motion(*self._trajectory.at(self._elapsed))
        self._put(target, velocity, acceleration)
        return velocity, acceleration

    def _greatest(self, rows: Array) -> float:
        return max(float(np.linalg.norm(rows[part])) for part in self._vectors())

    def _within(self, rows: Array, bounds: Sequence[float]) -> bool:
        parts = zip(self._vectors(), bounds, strict=True)
        return all(float(np.linalg.norm(rows[part])) <= bound for part, bound in parts)

    def _units(self) -> Sequence[str]:
        """Return the unit of each of `_vectors`."""
        return self.unit.split("|")

    # What a task states: its target as coordinates of a trajectory.

    def _course(self) -> Course:
        """Return coordinates of targets, from the present one on."""
        raise NotImplementedError

    def _put(self, target: Any, velocity: Array, acceleration: Array) -> None:
        """Set target and feed-forwards of one tick."""
        raise NotImplementedError
