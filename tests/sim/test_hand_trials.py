"""Trials of hands: a press that is held, the way of a cart, bad input refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wbc.core.errors import InputError
from wbc.core.robot import GRAVITY
from wbc.sim.hands import (
    CartSpec,
    CartTrial,
    HandPressSpec,
    HandPressTrial,
    open_door,
    push_cart,
)
from wbc.tasks.stabilizer.zmp import zmp_offset
from wbc.walking import HandSettings


@pytest.mark.slow
def test_a_press_on_a_wall_is_held_and_the_feet_take_their_part_of_it() -> None:
    hands = HandSettings(reach=1.5, ramp=2.5, edge=0.5)
    trial = HandPressTrial(HandPressSpec(on="wall", force=30.0, seconds=0.5, noise="none", hands=hands))
    result = trial.run()
    assert result.stage == "done" and result.upright and not result.lost
    assert result.held_s == pytest.approx(0.5) and result.within == 1.0
    assert 27.0 < result.least_N <= result.mean_N <= result.greatest_N < 33.0
    # Half of the way to the edge of the soles is the ZMP's, the rest that of the centre of mass.
    place = trial.plant.data.site("left_hand site").xpos
    wrench = np.array((-30.0, 0.0, 0.0, 0.0, -30.0 * place[2], 0.0))
    whole = -zmp_offset(wrench, np.zeros(3), trial.robot.mass * GRAVITY)[0]
    assert trial.hands.shift[0] == pytest.approx(whole - 0.25 * trial.robot.soles[0].length, abs=4e-3)


@pytest.mark.parametrize("angle", [0.5, -0.2, 0.06])
def test_a_cart_is_turned_about_its_own_middle(angle: float) -> None:
    trial = CartTrial(CartSpec())
    start = trial.stand()
    plan = trial._turning(start, angle)
    last = {"left": start.left, "right": start.right} | {step.side: step for step in plan.steps}
    yaw = 0.5 * (last["left"].yaw + last["right"].yaw)
    middle = 0.5 * np.array([last["left"].x + last["right"].x, last["left"].y + last["right"].y])
    assert yaw == pytest.approx(angle, abs=1e-3)
    arm = float(trial._goal.translation[0])  # the cart's middle, as the robot stands at the origin
    assert middle + arm * np.array([math.cos(yaw), math.sin(yaw)]) == pytest.approx([arm, 0.0], abs=0.02)


@pytest.mark.slow
def test_feet_that_slip_under_a_cart_turn_on_until_the_gyroscope_is_satisfied() -> None:
    turn = {"forward": 0.0, "back": 0.0, "turn": 20.0}
    once = push_cart(**turn, corrections=0)
    again = push_cart(**turn)
    assert once.stage == again.stage == "done"
    assert abs(once.heading_error_deg) > 3.0, "the feet slip"
    assert again.corrections > 0 and abs(again.heading_error_deg) < 2.5


@pytest.mark.slow
def test_a_door_is_opened_by_its_handle_and_walked_through() -> None:
    result = open_door()
    assert result.stage == "done" and result.upright
    assert result.open_deg > 80.0 > result.released_deg > 10.0, "by the handle, then by the other hand"
    assert result.beyond_mm > 1000.0, "it stands behind the frame"


def test_a_force_that_a_sudden_loss_would_not_leave_standing_is_refused() -> None:
    with pytest.raises(InputError, match="a sudden loss of 60 N"):
        push_cart(limit=60.0, noise="none")
