"""Targets two metres away: a standing robot reaches as far as it can, and stands."""

from __future__ import annotations

import numpy as np
import pytest

import wbc


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["hrp4_class", "talos", "g1"])
@pytest.mark.parametrize("mode", ["position", "torque"])
@pytest.mark.parametrize("offset", [(2.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, -2.0)])
def test_a_hand_sent_two_metres_away_makes_no_robot_fall(
    robot: str, mode: str, offset: tuple[float, ...]
) -> None:
    description = wbc.load_robot(robot)
    plant = wbc.Plant(description, control_period=0.005 if mode == "position" else 0.002)
    model = description.robot()
    controller = wbc.balance_controller(model, plant.control_period)
    control = (wbc.PositionControl if mode == "position" else wbc.TorqueControl)(controller)
    hand = controller.add(wbc.PositionTask(model.frames["left_hand"], weight=10.0, stiffness=100.0))
    hand.target = hand.target + offset
    before = np.array(plant.truth().com[:2])
    while plant.time < 4.0:
        plant.step(control.command(plant.measure()))
    assert np.linalg.norm(plant.truth().com[:2] - before) < 0.03
    assert abs(hand.error).max() > 0.5, "it is out of reach"
