"""Statistics of trials: means with intervals over layouts, differences of pairs, shares of successes.

The unit of chance is the layout: a ground of one seed. Trials on one layout are not independent, so a bootstrap draws
layouts, each with all of its trials, and a test flips the signs of whole layouts.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array
from wbc.base.settings import Count, Number, Positive, Share

CONFIDENCE = 0.95
"""Confidence of every interval."""

RESAMPLES = 9999
"""Resamples of bootstrap and permutation test, scipy's default: the ends of an interval vary by about 1 % of its width,
and the smallest p-value is 2e-4."""

DRAWN = 10_000_000
"""Number of layouts that are drawn at a time: eighty megabytes."""

EQUAL = 1e-12
"""Largest difference of the means of layouts that is rounding, over the largest value."""

FEW = 8
"""Number of layouts below which no interval is shown: fewer tell too little of the rest."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """Mean with its confidence interval."""

    n: int
    mean: float | None  # None without values
    low: float | None  # lower end of the interval; None with fewer than two layouts
    high: float | None  # upper end of the interval
    layouts: int  # number of layouts that the values come from

    def text(self, digits: int = 3) -> str:
        """Return a text such as "20.4 [18.2, 21.7]"; too few layouts give no interval."""
        if self.mean is None:
            return "–"
        if self.low is None or self.high is None or self.layouts < FEW:
            return f"{self.mean:.{digits}g}"
        return f"{self.mean:.{digits}g} [{self.low:.{digits}g}, {self.high:.{digits}g}]"


@checked
def mean_interval(values: Sequence[Number], layouts: Sequence[Hashable] | None = None) -> Estimate:
    """Return the mean with its cluster bootstrap interval, bias-corrected and accelerated.

    `layouts` has the layout of each trial; when None, each trial has a layout of its own. The order of the values does
    not matter. Layouts with equal means have an interval of zero width.

    Source: B. Efron, "Better bootstrap confidence intervals", JASA 82(397), 1987; clusters: A. Davison, D. Hinkley,
    "Bootstrap methods and their application", 1997, section 3.8; `scipy.stats.bootstrap`.
    """
    from scipy.stats import bootstrap  # noqa: PLC0415 - takes half a second to import

    sample = finite_array("values to average", list(values))
    n = sample.size
    if n == 0:
        return Estimate(0, None, None, None, 0)
    mean = float(sample.mean())
    sums, counts = _by_layout(sample, layouts)
    if sums.size == 1:
        return Estimate(n, mean, None, None, 1)
    if np.ptp(sums / counts) <= EQUAL * np.abs(sample).max():
        return Estimate(n, mean, mean, mean, sums.size)

    def ratio(total: Array, count: Array, axis: int = -1) -> Array:
        return np.asarray(total.sum(axis=axis) / count.sum(axis=axis))

    order = np.lexsort((counts, sums))  # the order of the trials must not matter
    interval = bootstrap(
        (sums[order], counts[order]),
        ratio,
        paired=True,
        vectorized=True,
        n_resamples=RESAMPLES,
        batch=_batch(sums.size),
        confidence_level=CONFIDENCE,
        random_state=np.random.default_rng(0),
    ).confidence_interval
    return Estimate(n, mean, float(interval.low), float(interval.high), sums.size)


def _by_layout(sample: Array, layouts: Sequence[Hashable] | None) -> tuple[Array, Array]:
    """Return the sum and the number of the values of each layout."""
    if layouts is None:
        return sample, np.ones(sample.size)
    if len(layouts) != sample.size:
        raise InputError(f"{sample.size} values need as many layouts, got {len(layouts)}")
    numbers = {layout: i for i, layout in enumerate(dict.fromkeys(layouts))}
    which = np.array([numbers[layout] for layout in layouts])
    counts = np.bincount(which).astype(np.float64)
    return np.asarray(np.bincount(which, sample), dtype=np.float64), counts


def _batch(layouts: int) -> int:
    """Return the number of resamples that are drawn at a time."""
    return min(RESAMPLES, max(1, DRAWN // layouts))


@checked
def sign_flip_p(differences: Sequence[Number], layouts: Sequence[Hashable] | None = None) -> float | None:
    """Return the two-sided p-value of a mean difference of zero, by flipping signs of layouts; None for one layout.

    Source: R. Fisher, "The design of experiments", 1935, section 21; `scipy.stats.permutation_test`: all patterns of
        signs for few layouts, a random part of them for more.
    """
    from scipy.stats import permutation_test  # noqa: PLC0415 - slow to import

    sums, _ = _by_layout(finite_array("differences", list(differences)), layouts)
    if sums.size < 2:
        return None
    # The signs of zeros change nothing, and the order of the pairs must not matter.
    sums = np.sort(sums[sums != 0.0])
    if sums.size < 2:
        return 1.0
    test = permutation_test(
        (sums,),
        np.sum,
        permutation_type="samples",
        n_resamples=RESAMPLES,
        batch=_batch(sums.size),
        random_state=np.random.default_rng(0),
    )
    return float(test.pvalue)


@checked
def holm(p_values: Sequence[Share | None]) -> list[float | None]:
    """Return p-values corrected for their number, in the same order; None stays None and does not count.

    Source: S. Holm, "A simple sequentially rejective multiple test procedure", Scand. J. Statist. 6(2), 1979.
    """
    known = sorted((p, i) for i, p in enumerate(p_values) if p is not None)
    result: list[float | None] = [None] * len(p_values)
    largest = 0.0
    for rank, (p, i) in enumerate(known):
        result[i] = largest = max(largest, min(1.0, (len(known) - rank) * p))
    return result


@checked
def share_interval(successes: Annotated[int, Field(ge=0)], trials: Count) -> tuple[float, float]:
    """Return the exact interval of a share of successes; one-sided if all or none succeeded.

    20 of 20 is "at least 86 %".

    Source: C. Clopper, E. Pearson, Biometrika 26(4), 1934; `scipy.stats.binomtest`.
    """
    from scipy.stats import binomtest  # noqa: PLC0415 - slow to import

    if successes > trials:
        raise InputError(f"successes must be from 0 to the {trials} trials, got {successes}")
    side = {0: "less", trials: "greater"}.get(successes, "two-sided")
    found = binomtest(successes, trials, alternative=side).proportion_ci(CONFIDENCE, "exact")
    return float(found.low), float(found.high)


@checked
def rate_interval(events: Annotated[int, Field(ge=0, le=10**15)], time: Positive) -> tuple[float, float]:
    """Return the exact interval of a rate of independent events per unit of `time`; one-sided if there were none.

    No event in half an hour is "at most 6 an hour".

    Source: F. Garwood, Biometrika 28(3/4), 1936: the interval of a Poisson mean by quantiles of chi squared.
    """
    from scipy.stats import chi2  # noqa: PLC0415 - slow to import

    if events == 0:
        return 0.0, -math.log(1.0 - CONFIDENCE) / time
    rest = 0.5 * (1.0 - CONFIDENCE)
    return float(chi2.ppf(rest, 2 * events)) / 2.0 / time, float(chi2.isf(rest, 2 * events + 2)) / 2.0 / time


def rate_text(events: int, time: float) -> str:
    """Return a text such as "1.9 [1.2, 2.8]"; of no events the greatest rate that they leave, "≤ 0.2"."""
    low, high = rate_interval(events, time)
    return f"{events / time:.3g} [{low:.3g}, {high:.3g}]" if events else f"≤ {high:.3g}"


def share_text(successes: int, trials: int) -> str:
    """Return a text such as "18 of 20 completed [68, 99] %"."""
    low, high = (100.0 * end for end in share_interval(successes, trials))
    if successes == trials:
        return f"{successes} of {trials} completed (at least {low:.0f} %)"
    if successes == 0:
        return f"0 of {trials} completed (at most {high:.0f} %)"
    return f"{successes} of {trials} completed [{low:.0f}, {high:.0f}] %"
