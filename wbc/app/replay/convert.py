"""Logs for open viewers of robots' data: files of Rerun (RRD, `rerun_file`) and of Foxglove (MCAP, `foxglove`).

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

LogFile = RerunFile | FoxgloveFile

FORMATS: dict[str, tuple[str, type[LogFile]]] = {
    ".rrd": ("rerun", RerunFile),
    ".mcap": ("foxglove", FoxgloveFile),
}
"""Ending of a file → library that it needs, which is the name of the extra, too, and the file of a log."""


@checked
def convert_log(
    log: Log,
    path: str | Path,
    *,
    rate: Annotated[Positive, "1/s"] = 30.0,
    progress: Callable[[Sequence[Any]], Iterable[Any]] = iter,
) -> str | None:
    """Write a log as an RRD file for Rerun, or as an MCAP file for Foxglove.

    Args:
        log: The log, with one tick at least.
        path: File to write, .rrd or .mcap.
        rate: Pictures of the scene per second of the run, Hz; signals keep their own rate.
        progress: Wrapper that shows the progress, as for `render_video`.

    Returns:
        Reason why the file contains only the signals; None if it also contains the scene.
    """
    target = check_target("a converted log", path, tuple(FORMATS), [log.path])
    extra, kind = FORMATS[target.suffix.lower()]
    if importlib.util.find_spec(extra) is None:
        raise InputError(f'{target.name} needs the extra "{extra}": pip install -e ".[{extra}]" in the clone')
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
        file = kind(new, log)
        scene = None if replay is None else file.scene(replay.stage)
        ticks = [] if replay is None else dict.fromkeys(replay.ticks(rate))
        for step in progress([*groups, *ticks]):
            if isinstance(step, str):
                texts = [each for each in groups[step] if each.kind == "text"]
                numbers = [each for each in groups[step] if each.kind not in ("text", "list")]
                if known := [each for each in numbers if np.isfinite(log[each.name]).any()]:
                    file.write_numbers(step, known)
                for signal in texts:  # lists are drawn in the scene
                    file.write_texts(signal.name)
            elif replay is not None and scene is not None:
                scene.draw(replay.picture(step))
        file.close()
    return reason
