"""Steering: velocities and goals as velocities of the steps."""

from __future__ import annotations

import math
from dataclasses import replace

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


def test_a_brisk_walk_has_longer_and_slower_steps_and_none_beyond_the_stride(
    settings: SteppingSettings,
) -> None:
    steering = Steering(replace(settings, fastest=9.0, fastest_back=9.0), 0.0, DT)
    most = steering.limits.forward
    assert settings.brisk < most == steering.limits.back < 9.0
    steering.velocity = (most, 0.0)
    assert most * steering.step_time == pytest.approx(settings.stride)
    for share in (0.5, 1.0, 1.2):  # of the velocity from which a walk is brisk
        steering.velocity = (-share * settings.brisk, 0.0)
        assert steering.step_time == settings.step_time * math.sqrt(max(share, 1.0))
    short = replace(settings, fastest=9.0, stride=0.5 * settings.step_time * settings.brisk)
    assert Steering(short, 0.0, DT).limits.forward == pytest.approx(0.5 * settings.brisk)
