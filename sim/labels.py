"""From walks to labels: which stiffness was best on a ground, how sure that is, and what the foot sees there."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from wbc.core.errors import Array, InputError, finite_array, positive
from wbc.feet.dataset import ProfileRecipe, StiffnessTable
from wbc.feet.roughness import PARAMETERS, roughness
from wbc.sim.journal import Entry
from wbc.sim.studies import Study, found_entries
from wbc.sim.walks.spec import WalkSpec

NEARLY = 5.0
"""A stiffness is nearly best if it is expected to cost less than this more than the best: half a step of the paper's
cost, in which a missed step counts 10."""

Curve = Callable[[Array], Array]
"""log10 of the stiffness → J."""

GRID = 121
"""Stiffnesses at which the fitted cost is looked at."""

DRAWS = 1000
"""Draws from the posterior, for the spread of the best stiffness."""


@dataclass(frozen=True, slots=True)
class Label:
    """What is known of the best stiffness on one ground at one amplitude.

    Attributes:
        stiffness: Where the expected J is greatest, Nm/rad.
        nearly_low: Least stiffness that is nearly as good, and all between, Nm/rad.
        nearly_high: Greatest one, Nm/rad.
        best_low: The best stiffness is less than this with a probability of 10 %, Nm/rad.
        best_high: It is more than this with a probability of 10 %, Nm/rad.
        J: Expected at the best.
        J_std: Standard deviation of that.
        gain: Expected J at the best minus that of the worst stiffness tried: how much the stiffness matters.
        walks: Number of walks that this rests on.
    """

    stiffness: float
    nearly_low: float
    nearly_high: float
    best_low: float
    best_high: float
    J: float
    J_std: float
    gain: float
    walks: int


def best_stiffness(
    stiffness: Array,
    J: Array,
    ground: Array,
    *,
    prior: Curve | None = None,
    nearly: float = NEARLY,
    seed: int = 0,
) -> Label:
    """Fit J over the logarithm of the stiffness by a Gaussian process, and find its maximum.

    Each ground's own mean is taken off first: grounds of one kind differ in how hard they are. The noise of single
    walks is fitted, too, so that one lucky walk is not the answer. What few walks leave open is filled by the prior.

    Args:
        stiffness: Of each walk, shape (n,), Nm/rad, positive.
        J: What came of it, shape (n,).
        ground: Number of the ground that it was walked on, shape (n,).
        prior: What is known from elsewhere: log10 of the stiffness → J, up to a constant; nothing when None.
        nearly: How much worse than the best is nearly best.
        seed: Of the draws.

    Raises:
        InputError: Fewer than four different stiffnesses, or values that are not finite.
    """
    from sklearn.gaussian_process import GaussianProcessRegressor  # noqa: PLC0415 - takes a second to import
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel  # noqa: PLC0415

    k, value = finite_array("stiffness (Nm/rad)", stiffness), finite_array("J", J)
    positive("nearly best", nearly)
    if np.unique(k).size < 4 or k.min() <= 0.0:
        raise InputError(
            f"a best stiffness needs walks with four different ones above 0, got {np.unique(k)} Nm/rad"
        )
    grounds, place = np.unique(ground, return_inverse=True)
    means = np.bincount(place, value) / np.bincount(place)
    centred = value - means[place]
    at = np.log10(np.geomspace(k.min(), k.max(), GRID))
    expected = np.zeros(GRID)
    if prior is not None:
        known = prior(np.log10(k))
        centred = centred - (known - (np.bincount(place, known) / np.bincount(place))[place])
        expected = prior(at) - prior(np.log10(np.unique(k))).mean()
    spread = float(centred.std())
    if spread < 1e-9 and prior is None:  # whatever the stiffness, the same
        middle = float(np.sqrt(k.min() * k.max()))
        ends = float(k.min()), float(k.max())
        return Label(middle, *ends, *ends, float(means.mean()), 0.0, 0.0, k.size)
    kernel = ConstantKernel(1.0, (1e-2, 1e2)) * Matern(0.5, (0.2, 3.0), nu=2.5) + WhiteKernel(
        0.5, (1e-3, 1e1)
    )
    model = GaussianProcessRegressor(kernel, n_restarts_optimizer=2, random_state=seed)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*(close to the specified|lbfgs failed).*")
        model.fit(np.log10(k)[:, None], centred / spread)
        mean, covariance = model.predict(at[:, None], return_cov=True)
    # What is predicted is another noisy walk; what is asked for is the mean under it.
    noise = model.kernel_.k2.noise_level
    covariance = covariance - noise * np.eye(at.size)
    rng = np.random.default_rng(seed)
    draws = rng.multivariate_normal(mean, covariance, size=DRAWS, method="eigh", check_valid="ignore")
    curve, draws = expected + spread * mean, expected + spread * draws
    best = int(np.argmax(curve))
    near = curve[best] - curve <= nearly
    low = best - int(np.argmin(near[best::-1])) + 1 if not near[: best + 1].all() else 0
    high = best + int(np.argmin(near[best:])) - 1 if not near[best:].all() else at.size - 1
    ends = np.percentile(at[np.argmax(draws, axis=1)], (10.0, 90.0))
    return Label(
        stiffness=float(10.0 ** at[best]),
        nearly_low=float(10.0 ** at[low]),
        nearly_high=float(10.0 ** at[high]),
        best_low=float(10.0 ** ends[0]),
        best_high=float(10.0 ** ends[1]),
        J=float(means.mean() + curve[best]),
        J_std=spread * float(np.sqrt(max(covariance[best, best], 0.0))),
        gain=float(curve[best] - curve.min()),
        walks=int(k.size),
    )


def pooled_curve(stiffness: Array, J: Array, ground: Array) -> Curve:
    """What all grounds together say: a smooth curve through the mean J of each stiffness.

    Args:
        stiffness: Of each walk, shape (n,), Nm/rad, positive.
        J: What came of it, shape (n,).
        ground: Number of the ground that it was walked on, shape (n,); each ground's own mean is taken off.

    Returns:
        log10 of the stiffness → J about its mean.
    """
    from sklearn.gaussian_process import GaussianProcessRegressor  # noqa: PLC0415 - takes a second to import
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern  # noqa: PLC0415

    _, place = np.unique(ground, return_inverse=True)
    centred = J - (np.bincount(place, J) / np.bincount(place))[place]
    tried, which = np.unique(stiffness, return_inverse=True)
    count = np.bincount(which)
    mean = np.bincount(which, centred) / count
    error = np.sqrt(np.bincount(which, (centred - mean[which]) ** 2) / np.maximum(count - 1, 1) / count)
    scale = max(float(mean.std()), float(error.mean()), 1e-9)
    kernel = ConstantKernel(1.0, (1e-2, 1e2)) * Matern(0.5, (0.2, 3.0), nu=2.5)
    model = GaussianProcessRegressor(
        kernel, alpha=np.maximum(error / scale, 1e-3) ** 2, n_restarts_optimizer=2, random_state=0
    )
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*(close to the specified|lbfgs failed).*")
        model.fit(np.log10(tried)[:, None], mean / scale)

    def curve(at: Array) -> Array:
        values: Array = scale * model.predict(np.asarray(at)[:, None])
        return values

    return curve


def labels(
    study: Study, entries: Mapping[str, Entry], *, pooled: bool = True, any_code: bool = False
) -> dict[str, Label]:
    """Best stiffness of each cell of a study whose arms are stiffnesses.

    Args:
        study: Such as `wbc.sim.stiffness_studies.dataset()`.
        entries: Those of a journal.
        pooled: What all grounds have in common is the prior of each: where a ground's own walks say little, its label
            is what is best on the whole. Without it each ground stands alone, as in the paper.
        any_code: Take walks of other versions of the code, too.

    Returns:
        Cell → label; cells without walks of four stiffnesses are left out. Walks that diverged, crashed or took too
        long do not count.
    """
    found: dict[str, list[tuple[float, float, int]]] = {}
    for trial, entry in found_entries(study, entries, any_code=any_code):
        if entry is not None and entry.status == "done" and entry.result is not None:
            stiffness = trial.spec.to_json()["stiffness"]
            found.setdefault(trial.cell, []).append((stiffness, entry.result["J"], trial.seed))
    walks = {cell: np.array(rows) for cell, rows in found.items() if len({k for k, _, _ in rows}) >= 4}
    if not walks:
        return {}
    prior = None
    if pooled:
        k, J, seed = np.concatenate(list(walks.values())).T
        cell = np.repeat(np.arange(len(walks)), [len(rows) for rows in walks.values()])
        prior = pooled_curve(k, J, cell * (1.0 + seed.max()) + seed)
    return {cell: best_stiffness(*rows.T, prior=prior) for cell, rows in walks.items()}


def stiffness_table(
    study: Study,
    found: Mapping[str, Label],
    *,
    windows: int = 6,
    recipe: ProfileRecipe | None = None,
    made: Mapping[str, Any] | None = None,
) -> StiffnessTable:
    """The table that a stiffness model learns from: what the toes see of each ground, with the ground's label.

    The ground is cut along the lines of both toes into windows as long as a scan, evenly spread over the walk and
    taken from the left and from the right in turn.

    Args:
        study: The study.
        found: Its labels.
        windows: Windows of each ground.
        recipe: How roughness is computed.
        made: What is to be written down about how the table was made.

    Raises:
        InputError: No labels, or fewer than two windows.
    """
    given = ProfileRecipe() if recipe is None else recipe
    if isinstance(windows, bool) or int(windows) != windows or windows < 2:
        raise InputError(f"windows of each ground must be a whole number of at least 2, got {windows!r}")
    if not found:
        raise InputError("no best stiffness is known yet; run the study first")
    if given.window is None:
        raise InputError("a table of windows needs the length of a window")
    rows: list[tuple[Any, ...]] = []
    done: set[tuple[str, int]] = set()
    for trial in study.trials():
        if trial.cell not in found or (trial.cell, trial.seed) in done:
            continue
        done.add((trial.cell, trial.seed))
        assert isinstance(trial.spec, WalkSpec)
        label, ground = found[trial.cell], trial.cell.rpartition(",")[0]
        values = seen_roughness(trial.spec, windows, given)
        for window, row in enumerate(values):
            shown = [float(f"{value:.9g}") for value in row]
            rows.append(
                (
                    ground,
                    trial.spec.terrain,
                    trial.spec.amplitude,
                    trial.seed,
                    window,
                    *shown,
                    *(float(f"{v:.4g}") for v in (label.stiffness, label.nearly_low, label.nearly_high)),
                    float(f"{label.J:.5g}"),
                )
            )
    names = ("ground", "family", "amplitude", "seed", "window", *PARAMETERS)
    columns = (*names, "stiffness", "stiffness_low", "stiffness_high", "J")
    cells = {cell: {k: float(f"{v:.5g}") for k, v in asdict(label).items()} for cell, label in found.items()}
    return StiffnessTable.from_columns(
        dict(zip(columns, zip(*rows, strict=True), strict=True)),
        recipe=given,
        made={**dict(made or {}), "labels": cells},
    )


def seen_roughness(spec: WalkSpec, windows: int, recipe: ProfileRecipe) -> Array:
    """Roughness of what the toes see of a ground, left and right in turn, shape (windows, 10)."""
    assert recipe.window is not None
    robot, ground = spec.prepared().robot(), spec.ground()
    count = round(recipe.window / recipe.step) + 1
    place = recipe.step * np.arange(count)
    starts = np.linspace(ground.start, ground.start + ground.length - place[-1], windows)
    lines = [float(robot.placement(sole.frame).translation[1]) for sole in robot.soles]
    heights = [ground.height(x + place, np.full(count, lines[i % 2])) for i, x in enumerate(starts)]
    return roughness(place, np.array(heights), recipe.roughness).values
