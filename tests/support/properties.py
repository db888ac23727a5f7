"""Profiles of hypothesis, the number of examples of a property test, and what alone runs by default.

The default profile draws the same examples in every run, on every machine: a run that is red stays red. The profile
`long` draws new ones at random, ten times as many: `HYPOTHESIS_PROFILE=long pytest tests/feet`. No phase explains
failures: it would trace every example, which takes a quarter of the time.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterable, Sequence
from typing import Any

import pytest
from hypothesis import Phase, settings

PERCENT = 100
"""Number of examples of a profile that keeps the counts of the tests."""

PHASES = tuple(phase for phase in Phase if phase is not Phase.explain)

settings.register_profile("default", max_examples=PERCENT, derandomize=True, deadline=None, phases=PHASES)
settings.register_profile("long", max_examples=10 * PERCENT, derandomize=False, deadline=None, phases=PHASES)


def load_profile() -> None:
    """Load the profile that the environment variable HYPOTHESIS_PROFILE names; the default one without it."""
    settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "default"))


def examples(count: int, **changes: Any) -> settings:
    """Return the settings of a property test: the profile's, with a number of examples of its own.

    Args:
        count: Number of examples in the default profile.
        **changes: Other settings that differ from the profile's.
    """
    return settings(max_examples=count * settings().max_examples // PERCENT, **changes)


def by_default(values: Iterable[Any], *usual: Any) -> list[Any]:
    """Return values of a parameter of which some are tested by default, and the others in the slow run."""
    return [value if value in usual else pytest.param(value, marks=pytest.mark.slow) for value in values]


def each_once(*lists: Sequence[Any]) -> list[Any]:
    """Return all combinations of values of several parameters.

    By default those are tested in which the lists go side by side, so that each value comes at least once; the others
    are tested in the slow run.
    """
    longest = max(map(len, lists))
    usual = {tuple(k % len(values) for values in lists) for k in range(longest)}
    return [
        pytest.param(
            *(values[k] for values, k in zip(lists, places, strict=True)),
            marks=() if places in usual else pytest.mark.slow,
        )
        for places in itertools.product(*(range(len(values)) for values in lists))
    ]
