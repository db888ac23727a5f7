"""The ladder of solvers: each step of it gives the same solution of the same problem, and none is trusted unchecked."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg.lapack import dposv

from wbc.app.bench.streams import ProblemStream
from wbc.core.errors import InputError, UnknownNameError
from wbc.core.qp import active_set
from wbc.core.qp.active_set import ActiveSet
from wbc.core.qp.other_solvers import DaqpSolver, solve_by_qpsolvers
from wbc.core.qp.solver import QpSolver, SolverSettings, Status, solver_names
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
    for _ in range(40):
        solution = problems.step()
        assert solution.ok
        assert other.solve().ok
        nv = problems.controller.problem.nv
        np.testing.assert_allclose(other.x[:nv], solution.accelerations, atol=1e-4)
        active += int(np.count_nonzero(solution.multipliers))
    assert active > 40
    used = {name for name, count in other.counts.items() if count}
    expected = {"auto": "DAQP", "proxqp": "ProxQP", "daqp": "DAQP"}.get(solver, "other")
    assert expected in used and "failed" not in used


def test_the_ladder_leaves_changing_limits_to_daqp_and_the_first_tick_to_proxqp() -> None:
    problems = stream()
    for _ in range(60):
        assert problems.step().ok
    counts = problems.controller.solver_counts
    assert counts["ProxQP"] == 1 and counts["DAQP"] > 5 and counts["active set"] > 5


def test_the_first_tick_is_proxqp_s_from_daqp_s_guess_and_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    problems = stream()
    for _ in range(20):
        solution = problems.step()
    problem = problems.controller.problem
    guessed = QpSolver(problem)
    assert guessed.solve() is Status.SOLVED and guessed.counts["ProxQP"] == 1
    assert guessed.iterations == 0, "ProxQP confirms an exact guess without an iteration"
    monkeypatch.setattr(DaqpSolver, "solve", lambda *_: None)
    alone = QpSolver(problem)
    assert alone.solve() is Status.SOLVED and alone.counts["ProxQP"] == 1 and alone.iterations > 0
    for one in (guessed, alone):
        np.testing.assert_allclose(one.x[: problem.nv], solution.accelerations, atol=1e-4)


def test_daqp_finds_the_same_from_any_guess_and_repeats_bit_for_bit() -> None:
    problems = stream(3)
    for _ in range(20):
        solution = problems.step()
    p = problems.controller.problem
    hessian, gradient, rng = p.hessian, p.gradient, np.random.default_rng(0)
    reference = DaqpSolver(p, 1e-7).solve(hessian, gradient, solution.multipliers)
    again = DaqpSolver(p, 1e-7).solve(hessian, gradient, solution.multipliers)
    assert reference is not None and again is not None
    for one, other in zip(reference, again, strict=True):
        np.testing.assert_array_equal(one, other)
    x, y, z = reference
    stationarity = hessian @ x + gradient + p.equality.T @ y + p.inequality.T @ z
    np.testing.assert_allclose(stationarity, 0.0, atol=1e-4)
    for _ in range(10):
        guess = np.where(rng.random(p.lower.size) < 0.1, rng.normal(size=p.lower.size), 0.0)
        guess[~np.isfinite(np.where(guess > 0.0, p.upper, p.lower))] = 0.0
        found = DaqpSolver(p, 1e-7).solve(hessian, gradient, guess)
        assert found is not None
        np.testing.assert_allclose(found[0], x, atol=1e-5)
    other_x = solve_by_qpsolvers("proxqp", p, hessian, gradient)
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


def test_an_unknown_solver_names_those_installed_and_the_way_to_others() -> None:
    with pytest.raises(
        UnknownNameError, match=r"no solver 'osqp2'; choices: auto, proxqp, daqp.*pip install"
    ):
        SolverSettings(solver="osqp2")


def test_a_solver_of_sparse_problems_is_refused_before_the_first_tick() -> None:
    with pytest.raises(InputError, match=r"'osqp' needs sparse matrices.*choices: auto, proxqp, daqp"):
        SolverSettings(solver="osqp")


def test_an_inexact_factorisation_is_refined_to_the_same_solution(monkeypatch: pytest.MonkeyPatch) -> None:
    problems = stream()
    for _ in range(20):
        solution = problems.step()
    problem = problems.controller.problem
    exact, refined = (ActiveSet(problem, 1e-7, 10) for _ in range(2))

    def rough(*arrays: Any, **options: Any) -> tuple[Any, Any, int]:
        factor, force, info = dposv(*arrays, **options)
        return factor, 1.001 * force, info

    for solver in (exact, refined):
        solver.guess(solution.multipliers)
        assert solver.solve()
        monkeypatch.setattr(active_set, "dposv", rough)
    np.testing.assert_allclose(refined.x, exact.x, atol=1e-6)
