"""Hybrid control: torques of the QP as feed-forward, and the machine's own servos around the motion that they make."""

from __future__ import annotations

import numpy as np

from wbc.core.arguments import checked
from wbc.core.control import FailurePolicy, Prepare, SafetySettings
from wbc.core.drive.torque import TorqueControl
from wbc.core.errors import Array, InputError, finite_array, non_negative, scalar
from wbc.core.estimation.observer import Observer
from wbc.core.lag import lag_gain
from wbc.core.qp.controller import Controller
from wbc.core.robot import BASE_DOF
from wbc.core.signals import Command, Measurement


class HybridControl(TorqueControl):
    """Hybrid control: joint position, joint velocity, torque, kp and kd in one command, for drives with soft servos.

    The controller's robot is the estimated one, as in torque control, and the torques of the solution carry it. The
    references are the joint positions and velocities which these torques lead to at the next command, so the servos add
    nothing while the robot moves as its model says, and damp and hold it where it does not, at the rate of the drive.

    Attributes:
        kp: Stiffness that the commands bring, shape (na,), Nm/rad.
        kd: Damping that the commands bring, shape (na,), Nms/rad.
        q: Joint positions of the last references, shape (na,), rad.
        v: Joint velocities of the last references, shape (na,), rad/s.
    """

    @checked
    def __init__(
        self,
        controller: Controller,
        observer: Observer | None = None,
        policy: FailurePolicy | None = None,
        *,
        kp: Array | None = None,
        kd: Array | None = None,
        reference_time: float = 0.02,
        prepare: Prepare | None = None,
        safety: SafetySettings | None = None,
    ) -> None:
        """Connect a controller to its observer.

        Args:
            controller: The controller.
            observer: Observer of the same robot model; a new one when None.
            policy: Reaction to failures.
            kp: Stiffness of the machine's servos, shape (na,), Nm/rad; that of the robot's description when None, and
                a soft share of what is derived there (`Servos.soft`).
            kd: Damping of the machine's servos, shape (na,), Nms/rad; likewise.
            reference_time: Time constant with which the position references are drawn to the estimate, s; 0 starts
                them from the estimate in every tick.
            prepare: Function called once a tick before the QP is solved.
            safety: Ranges of measurements and commands.

        Raises:
            InputError: An observer of another robot model, gains that are negative or missing, a negative time.
        """
        super().__init__(controller, observer, policy, prepare=prepare, safety=safety)
        robot = controller.robot
        if kp is None or kd is None:
            if robot.servos is None:
                raise InputError(f"give kp and kd: the gains of the servos of {robot!r} are not known")
            soft = robot.servos.soft()
            kp, kd = soft[0] if kp is None else kp, soft[1] if kd is None else kd
        self.kp, self.kd = _gains("kp", kp, robot.na), _gains("kd", kd, robot.na)
        self._pull = lag_gain(controller.dt, non_negative("reference time (s)", reference_time))
        self._dt = scalar(controller.dt)
        self._off = np.zeros(robot.na)
        self.q, self.v = np.array(robot.q[7:]), np.zeros(robot.na)

    def reset(self, q: Array | None = None) -> None:
        """Restart from a configuration at rest.

        Args:
            q: Configuration, shape (nq,); half-sitting when None.
        """
        super().reset(q)
        self.q[:], self.v[:] = self.controller.robot.q[7:], 0.0

    def command(self, measurement: Measurement) -> Command:
        """Run one tick.

        Args:
            measurement: Measurement of this tick.

        Returns:
            References that the servos should reach at the next tick, feed-forward torques and gains. Nothing is raised:
            a failed tick holds references and torques while the servos damp; after `FailurePolicy.stop_after` the
            joints are only damped.
        """
        robot, gains = self.controller.robot, (self.kp, self.kd)
        good = self._think(measurement)
        last = self.measurement  # None before the first good one
        position = self.q if last is None else last.joint_position
        measured = position, self.plausibility.joint_velocity(measurement)
        torques = self._torques
        if good:
            assert self.solution is not None
            velocity = robot.v[BASE_DOF:]
            step = self.solution.accelerations[BASE_DOF:] * self._dt
            self.q += self._pull * (robot.q[7:] - self.q)
            self.v += self._pull * (velocity - self.v)
            self.q += (self.v + 0.5 * step) * self._dt
            self.v += step
        elif self.stopped:
            damping = self.policy.joint_damping * np.minimum(robot.torque_limit, 1e6)
            gains, torques = (self._off, np.maximum(self.kd, damping)), self._off
            self.q[:], self.v[:] = measured[0], 0.0
        else:
            self.v[:] = 0.0
        command = self.gate.pass_on_with_gains(torques, self.q.copy(), self.v.copy(), gains, measured)
        if self.gate.faults:
            assert command.joint_position is not None and command.joint_velocity is not None
            self.q[:], self.v[:] = command.joint_position, command.joint_velocity
        return self._send(command)


def _gains(name: str, value: Array, joints: int) -> Array:
    gains = finite_array(f"{name} of the servos", value, (joints,))
    if (gains < 0.0).any():
        raise InputError(f"{name} of the servos must not be negative, got {gains.min():g}")
    gains.setflags(write=False)
    return gains
