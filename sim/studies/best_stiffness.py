"""Best stiffness of each ground, fitted to walks, and the table of it that a stiffness model learns from."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.core.errors import ROUNDING, Array, InputError, finite_array, whole_number
from wbc.feet.stiffness.dataset import ProfileRecipe, StiffnessTable
from wbc.feet.stiffness.roughness import PARAMETERS, roughness
from wbc.sim.studies.journal import Entry
from wbc.sim.studies.study import Study, ground_of, study_entries
from wbc.sim.walks.spec import WalkSpec

NEARLY = 5.0
"""A stiffness is nearly best if it is expected to cost less than this more than the best: half a step of the paper's
cost, in which a missed step counts 10."""

Curve = Callable[[Array], Array]
"""Function: log10 of the stiffness → J."""

MIN_STIFFNESSES = 4
"""Smallest number of different stiffnesses to which a curve is fitted."""

GRID = 121
"""Number of stiffnesses at which the fitted J is evaluated."""

DRAWS = 1000
"""Number of draws from the posterior, for the spread of the best stiffness."""


@dataclass(frozen=True, slots=True)
class Label:
    """Best stiffness on one ground at one amplitude, with its uncertainty.

    Attributes:
        stiffness: Stiffness of the greatest expected J, Nm/rad.
        nearly_low: Lower end of the range around it that is nearly as good, Nm/rad.
        nearly_high: Upper end of that range, Nm/rad.
        best_low: The best stiffness is less than this with a probability of 10 %, Nm/rad.
        best_high: The best stiffness is more than this with a probability of 10 %, Nm/rad.
        J: Expected J at the best stiffness.
        J_std: Standard deviation of J left by the fit over the stiffness; grounds differ by more.
        gain: Expected J at the best minus that of the worst stiffness tried: how much the stiffness matters.
        walks: Number of walks.
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
) -> Label:
    """Fit J over the logarithm of the stiffness by a Gaussian process, and find its maximum.

    Grounds of one kind differ in how hard they are: the offset of each `ground` (numbers, shape (n,)) is subtracted
    first. The noise of single walks is fitted, too, so that one lucky walk does not decide. The `prior`, a curve from
    other grounds up to a constant, decides where there are few walks. A difference in J to the best below
    `NEARLY` counts as nearly best.

    Raises `InputError` for fewer than four different stiffnesses (Nm/rad, shape (n,)), shapes that differ, or values
    that are not finite.
    """
    k, value, places = _walks(stiffness, J, ground)
    if np.unique(k).size < MIN_STIFFNESSES:
        raise InputError(
            f"a best stiffness needs walks with {MIN_STIFFNESSES} different ones, got {np.unique(k)} Nm/rad"
        )
    at = np.log10(np.geomspace(k.min(), k.max(), GRID))
    expected, known = np.zeros(GRID), np.zeros(k.size)
    if prior is not None:
        expected, known = prior(at), prior(np.log10(k))
    offsets = ground_offsets(k, value - known, places)
    left = value - known - offsets[places]
    level = float(offsets.mean())
    spread = float(left.std())
    mean, covariance = np.zeros(GRID), np.zeros((GRID, GRID))
    if spread > ROUNDING:
        model = _fitted(np.log10(k), left / spread, noisy=True)
        mean, covariance = model.predict(at[:, None], return_cov=True)
        # The model predicts another noisy walk; without the noise it is the mean.
        covariance = covariance - model.kernel_.k2.noise_level * np.eye(GRID)
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal(mean, covariance, size=DRAWS, method="eigh", check_valid="ignore")
    curve, draws = expected + spread * mean, expected + spread * draws
    best = int(np.argmax(curve))
    if np.ptp(curve) < ROUNDING:  # whatever the stiffness, the same
        best = GRID // 2
    far = np.flatnonzero(curve[best] - curve > NEARLY)
    low, high = far[far < best].max(initial=-1) + 1, far[far > best].min(initial=GRID) - 1
    likely = np.percentile(at[np.argmax(draws, axis=1)], (10.0, 90.0))
    if np.ptp(draws) < ROUNDING:
        likely = at[[0, -1]]
    return Label(
        stiffness=float(10.0 ** at[best]),
        nearly_low=float(10.0 ** at[low]),
        nearly_high=float(10.0 ** at[high]),
        best_low=float(10.0 ** likely[0]),
        best_high=float(10.0 ** likely[1]),
        J=level + float(curve[best]),
        J_std=spread * float(np.sqrt(max(covariance[best, best], 0.0))),
        gain=float(np.ptp(curve)),
        walks=int(k.size),
    )


def _fitted(log_stiffness: Array, values: Array, *, noisy: bool = False, alpha: Any = 1e-10) -> Any:
    """Return a Gaussian process fitted to values with a standard deviation of about one, over log10 of the stiffness.

    `noisy` fits the noise of the values, too; `alpha` is their known variance.
    """
    from sklearn.gaussian_process import GaussianProcessRegressor  # noqa: PLC0415 - takes a second to import
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel  # noqa: PLC0415

    kernel = ConstantKernel(1.0, (1e-2, 1e2)) * Matern(0.5, (0.2, 3.0), nu=2.5)
    if noisy:
        kernel += WhiteKernel(0.5, (1e-3, 1e1))
    model = GaussianProcessRegressor(kernel, alpha=alpha, n_restarts_optimizer=2, random_state=0)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*(close to the specified|lbfgs failed).*")
        return model.fit(log_stiffness[:, None], values)


def ground_offsets(stiffness: Array, J: Array, ground: NDArray[np.intp]) -> Array:
    """Return the offset of each ground (numbers from 0, one a walk) in J, shape (number of grounds,).

    The least-squares solution of J = offset of the ground + effect of the stiffness, the effects with mean zero. Means
    over grounds would differ by the stiffnesses whose walks are missing.
    """
    tried, which = np.unique(stiffness, return_inverse=True)
    grounds = int(ground.max()) + 1
    rows = np.arange(J.size)
    design = np.zeros((J.size + 1, grounds + tried.size))
    design[rows, ground] = 1.0
    design[rows, grounds + which] = 1.0
    design[-1, grounds:] = 1.0
    solution = np.linalg.lstsq(design, np.append(J, 0.0), rcond=None)[0]
    return np.asarray(solution[:grounds])


def _walks(stiffness: Array, J: Array, ground: Array) -> tuple[Array, Array, NDArray[np.intp]]:
    """Return the columns of walks after a check, grounds numbered from 0."""
    k, value = finite_array("stiffness (Nm/rad)", stiffness), finite_array("J", J)
    places = np.asarray(ground)
    if k.ndim != 1 or k.size == 0 or not k.shape == value.shape == places.shape:
        raise InputError(
            f"stiffness, J and ground of walks must have the same shape (n,), got {k.shape}, {value.shape} and "
            f"{places.shape}"
        )
    if k.min() <= 0.0:
        raise InputError(f"stiffness of walks must be above 0 Nm/rad, got {k.min():g}")
    return k, value, np.unique(places, return_inverse=True)[1]


def pooled_curve(stiffness: Array, J: Array, ground: Array) -> Curve:
    """Return a smooth curve through the mean J of each stiffness over all grounds: log10 of it → J, up to a constant.

    One stiffness (Nm/rad, above zero), J and ground a walk; the offset of each ground is subtracted.
    """
    k, value, places = _walks(stiffness, J, ground)
    left = value - ground_offsets(k, value, places)[places]
    tried, which = np.unique(k, return_inverse=True)
    count = np.bincount(which)
    mean = np.bincount(which, left) / count
    freedom = max(k.size - tried.size - int(places.max()), 1)
    error = np.sqrt(((left - mean[which]) ** 2).sum() / freedom / count)
    scale = max(float(mean.std()), float(error.mean()), ROUNDING)
    model = _fitted(np.log10(tried), mean / scale, alpha=np.maximum(error / scale, 1e-3) ** 2)

    def curve(at: Array) -> Array:
        values: Array = scale * model.predict(np.asarray(at)[:, None])
        return values

    return curve


def labels(study: Study, entries: Mapping[str, Entry], *, pooled: bool = True) -> dict[str, Label]:
    """Return the best stiffness of each cell of a study whose arms are stiffnesses; those with less than 4 left out.

    The `pooled` curve of all other grounds is the prior of each ground: it decides where walks of the ground do not.
    Without it each ground stands alone, as in the paper.
    Walks that diverged, crashed or took too long do not count.
    """
    _check_arms(study)
    found: dict[str, list[tuple[float, float, int]]] = {}
    for trial, entry in study_entries(study, entries):
        assert isinstance(trial.spec, WalkSpec)
        if entry is None or entry.status != "done" or entry.result is None:
            continue
        if trial.spec.stiffness is not None:  # a rigid sole has none
            found.setdefault(trial.cell, []).append((trial.spec.stiffness, entry.result["J"], trial.seed))
    walks = {
        cell: np.array(rows)
        for cell, rows in found.items()
        if len({k for k, _, _ in rows}) >= MIN_STIFFNESSES
    }
    return {
        cell: best_stiffness(*rows.T, prior=_prior_without(cell, walks) if pooled else None)
        for cell, rows in walks.items()
    }


def label_table(labels_of: Mapping[str, Label]) -> str:
    """Return labels as a table for people."""
    lines = [f"{'best stiffness, Nm/rad':<32} best   nearly best     80 % sure        J   gained by it"]
    for cell, label in labels_of.items():
        near = f"{label.nearly_low:.3g} … {label.nearly_high:.3g}"
        sure = f"{label.best_low:.3g} … {label.best_high:.3g}"
        lines.append(
            f"  {cell:<30} {label.stiffness:4.3g}  {near:^14} {sure:^14} {label.J:8.3g} {label.gain:8.2g}"
        )
    return "\n".join(lines)


def _check_arms(study: Study) -> None:
    """Refuse a study without soles of enough stiffnesses, or with two arms of the same."""
    if study.kind != WalkSpec.kind:
        raise InputError(
            f"a best stiffness comes from walks; study '{study.name}' is of the kind '{study.kind}'"
        )
    seen: dict[float, str] = {}
    for trial in study.narrowed(seeds=1).trials():
        assert isinstance(trial.spec, WalkSpec)
        stiffness = trial.spec.stiffness
        if stiffness is not None and seen.setdefault(stiffness, trial.arm) != trial.arm:
            raise InputError(
                f"arms '{seen[stiffness]}' and '{trial.arm}' of the study '{study.name}' have the same stiffness of "
                f"{stiffness:g} Nm/rad"
            )
    if len(seen) < MIN_STIFFNESSES:
        raise InputError(
            f"a best stiffness needs arms of {MIN_STIFFNESSES} stiffnesses; study '{study.name}' has "
            f"{', '.join(f'{k:g}' for k in sorted(seen)) or 'none'} of them"
        )


def _prior_without(cell: str, walks: Mapping[str, Array]) -> Curve | None:
    """Return the pooled curve of all cells but one; None if there is no other."""
    others = [rows for name, rows in walks.items() if name != cell]
    if not others:
        return None
    k, J, seed = np.concatenate(others).T
    place = np.repeat(np.arange(len(others)), [len(rows) for rows in others])
    return pooled_curve(k, J, place * (1.0 + seed.max()) + seed)


def stiffness_table(
    study: Study,
    labels_of: Mapping[str, Label],
    *,
    windows: int = 6,
    made: Mapping[str, Any] | None = None,
) -> StiffnessTable:
    """Return the table that a stiffness model learns from: roughness under the toes, with the label of the ground.

    The ground is cut along the lines of both toes into at least 2 windows as long as a scan, evenly spread over the
    walk and taken from the left and from the right in turn. `made` is the origin of the table, written into it.
    """
    whole_number("windows of each ground", windows, low=2)
    if not labels_of:
        raise InputError("no best stiffness is known yet; run the study first")
    rows: list[tuple[Any, ...]] = []
    done: set[tuple[str, int]] = set()
    for trial in study.trials():
        if trial.cell not in labels_of or (trial.cell, trial.seed) in done:
            continue
        done.add((trial.cell, trial.seed))
        assert isinstance(trial.spec, WalkSpec)
        label, ground = labels_of[trial.cell], ground_of(trial.cell)
        for window, row in enumerate(seen_roughness(trial.spec, windows)):
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
    cells = {
        cell: {k: float(f"{v:.5g}") for k, v in asdict(label).items()} for cell, label in labels_of.items()
    }
    return StiffnessTable.from_columns(
        dict(zip(columns, zip(*rows, strict=True), strict=True)),
        recipe=ProfileRecipe(),
        made={**dict(made or {}), "labels": cells},
    )


def seen_roughness(spec: WalkSpec, windows: int) -> Array:
    """Return the roughness under the toes on a ground, left and right in turn, shape (windows, 10)."""
    robot, ground = spec.prepare().robot(), spec.ground()
    end = ground.start + ground.length
    if spec.plan.distance is not None:
        end = min(end, spec.start[0] + spec.plan.distance + 0.5 * robot.soles[0].length)
    toes = [float(robot.placement(sole.frame).translation[1]) for sole in robot.soles]
    recipe = ProfileRecipe()
    assert recipe.window is not None  # None is that of whole tracks
    place = recipe.step * np.arange(round(recipe.window / recipe.step) + 1)
    starts = np.linspace(ground.start, max(end - place[-1], ground.start), windows)
    heights = [ground.height(x + place, np.full(place.size, toes[i % 2])) for i, x in enumerate(starts)]
    return roughness(place, np.array(heights), recipe.roughness).values
