"""Bayesian optimisation of a sole's stiffness and the stabilizer's gains: which points to walk, and what the walks say.

A walk is one value of a noisy function: every walk has a layout of its own. Asking is a pure function of what has been
walked, so that a run that was killed asks the same again and finds the answers in its journal.
"""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from wbc.core.errors import ROUNDING, Array, InputError
from wbc.core.registry import Registry
from wbc.core.settings import Count, NonNegative, Positive, Seed, settings
from wbc.feet.soles.actuator import PAPER_STIFFEST, SOFTEST, STIFFEST
from wbc.sim.studies.journal import Entry, canonical, trial_key
from wbc.sim.studies.provenance import provenance
from wbc.sim.studies.study import merged
from wbc.sim.walks.presets import FAST_LANDING
from wbc.sim.walks.settings import NO_BIAS, PAPER_GAINS
from wbc.sim.walks.spec import WalkSpec, with_ramp

NAMES = ("k", "kP", "kD")
"""Parameters: stiffness of the sole (Nm/rad), proportional (1/s) and derivative gain of the stabilizer."""

OPTIMISATION_SEED = 10_000
"""Seed of the first walk of an optimisation; the following walks have the following seeds. Validations have 100 to 119,
which no walk of an optimisation has."""

FIRST_DESIGN = 12
"""Number of points before the first model: four for each parameter, a scrambled Sobol sequence."""

CANDIDATES = 2000
"""Number of random points of which the next walk is the best: as good as a search by gradients, and eight times as
quick."""

REFIT = 10
"""Number of walks after which the length scales of the model are fitted anew."""


PAPER_CHANGES = {"gains.dcm_p": PAPER_GAINS["dcm_p"], "gains.dcm_d": PAPER_GAINS["dcm_d"]}
"""The paper's gains as changes of a law that has others."""


@settings(kw_only=True)
class Bounds:
    """Bounds of an optimisation, each the lowest and the highest value.

    Attributes:
        k: Stiffness of the sole, Nm/rad.
        kP: Proportional gain of the stabilizer, 1/s.
        kD: Derivative gain of the stabilizer.
        log: The stiffness is searched in its logarithm.
    """

    k: Annotated[tuple[float, float], "Nm/rad"]
    kP: Annotated[tuple[float, float], "1/s"] = (0.1, 5.0)  # noqa: N815 - the paper's name
    kD: tuple[float, float] = (0.1, 5.0)  # noqa: N815 - the paper's name
    log: bool = True

    def __post_init__(self) -> None:
        for name in NAMES:
            low, high = getattr(self, name)
            if not (math.isfinite(low) and math.isfinite(high) and 0.0 <= low < high):
                raise InputError(
                    f"bounds of {name} must be two numbers, the lower one first and not below 0, got {low:g} {high:g}"
                )
        if self.log and self.k[0] == 0.0:
            raise InputError("bounds of k from 0 have no logarithm; begin above 0, or search k itself")

    def values(self, unit: Sequence[float] | Array) -> dict[str, float]:
        """Return the parameters of a point of the unit cube, with six digits."""
        result = {}
        for name, share in zip(NAMES, unit, strict=True):
            low, high = getattr(self, name)
            if name == "k" and self.log:
                value = 10.0 ** (math.log10(low) + share * math.log10(high / low))
            else:
                value = low + share * (high - low)
            result[name] = min(max(float(f"{value:.6g}"), low), high)
        return result

    def unit(self, values: Mapping[str, float]) -> list[float]:
        """Return the point of the unit cube of some parameters; outside it if they are outside the bounds."""
        result = []
        for name in NAMES:
            low, high = getattr(self, name)
            if name == "k" and self.log:
                result.append(math.log10(max(values[name], 1e-12) / low) / math.log10(high / low))
            else:
                result.append((values[name] - low) / (high - low))
        return result


BOUNDS: Registry[Bounds] = Registry(
    "preset of bounds",
    {"wide": Bounds(k=(SOFTEST, STIFFEST)), "paper": Bounds(k=(0.0, PAPER_STIFFEST), log=False)},
)
"""Bounds by name: "paper" is its Table I, "wide" has k to 2,000 Nm/rad in its logarithm."""


@settings(kw_only=True)
class OptimisationSpec:
    """One optimisation: ground, law, bounds and seed decide which walks it asks for.

    Attributes:
        ground: Family of grounds.
        amplitude: Highest minus lowest point of the ground, m; the family's own when None.
        ramp: Length of the ramp that the ground begins with, m; the family's own when None.
        law: Preset of the stabilizer's settings, "default", "frizza" or "no_bias".
        bounds: Bounds of the parameters.
        distance: Length of a walk, m.
        seed: Seed of the optimisation: of the points it asks for.
        batch: Number of points asked for at a time, which workers walk side by side.
    """

    ground: str
    amplitude: Annotated[Positive, "m"] | None = None
    ramp: Annotated[NonNegative, "m"] | None = None
    law: str = "default"
    bounds: Bounds
    distance: Annotated[Positive, "m"] = 3.0
    seed: Seed = 0
    batch: Annotated[Count, Field(le=1000)] = 1

    def __post_init__(self) -> None:
        self.walk(self.bounds.values((0.5, 0.5, 0.5)), OPTIMISATION_SEED)

    def parts(self) -> dict[str, Any]:
        """Return the parts of a spec that all walks share."""
        shared = {
            "terrain": self.ground,
            "amplitude": self.amplitude,
            "terrain_params": {} if self.ramp is None else {"ramp": self.ramp},
            "foot": "soft",
            "noise": "realistic",
            "plan": {"distance": self.distance},
            "gains": self.law,
        }
        return shared | ({} if self.law == "default" else {"gait": dict(FAST_LANDING)})

    def own_parts(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Return the parts of a spec that the parameters decide."""
        gains = {"gains.dcm_p": values["kP"], "gains.dcm_d": values["kD"]}
        return {"stiffness": values["k"], "changes": gains}

    def usual_parts(self) -> dict[str, Any]:
        """Return the same parts of a walk that nothing was optimised for: 80 Nm/rad and the usual gains of the law."""
        gains = {} if self.law == "default" else dict(PAPER_CHANGES)
        return {"stiffness": PAPER_STIFFEST, "changes": gains}

    def walk(self, values: Mapping[str, float], seed: int) -> WalkSpec:
        """Return the walk with some parameters over the layout of a seed."""
        return WalkSpec.from_json(merged(self.parts(), self.own_parts(values), {"seed": seed}))

    def owns(self, spec: Mapping[str, Any]) -> bool:
        """Return True if a walk of a journal can be one of this optimisation or of its validation."""
        spec = {**with_ramp(spec), "gains": NO_BIAS.get(spec["gains"], spec["gains"])}
        if any(spec.get(name) != value for name, value in _shared_by_walks(self).items()):
            return False
        return spec["seed"] < OPTIMISATION_SEED or within(self.bounds, parameters(spec))


@lru_cache(64)
def _shared_by_walks(optimisation: OptimisationSpec) -> dict[str, Any]:
    """Return the plain values that all walks of an optimisation have."""
    middle = optimisation.walk(optimisation.bounds.values((0.5, 0.5, 0.5)), OPTIMISATION_SEED).to_json()
    return {name: value for name, value in middle.items() if name not in ("seed", "stiffness", "changes")}


def parameters(spec: Mapping[str, Any]) -> dict[str, float]:
    """Return k, kP and kD of the spec of a walk."""
    gains = [np.ravel(spec["changes"][f"gains.dcm_{name}"])[0] for name in "pd"]
    return dict(zip(NAMES, (float(spec["stiffness"]), *map(float, gains)), strict=True))


def within(bounds: Bounds, values: Mapping[str, float]) -> bool:
    """Return True if parameters lie within the bounds."""
    return all(-ROUNDING <= share <= 1.0 + ROUNDING for share in bounds.unit(values))


@dataclass(frozen=True)
class Walked:
    """A point and what it gave.

    Attributes:
        unit: Point of the unit cube.
        J: Objective of the walk.
        result: Result of the walk.
    """

    unit: tuple[float, ...]
    J: float
    result: Mapping[str, Any]


def check_journal(entries: Mapping[str, Entry], specs: Sequence[OptimisationSpec], *, any_code: bool) -> None:
    """Refuse a journal of other optimisations, or, without `any_code`, of another version of the code."""
    for entry in entries.values():
        if not any(spec.owns(entry.spec) for spec in specs):
            where = {name: entry.spec.get(name) for name in ("terrain", "amplitude", "foot", "gains")}
            raise InputError(
                f"the journal is not of this optimisation: it has a walk with {canonical(where)}; use another"
            )
        if not any_code and entry.version != provenance():
            raise InputError(
                f"the journal has walks of another version of the code ({entry.version.get('code')}, not "
                f"{provenance()['code']}): --any-code takes them, or begin another journal"
            )


class Asker:
    """Chooses points by a Gaussian process and the expected improvement over the best expected value.

    Engine: `bayesian-optimization` (MIT), with a Matérn kernel of one length a parameter and the noise of single walks,
    both fitted; docs/paper.md has others beside it. The value to improve on is the best expected one of
    the points known, as the greatest of noisy values says little. Points that are asked for together are told apart by
    believing the model's mean at those before.

    Source: batches: D. Ginsbourger et al., "Kriging is well-suited to parallelize optimization", 2010 (Kriging
    believer); improvement with noise: E. Vazquez et al., "Global optimization based on noisy evaluations", 2008.
    """

    def __init__(self, seed: int) -> None:
        """Start without data; `InputError` if the engine is not installed."""
        try:
            import bayes_opt  # type: ignore[import-not-found, unused-ignore] # noqa: PLC0415 - an extra
        except ImportError as error:
            raise InputError(
                'an optimisation needs the extra "studies": pip install -e ".[studies]" in the clone'
            ) from error
        self._engine = bayes_opt
        self._seed = seed
        self._kernel: tuple[int, Any] = (0, None)

    def ask(self, known: Sequence[Walked], count: int) -> list[tuple[float, ...]]:
        """Return the next points of the unit cube; the same for the same points known, in any process."""
        from scipy.stats import qmc  # noqa: PLC0415 - slow to import

        first = qmc.Sobol(len(NAMES), rng=np.random.default_rng(self._seed)).random(16)[:FIRST_DESIGN]
        points: list[tuple[float, ...]] = []
        X = [walked.unit for walked in known]
        y = [walked.J for walked in known]
        while len(points) < count:
            if len(X) < FIRST_DESIGN:
                point = tuple(float(v) for v in first[len(X)])
                believed = float(np.mean(y)) if y else 0.0
            else:
                point, believed = self._suggest(X, y, len(known))
            points.append(point)
            X, y = [*X, point], [*y, believed]
        return points

    def _suggest(self, X: list[Any], y: list[float], told: int) -> tuple[tuple[float, ...], float]:
        rng = np.random.RandomState(np.random.SeedSequence([self._seed, len(X)]).generate_state(1)[0])  # noqa: NPY002 - the engine's kind
        acquisition = self._engine.acquisition
        improvement = acquisition.ExpectedImprovement(xi=0.0)
        engine = self._engine.BayesianOptimization(
            f=None,
            pbounds={name: (0.0, 1.0) for name in NAMES},
            random_state=rng,
            verbose=0,
            allow_duplicate_points=True,
        )
        with redirect_stdout(io.StringIO()):  # it prints a line for every point that it asks for again
            for point, value in zip(X, y, strict=True):
                engine.register(params=dict(zip(NAMES, point, strict=True)), target=value)
        fitted_at = max(FIRST_DESIGN, told - told % REFIT)
        if self._kernel[0] != fitted_at:
            data = np.array(X[:fitted_at]), np.array(y[:fitted_at])
            self._kernel = fitted_at, fitted(*data, seed=self._seed).kernel_
        # As alpha, the noise of single walks is no part of the deviation: the improvement is that of their mean.
        function, noise = self._kernel[1].k1, self._kernel[1].k2.noise_level
        engine.set_gp_params(kernel=function, optimizer=None, normalize_y=True, alpha=noise)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model = engine._gp.fit(np.array(X), np.array(y))
            improvement.y_max = float(model.predict(np.array(X)).max())  # its own is the greatest noisy value
            found = acquisition.AcquisitionFunction.suggest(
                improvement, model, engine.space, CANDIDATES, 0, fit_gp=False, random_state=rng
            )
            point = tuple(float(f"{value:.9g}") for value in found)
            believed = float(model.predict(np.array([point]))[0])
        return point, believed


def fitted(X: Array, y: Array, *, seed: int = 0) -> Any:
    """Return a Gaussian process of noisy values over the unit cube, fitted; X (n, 3), y (n,)."""
    from sklearn.gaussian_process import GaussianProcessRegressor  # noqa: PLC0415 - takes a second to import
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel  # noqa: PLC0415

    kernel = ConstantKernel(1.0, (1e-2, 1e2)) * Matern([0.3] * X.shape[1], (0.05, 10.0), nu=2.5)
    kernel += WhiteKernel(0.5, (1e-3, 1e1))
    model = GaussianProcessRegressor(kernel, normalize_y=True, n_restarts_optimizer=1, random_state=seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return model.fit(X, y)


Run = Callable[[list[WalkSpec]], Mapping[str, Entry]]
"""Function that runs walks that a journal does not have, and returns the entries of the journal."""


def optimise(spec: OptimisationSpec, budget: int, run: Run) -> list[Walked]:
    """Walk the points of an optimisation until its budget is spent; return points and results in the order of asking.

    `run` runs walks; what a journal has is not run again. Walks without a result are left out.
    """
    asker, asked = Asker(spec.seed), 0
    known: list[Walked] = []
    while asked < budget:
        left = (FIRST_DESIGN if asked < FIRST_DESIGN else budget) - asked
        points = asker.ask(known, min(spec.batch, left, budget - asked))
        specs = [
            spec.walk(spec.bounds.values(p), OPTIMISATION_SEED + asked + i) for i, p in enumerate(points)
        ]
        asked += len(points)
        entries = run(specs)
        for point, walk in zip(points, specs, strict=True):
            entry = entries.get(trial_key(walk.to_json()))
            if entry is not None and entry.status == "done" and entry.result is not None:
                known.append(Walked(point, float(entry.result["J"]), entry.result))
    return known
