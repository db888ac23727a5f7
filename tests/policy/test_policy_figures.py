"""Figures of policies by closed forms: loads of feet, velocities that lack, clocks, what a network is refused for."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from made_policies import DT, G1, LEGS, Known, control, described, write_network, write_tracker

from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY
from wbc.policy import OnnxNetwork
from wbc.policy.contacts import CARRIES, STEP, FootContacts

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

    _, policy = control(Known(9 + 3 * N, N), described(fastest=(2.0, 2.0, 2.0)), regain=0.8)
    policy.velocity = (0.5, -0.2, 0.3)
    policy._ask_for_more(Walking())  # type: ignore[arg-type]
    cos, sin = math.cos(0.5), math.sin(0.5)
    own = np.array([cos * 0.3 + sin * 0.1, cos * 0.1 - sin * 0.3])
    lack = policy.description.period * 0.8 * (np.array([0.5, -0.2]) - own)
    np.testing.assert_allclose(policy.observed.command, [0.5 + lack[0], -0.2 + lack[1], 0.3], atol=1e-12)


@pytest.mark.parametrize(
    ("velocity", "runs"), [((0.3, 0.0, 0.0), True), ((0.0, 0.0, 0.005), False), (None, False)]
)
def test_the_clock_runs_while_any_velocity_is_asked_for(
    velocity: tuple[float, ...] | None, runs: bool
) -> None:
    plant, policy = control(Known(9 + 3 * N, N), described(phase=0.8))
    policy.velocity = velocity
    for _ in range(30):
        plant.step(policy.command(plant.measure()))
    assert (np.abs(policy.observed.phase[0] - math.pi) > 0.1) == runs


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
