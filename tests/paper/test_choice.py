"""The choice of a sole by the ground: what it is worth, on layouts that it was not made on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from choice import choice, p_small


def made_up(
    steps: Callable[[str, str, int], float], arms: tuple[str, ...] = ("5", "80", "400")
) -> pd.DataFrame:
    places = [(name, 0.05, 0.0, seed) for name in ("boards", "stones") for seed in range(10)]
    index = pd.MultiIndex.from_tuples(places, names=["terrain", "amplitude", "cutoff", "seed"])
    return pd.DataFrame(
        [[steps(name, arm, seed) for arm in arms] for name, _, _, seed in places], index, arms
    )


def test_choosing_by_the_ground_is_worth_what_it_is() -> None:
    rng = np.random.default_rng(2)
    best = {"boards": "400", "stones": "5"}
    found = choice(made_up(lambda name, arm, seed: 15.0 + 4.0 * (arm == best[name]) + 0.1 * rng.normal()))
    assert {place[0]: arm for place, arm in found.best.items()} == best
    assert all(same == (found.best[place],) for place, same in found.same.items())
    assert found.gain.mean == pytest.approx(2.0, abs=0.1) and found.gain.n == 20
    assert found.over["80"].mean == pytest.approx(4.0, abs=0.1) and found.p_small > 0.5


def test_the_first_layouts_choose_and_the_others_judge() -> None:
    """On the first six layouts 5 looks best on boards by chance; on the others it is worth nothing."""
    lucky = made_up(
        lambda name, arm, seed: (
            15.0 + (3.0 if arm == "5" and seed < 6 and name == "boards" else 2.0 * (arm == "80"))
        )
    )
    found = choice(lucky, chosen_by=6)
    assert [found.best[place] for place in found.means.index] == ["5", "80"] and found.single == "80"
    assert found.gain.mean == pytest.approx(-1.0) and found.gain.n == 8
    assert found.over["400"].mean == pytest.approx(1.0)


def test_the_best_arm_is_compared_with_the_others_alone() -> None:
    """Eight layouts that differ have p = 2 / 2^8, which six comparisons keep below 5 % and eight would not."""
    table = made_up(lambda name, arm, seed: 15.0 + (arm == "5" and seed < 8), ("1", "5", "80", "400"))
    assert 6 * 2.0 / 2.0**8 < 0.05 < 8 * 2.0 / 2.0**8
    assert all(same == ("5",) for same in choice(table).same.values())


def test_layouts_that_an_arm_has_not_walked_are_left_out() -> None:
    table = made_up(lambda name, arm, seed: 15.0 + (arm == "80"))
    table.iloc[0, 0] = np.nan
    assert choice(table).gain.n == 19


def test_small_differences_are_shown_in_spite_of_falls_that_are_rare() -> None:
    """One walk in 44 loses all 22 steps: half a step."""
    rng = np.random.default_rng(5)
    for n in (20, 200):
        draws = -22.0 * (rng.random((400, n)) < 1 / 44)
        assert np.mean([p_small(row, 0.5, 22.0) < 0.05 for row in draws]) <= 0.05
    steps = rng.integers(-1, 2, (100, 300))  # a step more, or less
    assert np.mean([p_small(row, 0.5, 22.0) < 0.05 for row in steps]) > 0.9
    assert p_small([0.0] * 154, 0.5, 22.0) < 0.05 < p_small([0.0] * 153, 0.5, 22.0)
    assert p_small([1.0] * 154, 0.5, 22.0) == 1.0
