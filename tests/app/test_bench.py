"""The benchmarks of the command line: the task of the comparison, problems of known feasibility, parts of a walk."""

from __future__ import annotations

from time import sleep

import mujoco
import pytest
from properties import by_default
from solver_problems import BenchSolverOptions, bench_solver
from walk_cost import CASES, BenchWalkOptions, bench_walk
from walk_profile import profile_walk

from wbc.app.bench import BenchTickOptions, bench_tick
from wbc.core.errors import Array
from wbc.core.settings import to_json
from wbc.robots import names
from wbc.sim.trial.loop import TrialHook, TrialTick
from wbc.sim.walks.plans import WalkPlan
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial
from wbc.tasks import PostureTask
from wbc.walking import Gait


@pytest.mark.parametrize("robot", by_default(names(), "talos"))
def test_ticks_are_solved_and_follow_the_sway(robot: str) -> None:
    # The soles of the comparison are wider than the small robots' own; the ticks stay what they are.
    result = bench_tick(BenchTickOptions(robot=robot, ticks=300, warm_up=1000))
    assert result["failures"] == 0 and sum(result["solvers"].values()) == result["ticks"] == 300
    assert result["com_error_mm"] < 1.0 and 0.0 < result["torque_use"] < 1.0
    assert result["p99_us"] >= result["median_us"] > sum(result["parts"].values()) * 0.5
    assert set(result["parts"]) == {"model", "assembly", "solve", "decode"}


@pytest.mark.slow
def test_random_problems_are_solved_within_tolerance() -> None:
    reported: list[int] = []
    options = BenchSolverOptions(ticks=100, stream=25, sample=10, scattered=0.5)
    result = bench_solver(options, progress=reported.append)
    assert result["ticks"] == 100 and result["compared_with_proxqp"] == 10
    assert result["unsolved"] == result["above_tolerance"] == 0
    assert result["active_limits"] > 1.0 and result["contact_switches"] > 0
    assert result["proxqp_failed"] == result["differ_from_proxqp"] == 0
    assert reported == sorted(reported) and reported[-1] == 100


@pytest.mark.slow
def test_parts_make_up_the_period_of_a_walk(monkeypatch: pytest.MonkeyPatch) -> None:
    few = [name for name in CASES if name == "flat floor, flat soles, fast mode"]
    monkeypatch.setattr("walk_cost.CASES", {name: CASES[name] for name in few})
    rows = to_json(list(bench_walk(BenchWalkOptions(distance=0.1, repeats=1))))
    assert [row["name"] for row in rows] == few
    for row in rows:
        assert row["steps_done"] == row["steps_planned"] == 2
        parts = {part["what"]: part for part in row["profile"]}
        assert sum(part["us"] for part in row["profile"]) == pytest.approx(row["period_us"])
        assert sum(part["share"] for part in row["profile"]) == pytest.approx(1.0)
        assert row["real_time_factor"] == pytest.approx(1e6 * row["control_period"] / row["period_us"])
        assert parts["physics"]["us"] > parts["sensors"]["us"]
        assert 0.0 < row["collision_share"] < row["constraint_share"] < 1.0
    assert mujoco.get_mjcb_time() is None


class _SlowTask(PostureTask):
    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        sleep(0.0003)
        super().evaluate(jacobian, error, drift)


class _SlowHook(TrialHook):
    def tick(self, tick: TrialTick) -> None:
        sleep(0.0006)


@pytest.mark.slow
def test_a_profile_finds_a_slow_task_and_a_slow_hook_by_name_and_leaves_the_walk_alone() -> None:
    quick = Gait(single_support=0.5, initial_double_support=0.5)
    spec = WalkSpec(
        plan=WalkPlan(distance=0.05), foot="variable", terrain="stones", amplitude=0.02, gait=quick
    )
    trial = WalkTrial(spec)
    trial.walking.controller.add(_SlowTask(weight=0.0, name="mine"))
    result, rows = profile_walk(trial, [_SlowHook()])
    parts = {row.what: row for row in rows}
    ticks = parts["sensors"].calls
    assert ticks == round(result.seconds / spec.period)
    assert parts["task 'mine'"].calls == ticks and parts["task 'mine'"].us > 300.0
    assert parts["hook _SlowHook"].us > 600.0
    assert sum(row.share for row in rows) == pytest.approx(1.0) and min(row.us for row in rows) > 0.0
