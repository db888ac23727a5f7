"""Ready-made figures by name, and their files."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.text import Text

from wbc.app.files import PICTURES
from wbc.app.log.reader import Log, parts_of
from wbc.app.log.stances import stances
from wbc.app.plot.balance import draw_balance, draw_plan
from wbc.app.plot.stiffness import draw_stiffness
from wbc.app.plot.style import as_written
from wbc.base.checked import checked
from wbc.base.errors import InputError, choose, printable
from wbc.base.files import check_target, replacing, save_figure
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


def save(figures: Mapping[str, Figure], path: str | Path) -> list[Path]:
    """Write figures: several into the pages of one PDF, or into files whose names end in theirs.

    Args:
        figures: Figures by name.
        path: File to write; its ending selects the format.

    Returns:
        The written files.

    Raises:
        FileError: The disk is full, for example.
    """
    target = check_target("a picture", path, PICTURES)
    for text in (text for figure in figures.values() for text in figure.findobj(Text)):
        if (shown := printable(text.get_text())) != text.get_text():  # of a file of somebody else
            text.set_text(shown)
    if target.suffix.lower() == ".pdf":
        document = io.BytesIO()
        with PdfPages(document) as pages:
            for figure in figures.values():
                pages.savefig(figure)
        with replacing(target) as new:
            new.write_bytes(document.getvalue())
        return [target]
    written = []
    for name, figure in figures.items():
        place = target if len(figures) == 1 else target.with_name(f"{target.stem}-{name}{target.suffix}")
        save_figure(figure, place, dpi=130)
        written.append(place)
    return written
