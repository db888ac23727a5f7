"""Hook that shows a trial in a live view."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from wbc.app.view.base import View
from wbc.app.view.meshcat_view import MeshcatView
from wbc.base.checked import checked
from wbc.base.settings import NonNegative, Positive
from wbc.robots import RobotDescription
from wbc.sim.plant.mujoco_robot import MujocoRobot
from wbc.sim.trial.trial import TrialHook

if TYPE_CHECKING:
    from wbc.app.view.controls import LiveControls
    from wbc.app.view.workbench import Workbench
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
        *,
        workbench: bool = False,
        port: int | None = None,
        speed: Positive | None = 1.0,
        wait: Annotated[NonNegative, "s"] = 0.0,
        stay: bool = False,
    ) -> None:
        """Store the options of a `MeshcatView` or of a `Workbench`.

        `wait` is the longest time that the trial waits for a page to be opened, s; a negative time is an `InputError`.
        With `stay` the view stays open at the end, for `restarted` and `close`.
        """
        self._wait, self._stay = wait, stay
        self._workbench = workbench
        self._options: dict[str, Any] = {"port": port, "speed": speed}
        self.view: View | None = None

    @property
    def bench(self) -> Workbench | None:
        """The view, if it is a workbench."""
        return self.view if self._workbench else None  # type: ignore[return-value]

    @property
    def controls(self) -> LiveControls | None:
        """Controls of the page, with the changes made there; None for a page without controls."""
        return None if self.bench is None else self.bench.controls

    def open(self, trial: Trial) -> None:
        """Open the view of a trial; otherwise `start` does it.

        A caller learns early in this way whether the port is free.
        """
        source: MujocoRobot | RobotDescription
        source, walking = (
            trial.plant.description,
            None,
        )  # of a loop without a model of MuJoCo's the robot alone is shown
        if isinstance(trial.plant, MujocoRobot):
            source, walking = trial.plant, trial.control
        if not self._workbench:
            self.view = MeshcatView(source, walking, **self._options)
        elif self.bench is not None and not self.bench.closed:
            self.bench.show(source, walking)
        else:
            from wbc.app.view.workbench import Workbench  # noqa: PLC0415 - needs an extra

            self.view = Workbench(source, walking, **self._options)

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
