"""Statistics of trials: intervals of means, shares and rates, and tests of differences, against theory and SciPy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples
from scipy import stats

from wbc.base.errors import InputError
from wbc.sim.studies.intervals import (
    FEW,
    Estimate,
    holm,
    mean_interval,
    rate_interval,
    rate_text,
    share_interval,
    share_text,
    sign_flip_p,
)


def test_many_layouts_are_drawn_a_part_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """The interval is the same, and near the normal one: its ends within 7 % of its width, the p-value within 0.02.

    Trials are spread unevenly over layouts.
    """
    rng, many = np.random.default_rng(5), 200
    values = rng.exponential(size=2 * many) - 1.0 + 0.8 / math.sqrt(many)
    layouts = np.array([*range(many), *rng.integers(0, many, many).tolist()])
    whole = mean_interval(values.tolist(), layouts.tolist())
    monkeypatch.setattr("wbc.sim.studies.intervals.DRAWN", 97 * many)
    found, p = (
        mean_interval(values.tolist(), layouts.tolist()),
        sign_flip_p(values.tolist(), layouts.tolist()),
    )
    assert found == whole and found.layouts == many and p is not None
    sums, counts = np.bincount(layouts, values), np.bincount(layouts)
    left = (
        sums - values.mean() * counts
    )  # √(n / (n − 1) Σ (sum − mean · count)²) / Σ count: Cochran, 1977, section 6.3
    half = 1.96 * math.sqrt(many / (many - 1) * float(left @ left)) / values.size
    assert found.low is not None and found.high is not None
    assert (found.low, found.high) == pytest.approx(
        (values.mean() - half, values.mean() + half), abs=0.15 * half
    )
    assert p == pytest.approx(2.0 * stats.norm.sf(abs(sums.sum()) / math.sqrt(sums @ sums)), abs=0.02)


def test_trials_on_one_layout_are_not_counted_as_independent() -> None:
    """Each layout ten times gives the interval of the layouts, not one that is three times too narrow."""
    rng = np.random.default_rng(3)
    values = rng.normal(0.0, 1.0, 12)
    alone = mean_interval(values.tolist())
    repeated = mean_interval(np.repeat(values, 10).tolist(), np.repeat(np.arange(12), 10).tolist())
    assert (repeated.n, repeated.layouts) == (120, 12)
    assert repeated.low == pytest.approx(alone.low, abs=1e-3)  # but for rounding in ties
    assert repeated.high == pytest.approx(alone.high, abs=1e-3)
    naive = mean_interval(np.repeat(values, 10).tolist())
    assert (
        naive.low is not None and naive.high is not None and alone.low is not None and alone.high is not None
    )
    assert naive.high - naive.low < 0.5 * (alone.high - alone.low)
    uneven = mean_interval([0.0, 0.0, 0.0, 8.0], ["a", "a", "a", "b"])
    assert uneven.mean == 2.0 and uneven.layouts == 2


@pytest.mark.parametrize("power", [-1000, -500, 500, 1020])
def test_sign_flips_do_not_depend_on_the_unit(power: int) -> None:
    values = np.random.default_rng(2).normal(0.4, 1.0, 14)
    for layouts in (None, list(range(7)) * 2):
        assert sign_flip_p(np.ldexp(values, power).tolist(), layouts) == sign_flip_p(values.tolist(), layouts)


def test_sign_flips_keep_their_level() -> None:
    """Under no difference one test in twenty says there is one."""
    draws = np.random.default_rng(4).normal(0.0, 1.0, (120, 8))
    found = [sign_flip_p(row.tolist()) for row in draws]
    assert 0.01 <= np.mean([p is not None and p < 0.05 for p in found]) <= 0.10
    exact = [1.0, 1.0, 1.0, 1.0, 1.0]
    assert sign_flip_p(exact) == 2 / 2**5
    assert sign_flip_p([*exact, *exact], [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]) == 2 / 2**5
    assert sign_flip_p([*exact, *[0.0] * 100]) == 2 / 2**5  # signs of pairs that are equal change nothing
    assert sign_flip_p([0.0] * 20) == 1.0 and sign_flip_p([1.0]) is None


def test_corrected_p_values_and_exact_shares() -> None:
    assert holm([0.01, None, 0.04, 0.03]) == [
        pytest.approx(0.03),
        None,
        pytest.approx(0.06),
        pytest.approx(0.06),
    ]
    assert share_interval(20, 20)[0] == pytest.approx(0.05 ** (1 / 20))  # "at least 86 %"
    assert share_interval(0, 20)[1] == pytest.approx(1 - 0.05 ** (1 / 20))
    low, high = share_interval(10, 20)
    assert (low, high) == (pytest.approx(0.272, abs=1e-3), pytest.approx(0.728, abs=1e-3))
    with pytest.raises(InputError, match="successes"):
        share_interval(6, 5)


def test_the_interval_of_a_rate_is_that_of_a_poisson_count() -> None:
    """10 events: 4.795 to 18.39 (Garwood's table); none in half an hour: at most 6.0 an hour."""
    assert rate_interval(10, 1.0) == pytest.approx((4.795, 18.39), abs=0.01)
    assert rate_interval(0, 0.5) == pytest.approx((0.0, 5.99), abs=0.01)
    with pytest.raises(InputError, match="time"):
        rate_interval(1, 0.0)


def test_an_interval_without_chance_is_a_point_and_one_layout_has_none() -> None:
    assert mean_interval([]) == Estimate(0, None, None, None, 0)
    assert mean_interval([1.0, 3.0], ["a", "a"]) == Estimate(2, 2.0, None, None, 1)
    assert mean_interval([2.0] * 3) == Estimate(3, 2.0, 2.0, 2.0, 3)
    equal = mean_interval([1.0, 3.0, 3.0, 1.0], [0, 0, 1, 1])
    assert (equal.mean, equal.low, equal.high) == (2.0, 2.0, 2.0)
    shuffled = np.random.default_rng(0).permutation(20)
    values = np.random.default_rng(1).normal(size=20)
    one, other = mean_interval(values.tolist()), mean_interval(values[shuffled].tolist())
    assert (one.low, one.high) == pytest.approx((other.low, other.high), abs=1e-12)
    with pytest.raises(InputError):
        mean_interval([1.0, 2.0], [0])


def test_the_bootstrap_interval_of_a_mean_covers_it_as_often_as_it_says() -> None:
    rng = np.random.default_rng(7)
    covered = 0
    for _ in range(30):
        found = mean_interval(rng.normal(0.0, 1.0, 25).tolist())
        assert found.low is not None and found.high is not None and found.mean is not None
        assert found.low < found.mean < found.high
        covered += found.low <= 0.0 <= found.high
    assert 26 <= covered <= 30


def test_texts_of_estimates_say_the_figures() -> None:
    assert Estimate(5, None, None, None, 0).text() == "–"
    for layouts, text in ((FEW - 1, "2.5"), (FEW, "2.5 [1.25, 3.75]")):
        assert Estimate(9, 2.5, 1.25, 3.75, layouts).text() == text
    assert share_text(20, 20) == "20 of 20 completed (at least 86 %)"
    assert share_text(0, 20) == "0 of 20 completed (at most 14 %)"
    assert share_text(18, 20) == "18 of 20 completed [68, 99] %"
    assert rate_text(10, 5.0) == "2 [0.959, 3.68]" and rate_text(0, 0.5) == "≤ 5.99"


@given(st.integers(1, 50), st.floats(0.1, 100.0))
@examples(20)
def test_ends_of_the_interval_of_a_rate_leave_as_much_chance_beyond(events: int, time: float) -> None:
    low, high = rate_interval(events, time)
    assert stats.poisson.sf(events - 1, low * time) == pytest.approx(0.025, rel=1e-6)
    assert stats.poisson.cdf(events, high * time) == pytest.approx(0.025, rel=1e-6)
