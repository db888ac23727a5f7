"""Targets of tasks: given, checked, moved on a trajectory, or set at every tick by another part.

A task is a `Targeted` motion; `Move` computes the trajectories.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.checked import checked as checked_arguments
from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array, read_only
from wbc.core.frames import FixedPose
from wbc.core.qp.motion import Motion
from wbc.core.qp.move import USUAL_SPEED, Coordinates, Move, coordinates
from wbc.core.robot import Robot
from wbc.core.trajectories import Duration


class Target:
    """Target of a task, and whoever sets it.

    Attributes:
        value: Target, in the form of its task; None until there is one.
        present: State of the robot when the task was bound; the value is the same object where none was given.
        settled: True once a controller has taken the task: the value stays then, whatever robot state it is bound at.
        move: Move that sets the value at every tick; None at rest.
        held_by: Name of what to use instead, where another part sets the value at every tick; None where it is free.
    """

    __slots__ = ("held_by", "move", "present", "settled", "value")

    def __init__(self) -> None:
        """Begin without a value."""
        self.value: Any = None
        self.present: Any = None
        self.settled = False
        self.move: Move | None = None
        self.held_by: str | None = None

    @property
    def open(self) -> bool:
        """True while the value is to be the present state when the task is bound."""
        return self.value is self.present and not self.settled


class Targeted(Motion):
    """Base of tasks: a motion with a target."""

    __slots__ = ("_target",)

    unit: ClassVar[str] = "m"
    _n_rows: int

    def __init__(self, name: str, stiffness: ArrayLike, damping: ArrayLike | None) -> None:
        """Begin without a target; see `Motion`."""
        self._target = Target()
        super().__init__(name, stiffness, damping)

    @property
    def held_by(self) -> str | None:
        """Name of what to use instead, where another part sets the target at every tick; None where it is free."""
        return self._target.held_by

    @held_by.setter
    @checked_arguments
    def held_by(self, value: str | None) -> None:
        self._target.held_by = value

    def present(self, robot: Robot) -> Any:
        """Return the target at which the present error is zero, as a copy; zero unless a task says otherwise."""
        return np.zeros(self._n_rows)

    def checked(self, value: Any) -> Any:
        """Return a target after a check, as a copy: a number for each of all axes unless a task says otherwise."""
        return finite_array(f"target of task '{self.name}' ({self.unit})", value, (self._n_rows,))

    @property
    def target(self) -> Any:
        """Target, in the form and unit of the constructor, read-only; assign one, or see `move_to`."""
        target = self._target.value
        if target is None:
            target = self.present(self.robot)
        return FixedPose(target) if isinstance(target, pin.SE3) else read_only(target)

    @target.setter
    def target(self, value: Any) -> None:
        target = self.checked(value)
        self._take_over()
        self._target.value = target

    def follow(self, target: Any, velocity: Array | None = None, acceleration: Array | None = None) -> None:
        """Set target and feed-forwards for one tick, unchecked: for a controller that makes them itself.

        Args:
            target: The target; kept, not copied.
            velocity: Its velocity along the task's axes, shape (dim,), `unit`/s; unchanged when None.
            acceleration: Its acceleration along them, shape (dim,), `unit`/s²; unchanged when None.
        """
        self._target.value = target
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
        return self._rows.velocity, self._rows.acceleration

    def _take_over(self) -> None:
        """End a move, or refuse a target that another part sets."""
        if self._target.held_by is not None:
            raise InputError(
                f"the target of task '{self.name}' is set at every tick by another part: use {self._target.held_by}"
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

        A move goes on from where the target is, with its present velocity, and sets target, feed-forward velocity and
        acceleration at every tick. Whatever is assigned to one of these ends it.

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

        A rotation between two of the targets is the shorter turn.
        """
        owner = None if self._owner is None else self._owner()
        if owner is None:
            raise InputError(f"task '{self.name}' can move its target once a controller has it: add it first")
        if not isinstance(targets, (Sequence, np.ndarray)) or len(targets) == 0:
            raise InputError(f"task '{self.name}' moves through one or more targets, got {targets!r}")
        if self._target.held_by is not None:
            self._take_over()
        rates: tuple[Array | None, Array | None] = (None, None)
        if self._target.move is not None:  # to where the target is at the next tick
            now = self._target.move.now()
            self._put(*now)
            rates = now[1:]
        if duration is None and speed is None:
            speed = self._usual_speed()
        limits = {"duration": duration, "speed": speed, "acceleration": acceleration}
        self._target.move = Move(self._coordinates(), targets, rates, **limits)
        owner.move(self)

    def _usual_speed(self) -> ArrayLike | None:
        """Return the greatest speed of a target where none is given, of each part of its coordinates."""
        usual = [USUAL_SPEED[unit] for unit in self.unit.split("|") if unit in USUAL_SPEED]
        return usual[0] if len(usual) == 1 else usual or None

    def _coordinates(self) -> Coordinates:
        """Return coordinates of targets, from the present one on."""
        return coordinates(self.target, self.checked)

    def _put(self, target: Any, velocity: Array, acceleration: Array) -> None:
        """Set the target of one tick of a move, and its rates along all axes."""
        self.follow(target, np.asarray(velocity)[self._keep], np.asarray(acceleration)[self._keep])

    def go_on_from(self, before: Self) -> None:
        """Take target, rates and move of another task of the same kind and axes over from it; its own move ends.

        Args:
            before: That task, which rests then.
        """
        owner = None if self._owner is None else self._owner()
        if owner is None:
            raise InputError(
                f"task '{self.name}' goes on from another one once a controller has it: add it first"
            )
        self.follow(before.target, before.feedforward_velocity, before.feedforward_acceleration)
        self._target.move, before._target.move = before._target.move, None
        if self._target.move is not None:
            owner.move(self)

    @property
    def moving(self) -> bool:
        """True while the target moves."""
        return self._target.move is not None

    def move_on(self, dt: float) -> bool:
        """Move a target that is on its way on by one tick of dt, s; return True if it is still on its way."""
        move = self._target.move
        if move is None:
            return False
        self._put(*move.now())
        if not move.advance(dt):
            self._target.move = None
        return self._target.move is not None

    def _stop(self) -> None:
        """End a move, if there is one, where the target is."""
        move = self._target.move
        if move is not None:
            still = np.zeros(move.coordinates.start.size)
            self._target.move = None
            self._put(self.target, still, still)
