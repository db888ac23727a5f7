"""Test rig: press, drop, slide and pitch one foot on any ground.

    >>> from wbc.feet import foot
    >>> from wbc.sim.rig import FootTest, press
    >>> from wbc.sim.terrain import terrain
    >>> test = FootTest(foot("soft", stiffness=5.0), terrain("stones", amplitude=0.03, seed=1), load=200.0)
    >>> press(test).hold.contacts
    4

This is what a designer of feet runs first: force balance, contact area, equivalent support polygon, sole
shape, loop gap, penetration and what is absorbed at impact, each run a pure function of a frozen `FootTest`.
"""

from __future__ import annotations

from wbc.sim.rig.actions import drop, pitch, press, slide
from wbc.sim.rig.plot import plot_curves, plot_pitch, plot_press
from wbc.sim.rig.results import Hold, Impact, PitchResult, PressResult, SlideResult, SupportPolygon, to_json
from wbc.sim.rig.spec import OWN_SOLE, FootTest
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
    "LOADS",
    "OWN_SOLE",
    "STIFFNESSES",
    "Deflection",
    "FootTest",
    "Hold",
    "Impact",
    "PitchResult",
    "PressResult",
    "SlideResult",
    "StabilityRow",
    "StiffnessRow",
    "SupportPolygon",
    "bumps",
    "deflection_table",
    "drop",
    "force_deflection",
    "over_bar",
    "pitch",
    "plot_curves",
    "plot_pitch",
    "plot_press",
    "press",
    "slide",
    "stability",
    "stability_table",
    "stiffness_curves",
    "stiffness_means",
    "stiffness_table",
    "to_json",
]
