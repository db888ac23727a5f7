"""Logs for open viewers of robots' data: files of Rerun (`rerun_file`), and of Foxglove (`foxglove`).

Signals keep their rate; each group, such as `com/estimated`, is one entity. Of a log that can be replayed, the pictures
follow: ground, bodies with their frames, and marks such as contact forces and footsteps. Names hold no spaces.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from wbc.app.log.reader import Log
from wbc.app.log.signals import Signal
from wbc.app.replay.foxglove import FoxgloveFile
from wbc.app.replay.replay import Replay
from wbc.app.replay.rerun_file import RerunFile
from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.files import check_target, replacing
from wbc.base.settings import Positive

VIEWERS = {".rrd": ("rerun", "rerun"), ".mcap": ("foxglove", "foxglove")}
"""Ending of a file → the module that writes it, and the extra that brings this module."""

RATE = 30.0
"""Rate at which the scene is written, 1/s."""


def check_conversion(path: str | Path, inputs: Iterable[str | Path] = ()) -> Path:
    """Return the path of a file to convert to, after `check_target` and a check that its writer is there."""
    target = check_target("a converted log", path, tuple(VIEWERS), inputs)
    module, extra = VIEWERS[target.suffix.lower()]
    if importlib.util.find_spec(module) is None:
        raise InputError(f'{target.name} needs the extra "{extra}": pip install -e ".[{extra}]" in the clone')
    return target


@checked
def convert_log(
    log: Log,
    path: str | Path,
    *,
    rate: Annotated[Positive, "1/s"] = RATE,
    progress: Callable[[Sequence[Any]], Iterable[Any]] = iter,
) -> str | None:
    """Write a log as an RRD file for Rerun, or as an MCAP file for Foxglove.

    Args:
        log: The log.
        path: File to write, .rrd or .mcap.
        rate: Pictures of the scene per second of the run, Hz; signals keep their own rate.
        progress: Wrapper that shows the progress, as for `render_video`.

    Returns:
        Reason why the file contains only the signals; None if it also contains the scene.
    """
    target = check_conversion(path, [log.path])
    if not len(log):
        raise InputError(f"{log.path} holds no ticks; there is nothing to convert")
    reason = replay = None
    try:
        replay = Replay(log)
    except InputError as error:
        reason = str(error)
    groups: dict[str, list[Signal]] = {}
    for name, signal in log.signals.items():
        if name != "time":
            groups.setdefault(name.rpartition("/")[0] or name, []).append(signal)
    with replacing(target) as new:
        file: Any = (RerunFile if target.suffix.lower() == ".rrd" else FoxgloveFile)(new, log)
        try:
            for name, signals in progress(list(groups.items())):
                if numbers := with_numbers(log, signals):
                    file.write_numbers(name, numbers)
                for signal in signals:
                    if signal.kind == "text":  # lists are drawn in the scene
                        file.write_texts(signal.name)
            if replay is not None:
                file.write_scene(replay, rate)
        finally:
            file.close()
    return reason


def with_numbers(log: Log, signals: Sequence[Signal]) -> list[Signal]:
    """Return the signals that have a number in at least one tick."""
    return [s for s in signals if s.kind not in ("text", "list") and np.isfinite(log[s.name]).any()]
