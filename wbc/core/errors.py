"""Exceptions of the library, and checks that raise them.

What is wrong with an argument is an `InputError` everywhere, an `UnknownNameError` for a name. Every message gives the
wrong value, the rule and the choices, so that a caller can correct the input without reading this code.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
"""Every array in the library: float64, in SI units."""

ROUNDING = 1e-9
"""Rounding allowed in sums and comparisons of times, lengths, forces and ratios, SI units; also the least divisor."""


class WbcError(Exception):
    """Root of every exception that the library raises on purpose."""


class InputError(WbcError, ValueError):
    """An argument that cannot be used; the message names the value, the rule and the choices."""


class UnknownNameError(InputError, LookupError):
    """A name that does not exist; the message lists the nearest ones that do."""


class ModelError(InputError):
    """A robot model that cannot be simulated or controlled as it stands."""


class MeasurementError(WbcError):
    """A measurement that cannot be used, such as one with NaN in it."""


LONGEST = 80
"""Longest text of a value in a message, characters."""

LONGEST_PERIOD = 1.0
"""Longest control period, s: numbers above are in milliseconds, or are frequencies."""


def shown(value: object) -> str:
    """Return a value as messages show it: on one line, shortened, printable."""
    try:
        text = value if isinstance(value, str) else repr(value)
    except Exception:  # nested too deep, or a broken `__repr__`
        text = f"<{type(value).__name__}>"
    text = " ".join(text[: 4 * LONGEST].split()) if not isinstance(value, str) else repr(text[: 4 * LONGEST])
    text = text.encode("utf-8", "backslashreplace").decode()
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def printable(text: str) -> str:
    r"""Return a text of several lines without characters that steer a terminal: these are written as `\x1b`, say.

    Texts of files, such as titles, names and patterns, may hold them.
    """
    return _STEERING.sub(lambda found: ascii(found[0])[1:-1], text)


_STEERING = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff\ud800-\udfff]"
)


def shown_path(path: str | Path) -> str:
    """Return a path as messages show it: on one line, of a long one the name of the file alone."""
    whole = shown(str(path))
    return whole if not whole.endswith("...") else shown(Path(path).name)


def unknown_name(kind: str, name: object, choices: Iterable[str]) -> NoReturn:
    """Raise `UnknownNameError` for a name of a kind ("frame", "joint", "robot", …) that is not among the choices."""
    names = sorted(choices)
    given = shown(name).strip("'") if isinstance(name, str) else shown(name)
    near = difflib.get_close_matches(given, names, n=3, cutoff=0.5)
    if near:
        hint = "did you mean " + " or ".join(f"'{n}'" for n in near) + "?"
    elif len(names) <= 20:
        hint = "choices: " + (", ".join(names) or "none")
    else:
        hint = f"there are {len(names)}, among them " + ", ".join(names[:10])
    raise UnknownNameError(f"no {kind} '{given}'; {hint}")


def choose(kind: str, name: str, choices: Iterable[str]) -> str:
    """Return a name that is one of the choices; `UnknownNameError` for another."""
    names = list(choices)
    if not isinstance(name, str) or name not in names:
        unknown_name(kind, name, names)
    return name


def names_in(what: str, value: object) -> list[str]:
    """Return names as a list; a single one counts as a list of one."""
    names: list[Any] = (
        [value] if isinstance(value, str) else list(value) if isinstance(value, Iterable) else [None]
    )
    if not all(isinstance(name, str) for name in names):
        raise InputError(f"{what} must be a name or several names, got {shown(value)}")
    return names


def check_parts(what: str, value: object, *parts: str) -> None:
    """Raise an `InputError` for an object, such as "a driver", that lacks an attribute or method of its protocol."""
    for part in parts:
        if not hasattr(value, part):
            *most, last = parts
            every = f"{', '.join(most)} and {last}" if most else last
            raise InputError(f"{what} must have {every}; '{part}' is missing in {shown(value)}")


def scalar(value: float) -> Array:
    """Return a number as an array without axes, for the tick: NumPy takes half the time of a Python number with it."""
    return np.array(float(value))


def finite_array(what: str, value: ArrayLike, shape: tuple[int, ...] | None = None) -> Array:
    """Return a copy of finite numbers as a float64 array, of any shape when None; `what` is its name in messages."""
    try:
        array = np.array(value, dtype=np.float64)
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
