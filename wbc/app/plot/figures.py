"""Ready-made figures by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.figure import Figure

from wbc.app.log.reader import Log, parts_of
from wbc.app.log.stances import stances
from wbc.app.plot.balance import draw_balance, draw_plan
from wbc.app.plot.stiffness import draw_stiffness
from wbc.app.plot.style import as_written
from wbc.base.checked import checked
from wbc.base.errors import InputError, choose
from wbc.core.robot import SIDES

_LOADED_FEET = {"wrench_measured": 6, "estimated/position": 2, "estimated/orientation": 4}
_PLANNED_FEET = {"reference/position": 3, "reference/orientation": 4}

FIGURES: dict[str, tuple[dict[str, int], Callable[[Sequence[Log]], Figure]]] = {
    "balance": (
        {"com/estimated": 2, "zmp/measured": 2}
        | {f"foot/{side}/{what}": size for side in SIDES for what, size in _LOADED_FEET.items()},
        draw_balance,
    ),
    "plan": (
        {"com/reference": 2, "com/estimated": 2, "dcm/estimated": 2, "zmp/measured": 2}
        | {f"foot/{side}/contact": 1 for side in SIDES}
        | {f"foot/{side}/{what}": size for side in SIDES for what, size in _PLANNED_FEET.items()},
        draw_plan,
    ),
    "stiffness": (
        {f"foot/{side}/{what}": 1 for side in SIDES for what in ("stiffness", "stiffness_command")},
        draw_stiffness,
    ),
}
"""Every ready-made figure: signals (1) and vectors (number of parts) that it requires, and the function that draws logs
which have these."""


def missing(name: str, log: Log) -> str | None:
    """Return what a log lacks for a figure; None if it can be drawn."""
    needs, _ = FIGURES[choose("figure", name, FIGURES)]
    for need, size in needs.items():
        absent = [part for part in parts_of(need, size) if part not in log]
        if absent:
            return f"has no {absent[0]}"
    robot = log.header.get("robot")
    if name != "stiffness" and (robot is None or len(robot["soles"]) != len(SIDES)):
        return "is not of a robot with two soles"
    if len(log) < 2:
        return f"has {len(log)} ticks"
    if name == "balance" and not np.isfinite(log.vector("com/estimated", 2)).any():
        return "has no tick with an estimate"
    if name == "plan" and not stances(log):
        return "has no tick in which a foot is planned to stand"
    if name == "stiffness" and not (log["foot/left/stiffness"] > 0.0).any():
        return "is of soles without a stiffness to set"
    return None


@as_written
@checked
def draw(name: str, logs: Log | Sequence[Log]) -> Figure:
    """Draw a ready-made figure, "balance", "plan" or "stiffness", from one or several logs.

    Args:
        name: One of `FIGURES`, for which each log must have the signals.
        logs: One or several logs, which are drawn side by side or in the same axes.
    """
    choose("figure", name, FIGURES)
    logs = [logs] if isinstance(logs, Log) else logs
    if len(logs) == 0:
        raise InputError("a figure needs at least one log")
    for log in logs:
        lack = missing(name, log)
        if lack is not None:
            raise InputError(f"figure '{name}' cannot be drawn: {log.path} {lack}")
    return FIGURES[name][1](logs)
