"""Reference of the swing foot: a motion whose derivatives are its own, replanned to landings that move."""

from __future__ import annotations

import numpy as np
import pytest
from point_mass import SCALE

from wbc.walking.stepping.settings import SteppingSettings
from wbc.walking.stepping.swing import MOST_ACCELERATION, SwingReference

DT = 0.002
SETTINGS = SteppingSettings().in_si(SCALE)
TIME, SPEED = SETTINGS.step_time, SETTINGS.landing_speed


def swing(
    landing: tuple[float, float],
    *,
    seconds: float,
    ground: float = 0.0,
    move: float = 0.0,
    speed: float = SPEED,
) -> np.ndarray:
    """Places, velocities and accelerations (x, y, z) at all ticks, shape (ticks, 3, 3); the landing moves half way."""
    reference, rows = SwingReference(SETTINGS, DT), []
    reference.lift((0.0, 0.0, 0.0))
    for tick in range(1, round(seconds / DT) + 1):
        elapsed = tick * DT
        goal = (landing[0] + move * (elapsed > 0.5 * TIME), landing[1])
        reference.travel(elapsed, TIME, goal)
        reference.rise(elapsed, TIME, ground, speed)
        z = reference.height
        rows.append(
            [
                [*reference.place, z[0]],
                [*reference.velocity, z[1]],
                [*reference.acceleration, z[2]],
            ]
        )
    return np.array(rows)


def test_velocity_and_acceleration_are_derivatives_of_the_place() -> None:
    motion = swing((0.3, 0.1), seconds=0.99 * TIME)
    place, velocity, acceleration = motion[:, 0], motion[:, 1], motion[:, 2]
    middle = slice(3, round(0.6 * TIME / DT))  # before the foot follows its landing
    np.testing.assert_allclose(np.gradient(place, DT, axis=0)[middle], velocity[middle], atol=0.03)
    np.testing.assert_allclose(
        np.gradient(velocity, DT, axis=0)[middle, :2], acceleration[middle, :2], atol=2.0
    )
    assert np.abs(np.diff(place[:, 2])).max() < 2.0 * DT, "the height does not jump"


@pytest.mark.parametrize("move", [0.0, 0.05])
def test_the_foot_arrives_where_it_is_to_land_also_if_the_landing_moves(move: float) -> None:
    motion = swing((0.3, -0.1), seconds=TIME, move=move)
    np.testing.assert_allclose(motion[-1, 0, :2], (0.3 + move, -0.1), atol=2e-3)
    assert np.abs(motion[-1, 1, :2]).max() < 0.15


@pytest.mark.parametrize("speed", [SPEED, SETTINGS.hardest])
def test_the_foot_rises_over_the_higher_ground_and_meets_it_in_time_with_its_speed(speed: float) -> None:
    for ground in (0.0, 0.04, -0.04):
        motion = swing((0.3, 0.1), seconds=SETTINGS.touch * TIME - 1e-3, ground=ground, speed=speed)
        height = motion[:, 0, 2]
        assert height.max() == pytest.approx(max(ground, 0.0) + SETTINGS.swing_height, abs=2e-3)
        assert np.argmax(height) * DT == pytest.approx(SETTINGS.apex * TIME, abs=2 * DT)
        assert height[-1] == pytest.approx(ground, abs=speed * DT)
        assert motion[-1, 1, 2] == pytest.approx(-speed, abs=0.06)


def test_a_foot_that_finds_no_ground_sinks_on_whatever_the_time_of_the_step_does_then() -> None:
    reference, heights = SwingReference(SETTINGS, DT), []
    reference.lift((0.0, 0.0, 0.0))
    touch = SETTINGS.touch * TIME
    for tick in range(1, round(2.0 * TIME / DT) + 1):
        elapsed = tick * DT
        time = TIME if elapsed <= touch + DT else elapsed + 0.05  # a late step is always about to end
        reference.rise(elapsed, time, 0.0, SPEED)
        heights.append(reference.height)
    late = np.array(heights)[round(touch / DT) + 2 :]
    assert (np.diff(late[:, 0]) <= 0.0).all()
    sinking = late[:, 1] < 0.0
    np.testing.assert_allclose(np.diff(late[sinking, 0]) / DT, -SETTINGS.search_speed, rtol=1e-6)
    assert late[-1, 0] == pytest.approx(-SETTINGS.search)
    assert late[-1, 1] == 0.0


def test_a_foot_that_follows_its_landing_keeps_within_its_acceleration_in_any_direction() -> None:
    ways = []
    for angle in np.linspace(0.0, 2.0 * np.pi, 7):
        reference, towards = SwingReference(SETTINGS, DT), np.array([np.cos(angle), np.sin(angle)])
        reference.lift((0.0, 0.0, 0.0))
        for _ in range(20):
            reference.travel(TIME, TIME, (0.3 * towards[0], 0.3 * towards[1]))
            assert np.hypot(*reference.acceleration) <= MOST_ACCELERATION + 1e-9
        ways.append(np.hypot(*reference.place))
        np.testing.assert_allclose(reference.place, ways[-1] * towards, atol=1e-12)
    np.testing.assert_allclose(ways, ways[0], rtol=1e-9)
