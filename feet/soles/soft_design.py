"""`SoftDesign`: settings of the soft foot, and the places and inertias of its parts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import pinocchio as pin
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import Count, NonNegative, Number, Positive, settings
from wbc.feet.soles.foot import Foot, fitted_sole
from wbc.feet.soles.rigid import SOFT_ANKLE_BEHIND, SOFT_LENGTH, SOFT_WIDTH
from wbc.feet.soles.sole import AnkleSole, FootFit, bar_inertia, box_inertia

ARCH_WIDTH = 0.03
"""Width of the arches, m; for their inertia and picture alone, they touch nothing."""

ARCH_THICKNESS = 0.01
"""Thickness of the arches, m (as above)."""

CARRIED_MASS = 20.0
"""Mass that a sole carries, for its critical damping, kg: half of a robot of 40 kg."""

ROWS = 2
"""Rows of contact spheres under each phalanx. With one a standing robot simulates 1.2 to 1.6 times as fast, but the
ankle stands up to 1 mm lower on stones and hinge angles differ by up to 0.08 rad."""


@dataclass(frozen=True)
class SoftLayout:
    """Places and inertias of a soft foot's parts in sole axes, rest shape.

    Attributes:
        hinges: Hinge of each phalanx on its heel side, from the toe, m; the last one is on the backward arch.
    """

    pitch: float  # length of a phalanx, m
    centres: tuple[float, ...]  # of the phalanges along x, from toe to heel, m
    hinges: tuple[tuple[float, float, float], ...]
    ankle: tuple[float, float, float]  # in the plane of the arches, where the frontal arch is hinged, m
    loop_point: tuple[float, float, float]  # point of the sole that the frontal arch holds, m
    phalanges: tuple[pin.Inertia, ...]  # inertia of each phalanx, from the toe
    backward_arch: pin.Inertia
    frontal_arch: pin.Inertia


@settings
class SoftDesign(Foot):
    """Phalanges hinged about the transverse axis with a spring and a damper each, under a two-part arch.

    Phalanx 1 is the toe. The backward arch is fixed to the ankle and carries the heel phalanx on a hinge at its middle;
    the frontal arch is hinged at the ankle and holds the top of phalanx `loop_phalanx`, which closes the chain. The
    builder of the MuJoCo model reads a design; `SoftFoot` calls the builder.

    Attributes:
        stiffness: k of the sole hinges, Nm/rad.
        front_stiffness: k of the hinges in front of the phalanx that the frontal arch holds, Nm/rad: those of the toe,
            which the stiffness of a variable sole then leaves alone. None for that of all hinges.
        damping: b of the sole hinges, Nms/rad. Below k ≈ 10 Nm/rad a damper of 2 carries more torque than the spring
            during a step; the public SoftFoot model has 0.04.
        damping_ratio: b of the sole hinges as a ratio of the critical damping at each stiffness, in place of `damping`;
            see `damping_at`. None for the same b at any stiffness, as in the paper.
        phalanges: Number of phalanges.
        length: Extent along x, m.
        width: Extent along y, m.
        thickness: Height of the phalanges, m; twice the radius of the sole spheres.
        hinge_height: Height of the sole hinges over the sole, m.
        ankle_behind: Distance by which the ankle is behind the sole centre, m.
        ankle_height: Height of the ankle over the sole, m; None keeps the robot's own if it is high enough.
        arch_clearance: Smallest height of the ankle over the top of the phalanges, m.
        arch_stiffness: k of the frontal arch, Nm/rad.
        arch_damping: b of the frontal arch, Nms/rad.
        loop_phalanx: Phalanx, counted from the toe, that the frontal arch holds.
        phalanx_mass: Mass of one phalanx, kg.
        frontal_arch_mass: Mass of the frontal arch, kg.
        backward_arch_mass: Mass of the backward arch, kg.

    Source: k, b, arch, loop and ten phalanges from the paper, sections II-A and II-B; footprint and ankle position from
    the authors' public controller configuration; masses of the public SoftFoot model (IIT): 0.07 kg each arch,
    phalanges of 20 g (5–50 g make no difference); thickness and hinge positions chosen here.
    """

    stiffness: Annotated[NonNegative, "Nm/rad"] = 5.0
    front_stiffness: Annotated[NonNegative, "Nm/rad"] | None = None
    damping: Annotated[NonNegative, "Nms/rad"] = 2.0
    damping_ratio: Positive | None = None
    phalanges: Annotated[int, Field(ge=2, le=100)] = 10
    length: Annotated[Positive, "m"] = SOFT_LENGTH
    width: Annotated[Positive, "m"] = SOFT_WIDTH
    thickness: Annotated[Positive, "m"] = 0.014
    hinge_height: Annotated[NonNegative, "m"] = 0.007
    ankle_behind: Annotated[Number, "m"] = SOFT_ANKLE_BEHIND
    ankle_height: Annotated[Positive, "m"] | None = None
    arch_clearance: Annotated[NonNegative, "m"] = 0.02
    arch_stiffness: Annotated[NonNegative, "Nm/rad"] = 100.0
    arch_damping: Annotated[NonNegative, "Nms/rad"] = 80.0
    loop_phalanx: Count = 3
    phalanx_mass: Annotated[Positive, "kg"] = 0.02
    frontal_arch_mass: Annotated[Positive, "kg"] = 0.07
    backward_arch_mass: Annotated[NonNegative, "kg"] = 0.07

    def __post_init__(self) -> None:
        if self.hinge_height > self.thickness:
            raise InputError(
                f"hinge_height (m), the height of the sole hinges, must be at most the thickness, {self.thickness:g}, "
                f"got {self.hinge_height:g}"
            )
        if 2.0 * self.contact.radius > self.thickness + ROUNDING:
            raise InputError(
                f"sole spheres of radius {self.contact.radius:g} m do not fit into phalanges "
                f"{self.thickness:g} m thick"
            )
        if self.front_stiffness is not None and self.loop_phalanx == 1:
            raise InputError("a foot whose frontal arch holds the toe has no hinges for a front_stiffness")
        if self.loop_phalanx >= self.phalanges:
            raise InputError(
                f"loop_phalanx must be an integer in [1, {self.phalanges - 1}] (the heel phalanx cannot "
                f"close the loop), got {self.loop_phalanx}"
            )

    @property
    def front_hinges(self) -> int:
        """Number of hinges, from the toe, that have `front_stiffness`."""
        return 0 if self.front_stiffness is None else self.loop_phalanx - 1

    def damping_at(self, stiffness: float) -> float:
        """Return b of the sole hinges at a stiffness (Nm/rad), Nms/rad.

        With a damping ratio ζ it is 2 ζ √(k J), where J = m l² is the inertia of the carried mass about a hinge one
        phalanx away: the load moves by l times the angle of a hinge; the phalanges weigh next to nothing.
        """
        if self.damping_ratio is None:
            return self.damping
        inertia = CARRIED_MASS * (self.length / self.phalanges) ** 2
        return 2.0 * self.damping_ratio * math.sqrt(stiffness * inertia)

    @property
    def mass(self) -> float:
        """Mass of the whole foot, kg."""
        return self.phalanges * self.phalanx_mass + self.frontal_arch_mass + self.backward_arch_mass

    @checked
    def fit(self, sole: AnkleSole) -> FootFit:
        """Return the foot in place of the robot's own sole; see `Foot.fit`."""
        fitted = fitted_sole(
            sole,
            length=self.length,
            width=self.width,
            ankle_behind=self.ankle_behind,
            ankle_height=self.ankle_height,
            min_height=self.thickness + self.arch_clearance,
        )
        layout = self.layout(fitted)
        inertia = layout.backward_arch + layout.frontal_arch
        for phalanx in layout.phalanges:
            inertia += phalanx
        return FootFit(
            fitted, fitted.placement.act(inertia), self.mass, float(fitted.ankle[2]) - float(sole.ankle[2])
        )

    @checked
    def layout(self, fitted: AnkleSole) -> SoftLayout:
        """Return places and inertias of the parts in the rest shape, under a given ankle."""
        n, z = self.phalanges, self.hinge_height
        pitch = self.length / n
        centres = tuple(self.length / 2.0 - (i + 0.5) * pitch for i in range(n))
        hinges = tuple((self.length / 2.0 - (i + 1) * pitch, 0.0, z) for i in range(n - 1))
        heel = (centres[-1], 0.0, z)
        ankle = (float(fitted.ankle[0]), 0.0, float(fitted.ankle[2]))
        loop_point = (centres[self.loop_phalanx - 1], 0.0, self.thickness)
        size = (pitch, self.width, self.thickness)
        return SoftLayout(
            pitch=pitch,
            centres=centres,
            hinges=(*hinges, heel),
            ankle=ankle,
            loop_point=loop_point,
            phalanges=tuple(
                box_inertia(self.phalanx_mass, size, (x, 0.0, self.thickness / 2.0)) for x in centres
            ),
            backward_arch=bar_inertia(
                self.backward_arch_mass, ankle, heel, width=ARCH_WIDTH, thickness=ARCH_THICKNESS
            ),
            frontal_arch=bar_inertia(
                self.frontal_arch_mass, ankle, loop_point, width=ARCH_WIDTH, thickness=ARCH_THICKNESS
            ),
        )

    def contact_rows(self) -> Array:
        """Return the positions of the rows of contact spheres along x, from the toe, shape (rows,), m."""
        return self.contact.row_positions(self.length, ROWS * self.phalanges)
