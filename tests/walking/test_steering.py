"""Steering: velocities and goals as velocities of the steps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import wbc
from wbc.walking.steering import PathSteering
from wbc.walking.stepping.settings import RobotSize, SteppingConstants, SteppingSettings, in_si

DT = 0.002


SIZE = RobotSize.of(wbc.load_robot("g1").robot(), SteppingSettings().bend)
CONSTANTS = in_si(SteppingConstants(), SIZE)


@pytest.fixture(scope="module")
def settings() -> SteppingSettings:
    return SteppingSettings().in_si(SIZE)


def steered(settings: SteppingSettings, heading: float = 0.0) -> PathSteering:
    return PathSteering(settings, SIZE, CONSTANTS, heading, DT)


def test_a_velocity_after_a_goal_leaves_the_line_to_that_goal(settings: SteppingSettings) -> None:
    steering = steered(settings)
    steering.rest((0.0, 0.0))
    steering.go_to(3.0, 0.0, 0.0)
    to_goal = steering.update((0.0, 0.1), (0.0, 0.0))  # the line to the goal begins here
    beside = steering.update((0.1, 0.3), (0.0, 0.0))
    assert abs(to_goal.velocity[1]) < 1e-9 and beside.velocity[1] < -0.05
    steering.command((0.2, 0.0, 0.0))
    steering.rest((0.1, 0.3))
    assert abs(steering.update((0.1, 0.3), (0.0, 0.0)).velocity[1]) < 1e-9


@pytest.mark.parametrize("aside", [0.3, 1.3, -2.0])
def test_a_robot_that_the_ground_turned_aside_comes_to_its_goal(
    settings: SteppingSettings, aside: float
) -> None:
    steering = steered(settings)
    steering.rest((0.0, 0.0))
    steering.go_to(2.0, 0.0, 0.0)
    place, speed, time = (0.0, 0.0), (0.0, 0.0), 0.0
    while steering.pending and time < 60.0:
        speed = turned(steering.update(place, speed).velocity, steering.heading)
        place, time = (place[0] + DT * speed[0], place[1] + DT * speed[1]), time + DT
        if abs(time - 4.0) < 0.5 * DT:
            place = (place[0], place[1] + aside)
    assert not steering.pending and math.dist(place, (2.0, 0.0)) < 0.15


def turned(point: tuple[float, float], angle: float) -> tuple[float, float]:
    c, s = math.cos(angle), math.sin(angle)
    return c * point[0] - s * point[1], s * point[0] + c * point[1]


def drive(steering: PathSteering, yaw: float, side: float) -> list[tuple[float, ...]]:
    """Velocity, turn and go of a robot that is slower and sways to a side first, in a world turned by an angle."""
    place, steps, speed, seconds = (0.0, 0.0), [], (0.0, 0.0), 3.0
    for tick in range(round(seconds / DT)):
        step = steering.update(turned(place, yaw), turned(speed, yaw))
        x, y = step.velocity
        steps.append((x, y, steering.turn, step.go))
        sway = 0.1 * side * math.cos(8.0 * tick * DT)
        speed = turned((0.8 * x - 0.05, y + sway), steering.heading - yaw)
        place = (place[0] + DT * speed[0], place[1] + DT * speed[1])
    return steps


@pytest.mark.parametrize("order", ["velocity", "far goal", "near goal"])
def test_a_turned_and_a_mirrored_world_are_steered_as_this_one(
    settings: SteppingSettings, order: str
) -> None:
    runs = []
    for yaw, side in ((0.0, 1.0), (2.9, 1.0), (0.0, -1.0)):
        steering = steered(settings, yaw)
        steering.rest((0.0, 0.0))
        if order == "velocity":
            steering.command((0.25, side * 0.05, side * 0.2))
        else:
            x, y = (2.5, side * 0.9) if order == "far goal" else (0.15, side * -0.1)
            steering.go_to(*turned((x, y), yaw), yaw + side * 0.4)
        runs.append(np.array(drive(steering, yaw, side)))
    np.testing.assert_allclose(runs[1], runs[0], atol=1e-9)
    np.testing.assert_allclose(runs[2], runs[0] * (1.0, -1.0, -1.0, 1.0), atol=1e-9)


@pytest.mark.parametrize("effort", [0.2, 0.4, 0.6, 3.0])
def test_a_velocity_is_granted_as_far_as_legs_reach_and_hips_have_torque_in_the_time(
    settings: SteppingSettings, effort: float
) -> None:
    steering, longest = steered(replace(settings, effort=effort)), settings.longest * settings.step_time
    most = steering.limits.forward
    steering.velocity = (most, 0.0)
    time = steering.step_time
    assert most * time <= SIZE.stride + 1e-6 and time <= longest + 1e-6
    assert most * time == pytest.approx(SIZE.stride) or time == pytest.approx(longest)
    least = effort * SIZE.swing * (CONSTANTS.late_touch * time) ** 2 * math.sqrt(3.0) / 10.0
    assert 2.0 * most * time <= least + 1e-6, "the way of the foot with the torque of the hip"
    assert most <= steered(replace(settings, effort=1.1 * effort)).limits.forward


def test_steps_take_longer_about_the_speed_at_which_a_walk_becomes_fast(settings: SteppingSettings) -> None:
    steering, quick, found = steered(settings), CONSTANTS.quick, []
    for speed in (0.0, 0.5 * quick, quick, 1.5 * quick, 2.0 * quick):
        for way in (1.0, -1.0):
            steering.velocity = (way * speed, 0.0)
            found.append((steering.step_time / settings.step_time, steering.haste))
    assert found[::2] == found[1::2], "forward and back"
    times, hastes = zip(*found[::2], strict=True)
    assert times[0] == times[4] == 1.0 and times[2] == max(times) > 1.05 and times[1] == times[3] < 1.01
    assert hastes == pytest.approx((0.0, 0.0, 0.0, 0.5, 1.0))
