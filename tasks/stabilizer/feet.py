"""Two feet that carry out what a stabilizer says, by the kind of commands to the drives.

On torques the feedback's horizontal acceleration of the CoM is the reference of the task of the CoM, and the desired
wrenches are a cost on the wrenches of the contacts. On positions the QP moves the commanded robot: the CoM follows the
pendulum, and standing feet follow their admittances, while the desired wrenches make the feed-forward torques
(`DriveControl.act`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.qp.contact import SoleContact
from wbc.tasks.force.wrench import WrenchTask
from wbc.tasks.stabilizer.distribution import LEAST_SHARE
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.tasks.stabilizer.stabilizer import StabilizerOutput


class StabilizedFeet:
    """Contacts of two feet, and with torque drives tasks on their wrenches.

    Attributes:
        contacts: Contacts of the left and of the right sole.
        parts: Tasks on the wrenches of the contacts; none with position drives.
        torque: True with torque drives.
    """

    def __init__(
        self, contacts: Sequence[SoleContact], *, torque: bool, weight: float, by_load: bool
    ) -> None:
        """Describe the feet, with the cost of deviations from the desired wrenches, per N² and (Nm)².

        The moments of two feet are weighed `by_load`, or alike; see `DistributionSettings.by_load`.
        """
        self.contacts, self.torque, self._by_load = tuple(contacts), torque, by_load
        self.parts = tuple(WrenchTask(contact, weight=weight) for contact in contacts) if torque else ()

    def swap(self) -> None:
        """Take the contacts in the other order."""
        self.contacts, self.parts = self.contacts[::-1], self.parts[::-1]

    def wrenches(self, output: StabilizerOutput) -> dict[str, Array]:
        """Return contact → its desired wrench, shape (6,), N and Nm."""
        left, right = self.contacts
        return {left.name: output.feet.wrenches[0], right.name: output.feet.wrenches[1]}

    def follow(self, output: StabilizerOutput, contact: tuple[bool, bool], places: Sequence[pin.SE3]) -> None:
        """Set the references of the feet in contact for one tick, whose soles are planned at their places."""
        for side, stands in enumerate(contact):
            if not stands:
                continue
            if not self.torque:
                self.contacts[side].follow(*output.corrections[side].apply(places[side]))
                continue
            self.parts[side].follow(output.feet.wrenches[side])
            if self._by_load:  # moments by the inverse square of the foot's load over the sum
                scale, (left, right) = np.ones(6), output.feet.wrenches[:, 2].tolist()
                if all(contact):
                    share = max((left, right)[side] / max(left + right, 1.0), LEAST_SHARE)
                    scale[3:] = (0.5 / share) ** 2
                self.parts[side].scale = scale

    def com_acceleration(
        self, output: StabilizerOutput, target: Pendulum, wanted: Array | None = None
    ) -> Array:
        """Return the acceleration that the CoM is to have, shape (3,), m/s².

        Where the CoM is wanted to have another acceleration than that of the pendulum, the feedback is about that one.
        """
        planned = target.com_acceleration
        acceleration = planned if wanted is None else wanted
        if not self.torque:
            return acceleration
        beyond = acceleration[:2] - planned[:2]
        acceleration = acceleration.copy()
        acceleration[:2] = output.com_acceleration[:2] + beyond
        return acceleration
