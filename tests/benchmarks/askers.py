"""Contest of engines for the Bayesian optimisation: how far from the best is the point that each recommends?

The functions have the noise of walks: a walk falls at a step of its own or not at all. All engines are judged alike, by
the true mean at the optimum that `wbc study optimize` would name among the points they asked for.

Usage: pip install -e '.[studies]' "optuna>=5,<6" scikit-optimize
       python tests/benchmarks/askers.py [--seeds N] [--budget N ...] [--engine NAME ...]
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.stats import qmc

from wbc.sim.studies.paper.optimization import NAMES, Asker, Bounds, Walked
from wbc.sim.studies.paper.optimum import optimum

STEPS = 22
WORST = 0.95  # probability of a fall far from the best
UNIT = Bounds(k=(0.0, 1.0), kP=(0.0, 1.0), kD=(0.0, 1.0), log=False)

Point = tuple[float, ...]
Engine = Callable[[int], tuple[Callable[[], Point], Callable[[Point, float], None]]]


def gains(u: Point) -> float:
    """Return the distance from the best where the stiffness does not matter."""
    return ((u[1] - 0.6) / 0.25) ** 2 + ((u[2] - 0.2) / 0.2) ** 2


def stiffness(u: Point) -> float:
    """Return the distance from the best where all three matter."""
    return ((u[0] - 0.35) / 0.3) ** 2 + ((u[1] - 0.55) / 0.35) ** 2 + 0.5 * ((u[2] - 0.3) / 0.35) ** 2


def ridge(u: Point) -> float:
    """Return the distance from the best where one gain asks for another one."""
    return ((u[1] - 0.7 * u[2] - 0.35) / 0.15) ** 2 + ((u[0] - 0.6) / 0.6) ** 2


FUNCTIONS = {function.__name__: function for function in (gains, stiffness, ridge)}


def falls(function: Callable[[Point], float], u: Point) -> float:
    """Return the probability of a fall at a point, at least 13 of 100."""
    return WORST * (1.0 - math.exp(-0.35 * function(u) - 0.15))


def steps(function: Callable[[Point], float], u: Point, rng: np.random.Generator) -> float:
    """Return the steps of one walk."""
    return float(int(STEPS * rng.random())) if rng.random() < falls(function, u) else float(STEPS)


def mean_steps(function: Callable[[Point], float], u: Point) -> float:
    """Return the mean number of steps at a point."""
    share = falls(function, u)
    return STEPS * (1.0 - share) + 0.5 * (STEPS - 1) * share


def bayesian_optimization(seed: int) -> Any:
    """Return ask and tell of the library's own optimisation."""
    asker, known = Asker(seed), []

    def tell(point: Point, value: float) -> None:
        known.append(Walked(point, value, {}))

    return lambda: asker.ask(known, 1)[0], tell


def optuna_tpe(seed: int) -> Any:
    """Return ask and tell of Optuna's tree of Parzen estimators."""
    import optuna  # noqa: PLC0415 - not a requirement

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    sampler = optuna.samplers.TPESampler(seed=seed, n_startup_trials=12, multivariate=True)
    study, trials = optuna.create_study(direction="maximize", sampler=sampler), []

    def ask() -> Point:
        trials.append(study.ask())
        return tuple(trials[-1].suggest_float(name, 0.0, 1.0) for name in NAMES)

    return ask, lambda point, value: study.tell(trials[-1], value)


def scikit_optimize(seed: int) -> Any:
    """Return ask and tell of scikit-optimize: a Gaussian process and the expected improvement."""
    import skopt  # noqa: PLC0415 - not a requirement

    engine = skopt.Optimizer(
        [(0.0, 1.0)] * len(NAMES),
        base_estimator="GP",
        acq_func="EI",
        n_initial_points=12,
        initial_point_generator="sobol",
        random_state=seed,
    )
    return lambda: tuple(float(v) for v in engine.ask()), lambda point, value: engine.tell(
        list(point), -value
    )


def sobol(seed: int) -> Any:
    """Return ask and tell of a scrambled Sobol sequence, which learns nothing."""
    points = iter(qmc.Sobol(len(NAMES), rng=np.random.default_rng(seed)).random(1024))
    return lambda: tuple(float(v) for v in next(points)), lambda point, value: None


ENGINES: dict[str, Engine] = {
    "bayesian-optimization, GP": bayesian_optimization,
    "scikit-optimize, GP": scikit_optimize,
    "Optuna, TPE": optuna_tpe,
    "Sobol": sobol,
}


def contest(engine: Engine, function: Callable[[Point], float], seed: int, budgets: list[int]) -> Any:
    """Return the steps missed at the recommended point by budget, and the processor time of a point, s."""
    ask, tell = engine(seed)
    rng = np.random.default_rng([seed, 7])
    grid = np.random.default_rng(0).random((4096, len(NAMES)))
    best = max(mean_steps(function, tuple(u)) for u in grid)
    known: list[Walked] = []
    missed, spent = {}, 0.0
    for count in range(1, max(budgets) + 1):
        begin = time.process_time()
        point = ask()
        value = steps(function, point, rng)
        tell(point, value)
        spent += time.process_time() - begin
        known.append(Walked(point, value, {}))
        if count in budgets:
            chosen = optimum(known, UNIT, seed=seed).best
            missed[count] = best - mean_steps(function, tuple(chosen[name] for name in NAMES))
    return missed, spent / len(known)


def main() -> None:
    """Print the table: steps of 22 missed, mean and worst of the seeds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--engine", choices=ENGINES, nargs="+", default=list(ENGINES))
    parser.add_argument("--budget", type=int, nargs="+", default=[50, 100])
    options = parser.parse_args()
    print("| Engine | Function | " + " | ".join(f"{b} walks" for b in options.budget) + " | A point |")
    print("|---|---|" + "---:|" * (len(options.budget) + 1))
    for name in options.engine:
        engine = ENGINES[name]
        for title, function in FUNCTIONS.items():
            runs = [contest(engine, function, seed, options.budget) for seed in range(options.seeds)]
            cells = [
                f"{np.mean([missed[b] for missed, _ in runs]):.2f} [{max(missed[b] for missed, _ in runs):.2f}]"
                for b in options.budget
            ]
            print(
                f"| {name} | {title} | {' | '.join(cells)} | {1e3 * np.mean([ask for _, ask in runs]):.0f} ms |",
                flush=True,
            )


if __name__ == "__main__":
    main()
