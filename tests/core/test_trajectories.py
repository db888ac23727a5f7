"""Trajectories against their equations: quintics, paths through points, followers, references with bounded rates."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples

from wbc.base.errors import InputError
from wbc.core.trajectories import (
    Follower,
    Quintic,
    QuinticPath,
    Ramp,
    Trajectory,
    approach,
    minimum_jerk,
)

DT = 0.005
POINTS = st.lists(st.tuples(*[st.floats(-2.0, 2.0)] * 3), min_size=2, max_size=5)


@examples(6)
@given(POINTS, st.floats(0.1, 2.0), st.floats(0.5, 5.0))
def test_a_trajectory_passes_its_points_from_rest_to_rest_within_its_limits(
    points: list[tuple[float, float, float]], speed: float, acceleration: float
) -> None:
    way = [np.array(point) for point in points]
    if any(np.linalg.norm(b - a) < 1e-3 for a, b in zip(way, way[1:], strict=False)):
        return
    path = Trajectory(way, speed=speed, acceleration=acceleration)
    times = np.linspace(0.0, path.duration, 1001)
    states = np.array([path.at(float(t)) for t in times])
    np.testing.assert_allclose(states[0], [way[0], np.zeros(3), np.zeros(3)], atol=1e-8)
    np.testing.assert_allclose(states[-1], [way[-1], np.zeros(3), np.zeros(3)], atol=1e-6)
    passed = np.cumsum([0.0, *(np.linalg.norm(b - a) for a, b in zip(way, way[1:], strict=False))])
    for point, share in zip(way, passed / passed[-1], strict=True):
        np.testing.assert_allclose(path.at(float(share) * path.duration)[0], point, atol=1e-7)
    speeds, pushes = np.linalg.norm(states[:, 1], axis=1), np.linalg.norm(states[:, 2], axis=1)
    assert speeds.max() <= speed * 1.005 and pushes.max() <= acceleration * 1.01
    # One of the limits is met: nothing is slower than it must be.
    assert speeds.max() > 0.99 * speed or pushes.max() > 0.98 * acceleration
    rate = np.gradient(states[:, 0], times, axis=0)[1:-1]
    np.testing.assert_allclose(rate, states[1:-1, 1], atol=2e-3 * (speed + acceleration * path.duration))


def test_a_quintic_has_the_states_of_its_ends_and_its_own_derivatives() -> None:
    start, end = np.random.default_rng(0).normal(size=(2, 3, 2))
    curve = Quintic(tuple(start), tuple(end), 1.3)
    np.testing.assert_allclose([curve.at(0.0), curve.at(1.3)], [start, end], atol=1e-12)
    for t in (0.2, 0.7, 1.1):
        before, now, after = (np.array(curve.at(t + h)) for h in (-1e-5, 0.0, 1e-5))
        np.testing.assert_allclose((after - before)[:2] / 2e-5, now[1:], rtol=1e-6, atol=1e-6)
    unit = Quintic((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0)
    for share in (0.15, 0.6, 0.9):
        np.testing.assert_allclose(minimum_jerk(share), unit.at(share)[:2], atol=1e-12)


@pytest.mark.parametrize("goal", [(2.0, -1.0, 0.5), (0.02, 0.0, 0.0)])
def test_a_reference_keeps_its_speed_and_acceleration_and_arrives(goal: tuple[float, ...]) -> None:
    place, velocity = np.zeros(3), np.array([0.0, 0.3, 0.0])
    speeds, changes = [], []
    for _ in range(2000):
        now = approach(np.array(goal) - place, velocity, 0.5, 2.0, DT)
        changes.append(np.linalg.norm(now - velocity) / DT)
        velocity = now
        place = place + DT * velocity
        speeds.append(np.linalg.norm(velocity))
    assert max(speeds) < 0.5 + 1e-9 and max(changes) < 2.0 + 1e-9
    np.testing.assert_allclose(place, goal, atol=1e-4)
    assert np.linalg.norm(velocity) < 1e-3


def rates(path: Trajectory) -> tuple[float, float]:
    """Greatest speed and acceleration."""
    states = np.array([path.at(float(t)) for t in np.linspace(0.0, path.duration * (1.0 - 1e-9), 1001)])
    return tuple(np.linalg.norm(states[:, 1:], axis=2).max(axis=0).tolist())  # type: ignore[return-value]


@examples(4)
@given(st.tuples(*[st.floats(-0.5, 0.5)] * 3), st.floats(0.02, 0.98), st.floats(0.05, 2.0))
def test_a_path_that_begins_in_motion_takes_the_least_time_that_keeps_its_limits(
    goal: tuple[float, float, float], moment: float, speed: float
) -> None:
    """From a moment of another move within the same limits, to the same goal, to a third one, and back."""
    acceleration = 5.0 * speed
    first = Trajectory([np.zeros(3), [0.3, 0.1, -0.2]], speed=speed, acceleration=acceleration)
    place, velocity, change = first.at(moment * first.duration)
    start = {"velocity": velocity, "acceleration_at_start": change}
    for end in (first.end, np.array(goal), np.zeros(3)):
        path = Trajectory([place, end], speed=speed, acceleration=acceleration, **start)
        speeds, pushes = rates(path)
        assert speeds <= 1.001 * speed and pushes <= 1.002 * acceleration
        assert speeds > 0.98 * speed or pushes > 0.95 * acceleration  # nothing is slower than it must be
        np.testing.assert_allclose(path.at(0.0)[:2], [place, velocity], atol=1e-9)
    onward = Trajectory([place, first.end], speed=speed, acceleration=acceleration, **start)
    left = (1.0 - moment) * first.duration
    assert onward.duration <= left * 1.001 + 1e-4  # what is left of the move keeps the limits, too


def test_a_duration_is_taken_if_and_only_if_it_keeps_the_limits() -> None:
    start: dict[str, Any] = {"velocity": [0.3, 0.0, 0.0], "acceleration_at_start": [1.0, 0.0, 0.0]}
    ends, taken = [np.zeros(3), np.array([0.1, 0.02, 0.0])], []
    for duration in np.geomspace(0.05, 3.0, 8).tolist():
        curve = Quintic(
            (ends[0], np.array(start["velocity"]), np.array(start["acceleration_at_start"])),
            (ends[1], np.zeros(3), np.zeros(3)),
            duration,
        )
        states = [curve.at(t)[1:] for t in np.linspace(0.0, duration, 500)]
        speed, push = np.linalg.norm(states, axis=2).max(axis=0)
        try:
            path = Trajectory(ends, duration, speed=1.0, acceleration=10.0, **start)
        except InputError as error:
            assert "duration" in str(error) and max(speed / 1.0, push / 10.0) > 0.995
            taken.append(False)
        else:
            speeds, pushes = rates(path)
            assert path.duration == duration and speeds < 1.002 and pushes < 10.02
            taken.append(True)
    assert any(taken) and not all(taken)


def test_between_two_points_the_greatest_speed_and_acceleration_are_those_of_the_least_jerk() -> None:
    """15/8 and 10/√3 of the way, over the time and its square."""
    way, duration = np.array([0.3, -0.4, 0.0]), 1.6
    path = Trajectory([np.zeros(3), way], duration)
    assert path.duration == duration
    speed, push = rates(path)
    assert speed == pytest.approx(15.0 / 8.0 * 0.5 / duration, rel=1e-4)
    assert push == pytest.approx(10.0 / np.sqrt(3.0) * 0.5 / duration**2, rel=1e-4)


def test_a_follower_is_a_critically_damped_mass() -> None:
    """x(t) = goal − (1 + t/T) e^(−t/T) · way, of numbers, arrays and points of the plane alike."""
    for start, goal in ((0.0, 2.0), (np.zeros(2), np.array([1.0, -3.0])), (1j, 2.0 + 0.5j)):
        follower, dt, time_constant = Follower(0.2, start), 1e-4, 0.2
        np.testing.assert_array_equal(follower.velocity, 0.0 * goal)
        for tick in range(1, 10_001):
            follower.follow(goal - follower.value, dt)
            if tick % 2500 == 0:
                t = tick * dt / time_constant
                left, rate = (1.0 + t) * np.exp(-t), t * np.exp(-t) / time_constant
                np.testing.assert_allclose(follower.value, goal - left * (goal - start), rtol=1e-3)
                np.testing.assert_allclose(follower.velocity, rate * (goal - start), rtol=2e-3)


def test_a_ramp_goes_along_a_quintic_and_rests_at_its_goal() -> None:
    ramp = Ramp(1.0)
    ramp.advance(DT)
    assert ramp.value == ramp.goal == 1.0
    ramp.to(3.0, 0.1)
    assert [ramp.after(time) for time in (0.0, 0.05, 0.1, 9.0)] == pytest.approx([1.0, 2.0, 3.0, 3.0])
    for tick in range(1, 31):
        ramp.advance(DT)
        assert ramp.value == pytest.approx(1.0 + 2.0 * minimum_jerk(min(tick * DT / 0.1, 1.0))[0])
    ramp.to(0.0, 1.0)
    assert (ramp.value, ramp.goal) == (3.0, 0.0)


def test_a_path_of_quintics_passes_its_goals_and_is_planned_anew_from_where_it_is() -> None:
    path = QuinticPath((0.5, 0.0, 0.0))
    assert path.at(-1.0) == path.at(7.0) == (0.5, 0.0, 0.0)
    goals = ((1.0, (1.0, 0.2, -0.1)), (1.5, (0.0, 0.0, 0.0)))
    path.follow(0.0, *goals)
    for time, motion in ((0.0, (0.5, 0.0, 0.0)), *goals, (2.0, goals[1][1])):
        np.testing.assert_allclose(path.at(time), motion, atol=1e-12)
    times = np.linspace(0.05, 1.45, 15)
    for time in times:
        before, now, after = (np.array(path.at(time + h)) for h in (-1e-5, 0.0, 1e-5))
        np.testing.assert_allclose((after - before)[:2] / 2e-5, now[1:], atol=1e-4)
    kept = [path.at(time) for time in times]
    turn = path.at(1.2)
    path.follow(1.2, (2.0, (3.0, 0.0, 0.0)))
    for time, motion in zip(times, kept, strict=True):
        if time <= 1.2:
            np.testing.assert_allclose(path.at(time), motion, atol=1e-12)
    np.testing.assert_allclose(path.at(1.2), turn, atol=1e-12)
    np.testing.assert_allclose(path.at(2.5), (3.0, 0.0, 0.0), atol=1e-12)
