"""`AnkleSole` and `FootFit`: a robot's own sole, and a foot fitted in its place; inertias of boxes and bars."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pydantic import BeforeValidator
from scipy.spatial.transform import Rotation

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array
from wbc.base.settings import Positive, settings


def _quaternion(rotation: Any) -> tuple[float, ...]:
    """Return a rotation, given as unit quaternion xyzw or as matrix, as unit quaternion xyzw."""
    given = finite_array("sole rotation", rotation)
    if given.shape == (3, 3):
        if not np.allclose(given @ given.T, np.eye(3), atol=1e-6) or np.linalg.det(given) < 0:
            raise InputError(f"sole rotation must be a right-handed rotation matrix, got {given.tolist()}")
        given = Rotation.from_matrix(given).as_quat()
    elif given.shape != (4,) or abs(np.linalg.norm(given) - 1.0) > 1e-6:
        raise InputError(
            f"sole rotation must be a unit quaternion xyzw or a 3 x 3 matrix, got {given.tolist()}"
        )
    return tuple(given.tolist())


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
        rotation: Sole axes in the ankle link, unit quaternion xyzw; a 3 × 3 matrix is accepted and converted.
        length: Extent along x, m.
        width: Extent along y, m.
        spacing: Lateral distance between the two sole centres when standing, m; None leaves it unchecked.
    """

    ankle_link: str
    translation: Annotated[tuple[float, float, float], "m"]
    rotation: Annotated[tuple[float, float, float, float], BeforeValidator(_quaternion)]
    length: Annotated[Positive, "m"]
    width: Annotated[Positive, "m"]
    spacing: Annotated[Positive, "m"] | None = None

    def __post_init__(self) -> None:
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
