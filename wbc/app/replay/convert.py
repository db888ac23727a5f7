"""Logs for other viewers: MCAP, which Foxglove and Lichtblick open, and RRD, which Rerun opens.

Signals keep their rate; each group, such as `com/estimated`, is one topic or entity. Of a log that can be replayed, the
scene follows: ground, bodies with their frames, contact forces, footsteps. Names hold no spaces.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

from wbc.app.files import check_target
from wbc.app.log.reader import Log
from wbc.app.replay.convert_mcap import write_mcap
from wbc.app.replay.convert_rrd import write_rrd
from wbc.app.replay.groups import Progress
from wbc.app.replay.replay import Replay
from wbc.core.arguments import checked
from wbc.core.errors import InputError
from wbc.core.files import replacing
from wbc.core.settings import Positive

CONVERSIONS = (".mcap", ".rrd")
"""Endings of the files that logs are converted to."""

RATE = 30.0
"""Rate at which the scene is written, 1/s."""

_EXTRAS = {".mcap": ("mcap", "mcap"), ".rrd": ("rerun", "rerun")}
"""Ending → module that writes it, and extra that brings the module."""


def check_conversion(path: str | Path, inputs: Iterable[str | Path] = ()) -> Path:
    """Return the path of a file to convert to, after a check that it can be written here.

    Args:
        path: File to write.
        inputs: Files that it is made from.

    Raises:
        InputError: Another file type, no such folder, not writable, one of the inputs, or a format whose package is
            not installed.
    """
    target = check_target("a converted log", path, CONVERSIONS, inputs)
    package, extra = _EXTRAS[target.suffix.lower()]
    if importlib.util.find_spec(package) is None:
        raise InputError(f'{target.name} needs the extra "{extra}": pip install -e ".[{extra}]" in the clone')
    return target


@checked
def convert_log(
    log: Log, path: str | Path, *, rate: Annotated[Positive, "1/s"] = RATE, progress: Progress | None = None
) -> str | None:
    """Write a log as MCAP or RRD.

    Args:
        log: The log.
        path: File to write, .mcap or .rrd.
        rate: Pictures of the scene for each second of the run, 1/s; signals keep their own.
        progress: Called with the number of finished ticks or groups and of all.

    Returns:
        Reason why the file holds the signals alone; None if it holds the scene, too.

    Raises:
        InputError: As `check_conversion` raises it, a rate that is not above zero, or an empty log.
    """
    target = check_conversion(path, [log.path])
    if not len(log):
        raise InputError(f"{log.path} holds no ticks; there is nothing to convert")
    reason = replay = None
    try:
        replay = Replay(log)
    except InputError as error:
        reason = str(error)
    with replacing(target) as new:
        write = write_mcap if target.suffix.lower() == ".mcap" else write_rrd
        write(log, replay, new, rate, progress or (lambda done, of: None))
    return reason
