"""Configurations for a whole clip: feet by contacts, the centre of mass by balance, the rest as given."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array
from wbc.core.robot import BASE_DOF, Robot
from wbc.motion.kinematics import Soles

STANCE, SWING, COM, ORIENTATION, JOINTS, LEGS = 1e4, 1e2, 1e3, 1.0, 0.5, 1e-3
"""Weights per squared error: pose of a sole that stands, and of one in the air (m², rad²), centre of mass (m²),
rotation of base and torso, joints outside the legs, and joints of the legs (rad²), on which the feet decide."""

ITERATIONS, SMALL = 12, 1e-6
"""Most steps of a frame, which ends with one that is smaller, rad and m."""


class InverseKinematics:
    """Least squares over all joints and the base, inside the joint limits, frame by frame.

    Joints at a limit that the gradient pushes beyond it stay there while the others are solved for.

    Source: D. P. Bertsekas, SIAM J. Control 20(2), 1982 (projected Newton steps).
    """

    def __init__(self, robot: Robot, margin: float) -> None:
        """Set up the weights; `margin` to the joint limits is in rad, half the range at the most."""
        self._model, self._data = robot.model, robot.model.createData()
        self._soles = [robot.frame_id(sole.frame) for sole in robot.soles[:2]]
        self._trunk = list(dict.fromkeys(robot.frame_id(f) for f in (robot.base_frame, robot.torso_frame)))
        room = np.minimum(margin, 0.5 * (robot.position_upper - robot.position_lower))
        self._lower, self._upper = robot.position_lower + room, robot.position_upper - room
        self._posture = np.full(robot.nv, JOINTS)
        self._posture[:BASE_DOF] = 1e-6
        self._posture[BASE_DOF:][robot.leg_joints] = LEGS

    def solve(
        self, q: Array, soles: Sequence[Soles], standing: Array, com: Array, start: Array | None = None
    ) -> Array:
        """Return configurations near given ones, with placements of both soles and of the centre of mass (T, 3), m.

        `standing` (T, 2) is 1 where a sole stands and 0 in the air; in between the weights change geometrically. The
        search begins at `start`, or at the given configurations; these and the result have shape (T, nq).
        """
        frames = zip(q, q if start is None else start, soles, standing, com, strict=True)
        return np.array([self._frame(*frame) for frame in frames])

    def _frame(self, reference: Array, start: Array, soles: Soles, standing: Array, com: Array) -> Array:
        model, data, q = self._model, self._data, start.copy()
        np.clip(q[7:], self._lower, self._upper, out=q[7:])
        pin.framesForwardKinematics(model, data, reference)
        trunk = [data.oMf[frame].rotation.copy() for frame in self._trunk]
        sole_weights = np.sqrt(SWING * (STANCE / SWING) ** standing)
        for _ in range(ITERATIONS):
            pin.computeJointJacobians(model, data, q)
            pin.updateFramePlacements(model, data)
            rows: list[Array] = []
            errors: list[Array] = []
            for frame, sole, weight in zip(self._soles, soles, sole_weights, strict=True):
                errors.append(weight * pin.log6(data.oMf[frame].actInv(sole)).vector)
                rows.append(weight * pin.getFrameJacobian(model, data, frame, pin.LOCAL))
            for frame, rotation in zip(self._trunk, trunk, strict=True):
                errors.append(np.sqrt(ORIENTATION) * pin.log3(data.oMf[frame].rotation.T @ rotation))
                rows.append(np.sqrt(ORIENTATION) * pin.getFrameJacobian(model, data, frame, pin.LOCAL)[3:])
            rows.append(np.sqrt(COM) * pin.jacobianCenterOfMass(model, data, q))
            errors.append(np.sqrt(COM) * (com - data.com[0]))
            jacobian, error = np.vstack(rows), np.concatenate(errors)
            near = pin.difference(model, q, reference)
            near[:BASE_DOF] = 0.0
            hessian = jacobian.T @ jacobian
            # Damped by the error that is left: far from a solution steps stay small (T. Sugihara, T-RO 27(5), 2011).
            hessian[np.diag_indices(model.nv)] += self._posture + float(error @ error)
            gradient = jacobian.T @ error + self._posture * near
            joints, push = q[7:], gradient[BASE_DOF:]
            held = ((joints >= self._upper) & (push > 0.0)) | ((joints <= self._lower) & (push < 0.0))
            free = np.concatenate([range(BASE_DOF), BASE_DOF + np.flatnonzero(~held)])
            step = np.zeros(model.nv)
            step[free] = np.linalg.solve(hessian[np.ix_(free, free)], gradient[free])
            q = pin.integrate(model, q, step)
            np.clip(q[7:], self._lower, self._upper, out=q[7:])
            if abs(step).max() < SMALL:
                break
        return q
