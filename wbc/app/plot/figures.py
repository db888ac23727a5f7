"""Ready-made figures by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from matplotlib.figure import Figure

from wbc.app.log.reader import Log
from wbc.app.plot.balance import draw_balance, draw_plan
from wbc.app.plot.signals import draw_signals
from wbc.app.plot.stiffness import draw_stiffness
from wbc.app.plot.torque import draw_torque
from wbc.core.arguments import checked
from wbc.core.errors import InputError, choose
from wbc.core.robot import SIDES


@dataclass(frozen=True)
class LogFigure:
    """A ready-made figure.

    Attributes:
        about: Description.
        needs: Signals or groups that it requires.
        draw: Draws it from logs that have these.
    """

    about: str
    needs: tuple[str, ...]
    draw: Callable[[Sequence[Log]], Figure]


_LOADED_FEET = ("wrench_measured", "estimated/position")
_FEET = ("foot/left/reference/position", "foot/right/reference/position", "foot/left/contact")

FIGURES = {
    "balance": LogFigure(
        "centre of mass, DCM and ZMP in both axes, with the support region, and the DCM's error or the sway",
        (
            "com/estimated",
            "zmp/measured",
            *(f"foot/{side}/{what}" for side in SIDES for what in _LOADED_FEET),
        ),
        draw_balance,
    ),
    "plan": LogFigure(
        "footsteps from above, planned and real, with the paths of centre of mass, DCM and ZMP, and the drift",
        ("com/reference", "zmp/measured", *_FEET),
        draw_plan,
    ),
    "feet": LogFigure(
        "normal forces and ankle moments of the feet, measured and desired",
        ("foot/left/wrench_measured", "foot/right/wrench_measured"),
        partial(draw_signals, words=("foot/*/wrench_[md]e*/fz", "foot/*/wrench_[md]e*/m[xy]")),
    ),
    "torque": LogFigure("joint torques over their limits", ("truth/joint/torque_ratio",), draw_torque),
    "timing": LogFigure(
        "time that the controller's ticks took, by its parts",
        ("tick/solve",),
        partial(
            draw_signals, words=tuple(f"tick/{part}" for part in ("model", "assembly", "solve", "decode"))
        ),
    ),
    "stiffness": LogFigure(
        "stiffness of the soles, commanded and actual, and the ground scanned in each step",
        ("foot/left/stiffness", "foot/right/stiffness"),
        draw_stiffness,
    ),
}
"""Every ready-made figure."""


def missing(name: str, log: Log) -> str | None:
    """Return what a log lacks for a figure; None if it can be drawn."""
    drawing = FIGURES[choose("figure", name, FIGURES)]
    groups = {signal.rpartition("/")[0] for signal in log}
    absent = [need for need in drawing.needs if need not in log and need not in groups]
    if absent:
        return f"has no {absent[0]}"
    if len(log) < 2:
        return f"has {len(log)} ticks"
    if name == "stiffness" and not (log["foot/left/stiffness"] > 0.0).any():
        return "is of soles without a stiffness to set"
    return None


@checked
def draw(name: str, logs: Sequence[Log]) -> Figure:
    """Draw a ready-made figure.

    Args:
        name: One of `FIGURES`.
        logs: One or several logs, drawn side by side or in the same axes.

    Raises:
        UnknownNameError: No such figure.
        InputError: No logs, or one that lacks a required signal.
    """
    choose("figure", name, FIGURES)
    if len(logs) == 0:
        raise InputError("a figure needs at least one log")
    for log in logs:
        lack = missing(name, log)
        if lack is not None:
            raise InputError(f"figure '{name}' cannot be drawn: {log.path} {lack}")
    return FIGURES[name].draw(logs)
