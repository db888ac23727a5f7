"""Steering: velocities and goals as velocities of the steps."""

from __future__ import annotations

import pytest

import wbc
from wbc.walking.stepping.settings import Scale, SteppingSettings
from wbc.walking.stepping.steering import Steering

DT = 0.002


@pytest.fixture(scope="module")
def settings() -> SteppingSettings:
    plain = SteppingSettings()
    return plain.in_si(Scale.of(wbc.load_robot("g1").robot(), plain.bend))


def test_a_velocity_after_a_goal_leaves_the_line_to_that_goal(settings: SteppingSettings) -> None:
    steering = Steering(settings, 0.0, DT)
    steering.rest((0.0, 0.0))
    steering.go_to(3.0, 0.0, 0.0)
    to_goal = steering.update((0.0, 0.1), (0.0, 0.0))  # the line to the goal begins here
    beside = steering.update((0.1, 0.3), (0.0, 0.0))
    assert abs(to_goal.velocity[1]) < 1e-9 and beside.velocity[1] < -0.05
    steering.command((0.2, 0.0, 0.0))
    steering.rest((0.1, 0.3))
    assert abs(steering.update((0.1, 0.3), (0.0, 0.0)).velocity[1]) < 1e-9
