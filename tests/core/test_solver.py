"""The ladder of solvers: each step of it gives the same solution of the same problem, and none is trusted unchecked."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from problem_streams import ProblemStream, least_violation

from wbc.base.errors import UnknownNameError
from wbc.core.qp.solving.problem import Problem
from wbc.core.qp.solving.solver import (
    QpSolver,
    SolverSettings,
    Status,
    solve_by_qpsolvers,
    solver_names,
)
from wbc.robots import load


def stream(seed: int = 4) -> ProblemStream:
    """Return a robot whose limits are active and change."""
    return ProblemStream(load("hrp4_class"), np.random.default_rng(seed), scattered=False)


@pytest.mark.parametrize("solver", solver_names())
def test_all_solvers_give_the_same_solution(solver: str) -> None:
    problems = stream()
    assert problems.step().ok
    other = QpSolver(problems.controller.problem, SolverSettings(solver=solver))
    active = 0
    for _ in range(15):
        solution = problems.step()
        assert solution.ok
        assert other.solve().ok
        nv = problems.controller.problem.nv
        np.testing.assert_allclose(other.x[:nv], solution.accelerations, atol=1e-4)
        active += int(np.count_nonzero(solution.multipliers))
    assert active > 15
    used = {name for name, count in other.counts.items() if count}
    expected = {"auto": "DAQP", "daqp": "DAQP"}.get(solver, "other")
    assert expected in used and "failed" not in used


def test_daqp_finds_the_same_from_any_guess_and_repeats_bit_for_bit() -> None:
    problems = stream(3)
    for _ in range(20):
        solution = problems.step()
    p = problems.controller.problem
    hessian, gradient, rng = p.hessian, p.gradient, np.random.default_rng(0)
    reference = QpSolver(p)._by_daqp(hessian, gradient, solution.multipliers)
    again = QpSolver(p)._by_daqp(hessian, gradient, solution.multipliers)
    assert reference is not None and again is not None
    for one, other in zip(reference, again, strict=True):
        np.testing.assert_array_equal(one, other)
    x, z = reference
    pull = hessian @ x + gradient + p.inequality.T @ z  # which the equalities hold
    held = np.linalg.lstsq(p.equality.T, -pull)[0]
    np.testing.assert_allclose(pull + p.equality.T @ held, 0.0, atol=1e-4)
    for _ in range(10):
        guess = np.where(rng.random(p.lower.size) < 0.1, rng.normal(size=p.lower.size), 0.0)
        guess[~np.isfinite(np.where(guess > 0.0, p.upper, p.lower))] = 0.0
        found = QpSolver(p)._by_daqp(hessian, gradient, guess)
        assert found is not None
        np.testing.assert_allclose(found[0], x, atol=1e-5)
    other_x = solve_by_qpsolvers("proxqp", p)
    assert other_x is not None
    np.testing.assert_allclose(other_x[0][: p.nv], x[: p.nv], atol=1e-3)


def test_what_has_no_solution_is_told_by_every_solver() -> None:
    problems = stream()
    assert problems.step().ok
    p = problems.controller.problem
    p.lower[0], p.upper[0] = 1e4, 1e4 + 1.0  # a torque that nothing can give
    p.lower[1], p.upper[1] = -1e4, -1e4 + 1.0
    for solver in solver_names():
        status = QpSolver(p, SolverSettings(solver=solver, residual_tolerance=1e-6)).solve()
        assert status is Status.INFEASIBLE


@pytest.mark.parametrize(
    ("seeds", "ticks"), [(range(6), 60), pytest.param(range(100, 124), 150, marks=pytest.mark.slow)]
)
def test_badly_scaled_ticks_are_solved_and_infeasible_ones_have_no_solution(seeds: range, ticks: int) -> None:
    """With friction down to 1e-6 and weights over twelve decades; the violations are those of a linear program."""
    counts: Counter[Status] = Counter()
    violations: list[float] = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        robot = load(("hrp4_class", "g1", "talos")[seed % 3])
        problems = ProblemStream(robot, rng, scattered=bool(seed % 2))
        controller = problems.controller
        weights = [np.array(task.weight) for task in controller.tasks]
        for _ in range(ticks):
            if rng.random() < 0.3:
                friction = 10.0 ** rng.uniform(-6.0, 0.0)
                for contact in controller.contacts:
                    contact.friction = friction  # type: ignore[attr-defined]
            if rng.random() < 0.3:
                for task, weight in zip(controller.tasks, weights, strict=True):
                    task.weight = weight * 10.0 ** rng.uniform(-6.0, 6.0)
            status = problems.step().status
            counts[status] += 1
            if status in (Status.RELAXED, Status.INFEASIBLE):  # limits that give way do so for a reason
                violations.append(least_violation(controller.problem))
    assert Status.REFUSED not in counts
    assert counts[Status.SOLVED] > 100 and counts[Status.BADLY_SCALED] > 5 and len(violations) > 5
    assert min(violations) > 1e-6


@pytest.mark.parametrize("name", ["osqp2", "osqp"])  # a wrong name, and a solver of sparse problems alone
def test_a_solver_that_cannot_solve_a_tick_is_refused_by_name(name: str) -> None:
    with pytest.raises(UnknownNameError, match=f"'{name}'"):
        SolverSettings(solver=name)


def small() -> Problem:
    """Return ½ (x² + 3 y² + 2 z²) − y with x = 1, a law of physics, z free, and y = 3 and y = 5, tasks, at once."""
    p = Problem(3, 0, 3, n_eq=3, n_soft=0, n_in=2)
    p.equality[:], p.target[:], p.n_physics = np.eye(3)[[0, 1, 1]], [1.0, 3.0, 5.0], 1
    p.inequality[:], p.lower[:], p.upper[:] = np.eye(3)[[2, 1]], [0.4, -9.0], [2.0, np.inf]
    p.diagonal[:], p.linear[:] = [1.0, 3.0, 2.0], [0.0, 1.0, 0.0]
    return p


@pytest.mark.parametrize("name", ["auto", "proxqp", "daqp"])
def test_hard_tasks_that_contradict_each_other_are_relaxed_at_their_cost(name: str) -> None:
    """(3 + 2 r) y = 1 + r (3 + 5), by the derivative of the costs."""
    relaxed = QpSolver(small(), SolverSettings(solver=name, relaxation=40.0))
    for tick in (1, 2):
        assert relaxed.solve() is Status.RELAXED and relaxed.counts["relaxed"] == tick
        np.testing.assert_allclose(relaxed.x, [1.0, 321.0 / 83.0, 0.4], atol=1e-6)
        np.testing.assert_allclose(relaxed.multipliers, [-0.8, 0.0], atol=1e-6)
    alone = QpSolver(small(), SolverSettings(solver=name))
    assert alone.solve() is Status.INFEASIBLE and alone.counts["failed"] == 1
    physics = small()
    physics.n_physics = 3
    assert QpSolver(physics, SolverSettings(solver=name, relaxation=40.0)).solve() is Status.INFEASIBLE


def test_a_qp_with_crossed_bounds_or_numbers_that_are_none_is_not_tried() -> None:
    for array, value, status in (
        ("upper", 0.39, Status.INFEASIBLE),
        ("upper", np.nan, Status.REFUSED),
        ("target", np.inf, Status.REFUSED),
        ("linear", np.nan, Status.REFUSED),
        ("rows", np.nan, Status.REFUSED),
    ):
        problem = small()
        problem.target[2] = 3.0
        tried = QpSolver(problem)
        assert tried.solve() is Status.SOLVED or tried.x is not None
        getattr(problem, array).reshape(-1)[0] = value
        assert tried.solve() is status and tried.counts["failed"] == 1, array
