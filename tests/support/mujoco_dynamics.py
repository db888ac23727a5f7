"""Accelerations, forces and mass matrices between our states and MuJoCo's, to compare the dynamics of both."""

from __future__ import annotations

import numpy as np

from wbc.core.conventions import Index, rotation_of, velocity_from_mujoco, velocity_to_mujoco
from wbc.core.errors import Array


def acceleration_to_mujoco(
    q: Array, v: Array, a: Array, joint_dof: Index | None = None, out: Array | None = None
) -> Array:
    """Translate an acceleration: the derivative of the world velocity gains the term R (ω × v).

    Args:
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        a: Acceleration v̇, shape (nv,).
        joint_dof: Place in `qacc` of each actuated joint, shape (na,).
        out: MuJoCo's `qacc` to write into (other entries are kept).

    Returns:
        `out`, or a new array of shape (nv,).
    """
    qacc = velocity_to_mujoco(q, a, joint_dof, out)
    qacc[0:3] += rotation_of(q[3:7]) @ np.cross(v[3:6], v[0:3])
    return qacc


def acceleration_from_mujoco(
    q: Array, v: Array, qacc: Array, joint_dof: Index | None = None, out: Array | None = None
) -> Array:
    """Translate MuJoCo's `qacc`; the inverse of `acceleration_to_mujoco`.

    Args:
        q: Configuration, shape (nq,).
        v: Velocity (ours, not `qvel`), shape (nv,).
        qacc: MuJoCo's accelerations.
        joint_dof: Place in `qacc` of each actuated joint, shape (na,).
        out: Acceleration to write into.

    Returns:
        Acceleration v̇, shape (nv,).
    """
    a = velocity_from_mujoco(q, qacc, joint_dof, out)
    a[0:3] -= np.cross(v[3:6], v[0:3])
    return a


def force_from_mujoco(
    q: Array, qfrc: Array, joint_dof: Index | None = None, out: Array | None = None
) -> Array:
    """Translate generalised forces, τ = Tᵀ τ_mujoco.

    T is orthogonal in the base block and the identity elsewhere, so that forces translate as velocities do.

    Args:
        q: Configuration, shape (nq,).
        qfrc: MuJoCo's generalised forces.
        joint_dof: Place in `qfrc` of each actuated joint, shape (na,).
        out: Forces to write into.

    Returns:
        Generalised forces, shape (nv,), base wrench in the base frame.
    """
    return velocity_from_mujoco(q, qfrc, joint_dof, out)


def mass_matrix_from_mujoco(q: Array, mass_matrix: Array, joint_dof: Index | None = None) -> Array:
    """Translate a joint-space inertia, M = Tᵀ M_mujoco T.

    Args:
        q: Configuration, shape (nq,).
        mass_matrix: MuJoCo's full mass matrix (`mj_fullM`).
        joint_dof: Place in `qvel` of each actuated joint, shape (na,).

    Returns:
        Mass matrix, shape (nv, nv).
    """
    if joint_dof is None:
        matrix = np.array(mass_matrix)
    else:
        places = np.concatenate([np.arange(6), joint_dof])
        matrix = mass_matrix[np.ix_(places, places)]
    rotation = rotation_of(q[3:7])
    matrix[:3] = rotation.T @ matrix[:3]
    matrix[:, :3] = matrix[:, :3] @ rotation
    return matrix
