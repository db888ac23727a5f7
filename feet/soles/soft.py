"""The paper's soft foot, passive or with a stiffness to set: a chain of phalanges under two arches."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import Count, NonNegative, Number, Positive, settings
from wbc.feet.soles.actuator import StiffnessActuator
from wbc.feet.soles.foot import AnkleSole, Foot, FootFit, FootParts, bar_inertia, box_inertia, fitted_sole
from wbc.feet.soles.rigid import SOFT_ANKLE_BEHIND, SOFT_LENGTH, SOFT_WIDTH

ARCH_WIDTH = 0.03
"""Width of the arches, m; for their inertia and picture alone, they touch nothing."""

ARCH_THICKNESS = 0.01
"""Thickness of the arches, m (as above)."""

VISUAL_GAP = 0.001
"""Distance between the drawn phalanges, m."""

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
class SoftFoot(Foot):
    """The soft foot of the paper: phalanges on springs under a two-part arch.

    Phalanx 1 is the toe. Its hinges turn about the transverse axis, with a spring and a damper each. The backward arch
    is fixed to the ankle and carries the heel phalanx on a hinge at its middle; the frontal arch is hinged at the ankle
    and holds the top of phalanx `loop_phalanx`, which closes the chain.

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
        return FootFit(fitted, fitted.placement.act(inertia))

    def build(self, spec: Any, ankle_body: Any, side: str, sole: AnkleSole) -> FootParts:
        """Add the foot to a MuJoCo model; see `Foot.build`.

        The tree runs ankle → foot body (backward arch, force sensor) → heel phalanx → … → toe, and foot body →
        frontal arch; a `connect` equality closes the arch onto the sole.
        """
        from wbc.feet.soles import build_mjcf as mjcf  # noqa: PLC0415 - only `build` needs MuJoCo

        fit = self.fit(sole)
        layout, contact = self.layout(fit.sole), self.contact
        root = mjcf.add_foot_body(spec, ankle_body, side, fit)
        mjcf.set_inertia(root, layout.backward_arch)
        mjcf.add_bar(
            root, mjcf.part(side, "backward_arch"), layout.ankle, layout.hinges[-1], ARCH_THICKNESS / 2.0
        )
        origins = np.array(layout.hinges)  # of the phalanges, from the toe
        bodies, hinges = [root] * self.phalanges, [""] * self.phalanges
        parent, parent_origin = root, np.zeros(3)
        size = (layout.pitch, self.width, self.thickness)
        drawn = (layout.pitch - VISUAL_GAP, self.width - VISUAL_GAP, self.thickness)
        for i in reversed(range(self.phalanges)):
            name = mjcf.part(side, f"phalanx_{i + 1}")
            stiffness = self.stiffness
            if i < self.front_hinges:
                assert self.front_stiffness is not None
                stiffness = self.front_stiffness
            bodies[i] = body = parent.add_body(name=name, pos=origins[i] - parent_origin)
            hinges[i] = mjcf.add_hinge(body, f"{name}_pitch", stiffness, self.damping_at(stiffness))
            centre = np.array([layout.centres[i], 0.0, self.thickness / 2.0]) - origins[i]
            mjcf.set_inertia(body, box_inertia(self.phalanx_mass, size, centre))
            mjcf.add_box(body, f"{name}_box", centre, drawn)
            parent, parent_origin = body, origins[i]
        geoms = []
        for row, x in enumerate(contact.row_positions(self.length, ROWS * self.phalanges)):
            i = row // ROWS
            for column, y in enumerate(contact.column_positions(self.width)):
                place = np.array([x, y, contact.radius]) - origins[i]
                name = mjcf.part(side, f"sole_{row + 1}_{column + 1}")
                geoms.append(mjcf.add_contact_sphere(bodies[i], name, place, contact))
        site = mjcf.add_range_site(
            bodies[0], side, np.array([layout.centres[0], 0.0, self.hinge_height]) - origins[0]
        )
        ankle, loop_point, held = np.array(layout.ankle), np.array(layout.loop_point), self.loop_phalanx - 1
        arch = root.add_body(name=mjcf.part(side, "frontal_arch"), pos=ankle)
        joint = mjcf.add_hinge(arch, mjcf.part(side, "arch_pitch"), self.arch_stiffness, self.arch_damping)
        mjcf.set_inertia(arch, pin.SE3(np.eye(3), -ankle).act(layout.frontal_arch))
        tip = loop_point - ankle
        mjcf.add_bar(arch, mjcf.part(side, "frontal_arch_bar"), (0.0, 0.0, 0.0), tip, ARCH_THICKNESS / 2.0)
        loop = mjcf.add_loop(spec, side, [(arch, tip), (bodies[held], loop_point - origins[held])])
        return mjcf.foot_parts(
            fit,
            root,
            side,
            site,
            geoms,
            sole_joints=tuple(hinges),
            variable_joints=tuple(hinges[self.front_hinges :]),
            arch_joint=joint,
            loop_sites=loop,
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
