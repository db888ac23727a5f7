"""Test rig: press, drop, slide and pitch one foot on any ground.

    >>> from wbc.feet import foot
    >>> from wbc.sim.rig import FootTest, press
    >>> from wbc.sim.terrain import terrain
    >>> test = FootTest(foot("soft", stiffness=5.0), terrain("stones", amplitude=0.03, seed=1), load=200.0)
    >>> press(test).hold.contacts
    4

For designers of feet: force balance, contact area, equivalent support polygon, sole shape, loop gap, penetration and
absorbed impact, each a pure function of a frozen `FootTest`. A new test goes into `actions.py`, its result into
`results.py`.
"""

from __future__ import annotations

from wbc.sim.rig.actions import drop, pitch, press, slide
from wbc.sim.rig.plot import plot_curves, plot_pitch, plot_press
from wbc.sim.rig.results import Hold, Impact, PitchResult, PressResult, SlideResult, SupportPolygon
from wbc.sim.rig.spec import HRP4C_SOLE, FootTest
from wbc.sim.rig.study import (
    LOADS,
    STIFFNESSES,
    Deflection,
    StabilityRow,
    StiffnessRow,
    bumps,
    force_deflection,
    over_bar,
    stability,
    stiffness_curves,
)
from wbc.sim.rig.tables import deflection_table, stability_table, stiffness_means, stiffness_table

__all__ = [
    # A test
    "FootTest",
    "HRP4C_SOLE",
    # Its actions
    "press",
    "drop",
    "slide",
    "pitch",
    # Their results
    "PressResult",
    "Impact",
    "Hold",
    "SupportPolygon",
    "SlideResult",
    "PitchResult",
    # Studies over stiffness, ground and physics step
    "stability",
    "stiffness_curves",
    "force_deflection",
    "StabilityRow",
    "StiffnessRow",
    "Deflection",
    "bumps",
    "over_bar",
    "STIFFNESSES",
    "LOADS",
    # Tables and pictures
    "stability_table",
    "stiffness_table",
    "stiffness_means",
    "deflection_table",
    "plot_press",
    "plot_pitch",
    "plot_curves",
]
