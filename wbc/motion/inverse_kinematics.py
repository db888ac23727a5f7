"""Configurations for a whole clip: feet by contacts, the centre of mass by balance, the rest as given."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array
from wbc.core.robot import BASE_DOF, Robot
from wbc.motion.kinematics import leg_joints

STANCE, SWING, COM, ORIENTATION, JOINTS, LEGS = 1e4, 1e2, 1e3, 1.0, 0.5, 1e-3
"""Weights per squared error: pose of a sole that stands, and of one in the air (m², rad²), centre of mass (m²),
rotation of base and torso, joints outside the legs, and joints of the legs (rad²), on which the feet decide."""

SMALL = 1e-6
"""Step with which a frame is solved, rad and m."""

Soles = Sequence[tuple[pin.SE3, pin.SE3]]
"""Placements of left and right sole in each frame."""


class InverseKinematics:
    """Least squares over all joints and the base, inside the joint limits, frame by frame.

    Attributes:
        lower: Least joint positions, shape (na,), rad.
        upper: Greatest joint positions, shape (na,), rad.
    """

    def __init__(self, robot: Robot, margin: float) -> None:
        """Set up the weights; `margin` to the joint limits is in rad, half the range at the most."""
        self._model, self._data = robot.model, robot.model.createData()
        self._soles = [robot.frame_id(sole.frame) for sole in robot.soles[:2]]
        self._trunk = list(dict.fromkeys(robot.frame_id(f) for f in (robot.base_frame, robot.torso_frame)))
        room = np.minimum(margin, 0.5 * (robot.position_upper - robot.position_lower))
        self.lower, self.upper = robot.position_lower + room, robot.position_upper - room
        legs = leg_joints(robot)
        self._posture = np.full(robot.nv, JOINTS)
        self._posture[:BASE_DOF] = 1e-6
        self._posture[BASE_DOF:][legs] = LEGS

    def solve(
        self,
        q: Array,
        soles: Soles,
        standing: Array,
        com: Array,
        start: Array | None = None,
        iterations: int = 12,
    ) -> Array:
        """Return configurations, shape (T, nq).

        Args:
            q: Configurations to stay near, shape (T, nq).
            soles: Placements of left and right sole, T pairs.
            standing: 1 where a sole stands, 0 in the air, shape (T, 2); in between the weights change geometrically.
            com: Places of the centre of mass, shape (T, 3), m.
            start: Configurations to begin with, shape (T, nq); those to stay near when None.
            iterations: Most Gauss–Newton steps of a frame, which ends with one below `SMALL`.
        """
        starts = q if start is None else start
        frames = zip(q, starts, soles, standing, com, strict=True)
        return np.array([self._frame(*frame, iterations) for frame in frames])

    def _frame(
        self,
        reference: Array,
        start: Array,
        soles: tuple[pin.SE3, pin.SE3],
        standing: Array,
        com: Array,
        iterations: int,
    ) -> Array:
        model, data = self._model, self._data
        q = start.copy()
        np.clip(q[7:], self.lower, self.upper, out=q[7:])
        pin.framesForwardKinematics(model, data, reference)
        trunk = [data.oMf[frame].rotation.copy() for frame in self._trunk]
        for _ in range(iterations):
            pin.computeJointJacobians(model, data, q)
            pin.updateFramePlacements(model, data)
            rows: list[Array] = []
            errors: list[Array] = []
            for side, frame in enumerate(self._soles):
                weight = np.sqrt(SWING * (STANCE / SWING) ** standing[side])
                errors.append(weight * pin.log6(data.oMf[frame].actInv(soles[side])).vector)
                rows.append(weight * pin.getFrameJacobian(model, data, frame, pin.LOCAL))
            for frame, rotation in zip(self._trunk, trunk, strict=True):
                weight = np.sqrt(ORIENTATION)
                errors.append(weight * pin.log3(data.oMf[frame].rotation.T @ rotation))
                rows.append(weight * pin.getFrameJacobian(model, data, frame, pin.LOCAL)[3:])
            rows.append(np.sqrt(COM) * pin.jacobianCenterOfMass(model, data, q))
            errors.append(np.sqrt(COM) * (com - data.com[0]))
            jacobian, error = np.vstack(rows), np.concatenate(errors)
            near = pin.difference(model, q, reference)
            near[:BASE_DOF] = 0.0
            hessian = jacobian.T @ jacobian
            # Damped by the error that is left: far from a solution steps stay small (T. Sugihara, T-RO 27(5), 2011).
            hessian[np.diag_indices(model.nv)] += self._posture + float(error @ error)
            gradient = jacobian.T @ error + self._posture * near
            step = self._bounded_step(hessian, gradient, q[7:])
            q = pin.integrate(model, q, step)
            np.clip(q[7:], self.lower, self.upper, out=q[7:])
            if abs(step).max() < SMALL:
                break
        return q

    def _bounded_step(self, hessian: Array, gradient: Array, joints: Array) -> Array:
        """Solve for a step; joints that it would take over a limit stop there and the others are solved for again."""
        step = np.linalg.solve(hessian, gradient)
        fixed = np.empty(0, dtype=int)
        for _ in range(3):
            count, reached = len(fixed), joints + step[BASE_DOF:]
            for bound, beyond in (
                (self.upper, reached > self.upper + 1e-9),
                (self.lower, reached < self.lower - 1e-9),
            ):
                new = np.setdiff1d(BASE_DOF + np.flatnonzero(beyond), fixed)
                step[new] = (bound - joints)[new - BASE_DOF]
                fixed = np.append(fixed, new)
            if len(fixed) == count:
                break
            free = np.setdiff1d(np.arange(len(step)), fixed)
            rest = gradient[free] - hessian[np.ix_(free, fixed)] @ step[fixed]
            step[free] = np.linalg.solve(hessian[np.ix_(free, free)], rest)
        return np.asarray(step)
