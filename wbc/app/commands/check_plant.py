"""`wbc check-plant`: a loop of one's own, checked for what it measures and how it obeys."""

from __future__ import annotations

import importlib
import runpy
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from wbc.app.output import Output, Report, reports
from wbc.core.errors import InputError, WbcError
from wbc.core.settings import to_json
from wbc.machine import conformance
from wbc.robots import load
from wbc.sim import Plant


class NonConformingError(WbcError):
    """A loop that does not measure or obey as it should."""


@reports
def check_plant(
    loop: Annotated[
        str | None,
        Parameter(
            help="Function that returns the loop, as module:name or file.py:name; a plant when left out."
        ),
    ] = None,
    /,
    *,
    robot: Annotated[str, Parameter(help="Robot of the plant.")] = "hrp4_class",
    delay: Annotated[float, Parameter(help="Delay that the loop is known to have, s.")] = 0.0,
    output: Output,
) -> Report:
    """Check a loop by exciting it a little: order, signs, units, frames, gains, delay and clock, each by name."""
    made: Any = Plant(load(robot), control_period=0.002) if loop is None else _made(loop)
    report = conformance(made, delay=delay)
    wrong = [check.name for check in report.wrong]
    text = f"{report}\n{len(report.checks)} checks, " + (
        f"WRONG: {', '.join(wrong)}" if wrong else "nothing wrong"
    )
    failure = NonConformingError(f"wrong: {', '.join(wrong)}") if wrong else None
    return output.report({"ok": report.ok, "checks": to_json(list(report.checks))}, text, failure)


def _made(name: str) -> Any:
    """Return the loop that a function with a name such as module:name or file.py:name returns."""
    module, _, function = name.rpartition(":")
    if not module:
        raise InputError(f"a loop is given as module:name or file.py:name of a function, got '{name}'")
    try:
        if module.endswith(".py"):
            make = runpy.run_path(str(Path(module).expanduser()))[function]
        else:
            make = getattr(importlib.import_module(module), function)
    except Exception as error:  # whatever the user's own file raises
        raise InputError(
            f"there is no function '{name}' that returns a loop: {type(error).__name__}: {error}"
        ) from error
    try:
        return make()
    except WbcError:
        raise
    except Exception as error:  # of the user's own program
        raise InputError(f"'{name}' returns no loop: {type(error).__name__}: {error}") from error
