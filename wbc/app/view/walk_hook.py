"""Hook that shows a trial in the live view."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from wbc.app.view.base import View
from wbc.app.view.meshcat_view import MeshcatView
from wbc.core.arguments import checked
from wbc.core.settings import NonNegative
from wbc.sim.trial.loop import TrialHook

if TYPE_CHECKING:
    from wbc.sim.trial.loop import Trial, TrialTick


class WatchWalk(TrialHook):
    """Live view of a trial. The result is that of the same trial without it, unless the page's controls changed it.

    Attributes:
        view: The view; None before the walk starts.
    """

    @checked
    def __init__(
        self,
        *,
        workbench: bool = False,
        host: str = "127.0.0.1",
        port: int | None = None,
        rate: float | None = None,
        speed: float | None = 1.0,
        wait: Annotated[NonNegative, "s"] = 0.0,
    ) -> None:
        """Store the options of a `MeshcatView`, or of a `Workbench` instead; both say what they are.

        `wait` is the longest time that the trial waits for a page to be opened, s; a negative one is an `InputError`.
        """
        self._wait = wait
        self._workbench = workbench
        self._options: dict[str, Any] = dict(host=host, port=port, rate=rate, speed=speed)
        self.view: View | None = None

    @property
    def interventions(self) -> list[dict[str, Any]]:
        """Changes made from the page; empty if the walk follows its spec."""
        return [] if self.view is None else self.view.interventions

    def news(self) -> str:
        """Return the changes made from the page since the last call as JSON, for a log; empty if none."""
        return "" if self.view is None else self.view.controls.news()

    def open(self, trial: Trial) -> None:
        """Serve the page; `start` does so, too, but a caller may want to know earlier that the port is free."""
        if self._workbench:
            from wbc.app.view.workbench import Workbench  # noqa: PLC0415 - needs an extra

            self.view = Workbench(trial.plant, trial.walking, **self._options)
        else:
            self.view = MeshcatView(trial.plant, trial.walker, **self._options)

    def start(self, trial: Trial) -> None:
        """See `TrialHook`."""
        if self.view is None or self.view.closed:
            self.open(trial)
        if self._wait > 0.0 and self.view is not None:
            self.view.wait_for_page(self._wait)

    def tick(self, tick: TrialTick) -> None:
        """See `TrialHook`."""
        if self.view is not None:
            self.view.update(measurement=tick.measurement)

    def end(self, result: object) -> None:
        """See `TrialHook`."""
        del result
        self.close()

    def close(self) -> None:
        """End the view; the page keeps its last picture."""
        if self.view is not None:
            self.view.close()

    def __enter__(self) -> WatchWalk:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
