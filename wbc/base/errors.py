"""Exceptions of the library, and checks of names that raise them.

What is wrong with an argument is an `InputError` everywhere, an `UnknownNameError` for a name. Every message gives the
wrong value, the rule and the choices, so that a caller can correct the input without reading this code.
"""

from __future__ import annotations

import difflib
import importlib
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NoReturn


class WbcError(Exception):
    """Root of every exception that the library raises on purpose; its message can be encoded whatever it names."""

    def __init__(self, *parts: object) -> None:
        r"""Take the message, with surrogates, which names may hold, written as `\ud800`, say."""
        super().__init__(
            *(p.encode("utf-8", "backslashreplace").decode() if isinstance(p, str) else p for p in parts)
        )


class InputError(WbcError, ValueError):
    """An argument that cannot be used; the message names the value, the rule and the choices."""


class UnknownNameError(InputError, LookupError):
    """A name that does not exist; the message lists the nearest ones that do."""


class ModelError(InputError):
    """A robot model that cannot be simulated or controlled as it stands."""


class MeasurementError(WbcError):
    """A measurement that cannot be used, such as one with NaN in it."""


class NoSolutionError(WbcError):
    """A problem without a solution; the message names what is in its way."""


LONGEST = 80
"""Longest text of a value in a message, characters."""


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


def one_line(text: str) -> str:
    """Return a text of a file on one line, without characters that steer a terminal."""
    return printable(" ".join(text.split()))


_STEERING = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff\ud800-\udfff]"
)


def shown_path(path: str | Path) -> str:
    """Return a path as messages show it: on one line, of a long one the name of the file alone."""
    whole = shown(str(path))
    return whole if not whole.endswith("...") else shown(Path(path).name)


IN_PLACE_OF = {
    "FrameTask": "PoseTask, PositionTask or OrientationTask",
    "Configuration": "Robot",
    "ConfigurationLimit": "JointLimits",
    "VelocityLimit": "JointLimits",
    "RobotWrapper": "Robot or load_robot",
    "solve_ik": "InverseKinematics",
    "TrialLoop": "Simulation",
    "read_sdf": "an MJCF that sdf2mjcf of sdformat-mjcf makes of the SDF",
    "CollisionHeights": "a CollisionHalfSpace, or boxes",
    "WatchWalk": "MeshcatView, a hook of the walk",
}
"""Names of other libraries, and former ones, with what takes their place."""


def unknown_name(kind: str, name: object, choices: Iterable[str]) -> NoReturn:
    """Raise `UnknownNameError` for a name of a kind ("frame", "joint of the robot") that is not among the choices."""
    names = sorted({*choices})
    given = shown(name).strip("'") if isinstance(name, str) else shown(name)
    near = difflib.get_close_matches(given, names, n=3, cutoff=0.5)
    if near:
        hint = "did you mean " + " or ".join(f"'{n}'" for n in near) + "?"
    elif len(names) <= 20:
        hint = "choices: " + (", ".join(names) or "none")
    else:
        hint = f"there are {len(names)}, among them " + ", ".join(names[:10])
    noun, of, whole = kind.partition(" of ")
    raise UnknownNameError(f"no {noun} '{given}'{of}{whole}; {hint}")


def missing_from(module: str, name: str, rooms: Iterable[str]) -> NoReturn:
    """Raise the `AttributeError` of a package for a name, with what is meant in it or in one of its rooms."""
    said = f"module '{module}' has no attribute '{name}'"
    if name in IN_PLACE_OF:
        raise AttributeError(f"{said}; in its place: {IN_PLACE_OF[name]}", name=name)
    paths = {each: f"{room}.{each}" for room in rooms for each in importlib.import_module(room).__all__}
    paths |= {each: each for each in sys.modules[module].__all__}
    near = [f"'{paths[each]}'" for each in difflib.get_close_matches(name, paths, n=3, cutoff=0.6)]
    raise AttributeError(said + (f"; did you mean {' or '.join(near)}?" if near else ""), name=name)


def former_name(record: Any, name: str) -> NoReturn:
    """Raise the `AttributeError` of a record for a name, with what its class says in `RENAMED` to be in its place."""
    said = f"; in its place: {record.RENAMED[name]}" if name in record.RENAMED else ""
    raise AttributeError(f"{type(record).__name__} has no attribute '{name}'{said}", name=name, obj=record)


def choose(kind: str, name: str, choices: Iterable[str]) -> str:
    """Return a name that is one of the choices; `UnknownNameError` for another."""
    names = list(choices)
    if not isinstance(name, str) or name not in names:
        unknown_name(kind, name, names)
    return name


def names_in(what: str, value: object) -> list[str]:
    """Return names as a list; a single one counts as a list of one."""
    try:
        names: list[Any] = [value] if isinstance(value, str) else list(value)  # type: ignore[call-overload]
    except TypeError:  # no iterable, or an array without axes
        names = [None]
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
