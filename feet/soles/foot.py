"""`Foot`: base class of foot designs, fitted under an ankle and built into a MuJoCo model."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import field
from typing import Annotated, Any

from wbc.core.errors import InputError
from wbc.core.settings import Positive, settings
from wbc.feet.soles.contact import ContactSpheres
from wbc.feet.soles.parts import FootParts
from wbc.feet.soles.sole import FootFit, SoleGeometry


@settings
class Foot(ABC):
    """A foot design.

    `fit` returns everything that a controller needs, without a simulator; `build` adds the foot to a MuJoCo model. A
    foot of your own is a frozen dataclass that derives from this class and implements both.

    Attributes:
        contact: Contact spheres of the sole.
    """

    contact: ContactSpheres = field(default_factory=ContactSpheres)

    @abstractmethod
    def fit(self, sole: SoleGeometry) -> FootFit:
        """Return the foot in place of the robot's own sole.

        Args:
            sole: The robot's own sole.

        Raises:
            InputError: The foot does not fit this ankle; the message names the numbers.
        """

    @abstractmethod
    def build(self, spec: Any, ankle_body: Any, side: str, sole: SoleGeometry) -> FootParts:
        """Add the foot to a MuJoCo model under construction.

        The robot's own sole geoms must have been removed from the ankle body.

        Args:
            spec: `mujoco.MjSpec` of the robot.
            ankle_body: `mujoco.MjsBody` that carries the foot.
            side: "left" or "right".
            sole: The robot's own sole.

        Returns:
            Names of the added parts.

        Raises:
            InputError: The foot does not fit this ankle.
        """


LARGEST_FOOT = 2.0
"""Largest length, width and height of a foot, m."""


def fitted_sole(
    sole: SoleGeometry,
    *,
    length: Annotated[Positive, "m"],
    width: Annotated[Positive, "m"],
    ankle_behind: float,
    ankle_height: Annotated[Positive, "m"] | None = None,
    min_height: float,
) -> SoleGeometry:
    """Return the rectangle of a foot under an ankle, oriented and laterally placed as the robot's own sole.

    Args:
        sole: The robot's own sole.
        length: Extent of the foot along x, m.
        width: Extent along y, m.
        ankle_behind: Distance from the ankle forward to the sole centre, m.
        ankle_height: Height of the ankle over the sole, m; None takes the robot's own or, if larger, `min_height`.
        min_height: Smallest height of the ankle that leaves room for the foot, m.

    Raises:
        InputError: The foot does not fit this ankle.
    """
    own_height = float(sole.ankle[2])
    if ankle_height is None:
        height = max(own_height, min_height)
    else:
        height = ankle_height
        if height < min_height:
            raise InputError(
                f"the foot does not fit under '{sole.ankle_link}': it needs an ankle at least "
                f"{min_height:.4f} m over the sole, got {height:.4f} m "
                f"(the robot's own is {own_height:.4f} m)"
            )
    if max(length, width, height) > LARGEST_FOOT:
        raise InputError(
            f"length, width and ankle height of a foot must be at most {LARGEST_FOOT:g} m, got {length:g}, {width:g} "
            f"and {height:g} m"
        )
    lateral = float(sole.ankle[1])
    if abs(ankle_behind) > length / 2.0 or abs(lateral) > width / 2.0:
        raise InputError(
            f"the foot does not fit under '{sole.ankle_link}': the ankle lies {ankle_behind:.4f} m behind and "
            f"{lateral:.4f} m beside the centre of a sole of {length:.4f} x {width:.4f} m, outside it"
        )
    if sole.spacing is not None and width >= sole.spacing:
        raise InputError(
            f"the foot does not fit under '{sole.ankle_link}': soles {width:.4f} m wide overlap, "
            f"their centres are {sole.spacing:.4f} m apart"
        )
    ankle_in_sole = (-ankle_behind, lateral, height)
    translation = -(sole.rotation_matrix @ ankle_in_sole)
    return SoleGeometry(
        sole.ankle_link, tuple(translation.tolist()), sole.rotation, length, width, spacing=sole.spacing
    )
