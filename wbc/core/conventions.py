"""Conventions of the library, and the only translation of states to MuJoCo's and back.

World frame: z up; metres, newtons, kilograms, radians, seconds. Gravity is `wbc.core.robot.GRAVITY` along −z.

Spatial vectors are [linear; angular], as in Pinocchio: a velocity is [v; ω], a wrench is [f; n].

Quaternions are xyzw. A configuration `q` is [base position in the world; base quaternion; joints], a velocity
`v` is [base linear velocity; base angular velocity; joint velocities], both base velocities **in the base
frame**, as Pinocchio has them. Joints keep Pinocchio's order (`Robot.joint_names`).

A sole frame lies at the centre of the sole rectangle, x forward, z up and away from the ground. A contact
wrench is what the ground does to the robot, in the sole frame, at the sole centre. `left_foot_ratio` is 1
when the left foot carries all the weight.

Errors are target − measured. Gains never depend on the control period.

MuJoCo's free joint differs in two ways: its quaternion is wxyz, and its linear velocity is that of the body's
origin **in the world** (its angular velocity is in the body frame, as here). With R the rotation of the base,

    qvel = T(q) v,    T = blockdiag(R, I, …),    qacc = T v̇ + [R (ω × v_lin); 0],    τ = Tᵀ τ_mujoco,

so that M = Tᵀ M_mujoco T. Joints are matched by name outside and by index arrays here: `joint_qpos[i]` and
`joint_dof[i]` are the places in MuJoCo's `qpos` and `qvel` of Pinocchio's i-th actuated joint, shape (na,)
(`model.jnt_qposadr`, `model.jnt_dofadr`); without them the joints follow the base in the same order. MuJoCo's
base always comes first. Arrays of MuJoCo are written into `out` if it is given: other entries, such as those of
compliant feet, are kept.

Sources: Pinocchio `JointModelFreeFlyer`; MuJoCo documentation "Computation / Floating objects", `mjJNT_FREE`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbc.base.numbers import Array

Index = NDArray[np.intp]
"""Indices of joints in an array."""


def rotation_of(quaternion: Array) -> Array:
    """Return the rotation matrix, shape (3, 3), of a unit quaternion xyzw, shape (4,)."""
    x, y, z, w = quaternion.tolist()
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def configuration_to_mujoco(q: Array, joint_qpos: Index | None = None, out: Array | None = None) -> Array:
    """Translate a configuration, shape (nq,), quaternion xyzw, to MuJoCo's `qpos`, wxyz."""
    qpos = np.empty(q.size) if out is None else out
    qpos[0:3] = q[0:3]
    qpos[3] = q[6]
    qpos[4:7] = q[3:6]
    qpos[slice(7, q.size) if joint_qpos is None else joint_qpos] = q[7:]
    return qpos


def configuration_from_mujoco(qpos: Array, joint_qpos: Index | None = None) -> Array:
    """Translate MuJoCo's `qpos`, quaternion wxyz, to a configuration, shape (nq,), xyzw."""
    joints = qpos[7:] if joint_qpos is None else qpos[joint_qpos]
    q = np.empty(7 + joints.size)
    q[0:3] = qpos[0:3]
    q[3:6] = qpos[4:7]
    q[6] = qpos[3]
    q[7:] = joints
    return q


def velocity_to_mujoco(q: Array, v: Array, joint_dof: Index | None = None, out: Array | None = None) -> Array:
    """Translate a velocity, shape (nv,), base in the base frame, at a configuration to MuJoCo's `qvel`."""
    qvel = np.empty(v.size) if out is None else out
    qvel[0:3] = rotation_of(q[3:7]) @ v[0:3]
    qvel[3:6] = v[3:6]
    qvel[slice(6, v.size) if joint_dof is None else joint_dof] = v[6:]
    return qvel


def velocity_from_mujoco(q: Array, qvel: Array, joint_dof: Index | None = None) -> Array:
    """Translate MuJoCo's `qvel` at a configuration (ours) to a velocity, shape (nv,), base in the base frame."""
    joints = qvel[6:] if joint_dof is None else qvel[joint_dof]
    v = np.empty(6 + joints.size)
    v[0:3] = rotation_of(q[3:7]).T @ qvel[0:3]
    v[3:6] = qvel[3:6]
    v[6:] = joints
    return v
