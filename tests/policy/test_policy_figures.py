"""Figures of policies by closed forms: loads of feet, velocities that lack, clocks, what a network is refused for."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from made_policies import (
    ARMS,
    DT,
    G1,
    LEGS,
    REST,
    Known,
    control,
    described,
    ticks,
    write_network,
    write_tracker,
)

import wbc
from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY
from wbc.policy import OnnxNetwork, PolicyFilter, Term
from wbc.policy.contacts import CARRIES, STEP, FootContacts
from wbc.policy.steering import PolicySteering
from wbc.walking.contact import GaitPhase

N = len(LEGS)


def test_a_foot_carries_from_a_share_of_the_weight_on() -> None:
    least = CARRIES * G1.robot().mass * GRAVITY
    for ratio, air, swing in ((0.999, DT, 0), (1.001, 0.0, None)):
        contacts = FootContacts(G1.robot(), DT)
        contacts.update((ratio * least, 1e3))
        assert contacts.air[0] == air and contacts.swing == swing


def test_steps_of_a_policy_are_counted_by_the_loads_of_its_feet() -> None:
    contacts = FootContacts(G1.robot(), DT)
    weight = G1.robot().mass * 9.81
    assert contacts.progress.phase is GaitPhase.STANDING
    for _ in range(3):  # left, right, left swing for 0.4 s each; the right one bounces in between
        for loads, seconds in (((0.0, weight), 0.4), ((0.5 * weight, 0.5 * weight), 0.05)):
            for _ in ticks(seconds):
                contacts.update(loads)
    assert contacts.steps_done == 3 and contacts.progress.phase is GaitPhase.DOUBLE
    for seconds, steps in ((STEP - DT, 3), (STEP + DT, 4)):  # thrown off the ground for a moment, or a step
        for _ in ticks(seconds):
            contacts.update((weight, 0.0))
        assert contacts.progress.swing == 1 and contacts.air == pytest.approx([0.0, seconds])
        contacts.update((0.5 * weight, 0.5 * weight))
        assert contacts.steps_done == steps and contacts.landed[1] == pytest.approx(DT)


def moving(x: float, y: float, yaw: float = 0.0) -> Any:
    """Return a robot whose CoM moves in the world, m/s, under a heading, rad."""
    base = pin.SE3(pin.utils.rotate("z", yaw), np.zeros(3))
    return SimpleNamespace(
        base_frame="pelvis", com_velocity=np.array([x, y, 0.0]), placement=lambda frame: base
    )


def test_what_lacks_of_a_velocity_is_counted_along_the_heading() -> None:
    """A robot that walks with (0.3, 0.1) m/s in the world under a heading of 0.5 rad."""
    description = described(fastest=(2.0, 2.0, 2.0))
    steering = PolicySteering(description, regain=0.8)
    steering.velocity = (0.5, -0.2, 0.3)
    steering.tick(moving(0.3, 0.1, 0.5))
    cos, sin = math.cos(0.5), math.sin(0.5)
    own = np.array([cos * 0.3 + sin * 0.1, cos * 0.1 - sin * 0.3])
    lack = description.period * 0.8 * (np.array([0.5, -0.2]) - own)
    np.testing.assert_allclose(steering.command, [0.5 + lack[0], -0.2 + lack[1], 0.3], atol=1e-12)


def test_what_lacks_makes_no_stand_of_a_walk_and_is_forgotten_with_its_direction() -> None:
    """A robot that is pulled ahead faster than it is asked to go is asked for less, and never to stand or go back."""
    steering, pulled = PolicySteering(described(phase=0.8), regain=0.5), moving(1.0, 0.1)
    steering.velocity = (0.2, 0.0, 0.0)
    phases = []
    for _ in range(100):
        steering.tick(pulled)
        phases.append(steering.phase.tolist())
    assert steering.command[0] == 0.0 and steering.command[1] < -0.05
    assert all(abs(abs(left - right) - math.pi) < 1e-9 for left, right in phases)  # its feet take turns
    steering.velocity = (0.2, 0.0, 0.0)  # again the same, as a page sends it
    steering.tick(pulled)
    assert steering.command[0] == 0.0
    steering.velocity = (-0.3, 0.0, 0.0)
    np.testing.assert_array_equal(steering.command, [-0.3, 0.0, 0.0])
    steering.tick(pulled)
    assert steering.command[0] == pytest.approx(-0.3 - 0.02 * 0.5 * 1.3)
    assert steering.command[1] < -0.05


def test_the_clock_runs_while_any_velocity_is_asked_for_and_the_feet_are_half_a_period_apart() -> None:
    steering, robot = PolicySteering(described(phase=0.8), regain=0.0), moving(0.0, 0.0)
    for velocity in ((0.3, 0.0, 0.0), None, (0.0, 0.0, 0.005), (0.0, 0.0, -0.1)):
        assert (steering.phase == math.pi).all()
        steering.velocity = velocity
        for k in range(50):
            steering.tick(robot)
            turned = 2.0 * math.pi * 0.02 * k / 0.8
            cosines = (math.cos(turned), -math.cos(turned))
            runs = velocity is not None and max(np.abs(velocity)) > 0.01
            np.testing.assert_allclose(np.cos(steering.phase), cosines if runs else (-1.0, -1.0), atol=1e-9)
            assert (np.abs(steering.phase) <= math.pi + 1e-12).all()
        steering.velocity = None
        steering.tick(robot)
    steering.velocity = (0.3, 0.0, 0.0)
    steering.tick(robot), steering.tick(robot)
    steering.begin()
    assert (steering.phase == math.pi).all()
    steering.tick(robot)
    np.testing.assert_allclose(steering.phase, [0.0, math.pi])


def test_an_action_of_another_shape_is_that_of_no_joint() -> None:
    network = Known(9 + 3 * N, N)
    plant, policy = control(network, described())
    policy.command(measurement := plant.measure())
    for shape in ((), (1,), (1, N), (N + 1,)):
        policy.reset()
        network.action = np.ones(shape, np.float32)
        for _ in ticks(0.02):
            policy.command(measurement)
        assert f"got {shape}" in str(policy.network_error) and not policy.observed.action.any()


@pytest.mark.parametrize(
    "options",
    [{"regain": 0.5, "arms": ARMS, "sees_arms": True}, {"filter": PolicyFilter(ARMS)}],
)
def test_a_policy_that_is_reset_is_as_a_fresh_one(options: dict[str, Any]) -> None:
    """The observer alone keeps something: the bias of the gyroscope, which is nearly zero."""
    seen = [
        Term("gravity", history=3),
        Term("command"),
        Term("phase_sine"),
        Term("joint_velocity"),
        Term("last_action"),
    ]
    weights = 0.05 * np.random.default_rng(0).normal(size=(N, 14 + 2 * N)).astype(np.float32)

    class Linear(Known):
        def __call__(self, observation: np.ndarray) -> np.ndarray:
            return weights @ observation

    rest = [REST[name] for name in LEGS]
    description = described(observation=seen, phase=0.8, default=rest)
    policy = control(Linear(14 + 2 * N, N), description, **options)[1]

    def run(*velocity: float) -> np.ndarray:
        plant, torques = wbc.Plant(G1, control_period=DT, noise="none", visuals=False), []
        for _ in ticks(0.2):
            policy.velocity = velocity
            plant.step(command := policy.command(plant.measure()))
            torques.append(np.concatenate((command.joint_torque, command.joint_position)))
        return np.array(torques)

    fresh = run(0.2, 0.1, 0.0)
    policy.reset()
    run(-0.3, 0.2, 0.4)
    policy.reset()
    np.testing.assert_allclose(run(0.2, 0.1, 0.0), fresh, atol=1e-3)


def test_a_network_says_how_long_it_takes(tmp_path: Path) -> None:
    network = OnnxNetwork(write_network(tmp_path / "a.onnx", np.zeros((2, 3))))
    assert 0.0 < network.took < 5.0  # s


@pytest.mark.parametrize("lacks", ["body_pos_w", "body_quat_w"])
def test_a_motion_without_places_is_none(lacks: str, tmp_path: Path) -> None:
    tables = {"joint_pos": np.zeros((4, 2)), "joint_vel": np.zeros((4, 2))}
    tables |= {"body_pos_w": np.zeros((4, 1, 3)), "body_quat_w": np.ones((4, 1, 4))}
    whole = OnnxNetwork(write_tracker(tmp_path / "whole.onnx", tables, 3))
    assert whole.holds_motion
    del tables[lacks]
    with pytest.raises(InputError, match="lacks outputs of a motion"):
        OnnxNetwork(write_tracker(tmp_path / "less.onnx", tables, 3))
