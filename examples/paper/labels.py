"""Best stiffness of each ground, fitted to walks (the paper's section IV-B), and the table that a model learns from.

wbc study run examples/paper/studies/dataset.json --journal dataset.jsonl --workers 2
python examples/paper/labels.py dataset.jsonl -o table.csv
python examples/paper/models.py judge table.csv
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel
from walks import walks

import wbc
from wbc.feet import roughness
from wbc.feet.sensing.roughness import PARAMETERS
from wbc.feet.stiffness.model import ProfileRecipe
from wbc.sim import make_terrain

Array = NDArray[np.float64]
Curve = Callable[[Array], Array]
"""log10 of the stiffness → J."""

NEARLY = 5.0
"""A stiffness is nearly best if it costs less than this more than the best: half a step, of which one counts 10."""

GRID, DRAWS, LEAST = 121, 1000, 4
"""Stiffnesses at which the fitted J is evaluated, draws from the posterior, least number of stiffnesses of a curve."""


@dataclass(frozen=True)
class Label:
    """Best stiffness on one ground at one amplitude.

    Attributes:
        stiffness: Stiffness of the greatest expected J, Nm/rad.
        stiffness_low: Lower end of the range around it that is nearly as good, Nm/rad.
        stiffness_high: Upper end of that range, Nm/rad.
        best_low: The best stiffness is less than this with a probability of 10 %, Nm/rad.
        best_high: The best stiffness is more than this with a probability of 10 %, Nm/rad.
        J: Expected J at the best stiffness.
        gain: Expected J at the best minus that of the worst stiffness tried.
        walks: Number of walks.
    """

    stiffness: float
    stiffness_low: float
    stiffness_high: float
    best_low: float
    best_high: float
    J: float
    gain: float
    walks: int


def best_stiffness(k: Array, J: Array, ground: Array, prior: Curve | None = None) -> Label:
    """Fit J over the logarithm of the stiffness by a Gaussian process, and find its maximum.

    Grounds of one kind differ in how hard they are: the offset of each `ground` is subtracted first. The noise of
    single walks is fitted, too, so that one lucky walk does not decide. The `prior`, a curve from other grounds up to a
    constant, decides where there are few walks.

    Args:
        k: Stiffness of each walk, above 0 Nm/rad, shape (n,).
        J: Objective of each walk, shape (n,).
        ground: Number of the ground of each walk, shape (n,).
        prior: Expected curve up to a constant.
    """
    places = np.unique(ground, return_inverse=True)[1]
    at = np.log10(np.geomspace(k.min(), k.max(), GRID))
    expected, known = (np.zeros(GRID), np.zeros(k.size)) if prior is None else (prior(at), prior(np.log10(k)))
    offsets = ground_offsets(k, J - known, places)
    left = J - known - offsets[places]
    spread = float(left.std())
    mean, covariance = np.zeros(GRID), np.zeros((GRID, GRID))
    if spread > 1e-9:
        model = _fitted(np.log10(k), left / spread, noisy=True)
        mean, covariance = model.predict(at[:, None], return_cov=True)
        covariance -= model.kernel_.k2.noise_level * np.eye(GRID)  # of the mean, not of another noisy walk
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal(mean, covariance, size=DRAWS, method="eigh", check_valid="ignore")
    curve, draws = expected + spread * mean, expected + spread * draws
    best = GRID // 2 if np.ptp(curve) < 1e-9 else int(np.argmax(curve))
    far = np.flatnonzero(curve[best] - curve > NEARLY)
    low, high = far[far < best].max(initial=-1) + 1, far[far > best].min(initial=GRID) - 1
    likely = (
        at[[0, -1]] if np.ptp(draws) < 1e-9 else np.percentile(at[np.argmax(draws, axis=1)], (10.0, 90.0))
    )
    ends = (float(10.0**value) for value in (at[best], at[low], at[high], *likely))
    return Label(*ends, float(offsets.mean()) + float(curve[best]), float(np.ptp(curve)), int(k.size))


def _fitted(
    log_k: Array, values: Array, *, noisy: bool = False, alpha: Array | float = 1e-10
) -> GaussianProcessRegressor:
    """Return a Gaussian process of values of about one; `noisy` fits their noise, `alpha` is a known variance."""
    kernel = ConstantKernel(1.0, (1e-2, 1e2)) * Matern(0.5, (0.2, 3.0), nu=2.5)
    if noisy:
        kernel += WhiteKernel(0.5, (1e-3, 1e1))
    model = GaussianProcessRegressor(kernel, alpha=alpha, n_restarts_optimizer=2, random_state=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return model.fit(log_k[:, None], values)


def ground_offsets(k: Array, J: Array, ground: NDArray[np.intp]) -> Array:
    """Return the offset of each ground (numbers from 0, one a walk) in J, shape (grounds,).

    The least-squares solution of J = offset of the ground + effect of the stiffness, the effects with mean zero. Means
    over grounds would differ by the stiffnesses whose walks are missing.
    """
    tried, which = np.unique(k, return_inverse=True)
    grounds, rows = int(ground.max()) + 1, np.arange(J.size)
    design = np.zeros((J.size + 1, grounds + tried.size))
    design[rows, ground] = design[rows, grounds + which] = design[-1, grounds:] = 1.0
    design[-1, :grounds] = 0.0
    return np.linalg.lstsq(design, np.append(J, 0.0), rcond=None)[0][:grounds]


def pooled_curve(k: Array, J: Array, ground: Array) -> Curve:
    """Return a smooth curve through the mean J of each stiffness over all grounds, up to a constant."""
    places = np.unique(ground, return_inverse=True)[1]
    left = J - ground_offsets(k, J, places)[places]
    tried, which = np.unique(k, return_inverse=True)
    count = np.bincount(which)
    mean = np.bincount(which, left) / count
    freedom = max(k.size - tried.size - int(places.max()), 1)
    error = np.sqrt(((left - mean[which]) ** 2).sum() / freedom / count)
    scale = max(float(mean.std()), float(error.mean()), 1e-9)
    model = _fitted(np.log10(tried), mean / scale, alpha=np.maximum(error / scale, 1e-3) ** 2)
    return lambda at: scale * model.predict(np.asarray(at)[:, None])


def labels(table: pd.DataFrame, *, pooled: bool = True) -> pd.DataFrame:
    """Return the best stiffness of each ground of some walks on soft soles: a row a ground, the fields of `Label`.

    The `pooled` curve of all other grounds is the prior of each ground: it decides where walks of the ground do not.
    Without it each ground stands alone, as in the paper.
    """
    soft = table[table["stiffness"].notna()].astype({"stiffness": float, "J": float})
    grounds = {
        place: rows
        for place, rows in soft.groupby(GROUND, sort=False)
        if rows["stiffness"].nunique() >= LEAST
    }
    if not grounds:
        raise SystemExit(f"a best stiffness needs walks with {LEAST} different ones on one ground")
    found = {}
    for place, rows in grounds.items():
        others = [each for other, each in grounds.items() if other != place]
        prior = None
        if pooled and others:
            rest = pd.concat(others)
            prior = pooled_curve(
                *rest[["stiffness", "J"]].to_numpy().T, rest.groupby([*GROUND, "seed"]).ngroup().to_numpy()
            )
        found[place] = asdict(best_stiffness(*rows[["stiffness", "J", "seed"]].to_numpy(float).T, prior))
    return pd.DataFrame.from_dict(found, orient="index").rename_axis(GROUND)


GROUND = ["terrain", "cutoff", "amplitude"]


def seen_roughness(
    terrain: str, cutoff: float, amplitude: float, ramp: float, seed: int, windows: int, distance: float = 3.0
) -> Array:
    """Return the roughness under the toes on a ground, shape (windows, 10).

    The ground is cut along the lines of both toes into windows as long as a scan, evenly spread over the walk and taken
    from the left and from the right in turn.
    """
    params = {"cutoff": cutoff} if cutoff else {}
    ground = make_terrain(terrain, amplitude=amplitude, seed=seed, ramp=ramp, **params)
    robot, recipe = wbc.load_robot("hrp4_class").robot(), ProfileRecipe()
    toes = [float(robot.placement(sole.frame).translation[1]) for sole in robot.soles]
    place = recipe.step * np.arange(round(recipe.window / recipe.step) + 1)
    end = min(ground.start + ground.length, distance + SOFT_LENGTH / 2.0)
    starts = np.linspace(ground.start, max(end - place[-1], ground.start), windows)
    heights = [ground.height(x + place, np.full(place.size, toes[i % 2])) for i, x in enumerate(starts)]
    return roughness(place, np.array(heights), recipe.roughness).values


SOFT_LENGTH = 0.27782
"""Length of the soft sole, m."""


def data_set(table: pd.DataFrame, windows: int = 6, *, pooled: bool = True) -> pd.DataFrame:
    """Return the table that a model learns from: roughness under the toes, a row each, with the label of its ground."""
    best = labels(table, pooled=pooled)
    parts = []
    for seed in sorted(table["seed"].unique()):
        for (terrain, cutoff, amplitude), label in best.iterrows():
            own = table[(table[[*GROUND, "seed"]] == (terrain, cutoff, amplitude, seed)).all(axis=1)]
            if own.empty:
                continue
            ramp, name = float(own["ramp"].iloc[0]), f"{terrain} {cutoff:g}" if cutoff else terrain
            values = seen_roughness(terrain, cutoff, amplitude, ramp, int(seed), windows)
            head = {"ground": name, "family": terrain, "amplitude": amplitude, "seed": seed}
            known = label[["stiffness", "stiffness_low", "stiffness_high", "J"]]
            seen = pd.DataFrame(values, columns=list(PARAMETERS))
            parts.append(seen.assign(**head, window=range(windows), **known))
    columns = [
        "ground",
        "family",
        "amplitude",
        "seed",
        "window",
        *PARAMETERS,
        "stiffness",
        "stiffness_low",
        "stiffness_high",
        "J",
    ]
    return pd.concat(parts, ignore_index=True)[columns]


def main() -> None:
    """Print the labels of a journal, and write the table of a model."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("journal", type=Path, help="journal of walks on soft soles of many stiffnesses")
    parser.add_argument("-o", "--out", type=Path, help="table to write (.csv)")
    parser.add_argument("--windows", type=int, default=6, help="profiles that are cut out of each ground")
    parser.add_argument("--separate", action="store_true", help="each ground alone, as in the paper")
    options = parser.parse_args()
    table = walks(options.journal)
    print(labels(table, pooled=not options.separate).to_string(float_format="{:.4g}".format))
    if options.out is not None:
        data_set(table, options.windows, pooled=not options.separate).to_csv(options.out, index=False)


if __name__ == "__main__":
    main()
