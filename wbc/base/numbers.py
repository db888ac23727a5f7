"""The array type of the library, the rounding that it allows, checks of numbers, and the lag of first order.

A check returns the value as a float, an integer or an array. Or it raises an `InputError` that names the value and the
rule.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.base.errors import InputError, shown

Array = NDArray[np.float64]
"""Every array in the library: float64, in SI units."""

ROUNDING = 1e-9
"""Rounding allowed in sums and comparisons of times, lengths, forces and ratios, SI units; also the least divisor."""

FLOAT64 = np.dtype(np.float64)
BOOLS = frozenset((bool, np.bool_))
"""Types of truth values, which are no numbers."""


def read_only(values: Array) -> Array:
    """Return a view that cannot be written: what is assigned is checked, an element that is written is not."""
    view = values.view()
    view.flags.writeable = False
    return view


def scalar(value: float) -> Array:
    """Return a number as an array without axes, for the tick: NumPy takes half the time of a Python number with it."""
    return np.array(float(value))


def unmasked(value: ArrayLike) -> ArrayLike:
    """Return a value as it is; of a masked array with numbers a copy with NaN where it is masked, which are none."""
    if isinstance(value, np.ma.MaskedArray) and value.dtype.kind in "iuf":
        return np.where(np.ma.getmaskarray(value), np.nan, value.data)
    return value


def numbers(value: ArrayLike) -> Array:
    """Return a copy of numbers as a float64 array; `TypeError` or `ValueError` for text and truth values among them."""
    array = np.array(unmasked(value))
    kind = array.dtype.kind
    if kind not in "iuf" and array.size:
        if kind != "O" or any(isinstance(each, (str, bytes, bool, type(None))) for each in array.flat):
            raise TypeError
    elif isinstance(value, (list, tuple)) and not BOOLS.isdisjoint(map(type, value)):
        raise TypeError
    return array if array.dtype is FLOAT64 else array.astype(np.float64)


def plain(value: Any) -> Any:
    """Return a number or an array of NumPy as plain values, for encoders of JSON; `TypeError` for anything else."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"{shown(value)} is no value that JSON has")


def finite_array(
    what: str, value: ArrayLike, shape: tuple[int, ...] | None = None, *, unbounded: bool = False
) -> Array:
    """Return a copy of finite numbers as a float64 array, of any shape when None; `what` is its name in messages.

    Where they may be `unbounded`, infinity and NaN pass: a check of their range follows.
    """
    try:
        array = numbers(value)
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        kind = "a number" if shape == () else "numbers"
        raise InputError(f"{what} must be {kind}, got {shown(value)}") from error
    if shape is not None and array.shape != shape:
        of = f"have shape {shape}, got {array.shape}" if shape else f"be a number, got {shown(value)}"
        raise InputError(f"{what} must {of}")
    # Three times as fast as NumPy for the small arrays of a tick.
    if not (unbounded or all(map(math.isfinite, array.ravel().tolist()))):
        raise InputError(f"{what} must be finite, got {shown(value if shape == () else array)}")
    return array


def in_range(what: str, array: Array, low: float, above: float, high: float) -> Array:
    """Return numbers that are all at least `low`, above `above` and at most `high`; else an `InputError`."""
    if array.size and not (array.min() >= low and array.min() > above and array.max() <= high):
        bounds = {"of at least": low, "above": above, "of at most": high}
        rules = " and ".join(f"{rule} {bound:g}" for rule, bound in bounds.items() if math.isfinite(bound))
        kind = "finite numbers" if array.ndim else "a finite number"
        raise InputError(f"{what} must be {kind} {rules}, got {shown(array.tolist())}")
    return array


def one_or_each(
    what: str,
    value: ArrayLike,
    count: int,
    *,
    low: float = -math.inf,
    above: float = -math.inf,
    high: float = math.inf,
    unbounded: bool = False,
) -> Array:
    """Return a number for each of `count` rows, joints or parts, shape (count,), of one for all or one for each.

    See `in_range` for the range, `finite_array` for `unbounded`.
    """
    array = finite_array(what, value, unbounded=unbounded)
    if array.shape not in ((), (count,)):
        raise InputError(f"{what} must be a scalar or have shape ({count},), got shape {array.shape}")
    return np.array(np.broadcast_to(in_range(what, array, low, above, high), (count,)))


def finite_scalar(
    what: str, value: Any, *, low: float = -math.inf, above: float = -math.inf, high: float = math.inf
) -> float:
    """Return a finite number of a range, see `in_range`, as a float."""
    if type(value) is float and math.isfinite(value) and low <= value <= high and above < value:
        return value
    return float(in_range(what, finite_array(what, value, ()), low, above, high))


def lag_gain(dt: float, time_constant: float) -> float:
    """Return the share of the way to its input that a first-order lag goes in dt; 1 without a time constant.

    The discretisation is exact: time constants do not depend on the control period.
    """
    return 1.0 if time_constant <= 0.0 else -math.expm1(-dt / time_constant)
