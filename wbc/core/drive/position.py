"""Position control: accelerations of the solution, integrated to references of joint position and velocity.

The controlled robot (the model that moves as commanded) and the estimated robot (from sensors) are two objects, as in
mc_rtc.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Literal

import numpy as np
import pinocchio as pin

from wbc.base.checked import checked, fixed, result
from wbc.base.errors import InputError
from wbc.base.numbers import Array, lag_gain, scalar
from wbc.base.settings import Positive
from wbc.core.drive.control import ANOTHER, RESTART, DriveControl, State
from wbc.core.drive.failures import FailurePolicy
from wbc.core.drive.sensing import SafetySettings
from wbc.core.estimation.observer import Observer
from wbc.core.qp.controller import Controller
from wbc.core.qp.solving.solution import Solution
from wbc.core.robot import BASE_DOF
from wbc.core.signals import Command


class PositionControl(DriveControl):
    """Position control: the accelerations of the solution are integrated to references of joint position and velocity.

    Attributes:
        feedback: With "open" the controller's robot is the commanded one, and sensors act only through tasks that read
            them. With "closed" it is the estimated robot, and the references converge to the estimate.
        feedforward: True to add the torques of the solution to the servos.
        q: Configuration of the commanded robot, shape (nq,), read-only; it changes with every tick.
        v: Velocity of the commanded robot, shape (nv,), read-only; it changes with every tick.
    """

    feedback: Literal["open", "closed"] = fixed(ANOTHER)
    feedforward: bool = fixed(ANOTHER)
    q: Array = result("_q", RESTART)
    v: Array = result("_v", RESTART)
    _moves_references = True

    @checked
    def __init__(
        self,
        controller: Controller,
        observer: Observer | None = None,
        failure_policy: FailurePolicy | None = None,
        *,
        feedback: Literal["open", "closed"] = "open",
        feedforward: bool = True,
        reference_time: Annotated[Positive, "s"] = 0.1,
        safety: SafetySettings | None = None,
    ) -> None:
        """See `DriveControl`, and the attributes.

        With open feedback the controller's robot becomes the commanded robot, which starts from its present state; the
        observer's robot is another one. With closed feedback `reference_time` is the time constant with which the
        references converge to the estimate, s. Without the torques of the solution servos sag under the weight.
        """
        if feedback == "open" and observer is not None and observer.robot is controller.robot:
            raise InputError(
                "in open loop the observer needs a robot of its own: Observer(robot), not adopt=True"
            )
        if controller.robot.servos is not None:  # ahead of the base, which marks the controller as driven
            controller.robot.servos.check_position_control()
        super().__init__(controller, observer, failure_policy, safety)
        self.feedback = feedback
        self._follows_estimate = feedback == "closed"
        self.feedforward = feedforward
        self._pull = lag_gain(controller.dt, reference_time)
        self._q = np.array(controller.robot.q)
        self._v = np.array(controller.robot.v)
        self._step = np.zeros(controller.robot.nv)
        self._dt, self._half_square = scalar(controller.dt), scalar(0.5 * controller.dt * controller.dt)
        self._soles = [controller.robot.placement(sole.frame) for sole in controller.robot.soles]

    def reset(self, q: Array | None = None) -> None:
        """Restart from a configuration at rest, shape (nq,); half-sitting when None."""
        robot = self.controller.robot
        self._q[:] = robot.half_sitting if q is None else robot.check_configuration("configuration", q)
        self._v[:] = 0.0
        robot.update(self._q, self._v)
        self.observer.reset(self._q)
        self._forget()

    def _reference_soles(self) -> Sequence[pin.SE3 | None] | None:
        """Bring the commanded robot to where it is commanded, released joints to where they are; return its soles."""
        if (released := self.controller.released) is not None:  # the commanded robot has them where they are
            index, estimate = released.index, self.observer.robot
            self._q[7 + index], self._v[BASE_DOF + index] = (
                estimate.q[7 + index],
                estimate.v[BASE_DOF + index],
            )
        if self.feedback != "open":
            return None
        # The estimate is kept in the commanded robot's world: loaded feet are where that robot has them.
        self.controller.robot.update(self._q, self._v)
        return self._soles

    def _torques_of(self, solution: Solution, wrenches: Mapping[str, Array] | None) -> Array:
        return super()._torques_of(solution, wrenches) if self.feedforward else self._torques

    def _follow(self, state: State, solution: Solution) -> Command:
        if self.feedback == "closed":
            self._draw()
        return self._move(solution.accelerations)

    def _hold(self, state: State) -> Command:
        """Let the motion decay; once stopped, freeze the references."""
        dt = self.controller.dt
        return self._move(-self._v / (dt if self.stopped else max(self._record.policy.damping_time, dt)))

    def _damp(self, state: State) -> Command:
        """Send gains with the command: the machine's stiffness would hold the joints against the ground."""
        robot, (position, velocity) = self.controller.robot, self.joints(state)
        position = np.where(np.isnan(position), self._q[7:], position)
        position = np.clip(position, robot.position_lower, robot.position_upper)
        none, damping = np.zeros(robot.na), self._record.damping
        self.gate.move(position)  # the reference is where the joint is, however fast it moves
        return self.gate.pass_on_with_gains(none, position, none, (none, damping), (position, velocity))

    def _move(self, acceleration: Array) -> Command:
        """Move the commanded robot on, and return it as references within all limits."""
        # Constant acceleration over the period, for which the braking law of the joint limits is made.
        q, v, step = self._q, self._v, np.multiply(acceleration, self._half_square, out=self._step)
        step += v * self._dt
        q[:] = pin.integrate(self.controller.robot.model, q, step)
        v += np.multiply(acceleration, self._dt, out=step)
        command = self.gate.pass_on(self._torques, q[7:], v[6:])
        if self.gate.faults:  # the commanded robot is where the command says
            assert command.joint_position is not None and command.joint_velocity is not None
            q[7:], v[6:] = command.joint_position, command.joint_velocity
        return command

    def _draw(self) -> None:
        """Draw the commanded robot to the estimated one."""
        estimate, q, v = self.observer.robot, self._q, self._v
        difference = pin.difference(estimate.model, q, estimate.q)
        q[:] = pin.integrate(estimate.model, q, self._pull * difference)
        v += self._pull * (estimate.v - v)
