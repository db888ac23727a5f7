"""The paper's soft foot: a chain of phalanges under two arches, passive or with a stiffness to set."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array, InputError, choose, finite_scalar, non_negative, positive
from wbc.feet.soles.actuator import StiffnessActuator
from wbc.feet.soles.contact import LOOP_CLOSURE, ConstraintLaw
from wbc.feet.soles.foot import Foot, fitted_sole
from wbc.feet.soles.model import FootParts
from wbc.feet.soles.rigid import SOFT_ANKLE_BEHIND, SOFT_LENGTH, SOFT_WIDTH
from wbc.feet.soles.sole import FootFit, SoleGeometry, bar_inertia, box_inertia

ARCH_WIDTH = 0.03
"""Width of the arches, m; they touch nothing, it only shapes their inertia and picture."""

ARCH_THICKNESS = 0.01
"""Thickness of the arches, m (as above)."""


@dataclass(frozen=True)
class TransverseBending:
    """Hinges about the longitudinal axis, which the paper's foot lacks.

    "twist" puts one between neighbouring phalanges; the heel phalanx stays fixed to the backward arch about
    this axis. "flaps" cuts every phalanx lengthwise into three strips and hinges the outer two onto the
    middle one. A standing robot runs 1.2 to 1.4 times slower with "twist" than with the plain sole, and 1.2 to
    3.5 times with "flaps".

    Attributes:
        kind: "twist" or "flaps".
        stiffness: Nm/rad per hinge; None takes the sole's own, and follows it where that is variable.
        damping: Nms/rad per hinge.
        hinge_share: Distance of the flaps' hinges from the middle, share of half the width.
    """

    kind: Literal["twist", "flaps"] = "twist"
    stiffness: float | None = None
    damping: float = 2.0
    hinge_share: float = 1.0 / 3.0

    def __post_init__(self) -> None:
        choose("kind of transverse bending", self.kind, ("twist", "flaps"))
        if self.stiffness is not None:
            non_negative("transverse stiffness (Nm/rad)", self.stiffness)
        non_negative("transverse damping (Nms/rad)", self.damping)
        finite_scalar("hinge share of the flaps", self.hinge_share, low=0.05, high=0.95)


@dataclass(frozen=True)
class SoftFoot(Foot):
    """Phalanges hinged about the transverse axis with a spring and a damper each, hung under a two-part arch.

    Phalanx 1 is the toe. The backward arch is fixed to the ankle and carries the heel phalanx on a hinge at
    its middle; the frontal arch is hinged at the ankle and holds the top of phalanx `loop_phalanx`, which
    closes the chain.

    Attributes:
        stiffness: k of the sole hinges, Nm/rad.
        damping: b of the sole hinges, Nms/rad. Below k ≈ 10 Nm/rad b = 2 carries more torque than the spring
            during a step; 0.04 is the value of the public SoftFoot model.
        phalanges: Number of phalanges.
        length: Extent along x, m.
        width: Extent along y, m.
        thickness: Height of the phalanges, m; twice the radius of the sole spheres.
        hinge_height: Height of the sole hinges over the sole, m.
        ankle_behind: Distance from the ankle forward to the sole centre, m.
        ankle_height: Height of the ankle over the sole, m; None keeps the robot's own where it is high
            enough.
        arch_clearance: Least height of the ankle over the top of the phalanges, m.
        arch_hinge: Hinge of the frontal arch forward of and above the ankle, m.
        arch_stiffness: k of the frontal arch, Nm/rad.
        arch_damping: b of the frontal arch, Nms/rad.
        loop: True if the frontal arch is closed onto the sole; without it the forefoot carries nothing.
        loop_phalanx: Phalanx, counted from the toe, that the frontal arch holds.
        loop_law: Constraint law of the closure.
        phalanx_mass: Of one phalanx, kg.
        frontal_arch_mass: kg.
        backward_arch_mass: kg.
        armature: Rotor-like inertia added to each sole hinge, kg m²; 0 with the `discrete` integrator, 1e-3
            makes `implicitfast` usable at 1 ms.
        transverse: Bending about the longitudinal axis, None as in the paper.
        encoders: True to measure the sole hinges.

    Source: k, b, arch, loop and ten phalanges from the paper, sections II-A and II-B; footprint and ankle
    position from the authors' public controller configuration; masses of the public SoftFoot model (IIT):
    0.07 kg each arch, phalanges of 20 g (5–50 g make no difference); thickness and hinge places chosen.
    """

    stiffness: float = 5.0
    damping: float = 2.0
    phalanges: int = 10
    length: float = SOFT_LENGTH
    width: float = SOFT_WIDTH
    thickness: float = 0.014
    hinge_height: float = 0.007
    ankle_behind: float = SOFT_ANKLE_BEHIND
    ankle_height: float | None = None
    arch_clearance: float = 0.02
    arch_hinge: tuple[float, float] = (0.0, 0.0)
    arch_stiffness: float = 100.0
    arch_damping: float = 80.0
    loop: bool = True
    loop_phalanx: int = 3
    loop_law: ConstraintLaw = field(default_factory=lambda: LOOP_CLOSURE)
    phalanx_mass: float = 0.02
    frontal_arch_mass: float = 0.07
    backward_arch_mass: float = 0.07
    armature: float = 0.0
    transverse: TransverseBending | None = None
    encoders: bool = False

    @property
    def rotation_stiffness(self) -> float:
        """Torque per angle between ankle and flat ground under a walking robot, Nm/rad.

        Source: measured with `wbc foot pitch --angle 1 --load 390`: 26 500 to 26 900 for hinges of 0.5 to 80 Nm/rad.
        The arches and the loop carry the torque, not the hinges.
        """
        return 26_700.0

    def __post_init__(self) -> None:
        non_negative("sole stiffness (Nm/rad)", self.stiffness)
        non_negative("sole damping (Nms/rad)", self.damping)
        if int(self.phalanges) != self.phalanges or self.phalanges < 2:
            raise InputError(f"phalanges must be an integer of at least 2, got {self.phalanges}")
        for name in ("length", "width", "thickness"):
            positive(f"foot {name} (m)", getattr(self, name))
        finite_scalar("height of the sole hinges (m)", self.hinge_height, low=0.0, high=self.thickness)
        if 2.0 * self.contact.radius > self.thickness + 1e-9:
            raise InputError(
                f"sole spheres of radius {self.contact.radius:g} m do not fit into phalanges "
                f"{self.thickness:g} m thick"
            )
        finite_scalar("ankle position behind the sole centre (m)", self.ankle_behind)
        non_negative("arch clearance (m)", self.arch_clearance)
        if len(self.arch_hinge) != 2:
            raise InputError(f"arch_hinge must be two numbers (forward, up) in m, got {self.arch_hinge!r}")
        for value in self.arch_hinge:
            finite_scalar("arch hinge offset (m)", value)
        non_negative("arch stiffness (Nm/rad)", self.arch_stiffness)
        non_negative("arch damping (Nms/rad)", self.arch_damping)
        if int(self.loop_phalanx) != self.loop_phalanx or not 1 <= self.loop_phalanx < self.phalanges:
            raise InputError(
                f"loop_phalanx must be an integer in [1, {self.phalanges - 1}] (the heel phalanx cannot "
                f"close the loop), got {self.loop_phalanx}"
            )
        positive("phalanx mass (kg)", self.phalanx_mass)
        positive("frontal arch mass (kg)", self.frontal_arch_mass)
        non_negative("backward arch mass (kg)", self.backward_arch_mass)
        non_negative("armature of the sole hinges (kg m2)", self.armature)

    @property
    def mass(self) -> float:
        """Mass of the whole foot, kg."""
        return self.phalanges * self.phalanx_mass + self.frontal_arch_mass + self.backward_arch_mass

    def fit(self, sole: SoleGeometry) -> FootFit:
        """See `Foot.fit`."""
        fitted = fitted_sole(
            sole,
            length=self.length,
            width=self.width,
            ankle_behind=self.ankle_behind,
            ankle_height=self.ankle_height,
            least_height=self.thickness + self.arch_clearance,
        )
        layout = self.layout(fitted)
        inertia = layout.backward_arch + layout.frontal_arch
        for phalanx in layout.phalanges:
            inertia += phalanx
        return FootFit(
            fitted, fitted.placement.act(inertia), self.mass, float(fitted.ankle[2]) - float(sole.ankle[2])
        )

    def layout(self, fitted: SoleGeometry) -> SoftLayout:
        """Where the parts of the foot lie in its rest shape, under a given ankle."""
        n, z = self.phalanges, self.hinge_height
        pitch = self.length / n
        centres = tuple(self.length / 2.0 - (i + 0.5) * pitch for i in range(n))
        hinges = tuple((self.length / 2.0 - (i + 1) * pitch, 0.0, z) for i in range(n - 1))
        heel = (centres[-1], 0.0, z)
        ankle = (float(fitted.ankle[0]), 0.0, float(fitted.ankle[2]))
        arch_hinge = (ankle[0] + self.arch_hinge[0], 0.0, ankle[2] + self.arch_hinge[1])
        loop_point = (centres[self.loop_phalanx - 1], 0.0, self.thickness)
        size = (pitch, self.width, self.thickness)
        return SoftLayout(
            pitch=pitch,
            centres=centres,
            hinges=(*hinges, heel),
            ankle=ankle,
            arch_hinge=arch_hinge,
            loop_point=loop_point,
            phalanges=tuple(
                box_inertia(self.phalanx_mass, size, (x, 0.0, self.thickness / 2.0)) for x in centres
            ),
            backward_arch=bar_inertia(
                self.backward_arch_mass, ankle, heel, width=ARCH_WIDTH, thickness=ARCH_THICKNESS
            ),
            frontal_arch=bar_inertia(
                self.frontal_arch_mass, arch_hinge, loop_point, width=ARCH_WIDTH, thickness=ARCH_THICKNESS
            ),
        )

    def contact_rows(self) -> Array:
        """Place along x of the rows of contact spheres, from the toe, m; `rows_per_phalanx` lie under each phalanx."""
        per_phalanx = self.contact.rows_per_phalanx
        if per_phalanx == 1:
            return np.array(
                [self.length / 2.0 - (i + 0.5) * self.length / self.phalanges for i in range(self.phalanges)]
            )
        return self.contact.row_positions(self.length, per_phalanx * self.phalanges)

    def build(self, spec: Any, ankle_body: Any, side: str, sole: SoleGeometry) -> FootParts:
        """See `Foot.build`."""
        from wbc.feet.soles.soft_mjcf import SoftFootBuilder  # noqa: PLC0415 - the pure part needs no MuJoCo

        return SoftFootBuilder(spec, ankle_body, side, self, self.fit(sole)).build()


@dataclass(frozen=True)
class LongArchFoot(SoftFoot):
    """The soft foot with an arch that reaches to the toe, so that no part of the sole hangs free before it.

    Between the ends of its arch the paper's foot follows the ground; the two phalanges before the point that the
    frontal arch holds bear only what their hinges bear. Here the toe itself is held. On a rig a tenth more of the sole
    and more is on the ground, at any stiffness, and walks over rough ground fall forward less often.

    Attributes:
        loop_phalanx: Phalanx, counted from the toe, that the frontal arch holds.
    """

    loop_phalanx: int = 1


@dataclass(frozen=True)
class VariableStiffnessFoot(SoftFoot):
    """The soft foot with an actuator that sets the stiffness of its sole while it is used.

    Attributes:
        stiffness: Stiffness that it starts with, Nm/rad; within the range of the actuator.
        actuator: How the actual stiffness follows the commanded one.
    """

    actuator: StiffnessActuator = field(default_factory=StiffnessActuator)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.actuator.check(self.stiffness)


@dataclass(frozen=True)
class SoftLayout:
    """Places and inertias of a soft foot's parts in sole axes, rest shape.

    Attributes:
        pitch: Length of a phalanx, m.
        centres: x of the phalanx centres from the toe to the heel, m.
        hinges: Hinge of each phalanx on the heel side, from the toe; the last is the heel's on the backward
            arch, m.
        ankle: Ankle in the plane of the arches, m.
        arch_hinge: Hinge of the frontal arch, m.
        loop_point: Where the frontal arch holds the sole, m.
        phalanges: Inertia of each phalanx, from the toe.
        backward_arch: Its inertia.
        frontal_arch: Its inertia.
    """

    pitch: float
    centres: tuple[float, ...]
    hinges: tuple[tuple[float, float, float], ...]
    ankle: tuple[float, float, float]
    arch_hinge: tuple[float, float, float]
    loop_point: tuple[float, float, float]
    phalanges: tuple[pin.Inertia, ...]
    backward_arch: pin.Inertia
    frontal_arch: pin.Inertia
