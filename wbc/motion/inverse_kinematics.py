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


def inverse_kinematics(
    robot: Robot,
    margin: float,
    q: Array,
    soles: Sequence[Soles],
    standing: Array,
    com: Array,
    start: Array | None = None,
) -> Array:
    """Return configurations near given ones, with placements of both soles and of the centre of mass (T, 3), m.

    Least squares over all joints and the base, frame by frame, at a margin to the joint limits, rad, half the range at
    the most: joints there that the gradient pushes on stay while the others are solved for. `standing` (T, 2) is 1
    where a sole stands and 0 in the air; in between the weights change geometrically. The search begins at `start`, or
    at the given configurations; these and the result have shape (T, nq).

    Source: D. P. Bertsekas, SIAM J. Control 20(2), 1982 (projected Newton steps); T. Sugihara, T-RO 27(5), 2011
    (damping by the error that is left: far from a solution steps stay small).
    """
    model, data, result = robot.model, robot.model.createData(), (q if start is None else start).copy()
    frames = [robot.frame_id(sole.frame) for sole in robot.soles[:2]]
    trunk = list(dict.fromkeys(robot.frame_id(frame) for frame in (robot.base_frame, robot.torso_frame)))
    room = np.minimum(margin, 0.5 * (robot.position_upper - robot.position_lower))
    lower, upper = robot.position_lower + room, robot.position_upper - room
    posture = np.concatenate([np.full(BASE_DOF, 1e-6), np.full(robot.na, JOINTS)])
    posture[BASE_DOF + np.array(robot.leg_joints)] = LEGS
    weights = np.sqrt(SWING * (STANCE / SWING) ** standing)
    for i, reference in enumerate(q):
        each = result[i]
        np.clip(each[7:], lower, upper, out=each[7:])
        pin.framesForwardKinematics(model, data, reference)
        upright = [data.oMf[frame].rotation.copy() for frame in trunk]
        for _ in range(ITERATIONS):
            pin.computeJointJacobians(model, data, each)
            pin.updateFramePlacements(model, data)
            rows = [np.sqrt(COM) * pin.jacobianCenterOfMass(model, data, each)]
            errors = [np.sqrt(COM) * (com[i] - data.com[0])]
            for frame, sole, weight in zip(frames, soles[i], weights[i], strict=True):
                errors.append(weight * pin.log6(data.oMf[frame].actInv(sole)).vector)
                rows.append(weight * pin.getFrameJacobian(model, data, frame, pin.LOCAL))
            for frame, rotation in zip(trunk, upright, strict=True):
                errors.append(np.sqrt(ORIENTATION) * pin.log3(data.oMf[frame].rotation.T @ rotation))
                rows.append(np.sqrt(ORIENTATION) * pin.getFrameJacobian(model, data, frame, pin.LOCAL)[3:])
            jacobian, error = np.vstack(rows), np.concatenate(errors)
            near = pin.difference(model, each, reference)
            near[:BASE_DOF] = 0.0
            hessian = jacobian.T @ jacobian
            hessian[np.diag_indices(model.nv)] += posture + float(error @ error)
            gradient = jacobian.T @ error + posture * near
            joints, push = each[7:], gradient[BASE_DOF:]
            held = ((joints >= upper) & (push > 0.0)) | ((joints <= lower) & (push < 0.0))
            free = np.concatenate([range(BASE_DOF), BASE_DOF + np.flatnonzero(~held)])
            step = np.zeros(model.nv)
            step[free] = np.linalg.solve(hessian[np.ix_(free, free)], gradient[free])
            each[:] = pin.integrate(model, each, step)
            np.clip(joints, lower, upper, out=joints)
            if abs(step).max() < SMALL:
                break
    return result
