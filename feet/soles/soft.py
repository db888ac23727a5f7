"""The paper's soft foot, passive or with a stiffness to set: a chain of phalanges under two arches."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, Any

import numpy as np

from wbc.base.numbers import Array
from wbc.base.settings import Count, NonNegative, Number, Positive, settings
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
class IitSoftFoot(SoftFoot):
    """The SoftFoot of the Istituto Italiano di Tecnologia (IIT), by the figures of its public model.

    The five chains of nine phalanges act as one chain here, and the heel is its tenth phalanx. Two hinges of 0.8 Nm/rad
    and 0.04 Nms/rad that turn alike lie between two phalanges of each of the five chains: five times a half of each.
    The hinges of the arches have no springs: the sole is the tie of the arch. The tendons and the stops of the hinges
    are left out, and so is the cube with its adapter to a leg, of 0.45 kg.

    Source: C. Crotti, L. Rossini, et al., the model of arXiv 2412.03191, 2024: MuJoCo Menagerie, iit_softfoot (MIT, ©
    2024 Istituto Italiano di Tecnologia).
    """

    stiffness: Annotated[NonNegative, "Nm/rad"] = 2.0
    damping: Annotated[NonNegative, "Nms/rad"] = 0.1
    length: Annotated[Positive, "m"] = 0.265
    width: Annotated[Positive, "m"] = 0.085
    thickness: Annotated[Positive, "m"] = 0.021
    hinge_height: Annotated[NonNegative, "m"] = 0.0105
    ankle_behind: Annotated[Number, "m"] = 0.041
    ankle_height: Annotated[Positive, "m"] | None = 0.095
    arch_stiffness: Annotated[NonNegative, "Nm/rad"] = 0.0
    arch_damping: Annotated[NonNegative, "Nms/rad"] = 0.001
    phalanx_mass: Annotated[Positive, "kg"] = 0.034
    frontal_arch_mass: Annotated[Positive, "kg"] = 0.072
    backward_arch_mass: Annotated[NonNegative, "kg"] = 0.068


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
