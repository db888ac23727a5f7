"""Checks made before anything is built: is the grid fine enough, can a foot clear the ground."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING

from wbc.core.errors import InputError, non_negative, positive

if TYPE_CHECKING:
    from wbc.sim.terrain.spec import Terrain

SOLE_SPHERE_RADIUS = 0.007
"""Radius of the soft sole's contact spheres, m (half the height of its 14 mm phalanges)."""

CELLS_PER_FEATURE = 3
"""Cells needed across the smallest feature: fewer can miss the top of a stone or the bottom of a joint."""

MOST_NODES = 20_000_000
"""Largest height field, nodes: 80 MB in single precision."""


class ClearanceWarning(UserWarning):
    """The ground is higher than the swing foot is lifted."""


def needed_resolution(smallest_feature: float, sole_radius: float) -> float:
    """Return the widest cell a height field may have, m.

    A cell wider than the sole's spheres would show them facets instead of the ground, and a feature needs
    `CELLS_PER_FEATURE` cells to be met.

    Args:
        smallest_feature: Of the ground, m.
        sole_radius: Of the spheres under the sole, m.
    """
    return min(positive("sole sphere radius (m)", sole_radius), smallest_feature / CELLS_PER_FEATURE)


def usable_resolution(terrain: Terrain, resolution: float | None, sole_radius: float, own: float) -> float:
    """Choose the cell of a height field.

    Args:
        terrain: What is to be drawn.
        resolution: Cell asked for, m; None lets the ground decide.
        sole_radius: Of the spheres under the sole, m.
        own: The family's own cell, m.

    Returns:
        Greatest cell, m.

    Raises:
        InputError: The cell asked for is too coarse; the message names the one needed.
    """
    feature = terrain.parameters.feature_at(terrain.amplitude)
    needed = needed_resolution(feature, sole_radius)
    if resolution is None:
        # A whole number of cells per own cell keeps the samples of the family where they are.
        return own / max(1, math.ceil(own / needed - 1e-9)) if math.isfinite(own) else needed
    step = positive("terrain resolution (m)", resolution)
    if step > needed * (1.0 + 1e-9):
        raise InputError(
            f"resolution {step:g} m is too coarse for terrain '{terrain.name}': at most {needed:.3g} m is needed "
            f"(sole spheres of {sole_radius:g} m, smallest feature {feature:.3g} m in {CELLS_PER_FEATURE} cells)"
        )
    return step


def node_limit(terrain: Terrain, step: float) -> None:
    """Check that the height field stays within memory.

    Raises:
        InputError: Too many nodes.
    """
    across = 1.0 if terrain.parameters.unidirectional else terrain.width / step
    nodes = terrain.length / step * across
    if nodes > MOST_NODES:
        raise InputError(
            f"a height field of {terrain.length:g} m x {terrain.width:g} m in cells of {step:.3g} m has "
            f"{nodes:.3g} nodes; at most {MOST_NODES:.3g} are drawn: shorten the track or coarsen the family"
        )


def check_clearance(terrain: Terrain, clearance: float) -> bool:
    """Warn when a foot lifted by `clearance` cannot pass over the ground.

    Args:
        terrain: The ground.
        clearance: Height of the sole above its start level in mid swing, m.

    Returns:
        True if the foot passes.

    Warns:
        ClearanceWarning: What has to be stepped over, the amplitude or one riser, is higher than the clearance.
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
