"""Torque control: the torques of the solution, by the estimate alone."""

from __future__ import annotations

from wbc.base.checked import checked
from wbc.base.numbers import Array
from wbc.core.drive.control import DriveControl, FailurePolicy, SafetySettings, State
from wbc.core.estimation.observer import Observer
from wbc.core.qp.controller import Controller
from wbc.core.qp.solving.solution import Solution
from wbc.core.signals import Command


class TorqueControl(DriveControl):
    """Torque control: the torques of the solution are commanded; the controller's robot is the estimated one."""

    @checked
    def __init__(
        self,
        controller: Controller,
        observer: Observer | None = None,
        policy: FailurePolicy | None = None,
        *,
        safety: SafetySettings | None = None,
    ) -> None:
        """See `DriveControl`.

        By default the observer estimates into the controller's own robot (`Observer(robot, adopt=True)`). The model is
        then updated once in a tick instead of twice.
        """
        if observer is None:
            observer = Observer(controller.robot, adopt=True)
        super().__init__(controller, observer, policy, safety)

    def reset(self, q: Array | None = None) -> None:
        """Restart from a configuration at rest, shape (nq,); half-sitting when None."""
        self.observer.reset(q)
        robot = self.controller.robot
        robot.update(self.observer.robot.q, self.observer.robot.v)
        self._forget()

    def resume(self) -> None:
        """Restart from the present estimate, which another control has kept with the same observer."""
        self._forget()

    def _follow(self, state: State, solution: Solution) -> Command:
        return self.gate.pass_on(self._torques)

    def _hold(self, state: State) -> Command:
        return self._damp(state) if self.stopped else self.gate.pass_on(self._torques + self._damping(state))

    def _damp(self, state: State) -> Command:
        return self.gate.pass_on(self._damping(state))
