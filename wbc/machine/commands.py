"""Commands changed on their way to a machine: gains filled in, two of them mixed, released joints held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbc.base.numbers import Array
from wbc.core.signals import Command


def with_gains(command: Command, gains: tuple[Array, Array]) -> Command:
    """Return a command with the gains that act where it brings none: the machine's, zero without a position."""
    none = np.zeros(len(command.joint_torque))
    kp, kd = command.gains((none, none) if command.joint_position is None else gains)
    return replace(command, kp=kp, kd=kd)


def references(command: Command, position: Array) -> tuple[Array, Array]:
    """Return position and velocity references of a command; where it has none, the position, shape (na,), and zero."""
    q, v = command.joint_position, command.joint_velocity
    return position if q is None else q, np.zeros_like(position) if v is None else v


def mixed(first: Command, second: Command, part: float) -> Command:
    """Return a command between two by what they do to the joints: torques, gains and servo torques in proportion.

    At `part` 0 it is the first, which has references and gains as the second has gains, from 1 on the second.
    """
    if part >= 1.0:
        return second
    a, b, zero = 1.0 - part, part, np.zeros_like(second.joint_torque)
    (kp1, kd1), (kp2, kd2) = first.gains((zero, zero)), second.gains((zero, zero))
    q1, v1 = references(first, zero)
    q2, v2 = references(second, q1)
    kp, kd = a * kp1 + b * kp2, a * kd1 + b * kd2
    # kp q = a kp1 q1 + b kp2 q2: the servos' torque is between both as well.
    q = np.divide(a * kp1 * q1 + b * kp2 * q2, kp, out=np.array(q2), where=kp > 0.0)
    v = np.divide(a * kd1 * v1 + b * kd2 * v2, kd, out=np.array(v2), where=kd > 0.0)
    torque = a * first.joint_torque + b * second.joint_torque
    return replace(second, joint_torque=torque, joint_position=q, joint_velocity=v, kp=kp, kd=kd)


class Parking:
    """Joints that somebody else is to move on a wire of which every motor gets its command: they are never limp."""

    def __init__(self, gains: tuple[Array, Array]) -> None:
        """Hold joints with gains kp and kd, each of shape (na,)."""
        self._gains = gains
        self._parked = np.zeros(gains[0].size, dtype=bool)
        self._place = np.zeros(gains[0].size)

    def hold(self, command: Command, position: Array) -> Command:
        """Return a command for all joints: those that are released stay where they were at first, shape (na,), rad."""
        released = command.released
        if released is None:
            self._parked[:] = False
            return command
        self._place = np.where(released & self._parked, self._place, position)
        self._parked = released.copy()
        q, v = references(command, position)
        whole = with_gains(command, self._gains)
        (own_kp, own_kd), (kp, kd) = self._gains, whole.gains(self._gains)
        return replace(
            whole,
            joint_torque=np.where(released, 0.0, whole.joint_torque),
            joint_position=np.where(released, self._place, q),
            joint_velocity=np.where(released, 0.0, v),
            kp=np.where(released, own_kp, kp),
            kd=np.where(released, own_kd, kd),
            released=None,
        )
