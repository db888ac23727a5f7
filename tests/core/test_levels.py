"""Strict priorities: cascades against hand calculation, DAQP's hierarchy, and weighted problems."""

from __future__ import annotations

import time

import daqp
import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import null_space

from wbc import (
    CoMTask,
    Controller,
    JointLimits,
    MotionTask,
    PositionTask,
    PostureTask,
    SoleContact,
    TorqueLimits,
    load_robot,
)
from wbc.core.errors import Array, InputError
from wbc.core.qp.levels import LevelSolver
from wbc.core.qp.problem import Problem
from wbc.core.qp.solver import QpSolver, SolverSettings, Status


class Sick(MotionTask):
    """A task whose error may be NaN, and whose Jacobian may be zero."""

    def __init__(self, level: int) -> None:
        super().__init__("sick", 1, level=level)
        self.row = self.value = 1.0

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        jacobian[:], error[:], drift[:] = self.row, self.value, 0.0


def problem(n: int, n_eq: int, n_soft: int, n_in: int) -> Problem:
    """Return a QP with a bound that never acts, as every controller's has some."""
    made = Problem(n, 0, n, n_eq, n_soft, n_in)
    made.diagonal[:] = 1e-7
    made.soft_weight[:] = 1.0
    return made


def random_problem(rng: np.random.Generator, n: int, n_eq: int, dims: tuple[int, ...], n_in: int) -> Problem:
    p = problem(n, n_eq, sum(dims), n_in)
    p.rows[:] = rng.normal(size=p.rows.shape)
    p.soft[:] /= np.linalg.norm(p.soft, axis=1)[
        :, None
    ]  # as DAQP's hierarchy does, which costs the scaled slack
    p.target[:] = rng.normal(size=p.target.shape)
    inside = np.linalg.lstsq(p.equality, p.equality_target, rcond=None)[0]
    room = rng.uniform(0.1, 2.0, size=(2, n_in))
    p.lower[:], p.upper[:] = p.inequality @ inside - room[0], p.inequality @ inside + room[1]
    return p


def costs(p: Problem, dims: tuple[int, ...], x: np.ndarray) -> list[float]:
    """Distance of each level from its targets."""
    residual = p.soft @ x - p.target[p.n_eq :]
    return [float(np.linalg.norm(part)) for part in np.split(residual, np.cumsum(dims)[:-1])]


def test_a_conflict_solved_by_hand() -> None:
    """X = 1 before x + y = 3 before (x, y) = (5, 5): (1, 2), though the last level wants something else."""
    p = problem(3, 1, 4, 1)
    p.equality[0, 2] = 1.0
    p.soft[:, :2] = [(1, 0), (1, 1), (1, 0), (0, 1)]
    p.target[1:] = 1, 3, 5, 5
    solver = LevelSolver(p, (1, 1, 2))
    assert solver.solve().ok
    np.testing.assert_allclose(solver.x, (1.0, 2.0, 0.0), atol=1e-6)
    np.testing.assert_allclose(solver.values, p.rows @ solver.x, atol=1e-12)


def test_bounds_hold_in_every_level() -> None:
    p = problem(3, 1, 2, 1)
    p.equality[0, 2] = 1.0
    p.soft[:, :2] = np.eye(2)
    p.target[1:] = 2.0, 5.0
    p.inequality[:], p.upper[:] = (1, 1, 0), 3.0
    solver = LevelSolver(p, (1, 1))
    assert solver.solve().ok
    np.testing.assert_allclose(solver.x, (2.0, 1.0, 0.0), atol=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_the_cascade_is_that_of_daqps_hierarchy(seed: int) -> None:
    dims = (9, 6, 34)
    rng = np.random.default_rng(seed)
    p = random_problem(rng, 52, 18, dims, 102)
    solver = LevelSolver(p, dims)
    assert solver.solve().ok
    # Every level as DAQP reaches it: rows in the order of the levels, hard ones first.
    rows = np.vstack([p.equality, p.inequality, p.soft])
    target = p.target[p.n_eq :]
    upper = np.concatenate([p.equality_target, p.upper, target])
    lower = np.concatenate([p.equality_target, p.lower, target])
    ends = np.cumsum([0, p.n_eq + p.lower.size, *dims])
    sense = np.zeros(len(rows), dtype=np.intc)
    x, _, flag, _ = daqp.solve(
        1e-7 * np.eye(52),
        np.zeros(52),
        rows,
        upper,
        lower,
        sense,
        break_points=ends.astype(np.intc),
        rho_soft=1e-8,
    )
    assert flag in (1, 2)
    np.testing.assert_allclose(costs(p, dims, solver.x), costs(p, dims, x), atol=1e-6)


@pytest.mark.parametrize("seed", range(10))
def test_no_level_notices_those_below_it(seed: int) -> None:
    dims = (9, 6, 20)
    p = random_problem(np.random.default_rng(seed), 40, 10, dims, 60)
    whole = LevelSolver(p, dims)
    assert whole.solve().ok
    for kept in (1, 2):
        part = random_problem(np.random.default_rng(seed), 40, 10, dims, 60)
        part.soft_weight[sum(dims[:kept]) :] = 0.0
        alone = LevelSolver(part, dims)
        assert alone.solve().ok
        np.testing.assert_allclose(
            costs(p, dims, whole.x)[:kept], costs(part, dims, alone.x)[:kept], atol=1e-6
        )


def test_levels_without_conflict_are_the_weighted_problem() -> None:
    rng = np.random.default_rng(5)
    p = random_problem(rng, 30, 6, (8, 8), 1)
    levels, weighted = LevelSolver(p, (8, 8)), QpSolver(p)
    assert levels.solve().ok and weighted.solve().ok
    assert max(costs(p, (8, 8), weighted.x)) < 1e-5, "there is room for both"
    np.testing.assert_allclose(levels.x, weighted.x, atol=1e-4)


@pytest.mark.parametrize("rank", [4, 10])
def test_a_level_may_have_more_rows_than_freedom_is_left(rank: int) -> None:
    """Thirty rows where ten directions are left, of which they decide some: least squares level by level."""
    dims, rng = (6, 30, 5), np.random.default_rng(rank)
    p = random_problem(rng, 20, 4, dims, 1)
    p.lower[:], p.upper[:], p.diagonal[:] = -1e3, 1e3, 1e-10
    p.soft[6:36] = rng.normal(size=(30, rank)) @ rng.normal(size=(rank, 20))
    solver = LevelSolver(p, dims)
    assert solver.solve().ok
    x, basis = np.zeros(20), np.eye(20)
    for rows, target in zip(
        np.split(p.rows[:45], np.cumsum((4, *dims))[:-1]),
        np.split(p.target, np.cumsum((4, *dims))[:-1]),
        strict=True,
    ):
        x = x + basis @ np.linalg.lstsq(rows @ basis, target - rows @ x)[0]
        basis = basis @ null_space(rows @ basis) if basis.size else basis
    np.testing.assert_allclose(costs(p, dims, solver.x), costs(p, dims, x), atol=1e-5)


def test_rows_that_imply_each_other_are_no_harm() -> None:
    """Twice the same wish in level 1, contradicting, and a wish that the constraints fix already."""
    p = problem(4, 1, 4, 1)
    p.equality[:], p.target[0] = (1, 0, 0, 0), 1.0
    p.soft[:] = [(0, 1, 0, 0), (0, 1, 0, 0), (1, 0, 0, 0), (0, 1, 1, 0)]
    p.target[1:] = 2.0, 4.0, 7.0, 0.0
    for solver in ("auto", "daqp", "proxqp"):
        cascade = LevelSolver(p, (3, 1), SolverSettings(solver=solver))
        assert cascade.solve().ok
        np.testing.assert_allclose(cascade.x[:3], (1.0, 3.0, -3.0), atol=1e-5)


# In a controller


def controller(
    com_level: int, hand_level: int, posture_level: int
) -> tuple[Controller, CoMTask, PositionTask]:
    robot = load_robot("hrp4_class").robot()
    made = Controller(robot, 0.005)
    com = made.add(CoMTask(level=com_level))
    hand = made.add(PositionTask("left_hand", level=hand_level))
    made.add(PostureTask(level=posture_level))
    made.add(SoleContact("left_foot"), SoleContact("right_foot"), JointLimits(), TorqueLimits())
    hand.target = hand.target + [2.0, 0.0, 0.0]  # far out of reach
    return made, com, hand


def test_a_level_that_those_above_it_decide_takes_nothing_from_those_below() -> None:
    """The same task once more, and a foot that its contact holds: their rows are rounding once those above are met."""

    def solved(*more: MotionTask) -> tuple[Array, Array]:
        robot = load_robot("hrp4_class").robot()
        made = Controller(robot, 0.005)
        com = np.array(robot.com) + (0.01, 0.02, 0.0)
        made.add(SoleContact("left_foot"), SoleContact("right_foot"), JointLimits(), TorqueLimits())
        made.add(CoMTask(com), PostureTask(robot.half_sitting[7:] + 0.05, level=4))
        for task in more:
            made.add(task)
            if isinstance(task, CoMTask):
                task.target = com
        solution = made.solve()
        assert solution.ok
        return solution.accelerations, solution.torques

    alone = solved()
    for more in (
        (CoMTask(name="again", level=2),),
        (CoMTask(name="again", level=2), PositionTask("left_foot", (0.0, 0.0, 1.0), level=3)),
    ):
        for got, expected in zip(solved(*more), alone, strict=True):
            np.testing.assert_allclose(got, expected, atol=1e-9)


def test_a_level_with_nothing_left_to_decide_has_no_active_limit() -> None:
    p = problem(3, 1, 3, 1)
    p.equality[0, 2] = 1.0
    p.soft[:2, :2], p.soft[2, 0] = np.eye(2), 1.0
    p.target[1:] = (1.0, 1.0, 5.0)
    p.inequality[0, 0], p.upper[:] = 1.0, 2.0
    solver = LevelSolver(p, (2, 1))
    p.soft_weight[:2] = 0.0
    assert solver.solve().ok and solver.x[0] == pytest.approx(2.0) and solver.multipliers[0] > 0.0
    p.soft_weight[:2] = 1.0
    assert solver.solve().ok and solver.x[0] == pytest.approx(1.0)
    assert solver.multipliers[0] == 0.0


def test_the_centre_of_mass_yields_nothing_to_a_hand_of_a_lower_level() -> None:
    def com_error(*levels: int) -> float:
        made, com, hand = controller(*levels)
        for task in (com, hand):
            task.weight = 1.0
        solution = made.solve()
        assert solution.status.ok
        return float(abs(solution.residuals[com.name]).max())

    assert com_error(1, 1, 1) > 1e-2
    assert com_error(1, 2, 3) < 1e-6
    assert com_error(1, 2, 2) < 1e-6


def test_a_selection_of_a_higher_level_is_kept() -> None:
    made, _, _ = controller(2, 2, 1)
    solution = made.solve()
    assert solution.status.ok
    assert abs(solution.residuals[made.tasks[2].name]).max() < 1e-5


def test_a_task_without_weight_binds_no_lower_level() -> None:
    made, com, hand = controller(1, 2, 2)
    com.weight = 0.0
    solution = made.solve()
    free = made.solve().residuals[hand.name]
    com.weight = 1.0
    bound = made.solve().residuals[hand.name]
    assert solution.status.ok and abs(free).max() < abs(bound).max()


@pytest.mark.parametrize("name", ["hrp4_class", "talos"])
def test_levels_are_solved_within_limits_where_many_of_them_act(name: str) -> None:
    """More bounds are tight than freedom is left, in nearly half of these ticks; one level alone never fails here."""
    robot = load_robot(name).robot()
    made = Controller(robot, 0.005)
    com, hand = made.add(CoMTask(level=1)), made.add(PositionTask(robot.frames["right_hand"], level=2))
    made.add(PostureTask(level=3), SoleContact("left_foot"), SoleContact("right_foot"), TorqueLimits())
    rng = np.random.default_rng(3)
    for _ in range(150):
        joints = rng.uniform(-0.1, 0.1, robot.na)
        q = pin.integrate(robot.model, robot.half_sitting, np.concatenate([np.zeros(6), joints]))
        robot.update(q, rng.uniform(-0.1, 0.1, robot.nv))
        for contact in made.contacts:
            contact.reset()
        com.feedforward_acceleration, hand.feedforward_acceleration = (
            5.0 * rng.normal(size=3),
            20.0 * rng.normal(size=3),
        )
        solution = made.solve()
        assert solution.ok
        p, values = made.problem, made.problem.rows @ solution.variables
        bounded = values[p.n_eq + p.n_soft :]
        assert (bounded <= p.upper + 1e-5).all() and (bounded >= p.lower - 1e-5).all()
        np.testing.assert_allclose(values[: p.n_eq], p.target[: p.n_eq], atol=1e-5)
    assert made.solver_counts["levels given up"] == 0


def test_levels_that_contradict_are_refused() -> None:
    with pytest.raises(InputError, match="level of task 'com' must be an integer of at least 1, got 0"):
        CoMTask(level=0)
    with pytest.raises(InputError, match="level of task 'com'.*got 1.5"):
        CoMTask(level=1.5)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="is hard, above all levels, so that its level must be 1, got 2"):
        CoMTask(level=2, hard=True)


@pytest.mark.parametrize("level", [1, 2, 3])
def test_nan_in_a_task_of_any_level_is_refused_and_named(level: int) -> None:
    made, _, _ = controller(1, 2, 3)
    good = made.solve()
    sick = made.add(Sick(level))
    sick.row, sick.value = 0.0, float("nan")
    for _ in range(2):
        refused = made.solve()
        assert refused.status is Status.REFUSED
        assert np.isfinite(refused.variables).all() and np.isfinite(refused.torques).all()
    named = made.diagnose()
    assert list(named) == ["task 'sick'"] and np.isnan(named["task 'sick'"])
    sick.value = 0.0
    well = made.solve()
    assert well.ok and made.diagnose() == {}
    np.testing.assert_allclose(well.torques, good.torques, atol=1e-3)


def test_nan_in_the_rows_of_a_lower_level_is_refused() -> None:
    p = problem(3, 1, 2, 1)
    p.equality[0], p.soft[0], p.soft[1] = [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, np.nan, 0.0]
    p.inequality[0], p.upper[:] = [1.0, 0.0, 0.0], 10.0
    solver = LevelSolver(p, (1, 1))
    assert solver.solve() is Status.REFUSED
    p.soft[1] = [0.0, 1.0, 0.0]
    assert solver.solve().ok and np.isfinite(solver.x).all()


@pytest.mark.slow
def test_three_levels_take_at_most_three_times_as_long_as_one() -> None:
    def median(levels: tuple[int, int, int]) -> float:
        made, _, hand = controller(*levels)
        hand.target = hand.target - [1.9, 0.0, 0.0]
        durations: list[float] = []
        q, v = made.robot.q.copy(), made.robot.v.copy()
        for _ in range(500):
            begin = time.process_time()
            made.update(q, v)
            assert made.solve().status.ok
            durations.append(time.process_time() - begin)
        return float(np.median(durations))

    one, three = median((1, 1, 1)), median((1, 2, 3))
    assert three < 3.0 * one
