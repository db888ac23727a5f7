"""Means with confidence intervals, and differences of pairs: trials that were run on the same grounds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc.core.errors import InputError, finite_array, finite_scalar

CONFIDENCE = 0.95
"""Default confidence of an interval."""

RESAMPLES = 9999
"""Resamples of the bootstrap, scipy's default: the ends of an interval vary by about 1 % of its width."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A mean with its confidence interval.

    Attributes:
        n: Number of values.
        mean: Mean; None without values.
        low: Lower end of the interval; None with fewer than two values.
        high: Upper end of the interval.
    """

    n: int
    mean: float | None
    low: float | None
    high: float | None

    def text(self, digits: int = 3) -> str:
        """Return a text such as "20.4 [18.2, 21.7]"."""
        if self.mean is None:
            return "–"
        if self.low is None or self.high is None:
            return f"{self.mean:.{digits}g}"
        return f"{self.mean:.{digits}g} [{self.low:.{digits}g}, {self.high:.{digits}g}]"


def mean_interval(values: Sequence[float], *, confidence: float = CONFIDENCE) -> Estimate:
    """Return the mean with its bootstrap interval, bias-corrected and accelerated; the same for the same values.

    Values that are all equal have an interval of no width.

    Args:
        values: Values of independent trials.
        confidence: Confidence of the interval.

    Raises:
        InputError: Values that are not finite, or a confidence outside (0, 1).

    Source: B. Efron, "Better bootstrap confidence intervals", JASA 82(397), 1987; `scipy.stats.bootstrap`.
    """
    from scipy.stats import bootstrap  # noqa: PLC0415 - takes half a second to import

    finite_scalar("confidence", confidence, low=0.0, high=1.0, open_low=True)
    sample = finite_array("values to average", list(values))
    n = sample.size
    if n == 0:
        return Estimate(0, None, None, None)
    mean = float(sample.mean())
    if n == 1:
        return Estimate(1, mean, None, None)
    if np.ptp(sample) == 0.0:
        return Estimate(n, mean, mean, mean)
    interval = bootstrap(
        (np.sort(sample),),  # the order of the trials must not matter
        np.mean,
        n_resamples=RESAMPLES,
        confidence_level=confidence,
        random_state=np.random.default_rng(0),
    ).confidence_interval
    low, high = float(interval.low), float(interval.high)
    if not (math.isfinite(low) and math.isfinite(high)):
        raise InputError(f"no interval can be given for {n} values around {mean:g}")
    return Estimate(n, mean, low, high)


def paired_difference(
    values: Mapping[Any, float], reference: Mapping[Any, float], *, confidence: float = CONFIDENCE
) -> Estimate:
    """Return the mean difference to a reference over the pairs that both have, with its interval.

    Args:
        values: Pair (a seed, a ground) → value.
        reference: Pair → value of the reference.
        confidence: Confidence of the interval.
    """
    pairs = [key for key in values if key in reference]
    return mean_interval([values[key] - reference[key] for key in pairs], confidence=confidence)
