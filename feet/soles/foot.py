"""`Foot`, base class of foot designs; the sole that it is fitted to, its fit, and its parts in a MuJoCo model."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, Number, Positive, settings
from wbc.feet.soles.contact import ContactSpheres


@settings
class AnkleSole:
    """A rectangular sole seen from its ankle: all that a foot needs to be fitted and built.

    It names no robot, so that a test rig has one too. A robot's `wbc.core.frames.Sole` is a named frame in any link of
    its model; `wbc.sim.plant.fitting.ankle_soles` makes these from it.

    The sole frame has its origin at the centre of the rectangle, x forward, y left, z away from the ground.
    The ankle is the origin of the ankle link, on the axis of the last joint.

    Attributes:
        ankle_link: Body that carries the sole.
        translation: Sole centre in the ankle link, m.
        rotation: Sole axes in the ankle link, unit quaternion xyzw.
        length: Extent along x, m.
        width: Extent along y, m.
        spacing: Lateral distance between the two sole centres when standing, m; None leaves it unchecked.
    """

    ankle_link: str
    translation: Annotated[tuple[float, float, float], "m"]
    rotation: tuple[float, float, float, float]
    length: Annotated[Positive, "m"]
    width: Annotated[Positive, "m"]
    spacing: Annotated[Positive, "m"] | None = None

    def __post_init__(self) -> None:
        if abs(np.linalg.norm(self.rotation) - 1.0) > 1e-6:
            raise InputError(f"sole rotation must be a unit quaternion xyzw, got {self.rotation}")
        if self.ankle[2] <= 0.0:
            raise InputError(
                f"the ankle of '{self.ankle_link}' must lie above its sole, got a height "
                f"of {self.ankle[2]:.4f} m"
            )

    @property
    def rotation_matrix(self) -> Array:
        """Sole axes in the ankle link, shape (3, 3)."""
        return np.asarray(Rotation.from_quat(self.rotation).as_matrix(), dtype=np.float64)

    @property
    def placement(self) -> pin.SE3:
        """Sole frame in the ankle link."""
        return pin.SE3(self.rotation_matrix, np.array(self.translation))

    @property
    def ankle(self) -> Array:
        """Origin of the ankle link in the sole frame, shape (3,), m."""
        return np.asarray(-self.rotation_matrix.T @ np.array(self.translation))

    @classmethod
    def under_ankle(cls, ankle_height: float, length: float, width: float) -> AnkleSole:
        """Return a level sole below an upright link "ankle", its centre under it; all in m."""
        return cls("ankle", (0.0, 0.0, -ankle_height), (0.0, 0.0, 0.0, 1.0), length, width)


TOE_HEIGHT = 0.02
"""Height of the range sensors at the toe over the sole, m."""


@checked
@dataclass(frozen=True)
class FootFit:
    """Data of a foot under an ankle, for the models of controller and plant.

    Attributes:
        sole: Rectangle that replaces the robot's own sole, for the contacts of a controller.
        added_inertia: Inertia that the foot in its rest shape adds to the ankle link, along the axes and at the origin
            of this link. The controller's model may include it, or leave it out as in the paper.
        toe_sensors: Positions of the downward range sensors at the toe in the sole frame, m. When None, there are three
            over the front edge: at both corners and in the middle. (The single sensor of the paper is
            `FootParts.range_site`.)
    """

    sole: AnkleSole
    added_inertia: pin.Inertia = field(compare=False)
    toe_sensors: tuple[tuple[float, float, float], ...] | None = None

    def __post_init__(self) -> None:
        if self.toe_sensors is None:
            x, y = 0.5 * self.sole.length, 0.5 * self.sole.width
            object.__setattr__(self, "toe_sensors", tuple((x, side, TOE_HEIGHT) for side in (-y, 0.0, y)))


def box_inertia(mass: float, size: ArrayLike, centre: ArrayLike) -> pin.Inertia:
    """Return the inertia of a uniform box, kg, with full extents `size`, shape (3,), m, in the frame of its centre."""
    x, y, z = np.asarray(size, dtype=np.float64)
    spread = mass / 12.0 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y])
    return pin.Inertia(mass, np.asarray(centre, dtype=np.float64), spread)


def bar_inertia(
    mass: float, start: ArrayLike, end: ArrayLike, *, width: float, thickness: float
) -> pin.Inertia:
    """Return the inertia of a uniform bar, kg, between two points of the x–z plane, shape (3,), m.

    Its section is a rectangle: `width` is the extent along y, `thickness` that across it in the x–z plane, m.
    """
    a, b = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    along = b - a
    pitch = np.arctan2(-along[2], along[0])
    placement = pin.SE3(Rotation.from_euler("y", pitch).as_matrix(), (a + b) / 2.0)
    size = (float(np.linalg.norm(along)), width, thickness)
    return placement.act(box_inertia(mass, size, np.zeros(3)))


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
        """Return the data of the foot under an ankle, in place of the robot's own sole."""

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
