"""Rigid soles: the robot's own, and one with the soft foot's footprint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from wbc.core.errors import finite_scalar, non_negative, positive
from wbc.feet.soles.foot import Foot, fitted_sole
from wbc.feet.soles.model import FootParts
from wbc.feet.soles.sole import FootFit, SoleGeometry, box_inertia

SOFT_LENGTH = 0.27782
"""Length of the soft foot, m: twice the 138.91 mm of the authors' public controller configuration."""

SOFT_WIDTH = 0.1045
"""Width of the soft foot, m: twice the 52.25 mm of the same file."""

SOFT_ANKLE_BEHIND = 0.030
"""Distance from the ankle forward to the centre of the soft sole, m (same file)."""


@dataclass(frozen=True)
class FlatFoot(Foot):
    """The robot's own sole: rigid, its rectangle and height, no mass of its own (the ankle link has it)."""

    def fit(self, sole: SoleGeometry) -> FootFit:
        """See `Foot.fit`."""
        return FootFit(sole, box_inertia(0.0, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)), 0.0, 0.0)

    def build(self, spec: Any, ankle_body: Any, side: str, sole: SoleGeometry) -> FootParts:
        """See `Foot.build`."""
        from wbc.feet.soles.rigid_mjcf import build_rigid  # noqa: PLC0415 - the pure part needs no MuJoCo

        return build_rigid(spec, ankle_body, side, self.fit(sole), self.contact, plate=None)


@dataclass(frozen=True)
class RigidFoot(Foot):
    """A rigid plate with the soft foot's footprint and mass: what a soft sole has to be compared with.

    Attributes:
        length: Extent along x, m.
        width: Extent along y, m.
        thickness: Height of the plate, m.
        ankle_behind: Distance from the ankle forward to the sole centre, m.
        ankle_height: Height of the ankle over the sole, m; None keeps the robot's own.
        mass: kg; the soft foot's, so that the two differ in compliance alone.
    """

    length: float = SOFT_LENGTH
    width: float = SOFT_WIDTH
    thickness: float = 0.014
    ankle_behind: float = SOFT_ANKLE_BEHIND
    ankle_height: float | None = None
    mass: float = 0.34

    def __post_init__(self) -> None:
        positive("foot length (m)", self.length)
        positive("foot width (m)", self.width)
        positive("plate thickness (m)", self.thickness)
        finite_scalar("ankle position behind the sole centre (m)", self.ankle_behind)
        non_negative("foot mass (kg)", self.mass)

    def fit(self, sole: SoleGeometry) -> FootFit:
        """See `Foot.fit`."""
        fitted = fitted_sole(
            sole,
            length=self.length,
            width=self.width,
            ankle_behind=self.ankle_behind,
            ankle_height=self.ankle_height,
            least_height=self.thickness,
        )
        plate = box_inertia(self.mass, self._plate(), (0.0, 0.0, self.thickness / 2.0))
        return FootFit(
            fitted, fitted.placement.act(plate), self.mass, float(fitted.ankle[2]) - float(sole.ankle[2])
        )

    def build(self, spec: Any, ankle_body: Any, side: str, sole: SoleGeometry) -> FootParts:
        """See `Foot.build`."""
        from wbc.feet.soles.rigid_mjcf import build_rigid  # noqa: PLC0415 - the pure part needs no MuJoCo

        return build_rigid(
            spec, ankle_body, side, self.fit(sole), self.contact, plate=(self.mass, self.thickness)
        )

    def _plate(self) -> tuple[float, float, float]:
        return (self.length, self.width, self.thickness)
