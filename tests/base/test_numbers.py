"""Checks of numbers at both sides of their bounds, first-order lags, and names that are listed in messages."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from wbc.base.errors import (
    InputError,
    UnknownNameError,
    check_parts,
    choose,
    names_in,
    one_line,
    printable,
    shown,
    shown_path,
    unknown_name,
)
from wbc.base.numbers import (
    finite_array,
    finite_scalar,
    lag_gain,
    numbers,
    plain,
    read_only,
)
from wbc.base.settings import Numbers


def refused(check: Any, *values: Any, **options: Any) -> bool:
    try:
        check(*values, **options)
    except (InputError, ValueError, TypeError):
        return True
    return False


def test_a_number_may_lie_on_its_bounds_and_not_beside_them() -> None:
    rng = np.random.default_rng(0)
    for low, high in np.sort(rng.normal(size=(50, 2)), axis=1):
        for value in (low, high, 0.5 * (low + high)):
            assert finite_scalar("x", value, low=low, high=high) == value
            assert refused(finite_scalar, "x", value, above=low, high=high) == (value == low)
        for value in (np.nextafter(low, -math.inf), np.nextafter(high, math.inf)):
            assert refused(finite_scalar, "x", value, low=low, high=high)
    assert finite_scalar("x", -1e300) == -1e300 and finite_scalar("x", np.float32(0.5)) == 0.5
    for value in (math.nan, math.inf, -math.inf, "1", b"1", True, None, [1.0, 2.0]):
        assert refused(finite_scalar, "x", value)
    for integer in (0, 3, np.int64(3)):
        assert finite_scalar("x", integer) == integer and type(finite_scalar("x", integer)) is float


def test_arrays_are_copies_of_finite_numbers_of_a_shape() -> None:
    given = np.arange(6.0).reshape(2, 3)
    for values in (given, given.tolist(), given.astype(np.float32), given.astype(int), given.astype(object)):
        got = finite_array("x", values, (2, 3))
        assert got.dtype == np.float64 and (got == given).all() and got is not values
    for bad in (["1"], [b"1"], [None], [True], [1.0, True], (False, 2), np.array([True]), [[1], [1, 2]]):
        assert refused(numbers, bad) and refused(finite_array, "x", bad)
    assert numbers([]).shape == (0,) and refused(finite_array, "x", given, (3, 2))
    for endless in (math.nan, math.inf, -math.inf):
        assert refused(finite_array, "x", [[0.0, endless]])
    for kind in (float, int):
        masked = np.ma.masked_array([1, 2], mask=[False, True], dtype=kind)
        assert refused(finite_array, "x", masked) and np.isnan(numbers(masked)).tolist() == [False, True]
    assert refused(read_only(given).__setitem__, 0, 1.0) and given.flags.writeable
    assert plain(np.float32(0.5)) == 0.5 and plain(given) == given.tolist() and refused(plain, {1, 2})


def test_ranges_of_arrays_are_kept_on_both_sides() -> None:
    """Of one number that lies outside, wherever it stands in the array."""
    for rule, good, bad in (
        (Numbers(low=0.0), (0.0, 1.0), -5e-324),
        (Numbers(above=0.0), (5e-324, 1.0), 0.0),
        (Numbers(high=2.0), (-1e9, 2.0), math.nextafter(2.0, 3.0)),
        (Numbers(low=1.0, high=2.0), (1.0, 2.0), 0.5),
        (Numbers(low=1.0, high=2.0), (1.0, 2.0), 2.5),
    ):
        assert (rule.checked(good) == good).all()
        for values in ((bad, good[1]), (good[0], bad), bad):
            assert refused(rule.checked, values)
    shaped = Numbers(shape=(2,))
    assert shaped.checked([-1, 1]).tolist() == [-1.0, 1.0]
    assert all(refused(shaped.checked, bad) for bad in ([1.0], [1.0, math.nan], [1.0, 2.0, 3.0], 1.0, "ab"))


def test_lags_are_exact_whatever_the_period() -> None:
    """The solution of T · dx/dt = u − x: n steps of a period come to where one of n periods does."""
    for time_constant in (0.01, 0.3, 5.0):
        assert lag_gain(time_constant, time_constant) == pytest.approx(1.0 - math.exp(-1.0), rel=1e-12)
        for dt in (1e-4, 0.005, 0.1):
            left = 1.0 - lag_gain(dt, time_constant)
            assert left**7 == pytest.approx(1.0 - lag_gain(7 * dt, time_constant), rel=1e-9)
    assert lag_gain(0.005, 0.0) == lag_gain(0.005, -1.0) == 1.0 and lag_gain(0.0, 0.1) == 0.0


def message(call: Any, *values: Any) -> str:
    with pytest.raises(InputError) as refusal:
        call(*values)
    return str(refusal.value)


def test_an_unknown_name_is_answered_with_the_near_ones_else_with_the_choices() -> None:
    few, many = [f"joint_{i}" for i in range(20)], [f"joint_{i:02d}" for i in range(21)]
    assert choose("joint", "joint_3", few) == "joint_3"
    for bad in ("elbow", 3, None, "joint_3 "):
        with pytest.raises(UnknownNameError):
            choose("joint", bad, few)  # type: ignore[arg-type]
    near = message(unknown_name, "joint", "left_nee", ["left_knee", "neck_yaw", "elbow"])
    assert "left_knee" in near and "neck_yaw" not in near
    assert all(name in message(unknown_name, "joint", "xx", few) for name in few)
    said = message(unknown_name, "joint", "xx", many)
    assert "21" in said and all((name in said) == (name in many[:10]) for name in many)
    assert "none" in message(unknown_name, "joint", "xx", ())


def test_one_name_is_a_list_of_one() -> None:
    assert names_in("joints", "ab") == ["ab"] and names_in("joints", ("a", "b")) == ["a", "b"]
    for bad in (3, None, ["a", 3], [None], np.array(1)):
        assert refused(names_in, "joints", bad)
    check_parts("a pair", (1, 2), "index", "count")
    said = message(check_parts, "a pair", (1, 2), "index", "load", "step")
    assert "index, load and step" in said and "'load'" in said


def test_values_and_paths_are_shown_on_one_short_line() -> None:
    for value in ("x" * 400, list(range(400)), "a\n\tb", "\x1b[2J", "\ud800"):
        assert len(shown(value)) <= 80 and shown(value).isprintable()
    assert printable("a\x1b[2Jb\n\u202ec") == "a\\x1b[2Jb\n\\u202ec" and one_line(" a \n b\x07") == "a b\\x07"
    long = "folder/" * 30 + "mesh.stl"
    assert shown_path("a/mesh.stl") == "'a/mesh.stl'" and shown_path(long) == "'mesh.stl'"
