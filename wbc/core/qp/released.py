"""Joints that somebody else moves: the QP knows how they accelerate, and chooses nothing of it.

Arms under a teleoperator or a policy, a gripper, a waist that is locked: such joints have no torque limit and no
acceleration to choose, but their momentum is the robot's. Their accelerations are those of the target that the other
one has told, as a servo would follow it,

    q̈ = q̈_told + (q̇_told − q̇) 2/t + (q_told − q) / t²,

else those that their measured torques make, else the low-passed differences of the measured velocities. They enter as a
cost that outweighs all others: of a row that selects one coordinate it costs the QP nothing but a number on its
diagonal.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg.lapack import dposv

from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array, lag_gain
from wbc.core.qp.options import distinct_joints, joint_columns
from wbc.core.qp.task import SelectionTask
from wbc.core.robot import Robot

WEIGHT = 1e5
"""Cost of an acceleration that is another one than the known, per (rad/s²)²."""

LAG = 0.01
"""Time constant of measured accelerations, s: encoders of 500 Hz tell the velocity to some 0.01 rad/s."""

STOP = 0.02
"""Distance from the end of a joint from which on its stop may act on it, rad; a quarter of its range at most."""

RESPONSE = 0.05
"""Time t in which servos follow a target, s."""


class ReleasedJoints(SelectionTask):
    """Joints that somebody else moves.

    Attributes:
        mask: True for each of them, shape (na,).
        index: Their indices in arrays of the robot's joints, shape (dim,).
        commanded: True where the one who moves them shares the command with the QP, as a policy beside arms of the QP.
    """

    unit = "rad"

    def __init__(self, robot: Robot, joints: Sequence[str], *, commanded: bool = False) -> None:
        """Take the names; an `UnknownNameError` for a joint that there is not.

        A joint of a leg is an `InputError`, unless the one who moves it shares the command and keeps the balance. Their
        motion is then that of the encoders: torques do not tell it without the forces on the feet.
        """
        names = distinct_joints(joints)
        self.index: NDArray[np.intp] = joint_columns(robot, names) - robot.base_dof
        balancing = set(robot.leg_joints) & set(self.index.tolist())
        if balancing and not commanded:
            some = ", ".join(robot.joint_names[joint] for joint in sorted(balancing))
            raise InputError(f"legs balance the robot and cannot be released: {some}")
        super().__init__("released joints", len(names), weight=WEIGHT, stiffness=0.0, damping=0.0)
        self.joints, self.commanded = tuple(names), commanded
        self.mask = np.zeros(robot.na, dtype=bool)
        self.mask[self.index] = True
        for fixed in (self.mask, self.index):
            fixed.setflags(write=False)
        self._told: tuple[Array, Array, Array] | None = None
        self._before: Array | None = None  # velocity in the tick before, rad/s
        self._acceleration, self._measured = np.zeros(len(names)), np.zeros(len(names))

    def bind(self, robot: Robot) -> None:
        """Look up the columns, and how quick the joints can be."""
        super().bind(robot)
        self.columns = self._dofs = self.index + robot.base_dof
        self._places = self.index + robot.base_nq
        self._bound = robot
        low, high = robot.position_lower[self.index], robot.position_upper[self.index]
        stop = np.minimum(STOP * robot.per_rad[self.index], 0.25 * (high - low))
        self._low, self._high = low + stop, high - stop
        inertia = np.diag(robot.mass_matrix)[self.columns]
        self._most = 2.0 * robot.torque_limit[self.index] / inertia

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Leave no error: the acceleration is known."""
        error[:] = 0.0

    def tell(
        self, position: ArrayLike | None, velocity: ArrayLike = 0.0, acceleration: ArrayLike = 0.0
    ) -> None:
        """Take the target of the one who moves the joints, until another is told.

        Args:
            position: Joint positions in the order of `joints`, shape (dim,), rad; None goes by what is measured.
            velocity: Their velocities, scalar or shape (dim,), rad/s.
            acceleration: Their accelerations, scalar or shape (dim,), rad/s².
        """
        if position is None:
            self._told = None
            return
        shape = (self.dim,)
        parts = []
        for name, unit, value in (
            ("position", "rad", position),
            ("velocity", "rad/s", velocity),
            ("acceleration", "rad/s²", acceleration),
        ):
            full = np.full(shape, value) if np.ndim(value) == 0 and name != "position" else value
            parts.append(finite_array(f"{name} told of the released joints ({unit})", full, shape))
        self._told = parts[0], parts[1], parts[2]

    def update(
        self, q: Array, v: Array, dt: float, torque: Array | None = None, accelerations: Array | None = None
    ) -> None:
        """Take the state of this tick, `dt` seconds after the last.

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).
            dt: Time since the last tick, s.
            torque: Measured joint torques, shape (na,), Nm (or N); None where none are measured.
            accelerations: Those of the last solution, shape (nv,), m/s² and rad/s²; None before one.
        """
        velocity, known = v[self.columns], self._acceleration
        if self._told is not None:
            position, speed, push = self._told
            rate = 1.0 / RESPONSE
            known[:] = push + (speed - velocity) * (2.0 * rate) + (position - q[self._places]) * (rate * rate)
        elif self._before is not None:
            self._measured += lag_gain(dt, LAG) * ((velocity - self._before) / dt - self._measured)
            known[:] = self._measured
            if not self.commanded and torque is not None and accelerations is not None:
                known[:] = self._driven(q, torque, accelerations)
        self._before = velocity
        np.maximum(known, -self._most, out=known)
        np.minimum(known, self._most, out=self._numbers.acceleration)
        self._fed = True

    def _driven(self, q: Array, torque: Array, accelerations: Array) -> Array:
        """Return the accelerations that their torques make, shape (dim,), rad/s²; measured ones at the ends of joints.

        The rest of the measured acceleration is that of a force from outside, on an arm that is hit. Its reaction is
        not on the robot, and a QP that took it for one would push the robot the way that it has been hit.
        """
        robot, columns, position = self._bound, self._dofs, q[self._places]
        at_end = ~((position > self._low) & (position < self._high))
        moved = accelerations.copy()
        moved[columns] = np.where(at_end, self._measured, 0.0)
        rows = robot.mass_matrix.take(columns, axis=0)
        rest = torque.take(self.index) - robot.bias.take(columns) - rows.dot(moved)
        inertia = rows.take(columns, axis=1)
        if at_end.any():  # known: out of the equations of the others
            inertia[at_end], inertia[:, at_end], rest[at_end] = 0.0, 0.0, self._measured[at_end]
            inertia[at_end, at_end] = 1.0
        driven: Array = dposv(inertia, rest, overwrite_b=True)[1]
        return driven

    def reset(self) -> None:
        """Forget the motion so far."""
        super().reset()
        self._before = None
        self._acceleration[:] = self._measured[:] = 0.0
