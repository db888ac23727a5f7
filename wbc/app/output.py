"""What a command prints: a report for people or one JSON object on stdout, everything else on stderr."""

from __future__ import annotations

import functools
import json
import logging
import math
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ParamSpec, TypeVar

from cyclopts import Parameter
from rich.console import Console

P = ParamSpec("P")
T = TypeVar("T")

Flat = Annotated[T, Parameter(name="*")]
"""Options of a command: each field of the configuration class is an option of its own."""


@dataclass(frozen=True, kw_only=True)
class Output:
    """How a command reports.

    Attributes:
        json: Print one JSON object on stdout instead of a text.
        verbose: Log more on stderr.
    """

    json: bool = False
    verbose: bool = False

    def report(self, data: Mapping[str, Any], text: str) -> Report:
        """Make the report of a command that has ended.

        Args:
            data: The result as plain values; NaN and infinity become null.
            text: The same for people.
        """
        return Report(dict(data), text, self.json)


OutputOptions = Annotated[Output, Parameter(name="*")]
"""Every command takes it as `output`."""


@dataclass(frozen=True)
class Report:
    """What a command has to say.

    Attributes:
        data: Plain values.
        text: The same for people.
        as_json: Which of the two is printed.
    """

    data: dict[str, Any] = field(default_factory=dict)
    text: str = ""
    as_json: bool = False

    def __str__(self) -> str:
        return json.dumps(_plain(self.data), allow_nan=False) if self.as_json else self.text


def reports(function: Callable[P, Report]) -> Callable[P, None]:
    """Make a command of a function that returns a report.

    While it runs, whatever is written to stdout (by C++ libraries, too) goes to stderr; then the report is printed.
    """

    @functools.wraps(function)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        output = kwargs.get("output")
        verbose = isinstance(output, Output) and output.verbose
        logging.basicConfig(
            level=logging.INFO if verbose else logging.WARNING, format="%(levelname)s %(name)s: %(message)s"
        )
        logging.captureWarnings(True)
        warnings.formatwarning = _what_it_says
        with stdout_on_stderr():
            report = function(*args, **kwargs)
        print(report)

    return run


@contextmanager
def stdout_on_stderr() -> Iterator[None]:
    """Send everything that is written to stdout to stderr instead."""
    sys.stdout.flush()
    python_stdout, sys.stdout = sys.stdout, sys.stderr
    try:
        saved = os.dup(1)
    except OSError:  # no stdout at all
        saved = None
    if saved is not None:
        os.dup2(2, 1)
    try:
        yield
    finally:
        sys.stdout = python_stdout
        if saved is not None:
            os.dup2(saved, 1)
            os.close(saved)


def _what_it_says(message: Warning | str, *where: object, **line: object) -> str:
    """A warning for people: where it was raised is not what they want to know."""
    del where, line
    return str(message)


def progress_console() -> Console:
    """Console for progress: on stderr."""
    return Console(stderr=True)


def _plain(value: Any) -> Any:
    """Values that JSON knows: tuples as lists, paths as text, NaN and infinity as null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Path):
        return str(value)
    return value
