"""Steering: velocities and goals as velocities of the steps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import wbc
from wbc.walking.steering import PathSteering, StepVelocity
from wbc.walking.stepping.law import SteppingConstants
from wbc.walking.stepping.settings import RobotSize, SteppingSettings, in_si

DT = 0.002


SIZE = RobotSize.of(wbc.load_robot("g1").robot(), SteppingSettings().bend)
BRISK = in_si(SteppingConstants(), SIZE).brisk


@pytest.fixture(scope="module")
def settings() -> SteppingSettings:
    return SteppingSettings().in_si(SIZE)


def steered(settings: SteppingSettings, heading: float = 0.0) -> PathSteering:
    return PathSteering(settings, SIZE, BRISK, heading, DT)


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


def drive(steering: PathSteering, yaw: float, side: float) -> list[StepVelocity]:
    """Steps of a robot that is slower than them and sways to a side first, in a world turned by an angle."""
    place, steps, speed, seconds = (0.0, 0.0), [], (0.0, 0.0), 3.0
    for tick in range(round(seconds / DT)):
        steps.append(steering.update(turned(place, yaw), turned(speed, yaw)))
        x, y = steps[-1].velocity
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
        runs.append(np.array([(*step.velocity, step.turn, step.go) for step in drive(steering, yaw, side)]))
    np.testing.assert_allclose(runs[1], runs[0], atol=1e-9)
    np.testing.assert_allclose(runs[2], runs[0] * (1.0, -1.0, -1.0, 1.0), atol=1e-9)


def test_a_brisk_walk_has_longer_and_slower_steps_and_none_beyond_the_stride(
    settings: SteppingSettings,
) -> None:
    steering = steered(replace(settings, fastest=9.0, fastest_back=9.0))
    most = steering.limits.forward
    assert BRISK < most == steering.limits.back < 9.0
    steering.velocity = (most, 0.0)
    assert most * steering.step_time == pytest.approx(settings.stride, rel=1e-4)
    times = []
    for share in (0.0, 0.5, 1.0, 1.5, 6.0):  # of the velocity about which a walk becomes brisk
        steering.velocity = (-share * BRISK, 0.0)
        times.append(steering.step_time / settings.step_time)
    assert times[0] == 1.0 and times[1] < 1.01 and times == sorted(times)
    assert times[-1] == pytest.approx(math.sqrt(6.0), rel=1e-3), "with the root of the speed"
    short = replace(settings, fastest=9.0, stride=0.5 * settings.step_time * BRISK)
    assert steered(short).limits.forward == pytest.approx(0.5 * BRISK, rel=0.01)
