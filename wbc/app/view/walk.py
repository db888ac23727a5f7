"""Watch a simulated walk: the live view as a hook.

walk(spec, hooks=[WatchWalk()])
"""

from __future__ import annotations

import sys
from types import TracebackType
from typing import TYPE_CHECKING, Any

from wbc.app.view.controls import intervention_text
from wbc.app.view.view import MeshcatView
from wbc.core.errors import non_negative
from wbc.sim.walks import WalkHook

if TYPE_CHECKING:
    from wbc.sim.walks import WalkResult, WalkTick, WalkTrial


class WatchWalk(WalkHook):
    """Shows a walk in the browser. The result is that of the same walk unseen, unless the page's controls changed it.

    Attributes:
        view: The view; None before the walk starts.
    """

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
        """Say how to watch.

        Args:
            host: See `MeshcatView`.
            port: See `MeshcatView`.
            rate: See `MeshcatView`.
            speed: See `MeshcatView`; in real time if nothing else is said.
            controls: See `MeshcatView`.
            wait: How long the walk waits at most for somebody to open the page, s.

        Raises:
            InputError: A time to wait that is negative.
        """
        self._wait = non_negative("time to wait for a page (s)", wait)
        self._options: dict[str, Any] = {
            "host": host,
            "port": port,
            "rate": rate,
            "speed": speed,
            "controls": controls,
        }
        self.view: MeshcatView | None = None
        self._told = 0

    @property
    def interventions(self) -> list[dict[str, Any]]:
        """What was changed from the page; empty if the walk is what its spec says."""
        return [] if self.view is None else self.view.interventions

    def news(self) -> str:
        """What was changed from the page since the last call, for a log; empty if nothing."""
        entries = self.interventions[self._told :]
        self._told += len(entries)
        return "; ".join(intervention_text(entry) for entry in entries)

    def open(self, trial: WalkTrial) -> None:
        """Serve the page; done by `start` unless somebody wants to know earlier whether the port can be had.

        Raises:
            InputError: An option out of range.
            PortError: The port cannot be had.
        """
        self.view = MeshcatView(trial.plant, walking=trial.walking, **self._options)

    def start(self, trial: WalkTrial) -> None:
        """See `WalkHook`."""
        if self.view is None:
            self.open(trial)
        if self._wait > 0.0 and self.view is not None:
            wait_for_page(self.view, self._wait)

    def tick(self, tick: WalkTick) -> None:
        """See `WalkHook`."""
        if self.view is not None:
            self.view.update(measurement=tick.measurement)

    def end(self, result: WalkResult) -> None:
        """See `WalkHook`."""
        del result
        self.close()

    def close(self) -> None:
        """End the view; the page keeps its last picture."""
        if self.view is not None:
            self.view.close()

    def __enter__(self) -> WatchWalk:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def wait_for_page(view: MeshcatView, seconds: float) -> None:
    """Say that the run waits for somebody to open the page, and wait.

    Args:
        view: The view.
        seconds: How long at most, s.
    """
    if seconds > 0.0:
        print(f"open it now: the run begins with it, or in {seconds:.0f} s", file=sys.stderr, flush=True)
    view.wait(seconds)
