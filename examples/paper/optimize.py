"""Best stiffness and gains of a ground by Bayesian optimisation (the paper's section III and Table II).

    python examples/paper/optimize.py stones --journal stones.jsonl --budget 400 --workers 2 --validate 20
    python examples/paper/optimize.py table2 --journal optimize.jsonl --workers 2       # its eleven grounds

A walk is one value of a noisy function: each has a layout of its own. Asking is a pure function of what has been
walked, so that a run that was killed asks the same again, finds the answers in its journal and goes on.
"""

from __future__ import annotations

import argparse
import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import norm, qmc
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel
from walks import by_sole, gain, markdown, shown, walks

from wbc.sim import WalkSpec
from wbc.sim.studies import Journal, Study, local_executor, read_journal, study_table, sweep
from wbc.sim.walks.presets import FAST_LANDING

Array = NDArray[np.float64]

NAMES = ("k", "kP", "kD")
"""Parameters: stiffness of the sole (Nm/rad), proportional (1/s) and derivative gain of the stabilizer."""

FIRST_SEED = 10_000
"""Seed of the first walk of an optimisation; the following walks have the following ones. Validations walk others."""

FIRST_DESIGN = 12
"""Points before the first model: four for each parameter, a scrambled Sobol sequence."""

CANDIDATES, GRID = 2000, 201
"""Random points of which the next one walked is the best, and stiffnesses of a slice of the posterior."""

PAPER_GAINS = {"gains.dcm_p": 3.4, "gains.dcm_d": 2.1}
"""The paper's gains on a flat floor."""

HEIGHTS = {
    "cylinder_obstacles": 0.060, "stones": 0.055, "small_stones": 0.020, "stone_bricks": 0.0775,
    "pyramidal_stones": 0.090, "metal_sheets": 0.065, "large_floor_tiles": 0.090, "roof_tiles": 0.055,
    "cobble_stones": 0.0775, "floor_tiles": 0.065,
}  # fmt: skip
"""Heights at which half of the walks by the default law fall (studies 'halfway', 'authority'), m."""

TABLE_II: Mapping[str, tuple[str, float, float, tuple[float, float] | None]] = {
    "flat": ("Flat floor", 3.4, 2.1, None),
    "cylinder_obstacles": ("Cylinder obst", 4.8, 1.8, (0.2, 9.5)),
    "stones": ("Stones", 4.0, 1.3, (2.8, 16.1)),
    "small_stones": ("Small stones", 4.3, 2.4, (2.3, 31.6)),
    "stone_bricks": ("Stones Bricks", 5.0, 0.5, (25.4, 28.9)),
    "pyramidal_stones": ("Pyramidal stones", 4.2, 1.6, (0.9, 48.7)),
    "metal_sheets": ("Metal iron sheets", 3.6, 2.7, (0.7, 19.9)),
    "large_floor_tiles": ("Large floor tiles", 3.9, 2.6, (0.02, 0.6)),
    "roof_tiles": ("Roof tiles", 4.1, 2.6, (23.9, 33.3)),
    "cobble_stones": ("Cobble stones", 4.0, 2.6, (18.4, 32.8)),
    "floor_tiles": ("Floor tiles", 3.7, 1.1, (31.6, 46.1)),
}
"""The paper's Table II: family → its name there, kP, kD and range of optimal k (Nm/rad; None: entire range)."""


@dataclass(frozen=True)
class Bounds:
    """Lowest and highest k (Nm/rad), kP (1/s) and kD; k is searched in its logarithm if `log`."""

    k: tuple[float, float]
    kP: tuple[float, float] = (0.1, 5.0)  # noqa: N815 - the paper's name
    kD: tuple[float, float] = (0.1, 5.0)  # noqa: N815 - the paper's name
    log: bool = True

    def _ends(self, name: str) -> tuple[float, float]:
        low, high = getattr(self, name)
        return (math.log10(low), math.log10(high)) if name == "k" and self.log else (low, high)

    def values(self, unit: Sequence[float] | Array) -> dict[str, float]:
        """Return the parameters of a point of the unit cube, with six digits."""
        result = {}
        for name, share in zip(NAMES, unit, strict=True):
            low, high = self._ends(name)
            value = low + share * (high - low)
            value = 10.0**value if name == "k" and self.log else value
            result[name] = float(np.clip(float(f"{value:.6g}"), *getattr(self, name)))
        return result

    def unit(self, values: Mapping[str, float]) -> list[float]:
        """Return the point of the unit cube of some parameters; outside it if they are outside the bounds."""
        result = []
        for name in NAMES:
            low, high = self._ends(name)
            value = math.log10(max(values[name], 1e-12)) if name == "k" and self.log else values[name]
            result.append((value - low) / (high - low))
        return result


BOUNDS = {"wide": Bounds((1.0, 2000.0)), "paper": Bounds((0.0, 80.0), log=False)}
"""The paper's Table I, and the whole range of the soles here."""


@dataclass(frozen=True)
class Optimisation:
    """One optimisation: ground, law, bounds and seed decide which walks it asks for.

    Attributes:
        ground: Family of grounds.
        amplitude: Highest minus lowest point of the ground, m; the family's own when None.
        law: Preset of the stabilizer, "default", "frizza" or "no_bias".
        bounds: Bounds of the parameters.
        distance: Length of a walk, m.
        seed: Seed of the points it asks for.
        batch: Points asked for at a time, which workers walk side by side.
    """

    ground: str
    amplitude: float | None = None
    law: str = "default"
    bounds: Bounds = BOUNDS["wide"]
    distance: float = 3.0
    seed: int = 0
    batch: int = 1

    @staticmethod
    def of(ground: str, law: str, **given: Any) -> Optimisation:
        """Return the optimisation of a ground: the default law at `HEIGHTS` and wide bounds, others at the paper's."""
        own = law == "default"
        values = {
            "amplitude": HEIGHTS.get(ground) if own else None,
            "bounds": BOUNDS["wide" if own else "paper"],
        }
        return Optimisation(ground, law=law, **{**values, **given})

    def parts(self) -> dict[str, Any]:
        """Return the parts of a spec that all walks share."""
        shared = {"terrain": self.ground, "amplitude": self.amplitude, "foot": "soft", "noise": "realistic"}
        gait = {} if self.law == "default" else {"gait": FAST_LANDING}
        return {**shared, "plan": {"distance": self.distance}, "gains": self.law, **gait}

    def own(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Return the parts of a spec that the parameters decide."""
        return {
            "stiffness": values["k"],
            "changes": {"gains.dcm_p": values["kP"], "gains.dcm_d": values["kD"]},
        }

    def usual(self) -> dict[str, Any]:
        """Return the same parts of a walk that nothing was optimised for: 80 Nm/rad and the usual gains of the law."""
        return {"stiffness": 80.0, "changes": {} if self.law == "default" else PAPER_GAINS}

    def walk(self, unit: Sequence[float], seed: int) -> WalkSpec:
        """Return the walk at a point of the unit cube over the layout of a seed."""
        return WalkSpec.from_json({**self.parts(), **self.own(self.bounds.values(unit)), "seed": seed})


def fitted(X: Array, y: Array, seed: int = 0) -> Any:
    """Return a Gaussian process of noisy values over the unit cube, fitted; X (n, 3), y (n,)."""
    kernel = ConstantKernel(1.0, (1e-2, 1e2)) * Matern([0.3] * X.shape[1], (0.05, 10.0), nu=2.5)
    kernel += WhiteKernel(0.5, (1e-3, 1e1))
    model = GaussianProcessRegressor(kernel, normalize_y=True, n_restarts_optimizer=1, random_state=seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return model.fit(X, y)


def ask(X: Sequence[Sequence[float]], y: Sequence[float], count: int, seed: int) -> list[tuple[float, ...]]:
    """Return the next points of the unit cube to walk; the same for the same points known, in any process.

    First a Sobol sequence, then the points of the greatest expected improvement of the mean over the best mean expected
    so far, as the greatest of noisy values says little. Points that are asked for together are told apart by believing
    the model's mean at those before.

    Source: D. Ginsbourger et al., "Kriging is well-suited to parallelize optimization", 2010 (Kriging believer);
    E. Vazquez et al., "Global optimization based on noisy evaluations", 2008.
    """
    first = qmc.Sobol(len(NAMES), rng=np.random.default_rng(seed)).random(16)[:FIRST_DESIGN]
    points, known, values = [], [list(each) for each in X], list(y)
    function = noise = None
    while len(points) < count:
        if len(known) < FIRST_DESIGN:
            point, believed = first[len(known)], float(np.mean(values)) if values else 0.0
        else:
            if function is None:
                kernel = fitted(np.array(known), np.array(values), seed).kernel_
                function, noise = kernel.k1, kernel.k2.noise_level
            # As alpha, the noise of single walks is no part of the deviation: the improvement is that of their mean.
            model = GaussianProcessRegressor(function, optimizer=None, normalize_y=True, alpha=noise)
            model.fit(np.array(known), np.array(values))
            rng = np.random.default_rng([seed, len(known)])
            candidates = rng.random((CANDIDATES, len(NAMES)))
            mean, std = model.predict(candidates, return_std=True)
            lead = mean - model.predict(np.array(known)).max()
            ratio = lead / np.maximum(std, 1e-12)
            best = int(np.argmax(lead * norm.cdf(ratio) + std * norm.pdf(ratio)))
            point, believed = candidates[best], float(mean[best])
        points.append(tuple(float(f"{value:.9g}") for value in point))
        known.append(list(points[-1]))
        values.append(believed)
    return points


def optimise(task: Optimisation, budget: int, journal: Journal, **options: Any) -> tuple[Array, Array]:
    """Walk the points of an optimisation until its budget is spent; return points (n, 3) and J (n,) as asked for.

    What the journal has is not walked again. Walks without a result are left out.
    """
    X: list[tuple[float, ...]] = []
    y: list[float] = []
    asked = 0
    while asked < budget:
        left = (FIRST_DESIGN if asked < FIRST_DESIGN else budget) - asked
        points = ask(X, y, min(task.batch, left, budget - asked), task.seed)
        specs = [task.walk(point, FIRST_SEED + asked + i) for i, point in enumerate(points)]
        asked += len(points)
        sweep(specs, journal, **options)
        for point, spec in zip(points, specs, strict=True):
            entry = journal.entry(spec)
            if entry is not None and entry.result is not None:
                X.append(point)
                y.append(float(entry.result["J"]))
        print(f"{task.ground}: {asked} of {budget} walks", flush=True)
    return np.array(X), np.array(y)


@dataclass(frozen=True)
class Optimum:
    """Result of an optimisation.

    Attributes:
        walks: Number of walks.
        best: Parameters of the greatest expected J among those walked.
        J: Expected J there, and the standard deviation of that expectation.
        noise: Standard deviation of the J of single walks about their expectation.
        same: Ranges of k whose expected J, at the best gains, cannot be told from the best at 95 %, Nm/rad.
        slices: Parameter → values, expected J and its standard deviation through the best point.
    """

    walks: int
    best: Mapping[str, float]
    J: tuple[float, float]
    noise: float
    same: tuple[tuple[float, float], ...]
    slices: Mapping[str, tuple[Array, Array, Array]]


def optimum(X: Array, y: Array, bounds: Bounds, seed: int = 0) -> Optimum:
    """Find the best parameters that were walked, and the stiffnesses that cannot be told from them.

    The best has the greatest expected J among the points walked: where nobody has walked, the model may be far off.

    Source: recommendation with noise: P. Frazier, "A tutorial on Bayesian optimization", 2018, section 5.
    """
    if len(y) < FIRST_DESIGN:
        raise SystemExit(f"an optimum needs at least {FIRST_DESIGN} walks with a result, got {len(y)}")
    model = None if np.ptp(y) < 1e-12 else fitted(X, y, seed)
    noise = 0.0 if model is None else math.sqrt(model.kernel_.k2.noise_level) * float(model._y_train_std)

    def posterior(points: Array) -> tuple[Array, Array]:
        if model is None:
            return np.full(len(points), y.mean()), np.zeros((len(points), len(points)))
        mean, cov = model.predict(points, return_cov=True)
        return mean, cov - noise**2 * np.eye(len(points))  # of the expectation, not of another noisy walk

    top = X[int(np.argmax(posterior(X)[0]))]
    slices, same, expected = {}, (), (math.nan, math.nan)
    for i, name in enumerate(NAMES):
        line = np.tile(top, (GRID + 1, 1))
        line[:GRID, i] = np.linspace(0.0, 1.0, GRID)  # and the best point itself
        mean, cov = posterior(line)
        std = np.sqrt(np.maximum(np.diag(cov), 0.0))
        values = np.array([bounds.values(point)[name] for point in line[:GRID]])
        slices[name] = (values, mean[:GRID], std[:GRID])
        if name == "k":
            spread = np.sqrt(np.maximum(np.diag(cov) + cov[GRID, GRID] - 2.0 * cov[GRID], 0.0))
            bounded = np.minimum(mean, 0.0)  # the model does not know that no walk has a J above 0
            same = _ranges(values, (bounded[GRID] - bounded <= 1.645 * spread + 1e-9)[:GRID])
            expected = float(bounded[GRID]), float(std[GRID])
    return Optimum(len(y), bounds.values(top), expected, noise, same, slices)


def _ranges(values: Array, inside: NDArray[np.bool_]) -> tuple[tuple[float, float], ...]:
    """Return the ends of the runs of values that are inside."""
    padded = np.concatenate([[False], inside, [False]]).astype(int)
    starts, stops = np.flatnonzero(np.diff(padded) == 1), np.flatnonzero(np.diff(padded) == -1) - 1
    return tuple((float(values[a]), float(values[b])) for a, b in zip(starts, stops, strict=True))


def table_two(found: Mapping[str, Optimum]) -> str:
    """Return the optima beside the paper's Table II, as Markdown."""
    rows = []
    for ground, each in found.items():
        k = each.slices["k"][0]
        same = ", ".join(f"{low:.3g} – {high:.4g}" for low, high in each.same)
        paper = TABLE_II.get(ground)
        span = "" if paper is None else "all" if paper[3] is None else f"{paper[3][0]:g} – {paper[3][1]:g}"
        theirs = ["", "", ""] if paper is None else [f"{paper[1]:g}", f"{paper[2]:g}", span]
        whole = each.same == ((float(k[0]), float(k[-1])),)
        rows.append(
            [ground, f"{each.best['kP']:.2g}", f"{each.best['kD']:.2g}", "all" if whole else same, *theirs]
        )
    head = ["ground", "kP", "kD", "k not told from the best (Nm/rad)", "kP, paper", "kD, paper", "k, paper"]
    return markdown(head, rows)


def validation(found: Mapping[Optimisation, Optimum], seeds: int) -> Study:
    """Return the study that walks optima on held-out seeds, beside other stiffnesses and the usual gains."""
    cells = {}
    for task, best in found.items():
        low, high = task.bounds.k
        others = {f"k {k:g}": task.own({**best.best, "k": k}) for k in (5.0, 80.0, high) if low <= k <= high}
        cells[task.ground] = {
            **task.parts(),
            "own": {"best": task.own(best.best), **others, "usual": task.usual()},
        }
    arms = dict.fromkeys(name for cell in cells.values() for name in cell["own"])
    return Study.from_json(
        {
            "name": "validation", "about": "optima on held-out seeds, beside other stiffnesses and the usual gains",
            "cells": cells, "arms": {arm: {} for arm in arms}, "seeds": {"first": 100, "count": seeds},
            "metric": "J", "reference": "best",
        }
    )  # fmt: skip


def _gains(table: pd.DataFrame) -> pd.DataFrame:
    """Return walks with their kP and kD in columns; NaN for the usual ones."""
    for name, key in (("kP", "gains.dcm_p"), ("kD", "gains.dcm_d")):
        table = table.assign(
            **{
                name: table["changes"].map(
                    lambda c, key=key: float(np.ravel(c[key])[0]) if key in c else np.nan
                )
            }
        )
    return table.assign(k=table["stiffness"].astype(float))


def stored_optima(journal: str | Path) -> Iterator[tuple[str, tuple[Array, Array], Optimum]]:
    """Yield ground, walked points with J, and optimum of the walks of a journal."""
    table = _gains(walks(journal))
    asked = table[table["seed"] >= FIRST_SEED].sort_values("seed")
    for ground in (name for name in TABLE_II if name in set(asked["terrain"])):
        own = asked[asked["terrain"] == ground]
        bounds = BOUNDS["wide" if own["gains"].iloc[0] == "default" else "paper"]
        X = np.array([bounds.unit(row) for row in own[list(NAMES)].to_dict("records")])
        inside = ((X >= -1e-9) & (X <= 1.0 + 1e-9)).all(axis=1)
        points = X[inside], own["J"].to_numpy(float)[inside]
        yield ground, points, optimum(*points, bounds)


def held_out_steps(journal: str | Path) -> str:
    """Return what the optima do over 80 Nm/rad at the usual gains on held-out layouts."""
    table = _gains(walks(journal))
    rest = table[table["seed"] < FIRST_SEED]
    arms = []
    for ground, _, best in stored_optima(journal):
        own = rest[rest["terrain"] == ground]
        at_best = np.logical_and.reduce([np.isclose(own[name], best.best[name], rtol=1e-5) for name in NAMES])
        usual = own["kP"].isna() & own["k"].eq(80.0)
        arms += [own[at_best].assign(arm="best"), own[usual].assign(arm="usual")]
    steps = by_sole(pd.concat(arms), name="arm")
    rows = [
        [ground, f"{own['best'].mean():.1f}", f"{own['usual'].mean():.1f}", len(own)]
        for ground, own in steps.groupby(level="terrain")
    ]
    for unit in (None, "terrain"):
        found, p = gain(steps, "best", "usual", unit)
        rows.append(
            [
                f"difference, by {'layouts' if unit is None else 'grounds'}",
                shown(found),
                f"p = {p:.2g}",
                found.n,
            ]
        )
    return markdown(["steps", "optimum", "80 Nm/rad, usual gains", "layouts"], rows)


def main() -> None:
    """Optimise, and print the optima beside Table II."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("grounds", nargs="+", help="families of grounds, or 'table2' for those of Table II")
    parser.add_argument("--journal", type=Path, required=True, help="file that every walk is written to")
    parser.add_argument("--budget", type=int, default=400, help="walks on each ground")
    parser.add_argument("--law", choices=("default", "frizza", "no_bias"), default="default")
    parser.add_argument("--bounds", choices=tuple(BOUNDS), default=None, help="wide, or the paper's Table I")
    parser.add_argument("--amplitude", type=float, default=None, help="height of the ground, m")
    parser.add_argument("--distance", type=float, default=3.0, help="length of a walk, m")
    parser.add_argument("--seed", type=int, default=0, help="seed of the points that are asked for")
    parser.add_argument(
        "--workers", type=int, default=1, help="processes; as many points are asked for at a time"
    )
    parser.add_argument(
        "--validate", type=int, default=20, help="held-out seeds on which the optimum is walked"
    )
    options = parser.parse_args()
    grounds = tuple(TABLE_II) if options.grounds == ["table2"] else options.grounds
    found = {}
    with Journal(options.journal) as journal, local_executor(options.workers) as executor:
        for ground in grounds:
            task = Optimisation.of(
                ground, options.law, distance=options.distance, seed=options.seed, batch=options.workers
            )
            if options.amplitude is not None:
                task = replace(task, amplitude=options.amplitude)
            if options.bounds is not None:
                task = replace(task, bounds=BOUNDS[options.bounds])
            found[task] = optimum(
                *optimise(task, options.budget, journal, executor=executor), task.bounds, options.seed
            )
        study = validation(found, options.validate) if options.validate else None
        if study is not None:
            sweep([trial.spec for trial in study.trials()], journal, executor=executor)
    print(table_two({task.ground: each for task, each in found.items()}))
    for task, each in found.items():
        best = ", ".join(f"{name} {value:.3g}" for name, value in each.best.items())
        print(
            f"{task.ground}: best at {best}; expected J {each.J[0]:.3g} ± {each.J[1]:.2g}, a walk ± {each.noise:.2g}"
        )
    if study is not None:
        print(study_table(study, read_journal(options.journal)).markdown())


if __name__ == "__main__":
    main()
