"""Way of a hand to its target: a reference that moves with bounded speed, or on minimum jerk trajectories.

All places are in the frame of the target, which the reference does not know.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.qp.move import Move, PoseCoordinates
from wbc.core.trajectories import approach

ARRIVED = 1e-3
"""Distance of the reference from a target, m and rad, from which it counts as there."""

TURN_SPEED, TURN_ACCELERATION = 1.5, 6.0
"""Greatest angular speed, rad/s, and acceleration, rad/s², of the reference."""

LINEAR = np.repeat((1.0, 0.0), 3)
"""Part of a velocity or acceleration, shape (6,), that is not of a rotation."""


class Route(NamedTuple):
    """Order of a hand to go to a target, or through other poses to it.

    Attributes:
        poses: Poses in the frame, that of the target last.
        frame: Name of the frame.
        turn: Ratio of the cost of the hand's rotation to that of its place; the hand turns as it likes at 0.
        durations: Times of a minimum jerk trajectory to each pose, s; without any the hand goes at its speed.
        speed: Greatest speed without trajectories, m/s; that of the settings when None.
    """

    poses: Sequence[pin.SE3]
    frame: str
    turn: float
    durations: Sequence[float] = ()
    speed: float | None = None


class HandWay:
    """Reference of one hand, on its way to a target.

    Attributes:
        goal: Target; None without one.
        turn: That of its `Route`.
        place: Reference.
        velocity: Its velocity, [linear; angular], shape (6,), m/s and rad/s.
        acceleration: Derivative of the velocity, shape (6,), m/s² and rad/s².
        moves: Trajectories to come, where times were given.
    """

    def __init__(self, speed: float, acceleration: float, dt: float) -> None:
        """Begin without a target; with a usual speed, m/s, and the greatest acceleration, m/s², in ticks of dt, s."""
        self._usual, self._acceleration, self._dt = speed, acceleration, dt
        self.goal: pin.SE3 | None = None
        self.turn, self._fastest = 0.0, speed  # and greatest speed without trajectories, m/s
        self.place, self.velocity, self.acceleration = pin.SE3.Identity(), np.zeros(6), np.zeros(6)
        self.moves: list[Move] = []

    @property
    def moving(self) -> bool:
        """True while the reference is on its way to the target."""
        left = self.left(self.place)  # zero without a target
        far = np.linalg.norm(left[:3]) > ARRIVED or np.linalg.norm(left[3:]) > ARRIVED
        return bool(self.moves or far)

    def left(self, here: pin.SE3) -> Array:
        """Return displacement and rotation from a pose to the target, shape (6,), m and rad; zero without a target."""
        if self.goal is None:
            return np.zeros(6)
        turn = np.zeros(3) if self.turn == 0.0 else pin.log3(self.goal.rotation @ here.rotation.T)
        return np.concatenate([self.goal.translation - here.translation, turn])

    def send(self, route: Route, here: pin.SE3, *, fresh: bool) -> None:
        """Go on along a route.

        A `fresh` reference begins at rest where the hand is, `here`; another one takes the rotation of a hand that has
        turned as it liked.
        """
        reference, rates, turns = self.place, (self.velocity, self.acceleration), route.turn > 0.0
        if fresh:
            reference, rates = here, (np.zeros(6), np.zeros(6))
        elif turns and self.turn == 0.0:
            reference = pin.SE3(here.rotation, reference.translation)
            rates = self.velocity * LINEAR, self.acceleration * LINEAR
        goals = [
            pin.SE3(pose.rotation if turns else reference.rotation, pose.translation) for pose in route.poses
        ]
        starts, begins = (reference, *goals), (rates, *([(None, None)] * len(goals)))
        self.moves = [
            Move(PoseCoordinates(start, pin.SE3), [goal], begin, duration=duration)
            for start, goal, begin, duration in zip(starts, goals, begins, route.durations, strict=False)
        ]
        self.goal, self.turn = goals[-1], route.turn
        self._fastest = self._usual if route.speed is None else route.speed
        self.place, (self.velocity, self.acceleration) = reference, rates

    def halt(self) -> None:
        """Come to rest at once."""
        self.velocity, self.acceleration = np.zeros(6), np.zeros(6)

    def end(self) -> None:
        """Have no target any more."""
        self.goal, self.moves = None, []

    def advance(self, pace: Sequence[float]) -> None:
        """Move the reference on by a tick.

        It goes more slowly where the hand stays behind in its place, or in its rotation: each `pace` is 0 to 1.
        """
        if not self.moves:
            self._approach(pace)
            return
        # A rotation holds the trajectory up if it matters as much as the place.
        slower, move = min(pace) if self.turn == 1.0 else pace[0], self.moves[0]
        move.advance(slower * self._dt)
        self.place, velocity, push = move.now()
        self.velocity, self.acceleration = slower * velocity, slower * slower * push
        if move.arrived:
            self.moves.pop(0)

    def _approach(self, pace: Sequence[float]) -> None:
        """Move towards the target at bounded speeds."""
        dt, before, place = self._dt, self.velocity, self.place
        left = self.left(place)
        linear = approach(left[:3], before[:3], self._fastest * pace[0], self._acceleration, dt)
        angular = approach(left[3:], before[3:], TURN_SPEED * pace[1], TURN_ACCELERATION, dt)
        self.velocity = np.concatenate((linear, angular))
        self.acceleration = (self.velocity - before) / dt
        place.translation = place.translation + dt * linear
        place.rotation = pin.exp3(dt * angular) @ place.rotation
