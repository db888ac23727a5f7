"""Rigid soles: the robot's own, and one with the soft foot's footprint."""

from __future__ import annotations

from typing import Annotated, Any

import pinocchio as pin

from wbc.base.checked import checked
from wbc.base.settings import NonNegative, Number, Positive, settings
from wbc.feet.soles.foot import AnkleSole, Foot, FootFit, FootParts, box_inertia, fitted_sole

SOFT_LENGTH = 0.27782
"""Length of the soft foot, m: twice the 138.91 mm of the authors' public controller configuration."""

SOFT_WIDTH = 0.1045
"""Width of the soft foot, m: twice the 52.25 mm of the same file."""

SOFT_ANKLE_BEHIND = 0.030
"""Distance from the ankle forward to the centre of the soft sole, m (same file)."""


@settings
class FlatFoot(Foot):
    """The robot's own sole: rigid, with its rectangle and height; its mass is part of the ankle link."""

    @checked
    def fit(self, sole: AnkleSole) -> FootFit:
        """Return the foot in place of the robot's own sole; see `Foot.fit`."""
        return FootFit(sole, pin.Inertia.Zero())

    def build(self, spec: Any, ankle_body: Any, side: str, sole: AnkleSole) -> FootParts:
        """Add the foot to a MuJoCo model; see `Foot.build`."""
        from wbc.feet.soles.build_mjcf import build_rigid  # noqa: PLC0415 - only `build` needs MuJoCo

        return build_rigid(spec, ankle_body, side, self.fit(sole), self.contact, plate=None)


@settings
class RigidFoot(Foot):
    """A rigid plate with the soft foot's footprint and mass, the reference that soft soles are compared with.

    Attributes:
        length: Extent along x, m.
        width: Extent along y, m.
        thickness: Height of the plate, m.
        ankle_behind: Distance by which the ankle is behind the sole centre, m.
        ankle_height: Height of the ankle over the sole, m; None keeps the robot's own.
        mass: Mass of the plate, kg; by default the soft foot's, so that they differ in compliance alone.
    """

    length: Annotated[Positive, "m"] = SOFT_LENGTH
    width: Annotated[Positive, "m"] = SOFT_WIDTH
    thickness: Annotated[Positive, "m"] = 0.014
    ankle_behind: Annotated[Number, "m"] = SOFT_ANKLE_BEHIND
    ankle_height: Annotated[Positive, "m"] | None = None
    mass: Annotated[NonNegative, "kg"] = 0.34

    @checked
    def fit(self, sole: AnkleSole) -> FootFit:
        """Return the foot in place of the robot's own sole; see `Foot.fit`."""
        fitted = fitted_sole(
            sole,
            length=self.length,
            width=self.width,
            ankle_behind=self.ankle_behind,
            ankle_height=self.ankle_height,
            min_height=self.thickness,
        )
        size = self.length, self.width, self.thickness
        plate = box_inertia(self.mass, size, (0.0, 0.0, self.thickness / 2.0))
        return FootFit(fitted, fitted.placement.act(plate))

    def build(self, spec: Any, ankle_body: Any, side: str, sole: AnkleSole) -> FootParts:
        """Add the foot to a MuJoCo model; see `Foot.build`."""
        from wbc.feet.soles.build_mjcf import build_rigid  # noqa: PLC0415 - only `build` needs MuJoCo

        return build_rigid(
            spec, ankle_body, side, self.fit(sole), self.contact, plate=(self.mass, self.thickness)
        )
