"""Hook that shows a trial in the live view."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from wbc.app.view.controls import intervention_text
from wbc.app.view.meshcat_view import MeshcatView
from wbc.core.arguments import checked
from wbc.core.errors import non_negative
from wbc.sim.trial import TrialHook

if TYPE_CHECKING:
    from wbc.sim.trial import Trial, TrialTick


class WatchWalk(TrialHook):
    """Live view of a trial. The result is that of the same trial without it, unless the page's controls changed it.

    Attributes:
        view: The view; None before the walk starts.
    """

    @checked
    def __init__(
        self,
        *,
        host: str = "127.0.0.1",
        port: int | None = None,
        rate: float = 30.0,
        speed: float | None = 1.0,
        controls: bool = True,
        wait: float = 0.0,
    ) -> None:
        """Store the options of the view.

        Args:
            host: See `MeshcatView`.
            port: See `MeshcatView`.
            rate: See `MeshcatView`.
            speed: See `MeshcatView`.
            controls: See `MeshcatView`.
            wait: Longest time that the walk waits for a page to be opened, s.

        Raises:
            InputError: A negative time to wait.
        """
        self._wait = non_negative("time to wait for a page (s)", wait)
        self._options: dict[str, Any] = dict(host=host, port=port, rate=rate, speed=speed, controls=controls)
        self.view: MeshcatView | None = None
        self._reported = 0

    @property
    def interventions(self) -> list[dict[str, Any]]:
        """Changes made from the page; empty if the walk follows its spec."""
        return [] if self.view is None else self.view.interventions

    def news(self) -> str:
        """Return the changes made from the page since the last call, for a log; empty if none."""
        entries = self.interventions[self._reported :]
        self._reported += len(entries)
        return "; ".join(intervention_text(entry) for entry in entries)

    def open(self, trial: Trial) -> None:
        """Serve the page; `start` does so, too, but a caller may want to know earlier that the port is free.

        Raises:
            InputError: An option out of range.
            PortError: The port is in use.
        """
        self.view = MeshcatView(trial.plant, walking=trial.walker, **self._options)

    def start(self, trial: Trial) -> None:
        """See `TrialHook`."""
        if self.view is None or self.view.closed:
            self._reported = 0
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
