"""Plain JSON values of frozen dataclasses, and back: the form in which a log holds the parts of a plant.

Classes of this library are written as `wbc:Name` and found by their names alone, so that logs outlive a move between
modules; other classes as `module:Name`. What is read from a file is data: only dataclasses and enumerations of this
library, or of modules that the program has imported itself, are made from it, and their own checks run.
"""

from __future__ import annotations

import base64
import enum
import importlib
import math
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wbc.core.errors import InputError, unknown_name

ROOMS = ("wbc.robots", "wbc.feet", "wbc.sim")
"""Packages whose classes make up a plant; imported when a log names a class of this library."""


def to_plain(value: Any) -> Any:
    """Return a value as objects, lists, numbers and texts; keys with a `$` name its type.

    What is no number, text, array, path, enumeration or dataclass, nor a tuple, list or mapping of these, is written as
    its `repr` and cannot be read back.
    """
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, enum.Enum):
        return {"$enum": _name(type(value)), "name": value.name}
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        number = float(value)
        return number if math.isfinite(number) else {"$float": repr(number)}
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        return {
            "$array": str(value.dtype.str),
            "shape": list(value.shape),
            "data": _text(np.ascontiguousarray(value).tobytes()),
        }
    if isinstance(value, bytes):
        return {"$bytes": _text(value)}
    if isinstance(value, Path):
        return {"$path": str(value)}
    if is_dataclass(value) and not isinstance(value, type):
        parts = {f.name: to_plain(getattr(value, f.name)) for f in fields(value) if f.init}
        return {"$class": _name(type(value)), **parts}
    if isinstance(value, Mapping) and all(isinstance(key, str) and key[:1] != "$" for key in value):
        return {key: to_plain(item) for key, item in value.items()}
    if isinstance(value, tuple):
        return {"$tuple": [to_plain(item) for item in value]}
    if isinstance(value, list):
        return [to_plain(item) for item in value]
    return {"$text": repr(value)}


def from_plain(plain: Any) -> Any:
    """Return the value that `to_plain` was given.

    A value written as its `repr`, or a class that does not exist or does not take these values, is an `InputError`.
    """
    if isinstance(plain, list):
        return [from_plain(item) for item in plain]
    if not isinstance(plain, dict):
        return plain
    tag = next((key for key in plain if key.startswith("$")), None)
    if tag is None:
        return {key: from_plain(item) for key, item in plain.items()}
    content = plain[tag]
    try:
        if tag == "$class":
            parts = {key: from_plain(item) for key, item in plain.items() if key != tag}
            kind = _kind(content)
            if is_dataclass(kind):
                make: Any = kind
                return make(**parts)
        if tag == "$enum":
            kind = _kind(content)
            if issubclass(kind, enum.Enum):
                return kind[plain["name"]]
        if tag == "$float":
            return float(content)
        if tag == "$array":
            data = np.frombuffer(base64.b64decode(plain["data"]), content)
            return data.reshape(plain["shape"]).copy()
        if tag == "$bytes":
            return base64.b64decode(content)
        if tag == "$path":
            return Path(content)
        if tag == "$tuple":
            return tuple(from_plain(item) for item in content)
    except (TypeError, ValueError, KeyError, AttributeError) as error:
        raise InputError(f"{content} cannot be made from what the log says: {error}") from error
    raise InputError(f"the log keeps only the text of a value: {content}")


def _name(kind: type) -> str:
    module = kind.__module__
    return f"{'wbc' if module.split('.')[0] == 'wbc' else module}:{kind.__qualname__}"


def _kind(name: str) -> Any:
    """Return the class of a name."""
    module, _, path = name.partition(":")
    if module == "wbc":
        return _class_of_wbc(path)
    if module not in sys.modules:
        raise InputError(f"the log needs {name}; import {module} first")
    kind: Any = sys.modules[module]
    for part in path.split("."):
        kind = getattr(kind, part)
    if not isinstance(kind, type):
        raise InputError(f"{name} is no class")
    return kind


def _class_of_wbc(name: str) -> type:
    """Return the dataclass or enumeration of this library that has a name, whatever module it is in."""
    for room in ROOMS:
        importlib.import_module(room)
    modules = [module for key, module in sys.modules.items() if key.startswith("wbc.")]
    kinds = {
        kind.__qualname__: kind
        for module in modules
        for kind in vars(module).values()
        if isinstance(kind, type) and (is_dataclass(kind) or issubclass(kind, enum.Enum))
        if kind.__module__ == module.__name__
    }
    return kinds.get(name) or unknown_name("class of wbc", name, kinds)


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
