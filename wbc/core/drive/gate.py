"""Gate at the way out of a control: no command leaves that exceeds a torque limit, a joint's range or its speed.

A law with servo gains of its own, such as a policy, may put references beyond a range: only their torque is bounded.
A command owns its arrays: what a driver does to them changes nothing here.
"""

from __future__ import annotations

import logging
import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wbc.base.errors import InputError, shown
from wbc.base.numbers import ROUNDING, Array
from wbc.base.vectors import largest
from wbc.core.robot import Robot
from wbc.core.signals import Command

logger = logging.getLogger(__name__)

SPEED_MARGIN = 2.0
"""Multiple of a joint's speed limit by which a position reference may change; a velocity reference is clipped there."""

SLACK = 1e-6
"""Share of a limit beyond it that is clipped without being reported: the QP meets its limits to 1e-6."""


class CommandGate:
    """Checks every command and clips what exceeds a limit.

    Attributes:
        faults: Names of the joints whose command was clipped last, empty if the last command passed as it was.
        period: Control period, s.
    """

    def __init__(self, robot: Robot, dt: float) -> None:
        """Take the limits from a robot; dt is the control period, s."""
        self._names = robot.joint_names
        self._least, self._most = robot.torque_lower, robot.torque_upper
        slack = SLACK * robot.torque_limit
        self._clipped_below, self._clipped_above = self._least - slack, self._most + slack
        self._lower, self._upper = robot.position_lower, robot.position_upper
        self._speed = SPEED_MARGIN * robot.velocity_limit
        self._step, self.period = self._speed * dt, dt
        # By how much velocity, change of position, position and torque exceed their limits; the last two twice.
        self._excess = np.zeros((6, robot.na))
        self._symmetric, self._torques = self._excess[:2], self._excess[4:].reshape(-1)
        self._all = self._excess.reshape(-1)
        self._bounds = np.array((self._speed, self._step))
        self.reset(robot.q[robot.base_nq :])

    def reset(self, position: Array) -> None:
        """Start from a posture, joint positions of shape (na,), from which the first references move."""
        self._position = np.array(position)
        self._told = False  # that commands are clipped
        self.faults: tuple[str, ...] = ()

    def move(self, position: Array) -> None:
        """Let the next reference move from a posture, shape (na,), which a law has sent or where the joints are."""
        self._position[:] = position

    def pass_on_with_gains(
        self,
        torque: Array,
        position: Array,
        velocity: Array,
        gains: tuple[Array, Array],
        measured: tuple[Array, Array],
    ) -> Command:
        """Return a hybrid command within all limits; `gains` are kp and kd, `measured` are q and q̇ of the joints.

        The torque limit holds for what the machine will apply where the joints are now, and for the feed-forward alone:
        the feed-forward gives way, and where its own limit does not let it, the gains do. A joint whose q or q̇ is not
        finite, unknown, may be anywhere, and as fast as the gate lets a reference be: its gains stay within the limit
        then.
        """
        # References first: what they are clipped to decides what the servos do.
        sent = self.pass_on(np.zeros_like(torque), position, velocity)
        faults = self.faults
        assert sent.joint_position is not None and sent.joint_velocity is not None
        reference = sent.joint_position, sent.joint_velocity
        torque, (kp, kd), beyond = self._with_servos(torque, reference, gains, measured)
        if beyond is not None:
            self._report(beyond, faults)
        return Command(torque.copy(), *reference, kp=kp.copy(), kd=kd.copy(), period=self.period)

    def _with_servos(
        self,
        torque: Array,
        reference: tuple[Array, Array],
        gains: tuple[Array, Array],
        measured: tuple[Array, Array],
    ) -> tuple[Array, tuple[Array, Array], NDArray[np.bool_] | None]:
        """Return feed-forward and gains within the torque limits together, and the joints that were beyond them.

        These are None where nothing has given way, and no joint where rounding alone has.
        """
        kp, kd = gains
        if not math.isfinite(measured[0].dot(measured[1])):
            torque, kp, kd, measured = self._without_state(torque, reference, gains, measured)
        servo = kp * (reference[0] - measured[0])
        servo += kd * (reference[1] - measured[1])
        total = torque + servo
        least, most = np.minimum(total, torque), np.maximum(total, torque)
        if (least >= self._least).all() and (most <= self._most).all():
            return torque, (kp, kd), None
        beyond = ~((least >= self._clipped_below) & (most <= self._clipped_above))
        least, most, servo = self._least, self._most, np.nan_to_num(servo, nan=0.0)
        torque = np.clip(np.nan_to_num(total, nan=0.0), least, most) - servo
        torque = np.clip(torque, least, most)  # servos may ask for more, as on a wrong velocity
        # Feed-forward at one limit, and servos that ask for the other at most: the gains give way last.
        share = np.minimum(1.0, (most - least) / np.maximum(np.abs(servo), ROUNDING))
        return torque, (share * kp, share * kd), beyond

    def _without_state(
        self,
        torque: Array,
        reference: tuple[Array, Array],
        gains: tuple[Array, Array],
        measured: tuple[Array, Array],
    ) -> tuple[Array, Array, Array, tuple[Array, Array]]:
        """Return torque, gains, and q and q̇ to count with, so that no unknown q and q̇ lead beyond a limit."""
        (q, v), (position, velocity), (kp, kd) = measured, reference, gains
        least, most = self._least, self._most
        lost, unseen = ~np.isfinite(q), ~np.isfinite(v)
        q, kp = np.where(lost, position, q), np.where(lost, 0.0, kp)
        servo = kp * (position - q)
        torque = np.where(unseen, np.clip(np.clip(torque + servo, least, most) - servo, least, most), torque)
        total = torque + servo
        room = np.maximum(np.minimum(most - total, total - least), 0.0)
        fastest = self._speed + np.abs(velocity)
        kd = np.where(unseen, np.minimum(kd, room / np.maximum(fastest, ROUNDING)), kd)
        return torque, kp, kd, (q, np.where(unseen, velocity, v))

    def admit(
        self, command: Command, measured: tuple[Array, Array], clipped: tuple[str, ...] = ()
    ) -> Command:
        """Return a command of any origin with torques within the limits, its own gains at the measured joints counted.

        References of servos whose gains the command leaves to the machine stay in the range of each joint, or where it
        is beyond that, and below the speed at which they are clipped. A joint whose q or q̇ is not finite is treated as
        in `pass_on_with_gains`. `clipped` names joints that were clipped while the command was made, which count among
        its `faults`. Raises `InputError` for what is no `Command`, and for what no drive must get (`Command.check`).
        """
        if not isinstance(command, Command):
            raise InputError(f"a control must return a wbc.Command, got {shown(command)}")
        command = command.check(self._names).copy()
        torque, position, velocity = command.joint_torque, command.joint_position, command.joint_velocity
        kp, kd = command.kp, command.kd
        if position is not None and velocity is None:
            velocity = np.zeros_like(position)
        q, v = np.where(np.isfinite(measured), measured, np.nan)
        if kp is None or kd is None or position is None or velocity is None:
            last = np.where(np.isnan(q), self._position, q)
            sent = self._clip((torque, position, velocity), last, np.inf, clipped)
            position, velocity = sent.joint_position, sent.joint_velocity
            return replace(
                command, joint_torque=sent.joint_torque, joint_position=position, joint_velocity=velocity
            )
        self.faults = clipped
        torque, (kp, kd), beyond = self._with_servos(torque, (position, velocity), (kp, kd), (q, v))
        if beyond is not None:
            self._report(beyond, clipped)
        return replace(command, joint_torque=torque, kp=kp, kd=kd)

    def pass_on(self, torque: Array, position: Array | None = None, velocity: Array | None = None) -> Command:
        """Return a command within all limits, of torques and references, shape (na,), in the units of a `Command`.

        In torque control references are None. What is not finite becomes a torque or velocity of zero, or the last
        position reference.
        """
        excess = self._excess
        np.subtract(torque, self._most, out=excess[4])
        np.subtract(self._least, torque, out=excess[5])
        if position is None or velocity is None:
            most = largest(self._torques)
        else:
            symmetric = self._symmetric
            excess[0] = velocity
            np.subtract(position, self._position, out=excess[1])
            np.abs(symmetric, out=symmetric)
            symmetric -= self._bounds
            np.subtract(position, self._upper, out=excess[2])
            np.subtract(self._lower, position, out=excess[3])
            most = largest(self._all)
        if not most <= 0.0:  # or NaN
            return self._clip((torque, position, velocity), self._position, self._step)
        self.faults = ()
        if position is None or velocity is None:
            return Command(torque.copy(), period=self.period)
        self._position[:] = position
        return Command(torque.copy(), position.copy(), velocity.copy(), period=self.period)

    def _clip(
        self,
        asked: tuple[Array, Array | None, Array | None],
        last: Array,
        step: Array | float,
        before: tuple[str, ...] = (),
    ) -> Command:
        """Return a command of torque and references, moved from a posture by a step at most; see `_report`.

        The posture, where a robot begins or is, may itself be out of range.
        """
        torque, position, velocity = asked
        wrong = ~((torque >= self._clipped_below) & (torque <= self._clipped_above))
        torque = np.clip(np.nan_to_num(torque, nan=0.0), self._least, self._most)
        if position is not None and velocity is not None:
            near = np.clip(np.where(np.isnan(position), last, position), last - step, last + step)
            sent = np.clip(near, np.minimum(self._lower, last), np.maximum(self._upper, last))
            wrong |= ~(np.abs(sent - position) <= 1e-6) | ~(np.abs(velocity) <= (1.0 + SLACK) * self._speed)
            velocity = np.clip(np.nan_to_num(velocity, nan=0.0), -self._speed, self._speed)
            position = sent
            self._position[:] = sent
        self._report(wrong, before)
        return Command(torque, position, velocity, period=self.period)

    def _report(self, wrong: NDArray[np.bool_], before: tuple[str, ...] = ()) -> None:
        """Take over the joints that were clipped, beside those of the same command that are counted already."""
        found = [self._names[i] for i in wrong.nonzero()[0]]
        self.faults = (*before, *(name for name in found if name not in before))
        if self.faults and not before:
            if not self._told:
                logger.info("command clipped at its limits: %s", ", ".join(self.faults))
            self._told = True
