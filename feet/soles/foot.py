"""`Foot`: base class of foot designs, fitted under an ankle and built into a MuJoCo model as `FootParts`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Annotated, Any

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.settings import NonNegative, Number, Positive, settings
from wbc.feet.soles.contact import ContactSpheres
from wbc.feet.soles.sole import AnkleSole, FootFit


@dataclass(frozen=True)
class FootParts:
    """Names of a built foot's body, sites, sensors, geoms and joints in its MuJoCo model.

    Attributes:
        fit: Rectangle, inertia and height of the foot under its ankle.
        body: Body welded to the ankle link, root of all other bodies of the foot; its frame is the sole frame.
        wrench_site: Site of the force sensor, at the sole centre in sole axes.
        force_sensor: Reversed force of the foot on the ankle link, along the axes of the sole, N; the force of the
            ground has the opposite sign.
        torque_sensor: Reversed moment of the foot on the ankle link about the sole centre, along the axes of the sole,
            Nm.
        range_site: Site under the toe whose z axis is the ray of the range sensor.
        contact_geoms: Spheres that touch the ground, row by row from the toe, each row from right to left.
        sole_joints: Hinges of the sole about the transverse axis, from the toe to the heel; empty for a rigid
            sole.
        variable_joints: Hinges whose stiffness follows the commanded one.
        arch_joint: Hinge of the front arch; None without an arch.
        loop_sites: Sites on the arch and on the sole that the loop closure holds together; None without an arch.
    """

    fit: FootFit
    body: str
    wrench_site: str
    force_sensor: str
    torque_sensor: str
    range_site: str
    contact_geoms: tuple[str, ...]
    sole_joints: tuple[str, ...] = ()
    variable_joints: tuple[str, ...] = ()
    arch_joint: str | None = None
    loop_sites: tuple[str, str] | None = None


@settings
class Foot(ABC):
    """Design of a foot: sole, joints and masses that take the place of the foot of a robot.

    `fit` returns the data that a controller needs, without a simulator. `build` adds the foot to a MuJoCo model. A foot
    of your own is a class with `@settings` that derives from this class and implements both methods.

    Attributes:
        contact: Contact spheres of the sole.
    """

    contact: ContactSpheres = field(default_factory=ContactSpheres)

    @abstractmethod
    def fit(self, sole: AnkleSole) -> FootFit:
        """Return the data of the foot under an ankle, in place of the robot's own sole.

        Args:
            sole: The robot's own sole.
        """

    @abstractmethod
    def build(self, spec: Any, ankle_body: Any, side: str, sole: AnkleSole) -> FootParts:
        """Add the foot to a MuJoCo model under construction.

        The robot's own sole geoms must have been removed from the ankle body.

        Args:
            spec: `mujoco.MjSpec` of the robot.
            ankle_body: `mujoco.MjsBody` that carries the foot.
            side: "left" or "right".
            sole: The robot's own sole.

        Returns:
            Names of the added parts.
        """


LARGEST_FOOT = 2.0
"""Largest length, width and height of a foot, m."""


@checked
def fitted_sole(
    sole: AnkleSole,
    *,
    length: Annotated[Positive, "m"],
    width: Annotated[Positive, "m"],
    ankle_behind: Annotated[Number, "m"],
    ankle_height: Annotated[Positive, "m"] | None = None,
    min_height: Annotated[NonNegative, "m"],
) -> AnkleSole:
    """Return the rectangle of a foot under an ankle, with the orientation and lateral place of the robot's own sole.

    Args:
        sole: The robot's own sole.
        length: Extent of the foot along x, m.
        width: Extent along y, m.
        ankle_behind: Distance by which the ankle is behind the sole centre, m.
        ankle_height: Height of the ankle over the sole, m. When None, it is that over the robot's own sole, or
            `min_height` if this is larger.
        min_height: Smallest height of the ankle that leaves room for the foot, m.
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
    return AnkleSole(
        sole.ankle_link, tuple(translation.tolist()), sole.rotation, length, width, spacing=sole.spacing
    )
