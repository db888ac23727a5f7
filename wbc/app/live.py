"""What every command that runs a robot offers: watching it live."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from wbc.sim.plant.plant import Plant

if TYPE_CHECKING:
    from wbc.app.view.walk import WatchWalk
    from wbc.sim.walks import WalkTrial

BROWSER_TIME = 20.0
"""How long a run waits for somebody to open the page, s."""


@dataclass(frozen=True, eq=False)
class Watching:
    """A run that may be watched.

    Attributes:
        after_tick: To be called after every tick; None if nobody watches.
        interventions: What was changed from the page, each with its time.
    """

    after_tick: Callable[[], None] | None
    interventions: list[dict[str, Any]]


@dataclass(frozen=True, kw_only=True)
class Live:
    """Whether a run is shown in a browser.

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
        """Show a plant, if that is asked for.

        Args:
            plant: The plant.

        Raises:
            InputError: A port that is none, or one that is in use.
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
        """Show a walk, if that is asked for: the port is taken now, the page is waited for when the walk starts.

        Args:
            trial: The walk.

        Raises:
            InputError: A port that is none, or one that is in use.
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
"""A command that can be watched takes it as `live`."""


def interactive(interventions: list[dict[str, Any]]) -> dict[str, Any]:
    """What a result says about changes from the page: a run that had any is not what its options say.

    Args:
        interventions: What was changed.
    """
    said: dict[str, Any] = {"interactive": bool(interventions)}
    if interventions:
        said["interventions"] = interventions
    return said


def interactive_text(interventions: list[dict[str, Any]]) -> str:
    """The same for people, each change on a line of its own that begins with a line break."""
    from wbc.app.view.controls import intervention_text  # noqa: PLC0415 - most runs are not watched

    return "".join(f"\n  CHANGED   from the page at {intervention_text(entry)}" for entry in interventions)
