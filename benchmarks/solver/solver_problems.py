"""Reliability of the solver: ticks of random problems, every solution checked, a sample compared with ProxQP.

    python benchmarks/solver/solver_problems.py --ticks 10000 --repeat 1 --sample 100

A tick counts with the shortest time of all passes: ticks repeat bit for bit, while the machine's own pauses (14 in
100,000 ticks, up to 30 ms, where this was written) fall on other ticks. Facts are printed as JSON.
"""

from __future__ import annotations

import argparse
import gc
import json
import logging
import math
import sys
from collections import Counter
from time import thread_time
from typing import Any

import numpy as np
import qpsolvers
from problem_streams import ProblemStream, least_violation

from wbc.core.qp.solving.problem import Problem
from wbc.core.qp.solving.solution import Solution
from wbc.core.qp.solving.solver import SolverSettings, Status, standard_form
from wbc.robots import load, names

SLOW = 5e-3
"""Time from which a tick is too late for a 200 Hz controller, s."""


AGREEMENT = 1e-3
"""Largest difference between two solvers that counts as the same solution, m/s² and rad/s²."""


class _Tally:
    """Counts and times of one pass over the problems."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.tolerance = SolverSettings().residual_tolerance
        self.wall: list[float] = []
        self.cpu: list[float] = []
        self.active: list[int] = []
        self.worst_residual = 0.0
        self.worst_difference = 0.0
        self.counts: Counter[str] = Counter()
        self.solvers: Counter[str] = Counter()
        self.violations: list[float] = []

    def run(self, stream: ProblemStream) -> None:
        """Solve the problems of a stream until it ends or enough are solved."""
        for _ in range(self.options.stream):
            start = thread_time()
            solution = stream.step()
            cpu = thread_time() - start
            problem = stream.controller.problem
            if solution.status is not Status.RELAXED and solution.ok:
                self.solved(problem, solution, cpu)
            else:
                violation = least_violation(problem)
                feasible = violation <= self.tolerance
                self.counts["unsolved" if feasible else "infeasible"] += 1
                if not feasible:
                    self.violations.append(violation)
                if not stream.scattered:
                    break
            if stream.fallen and not stream.scattered or len(self.wall) >= self.options.ticks:
                break

    def solved(self, problem: Problem, solution: Solution, cpu: float) -> None:
        """Check a solution, and compare a sample with ProxQP."""
        self.wall.append(solution.timings.solve)
        self.cpu.append(cpu)
        self.active.append(int(np.count_nonzero(np.abs(solution.multipliers) > 1e-9)))
        residual = primal_residual(problem, solution)
        self.worst_residual = max(self.worst_residual, residual)
        self.counts["above tolerance"] += residual > self.tolerance
        if len(self.wall) % self.options.sample == 0:
            self._compare(problem, solution)

    def _compare(self, problem: Problem, solution: Solution) -> None:
        other = qpsolvers.solve_problem(standard_form(problem), solver="proxqp", eps_abs=1e-9)
        if not other.found or other.x is None:
            self.counts["ProxQP failed"] += 1
            return
        nv = problem.nv
        difference = float(np.abs(other.x[:nv] - solution.accelerations).max())
        self.counts["compared"] += 1
        self.counts["differ"] += difference > AGREEMENT
        self.worst_difference = max(self.worst_difference, difference)


def bench_solver(options: argparse.Namespace) -> dict[str, Any]:
    """Solve random problems until enough feasible ones are solved.

    A problem that was not solved, or with limits relaxed, goes to a linear program: if that, too, finds no point within
    the tolerance, the problem is infeasible, is not counted as a tick, and a new stream begins; otherwise it counts as
    unsolved. Of the
    plain values returned `unsolved`, `above_tolerance`, `slow_ticks` and `differ_from_proxqp` should be zero.
    """
    tally = _pass(options)
    first = np.array(tally.wall)
    for _ in range(options.repeat - 1):
        again = _pass(options)
        tally.wall = list(np.minimum(tally.wall, again.wall))
        tally.cpu = list(np.minimum(tally.cpu, again.cpu))
    return _facts(tally, first)


def _pass(options: argparse.Namespace) -> _Tally:
    """Solve all problems once."""
    tally = _Tally(options)
    root = np.random.SeedSequence(options.seed)
    while len(tally.wall) < options.ticks:
        rng = np.random.default_rng(root.spawn(1)[0])
        robots = options.robot or names()
        description = load(robots[tally.counts["streams"] % len(robots)])
        scattered = bool(rng.random() < options.scattered)
        stream = ProblemStream(
            description, rng, scattered=scattered, solver=SolverSettings(solver=options.solver)
        )
        tally.counts["streams"] += 1
        gc.collect()
        gc.disable()  # it can take 25 ms; `timeit` does so, too
        try:
            tally.run(stream)
        finally:
            gc.enable()
        tally.solvers.update(stream.controller.solver_counts)
        tally.counts["switches"] += stream.switches
        print(len(tally.wall), "ticks", file=sys.stderr)
    return tally


def primal_residual(problem: Problem, solution: Solution) -> float:
    """Return the largest violation of any constraint, computed from the solution alone."""
    x = solution.variables
    equality = np.abs(problem.equality @ x - problem.equality_target).max(initial=0.0)
    values = problem.inequality @ x
    return float(max(equality, (values - problem.upper).max(), (problem.lower - values).max(), 0.0))


def _facts(tally: _Tally, first: np.ndarray[Any, Any]) -> dict[str, Any]:
    wall, cpu = np.array(tally.wall), np.array(tally.cpu)
    shares = (50.0, 90.0, 99.0, 99.9, 99.99, 100.0)
    return {
        "ticks": len(wall),
        "streams": tally.counts["streams"],
        "contact_switches": tally.counts["switches"],
        "unsolved": tally.counts["unsolved"],
        "above_tolerance": tally.counts["above tolerance"],
        "worst_residual": tally.worst_residual,
        "slow_ticks": int(np.count_nonzero((wall > SLOW) & (cpu > SLOW))),
        "slow_by_the_clock": int(np.count_nonzero(first > SLOW)),
        "solve_us": _percentiles(1e6 * wall, shares),
        "tick_cpu_us": _percentiles(1e6 * cpu, shares),
        "compared_with_proxqp": tally.counts["compared"],
        "differ_from_proxqp": tally.counts["differ"],
        "worst_difference": tally.worst_difference,
        "proxqp_failed": tally.counts["ProxQP failed"],
        "solvers": dict(tally.solvers),
        "active_limits": round(float(np.mean(tally.active)), 2),
        "infeasible": {
            "problems": tally.counts["infeasible"],
            "least_violation": min(tally.violations, default=math.nan),
        },
        "options": vars(tally.options),
    }


def _percentiles(values: np.ndarray[Any, Any], shares: tuple[float, ...]) -> dict[str, float]:
    return {f"{share:g}%": round(float(np.percentile(values, share)), 1) for share in shares}


def main() -> None:
    """Run the benchmark and print its facts as JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, default, text in (
        ("ticks", 100_000, "feasible problems to solve, over all robots"),
        ("stream", 1000, "longest stream from one random start, ticks"),
        ("scattered", 0.2, "share of streams whose every tick has a random state of its own"),
        ("sample", 50, "ProxQP solves the same problem from scratch every so many ticks"),
        ("seed", 0, "of every random draw"),
        ("repeat", 2, "passes over all problems; a tick counts with its shortest time"),
        ("solver", "auto", 'the ladder, or "proxqp", "daqp" or another one that qpsolvers finds'),
    ):
        parser.add_argument(
            f"--{name}", type=type(default), default=default, help=f"{text}, default %(default)s"
        )
    parser.add_argument(
        "--robot", action="append", help="robots that take turns; all built-in ones when none is given"
    )
    options = parser.parse_args()
    # Infeasible problems are expected here.
    logging.getLogger("wbc.core.qp.solving.solver").setLevel(logging.ERROR)
    print(json.dumps(bench_solver(options), indent=1))


if __name__ == "__main__":
    main()
