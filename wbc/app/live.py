"""Live view of a command that runs a robot: its options, and the context in which it runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from wbc.core.settings import settings
from wbc.sim.plant.plant import Plant

if TYPE_CHECKING:
    from wbc.app.view.walk import WatchWalk
    from wbc.sim.walks import WalkTrial

BROWSER_TIME = 20.0
"""Longest time that a run waits for the page to be opened, s."""


@dataclass(frozen=True, eq=False)
class Watching:
    """A run that may be watched.

    Attributes:
        after_tick: Function to call after every tick; None without a view.
        interventions: Changes from the page, each with its time.
    """

    after_tick: Callable[[], None] | None
    interventions: list[dict[str, Any]]


@settings(kw_only=True)
class Live:
    """Options of the live view in a browser.

    Attributes:
        view: Show the run live in the browser, in real time.
        host: Address of the page; the default is reached from this machine alone, 0.0.0.0 from everywhere.
        port: Port of the page; the first free one from 7000 on when not given.
    """

    view: bool = False
    host: str = "127.0.0.1"
    port: int | None = None

    @contextmanager
    def show(self, plant: Plant) -> Iterator[Watching]:
        """Show a plant, if `view` is set.

        Args:
            plant: The plant.

        Raises:
            InputError: A port that does not exist or is in use.
            ViewError: The page cannot be served there.
        """
        if not self.view:
            yield Watching(None, [])
            return
        from wbc.app.view.view import MeshcatView  # noqa: PLC0415 - most runs are not watched
        from wbc.app.view.walk import wait_for_page  # noqa: PLC0415

        with MeshcatView(plant, host=self.host, port=self.port, speed=1.0) as view:
            wait_for_page(view, BROWSER_TIME)
            yield Watching(view.update, view.interventions)

    @contextmanager
    def watch(self, trial: WalkTrial) -> Iterator[WatchWalk | None]:
        """Show a walk, if `view` is set: the port is taken now, the page is waited for when the walk starts.

        Args:
            trial: The walk.

        Raises:
            InputError: A port that does not exist or is in use.
            ViewError: The page cannot be served there.
        """
        if not self.view:
            yield None
            return
        from wbc.app.view.walk import WatchWalk  # noqa: PLC0415 - most runs are not watched

        with WatchWalk(host=self.host, port=self.port, wait=BROWSER_TIME) as hook:
            hook.open(trial)
            yield hook


LiveOptions = Annotated[Live, Parameter(name="*")]
"""Annotation of the parameter `live` of a command that can be watched."""


def interactive(interventions: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the changes from the page for a result: a run that had any is not reproduced by its options.

    Args:
        interventions: Changes from the page.
    """
    return {"interactive": bool(interventions)} | ({"interventions": interventions} if interventions else {})


def interactive_text(interventions: list[dict[str, Any]]) -> str:
    """Return the changes from the page as text, a line for each that begins with a line break."""
    from wbc.app.view.controls import intervention_text  # noqa: PLC0415 - most runs are not watched

    return "".join(f"\n  CHANGED   from the page at {intervention_text(entry)}" for entry in interventions)
