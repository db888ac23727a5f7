"""The benchmarks of the command line: the task of the comparison, problems of known feasibility, parts of a walk."""

from __future__ import annotations

from dataclasses import replace
from time import sleep

import mujoco
import numpy as np
import pytest
from problem_streams import ProblemStream, least_violation
from properties import by_default
from solver_problems import BenchSolverOptions, bench_solver
from walk_cost import CASES, BenchWalkOptions, bench_walk

from wbc.app.bench import BenchTickOptions, bench_tick
from wbc.app.profile import parts_of, profile_walk
from wbc.core.errors import Array
from wbc.core.settings import to_json
from wbc.robots import load, names
from wbc.sim.trial.loop import TrialHook, TrialTick
from wbc.sim.walks.plans import WalkPlan
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial
from wbc.tasks import PositionTask, PostureTask
from wbc.tasks.balance import balance_controller
from wbc.walking import Gait


@pytest.mark.parametrize("robot", by_default(names(), "talos"))
def test_ticks_are_solved_and_follow_the_sway(robot: str) -> None:
    # The soles of the comparison are wider than the small robots' own; the ticks stay what they are.
    result = bench_tick(BenchTickOptions(robot=robot, ticks=300, warm_up=1000))
    assert result["failures"] == 0 and sum(result["solvers"].values()) == result["ticks"] == 300
    assert result["com_error_mm"] < 1.0 and 0.0 < result["torque_use"] < 1.0
    assert result["p99_us"] >= result["median_us"] > sum(result["parts"].values()) * 0.5
    assert set(result["parts"]) == {"model", "assembly", "solve", "decode"}


def test_the_judge_tells_feasible_from_infeasible() -> None:
    robot = load("hrp4_class").robot()
    controller = balance_controller(robot, 0.005)
    assert controller.solve().ok
    assert least_violation(controller.problem) < 1e-7
    place = robot.placement(robot.torso_frame).translation
    for name, way in (("up", 0.1), ("down", -0.1)):
        controller.add(PositionTask(robot.torso_frame, place + [0, 0, way], name=name, hard=True))
    assert not controller.solve().ok
    assert least_violation(controller.problem) == np.inf  # equalities that contradict each other
    controller.remove(controller.task("down"))
    controller.task("up").stiffness = 1e6  # an acceleration that no motor has the torque for
    assert not controller.solve().ok
    assert 1.0 < least_violation(controller.problem) < np.inf


def test_random_streams_are_hard_and_repeat_themselves() -> None:
    def accelerations(seed: int) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
        stream = ProblemStream(load("hrp4_class"), np.random.default_rng(seed), scattered=False)
        return np.array([stream.step().accelerations for _ in range(30)])

    first = accelerations(3)
    np.testing.assert_array_equal(first, accelerations(3))
    assert np.abs(first - accelerations(4)).max() > 1.0


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
    def evaluate(self, error: Array) -> None:
        sleep(0.0003)
        super().evaluate(error)


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
    slow = trial.walking.controller.add(_SlowTask(weight=0.0, name="mine"))
    result, rows = profile_walk(trial, [_SlowHook()])
    parts = {row.what: row for row in rows}
    ticks = parts["sensors"].calls
    assert ticks == round(result.seconds / spec.period)
    assert parts["task 'mine'"].calls == ticks and parts["task 'mine'"].us > 300.0
    assert parts["hook _SlowHook"].us > 600.0
    assert list(parts) == list(dict.fromkeys(what for what, _, _ in parts_of(trial, [_SlowHook()])))
    assert sum(row.share for row in rows) == pytest.approx(1.0) and min(row.us for row in rows) > 0.0
    for owner in (
        trial.plant,
        trial.walking,
        trial.walking.controller,
        slow,
        trial.meter,
    ):  # no clock is left
        assert not any(callable(value) and hasattr(value, "__wrapped__") for value in vars(owner).values())


@pytest.mark.slow
def test_a_profiled_walk_is_the_same_bit_for_bit() -> None:
    spec = WalkSpec(plan=WalkPlan(distance=0.05), foot="soft", terrain="stones", amplitude=0.02)
    profiled, plain = profile_walk(WalkTrial(spec))[0], WalkTrial(spec).run()
    assert replace(profiled, clock=None).to_json() == replace(plain, clock=None).to_json()
