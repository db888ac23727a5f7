"""Feature selection: it finds what was planted, whatever the units and the order of the profiles."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view

from wbc.core.errors import InputError, UnknownNameError
from wbc.feet.sensing.scan import PROFILE_STEP
from wbc.feet.stiffness.features import (
    WINDOW_FEATURES,
    FeatureSet,
    select_features,
)
from wbc.feet.stiffness.roughness import PARAMETERS, roughness
from wbc.sim.terrain.spec import terrain

RNG = np.random.default_rng(0)


@pytest.fixture(scope="module")
def values() -> np.ndarray:
    """Roughness of windows of six grounds, shape (n, 10)."""
    cut = [
        sliding_window_view(terrain(name, amplitude=a, seed=s).profile()[1], 41)[::41]
        for name in ("stones", "cobble_stones", "cylinder_obstacles", "random", "roof_tiles", "stone_bricks")
        for a in (0.02, 0.035)
        for s in range(2)
    ]
    z = np.concatenate(cut)
    return roughness(PROFILE_STEP * np.arange(z.shape[1]), z).values


def test_features_are_what_their_names_say(values: np.ndarray) -> None:
    names = ("Sp", "Sp^3", "sqrt(P)", "lines", "Ssk", "Ssk^3", "K")
    f = dict(zip(names, FeatureSet(names)(values).T, strict=True))
    p = dict(zip(PARAMETERS, values.T, strict=True))
    np.testing.assert_allclose(f["Sp^3"], p["Sp"] ** 3)
    np.testing.assert_allclose(f["sqrt(P)"] ** 2, p["P"])
    np.testing.assert_allclose(f["lines"], 1 / (1 - p["K"]))
    np.testing.assert_allclose(f["Ssk^3"], p["Ssk"] ** 3)
    np.testing.assert_array_equal(f["K"], p["K"])
    one = FeatureSet(names)(values[3])
    np.testing.assert_array_equal(one, FeatureSet(names)(values)[3])
    np.testing.assert_array_equal(FeatureSet(WINDOW_FEATURES)(np.zeros(10)), [0, 0, 0, 0, 1])


def test_independent_columns_come_first() -> None:
    """Nine noisy copies of one parameter and one of its own: the two first picks hold both."""
    common = RNG.normal(size=300)
    values = common[:, None] + 1e-3 * RNG.normal(size=(300, 10))
    values[:, 6] = RNG.normal(size=300)
    s = select_features(values, powers=(1,), bound=10.0)
    assert len(s.kept) == 2 and "Sz" in s.kept
    assert s.diagonal[1] > 0.9 * s.diagonal[0]


def test_the_rank_is_that_of_the_condition_number(values: np.ndarray) -> None:
    sizes = []
    for bound in (1.0, 2.0, 5.0, 20.0, 100.0):
        s = select_features(values, bound=bound)
        ratio = s.singular_values[0] / np.array(s.singular_values[: len(s.kept) + 1])
        assert ratio[-2] <= bound < ratio[-1]
        sizes.append(len(s.kept))
    assert sizes[0] == 1 and sizes == sorted(sizes) and sizes[-1] > sizes[2]
    assert select_features(values).kept_condition < 5.0


def test_the_choice_depends_neither_on_units_nor_on_order(values: np.ndarray) -> None:
    chosen = select_features(values)
    again = select_features(values[RNG.permutation(len(values))])
    in_mm = select_features(values * [1e3, 1e3, 1, 1, 1e3, 1e3, 1e3, 1e6, 1, 1])
    assert chosen.kept == again.kept == in_mm.kept
    assert len(set(chosen.kept)) == len(chosen.kept) > 1


def test_columns_that_are_the_same_are_offered_once(values: np.ndarray) -> None:
    s = select_features(values)
    assert ("M", "Sq^2") in s.twins or ("Sq^2", "M") in s.twins
    assert not {"M", "Sq^2"} <= set(s.kept)
    flat_k = values.copy()
    flat_k[:, PARAMETERS.index("K")] = 0.5
    assert select_features(flat_k).constant == ("K", "K^2", "K^3")


def test_bad_input_is_refused(values: np.ndarray) -> None:
    for names, message in (
        ((), "at least one feature"),
        (("Sp", "Sp"), "features must be named once each, got Sp, Sp"),
        (("Sp^x",), "power must be a whole number"),
        (("Sp^1",), "power must be a whole number"),
        (("sqrt(Ssk)",), "can be negative"),
    ):
        with pytest.raises(InputError, match=message):
            FeatureSet(names)
    with pytest.raises(UnknownNameError, match="roughness parameter 'Spp'"):
        FeatureSet(("Spp^2",))
    with pytest.raises(InputError, match="shape"):
        FeatureSet(("Sp",))(np.zeros(9))
    with pytest.raises(InputError, match="finite"):
        FeatureSet(("Sp",))(np.full(10, np.nan))
    for bad, options, message in (
        (values[:1], {}, "two profiles or more"),
        (values[0], {}, "two profiles or more"),
        (np.ones((5, 10)), {}, "nothing changes over the 5 profiles"),
        (values, {"bound": 0.5}, "condition number"),
    ):
        with pytest.raises(InputError, match=message):
            select_features(bad, **options)
