"""`wbc view`: replay of a recorded run in the browser, as a film, or as a file for Rerun or Foxglove."""

from __future__ import annotations

import sys
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.progress import track

from wbc.app.log.reader import Log
from wbc.app.output import Report, progress_console, reports
from wbc.app.view.base import Port
from wbc.base.errors import InputError
from wbc.base.registry import run_code
from wbc.base.settings import Count, Positive, settings

EXPORTS = (".mp4", ".rrd", ".mcap")


@settings(kw_only=True)
class ViewOptions:
    """Page or file of the replay.

    Attributes:
        out: File to write instead of serving a page: a film, .mp4, or .rrd for Rerun or .mcap for
            Foxglove with all signals.
        port: Port of the page; the first free one from 7000 on when not given.
        rate: Pictures a second of a file.
        speed: Speed of the film: seconds of the run in one second of the film.
        size: Width and height of the film, pixels.
        code: Python file that registers the feet of the log, where they are your own; it is run.
    """

    out: Annotated[Path | None, Parameter(alias="-o")] = None
    port: Port | None = None
    rate: Annotated[Positive, "pictures a second"] = 30.0
    speed: Positive = 1.0
    size: tuple[Count, Count] = (960, 720)
    code: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        ending = None if self.out is None else self.out.suffix.lower()
        if self.out is not None and ending not in EXPORTS:
            raise InputError(
                f"a replay's name must end in one of {', '.join(EXPORTS)}, got '{self.out.name}'"
            )
        if ending != ".mp4" and (self.speed != 1.0 or self.size != (960, 720)):
            raise InputError("speed and size are those of a film: they need --out with .mp4")
        if self.out is not None and self.port is not None:
            raise InputError(f"the port is that of a page that is served, not of '{self.out.name}'")


@reports
def view(
    log: Annotated[Path, Parameter(help="Log to replay, as --record has written it.")],
    /,
    *,
    options: ViewOptions,
) -> Report:
    """Replay a log in the browser with a time slider, or write it as a film, for Rerun or for Foxglove."""
    from wbc.app.replay.convert import convert_log  # noqa: PLC0415 - slow
    from wbc.app.replay.film import render_video  # noqa: PLC0415 - slow
    from wbc.app.replay.replay import Replay  # noqa: PLC0415 - slow

    out = options.out
    run_code(options.code)
    opened = Log.open(log)
    if opened.broken:
        print(f"{log} ends early ({opened.broken}); {len(opened)} ticks are shown", file=sys.stderr)
    facts: dict[str, Any] = {
        "log": str(log),
        "seconds": float(opened.time[-1]) if len(opened) else 0.0,
        "file": None if out is None else str(out),
        "broken": opened.broken,
    }
    if out is None:
        from wbc.app.replay.player import Player  # noqa: PLC0415 - needs an extra

        player = Player(Replay(opened), options.port)
        print(
            f"replay: {player.url} (of this machine alone; from another: ssh -L); Ctrl-C ends it",
            file=sys.stderr,
        )
        with suppress(KeyboardInterrupt):
            player.run()
        player.close()
        return Report(facts | {"url": player.url}, "replay ended")
    console = progress_console()
    bar = partial(
        track, description=out.name, console=console, transient=True, disable=not console.is_terminal
    )
    if out.suffix.lower() != ".mp4":
        reason = convert_log(opened, out, rate=options.rate, progress=bar)
        note = f"; no pictures: {reason}" if reason else ""
        return Report(facts | {"without_scene": reason}, f"{out}: {len(opened)} ticks{note}")
    replay = Replay(opened)
    pictures = render_video(
        replay, out, rate=options.rate, speed=options.speed, size=options.size, progress=bar
    )
    return Report(facts | {"pictures": pictures}, f"{out}: {pictures} pictures")
