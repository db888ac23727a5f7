"""Foot clearance: a warning where the ground is higher than the swing foot is lifted."""

from __future__ import annotations

import warnings

from wbc.core.errors import non_negative
from wbc.sim.terrain.spec import Terrain


class ClearanceWarning(UserWarning):
    """The ground is higher than the swing foot is lifted."""


def check_clearance(terrain: Terrain, clearance: float) -> bool:
    """Warn when a foot lifted by `clearance` cannot pass over the ground.

    Args:
        terrain: The ground.
        clearance: Height of the sole above its start level in mid swing, m.

    Returns:
        True if the foot passes.

    Raises:
        InputError: A negative clearance.

    Warns:
        ClearanceWarning: The obstacle of one step, the amplitude or one riser, is higher than the clearance.
    """
    height = non_negative("foot clearance (m)", clearance)
    rise = terrain.parameters.rise_at(terrain.amplitude)
    if rise <= height:
        return True
    warnings.warn(
        f"terrain '{terrain.name}' rises by {1e3 * rise:.3g} mm, more than the foot clearance of "
        f"{1e3 * height:.3g} mm: the swing foot will hit it; lift the foot higher or lower the amplitude",
        ClearanceWarning,
        stacklevel=2,
    )
    return False
