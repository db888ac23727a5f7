"""Optimum of an optimisation: the best parameters, the stiffnesses that are as good, and their validation."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wbc.core.errors import ROUNDING, Array, InputError
from wbc.feet.soles.actuator import PAPER_STIFFEST
from wbc.sim.studies.journal import Entry
from wbc.sim.studies.paper.optimization import (
    FIRST_DESIGN,
    NAMES,
    OPTIMISATION_SEED,
    Bounds,
    OptimisationSpec,
    Walked,
    fitted,
    parameters,
)
from wbc.sim.studies.study import FRESH_SEED, Cell, Study

GRID = 201
"""Number of stiffnesses of a slice of the posterior."""

USUAL = "usual gains, k 80"
"""Arm of a validation that nothing was optimised for."""

BEST_J = 0.0
"""Greatest J that there can be: every step done, without errors."""

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
class Optimum:
    """Result of an optimisation.

    Attributes:
        walks: Number of walks.
        best: Parameters of the greatest expected J among those walked.
        J: Expected J there.
        J_std: Standard deviation of that expectation.
        noise: Standard deviation of the J of single walks about their expectation.
        same: Ranges of k whose expected J, at the best gains, cannot be told from the best at 95 %, Nm/rad.
        k: Stiffnesses of the slice of the posterior at the best gains, shape (n,), Nm/rad.
        mean: Expected J of the slice, shape (n,).
        std: Standard deviation of the expectation, shape (n,).
        slices: Slices of the other parameters through the best point: name → values, mean, std.
    """

    walks: int
    best: Mapping[str, float]
    J: float
    J_std: float
    noise: float
    same: tuple[tuple[float, float], ...]
    k: Array
    mean: Array
    std: Array
    slices: Mapping[str, tuple[Array, Array, Array]]

    @property
    def whole(self) -> bool:
        """True if no k of the bounds can be told from the best."""
        return len(self.same) == 1 and self.same[0] == (float(self.k[0]), float(self.k[-1]))


def walked_points(spec: OptimisationSpec, entries: Mapping[str, Entry]) -> list[Walked]:
    """Return the points of an optimisation that a journal has, in the order in which they were asked for."""
    found = {}
    for entry in entries.values():
        if entry.status != "done" or entry.result is None:
            continue
        if entry.spec["seed"] >= OPTIMISATION_SEED and spec.owns(entry.spec):
            point = tuple(spec.bounds.unit(parameters(entry.spec)))
            found[entry.spec["seed"]] = Walked(point, float(entry.result["J"]), entry.result)
    return [found[seed] for seed in sorted(found)]


def optimum(known: Sequence[Walked], bounds: Bounds, *, seed: int = 0) -> Optimum:
    """Find the best parameters that were walked, and the stiffnesses that cannot be told from them.

    The best has the greatest expected J among the points walked: where nobody has walked, the model may be far off.
    Fewer walks than a model needs are an `InputError`.

    Source: recommendation with noise: P. Frazier, "A tutorial on Bayesian optimization", 2018, section 5.
    """
    if len(known) < FIRST_DESIGN:
        raise InputError(f"an optimum needs at least {FIRST_DESIGN} walks with a result, got {len(known)}")
    X, y = np.array([w.unit for w in known]), np.array([w.J for w in known])
    model = None if np.ptp(y) < 1e-12 else fitted(X, y, seed=seed)

    def posterior(points: Array) -> tuple[Array, Array]:
        if model is None:
            return np.full(len(points), y.mean()), np.zeros((len(points), len(points)))
        mean, cov = model.predict(points, return_cov=True)
        level = float(model.kernel_.k2.noise_level) * float(model._y_train_std) ** 2
        return mean, cov - level * np.eye(len(points))  # of the expectation, not of another noisy walk

    top = X[int(np.argmax(posterior(X)[0]))]
    axis = np.linspace(0.0, 1.0, GRID)
    slices = {}
    for i, name in enumerate(NAMES):
        line = np.tile(top, (GRID + 1, 1))
        line[:GRID, i] = axis  # and the best point itself
        mean, cov = posterior(line)
        std = np.sqrt(np.maximum(np.diag(cov), 0.0))
        values = np.array([bounds.values(point)[name] for point in line[:GRID]])
        slices[name] = (values, mean[:GRID], std[:GRID])
        if name == "k":
            spread = np.sqrt(np.maximum(np.diag(cov) + cov[GRID, GRID] - 2.0 * cov[GRID], 0.0))
            bounded = np.minimum(mean, BEST_J)  # the model does not know that walks cannot be better
            same = bounded[GRID] - bounded <= 1.645 * spread + ROUNDING
            ranges = _ranges(values, same[:GRID])
            expected = float(bounded[GRID]), float(std[GRID])
    k, mean, std = slices.pop("k")
    noise = 0.0 if model is None else math.sqrt(model.kernel_.k2.noise_level) * float(model._y_train_std)
    return Optimum(len(known), bounds.values(top), *expected, noise, ranges, k, mean, std, slices)


def _ranges(values: Array, inside: Iterable[bool]) -> tuple[tuple[float, float], ...]:
    """Return the ends of the runs of values that are inside."""
    found: list[tuple[float, float]] = []
    before = False
    for value, now in zip(values.tolist(), inside, strict=True):
        if now:
            found = [*found[:-1], (found[-1][0], value)] if before else [*found, (value, value)]
        before = bool(now)
    return tuple(found)


def validation(found: Mapping[OptimisationSpec, Optimum], seeds: int) -> Study:
    """Return the study that walks optima on seeds that no optimisation has seen.

    Beside them walk other stiffnesses with the same gains, and 80 Nm/rad with the usual gains of the law.
    """
    low, high = next(iter(found)).bounds.k
    others = {f"k {k:g}": k for k in (5.0, PAPER_STIFFEST, high) if low <= k <= high}
    cells = []
    for spec, optimal in found.items():
        own = {name: spec.own_parts({**optimal.best, "k": k}) for name, k in others.items()}
        values = {"best": spec.own_parts(optimal.best), **own, USUAL: spec.usual_parts()}
        cells.append(Cell(spec.ground, spec.parts(), arm_values=values))
    return Study(
        name="validation",
        about="optima on held-out seeds, beside other stiffnesses and the usual gains",
        base={},
        cells=tuple(cells),
        arms={name: {} for name in ("best", *others, USUAL)},
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        metric="J",
        reference="best",
    )


def table_two(found: Mapping[str, Optimum]) -> str:
    """Return the optima beside the paper's Table II, as Markdown."""
    lines = [
        "| | kP | kD | k not told from the best (Nm/rad) | kP, paper | kD, paper | k, paper |",
        "|---|---:|---:|---|---:|---:|---|",
    ]
    for ground, optimal in found.items():
        paper = TABLE_II.get(ground)
        same = "all" if optimal.whole else ", ".join(_span(a, b) for a, b in optimal.same)
        theirs = ("", "", "")
        if paper is not None:
            span = "entire range" if paper[3] is None else f"{paper[3][0]:g} – {paper[3][1]:g}"
            theirs = (f"{paper[1]:g}", f"{paper[2]:g}", span)
        best = optimal.best
        lines.append(f"| `{ground}` | {best['kP']:.2g} | {best['kD']:.2g} | {same} | {' | '.join(theirs)} |")
    return "\n".join(lines)


def _span(low: float, high: float) -> str:
    """Return a range of stiffnesses (Nm/rad) as text."""
    ends = [f"{k:.3g}" if k < 1000.0 else f"{k:,.0f}" for k in (low, high)]
    return ends[0] if ends[0] == ends[1] else " – ".join(ends)
