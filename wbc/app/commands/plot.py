"""`wbc plot`: figures from logs."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from wbc.app.files import PICTURES
from wbc.app.log.reader import Log
from wbc.app.output import Report, reports
from wbc.base.errors import InputError
from wbc.base.files import check_target
from wbc.base.settings import settings

logger = logging.getLogger(__name__)


@settings(kw_only=True)
class PlotOptions:
    """File of the figures.

    Attributes:
        out: File to write, ending in .png, .pdf, .svg or .jpg; several figures become the pages of one PDF, or files
            whose names end in theirs. The name of the log with .png when not given.
        list: Name the signals of the logs instead of drawing.
    """

    out: Annotated[Path | None, Parameter(alias="-o")] = None
    list: bool = False


@reports
def plot(
    *words: Annotated[str, Parameter(help="Logs, then what to draw.", show_default=False)],
    options: PlotOptions,
) -> Report:
    """Draw figures from one log, or compare several: balance, plan, stiffness, any signals.

    Logs come first; all but the first one end in .arrow. Then come ready-made figures, or signals: a name, the
    beginning of names such as `com/estimated`, or a pattern such as `"joint/torque_command/*knee*"`. Without any of
    them, all figures are drawn for which the logs have signals.
    """
    paths = [Path(word) for i, word in enumerate(words) if i == 0 or word.endswith(".arrow")]
    if not paths:
        raise InputError("a log is needed: wbc plot FILE [SIGNAL …]")
    drawings = [word for word in words if Path(word) not in paths]
    logs = [Log.open(path) for path in paths]
    notes = [f"{log.path} ends early ({log.broken}); {len(log)} ticks are read" for log in logs if log.broken]
    if options.list:
        return _listing(logs, notes)

    from wbc.app.plot.figures import FIGURES, draw, missing, save  # noqa: PLC0415 - slow to import
    from wbc.app.plot.signals import draw_signals, select  # noqa: PLC0415 - slow to import

    figures = [word for word in drawings if word in FIGURES]
    signals = [word for word in drawings if word not in FIGURES]
    target = check_target("a picture", options.out or f"{logs[0].path.stem}.png", PICTURES, paths)
    select(logs, signals, FIGURES)
    if not drawings:
        figures = [name for name in FIGURES if all(missing(name, log) is None for log in logs)]
        if not figures:
            raise InputError("no ready-made figure can be drawn of these logs; --list names their signals")
    drawn = {name: draw(name, logs) for name in figures}
    if signals:
        drawn["signals"] = draw_signals(logs, signals)
    written = save(drawn, target)
    facts = {
        "logs": [str(path) for path in paths],
        "figures": list(drawn),
        "files": [str(path) for path in written],
        "notes": notes,
    }
    for note in notes:
        logger.warning("%s", note)
    return Report(facts, "\n".join(str(path) for path in written))


def _listing(logs: Sequence[Log], notes: list[str]) -> Report:
    signals = {name: signal for log in logs for name, signal in log.signals.items()}
    width = max(len(name) for name in signals)
    lines = [f"{log!r}" for log in logs] + notes
    lines += [f"{name:<{width}}  {signal.unit:<7} {signal.about}" for name, signal in signals.items()]
    facts = {
        "logs": [
            {
                "file": str(log.path),
                "ticks": len(log),
                "broken": log.broken,
                # without the models of plant and robot, which only a replay needs
                "header": {k: v for k, v in log.header.items() if k not in ("plant", "description")},
            }
            for log in logs
        ],
        "signals": [
            {"name": name, "unit": signal.unit, "about": signal.about, "kind": signal.kind}
            for name, signal in signals.items()
        ],
    }
    return Report(facts, "\n".join(lines))
