"""The scenes of inverse kinematics that every library of the comparison solves, stated once; standard library alone."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path


@dataclass(frozen=True)
class KinematicScene:
    """A hand on a circle: an arm that is bolted, or a humanoid on two feet with a task of its centre of mass."""

    robot: str
    """Name of the robot."""
    urdf: str
    """Robot description without any geometry, as XML text."""
    posture: dict[str, float]
    """Position of every joint at the start, rad; target of the posture task."""
    hand: str
    """Frame of the hand."""
    soles: tuple[str, ...] = ()
    """Frames of the soles; none of an arm."""
    base_height: float = 0.0
    """Height of the base at the start, m."""
    radius: float = 0.05
    """Radius of the circle, in the plane of y and z, m."""
    frequency: float = 0.5
    """Turns per second, Hz."""
    posture_cost: float = 1e-2
    """Cost per rad of the posture; the other tasks cost 1 per m and rad."""
    gain: float = 0.1
    """Share of the error that a step takes away."""
    period: float = 0.01
    """Period of a step, s."""
    warm_up: int = 300
    """Steps before the measured ones."""
    steps: int = 3000
    """Steps measured."""

    def save(self, path: Path) -> None:
        """Write the scene as JSON."""
        path.write_text(json.dumps(asdict(self)), encoding="utf-8")

    @classmethod
    def load(cls, path: Path) -> KinematicScene:
        """Read a scene written by `save`."""
        fields = json.loads(path.read_text(encoding="utf-8"))
        fields["soles"] = tuple(fields["soles"])
        return cls(**fields)

    def offset(self, step: int) -> tuple[float, float, float]:
        """Offset of the hand's target from its start, m."""
        angle = 2.0 * math.pi * self.frequency * self.period * step
        return 0.0, self.radius * math.sin(angle), self.radius * (math.cos(angle) - 1.0)
