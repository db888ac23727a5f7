"""Position servos in the drives of a robot: their gains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array

SOFT_SHARE = 0.03
"""Share of derived gains that hybrid control asks of a machine whose own gains are not known.

Derived gains hold a robot by position servos alone, 13 m g h at hips and knees; three hundredths of them are the gains
at which a G1 is driven: 86 Nm/rad there (60 to 150 in the examples of its maker), 43 at the ankles (40).
"""


ANKLE_SHARE = 0.4
"""Least kp of each ankle joint in position control, as a multiple of m g h.

In trial walks of a G1 with noisy sensors servos of 0.39 m g h walked, servos of 0.2 fell at the first step.
"""


@dataclass(frozen=True, eq=False, slots=True)
class Servos:
    """Position servos in the drives of a robot: each applies kp (q_ref − q) + kd (q̇_ref − q̇) + τ.

    Attributes:
        given: Joints whose gains are those of the machine; those of the others are derived from the robot's inertia.
        tipping: m g h of the robot at half-sitting, Nm/rad: the stiffness of the ankles below which it tips over.
    """

    kp: Array  # stiffness of each joint, shape (na,), Nm/rad (or N/m)
    kd: Array  # damping of each joint, shape (na,), Nms/rad (or Ns/m)
    given: frozenset[str]
    joint_names: tuple[str, ...]  # joints in the order of the gains, length na
    ankles: tuple[str, ...] = ()  # joints next to the soles
    tipping: float = 0.0

    def __post_init__(self) -> None:
        for name in ("kp", "kd"):
            value = finite_array(f"{name} of the servos", getattr(self, name), (len(self.joint_names),))
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    @property
    def soft_ankle(self) -> str | None:
        """Ankle joint whose given stiffness is too small for position control; None if there is none."""
        needed = ANKLE_SHARE * self.tipping
        for name in self.ankles:
            if name in self.given and self.kp[self.joint_names.index(name)] < needed:
                return name
        return None

    def check_position_control(self) -> None:
        """Refuse position control on servos that are too soft for it.

        The error names an ankle whose kp is given and too small, the number needed and the mode to use.
        """
        if (ankle := self.soft_ankle) is not None:
            kp = self.kp[self.joint_names.index(ankle)]
            raise InputError(
                f"position control needs a kp of {ANKLE_SHARE * self.tipping:.0f} Nm/rad or more at each ankle "
                f"({ANKLE_SHARE:g} m g h), '{ankle}' has {kp:g}: use hybrid control"
            )

    def soft(self) -> tuple[Array, Array]:
        """Return kp and kd for hybrid control: given ones as they are, `SOFT_SHARE` of derived ones."""
        share = np.array([1.0 if name in self.given else SOFT_SHARE for name in self.joint_names])
        return share * self.kp, share * self.kd
