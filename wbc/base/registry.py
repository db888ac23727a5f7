"""Registry: robots, feet, grounds, policies and trials by name, with the same errors everywhere."""

from __future__ import annotations

import contextlib
import importlib.util
import inspect
import logging
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import fields, is_dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from wbc.base.checked import names_of
from wbc.base.errors import InputError, WbcError, choose, shown, unknown_name
from wbc.base.files import existing, file_hash, home_path

logger = logging.getLogger(__name__)

T = TypeVar("T")

HASH_LENGTH = 12
"""Hex digits of the hash of a file in the name of an entry of this file."""


_allowed: set[str] = set()  # files of code that a user named
_of_data: ContextVar[bool] = ContextVar("of_data", default=False)


@contextlib.contextmanager
def reading_data() -> Iterator[None]:
    """Take the names of the block for data's, which run no file of code but those that a user has named."""
    before = _of_data.set(True)
    try:
        yield
    finally:
        _of_data.reset(before)


def is_data() -> bool:
    """Return True in a block of `reading_data`."""
    return _of_data.get()


def code_of(*values: Any) -> Iterator[str]:
    """Yield the files of code that values name as "mine.py:NAME" or "mine.py", and all paths in them."""
    for value in values:
        if isinstance(value, (Mapping, list, tuple)):
            yield from code_of(*(value.values() if isinstance(value, Mapping) else value))
        elif isinstance(value, Path) or str(value).endswith(".py"):
            yield str(value)
        elif in_file(value):
            yield value.rpartition(":")[0]


def allow_code(*values: Any) -> None:
    """Let the files of code that values name, or are the paths of, be run where data name them, too."""
    places = map(home_path, code_of(*values))
    _allowed.update(str(place.resolve()) for place in places if os.path.isfile(place))


def run_code(files: Sequence[Path]) -> None:
    """Run Python files that a user has named, for what they register; each once."""
    allow_code(files)
    for path in files:
        place = existing(path, "Python", "one that registers something")
        _module(str(place.resolve()), file_hash(place)[:HASH_LENGTH])


class Registry(dict[str, T]):
    """A dictionary of names whose missing names raise an error with the nearest known ones.

    Other packages offer further names by entry points, which are loaded when one is used.

    Attributes:
        kind: The noun of its messages: "robot", "foot", "terrain", …
        group: Group of the entry points; None for a registry that has none.
    """

    def __init__(
        self,
        kind: str,
        entries: Mapping[str, T] | None = None,
        *,
        group: str | None = None,
        check: Callable[[T], object] | None = None,
    ) -> None:
        """Begin with some entries; `check` raises an `InputError` for a value that is none of its kind."""
        super().__init__(entries or {})
        self.kind, self.group, self._check = kind, group, check

    def __missing__(self, name: str) -> T:
        offered = self.offered()
        if name not in offered:
            if str(name).endswith(".py"):
                raise InputError(f"a {self.kind} in a file is named as {name}:NAME")
            unknown_name(self.kind, name, self.names())
        point = offered[name]
        try:
            value = point.load()
            if not dict.__contains__(self, name):  # a module may register what it defines
                self.add(name, value)
        except Exception as error:  # whatever a module of somebody else raises
            package = point.dist.name if point.dist is not None else "?"
            raise InputError(
                f"the {self.kind} '{name}' of package '{package}' cannot be loaded from {point.value} (entry point of "
                f"{self.group}): {type(error).__name__}: {error}"
            ) from error
        return self[name]

    def __setitem__(self, name: str, value: T) -> None:
        if not isinstance(name, str) or not name.strip():
            raise InputError(f"the name of a {self.kind} must be text, got {shown(name)}")
        if self._check is not None:
            self._check(value)
        super().__setitem__(name, value)

    def offered(self) -> Mapping[str, EntryPoint]:
        """Return the names that other packages offer beside those that are here → entry point, not loaded."""
        found = {} if self.group is None else _offered(self.group, tuple(sys.path))
        return {name: point for name, point in found.items() if name not in self}

    def names(self) -> tuple[str, ...]:
        """Return all names, those of other packages last."""
        return (*self, *self.offered())

    def find(self, name: str) -> tuple[str, T]:
        """Return an entry, and its name as a spec keeps it: that of a file has the hash of the file behind it.

        Args:
            name: A name, or a file and a name in it, such as "mine.py:NAME". "#" and the hash of the file may follow.

        Raises:
            InputError: The name is unknown, or the file cannot be run, has changed since the spec was made, or does
                not have the name, or has no such entry under it, or data name it and no user does.
        """
        if not in_file(name) or name in self:
            return name, self[name]
        place, _, attribute = name.rpartition(":")
        attribute, _, given = attribute.partition("#")
        path = existing(place, "Python", f"one with the {self.kind}")
        if not is_data():
            allow_code(path)
        elif str(path.resolve()) not in _allowed:
            raise InputError(
                f"the {self.kind} {shown(name)} is code, which data name and no reader runs; if you know the file, "
                "name it with --code, or in a program with wbc.base.registry.allow_code"
            )
        now = file_hash(path)[:HASH_LENGTH]
        if given and given != now:
            raise InputError(
                f"{self.kind} {place} has changed: a spec has its content {given}, now it is {now}"
            )
        module = _module(str(path.resolve()), now)
        value = getattr(module, attribute, None)
        if value is None:
            unknown_name(f"{self.kind} of {place}", attribute, [key for key in vars(module) if key[0] != "_"])
        if self._check is not None:
            self._check(value)
        return f"{place}:{attribute}#{now}", value

    def loaded(self) -> Mapping[str, T]:
        """Return all entries, those of other packages loaded; one that cannot be is left out with a warning."""
        for name in self.offered():
            try:
                self[name]
            except InputError as error:
                logger.warning("%s", error)
        return self

    def add(self, name: str, value: T) -> None:
        """Register a value under a new name; `InputError` if that is not text, is empty or is taken.

        What is defined anew in the same place, as by a cell of a notebook that runs again, takes the place of its past.
        """
        if isinstance(name, str) and name in self and _place(self[name]) != _place(value):
            raise InputError(
                f"a {self.kind} '{name}' is registered already, by another part of the program; take another name"
            )
        self[name] = value


def _place(value: Any) -> Any:
    """Return module and name of a class or a function; of a record those of its parts."""
    if is_dataclass(value) and not isinstance(value, type):
        return type(value), *(_place(getattr(value, part.name)) for part in fields(value))
    return getattr(value, "__module__", None), getattr(value, "__qualname__", None)


def first_line(kind: object) -> str:
    """Return the first line of the documentation of a class."""
    return (inspect.getdoc(kind) or "").splitlines()[0]


def call_checked(what: str, make: Callable[..., T], parameters: Mapping[str, Any]) -> T:
    """Call a function, `what` in messages, with named parameters, after a check that they fit."""
    known = inspect.signature(make).parameters.values()
    for name in parameters:
        choose(f"parameter of the {what}", name, names_of(make) or parameters)
    for parameter in known:
        needed = parameter.default is parameter.empty and parameter.kind is not parameter.VAR_KEYWORD
        if needed and parameter.name not in parameters:
            raise InputError(f"the {what} needs a value for '{parameter.name}'")
    try:
        return make(**parameters)
    except (TypeError, AttributeError, LookupError) as error:  # of a value of another kind
        if isinstance(error, WbcError):
            raise
        raise InputError(f"the {what} cannot use {shown(dict(parameters))}: {error}") from error


def in_file(name: object) -> bool:
    """Return True for the name of an entry in a Python file, such as "mine.py:NAME"."""
    return isinstance(name, str) and ".py:" in name


@cache
def _module(path: str, content: str) -> ModuleType:
    """Return the module of a file, run once for each content; it may import what lies beside it."""
    name = f"wbc_file_{Path(path).stem}_{content}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise InputError(f"{path} is no Python file")
    module, folder = importlib.util.module_from_spec(spec), str(Path(path).parent)
    sys.path.append(folder)
    sys.modules[name] = module  # where dataclasses look up their annotations
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # whatever a file of somebody else raises
        del sys.modules[name]
        if isinstance(error, WbcError):
            raise
        raise InputError(f"{path} cannot be run: {type(error).__name__}: {error}") from error
    finally:
        sys.path.remove(folder)
    return module


@cache
def _offered(group: str, path: tuple[str, ...]) -> Mapping[str, EntryPoint]:
    """Return name → entry point of a group; looked up anew when the search path has changed."""
    return {point.name: point for point in entry_points(group=group)}
