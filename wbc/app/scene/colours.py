"""Colours of the live view and of replays."""

from __future__ import annotations

import math

import numpy as np

from wbc.app.scene.shapes import Colour, Legend
from wbc.feet.soles.actuator import STIFFEST

PLAIN: Colour = (0.78, 0.80, 0.83, 1.0)
"""Colour of links without one."""

SKY_COLOURS = {"top_color": (0.95, 0.97, 1.0), "bottom_color": (0.82, 0.86, 0.90)}
"""Background at the top and at the bottom of the page."""

TILE_COLOURS = np.array([[0.80, 0.82, 0.83], [0.86, 0.875, 0.885]])
LOW_COLOUR, HIGH_COLOUR = np.array([0.40, 0.36, 0.33]), np.array([0.82, 0.77, 0.68])
"""Colours of the lowest and the highest point of a rough ground."""

COM_COLOUR: Colour = (0.95, 0.60, 0.10, 1.0)
ZMP_COLOUR: Colour = (0.75, 0.15, 0.75, 1.0)
DCM_COLOUR: Colour = (0.34, 0.71, 0.91, 1.0)
ARROW_COLOURS: dict[str, Colour] = {"ground": (0.10, 0.60, 0.25, 0.9), "push": (0.85, 0.15, 0.10, 0.9)}
SIDE_COLOURS: dict[str, Colour] = {"left": (0.0, 0.45, 0.70, 1.0), "right": (0.84, 0.37, 0.0, 1.0)}
SUPPORT_COLOUR: Colour = (0.0, 0.62, 0.45, 0.35)
OUTSIDE_COLOUR: Colour = (0.55, 0.25, 0.10, 0.9)
RAY_COLOUR: Colour = (0.90, 0.20, 0.20, 0.9)
SCAN_COLOUR: Colour = (0.95, 0.90, 0.25, 1.0)
SOFT_COLOUR: Colour = (0.35, 0.80, 0.85, 1.0)
STIFF_COLOUR: Colour = (0.50, 0.10, 0.45, 1.0)

LEGEND: Legend = (
    ("centre of mass and its shadow", COM_COLOUR),
    ("ZMP", ZMP_COLOUR),
    ("contact force, drawn up to 1.5 x weight", ARROW_COLOURS["ground"]),
    ("push", ARROW_COLOURS["push"]),
)
"""Legend of every scene."""

FOOTSTEP_LEGEND: Legend = tuple(
    (f"{side} footstep, planned and real", colour) for side, colour in SIDE_COLOURS.items()
)


def translucent(colour: Colour) -> Colour:
    """Return the colour of a filled area."""
    return (*colour[:3], 0.35)


def stiffness_colour(stiffness: float) -> Colour:
    """Return the colour of a sole, Nm/rad: from soft to stiff on a logarithmic scale."""
    share = min(1.0, math.log1p(max(0.0, stiffness)) / math.log1p(STIFFEST))
    red, green, blue, opacity = (
        round(a + share * (b - a), 4) for a, b in zip(SOFT_COLOUR, STIFF_COLOUR, strict=True)
    )
    return red, green, blue, opacity
