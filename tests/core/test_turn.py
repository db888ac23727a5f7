"""Turn by the gyroscope alone."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.walking.hands.turn import GyroTurn


def test_a_turn_is_integrated_without_the_bias_that_was_averaged_at_rest() -> None:
    turn, vertical = GyroTurn(), np.array([0.0, np.sin(0.1), np.cos(0.1)])  # an IMU that is tilted
    bias = 0.01
    for _ in range(200):
        turn.update(bias * vertical, vertical, True, 0.005)
    assert turn.bias == pytest.approx(bias, abs=1e-12) and turn.angle == 0.0
    for _ in range(400):
        turn.update((0.3 + bias) * vertical, vertical, False, 0.005)
    assert turn.angle == pytest.approx(0.6, abs=1e-9)
    for _ in range(20):  # a short rest: too short for a new bias
        turn.update(0.05 * vertical, vertical, True, 0.005)
    assert turn.bias == pytest.approx(bias, abs=1e-12) and turn.angle == pytest.approx(0.6, abs=1e-9)
