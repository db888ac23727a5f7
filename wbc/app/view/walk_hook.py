"""Hook that shows a trial in a live view."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Annotated, Any

from wbc.app.view import VIEWERS, Viewer
from wbc.app.view.base import View
from wbc.base.checked import checked
from wbc.base.settings import NonNegative, Positive
from wbc.sim.plant.mujoco_robot import MujocoRobot
from wbc.sim.trial.trial import TrialHook

if TYPE_CHECKING:
    from wbc.app.view.controls import LiveControls
    from wbc.sim.trial.trial import Trial, TrialTick


class WatchWalk(TrialHook):
    """Hook that shows a trial in a live view.

    The result is the same as without the view, unless a user of a workbench changes the run.

    Attributes:
        view: The view; None before the trial starts.
    """

    @checked
    def __init__(
        self,
        viewer: Viewer = "meshcat",
        *,
        port: int | None = None,
        speed: Positive | None = 1.0,
        wait: Annotated[NonNegative, "s"] = 0.0,
        stay: bool = False,
    ) -> None:
        """Store the name and the options of a live view.

        `wait` is the longest time that the trial waits for a page to be opened, s; a negative time is an `InputError`.
        With `stay` the view stays open at the end, for `restarted` and `close`.
        """
        self._wait, self._stay, self._viewer = wait, stay, viewer
        self._options: dict[str, Any] = {"port": port, "speed": speed}
        self.view: View | None = None

    @property
    def controls(self) -> LiveControls | None:
        """Controls of the page, with the changes made there; None for a page without controls."""
        return getattr(self.view, "controls", None)

    def open(self, trial: Trial) -> None:
        """Open the view of a trial; otherwise `start` does it.

        A caller learns early in this way whether the port is free. Of a simulation without a model of MuJoCo's the
        robot alone is shown.
        """
        known = isinstance(trial.plant, MujocoRobot)
        shown = (trial.plant, trial.control) if known else (trial.plant.description, None)
        if self.view is not None and not self.view.closed:
            self.view.show(*shown)
        else:
            module, name = VIEWERS[self._viewer]
            self.view = getattr(import_module(module), name)(*shown, **self._options)

    def start(self, trial: Trial) -> None:
        """See `TrialHook`."""
        if self.view is None or self.view.closed:
            self.open(trial)
        if self._wait > 0.0 and self.view is not None:
            self.view.wait_for_page(self._wait)

    def tick(self, tick: TrialTick) -> None:
        """See `TrialHook`."""
        if self.view is None:
            return
        if isinstance(tick.plant, MujocoRobot):
            self.view.update()
        else:
            self.view.update(tick.plant.truth().q, measurement=tick.measurement)

    def end(self, result: object) -> None:
        """See `TrialHook`."""
        del result
        if not self._stay:
            self.close()

    def restarted(self, how: str) -> bool:
        """Show on the page how the trial has ended; return True if the user of a workbench asks for another trial."""
        return self.view is not None and not self.view.closed and self.view.ended(how)

    def close(self) -> None:
        """End the view; the page keeps its last picture."""
        if self.view is not None:
            self.view.close()
