"""Options of the live view, for every command that runs a robot."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar, get_args

from wbc.app.output import progress_console
from wbc.app.view import VIEWERS, Viewer
from wbc.app.view.base import Port
from wbc.app.view.controls import END, intervention_text
from wbc.base.errors import InputError
from wbc.base.settings import settings
from wbc.sim.trial.trial import TrialHook
from wbc.walking.steered import SteeredControl

if TYPE_CHECKING:
    from rich.status import Status

    from wbc.app.repeat import RepeatWalk
    from wbc.app.view.base import View
    from wbc.sim.trial.trial import AnyTrial, TrialTick

TrialT = TypeVar("TrialT", bound="AnyTrial")
ResultT = TypeVar("ResultT")

BROWSER_TIME = 20.0
"""Longest time that a run waits for a page to be opened, s."""


@settings(kw_only=True)
class LiveView:
    """Options of the live view, which shows the run in real time on this machine; from another one through `ssh -L`.

    Attributes:
        view: Viewer of the run: meshcat (a page in the browser), workbench (a page with controls of the run: push,
            gains, targets, pause, restart), rerun (Rerun's page, in which the run can be looked at again) or mujoco
            (the window of MuJoCo's viewer, on a screen).
        port: Port of the page; the first free one from 7000 on if not given.
    """

    view: Viewer | None = None
    port: Port | None = None

    def __post_init__(self) -> None:
        if self.port is not None and self.view in (None, "mujoco"):
            pages = ", ".join(name for name in get_args(Viewer) if name != "mujoco")
            raise InputError(
                f"the port is that of a page: it needs --view with one of {pages}, got {self.view}"
            )

    def run(
        self,
        make: Callable[[], TrialT],
        simulate: Callable[[TrialT, list[View]], ResultT],
        outcome: Callable[[ResultT], str],
    ) -> tuple[ResultT, TrialT, list[View]]:
        """Simulate a trial, and another one as often as a workbench asks for it; Ctrl-C ends one as other ends do.

        `simulate` gets the views that show it, none without a page; `outcome` says in a few words how it has ended.
        Return the result of the last trial, the trial, and its views.
        """
        with ExitStack() as stack:
            views: list[View] = []
            if self.view is not None:
                kind: type[View] = getattr(import_module("wbc.app"), VIEWERS[self.view])
                view = kind(port=self.port, speed=1.0, wait=BROWSER_TIME)
                view.stays = True
                stack.callback(view.close)
                views.append(view)
            while True:
                trial = make()
                with ended_by_interrupt(trial), shown_progress(trial, watched=bool(views)):
                    result = simulate(trial, views)
                if not any(not view.closed and view.ended(outcome(result)) for view in views):
                    return result, trial, views


@settings(kw_only=True)
class LiveDrive(LiveView):
    """Options of the live view of a walk.

    Attributes:
        drive: Drive from the workbench, by sliders or keys.
    """

    drive: bool = False

    def __post_init__(self) -> None:
        if self.drive and self.view not in (None, "workbench"):
            raise InputError(
                f"the page to drive from is the workbench: --drive needs no --view, got {self.view}"
            )
        if self.drive:
            object.__setattr__(self, "view", "workbench")
        super().__post_init__()


def with_changes(
    hooks: Sequence[View | RepeatWalk], trial: AnyTrial, result: dict[str, Any], text: str
) -> tuple[dict[str, Any], str]:
    """Return result and text with changes and end by Ctrl-C of a run, which then is not that of its options."""
    changes = [
        change for hook in hooks if hook.controls is not None for change in hook.controls.interventions
    ]
    if changes:
        text += "".join(f"\n  CHANGED   from the page at {intervention_text(each)}" for each in changes)
    changes += ending(trial)
    return result | {"interactive": bool(changes)} | ({"interventions": changes} if changes else {}), text


def ending(trial: AnyTrial) -> list[dict[str, Any]]:
    """Return the end of a run by Ctrl-C as an intervention; empty before, and for a run that ends by itself."""
    return [] if trial.last is None else [{"time": trial.last, "what": END}]


@contextmanager
def shown_progress(trial: AnyTrial, *, watched: bool) -> Iterator[None]:
    """Show how far a trial has come on a terminal, unless a page shows it."""
    console = progress_console()
    if watched or not console.is_terminal:
        yield
        return
    with console.status("simulating") as line:
        trial.hooks.append(ProgressLine(line))
        yield


class ProgressLine(TrialHook):
    """Line of a trial on the terminal: simulated time, and steps of a walk."""

    def __init__(self, line: Status) -> None:
        self._line, self._next = line, 0.0

    def tick(self, tick: TrialTick) -> None:
        """See `TrialHook`."""
        time = tick.plant.time
        if time >= self._next:
            self._next = time + 0.1
            steps = f", {tick.control.steps_done} steps" if isinstance(tick.control, SteeredControl) else ""
            self._line.update(f"{time:.1f} s simulated{steps}")


@contextmanager
def ended_by_interrupt(trial: AnyTrial) -> Iterator[None]:
    """Let Ctrl-C end a trial with its next tick, as an end like another; a second one interrupts."""

    def stop(*_: object) -> None:
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
