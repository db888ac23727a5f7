"""The paper's soft foot, passive or with a stiffness to set: a chain of phalanges under two arches."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from wbc.base.numbers import Array
from wbc.base.settings import Count, settings
from wbc.feet.soles.actuator import StiffnessActuator
from wbc.feet.soles.foot import FootParts
from wbc.feet.soles.soft_design import SoftDesign
from wbc.feet.soles.sole import AnkleSole


@settings
class SoftFoot(SoftDesign):
    """The soft foot of the paper: phalanges on springs under a two-part arch.

    Its attributes are those of `SoftDesign`.
    """

    def build(self, spec: Any, ankle_body: Any, side: str, sole: AnkleSole) -> FootParts:
        """Add the foot to a MuJoCo model; see `Foot.build`."""
        from wbc.feet.soles.soft_mjcf import SoftFootBuilder  # noqa: PLC0415 - only `build` needs MuJoCo

        return SoftFootBuilder(spec, ankle_body, side, self, self.fit(sole)).build()


@settings
class LongArchFoot(SoftFoot):
    """The soft foot with a frontal arch that reaches to the toe.

    In the paper's foot the two phalanges in front of the frontal arch carry only the load that their hinges transmit;
    here the arch holds the toe itself. On a rig at least a tenth more of the sole is on the ground, at any stiffness,
    and walks over rough ground fall forward less often.

    Attributes:
        loop_phalanx: Phalanx, counted from the toe, that the frontal arch holds.
    """

    loop_phalanx: Count = 1


@settings
class VariableStiffnessFoot(SoftFoot):
    """The soft foot with an actuator that sets the stiffness of its sole during a walk.

    Attributes:
        stiffness: Stiffness at the start, Nm/rad; within the range of the actuator.
        actuator: Rate limit, lag and range of the stiffness.
    """

    actuator: StiffnessActuator = field(default_factory=StiffnessActuator)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.actuator.check(self.stiffness)


@settings
class PaperFoot(VariableStiffnessFoot):
    """The variable foot with the paper's range of stiffness, 0 to 80 Nm/rad, and its actuator, which acts at once.

    Attributes:
        actuator: Rate limit, lag and range of the stiffness.
    """

    actuator: StiffnessActuator = field(default_factory=StiffnessActuator.instantaneous)


def toe_sensor(foot: SoftFoot) -> Array:
    """Return the position of a soft foot's range sensor, the middle of its toe, in the sole frame, shape (3,), m."""
    return np.array([(foot.length - foot.length / foot.phalanges) / 2.0, 0.0, foot.hinge_height])
