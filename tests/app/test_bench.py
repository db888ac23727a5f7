"""`wbc bench tick`: the task that other libraries are compared with."""

from __future__ import annotations

import importlib
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from properties import by_default

from wbc.app.cli import RAN, main
from wbc.app.commands import bench
from wbc.app.commands.bench import (
    CLEARANCE,
    FALL_BACK,
    TASK,
    BenchTickOptions,
    bench_tick,
    start_configuration,
    sway,
)
from wbc.core.qp.controller import Controller
from wbc.core.qp.solving.solution import Solution
from wbc.robots import load, names


@pytest.mark.parametrize("robot", by_default(names(), "talos"))
def test_ticks_are_solved_and_follow_the_sway(robot: str) -> None:
    # The soles of the comparison are wider than the small robots' own; the ticks stay what they are.
    result = bench_tick(BenchTickOptions(robot=robot, ticks=200, warm_up=1000))
    assert result["failures"] == 0 and sum(result["solvers"].values()) == result["ticks"] == 200
    assert result["com_error_mm"] < 1.0 and 0.0 < result["torque_use"] < 1.0
    assert result["p99_us"] >= result["median_us"]
    assert 0.5 < result["median_us"] / sum(result["parts"].values()) < 5.0, (
        "the parts are those of a tick, µs"
    )
    assert set(result["parts"]) == {"model", "assembly", "solve", "decode"}


def test_the_sway_is_a_sine_along_each_axis_with_its_derivatives() -> None:
    step = 1e-5
    for time in (0.0, 0.3, 1.7):
        (before, *_), (place, velocity, acceleration), (after, *_) = (
            sway(time + k * step) for k in (-1, 0, 1)
        )
        np.testing.assert_allclose(velocity, (after - before) / (2.0 * step), atol=1e-9)
        np.testing.assert_allclose(acceleration, (after - 2.0 * place + before) / step**2, atol=2e-6)
        wanted = [0.010 * math.sin(math.tau * time), 0.020 * math.sin(math.pi * time), 0.0]
        np.testing.assert_allclose(place, wanted, atol=1e-15)


def test_joints_near_a_limit_start_in_the_middle_of_their_range() -> None:
    robot = load("g1").robot()
    low, high, half = robot.position_lower, robot.position_upper, np.array(robot.half_sitting[7:])
    for limits in (low, high):
        limits.setflags(write=True)
    low[0], high[0] = half[0] - 0.9 * CLEARANCE, half[0] + 1.0
    low[1], high[1] = half[1] - 1.0, half[1] + 0.9 * CLEARANCE
    low[2], high[2] = half[2] - 1.1 * CLEARANCE, half[2] + 1.1 * CLEARANCE
    start = start_configuration(robot)[7:]
    np.testing.assert_allclose(start[:2], 0.5 * (low + high)[:2])
    np.testing.assert_array_equal(start[2], half[2])


@pytest.fixture
def timed(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Record of what `bench_tick` did: times of the sway, states, accelerations; its clock goes on by 5 µs a look."""
    seen = SimpleNamespace(sways=[], states=[], accelerations=[], fails=set(), looks=0)
    update, solve, real_sway = Controller.update, Controller.solve, bench.sway

    def look() -> int:
        seen.looks += 1
        return 5000 * seen.looks

    def updated(controller: Controller, q: Any, v: Any) -> Any:
        seen.states.append((np.array(q), np.array(v)))
        return update(controller, q, v)

    def solved(controller: Controller) -> Any:
        solution = solve(controller)
        seen.accelerations.append(np.array(solution.accelerations))
        if len(seen.states) - 1 in seen.fails:
            monkeypatch.setattr(Solution, "ok", property(lambda self: len(seen.states) - 1 not in seen.fails))
        return solution

    def swayed(time: float) -> Any:
        seen.sways.append(time)
        return real_sway(time)

    monkeypatch.setattr(bench, "perf_counter_ns", look)
    monkeypatch.setattr(bench, "sway", swayed)
    monkeypatch.setattr(bench, "_preemptions", lambda: 10 + len(seen.states))
    monkeypatch.setattr(Controller, "update", updated)
    monkeypatch.setattr(Controller, "solve", solved)
    return seen


def test_a_benchmark_integrates_its_ticks_and_counts_those_without_a_solution(timed: SimpleNamespace) -> None:
    timed.fails = {5, 6}
    facts = bench_tick(BenchTickOptions(robot="g1", ticks=6, warm_up=3, period=0.002))
    np.testing.assert_allclose(timed.sways, 0.002 * np.arange(9))
    robot = load("g1").robot()
    for i in range(8):
        (q, v), (after, faster) = timed.states[i : i + 2]
        given = -v / FALL_BACK if i in timed.fails else timed.accelerations[i]
        np.testing.assert_allclose(faster - v, 0.002 * given, atol=1e-12)
        np.testing.assert_allclose(
            after, pin.integrate(robot.model, q, 0.002 * (0.5 * v + 0.5 * faster)), atol=1e-12
        )
    assert facts["failures"] == 2 and sum(facts["solvers"].values()) == facts["ticks"] == 6
    assert facts["median_us"] == facts["p99_us"] == 5.0
    assert facts["preempted"] == 6, "those before the ticks that count are no noise of theirs"
    assert facts["options"]["period"] == 0.002


def test_a_benchmark_reports_millimetres_shares_of_torque_and_parts_of_a_tick(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A controller that ignores the sway: the centre of mass stays, the greatest error is that of the sway."""
    solve, told = Controller.solve, []

    def still(controller: Controller) -> Any:
        solution = solve(controller)
        told.append(
            (
                solution.timings,
                np.count_nonzero(solution.multipliers),
                controller.robot.torque_share(solution.torques),
            )
        )
        solution.accelerations[:] = 0.0
        return solution

    monkeypatch.setattr(Controller, "solve", still)
    facts = bench_tick(BenchTickOptions(robot="g1", ticks=40, warm_up=2, period=0.01))
    times = 0.01 * np.arange(2, 42)
    size = np.hypot(0.010 * np.sin(math.tau * times), 0.020 * np.sin(math.pi * times)).max()
    assert facts["com_error_mm"] == pytest.approx(1e3 * size, abs=1e-3)
    timings, active, shares = zip(*told[2:], strict=True)
    assert facts["active_limits"] == pytest.approx(np.mean(active), abs=1e-3)
    assert facts["torque_use"] == pytest.approx(np.max(shares), abs=1e-3)
    np.testing.assert_allclose(list(facts["parts"].values()), 1e6 * np.median(timings, axis=0), atol=0.006)


def test_the_text_of_a_benchmark_has_its_percentages(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    facts = bench_tick(BenchTickOptions(robot="g1", ticks=2, warm_up=0)) | {"torque_use": 0.34}
    monkeypatch.setattr("wbc.app.commands.bench.bench_tick", lambda options: facts)
    assert main(["bench", "tick"]) == RAN
    assert "torques up to 34 % of" in capsys.readouterr().out
    assert TASK["sagittal_amplitude"] < TASK["lateral_amplitude"]


def test_all_libraries_of_a_comparison_are_timed_over_the_same_ticks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks" / "comparisons"))
    compare = importlib.import_module("compare")
    command = compare.command_of("tick", "wbc", "python", Path("scene.json"), 17)
    assert command[command.index("--ticks") + 1] == "17"
