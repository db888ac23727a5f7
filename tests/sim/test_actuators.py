"""Commands of joints to the actuators of a model of one's own: laws, ranges and kinds, against MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from foreign import KINDS, foreign_model
from properties import each_once

import wbc
from wbc import Command
from wbc.sim import MujocoLoop

DESCRIPTION = wbc.load_robot("hrp4_class")
PREFIX = "mine/"


@pytest.mark.parametrize(("kind", "given"), each_once(KINDS, ("gains", "torque")))
def test_computed_servos_act_on_the_state_at_the_end_of_a_step(kind: str, given: str) -> None:
    """τ + kp (q_ref − q) + kd (q̇_ref − q̇) of the state after the step, as far as the last one foretells it."""
    model = foreign_model(DESCRIPTION, kind, integrator="euler", gear=3.0)
    model.opt.gravity[:], model.jnt_actfrclimited[:] = 0.0, 0
    loop = MujocoLoop(DESCRIPTION, model, prefix=PREFIX, control_period=0.001)
    robot, rng = loop.robot, np.random.default_rng(1)
    up = robot.half_sitting.copy()
    up[2] += 1.0
    loop.reset(up)
    for _ in range(3):  # until the joints move
        loop.step(Command(rng.normal(0.0, 3.0, robot.na)))
    assert np.abs(loop.joint_velocity).max() > 0.05
    kp, kd = rng.uniform(50.0, 300.0, robot.na), rng.uniform(1.0, 5.0, robot.na)
    position = loop.joint_position + 0.01 * rng.normal(size=robot.na)
    velocity, torque = 0.1 * rng.normal(size=robot.na), rng.normal(size=robot.na)
    if given == "gains":
        loop.step(Command(torque, position, velocity, kp=kp, kd=kd))
        law = torque + kp * (position - loop.joint_position) + kd * (velocity - loop.joint_velocity)
    else:
        loop.step(Command(torque))
        law = torque
    if kind == "none":
        law = np.clip(law, robot.torque_lower, robot.torque_upper)
    # A torque that is cut off lets the others move otherwise than foretold.
    np.testing.assert_allclose(loop.joint_torque, law, atol=1e-4 if kind != "none" else 5e-3)


@pytest.mark.parametrize("kind", ["motor", "position", "general", "velocity"])
def test_ranges_of_controls_leave_the_torques_that_mujoco_gives_at_their_ends(kind: str) -> None:
    model = foreign_model(DESCRIPTION, kind, gear=-2.0)
    model.jnt_actfrclimited[:] = 0
    loop = MujocoLoop(DESCRIPTION, model, prefix=PREFIX)
    q = loop.robot.half_sitting[7:] + np.linspace(-0.2, 0.2, loop.robot.na)
    least, most = loop.actuators.reach(q)
    assert np.isinf(least).all() and np.isinf(most).all()
    model.actuator_ctrllimited[1:] = 1  # but for the door's
    model.actuator_ctrlrange[:] = np.random.default_rng(0).uniform(0.1, 0.9, (model.nu, 2)) * [-1.0, 1.0]
    least, most = loop.actuators.reach(q)
    data, found = mujoco.MjData(model), []
    data.qpos[loop.places.joint_qpos] = q
    for end in range(2):
        data.ctrl[:] = model.actuator_ctrlrange[:, end]
        mujoco.mj_forward(model, data)
        found.append(data.qfrc_actuator[loop.places.joint_dof])
    np.testing.assert_allclose(least, np.minimum(*found), atol=1e-9)
    np.testing.assert_allclose(most, np.maximum(*found), atol=1e-9)
    assert (most > least).all()
    names = {"motor": "motor", "position": "position", "general": "position", "velocity": "velocity"}
    assert set(loop.actuators.kinds) == {names[kind]}


def test_a_joint_without_a_drive_and_one_with_two_say_so() -> None:
    bare = MujocoLoop(DESCRIPTION, foreign_model(DESCRIPTION, "none"), prefix=PREFIX)
    assert set(bare.actuators.kinds) == {"none"} and not bare.actuators.servo.any()
    mixed = MujocoLoop(DESCRIPTION, foreign_model(DESCRIPTION, "mixed"), prefix=PREFIX)
    kinds = np.array(mixed.actuators.kinds)
    assert set(kinds) == {"motor", "position + velocity"}
    np.testing.assert_array_equal(mixed.actuators.servo, kinds != "motor")
