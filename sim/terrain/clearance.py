"""Foot clearance: a warning where the ground is higher than the swing foot is lifted."""

from __future__ import annotations

import warnings

from wbc.core.errors import non_negative
from wbc.sim.terrain.spec import Terrain


def check_clearance(terrain: Terrain, clearance: float) -> bool:
    """Return True if a foot whose sole is lifted by `clearance`, m, passes over the ground; warn where it does not.

    The obstacle of one step is the amplitude, or one riser. A negative clearance is an `InputError`.
    """
    height = non_negative("foot clearance (m)", clearance)
    rise = terrain.parameters.rise_at(terrain.amplitude)
    if rise <= height:
        return True
    warnings.warn(
        f"terrain '{terrain.name}' rises by {1e3 * rise:.3g} mm, more than the foot clearance of "
        f"{1e3 * height:.3g} mm: the swing foot will hit it; lift the foot higher or lower the amplitude",
        stacklevel=2,
    )
    return False
