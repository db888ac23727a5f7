"""Figures of policies by closed forms: loads of feet, velocities that lack, clocks, what a network is refused for."""

from __future__ import annotations

import math
from pathlib import Path
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
from wbc.policy.steering import Steering

N = len(LEGS)


@pytest.mark.parametrize(("ratio", "carries"), [(0.999, False), (1.001, True)])
def test_a_foot_carries_from_a_share_of_the_weight_on(ratio: float, carries: bool) -> None:
    robot = G1.robot()
    contacts = FootContacts(robot, DT)
    contacts.update((ratio * CARRIES * robot.mass * GRAVITY, 1e3))
    assert contacts.air[0] == (0.0 if carries else DT) and contacts.swing == (None if carries else 0)


@pytest.mark.parametrize(("ticks", "steps"), [(round(STEP / DT) - 1, 0), (round(STEP / DT) + 1, 1)])
def test_a_landing_counts_after_a_tenth_of_a_second_in_the_air(ticks: int, steps: int) -> None:
    contacts = FootContacts(G1.robot(), DT)
    for _ in range(ticks):
        contacts.update((0.0, 1e3))
    assert contacts.air[0] == pytest.approx(ticks * DT)
    contacts.update((1e3, 1e3))
    assert contacts.steps_done == steps and contacts.landed[0] == pytest.approx(DT)


def test_what_lacks_of_a_velocity_is_counted_along_the_heading() -> None:
    """A robot that walks with (0.3, 0.1) m/s in the world under a heading of 0.5 rad."""

    class Walking:
        base_frame = "pelvis"
        com_velocity = np.array([0.3, 0.1, 0.0])

        def placement(self, frame: str) -> pin.SE3:
            return pin.SE3(pin.utils.rotate("z", 0.5), np.zeros(3))

    description = described(fastest=(2.0, 2.0, 2.0))
    steering = Steering(description, regain=0.8)
    steering.velocity = (0.5, -0.2, 0.3)
    steering.tick(Walking())  # type: ignore[arg-type]
    cos, sin = math.cos(0.5), math.sin(0.5)
    own = np.array([cos * 0.3 + sin * 0.1, cos * 0.1 - sin * 0.3])
    lack = description.period * 0.8 * (np.array([0.5, -0.2]) - own)
    np.testing.assert_allclose(steering.command, [0.5 + lack[0], -0.2 + lack[1], 0.3], atol=1e-12)


def test_what_lacks_makes_no_stand_of_a_walk_and_is_forgotten_with_its_direction() -> None:
    """A robot that is pulled ahead faster than it is asked to go is asked for less, and never to stand or go back."""

    class Pulled:
        base_frame = "pelvis"
        com_velocity = np.array([1.0, 0.1, 0.0])

        def placement(self, frame: str) -> pin.SE3:
            return pin.SE3.Identity()

    steering = Steering(described(phase=0.8), regain=0.5)
    steering.velocity = (0.2, 0.0, 0.0)
    phases = []
    for _ in range(100):
        steering.tick(Pulled())  # type: ignore[arg-type]
        phases.append(steering.clock.phase.tolist())
    assert steering.command[0] == 0.0 and steering.command[1] < -0.05
    assert all(abs(abs(left - right) - math.pi) < 1e-9 for left, right in phases)  # its feet take turns
    steering.velocity = (0.2, 0.0, 0.0)  # again the same, as a page sends it
    steering.tick(Pulled())  # type: ignore[arg-type]
    assert steering.command[0] == 0.0
    steering.velocity = (-0.3, 0.0, 0.0)
    np.testing.assert_array_equal(steering.command, [-0.3, 0.0, 0.0])
    steering.tick(Pulled())  # type: ignore[arg-type]
    assert steering.command[0] == pytest.approx(-0.3 - 0.02 * 0.5 * 1.3)
    assert steering.command[1] < -0.05


@pytest.mark.parametrize(
    ("velocity", "runs"), [((0.3, 0.0, 0.0), True), ((0.0, 0.0, 0.005), False), (None, False)]
)
def test_the_clock_runs_while_any_velocity_is_asked_for(
    velocity: tuple[float, ...] | None, runs: bool
) -> None:
    plant, policy = control(Known(9 + 3 * N, N), described(phase=0.8))
    policy.velocity = velocity
    for _ in ticks(0.06):
        plant.step(policy.command(plant.measure()))
    assert (np.abs(policy.observed.phase[0] - math.pi) > 0.1) == runs


@pytest.mark.parametrize("shape", [(), (1,), (1, N), (N + 1,)])
def test_an_action_of_another_shape_is_that_of_no_joint(shape: tuple[int, ...]) -> None:
    network = Known(9 + 3 * N, N)
    plant, policy = control(network, described())
    policy.command(plant.measure())
    network.action = np.ones(shape, np.float32)
    for _ in range(10):
        policy.command(plant.measure())
    assert "shape" in str(policy.network_error) and not policy.observed.action.any()


@pytest.mark.parametrize(
    "options",
    [{"regain": 0.5}, {"arms": ARMS}, {"arms": ARMS, "sees_arms": True}, {"filter": PolicyFilter(ARMS)}],
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
    policy = control(Linear(14 + 2 * N, N), described(observation=seen, phase=0.8, default=rest), **options)[
        1
    ]

    def run(*velocity: float) -> np.ndarray:
        plant, torques = wbc.Plant(G1, control_period=DT, noise="none", visuals=False), []
        for _ in ticks(0.3):
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
