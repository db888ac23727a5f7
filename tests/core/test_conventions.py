"""The translation between our states and MuJoCo's."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from wbc.core import conventions

JOINTS = 4
BODY = """
<mujoco><option gravity="0 0 0"/><worldbody><body>
  <freejoint/><inertial pos="0.1 -0.2 0.05" mass="3" diaginertia="0.1 0.2 0.25"/>
</body></worldbody></mujoco>
"""


def random_state(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    q = rng.normal(size=7 + JOINTS)
    quaternion = rng.normal(size=4)
    q[3:7] = quaternion / np.linalg.norm(quaternion)
    return q, rng.normal(size=6 + JOINTS)


def shuffled(rng: np.random.Generator) -> np.ndarray:
    """Places of the joints in a larger MuJoCo model, as when feet bring joints of their own."""
    return rng.permutation(np.arange(6, 6 + 2 * JOINTS))[:JOINTS]


@pytest.mark.parametrize("with_map", [False, True])
def test_there_and_back_is_the_identity(with_map: bool) -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        q, v = random_state(rng)
        dof = shuffled(rng) if with_map else None
        qpos_index = None if dof is None else dof + 1
        size = 6 + (2 * JOINTS if with_map else JOINTS)
        qpos = conventions.configuration_to_mujoco(q, qpos_index, np.zeros(size + 1))
        qvel = conventions.velocity_to_mujoco(q, v, dof, np.zeros(size))
        np.testing.assert_array_equal(conventions.configuration_from_mujoco(qpos, qpos_index), q)
        np.testing.assert_allclose(conventions.velocity_from_mujoco(q, qvel, dof), v, atol=1e-14)


def test_the_rotation_is_pinocchios() -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        quaternion = random_state(rng)[0][3:7]
        np.testing.assert_allclose(
            conventions.rotation_of(quaternion), pin.Quaternion(quaternion).toRotationMatrix(), atol=1e-15
        )


def test_both_libraries_integrate_to_the_same_pose() -> None:
    """A twist held for a while: q ⊕ v dt here and mj_integratePos there end in the same place for small dt."""
    rng = np.random.default_rng(3)
    model = mujoco.MjModel.from_xml_string(BODY)
    free = pin.Model()
    free.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    dt = 1e-5
    for _ in range(20):
        q, v = random_state(rng)[0][:7], rng.normal(size=6)
        qpos = conventions.configuration_to_mujoco(q)
        mujoco.mj_integratePos(model, qpos, conventions.velocity_to_mujoco(q, v), dt)
        expected = pin.integrate(free, q, v * dt)
        reached = conventions.configuration_from_mujoco(qpos)
        np.testing.assert_allclose(reached, expected, atol=10 * dt**2)
        assert np.abs(reached - q).max() > 1e-7


def test_writing_in_place_keeps_what_is_not_ours() -> None:
    rng = np.random.default_rng(6)
    q, v = random_state(rng)
    dof = np.array([6, 8, 9, 11])
    qpos, qvel = np.full(15, 7.0), np.full(14, 7.0)
    assert conventions.configuration_to_mujoco(q, dof + 1, qpos) is qpos
    assert conventions.velocity_to_mujoco(q, v, dof, qvel) is qvel
    others = [7, 10, 12, 13]
    assert (qvel[others] == 7.0).all()
    assert (qpos[[i + 1 for i in others]] == 7.0).all()
    np.testing.assert_array_equal(qvel[dof], v[6:])
