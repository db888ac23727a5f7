"""The loop of a trial on a robot that stands still: how far it advances, what it waits for, what its clocks count."""

from __future__ import annotations

import math
from array import array
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import wbc
from wbc.robots import load
from wbc.sim.trial.trial import StageError, Trial, TrialHook


class Still(wbc.Control):
    """A loop whose robot stands still in the air, and its controller."""

    diverged = None
    control_period = 0.005

    def __init__(self) -> None:
        self.robot = load("hrp4_class").robot()
        self.base_pose = tuple(self.robot.half_sitting[:7].tolist())
        self.ticks, self.com_height = 0, float(self.robot.com[2])

    @property
    def time(self) -> float:
        return self.ticks * self.control_period

    def measure(self) -> None:
        return None

    def clouds(self) -> list[Any]:
        return []

    def step(self, command: object) -> None:
        self.ticks += 1

    def command(self, measurement: object) -> None:
        return None


@pytest.mark.parametrize(
    ("seconds", "ticks"), [(0.0, 0), (0.0024, 0), (0.0026, 1), (0.012, 2), (0.013, 3), (1.0, 200)]
)
def test_a_trial_advances_by_the_nearest_number_of_periods(seconds: float, ticks: int) -> None:
    loop: Any = Still()
    trial = Trial(loop, loop)
    looks: list[float] = []
    trial.advance(seconds, lambda: looks.append(trial.plant.time))
    assert loop.ticks == len(looks) == ticks
    trial.advance(0.1)
    assert loop.ticks == ticks + 20


def test_a_trial_waits_for_a_condition_up_to_its_time_and_ends_with_a_fall() -> None:
    """The condition is asked every 0.1 s, after the last one once more."""
    for over, most, passes in ((0.35, 0.5, True), (0.55, 0.5, True), (0.65, 0.5, False)):
        loop: Any = Still()
        trial = Trial(loop, loop)
        if passes:
            trial.until(lambda loop=loop, over=over: loop.time >= over, most)
            assert loop.time == pytest.approx(math.ceil(10.0 * over) / 10.0)
        else:
            with pytest.raises(StageError):
                trial.until(lambda loop=loop, over=over: loop.time >= over, most)
            assert loop.time == pytest.approx(0.6)
    loop = Still()
    trial = Trial(loop, loop)
    lowest = 0.7 * loop.com_height
    for height, fallen in ((1.001 * lowest, False), (0.999 * lowest, True)):
        loop.com_height = height
        assert trial.step() != fallen and trial.fallen == fallen
    with pytest.raises(StageError):
        trial.advance(0.1)
    trial.tick_times = array("d", [1e-6 * t for t in range(1, 102)])
    trial.loop_time = 0.5 * loop.time
    clock = trial.clock()
    assert clock.tick_us == pytest.approx({"median": 51.0, "p99": 100.0})
    assert clock.real_time_factor == pytest.approx(2.0)


def test_times_of_a_trial_are_those_of_its_parts_without_its_hooks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten ticks, of which the control takes 0.1 s, physics 0.2 s, and hooks that look on 0.5 s and 0.25 s."""
    now = [50.0]
    monkeypatch.setattr("wbc.sim.trial.trial.time", SimpleNamespace(perf_counter=lambda: now[0]))

    def takes(seconds: float) -> Any:
        def spent(*parts: object) -> None:
            now[0] += seconds

        return spent

    class Watch(TrialHook):
        tick, after = takes(0.5), takes(0.25)

    class Timed(Trial):
        def simulate(self) -> None:
            self.advance(0.05)

    loop: Any = Still()
    step, loop.command = loop.step, takes(0.1)
    loop.step = lambda command: (takes(0.2)(), step(command))
    trial = Timed(loop, loop)
    trial.run([Watch()])
    assert len(trial.tick_times) == 10 and np.allclose(trial.tick_times, 0.1)
    assert trial.hook_time == pytest.approx(7.5) and trial.loop_time == pytest.approx(3.0)
    clock = trial.clock()
    assert clock.real_time_factor == pytest.approx(0.05 / 3.0)
    assert clock.tick_us == pytest.approx({"median": 1e5, "p99": 1e5})


def test_a_walk_along_a_plan_is_given_three_seconds_a_step_and_twelve_more() -> None:
    """After a second at the start; who is not done then has not come to its end."""
    for steps in (0, 2):
        loop: Any = Still()
        loop.done, loop.follow = False, lambda plan: None
        trial = Trial(loop, loop)
        with pytest.raises(StageError):
            trial.follow([None] * steps)  # type: ignore[arg-type]
        assert loop.time == pytest.approx(1.0 + 3.0 * (steps + 4), abs=0.21)
