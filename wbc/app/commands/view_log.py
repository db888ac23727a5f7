"""`wbc view` and `wbc log`: replay of a recorded run, and conversion for Rerun."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.progress import Progress

from wbc.app.address import Address, Host, Port
from wbc.app.files import FILMS, check_target
from wbc.app.log.reader import Log
from wbc.app.output import Flat, Output, OutputOptions, Report, progress_console, reports
from wbc.core.errors import InputError
from wbc.core.files import write_text
from wbc.core.settings import Count, Positive, settings

EXPORTS = (".html", *FILMS)


@settings(kw_only=True)
class ViewOptions:
    """Page or file of the replay.

    Attributes:
        out: File to write instead of serving a page: .html (one page that opens offline), .mp4 or .gif.
        host: Address to listen at; the default is reached from this machine alone, 0.0.0.0 from everywhere.
        port: Port of the page; the first free one from 7000 on when not given.
        rate: Pictures a second; a GIF has at most 20.
        speed: Seconds of the run in a second of the film.
        size: Width and height of the film, pixels.
    """

    out: Annotated[Path | None, Parameter(alias="-o")] = None
    host: Host = "127.0.0.1"
    port: Port | None = None
    rate: Annotated[Positive, "pictures a second"] = 30.0
    speed: Positive = 1.0
    size: tuple[Count, Count] = (960, 720)

    def __post_init__(self) -> None:
        if self.out is not None and self.out.suffix.lower() not in EXPORTS:
            raise InputError(
                f"a replay's name must end in one of {', '.join(EXPORTS)}, got '{self.out.name}'"
            )
        film = self.out is not None and self.out.suffix.lower() in FILMS
        if not film and (self.speed != 1.0 or self.size != (960, 720)):
            raise InputError(f"speed and size are those of a film: they need --out with {' or '.join(FILMS)}")
        if self.out is not None and (self.port is not None or self.host != "127.0.0.1"):
            raise InputError(f"host and port are those of a page that is served, not of '{self.out.name}'")


@reports
def view(
    log: Annotated[Path, Parameter(help="Log to replay, as --record has written it.")],
    /,
    *,
    options: Flat[ViewOptions] = ViewOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Replay a log in the browser with a time slider, or write it as a page or a film."""
    from wbc.app.replay.film import check_film, render_video  # noqa: PLC0415 - slow
    from wbc.app.replay.page import replay_page  # noqa: PLC0415 - slow
    from wbc.app.replay.replay import Replay  # noqa: PLC0415 - slow
    from wbc.app.view.guard import PageServer, new_nonce  # noqa: PLC0415

    opened = Log.open(log)
    if opened.broken:
        print(f"{log} ends early ({opened.broken}); {len(opened)} ticks are shown", file=sys.stderr)
    out, server, nonce = options.out, None, ""
    film = out is not None and out.suffix.lower() in FILMS
    if out is None:
        server, nonce = PageServer("replay", Address(options.host, options.port)), new_nonce()
    elif film:
        check_film(out, [log])
    else:
        check_target("a page", out, EXPORTS, [log])
    replay = Replay(opened)
    with _bar("filming" if film else "preparing") as progress:
        if out is not None and film:
            pictures = render_video(
                replay, out, rate=options.rate, speed=options.speed, size=options.size, progress=progress
            )
        else:
            pictures = len(replay.ticks(options.rate))
            page = replay_page(replay, rate=options.rate, progress=progress, nonce=nonce)
    if server is not None:
        server.serve_page(page, nonce)
    elif out is not None and not film:
        write_text(out, page)
    facts = {
        "log": str(log),
        "seconds": float(opened.time[-1]),
        "pictures": pictures,
        "file": None if out is None else str(out),
        "url": None if server is None else server.served.url,
        "broken": opened.broken,
    }
    return output.report(facts, f"{out}: {pictures} pictures" if out is not None else "replay ended")


@settings(kw_only=True)
class ConvertOptions:
    """Scene of a converted log.

    Attributes:
        rate: Rate of the scene, pictures a second; signals keep their own.
    """

    rate: Annotated[Positive, "pictures a second"] = 30.0


@reports
def convert(
    log: Annotated[Path, Parameter(help="Log to convert, as --record has written it.")],
    out: Annotated[Path, Parameter(help="File to write, .rrd.")],
    /,
    *,
    options: Flat[ConvertOptions] = ConvertOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Write a log, its signals and its scene, for Rerun, an open viewer of robots' data."""
    from wbc.app.replay.convert import check_conversion, convert_log  # noqa: PLC0415 - slow

    check_conversion(out, [log])
    opened = Log.open(log)
    with _bar("converting") as progress:
        reason = convert_log(opened, out, rate=options.rate, progress=progress)
    facts = {"log": str(log), "file": str(out), "without_scene": reason, "broken": opened.broken}
    notes = [f"; no scene: {reason}"] if reason else []
    notes += [f"; the log ends early: {opened.broken}"] if opened.broken else []
    return output.report(facts, f"{out}: {len(opened)} ticks{''.join(notes)}")


@contextmanager
def _bar(what: str) -> Iterator[Callable[[int, int], None]]:
    """Show the progress and the time left."""
    with Progress(console=progress_console(), transient=True) as bar:
        task = bar.add_task(what)
        yield lambda done, total: bar.update(task, completed=done, total=total)
