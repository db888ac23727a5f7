"""What every foot is: a frozen description that is fitted under an ankle and built into a simulator model."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any

from wbc.core.errors import InputError, finite_scalar, positive
from wbc.feet.soles.contact import ContactSpheres
from wbc.feet.soles.model import FootParts
from wbc.feet.soles.sole import FootFit, SoleGeometry


@dataclass(frozen=True)
class Foot(ABC):
    """A foot design.

    `fit` needs no simulator and says everything that a controller has to know. `build` adds the foot to a
    MuJoCo model. A foot of your own derives from this class and implements both.

    Attributes:
        contact: How the sole touches the ground.
    """

    contact: ContactSpheres = field(default_factory=ContactSpheres)

    @property
    def rotation_stiffness(self) -> float:
        """Torque per angle between ankle and flat ground under a walking robot, Nm/rad; infinite for a rigid sole."""
        return math.inf

    @abstractmethod
    def fit(self, sole: SoleGeometry) -> FootFit:
        """Put the foot in the place of a robot's own sole.

        Args:
            sole: The robot's own sole.

        Raises:
            InputError: The foot does not fit this ankle; the message names the numbers.
        """

    @abstractmethod
    def build(self, spec: Any, ankle_body: Any, side: str, sole: SoleGeometry) -> FootParts:
        """Add the foot to a MuJoCo model under construction.

        The robot's own sole geoms must have been taken off the ankle body before.

        Args:
            spec: `mujoco.MjSpec` of the robot.
            ankle_body: `mujoco.MjsBody` that carries the foot.
            side: "left" or "right".
            sole: The robot's own sole.

        Returns:
            Names of everything that was added.

        Raises:
            InputError: The foot does not fit, or the model is set up so that its force sensor would be lost.
        """


def fitted_sole(
    own: SoleGeometry,
    *,
    length: float,
    width: float,
    ankle_behind: float,
    ankle_height: float | None = None,
    least_height: float,
) -> SoleGeometry:
    """The rectangle of a foot under an ankle: same orientation and lateral position as the robot's own sole.

    Args:
        own: The robot's own sole.
        length: Extent of the foot along x, m.
        width: Extent along y, m.
        ankle_behind: Distance from the ankle forward to the sole centre, m.
        ankle_height: Wanted height of the ankle over the sole, m; None takes the robot's own, or
            `least_height` where that is too low.
        least_height: Height that the foot needs, m.

    Raises:
        InputError: The foot does not fit this ankle.
    """
    positive("foot length (m)", length)
    positive("foot width (m)", width)
    finite_scalar("ankle position behind the sole centre (m)", ankle_behind)
    own_height = float(own.ankle[2])
    if ankle_height is None:
        height = max(own_height, least_height)
    else:
        height = positive("ankle height over the sole (m)", ankle_height)
        if height < least_height:
            raise InputError(
                f"the foot does not fit under '{own.ankle_link}': it needs an ankle at least "
                f"{least_height:.4f} m over the sole, got {height:.4f} m "
                f"(the robot's own is {own_height:.4f} m)"
            )
    lateral = float(own.ankle[1])
    if abs(ankle_behind) > length / 2.0 or abs(lateral) > width / 2.0:
        raise InputError(
            f"the foot does not fit under '{own.ankle_link}': the ankle lies {ankle_behind:.4f} m behind and "
            f"{lateral:.4f} m beside the centre of a sole of {length:.4f} x {width:.4f} m, outside it"
        )
    if own.spacing is not None and width >= own.spacing:
        raise InputError(
            f"the foot does not fit under '{own.ankle_link}': soles {width:.4f} m wide overlap, "
            f"their centres are {own.spacing:.4f} m apart"
        )
    ankle_in_sole = (-ankle_behind, lateral, height)
    translation = -(own.rotation_matrix @ ankle_in_sole)
    return SoleGeometry(
        own.ankle_link, tuple(translation.tolist()), own.rotation, length, width, spacing=own.spacing
    )
