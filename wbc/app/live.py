"""Options of the live view, for every command that runs a robot."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from wbc.app.address import Host, Port
from wbc.core.errors import InputError
from wbc.core.settings import settings

if TYPE_CHECKING:
    from wbc.app.repeat import RepeatWalk
    from wbc.app.view.walk_hook import WatchWalk
    from wbc.sim.trial.loop import Trial

BROWSER_TIME = 20.0
"""Longest time that a run waits for a page to be opened, s."""


@settings(kw_only=True)
class LiveView:
    """Options of the live view in a browser.

    Attributes:
        view: Show the run in the browser, in real time.
        workbench: Show it with controls of tasks and gains.
        host: Address of the page; 0.0.0.0 is reached from other machines, too.
        port: Port of the page; the first free one from 7000 on if not given.
    """

    view: bool = False
    workbench: bool = False
    host: Host = "127.0.0.1"
    port: Port | None = None

    @property
    def watched(self) -> bool:
        """True if there is a page."""
        return any(getattr(self, name, False) for name in ("view", "workbench", "drive"))

    def __post_init__(self) -> None:
        if not self.watched and (self.port is not None or self.host != "127.0.0.1"):
            raise InputError("host and port are those of the live view: they need --view or --workbench")

    @contextmanager
    def watch(self, trial: Trial) -> Iterator[list[WatchWalk]]:
        """Give the hooks of a trial that show it if there is a page; none otherwise.

        The port is taken now, the trial waits for the page when it starts. Raises `InputError` for a port that is in
        use, `ViewError` where the page cannot be served.
        """
        if not self.watched:
            yield []
            return
        from wbc.app.view.walk_hook import WatchWalk  # noqa: PLC0415 - most runs are not watched

        with WatchWalk(workbench=self.workbench, host=self.host, port=self.port, wait=BROWSER_TIME) as hook:
            hook.open(trial)
            yield [hook]


@settings(kw_only=True)
class LiveDrive(LiveView):
    """Options of the live view of a walk.

    Attributes:
        drive: Drive from the live page: arrow keys, stick, gamepad.
    """

    drive: bool = False


LiveOptions = Annotated[LiveView, Parameter(name="*")]
DriveOptions = Annotated[LiveDrive, Parameter(name="*")]
"""Types of the argument `live` of a command, and of one that can be driven."""


def with_changes(
    hooks: Sequence[WatchWalk | RepeatWalk], trial: Trial, result: dict[str, Any], text: str
) -> tuple[dict[str, Any], str]:
    """Return result and text with changes and end by Ctrl-C of a run, which then is not that of its options."""
    changes = [change for hook in hooks for change in hook.interventions]
    if changes:
        from wbc.app.view.controls import intervention_text  # noqa: PLC0415 - most runs are not watched

        text += "".join(f"\n  CHANGED   from the page at {intervention_text(each)}" for each in changes)
    changes += ending(trial)
    result = result | {"interactive": bool(changes)}
    if changes:
        result["interventions"] = changes
    return result, text


def ending(trial: Trial) -> list[dict[str, Any]]:
    """Return the end of a run by Ctrl-C as an intervention; empty before, and for a run that ends by itself."""
    return [] if trial.last is None else [{"time": trial.last, "what": "end"}]


@contextmanager
def ended_by_interrupt(trial: Trial) -> Iterator[None]:
    """Let Ctrl-C end a trial with its next tick, as an end like another; a second one interrupts."""

    def stop(number: int, frame: object) -> None:
        del number, frame
        trial.stop()
        signal.signal(signal.SIGINT, before)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
