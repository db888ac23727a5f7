"""Output of a command: a text or one JSON object on stdout, everything else on stderr."""

from __future__ import annotations

import functools
import json
import logging
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

from pydantic_core import to_jsonable_python
from rich.console import Console

from wbc.app.arguments import with_options
from wbc.base.errors import WbcError, printable
from wbc.base.settings import settings


@settings(kw_only=True)
class Output:
    """Options of the output of every command.

    Attributes:
        json: Print one JSON object instead of a text.
        verbose: Log more on stderr.
    """

    json: bool = False
    verbose: bool = False


class Report(NamedTuple):
    """Report of a command that has ended.

    Attributes:
        data: Result as plain values.
        text: Result as text.
        failure: Failure of a part, such as a recording, which is raised after the result has been printed.
    """

    data: Mapping[str, Any]
    text: str
    failure: WbcError | None = None


def facts_text(facts: Mapping[str, Any], group: str = "") -> str:
    """Return plain values as text: a name and a value a line, SI units unless the name says one; no lists of lists."""
    lines = []
    for key, value in facts.items():
        values = value if isinstance(value, list) else [value]
        if isinstance(value, dict):
            lines.append(facts_text(value, f"{group}{key}."))
        elif not any(isinstance(each, list | None) for each in values):
            shown = (f"{each:.4g}" if isinstance(each, float) else str(each) for each in values)
            lines.append(f"{group + key:<28} {' '.join(shown)}")
    return "\n".join(lines)


def reports(function: Callable[..., Report]) -> Callable[..., None]:
    """Make a command of a function that returns a report: it has the options of `Output`, too; see `with_options`."""

    @functools.wraps(function)
    def run(*args: Any, output: Output, **values: Any) -> None:
        handler = logging.StreamHandler()
        handler.setFormatter(_Lines("%(levelname)s %(name)s: %(message)s"))
        logging.basicConfig(level=logging.INFO if output.verbose else logging.WARNING, handlers=[handler])
        logging.captureWarnings(True)
        warnings.formatwarning = lambda message, *_, **__: str(message)  # without the line that raised it
        with stdout_on_stderr():
            report = function(*args, **values)
        if output.json:  # NaN and infinity as null
            print(json.dumps(to_jsonable_python(report.data, inf_nan_mode="null")))
        else:
            print(printable(report.text))
        if report.failure is not None:
            raise report.failure

    return with_options(run, output=Output)


class _Lines(logging.Formatter):
    """Formatter of messages for a terminal, which none of them steers."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the text of a message."""
        return printable(super().format(record))


@contextmanager
def stdout_on_stderr() -> Iterator[None]:
    """Send everything that is written to stdout to stderr instead."""
    print(end="", flush=True)  # there may be no stdout
    python_stdout, sys.stdout = sys.stdout, sys.stderr
    try:
        saved = os.dup(1)
    except OSError:  # there is no stdout
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


def progress_console() -> Console:
    """Return the console for progress bars, on stderr."""
    return Console(stderr=True)
