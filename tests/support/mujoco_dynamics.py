"""Mass matrix, bias forces and placements of our models beside MuJoCo's."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core import conventions
from wbc.core.conventions import Index, rotation_of, velocity_from_mujoco, velocity_to_mujoco
from wbc.core.robot import GRAVITY
from wbc.robots import RobotDescription


def drift_of(q: Array, v: Array, joint_dof: Index, out: Array) -> Array:
    """Return MuJoCo's accelerations of a motion without one of ours: of the base, R (ω × v)."""
    velocity_to_mujoco(q, np.zeros(v.size), joint_dof, out)
    out[0:3] += rotation_of(q[3:7]) @ np.cross(v[3:6], v[0:3])
    return out


def mass_matrix_from_mujoco(q: Array, matrix: Array) -> Array:
    """Translate a joint-space inertia, joints in our order: M = Tᵀ M_mujoco T."""
    rotation = rotation_of(q[3:7])
    matrix[:3] = rotation.T @ matrix[:3]
    matrix[:, :3] = matrix[:, :3] @ rotation
    return matrix


def assert_same_dynamics(description: RobotDescription, theirs: mujoco.MjModel, states: int = 20) -> None:
    """Compare mass matrix, bias forces and body placements with MuJoCo's own model at random states."""
    theirs.opt.gravity[:] = (0.0, 0.0, -GRAVITY)
    ours, floating = description.pinocchio_model(), description.base == "floating"
    state = mujoco.MjData(theirs)
    ids = [theirs.joint(joint).id for joint in description.joint_names]
    qpos_index, dof = theirs.jnt_qposadr[ids], theirs.jnt_dofadr[ids]
    bodies = [theirs.body(b).name for b in range(1, theirs.nbody)]
    bodies = [name for name in bodies if ours.existFrame(name, pin.FrameType.BODY)]
    assert bodies
    base = 0
    if floating:
        base = int(theirs.jnt_dofadr[theirs.jnt_type == mujoco.mjtJoint.mjJNT_FREE][-1])
        assert base in (0, 6)
        theirs.dof_armature[base : base + 6] = 0.0  # from defaults; of no robot
    coupled = [
        (theirs.joint(name), theirs.joint(coupling.leader), coupling)
        for name, coupling in description.couplings.items()
    ]
    places = [*(range(base, base + 6) if floating else ()), *dof]
    lead = np.zeros((theirs.nv, len(places)))  # their velocities by ours
    lead[places, np.arange(len(places))] = 1.0
    for follower, leader, coupling in coupled:
        lead[follower.dofadr] = coupling.ratio * lead[leader.dofadr]
    rng = np.random.default_rng(1)
    low, high = np.clip(description.position_limits, -np.pi, np.pi)
    for _ in range(states):
        quaternion, joints, v = rng.normal(size=4), rng.uniform(low, high), rng.normal(size=ours.nv)
        if floating:
            q = np.concatenate([rng.normal(size=3), quaternion / np.linalg.norm(quaternion), joints])
            qpos = conventions.configuration_to_mujoco(q, qpos_index, np.zeros(theirs.nq))
            qvel = conventions.velocity_to_mujoco(q, v, dof, np.zeros(theirs.nv))
            drift = drift_of(q, v, dof, np.zeros(theirs.nv))
        else:
            q, qpos, qvel, drift = joints, np.zeros(theirs.nq), np.zeros(theirs.nv), np.zeros(theirs.nv)
            qpos[qpos_index], qvel[dof] = q, v
        if base:  # another free body comes first
            qpos[7:14], qpos[:7] = qpos[:7].copy(), theirs.qpos0[:7]
            for vector in (qvel, drift):
                vector[6:12], vector[:6] = vector[:6].copy(), 0.0
        for follower, leader, coupling in coupled:
            qpos[follower.qposadr] = coupling.ratio * qpos[leader.qposadr] + coupling.offset
            qvel[follower.dofadr] = coupling.ratio * qvel[leader.dofadr]
        state.qpos[:], state.qvel[:] = qpos, qvel
        data = ours.createData()  # of coupled joints crba leaves some behind
        mujoco.mj_forward(theirs, state)
        product, full = np.zeros(theirs.nv), np.zeros((theirs.nv, theirs.nv))
        mujoco.mj_mulM(theirs, state, product, drift)
        mujoco.mj_fullM(theirs, state, full)
        matrix, bias = lead.T @ full @ lead, lead.T @ (state.qfrc_bias + product)
        if floating:
            matrix = mass_matrix_from_mujoco(q, matrix)
            bias = velocity_from_mujoco(q, bias)  # forces turn as velocities do
        np.testing.assert_allclose(matrix, pin.crba(ours, data, q), atol=1e-6)
        np.testing.assert_allclose(bias, pin.nonLinearEffects(ours, data, q, v), atol=1e-6)
        pin.framesForwardKinematics(ours, data, q)
        for name in bodies:
            placement = data.oMf[ours.getFrameId(name, pin.FrameType.BODY)]
            np.testing.assert_allclose(placement.translation, state.body(name).xpos, atol=1e-6)
            np.testing.assert_allclose(placement.rotation, state.body(name).xmat.reshape(3, 3), atol=1e-6)
