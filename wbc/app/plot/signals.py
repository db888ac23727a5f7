"""Figure of any signals of any logs."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from wbc.app.log.reader import Log
from wbc.app.plot.style import COLOURS, STYLES, as_written, grid, labels, legend, mark_states, new_figure
from wbc.base.checked import checked
from wbc.base.errors import InputError, unknown_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MAX_SIGNALS = 40
"""Largest number of signals that can be told apart in one figure."""


def select(logs: Sequence[Log], words: Sequence[str], figures: Iterable[str] = ()) -> list[str]:
    """Return the signals that words stand for, without repetitions, in the order of the words.

    An error for an unknown word names the nearest signals, groups and figures.
    """
    kinds = {name: signal.kind for log in logs for name, signal in log.signals.items()}
    chosen: dict[str, None] = {}
    for word in words:
        prefix = word.rstrip("/") + "/"
        names = [word] if word in kinds else [name for name in kinds if name.startswith(prefix)]
        names = names or fnmatch.filter(kinds, word)
        if not names:
            groups = {name.rpartition("/")[0] for name in kinds} - {""}
            unknown_name("figure or signal" if figures else "signal", word, {*kinds, *groups, *figures})
        if kinds[names[0]] == "list" and len(names) == 1:
            raise InputError(f"signal '{names[0]}' holds lists and cannot be drawn over time")
        chosen |= dict.fromkeys(name for name in names if kinds[name] != "list")
    if len(chosen) > MAX_SIGNALS:
        raise InputError(
            f"{len(chosen)} signals are too many for one figure, at most {MAX_SIGNALS}: choose fewer"
        )
    return list(chosen)


@as_written
@checked
def draw_signals(logs: Log | Sequence[Log], words: Sequence[str]) -> Figure:
    """Draw signals over time: one panel for each unit, one colour for each signal, one line style for each log.

    Args:
        logs: One or several.
        words: Signals, groups of signals, or patterns with * and ?.
    """
    logs = [logs] if isinstance(logs, Log) else logs
    if len(logs) == 0 or len(words) == 0:
        raise InputError(f"a figure needs at least one {'log' if len(logs) == 0 else 'signal'}")
    names = select(logs, words)
    panels: dict[tuple[str, str], list[str]] = {}
    for name in names:
        signal = next(log.signals[name] for log in logs if name in log)
        key = (name, "") if signal.kind == "text" else ("", signal.unit)
        panels.setdefault(key, []).append(name)
    heights = [1.5 if text else 2.6 for text, _ in panels]
    figure = new_figure(10.0, 1.2 + sum(heights))
    rows = grid(figure, len(panels), 1, sharex=True, height_ratios=heights)
    for (ax,), ((text, unit), members) in zip(rows, panels.items(), strict=True):
        if text:
            _draw_text(ax, logs, text)
        else:
            _draw_numbers(ax, logs, members)
            ax.set_ylabel(members[0] if len(members) == 1 and unit == "1" else f"({unit})")
            if len(members) == 1 and unit != "1":
                ax.set_ylabel(f"{members[0]} ({unit})")
        if len(logs) == 1:
            mark_states(ax, logs[0], names=ax is rows[0][0])
        legend(ax, columns=3)
    rows[-1][0].set_xlabel("time (s)")
    return figure


def _draw_numbers(ax: Axes, logs: Sequence[Log], names: Sequence[str]) -> None:
    # One signal of several logs: a colour for each log; else a colour for each signal.
    by_log = len(names) == 1
    for j, (log, label) in enumerate(zip(logs, labels(logs), strict=True)):
        for i, name in enumerate(names):
            if name not in log:
                continue
            k = j if by_log else i
            style = STYLES[(k // len(COLOURS) if len(logs) == 1 or by_log else j) % len(STYLES)]
            shown = label if by_log and len(logs) > 1 else name if len(logs) == 1 else f"{name}, {label}"
            values = log[name]
            known = np.isfinite(values)
            isolated = known & ~np.roll(known, 1) & ~np.roll(known, -1)
            marker = "." if isolated.any() else ""  # values once a step
            colour, time = COLOURS[k % len(COLOURS)], log.time
            ax.plot(time, values, marker=marker, linestyle=style, color=colour, linewidth=1.0, label=shown)


def _draw_text(ax: Axes, logs: Sequence[Log], name: str) -> None:
    columns = [(log, log.texts(name)) for log in logs if name in log]
    levels = list(dict.fromkeys(t for _, texts in columns for t in texts if t is not None))
    places = {text: i for i, text in enumerate(levels)}
    for j, (log, texts) in enumerate(columns):
        values = np.array([np.nan if text is None else places[text] for text in texts])
        colour, label = COLOURS[j % len(COLOURS)], labels(logs)[j] if len(logs) > 1 else None
        ax.plot(log.time, values + 0.08 * j, ".", markersize=3.0, color=colour, label=label)
    ax.set_yticks(range(len(levels)), levels, fontsize=8)
    ax.set_ylim(-0.5, len(levels) - 0.5)
    ax.set_ylabel(name)
