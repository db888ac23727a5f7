"""Torque and hybrid control: the torques of the solution by the estimate alone, and soft servos around their motion."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from wbc.base.checked import checked, fixed, result
from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array, lag_gain, read_only, scalar
from wbc.base.settings import NonNegative, NonNegativeNumbers
from wbc.core.drive.control import ANOTHER, RESTART, DriveControl, State
from wbc.core.drive.failures import FailurePolicy
from wbc.core.drive.sensing import SafetySettings
from wbc.core.estimation.observer import Observer
from wbc.core.qp.controller import Controller
from wbc.core.qp.solving.solution import Solution
from wbc.core.robot import BASE_DOF
from wbc.core.signals import Command


class TorqueControl(DriveControl):
    """Torque control: the torques of the solution are commanded; the controller's robot is the estimated one."""

    @checked
    def __init__(
        self,
        controller: Controller,
        observer: Observer | None = None,
        failure_policy: FailurePolicy | None = None,
        *,
        safety: SafetySettings | None = None,
    ) -> None:
        """See `DriveControl`.

        By default the observer estimates into the controller's own robot (`Observer(robot, adopt=True)`). The model is
        then updated once in a tick instead of twice.
        """
        if observer is None:
            observer = Observer(controller.robot, adopt=True)
        super().__init__(controller, observer, failure_policy, safety)

    def reset(self, q: Array | None = None) -> None:
        """Restart from a configuration at rest, shape (nq,); half-sitting when None."""
        self.observer.reset(q)
        robot = self.controller.robot
        robot.update(self.observer.robot.q, self.observer.robot.v)
        self._forget()

    def resume(self) -> None:
        """Begin from the present estimate, which another control has kept with the same observer.

        Drives that share their estimate (`share`) keep doubts, refusals, failures and a fall; others forget theirs,
        which are old.
        """
        if self.sensing.stale:
            self.sensing.reset()
            self._record.reset()
        robot, estimate = self.controller.robot, self.observer.robot
        if robot is not estimate:
            robot.update(estimate.q, estimate.v)
        self._begin()

    def _follow(self, state: State, solution: Solution) -> Command:
        return self.gate.pass_on(self._torques)

    def _hold(self, state: State) -> Command:
        return self._damp(state) if self.stopped else self.gate.pass_on(self._torques + self._damping(state))

    def _damp(self, state: State) -> Command:
        return self.gate.pass_on(self._damping(state))

    def _damping(self, state: State) -> Array:
        """Return the torques that damp the joints, shape (na,), Nm."""
        return -self._record.damping * np.nan_to_num(self.joints(state)[1], nan=0.0)


class HybridControl(TorqueControl):
    """Hybrid control: joint position, joint velocity, torque, kp and kd in one command, for drives with soft servos.

    The controller's robot is the estimated one, as in torque control, and the torques of the solution carry it. The
    references are the joint positions and velocities that these torques should produce by the next command. While the
    robot moves as its model predicts, the servos therefore add no torque. When it moves otherwise, they damp and hold
    it, at the high rate of the drives.

    Attributes:
        kp: Stiffness in the commands, shape (na,), Nm/rad.
        kd: Damping in the commands, shape (na,), Nms/rad.
        q: Joint positions of the last references, shape (na,), rad, read-only.
        v: Joint velocities of the last references, shape (na,), rad/s, read-only.
    """

    kp: Array = fixed(ANOTHER)
    kd: Array = fixed(ANOTHER)
    q: Array = result("_q", RESTART)
    v: Array = result("_v", RESTART)

    @checked
    def __init__(
        self,
        controller: Controller,
        observer: Observer | None = None,
        failure_policy: FailurePolicy | None = None,
        *,
        kp: NonNegativeNumbers | None = None,
        kd: NonNegativeNumbers | None = None,
        reference_time: Annotated[NonNegative, "s"] = 0.02,
        safety: SafetySettings | None = None,
    ) -> None:
        """See `TorqueControl`, and the attributes.

        Gains that are None are those of the robot's description, which must then have them; of those that were derived
        and not given it is a softer share (`Servos.soft`). `reference_time` is the time constant with which position
        references converge to the estimated positions, s; with 0 they start from the estimate at every tick.
        """
        super().__init__(controller, observer, failure_policy, safety=safety)
        robot = controller.robot
        if kp is None or kd is None:
            if robot.servos is None:
                raise InputError(f"give kp and kd: the gains of the servos of {robot!r} are not known")
            soft = robot.servos.soft()
            kp, kd = soft[0] if kp is None else kp, soft[1] if kd is None else kd
        self.kp, self.kd = (
            read_only(finite_array(f"{name} of the servos", value, (robot.na,)))
            for name, value in (("kp", kp), ("kd", kd))
        )
        self._pull = lag_gain(controller.dt, reference_time)
        self._dt = scalar(controller.dt)
        self._off = np.zeros(robot.na)
        self._q, self._v = np.array(robot.q[7:]), np.zeros(robot.na)

    def reset(self, q: Array | None = None) -> None:
        """Restart from a configuration at rest, shape (nq,); half-sitting when None."""
        super().reset(q)
        self._q[:], self._v[:] = self.controller.robot.q[7:], 0.0

    def resume(self) -> None:
        """See `TorqueControl.resume`; the references begin where and as fast as the joints are."""
        super().resume()
        robot = self.controller.robot
        self._q[:], self._v[:] = robot.q[7:], robot.v[BASE_DOF:]

    def _follow(self, state: State, solution: Solution) -> Command:
        robot, q, v = self.controller.robot, self._q, self._v
        velocity = robot.v[BASE_DOF:]
        step = solution.accelerations[BASE_DOF:] * self._dt
        q += self._pull * (robot.q[7:] - q)
        v += self._pull * (velocity - v)
        q += (v + 0.5 * step) * self._dt
        v += step
        # The servos of released joints are not ours: no torque of them counts in the gate.
        if (released := self.controller.released) is not None:
            index = released.index
            q[index], v[index] = robot.q[7 + index], velocity[index]
        return self._command(state, self._torques, (self.kp, self.kd))

    def _hold(self, state: State) -> Command:
        """Hold references and torques while the servos damp; once stopped, only damp."""
        if self.stopped:
            return self._damp(state)
        self._v[:] = 0.0
        return self._command(state, self._torques, (self.kp, self.kd))

    def _damp(self, state: State) -> Command:
        position, _ = self.joints(state)
        self._q[:], self._v[:] = np.where(np.isnan(position), self._q, position), 0.0
        return self._command(state, self._off, (self._off, np.maximum(self.kd, self._record.damping)))

    def _command(self, state: State, torques: Array, gains: tuple[Array, Array]) -> Command:
        """Return the command of the references, within all limits; the references are where it says."""
        command = self.gate.pass_on_with_gains(torques, self._q, self._v, gains, self.joints(state))
        if self.gate.faults:
            assert command.joint_position is not None and command.joint_velocity is not None
            self._q[:], self._v[:] = command.joint_position, command.joint_velocity
        return command
