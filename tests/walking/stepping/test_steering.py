"""Steering: velocities and goals as velocities of the steps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import wbc
from wbc.walking.stepping.law import SteppingConstants
from wbc.walking.stepping.settings import RobotSize, SteppingSettings, in_si
from wbc.walking.stepping.steering import Steering, SteeringConstants, StepVelocity

DT = 0.002


SIZE = RobotSize.of(wbc.load_robot("g1").robot(), SteppingSettings().bend)
BRISK = in_si(SteppingConstants(), SIZE).brisk


@pytest.fixture(scope="module")
def settings() -> SteppingSettings:
    return SteppingSettings().in_si(SIZE)


def steered(settings: SteppingSettings, heading: float = 0.0) -> Steering:
    return Steering(settings, SIZE, BRISK, heading, DT)


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


def turned(point: tuple[float, float], angle: float) -> tuple[float, float]:
    c, s = math.cos(angle), math.sin(angle)
    return c * point[0] - s * point[1], s * point[0] + c * point[1]


def drive(steering: Steering, yaw: float, side: float) -> list[StepVelocity]:
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


def test_the_velocity_to_a_goal(settings: SteppingSettings) -> None:
    """Far away along the way to it, slower the more it has to turn; near it every part in the time to a goal."""
    s, c, steering = settings, in_si(SteeringConstants(), SIZE), steered(settings, 3.0)
    steering.go_to(-4.0, -0.3, 0.0)
    off = math.pi - 3.0 + math.atan2(0.3, 4.0)
    expected = (s.cruise * math.cos(off) ** 4, 0.0, off / c.goal_time)
    assert steering._wanted((0.0, 0.0)) == pytest.approx(expected)
    dx, dy = turned((0.4 * c.near, -0.2 * c.near), 3.0)
    steering.go_to(1.0 + dx, 2.0 + dy, -3.0)
    ahead, aside = 0.4 * c.near / c.goal_time, -0.2 * c.near / c.goal_time
    turn = (2.0 * math.pi - 6.0) / c.goal_time
    assert steering._wanted((1.0, 2.0)) == pytest.approx((ahead, aside, turn))
    place = (1.0 + dx, 2.0 + dy)
    steering.heading = 1.1 * c.arrived_turn - 3.0
    assert any(steering._wanted(place)) and steering.pending
    steering.heading = 0.9 * c.arrived_turn - 3.0
    beside = (place[0] + 1.1 * c.arrived, place[1])
    assert any(steering._wanted(beside)) and steering.pending
    assert not any(steering._wanted((place[0] + 0.9 * c.arrived, place[1]))) and not steering.pending
    forward, back, aside, most = steering.limits
    assert steering.limited((9.0, 9.0, 9.0)) == (forward, aside, most)
    assert steering.limited((-9.0, -9.0, -9.0)) == (-back, -aside, -most)
    assert steering.limited((0.1, -0.02, 0.03)) == (0.1, -0.02, 0.03)


def test_steps_lead_back_to_the_path_and_make_up_for_what_the_robot_falls_short(
    settings: SteppingSettings,
) -> None:
    s, c, steering = settings, in_si(SteeringConstants(), SIZE), steered(replace(settings, fastest=9.0))
    steering.rest((0.0, 0.0))
    steering.command((0.2, 0.0, 0.0))
    ramp = [steering.update((0.0, 0.0), (0.2, 0.0)).velocity[0] for _ in range(5)]
    assert steering.velocity[0] == pytest.approx(5 * DT * s.acceleration) and ramp[0] < ramp[-1]
    steering.velocity, steering._missing = (0.2, 0.0), 0.0
    most = c.drift_speed / c.drift_gain  # distance from the path from which on the way back is fastest
    for aside in (0.3 * most, -0.6 * most, 5.0 * most):
        steering.rest((0.0, 0.0))
        steering.velocity = (0.2, 0.0)
        step = steering.update((0.3, aside), (0.2, 0.0))
        assert step.velocity == pytest.approx((0.2, -c.drift_gain * min(aside, most)))
    for brisk in (0.5, 1.2):  # quicker where steps are longer
        steering.rest((0.0, 0.0))
        speed = brisk * BRISK
        steering.target, steering.velocity = (speed, 0.0, 0.0), (speed, 0.0)
        lag = (s.step_time / steering.step_time) ** 4
        gained = [steering.update((0.0, 0.0), (speed - 0.04, 0.0)).velocity[0] - speed for _ in range(100)]
        assert gained[-1] == pytest.approx(min(100 * DT * 0.04 / (lag * c.speed_lag), c.speed_bias), rel=1e-6)
    for _ in range(500):
        steering.update((0.0, 0.0), (-9.0, 0.0))
    assert steering._missing == c.speed_bias


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
