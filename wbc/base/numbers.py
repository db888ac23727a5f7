"""The array type of the library, the rounding that it allows, and checks of numbers.

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


def numbers(value: ArrayLike) -> Array:
    """Return a copy of numbers as a float64 array; `TypeError` or `ValueError` for text and truth values among them."""
    array = np.array(value)
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


def finite_array(what: str, value: ArrayLike, shape: tuple[int, ...] | None = None) -> Array:
    """Return a copy of finite numbers as a float64 array, of any shape when None; `what` is its name in messages."""
    try:
        array = numbers(value)
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        raise InputError(f"{what} must be numbers, got {shown(value)}") from error
    if shape is not None and array.shape != shape:
        raise InputError(f"{what} must have shape {shape}, got {array.shape}")
    # Three times as fast as NumPy for the small arrays of a tick.
    if not all(map(math.isfinite, array.ravel().tolist())):
        raise InputError(f"{what} must be finite, got {shown(array)}")
    return array


def finite_scalar(
    what: str, value: Any, *, low: float = -math.inf, high: float = math.inf, open_low: bool = False
) -> float:
    """Return a number as a float inside [low, high], or (low, high] with `open_low`; `what` is named in messages."""
    if isinstance(value, (str, bytes, bool)):
        raise InputError(f"{what} must be a number, got {shown(value)}")
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{what} must be a number, got {shown(value)}") from error
    if not math.isfinite(number):
        raise InputError(f"{what} must be finite, got {number}")
    if number < low or number > high or (open_low and number == low):
        raise InputError(f"{what} must lie in {'(' if open_low else '['}{low:g}, {high:g}], got {number:g}")
    return number


def positive(what: str, value: Any) -> float:
    """Return a number as a float above zero; `InputError` for anything else."""
    return finite_scalar(what, value, low=0.0, open_low=True)


def non_negative(what: str, value: Any) -> float:
    """Return a number as a float of at least zero; `InputError` for anything else."""
    return finite_scalar(what, value, low=0.0)


def whole_number(what: str, value: Any, *, low: int) -> int:
    """Return an integer that is not below `low`; `InputError` for anything else."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < low:
        raise InputError(f"{what} must be an integer of at least {low}, got {shown(value)}")
    return int(value)
